//! Radar on a software-defined radio (Chim 2018, 5.4 to 5.6), with a simulated radio that has the faults of an AD9361.

use std::f64::consts::TAU;
use std::ops::Range;
use std::sync::atomic::AtomicBool;

use num_complex::Complex64;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_plot::{Chart, Curve, Stroke, lines};
use subaperture_radio::live::LiveBurst;
use subaperture_radio::plan;
use subaperture_radio::profile::{Calibration, Profile, Sweep};
use subaperture_radio::simulated::{Analogue, Coupled, SimulatedRadio, Wiring};
use subaperture_radio::tone::Tone;
use subaperture_radio::{Burst, Configuration, RadioError, Ranges, Sample, Side, Transceiver};
use subaperture_radio::{capture, chirp};
use subaperture_signal::window::Window;
use subaperture_simulate::Experiment;

use super::chim_stepped::{LASER_M, RANGES_M, experiment, three_ranges};
use crate::{Check, Context, Finding, Item, ItemError, NOT_GIVEN, Picture};

pub(super) const CHIRP: [Item; 1] = [Item {
    id: "c-5-8",
    source: "Chim 2018, 5.4, Fig. 5.8 and 5.9",
    title: "A chirp radar on a software-defined radio",
    work: 0.05,
    reproduce: chirps,
}];

pub(super) const STEPPED: [Item; 1] = [Item {
    id: "c-5-13-radio",
    source: "Chim 2018, 5.5, 5.6 and Fig. 5.13",
    title: "The same profile through the radio, with the reference and without",
    work: 0.3,
    reproduce: stepped,
}];

/// Delays of loop and antenna cables, seconds; direct leakage between the antennas.
const LOOP_S: f64 = 15e-9;
const CABLES_S: f64 = 20e-9;
const LEAKAGE: Coupled = Coupled {
    delay_s: 0.5e-9,
    amplitude: 3.0,
};
/// Largest range evaluated, metres; there are no reflectors beyond the far wall.
pub(super) const REACH_M: f64 = 25.0;

pub(super) fn failed(error: &impl ToString) -> ItemError {
    ItemError::Measure(error.to_string())
}

fn configuration(rate_hz: f64) -> Configuration {
    Configuration {
        master_clock_hz: rate_hz.max(16e6),
        sample_rate_hz: rate_hz,
        bandwidth_hz: rate_hz,
        transmit_gain_db: 60.0,
        receive_gain_db: [40.0; 2],
        transmit_antenna: "TX/RX".to_owned(),
        receive_antennas: ["RX2".to_owned(), "RX2".to_owned()],
        clock: Default::default(),
        pps: Default::default(),
    }
}

/// Stepped plan: 1.1 to 1.3 GHz in 50 steps, a tone of 125 kHz in bursts of a millisecond.
pub(super) fn steps() -> plan::Plan {
    plan::Plan {
        name: "C 5.6".to_owned(),
        start_hz: 1.1e9,
        stop_hz: 1.3e9,
        steps: 50,
        avoid: Vec::new(),
        order: plan::Order::Up,
        seed: 0,
        dwell_s: 1e-3,
        tone_hz: 125e3,
        amplitude: 0.7,
        sweeps: 1,
        pri_s: 0.0,
        lead_s: 1e-3,
        steady: 0.02,
        bursts: 8,
        reference: Default::default(),
        antennas: None,
        radio: configuration(1e6),
    }
}

fn radio(experiment: &Experiment) -> Result<SimulatedRadio<'_>, RadioError> {
    let wiring = Wiring::loopback(LOOP_S, CABLES_S, Some(LEAKAGE));
    SimulatedRadio::new(experiment, wiring, Analogue::b210())
}

