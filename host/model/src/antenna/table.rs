//! Antenna pattern from samples on a lattice of azimuth and elevation.
//!
//! The amplitude is `10^(gain_db / 20)` relative to the largest gain of the table, which is therefore 1: gains in dBi and gains relative to the
//! maximum give the same pattern. Between samples the amplitude is bilinear in azimuth and elevation. An axis of one value has no effect. The
//! amplitude is 0 outside of the table.
//!
//! Interpolation of a lattice with steps of a fraction `s` of the half-power width is off by at most `0.7 s^2` of the maximum in a Gaussian main
//! lobe (`f'' h^2 / 8` with `f'' = 4 ln 2 / w^2` in both axes): 0.7 % for ten samples in the width.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

/// Amplitude over a lattice of azimuth and elevation, 1 at its maximum. Copies share the samples.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Samples", into = "Samples")]
pub struct PatternTable {
    azimuth_rad: Arc<[f64]>,
    elevation_rad: Arc<[f64]>,
    /// Amplitudes, elevation by elevation, azimuths inside.
    amplitude: Arc<[f64]>,
}

/// Stored form of a table.
#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Samples {
    azimuth_rad: Vec<f64>,
    elevation_rad: Vec<f64>,
    gain_db: Vec<f64>,
}

impl TryFrom<Samples> for PatternTable {
    type Error = String;

    fn try_from(samples: Samples) -> Result<Self, String> {
        Self::new(samples.azimuth_rad, samples.elevation_rad, &samples.gain_db)
    }
}

impl From<PatternTable> for Samples {
    fn from(table: PatternTable) -> Self {
        Self {
            gain_db: table.gain_db(),
            azimuth_rad: table.azimuth_rad.to_vec(),
            elevation_rad: table.elevation_rad.to_vec(),
        }
    }
}

/// Smallest step of an axis, radians: values in degrees and radians then differ alike.
const LEAST_STEP_RAD: f64 = 1e-12;

/// Largest magnitude of a gain, dB.
const LARGEST_DB: f64 = 400.0;

impl PatternTable {
    /// Make a table of gains in dB, elevation by elevation with azimuths inside. Both axes ascend; azimuths lie within 180 degrees of the
    /// boresight, elevations within 90 degrees.
    ///
    /// # Errors
    /// A message that names the axis, or the first gain that is not within 400 dB of 0.
    pub fn new(
        azimuth_rad: Vec<f64>,
        elevation_rad: Vec<f64>,
        gain_db: &[f64],
    ) -> Result<Self, String> {
        let axes = [
            ("azimuth", &azimuth_rad, std::f64::consts::PI),
            ("elevation", &elevation_rad, std::f64::consts::FRAC_PI_2),
        ];
        for (name, axis, most_rad) in axes {
            let within = axis.iter().all(|x| x.abs() <= most_rad * (1.0 + 1e-12));
            let ascends = axis
                .windows(2)
                .all(|pair| pair[1] - pair[0] > LEAST_STEP_RAD);
            if axis.is_empty() || !within || !ascends {
                return Err(format!(
                    "expected ascending values of {name} within {:.0} degrees",
                    most_rad.to_degrees()
                ));
            }
        }
        if Some(gain_db.len()) != azimuth_rad.len().checked_mul(elevation_rad.len()) {
            return Err(format!(
                "expected a gain for each of {} azimuths and {} elevations, found {}",
                azimuth_rad.len(),
                elevation_rad.len(),
                gain_db.len()
            ));
        }
        if let Some(gain) = gain_db
            .iter()
            .find(|gain| gain.is_nan() || gain.abs() > LARGEST_DB)
        {
            return Err(format!(
                "expected gains of -{LARGEST_DB} to {LARGEST_DB} dB, found {gain}"
            ));
        }
        let most_db = gain_db.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let amplitude = |gain: &f64| libm::pow(10.0, (gain - most_db) / 20.0);
        Ok(Self {
            amplitude: gain_db.iter().map(amplitude).collect(),
            azimuth_rad: azimuth_rad.into(),
            elevation_rad: elevation_rad.into(),
        })
    }

    /// The pattern with half of the dB: that of each of two equal antennas whose two-way pattern this is.
    #[must_use]
    pub fn per_antenna(mut self) -> Self {
        self.amplitude = self.amplitude.iter().map(|a| a.sqrt()).collect();
        self
    }

    /// Azimuths of the lattice, radians, ascending.
    pub fn azimuth_rad(&self) -> &[f64] {
        &self.azimuth_rad
    }

    /// Elevations of the lattice, radians, ascending.
    pub fn elevation_rad(&self) -> &[f64] {
        &self.elevation_rad
    }

    /// Gains in dB relative to the maximum, elevation by elevation with azimuths inside.
    pub fn gain_db(&self) -> Vec<f64> {
        let gain = |a: &f64| (20.0 * libm::log10(*a)).max(-LARGEST_DB);
        self.amplitude.iter().map(gain).collect()
    }

    /// Amplitude in a direction: bilinear between samples, 0 outside of the table.
    pub fn amplitude(&self, azimuth_rad: f64, elevation_rad: f64) -> f64 {
        let columns = self.azimuth_rad.len();
        let (Some((column, right)), Some((row, above))) = (
            place(&self.azimuth_rad, azimuth_rad),
            place(&self.elevation_rad, elevation_rad),
        ) else {
            return 0.0;
        };
        let across = |row: usize| {
            let line = &self.amplitude[row * columns..(row + 1) * columns];
            match right > 0.0 {
                true => line[column] + right * (line[column + 1] - line[column]),
                false => line[column],
            }
        };
        match above > 0.0 {
            true => (1.0 - above) * across(row) + above * across(row + 1),
            false => across(row),
        }
    }

