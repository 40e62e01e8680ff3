//! Recordings of several channels: listed, one selected, or their coherent sum.

use std::fs;
use std::path::Path;

use serde_json::Value;
use subaperture_tests::subap::{run, write_recording};

const MIMO: &str = r#"name = "array"

[[scene.point]]
position = "3, 4, 0 m"

[radar]
kind = "ideal"
pulses = 256
pri = "1 ms"
centre = "10 GHz"
bandwidth = "200 MHz"
samples = 64

[[radar.transmitter]]
[[radar.transmitter]]
offset = "0, 0, 20 cm"

[[radar.receiver]]
[[radar.receiver]]
name = "aft"
offset = "-30, 0, 0 cm"

[platform]
kind = "linear"
position = "0, -800, 300 m"
velocity = "100, 0, 0 m/s"
"#;

const GRID: &str = "--grid x=0:6:0.25,y=1:7:0.25";

fn mimo() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("mimo.toml"), MIMO).unwrap();
    run(folder.path(), "simulate mimo.toml -o mimo.cphd").succeeded();
    folder
}

fn record(folder: &Path, image: &str) -> Value {
    let text = fs::read(folder.join(image).join("image.json")).unwrap();
    serde_json::from_slice(&text).unwrap()
}

fn names(record: &Value) -> Vec<&str> {
    let channels = record["collection"]["channels"].as_array().unwrap();
    let names = channels.iter().map(|channel| channel["name"].as_str());
    names.map(Option::unwrap).collect()
}

#[test]
fn coherent_sum_of_channels_is_one_image_whose_record_names_them() {
    let folder = mimo();
    let at = folder.path();
    // 1001 x 576 pixels: all are compared with the exact sum.
    run(
        at,
        &format!("focus mimo.cphd --channels all --check 1001 --out all {GRID}"),
    )
    .succeeded();
    let all = record(at, "all");
    assert_eq!(names(&all), ["T1R1", "T1R2", "T2R1", "T2R2"]);
    assert_eq!(all["collection"]["num_pulses"], 512);
    assert_eq!(all["settings"]["given"]["channels"], "all");
    assert!(all["check"]["relative_rms_db"].as_f64().unwrap() < -60.0);
    // The scatterer of 1 m^2 has amplitude 1, as with one channel.
    assert!(all["brightest"]["level_db"].as_f64().unwrap().abs() < 0.05);
    let position = &all["brightest"]["position_m"];
    assert_eq!((&position[0], &position[1]), (&3.0.into(), &4.0.into()));
    // Some channels, by name and by number.
    run(
        at,
        &format!("focus mimo.cphd --channels T1R1,4 --out some {GRID}"),
    )
    .succeeded();
    assert_eq!(names(&record(at, "some")), ["T1R1", "T2R2"]);
    // One channel; by default the reference channel, which is the first.
    run(at, &format!("focus mimo.cphd --channel 1 --out one {GRID}")).succeeded();
    run(at, &format!("focus mimo.cphd --out reference {GRID}")).succeeded();
    assert_eq!(names(&record(at, "one")), ["T1R1"]);
    assert!(
        run(at, "compare one reference")
            .succeeded()
            .contains("error   none")
    );
    assert!(
        !run(at, "compare one all")
            .succeeded()
            .contains("error   none")
    );
    // A plan for all channels is executed on all of them with the same bits, and refused on others.
    run(
        at,
        &format!("plan focus mimo.cphd --channels all -o plan.json {GRID}"),
    )
    .succeeded();
    run(
        at,
        "focus mimo.cphd --channels all --plan plan.json --out tiled",
    )
    .succeeded();
    assert!(
        run(at, "compare tiled all")
            .succeeded()
            .contains("error   none")
    );
    let other = run(
        at,
        "focus mimo.cphd --channel 2 --plan plan.json --out other",
    );
    other.failed(1, &["plan"]);
    // An image of all channels is measured on all channels.
    run(at, "quality all --from mimo.cphd").succeeded();
    // A former that the user names but that cannot keep its bound forms the image and warns.
    let missed = run(at, "focus mimo.cphd -a omega-k --channels all --out no");
    missed.failed(3, &["--error-db"]);
}

#[test]
fn info_lists_channels_with_their_geometry() {
    let folder = mimo();
    let ran = run(folder.path(), "info mimo.cphd");
    let text = ran.succeeded();
    for part in [
        "T1R1: 128 vectors of 64 samples (reference)",
        // Band from the first frequency to the last; midpoints of antennas in the frame of a track eastwards.
        "T1R2: 128 vectors of 64 samples, 196.875 MHz about 9.99844 GHz, antennas x -0.1500 m, y 0.0000 m, z 0.0000 m from those \
         of T1R1",
        // One cycle of transmitters later: 1 ms at 100 m/s.
        "x 0.1000 m, y 0.0000 m, z 0.1000 m from those of T1R1",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
    let ran = run(folder.path(), "info mimo.cphd --channels all --json");
    let about: Value = serde_json::from_str(ran.succeeded()).unwrap();
    assert_eq!(about["channels"][3]["name"], "T2R2");
    assert_eq!(about["num_pulses"], 512);
    let offset = about["containers"][0]["channels"][1]["offset_m"][0].as_f64();
    assert!((offset.unwrap() + 0.15).abs() < 1e-6, "{offset:?}");
}

#[test]
fn echoes_have_a_description_for_each_antenna_pair() {
    let folder = mimo();
    let at = folder.path();
    run(at, "simulate mimo.toml --echoes raw").succeeded();
    // The description of each pair is a recording of one channel.
    run(
        at,
        &format!("focus raw/recording-T2R2.toml --channel T1R1 --out pair {GRID}"),
    )
    .succeeded();
    let wrong = run(
        at,
        &format!("focus raw/recording-T2R2.toml --channel T2R2 --out no {GRID}"),
    );
    wrong.failed(1, &["unknown channel 'T2R2'", "T1R1"]);
}

#[test]
fn incompatible_channels_are_refused() {
    let folder = mimo();
    let at = folder.path();
    let refuse = |line: &str, code: i32, parts: &[&str]| {
        run(at, &format!("{line} --out no")).failed(code, parts);
        assert!(!at.join("no").exists());
    };
    refuse(
        "focus mimo.cphd --channels T1R1,T3R1",
        1,
        &["unknown channel 'T3R1'", "T1R1, T1R2, T2R1, T2R2"],
    );
    refuse(
        "focus mimo.cphd --channels T1R1,1",
        1,
        &["duplicate channel 'T1R1'"],
    );
    refuse("focus mimo.cphd --channels T1R1,", 2, &["--channels"]);
    refuse(
        "focus mimo.cphd --channels all --channel T1R1",
        2,
        &["--channel"],
    );
    refuse("focus mimo.cphd mimo.cphd --channels all", 1, &["share"]);
    run(at, "plan module --ram 512K mimo.cphd --channels all").failed(2, &["--channel "]);
    // An incomplete last cycle gives the transmitters different numbers of pulses.
    let text = MIMO.replace("pulses = 256", "pulses = 255");
    write_recording(at, "odd", text);
    refuse(
        "focus odd.cphd --channels all",
        1,
        &["'T1R1' has 128 pulses, but channel 'T2R1' has 127"],
    );
    run(
        at,
        "focus odd.cphd --channels T2R1,T2R2 --out two --grid x=0:6:0.5,y=1:7:0.5",
    )
    .succeeded();
    let about = run(at, "info odd.cphd");
    assert!(about.succeeded().contains("not side by side"), "{about:?}");
}
