//! Maps written by the command, checked with GDAL and rio-cogeo's validator.
//!
//! Python is that of `SUBAPERTURE_PYTHON`, or `python3`.

use std::fs;

use subaperture_tests::python;
use subaperture_tests::subap::{folder_with_recording, run};

/// One point off the middle, seen from the south.
const SCENE: &str = r#"
name = "one"
seed = 1
[scene]
reference = "0, 0, 0 m"
[scene.origin]
latitude = "52.1 deg"
longitude = "4.3 deg"
height = "43 m"
[[scene.point]]
position = "1.37, -2.21, 0 m"
[radar]
kind = "pulsed"
pulses = 64
prf = "64 Hz"
centre = "9.6 GHz"
sample_rate = "250 MHz"
samples = 256
[radar.pulse]
kind = "lfm"
bandwidth = "200 MHz"
duration = "0.5 us"
[platform]
kind = "linear"
position = "0, -5, 3 km"
velocity = "200, 0, 0 m/s"
"#;

const EXPECTED: &str = r#"{
    "origin": { "latitude_deg": 52.1, "longitude_deg": 4.3, "height_m": 43.0 },
    "point_m": [1.37, -2.21, 0.0],
    "level_db": LEVEL
}"#;

#[test]
fn gdal_reads_point_at_its_true_position() {
    let folder = folder_with_recording("scene", SCENE);
    let at = folder.path();
    // The resolution is some 0.6 m by 0.4 m.
    let grid = "--grid x=-8:8:0.17,y=-9:7:0.25,yaw=20";
    run(at, &format!("focus scene.cphd -a exact {grid} -o image")).succeeded();
    for line in [
        "-o db.tif",
        "-o amplitude.tif --layout amplitude",
        "-o complex.tif --layout complex",
        "-o amplitude-geographic.tif --layout amplitude --projection geographic",
        "-o overviews.tif --layout amplitude --pixel 2.5cm",
        "-o map.kmz --remap db",
        "-o tiles.kmz --remap db --pixel 1.8cm",
        "-o picture.png --remap db",
        // The command replaces its own files and those next to them.
        "-o picture.png --remap db",
        "-o db.tif --looks 1",
    ] {
        run(at, &format!("export image {line}")).succeeded();
    }
    let record: serde_json::Value =
        serde_json::from_slice(&fs::read(at.join("image/image.json")).unwrap()).unwrap();
    let level = record["brightest"]["level_db"].to_string();
    fs::write(at.join("expected.json"), EXPECTED.replace("LEVEL", &level)).unwrap();

    python::script("maps_check.py", [at]);
}

#[test]
fn export_refuses_impossible_maps_with_a_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    run(at, "simulate --preset table-4-1 -o scene.cphd").succeeded();
    let focus = "focus scene.cphd -a bp --grid";
    run(at, &format!("{focus} x=-5:5:0.25,y=-5:5:0.25 -o image")).succeeded();
    run(
        at,
        &format!("{focus} x=-5:5:0.25,y=-5:5:0.25,roll=90 -o wall"),
    )
    .succeeded();
    run(at, &format!("{focus} x=-5:5:2,y=-5:5:2 -o coarse")).succeeded();
    fs::write(at.join("theirs.tif"), "theirs").unwrap();
    fs::write(at.join("theirs.pgw"), "theirs").unwrap();
    for (line, code, expected) in [
        ("image -o map.jp2", 2, "--format"),
        ("image -o a.kmz --layout complex", 2, "--layout"),
        ("image -o a.kmz --projection utm", 2, "--projection"),
        ("image -o a.tif --layout amplitude --top -3", 2, "--top"),
        ("image -o a.tif --layout complex --looks 3", 2, "--looks"),
        ("image -o a.tif --place 91,0", 2, "-90 to 90"),
        ("image -o a.tif --speed 3m/s", 2, "--format sicd"),
        ("image -o a.nitf --looks 3", 2, "apply to maps"),
        ("image -o theirs.tif", 1, "not a map written by subap"),
        ("image -o theirs.png", 1, "theirs.pgw"),
        ("image -o a.tif --pixel 3km", 1, "use smaller pixels"),
        ("image -o a.tif --place 89,0", 1, "84 degrees north"),
        ("image -o a.tif --layout complex --pixel 1", 1, "too coarse"),
        ("wall -o a.tif", 1, "upright"),
        ("coarse -o a.tif", 1, "finer grid"),
        ("scene.cphd -o a.tif", 1, "expected an image"),
    ] {
        let ran = run(at, &format!("export {line}"));
        ran.failed(code, &[expected]);
    }
    assert!(!at.join("a.tif").exists() && !at.join("theirs.png").exists());
    assert_eq!(fs::read(at.join("theirs.pgw")).unwrap(), b"theirs");
    // Files written next to a map must not be the map, an input, or a file by another program.
    let record = fs::read(at.join("image/image.json")).unwrap();
    run(at, "export image -o own.tif").succeeded();
    fs::write(at.join("own.json"), "theirs").unwrap();
    for (line, expected) in [
        ("-o map.json --format cog", "map.json"),
        ("-o map.pgw --format png", "map.pgw"),
        ("-o image/image.tif --force", "image.json"),
        ("-o own.tif", "not a STAC item"),
    ] {
        run(at, &format!("export image {line}")).failed(1, &[expected]);
    }
    assert!(!at.join("map.json").exists() && !at.join("map.pgw").exists());
    assert_eq!(fs::read(at.join("image/image.json")).unwrap(), record);
    assert_eq!(fs::read(at.join("own.json")).unwrap(), b"theirs");
    let picture = "picture image -o density.png --remap density";
    run(at, picture).succeeded();
    run(at, &format!("{picture} --top 3")).failed(2, &["--remap", "--top"]);
    // Maps by latitude and longitude exist near the poles too.
    run(
        at,
        "export image -o pole.tif --place 89,0 --projection geographic",
    )
    .succeeded();
}
