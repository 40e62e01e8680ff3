//! `subap compare` of images that are not on one grid, or not of one format: compared on the same pixels, or refused.

use std::fs::{self, File};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::Path;

use serde_json::Value;
use subaperture_tests::subap::{run, write_recording};

/// A satellite that sees the scene from `position` (three numbers with a unit) and flies along `velocity`.
fn scene(position: &str, velocity: &str) -> String {
    format!(
        r#"name = "turned"

[scene]
reference = "0, 0, 0 m"
x = "-20, 20 m"
y = "-20, 20 m"

[[scene.point]]
position = "0, 0, 0 m"
[[scene.point]]
position = "9, -5, 0 m"
cross_section = "-6 dBsm"
[[scene.point]]
position = "-11, 8, 0 m"
cross_section = "-3 dBsm"

[radar]
kind = "ideal"
pulses = 160
pri = "12.5 ms"
centre = "9.6 GHz"
bandwidth = "300 MHz"
samples = 160

[platform]
kind = "linear"
position = "{position}"
velocity = "{velocity}"
"#
    )
}

const SOUTH: [&str; 2] = ["60, -480, 350 km", "7500, 0, 0 m/s"];

/// Simulates the scene as `space.cphd`.
fn simulate(at: &Path, [position, velocity]: [&str; 2]) {
    write_recording(at, "space", scene(position, velocity));
}

fn focus(at: &Path, name: &str, grid: &str) {
    run(at, &format!("focus space.cphd --grid {grid} --out {name}")).succeeded();
}

fn compared(at: &Path, pair: &str) -> Value {
    let ran = run(at, &format!("compare {pair} --json"));
    serde_json::from_str(ran.succeeded()).unwrap()
}

fn error_db(of: &Value) -> f64 {
    of["error_db"].as_f64().unwrap_or(f64::NEG_INFINITY)
}

fn notes(of: &Value) -> String {
    of["notes"].to_string()
}

/// The grid is longer than wide and not centred, so that a pixel at a wrong position cannot have its neighbour's value.
const GRID: &str = "x=-20:12:0.4,y=-16:20:0.25";

#[test]
fn image_and_its_sicd_are_equal_from_every_direction() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    // Rows of a SICD point away from the radar, so all four orientations occur.
    let mut turns = std::collections::BTreeSet::new();
    for views in [
        SOUTH,
        ["60, 480, 350 km", "-7500, 0, 0 m/s"],
        ["480, 60, 350 km", "0, 7500, 0 m/s"],
        ["-480, 60, 350 km", "0, -7500, 0 m/s"],
    ] {
        simulate(at, views);
        focus(at, "image", GRID);
        run(at, "export image -o image.nitf").succeeded();
        for pair in ["image image.nitf", "image.nitf image"] {
            let of = compared(at, pair);
            assert_eq!(error_db(&of), f64::NEG_INFINITY, "{of}");
            assert_eq!(of["correlation"], 1.0, "{of}");
            assert_eq!(of["values"], "complex");
            assert_eq!(of["pixels"], 80 * 144);
            turns.insert(notes(&of).split(" is ").nth(1).unwrap().to_owned());
        }
    }
    assert!(turns.len() >= 3, "{turns:?}");
}

/// One sample of the SICD is replaced by zero: the error is that sample's share of the energy, by definition.
#[test]
fn error_of_changed_sicd_sample_is_its_share_of_energy() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    simulate(at, SOUTH);
    focus(at, "image", GRID);
    run(at, "export image -o image.nitf").succeeded();
    let mut file = File::options()
        .read(true)
        .write(true)
        .open(at.join("image.nitf"))
        .unwrap();
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes).unwrap();
    // Samples are the longest part of the file, float32 pairs; header and XML are elsewhere.
    let text = |range: std::ops::Range<usize>| String::from_utf8_lossy(&bytes[range]).into_owned();
    let header: usize = text(354..360).parse().unwrap();
    let image_header: usize = text(363..369).parse().unwrap();
    let samples: usize = text(369..379).parse().unwrap();
    assert_eq!(samples, 8 * 80 * 144);
    let first = header + image_header;
    let number = |at: usize| {
        let bytes: [u8; 4] = bytes[at..at + 4].try_into().unwrap();
        f64::from(f32::from_be_bytes(bytes))
    };
    let power = |i: usize| number(first + 8 * i).powi(2) + number(first + 8 * i + 4).powi(2);
    let all: f64 = (0..samples / 8).map(power).sum();
    let brightest = (0..samples / 8)
        .max_by(|&a, &b| power(a).total_cmp(&power(b)))
        .unwrap();
    let expected_db = 10.0 * (power(brightest) / all).log10();
    file.seek(SeekFrom::Start((first + 8 * brightest) as u64))
        .unwrap();
    file.write_all(&[0; 8]).unwrap();
    drop(file);
    let of = compared(at, "image.nitf image");
    // Sums of float64 over 11520 pixels.
    assert!((error_db(&of) - expected_db).abs() < 1e-6, "{of}");
}

