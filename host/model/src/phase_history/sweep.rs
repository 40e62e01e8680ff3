//! Intra-pulse motion: samples of a pulse taken one after another.
//!
//! A linear sweep passes through its frequencies, and a stepped radar sets its carriers, one after another: sample
//! `k` is taken `s = (k - K/2) sample_s` seconds after sample `K/2`, which has the pulse's geometry. Meanwhile the
//! antennas move along
//!
//! ```text
//! T(s) = transmitter_m + transmitter_m_s s + transmitter_m_s2 s^2 / 2,    R(s) likewise
//! ```
//!
//! so that the path to `p` at that sample is `|p - T(s)| + |p - R(s)|`. Phases are referred to the reference point at
//! the sample's own time ([`Sweep::reference_m_s`]) or to one path for all samples.
//!
//! **Effect.** With `r'` and `r''` the derivatives of the relative path by `k` and `d = k - K/2`, the phase
//! of a scatterer is, in turns,
//!
//! ```text
//! -f_k r_k / c = -(f_c r + d (step r + f_c r') + d^2 (step r' + f_c r'' / 2) + d^3 step r'' / 2) / c
//! ```
//!
//! The term in `d` shifts the range profile by `f_c r' / step`: range-Doppler coupling. The term in `d^2` smears it.
//! At the reference point `r'` and `r''` are zero; elsewhere they increase with the angle between the lines of sight.
//!
//! Neglected: the difference in departure and arrival times between the wave to `p` and that to the reference, which
//! changes the path by less than `2 v / c` of its difference from the reference's; and deviations of the track from a
//! parabola over the sweep.

use glam::DVec3;

use super::Pulse;

/// Motion of the antennas while the samples of a pulse are taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sweep {
    /// Time from sample to sample, seconds; negative if higher frequencies come first, 0 for simultaneous samples.
    pub sample_s: f64,
    /// Velocity of the transmitter at sample `K/2`, metres per second.
    pub transmitter_m_s: DVec3,
    /// Acceleration of the transmitter, metres per second squared.
    pub transmitter_m_s2: DVec3,
    /// Velocity of the receiver at sample `K/2`, metres per second.
    pub receiver_m_s: DVec3,
    /// Acceleration of the receiver, metres per second squared.
    pub receiver_m_s2: DVec3,
    /// Velocity of the reference point (zero for a scene at rest), if the phase of every sample is referred to the
    /// path through it at the sample's own time. `None` if all samples are referred to the pulse's reference path.
    pub reference_m_s: Option<DVec3>,
}

/// Path with its derivatives over the sample index.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PathTerms {
    /// Path at sample `K/2`, metres.
    pub path_m: f64,
    /// First derivative, metres per sample.
    pub rate_m: f64,
    /// Second derivative, metres per sample squared.
    pub bend_m: f64,
}

impl Sweep {
    /// Simultaneous samples: a radar at rest during a pulse, or a short pulse.
    pub const AT_ONCE: Self = Self {
        sample_s: 0.0,
        transmitter_m_s: DVec3::ZERO,
        transmitter_m_s2: DVec3::ZERO,
        receiver_m_s: DVec3::ZERO,
        receiver_m_s2: DVec3::ZERO,
        reference_m_s: None,
    };

    /// Whether all values are finite.
    #[inline]
    pub fn is_finite(&self) -> bool {
        let vectors = [
            self.transmitter_m_s,
            self.transmitter_m_s2,
            self.receiver_m_s,
            self.receiver_m_s2,
            self.reference_m_s.unwrap_or_default(),
        ];
        self.sample_s.is_finite() && vectors.iter().all(|v| v.is_finite())
    }

    /// Whether paths are the same for all samples of the pulse.
    #[inline]
    pub fn is_at_once(&self) -> bool {
        let still = [
            self.transmitter_m_s,
            self.transmitter_m_s2,
            self.receiver_m_s,
            self.receiver_m_s2,
            self.reference_m_s.unwrap_or_default(),
        ];
        self.sample_s == 0.0 || still.iter().all(|&v| v == DVec3::ZERO)
    }
}

