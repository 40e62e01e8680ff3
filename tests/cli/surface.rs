//! `--surface`: a reflector on a hill appears at its position on the ground of an elevation model, in image and map, and with layover
//! without a surface.

use std::fs;
use std::path::Path;

use glam::DVec3;
use serde_json::Value;
use subaperture::io::npy;
use subaperture::io::product;
use subaperture_tests::dem::{GeoTiff, degree_m, east_north_up_m, hgt, hgt_height_m};
use subaperture_tests::subap::{run, write_recording};
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::Tag;

/// The scene's origin, on the ellipsoid.
const ORIGIN: [f64; 3] = [52.4, 4.6, 0.0];
/// Latitude and longitude of the reflector, some 170 m east and 250 m north of the origin.
const REFLECTOR: [f64; 2] = [52.402_249_5, 4.6025];
/// South-western corner of the elevation model.
const CORNER: [f64; 2] = [52.0, 4.0];
/// Height of the geoid above the ellipsoid here, metres.
const GEOID_M: f64 = 43.5;

/// Ground height of a hill of 200 m, on whose slope the reflector stands.
fn hill_m(latitude: f64, longitude: f64) -> f64 {
    let [north, east] = degree_m(ORIGIN[0]);
    let (y, x) = (
        (latitude - REFLECTOR[0]) * north - 120.0,
        (longitude - REFLECTOR[1]) * east + 80.0,
    );
    60.0 + 200.0 * (-(x * x + y * y) / (2.0 * 400.0f64.powi(2))).exp()
}

/// An aircraft 5 km south of the scene and 4 km up, flying east; the reflector in metres east, north and up.
fn scenario(reflector: DVec3) -> String {
    format!(
        r#"name = "hill"
[scene]
reference = "0, 0, 0 m"
x = "-400, 400 m"
y = "-400, 400 m"
[scene.origin]
latitude = "{} deg"
longitude = "{} deg"
[[scene.point]]
position = "{}, {}, {} m"
[radar]
kind = "ideal"
pulses = 200
pri = "8 ms"
centre = "9.6 GHz"
bandwidth = "300 MHz"
samples = 1500
[platform]
kind = "linear"
position = "0, -5000, 4000 m"
velocity = "100, 0, 0 m/s"
"#,
        ORIGIN[0], ORIGIN[1], reflector.x, reflector.y, reflector.z
    )
}

/// Position of the reflector on ground of `height_m` above the ellipsoid.
fn stands_m(height_m: f64) -> DVec3 {
    east_north_up_m(ORIGIN, [REFLECTOR[0], REFLECTOR[1], height_m])
}

/// Apparent position in the plane z = 0: an echo on a straight track determines a circle about it.
fn laid_over_m(reflector: DVec3) -> DVec3 {
    let up_m = 4000.0;
    let range2 = (reflector.y + 5000.0).powi(2) + (reflector.z - up_m).powi(2);
    DVec3::new(reflector.x, (range2 - up_m * up_m).sqrt() - 5000.0, 0.0)
}

/// A grid of 0.25 m about a position.
fn grid(about: DVec3) -> String {
    let (x, y) = (about.x.round(), about.y.round());
    format!(
        "x={}:{}:0.25,y={}:{}:0.25",
        x - 12.0,
        x + 12.0,
        y - 12.0,
        y + 12.0
    )
}

/// Position of the brightest pixel from the record.
fn brightest(folder: &Path) -> DVec3 {
    let record: Value =
        serde_json::from_slice(&fs::read(folder.join("image.json")).unwrap()).unwrap();
    let place: [f64; 3] =
        serde_json::from_value(record["brightest"]["position_m"].clone()).unwrap();
    place.into()
}

