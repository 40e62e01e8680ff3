//! Products for tests.

use num_complex::Complex32;
use subaperture_model::geometry::{ImageGrid, SceneFrame};
use subaperture_model::image::Image;

use super::{Pixels, Product};

/// Product whose pixels are all 1.
pub(super) fn of_ones(grid: &str, frame: SceneFrame) -> Product {
    let grid: ImageGrid = grid.parse().unwrap();
    let image = Image {
        rows: grid.rows.count,
        columns: grid.columns.count,
        pixels: vec![Complex32::ONE; grid.num_pixels() as usize],
    };
    Product {
        grid: Some(grid),
        frame,
        ..Product::new("a".to_owned(), Pixels::whole(Box::new(image)))
    }
}
