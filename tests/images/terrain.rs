//! Elevation model readers and reliefs against heights computed independently in the tests.

use std::fs;
use std::path::Path;

use glam::DVec3;
use subaperture::geometry::{Geodetic, ImageGrid, SceneFrame, Utm};
use subaperture::monitor::Silent;
use subaperture::terrain::{Geoid, Ground, Region, Surface, TerrainError, relief};
use subaperture_tests::dem::{GeoTiff, degree_m, east_north_up_m, ecf_m, hgt, hgt_height_m};

const MEMORY: u64 = 64 << 20;

fn region(latitudes_deg: [f64; 2], longitudes_deg: [f64; 2]) -> Region {
    Region {
        latitudes_deg,
        longitudes_deg,
    }
}

fn write(folder: &Path, name: &str, bytes: &[u8]) -> std::path::PathBuf {
    let path = folder.join(name);
    fs::write(&path, bytes).unwrap();
    path
}

/// Northings and eastings of UTM are the model's own; its tests compare them with GeographicLib's.
#[test]
fn utm_model_heights_agree_with_formula() {
    let folder = tempfile::tempdir().unwrap();
    let middle = Geodetic {
        latitude_deg: -33.4,
        longitude_deg: 149.2,
        height_m: 0.0,
    };
    let utm = Utm::of(&middle).unwrap();
    let corner = [
        (utm.easting_m - 1500.0).round(),
        (utm.northing_m + 1500.0).round(),
    ];
    let file = GeoTiff {
        size: [100, 100],
        origin: corner,
        steps: [30.0, 30.0],
        points: false,
        epsg: utm.zone.epsg(),
        tile: Some(48),
        strip_rows: 1,
        void: None,
        deflate: false,
    };
    // Linear in easting and northing, so that bilinear interpolation is exact.
    let height =
        |east: f64, north: f64| 700.0 + 0.2 * (east - corner[0]) - 0.1 * (north - corner[1]);
    let bytes = file.bytes(|column, row| {
        let (east, north) = (column as f64 + 0.5, row as f64 + 0.5);
        height(corner[0] + 30.0 * east, corner[1] - 30.0 * north) as f32
    });
    let path = write(folder.path(), "utm.tif", &bytes);
    let [north_m, east_m] = degree_m(middle.latitude_deg);
    let (dn, de) = (900.0 / north_m, 900.0 / east_m);
    let region = region(
        [middle.latitude_deg - dn, middle.latitude_deg + dn],
        [middle.longitude_deg - de, middle.longitude_deg + de],
    );
    let ground = Ground::open(&path, &Geoid::None, &region, MEMORY).unwrap();
    for (n, e) in [(0.0, 0.0), (0.9, -0.8), (-0.97, 0.93), (0.1, 1.0)] {
        let (latitude, longitude) = (middle.latitude_deg + n * dn, middle.longitude_deg + e * de);
        let place = Geodetic {
            latitude_deg: latitude,
            longitude_deg: longitude,
            height_m: 0.0,
        };
        let there = Utm::in_zone(&place, utm.zone).unwrap();
        let expected = height(there.easting_m, there.northing_m);
        let found = ground.height_m(latitude, longitude).unwrap();
        // Posts are float32: 6e-5 m at 1000 m.
        assert!((found - expected).abs() < 2e-4, "{found} {expected}");
    }
    assert!((ground.step_m(middle.latitude_deg) - 30.0).abs() < 1e-9);
    let beyond = ground.height_m(middle.latitude_deg + 3.0 * dn, middle.longitude_deg);
    assert!(
        matches!(beyond, Err(TerrainError::Void { .. })),
        "{beyond:?}"
    );
}