/// Latitude and longitude of the brightest pixel of a geographic GeoTIFF of amplitudes, by another program's reader.
fn brightest_of_map(path: &Path) -> [f64; 2] {
    let mut map = Decoder::new(fs::File::open(path).unwrap())
        .unwrap()
        .with_limits(Limits::unlimited());
    let (columns, _) = map.dimensions().unwrap();
    let scale = map.get_tag_f64_vec(Tag::ModelPixelScaleTag).unwrap();
    let tie = map.get_tag_f64_vec(Tag::ModelTiepointTag).unwrap();
    let DecodingResult::F32(pixels) = map.read_image().unwrap() else {
        panic!("float32 amplitudes are wanted");
    };
    let (at, _) = pixels
        .iter()
        .enumerate()
        .filter(|(_, value)| value.is_finite())
        .max_by(|a, b| a.1.total_cmp(b.1))
        .unwrap();
    let (row, column) = (at / columns as usize, at % columns as usize);
    // Pixels are areas.
    [
        tie[4] - (row as f64 + 0.5 - tie[1]) * scale[1],
        tie[3] + (column as f64 + 0.5 - tie[0]) * scale[0],
    ]
}

/// East and north of a map position from the reflector, metres.
fn off_m(found: [f64; 2], height_m: f64) -> DVec3 {
    let place = [REFLECTOR[0], REFLECTOR[1], height_m];
    east_north_up_m(place, [found[0], found[1], height_m])
}

#[test]
fn reflector_on_hill_appears_at_its_position_with_surface() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let side = 1201;
    fs::create_dir(at.join("ground")).unwrap();
    fs::write(at.join("ground/N52E004.hgt"), hgt(CORNER, side, hill_m)).unwrap();
    let height_m = hgt_height_m(CORNER, side, REFLECTOR, hill_m) + GEOID_M;
    let true_m = stands_m(height_m);
    assert!(height_m > 250.0, "{height_m}");
    write_recording(at, "hill", scenario(true_m));

    // Without the ground: displaced towards the radar by the predicted layover.
    let over_m = laid_over_m(true_m);
    run(
        at,
        &format!("focus hill.cphd --grid {} --out flat", grid(over_m)),
    )
    .succeeded();
    let found_m = brightest(&at.join("flat"));
    println!("{true_m:.2} is seen at {found_m:.2} in the plane, {over_m:.2} by layover");
    assert!((found_m - over_m).abs().max_element() <= 0.125 + 1e-6);
    assert!(true_m.y - over_m.y > 150.0);

    // With the ground from a file or a folder: at its position within half a pixel of 0.25 m.
    for (name, surface) in [
        ("dem", "dem:ground/N52E004.hgt"),
        ("of_folder", "dem:ground"),
    ] {
        let line = format!(
            "focus hill.cphd --grid {} --surface {surface} --geoid {GEOID_M} --out {name}",
            grid(true_m)
        );
        let ran = run(at, &line);
        ran.succeeded();
        assert!(ran.is_untroubled(), "{ran:?}");
        let found_m = brightest(&at.join(name));
        println!("{name}: {found_m:.2}");
        let off = (found_m - true_m).abs();
        assert!(off.x <= 0.126 && off.y <= 0.126, "{off}");
        let about = run(at, &format!("info {name}"));
        assert!(
            about
                .succeeded()
                .contains("the ground of N52E004.hgt above a geoid 43.5 m"),
            "{about:?}"
        );
        // The slope is less than 1 in 3: half a pixel is 8 cm of height; nodes have errors of 0.05 pixels.
        assert!(off.z < 0.1, "{off}");
    }

    // A position outside the elevation model.
    let away =
        "focus hill.cphd --grid x=-50000:-49990:0.5,y=0:10:0.5 --surface dem:ground --out away";
    run(at, away).failed(1, &["ground", "overlaps the scene"]);

    // On the map, with pixels of 5 cm: within half a pixel of the image.
    for (name, expected_m) in [
        ("dem", DVec3::ZERO),
        // In the plane the position is displaced by the layover.
        ("flat", over_m - true_m),
    ] {
        let line = format!(
            "export {name} -o {name}.tif --projection geographic --layout amplitude --pixel 0.05m"
        );
        run(at, &line).succeeded();
        let found = brightest_of_map(&at.join(format!("{name}.tif")));
        let off = off_m(found, height_m);
        println!("{name}.tif: {found:?}, {off:.2} m from the reflector");
        assert!((off.x - expected_m.x).abs() <= 0.15, "{off}");
        // 180 m of layover at one height are 5 cm less at another on the round Earth: 300 m / 6371 km of it are 8 mm.
        assert!((off.y - expected_m.y).abs() <= 0.15, "{off}");
    }

    // Formats and formers without surfaces refuse.
    run(at, "export dem --format sicd -o dem.nitf").failed(1, &["plane"]);
    for former in ["pfa", "omega-k", "rda", "rdbp"] {
        let line = format!(
            "focus hill.cphd --grid {} --surface dem:ground --algorithm {former} --out {former}",
            grid(true_m)
        );
        run(at, &line).failed(1, &["N52E004.hgt", former, "bp"]);
    }
}

