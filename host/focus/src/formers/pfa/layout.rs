//! Division of grid and aperture: patches of pixels and sub-apertures, each pair with linear paths of its own.
//!
//! The residual of linear paths falls with the square of the patch and with the square of the sub-aperture. For each number of
//! sub-apertures the largest patches that keep the bound are sought; the fastest pair by the timing model is taken.

use std::ops::Range;

use glam::{DVec2, DVec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::plane::{Extent, Plane};
use super::raster::RasterSize;
use crate::patch::{PatchSize, Patches, Rectangle};
use crate::probes::{Shares, rough, spread, turned};
use crate::{FormError, ImageSpec, Tile};
use std::f64::consts::TAU;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::{Axis, ImageGrid};
use subaperture_model::phase_history::Pulse;

/// Largest number of paths evaluated for the residual of an undivided grid, and of one layout of patches.
const PROBED_PATHS_WHOLE: usize = 8_000_000;
const PROBED_PATHS: usize = 1_000_000;
/// Patches per side at which the residual is evaluated, and points per side of such a patch; of a grid that is not divided.
const PROBED_PATCHES: usize = 5;
const PROBED_POINTS: usize = 5;
const PROBED_POINTS_WHOLE: usize = 9;
/// Positions of each antenna whose nearest patch is among those evaluated.
const PROBED_POSITIONS: usize = 8;
/// Largest number of attempts at a patch size that keeps the bound, for each number of sub-apertures.
const ATTEMPTS: usize = 8;
/// Ratio of times to the fastest layout so far beyond which more sub-apertures are not tried.
const TOO_SLOW: f64 = 1.5;

/// Sizes of patches and sub-apertures.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Layout {
    /// Largest size of a patch.
    patch: PatchSize,
    /// Number of sub-apertures with nearly equal numbers of pulses.
    sub_apertures: usize,
    /// Point about which all paths are linearised, metres; `None` for the centre of each patch.
    centre_m: Option<DVec3>,
}

impl Layout {
    /// One patch and one aperture: polar format of textbooks.
    pub(super) fn whole(grid: &ImageGrid, centre_m: Option<DVec3>) -> Self {
        Self {
            patch: Tile::place_of(grid).size,
            sub_apertures: 1,
            centre_m,
        }
    }

    /// Whether the layout is valid for `num_pulses` pulses.
    pub(super) fn fits(&self, num_pulses: usize) -> bool {
        let patch = self.patch.rows.min(self.patch.columns) > 0;
        let centre = self.centre_m.unwrap_or_default();
        let near = centre.abs().cmple(DVec3::splat(1e12)).all();
        patch && near && (1..=num_pulses).contains(&self.sub_apertures)
    }

    /// Whether grid and aperture are not divided.
    pub(super) fn is_whole(&self, grid: &ImageGrid) -> bool {
        self.sub_apertures == 1 && self.patches(grid).count() == 1
    }

    pub(super) fn patches(&self, grid: &ImageGrid) -> Patches {
        Patches::new(grid, self.patch)
    }

    /// Pulses of each sub-aperture of `num_pulses`.
    pub(super) fn sub_apertures(&self, num_pulses: usize) -> impl Iterator<Item = Range<usize>> {
        let end = move |i: usize| i * num_pulses / self.sub_apertures;
        (0..self.sub_apertures).map(move |i| end(i)..end(i + 1))
    }

    /// Plane of a patch and the pulses of a sub-aperture, and the extent of the patch in it.
    pub(super) fn cell<'a>(
        &self,
        pulses: &'a [Pulse],
        grid: &ImageGrid,
        place: &Rectangle,
    ) -> (Plane<'a>, Extent) {
        let part = part(grid, place);
        let plane = Plane::new(pulses, &part, self.centre_m);
        let extent = plane.image_extent(&part);
        (plane, extent)
    }

    /// Rasters of the sub-apertures for the patch in the middle of the grid.
    pub(super) fn rasters(
        &self,
        spec: &ImageSpec,
        taps: usize,
    ) -> Result<Vec<RasterSize>, FormError> {
        let collection = spec.collection;
        let middle = self.patches(spec.grid).spread(1).next();
        let place = middle.unwrap_or(Tile::place_of(spec.grid));
        let each = self.sub_apertures(collection.pulses.len()).map(|pulses| {
            let (plane, extent) = self.cell(&collection.pulses[pulses], spec.grid, &place);
            RasterSize::new(plane.spectrum(collection.num_samples), extent, taps)
        });
        each.collect()
    }

    /// Predicted relative RMS error of the worst pixel from the phase error of linear paths,
    /// and its part that varies fast from pulse to pulse.
    pub(super) fn residual(&self, spec: &ImageSpec) -> [f64; 2] {
        let places = self.probed(spec);
        let (side, paths) = match self.is_whole(spec.grid) {
            true => (PROBED_POINTS_WHOLE, PROBED_PATHS_WHOLE),
            false => (PROBED_POINTS, PROBED_PATHS),
        };
        let seen = Seen::new(spec, paths / (places.len() * side * side));
        let worst = places.par_iter().map(|place| {
            let part = part(spec.grid, place);
            let spans = seen.spans(self, &part);
            let points = spread(&part, side);
            let worst = points.par_iter().map(|&point| seen.error(&spans, point));
            worst.reduce(|| [0.0; 2], most)
        });
        worst.reduce(|| [0.0; 2], most).map(f64::sqrt)
    }

    /// Patches spread over the grid, and those nearest to some positions of the antennas, where paths bend most.
    fn probed(&self, spec: &ImageSpec) -> Vec<Rectangle> {
        let (grid, pulses) = (spec.grid, &spec.collection.pulses);
        let patches = self.patches(grid);
        let mut places: Vec<Rectangle> = patches.spread(PROBED_PATCHES).collect();
        for n in crate::patch::spread(pulses.len(), PROBED_POSITIONS) {
            for antenna_m in [pulses[n].transmitter_m, pulses[n].receiver_m] {
                let [row, column] = grid.coordinates(antenna_m);
                let index = |axis: &Axis, value: f64| {
                    let at = ((value - axis.start) / axis.step).round();
                    at.clamp(0.0, (axis.count - 1) as f64) as usize
                };
                let nearest = patches.at(index(&grid.rows, row), index(&grid.columns, column));
                if !places.contains(&nearest) {
                    places.push(nearest);
                }
            }
        }
        places
    }
}

