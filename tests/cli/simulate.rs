//! `subap simulate` on scenarios: its files, and its errors on invalid ones.

use std::fs;
use std::path::Path;
use std::sync::OnceLock;

use proptest::prelude::*;
use subaperture::phase_history::PhaseHistory;
use subaperture::prelude::Complex32;
use subaperture::simulate::scenario::{Scenario, examples};
use subaperture_tests::subap::{command, listing, run};

const SOUND: &str = r#"name = "small"
seed = 7

[scene]
x = "-20, 20 m"
y = "-20, 20 m"

[[scene.point]]
position = "3, 4, 0 m"

[radar]
kind = "ideal"
pulses = 32
pri = "1 ms"
centre = "10 GHz"
bandwidth = "200 MHz"
samples = 64

[radar.noise]
power = "-10 dB"

[platform]
kind = "linear"
position = "0, -5, 3 km"
velocity = "100, 0, 0 m/s"
"#;

/// Replace `old` by `new` in a valid scenario and assert that the command fails with the error at `place` (line and column), shows the line
/// with a caret in that column, contains `part`, and writes no file.
#[track_caller]
fn refuse(old: &str, new: &str, place: (usize, usize), part: &str) {
    assert!(SOUND.contains(old), "{old}");
    let folder = tempfile::tempdir().unwrap();
    let text = SOUND.replacen(old, new, 1);
    fs::write(folder.path().join("bad.toml"), &text).unwrap();
    let before = listing(folder.path());
    let ran = run(folder.path(), "simulate bad.toml -o out.cphd");
    let head = format!("bad.toml:{}:{}: ", place.0, place.1);
    ran.failed(1, &[&head, part]);
    let lines: Vec<&str> = ran.stderr.lines().collect();
    let at = lines.iter().position(|line| line.contains(&head)).unwrap();
    let source = text.lines().nth(place.0 - 1).unwrap_or_default();
    let margin = format!("  {} | ", place.0);
    assert_eq!(
        lines[at + 1].trim_end(),
        format!("{margin}{source}").trim_end()
    );
    let caret = lines[at + 2].find('^').unwrap();
    assert_eq!(caret, margin.len() + place.1 - 1, "{}", ran.stderr);
    assert_eq!(listing(folder.path()), before);
}

#[test]
fn every_kind_of_error_states_its_position() {
    refuse("seed = 7", "seed = = 7", (2, 8), "not TOML");
    refuse("seed = 7", "seed = 7\nseed = 8", (3, 1), "duplicate key");
    refuse(
        "pulses = 32",
        "pulse = 32",
        (13, 1),
        "did you mean 'pulses'?",
    );
    refuse("[radar]", "[radra]", (11, 2), "did you mean 'radar'?");
    refuse(
        "seed = 7",
        "seed = 7\ncentre = \"1 GHz\"",
        (3, 1),
        "[radar]",
    );
    refuse("pulses = 32\n", "", (11, 1), "[radar] needs 'pulses'");
    refuse("\"1 ms\"", "\"1 mss\"", (14, 7), "did you mean 'ms'?");
    refuse(
        "\"1 ms\"",
        "\"1 m\"",
        (14, 7),
        "expected a time, found a length",
    );
    refuse("\"1 ms\"", "\"1\"", (14, 7), "has no unit");
    refuse("\"1 ms\"", "0.001", (14, 7), "without a unit");
    refuse("\"1 ms\"", "\"0 ms\"", (14, 7), "must be above 0");
    refuse("\"1 ms\"", "\"-1 ms\"", (14, 7), "must be above 0");
    refuse("\"1 ms\"", "true", (14, 7), "expected a time");
    refuse(
        "pulses = 32",
        "pulses = 0",
        (13, 10),
        "expected a whole number, 1 to",
    );
    refuse(
        "pulses = 32",
        "pulses = \"32\"",
        (13, 10),
        "a whole number without a unit",
    );
    refuse(
        "pulses = 32",
        "pulses = 99999999999999999999",
        (13, 10),
        "too large",
    );
    refuse("\"ideal\"", "\"idael\"", (12, 8), "did you mean \"ideal\"?");
    refuse("\"3, 4, 0 m\"", "\"3, 4 m\"", (9, 12), "found 2 quantities");
    refuse(
        "\"-20, 20 m\"",
        "\"20, -20 m\"",
        (5, 5),
        "expected the lower limit before the upper one",
    );
    refuse("x = \"-20, 20 m\"\n", "", (5, 5), "y is given without x");
    refuse("[[scene.point]]", "[scene.point]", (8, 8), "two brackets");
    refuse(
        "samples = 64",
        "samples = 64\nsweep = \"up\"",
        (18, 1),
        "does not apply to kind = \"ideal\"",
    );
    refuse("seed = 7", "seed = 1979-05-27", (2, 8), "'seed' is a date");
    refuse(
        "\"0, -5, 3 km\"",
        "\"0, 0, 0 km\"",
        (22, 1),
        "inside the scene",
    );
    refuse(
        "\"100, 0, 0 m/s\"",
        "\"0, 0, 0 m/s\"",
        (22, 1),
        "no aperture",
    );
}

