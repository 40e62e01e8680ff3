//! Motion compensation for tracks that are not straight or not evenly sampled.
//!
//! On a track near a line (`crate::straight_track`) pulse `n` lies at the along-track position `s_n`, and half of its path to a
//! point of the scene at `(x, r)` is
//!
//! ```text
//! path_n / 2 = rho + e_n(x, r),   rho = sqrt(r^2 + (x - s_n)^2),   e_n = -(r / rho) (offset_n . toward(r)) + ...
//! ```
//!
//! `offset_n` is the vector from the line to the antennas, `toward(r)` the unit vector across the track towards the point of the grid plane at distance `r` from
//! the line. The sum computed by every former contains the phases `kappa_k path_n / 2`; the processing stages use `rho`
//! alone. Three levels of compensation convert one to the other, at increasing cost ([`Compensation`]):
//!
//! **A point.** Pulses are assumed even, `s_n = (n - (N - 1) / 2) d`, and compensated by `e_n` of one point, the grid centre: a
//! phase for each sample. The residual is `e_n(x, r) - e_n(point)`.
//!
//! **Places.** As before, but with the actual along-track position of each pulse. The exact sum counts every pulse once at any
//! position, so the corresponding along-track spectrum is
//!
//! ```text
//! Y(kx) = sum_n z_n exp(-j kx s_n)
//! ```
//!
//! over the uneven positions. Pulses are not interpolated to even positions, as in Chim 2018 4.5, and not weighted by their density, which
//! would give a different image. [`uneven`] evaluates the sum to -107 dB, also for pulses that stand still, reverse, come in any order or leave gaps. A
//! straight track at uneven speed has no residual.
//!
//! **Ranges.** For each pulse, `e_n` is approximated by a function of `rho` alone, `d_n(rho)`. The range profile `g_n` of the
//! pulse is interpolated at `rho + d_n(rho)`, which gives the profile seen from the line:
//!
//! ```text
//! g_n(rho) = sum_k w_k z[n][k] exp(j kappa_k rho),   g'_n(rho) = g_n(rho + d_n(rho)) = sum_m c[n][m] exp(j kappa'_m rho)
//! ```
//!
//! ([`warp`]). The coefficients `c` are samples of a radar on the line, and further processing is that of a straight track. Phase and
//! envelope move together, and every sample keeps its weight, so the image is that of the exact sum except for the residual of
//! `d_n`. The usual second-order compensation multiplies the profile by `exp(j kappa_c d_n(rho))` and ignores the envelope
//! and all other frequencies: of the phase `kappa d` it leaves `(kappa - kappa_c) d`, `B / (2 sqrt(3) f_c)` of it in RMS.
//! [`deviations`] computes `d_n` by a least-squares fit to `e_n` over the whole grid.
//!
//! **Residual.** Pixels at one `rho` of a pulse lie in different directions. Along the track their angles `theta` off
//! broadside differ, and with them `r / rho = cos(theta)`: the residual is about `offset_n theta (theta - theta')`. A range shift
//! cannot compensate it. It is largest for a radar near the ground with wide angles, and is the reason why, by Chim 2018 ch. 3, frequency-domain
//! formers cannot be compensated fully. It is evaluated for every pulse at points throughout the grid ([`super::prediction`]), and an
//! image that would exceed its bound is refused: time-domain formers support any track.
//!
//! **Measured** (predicted) errors of [`crate::omega_k`], dB against [`crate::exact`], for a strip map of 600 pulses over 240 m of track at 5 GHz and
//! 100 MHz, 3 km away and 1 km above 60 x 60 m, with smooth deviations (`tests/formers/crooked_tracks.rs` measures them), by the RMS deviation along
//! the track, and across and up:
//!
//! | along | across and up | point | places | ranges |
//! |---|---|---|---|---|
//! | 0.5 m | 0 | -18 (-8) | -109 (-97) | -105 (not chosen) |
//! | 0 | 3 cm | -49 (-35) | -49 (-35) | -67 (-58) |
//! | 0.5 m | 10 cm | -18 (-8) | -38 (-25) | -56 (-48) |
//! | 0.5 m | 30 cm | -17 (-7) | -29 (-15) | -47 (-38) |
//! | 0.5 m | 1 m | -14 (-3) | -17 (-5) | -35 (-26) |
//!
//! From 2 m above the ground, 8 to 14 m from 4 m of track, at 1.1 to 1.3 GHz, 5 cm along and 1 cm across and up: -17 for a point, -46 (-36) by
//! ranges. An arc of 240 m with a radius of 3 km gives -37 (-28). A gap of 40 m without pulses, or pulses that stand still, cause no error.
//!
//! The error of the second-order compensation described above was not measured.

