//! Clipped samples: values at the limits of an integer type, or piled up at the largest or smallest value.
//!
//! Values pile up if the extreme value occurs more than 4 times as often as each of the next 4 values. Without
//! clipping, integers of a sinusoid occur at most 2.4 times as often at the extreme as next to it, and those of noise
//! less often.

use num_complex::Complex32;

use super::absent::is_absent;

/// Number of different values that are counted at each end.
const KEPT: usize = 5;

/// Ratio of the number of extreme values to that of the next ones above which values pile up.
const PILE: u64 = 4;

/// Minimum number of piled-up values, of values at the limits of a type, and their minimum share.
const LEAST_PILED: u64 = 16;
const LEAST_AT_LIMIT: u64 = 4;
const LEAST_SHARE: f64 = 1e-4;

/// Counts of the extreme values of I and Q.
#[derive(Clone, Debug)]
pub(super) struct Clipping {
    /// Largest and smallest values of I, then of Q.
    ends: [End; 4],
    real: bool,
    limits: Option<[f32; 2]>,
    at_limits: u64,
    /// Number of values added.
    count: u64,
}

/// Share and limits of clipped values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Clipped {
    /// Share of all values of I and Q.
    pub(super) share: f64,
    /// Smallest and largest value.
    pub(super) range: [f32; 2],
}

impl Clipping {
    pub(super) fn new(real: bool, limits: Option<[f32; 2]>) -> Self {
        let end = |sign| End {
            sign,
            held: Vec::with_capacity(KEPT + 1),
        };
        Self {
            ends: [end(1.0), end(-1.0), end(1.0), end(-1.0)],
            real,
            limits,
            at_limits: 0,
            count: 0,
        }
    }

    /// Add the samples of a pulse.
    pub(super) fn add(&mut self, row: &[Complex32]) {
        let [high_i, low_i, high_q, low_q] = &mut self.ends;
        let is_limit = |value: f32| match self.limits {
            // The lower limit of unsigned types is also the value of padding.
            Some([low, high]) => value == high || (value == low && low < 0.0),
            None => false,
        };
        let per_sample = if self.real { 1 } else { 2 };
        for z in row.iter().filter(|z| !is_absent(**z)) {
            self.count += per_sample;
            high_i.add(z.re);
            low_i.add(z.re);
            self.at_limits += u64::from(is_limit(z.re));
            if !self.real {
                high_q.add(z.im);
                low_q.add(z.im);
                self.at_limits += u64::from(is_limit(z.im));
            }
        }
    }

    /// Clipped values, if there are some.
    pub(super) fn clipped(&self) -> Option<Clipped> {
        let least = |least: u64| least.max((LEAST_SHARE * self.count as f64) as u64);
        let piled: u64 = (self.ends.iter())
            .filter_map(End::pile)
            .filter(|&pile| pile >= least(LEAST_PILED))
            .sum();
        let at_limits = match self.at_limits >= least(LEAST_AT_LIMIT) {
            true => self.at_limits,
            false => 0,
        };
        let clipped = piled.max(at_limits);
        let value = |i: usize| self.ends[i].held.first().map_or(0.0, |&(value, _)| value);
        let extreme = |i: usize| match self.real {
            true => value(i),
            false => {
                self.ends[i].sign
                    * (value(i) * self.ends[i].sign).max(value(i + 2) * self.ends[i].sign)
            }
        };
        (clipped > 0).then(|| Clipped {
            share: clipped as f64 / self.count as f64,
            range: [extreme(1), extreme(0)],
        })
    }
}

/// The largest values times `sign`, in falling order, with their counts.
#[derive(Clone, Debug)]
struct End {
    sign: f32,
    held: Vec<(f32, u64)>,
}

impl End {
    fn add(&mut self, value: f32) {
        let signed = |value: f32| self.sign * value;
        if let Some((last, _)) = self.held.get(KEPT - 1)
            && signed(value) < signed(*last)
        {
            return;
        }
        let place = (self.held).partition_point(|(held, _)| signed(*held) > signed(value));
        match self.held.get_mut(place) {
            Some((held, count)) if *held == value => *count += 1,
            _ if value.is_finite() => {
                self.held.insert(place, (value, 1));
                self.held.truncate(KEPT);
            }
            _ => {}
        }
    }

    /// Number of values at the extreme, if they are piled up.
    fn pile(&self) -> Option<u64> {
        let [(_, extreme), next @ ..] = self.held.as_slice() else {
            return None;
        };
        let most = next.iter().map(|(_, count)| *count).max()?;
        (next.len() >= 2 && *extreme > PILE * most).then_some(*extreme)
    }
}
