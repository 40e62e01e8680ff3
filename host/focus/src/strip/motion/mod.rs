//! Motion compensation: what is done about a track that is neither straight nor even.
//!
//! On a track near a line (`crate::straight_track`) pulse `n` lies at the place `s_n` along it, and half of its path to a
//! point of the scene at `(x, r)` is
//!
//! ```text
//! path_n / 2 = rho + e_n(x, r),   rho = sqrt(r^2 + (x - s_n)^2),   e_n = -(r / rho) (offset_n . toward(r)) + ...
//! ```
//!
//! `offset_n` the way from the line to the antennas, `toward(r)` the unit vector across the track to where the grid's plane is `r` off
//! the line. The sum that every former computes is made of the phases `kappa_k path_n / 2`; the strip's stages know `rho`
//! alone. There are three ways to bring the one to the other, each dearer than the one before ([`Compensation`]):
//!
//! **A point.** Pulses are taken for even, `s_n = (n - (N - 1) / 2) d`, and moved by `e_n` of one point, the grid's middle: a
//! phase for each sample. What is left is `e_n(x, r) - e_n(point)`.
//!
//! **Places.** The same, but with each pulse's own place along the line. The exact sum counts every pulse once, wherever
//! it is, so the spectrum along the track that stands for it is
//!
//! ```text
//! Y(kx) = sum_n z_n exp(-j kx s_n)
//! ```
//!
//! over the uneven places as they are: no interpolation to even ones, as Chim 2018 4.5 has it, and no weights for the density of pulses, which
//! would give another image. [`uneven`] evaluates it to -107 dB, where pulses stand still, turn back, come in any order or leave gaps. A
//! straight track flown unevenly then leaves nothing.
//!
//! **Ranges.** For each pulse, `e_n` is taken for a function of `rho` alone, `d_n(rho)`: the range profile `g_n` of the
//! pulse is read at `rho + d_n(rho)`, and what is read is a profile seen from the line:
//!
//! ```text
//! g_n(rho) = sum_k w_k z[n][k] exp(j kappa_k rho),   g'_n(rho) = g_n(rho + d_n(rho)) = sum_m c[n][m] exp(j kappa'_m rho)
//! ```
//!
//! ([`warp`]). Its `c` are samples as of a radar on the line, and all that follows is as on a straight track. Phase and
//! envelope move together, and every sample keeps its weight, so the image is that of the exact sum but for what `d_n`
//! leaves. A multiplication of the profile by `exp(j kappa_c d_n(rho))`, the usual second-order compensation, would leave the envelope
//! and every other frequency behind: of the phase `kappa d` it leaves `(kappa - kappa_c) d`, `B / (2 sqrt(3) f_c)` of it in RMS.
//! [`deviations`] has `d_n`: what is nearest to `e_n` over all of the grid, in the sense of least squares.
//!
//! **What is left** in the end is that pixels at one `rho` of a pulse lie in different directions. Along the track their angles `theta` off
//! broadside differ, and with them `r / rho = cos(theta)`: some `offset_n theta (theta - theta')`. No change of range
//! undoes that. It is what a radar near the ground sees most of, with its wide angles, and why Chim 2018 ch. 3 says that frequency-domain
//! formers cannot be compensated fully. It is evaluated for every pulse at points all over the grid ([`super::prediction`]), and an
//! image that would miss its bound is refused: time-domain formers take any track.
//!
//! **Measured** (predicted) errors of [`crate::omega_k`], dB against [`crate::exact`], for a strip map of 600 pulses over 240 m of track at 5 GHz and
//! 100 MHz, 3 km off and 1 km above 60 x 60 m, that wanders smoothly (`tests/formers/crooked_tracks.rs` measures them), by what it wanders along
//! the track, and across it and up, in RMS:
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
//! ranges. An arc of 240 m and a radius of 3 km leaves -37 (-28). A stretch of 40 m without pulses, or pulses that stand still, leave nothing.
//!
//! What moving phases alone would leave, as above, was not measured.

mod deviations;
mod profiles;
pub(super) mod uneven;
pub(super) mod warp;

use glam::DVec3;
use rayon::prelude::*;

