//! Ten scatterers seen from a given track, for comparisons of image formers.

use std::f64::consts::TAU;

use glam::DVec3;
use num_complex::Complex64;
use subaperture::geometry::SceneFrame;
use subaperture::phase_history::{Collection, Pulse, Sweep};
use subaperture::simulate::{PointTargetHistory, Scatterer};

/// A recording of ten scatterers within `extent_m` of the origin. The track gives transmitter and receiver by pulse number, 0 in the
/// middle; the band is start, step (Hz) and number of samples.
pub(crate) fn scene(
    num_pulses: usize,
    (start_hz, step_hz, num_samples): (f64, f64, usize),
    antennas: impl Fn(f64) -> (DVec3, DVec3),
    extent_m: f64,
) -> PointTargetHistory {
    let pulses = (0..num_pulses)
        .map(|n| {
            let (transmitter_m, receiver_m) = antennas(n as f64 - num_pulses as f64 / 2.0);
            Pulse {
                time_s: n as f64,
                transmitter_m,
                receiver_m,
                reference_m: DVec3::ZERO,
                reference_path_m: transmitter_m.length() + receiver_m.length(),
                start_hz,
                step_hz,
                sweep: Sweep::AT_ONCE,
                // The sum is defined at all places.
                recorded_path_m: Some([0.0, 1e12]),
            }
        })
        .collect();
    let collection = Collection {
        name: "scene".to_owned(),
        num_samples,
        pulses,
        frame: SceneFrame::Local,
        extent: None,
        timed: true,
    };
    let scatterers = (0..10)
        .map(|i| {
            // Golden-ratio positions: evenly spread without a lattice.
            let turn = f64::from(i) * 0.618_034;
            let radius = extent_m * (f64::from(i) / 10.0).sqrt();
            Scatterer {
                position_m: DVec3::new(
                    radius * (turn * TAU).cos(),
                    radius * (turn * TAU).sin(),
                    0.0,
                ),
                amplitude: Complex64::cis(f64::from(i)),
            }
        })
        .collect();
    PointTargetHistory::new(collection, scatterers, None)
}

/// A reproducible number in [-1, 1) for pulse `n`.
pub(crate) fn noise(n: f64) -> f64 {
    ((n * 12.9898).sin() * 43_758.547).fract()
}
