//! Histogram of an image's levels, in bins of 1 dB.

use serde_json::{Value, json};

/// Range below the highest level, dB. Lower levels count in the lowest bin.
const RANGE_DB: f64 = 150.0;

/// Counts of levels in bins of 1 dB.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Histogram {
    /// Lower edge of the first bin, dB.
    first_db: i32,
    counts: Vec<u32>,
}

impl Histogram {
    /// Histogram of the positive finite powers; `None` without any.
    pub(super) fn of(powers: &[f64]) -> Option<Self> {
        let levels = || {
            let seen = powers.iter().filter(|p| p.is_finite() && **p > 0.0);
            seen.map(|p| 10.0 * p.log10())
        };
        let highest = levels().reduce(f64::max)?.floor();
        let lowest = levels().fold(highest, f64::min).floor();
        let first = lowest.max(highest - RANGE_DB);
        let mut counts = vec![0; (highest - first) as usize + 1];
        for level in levels() {
            // `as` saturates at bin 0.
            counts[(level - first) as usize] += 1;
        }
        Some(Self {
            first_db: first as i32,
            counts,
        })
    }

    pub(super) fn to_json(&self) -> Value {
        json!({ "first_db": self.first_db, "counts": self.counts })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_are_counted_in_bins_of_one_decibel() {
        let power = |db: f64| 10f64.powf(db / 10.0);
        let powers = [-3.5, -3.9, -1.2, 0.5, 0.7, 0.9].map(power);
        let mut powers = powers.to_vec();
        powers.extend([0.0, f64::NAN, f64::INFINITY]);
        let found = Histogram::of(&powers).unwrap();
        assert_eq!((found.first_db, found.counts), (-4, vec![2, 0, 1, 0, 3]));
        // Far below the highest: the lowest bin.
        let found = Histogram::of(&[power(10.5), power(-900.0)]).unwrap();
        assert_eq!((found.first_db, found.counts[0]), (-140, 1));
        assert_eq!(found.counts.len(), 151);
        assert_eq!(Histogram::of(&[0.0, f64::NAN]), None);
    }
}