/// The same ground as GeoTIFF: geographic, with pixels as points and as areas, in strips and in compressed tiles, with voids elsewhere.
#[test]
fn geotiff_and_hgt_models_give_same_image() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    // Posts about 20 m apart, bilinear in between.
    let step = 2e-4;
    let west_north = [4.59, 52.41];
    let height_of = |latitude: f64, longitude: f64| {
        let (r, c) = (
            (west_north[1] - latitude) / step,
            (longitude - west_north[0]) / step,
        );
        let (i, j) = (r.floor(), c.floor());
        let post = |i: f64, j: f64| {
            f64::from(hill_m(west_north[1] - i * step, west_north[0] + j * step) as f32)
        };
        let (v, u) = (r - i, c - j);
        (1.0 - v) * ((1.0 - u) * post(i, j) + u * post(i, j + 1.0))
            + v * ((1.0 - u) * post(i + 1.0, j) + u * post(i + 1.0, j + 1.0))
    };
    let height_m = height_of(REFLECTOR[0], REFLECTOR[1]);
    let true_m = stands_m(height_m);
    write_recording(at, "hill", scenario(true_m));
    let base = GeoTiff {
        size: [120, 110],
        origin: west_north,
        steps: [step; 2],
        points: true,
        epsg: 4326,
        tile: None,
        strip_rows: 7,
        void: Some(-9999.0),
        deflate: false,
    };
    let post = |column: usize, row: usize| match column < 5 {
        true => -9999.0,
        false => hill_m(
            west_north[1] - row as f64 * step,
            west_north[0] + column as f64 * step,
        ) as f32,
    };
    fs::write(at.join("points.tif"), base.bytes(post)).unwrap();
    // The outer corner of the first pixel is half a step before its centre.
    let areas = GeoTiff {
        points: false,
        origin: [west_north[0] - 0.5 * step, west_north[1] + 0.5 * step],
        tile: Some(32),
        deflate: true,
        ..base.clone()
    };
    fs::write(at.join("areas.tif"), areas.bytes(post)).unwrap();
    let mut images = Vec::new();
    for name in ["points", "areas"] {
        let line = format!(
            "focus hill.cphd --grid {} --surface dem:{name}.tif --out {name}",
            grid(true_m)
        );
        run(at, &line).succeeded();
        let found_m = brightest(&at.join(name));
        let off = (found_m - true_m).abs();
        println!("{name}: {found_m:.2}, {off:.3} off");
        assert!(off.x <= 0.126 && off.y <= 0.126 && off.z < 0.1, "{off}");
        images.push(npy::read(&at.join(name).join("image.npy")).unwrap());
    }
    // Both have the same heights up to roundings, which nodes of 0.1 mm hide except here and there.
    let error_db = subaperture_tests::error_db(&images[0], &images[1]);
    assert!(error_db < -40.0, "{error_db}");

    // A void is reported with its position.
    let hole = |column: usize, row: usize| match column > 50 {
        true => -9999.0,
        false => post(column, row),
    };
    fs::write(at.join("hole.tif"), base.bytes(hole)).unwrap();
    let line = |surface: &str| {
        format!(
            "focus hill.cphd --grid {} --surface {surface} --out never",
            grid(true_m)
        )
    };
    run(at, &line("dem:hole.tif")).failed(1, &["hole.tif", "latitude 52.40", "void"]);
    // Other reference systems and positions are refused by name.
    let other = GeoTiff {
        epsg: 31467,
        ..base.clone()
    };
    fs::write(at.join("other.tif"), other.bytes(post)).unwrap();
    run(at, &line("dem:other.tif")).failed(1, &["other.tif", "31467", "gdalwarp"]);
    fs::write(at.join("plain.xyz"), "1 2 3").unwrap();
    run(at, &line("dem:plain.xyz")).failed(1, &["plain.xyz", ".hgt", ".tif"]);
    run(at, &line("dem:none.tif")).failed(1, &["none.tif", "cannot read"]);
    run(at, &line("dem")).failed(2, &["dem:FILE"]);
    run(at, &line("hae:high")).failed(2, &["hae"]);
    run(at, &line("hae --geoid 3")).failed(2, &["--geoid", "--surface dem"]);

    // A plan contains the surface, and its tiles are bit-identical to the image; the elevation model is not needed any more.
    let plan = format!(
        "plan focus hill.cphd --grid {} --surface dem:points.tif -o plan.json",
        grid(true_m)
    );
    run(at, &plan).succeeded();
    fs::remove_file(at.join("points.tif")).unwrap();
    run(
        at,
        "focus hill.cphd --plan plan.json --tiles 2/2 --out tiles",
    )
    .succeeded();
    run(
        at,
        "focus hill.cphd --plan plan.json --tiles 1/2 --out tiles",
    )
    .succeeded();
    let whole = product::read(&at.join("points")).unwrap();
    let tiles = product::read(&at.join("tiles")).unwrap();
    assert_eq!(whole.grid, tiles.grid);
    let relief = tiles.grid.relief.unwrap();
    assert!(
        relief.surface().contains("points.tif"),
        "{}",
        relief.surface()
    );
    assert!(whole.image.pixels == tiles.image.pixels);
}