use super::bounds::Bounds;
use crate::FormError;
use crate::straight_track::StraightTrack;
pub(super) use profiles::Profiles;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::{Collection, Pulse};

/// How a track is compensated.
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
pub(super) enum Compensation {
    /// Pulses as even as the line's, moved for one point.
    #[default]
    Point,
    /// Pulses where they are along the line, moved for one point.
    Places,
    /// The same, moved by as much as each range asks for.
    Ranges,
}

impl Compensation {
    /// From the cheapest on.
    pub(super) const ALL: [Self; 3] = [Self::Point, Self::Places, Self::Ranges];
}

/// A recorded track on the line fitted to it.
pub(super) struct Motion {
    pub(super) track: StraightTrack,
    pub(super) compensation: Compensation,
    /// Places of pulses along the line from its middle, where they are not as even as its own, metres.
    places_m: Option<Vec<f64>>,
    /// The first and the last place of a pulse, metres.
    span_m: [f64; 2],
    /// By how much each pulse's two-way path to the point of reference is longer than from the line, metres; of
    /// [`Compensation::Ranges`] nothing.
    excess_m: Vec<f64>,
    /// How profiles are read.
    profiles: Option<Profiles>,
}

impl Motion {
    /// The pulses of `collection`, whose two-way wavenumbers are `wavenumbers`, for the pixels of `grid`, which lie within `bounds`.
    ///
    /// # Errors
    /// [`FormError::Unsuited`] if profiles cannot be read so: an antenna amid the pixels, or a deviation that changes with range as fast
    /// as range itself.
    pub(super) fn new(
        collection: &Collection,
        grid: &ImageGrid,
        track: StraightTrack,
        bounds: &Bounds,
        wavenumbers: &[f64],
        compensation: Compensation,
    ) -> Result<Self, FormError> {
        let pulses = &collection.pulses;
        let places_m: Option<Vec<f64>> = (compensation != Compensation::Point)
            .then(|| pulses.iter().map(|pulse| track.place_m(pulse)).collect());
        let span_m = match &places_m {
            Some(places_m) => (places_m.iter())
                .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], &s| {
                    [low.min(s), high.max(s)]
                }),
            None => [0, track.num_pulses - 1].map(|n| track.along_m(n)),
        };
        let mut motion = Self {
            track,
            compensation,
            places_m,
            span_m,
            excess_m: Vec::new(),
            profiles: None,
        };
        if compensation == Compensation::Ranges {
            let profiles = Profiles::new(collection, grid, &motion, bounds, wavenumbers)?;
            motion.profiles = Some(profiles);
        } else {
            let (rows, columns) = (grid.rows.count - 1, grid.columns.count - 1);
            let reference = grid.position_m(rows / 2, columns / 2);
            let of_pulses = pulses.par_iter().enumerate();
            motion.excess_m = of_pulses
                .map(|(n, pulse)| pulse.path_m(reference) - 2.0 * motion.range_m(n, reference))
                .collect();
        }
        Ok(motion)
    }

    /// Place of pulse `n` along the line from its middle, metres.
    pub(super) fn along_m(&self, n: usize) -> f64 {
        match &self.places_m {
            Some(places_m) => places_m[n],
            None => self.track.along_m(n),
        }
    }

    /// The first and the last place of a pulse, metres.
    pub(super) fn span_m(&self) -> [f64; 2] {
        self.span_m
    }

    /// `rho`, from pulse `n` on the line to a point of the scene, metres.
    fn range_m(&self, n: usize, point: DVec3) -> f64 {
        let on_line = self.track.centre_m + self.track.direction * self.along_m(n);
        (point - on_line).length()
    }

    /// By how much the two-way path of pulse `n` is shortened for all of the scene, metres; not of [`Compensation::Ranges`].
    pub(super) fn excess_m(&self, n: usize) -> f64 {
        self.excess_m[n]
    }

    /// What is left of the two-way path of pulse `n` to `point`, metres.
    pub(super) fn left_m(&self, n: usize, pulse: &Pulse, point: DVec3) -> f64 {
        let range_m = self.range_m(n, point);
        let excess_m = pulse.path_m(point) - 2.0 * range_m;
        match &self.profiles {
            Some(profiles) => excess_m - 2.0 * profiles.deviation_m(n, range_m),
            None => excess_m - self.excess_m[n],
        }
    }

    /// How profiles are read, of [`Compensation::Ranges`].
    pub(super) fn profiles(&self) -> Option<&Profiles> {
        self.profiles.as_ref()
    }

    /// Whether pulses have places of their own.
    pub(super) fn is_uneven(&self) -> bool {
        self.places_m.is_some()
    }

    /// Bytes beside the samples: places, deviations, tables of the spreading.
    pub(super) fn bytes(&self) -> u128 {
        let of_pulse = match self.compensation {
            Compensation::Point => 0,
            Compensation::Places => size_of::<f64>() + uneven::PULSE_BYTES,
            Compensation::Ranges => size_of::<f64>() + uneven::PULSE_BYTES + profiles::PULSE_BYTES,
        };
        (of_pulse * self.track.num_pulses) as u128
    }

    /// Complex values that a thread needs to read profiles of so many samples.
    pub(super) fn scratch_length(&self, samples: usize) -> usize {
        match self.profiles {
            Some(_) => warp::room_length(samples),
            None => 0,
        }
    }

    /// Relative RMS errors of what is done here beside [`Self::left_m`]: a kernel each.
    pub(super) fn floors(&self) -> [f64; 2] {
        let spread = if self.places_m.is_some() {
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

    /// 41 pulses 0.5 m apart along x, 80 m off and 40 m above the origin, swaying upwards by so much; 1 GHz, steps of 2 MHz.
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

    /// RMS over pulses of half of what is left at a point.
    fn left_m(motion: &Motion, collection: &Collection, point: DVec3) -> f64 {
        let each = collection.pulses.iter().enumerate();
        let squares = each.map(|(n, pulse)| (motion.left_m(n, pulse, point) / 2.0).powi(2));
        (squares.sum::<f64>() / collection.pulses.len() as f64).sqrt()
    }

    #[test]
    fn a_point_leaves_the_change_of_the_line_of_sight() {
        // 1 cm upwards: from the middle of the track its part along the line of sight changes by 1 cm times the change of the
        // sine of the elevation; RMS over a sway of sines is that over sqrt(2).
        let collection = swaying(0.01, 64);
        let grid = grid("x=-1:1.1:1,y=-20:20.1:1");
        let sway: Vec<f64> = (0..41).map(|n| 0.01 * (0.4 * f64::from(n)).sin()).collect();
        let sway_m = (sway.iter().map(|s| s * s).sum::<f64>() / 41.0).sqrt();
        let sine = |y: f64| 40.0 / (80.0 + y).hypot(40.0);
        let expected_m = sway_m * (sine(20.0) - sine(0.0)).abs();
        let motion = motion(&collection, &grid, Compensation::Point);
        let got_m = left_m(&motion, &collection, DVec3::new(0.0, 20.0, 0.0));
        // The fitted line takes a part of the sway, and the lines of sight turn by up to 10 m in 90 m.
        assert!(
            (got_m / expected_m - 1.0).abs() < 0.05,
            "{got_m} {expected_m}"
        );
        assert!(left_m(&motion, &collection, DVec3::ZERO) < 1e-12);
    }

    #[test]
    fn ranges_leave_what_directions_differ_by() {
        let collection = swaying(0.01, 64);
        let grid = grid("x=-2:2.1:1,y=-20:20.1:1");
        let motion = motion(&collection, &grid, Compensation::Ranges);
        // In the middle the fit's own part of it; at the edge, seen 10 m ahead and 2 m more, at most sway cos(theta) differs by
        // ((12^2 - 10^2) / 2) / 70^2 of it, and the elevation's sine at one range by less.
        for (at, most) in [(DVec3::ZERO, 2e-3), (DVec3::new(2.0, -20.0, 0.0), 9e-3)] {
            let got_m = left_m(&motion, &collection, at);
            assert!(got_m < most * 0.01, "{got_m}");
        }
    }

    #[test]
    fn places_leave_nothing_of_an_uneven_straight_track() {
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
    fn antennas_close_together_are_one_in_their_middle() {
        // Apart by b along the track: path = 2 R + b^2 cos^2(angle off the track's normal) / (4 R); at 90 m.
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
    fn an_antenna_amid_the_pixels_is_refused() {
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