    /// Full half-power widths in azimuth and in elevation, radians, in the cuts through the maximum; `None` along an axis whose gain does not
    /// fall to half of its power on both sides.
    pub fn widths_rad(&self) -> [Option<f64>; 2] {
        let columns = self.azimuth_rad.len();
        let peak = (0..self.amplitude.len())
            .max_by(|&a, &b| self.amplitude[a].total_cmp(&self.amplitude[b]))
            .unwrap_or(0);
        let (row, column) = (peak / columns, peak % columns);
        let azimuths: Vec<f64> = self.amplitude[row * columns..(row + 1) * columns].to_vec();
        let rows = self.elevation_rad.len();
        let elevations: Vec<f64> = (0..rows)
            .map(|row| self.amplitude[row * columns + column])
            .collect();
        [
            width(&self.azimuth_rad, &azimuths, column),
            width(&self.elevation_rad, &elevations, row),
        ]
    }
}

/// Index of the sample at or below a value, and the fraction of the step beyond it; `None` outside. An axis of one sample covers all values.
fn place(axis: &[f64], value: f64) -> Option<(usize, f64)> {
    let [first, .., last] = *axis else {
        return Some((0, 0.0));
    };
    if !(first..=last).contains(&value) {
        return None;
    }
    let below = axis.partition_point(|x| *x <= value) - 1;
    match axis.get(below + 1) {
        Some(next) => Some((below, (value - axis[below]) / (next - axis[below]))),
        None => Some((below, 0.0)),
    }
}

/// Width between the half-power points about a maximum.
fn width(axis: &[f64], amplitude: &[f64], peak: usize) -> Option<f64> {
    let least = amplitude[peak] * std::f64::consts::FRAC_1_SQRT_2;
    let crossing = |inside: usize, outside: usize| {
        let [a, b] = [amplitude[inside], amplitude[outside]];
        axis[inside] + (axis[outside] - axis[inside]) * (a - least) / (a - b)
    };
    let after = (peak + 1..axis.len()).find(|&i| amplitude[i] <= least)?;
    let before = (0..peak).rev().find(|&i| amplitude[i] <= least)?;
    Some(crossing(after - 1, after) - crossing(before + 1, before))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two elevations and three azimuths with round amplitudes: 1, 1/2 and 1/4 are 0, -6.02 and -12.04 dB.
    fn table() -> PatternTable {
        let db = |a: f64| 7.0 + 20.0 * a.log10();
        let gains = [0.5, 1.0, 0.25, 0.25, 0.5, 0.125].map(db);
        PatternTable::new(vec![-0.2, 0.0, 0.1], vec![0.0, 0.4], &gains).unwrap()
    }

    #[test]
    fn amplitude_is_bilinear_and_relative_to_maximum() {
        let table = table();
        for (azimuth, elevation, expected) in [
            (0.0, 0.0, 1.0),
            (-0.2, 0.0, 0.5),
            (0.1, 0.4, 0.125),
            // Half of each step: the mean of the four samples about the point.
            (-0.1, 0.2, (0.5 + 1.0 + 0.25 + 0.5) / 4.0),
            // A quarter of a step in azimuth, three quarters in elevation.
            (
                0.025,
                0.3,
                0.25 * (0.75 + 0.0625) + 0.75 * (0.375 + 0.03125),
            ),
            (0.101, 0.0, 0.0),
            (0.0, -0.001, 0.0),
        ] {
            let amplitude = table.amplitude(azimuth, elevation);
            // Powers and sums of numbers of order 1 round to some 1e-16 each.
            assert!(
                (amplitude - expected).abs() < 1e-14,
                "{azimuth} {elevation}: {amplitude}"
            );
        }
        let each = table.per_antenna();
        assert!((each.amplitude(-0.2, 0.0) - 0.5f64.sqrt()).abs() < 1e-14);
    }

    #[test]
    fn cut_of_one_elevation_covers_all_elevations_and_has_half_power_width() {
        // A triangle of amplitude: half the power at 1 - 1/sqrt 2 of its base on either side.
        let cut = PatternTable::new(vec![-0.1, 0.0, 0.1], vec![0.0], &[-40.0, 0.0, -40.0]).unwrap();
        assert_eq!(cut.amplitude(0.0, 1.2), 1.0);
        let [azimuth, elevation] = cut.widths_rad();
        let expected = 0.2 * (1.0 - 0.5f64.sqrt()) / 0.99;
        assert!((azimuth.unwrap() - expected).abs() < 1e-12);
        assert_eq!(elevation, None);
        assert_eq!(cut.amplitude(0.2, 0.0), 0.0);
    }

    #[test]
    fn table_survives_storage_and_refuses_bad_axes() {
        let table = table();
        let text = serde_json::to_string(&table).unwrap();
        let again: PatternTable = serde_json::from_str(&text).unwrap();
        for (a, b) in table.amplitude.iter().zip(&*again.amplitude) {
            assert!((a - b).abs() < 1e-14);
        }
        for (azimuth, gains, message) in [
            (vec![0.0, 0.0], vec![0.0; 2], "ascending values of azimuth"),
            (vec![0.0, 4.0], vec![0.0; 2], "within 180 degrees"),
            (vec![], vec![], "azimuth"),
            (vec![0.0, 1.0], vec![0.0; 3], "found 3"),
            (vec![0.0, 1.0], vec![0.0, f64::NAN], "found NaN"),
            (vec![0.0, 1.0], vec![0.0, -1e9], "expected gains"),
        ] {
            let error = PatternTable::new(azimuth, vec![0.0], &gains).unwrap_err();
            assert!(error.contains(message), "{error}");
        }
    }
}
