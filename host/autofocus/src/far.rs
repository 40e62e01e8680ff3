//! Tracks of far scenes: displacements along the line of sight.
//!
//! In a far scene the lines of sight to all pixels are parallel within [`PARALLEL`]. A displacement `d(n)` of the radar then gives all echoes
//! of a pulse one phase,
//!
//! ```text
//! psi(n) = k s(n) . d(n)          k = 2 pi f / c,  s = u_t + u_r (unit vectors away from the antennas, to the grid's centre)
//! ```
//!
//! and only this phase is observable, modulo a turn: `4 pi f / c` times the displacement along the line of sight for one antenna.
//! A method's track is therefore converted to phases. They are unwrapped along slow time about their mean slope, which restores turns
//! lost by the method between two pulses. The displacement along the line of sight, in the plane of the pixels, follows from them;
//! across the line of sight it is zero. A rigid motion in the plane is removed.
//!
//! Neglected: phases that differ over the scene by the angles between lines of sight, [`PARALLEL`] times the displacement in radians of path.
//!
//! **Slips.** A true step of `x` beyond half a turn between neighbouring pulses is unwrapped to `x - 2 pi`, and the track is wrong by half a wavelength from that pulse on.
//! Steps near half a turn are a sign of others beyond it. [`max_step_rad`] therefore bounds the accepted steps: of random walks with a step of any size,
//! less than 1 % (by simulation, test below) lose a turn and have all of their steps below it. Short apertures have few steps that could exceed it, and a smaller bound.

use glam::DVec3;
use num_complex::Complex64;

use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::Collection;
use subaperture_model::resolution::support::path_gradient;
use subaperture_signal::phase::cis;

use super::correction::{Correction, wrap};
use super::echoes::wavenumber_rad_m;
use super::modified_pga::middles;
use super::rigid::without_rigid_motion;

/// Largest difference between gradients of the path at the corners of a far scene, relative to their length.
const PARALLEL: f64 = 0.05;

/// Smallest fraction of the path's gradient in the plane of the pixels: below it the line of sight is nearly normal to the plane.
const MIN_IN_PLANE: f64 = 0.1;

/// Largest accepted change of the two-way phase between neighbouring pulses, radians, for a track of `turns` pulses.
pub(crate) fn max_step_rad(turns: usize) -> f64 {
    let half_turns = match turns {
        0..12 => 0.25,
        12..24 => 0.5,
        24..48 => 2.0 / 3.0,
        _ => 0.75,
    };
    half_turns * std::f64::consts::PI
}

/// Lines of sight to a far scene.
pub(crate) struct FarScene {
    axes: [DVec3; 2],
    /// Derivative of the phase by displacement in the plane for each turn, radians per metre, mean over all channels.
    slopes: Vec<DVec3>,
    /// Midpoints of the antennas, one per turn.
    antennas_m: Vec<DVec3>,
}

impl FarScene {
    /// Lines of sight to the grid; `None` if they are not parallel at some pulse, or nearly normal to the plane of the pixels.
    pub(crate) fn of(collection: &Collection, grid: &ImageGrid) -> Option<Self> {
        let (rows, columns) = (grid.rows.count - 1, grid.columns.count - 1);
        let corners_m = [(0, 0), (0, columns), (rows, 0), (rows, columns)]
            .map(|(row, column)| grid.position_m(row, column));
        let centre_m = corners_m.iter().sum::<DVec3>() / 4.0;
        let axes = [grid.x_axis, grid.y_axis];
        let turns = collection.num_turns();
        let channels = collection.pulses.len() / turns;
        let mut slopes = Vec::with_capacity(turns);
        for n in 0..turns {
            let pulses = || collection.pulses[n..].iter().step_by(turns);
            let gradient = |pulse: &subaperture_model::phase_history::Pulse, place_m| {
                path_gradient(pulse.transmitter_m, pulse.receiver_m, place_m)
            };
            let mean = pulses().map(|p| gradient(p, centre_m)).sum::<DVec3>() / channels as f64;
            let parallel = pulses().all(|pulse| {
                corners_m.iter().all(|&corner_m| {
                    gradient(pulse, corner_m).distance(mean) <= 0.5 * PARALLEL * mean.length()
                })
            });
            let flat = axes[0] * mean.dot(axes[0]) + axes[1] * mean.dot(axes[1]);
            if !parallel || flat.length() < MIN_IN_PLANE * mean.length() {
                return None;
            }
            slopes.push(flat * wavenumber_rad_m(collection, &collection.pulses[n]));
        }
        Some(Self {
            axes,
            slopes,
            antennas_m: middles(collection).take(turns).collect(),
        })
    }

