//! Descriptions of images in other formats, from their metadata.

use serde_json::{Value, json};
use subaperture::geometry::SceneFrame;
use subaperture::image::{ImageSource as _, peak_of};
use subaperture::images::{OpenImage, PixelGeometry, Pixels, Values};
use subaperture::maps::ProjectionModel as _;

use super::description::{Description, line};
use crate::text;

/// Describe format, size, position, values and brightest pixel.
pub(super) fn describe(image: &OpenImage) -> anyhow::Result<Description> {
    let (rows, columns) = image.pixels.size();
    let path = image.path.display().to_string();
    let label = match image.pixels {
        Pixels::Array(_) => "array",
        _ => "image",
    };
    let mut text = line(label, &path);
    let size = match image.pixels {
        Pixels::Array(_) | Pixels::Velocity(_) => {
            format!("{rows} rows x {columns} columns, complex64")
        }
        _ => format!("{rows} rows x {columns} columns, {}", image.values),
    };
    if !matches!(image.pixels, Pixels::Array(_)) {
        text += &line("format", &format(image));
    }
    text += &line("size", &size);
    let mut json = json!({
        "path": path,
        "kind": match image.pixels { Pixels::Array(_) => "array", _ => "image" },
        "format": image.kind().to_string(),
        "values": image.values.to_string(),
        "rows": rows,
        "columns": columns,
    });
    place(image, &mut text, &mut json);
    if let Pixels::Unfinished(tiles) = &image.pixels {
        let [formed, count] = tiles.tiles();
        text += &line("tiles", &format!("{formed} of {count} are formed"));
        json["tiles"] = json!({ "formed": formed, "of": count });
    }
    brightest(image, &mut text, &mut json)?;
    Ok(Description { text, json })
}

fn format(image: &OpenImage) -> String {
    match &image.pixels {
        Pixels::Sicd(file) => format!("SICD {}", file.version()),
        Pixels::Sidd(file) => format!(
            "SIDD {}, remap {}",
            file.version(),
            file.remap().unwrap_or("not named")
        ),
        Pixels::Zarr(file) => match file.layer() {
            Some((layer, count)) => format!("Zarr 3, image {layer} of {count}"),
            None => "Zarr 3".to_owned(),
        },
        _ => image.kind().to_string(),
    }
}

fn place(image: &OpenImage, text: &mut String, json: &mut Value) {
    if let Pixels::Sicd(file) = &image.pixels {
        for (label, value) in [("collection", file.name()), ("recorded", file.start())] {
            if let Some(value) = value {
                *text += &line(label, &value);
                json[label] = value.into();
            }
        }
    }
    if let Some((grid, frame)) = image.grid() {
        for (name, axis) in [("columns", &grid.columns), ("rows", &grid.rows)] {
            let unit = match (grid.polar, name) {
                (true, "columns") => "rad",
                _ => "m",
            };
            *text += &line(
                name,
                &format!(
                    "{}: from {} to {} {unit} by {}",
                    axis.count,
                    text::significant(axis.start, 6),
                    text::significant(axis.at(axis.count - 1), 6),
                    text::significant(axis.step, 6)
                ),
            );
        }
        json["grid"] = json!(grid);
        let middle = [grid.rows.count / 2, grid.columns.count / 2];
        let place = match &image.lies {
            // Few SICD grids lie in the ground plane, so the ground position of the centre pixel is projected.
            PixelGeometry::Sicd { on_map, .. } => match &**on_map {
                Ok(on_map) => on_map.place(middle.map(|n| n as f64)),
                Err(_) => None,
            },
            _ => frame
                .unwrap_or(SceneFrame::Local)
                .geodetic(grid.position_m(middle[0], middle[1])),
        };
        if let Some(place) = place {
            let (lat, lon) = (place.latitude_deg, place.longitude_deg);
            let words = format!(
                "{lat:.6} deg north, {lon:.6} deg east, {:.1} m above WGS 84",
                place.height_m
            );
            *text += &line("middle", &words);
            json["middle"] = json!([lat, lon, place.height_m]);
        }
    }
    match &image.lies {
        PixelGeometry::Map(raster) => {
            let words = format!(
                "{} on EPSG:{}, west {}, north {}",
                text::metres(Some(raster.pixel_m)),
                raster.projection.epsg(),
                text::significant(raster.west, 9),
                text::significant(raster.north, 9)
            );
            *text += &line("pixels", &words);
            json["raster"] = json!({
                "epsg": raster.projection.epsg(),
                "west": raster.west,
                "north": raster.north,
                "step": raster.step,
            });
        }
        PixelGeometry::Sicd { on_map, .. } => {
            if let Err(why) = &**on_map {
                *text += &line("on the ground", &format!("not projected: {why}"));
            }
        }
        PixelGeometry::Pixels => {
            if let Pixels::Map(map) = &image.pixels
                && let Err(why) = map.raster()
            {
                *text += &line("place", &format!("not read: {why}"));
            }
        }
        PixelGeometry::Grid { .. } | _ => {}
    }
}

/// Find the brightest pixel in one pass over the image.
fn brightest(image: &OpenImage, text: &mut String, json: &mut Value) -> anyhow::Result<()> {
    let peak = peak_of(&image.pixels).map_err(|error| anyhow::anyhow!(error))?;
    let level_db = peak.map(|peak| 10.0 * subaperture::image::power(peak.value).log10());
    let level_db = level_db.filter(|level_db| level_db.is_finite());
    json["peak_db"] = json!(level_db);
    if let (Some(peak), Some(level_db)) = (peak, level_db) {
        let level = match image.values {
            Values::Greys => format!("grey {}", peak.value.re),
            _ => text::decibels(level_db),
        };
        let place = format!("row {}, column {}: {level}", peak.row, peak.column);
        *text += &line("brightest", &place);
    }
    Ok(())
}
