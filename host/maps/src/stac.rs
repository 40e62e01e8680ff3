//! Writer of STAC 1.0.0 items of maps.

use std::path::Path;

use serde_json::{Value, json};

use subaperture_io::atomic::WriteError;
use subaperture_io::ours::ITEM_SCHEMA;
use subaperture_io::together::FileSet;
use subaperture_io::written::FileKind;

use crate::cog::Layout;
use crate::{MapError, Ortho};

/// Outline points per side of an image.
const SIDE_PLACES: usize = 4;

/// Properties of an item that the map does not give.
#[derive(Clone, Debug)]
pub struct About<'a> {
    /// Item id in a catalogue.
    pub id: &'a str,
    /// Time of recording, or of processing where that is unknown: RFC 3339, UTC.
    pub datetime: &'a str,
    /// Further properties, a JSON object.
    pub properties: Value,
}

/// Add the item of the map at `map` to a set of files. The map's link is relative: same folder.
///
/// # Errors
/// [`MapError`] if the outline does not project to the Earth, or the file cannot be written.
pub fn add_to(
    files: &mut FileSet,
    path: &Path,
    map: &Path,
    ortho: &Ortho,
    layout: Layout,
    about: &About,
) -> Result<(), MapError> {
    let item = item(map, ortho, layout, about)?;
    let mut text = serde_json::to_vec_pretty(&item).map_err(|error| WriteError::Io {
        path: path.to_owned(),
        needed_bytes: 0,
        source: error.into(),
    })?;
    text.push(b'\n');
    Ok(files.write_bytes(path, FileKind::Sidecar, &text)?)
}

fn item(map: &Path, ortho: &Ortho, layout: Layout, about: &About) -> Result<Value, MapError> {
    let raster = ortho.raster();
    let outline = ortho.surface().outline(SIDE_PLACES)?;
    let first_deg = outline[0].longitude_deg;
    // Longitude difference from the first point in -180 to 180, so that the ring closes.
    let mut ring: Vec<[f64; 2]> = outline
        .iter()
        .map(|place| {
            let away = (place.longitude_deg - first_deg + 180.0).rem_euclid(360.0) - 180.0;
            [first_deg + away, place.latitude_deg]
        })
        .collect();
    // GeoJSON needs a counter-clockwise ring.
    let area: f64 = (0..ring.len())
        .map(|i| {
            let ([a, b], [c, d]) = (ring[i], ring[(i + 1) % ring.len()]);
            (c - a) * (d + b)
        })
        .sum();
    if area > 0.0 {
        ring.reverse();
    }
    let (geometry, bounds) = on_the_globe(&ring);
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
        "geometry": geometry,
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

/// Geometry and bounding box of a ring of longitudes and latitudes. A ring across the antimeridian is split there, and the western bound exceeds the eastern (RFC 7946,
/// 3.1.9 and 5.2).
fn on_the_globe(ring: &[[f64; 2]]) -> (Value, [f64; 4]) {
    let extent = |axis: usize| {
        let values = ring.iter().map(|place| place[axis]);
        values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
            [low.min(x), high.max(x)]
        })
    };
    let ([west, east], [south, north]) = (extent(0), extent(1));
    let closed = |mut ring: Vec<[f64; 2]>| {
        ring.extend(ring.first().copied());
        ring
    };
    let line_deg = match (west < -180.0, east > 180.0) {
        (false, false) => {
            let geometry = json!({ "type": "Polygon", "coordinates": [closed(ring.to_vec())] });
            return (geometry, [west, south, east, north]);
        }
        (true, _) => -180.0,
        (false, true) => 180.0,
    };
    // The part beyond the antimeridian has longitudes of the other sign.
    let shift = |by: f64, part: Vec<[f64; 2]>| {
        let moved = part.into_iter().map(|[x, y]| [x + by, y]);
        closed(moved.collect())
    };
    let [to_west, to_east] = match line_deg > 0.0 {
        true => [0.0, -360.0],
        false => [360.0, 0.0],
    };
    let parts = [
        [shift(to_west, cut(ring, line_deg, -1.0))],
        [shift(to_east, cut(ring, line_deg, 1.0))],
    ];
    let geometry = json!({ "type": "MultiPolygon", "coordinates": parts });
    (geometry, [west + to_west, south, east + to_east, north])
}

/// Part of a convex ring west (`side` -1) or east (1) of a meridian.
fn cut(ring: &[[f64; 2]], meridian_deg: f64, side: f64) -> Vec<[f64; 2]> {
    let mut part = Vec::with_capacity(ring.len() + 2);
    for (i, &[x, y]) in ring.iter().enumerate() {
        let [next_x, next_y] = ring[(i + 1) % ring.len()];
        let (here, there) = (side * (x - meridian_deg), side * (next_x - meridian_deg));
        if here >= 0.0 {
            part.push([x, y]);
        }
        if here * there < 0.0 {
            let share = here / (here - there);
            part.push([meridian_deg, y + share * (next_y - y)]);
        }
    }
    part
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ring_across_antimeridian_becomes_multipolygon() {
        let square = |west: f64| {
            [
                [west, 10.0],
                [west + 2.0, 10.0],
                [west + 2.0, 12.0],
                [west, 12.0],
            ]
        };
        let (geometry, bounds) = on_the_globe(&square(100.0));
        assert_eq!(geometry["type"], "Polygon");
        assert_eq!(geometry["coordinates"][0][4], json!([100.0, 10.0]));
        assert_eq!(bounds, [100.0, 10.0, 102.0, 12.0]);
        // Both longitude conventions give the same geometry: half a degree west of the antimeridian, one and a half east.
        for west in [179.5, -180.5] {
            let (geometry, bounds) = on_the_globe(&square(west));
            assert_eq!(bounds, [179.5, 10.0, -178.5, 12.0]);
            let coordinates = json!([
                [[
                    [179.5, 10.0],
                    [180.0, 10.0],
                    [180.0, 12.0],
                    [179.5, 12.0],
                    [179.5, 10.0]
                ]],
                [[
                    [-180.0, 10.0],
                    [-178.5, 10.0],
                    [-178.5, 12.0],
                    [-180.0, 12.0],
                    [-180.0, 10.0]
                ]],
            ]);
            assert_eq!(
                geometry,
                json!({ "type": "MultiPolygon", "coordinates": coordinates })
            );
        }
    }
}
