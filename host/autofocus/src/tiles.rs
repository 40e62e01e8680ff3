//! Tiles of an image: one range cell deep, and as wide in cross-range as the Fourier relation to the pulses is valid.
//!
//! Around a point the history of its range cell (`echoes.rs`) is the transform of the cross-range profile where paths
//! differ from the point's by a linear function of the pulse, and by less than a range cell. Both conditions are checked on the exact paths at
//! both ends of a tile; where they fail, tiles are narrower and contain less information.
//!
//! Dark pixels belong to no tile.

use glam::DVec3;

use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::{Image, power};
use subaperture_model::phase_history::Collection;

use super::centring::cross_range;
use super::echoes::{Echo, cell_path_m, wavenumber_rad_m};

/// Largest deviation of paths from a linear function at a tile's end, radians, and largest path difference, range cells.
const BEND_RAD: f64 = std::f64::consts::FRAC_PI_4;
const MIGRATION_CELLS: f64 = 0.5;

/// Width of the narrowest tiles, cross-range cells.
pub(crate) const MIN_CELLS: f64 = 8.0;

/// Piece of a range cell.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tile {
    /// Pixel nearest to its centre.
    pub(crate) place_m: DVec3,
    /// Index of the range cell at the centre of the aperture.
    pub(crate) bin: i64,
    /// Index of the cross-range piece.
    pub(crate) block: i64,
    /// Power of its brightest pixel.
    pub(crate) power: f64,
}

/// Tiles of an image.
#[derive(Clone, Debug)]
pub(crate) struct Tiling {
    /// Tiles, ordered by cross-range piece, then by range cell.
    pub(crate) tiles: Vec<Tile>,
    /// Width of each tile, cross-range cells.
    pub(crate) cells: f64,
}

impl Tiling {
    /// Keep the `most` brightest tiles.
    pub(crate) fn keep(&mut self, most: usize) {
        if self.tiles.len() <= most {
            return;
        }
        self.tiles.sort_by(|a, b| b.power.total_cmp(&a.power));
        self.tiles.truncate(most);
        self.tiles.sort_by_key(|tile| (tile.block, tile.bin));
    }
}

/// Tiles of `image`; `None` if the geometry leaves too few cells to each.
pub(crate) fn tiling(collection: &Collection, grid: &ImageGrid, image: &Image) -> Option<Tiling> {
    let turns = collection.num_turns();
    let at = |index: usize| grid.position_m(index / image.columns, index % image.columns);
    let brightest = (0..image.pixels.len())
        .filter(|&i| power(image.pixels[i]).is_finite())
        .max_by(|&a, &b| power(image.pixels[a]).total_cmp(&power(image.pixels[b])))?;
    let widest = widest(collection, grid, at(brightest), turns)?;
    let pulses = &collection.pulses[..turns];
    let (first, middle, last) = (&pulses[0], &pulses[turns / 2], &pulses[turns - 1]);
    let (bin_m, wavenumber) = (
        cell_path_m(collection),
        wavenumber_rad_m(collection, middle),
    );
    // Cycles over the aperture (cross-range cells), and range cells.
    let coordinates = |place_m: DVec3| {
        let cycles = (last.path_m(place_m) - first.path_m(place_m)) * wavenumber;
        [
            cycles / std::f64::consts::TAU,
            middle.path_m(place_m) / bin_m,
        ]
    };
    let all: Vec<[f64; 2]> = (0..image.pixels.len())
        .map(|i| coordinates(at(i)))
        .collect();
    let (low, high) = all
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), c| {
            (a.min(c[0]), b.max(c[0]))
        });
    let extent = (high - low).max(1.0);
    let blocks = (extent / widest).ceil().max(1.0);
    let wide = extent / blocks;
    let mut found = std::collections::BTreeMap::<(i64, i64), (f64, Tile)>::new();
    for (i, &[cycles, cells]) in all.iter().enumerate() {
        let power = power(image.pixels[i]);
        if !power.is_finite() {
            continue;
        }
        let across = (cycles - low) / wide;
        let (bin, block) = (cells.floor(), across.floor().min(blocks - 1.0));
        let off = libm::hypot(cells - bin - 0.5, (across - block - 0.5) * wide);
        let tile = Tile {
            place_m: at(i),
            bin: bin as i64,
            block: block as i64,
            power,
        };
        let entry = found
            .entry((tile.block, tile.bin))
            .or_insert((off, Tile { power: 0.0, ..tile }));
        let most = entry.1.power.max(power);
        if off < entry.0 {
            *entry = (off, tile);
        }
        entry.1.power = most;
    }
    let tiles = found.into_values().map(|(_, tile)| tile);
    Some(Tiling {
        tiles: tiles.filter(|tile| tile.power > 0.0).collect(),
        cells: match blocks > 1.0 {
            true => wide,
            false => widest,
        },
    })
}

/// Number of cross-range cells around a position for which the transform is valid.
fn widest(collection: &Collection, grid: &ImageGrid, place_m: DVec3, turns: usize) -> Option<f64> {
    let echo = Echo {
        point: 0,
        first: 0,
        values: vec![Default::default(); turns],
    };
    let (across, cell_m) = cross_range(collection, grid, &echo, place_m)?;
    let pulses = &collection.pulses[..turns];
    let bin_m = cell_path_m(collection);
    let holds = |half_m: f64| {
        let there_m = place_m + across * half_m;
        let paths = pulses
            .iter()
            .map(|pulse| pulse.path_m(there_m) - pulse.path_m(place_m));
        let mut paths: Vec<f64> = paths.collect();
        let middle_m = paths[turns / 2];
        let moved_m = paths
            .iter()
            .fold(0.0, |most: f64, path| most.max((path - middle_m).abs()));
        without_trend(&mut paths);
        let bend = paths
            .iter()
            .zip(pulses)
            .map(|(path, pulse)| (path * wavenumber_rad_m(collection, pulse)).abs())
            .fold(0.0, f64::max);
        moved_m <= MIGRATION_CELLS * bin_m && bend <= BEND_RAD
    };
    let mut cells = turns as f64;
    while cells >= MIN_CELLS {
        let half_m = 0.5 * cells * cell_m;
        if holds(half_m) && holds(-half_m) {
            return Some(cells);
        }
        cells *= 0.8;
    }
    None
}

/// Remove constant and slope by least squares.
pub(crate) fn without_trend(values: &mut [f64]) {
    let count = values.len().max(1) as f64;
    let middle = (count - 1.0) / 2.0;
    let mean = values.iter().sum::<f64>() / count;
    let (mut up, mut down) = (0.0, 0.0);
    for (n, value) in values.iter().enumerate() {
        let u = n as f64 - middle;
        up += u * value;
        down += u * u;
    }
    let slope = match down > 0.0 {
        true => up / down,
        false => 0.0,
    };
    for (n, value) in values.iter_mut().enumerate() {
        *value -= mean + slope * (n as f64 - middle);
    }
}