impl Pulse {
    /// Two-way path to `point` `after` samples after sample `K/2`, metres.
    #[inline]
    pub fn path_after_m(&self, point: DVec3, after: f64) -> f64 {
        let [transmitter_m, receiver_m] = self.antennas_after_m(after);
        (point - transmitter_m).length() + (point - receiver_m).length()
    }

    /// Path to `point` relative to the reference path of that sample's phase, metres. Equal to
    /// [`Self::relative_path_m`] at sample `K/2`.
    #[inline]
    pub fn relative_path_after_m(&self, point: DVec3, after: f64) -> f64 {
        if self.sweep.sample_s == 0.0 {
            return self.relative_path_m(point);
        }
        self.path_after_m(point, after) - self.reference_path_m - self.reference_drift_m(after)
    }

    /// Positions of transmitter and receiver `after` samples after sample `K/2`, metres.
    #[inline]
    pub fn antennas_after_m(&self, after: f64) -> [DVec3; 2] {
        let sweep = &self.sweep;
        let s = after * sweep.sample_s;
        [
            self.transmitter_m + s * (sweep.transmitter_m_s + 0.5 * s * sweep.transmitter_m_s2),
            self.receiver_m + s * (sweep.receiver_m_s + 0.5 * s * sweep.receiver_m_s2),
        ]
    }

    /// Increase of the reference path from sample `K/2` to that sample, metres.
    #[inline]
    pub fn reference_drift_m(&self, after: f64) -> f64 {
        let Some(velocity_m_s) = self.sweep.reference_m_s else {
            return 0.0;
        };
        let moved_m = velocity_m_s * (after * self.sweep.sample_s);
        self.path_after_m(self.reference_m + moved_m, after) - self.path_m(self.reference_m)
    }

    /// Path to a point that is at `point` at sample `K/2` and moves at `velocity_m_s`, with its derivatives over the
    /// sample index. Metres; not relative to the reference path.
    // Inlined: a call for every pixel and pulse would cost a third of the time of backprojection.
    #[inline(always)]
    pub fn path_terms(&self, point: DVec3, velocity_m_s: DVec3) -> PathTerms {
        let sweep = &self.sweep;
        let leg = |antenna_m: DVec3, antenna_m_s: DVec3, antenna_m_s2: DVec3| {
            let sight = point - antenna_m;
            let range_m = sight.length();
            // A point at the antenna's phase centre has neither direction nor rate.
            if sweep.sample_s == 0.0 || range_m == 0.0 {
                return [range_m, 0.0, 0.0];
            }
            let towards = velocity_m_s - antenna_m_s;
            let rate = sight.dot(towards) / range_m;
            let bend = (towards.length_squared() - rate * rate - sight.dot(antenna_m_s2)) / range_m;
            [range_m, rate, bend]
        };
        let out = leg(
            self.transmitter_m,
            sweep.transmitter_m_s,
            sweep.transmitter_m_s2,
        );
        let back = if self.transmitter_m == self.receiver_m
            && sweep.transmitter_m_s == sweep.receiver_m_s
            && sweep.transmitter_m_s2 == sweep.receiver_m_s2
        {
            out
        } else {
            leg(self.receiver_m, sweep.receiver_m_s, sweep.receiver_m_s2)
        };
        PathTerms {
            path_m: out[0] + back[0],
            rate_m: (out[1] + back[1]) * sweep.sample_s,
            bend_m: (out[2] + back[2]) * sweep.sample_s * sweep.sample_s,
        }
    }

    /// Reference path of the phases, with its derivatives over the sample index.
    #[inline]
    pub fn reference_terms(&self) -> PathTerms {
        let mut terms = match self.sweep.reference_m_s {
            Some(velocity_m_s) => self.path_terms(self.reference_m, velocity_m_s),
            None => PathTerms::default(),
        };
        terms.path_m = self.reference_path_m;
        terms
    }
}