fn most(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0].max(b[0]), a[1].max(b[1])]
}

/// Part of a planar grid.
fn part(grid: &ImageGrid, place: &Rectangle) -> ImageGrid {
    let axis = |axis: &Axis, range: &Range<usize>| Axis {
        start: axis.at(range.start),
        count: range.len(),
        ..*axis
    };
    let [rows, columns] = place.place();
    ImageGrid {
        rows: axis(&grid.rows, &rows),
        columns: axis(&grid.columns, &columns),
        ..grid.clone()
    }
}

/// Pulses at which the residual is evaluated.
struct Seen<'a> {
    pulses: &'a [Pulse],
    /// Indices of the evaluated pulses.
    chosen: Vec<usize>,
    /// RMS frequency of each, hertz.
    rms_hz: Vec<f64>,
    slow: Shares,
}

/// Evaluated pulses of a sub-aperture, in a patch's plane.
struct Span<'a> {
    plane: Plane<'a>,
    /// Pulse, path gradient, path to the centre in metres, and RMS frequency.
    pulses: Vec<(&'a Pulse, DVec2, f64, f64)>,
}

impl<'a> Seen<'a> {
    /// At most `at_most` pulses, evenly spaced.
    fn new(spec: &ImageSpec<'a>, at_most: usize) -> Self {
        let (collection, weights) = (spec.collection, spec.weights);
        let (count, at_most) = (collection.pulses.len(), at_most.max(1));
        // Even sampling with a golden-ratio offset avoids aliasing with periodic errors.
        let place = |i: usize| {
            let offset = (i as f64 * 0.618_033_988_749_895).fract();
            ((i as f64 + offset) * count as f64 / at_most as f64) as usize
        };
        let chosen: Vec<usize> = match count <= at_most {
            true => (0..count).collect(),
            false => (0..at_most).map(place).collect(),
        };
        let slow: Vec<f64> = chosen.iter().map(|&n| weights.slow[n]).collect();
        let fast = Shares::new(&weights.fast);
        let rms_hz = chosen.iter().map(|&n| {
            let pulse = &collection.pulses[n];
            let squares = (0..collection.num_samples).map(|k| pulse.frequency_hz(k).powi(2));
            fast.worst(squares).sqrt()
        });
        Self {
            pulses: &collection.pulses,
            rms_hz: rms_hz.collect(),
            slow: Shares::new(&slow),
            chosen,
        }
    }

    fn spans(&self, layout: &Layout, part: &ImageGrid) -> Vec<Span<'a>> {
        let each = layout.sub_apertures(self.pulses.len()).map(|range| {
            let plane = Plane::new(&self.pulses[range.clone()], part, layout.centre_m);
            let first = self.chosen.partition_point(|&n| n < range.start);
            let end = self.chosen.partition_point(|&n| n < range.end);
            let linear = |i: usize| {
                let pulse = &self.pulses[self.chosen[i]];
                let centre_path_m = pulse.path_m(plane.centre_m);
                (pulse, plane.gradient(pulse), centre_path_m, self.rms_hz[i])
            };
            Span {
                pulses: (first..end).map(linear).collect(),
                plane,
            }
        });
        each.collect()
    }

    /// Squared relative error of a pixel, and its part that varies fast.
    fn error(&self, spans: &[Span], point: DVec3) -> [f64; 2] {
        let mut phases_rad = Vec::with_capacity(self.chosen.len());
        for Span { plane, pulses } in spans {
            let place = plane.place(point);
            phases_rad.extend(
                pulses
                    .iter()
                    .map(|(pulse, gradient, centre_path_m, rms_hz)| {
                        let left_m = pulse.path_m(point) - centre_path_m - gradient.dot(place);
                        TAU * rms_hz * left_m / SPEED_OF_LIGHT_M_S
                    }),
            );
        }
        [
            self.slow
                .worst(phases_rad.iter().map(|&phase_rad| turned(phase_rad))),
            self.slow.worst(rough(&phases_rad).map(turned)),
        ]
    }
}

