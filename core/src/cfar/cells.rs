//! Powers of the cells of a map, and the interpolation of peaks.

use super::settings::Detection;
use crate::stream::PatchMap;

/// Access to cell powers from a slice or a map.
pub(super) struct Cells<P> {
    pub(super) rows: usize,
    pub(super) columns: usize,
    pub(super) power: P,
}

/// Powers of a patch map.
pub(super) fn cells_of<'a>(
    map: &'a PatchMap<'_>,
) -> Cells<impl Fn(usize, usize) -> Option<f32> + 'a> {
    let patch = map.header.patch;
    let bin = |index: usize, reach: u16| (index as i32).wrapping_sub(i32::from(reach));
    Cells {
        rows: patch.num_doppler_bins(),
        columns: patch.num_range_bins(),
        power: move |row: usize, column: usize| {
            let value = map.at(
                bin(row, patch.doppler_reach),
                bin(column, patch.range_reach),
            );
            Some(value.norm_sqr())
        },
    }
}

impl<P: Fn(usize, usize) -> Option<f32>> Cells<P> {
    /// Power of a cell, or `None` if the cell is outside the map or invalid.
    #[inline]
    pub(super) fn at(&self, row: usize, column: usize) -> Option<f32> {
        if row >= self.rows || column >= self.columns {
            return None;
        }
        (self.power)(row, column).filter(|power| *power >= 0.0 && *power < f32::INFINITY)
    }

    /// Whether `power` is a local maximum of the eight neighbours. Of equal neighbours the first counts as the peak.
    pub(super) fn is_peak(&self, row: usize, column: usize, power: f32) -> bool {
        let neighbour = |up: usize, right: usize| {
            // Offsets are one too high, so that 0 means the neighbour before; it wraps out of the map.
            let (row, column) = (row.wrapping_add(up), column.wrapping_add(right));
            self.at(row.wrapping_sub(1), column.wrapping_sub(1))
        };
        let before = [(0, 0), (0, 1), (0, 2), (1, 0)];
        let after = [(1, 2), (2, 0), (2, 1), (2, 2)];
        !(before
            .iter()
            .filter_map(|&(d, r)| neighbour(d, r))
            .any(|p| p >= power)
            || after
                .iter()
                .filter_map(|&(d, r)| neighbour(d, r))
                .any(|p| p > power))
    }

    /// Detection at a peak, interpolated in both axes.
    pub(super) fn refine(&self, row: usize, column: usize, power: f32, noise: f32) -> Detection {
        let across = |before: Option<f32>, after: Option<f32>| match (before, after) {
            (Some(before), Some(after)) => parabola(before, power, after),
            _ => (0.0, 0.0),
        };
        let (doppler, doppler_lift) = across(
            self.at(row.wrapping_sub(1), column),
            self.at(row.wrapping_add(1), column),
        );
        let (range, range_lift) = across(
            self.at(row, column.wrapping_sub(1)),
            self.at(row, column.wrapping_add(1)),
        );
        let from_centre = |index: usize, count: usize| index as f32 - (count / 2) as f32;
        Detection {
            range_bin: from_centre(column, self.columns) + range,
            doppler_bin: from_centre(row, self.rows) + doppler,
            power: (power * libm::expf(doppler_lift + range_lift)).min(f32::MAX),
            noise,
        }
    }
}

/// Vertex of the parabola through the logarithms of three powers whose middle one is the largest: offset within
/// half a bin, and log height above the middle power.
fn parabola(before: f32, peak: f32, after: f32) -> (f32, f32) {
    /// Natural logarithm of `(pi / 2)^2` = 3.9 dB, the maximum straddle loss of a map with `R = F` or `D = M`.
    /// Limits the vertex when a neighbour near zero makes the parabola steep.
    const HIGHEST_LIFT: f32 = 0.903_165_4;
    let below = |power: f32| libm::logf((power / peak).max(f32::MIN_POSITIVE)).min(0.0);
    let (before, after) = (below(before), below(after));
    let (sum, difference) = (before + after, before - after);
    if sum < 0.0 {
        let lift = -difference * difference / (8.0 * sum);
        (difference / (2.0 * sum), lift.min(HIGHEST_LIFT))
    } else {
        (0.0, 0.0)
    }
}
