//! Speed limits of a sweep of stepped carriers.
//!
//! A stepped radar measures its `K` carriers one after another, one every `tau`, and repeats the sweep every `T >= K tau`. A scatterer of
//! range `r` and radial speed `v` has at carrier `f_c + d step`, taken at the time `s` from the middle of the sweep, the phase in turns
//!
//! ```text
//! -2 (f_c + d step) (r + v s) / c
//! ```
//!
//! **Displacement.** In ascending order `s = d tau`, and the phase is `-2 (f_c r + d (step r + f_c v tau) + d^2 step v tau) / c`. The
//! term in `d` is that of a scatterer at `r + f_c v tau / step`: motion and range are mixed. In resolution cells `c / (2 K step)` the
//! range profile is displaced by the change of the carrier's phase over the sweep in turns,
//!
//! ```text
//! D = 2 f_c v K tau / c
//! ```
//!
//! The term in `d^2` reaches `D B / (4 f_c)` turns at the edges of the band `B`, less than `D / 2`. The profile is in place if `D` is at
//! most [`DISPLACED_CELLS`]. Descending order displaces it in the opposite direction, and the mean of both is in place.
//!
//! **Phase from sweep to sweep.** A track is followed by the phase of each carrier between sweeps (slow time). It is ambiguous from half
//! a turn on, the Nyquist limit: `2 f v T / c <= 1/2` for the highest carrier. With sweeps back to back the profile is displaced by half a
//! cell at this limit.
//!
//! **Phase from carrier to carrier.** Beyond `2 f v tau / c = 1/2` the motion is ambiguous within a sweep: the displacement is half the
//! unambiguous range.
//!
//! How the limits change:
//!
//! - *Fewer carriers* shorten the sweep: the first two limits are inversely proportional to `K tau` and `T`. Every `M`-th carrier of the same
//!   band keeps the resolution and divides the unambiguous range by `M`.
//! - *Interleaved order* takes carriers `0, M, 2M, ...`, then `1, M + 1, ...`: each pass is a sweep of every `M`-th carrier with its limits,
//!   and the unambiguous range of all carriers is kept. A profile of all carriers is displaced by `D / M`. For `M = 2` the passes differ by `D / 2` turns, and
//!   without compensation a ghost of `tan(pi D / 2)` of the peak appears half the unambiguous range away.
//! - *Shuffled order* displaces no profile: motion reduces the peak to `sin(pi D) / (pi D)` and spreads the rest as noise.
//! - *Motion compensation within the sweep* by a predicted speed subtracts `2 f v s / c`: the limits then hold for the error of the speed.
//!   The prediction of a constant speed fails at the acceleration with `2 f a T^2 / c = 1/2`, the second difference of the phase between sweeps.
//!
//! A platform at speed `V` that looks broadside has the radial speeds `V sin(angle)`, up to half the beamwidth; without a beam any direction
//! counts, and the platform's limit is the radial one.

use serde::Serialize;

use crate::sampling::cross_range_resolution_m;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::phase_history::Collection;

/// Largest displacement of a range profile that is in place, resolution cells.
pub const DISPLACED_CELLS: f64 = 0.1;

/// Timing of a sweep whose carriers are measured one after another.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SteppedSweep {
    /// Centre of the band, hertz.
    pub centre_hz: f64,
    /// Frequency of the highest carrier, hertz.
    pub highest_hz: f64,
    /// Number of carriers per sweep.
    pub carriers: usize,
    /// Duration of a sweep, seconds.
    pub sweep_s: f64,
    /// Time from sweep to sweep, at least the duration, seconds.
    pub interval_s: f64,
}

/// Speed limits of a platform, metres per second.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SpeedLimits {
    /// Speed at which the range profile is displaced by [`DISPLACED_CELLS`] in ascending or descending order.
    pub in_place_m_s: f64,
    /// Speed at which the phase of the highest carrier changes by half a turn from sweep to sweep.
    pub followed_m_s: f64,
    /// Speed at which the phase of the highest carrier changes by half a turn from carrier to carrier.
    pub unwrapped_m_s: f64,
    /// Acceleration at which a prediction by constant speed is off by half a turn at the next sweep, metres per second squared.
    pub predicted_m_s2: f64,
}