mod deviations;
mod positions;
mod profiles;
pub(super) mod uneven;
pub(super) mod warp;

use glam::DVec3;
use rayon::prelude::*;

use super::bounds::Bounds;
use crate::FormError;
use crate::straight_track::StraightTrack;
pub(super) use positions::Positions;
pub(super) use profiles::Profiles;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::{Collection, Pulse};

/// Motion compensation of a track.
#[derive(
    Clone,
    Copy,
    Debug,
    Default,
    PartialEq,
    Eq,
    PartialOrd,
    Ord,
    serde::Serialize,
    serde::Deserialize,
)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Compensation {
    /// Even pulse positions, compensation for one point.
    #[default]
    Point,
    /// Actual along-track pulse positions, compensation for one point.
    Places,
    /// Actual along-track pulse positions, range-dependent compensation.
    Ranges,
}

impl Compensation {
    /// All levels, the cheapest first.
    pub(super) const ALL: [Self; 3] = [Self::Point, Self::Places, Self::Ranges];
}

/// Recorded track relative to the fitted line.
pub(super) struct Motion {
    pub(super) positions: Positions,
    pub(super) compensation: Compensation,
    /// Excess two-way path of each pulse to the reference point relative to the line, metres; empty for
    /// [`Compensation::Ranges`].
    excess_m: Vec<f64>,
    /// Sampling of the profiles for range-dependent compensation.
    profiles: Option<Profiles>,
}

impl Motion {
    /// Fit the pulses of `collection` with two-way wavenumbers `wavenumbers` to the pixels of `grid`, which lie within `bounds`.
    ///
    /// # Errors
    /// [`FormError::Unsuited`] if profiles cannot be compensated: an antenna lies among the pixels, or a deviation changes as fast
    /// as range.
    pub(super) fn new(
        collection: &Collection,
        grid: &ImageGrid,
        track: StraightTrack,
        bounds: &Bounds,
        wavenumbers: &[f64],
        compensation: Compensation,
    ) -> Result<Self, FormError> {
        let pulses = &collection.pulses;
        let positions = match compensation {
            Compensation::Point => Positions::even(track),
            Compensation::Places | Compensation::Ranges => Positions::recorded(track, pulses),
        };
        let mut motion = Self {
            positions,
            compensation,
            excess_m: Vec::new(),
            profiles: None,
        };
        let positions = &motion.positions;
        if compensation == Compensation::Ranges {
            let profiles = Profiles::new(collection, grid, positions, bounds, wavenumbers)?;
            motion.profiles = Some(profiles);
        } else {
            let (rows, columns) = (grid.rows.count - 1, grid.columns.count - 1);
            let reference = grid.position_m(rows / 2, columns / 2);
            let of_pulses = pulses.par_iter().enumerate();
            motion.excess_m = of_pulses
                .map(|(n, pulse)| pulse.path_m(reference) - 2.0 * positions.range_m(n, reference))
                .collect();
        }
        Ok(motion)
    }

    /// Two-way path correction of pulse `n` for the whole scene, metres; not for [`Compensation::Ranges`].
    pub(super) fn excess_m(&self, n: usize) -> f64 {
        self.excess_m[n]
    }

    /// Residual two-way path of pulse `n` to `point`, metres.
    pub(super) fn left_m(&self, n: usize, pulse: &Pulse, point: DVec3) -> f64 {
        let range_m = self.positions.range_m(n, point);
        let excess_m = pulse.path_m(point) - 2.0 * range_m;
        match &self.profiles {
            Some(profiles) => excess_m - 2.0 * profiles.deviation_m(n, range_m),
            None => excess_m - self.excess_m[n],
        }
    }

