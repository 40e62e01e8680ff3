//! Vectors of a channel as pulses: positions, bands, motion.

use std::collections::TryReserveError;

use glam::DVec3;

use super::conventions::Domain;
use super::metadata::CphdInfo;
use super::pvp::{Layout, Vector};
use super::toa::Bins;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::phase_history::{Pulse, Sweep};

/// Numbers of the omitted vectors, ascending. Only omitted vectors take memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Missing(pub(super) Vec<usize>);

impl Missing {
    /// Vector number of a pulse, counting omitted vectors before it.
    pub(super) fn vector(&self, pulse: usize) -> usize {
        let (mut low, mut high) = (0, self.0.len());
        while low < high {
            let middle = (low + high) / 2;
            match self.0[middle] - middle <= pulse {
                true => low = middle + 1,
                false => high = middle,
            }
        }
        pulse + low
    }

    /// Pulse of a vector. `None` if it is omitted.
    pub(super) fn pulse(&self, vector: usize) -> Option<usize> {
        self.0
            .binary_search(&vector)
            .err()
            .map(|before| vector - before)
    }
}

/// Range of scale factors for which float32 represents scaled samples and values 100 dB below them.
const SCALES: std::ops::RangeInclusive<f64> = 1e-25..=1e25;

/// Describe the fault of a scale factor (AmpSF).
pub(crate) fn scale_fault(scale: f64) -> Option<String> {
    (scale != 0.0 && !SCALES.contains(&scale.abs())).then(|| {
        format!(
            "AmpSF: expected {:e} to {:e} (float32 samples), found {scale:e}; multiply all AmpSF of the file by one number",
            SCALES.start(),
            SCALES.end()
        )
    })
}

/// Fraction of the unambiguous delay from which TOA1 to TOA2 is the swath of a vector without a shorter receive window.
const WHOLE_SWATH: f64 = 0.8;

/// Recorded two-way paths: between TOA1 and TOA2, where the standard has the echoes complete, or the whole unambiguous
/// interval about their middle where they leave only the oversampling that the standard requires.
fn recorded(vector: &Vector, pulse: &Pulse) -> Option<[f64; 2]> {
    let [first, last] = vector.toa?;
    let is_whole = (last - first) * pulse.step_hz >= WHOLE_SWATH * (1.0 - 1e-9);
    let half = match is_whole {
        true => (0.5 / pulse.step_hz).max(0.5 * (last - first)),
        false => 0.5 * (last - first),
    };
    let middle = 0.5 * (first + last);
    let ends = [middle - half, middle + half];
    Some(ends.map(|toa| SPEED_OF_LIGHT_M_S * toa + pulse.reference_path_m))
}

/// Per-vector parameters held after opening.
pub(super) struct Vectors {
    pub(super) domain: Domain,
    pub(super) stored_samples: usize,
    pub(super) frame: subaperture_model::geometry::SceneFrame,
    pub(super) pulses: Vec<Pulse>,
    pub(super) amp_sf: Vec<f64>,
    /// Vectors without an echo, ascending.
    pub(super) missing: Missing,
    pub(super) shifts: Vec<f64>,
    pub(super) true_antennas: Vec<[DVec3; 2]>,
    pub(super) bins: Option<Bins>,
}

impl Vectors {
    /// Create empty lists for a file.
    pub(super) fn to_be_read(info: &CphdInfo, stored_samples: usize) -> Self {
        Self {
            domain: info.domain,
            stored_samples,
            frame: info.frame,
            pulses: Vec::new(),
            amp_sf: Vec::new(),
            missing: Missing::default(),
            shifts: Vec::new(),
            true_antennas: Vec::new(),
            bins: None,
        }
    }

    /// Reserve memory for exactly `count` vectors.
    pub(super) fn reserve(&mut self, count: usize, layout: &Layout) -> Result<(), TryReserveError> {
        self.pulses.try_reserve_exact(count)?;
        if layout.has_amp_sf() {
            self.amp_sf.try_reserve_exact(count)?;
        }
        if layout.has_true_antennas() {
            self.true_antennas.try_reserve_exact(count)?;
        }
        if self.domain == Domain::Toa {
            self.shifts.try_reserve_exact(count)?;
        }
        Ok(())
    }

    pub(super) fn push(&mut self, index: u64, vector: &Vector) -> Result<(), String> {
        let (start_hz, step_hz) = match self.domain {
            Domain::Fx => (vector.sc0, vector.scss),
            Domain::Toa => self.arrival_band(index, vector)?,
        };
        let mut pulse = Pulse {
            time_s: vector.tx_time,
            transmitter_m: self.frame.from_ecf_m(vector.tx_pos),
            receiver_m: self.frame.from_ecf_m(vector.rcv_pos),
            reference_m: self.frame.from_ecf_m(vector.srp_pos),
            // Computed from ECF positions, which saves one rounding.
            reference_path_m: (vector.tx_pos - vector.srp_pos).length()
                + (vector.rcv_pos - vector.srp_pos).length(),
            start_hz,
            step_hz,
            sweep: self.sweep(vector, step_hz),
            recorded_path_m: None,
        };
        pulse.recorded_path_m = recorded(vector, &pulse);
        let count = self.bins.map_or(self.stored_samples, |bins| bins.count);
        if let Some(what) = pulse.fault(count) {
            return Err(format!(
                "vector {index}: {what} (TxTime, TxPos, RcvPos, SRPPos, SC0 or SCSS); repair or drop it"
            ));
        }
        if !self.is_sweep(&pulse.sweep) {
            return Err(format!(
                "vector {index}: TxVel, RcvVel or aFRR2 is impossibly large; repair or drop it"
            ));
        }
        if let Some(what) = vector.amp_sf.and_then(scale_fault) {
            return Err(format!("vector {index}: {what}"));
        }
        self.pulses.push(pulse);
        if let Some(amp_sf) = vector.amp_sf {
            self.amp_sf.push(amp_sf);
        }
        if let Some(truth) = vector.true_antennas {
            self.true_antennas
                .push(truth.map(|p| self.frame.from_ecf_m(p)));
        }
        Ok(())
    }

