//! Images of one grid as a Zarr group.

use std::path::Path;

use anyhow::bail;
use serde_json::{Value, json};
use subaperture::geometry::{Geodetic, ImageGrid, SceneFrame};
use subaperture::image::Parts;
use subaperture::io::claim::Claims;
use subaperture::io::ours::TEXT_MARK;
use subaperture::io::product::{self, OpenProduct};
use subaperture::io::stack::{Stack, StackError};

use super::{One, Written};
use crate::commands::stored;
use crate::config::Session;
use crate::failure::Usage;
use crate::interrupt;

/// Refuses options of maps and of SICD.
pub(super) fn check(one: &One) -> Result<(), Usage> {
    if one.maps.is_given() || one.speed_m_s.is_some() {
        return Err(Usage(
            "--projection, --pixel, --looks, --layout, --remap, --top, --span and --speed say nothing to --format zarr, which has the images' own \
             pixels: leave them out"
                .to_owned(),
        ));
    }
    Ok(())
}

/// Claims the folder.
pub(super) fn claim(one: &One, claims: &mut Claims) -> anyhow::Result<()> {
    Ok(claims.store(one.out)?)
}

/// Reads all images and writes them.
pub(super) fn write(session: &Session, one: &One) -> anyhow::Result<Written> {
    let mut opened: Vec<(&Path, OpenProduct)> = Vec::new();
    for image in [one.image]
        .into_iter()
        .chain(one.others.iter().map(AsRef::as_ref))
    {
        let Some(folder) = stored::product_folder(image) else {
            bail!(
                "{}: no image: give the folder of a product (with image.json and image.npy)",
                image.display()
            );
        };
        let next = product::open(folder)?;
        if let Some((first, before)) = opened.first()
            && (before.grid != next.grid || before.metadata["frame"] != next.metadata["frame"])
        {
            bail!(
                "{} and {} are on different grids: form both with one --grid",
                first.display(),
                image.display()
            );
        }
        opened.push((image, next));
    }
    let (name, first) = &opened[0];
    let images: Vec<&dyn Parts> = opened
        .iter()
        .map(|(_, product)| &product.pixels as &dyn Parts)
        .collect();
    let frame = match one.place {
        Some(place) => SceneFrame::east_north_up(&place),
        None => product::frame_of(&first.metadata)
            .map_err(|what| anyhow::anyhow!("{}: {what}", name.display()))?,
    };
    let starts = opened
        .iter()
        .map(|(_, product)| product.metadata["antennas"]["start_ns"].as_i64());
    let starts: Option<Vec<i64>> = starts.collect();
    let stack = Stack {
        images: &images,
        grid: &first.grid,
        start_ns: &starts.unwrap_or_default(),
        attributes: &attributes(&opened, &frame),
    };
    let writing = session.progress("writing");
    match stack.write(one.out, &writing) {
        Err(StackError::Cancelled) => {
            interrupt::check()?;
            bail!("interrupted");
        }
        wrote => wrote?,
    }
    writing.finish();
    let path = one.out.display().to_string();
    let (count, grid) = (opened.len(), &first.grid);
    Ok(Written {
        name: "export",
        about: json!({ "path": path, "bytes": stack.bytes(), "images": count }),
        line: format!(
            "{path}: {count} x {} x {} pixels",
            grid.rows.count, grid.columns.count
        ),
    })
}

/// What is known of the images.
fn attributes(opened: &[(&Path, OpenProduct)], frame: &SceneFrame) -> Value {
    let source = |(path, product): &(&Path, OpenProduct)| {
        let record = &product.metadata;
        json!({
            "name": path.display().to_string(),
            "title": record["picture"]["title"],
            "start_ns": record["antennas"]["start_ns"],
            "collection": record["collection"]["name"],
            "settings": record["settings"],
            "inputs": record["inputs"],
        })
    };
    let sources: Vec<Value> = opened.iter().map(source).collect();
    let grid = &opened[0].1.grid;
    let mut about = json!({
        "title": sources[0]["title"],
        "history": format!("{TEXT_MARK} {}", env!("CARGO_PKG_VERSION")),
        "source": "synthetic aperture radar",
        "grid_origin_m": grid.origin_m.to_array(),
        "grid_x_axis": grid.x_axis.to_array(),
        "grid_y_axis": grid.y_axis.to_array(),
        "grid_is_polar": grid.polar,
        "grid_has_relief": grid.relief.is_some(),
        "position": "of a pixel in the scene frame, metres: grid_origin_m + x grid_x_axis + y grid_y_axis, and the relief along their normal",
        "sources": sources,
    });
    if let SceneFrame::Earth {
        origin_ecf_m,
        x_axis_ecf,
        y_axis_ecf,
    } = frame
    {
        about["frame_origin_ecf_m"] = json!(origin_ecf_m.to_array());
        about["frame_x_axis_ecf"] = json!(x_axis_ecf.to_array());
        about["frame_y_axis_ecf"] = json!(y_axis_ecf.to_array());
        let corners = corners(grid, frame);
        let bound = |of: fn(&Geodetic) -> f64, least: fn(f64, f64) -> f64| {
            corners.iter().map(of).reduce(least)
        };
        about["geospatial_bounds_crs"] = "EPSG:4326".into();
        let (latitude, longitude) = (
            |place: &Geodetic| place.latitude_deg,
            |place: &Geodetic| place.longitude_deg,
        );
        about["geospatial_lat_min"] = json!(bound(latitude, f64::min));
        about["geospatial_lat_max"] = json!(bound(latitude, f64::max));
        about["geospatial_lon_min"] = json!(bound(longitude, f64::min));
        about["geospatial_lon_max"] = json!(bound(longitude, f64::max));
        let corners = corners
            .iter()
            .map(|at| [at.latitude_deg, at.longitude_deg, at.height_m]);
        about["corners_lat_lon_height"] = json!(corners.collect::<Vec<_>>());
    }
    about
}

/// The places of the first and last pixels: of first row and column, first row and last column, last and last, last and first.
fn corners(grid: &ImageGrid, frame: &SceneFrame) -> [Geodetic; 4] {
    let (rows, columns) = (grid.rows.count - 1, grid.columns.count - 1);
    [[0, 0], [0, columns], [rows, columns], [rows, 0]]
        .map(|[row, column]| Geodetic::from_ecf_m(frame.to_ecf_m(grid.position_m(row, column))))
}
