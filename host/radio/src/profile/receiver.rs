//! Calibration of one receiver: response of the empty scene, and delay and amplitude from reflectors at known ranges.

use num_complex::Complex64;
use serde::{Deserialize, Serialize};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_signal::phase::phasor;

use super::error::{CalibrationError, ProfileError};
use super::scatterers::PointScatterer;
use super::sweep::Sweep;

/// Largest difference of the delays of two reflectors, metres: larger ones are errors of the survey.
const SAME_DELAY_M: f64 = 0.3;

/// Level of the weakest scatterers in a calibration relative to the strongest, dB.
const FLOOR_DB: f64 = 40.0;

/// Reflector of a calibration.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Reflector {
    /// Surveyed range, half the path from transmitter to reflector to receiver, metres.
    pub range_m: f64,
    /// Measured range minus surveyed range and common delay, metres.
    pub residual_m: f64,
    /// Standard deviation of the measured range by noise, metres.
    pub sigma_m: f64,
    /// Amplitude.
    pub amplitude: f64,
}

/// Calibration of one receiver.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Receiver {
    /// Delay to subtract, seconds.
    pub delay_s: f64,
    /// Standard deviation of the delay, seconds: by noise, or by the residuals of several reflectors if they are larger.
    #[serde(default)]
    pub delay_sigma_s: Option<f64>,
    /// Complex amplitude of the first reflector, real and imaginary parts.
    pub amplitude: [f64; 2],
    /// Reflectors with their residuals.
    #[serde(default)]
    pub reflectors: Vec<Reflector>,
    /// Response of the empty scene at each carrier, real and imaginary parts.
    pub sky: Vec<[f64; 2]>,
}

impl Receiver {
    /// Calibrate a receiver with a sweep from which the sky is subtracted. The reflectors are at half the paths from
    /// transmitter to reflector to receiver, `ranges_m`, plus a common delay of at most `search_m`.
    pub(super) fn of(
        sweep: &Sweep,
        sky: &[Complex64],
        ranges_m: &[f64],
        search_m: f64,
        reach_m: f64,
    ) -> Result<Self, ProfileError> {
        check_apart(sweep, ranges_m)?;
        let seen = sweep.scatterers(FLOOR_DB, reach_m)?;
        let matched = matched(&seen, ranges_m, search_m)?;
        let pairs = || ranges_m.iter().zip(&matched);
        let count = ranges_m.len() as f64;
        let late_m = pairs()
            .map(|(range_m, found)| found.range_m - range_m)
            .sum::<f64>()
            / count;
        let reflectors: Vec<Reflector> = pairs()
            .map(|(&range_m, found)| Reflector {
                range_m,
                residual_m: found.range_m - range_m - late_m,
                sigma_m: found.sigma_m,
                amplitude: found.amplitude.norm(),
            })
            .collect();
        // The residuals also contain errors of the survey and of reflectors that are not points.
        let root = |of: fn(&Reflector) -> f64| {
            reflectors
                .iter()
                .map(|one| of(one).powi(2))
                .sum::<f64>()
                .sqrt()
        };
        let noise_m = root(|one| one.sigma_m) / count;
        let spread_m = root(|one| one.residual_m) / (count * (count - 1.0).max(1.0)).sqrt();
        let sigma_m = noise_m.max(spread_m);
        // Response of the first reflector at its surveyed range.
        let middle_hz =
            sweep.frequency_hz(0) + 0.5 * (sweep.values.len() as f64 - 1.0) * sweep.step_hz;
        let turns = 2.0 * middle_hz * reflectors[0].residual_m / SPEED_OF_LIGHT_M_S;
        let amplitude = matched[0].amplitude * phasor(-turns);
        Ok(Self {
            delay_s: 2.0 * late_m / SPEED_OF_LIGHT_M_S,
            delay_sigma_s: Some(2.0 * sigma_m / SPEED_OF_LIGHT_M_S),
            amplitude: [amplitude.re, amplitude.im],
            reflectors,
            sky: sky.iter().map(|z| [z.re, z.im]).collect(),
        })
    }

    /// Response of the empty scene at each carrier.
    pub(super) fn sky(&self) -> impl Iterator<Item = Complex64> {
        self.sky.iter().map(|z| Complex64::new(z[0], z[1]))
    }

