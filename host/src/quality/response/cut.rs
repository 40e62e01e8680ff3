//! Widths and side lobes along a line through the peak.

/// Side lobes by one rule of what the main lobe is, dB.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct SideLobes {
    /// Highest local maximum outside the main lobe over the peak, of power; `None` if there is none.
    pub pslr_db: Option<f64>,
    /// Energy outside the main lobe, within the span, over the energy inside it.
    pub islr_db: Option<f64>,
}

/// A line through the peak: power relative to the peak's against the distance from it.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Cut {
    /// Along what.
    pub along: Direction,
    /// Width between the points of half the peak's power, in the unit of the offsets; `None` if the
    /// span ends before them.
    pub width_3db: Option<f64>,
    /// First minima on both sides of the peak, offsets; `None` if the span ends before them.
    pub nulls: Option<[f64; 2]>,
    /// Side lobes where the main lobe lies between the first minima.
    pub null_rule: SideLobes,
    /// Side lobes where the main lobe reaches a given number of widths to both sides.
    pub fixed_rule: SideLobes,
    /// First and last offset: what the side lobes' energy is taken over.
    pub span: [f64; 2],
    /// Distances from the peak, ascending, evenly spaced: metres, or radians across a polar grid.
    #[serde(skip)]
    pub offsets: Vec<f64>,
    /// Power over the peak's.
    #[serde(skip)]
    pub powers: Vec<f64>,
}

/// What a cut runs along.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Direction {
    /// Columns: x, or angle.
    X,
    /// Rows: y, or range of a polar grid.
    Y,
    /// The line of sight given.
    Range,
    /// Square to the line of sight.
    CrossRange,
}

impl Direction {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::X => "x",
            Self::Y => "y",
            Self::Range => "range",
            Self::CrossRange => "cross range",
        }
    }
}

impl Cut {
    /// Measures a cut whose sample `middle` is the peak; the main lobe of the fixed rule reaches
    /// `main_lobe_widths` widths to both sides.
    pub(super) fn new(
        along: Direction,
        offsets: Vec<f64>,
        powers: Vec<f64>,
        middle: usize,
        main_lobe_widths: f64,
    ) -> Self {
        // Walks from the peak outwards: towards the end, or towards the start.
        let ahead: Vec<usize> = (middle..powers.len()).collect();
        let back: Vec<usize> = (0..=middle).rev().collect();
        let both = |f: &dyn Fn(&[usize]) -> Option<f64>| Some([f(&back)?, f(&ahead)?]);
        let half_power = both(&|walk| {
            let pair = walk.windows(2).find(|p| powers[p[1]] < 0.5)?;
            let (a, b) = (powers[pair[0]], powers[pair[1]]);
            let part = (a - 0.5) / (a - b);
            Some(offsets[pair[0]] + part * (offsets[pair[1]] - offsets[pair[0]]))
        });
        let null = both(&|walk| {
            let pair = walk.windows(2).find(|p| powers[p[1]] > powers[p[0]])?;
            Some(offsets[pair[0]])
        });
        let width_3db = half_power.map(|[low, high]| high - low);
        let fixed = width_3db.map(|w| [-w * main_lobe_widths, w * main_lobe_widths]);
        let side_lobes = |main: Option<[f64; 2]>| SideLobes {
            pslr_db: main.and_then(|main| highest_side_lobe_db(&offsets, &powers, main)),
            islr_db: main.and_then(|main| integrated_db(&offsets, &powers, main)),
        };
        Self {
            along,
            width_3db,
            nulls: null,
            null_rule: side_lobes(null),
            fixed_rule: side_lobes(fixed),
            span: [offsets[0], offsets[offsets.len() - 1]],
            offsets,
            powers,
        }
    }
}

fn inside(offset: f64, [low, high]: [f64; 2]) -> bool {
    low <= offset && offset <= high
}

fn highest_side_lobe_db(offsets: &[f64], powers: &[f64], main: [f64; 2]) -> Option<f64> {
    let tops = powers.windows(3).zip(&offsets[1..]);
    tops.filter(|(p, at)| !inside(**at, main) && p[0] < p[1] && p[1] >= p[2])
        .map(|(p, _)| p[1])
        .reduce(f64::max)
        .filter(|&p| p > 0.0)
        .map(|p| 10.0 * p.log10())
}

fn integrated_db(offsets: &[f64], powers: &[f64], main: [f64; 2]) -> Option<f64> {
    let (mut within, mut beyond) = (0.0, 0.0);
    for (&at, power) in offsets.iter().zip(powers) {
        match inside(at, main) {
            true => within += power,
            false => beyond += power,
        }
    }
    (beyond > 0.0 && within > 0.0).then(|| 10.0 * (beyond / within).log10())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_staircase_by_hand() {
        // Powers of a made-up response; half power between 1 and 0.25 at a third of (0.5 / 0.75) of a
        // step on both sides, nulls at -2 and 2.
        let powers = vec![0.01, 0.04, 0.0, 0.25, 1.0, 0.25, 0.0, 0.01, 0.005];
        let offsets = (0..9).map(|i| f64::from(i) - 4.0).collect();
        let cut = Cut::new(Direction::X, offsets, powers, 4, 0.9);
        assert!((cut.width_3db.unwrap() - 4.0 / 3.0).abs() < 1e-12);
        assert_eq!(cut.nulls, Some([-2.0, 2.0]));
        let near = |value: Option<f64>, power: f64| {
            assert!(
                (value.unwrap() - 10.0 * power.log10()).abs() < 1e-9,
                "{value:?}"
            );
        };
        near(cut.null_rule.pslr_db, 0.04);
        near(cut.null_rule.islr_db, 0.065 / 1.5);
        // 0.9 widths are 1.2: the zeros at 2 lie outside and add nothing.
        near(cut.fixed_rule.islr_db, 0.065 / 1.5);
        assert_eq!(cut.span, [-4.0, 4.0]);
    }
}