    /// Track along the line of sight with the same phases modulo whole turns. Phase corrections are unchanged.
    pub(crate) fn along_sight(&self, correction: Correction) -> Correction {
        let Correction::Track { displacement_m } = correction else {
            return correction;
        };
        let turns = self.slopes.len();
        let phases_rad: Vec<f64> = displacement_m
            .iter()
            .zip(&self.slopes)
            .map(|(moved_m, slope)| moved_m.dot(*slope))
            .collect();
        let moved_m: Vec<DVec3> = unwrapped_about_slope(&phases_rad)
            .iter()
            .zip(&self.slopes)
            .map(|(phase, slope)| *slope * (phase / slope.length_squared()))
            .collect();
        let moved_m = without_rigid_motion(self.axes, &self.antennas_m, &moved_m);
        let channels = displacement_m.len() / turns;
        Correction::Track {
            displacement_m: (0..channels)
                .flat_map(|_| moved_m.iter().copied())
                .collect(),
        }
    }
}

/// Phases with whole turns added, so that steps between neighbours differ from the mean step by less than half a turn.
fn unwrapped_about_slope(phases_rad: &[f64]) -> Vec<f64> {
    let steps = || phases_rad.windows(2).map(|pair| pair[1] - pair[0]);
    let sum: Complex64 = steps().map(cis).sum();
    let mean = libm::atan2(sum.im, sum.re);
    let mut last = phases_rad.first().copied().unwrap_or(0.0);
    let mut all = vec![last; phases_rad.len().min(1)];
    for step in steps() {
        last += mean + wrap(step - mean);
        all.push(last);
    }
    all
}

#[cfg(test)]
mod tests {
    use subaperture_model::geometry::{Axis, SceneFrame};
    use subaperture_model::phase_history::{Pulse, Sweep};

    use super::*;
    use crate::chance::gauss;

    const TURNS: usize = 60;
    const HZ: f64 = 10e9;
    const HALF_WAVELENGTH_M: f64 = 299_792_458.0 / HZ / 2.0;

    /// Pulses at a spacing of 0.5 m along x, `range_m` from the origin at 30 degrees of elevation, for a receiver at the transmitter
    /// and one `aside_m` from it.
    fn collection(range_m: f64, aside_m: f64) -> Collection {
        let pulse = |(n, aside_m): (usize, f64)| {
            let at_m = DVec3::new(
                0.5 * n as f64 - 0.25 * (TURNS - 1) as f64,
                -range_m * 0.75f64.sqrt(),
                range_m * 0.5,
            );
            Pulse {
                time_s: n as f64,
                transmitter_m: at_m,
                receiver_m: at_m + DVec3::X * aside_m,
                reference_m: DVec3::ZERO,
                reference_path_m: 0.0,
                start_hz: HZ,
                step_hz: 0.0,
                sweep: Sweep::AT_ONCE,
                recorded_path_m: None,
            }
        };
        let channels = [0.0, aside_m];
        let pulses = channels
            .into_iter()
            .flat_map(|m| (0..TURNS).map(move |n| (n, m)));
        Collection {
            name: "far".to_owned(),
            num_samples: 1,
            pulses: pulses.map(pulse).collect(),
            frame: SceneFrame::Local,
            extent: None,
            timed: true,
        }
    }

    fn grid() -> ImageGrid {
        let axis = Axis {
            start: -20.0,
            step: 1.0,
            count: 41,
        };
        ImageGrid::horizontal(axis, axis, 0.0)
    }

    #[test]
    fn far_scene_has_parallel_lines_of_sight() {
        // The corners are 28 m off: 0.05 of half a kilometre is beyond half of PARALLEL, 0.007 of four is not.
        assert!(FarScene::of(&collection(500.0, 0.1), &grid()).is_none());
        assert!(FarScene::of(&collection(4e3, 0.1), &grid()).is_some());
        // Receivers at 800 m see it under 0.2 rad; both components of displacements are observable.
        assert!(FarScene::of(&collection(4e3, 800.0), &grid()).is_none());
        // The line of sight straight down has no direction in the plane.
        let mut above = collection(4e3, 0.1);
        for pulse in &mut above.pulses {
            for antenna_m in [&mut pulse.transmitter_m, &mut pulse.receiver_m] {
                *antenna_m = DVec3::new(antenna_m.x, 0.0, 4e3);
            }
        }
        assert!(FarScene::of(&above, &grid()).is_none());
    }

