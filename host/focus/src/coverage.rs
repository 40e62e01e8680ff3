//! Pixels whose delays lie within the recorded interval of delays.
//!
//! A pulse's samples hold the echoes of an interval of two-way paths completely
//! ([`Pulse::recorded_paths_m`](subaperture_model::phase_history::Pulse::recorded_paths_m)): those of the receive window less the pulse, of TOA1 to
//! TOA2, or of the unambiguous interval `c / step` about the reference path. Echoes of other paths are missing, and since a sum over frequencies
//! `step` apart repeats in the path, echoes of the interval would appear there.
//!
//! **Rule.** A pixel is covered if its path lies within the interval of every pulse that forms it: all pulses, or those of its block in a beam. Pixels
//! that are not covered are zero in every image, whatever former makes it, and in the exact sum that it is compared with. [`Plan`](crate::Plan)
//! counts them (`uncovered_pixels` in its summary), and refuses a grid without a covered pixel. Pulses that state no interval cover every pixel.
//!
//! The path of a velocity ([`GridPoints::Velocities`]) is that to the moving target's position in the pulse.
//!
//! **Cost.** The grid is divided by four until every pulse covers a rectangle or one pulse misses it; a pulse that covers a rectangle is not
//! examined again within it. The path changes by at most twice the distance, so the centre and the radius of a rectangle decide. Only rectangles
//! at the edge of an interval are divided down to pixels.

use glam::DVec3;
use num_complex::Complex32;
use serde_json::{Map, Value};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::quantity::metres;

use super::patch::{PatchSize, Rectangle};
use super::{FormError, GridPoints, ImageSpec, Tile};

/// Key of the number of uncovered pixels in the summary of a plan and in the settings of an image.
const KEY: &str = "uncovered_pixels";

/// Antennas and recorded interval of a pulse.
struct Interval {
    antennas_m: [DVec3; 2],
    paths_m: [f64; 2],
    /// Position of a grid point in the pulse: `origin_m + scale * point`. The scale is 1, or the elapsed time in seconds for velocities.
    origin_m: DVec3,
    scale: f64,
}

impl Interval {
    /// Smallest and largest excess of a ball of grid points over the ends of the interval, metres of two-way path; negative within.
    fn excess_m(&self, (centre, radius): (DVec3, f64)) -> [f64; 2] {
        let [from_m, to_m] = self.antennas_m;
        let point_m = self.origin_m + self.scale * centre;
        let path_m = (point_m - from_m).length() + (point_m - to_m).length();
        let [shortest_m, longest_m] = self.paths_m;
        let excess_m = (path_m - longest_m).max(shortest_m - path_m);
        let change_m = 2.0 * self.scale.abs() * radius;
        [excess_m - change_m, excess_m + change_m]
    }
}

/// Recorded intervals of the pulses of an image.
pub(crate) struct Coverage<'a> {
    spec: ImageSpec<'a>,
    points: GridPoints,
    /// By pulse; `None` for a pulse that states no interval.
    intervals: Vec<Option<Interval>>,
}

impl<'a> Coverage<'a> {
    /// Prepare the intervals of all pulses of `spec`.
    pub(crate) fn new(spec: ImageSpec<'a>, points: GridPoints) -> Self {
        let intervals = spec.collection.pulses.iter().map(|pulse| {
            Some(Interval {
                antennas_m: [pulse.transmitter_m, pulse.receiver_m],
                paths_m: pulse.recorded_paths_m()?,
                origin_m: points.target(pulse, DVec3::ZERO).0,
                scale: match points {
                    GridPoints::Positions => 1.0,
                    GridPoints::Velocities { epoch_s, .. } => pulse.time_s - epoch_s,
                },
            })
        });
        Self {
            intervals: intervals.collect(),
            spec,
            points,
        }
    }

    /// Whether a pixel is covered.
    pub(crate) fn covers(&self, row: usize, column: usize) -> bool {
        let pixel = Rectangle::of(&[row..row + 1, column..column + 1]);
        let mut covers = true;
        self.uncovered(&pixel, &mut |_| covers = false);
        covers
    }

    /// Set the pixels of a tile that are not covered to zero, and return their number.
    pub(crate) fn clear(&self, tile: &mut Tile) -> u64 {
        self.fill(tile, Complex32::ZERO)
    }

    /// Set the pixels of a tile that are not covered to `value`, and return their number.
    pub(crate) fn fill(&self, tile: &mut Tile, value: Complex32) -> u64 {
        let own = tile.place;
        let pixels = &mut tile.pixels;
        let mut count = 0;
        self.uncovered(&own, &mut |part| {
            for row in part.row - own.row..part.row - own.row + part.size.rows {
                let first = row * own.size.columns + part.column - own.column;
                pixels[first..first + part.size.columns].fill(value);
            }
            count += part.size.rows as u64 * part.size.columns as u64;
        });
        count
    }