#[test]
fn all_errors_are_reported_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let text = SOUND
        .replace("\"1 ms\"", "\"1 m\"")
        .replace("pulses = 32", "pulse = 32");
    fs::write(folder.path().join("bad.toml"), text).unwrap();
    let ran = run(folder.path(), "simulate bad.toml -o out.cphd");
    ran.failed(
        1,
        &["bad.toml:11:1: ", "bad.toml:13:1: ", "bad.toml:14:7: "],
    );
}

#[test]
fn settings_override_and_their_errors_name_them() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.toml"), SOUND).unwrap();
    let set = |setting: &str| {
        let words = ["simulate", "a.toml", "-o", "out.cphd", "--set", setting];
        let output = command(folder.path(), words).output().unwrap();
        subaperture_tests::subap::Ran::from(output)
    };
    set("radar.pri = 0.5 mss").failed(1, &["--set radar.pri=0.5 mss: unit 'mss'", "'ms'"]);
    set("radar.pry=1 ms").failed(1, &["--set radar.pry=1 ms", "did you mean 'radar.pri'?"]);
    set("scene.point[3].position=1, 2, 3 m").failed(1, &["from 0 to 1"]);
    set("radar.pri=0 s").failed(1, &["--set radar.pri=0 s: 'pri' must be above 0"]);
    assert!(!folder.path().join("out.cphd").exists());
    let ran = set("radar.pulses=20");
    assert!(
        ran.succeeded().contains("20 pulses of 64 frequencies"),
        "{ran:?}"
    );
    run(folder.path(), "info out.cphd").succeeded();
}

#[test]
fn missing_and_unreadable_files_are_named() {
    let folder = tempfile::tempdir().unwrap();
    run(folder.path(), "simulate none.toml -o out.cphd").failed(1, &["none.toml", "No such file"]);
    fs::write(folder.path().join("latin.toml"), b"name = \"\xe4\"\n").unwrap();
    run(folder.path(), "simulate latin.toml -o out.cphd").failed(1, &["latin.toml", "UTF-8"]);
    let csv = SOUND.replace(
        "kind = \"linear\"\nposition = \"0, -5, 3 km\"\nvelocity = \"100, 0, 0 m/s\"",
        "kind = \"csv\"\nfile = \"track.csv\"",
    );
    // Paths are relative to the scenario's folder, not to the working directory.
    fs::create_dir(folder.path().join("sub")).unwrap();
    fs::write(folder.path().join("sub/csv.toml"), csv).unwrap();
    run(folder.path(), "simulate sub/csv.toml -o out.cphd")
        .failed(1, &["sub/csv.toml:24:8: ", "sub/track.csv", "No such file"]);
    let csv = "time_s,x_m,y_m,z_m\n0,-2,-5000,3000\n0.03,1,-5000,3000\n0.06,4,-5000,3000\n";
    fs::write(folder.path().join("sub/track.csv"), csv).unwrap();
    run(folder.path(), "simulate sub/csv.toml -o out.cphd").succeeded();
}