    #[test]
    fn lost_turns_are_restored_and_cross_range_displacements_removed() {
        let collection = collection(40e3, 0.1);
        let far = FarScene::of(&collection, &grid()).unwrap();
        // A parabola of 60 mm: its steps are 4 mm at most, and half a turn is a quarter of a wavelength over cos 30 degrees, 8.7 mm.
        let bend = |n: usize| {
            let u = 2.0 * (n as f64 + 0.5) / TURNS as f64 - 1.0;
            0.06 * (u * u - 1.0 / 3.0)
        };
        let found: Vec<DVec3> = (0..2 * TURNS)
            .map(|i| {
                let n = i % TURNS;
                let lost = if n >= 20 { 1.0 } else { 0.0 } - if n >= 33 { 2.0 } else { 0.0 };
                let slip_m = lost * HALF_WAVELENGTH_M / 0.75f64.sqrt();
                DVec3::new(0.004 * (n as f64).sin(), bend(n) + slip_m, 0.0)
            })
            .collect();
        let Correction::Track { displacement_m } = far.along_sight(Correction::Track {
            displacement_m: found,
        }) else {
            panic!("no track");
        };
        assert_eq!(displacement_m.len(), 2 * TURNS);
        for (i, at_m) in displacement_m.iter().enumerate() {
            let expected = DVec3::Y * bend(i % TURNS);
            // Across, 4 mm turn the phase by the angle of up to 4e-4 rad off the y axis. The mean of the samples of the parabola is 5e-6 m.
            assert!(at_m.distance(expected) < 2e-5, "{i}: {at_m} {expected}");
        }
    }

    #[test]
    fn random_walks_with_lost_turns_rarely_pass_step_limit() {
        let mut state = 7;
        for turns in [8, 12, 24, 48, 128] {
            let limit_rad = max_step_rad(turns);
            let (mut most, mut passed) = (0, 0);
            for tenths in [6, 8, 10, 11, 12, 13, 14, 16, 20, 30] {
                let mut lost_and_passed = 0;
                for _ in 0..1000 {
                    let mut at = 0.0;
                    let walk: Vec<f64> = (0..turns)
                        .map(|_| {
                            at += 0.1 * f64::from(tenths) * gauss(&mut state);
                            at
                        })
                        .collect();
                    let found = unwrapped_about_slope(&walk);
                    let whole = (found[turns - 1] - found[0]) / (turns - 1) as f64;
                    let steps = || found.windows(2).map(|pair| pair[1] - pair[0]);
                    let passes = steps().all(|step| (step - whole).abs() < limit_rad);
                    let true_steps = walk.windows(2).map(|pair| pair[1] - pair[0]);
                    let lost = steps().zip(true_steps).any(|(a, b)| (a - b).abs() > 1.0);
                    lost_and_passed += usize::from(lost && passes);
                    passed += usize::from(passes);
                }
                most = most.max(lost_and_passed);
            }
            println!(
                "{turns} pulses: {passed} of 10000 walks pass, {most} of 1000 with a lost turn"
            );
            // 10 are expected at 1 %, with a standard deviation of 3.2; the largest of ten step sizes is three of these above.
            assert!(most <= 20, "{turns}: {most}");
            // Walks of small steps pass.
            assert!(passed > 300, "{turns}: {passed}");
        }
    }

    #[test]
    fn phases_are_unwrapped_about_their_mean_slope() {
        // Steps of 2.5 rad with 1.2 rad more and less exceed half a turn; steps about the slope do not.
        let truth: Vec<f64> = (0..50)
            .map(|n| 2.5 * f64::from(n) + if n % 2 == 0 { 0.6 } else { -0.6 })
            .collect();
        let wrapped: Vec<f64> = truth.iter().map(|&phase| wrap(phase)).collect();
        for (found, expected) in unwrapped_about_slope(&wrapped).iter().zip(&truth) {
            assert!((found - wrapped[0] - expected + truth[0]).abs() < 1e-9);
        }
        assert!(unwrapped_about_slope(&[]).is_empty());
    }
}