    /// Sampling of the profiles; `None` except for [`Compensation::Ranges`].
    pub(super) fn profiles(&self) -> Option<&Profiles> {
        self.profiles.as_ref()
    }

    /// Memory in addition to the samples, bytes: positions, deviations, gridding tables.
    pub(super) fn bytes(&self) -> u128 {
        let of_pulse = match self.compensation {
            Compensation::Point => 0,
            Compensation::Places => size_of::<f64>() + uneven::PULSE_BYTES,
            Compensation::Ranges => size_of::<f64>() + uneven::PULSE_BYTES + profiles::PULSE_BYTES,
        };
        (of_pulse * self.positions.track.num_pulses) as u128
    }

    /// Complex scratch values per thread for interpolating profiles with the given number of samples.
    pub(super) fn scratch_length(&self, samples: usize) -> usize {
        match self.profiles {
            Some(_) => warp::room_length(samples),
            None => 0,
        }
    }

    /// Relative RMS errors of the compensation kernels, in addition to [`Self::left_m`].
    pub(super) fn floors(&self) -> [f64; 2] {
        let spread = if self.positions.is_uneven() {
            uneven::ERROR
        } else {
            0.0
        };
        let read = if self.profiles.is_some() {
            warp::ERROR
        } else {
            0.0
        };
        [spread, read]
    }
}

#[cfg(test)]
pub(super) mod tests {
    use std::f64::consts::PI;

    use super::*;
    use subaperture_model::SPEED_OF_LIGHT_M_S;
    use subaperture_model::geometry::SceneFrame;
    use subaperture_model::phase_history::Sweep;

    /// Collection of 41 pulses 0.5 m apart along x, 80 m away and 40 m above the origin, with vertical sway of the given amplitude; 1 GHz, steps of 2 MHz.
    pub(super) fn swaying(sway_m: f64, num_samples: usize) -> Collection {
        let pulses = (0..41)
            .map(|n| {
                let sway_m = sway_m * (0.4 * f64::from(n)).sin();
                let at = DVec3::new(0.5 * f64::from(n - 20), -80.0, 40.0 + sway_m);
                Pulse {
                    time_s: f64::from(n),
                    transmitter_m: at,
                    receiver_m: at,
                    reference_m: DVec3::ZERO,
                    reference_path_m: 170.0,
                    start_hz: 1e9,
                    step_hz: 2e6,
                    sweep: Sweep::AT_ONCE,
                    recorded_path_m: None,
                }
            })
            .collect();
        Collection {
            name: "swaying".to_owned(),
            num_samples,
            pulses,
            frame: SceneFrame::Local,
            extent: None,
            timed: true,
        }
    }

    pub(super) fn grid(text: &str) -> ImageGrid {
        text.parse().unwrap()
    }

    pub(super) fn wavenumbers(collection: &Collection) -> Vec<f64> {
        let of = |k| 4.0 * PI * collection.pulses[0].frequency_hz(k) / SPEED_OF_LIGHT_M_S;
        (0..collection.num_samples).map(of).collect()
    }

    fn motion(collection: &Collection, grid: &ImageGrid, compensation: Compensation) -> Motion {
        let track = StraightTrack::fit(collection).unwrap();
        let bounds = Bounds::of(&track, grid);
        let wavenumbers = wavenumbers(collection);
        Motion::new(collection, grid, track, &bounds, &wavenumbers, compensation).unwrap()
    }

    /// RMS over pulses of half of the residual path at a point.
    fn left_m(motion: &Motion, collection: &Collection, point: DVec3) -> f64 {
        let each = collection.pulses.iter().enumerate();
        let squares = each.map(|(n, pulse)| (motion.left_m(n, pulse, point) / 2.0).powi(2));
        (squares.sum::<f64>() / collection.pulses.len() as f64).sqrt()
    }