    /// Number of pixels that are not covered.
    ///
    /// # Errors
    /// [`FormError::Unsuited`] if these are all pixels of the grid.
    pub(crate) fn count_uncovered(&self) -> Result<u64, FormError> {
        let grid = self.spec.grid;
        let mut count = 0;
        self.uncovered(&Tile::place_of(grid), &mut |part| {
            count += part.size.rows as u64 * part.size.columns as u64;
        });
        match count == grid.num_pixels() {
            true => Err(FormError::unsuited(self.reason())),
            false => Ok(count),
        }
    }

    /// Reason to refuse a grid without a covered pixel.
    fn reason(&self) -> String {
        let span = |values: &mut dyn Iterator<Item = f64>| {
            let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
                (low.min(x), high.max(x))
            });
            format!("{} to {}", metres(0.5 * low), metres(0.5 * high))
        };
        let stated = || self.intervals.iter().flatten();
        let pulses = &self.spec.collection.pulses;
        let place = Tile::place_of(self.spec.grid);
        let corners = [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0), (0.5, 0.5)]
            .map(|(row, column)| place.point_m(self.spec.grid, row, column));
        let paths = pulses.iter().flat_map(|pulse| {
            corners.map(|point| pulse.path_m(self.points.target(pulse, point).0))
        });
        format!(
            "no pixel lies within the recorded delays of all pulses that form it: the samples hold slant ranges of {}, and the grid has {}: choose a grid \
             within the recorded ranges (subap info states the default grid), select the pulses of each pixel by a beam or a processed Doppler band, or \
             correct the recorded delays or the positions",
            span(&mut stated().flat_map(|own| own.paths_m)),
            span(&mut { paths })
        )
    }

    /// Visit the largest rectangles of `place` that are not covered.
    fn uncovered(&self, place: &Rectangle, visit: &mut dyn FnMut(Rectangle)) {
        let Some(illumination) = &self.spec.weights.illumination else {
            let stated: Vec<&Interval> = self.intervals.iter().flatten().collect();
            self.divide(*place, &stated, visit);
            return;
        };
        let side = illumination.side();
        let [rows, columns] = place.place();
        for row in rows.start / side[0]..rows.end.div_ceil(side[0]) {
            for column in columns.start / side[1]..columns.end.div_ceil(side[1]) {
                let block = illumination.block_of(row * side[0], column * side[1]);
                let of_block = illumination.place(block);
                let part = [0, 1].map(|axis| {
                    let (own, all) = (&of_block[axis], &place.place()[axis]);
                    own.start.max(all.start)..own.end.min(all.end)
                });
                let stated = self.intervals[illumination.pulses(block)].iter();
                let stated: Vec<&Interval> = stated.flatten().collect();
                self.divide(Rectangle::of(&part), &stated, visit);
            }
        }
    }

    /// Visit the uncovered rectangles of `place`, whose pulses are examined.
    fn divide(&self, place: Rectangle, pulses: &[&Interval], visit: &mut dyn FnMut(Rectangle)) {
        let points = ball(self.spec.grid, &place);
        let mut undecided = Vec::new();
        for &pulse in pulses {
            let [least_m, most_m] = pulse.excess_m(points);
            if least_m > 0.0 {
                visit(place);
                return;
            }
            if most_m > 0.0 {
                undecided.push(pulse);
            }
        }
        if undecided.is_empty() {
            return;
        }
        let halves = place.place().map(|side| {
            let middle = side.start + side.len().div_ceil(2);
            [side.start..middle, middle..side.end]
        });
        for rows in &halves[0] {
            for columns in &halves[1] {
                if !rows.is_empty() && !columns.is_empty() {
                    let part = Rectangle::of(&[rows.clone(), columns.clone()]);
                    self.divide(part, &undecided, visit);
                }
            }
        }
    }
}

