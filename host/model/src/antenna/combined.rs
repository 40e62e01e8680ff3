//! Two-way amplitude of both antennas of a channel over pulses and points, for matched weights of image formation (Chim 2018, 3.2.1).
//!
//! ```text
//! A_n(p) = A_tx(direction from the transmitter at pulse n to p) A_rx(direction from the receiver at pulse n to p)
//! W_n(c) = |A_n(c)|,  where A_n(c) has the sign of the largest and |A_n(c)| >= FLOOR max_m |A_m(c)|;  0 elsewhere
//! ```
//!
//! The point `c` is seen in the pulses from the first to the last with `W_n(c) > 0`, and in no pulse if the largest amplitude is below [`LEAST`].
//!
//! Attitudes are stored at as few times as keep interpolated ones within 1e-4 of the narrowest half-power width: an amplitude error of 0.03 % on the flank of
//! a Gaussian two-way pattern.

use std::ops::Range;

use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

use super::{Antenna, MountedAntennas, Pattern};

/// Smallest two-way amplitude of a pulse that forms a point, relative to the largest at the point: -20 dB.
pub const FLOOR: f64 = 0.1;

/// Smallest two-way amplitude, relative to boresight, of a point that is formed: -40 dB.
pub const LEAST: f64 = 0.01;

/// Largest error of interpolated attitudes, relative to the narrowest half-power width.
const ATTITUDE_ERROR: f64 = 1e-4;

/// Patterns of a transmitting and a receiving antenna with the attitudes of their bodies over time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored", into = "Stored")]
pub struct AntennaPatterns {
    antennas: [Antenna; 2],
    times_s: Vec<f64>,
    attitudes: Vec<[DQuat; 2]>,
}

/// Stored form of patterns.
#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Stored {
    antennas: [Antenna; 2],
    times_s: Vec<f64>,
    attitudes: Vec<[DQuat; 2]>,
}

impl TryFrom<Stored> for AntennaPatterns {
    type Error = String;

    fn try_from(stored: Stored) -> Result<Self, String> {
        let ascends = stored.times_s.windows(2).all(|pair| pair[0] < pair[1]);
        if stored.times_s.len() != stored.attitudes.len() || stored.times_s.is_empty() || !ascends {
            return Err(format!(
                "expected attitudes at ascending times, found {} times and {} attitudes",
                stored.times_s.len(),
                stored.attitudes.len()
            ));
        }
        let is_unit = |attitude: &DQuat| (attitude.length_squared() - 1.0).abs() < 1e-6;
        if !stored.attitudes.iter().flatten().all(is_unit) {
            return Err("expected attitudes as unit quaternions".to_owned());
        }
        Ok(Self {
            antennas: stored.antennas,
            times_s: stored.times_s,
            attitudes: stored.attitudes,
        })
    }
}

impl From<AntennaPatterns> for Stored {
    fn from(patterns: AntennaPatterns) -> Self {
        Self {
            antennas: patterns.antennas,
            times_s: patterns.times_s,
            attitudes: patterns.attitudes,
        }
    }
}

impl AntennaPatterns {
    /// Patterns of antennas mounted on bodies with an attitude at each of `times_s`. `None` if neither antenna has a pattern, or times do not ascend or
    /// differ in number from the attitudes.
    pub fn new(mounted: &MountedAntennas, times_s: &[f64]) -> Option<Self> {
        let ascends = times_s.windows(2).all(|pair| pair[0] < pair[1]);
        let attitudes = &mounted.attitudes;
        if !mounted.is_directive()
            || !ascends
            || times_s.is_empty()
            || attitudes.len() != times_s.len()
        {
            return None;
        }
        let narrowest = mounted.antennas.iter().filter_map(Antenna::narrowest_rad);
        let most_rad = ATTITUDE_ERROR * narrowest.fold(1.0, f64::min);
        let last = times_s.len() - 1;
        let mut intervals = 1;
        loop {
            let mut chosen: Vec<usize> = (0..=intervals).map(|i| i * last / intervals).collect();
            chosen.dedup();
            let is_still = attitudes.iter().all(|own| *own == attitudes[0]);
            if is_still {
                chosen.truncate(1);
            }
            let stored = Self {
                antennas: mounted.antennas.clone(),
                times_s: chosen.iter().map(|&n| times_s[n]).collect(),
                attitudes: chosen.iter().map(|&n| attitudes[n]).collect(),
            };
            let close = |(time_s, own): (&f64, &[DQuat; 2])| {
                let between = stored.attitudes_at(*time_s);
                (0..2).all(|i| angle_rad(between[i], own[i]) <= most_rad)
            };
            if intervals >= last || is_still || times_s.iter().zip(attitudes).all(close) {
                return Some(stored);
            }
            intervals = (2 * intervals).min(last);
        }
    }

