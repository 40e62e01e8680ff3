//! Colours of many powers, without a logarithm of each.
//!
//! Levels are logarithms of powers, and colours change with them in steps. The bits of a positive float64 number grow with it, so that those
//! whose leading bits are the same are a run of levels, at most 0.017 dB long: where both its ends are of one colour, all of the run is, and one look into a table
//! tells it. Of the few others, and of scales that no table suits, each level is computed. The colours are the same either way.

use super::colours::Colours;
use super::scale::Levels;

/// Bits of a float64 number that are left out of a run's number: all but 8 of its fraction.
const BELOW: u32 = 44;

/// How far the level of a power may be off by rounding, as a part of the scale.
const OFF: f64 = 1e-9;

/// Scales for which there is a table, dB: their spans, and how far their ends may lie from 0.
const SPANS_DB: std::ops::RangeInclusive<f64> = 1.0..=200.0;
const FARTHEST_DB: f64 = 2000.0;

/// Powers below which no table is worth it.
const FEW: usize = 10_000;

/// Colours of powers on a scale.
pub(super) struct Shades {
    levels: Levels,
    colours: Colours,
    absent: [u8; 3],
    /// What lies below the table.
    darkest: [u8; 3],
    /// Number of the first run in the table.
    first: u64,
    /// The colour of each run; none if they are several, or above the scale, where few are.
    runs: Vec<Option<[u8; 3]>>,
}

impl Shades {
    /// For so many powers.
    pub(super) fn new(levels: Levels, colours: Colours, absent: [u8; 3], count: usize) -> Self {
        let mut shades = Self {
            levels,
            colours,
            absent,
            darkest: colours.at(0.0),
            first: 0,
            runs: Vec::new(),
        };
        let Levels { bottom, top, .. } = levels;
        let ends = [bottom, top].iter().all(|db| db.abs() < FARTHEST_DB);
        if count >= FEW && ends && SPANS_DB.contains(&(top - bottom)) {
            let run_of = |db: f64| 10f64.powf(db / 10.0).to_bits() >> BELOW;
            // A run more at the bottom, and at the top what rounding may lie above.
            shades.first = run_of(bottom) - 1;
            let last = run_of(top + 0.01 * (top - bottom)) + 1;
            let parts: Vec<f64> = (shades.first..=last + 1)
                .map(|run| shades.part(f64::from_bits(run << BELOW)))
                .collect();
            let run = |ends: &[f64]| shades.run(ends[0] - OFF, ends[1] + OFF);
            shades.runs = parts.windows(2).map(run).collect();
        }
        shades
    }

    /// How far up the scale a power is, 0 to 1 within it.
    fn part(&self, power: f64) -> f64 {
        self.levels.part(10.0 * power.log10())
    }

    /// The colour of all levels from one to another, if it is one and of the scale.
    fn run(&self, low: f64, high: f64) -> Option<[u8; 3]> {
        let within = !self.levels.is_above(high);
        self.colours.of_all(low, high).filter(|_| within)
    }

    /// The colour of a power that is not negative, and whether that lies above the scale.
    #[inline]
    pub(super) fn of(&self, power: f64) -> ([u8; 3], bool) {
        // That of NaN is beyond the table.
        let run = power.to_bits() >> BELOW;
        let Some(place) = run.checked_sub(self.first) else {
            return (self.darkest, false);
        };
        match self.runs.get(place as usize) {
            Some(Some(colour)) => (*colour, false),
            _ => self.computed(power),
        }
    }

    fn computed(&self, power: f64) -> ([u8; 3], bool) {
        self.levels
            .colour(10.0 * power.log10(), self.colours, self.absent)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_tells_the_computed_colours() {
        let absent = [1, 2, 3];
        for (bottom, top) in [(-60.0, 0.0), (-123.0, -69.0), (3.0, 4.0), (-199.5, 0.4)] {
            for colours in [Colours::Grey, Colours::Viridis] {
                for marks_above in [true, false] {
                    let levels = Levels {
                        bottom,
                        top,
                        marks_above,
                    };
                    let shades = Shades::new(levels, colours, absent, FEW);
                    assert!(!shades.runs.is_empty());
                    // A table that tells nothing would be no use.
                    let told = shades.runs.iter().flatten().count();
                    assert!(top - bottom < 50.0 || told > shades.runs.len() * 4 / 5);
                    let db = (0..200_000)
                        .map(|i| bottom - 7.0 + (top - bottom + 14.0) * f64::from(i) / 2e5);
                    let powers = db.map(|db| 10f64.powf(db / 10.0));
                    let edges = (0..shades.runs.len() as u64).flat_map(|run| {
                        let edge = (shades.first + run) << BELOW;
                        [edge - 1, edge, edge + 1].map(f64::from_bits)
                    });
                    let others = [0.0, f64::NAN, f64::INFINITY, f64::MIN_POSITIVE, 1e300];
                    for power in powers.chain(edges).chain(others) {
                        let wanted = levels.colour(10.0 * power.log10(), colours, absent);
                        assert_eq!(shades.of(power), wanted, "{power:e}");
                    }
                }
            }
        }
    }

    #[test]
    fn scales_without_a_table_tell_the_same() {
        for (bottom, top) in [(-1e4, -1e4 + 50.0), (0.0, 0.5), (-900.0, 0.0), (5.0, 5.0)] {
            let levels = Levels {
                bottom,
                top,
                marks_above: true,
            };
            let shades = Shades::new(levels, Colours::Grey, [9; 3], FEW);
            assert!(shades.runs.is_empty());
            for power in [0.0, 1e-30, 1.0, 1.1, 4.0, f64::NAN] {
                let wanted = levels.colour(10.0 * power.log10(), Colours::Grey, [9; 3]);
                assert_eq!(shades.of(power), wanted, "{power:e}");
            }
        }
    }
}