/// Sweep with and without loop reference, and the number of bursts until the synthesisers settled. Each burst whose reference
/// is steady is passed to `accepted`: its step, the samples of reference and echo, and the lost ones.
pub(super) fn sweep(
    experiment: &Experiment,
    plan: &plan::Plan,
    mut accepted: impl FnMut(usize, &[Vec<Sample>; 2], &[Range<usize>]),
) -> Result<([Sweep; 2], u32), RadioError> {
    let mut radio = radio(experiment)?;
    plan.check(&radio.about().ranges)?;
    radio.configure(&plan.radio)?;
    let tone = Tone::new(plan.period(), plan.radio.sample_rate_hz);
    let waveform = tone.waveform(plan.amplitude);
    let empty = || Sweep {
        start_hz: plan.start_hz + plan.tone_hz,
        step_hz: plan.step_hz(),
        values: vec![None; plan.steps],
        times_s: vec![0.0; plan.steps],
    };
    let (mut sweeps, mut all) = ([empty(), empty()], 0);
    let mut channels = [0, 1].map(|_| vec![Sample::ZERO; plan.samples()]);
    for step in plan.carriers(0) {
        for side in [Side::Transmit, Side::Receive] {
            radio.tune(side, plan.carrier_hz(step), None)?;
        }
        for _ in 0..plan.bursts {
            let burst = Burst {
                waveform: &waveform,
                at_s: radio.now_s()? + plan.lead_s,
            };
            let [reference, echo] = &mut channels;
            let received = radio.burst(&burst, [reference, echo])?;
            all += 1;
            let mixed = tone.mix([&channels[0], &channels[1]], &received.lost);
            if let Some(mixed) = mixed.filter(|mixed| mixed.unsteady <= plan.steady) {
                sweeps[0].values[step] = Some(mixed.value);
                sweeps[1].values[step] = Some(mixed.unreferred);
                accepted(step, &channels, &received.lost);
                break;
            }
        }
    }
    Ok((sweeps, all))
}

/// Calibration from a sky measurement and a reflector alone at the corner's position.
fn calibration(plan: &plan::Plan) -> Result<Calibration, ItemError> {
    let lone = experiment(false);
    let mut sky = lone.clone();
    sky.scene = Default::default();
    let radio = radio(&lone).map_err(|error| failed(&error))?;
    let setup = capture::setup(radio.about(), plan, &plan.radio);
    let of = |experiment: &Experiment| {
        sweep(experiment, plan, |_, _, _| {}).map_err(|error| failed(&error))
    };
    let ([sky, _], _) = of(&sky)?;
    let ([reflector, _], _) = of(&lone)?;
    Calibration::measure("", &setup, &sky, &reflector, &[RANGES_M[1]], 2.0)
        .map_err(|error| failed(&error))
}

/// Levels relative to the largest, dB.
fn points_db(profile: &Profile) -> Vec<(f64, f64)> {
    let top = profile.values.iter().map(|z| z.norm()).fold(0.0, f64::max);
    let points = profile.values.iter().enumerate();
    points
        .map(|(i, z)| {
            let level = (z.norm() / top).max(1e-6);
            (i as f64 * profile.spacing_m, 20.0 * level.log10())
        })
        .collect()
}

