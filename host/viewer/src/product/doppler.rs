//! Range-Doppler maps of a sub-CPI about a place of an image, as the page gets them.

use glam::DVec3;
use num_complex::Complex32;
use serde_json::{Value, json};
use subaperture_model::geometry::{ImageGrid, SceneFrame};
use subaperture_model::image::{PartsError, power};

use super::Product;
use crate::level::{NONE, tenths};

/// Rows and columns of a map as it is sent, at the most; of more the largest of neighbours are sent.
const MOST_CELLS: usize = 512;

/// Where range-Doppler maps come from.
pub trait DopplerMaps: Send + Sync {
    /// What it is called.
    fn name(&self) -> &str;

    /// The frame of its places.
    fn frame(&self) -> SceneFrame;

    /// How many sub-CPIs there are, in the order of time; at least one.
    fn sub_cpis(&self) -> usize;

    /// The map of a sub-CPI about a place, or about the nearest that there is one of; of any where no place is given.
    ///
    /// # Errors
    /// If there is none, or it cannot be read.
    fn map(&self, sub_cpi: usize, place_m: Option<DVec3>) -> Result<DopplerMap, PartsError>;
}

/// A map.
#[derive(Clone, Debug)]
pub struct DopplerMap {
    /// Doppler bin by Doppler bin, range bins contiguous.
    pub values: Vec<Complex32>,
    /// Bins on either side of the place, which is bin 0: Doppler, range.
    pub reaches: [usize; 2],
    /// What a bin of Doppler is, hertz (cycles a pulse where times are not known), and one of range, metres of half the two-way path.
    pub steps: [f64; 2],
    /// Whether times are known.
    pub timed: bool,
    /// The place.
    pub place_m: DVec3,
    /// Times of the first and the last pulse, seconds.
    pub time_s: [f64; 2],
    /// Pulses of the sub-CPI.
    pub pulses: usize,
}

/// What the page knows of them before it asks.
pub(super) fn about(maps: &dyn DopplerMaps) -> Value {
    json!({ "name": maps.name(), "sub_cpis": maps.sub_cpis() })
}

/// A map about a pixel, with levels in tenths of dB.
pub(super) fn map(
    maps: &dyn DopplerMaps,
    sub_cpi: usize,
    product: &Product,
    [row, column]: [usize; 2],
) -> Result<Value, PartsError> {
    let grid = product.grid.as_ref();
    let place = grid.map(|grid| grid.position_m(row, column));
    let place = place.map(|place| between(&product.frame, &maps.frame(), place));
    let place = place.transpose()?;
    let map = maps.map(sub_cpi, place)?;
    let [doppler, range] = map.reaches.map(|reach| 2 * reach + 1);
    if map.values.len() != doppler * range {
        return Err("the map has not as many values as bins".into());
    }
    let every = [doppler, range].map(|count| count.div_ceil(MOST_CELLS).max(1));
    let powers = largest(&map.values, range, every);
    let levels: Vec<i16> = powers
        .iter()
        .map(|&power| match power > 0.0 {
            true => tenths((10.0 * power.log10()) as f32),
            false => NONE,
        })
        .collect();
    let at = grid.map(|grid| pixel(product, grid, &maps.frame(), map.place_m));
    // The middles of the first bins that are sent as one.
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

/// A place of one frame in another.
fn between(from: &SceneFrame, to: &SceneFrame, place: DVec3) -> Result<DVec3, PartsError> {
    match (from, to) {
        (SceneFrame::Earth { .. }, SceneFrame::Earth { .. }) => {
            Ok(to.from_ecf_m(from.to_ecf_m(place)))
        }
        (SceneFrame::Local, SceneFrame::Local) => Ok(place),
        _ => Err(
            "the maps and the image are not in one frame: one is on the Earth, the other is not"
                .into(),
        ),
    }
}

/// Row and column of a map's place.
fn pixel(
    product: &Product,
    grid: &ImageGrid,
    frame: &SceneFrame,
    place: DVec3,
) -> Result<[f64; 2], PartsError> {
    let [row_value, column_value] = grid.coordinates(between(frame, &product.frame, place)?);
    Ok([
        (row_value - grid.rows.start) / grid.rows.step,
        (column_value - grid.columns.start) / grid.columns.step,
    ])
}

/// The largest powers of runs of so many rows and columns.
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

    /// One map whose bin `(d, r)` of 3 x 5 has amplitude `10^((5 d + r) / 20)`, about the place (3, 1).
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

        fn map(&self, _: usize, place: Option<DVec3>) -> Result<DopplerMap, PartsError> {
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
    fn levels_axes_and_the_place_are_told() {
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
        let told = map(&One, 0, &product, [2, 2]).unwrap();
        let levels: Vec<i64> = (0..15).map(|i| 10 * i).collect();
        assert_eq!(told["levels"], json!(levels));
        assert_eq!((&told["rows"], &told["columns"]), (&3.into(), &5.into()));
        assert_eq!(told["first"], json!([-10.0, -1.0]));
        // x = 3 is column 3, y = 1 half a row of 2 m.
        assert_eq!(told["at"], json!([0.5, 3.0]));
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
    fn of_many_bins_the_largest_are_kept() {
        let values: Vec<Complex32> = (0..15).map(|i| Complex32::new(i as f32, 0.0)).collect();
        let found = largest(&values, 5, [2, 3]);
        assert_eq!(found, [7.0, 9.0, 12.0, 14.0].map(|a: f64| a * a));
    }
}
