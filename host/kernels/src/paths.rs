//! Path lengths from a pulse's antennas to many points.
//!
//! ```text
//! path[i] = |p_i - t| + |p_i - r| - datum
//! ```
//!
//! and lines through the paths at two times ([`lines`]). Float64, metres. **Accuracy** at most 5 roundings of the path, 6e-16 of it, plus that of the datum. For a monostatic antenna
//! one leg is computed, with identical bits.
//! equal, half is computed and the bits are the same.

use std::ops::Range;

use crate::lanes::{Instructions, Kernel, Lanes};

/// Points in separate coordinate arrays, metres.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Points {
    coordinates_m: [Vec<f64>; 3],
}

impl Points {
    /// Remove all points; keeps the memory.
    pub fn clear(&mut self) {
        self.coordinates_m.iter_mut().for_each(Vec::clear);
    }

    /// Append a point.
    #[inline]
    pub fn push(&mut self, point_m: [f64; 3]) {
        for (all, one) in self.coordinates_m.iter_mut().zip(point_m) {
            all.push(one);
        }
    }

    /// Replace all points by `count` points of a grid row, from `row`'s first on.
    pub fn set_row(&mut self, instructions: Instructions, row: &Row, count: usize) {
        for (axis, all) in self.coordinates_m.iter_mut().enumerate() {
            all.resize(count, 0.0);
            instructions.run(Along { row, axis, all });
        }
    }

    /// Number of points.
    #[inline]
    pub fn len(&self) -> usize {
        self.coordinates_m[0].len()
    }

    /// Whether there are no points.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Iterate over the points.
    #[inline]
    pub fn iter(&self) -> impl Iterator<Item = [f64; 3]> + '_ {
        let [x, y, z] = &self.coordinates_m;
        x.iter().zip(y).zip(z).map(|((&x, &y), &z)| [x, y, z])
    }

    /// Coordinates x, y and z of a range of points, for [`paths`].
    ///
    /// # Panics
    /// If the range is out of bounds.
    #[inline(always)]
    pub fn part(&self, range: Range<usize>) -> [&[f64]; 3] {
        let [x, y, z] = &self.coordinates_m;
        [&x[range.clone()], &y[range.clone()], &z[range]]
    }
}

/// Points of a grid row, `(origin_m + x_axis (start_m + column step_m)) + across_m`, from column `first` on. Each is computed from its own
/// column in this order of operations, so that its bits are independent of the block that contains it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Origin of the grid, metres.
    pub origin_m: [f64; 3],
    /// Unit vector along the row.
    pub x_axis: [f64; 3],
    /// Offset from the origin to the row, metres.
    pub across_m: [f64; 3],
    /// Position of column 0 along the row, metres.
    pub start_m: f64,
    /// Column spacing, metres.
    pub step_m: f64,
    /// Column of the first point; exact in float64.
    pub first: usize,
}

/// One coordinate of a row's points.
struct Along<'a> {
    row: &'a Row,
    axis: usize,
    all: &'a mut [f64],
}

impl Kernel for Along<'_> {
    type Output = ();

    /// A plain loop: what the lanes' instructions make of it.
    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let Row {
            start_m, step_m, ..
        } = *self.row;
        let of = |all: &[f64; 3]| all[self.axis];
        let (origin_m, x) = (of(&self.row.origin_m), of(&self.row.x_axis));
        let (across_m, first) = (of(&self.row.across_m), self.row.first as f64);
        for (i, one) in self.all.iter_mut().enumerate() {
            // Integer sum, exact.
            let column = first + i as f64;
            *one = (origin_m + x * (start_m + column * step_m)) + across_m;
        }
    }
}

/// Antenna positions and path datum of a pulse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Antennas {
    /// Phase centre of the transmitter, metres.
    pub transmitter_m: [f64; 3],
    /// Phase centre of the receiver, metres.
    pub receiver_m: [f64; 3],
    /// Datum subtracted from every path, metres.
    pub datum_m: f64,
}

