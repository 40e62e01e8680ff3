//! Range-Doppler maps of a sub-CPI around a position in an image, as sent to the page.

use glam::DVec3;
use num_complex::Complex32;
use serde_json::{Value, json};
use subaperture_model::geometry::{ImageGrid, SceneFrame};
use subaperture_model::image::{ImageSourceError, power};

use super::Product;
use crate::level::{NONE, tenths};

/// Maximum number of rows and columns of a map as sent. Larger maps are reduced by the maximum of neighbouring bins.
const MAX_CELLS: usize = 512;

/// Source of range-Doppler maps.
pub trait DopplerMaps: Send + Sync {
    /// Name shown on the page.
    fn name(&self) -> &str;

    /// Scene frame of the positions.
    fn frame(&self) -> SceneFrame;

    /// Number of sub-CPIs, in time order; at least 1.
    fn sub_cpis(&self) -> usize;

    /// Map of sub-CPI `sub_cpi` at the available position nearest to `place_m`, or at any position if `None`.
    ///
    /// # Errors
    /// If no map exists or it cannot be read.
    fn map(&self, sub_cpi: usize, place_m: Option<DVec3>) -> Result<DopplerMap, ImageSourceError>;
}

/// Range-Doppler map around one position.
#[derive(Clone, Debug)]
pub struct DopplerMap {
    /// Complex values, one Doppler bin after another, with range bins contiguous.
    pub values: Vec<Complex32>,
    /// Number of bins on either side of bin 0, which is the position: Doppler, range.
    pub reaches: [usize; 2],
    /// Bin spacing: Doppler in Hz, or in cycles per pulse if pulse times are unknown; range in metres of one-way
    /// distance (half the two-way path).
    pub steps: [f64; 2],
    /// Whether pulse times are known.
    pub timed: bool,
    /// Position of the map, metres in [`DopplerMaps::frame`].
    pub place_m: DVec3,
    /// Times of the first and the last pulse, seconds.
    pub time_s: [f64; 2],
    /// Number of pulses in the sub-CPI.
    pub pulses: usize,
}

/// Name and number of sub-CPIs, as JSON.
pub(super) fn about(maps: &dyn DopplerMaps) -> Value {
    json!({ "name": maps.name(), "sub_cpis": maps.sub_cpis() })
}

/// Map around a pixel as JSON, with levels in tenths of dB.
pub(super) fn map(
    maps: &dyn DopplerMaps,
    sub_cpi: usize,
    product: &Product,
    [row, column]: [usize; 2],
) -> Result<Value, ImageSourceError> {
    let grid = product.grid.as_ref();
    let place = grid.map(|grid| grid.position_m(row, column));
    let place = place.map(|place| between(&product.frame, &maps.frame(), place));
    let place = place.transpose()?;
    let map = maps.map(sub_cpi, place)?;
    let [doppler, range] = map.reaches.map(|reach| 2 * reach + 1);
    if map.values.len() != doppler * range {
        return Err("the number of values in the map does not match its number of bins".into());
    }
    let every = [doppler, range].map(|count| count.div_ceil(MAX_CELLS).max(1));
    let powers = largest(&map.values, range, every);
    let levels: Vec<i16> = powers
        .iter()
        .map(|&power| match power > 0.0 {
            true => tenths((10.0 * power.log10()) as f32),
            false => NONE,
        })
        .collect();
    let at = grid.map(|grid| pixel(product, grid, &maps.frame(), map.place_m));
    // Centres of the first bins as sent.
    let middle = |i: usize| (every[i] as f64 - 1.0) / 2.0 - map.reaches[i] as f64;
    let first = [0, 1].map(|i| middle(i) * map.steps[i]);
    let steps = [0, 1].map(|i| every[i] as f64 * map.steps[i]);
    Ok(json!({
        "rows": doppler.div_ceil(every[0]),
        "columns": range.div_ceil(every[1]),
        "first": first,
        "steps": steps,
        "timed": map.timed,
        "levels": levels,
        "place_m": map.place_m.to_array(),
        "at": at.transpose()?,
        "time_s": map.time_s,
        "pulses": map.pulses,
    }))
}