    /// Sweep without the delay and amplitude of the receiver.
    pub(super) fn corrected(&self, sweep: &Sweep) -> Sweep {
        let amplitude = Complex64::new(self.amplitude[0], self.amplitude[1]);
        let value = |(n, value): (usize, &Option<Complex64>)| {
            value.map(|z| z * phasor(sweep.frequency_hz(n) * self.delay_s) / amplitude)
        };
        Sweep {
            values: sweep.values.iter().enumerate().map(value).collect(),
            ..sweep.clone()
        }
    }
}

/// Refuse reflectors that are closer than the range resolution: both would be one scatterer.
fn check_apart(sweep: &Sweep, ranges_m: &[f64]) -> Result<(), ProfileError> {
    let bandwidth_hz = sweep.values.len() as f64 * sweep.step_hz.abs();
    let resolution_m = SPEED_OF_LIGHT_M_S / (2.0 * bandwidth_hz);
    let mut sorted = ranges_m.to_vec();
    sorted.sort_by(f64::total_cmp);
    let close = sorted.windows(2).find(|two| two[1] - two[0] < resolution_m);
    match close {
        None => Ok(()),
        Some(two) => Err(ProfileError::Options(format!(
            "expected reflectors farther apart than the range resolution of {resolution_m:.2} m, found reflectors at {} m and {} m: leave one out",
            two[0], two[1]
        ))),
    }
}

/// Scatterers of the reflectors at a common delay of at most `search_m` metres, those with the largest power in all.
fn matched(
    seen: &[PointScatterer],
    ranges_m: &[f64],
    search_m: f64,
) -> Result<Vec<PointScatterer>, ProfileError> {
    let Some(&first_m) = ranges_m.first() else {
        return Err(ProfileError::Options(
            "expected the range of at least one reflector".to_owned(),
        ));
    };
    let nearest = |range_m: f64| {
        let off = |one: &&PointScatterer| (one.range_m - range_m).abs();
        seen.iter()
            .min_by(|a, b| off(a).total_cmp(&off(b)))
            .copied()
    };
    let delays = seen.iter().map(|one| one.range_m - first_m);
    let choices = delays
        .filter(|late_m| late_m.abs() <= search_m)
        .map(|late_m| {
            let each = ranges_m.iter().map(|range_m| {
                nearest(range_m + late_m).map(|one| (one, one.range_m - range_m - late_m))
            });
            each.collect::<Option<Vec<_>>>().unwrap_or_default()
        });
    let mut choices: Vec<Vec<(PointScatterer, f64)>> = choices.collect();
    let is_complete = |choice: &[(PointScatterer, f64)]| {
        choice.iter().all(|(_, off_m)| off_m.abs() <= SAME_DELAY_M)
    };
    let power = |choice: &[(PointScatterer, f64)]| {
        choice
            .iter()
            .map(|(one, _)| one.amplitude.norm_sqr())
            .sum::<f64>()
    };
    choices.sort_by(|a, b| power(b).total_cmp(&power(a)));
    if let Some(choice) = choices.iter().find(|choice| is_complete(choice)) {
        return Ok(choice.iter().map(|(one, _)| *one).collect());
    }
    let lost = choices.first().and_then(|choice| {
        let all = choice.iter().zip(ranges_m);
        all.filter(|((_, off_m), _)| off_m.abs() > SAME_DELAY_M)
            .map(|(_, range_m)| *range_m)
            .next()
    });
    Err(CalibrationError::NotSeen {
        range_m: lost.unwrap_or(first_m),
    }
    .into())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two echoes at 5 and 8 m, and a survey with a reflector next to one of them.
    #[test]
    fn reflectors_within_a_resolution_cell_are_refused() {
        let step_hz = 4e6;
        let values = (0..50).map(|n| {
            let cycles = 2.0 * (1.1e9 + f64::from(n) * step_hz) / SPEED_OF_LIGHT_M_S;
            Some(phasor(-cycles * 5.0) + phasor(-cycles * 8.0))
        });
        let sweep = Sweep {
            start_hz: 1.1e9,
            step_hz,
            values: values.collect(),
            times_s: vec![0.0; 50],
        };
        let of = |ranges_m: &[f64]| Receiver::of(&sweep, &[], ranges_m, 1.0, 20.0);
        assert!(of(&[8.0, 5.0]).unwrap().delay_s.abs() < 1e-12);
        // 200 MHz have a resolution of 0.75 m.
        let error = of(&[8.0, 5.0, 8.5]).unwrap_err().to_string();
        assert!(
            error.contains("0.75 m, found reflectors at 8 m and 8.5 m"),
            "{error}"
        );
    }
}