#[test]
fn products_on_different_grids_are_compared_on_pixels_of_the_second() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    simulate(at, SOUTH);
    focus(at, "a", GRID);
    focus(at, "b", "x=-20:20:0.2,y=-16:16:0.2");
    focus(at, "turned", "x=-12:12:0.3,y=-12:12:0.22,yaw=33");
    focus(at, "polar", "r=4:12:0.2,theta=20:80:1");
    focus(at, "part", "x=-10:10:0.4,y=-8:8:0.25");
    // The error of each image against the sum and that of resampling, at most -60 dB: in amplitude 1.0e-3 each, together -50.4 dB.
    for pair in ["a b", "b a", "a turned", "turned a", "turned b", "b polar"] {
        let of = compared(at, pair);
        assert!(error_db(&of) < -50.4, "{pair}: {of}");
        assert!(of["pixels"].as_u64().unwrap() > 500, "{pair}: {of}");
        assert!(notes(&of).contains("resampled"), "{pair}: {of}");
        assert_eq!(of["values"], "complex");
    }
    // Common pixels are not resampled. The images are formed separately, each to -60 dB: together -54 dB.
    let of = compared(at, "a part");
    assert!(error_db(&of) < -54.0, "{of}");
    assert!(!notes(&of).contains("resampled"), "{of}");
    let of = compared(at, "part a");
    assert_eq!(
        (&of["pixels"], &of["of_pixels"]),
        (&3200.into(), &(80 * 144).into())
    );
    let printed = run(at, "compare part a");
    assert!(
        printed.succeeded().contains("3200 of 11520 pixels"),
        "{printed:?}"
    );
}

#[test]
fn images_of_other_surfaces_and_places_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    simulate(at, SOUTH);
    focus(at, "low", GRID);
    focus(at, "high", &format!("{GRID},z=1"));
    focus(at, "beside", "x=100:120:0.4,y=-16:20:0.25");
    run(at, "compare low high").failed(
        1,
        &["low and high", "different surfaces", "up to 1 m apart"],
    );
    run(at, "compare low beside").failed(1, &["different places"]);
    // The same local grid at another position on the Earth.
    run(at, "export low --place 52,4,0 -o here.nitf").succeeded();
    run(at, "export low --place 52,5,0 -o there.nitf").succeeded();
    run(at, "compare here.nitf there.nitf").failed(1, &["here.nitf and there.nitf", "different"]);
    // An array has no position: it is compared by its shape, and the output states this.
    let of = compared(at, "low low/image.npy");
    assert_eq!(error_db(&of), f64::NEG_INFINITY);
    assert!(notes(&of).contains("by row and column alone"), "{of}");
    run(at, "compare low beside/image.npy").failed(1, &["differ in size", "no metadata"]);
}

#[test]
fn scene_without_position_is_compared_with_its_sicd_after_place_is_given() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("space.toml"), scene(SOUTH[0], SOUTH[1])).unwrap();
    // A description without a position of the scene on the Earth.
    run(at, "simulate space.toml --echoes raw").succeeded();
    let text = fs::read_to_string(at.join("raw/recording.toml")).unwrap();
    let mut within = false;
    let placeless = text.lines().filter(|line| {
        if line.starts_with('[') {
            within = *line == "[scene.origin]";
        }
        !within
    });
    let placeless: Vec<&str> = placeless.collect();
    fs::write(at.join("raw/recording.toml"), placeless.join("\n")).unwrap();
    run(
        at,
        &format!("focus raw/recording.toml --grid {GRID} --out image"),
    )
    .succeeded();
    let exported = run(at, "export image --place 52,4,10 -o image.nitf");
    exported.succeeded();
    run(at, "compare image image.nitf").failed(1, &["no position on the Earth", "--place"]);
    let of = compared(at, "image image.nitf --place 52,4,10");
    assert_eq!(error_db(&of), f64::NEG_INFINITY, "{of}");
}

