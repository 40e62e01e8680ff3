//! Commands on images of every format, and `subap info` on every kind of file that the program reads or writes.

use std::fs;
use std::path::Path;

use serde_json::Value;
use subaperture_tests::subap::{run, write_recording};

/// An aeroplane passing three points, in an Earth frame.
const SCENE: &str = r#"name = "three"

[scene]
reference = "0, 0, 0 m"
x = "-20, 20 m"
y = "-20, 20 m"

[scene.origin]
latitude = "52 deg"
longitude = "4 deg"

[[scene.point]]
position = "2, 3, 0 m"
[[scene.point]]
position = "9, -5, 0 m"
cross_section = "-6 dBsm"

[radar]
kind = "ideal"
pulses = 160
pri = "12.5 ms"
centre = "9.6 GHz"
bandwidth = "300 MHz"
samples = 160

[platform]
kind = "linear"
position = "60, -480, 350 km"
velocity = "7500, 0, 0 m/s"
"#;

const GRID: &str = "x=-20:12:0.4,y=-16:20:0.25";

/// Write a product and the same image in every other format. The point at x 2 m, y 3 m is the brightest.
fn images(at: &Path) {
    fs::write(at.join("scene.toml"), SCENE).unwrap();
    for line in [
        "simulate scene.toml -o scene.cphd".to_owned(),
        format!("focus scene.cphd --grid {GRID} --out product"),
        "export product -o sicd.nitf".to_owned(),
        "export product --format sidd --remap db -o sidd.nitf".to_owned(),
        "export product -o levels.tif".to_owned(),
        "export product --layout amplitude -o amplitude.tif".to_owned(),
        "export product --layout complex -o complex.tif".to_owned(),
        "export product -o stack.zarr".to_owned(),
        format!("plan focus scene.cphd --grid {GRID} --scratch 64K --out plan.json"),
        "focus scene.cphd --plan plan.json --tiles 2/3 --out growing".to_owned(),
        "velocity scene.cphd --at 2,3 --out velocity".to_owned(),
    ] {
        run(at, &line).succeeded();
    }
}

const IMAGES: [&str; 11] = [
    "product",
    "product/image.json",
    "product/image.npy",
    "sicd.nitf",
    "sidd.nitf",
    "levels.tif",
    "amplitude.tif",
    "complex.tif",
    "stack.zarr",
    "growing",
    "velocity",
];

fn json(at: &Path, line: &str) -> Value {
    serde_json::from_str(run(at, &format!("{line} --json")).succeeded()).unwrap()
}