impl std::ops::Sub for PathTerms {
    type Output = Self;

    #[inline]
    fn sub(self, other: Self) -> Self {
        Self {
            path_m: self.path_m - other.path_m,
            rate_m: self.rate_m - other.rate_m,
            bend_m: self.bend_m - other.bend_m,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Transmitter at (0, -4, 3) that moves along x at 2 m/s and climbs at 1 m/s^2, receiver at rest at (0, -5, 0),
    /// 10 ms per sample, referred to the origin.
    fn pulse(reference_m_s: Option<DVec3>) -> Pulse {
        Pulse {
            time_s: 0.0,
            transmitter_m: DVec3::new(0.0, -4.0, 3.0),
            receiver_m: DVec3::new(0.0, -5.0, 0.0),
            reference_m: DVec3::ZERO,
            reference_path_m: 10.0,
            start_hz: 1e9,
            step_hz: 1e6,
            sweep: Sweep {
                sample_s: 0.01,
                transmitter_m_s: DVec3::new(2.0, 0.0, 0.0),
                transmitter_m_s2: DVec3::new(0.0, 0.0, 1.0),
                reference_m_s,
                ..Sweep::AT_ONCE
            },
            recorded_path_m: None,
        }
    }

    #[test]
    fn paths_follow_moving_antennas() {
        // 50 samples are half a second: the transmitter is at (1, -4, 3.125). To (1, 2, 0), by Pythagoras.
        let point = DVec3::new(1.0, 2.0, 0.0);
        let back_m = (1.0f64 + 49.0).sqrt();
        let expected_m = (36.0f64 + 3.125 * 3.125).sqrt() + back_m;
        let fixed = pulse(None);
        assert!((fixed.path_after_m(point, 50.0) - expected_m).abs() < 1e-14);
        let relative_m = fixed.relative_path_after_m(point, 50.0);
        assert!((relative_m - (expected_m - 10.0)).abs() < 1e-14);
        // With a followed reference: from (1, -4, 3.125) to the origin, and 5 m back.
        let followed = pulse(Some(DVec3::ZERO));
        let reference_m = (17.0f64 + 3.125 * 3.125).sqrt() + 5.0;
        let relative_m = followed.relative_path_after_m(point, 50.0);
        assert!((relative_m - (expected_m - reference_m)).abs() < 1e-14);
        assert!(followed.relative_path_after_m(DVec3::ZERO, 50.0).abs() < 1e-14);
        assert_eq!(
            followed.relative_path_after_m(point, 0.0),
            followed.relative_path_m(point)
        );
    }

    #[test]
    fn path_terms_equal_numerical_derivatives() {
        let pulse = pulse(Some(DVec3::new(0.3, -0.2, 0.1)));
        let (point, velocity) = (DVec3::new(1.0, 2.0, 0.5), DVec3::new(-1.0, 0.5, 0.0));
        let path_m = |after: f64| pulse.path_after_m(point + velocity * (0.01 * after), after);
        let check = |terms: PathTerms, path_m: &dyn Fn(f64) -> f64| {
            // Central differences over one sample: the next term is 1e-6 of a path of about 10 m, at 1 m/s per
            // sample.
            let (before, at, after) = (path_m(-1.0), path_m(0.0), path_m(1.0));
            assert!((terms.path_m - at).abs() < 1e-14);
            assert!((terms.rate_m - (after - before) / 2.0).abs() < 1e-7);
            assert!((terms.bend_m - (after - 2.0 * at + before)).abs() < 1e-9);
        };
        check(pulse.path_terms(point, velocity), &path_m);
        let drift_m = |after: f64| pulse.reference_path_m + pulse.reference_drift_m(after);
        check(pulse.reference_terms(), &drift_m);
    }
}
