//! Pictures of Chim 2018, Figs 7.8 and 7.9: range profiles, angles of arrival, and the track compared with the motor's.

use std::f64::consts::TAU;

use glam::DVec2;
use num_complex::{Complex32, Complex64};

use super::chim_strip::{Map, band, profiles};
use crate::{ItemError, Picture};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::Axis;
use subaperture_model::phase_history::{InMemory, PhaseHistory};
use subaperture_plot::{Chart, Curve, Stroke, lines, stacked};
use subaperture_signal::phase::{narrow, widen};
use subaperture_signal::window::Window;

/// Range interval of the profiles shown, metres.
const SHOWN_M: (f64, f64) = (0.5, 12.5);
/// Pulses and range bins per pixel.
const BLOCK: usize = 2;
const BINS: usize = 4;

/// Range profiles of the first channel (Fig. 7.8): pulses horizontally, range upwards.
pub(super) fn traces(history: &InMemory) -> Result<Picture, ItemError> {
    let band = band(history)?;
    let num_pulses = history.collection().pulses.len();
    let mut samples = vec![Complex32::ZERO; num_pulses * band.count];
    history.read(0..num_pulses, &mut samples)?;
    // Uncompensated phases, so that all pulses share one range axis.
    let pulses = &history.collection().pulses;
    for (pulse, row) in pulses.iter().zip(samples.chunks_exact_mut(band.count)) {
        for (k, z) in row.iter_mut().enumerate() {
            let turns = band.frequency_hz(k) * (pulse.reference_path_m / SPEED_OF_LIGHT_M_S);
            *z = narrow(widen(*z) * Complex64::cis(-TAU * turns.fract()));
        }
    }
    let (powers, ranges) = profiles(&samples, &band, Window::default(), 0.0, SHOWN_M);
    // Mean over several pulses and bins per pixel.
    let rows = ranges.count / BINS;
    let mean = |i: usize| {
        let (row, column) = (i / (num_pulses / BLOCK), i % (num_pulses / BLOCK));
        let cells = (0..BINS * BLOCK).map(|j| {
            let (bin, pulse) = (row * BINS + j % BINS, column * BLOCK + j / BINS);
            powers[pulse * ranges.count + bin]
        });
        cells.sum::<f32>() / (BINS * BLOCK) as f32
    };
    let by_range: Vec<f32> = (0..rows * (num_pulses / BLOCK)).map(mean).collect();
    let map = Map {
        name: "profiles",
        caption: "Range profiles of one channel (Fig. 7.8)",
        labels: ["pulse", "range (m)"],
        rows: Axis {
            start: ranges.start + 0.5 * (BINS - 1) as f64 * ranges.step,
            step: BINS as f64 * ranges.step,
            count: rows,
        },
        columns: Axis {
            start: 0.5 * (BLOCK - 1) as f64,
            step: BLOCK as f64,
            count: num_pulses / BLOCK,
        },
    };
    Ok(map.levels(&by_range)?)
}

fn curve(name: &str, points: impl Iterator<Item = (usize, f64)>, stroke: Stroke) -> Curve {
    Curve {
        name: name.to_owned(),
        points: points.map(|(n, value)| (n as f64, value)).collect(),
        stroke,
    }
}

/// Estimated track compared with the motor's (Fig. 7.9): azimuth and range along the array's axes against pulses.
pub(super) fn positions(places_m: &[DVec2], motor_m: &[f64]) -> Result<Picture, ItemError> {
    let chart = |title: &str, label: &str, of: &dyn Fn(&DVec2) -> f64, motor: &[f64]| {
        let found = places_m.iter().map(of).enumerate();
        let curves = vec![
            curve("by MPGA", found, Stroke::Solid),
            curve(
                "by the motor",
                motor.iter().copied().enumerate(),
                Stroke::Dashed,
            ),
        ];
        let all = curves.iter().flat_map(|curve| &curve.points);
        Chart {
            title: title.to_owned(),
            across_label: "pulse".to_owned(),
            up_label: label.to_owned(),
            up: Some(with_room(all.map(|point| point.1))),
            curves,
            ..Chart::default()
        }
    };
    let still = vec![0.0; motor_m.len()];
    let png = stacked(&[
        chart(
            "The radar's track (Fig. 7.9)",
            "azimuth (m)",
            &|at_m| at_m.x,
            motor_m,
        ),
        chart("", "range (mm)", &|at_m| 1e3 * at_m.y, &still),
    ])?;
    Ok(Picture {
        name: "track".to_owned(),
        caption: "Azimuth (upper) and range (lower) of the radar by its motor and by MPGA, along the array's own axes (Fig. 7.9)".to_owned(),
        png,
    })
}

/// Angles of arrival against pulses, degrees: estimated and true sines per named target.
pub(super) fn angles(
    names: &[String],
    estimates: &[Vec<(usize, f64)>],
    truth: &[Vec<f64>],
) -> Result<Picture, ItemError> {
    /// Angles of the room, with space for the legend.
    const UP_DEG: (f64, f64) = (-50.0, 50.0);
    let degrees = |sine: f64| sine.clamp(-1.0, 1.0).asin().to_degrees();
    let each = names.iter().zip(estimates);
    let mut curves: Vec<Curve> = each
        .map(|(name, sines)| {
            let points = sines.iter().map(|&(n, sine)| (n, degrees(sine)));
            curve(name, points, Stroke::Solid)
        })
        .collect();
    let truth = truth.iter().flat_map(|sines| {
        let all = sines.iter().enumerate();
        all.map(|(n, &sine)| (n, degrees(sine)))
            .chain([(0, f64::NAN)])
    });
    curves.push(curve("true", truth, Stroke::Dashed));
    let png = lines(&Chart {
        title: "Angles of arrival of the reflectors".to_owned(),
        across_label: "pulse".to_owned(),
        up_label: "angle of arrival (deg)".to_owned(),
        up: Some(UP_DEG),
        curves,
        ..Chart::default()
    })?;
    Ok(Picture {
        name: "angles".to_owned(),
        caption: "Angles of arrival of the four reflectors by the phase difference of both channels, pulse by pulse".to_owned(),
        png,
    })
}

/// Range of the values, with space for the legend above.
fn with_room(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let low = values.clone().fold(f64::INFINITY, f64::min);
    let high = values.fold(f64::NEG_INFINITY, f64::max);
    (low - 0.05 * (high - low), high + 0.2 * (high - low))
}

/// Azimuth errors.
pub(super) fn errors(pairs_m: &[f64], together_m: &[f64]) -> Result<Picture, ItemError> {
    let of = |all: &[f64]| {
        all.iter()
            .map(|m| 1e3 * m)
            .enumerate()
            .collect::<Vec<_>>()
            .into_iter()
    };
    let png = lines(&Chart {
        title: "Azimuth errors".to_owned(),
        across_label: "pulse".to_owned(),
        up_label: "error along the array (mm)".to_owned(),
        curves: vec![
            curve("MPGA from pulse to pulse", of(pairs_m), Stroke::Solid),
            curve(
                "all poses and places together",
                of(together_m),
                Stroke::Solid,
            ),
        ],
        up: Some(with_room(pairs_m.iter().chain(together_m).map(|m| 1e3 * m))),
        ..Chart::default()
    })?;
    Ok(Picture {
        name: "errors".to_owned(),
        caption: "Errors in azimuth of both tracks".to_owned(),
        png,
    })
}
