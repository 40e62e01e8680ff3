//! Delays from transmission through reflection to reception.
//!
//! For a wave received at time `t`, with the antennas at `r(t)` (receiver) and `q(t)` (transmitter) and the scatterer
//! at `p(t)`,
//!
//! ```text
//! back = |r(t) - p(t - back)| / c,    tau = back + |q(t - tau) - p(t - back)| / c
//! ```
//!
//! Both are fixed points solved by iteration. Every iteration reduces the error by `v / c`, at most 1e-5 for aircraft
//! and satellites. The iteration ends when a step changes less than 1e-15 s, with an error below 1e-20 s (1e-9 turns at
//! 100 GHz). With stop-and-go, all positions are those at the pulse's time.

use glam::DVec3;

use super::View;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::radar::Motion;

/// Change of delay at which the iteration ends, seconds; the next change is below rounding.
const SETTLED_S: f64 = 1e-15;
/// Maximum number of iterations; not reached even at a hundredth of the speed of light.
const MAX_ROUNDS: usize = 12;

impl View<'_> {
    /// Position of the transmit antenna, metres.
    pub(super) fn transmitter_m(&self, time_s: f64) -> DVec3 {
        self.body.pose(time_s).point_m(self.transmitter.offset_m)
    }

    /// Position of the receive antenna, metres.
    pub(super) fn receiver_m(&self, time_s: f64) -> DVec3 {
        self.body.pose(time_s).point_m(self.receiver.offset_m)
    }

    /// Time of sample `k`, seconds.
    pub(super) fn sample_s(&self, k: f64) -> f64 {
        self.time_s + self.sweep.start_s + k * self.sweep.step_s
    }

    /// Time at which amplitudes and visibility are evaluated, seconds: that of the pulse, or the middle of the sweep.
    pub(super) fn middle_s(&self) -> f64 {
        match self.motion {
            Motion::StopAndGo => self.time_s,
            Motion::True => self.sample_s((self.sweep.count.max(1) - 1) as f64 / 2.0),
        }
    }

    /// Delay of a scatterer at `place(t)`, received at `time_s` at `receiver_m`; `guess_s` is a starting value. In
    /// seconds.
    pub(super) fn delay_s(
        &self,
        place: impl Fn(f64) -> DVec3,
        time_s: f64,
        receiver_m: DVec3,
        guess_s: f64,
    ) -> f64 {
        let mut back_s = guess_s / 2.0;
        let mut point_m = place(time_s - back_s);
        for _ in 0..MAX_ROUNDS {
            let next_s = receiver_m.distance(point_m) / SPEED_OF_LIGHT_M_S;
            let change_s = (next_s - back_s).abs();
            back_s = next_s;
            point_m = place(time_s - back_s);
            if change_s < SETTLED_S {
                break;
            }
        }
        let mut delay_s = guess_s;
        for _ in 0..MAX_ROUNDS {
            let out_m = self.transmitter_m(time_s - delay_s).distance(point_m);
            let next_s = back_s + out_m / SPEED_OF_LIGHT_M_S;
            let change_s = (next_s - delay_s).abs();
            delay_s = next_s;
            if change_s < SETTLED_S {
                break;
            }
        }
        delay_s
    }
}