/// Both sizes, a seam between two files, voids, and the geoid from a file.
#[test]
fn hgt_tiles_of_folder_join_at_edges() {
    let folder = tempfile::tempdir().unwrap();
    let height = |latitude: f64, longitude: f64| {
        400.0 + 30.0 * (latitude * 900.0).sin() + 20.0 * (longitude * 700.0).cos()
    };
    // 1 arc second in the west, 3 in the east.
    let mut west = hgt([46.0, 7.0], 3601, height);
    let east = hgt([46.0, 8.0], 1201, height);
    // A void at the post 3600 / 2 rows and 100 columns from the north-west.
    let void = 2 * (1800 * 3601 + 100);
    west[void..void + 2].copy_from_slice(&(-32768i16).to_be_bytes());
    write(folder.path(), "N46E007.hgt", &west);
    write(folder.path(), "N46E008.hgt", &east);
    write(folder.path(), "readme.txt", b"of somebody");
    let geoid = GeoTiff {
        size: [72, 36],
        origin: [-180.0, 90.0],
        steps: [5.0, 5.0],
        points: true,
        epsg: 4326,
        tile: None,
        strip_rows: 36,
        void: None,
        deflate: false,
    };
    // Linear, around the whole Earth.
    let bytes = geoid.bytes(|column, row| (column as f32 * 0.5) - row as f32);
    let geoid_path = write(folder.path(), "geoid.tiff", &bytes);
    let undulation =
        |latitude: f64, longitude: f64| (longitude + 180.0) / 5.0 * 0.5 - (90.0 - latitude) / 5.0;
    let models = folder.path().join("models");
    fs::create_dir(&models).unwrap();
    for name in ["N46E007.hgt", "N46E008.hgt", "readme.txt"] {
        fs::rename(folder.path().join(name), models.join(name)).unwrap();
    }
    let seam = region([46.4, 46.6], [7.95, 8.05]);
    let ground = Ground::open(&models, &Geoid::File(geoid_path), &seam, MEMORY).unwrap();
    assert_eq!(ground.files().len(), 3);
    for (latitude, longitude) in [
        (46.45, 7.951),
        (46.5123, 7.99999),
        (46.5, 8.0),
        (46.59, 8.0312),
    ] {
        let (corner, side) = match longitude <= 8.0 {
            true => ([46.0, 7.0], 3601),
            false => ([46.0, 8.0], 1201),
        };
        let expected = hgt_height_m(corner, side, [latitude, longitude], height)
            + undulation(latitude, longitude);
        let found = ground.height_m(latitude, longitude).unwrap();
        // Positions within a file are exact to 1e-6 of a post, on slopes of about 1 in 2.
        assert!(
            (found - expected).abs() < 1e-3,
            "{latitude} {longitude}: {found} {expected}"
        );
    }
    let hole = region([46.49, 46.51], [7.02, 7.04]);
    let ground = Ground::open(&models, &Geoid::None, &hole, MEMORY).unwrap();
    let at = |longitude: f64| ground.height_m(46.5, longitude);
    assert!(at(7.0 + 100.5 / 3600.0).is_err() && at(7.0 + 100.0 / 3600.0).is_err());
    assert!(at(7.0 + 102.0 / 3600.0).is_ok());
    // Elsewhere the model has no heights; one beyond the memory is refused before it is read.
    let elsewhere = Ground::open(
        &models,
        &Geoid::None,
        &region([10.0, 10.1], [7.0, 7.1]),
        MEMORY,
    );
    assert!(
        matches!(elsewhere, Err(TerrainError::Nothing { .. })),
        "{elsewhere:?}"
    );
    let much = Ground::open(
        &models,
        &Geoid::None,
        &region([46.1, 46.9], [7.1, 7.9]),
        1 << 20,
    );
    assert!(matches!(much, Err(TerrainError::Memory { .. })), "{much:?}");
    fs::write(models.join("N47E007.hgt"), b"short").unwrap();
    let short = Ground::open(&models, &Geoid::None, &hole, MEMORY).unwrap_err();
    assert!(short.to_string().contains("5 bytes"), "{short}");
}

