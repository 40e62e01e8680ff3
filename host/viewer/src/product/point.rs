//! Readout of a pixel: value, position, and point response.

use glam::DVec3;
use serde_json::{Value, json};
use subaperture_model::geometry::{Geodetic, SceneFrame};
use subaperture_model::image::{ImageSource, ImageSourceError, power};
use subaperture_quality::response::{Cut, ResponseError, Settings, Target, measure_in};

use super::Product;

/// Maximum number of points of a cut as sent.
const MAX_POINTS: usize = 800;

/// Value and position of a pixel, as JSON.
pub(super) fn value(
    product: &Product,
    [row, column]: [usize; 2],
) -> Result<Value, ImageSourceError> {
    let pixel = product
        .pixels
        .window(&[row..row + 1, column..column + 1])?
        .pixels[0];
    let power = power(pixel);
    let there = power > 0.0;
    let mut fields = json!({
        "row": row,
        "column": column,
        "level_db": there.then(|| 10.0 * power.log10()),
        "phase_deg": there.then(|| f64::from(pixel.im).atan2(pixel.re.into()).to_degrees()),
    });
    if let Some(grid) = &product.grid {
        let position = grid.position_m(row, column);
        fields["position_m"] = json!(position.to_array());
        if grid.polar {
            fields["range_m"] = json!(grid.rows.at(row));
            fields["angle_deg"] = json!(grid.columns.at(column).to_degrees());
        }
        add_geodetic(&mut fields, product, position);
    }
    Ok(fields)
}

/// Add the geodetic position of a point in the grid's plane, if it is known.
fn add_geodetic(fields: &mut Value, product: &Product, position: DVec3) {
    if let Some(place) = place(product, position) {
        fields["latitude_deg"] = json!(place.latitude_deg);
        fields["longitude_deg"] = json!(place.longitude_deg);
        fields["height_m"] = json!(place.height_m);
    }
}

/// Geodetic position of a point in the grid's plane.
pub(super) fn place(product: &Product, position: DVec3) -> Option<Geodetic> {
    let on_ground = match product.slant {
        true => on_ground(product, position)?,
        false => position,
    };
    product.frame.geodetic(on_ground)
}

/// Project along the plane's normal to the height of the frame's origin. A curve of constant range and Doppler
/// frequency leaves the slant plane in this direction.
fn on_ground(product: &Product, position: DVec3) -> Option<DVec3> {
    let grid = product.grid.as_ref()?;
    let normal = grid.x_axis.cross(grid.y_axis);
    let SceneFrame::Earth { origin_ecf_m, .. } = product.frame else {
        return None;
    };
    let [_, _, up] = Geodetic::from_ecf_m(origin_ecf_m).east_north_up();
    let up = product.frame.direction_from_ecf(up);
    let steep = normal.dot(up);
    // A vertical plane has no defined intersection with the ground.
    (steep.abs() > 0.05).then(|| position - normal * (up.dot(position) / steep))
}

/// Angle in the grid's plane, from x towards y, of the direction to the antenna, radians. `None` if the antenna is
/// directly above, and for polar grids.
fn line_of_sight_rad(product: &Product, position: DVec3) -> Option<f64> {
    let grid = product.grid.as_ref().filter(|grid| !grid.polar)?;
    let sight = product.carrier?.antenna_m - position;
    let (x, y) = (sight.dot(grid.x_axis), sight.dot(grid.y_axis));
    (libm::hypot(x, y) > 1e-3 * sight.length()).then(|| libm::atan2(y, x))
}

/// Point response of the brightest point within `search_px` pixels.
pub(super) fn response(
    product: &Product,
    [row, column]: [usize; 2],
    search_px: usize,
    memory_bytes: u64,
) -> Result<Value, ResponseError> {
    let grid = product.any_grid();
    let position = grid.position_m(row, column);
    let settings = Settings {
        search_px,
        line_of_sight_rad: line_of_sight_rad(product, position),
        carrier: product.carrier,
        looks: product.looks.as_ref(),
        memory_bytes,
        ..Settings::default()
    };
    let target = Target::Near {
        column_value: grid.columns.at(column),
        row_value: grid.rows.at(row),
    };
    let found = measure_in(&product.pixels, &grid, target, &settings)?;
    let mut fields = serde_json::to_value(&found).unwrap_or_default();
    let curves: Vec<Value> = found.cuts.iter().map(curve).collect();
    fields["curves"] = json!(curves);
    fields["in_pixels"] = json!(product.grid.is_none());
    fields["polar"] = json!(grid.polar);
    if product.grid.is_some() {
        add_geodetic(&mut fields, product, found.position_m.into());
    }
    Ok(fields)
}

/// Curve of a cut, decimated.
fn curve(cut: &Cut) -> Value {
    let every = cut.offsets.len().div_ceil(MAX_POINTS).max(1);
    let offsets: Vec<f64> = cut.offsets.iter().step_by(every).copied().collect();
    let levels = cut.powers.iter().step_by(every);
    let levels: Vec<Option<f64>> = levels
        .map(|&power| (power > 0.0).then(|| 10.0 * power.log10()))
        .collect();
    json!({ "offsets": offsets, "levels_db": levels })
}