    #[test]
    fn point_compensation_leaves_change_of_line_of_sight() {
        // Sway of 1 cm upwards: from the track centre its component along the line of sight changes by 1 cm times the change of the
        // sine of the elevation; RMS over a sinusoidal sway is that over sqrt(2).
        let collection = swaying(0.01, 64);
        let grid = grid("x=-1:1.1:1,y=-20:20.1:1");
        let sway: Vec<f64> = (0..41).map(|n| 0.01 * (0.4 * f64::from(n)).sin()).collect();
        let sway_m = (sway.iter().map(|s| s * s).sum::<f64>() / 41.0).sqrt();
        let sine = |y: f64| 40.0 / (80.0 + y).hypot(40.0);
        let expected_m = sway_m * (sine(20.0) - sine(0.0)).abs();
        let motion = motion(&collection, &grid, Compensation::Point);
        let got_m = left_m(&motion, &collection, DVec3::new(0.0, 20.0, 0.0));
        // The fitted line absorbs a part of the sway, and the lines of sight turn by up to 10 m in 90 m.
        assert!(
            (got_m / expected_m - 1.0).abs() < 0.05,
            "{got_m} {expected_m}"
        );
        assert!(left_m(&motion, &collection, DVec3::ZERO) < 1e-12);
    }

    #[test]
    fn range_compensation_leaves_error_of_differing_directions() {
        let collection = swaying(0.01, 64);
        let grid = grid("x=-2:2.1:1,y=-20:20.1:1");
        let motion = motion(&collection, &grid, Compensation::Ranges);
        // At the centre, the fit error; at the edge, seen 10 m ahead and 2 m more, at most sway cos(theta) differs by
        // ((12^2 - 10^2) / 2) / 70^2 of it, and the sine of the elevation at one range by less.
        for (at, most) in [(DVec3::ZERO, 2e-3), (DVec3::new(2.0, -20.0, 0.0), 9e-3)] {
            let got_m = left_m(&motion, &collection, at);
            assert!(got_m < most * 0.01, "{got_m}");
        }
    }

    #[test]
    fn places_fully_compensate_uneven_straight_track() {
        let mut collection = swaying(0.0, 64);
        for (n, pulse) in collection.pulses.iter_mut().enumerate() {
            let ahead_m = 3.0 * (0.2 * n as f64).sin();
            pulse.transmitter_m.x += ahead_m;
            pulse.receiver_m.x += ahead_m;
        }
        let grid = grid("x=-2:2.1:1,y=-20:20.1:1");
        let corner = DVec3::new(2.0, -20.0, 0.0);
        let of = |compensation| {
            left_m(
                &motion(&collection, &grid, compensation),
                &collection,
                corner,
            )
        };
        assert!(of(Compensation::Point) > 0.01);
        assert!(of(Compensation::Places) < 1e-12);
    }

    #[test]
    fn close_antennas_equal_one_at_their_midpoint() {
        // Antennas b apart along the track: path = 2 R + b^2 cos^2(angle off the track normal) / (4 R); at 90 m.
        let mut collection = swaying(0.0, 64);
        for pulse in &mut collection.pulses {
            pulse.transmitter_m.x -= 0.1;
            pulse.receiver_m.x += 0.1;
        }
        let motion = motion(&collection, &grid("x=0:1:1,y=0:1:1"), Compensation::Point);
        let excess_m = motion.excess_m(20);
        let range_m = 80f64.hypot(40.0);
        assert!(
            (excess_m / (0.04 / (4.0 * range_m)) - 1.0).abs() < 1e-3,
            "{excess_m}"
        );
    }

    #[test]
    fn antenna_among_pixels_is_refused() {
        let collection = swaying(0.5, 64);
        let track = StraightTrack::fit(&collection).unwrap();
        let grid = grid("x=-2:2:1,y=-80:80:1,z=40");
        let bounds = Bounds::of(&track, &grid);
        let of = wavenumbers(&collection);
        let refused = Motion::new(
            &collection,
            &grid,
            track,
            &bounds,
            &of,
            Compensation::Ranges,
        );
        assert!(matches!(refused, Err(FormError::Unsuited(_))));
    }
}
