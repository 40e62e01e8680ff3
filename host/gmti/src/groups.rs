//! Groups of detected pixels, one for each target.
//!
//! Pixels are taken in descending order of SNR. A pixel without neighbours among those taken before begins a group; otherwise it joins the strongest
//! group among its neighbours. Two groups that meet in a pixel become one if the weaker peak is not prominent: less than 10 dB above that pixel. A
//! defocused target thus is one group, and two targets joined by their side lobes are two.

use crate::detection::StatisticMap;

/// Smallest prominence of a group of its own, as a ratio of power: 10 dB.
const PROMINENCE: f32 = 10.0;

/// Groups of detected pixels in descending order of their peaks: the peak, and all pixels. Neighbours are at most one independent cell apart.
pub(crate) fn groups(map: &StatisticMap) -> Vec<(usize, Vec<usize>)> {
    let (rows, columns) = (map.rows, map.columns);
    let mut order: Vec<usize> = (0..map.detected.len())
        .filter(|&i| map.detected[i])
        .collect();
    order.sort_by(|&a, &b| map.snr[b].total_cmp(&map.snr[a]).then(a.cmp(&b)));
    // Group of each pixel that was taken, and the group that each group has joined.
    let mut of_pixel = vec![usize::MAX; map.detected.len()];
    let mut peaks: Vec<usize> = Vec::new();
    let mut joined: Vec<usize> = Vec::new();
    for &pixel in &order {
        let (row, column) = (pixel / columns, pixel % columns);
        let near = |at: usize, reach: usize, count: usize| {
            at.saturating_sub(reach)..(at + reach + 1).min(count)
        };
        let mut neighbours = Vec::new();
        for row in near(row, map.spacing.rows, rows) {
            for column in near(column, map.spacing.columns, columns) {
                let group = of_pixel[row * columns + column];
                if group != usize::MAX {
                    neighbours.push(root(&joined, group));
                }
            }
        }
        neighbours.sort_unstable();
        neighbours.dedup();
        // Groups are numbered in descending order of their peaks.
        let Some((&strongest, others)) = neighbours.split_first() else {
            of_pixel[pixel] = peaks.len();
            joined.push(peaks.len());
            peaks.push(pixel);
            continue;
        };
        of_pixel[pixel] = strongest;
        for &other in others {
            if map.snr[peaks[other]] < PROMINENCE * map.snr[pixel] {
                joined[other] = strongest;
            }
        }
    }
    let mut groups: Vec<(usize, Vec<usize>)> =
        peaks.iter().map(|&peak| (peak, Vec::new())).collect();
    for pixel in order {
        groups[root(&joined, of_pixel[pixel])].1.push(pixel);
    }
    groups.retain(|(_, pixels)| !pixels.is_empty());
    groups
}

/// Group that a group has become part of.
fn root(joined: &[usize], mut group: usize) -> usize {
    while joined[group] != group {
        group = joined[group];
    }
    group
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::correlation::Spacing;

    fn map(snr: &[f32]) -> StatisticMap {
        StatisticMap {
            rows: 1,
            columns: snr.len(),
            snr: snr.to_vec(),
            detected: snr.iter().map(|&snr| snr > 1.0).collect(),
            spacing: Spacing {
                rows: 1,
                columns: 1,
            },
            cell_pixels: 1.0,
            cells: snr.len() as f64,
            single_probability: 1e-6,
        }
    }

    #[test]
    fn prominent_peaks_are_groups_of_their_own() {
        // A saddle of 20 between 100 and 300: the weaker peak is 7 dB above it.
        let one = groups(&map(&[0.0, 50.0, 100.0, 20.0, 300.0, 9.0, 0.0, 2.0]));
        assert_eq!(one, [(4, vec![4, 2, 1, 3, 5]), (7, vec![7])]);
        // A saddle of 9: 10.5 dB.
        let two = groups(&map(&[0.0, 50.0, 100.0, 9.0, 300.0, 9.0]));
        assert_eq!(two, [(4, vec![4, 3, 5]), (2, vec![2, 1])]);
    }
}