/// Heights of 100 in a given unit in a small model, with these GeoTIFF keys in place of the default ones.
fn keyed(epsg: u16, keys: &[[u16; 2]]) -> Vec<u8> {
    let geographic = !(26901..=32760).contains(&epsg);
    let file = GeoTiff {
        size: [40, 40],
        origin: match geographic {
            true => [-121.51, 44.26],
            false => [618_800.0, 4_901_700.0],
        },
        steps: match geographic {
            true => [0.0005, 0.0005],
            false => [50.0, 50.0],
        },
        points: false,
        epsg: if geographic { 4326 } else { epsg },
        tile: None,
        strip_rows: 40,
        void: None,
        deflate: false,
    };
    let mut bytes = file.bytes(|_, _| 100.0);
    let mut entry = |from: [u16; 4], to: [u16; 4]| {
        let raw = |entry: [u16; 4]| entry.map(u16::to_le_bytes).concat();
        let at = bytes.windows(8).position(|window| window == raw(from));
        let at = at.expect("the model has the key");
        bytes[at..at + 8].copy_from_slice(&raw(to));
    };
    if geographic {
        entry([2048, 0, 1, 4326], [2048, 0, 1, epsg]);
    }
    // Pixels are areas by default, without the key.
    let mut spare = [[1025, 0, 1, 1]].into_iter();
    for &[key, value] in keys {
        entry(spare.next().expect("one key"), [key, 0, 1, value]);
    }
    bytes
}

#[test]
fn vertical_units_are_converted_or_rejected() {
    let folder = tempfile::tempdir().unwrap();
    let here = region([44.248, 44.252], [-121.502, -121.498]);
    let open = |bytes: &[u8]| {
        let path = write(folder.path(), "model.tif", bytes);
        Ground::open(&path, &Geoid::Undulation(0.0), &here, MEMORY)
    };
    let survey = 1200.0 / 3937.0;
    for (key, unit_m) in [
        (None, 1.0),
        (Some([4099, 9001]), 1.0),
        (Some([4099, 9002]), 0.3048),
        (Some([4099, 9003]), survey),
        (Some([4096, 6360]), survey),
        (Some([4096, 8228]), 0.3048),
        (Some([4096, 5703]), 1.0),
    ] {
        let keys: Vec<[u16; 2]> = key.into_iter().collect();
        let height_m = open(&keyed(4326, &keys))
            .unwrap()
            .height_m(44.25, -121.5)
            .unwrap();
        // Heights are float32: 30 m to 2e-6 m.
        assert!(
            (height_m - 100.0 * unit_m).abs() < 4e-6,
            "{key:?}: {height_m}"
        );
    }
    for (key, part) in [([4099, 9036], "EPSG 9036"), ([4096, 5336], "unknown unit")] {
        let error = open(&keyed(4326, &[key])).unwrap_err().to_string();
        assert!(error.contains(part), "{error}");
    }
    // A height above an unknown geoid causes a warning.
    let path = write(folder.path(), "navd88.tif", &keyed(4326, &[[4096, 5703]]));
    let ground = Ground::open(&path, &Geoid::None, &here, MEMORY).unwrap();
    assert!(
        ground.warnings()[0].contains("refer to NAVD88"),
        "{:?}",
        ground.warnings()
    );
}