#[test]
fn same_seed_gives_same_bytes_on_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.toml"), SOUND).unwrap();
    let bytes = |options: &str| {
        run(
            folder.path(),
            &format!("simulate a.toml -o out.cphd {options}"),
        )
        .succeeded();
        fs::read(folder.path().join("out.cphd")).unwrap()
    };
    let one = bytes("--threads 1");
    assert!(one == bytes("--threads 2"));
    assert!(one == bytes("--threads 2 --seed 7"));
    assert!(one != bytes("--seed 8"));
}

#[test]
fn antenna_pairs_are_channels() {
    let folder = tempfile::tempdir().unwrap();
    let antennas = "[[radar.transmitter]]\noffset = \"1, 0, 0 m\"\n[[radar.transmitter]]\n\
        [[radar.receiver]]\n[[radar.receiver]]\noffset = \"0, 0, 10 cm\"\n";
    let text = SOUND.replace("[radar.noise]", &format!("{antennas}[radar.noise]"));
    fs::write(folder.path().join("mimo.toml"), text).unwrap();
    let ran = run(folder.path(), "simulate mimo.toml -o mimo.cphd");
    for id in ["T1R1", "T1R2", "T2R1", "T2R2"] {
        // Two transmitters alternate over 32 pulses.
        let line = format!("mimo.cphd {id}: 16 pulses of 64 frequencies");
        assert!(ran.succeeded().contains(&line), "{ran:?}");
        let about = run(folder.path(), &format!("info mimo.cphd --channel {id}"));
        assert!(
            about.succeeded().contains("16 pulses of 64 frequencies"),
            "{about:?}"
        );
    }
}

#[test]
fn elevation_model_casts_shadow_in_recording() {
    // A tile of 1201 x 1201 heights (90 m apart along latitude) with a wall of 400 m in one row, 2 km to the south of the scene.
    let folder = tempfile::tempdir().unwrap();
    let wall = 600 + (2000.0 / (111_195.0 / 1200.0)) as usize;
    let heights = (0..1201 * 1201).flat_map(|i| {
        let height: i16 = if i / 1201 == wall { 400 } else { 0 };
        height.to_be_bytes()
    });
    fs::write(
        folder.path().join("N52E004.hgt"),
        heights.collect::<Vec<u8>>(),
    )
    .unwrap();
    let scenario = |height: &str, terrain: &str| {
        let text = format!(
            r#"
            [scene]
            x = "-3000, 3000 m"
            y = "-3000, 3000 m"
            [scene.origin]
            latitude = "52.5 deg"
            longitude = "4.5 deg"
            {terrain}
            [[scene.clutter]]
            x = "-50, 50 m"
            y = "-50, 50 m"
            count = 100
            sigma0 = "0 dB"
            [radar]
            kind = "ideal"
            pulses = 4
            pri = "1 ms"
            centre = "10 GHz"
            bandwidth = "10 MHz"
            samples = 64
            [platform]
            kind = "linear"
            position = "0, -20000, {height} m"
            velocity = "100, 0, 0 m/s"
            "#
        );
        let experiment = Scenario::new("dem.toml", text, folder.path()).experiment();
        let experiment = experiment.unwrap_or_else(|error| panic!("{error}"));
        let recording = experiment.record(experiment.pairs()[0]).unwrap();
        let mut samples = vec![Complex32::ZERO; 4 * 64];
        recording.read(0..4, &mut samples).unwrap();
        samples.iter().map(|z| z.norm_sqr()).sum::<f32>()
    };
    let terrain = "[scene.terrain]\nkind = \"file\"\nfile = \"N52E004.hgt\"\nspacing = \"30 m\"";
    // The line to the scene passes the wall 2 km before it at a tenth of the radar's height: below 400 m from 3 km, above from 6 km.
    assert_eq!(scenario("3000", terrain), 0.0);
    let seen = scenario("6000", terrain) / scenario("6000", "");
    // Heights of the model are those above the ellipsoid, 3 km from the origin 0.7 m below the plane.
    assert!((seen - 1.0).abs() < 0.1, "{seen}");
}

#[test]
fn simulation_beyond_memory_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.toml"), SOUND).unwrap();
    let line = "simulate a.toml -o out.cphd --threads 2 --memory 28M --set radar.pulses=100000";
    run(folder.path(), line).failed(1, &["100000 pulses", "raise --memory"]);
    assert!(!folder.path().join("out.cphd").exists());
}