/// Centre and radius of a ball that contains the points of a rectangle, in the grid's unit. The radius is 0 for one point.
fn ball(grid: &ImageGrid, place: &Rectangle) -> (DVec3, f64) {
    let Rectangle { row, column, size } = *place;
    if size
        == (PatchSize {
            rows: 1,
            columns: 1,
        })
    {
        return (grid.position_m(row, column), 0.0);
    }
    let rows = [grid.rows.at(row), grid.rows.at(row + size.rows - 1)];
    let columns = [
        grid.columns.at(column),
        grid.columns.at(column + size.columns - 1),
    ];
    let middle = |[first, last]: [f64; 2]| 0.5 * (first + last);
    let half = |[first, last]: [f64; 2]| 0.5 * (last - first).abs();
    let across = match grid.polar {
        true => half(rows) + rows[0].abs().max(rows[1].abs()) * half(columns),
        false => libm::hypot(half(rows), half(columns)),
    };
    let flat_m = grid.flat().point_m(middle(rows), middle(columns));
    let heights = grid.relief.as_ref().map_or([0.0; 2], |relief| {
        let [x, y] = grid.plane_m(middle(rows), middle(columns));
        relief.range_over_m([x - across, x + across], [y - across, y + across])
    });
    let centre_m = flat_m + grid.normal() * middle(heights);
    // Rounding of coordinates must not decide about a rectangle.
    let rounding_m = 1e-9 + 1e-13 * centre_m.length();
    (centre_m, across + half(heights) + rounding_m)
}

/// Add the number of pixels that are not covered to the summary of a plan or the settings of an image, if there are any.
pub(crate) fn note(count: u64, settings: &mut Map<String, Value>) {
    if count > 0 {
        settings.insert(KEY.to_owned(), count.into());
    }
}

/// Warning about pixels that are not covered, from the summary of a plan or the settings of an image of `grid`; `None` if all are covered.
pub fn warning(settings: &Map<String, Value>, grid: &ImageGrid) -> Option<String> {
    let count = settings.get(KEY)?.as_u64()?;
    Some(format!(
        "image: {count} of {} pixels lie outside the recorded delays of a pulse: they are zero",
        grid.num_pixels()
    ))
}

#[cfg(test)]
mod tests {
    use subaperture_model::SPEED_OF_LIGHT_M_S;
    use subaperture_model::geometry::{Axis, Relief, SceneFrame};
    use subaperture_model::phase_history::{BlockIllumination, Collection, Pulse, Sweep, Weights};
    use subaperture_signal::window::Window;

    use super::*;

    /// Radar on a line 10 km from the origin whose unambiguous interval is 100 m of path: 50 m of range.
    fn collection(reference_path_m: f64) -> Collection {
        let pulses = (0..50).map(|n| {
            let antenna_m = DVec3::new(0.1 * f64::from(n), -10_000.0, 0.0);
            Pulse {
                transmitter_m: antenna_m,
                receiver_m: antenna_m,
                reference_m: DVec3::ZERO,
                reference_path_m,
                start_hz: 1e10,
                step_hz: SPEED_OF_LIGHT_M_S / 100.0,
                time_s: f64::from(n),
                sweep: Sweep::AT_ONCE,
                recorded_path_m: None,
            }
        });
        Collection {
            name: "strip".to_owned(),
            frame: SceneFrame::Local,
            pulses: pulses.collect(),
            num_samples: 8,
            timed: true,
            extent: None,
        }
    }

    fn count(collection: &Collection, grid: &str) -> Result<u64, FormError> {
        let grid: ImageGrid = grid.parse().unwrap();
        let weights = Weights::new(collection, Window::default(), Window::default());
        let spec = ImageSpec::new(collection, &grid, &weights);
        Coverage::new(spec, GridPoints::Positions).count_uncovered()
    }

    #[test]
    fn pixels_beyond_the_interval_are_counted() {
        let about_reference = collection(20_000.0);
        assert_eq!(count(&about_reference, "x=-5:5:1,y=-24:24:1").unwrap(), 0);
        // 100 rows at -49.5 to 49.5 m. Those from -24.5 to 24.5 m are covered: 0.05 mm of curvature.
        assert_eq!(count(&about_reference, "x=0:1:1,y=-49.5:50:1").unwrap(), 50);
        let raw = collection(0.0);
        assert_eq!(count(&raw, "x=-5:5:1,y=60:80:1").unwrap(), 0);
        let mut stated = raw;
        for pulse in &mut stated.pulses {
            // Slant ranges of 10 010 to 10 020 m.
            pulse.recorded_path_m = Some([20_020.0, 20_040.0]);
        }
        // Rows at 0.5, 1.5, ...: those from 10.5 to 19.5 m are covered.
        assert_eq!(count(&stated, "x=0:1:1,y=0.5:30:1").unwrap(), 20);
    }

    #[test]
    fn grid_without_covered_pixel_is_refused() {
        let error = count(&collection(20_000.0), "x=-5:5:1,y=60:80:1").unwrap_err();
        let error = error.to_string();
        for part in ["9975 m to 10.03 km", "10.06 km to 10.08 km"] {
            assert!(error.contains(part), "{error}");
        }
    }