/// Convert a position from one frame to another.
fn between(from: &SceneFrame, to: &SceneFrame, place: DVec3) -> Result<DVec3, ImageSourceError> {
    match (from, to) {
        (SceneFrame::Earth { .. }, SceneFrame::Earth { .. }) => {
            Ok(to.from_ecf_m(from.to_ecf_m(place)))
        }
        (SceneFrame::Local, SceneFrame::Local) => Ok(place),
        _ => Err(
            "the maps and the image have different frames: only one of them is georeferenced"
                .into(),
        ),
    }
}

/// Fractional row and column of a map's position.
fn pixel(
    product: &Product,
    grid: &ImageGrid,
    frame: &SceneFrame,
    place: DVec3,
) -> Result<[f64; 2], ImageSourceError> {
    let [row_value, column_value] = grid.coordinates(between(frame, &product.frame, place)?);
    Ok([
        (row_value - grid.rows.start) / grid.rows.step,
        (column_value - grid.columns.start) / grid.columns.step,
    ])
}

/// Maximum powers over blocks of `every` rows and columns.
fn largest(values: &[Complex32], columns: usize, every: [usize; 2]) -> Vec<f64> {
    let lines: Vec<&[Complex32]> = values.chunks_exact(columns).collect();
    let across = columns.div_ceil(every[1]);
    let runs = lines.chunks(every[0]).flat_map(|lines| {
        (0..across).map(|i| {
            let run = i * every[1]..((i + 1) * every[1]).min(columns);
            let powers = lines.iter().flat_map(|line| &line[run.clone()]);
            powers.map(|&z| power(z)).fold(0.0, f64::max)
        })
    });
    runs.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::product::Pixels;
    use subaperture_model::image::Image;

    /// Source with one map at (3, 1), whose bin `(d, r)` of 3 x 5 has amplitude `10^((5 d + r) / 20)`.
    struct One;

    impl DopplerMaps for One {
        fn name(&self) -> &str {
            "one"
        }

        fn frame(&self) -> SceneFrame {
            SceneFrame::Local
        }

        fn sub_cpis(&self) -> usize {
            1
        }

        fn map(&self, _: usize, place: Option<DVec3>) -> Result<DopplerMap, ImageSourceError> {
            assert_eq!(place, Some(DVec3::new(2.0, 4.0, 0.0)));
            let amplitude = |i: usize| 10f64.powf(i as f64 / 20.0) as f32;
            Ok(DopplerMap {
                values: (0..15).map(|i| Complex32::new(0.0, amplitude(i))).collect(),
                reaches: [1, 2],
                steps: [10.0, 0.5],
                timed: true,
                place_m: DVec3::new(3.0, 1.0, 0.0),
                time_s: [0.0, 1.0],
                pulses: 7,
            })
        }
    }

    #[test]
    fn map_json_has_levels_axes_and_position() {
        let grid: ImageGrid = "x=0:10:1,y=0:8:2,z=0".parse().unwrap();
        let image = Image {
            rows: grid.rows.count,
            columns: grid.columns.count,
            pixels: vec![Complex32::ONE; grid.num_pixels() as usize],
        };
        let product = Product {
            grid: Some(grid),
            ..Product::new("a".to_owned(), Pixels::whole(Box::new(image)))
        };
        let sent = map(&One, 0, &product, [2, 2]).unwrap();
        let levels: Vec<i64> = (0..15).map(|i| 10 * i).collect();
        assert_eq!(sent["levels"], json!(levels));
        assert_eq!((&sent["rows"], &sent["columns"]), (&3.into(), &5.into()));
        assert_eq!(sent["first"], json!([-10.0, -1.0]));
        // x = 3 is column 3; y = 1 is half a row of 2 m.
        assert_eq!(sent["at"], json!([0.5, 3.0]));
        let earth = Product {
            frame: SceneFrame::east_north_up(&subaperture_model::geometry::Geodetic {
                latitude_deg: 1.0,
                longitude_deg: 2.0,
                height_m: 3.0,
            }),
            ..product
        };
        assert!(map(&One, 0, &earth, [2, 2]).is_err());
    }

    #[test]
    fn block_reduction_keeps_maximum() {
        let values: Vec<Complex32> = (0..15).map(|i| Complex32::new(i as f32, 0.0)).collect();
        let found = largest(&values, 5, [2, 3]);
        assert_eq!(found, [7.0, 9.0, 12.0, 14.0].map(|a: f64| a * a));
    }
}
