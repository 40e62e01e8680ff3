//! Elevation models of any origin: GeoTIFF and HGT.

use glam::DVec3;
use subaperture::geometry::{Geodetic, ImageGrid, SceneFrame};
use subaperture::monitor::Silent;
use subaperture::terrain::{Geoid, Ground, Region, Surface, relief};

use super::scratch::with_files;
use super::{MEMORY_BYTES, choice};
use crate::dem::GeoTiff;

pub(super) const WORDS: &[&str] = &[
    "II*\0",
    "MM\0*",
    "-9999\0",
    "nan\0",
    "\u{1}\0\u{1}\0\0\0",
    "\0\u{4}\0\0",
    "\u{1}\u{4}\0\0",
];

const PLACE: Geodetic = Geodetic {
    latitude_deg: 0.5,
    longitude_deg: 0.5,
    height_m: 0.0,
};

fn grid() -> ImageGrid {
    "x=-40:40:5,y=-30:30:5,z=0".parse().expect("a grid")
}

/// Strips and tiles, uncompressed and compressed, with pixels as points and areas; and a truncated file.
pub(super) fn seeds() -> Vec<Vec<u8>> {
    let points = GeoTiff {
        size: [24, 20],
        origin: [0.4988, 0.501],
        steps: [1e-4; 2],
        points: true,
        epsg: 4326,
        tile: None,
        strip_rows: 7,
        void: Some(-9999.0),
        deflate: false,
    };
    let areas = GeoTiff {
        tile: Some(16),
        points: false,
        deflate: true,
        void: None,
        ..points.clone()
    };
    let utm = GeoTiff {
        epsg: 32631,
        // Position of the scene: 221 km east of the zone's first degree and 55 km north.
        origin: [221_600.0, 55_400.0],
        steps: [20.0; 2],
        ..points.clone()
    };
    let height = |column: usize, row: usize| column as f32 * 0.5 - row as f32;
    vec![
        points.bytes(height),
        areas.bytes(height),
        utm.bytes(height),
        vec![0, 1, 2, 3],
    ]
}

pub(super) fn read(bytes: &[u8]) -> String {
    let name = match choice(bytes, 8) {
        0 => "N00E000.hgt",
        _ => "model.tif",
    };
    let (grid, frame) = (grid(), SceneFrame::east_north_up(&PLACE));
    let region = Region::of(&grid, &frame).expect("a horizontal grid");
    with_files(&[(name, bytes)], |folder| {
        let path = folder.join(name);
        let ground = match Ground::open(&path, &Geoid::Undulation(3.0), &region, MEMORY_BYTES) {
            Ok(ground) => ground,
            Err(error) => return error.to_string(),
        };
        match ground.height_m(0.5, 0.5) {
            Ok(height_m) => assert!(height_m.is_finite()),
            Err(error) => return error.to_string(),
        }
        match relief(&grid, &frame, Surface::Ground(&ground), &Silent) {
            Ok(relief) => {
                let grid = grid.on(relief);
                let corners = [grid.position_m(0, 0), grid.position_m(11, 15)];
                assert!(corners.iter().all(|p: &DVec3| p.is_finite()));
                "a relief".to_owned()
            }
            Err(error) => error.to_string(),
        }
    })
}
