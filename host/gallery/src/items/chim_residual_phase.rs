//! Residual video phase of a dechirped sweep: Chim 2018, (2.22) and (3.1).

use std::f64::consts::{PI, TAU};

use glam::DVec3;
use num_complex::{Complex32, Complex64};

use super::chim_radar::standing;
use super::chim_strip::band;
use crate::{Check, Context, Finding, Item, ItemError, NOT_GIVEN, Picture};
use subaperture_io::receive::{Deskewed, Skew};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::phase_history::PhaseHistory;
use subaperture_model::radar::{Pattern, Waveform};
use subaperture_plot::{Chart, Curve, Stroke, lines};
use subaperture_signal::phase::widen;
use subaperture_simulate::scene::Scene;
use subaperture_simulate::{Experiment, Pair, Scatterer};

pub(super) const ITEMS: [Item; 1] = [Item {
    id: "c-2-22",
    source: "Chim 2018, (2.22) and (3.1)",
    title: "The residual video phase of a de-chirped sweep",
    work: 0.26,
    reproduce: residual_phase,
}];

/// Sweep rate, hertz per second: 300 MHz in 100 us.
const CHIRP_HZ_S: f64 = 3e12;
/// Range steps of the scatterer, metres; the phase changes by less than half a cycle per step.
const STEP_M: f64 = 10.0;
const STEPS: u32 = 10;
/// Largest delay of the receiver, seconds.
const MAX_DELAY_S: f64 = 0.7e-6;

/// Dechirped sweep of one scatterer at `range_m`.
fn experiment(range_m: f64) -> Experiment {
    let radar_m = DVec3::new(0.0, -50.0, 0.0);
    let scatterer = Scatterer {
        position_m: radar_m + DVec3::Y * range_m,
        amplitude: Complex64::ONE,
    };
    let scene = Scene {
        points: vec![scatterer],
        ..Scene::default()
    };
    let waveform = Waveform::Fmcw {
        start_hz: 1.7e9,
        chirp_hz_s: CHIRP_HZ_S,
        sample_rate_hz: 5e6,
        num_samples: 500,
        mixer_delay_s: 0.0,
    };
    standing("sweep", waveform, Pattern::Isotropic, radar_m, scene)
}

/// Phase relative to `exp(-j 2 pi f tau)`, mean over the band, radians.
fn phase_rad(range_m: f64, skew: Skew) -> Result<f64, ItemError> {
    let unsuited = |error: String| ItemError::Measure(error);
    let experiment = experiment(range_m);
    let pair = Pair {
        transmitter: 0,
        receiver: 0,
    };
    let echoes = experiment
        .echoes(pair)
        .map_err(|e| unsuited(e.to_string()))?;
    let received =
        Deskewed::new(echoes, Some(MAX_DELAY_S), skew).map_err(|e| unsuited(e.to_string()))?;
    let band = band(&received)?;
    let mut samples = vec![Complex32::ZERO; band.count];
    received.read(0..1, &mut samples)?;
    let delay_s = 2.0 * range_m / SPEED_OF_LIGHT_M_S;
    let deramped = samples
        .iter()
        .enumerate()
        .map(|(k, &z)| widen(z) * Complex64::cis(TAU * (band.frequency_hz(k) * delay_s).fract()));
    Ok(deramped.sum::<Complex64>().arg())
}

/// Unwrapped residual phase over range, and the largest residual after removal.
fn measured_rad() -> Result<(Vec<(f64, f64)>, f64), ItemError> {
    let mut left = Vec::new();
    let mut removed_rad: f64 = 0.0;
    let mut unwrapped = 0.0;
    for i in 0..=STEPS {
        let range_m = STEP_M * f64::from(i).max(0.1);
        let phase = phase_rad(range_m, Skew::Left)?;
        unwrapped += (phase - unwrapped + PI).rem_euclid(TAU) - PI;
        left.push((range_m, unwrapped));
        removed_rad = removed_rad.max(phase_rad(range_m, Skew::Removed)?.abs());
    }
    Ok((left, removed_rad))
}

/// `pi a tau^2`.
fn closed(range_m: f64) -> f64 {
    let delay_s = 2.0 * range_m / SPEED_OF_LIGHT_M_S;
    PI * CHIRP_HZ_S * delay_s.powi(2)
}

/// Measured phase and (2.22).
fn chart(left: &[(f64, f64)]) -> Result<Vec<u8>, ItemError> {
    let (far_m, _) = left[left.len() - 1];
    let curve = |name: &str, points: Vec<(f64, f64)>, stroke: Stroke| Curve {
        name: name.to_owned(),
        points,
        stroke,
    };
    let of = |factor: f64| {
        (0..=100)
            .map(|i| f64::from(i) * far_m / 100.0)
            .map(|range_m| (range_m, factor * closed(range_m)))
            .collect::<Vec<_>>()
    };
    Ok(lines(&Chart {
        title: "Residual video phase of a sweep of 3 MHz/us".to_owned(),
        across_label: "range (m)".to_owned(),
        up_label: "phase (rad)".to_owned(),
        curves: vec![
            curve("measured", left.to_vec(), Stroke::Dots),
            curve("pi a tau^2", of(1.0), Stroke::Solid),
            curve("2 pi a tau^2, (2.22)", of(2.0), Stroke::Dashed),
        ],
        // Space for the legend.
        up: Some((-0.5, 11.0)),
        ..Chart::default()
    })?)
}

fn residual_phase(_: &Context) -> Result<Finding, ItemError> {
    let (left, removed_rad) = measured_rad()?;
    let (far_m, far_rad) = left[left.len() - 1];
    let off_rad = left
        .iter()
        .map(|&(range_m, phase)| (phase - closed(range_m)).abs())
        .fold(0.0, f64::max);
    let png = chart(&left)?;
    Ok(Finding {
        thesis: "An echo that is tau late beats at f = alpha tau, (2.23), and has the residual video phase exp(-j 2 \
                 pi alpha tau^2), (2.22), which (3.1) removes."
            .to_owned(),
        method: format!(
            "A sweep of 300 MHz in 100 us, a = 3e12 Hz/s, dechirped on receive, over one scatterer at up to \
             {far_m:.0} m. The phase relative to exp(-j 2 pi f tau) is measured with the residual video phase kept and \
             removed by the receive chain. Ours is positive, because our mixer conjugates the other factor. Scale: the \
             thesis gives formulas and no waveform; sweep and ranges are ours."
        ),
        checks: vec![
            Check::number(
                &format!("residual video phase at {far_m:.0} m, where the beat is at a tau: magnitude"),
                2.0 * closed(far_m),
                far_rad.abs(),
                0.05,
                2,
                "rad",
            ),
            Check::claim(
                "largest difference from pi a tau^2",
                NOT_GIVEN,
                format!("{off_rad:.1e} rad"),
                off_rad < 0.01,
            ),
            Check::claim(
                "largest residual after removal",
                "removed",
                format!("{removed_rad:.1e} rad"),
                removed_rad < 0.01,
            ),
        ],
        why: Some(
            "A phase of 2 pi alpha t^2, as (2.12) has it, sweeps at 2 alpha: the beat is at 2 alpha tau, not \
             alpha tau. With the rate a = 2 alpha, for which the beat is at a tau, (2.22) itself is pi a tau^2."
                .to_owned(),
        ),
        pictures: vec![Picture {
            name: "phase".to_owned(),
            caption: "Residual video phase against range".to_owned(),
            png,
        }],
    })
}