    /// Motion within a vector: the rate of its sweep is `2 / (c aFRR2)`.
    fn sweep(&self, vector: &Vector, step_hz: f64) -> Sweep {
        let Some(([transmitter, receiver], a_frr2)) = vector.sweep else {
            return Sweep::AT_ONCE;
        };
        Sweep {
            sample_s: 0.5 * SPEED_OF_LIGHT_M_S * a_frr2 * step_hz,
            transmitter_m_s: self.frame.direction_from_ecf(transmitter),
            receiver_m_s: self.frame.direction_from_ecf(receiver),
            reference_m_s: Some(DVec3::ZERO),
            ..Sweep::AT_ONCE
        }
    }

    /// Whether a radar can make this sweep: at most one second per sample, slower than light.
    fn is_sweep(&self, sweep: &Sweep) -> bool {
        let slow = |v: DVec3| v.length() < SPEED_OF_LIGHT_M_S;
        sweep.sample_s.abs() < 1.0 && slow(sweep.transmitter_m_s) && slow(sweep.receiver_m_s)
    }

    /// Set accelerations: at each vector, the slope of the polynomial through its velocity and those of the two
    /// vectors before and after. (Two neighbours alone have the error `(w h)^2 / 6` for a vibration of `w` radians
    /// per second and `h` seconds between vectors: 8 % at 1.8 Hz and 60 ms. Four have `(w h)^4 / 30`, 0.7 %.)
    pub(super) fn set_accelerations(&mut self) {
        const NEIGHBOURS: usize = 2;
        for i in 0..self.pulses.len() {
            let [first, end] = [
                i.saturating_sub(NEIGHBOURS),
                self.pulses.len().min(i + NEIGHBOURS + 1),
            ];
            let near = &self.pulses[first..end];
            let rise = |pair: &[Pulse]| pair[1].time_s > pair[0].time_s;
            if near.iter().any(|pulse| pulse.sweep.sample_s == 0.0) || !near.windows(2).all(rise) {
                continue;
            }
            let times_s: Vec<f64> = near.iter().map(|pulse| pulse.time_s).collect();
            let weights = slope_weights(&times_s, i - first);
            let slope = |of: fn(&Sweep) -> DVec3| -> DVec3 {
                let terms = near.iter().zip(&weights);
                terms
                    .map(|(pulse, &weight)| of(&pulse.sweep) * weight)
                    .sum()
            };
            let transmitter_m_s2 = slope(|sweep| sweep.transmitter_m_s);
            let receiver_m_s2 = slope(|sweep| sweep.receiver_m_s);
            let sweep = &mut self.pulses[i].sweep;
            (sweep.transmitter_m_s2, sweep.receiver_m_s2) = (transmitter_m_s2, receiver_m_s2);
        }
    }

    /// First frequency and step of a TOA vector's spectrum.
    fn arrival_band(&mut self, index: u64, vector: &Vector) -> Result<(f64, f64), String> {
        let n = self.stored_samples;
        let bandwidth_hz = vector.fx2 - vector.fx1;
        let bins = Bins::of_band(bandwidth_hz, vector.scss, n).ok_or_else(|| {
            format!(
                "vector {index}: the band FX1 to FX2 of {bandwidth_hz:?} Hz needs 1 to {n} of the \
                 bins of {:?} Hz that {n} samples {:?} s apart (SCSS) have; the vector is \
                 under-sampled or damaged",
                1.0 / (n as f64 * vector.scss),
                vector.scss
            )
        })?;
        match self.bins {
            Some(first) if first != bins => {
                return Err(format!(
                    "vector {index}: its band FX1 to FX2 holds {} frequencies and that of vector \
                     0 {}; vectors of unequal bands are not read in the TOA domain",
                    bins.count, first.count
                ));
            }
            _ => self.bins = Some(bins),
        }
        let period_s = n as f64 * vector.scss;
        self.shifts.push(vector.sc0 / period_s);
        let step_hz = 1.0 / period_s;
        let start_hz = 0.5 * (vector.fx1 + vector.fx2) + bins.first as f64 * step_hz;
        if start_hz > 0.0 && (vector.sc0 / period_s).is_finite() {
            Ok((start_hz, step_hz))
        } else {
            Err(format!(
                "vector {index}: FX1 {:?} Hz, FX2 {:?} Hz, SC0 {:?} s and SCSS {:?} s give no \
                 positive frequencies; repair or drop it",
                vector.fx1, vector.fx2, vector.sc0, vector.scss
            ))
        }
    }
}

/// Weights of the values at distinct `times_s` whose weighted sum is the slope at time `at` of the interpolating polynomial.
fn slope_weights(times_s: &[f64], at: usize) -> Vec<f64> {
    let others = |skipped: usize| {
        let all = times_s.iter().enumerate();
        all.filter(move |&(k, _)| k != at && k != skipped)
    };
    let here = times_s[at];
    let weight = |j: usize| -> f64 {
        if j == at {
            return others(at).map(|(_, time)| 1.0 / (here - time)).sum();
        }
        let ratios = others(j).map(|(_, time)| (here - time) / (times_s[j] - time));
        ratios.product::<f64>() / (times_s[j] - here)
    };
    (0..times_s.len()).map(weight).collect()
}