#[test]
fn nad83_models_are_read_as_wgs_84_with_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    // UTM zone 10 north, in Oregon.
    let here = region([44.2482, 44.2518], [-121.502, -121.498]);
    for epsg in [4269, 6318, 26910, 6339] {
        let bytes = match epsg {
            6339 => {
                let mut bytes = keyed(26910, &[]);
                let raw = |code: u16| [3072u16, 0, 1, code].map(u16::to_le_bytes).concat();
                let at = bytes
                    .windows(8)
                    .position(|window| window == raw(26910))
                    .unwrap();
                bytes[at..at + 8].copy_from_slice(&raw(6339));
                bytes
            }
            epsg => keyed(epsg, &[]),
        };
        let path = write(folder.path(), "nad83.tif", &bytes);
        let ground = Ground::open(&path, &Geoid::None, &here, MEMORY).unwrap();
        assert_eq!(ground.height_m(44.25, -121.5).unwrap(), 100.0);
        let warnings = ground.warnings();
        assert!(
            warnings.len() == 1
                && warnings[0].contains("NAD83")
                && warnings[0].contains("up to 2 m"),
            "{warnings:?}"
        );
    }
    let path = write(folder.path(), "other.tif", &keyed(4267, &[]));
    let error = Ground::open(&path, &Geoid::None, &here, MEMORY).unwrap_err();
    assert!(error.to_string().contains("EPSG 4267"), "{error}");
}

#[test]
fn unsupported_compression_is_named_in_error() {
    let folder = tempfile::tempdir().unwrap();
    let here = region([44.248, 44.252], [-121.502, -121.498]);
    for (packing, name) in [(50_000u16, "ZSTD"), (34_887, "LERC"), (7, "JPEG")] {
        let mut bytes = keyed(4326, &[]);
        // Entry of tag 259: a short, one value.
        let entry = [259u16, 3, 1, 0, 1, 0].map(u16::to_le_bytes).concat();
        let at = bytes
            .windows(12)
            .position(|window| window == entry)
            .unwrap();
        bytes[at + 8..at + 10].copy_from_slice(&packing.to_le_bytes());
        let path = write(folder.path(), "packed.tif", &bytes);
        let error = Ground::open(&path, &Geoid::None, &here, MEMORY)
            .unwrap_err()
            .to_string();
        assert!(
            error.contains(name) && error.contains("COMPRESS=DEFLATE"),
            "{error}"
        );
    }
}

/// A raster with area pixels, so that adjacent files share no posts.
fn areas(size: [usize; 2], origin: [f64; 2], steps: [f64; 2]) -> GeoTiff {
    GeoTiff {
        size,
        origin,
        steps,
        points: false,
        epsg: 4326,
        tile: None,
        strip_rows: 16,
        void: None,
        deflate: false,
    }
}

/// As in Copernicus' model: files of a degree without common posts, and fewer columns north of 50 degrees. There is ground between the last
/// posts of a file and the first of the next.
#[test]
fn adjacent_models_without_shared_posts_leave_no_gap() {
    let folder = tempfile::tempdir().unwrap();
    let height = |latitude: f64, longitude: f64| {
        200.0 + 7.0 * (latitude - 50.0) * 60.0 - 5.0 * (longitude - 7.0) * 60.0
    };
    for (name, [west, north], columns) in [
        ("a.tif", [6.0, 50.0], 120),
        ("b.tif", [7.0, 50.0], 120),
        ("c.tif", [6.0, 51.0], 80),
        ("d.tif", [7.0, 51.0], 80),
    ] {
        let steps = [1.0 / f64::from(columns), 1.0 / 120.0];
        let file = areas([columns as usize, 120], [west, north], steps);
        let bytes = file.bytes(|column, row| {
            let latitude = north - (row as f64 + 0.5) * steps[1];
            height(latitude, west + (column as f64 + 0.5) * steps[0]) as f32
        });
        write(folder.path(), name, &bytes);
    }
    let region = region([49.99, 50.01], [6.98, 7.02]);
    let ground = Ground::open(folder.path(), &Geoid::None, &region, MEMORY).unwrap();
    for (latitude, longitude) in [
        (49.9951, 7.0001),
        (49.9999, 6.99),
        (50.0, 7.0),
        (50.003, 6.9989),
        (50.0002, 7.013),
        (50.0049, 7.0003),
    ] {
        let found = ground.height_m(latitude, longitude).unwrap();
        let expected = height(latitude, longitude);
        // Posts are float32, at 200 m.
        assert!(
            (found - expected).abs() < 1e-3,
            "{latitude} {longitude}: {found} {expected}"
        );
    }
    // A single file ends at its last posts.
    let alone = Ground::open(&folder.path().join("a.tif"), &Geoid::None, &region, MEMORY).unwrap();
    assert!(alone.height_m(49.9951, 6.9957).is_ok() && alone.height_m(49.9951, 7.0).is_err());
}