    /// Transmitting and receiving antenna.
    pub fn antennas(&self) -> &[Antenna; 2] {
        &self.antennas
    }

    /// Attitudes at a time, interpolated; constant before the first and after the last.
    fn attitudes_at(&self, time_s: f64) -> [DQuat; 2] {
        let last = self.times_s.len() - 1;
        let after = self.times_s.partition_point(|&t| t <= time_s).min(last);
        let before = after.saturating_sub(1);
        let span_s = self.times_s[after] - self.times_s[before];
        let part = match span_s > 0.0 {
            true => ((time_s - self.times_s[before]) / span_s).clamp(0.0, 1.0),
            false => 0.0,
        };
        [0, 1].map(|i| self.attitudes[before][i].lerp(self.attitudes[after][i], part))
    }

    /// Two-way pattern over pulses, each with its time and the positions of transmitter and receiver.
    pub fn over(&self, pulses: impl Iterator<Item = (f64, [DVec3; 2])>) -> CombinedPattern {
        let looks = pulses.map(|(time_s, places_m)| {
            let attitudes = self.attitudes_at(time_s);
            [0, 1].map(|i| Look {
                from_m: places_m[i],
                axes: self.antennas[i].axes(attitudes[i], places_m[i]),
            })
        });
        let [transmitter, receiver] = &self.antennas;
        CombinedPattern {
            is_same: transmitter.pattern == receiver.pattern,
            patterns: self.antennas.each_ref().map(|one| one.pattern.clone()),
            looks: looks.collect(),
        }
    }
}

/// Angle between two attitudes, radians. Its sine loses no digits for small angles.
fn angle_rad(a: DQuat, b: DQuat) -> f64 {
    let turn = a * b.conjugate();
    2.0 * libm::asin(DVec3::new(turn.x, turn.y, turn.z).length().min(1.0))
}

/// Position and axes of an antenna at a pulse.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Look {
    from_m: DVec3,
    /// Boresight, left and up.
    axes: [DVec3; 3],
}

/// Two-way amplitude of both antennas at each pulse.
#[derive(Clone, Debug)]
pub struct CombinedPattern {
    /// Whether both antennas have the same pattern.
    is_same: bool,
    patterns: [Pattern; 2],
    looks: Vec<[Look; 2]>,
}

impl CombinedPattern {
    /// Memory of a pulse, bytes.
    pub const PULSE_BYTES: u64 = size_of::<[Look; 2]>() as u64;

    /// Number of pulses that the pattern covers.
    pub fn num_pulses(&self) -> usize {
        self.looks.len()
    }

    /// Two-way amplitude at a point in a pulse; negative where the echo has the opposite sign.
    pub fn amplitude(&self, pulse: usize, point_m: DVec3) -> f64 {
        let [from, to] = &self.looks[pulse];
        let one = |pattern: &Pattern, look: &Look| match pattern {
            Pattern::Isotropic => 1.0,
            _ => {
                let towards = (point_m - look.from_m).normalize_or_zero();
                pattern.amplitude(look.axes.map(|axis| towards.dot(axis)))
            }
        };
        let out = one(&self.patterns[0], from);
        match self.is_same && from == to {
            true => out * out,
            false => out * one(&self.patterns[1], to),
        }
    }

    /// Pulses within a range that see a point, and the amplitude of largest magnitude there, with its sign. The range is empty where no amplitude
    /// reaches [`LEAST`].
    pub fn seeing(&self, within: Range<usize>, point_m: DVec3) -> (Range<usize>, f64) {
        let amplitudes: Vec<f64> = within.clone().map(|n| self.amplitude(n, point_m)).collect();
        let larger = |most: f64, &a: &f64| if a.abs() > most.abs() { a } else { most };
        let peak = amplitudes.iter().fold(0.0, larger);
        if peak.abs() < LEAST {
            return (within.start..within.start, peak);
        }
        let sees = |a: &f64| weight(*a, peak) > 0.0;
        let first = amplitudes.iter().position(sees).unwrap_or(0);
        let last = amplitudes.iter().rposition(sees).unwrap_or(0);
        (within.start + first..within.start + last + 1, peak)
    }