#[test]
fn every_command_on_images_opens_every_format() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    images(at);
    for image in IMAGES {
        let result = json(at, &format!("info {image}"));
        let result = &result["stored"][0];
        let kind = result["kind"].as_str().unwrap();
        assert!(["image", "array"].contains(&kind), "{image}: {result}");
        let measured = json(at, &format!("quality {image}"));
        assert!(
            measured["statistics"]["peak_level_db"].is_number(),
            "{image}"
        );
        run(at, &format!("picture {image} -o picture.png")).succeeded();
        let compared = json(at, &format!("compare {image} {image}"));
        assert!(compared["error_db"].is_null(), "{image}: {compared}");
        assert_eq!(compared["correlation"], 1.0, "{image}");
        let exported = run(at, &format!("export {image} -o copy.zarr"));
        match image {
            "growing" => exported.failed(1, &["growing", "1 of 3 tiles", "focus"]),
            _ => {
                exported.succeeded();
                let compared = json(at, &format!("compare {image} copy.zarr"));
                assert_eq!(compared["correlation"], 1.0, "{image}");
            }
        }
    }
    // A point has the same level and widths in every format with complex values.
    let level = |image: &str| {
        let measured = json(at, &format!("quality {image}"));
        let response = &measured["points"][0]["response"];
        let width = |cut: usize| response["cuts"][cut]["width_3db"].as_f64().unwrap();
        let mut widths = [width(0), width(1)];
        widths.sort_by(f64::total_cmp);
        (response["level_db"].as_f64().unwrap(), widths)
    };
    let (expected, widths) = level("product");
    for image in ["sicd.nitf", "stack.zarr"] {
        let (found, found_widths) = level(image);
        // The same samples, measured about a carrier or without one.
        assert!(
            (found - expected).abs() < 0.01,
            "{image}: {found} {expected}"
        );
        for (a, b) in widths.iter().zip(found_widths) {
            assert!((a - b).abs() < 0.005 * a, "{image}: {a} {b}");
        }
    }
    // A plane of velocities is not an image over positions.
    run(at, "compare velocity product").failed(1, &["velocity and product", "velocities"]);
    run(at, "velocity scene.cphd --at 3,3 --out beside").succeeded();
    run(at, "compare velocity beside").failed(
        1,
        &["velocity and beside", "different velocities or positions"],
    );
    // Responses of detected images are not measured, and the output states this.
    let detected = run(at, "quality sidd.nitf");
    assert!(detected.stderr.contains("complex values"), "{detected:?}");
    run(at, "quality sidd.nitf --at 0,0").failed(1, &["sidd.nitf", "complex values"]);
    // Values of a detected image are unchanged in a stack.
    run(at, "export sidd.nitf -o grey.zarr").succeeded();
    assert_eq!(
        json(at, "compare product grey.zarr")["values"],
        "amplitudes"
    );
    // A stack contains the record that maps and SICD need.
    run(at, "export stack.zarr -o again.tif --layout complex").succeeded();
    assert_eq!(
        json(at, "compare again.tif complex.tif")["correlation"],
        1.0
    );
    run(at, "export stack.zarr -o again.nitf").succeeded();
    assert_eq!(json(at, "compare again.nitf sicd.nitf")["correlation"], 1.0);
    run(at, "export levels.tif -o x.nitf").failed(1, &["levels.tif", "GeoTIFF", "zarr"]);
}

#[test]
fn quality_compares_images_of_any_two_formats() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    images(at);
    for (pair, values, most_db) in [
        ("sicd.nitf --against product", "complex", -200.0),
        ("product --against stack.zarr", "complex", -200.0),
        ("product --against complex.tif", "complex", -200.0),
        // Half a step of 60 dB over 254.
        ("product --against sidd.nitf", "amplitudes", -37.0),
    ] {
        let result = json(at, &format!("quality {pair}"));
        let against = &result["against"];
        let error_db = against["comparison"]["error_db"].as_f64();
        assert!(error_db.is_none_or(|db| db < most_db), "{pair}: {against}");
        assert_eq!(against["values"], values, "{pair}");
        assert!(
            against["offset_pixels"]["columns"].as_f64().unwrap().abs() < 1e-3,
            "{pair}"
        );
    }
    run(
        at,
        &format!("focus scene.cphd --grid {GRID},z=2 --out high"),
    )
    .succeeded();
    run(at, "quality product --against high").failed(1, &["different surfaces"]);
}