/// Sweep of stepped carriers with its speed limits.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SweepPlan {
    /// Timing of the sweep.
    pub sweep: SteppedSweep,
    /// Full angle around broadside within which scatterers are followed, radians; pi for any direction.
    pub angle_rad: f64,
    /// Limits with all carriers in ascending or descending order.
    pub limits: SpeedLimits,
    /// Limits with every second carrier, or with two interleaved passes.
    pub halved: SpeedLimits,
    /// Speed of the platform, metres per second; `None` if unknown.
    pub platform_m_s: Option<f64>,
}

impl SteppedSweep {
    /// Timing of the sweeps of a recording, from its middle pulse. `interval_s` is the time from pulse to pulse; `None` takes the
    /// sweeps back to back. Returns `None` for simultaneous samples.
    pub fn of(collection: &Collection, interval_s: Option<f64>) -> Option<Self> {
        let pulse = collection.pulses.get(collection.pulses.len() / 2)?;
        let carrier_s = pulse.sweep.sample_s.abs();
        (carrier_s > 0.0).then(|| Self::new(collection, carrier_s, interval_s))?
    }

    /// Timing of sweeps over the band of a collection, with the time from carrier to carrier. `None` for a collection without pulses.
    pub fn new(collection: &Collection, carrier_s: f64, interval_s: Option<f64>) -> Option<Self> {
        let pulse = collection.pulses.get(collection.pulses.len() / 2)?;
        let carriers = collection.num_samples;
        let sweep_s = carriers as f64 * carrier_s;
        let edges_hz =
            [0.0, (carriers.saturating_sub(1)) as f64].map(|k| pulse.start_hz + k * pulse.step_hz);
        Some(Self {
            centre_hz: (edges_hz[0] + edges_hz[1]) / 2.0,
            highest_hz: edges_hz[0].max(edges_hz[1]),
            carriers,
            sweep_s,
            interval_s: interval_s.unwrap_or(sweep_s),
        })
    }

    /// Displacement of the range profile in ascending order at a radial speed, resolution cells: the change of the carrier's phase over
    /// the sweep in turns.
    pub fn displaced_cells(&self, radial_m_s: f64) -> f64 {
        2.0 * self.centre_hz * radial_m_s * self.sweep_s / SPEED_OF_LIGHT_M_S
    }

    /// Sweep of every `nth` carrier of the same band, in proportionally less time.
    pub fn every(&self, nth: usize) -> Self {
        let carriers = self.carriers.div_ceil(nth);
        let part = carriers as f64 / self.carriers as f64;
        Self {
            carriers,
            sweep_s: self.sweep_s * part,
            interval_s: self.interval_s * part,
            ..*self
        }
    }

    /// Speed limits for scatterers within a full angle around broadside, radians; pi for any direction.
    pub fn limits(&self, angle_rad: f64) -> SpeedLimits {
        // Distance along the track that changes the phase of a scatterer at the edge by half a turn.
        let half_turn_m =
            |hz: f64| cross_range_resolution_m(SPEED_OF_LIGHT_M_S / hz, angle_rad / 2.0);
        let highest_m = half_turn_m(self.highest_hz);
        SpeedLimits {
            in_place_m_s: 2.0 * DISPLACED_CELLS * half_turn_m(self.centre_hz) / self.sweep_s,
            followed_m_s: highest_m / self.interval_s,
            unwrapped_m_s: highest_m * self.carriers as f64 / self.sweep_s,
            predicted_m_s2: highest_m / self.interval_s.powi(2),
        }
    }
}

