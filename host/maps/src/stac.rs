//! What a map is of, as an item of a SpatioTemporal Asset Catalog (STAC 1.0.0) beside it.

use std::io::Write;
use std::path::Path;

use serde_json::{Value, json};

use subaperture_io::atomic::write_atomically;
use subaperture_io::ours::ITEM_SCHEMA;

use crate::cog::Layout;
use crate::{MapError, Ortho};

/// Places along each side of an image in its outline.
const SIDE_PLACES: usize = 4;

/// What an item says beside where its map is.
#[derive(Clone, Debug)]
pub struct About<'a> {
    /// Its name in a catalogue.
    pub id: &'a str,
    /// When the image was recorded, or made where that is not known: RFC 3339, UTC.
    pub datetime: &'a str,
    /// Further properties; an object.
    pub properties: Value,
}

/// Writes the item of the map at `map`, in its folder or elsewhere, complete or not at all.
///
/// # Errors
/// [`MapError`].
pub fn write(
    path: &Path,
    map: &Path,
    ortho: &Ortho,
    layout: Layout,
    about: &About,
) -> Result<(), MapError> {
    let item = item(map, ortho, layout, about)?;
    let write = |file: &mut std::fs::File| {
        serde_json::to_writer_pretty(&mut *file, &item)?;
        file.write_all(b"\n")
    };
    Ok(write_atomically(path, 0, write)?)
}

fn item(map: &Path, ortho: &Ortho, layout: Layout, about: &About) -> Result<Value, MapError> {
    let raster = ortho.raster();
    let outline = ortho.surface.outline(SIDE_PLACES)?;
    let mut ring: Vec<[f64; 2]> = outline
        .iter()
        .map(|place| [place.longitude_deg, place.latitude_deg])
        .collect();
    // Counter-clockwise, as GeoJSON has it, whichever way the image's axes run.
    let area: f64 = (0..ring.len())
        .map(|i| {
            let ([a, b], [c, d]) = (ring[i], ring[(i + 1) % ring.len()]);
            (c - a) * (d + b)
        })
        .sum();
    if area > 0.0 {
        ring.reverse();
    }
    ring.push(ring[0]);
    let bounds = [0, 1, 2, 3].map(|i| {
        let all = ring.iter().map(|place| place[i % 2]);
        match i < 2 {
            true => all.fold(f64::INFINITY, f64::min),
            false => all.fold(f64::NEG_INFINITY, f64::max),
        }
    });
    let mut properties = about.properties.clone();
    let own = json!({
        "datetime": about.datetime,
        "gsd": raster.pixel_m,
        "proj:epsg": raster.projection.epsg(),
        "proj:shape": [raster.rows, raster.columns],
        "proj:transform": [raster.step[0], 0.0, raster.west, 0.0, -raster.step[1], raster.north],
        "subaperture:oversampling": ortho.oversampling(),
        "subaperture:resampling_error_db": ortho.error_db(),
        "subaperture:pixels_averaged": ortho.averaged(),
    });
    if let (Some(to), Value::Object(own)) = (properties.as_object_mut(), own) {
        to.extend(own);
    }
    let href = map.file_name().unwrap_or_default().to_string_lossy();
    Ok(json!({
        "schema": ITEM_SCHEMA,
        "type": "Feature",
        "stac_version": "1.0.0",
        "stac_extensions": [
            "https://stac-extensions.github.io/projection/v1.1.0/schema.json",
            "https://stac-extensions.github.io/raster/v1.1.0/schema.json",
        ],
        "id": about.id,
        "geometry": { "type": "Polygon", "coordinates": [ring] },
        "bbox": bounds,
        "properties": properties,
        "links": [],
        "assets": {
            "data": {
                "href": format!("./{href}"),
                "type": "image/tiff; application=geotiff; profile=cloud-optimized",
                "roles": ["data"],
                "raster:bands": layout.to_json(),
            },
        },
    }))
}
