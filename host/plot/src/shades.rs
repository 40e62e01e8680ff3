//! Colour lookup of powers without a logarithm per pixel.
//!
//! Colours are steps of the logarithm of power. The bit pattern of a positive float64 increases with it, so powers
//! with equal leading bits form an interval of levels, at most 0.017 dB long. Where both ends have the same colour, so has the interval, and one table
//! lookup gives it. For the other intervals, and for scales without a table, the level is computed. The colours are identical.

use super::colours::Colours;
use super::scale::Levels;

/// Low bits of a float64 ignored in an interval's index: all but 8 of the fraction.
const BELOW: u32 = 44;

/// Bound on the rounding error of a level, relative to the scale.
const OFF: f64 = 1e-9;

/// Scales with a table: dynamic range, and distance of the ends from 0, dB.
const SPANS_DB: std::ops::RangeInclusive<f64> = 1.0..=200.0;
const FARTHEST_DB: f64 = 2000.0;

/// Smallest number of powers for which a table is built.
const FEW: usize = 10_000;

/// Colour lookup of a scale.
pub(super) struct Shades {
    levels: Levels,
    colours: Colours,
    absent: [u8; 3],
    /// Colour below the table.
    darkest: [u8; 3],
    /// Index of the first interval in the table.
    first: u64,
    /// Colour of each interval; `None` if it has several, or is above the scale.
    runs: Vec<Option<[u8; 3]>>,
}

impl Shades {
    /// Build the lookup for `count` powers.
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
            // One more interval at the bottom, and a margin for rounding at the top.
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

    /// Position of a power on the scale, 0 to 1 within it.
    fn part(&self, power: f64) -> f64 {
        self.levels.part(10.0 * power.log10())
    }

    /// Colour of all levels from `low` to `high`, if it is one and on the scale.
    fn run(&self, low: f64, high: f64) -> Option<[u8; 3]> {
        let within = !self.levels.is_above(high);
        self.colours.of_all(low, high).filter(|_| within)
    }

    /// Colour of a non-negative power, and whether it is above the scale.
    #[inline]
    pub(super) fn of(&self, power: f64) -> ([u8; 3], bool) {
        // NaN is beyond the table.
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
    fn colour_table_agrees_with_computed_colours() {
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
                    // The table must cover most intervals.
                    let covered = shades.runs.iter().flatten().count();
                    assert!(top - bottom < 50.0 || covered > shades.runs.len() * 4 / 5);
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
    fn scale_without_table_gives_same_colours() {
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