impl SweepPlan {
    /// Limits for scatterers within a full angle around broadside, radians; pi for any direction.
    pub fn new(sweep: SteppedSweep, angle_rad: f64, platform_m_s: Option<f64>) -> Self {
        Self {
            sweep,
            angle_rad,
            limits: sweep.limits(angle_rad),
            halved: sweep.every(2).limits(angle_rad),
            platform_m_s,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_complex::Complex64;
    use std::f64::consts::{PI, TAU};

    const C: f64 = 299_792_458.0;
    const START_HZ: f64 = 1.1e9;
    const STEP_HZ: f64 = 4e6;
    const CARRIERS: usize = 50;
    const CARRIER_S: f64 = 6e-3;
    /// Range resolution `c / 2 B` of 200 MHz, metres.
    const CELL_M: f64 = C / 400e6;
    const RANGE_M: f64 = 6.3;

    /// Radar of Chim 2018, 5.6, with 6 ms per carrier.
    fn sweep() -> SteppedSweep {
        SteppedSweep {
            centre_hz: 1.198e9,
            highest_hz: 1.296e9,
            carriers: CARRIERS,
            sweep_s: 0.3,
            interval_s: 0.3,
        }
    }

    /// Carrier number and sample of a point that recedes at `speed_m_s` and is at `RANGE_M` at time 0, for carriers taken in this order from
    /// `start_s` on. The echo is the wave of the two-way path at the carrier's time.
    fn samples(order: &[usize], start_s: f64, speed_m_s: f64) -> Vec<(usize, Complex64)> {
        let of = |(n, &k): (usize, &usize)| {
            let path_m = 2.0 * (RANGE_M + speed_m_s * (start_s + n as f64 * CARRIER_S));
            let carrier_hz = START_HZ + k as f64 * STEP_HZ;
            (k, Complex64::cis(-TAU * carrier_hz * path_m / C))
        };
        order.iter().enumerate().map(of).collect()
    }

    /// Range profile of these samples at a range: phases of a target at rest removed.
    fn profile(samples: &[(usize, Complex64)], range_m: f64) -> Complex64 {
        let sum: Complex64 = (samples.iter())
            .map(|&(k, sample)| {
                let carrier_hz = START_HZ + k as f64 * STEP_HZ;
                sample * Complex64::cis(TAU * carrier_hz * 2.0 * range_m / C)
            })
            .sum();
        sum / samples.len() as f64
    }

    /// Position of the peak within three cells of `from_m`, relative to it in cells, and its magnitude.
    fn peak(samples: &[(usize, Complex64)], from_m: f64) -> (f64, f64) {
        let at = |cells: f64| profile(samples, from_m + cells * CELL_M).norm();
        let steps = (-3000..=3000).map(|i| f64::from(i) * 1e-3);
        let best = steps.max_by(|a, b| at(*a).total_cmp(&at(*b))).unwrap();
        (best, at(best))
    }

    fn ascending() -> Vec<usize> {
        (0..CARRIERS).collect()
    }

    /// Start of a sweep whose middle, between its two middle carriers, is at time 0.
    fn centred_s() -> f64 {
        -(CARRIERS as f64 - 1.0) / 2.0 * CARRIER_S
    }

    #[test]
    fn limits_agree_with_closed_forms() {
        let limits = sweep().limits(PI);
        for (value, expected) in [
            // c / (20 1.198 GHz 0.3 s)
            (limits.in_place_m_s, C / (20.0 * 1.198e9 * 0.3)),
            // A quarter wavelength of 231.32 mm per sweep of 0.3 s, or per carrier of 6 ms.
            (limits.followed_m_s, 0.192_768),
            (limits.unwrapped_m_s, 9.638_389),
            // 2 a T^2 is half a wavelength.
            (limits.predicted_m_s2, 0.642_559),
        ] {
            assert!((value / expected - 1.0).abs() < 1e-5, "{value} {expected}");
        }
        assert!((sweep().displaced_cells(limits.in_place_m_s) - 0.1).abs() < 1e-12);
        // Within 10 degrees of broadside the radial speed is sin 10 degrees = 0.173648 of the platform's.
        let narrow = sweep().limits(20f64.to_radians());
        assert!((limits.followed_m_s / narrow.followed_m_s - 0.173_648).abs() < 1e-6);
        let halved = sweep().every(2).limits(PI);
        assert_eq!(halved.followed_m_s, 2.0 * limits.followed_m_s);
        assert_eq!(halved.in_place_m_s, 2.0 * limits.in_place_m_s);
        assert_eq!(halved.unwrapped_m_s, limits.unwrapped_m_s);
    }

    #[test]
    fn profile_of_moving_point_leaves_its_place_at_the_limit() {
        let limit_m_s = sweep().limits(PI).in_place_m_s;
        for (part, in_place) in [(0.5, true), (2.0, false)] {
            let swept = samples(&ascending(), centred_s(), part * limit_m_s);
            let (cells, level) = peak(&swept, RANGE_M);
            assert_eq!(cells.abs() <= 0.1, in_place, "{cells}");
            // The grid has 0.001 cells. The term in d^2 moves no symmetric peak.
            assert!((cells - 0.1 * part).abs() < 1.5e-3, "{cells}");
            // D B / (4 f_c) of 0.2 / 24 turns at the edges: the peak loses less than 1e-3.
            assert!(level > 0.999, "{level}");
        }
        // Descending order, at the same speed: the opposite direction, and the mean is in place.
        let up = peak(&samples(&ascending(), centred_s(), limit_m_s), RANGE_M).0;
        let down: Vec<usize> = ascending().into_iter().rev().collect();
        let down = peak(&samples(&down, centred_s(), limit_m_s), RANGE_M).0;
        assert!(down < -0.09 && (up + down).abs() < 2e-3, "{up} {down}");
    }

    #[test]
    fn phase_from_sweep_to_sweep_is_ambiguous_beyond_the_limit() {
        let limit_m_s = sweep().limits(PI).followed_m_s;
        // Speed by the phase of the highest carrier between two sweeps.
        let measured = |speed_m_s: f64| {
            let [first, second] = [0.0, 0.3].map(|start_s| {
                let swept = samples(&ascending(), start_s, speed_m_s);
                swept[CARRIERS - 1].1
            });
            -(second * first.conj()).arg() / TAU * C / (2.0 * 1.296e9 * 0.3)
        };
        for part in [0.5, 0.98] {
            let got = measured(part * limit_m_s);
            assert!(
                (got / (part * limit_m_s) - 1.0).abs() < 1e-6,
                "{part} {got}"
            );
        }
        // 1.02 of the limit is -0.98 of it.
        let got = measured(1.02 * limit_m_s);
        assert!((got / limit_m_s + 0.98).abs() < 1e-6, "{got}");
        // Two interleaved passes: phases of the whole pass at the range of the point, at 1.8 of the limit. Their carriers have a mean of
        // 1.196 GHz and 1.2 GHz, and the middle of the passes is 78 ms before and 72 ms after time 0: 1.196 78 + 1.2 72 = 1.19792 150.
        // The term in d^2 turns the phase of a pass of D = 0.416 by up to D B / (4 f_c) = 0.017 turns. It differs between the passes by B / f_c
        // of that, since the speed times the middle of a pass changes the slope: 0.003 turns of 0.416.
        let speed_m_s = 1.8 * limit_m_s;
        let pass = |first: usize, start_s: f64| {
            let order: Vec<usize> = (first..CARRIERS).step_by(2).collect();
            profile(&samples(&order, start_s, speed_m_s), RANGE_M)
        };
        let phase = (pass(1, 0.0) * pass(0, -0.15).conj()).arg();
        let got = -phase / TAU * C / (2.0 * 1.198e9 * 0.15);
        assert!((got / speed_m_s - 1.0).abs() < 7e-3, "{got} {speed_m_s}");
    }

    #[test]
    fn interleaved_and_shuffled_orders_follow_their_formulas() {
        let speed_m_s = 2.0 * sweep().limits(PI).in_place_m_s;
        let interleaved: Vec<usize> = [0, 1]
            .into_iter()
            .flat_map(|first| (first..CARRIERS).step_by(2))
            .collect();
        let swept = samples(&interleaved, centred_s(), speed_m_s);
        // D = 0.2, displaced by half of it. At the peak the response of the ghost, 0.32 at 25 cells, has the slope 0.32 pi / 50 = 0.02 per cell,
        // and the peak the curvature pi^2 / 3: they move it by up to 0.006 cells.
        let (cells, main) = peak(&swept, RANGE_M);
        assert!((cells - 0.1).abs() < 7e-3, "{cells}");
        let (_, ghost) = peak(&swept, RANGE_M + 25.0 * CELL_M);
        // tan(pi 0.2 / 2) = 0.3249. The passes are 24.5 of 50 carriers apart instead of 25: 2 % less.
        assert!(
            (ghost / main / 0.324_9 - 1.0).abs() < 0.03,
            "{ghost} {main}"
        );

        // 7 n mod 50 takes every carrier once.
        let shuffled: Vec<usize> = (0..CARRIERS).map(|n| 7 * n % CARRIERS).collect();
        let fast_m_s = 5.0 * sweep().limits(PI).in_place_m_s;
        let swept = samples(&shuffled, centred_s(), fast_m_s);
        let level = profile(&swept, RANGE_M).norm();
        // D = 0.5: 2 / pi. Carriers off the centre by up to B / (2 f_c) = 8 % change phases by up to D / 2 of this, 0.13 rad, with an RMS of
        // 0.05 rad: the sum by less than its square, and by its correlation with n, in quadrature.
        assert!((level - 2.0 / PI).abs() < 0.01, "{level}");
    }
}