/// Points on the ellipsoid far from the scene's origin: a plane is 31 m above it at 20 km, so that points are displaced.
#[test]
fn points_on_ellipsoid_keep_their_positions() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    // 20 km to the north, 12 m above the ellipsoid.
    let [north, _] = degree_m(ORIGIN[0]);
    let place = [ORIGIN[0] + 20_000.0 / north, ORIGIN[1], 12.0];
    let true_m = east_north_up_m(ORIGIN, place);
    assert!(
        (true_m.z - 12.0 + 20_000.0f64.powi(2) / (2.0 * 6.37e6)).abs() < 0.5,
        "{true_m}"
    );
    let text = scenario(true_m).replace(
        "reference = \"0, 0, 0 m\"",
        &format!("reference = \"0, {}, 0 m\"", true_m.y),
    );
    write_recording(at, "far", text);
    let grid = grid(true_m).replace(":0.25", ":0.5");
    run(
        at,
        &format!("focus far.cphd --grid {grid} --surface hae:12 --out hae"),
    )
    .succeeded();
    let off = (brightest(&at.join("hae")) - true_m).abs();
    println!("{off:.3}");
    // Half a pixel; the ellipsoid falls away by 3 mm per metre there.
    assert!(off.x <= 0.26 && off.y <= 0.26 && off.z < 0.02, "{off}");
    // The slant plane through the position contains the reflector at its own range and cross-range.
    let here = format!(
        "x=-10:10:0.5,y=-10:10:0.5,cx={},cy={},z={}",
        true_m.x, true_m.y, true_m.z
    );
    run(
        at,
        &format!("focus far.cphd --grid {here} --surface slant --out slant"),
    )
    .succeeded();
    let off = (brightest(&at.join("slant")) - true_m).abs();
    assert!(off.max_element() < 1e-6, "{off}");
    let slant = product::read(&at.join("slant")).unwrap().grid;
    // y points from the antenna to the position, x along the track.
    let sight = (true_m - DVec3::new(0.0, -5000.0, 4000.0)).normalize();
    assert!(slant.y_axis.distance(sight) < 1e-4, "{}", slant.y_axis);
    assert!(slant.x_axis.distance(DVec3::X) < 1e-4, "{}", slant.x_axis);
    run(
        at,
        &format!("focus far.cphd --grid {here},yaw=3 --surface slant --out never"),
    )
    .failed(2, &["yaw"]);
}
