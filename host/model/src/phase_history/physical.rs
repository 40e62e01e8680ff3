//! Physical limits of the numbers in a recording. Readers refuse numbers outside these limits: no radar measures them, and sums
//! over them are not finite.
//!
//! | number | limits | extreme known use |
//! |---|---|---|
//! | frequency | 1 kHz to 10^15 Hz | from sounding with kHz to lidar at 2 10^14 Hz |
//! | step of frequency | 10^-6 Hz to 10^15 Hz | |
//! | position, each coordinate in the scene frame; path | 10^10 m | the Moon is 4 10^8 m away |
//! | time | 10^11 s, 3000 years | seconds since 1970 are 2 10^9 |

use glam::DVec3;

use super::Pulse;

/// Lower limit of a frequency, hertz.
const MIN_HZ: f64 = 1e3;
/// Upper limit of a frequency, hertz.
const MAX_HZ: f64 = 1e15;
/// Minimum frequency step, hertz.
const MIN_STEP_HZ: f64 = 1e-6;
/// Maximum magnitude of a coordinate, metres.
const FARTHEST_M: f64 = 1e10;
/// Maximum magnitude of a time, seconds.
const LONGEST_S: f64 = 1e11;

/// Describe the fault of a band of `count` frequencies; `None` if it is valid.
pub fn band_fault(start_hz: f64, step_hz: f64, count: usize) -> Option<String> {
    let last_hz = start_hz + step_hz * count.saturating_sub(1) as f64;
    if !(MIN_STEP_HZ..=MAX_HZ).contains(&step_hz) {
        return Some(format!(
            "expected a frequency step from {MIN_STEP_HZ:e} to {MAX_HZ:e} Hz, found {step_hz:e} Hz"
        ));
    }
    [start_hz, last_hz]
        .into_iter()
        .find(|hz| !(MIN_HZ..=MAX_HZ).contains(hz))
        .map(|hz| format!("expected a frequency from {MIN_HZ:e} to {MAX_HZ:e} Hz, found {hz:e} Hz"))
}

/// Describe the fault of a position or vector of the scene frame; `None` if it is valid.
pub fn position_fault(name: &str, position_m: DVec3) -> Option<String> {
    let within = position_m.abs().max_element() <= FARTHEST_M && position_m.is_finite();
    (!within).then(|| {
        let [x, y, z] = position_m.to_array();
        format!("its {name} at ({x:e}, {y:e}, {z:e}) m is not within {FARTHEST_M:e} m of the scene")
    })
}

/// Describe the fault of a time; `None` if it is valid.
pub fn time_fault(time_s: f64) -> Option<String> {
    (time_s.is_nan() || time_s.abs() > LONGEST_S)
        .then(|| format!("its time {time_s:e} s is not within {LONGEST_S:e} s: give seconds"))
}

impl Pulse {
    /// Describe the first number of this pulse of `num_samples` that is not finite or is outside the physical limits;
    /// `None` if all are valid.
    pub fn fault(&self, num_samples: usize) -> Option<String> {
        let path_m = self.reference_path_m;
        band_fault(self.start_hz, self.step_hz, num_samples)
            .or_else(|| position_fault("transmitter", self.transmitter_m))
            .or_else(|| position_fault("receiver", self.receiver_m))
            .or_else(|| position_fault("reference point", self.reference_m))
            .or_else(|| {
                (path_m.is_nan() || path_m.abs() > 4.0 * FARTHEST_M).then(|| {
                    let most_m = 4.0 * FARTHEST_M;
                    format!("its reference path of {path_m:e} m is not within {most_m:e} m")
                })
            })
            .or_else(|| time_fault(self.time_s))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phase_history::Sweep;

    #[test]
    fn fault_states_the_expected_range_and_the_value() {
        let good = Pulse {
            time_s: 1.7e9,
            transmitter_m: DVec3::splat(7e6),
            receiver_m: DVec3::splat(-4e8),
            reference_m: DVec3::ZERO,
            reference_path_m: 0.0,
            start_hz: 9e9,
            step_hz: 1e6,
            sweep: Sweep::AT_ONCE,
            recorded_path_m: None,
        };
        assert_eq!(good.fault(1000), None);
        type Spoil = fn(&mut Pulse);
        let faults: [(Spoil, &str); 10] = [
            (|p| p.start_hz = 5e245, "5e245 Hz"),
            (|p| p.start_hz = -9e9, "-9e9 Hz"),
            (|p| p.start_hz = f64::NAN, "NaN Hz"),
            (|p| p.step_hz = 1e14, "found 9.9"),
            (
                |p| p.step_hz = 0.0,
                "step from 1e-6 to 1e15 Hz, found 0e0 Hz",
            ),
            (|p| p.step_hz = f64::INFINITY, "found inf Hz"),
            (
                |p| p.transmitter_m.y = 1e300,
                "transmitter at (7e6, 1e300, 7e6) m",
            ),
            (|p| p.receiver_m.z = f64::NAN, "receiver"),
            (|p| p.reference_path_m = -1e11, "reference path"),
            (|p| p.time_s = 1e12, "give seconds"),
        ];
        for (spoil, part) in faults {
            let mut pulse = good;
            spoil(&mut pulse);
            let what = pulse.fault(1000).unwrap();
            assert!(what.contains(part), "{what}");
        }
    }
}
