//! Range profile of a simulated radio by the embedded module (Chim 2018, 5.5 and 5.6).

use std::f64::consts::TAU;
use std::iter;
use std::time::Duration;

use num_complex::{Complex32, Complex64};
use subaperture_core::sweep::{Profiler, Setup};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::monitor::Silent;
use subaperture_model::phase_history::ReadError;
use subaperture_module::link::{
    self, Buffers, Firmware, ModuleAddress, ProfileRun, Session, Settings, SweepBurst, SweepSource,
};
use subaperture_plot::{Chart, Curve, Stroke, lines};
use subaperture_radio::plan::Plan;
use subaperture_radio::profile::Sweep;
use subaperture_signal::phase::cis;
use subaperture_signal::window::Window;

use super::chim_radio::{REACH_M, failed, steps, sweep};
use super::chim_stepped::{RANGES_M, experiment};
use crate::{Check, Context, Finding, Item, ItemError, NOT_GIVEN, Picture};

pub(super) const MODULE: [Item; 1] = [Item {
    id: "c-5-13-module",
    source: "Chim 2018, 5.5, 5.6 and Fig. 5.13",
    title: "The same profile by the embedded module",
    work: 0.2,
    reproduce: by_the_module,
}];

/// Samples of a period of the tone, carriers, and bins of the profile.
const PERIOD: usize = 8;
const CARRIERS: usize = 50;
const BINS: usize = 128;

/// Longest time for an answer of the emulated module.
const EMULATOR_LIMIT: Duration = Duration::from_secs(60);

/// Bursts of one sweep.
struct OneSweep(Vec<SweepBurst>);

impl SweepSource for OneSweep {
    fn has(&mut self, sweep: u32) -> Result<bool, ReadError> {
        Ok(sweep == 0)
    }

    fn burst(&mut self, _: u32, index: usize, burst: &mut SweepBurst) -> Result<bool, ReadError> {
        let Some(next) = self.0.get(index) else {
            return Ok(false);
        };
        burst.clone_from(next);
        Ok(true)
    }
}

fn setup(plan: &Plan) -> Setup {
    Setup {
        carriers: CARRIERS as u16,
        period: PERIOD as u16,
        samples: plan.samples() as u32,
        bins: BINS as u16,
        start_hz: plan.start_hz + plan.tone_hz,
        step_hz: plan.step_hz(),
    }
}

/// Profile by the firmware under emulation, and the ratio of the bytes from the module to those to it. `None` without an
/// emulator or a firmware.
fn emulated(
    setup: Setup,
    weights: &[f32],
    bursts: &[SweepBurst],
) -> Result<Option<(Vec<Complex32>, f64)>, ItemError> {
    let place = ModuleAddress::Emulate(Firmware::Float);
    let Ok(mut line) = link::open(&place, None, false) else {
        return Ok(None);
    };
    let mut buffers = Buffers::new();
    // The emulator's line loses no bytes. A repeated request would only be answered twice by a slow emulator.
    let settings = Settings {
        answer: EMULATOR_LIMIT,
        idle: EMULATOR_LIMIT,
        ..Settings::default()
    };
    let mut session = Session::open(&mut *line, &mut buffers, settings, &mut Silent)
        .map_err(|error| failed(&error))?;
    let mut source = OneSweep(bursts.to_vec());
    let mut run = ProfileRun {
        setup,
        weights,
        source: &mut source,
    };
    let mut received = Vec::new();
    let result = session.profiles(
        &mut run,
        &mut |profile| received = profile.values,
        &mut Silent,
    );
    result.ending.map_err(|error| failed(&error))?;
    Ok(Some((received, session.counts().down_up_ratio())))
}

/// Profile by the module's core on this computer, which gives the same bits.
fn by_core(
    setup: &Setup,
    weights: &[f32],
    bursts: &[SweepBurst],
) -> Result<Vec<Complex32>, ItemError> {
    let mut profiler = Box::new(Profiler::<PERIOD, CARRIERS, BINS>::new());
    profiler.configure(setup).map_err(|error| failed(&error))?;
    let weights = weights.iter().copied();
    profiler
        .set_weights(0, weights)
        .map_err(|error| failed(&error))?;
    profiler.start(0);
    for burst in bursts {
        // The received pieces between the lost ones.
        let mut first = 0;
        let end = burst.samples.len();
        for lost in burst.lost.iter().cloned().chain(iter::once(end..end)) {
            if lost.start > first {
                let samples = burst.samples[first..lost.start].iter().copied();
                profiler
                    .push(0, burst.carrier, first as u32, samples)
                    .map_err(|error| failed(&error))?;
            }
            first = lost.end;
        }
    }
    let profile = profiler.finish(0).map_err(|error| failed(&error))?;
    Ok(profile.values.to_vec())
}

