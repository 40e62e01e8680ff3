//! Export of images on a common grid as a Zarr group.

use anyhow::bail;
use serde_json::{Value, json};
use subaperture::geometry::{Geodetic, ImageGrid, SceneFrame};
use subaperture::image::ImageSource;
use subaperture::images::{OpenImage, Pixels, Values};
use subaperture::io::claim::OutputClaims;
use subaperture::io::ours::TEXT_MARK;
use subaperture::io::stack::Stack;

use super::one::{One, Written, whole};
use crate::commands::{rasters, stored};
use crate::config::Session;
use crate::failure::Usage;

/// Refuse options that apply to maps and SICD.
pub(super) fn check(one: &One) -> Result<(), Usage> {
    if one.maps.is_given() || one.speed_m_s.is_some() {
        return Err(Usage(
            "--projection, --pixel, --looks, --layout, --remap, --top, --span and --speed do not apply to --format zarr, which keeps the images' own \
             pixels: leave them out"
                .to_owned(),
        ));
    }
    Ok(())
}

/// Claim the path of the output folder.
pub(super) fn claim(one: &One, claims: &mut OutputClaims) -> anyhow::Result<()> {
    Ok(claims.store(one.out)?)
}

/// Read all images and write them.
pub(super) fn write(session: &Session, one: &One) -> anyhow::Result<Written> {
    let mut opened: Vec<OpenImage> = Vec::new();
    for path in [one.image]
        .into_iter()
        .chain(one.others.iter().map(AsRef::as_ref))
    {
        let next = whole(session, path)?;
        if let Some(first) = opened.first() {
            stored::check_same_pixels(first, &next)?;
            if first.values != next.values {
                bail!(
                    "{} and {} hold different values ({} and {}): a stack needs images of one kind",
                    first.path.display(),
                    next.path.display(),
                    first.values,
                    next.values
                );
            }
        }
        opened.push(match &one.place {
            Some(place) => next.placed(place),
            None => next,
        });
    }
    let first = &opened[0];
    let images: Vec<&dyn ImageSource> = opened
        .iter()
        .map(|image| &image.pixels as &dyn ImageSource)
        .collect();
    let (grid, frame) = stored::grid(first);
    let starts = opened
        .iter()
        .map(|image| image.record.as_ref()?["antennas"]["start_ns"].as_i64());
    let starts: Option<Vec<i64>> = starts.collect();
    let stack = Stack {
        images: &images,
        grid: &grid,
        start_ns: &starts.unwrap_or_default(),
        measures: &[],
        attributes: &attributes(&opened.iter().collect::<Vec<_>>(), &grid, &frame),
    };
    rasters::write_stack(session, &stack, one.out)?;
    let path = one.out.display().to_string();
    let count = opened.len();
    Ok(Written {
        name: "export",
        about: json!({ "bytes": stack.bytes(), "images": count }),
        files: vec![one.file()],
        line: format!(
            "{path}: {count} x {} x {} pixels",
            grid.rows.count, grid.columns.count
        ),
    })
}

/// Metadata of the images. For images without a position, coordinates are rows and columns.
pub(in crate::commands) fn attributes(
    opened: &[&OpenImage],
    grid: &ImageGrid,
    frame: &SceneFrame,
) -> Value {
    let source = |image: &&OpenImage| {
        let record = image.record.clone().unwrap_or_default();
        json!({
            "name": image.path.display().to_string(),
            "title": record["picture"]["title"],
            "start_ns": record["antennas"]["start_ns"],
            "collection": record["collection"]["name"],
            "settings": record["settings"],
            "inputs": record["inputs"],
            "support": record["support"],
            "antennas": record["antennas"],
            "recording": record["collection"],
        })
    };
    let sources: Vec<Value> = opened.iter().map(source).collect();
    let mut about = json!({
        "title": sources[0]["title"],
        "history": format!("{TEXT_MARK} {}", env!("CARGO_PKG_VERSION")),
        "source": "synthetic aperture radar",
        "sources": sources,
    });
    // A detected image stays detected although it is stored as complex.
    about["values"] = match opened[0].values {
        Values::Complex => json!("complex"),
        Values::Levels(levels_db) => json!({ "levels_db": levels_db }),
        Values::Amplitudes => json!("amplitudes"),
        _ => json!("greys"),
    };
    if matches!(opened[0].pixels, Pixels::Map(_)) {
        about["missing"] = "NaN".into();
    }
    if opened[0].grid().is_none() {
        about["position"] = "of a pixel: x is its column and y its row".into();
        return about;
    }
    about["grid_origin_m"] = json!(grid.origin_m.to_array());
    about["grid_x_axis"] = json!(grid.x_axis.to_array());
    about["grid_y_axis"] = json!(grid.y_axis.to_array());
    about["grid_is_polar"] = grid.polar.into();
    about["grid_has_relief"] = grid.relief.is_some().into();
    about["position"] = "of a pixel in the scene frame, metres: grid_origin_m + x grid_x_axis + y grid_y_axis, and the relief along their normal".into();
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

/// Positions of the corner pixels: first row and column; first row, last column; last row and column; last row, first column.
fn corners(grid: &ImageGrid, frame: &SceneFrame) -> [Geodetic; 4] {
    let (rows, columns) = (grid.rows.count - 1, grid.columns.count - 1);
    [[0, 0], [0, columns], [rows, columns], [rows, 0]]
        .map(|[row, column]| Geodetic::from_ecf_m(frame.to_ecf_m(grid.position_m(row, column))))
}
