//! Width and sidelobes of a cut through the peak.

use subaperture_model::resolution::theory::SideLobes;

/// Cut through the peak: power relative to the peak, against distance.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct Cut {
    /// Direction of the cut.
    pub along: Direction,
    /// 3 dB width, in the unit of the offsets; `None` if the
    /// span ends before the half-power points.
    pub width_3db: Option<f64>,
    /// Offsets of the first minima on both sides; `None` if the span ends before them.
    pub nulls: Option<[f64; 2]>,
    /// Sidelobes for a main lobe between the first minima.
    pub null_rule: SideLobes,
    /// Sidelobes for a main lobe of a fixed number of 3 dB widths.
    pub fixed_rule: SideLobes,
    /// First and last offset of the sidelobe search: [`SPAN_WIDTHS`] widths to each side, where the chip
    /// allows.
    pub span: [f64; 2],
    /// Offsets from the peak, ascending, evenly spaced: metres, or radians along the angle of a polar grid.
    #[serde(skip)]
    pub offsets: Vec<f64>,
    /// Power relative to the peak.
    #[serde(skip)]
    pub powers: Vec<f64>,
}

/// Half-length of the sidelobe search and ISLR integration, 3 dB widths; fixed so that the ISLR does not depend on the
/// image size.
pub const SPAN_WIDTHS: f64 = 10.0;

/// Direction of a cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Direction {
    /// Along x, or the angle of a polar grid.
    X,
    /// Along y, or the range of a polar grid.
    Y,
    /// Along the line of sight.
    Range,
    /// Perpendicular to the line of sight.
    CrossRange,
}

impl Direction {
    /// Name, as in reports.
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
    /// Measure a cut whose sample `middle` is the peak; the fixed main lobe extends
    /// `main_lobe_widths` 3 dB widths to both sides.
    pub(super) fn new(
        along: Direction,
        mut offsets: Vec<f64>,
        mut powers: Vec<f64>,
        mut middle: usize,
        main_lobe_widths: f64,
    ) -> Self {
        // Width from the whole cut; the rest from the span.
        let width = half_power_width(&offsets, &powers, middle);
        if let Some([low, high]) = width {
            let span = SPAN_WIDTHS * (high - low);
            let first = offsets.iter().position(|&at| at >= -span).unwrap_or(0);
            let end = offsets
                .iter()
                .rposition(|&at| at <= span)
                .map_or(0, |i| i + 1);
            offsets = offsets[first..end].to_vec();
            powers = powers[first..end].to_vec();
            middle -= first;
        }
        // Indices outwards from the peak, to the end and to the start.
        let ahead: Vec<usize> = (middle..powers.len()).collect();
        let back: Vec<usize> = (0..=middle).rev().collect();
        let both = |f: &dyn Fn(&[usize]) -> Option<f64>| Some([f(&back)?, f(&ahead)?]);
        let half_power = half_power_width(&offsets, &powers, middle);
        // Minima above half power are rounding noise near the top.
        let null = both(&|walk| {
            let below = walk.iter().position(|&i| powers[i] < 0.5)?;
            let pair = walk[below..]
                .windows(2)
                .find(|p| powers[p[1]] > powers[p[0]])?;
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

/// Half-power points on both sides, by linear interpolation.
fn half_power_width(offsets: &[f64], powers: &[f64], middle: usize) -> Option<[f64; 2]> {
    let crossing = |pair: Option<(usize, usize)>| {
        let (near, far) = pair?;
        let (a, b) = (powers[near], powers[far]);
        let part = (a - 0.5) / (a - b);
        Some(offsets[near] + part * (offsets[far] - offsets[near]))
    };
    let back = (0..middle).rev().find(|&i| powers[i] < 0.5);
    let ahead = (middle + 1..powers.len()).find(|&i| powers[i] < 0.5);
    let (back, ahead) = (
        crossing(back.map(|i| (i + 1, i))),
        crossing(ahead.map(|i| (i - 1, i))),
    );
    Some([back?, ahead?])
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
    fn cut_measures_agree_with_hand_calculation() {
        // Invented response: half power between 1 and 0.25 at a third of (0.5 / 0.75) of a
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
        // 0.9 widths are 1.2: the zeros at 2 lie outside and do not contribute.
        near(cut.fixed_rule.islr_db, 0.065 / 1.5);
        assert_eq!(cut.span, [-4.0, 4.0]);
    }
}