/// The defining sum of a profile over the carriers in float64, at bin `l`.
fn defining_sum(setup: &Setup, weights: &[f64], sweep: &Sweep, l: usize) -> Complex64 {
    let range_m = l as f64 * SPEED_OF_LIGHT_M_S / (2.0 * BINS as f64 * setup.step_hz);
    let carriers = sweep.values.iter().zip(weights).enumerate();
    carriers
        .filter_map(|(n, (value, weight))| {
            let hz = setup.start_hz + n as f64 * setup.step_hz;
            let phase = TAU * hz * 2.0 * range_m / SPEED_OF_LIGHT_M_S;
            Some(value.as_ref()? * cis(phase) * *weight)
        })
        .sum()
}

fn by_the_module(_: &Context) -> Result<Finding, ItemError> {
    let plan = steps();
    let scene = experiment(true);
    let ([host, _], bursts) = {
        let mut bursts = Vec::new();
        let (sweeps, _) = sweep(&scene, &plan, |step, [reference, echo], lost| {
            let pairs = reference.iter().zip(echo);
            bursts.push(SweepBurst {
                carrier: step as u16,
                samples: pairs.map(|(reference, echo)| [*reference, *echo]).collect(),
                lost: lost.to_vec(),
            });
        })
        .map_err(|error| failed(&error))?;
        (sweeps, bursts)
    };
    let setup = setup(&plan);
    let weights = Window::Hamming.weights(CARRIERS);
    let weights32: Vec<f32> = weights.iter().map(|weight| *weight as f32).collect();
    let core = by_core(&setup, &weights32, &bursts)?;
    let emulated = emulated(setup, &weights32, &bursts)?;
    let exact: Vec<Complex64> = (0..BINS)
        .map(|l| defining_sum(&setup, &weights, &host, l))
        .collect();
    let differences = core.iter().zip(&exact);
    let power: f64 = differences
        .map(|(own, exact)| {
            let own = Complex64::new(own.re.into(), own.im.into());
            (own - exact).norm_sqr()
        })
        .sum();
    let whole: f64 = exact.iter().map(Complex64::norm_sqr).sum();
    let error_db = 10.0 * (power / whole).log10();
    let (identical, ratio, machine) = match &emulated {
        Some((values, ratio)) => (
            values == &core,
            *ratio,
            "The firmware under emulation received the samples over its serial line.",
        ),
        None => (
            true,
            8.0 * BINS as f64 / (8.0 * plan.samples() as f64 * bursts.len() as f64),
            "Without an emulator (qemu-system-arm) and a firmware (cargo xtask module) the module's core ran on this \
             computer, and the ratio counts samples and values alone.",
        ),
    };
    let top = core.iter().map(|z| z.norm()).fold(0.0, f32::max);
    let spacing_m = plan.unambiguous_m() / BINS as f64;
    let level = |magnitude: f64| 20.0 * (magnitude / f64::from(top)).max(1e-6).log10();
    let points = |magnitudes: Vec<f64>| {
        let all = magnitudes.into_iter().enumerate();
        all.map(|(l, magnitude)| (l as f64 * spacing_m, level(magnitude)))
            .take_while(|(range_m, _)| *range_m < REACH_M)
            .collect()
    };
    let chart = Chart {
        title: "50 carriers from 1.1 to 1.3 GHz, profile by the module".to_owned(),
        across_label: "range (m)".to_owned(),
        up_label: "level (dB)".to_owned(),
        curves: vec![
            Curve {
                name: "module, float32".to_owned(),
                points: points(core.iter().map(|z| f64::from(z.norm())).collect()),
                stroke: Stroke::Solid,
            },
            Curve {
                name: "host, float64".to_owned(),
                points: points(exact.iter().map(|z| z.norm()).collect()),
                stroke: Stroke::Dashed,
            },
        ],
        marks: RANGES_M.to_vec(),
        up: Some((-60.0, 5.0)),
        ..Chart::default()
    };
    Ok(Finding {
        thesis: "The profiles of 5.5 and 5.6 are computed on a computer from the recorded samples; a module is not part of the thesis."
            .to_owned(),
        method: format!(
            "The capture of c-5-13-radio, not calibrated, Hamming window: each accepted burst is sent to the module, which divides the echo by the reference, applies the window and transforms. {machine} \
             Scaled down: as c-5-13-radio. subap capture does the same during a capture and keeps a waterfall of the sweeps up to date."
        ),
        checks: vec![
            Check::claim(
                "module - host, RMS over RMS",
                NOT_GIVEN,
                format!("{error_db:.1} dB"),
                error_db < -100.0,
            ),
            Check::claim(
                "values bit-identical to the core on this computer",
                NOT_GIVEN,
                if identical { "yes" } else { "no" }.to_owned(),
                identical,
            ),
            Check::claim(
                "bytes from the module for each byte to it",
                NOT_GIVEN,
                format!("{ratio:.4}"),
                ratio < 0.01,
            ),
        ],
        why: None,
        pictures: vec![Picture {
            name: "profile".to_owned(),
            caption: "Range profile by the module and by the host; objects at the marks, behind the delay of the cables".to_owned(),
            png: lines(&chart)?,
        }],
    })
}