#[test]
fn sicds_and_maps_on_other_pixels_are_compared_by_their_amplitudes() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    simulate(at, SOUTH);
    focus(at, "a", GRID);
    focus(at, "b", "x=-20:20:0.2,y=-16:16:0.2");
    run(at, "export a -o a.nitf").succeeded();
    run(at, "export b -o b.nitf").succeeded();
    run(at, "export a --layout complex -o complex.tif").succeeded();
    run(at, "export a --layout amplitude -o amplitude.tif").succeeded();
    // The bound is that of the products above.
    for pair in [
        "b.nitf a",
        "a b.nitf",
        "a.nitf b.nitf",
        "a.nitf complex.tif",
    ] {
        let of = compared(at, pair);
        assert!(error_db(&of) < -50.4, "{pair}: {of}");
        assert_eq!(of["values"], "amplitudes", "{pair}");
        assert!(notes(&of).contains("phases"), "{pair}: {of}");
        assert!(of["scale_deg"].is_null() && of["peak_phase_error_deg"].is_null());
    }
    // A complex map of a product contains its phases: it equals the product, and differs from another product by resampling.
    let of = compared(at, "a complex.tif");
    assert_eq!(error_db(&of), f64::NEG_INFINITY, "{of}");
    assert_eq!(of["values"], "complex");
    let of = compared(at, "complex.tif b");
    assert_eq!(of["values"], "complex");
    let of = compared(at, "a amplitude.tif");
    assert!(error_db(&of) < -120.0, "{of}");
    assert_eq!(of["values"], "amplitudes");
    assert!(notes(&of).contains("detected"), "{of}");
}

/// Levels are rounded to steps of the span over 255: an amplitude is off by at most half a step.
#[test]
fn detected_images_are_compared_within_their_levels() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    simulate(at, SOUTH);
    focus(at, "a", GRID);
    focus(at, "b", "x=-20:20:0.2,y=-16:16:0.2");
    run(
        at,
        "export a --format sidd --remap db --span 50 -o a.sidd.nitf",
    )
    .succeeded();
    run(at, "export a --span 50 -o a.tif").succeeded();
    run(at, "export a -o a.nitf").succeeded();
    // Half a step of 50 dB / 254 as a share of the amplitude, and -54 dB for resampling.
    let most_db = 20.0 * (10f64.powf(0.5 * 50.0 / 254.0 / 20.0) - 1.0 + 2e-3).log10();
    for pair in [
        "a a.sidd.nitf",
        "a.sidd.nitf a",
        "b a.sidd.nitf",
        "a.nitf a.sidd.nitf",
        "a a.tif",
    ] {
        let of = compared(at, pair);
        assert!(error_db(&of) < most_db, "{pair}: {of}, {most_db}");
        // Without any rounding the file would be a different one.
        assert!(error_db(&of) > -60.0, "{pair}: {of}");
        assert_eq!(of["values"], "amplitudes", "{pair}");
        assert!(
            notes(&of).contains("limited to the detected image's levels"),
            "{of}"
        );
    }
    run(at, "compare a.sidd.nitf a.tif").failed(1, &["detected images on different pixels"]);
    // Pixels of 8 bits without a stated scale are not amplitudes.
    let bytes = fs::read(at.join("a.sidd.nitf")).unwrap();
    let foreign = String::from_utf8_lossy(&bytes).into_owned();
    let start = foreign.find("black_db").map(|_| ());
    assert_eq!(start, Some(()));
    let mut bytes = bytes;
    let name = b"\"black_db\"";
    let found = bytes.windows(name.len()).position(|w| w == name).unwrap();
    bytes[found + 1] = b'x';
    fs::write(at.join("foreign.nitf"), bytes).unwrap();
    run(at, "compare a foreign.nitf").failed(1, &["grey levels", "no stated scale"]);
}

#[test]
fn stacks_and_products_in_progress_are_compared_where_they_have_pixels() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    simulate(at, SOUTH);
    focus(at, "a", GRID);
    focus(at, "b", "x=-20:20:0.2,y=-16:16:0.2");
    run(at, "export a -o one.zarr").succeeded();
    run(at, "export a a/../a -o two.zarr").succeeded();
    for pair in [
        "a one.zarr",
        "one.zarr a",
        "a two.zarr:1",
        "a one.zarr/image",
    ] {
        assert_eq!(error_db(&compared(at, pair)), f64::NEG_INFINITY, "{pair}");
    }
    let of = compared(at, "b one.zarr");
    assert!(error_db(&of) < -54.0, "{of}");
    run(at, "compare a two.zarr").failed(1, &["expected one image, found 2", "two.zarr", ":0"]);
    run(at, "compare a two.zarr:2").failed(1, &["expected an image number below 2, found 2"]);

    // One of the tiles of the same image.
    let line = format!("plan focus space.cphd --grid {GRID} --scratch 64K --out plan.json");
    run(at, &line).succeeded();
    run(
        at,
        "focus space.cphd --plan plan.json --tiles 1/3 --out growing",
    )
    .succeeded();
    let of = compared(at, "growing a");
    let pixels = of["pixels"].as_u64().unwrap();
    assert!(pixels > 1000 && pixels < 80 * 144, "{of}");
    // Both images are formed to -66 dB.
    assert!(error_db(&of) < -60.0, "{of}");
    assert!(notes(&of).contains("not recorded yet"), "{of}");
    run(at, "compare growing b").failed(1, &["growing", "incomplete"]);
}