    /// Weight `W_n(c)` of a pulse at a point whose amplitude of largest magnitude is `peak`.
    pub fn weight(&self, pulse: usize, point_m: DVec3, peak: f64) -> f64 {
        weight(self.amplitude(pulse, point_m), peak)
    }
}

/// Magnitude of an amplitude with the sign of `peak` that is not below [`FLOOR`] of it, else 0.
fn weight(amplitude: f64, peak: f64) -> f64 {
    let aligned = amplitude * peak.signum();
    match aligned >= FLOOR * peak.abs() {
        true => aligned.max(0.0),
        false => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH_RAD: f64 = 0.1;

    fn mounted(attitudes: Vec<[DQuat; 2]>) -> MountedAntennas {
        let antenna = Antenna {
            name: "a".to_owned(),
            offset_m: DVec3::ZERO,
            boresight: DVec3::Y,
            up: DVec3::Z,
            pattern: Pattern::Gaussian {
                azimuth_rad: WIDTH_RAD,
                elevation_rad: 1.0,
            },
            aim_m: None,
        };
        MountedAntennas {
            antennas: [antenna.clone(), antenna],
            attitudes,
        }
    }

    #[test]
    fn attitudes_are_thinned_within_their_tolerance_and_survive_storage() {
        let times_s: Vec<f64> = (0..1001).map(|n| 0.01 * f64::from(n)).collect();
        let still = AntennaPatterns::new(&mounted(vec![[DQuat::IDENTITY; 2]; 1001]), &times_s);
        assert_eq!(still.unwrap().times_s.len(), 1);
        let turn = |t: &f64| [DQuat::from_rotation_z(0.02 * libm::sin(2.0 * t)); 2];
        let attitudes: Vec<[DQuat; 2]> = times_s.iter().map(turn).collect();
        let swaying = AntennaPatterns::new(&mounted(attitudes), &times_s).unwrap();
        // Linear interpolation over h is off by h^2 / 8 of the second derivative, 0.08 rad/s^2: 1e-5 rad for 32 ms.
        assert!(swaying.times_s.len() > 200 && swaying.times_s.len() < 1001);
        let text = serde_json::to_string(&swaying).unwrap();
        assert_eq!(
            serde_json::from_str::<AntennaPatterns>(&text).unwrap(),
            swaying
        );
        let short = text.replacen("\"times_s\":[0.0,", "\"times_s\":[", 1);
        assert!(serde_json::from_str::<AntennaPatterns>(&short).is_err());
    }

    #[test]
    fn pulses_down_to_minus_20_db_see_a_point() {
        // A boresight along y from a track along x: at range 100 the azimuth of the origin is atan(x / 100).
        let count = 201;
        let times_s: Vec<f64> = (0..count).map(|n| 0.01 * n as f64).collect();
        let place_m = |t: f64| DVec3::new(20.0 * (t - 1.0), 0.0, 0.0);
        let patterns = AntennaPatterns::new(&mounted(vec![[DQuat::IDENTITY; 2]; count]), &times_s);
        let combined = patterns.unwrap();
        let combined = combined.over(times_s.iter().map(|&t| (t, [place_m(t); 2])));
        let point_m = DVec3::new(0.0, 100.0, 0.0);
        let expected = |n: usize| {
            let azimuth = (place_m(times_s[n]).x / 100.0).atan() / WIDTH_RAD;
            0.5f64.powf(4.0 * azimuth * azimuth)
        };
        for n in [0, 37, 100, 160] {
            assert!((combined.amplitude(n, point_m) - expected(n)).abs() < 1e-14);
        }
        let (seen, peak) = combined.seeing(0..count, point_m);
        assert_eq!(peak, 1.0);
        for n in 0..count {
            assert_eq!(seen.contains(&n), expected(n) >= FLOOR, "{n}");
        }
        // Elevations of a steep point have less than -40 dB in all pulses.
        let above = combined.seeing(0..count, DVec3::new(0.0, 1.0, 100.0)).0;
        assert!(above.is_empty());
    }
}