/// A line of each file's description, and its kind.
#[test]
fn info_describes_every_kind_of_file() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    images(at);
    let example = |line: &str, name: &str| {
        let text = run(at, line).succeeded().to_owned();
        fs::write(at.join(name), text).unwrap();
    };
    example("capture --example rail-scene", "rail-scene.toml");
    example("capture --example rail", "rail.toml");
    example("run --example", "job.toml");
    // The file of the scene has the name that the experiment refers to.
    let text = fs::read_to_string(at.join("rail.toml")).unwrap();
    let name = text
        .lines()
        .find(|line| line.starts_with("scenario"))
        .unwrap();
    let name = name.split('"').nth(1).unwrap();
    if name != "rail-scene.toml" {
        fs::copy(at.join("rail-scene.toml"), at.join(name)).unwrap();
    }
    run(at, "capture rail.toml -o walk --set plan.sweeps=3").succeeded();
    fs::write(
        at.join("track.csv"),
        "time_s,x_m,y_m,z_m\n0,0,0,1\n1,3,4,1\n2,6,8,1\n",
    )
    .unwrap();
    fs::write(at.join("phases.csv"), "pulse,phase_rad\n0,0.5\n1,-0.5\n").unwrap();
    fs::write(
        at.join("layer.json"),
        r#"{"type":"FeatureCollection","features":[{"type":"Feature","properties":{},"geometry":{"type":"Point","coordinates":[4,52]}}]}"#,
    )
    .unwrap();
    // A fix from the GGA sentence's documentation, with its checksum.
    fs::write(
        at.join("log.nmea"),
        "$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\r\n",
    )
    .unwrap();
    run(at, "plan calibrate --out model.json").succeeded();
    run(at, "export product -o map.kmz").succeeded();
    for (path, kind, words) in [
        ("walk.sigmf-meta", "capture", "3 sweeps"),
        ("walk.sigmf-data", "capture", "3 sweeps"),
        ("walk", "capture", "3 sweeps"),
        ("rail.toml", "experiment", "simulated"),
        ("rail-scene.toml", "scenario", "pairs of antennas"),
        ("scene.toml", "scenario", "three"),
        ("job.toml", "job", "input."),
        ("plan.json", "plan", "144 rows x 80 columns"),
        ("model.json", "record", "subaperture-time-model"),
        ("levels.json", "GeoJSON", "1 features"),
        ("layer.json", "GeoJSON", "1 features"),
        ("track.csv", "track", "3 fixes"),
        ("phases.csv", "phases", "2 pulses"),
        ("log.nmea", "navigation log", "1 positions"),
        ("product/image.png", "picture", "pixels"),
        ("map.kmz", "map", "KMZ"),
        ("growing", "image", "1 of 3 are formed"),
        ("velocity", "image", "v_x in m/s"),
        ("sicd.nitf", "image", "SICD 1.3"),
        ("sidd.nitf", "image", "SIDD 3.0"),
        ("levels.tif", "image", "EPSG:32631"),
        ("stack.zarr", "image", "Zarr 3"),
    ] {
        let shown = run(at, &format!("info {path}"));
        assert!(shown.succeeded().contains(words), "{path}: {shown:?}");
        let result = json(at, &format!("info {path}"));
        assert_eq!(result["stored"][0]["kind"], kind, "{path}");
    }
    // 3 m by 4 m in a second.
    assert_eq!(json(at, "info track.csv")["stored"][0]["length_m"], 10.0);
    run(at, "info scene.cphd").succeeded();
    // An unknown file is passed to the reader of recordings, whose error lists the formats.
    fs::write(at.join("notes.txt"), "a,b\n").unwrap();
    run(at, "info notes.txt").failed(1, &["notes.txt", "CPHD"]);
    // A damaged file is reported as damaged.
    fs::write(
        at.join("walk.sigmf-meta"),
        "{\"global\":{\"core:datatype\":\"ci16_le\"",
    )
    .unwrap();
    run(at, "info walk.sigmf-meta").failed(1, &["walk.sigmf-meta"]);
}

/// The default grid contains the velocity of the target.
#[test]
fn velocities_have_a_default_grid() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let moving = SCENE
        .replace("[[scene.point]]\nposition = \"2, 3, 0 m\"\n", "")
        .replace("[radar]", "[[scene.mover]]\nkind = \"linear\"\nposition = \"2, 3, 0 m\"\nvelocity = \"0, 0.4, 0 m/s\"\n\n[radar]");
    write_recording(at, "moving", moving);
    let result = json(at, "velocity moving.cphd --at 2,3 --out plane");
    let brightest = &result["brightest"]["velocity_m_s"];
    let resolution = result["resolution_m_s"]["v_y"].as_f64().unwrap();
    let found = brightest[1].as_f64().unwrap();
    assert!((found - 0.4).abs() < resolution, "{result}");
    let step = result["velocities"]["rows"]["step"].as_f64().unwrap();
    assert!((step - resolution / 2.0).abs() < 1e-9 * step, "{result}");
    // One axis may be given.
    let result = json(
        at,
        "velocity moving.cphd --at 2,3 --vx -1:1.5:0.5 --out plane",
    );
    assert_eq!(result["velocities"]["columns"]["count"], 5);
}