#[test]
fn examples_and_keys_are_printed_and_examples_run() {
    let folder = tempfile::tempdir().unwrap();
    let keys = run(folder.path(), "simulate --keys");
    for part in [
        "[radar]",
        "pulses (required, for example 64)",
        "[[scene.mover]]",
        "default \"stop-and-go\"",
    ] {
        assert!(keys.succeeded().contains(part), "{part}");
    }
    let text = run(folder.path(), "simulate --example rail");
    fs::write(folder.path().join("rail.toml"), text.succeeded()).unwrap();
    run(
        folder.path(),
        "simulate rail.toml --set radar.pulses=16 -o rail.cphd",
    )
    .succeeded();
    let about = run(folder.path(), "info rail.cphd");
    assert!(about.succeeded().contains("16 pulses"), "{about:?}");
    run(folder.path(), "simulate --example none").failed(2, &["--example", "spotlight", "rail"]);
    run(folder.path(), "simulate -o out.cphd").failed(2, &["SCENARIO"]);
    run(folder.path(), "simulate rail.toml").failed(2, &["--out"]);
}

/// Read a scenario; any result is accepted, but no panic.
fn survive(text: &str) {
    static EMPTY: OnceLock<tempfile::TempDir> = OnceLock::new();
    let folder: &Path = EMPTY.get_or_init(|| tempfile::tempdir().unwrap()).path();
    let scenario = Scenario::new("any.toml", text, folder);
    if let Err(error) = scenario.experiment() {
        assert!(!error.faults.is_empty());
        for fault in &error.faults {
            assert!(!fault.message.is_empty() && fault.line.is_some(), "{error}");
        }
    }
}

/// Replacements of words in an example: extreme numbers, units, brackets, junk.
fn replacement() -> impl Strategy<Value = String> {
    prop_oneof![
        prop::sample::select(vec![
            "",
            "0",
            "-1",
            "1e300",
            "1e-300",
            "nan",
            "inf",
            "\"",
            "[",
            "]",
            "=",
            ".",
            ",",
            "\n",
            "km",
            "ms",
            "GHz",
            "dB",
            "[[x]]",
            "\u{e4}",
            "\u{0}",
            "'''",
            "{",
            "}",
            "#",
            "9999999999999999999999",
        ])
        .prop_map(str::to_owned),
        "[ -~]{0,6}",
        any::<i32>().prop_map(|number| number.to_string()),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn arbitrary_text_does_not_panic(text in "\\PC{0,200}") {
        survive(&text);
    }

    #[test]
    fn arbitrary_tables_do_not_panic(lines in prop::collection::vec(
        prop_oneof![
            "\\[{1,2}(radar|scene|platform|navigation)(\\.[a-z_]{1,8})?\\]{1,2}",
            "(kind|pri|pulses|x|position|name|seed) = [-\"0-9a-z, .\\[\\]{}]{0,12}",
        ], 0..12)) {
        survive(&lines.join("\n"));
    }

    /// Examples with up to three changed words or numbers, reduced to few pulses unless that was changed.
    #[test]
    fn damaged_examples_do_not_panic(
        // All except the distributed scene, whose points take long to draw.
        example in 0..examples::names().len() - 1,
        damages in prop::collection::vec((any::<prop::sample::Index>(), 0..8usize, replacement()), 1..4),
    ) {
        let mut text = examples::text(examples::names()[example]).unwrap().to_owned();
        for (at, length, new) in damages {
            let places: Vec<usize> = text.char_indices().map(|(place, _)| place).collect();
            let from = at.index(places.len());
            let to = (from + length).min(places.len() - 1);
            text.replace_range(places[from]..places[to], &new);
        }
        survive(&text);
    }
}

/// Nesting as deep as a file allows must not exhaust the stack.
#[test]
fn deep_nesting_is_refused() {
    for text in [
        format!("a = {}", "[".repeat(200_000)),
        format!("a = {}1{}", "[".repeat(100_000), "]".repeat(100_000)),
        format!("{}x = 1", "a.".repeat(100_000)),
        format!("[{}x]", "a.".repeat(100_000)),
    ] {
        survive(&text);
    }
}