/// A model of the whole Earth, whose last column is adjacent to its first; and scenes over a pole.
#[test]
fn model_of_whole_earth_has_no_seam_and_includes_poles() {
    let folder = tempfile::tempdir().unwrap();
    // One post per degree, from -180 degrees on; the height is the sine of the longitude.
    let file = areas([360, 180], [-180.5, 90.0], [1.0, 1.0]);
    let wave = |longitude: f64| 50.0 * longitude.to_radians().sin();
    let bytes = file.bytes(|column, _| wave(column as f64 - 180.0) as f32);
    let path = write(folder.path(), "earth.tif", &bytes);
    for ([west, east], longitude) in [([179.3, 179.6], 179.5), ([179.9, 180.2], -179.85)] {
        let region = region([10.0, 10.3], [west, east]);
        let ground = Ground::open(&path, &Geoid::None, &region, MEMORY).unwrap();
        let found = ground.height_m(10.1, longitude).unwrap();
        // Near 180 degrees the sine is linear up to its cube over 6.
        assert!((found - wave(longitude)).abs() < 1e-3, "{found}");
    }
    let frame = SceneFrame::east_north_up(&Geodetic {
        latitude_deg: -89.97,
        longitude_deg: 60.0,
        height_m: 0.0,
    });
    // The pole is 3.4 km from the origin.
    let grid: ImageGrid = "x=-5000:5000:100,y=-5000:5000:100".parse().unwrap();
    let region = Region::of(&grid, &frame).unwrap();
    assert_eq!(region.latitudes_deg[0], -90.0);
    assert!(region.latitudes_deg[1] < -89.8, "{region:?}");
    let [west, east] = region.longitudes_deg;
    assert_eq!(east - west, 360.0);
}

/// On both sides of 180 degrees: files of one side are found from the other.
#[test]
fn scene_across_date_line_uses_files_on_both_sides() {
    let folder = tempfile::tempdir().unwrap();
    let height =
        |latitude: f64, longitude: f64| 100.0 + 10.0 * latitude + (longitude * 300.0).sin() * 9.0;
    write(
        folder.path(),
        "S17E179.hgt",
        &hgt([-17.0, 179.0], 1201, height),
    );
    write(
        folder.path(),
        "S17W180.hgt",
        &hgt([-17.0, -180.0], 1201, height),
    );
    let origin = Geodetic {
        latitude_deg: -16.5,
        longitude_deg: 179.999,
        height_m: 0.0,
    };
    let grid: ImageGrid = "x=-300:300:5,y=-100:100:5".parse().unwrap();
    let frame = SceneFrame::east_north_up(&origin);
    let region = Region::of(&grid, &frame).unwrap();
    assert!(region.longitudes_deg[1] > 180.0, "{region:?}");
    let ground = Ground::open(folder.path(), &Geoid::None, &region, MEMORY).unwrap();
    assert_eq!(ground.files().len(), 2);
    let grid = grid
        .clone()
        .on(relief(&grid, &frame, Surface::Ground(&ground), &Silent).unwrap());
    for (row, column) in [(0, 0), (20, 119), (39, 60)] {
        let place = frame.geodetic(grid.position_m(row, column)).unwrap();
        let west = if place.longitude_deg < 0.0 {
            -180.0
        } else {
            179.0
        };
        let at = [place.latitude_deg, place.longitude_deg];
        let expected = hgt_height_m([-17.0, west], 1201, at, height);
        assert!(
            (place.height_m - expected).abs() < 0.3,
            "{place:?} {expected}"
        );
    }
}