/// Compute paths to points with the coordinates `[x, y, z]` into `paths_m`.
///
/// # Panics
/// If slices differ in length.
#[inline(always)]
pub fn paths(antennas: &Antennas, [x, y, z]: [&[f64]; 3], paths_m: &mut [f64]) {
    let count = paths_m.len();
    assert!(x.len() == count && y.len() == count && z.len() == count);
    let distance = |from: &[f64; 3], i: usize| {
        let (dx, dy, dz) = (x[i] - from[0], y[i] - from[1], z[i] - from[2]);
        (dx * dx + dy * dy + dz * dz).sqrt()
    };
    let Antennas {
        transmitter_m,
        receiver_m,
        datum_m,
    } = antennas;
    if transmitter_m == receiver_m {
        for (i, path_m) in paths_m.iter_mut().enumerate() {
            *path_m = 2.0 * distance(transmitter_m, i) - datum_m;
        }
    } else {
        for (i, path_m) in paths_m.iter_mut().enumerate() {
            *path_m = distance(transmitter_m, i) + distance(receiver_m, i) - datum_m;
        }
    }
}

/// Path linear in slow time, `path + rate u`, `u` in pulses from a centre.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Line {
    /// Path at the centre, metres.
    pub path_m: f64,
    /// Rate, metres per pulse.
    pub rate_m: f64,
}

/// Points per block of [`lines`] (1 KiB).
const RUN: usize = 64;

/// Lines through the paths at an early and a late time, `between` pulses apart with the centre halfway; `between` 0 gives
/// rate 0.
///
/// # Panics
/// If `lines` is shorter than the points.
pub fn lines(
    instructions: Instructions,
    antennas: &[Antennas; 2],
    between: f64,
    points: &Points,
    lines: &mut [Line],
) {
    assert_eq!(points.len(), lines.len());
    instructions.run(Lines {
        antennas,
        between,
        points,
        lines,
    });
}

struct Lines<'a> {
    antennas: &'a [Antennas; 2],
    between: f64,
    points: &'a Points,
    lines: &'a mut [Line],
}