    /// Relief, polar grid and blocks of different pulses, against a test of every pixel for every pulse.
    #[test]
    fn rectangles_agree_with_single_pixels() {
        let mut collection = collection(0.0);
        for (n, pulse) in collection.pulses.iter_mut().enumerate() {
            let place_m = DVec3::new(40.0 * n as f64 - 1000.0, -9000.0, 3000.0);
            (pulse.transmitter_m, pulse.receiver_m) = (place_m, place_m + DVec3::X * 300.0);
            let drift_m = (n as f64 * 0.7).sin() * 30.0;
            pulse.recorded_path_m = Some([18_700.0 + drift_m, 19_300.0 + drift_m]);
        }
        let axis = |start: f64, step: f64, count: usize| Axis { start, step, count };
        let hills: Vec<f64> = (0..64).map(|i| 40.0 * (i as f64 * 0.9).sin()).collect();
        let relief = Relief::new("hills", [axis(-500.0, 150.0, 8); 2], hills, 0.0);
        let flat = ImageGrid::horizontal(axis(-400.0, 9.7, 80), axis(-400.0, 11.3, 70), 0.0);
        let polar: ImageGrid = "r=100:500:7,theta=-60:200:3".parse().unwrap();
        let grids = [flat.clone(), flat.on(relief.unwrap()), polar];
        for grid in &grids {
            let (rows, columns) = (grid.rows.count, grid.columns.count);
            let side = [23, 31];
            let blocks = rows.div_ceil(side[0]) * columns.div_ceil(side[1]);
            let pulses = (0..blocks)
                .map(|i| (3 * i) % 20..20 + (7 * i) % 30)
                .collect();
            let beam = BlockIllumination::new([rows, columns], side, pulses, Window::default());
            let whole = Weights::new(&collection, Window::default(), Window::default());
            let in_beam = Weights {
                illumination: Some(beam.into()),
                ..whole.clone()
            };
            for weights in [&whole, &in_beam] {
                let spec = ImageSpec::new(&collection, grid, weights);
                let coverage = Coverage::new(spec, GridPoints::Positions);
                let place = Tile::place_of(grid);
                let mut cleared = Tile::new(place);
                cleared.pixels.fill(Complex32::ONE);
                coverage.clear(&mut cleared);
                let mut count = 0;
                for (i, point_m) in cleared.points(grid).enumerate() {
                    let forming = match &weights.illumination {
                        None => 0..collection.pulses.len(),
                        Some(beam) => beam.pulses(beam.block_of(i / columns, i % columns)),
                    };
                    let covered = collection.pulses[forming].iter().all(|pulse| {
                        let path_m = point_m.distance(pulse.transmitter_m)
                            + point_m.distance(pulse.receiver_m);
                        let [from_m, to_m] = pulse.recorded_path_m.unwrap();
                        (from_m..=to_m).contains(&path_m)
                    });
                    assert_eq!(cleared.pixels[i] != Complex32::ZERO, covered, "{i}");
                    assert_eq!(coverage.covers(i / columns, i % columns), covered, "{i}");
                    count += u64::from(!covered);
                }
                assert!(count > 0 && count < grid.num_pixels(), "{count}");
                assert_eq!(coverage.count_uncovered().unwrap(), count);
            }
        }
    }

    /// Velocities of a target at (3, 5) m at 20 s: covered are those whose target stays within the interval, by a test of every velocity for every pulse.
    #[test]
    fn velocities_are_covered_while_the_target_stays_in_the_interval() {
        let collection = collection(20_000.0);
        let grid: ImageGrid = "x=-3:3:0.21,y=-1.5:1.5:0.07".parse().unwrap();
        let weights = Weights::new(&collection, Window::default(), Window::default());
        let position_m = DVec3::new(3.0, 5.0, 0.0);
        let points = GridPoints::Velocities {
            position_m,
            epoch_s: 20.0,
        };
        let coverage = Coverage::new(ImageSpec::new(&collection, &grid, &weights), points);
        let mut count = 0;
        for row in 0..grid.rows.count {
            for column in 0..grid.columns.count {
                let velocity_m_s = grid.position_m(row, column);
                let covered = collection.pulses.iter().all(|pulse| {
                    let target_m = position_m + velocity_m_s * (pulse.time_s - 20.0);
                    (pulse.path_m(target_m) - 20_000.0).abs() <= 50.0
                });
                assert_eq!(coverage.covers(row, column), covered, "{velocity_m_s}");
                count += u64::from(!covered);
            }
        }
        assert!(count > 0 && count < grid.num_pixels(), "{count}");
        assert_eq!(coverage.count_uncovered().unwrap(), count);
    }
}