/// Pixels lie on the surface of the ellipsoid, over horizontal and tilted planes, and a point of the surface has its own pixel.
#[test]
fn relief_pixels_lie_on_surface() {
    let origin = [52.4, 4.6, 20.0];
    let frame = SceneFrame::east_north_up(&Geodetic {
        latitude_deg: origin[0],
        longitude_deg: origin[1],
        height_m: origin[2],
    });
    for text in [
        "x=-10000:10000:50,y=-8000:9000:40",
        "x=-10000:10000:50,y=-8000:9000:40,yaw=30,roll=-40",
        "r=4000:9000:20,theta=20:140:0.5",
    ] {
        let grid: ImageGrid = text.parse().unwrap();
        let made = relief(&grid, &frame, Surface::Ellipsoid(-12.0), &Silent).unwrap();
        // A twentieth of the smaller pixel at the centres of cells, where bilinear interpolation has its largest error.
        let bound_m = 0.05 * grid.rows.step.min(40.0);
        assert!(made.error_m() <= bound_m, "{text}: {}", made.error_m());
        let grid = grid.on(made.clone());
        let (rows, columns) = (grid.rows.count, grid.columns.count);
        for (row, column) in [
            (0, 0),
            (rows - 1, columns - 1),
            (rows / 3, columns / 5),
            (rows - 1, 0),
        ] {
            let point = grid.position_m(row, column);
            let place = frame.geodetic(point).unwrap();
            assert!(
                (place.height_m + 12.0).abs() <= 1.1 * bound_m,
                "{text}: {place:?}"
            );
            let [row_value, column_value] = grid.coordinates(point);
            let found = [
                (row_value - grid.rows.start) / grid.rows.step,
                (column_value - grid.columns.start) / grid.columns.step,
            ];
            assert!((found[0] - row as f64).abs() < 1e-6, "{text}: {found:?}");
            assert!((found[1] - column as f64).abs() < 1e-6, "{text}: {found:?}");
            // Directions are derivatives of points.
            let h = 1e-3;
            let at =
                |r: f64, c: f64| grid.point_m(grid.rows.at(row) + r, grid.columns.at(column) + c);
            let [across, up] = grid.directions(grid.rows.at(row) + 0.5, grid.columns.at(column));
            let measured = (at(0.5 + h, 0.0) - at(0.5 - h, 0.0)) / (2.0 * h);
            assert!(measured.distance(up) < 1e-6, "{text}: {measured} {up}");
            let scale = if grid.polar { 1e-3 } else { 1.0 };
            let (_, along) = (
                at(0.5, 0.0),
                (at(0.5, h * scale) - at(0.5, -h * scale)) / (2.0 * h * scale),
            );
            assert!(
                along.distance(across) < 1e-3 * across.length(),
                "{text}: {along} {across}"
            );
        }
        // Converted to text and back: the same nodes.
        let text = serde_json::to_string(&made).unwrap();
        assert_eq!(
            serde_json::from_str::<subaperture::geometry::Relief>(&text).unwrap(),
            made
        );
    }
    let upright: ImageGrid = "x=-100:100:5,y=-80:90:4,roll=90".parse().unwrap();
    let refused = relief(&upright, &frame, Surface::Ellipsoid(0.0), &Silent);
    assert!(
        matches!(refused, Err(TerrainError::Steep { .. })),
        "{refused:?}"
    );
    let level: ImageGrid = "x=-100:100:5,y=-80:90:4".parse().unwrap();
    let local = relief(&level, &SceneFrame::Local, Surface::Ellipsoid(0.0), &Silent);
    assert!(matches!(local, Err(TerrainError::Local)), "{local:?}");
    // The frame by the tests' own formulas.
    let place = [52.41, 4.59, 100.0];
    let local = frame.from_ecf_m(ecf_m(place));
    assert!(local.distance(east_north_up_m(origin, place)) < 1e-6);
    assert!(local.distance(DVec3::ZERO) > 1000.0);
}