impl Kernel for Lines<'_> {
    type Output = ();

    /// Plain loops: what the lanes' instructions make of them.
    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let [early, late] = self.antennas;
        let mut paths_m = [[0.0; RUN]; 2];
        for (run, lines) in self.lines.chunks_mut(RUN).enumerate() {
            let part = self.points.part(run * RUN..run * RUN + lines.len());
            let [early_m, late_m] = &mut paths_m;
            paths(early, part, &mut early_m[..lines.len()]);
            paths(late, part, &mut late_m[..lines.len()]);
            for (line, (early_m, late_m)) in lines.iter_mut().zip(early_m.iter().zip(late_m)) {
                line.path_m = (early_m + *late_m) / 2.0;
                line.rate_m = match self.between != 0.0 {
                    true => (*late_m - early_m) / self.between,
                    false => 0.0,
                };
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trial::Numbers;

    /// Oracle: nested hypotenuses, with an error of 5 roundings.
    #[test]
    fn paths_agree_with_sums_of_distances() {
        let mut numbers = Numbers::new(1);
        let mut place = |reach_m: f64| [0; 3].map(|_| numbers.signed() * reach_m);
        for (one, datum_m) in [(true, 0.0), (false, 13_000.0), (false, -1.0)] {
            let transmitter_m = place(8000.0);
            let receiver_m = if one { transmitter_m } else { place(8000.0) };
            let antennas = Antennas {
                transmitter_m,
                receiver_m,
                datum_m,
            };
            let mut points = Points::default();
            let places: Vec<[f64; 3]> = (0..100).map(|_| place(90.0)).collect();
            places.iter().for_each(|&point| points.push(point));
            let mut paths_m = vec![0.0; 99];
            paths(&antennas, points.part(1..100), &mut paths_m);
            for (point, got_m) in places[1..].iter().zip(&paths_m) {
                let leg = |from: [f64; 3]| {
                    let across = (point[0] - from[0]).hypot(point[1] - from[1]);
                    across.hypot(point[2] - from[2])
                };
                let whole_m = leg(transmitter_m) + leg(receiver_m);
                let error_m = (got_m - (whole_m - datum_m)).abs();
                // Ten roundings of the path, two of the difference.
                let allowed_m = 0.5 * f64::EPSILON * (10.0 * whole_m + 2.0 * got_m.abs());
                assert!(error_m <= allowed_m, "{error_m} {allowed_m}");
            }
        }
    }

    #[test]
    fn monostatic_path_is_bit_identical_to_two_coincident_antennas() {
        let mut numbers = Numbers::new(2);
        let mut points = Points::default();
        (0..50).for_each(|_| points.push([0; 3].map(|_| numbers.signed() * 1e3)));
        assert!(points.len() == 50 && !points.is_empty());
        let one = Antennas {
            transmitter_m: [5.0, -0.0, 700.1],
            receiver_m: [5.0, 0.0, 700.1],
            datum_m: 3.3,
        };
        let mut together = [0.0; 50];
        paths(&one, points.part(0..50), &mut together);
        let leg = |datum_m| Antennas { datum_m, ..one };
        let mut legs = [0.0; 50];
        paths(&leg(0.0), points.part(0..50), &mut legs);
        for (path_m, leg_m) in together.iter().zip(legs) {
            assert_eq!(*path_m, leg_m / 2.0 + leg_m / 2.0 - 3.3);
        }
        points.clear();
        assert!(points.is_empty());
    }

    /// Far from the origin, where the order of summation matters: against hand evaluation, from any column.
    #[test]
    fn row_point_is_independent_of_block_start() {
        let row = Row {
            origin_m: [4.1e6, -1.3e6, 4.7e6],
            x_axis: [0.6, -0.64, 0.48],
            across_m: [3.3, 7.7, -11.1],
            start_m: -250.3,
            step_m: 0.37,
            first: 0,
        };
        for instructions in Instructions::available() {
            for (first, count) in [(0, 301), (1, 300), (37, 64), (299, 2)] {
                let mut part = Points::default();
                part.set_row(instructions, &Row { first, ..row }, count);
                assert_eq!(part.len(), count);
                for (i, got) in (first..).zip(part.iter()) {
                    let along_m = -250.3 + i as f64 * 0.37;
                    let expected = [0, 1, 2].map(|axis| {
                        let along_m = row.x_axis[axis] * along_m;
                        row.origin_m[axis] + along_m + row.across_m[axis]
                    });
                    assert_eq!(got, expected, "{i} of {first}, {}", instructions.name());
                }
            }
        }
    }

    /// An antenna in uniform motion along the line of points has linear paths, evaluated by hand.
    #[test]
    fn lines_pass_through_paths_at_both_times() {
        let at = |x_m: f64| Antennas {
            transmitter_m: [x_m, 0.0, 0.0],
            receiver_m: [x_m, 0.0, 0.0],
            datum_m: 2000.0,
        };
        let mut points = Points::default();
        (0..150).for_each(|i| points.push([1000.0 + f64::from(i), 0.0, 0.0]));
        let mut got = vec![Line::default(); 150];
        lines(
            Instructions::best(),
            &[at(-3.0), at(5.0)],
            16.0,
            &points,
            &mut got,
        );
        for (line, i) in got.iter().zip(0..) {
            // 2 (1000 + i - x) - 2000 at the centre, x = 1; 16 m less in 16 pulses. Exact in float64.
            let expected = Line {
                path_m: 2.0 * f64::from(i) - 2.0,
                rate_m: -1.0,
            };
            assert_eq!(*line, expected);
        }
        lines(
            Instructions::Portable,
            &[at(1.0), at(1.0)],
            0.0,
            &points,
            &mut got,
        );
        assert!(got.iter().all(|line| line.rate_m == 0.0));
        assert_eq!(got[149].path_m, 296.0);
    }
}