fn stepped(_: &Context) -> Result<Finding, ItemError> {
    let plan = steps();
    let calibration = calibration(&plan)?;
    let scene = experiment(true);
    let ([with, without], bursts) =
        sweep(&scene, &plan, |_, _, _| {}).map_err(|error| failed(&error))?;
    let profile = |sweep: &Sweep| {
        sweep
            .profile(Window::Hamming, 24, REACH_M)
            .map_err(|error| failed(&error))
    };
    let clean = calibration
        .apply(&calibration.setup, &with)
        .map_err(|error| failed(&error))?;
    let ranges = three_ranges(&clean, REACH_M).map_err(|error| failed(&error))?;
    let (clean, raw, alone) = (profile(&clean)?, profile(&with)?, profile(&without)?);
    let mut checks = vec![
        Check::printed(
            "range resolution, c / 2B",
            "0.75",
            plan.resolution_m(),
            3,
            "m",
        ),
        Check::printed(
            "largest range, c / (2 4 MHz)",
            "37.47",
            plan.unambiguous_m(),
            3,
            "m",
        ),
    ];
    checks.extend(ranges);
    let why = Finding::unless_all_agree(
        &checks,
        "The walls have a width, and the part nearest to the radar is not where the thesis's laser pointed.",
    );
    let [with, without] = [&raw, &alone].map(Profile::contrast);
    checks.push(Check::claim(
        "largest over mean magnitude, before calibration: with the reference, without",
        "the reference removes the phases of each retune",
        format!("{with:.1}, {without:.1}"),
        with > 2.0 * without,
    ));
    let curve = |name: &str, profile: &Profile, stroke| Curve {
        name: name.to_owned(),
        points: points_db(profile),
        stroke,
    };
    let chart = Chart {
        title: "50 carriers from 1.1 to 1.3 GHz, by a simulated B210".to_owned(),
        across_label: "range (m)".to_owned(),
        up_label: "level (dB)".to_owned(),
        curves: vec![
            curve("by the reference, calibrated", &clean, Stroke::Solid),
            curve("without the reference", &alone, Stroke::Dashed),
        ],
        marks: RANGES_M.to_vec(),
        up: Some((-60.0, 5.0)),
        ..Chart::default()
    };
    Ok(Finding {
        thesis: "A B210 sends a tone at 50 carriers from 1.1 to 1.3 GHz; each retune has a phase of its own and an offset of frequency, which a looped-back copy on the second receiver removes \
                 (5.4 to 5.11). The profile peaks at walls at 1 and 16 m and at a corner reflector at 6.3 m."
            .to_owned(),
        method: format!(
            "The scene of c-5-13 seen by a simulated radio: a random phase at each retune, up to 200 Hz of frequency offset on each side, a transient of 1.5 ms, DC offset, image band, 12 bits, leakage between the antennas of three times the \
             echo of 1 m2. Each step is repeated until its reference is steady: {bursts} bursts for 50 steps. Calibrated by one capture of the sky and one of the corner alone; Hamming window. Scaled down: three objects instead of all that \
             Fig. 5.12 shows, because the thesis gives the positions of these three alone; the carriers are the thesis's."
        ),
        checks,
        why,
        pictures: vec![Picture {
            name: "profile".to_owned(),
            caption: "Range profiles with and without the looped-back reference".to_owned(),
            png: lines(&chart)?,
        }],
    })
}

/// Chirp plan of C 5.4: 1.2 GHz, 20.48 MS/s; the thesis gives no chirp and no interval.
fn chirp_plan() -> chirp::Plan {
    chirp::Plan {
        name: "C 5.4".to_owned(),
        carrier_hz: 1.2e9,
        bandwidth_hz: 16e6,
        duration_s: 50e-6,
        interval_s: 200e-6,
        pulses: 8,
        bursts: 1,
        reach_m: 700.0,
        amplitude: 0.7,
        lead_s: 1e-3,
        radio: configuration(20.48e6),
    }
}

/// Response of the scene by a burst of chirps.
fn chirped(experiment: &Experiment) -> Result<Sweep, ItemError> {
    let wiring = Wiring::loopback(LOOP_S, LOOP_S, None);
    let radio = SimulatedRadio::new(experiment, wiring, Analogue::b210());
    let mut radio = radio.map_err(|error| failed(&error))?;
    let mut response = None;
    let mut keep = |burst: LiveBurst| response = Some(burst.response);
    let stop = AtomicBool::new(false);
    chirp::capture(&mut radio, &chirp_plan(), None, &mut keep, &stop)
        .map_err(|error| failed(&error))?;
    response.ok_or_else(|| ItemError::Measure("expected a burst of chirps".to_owned()))
}