/// Layout with its residual and its part that varies fast, as of [`Layout::residual`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Planned {
    pub(super) layout: Layout,
    pub(super) residual: [f64; 2],
}

impl Planned {
    pub(super) fn new(spec: &ImageSpec, layout: Layout) -> Self {
        Self {
            residual: layout.residual(spec),
            layout,
        }
    }

    /// Fastest layout with a residual of at most `bound`, by the time that `time` gives, and that time. `self` is the undivided layout. `None` if no
    /// layout was seen to keep the bound.
    pub(super) fn fastest(
        &self,
        spec: &ImageSpec,
        bound: f64,
        time: impl Fn(&Layout) -> Option<f64>,
        cancelled: &dyn Fn() -> bool,
    ) -> Result<Option<(f64, Self)>, FormError> {
        let num_pulses = spec.collection.pulses.len();
        // Paths of one pulse are linear in the fitted positions.
        let powers = (0..).map(|i| 1usize << i);
        let counts = powers.take_while(|&count| count < num_pulses);
        let mut best: Option<(f64, Self)> = None;
        for sub_apertures in counts.chain([num_pulses]) {
            let undivided = match sub_apertures {
                1 => *self,
                _ => self.with(spec, sub_apertures, self.layout.patch),
            };
            let Some(found) = undivided.largest_patches(spec, bound, cancelled)? else {
                continue;
            };
            let Some(time) = time(&found.layout) else {
                break;
            };
            let fastest = best.as_ref().map_or(f64::INFINITY, |(time, _)| *time);
            if time < fastest {
                best = Some((time, found));
            }
            let undivided = found.layout.patches(spec.grid).count() == 1;
            if undivided || time > TOO_SLOW * fastest {
                break;
            }
        }
        Ok(best)
    }

    /// Layout with other sizes.
    fn with(&self, spec: &ImageSpec, sub_apertures: usize, patch: PatchSize) -> Self {
        Self::new(
            spec,
            Layout {
                patch,
                sub_apertures,
                ..self.layout
            },
        )
    }

    /// Layout of nearly the largest patches with a residual of at most `bound`; `self` has one patch.
    fn largest_patches(
        self,
        spec: &ImageSpec,
        bound: f64,
        cancelled: &dyn Fn() -> bool,
    ) -> Result<Option<Self>, FormError> {
        let mut planned = self;
        let mut side_m = self.layout.patch.side_m(spec.grid);
        for _ in 1..ATTEMPTS {
            if cancelled() {
                return Err(FormError::Cancelled);
            }
            let [residual, _] = planned.residual;
            if residual <= bound {
                return Ok(Some(planned));
            }
            // Square law, with a margin of a tenth for the higher orders.
            side_m *= (0.9 * bound / residual).sqrt().clamp(0.02, 0.9);
            let smaller = PatchSize::from_metres(spec.grid, side_m);
            if smaller == planned.layout.patch {
                return Ok(None);
            }
            planned = self.with(spec, self.layout.sub_apertures, smaller);
        }
        Ok((planned.residual[0] <= bound).then_some(planned))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sub_apertures_contain_every_pulse_once() {
        let grid: ImageGrid = "x=0:4:1,y=0:4:1".parse().unwrap();
        for (count, num_pulses) in [(1, 7), (3, 7), (7, 7), (4, 1001)] {
            let layout = Layout {
                sub_apertures: count,
                ..Layout::whole(&grid, None)
            };
            let ranges: Vec<Range<usize>> = layout.sub_apertures(num_pulses).collect();
            assert_eq!(ranges.len(), count);
            let pulses: Vec<usize> = ranges.iter().cloned().flatten().collect();
            assert_eq!(pulses, (0..num_pulses).collect::<Vec<_>>());
            let sizes = ranges.iter().map(|range| range.len());
            assert!(sizes.clone().max().unwrap() - sizes.min().unwrap() <= 1);
        }
    }

    #[test]
    fn parts_have_the_points_of_the_grid() {
        let grid: ImageGrid = "r=1:5:0.3,theta=0:90:7,cx=0.5,pitch=10".parse().unwrap();
        let place = Rectangle {
            row: 3,
            column: 2,
            size: PatchSize {
                rows: 4,
                columns: 5,
            },
        };
        let part = part(&grid, &place);
        for (row, column) in [(0, 0), (3, 4)] {
            let expected = grid.position_m(3 + row, 2 + column);
            assert!(part.position_m(row, column).distance(expected) < 1e-12);
        }
    }
}