fn chirps(_: &Context) -> Result<Finding, ItemError> {
    let plan = chirp_plan();
    plan.check(&Ranges::b210())
        .map_err(|error| failed(&error))?;
    let sweep = chirped(&experiment(false))?;
    let profile = sweep.profile(Window::None, 16, plan.reach_m);
    let profile = profile.map_err(|error| failed(&error))?;
    let scatterers = sweep.scatterers(20.0, plan.reach_m);
    let scatterers = scatterers.map_err(|error| failed(&error))?;
    let strongest = scatterers
        .iter()
        .max_by(|a, b| a.amplitude.norm().total_cmp(&b.amplitude.norm()));
    let Some(strongest) = strongest else {
        return Err(ItemError::Measure("expected an echo".to_owned()));
    };
    let (mut places, mut phases) = (Vec::new(), Vec::new());
    let (mut before, mut phase) = (None, 0.0);
    for (n, value) in sweep.values.iter().enumerate() {
        let Some(now) = value else { continue };
        phase += before.map_or(0.0, |before: Complex64| (now * before.conj()).arg());
        before = Some(*now);
        places.push(sweep.frequency_hz(n) - plan.carrier_hz);
        phases.push(phase);
    }
    let n = places.len() as f64;
    let mean_rad = phases.iter().sum::<f64>() / n;
    let slope = -2.0 * TAU * strongest.range_m / SPEED_OF_LIGHT_M_S;
    let pairs = || places.iter().zip(&phases);
    let off = pairs()
        .map(|(x, y)| (y - mean_rad - slope * x).powi(2))
        .sum::<f64>()
        / n;
    let top = profile.values.iter().map(|z| z.norm()).fold(0.0, f64::max);
    let shown = profile.values.iter().enumerate();
    let shown = shown.map(|(l, z)| {
        (
            l as f64 * profile.spacing_m,
            20.0 * (z.norm() / top).max(1e-6).log10(),
        )
    });
    let points = shown.take_while(|(range_m, _)| *range_m < 200.0);
    let amplitude = Chart {
        title: "A chirp of 16 MHz at 1.2 GHz, 20.48 MS/s".to_owned(),
        across_label: "range (m)".to_owned(),
        up_label: "level (dB)".to_owned(),
        curves: vec![Curve {
            name: "response of the scene".to_owned(),
            points: points.collect(),
            stroke: Stroke::Solid,
        }],
        marks: vec![RANGES_M[1]],
        across: Some((0.0, 200.0)),
        up: Some((-60.0, 5.0)),
        ..Chart::default()
    };
    let phase = Chart {
        title: "Phase of the response".to_owned(),
        across_label: "frequency about the carrier (MHz)".to_owned(),
        up_label: "phase (rad)".to_owned(),
        curves: vec![
            Curve {
                name: "echo over reference".to_owned(),
                points: places
                    .iter()
                    .map(|hz| hz / 1e6)
                    .zip(phases.iter().copied())
                    .collect(),
                stroke: Stroke::Solid,
            },
            Curve {
                name: "of a delay of 6.3 m".to_owned(),
                points: places
                    .iter()
                    .map(|hz| {
                        let turns = -2.0 * RANGES_M[1] / SPEED_OF_LIGHT_M_S * hz;
                        (hz / 1e6, mean_rad + TAU * turns)
                    })
                    .collect(),
                stroke: Stroke::Dashed,
            },
        ],
        ..Chart::default()
    };
    Ok(Finding {
        thesis: "A baseband chirp at 1.2 GHz and 20.48 MS/s; the received signal is multiplied by the conjugate of a copy of the transmitted one, in the frequency domain. The peak of the amplitude (Fig. 5.8) is at the \
                 echo's delay; Fig. 5.9 is the phase over frequency."
            .to_owned(),
        method: format!(
            "The corner reflector of c-5-13 at 6.3 m alone, seen by a simulated B210 with its faults; chirps of {:.0} MHz in {:.0} us every {:.0} us: {:.2} m of range resolution. \
             The spectrum of the echo is divided by that of the looped-back reference, over 0.8 of the bandwidth and {} pulses; a matched filter of the computed chirp would leave its Fresnel ripple in the \
             phase. Scaled down: one reflector, because 5.4 describes no scene; it gives no bandwidth, duration or pulse interval either.",
            plan.bandwidth_hz / 1e6,
            plan.duration_s * 1e6,
            plan.interval_s * 1e6,
            plan.resolution_m(),
            plan.pulses - 1
        ),
        checks: vec![
            Check::claim(
                "range by the slope of the phase, 6.300 m simulated",
                NOT_GIVEN,
                format!("{:.3} m", strongest.range_m),
                (strongest.range_m - RANGES_M[1]).abs() < LASER_M,
            ),
            Check::claim(
                "deviation of the phase from a straight line over 0.8 of the band, RMS",
                "a delay alone",
                format!("{:.3} rad", off.sqrt()),
                off.sqrt() < 0.05,
            ),
        ],
        why: None,
        pictures: vec![
            Picture {
                name: "amplitude".to_owned(),
                caption: "Amplitude over range".to_owned(),
                png: lines(&amplitude)?,
            },
            Picture {
                name: "phase".to_owned(),
                caption: "Phase over frequency".to_owned(),
                png: lines(&phase)?,
            },
        ],
    })
}
