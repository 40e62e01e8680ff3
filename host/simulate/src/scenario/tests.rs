//! Tests of the key table against the builders, and of whole scenarios.

use std::collections::BTreeSet;
use std::fmt::Write;

use num_complex::Complex32;

use super::keys::{SCHEMA, reference};
use super::*;
use subaperture_describe::schema::{Presence, Requirement, Section, ValueType};
use subaperture_model::phase_history::{PhaseHistory, check_finite};

/// Values of a section's selector; one empty string if it has none.
fn variants(section: &Section) -> &'static [&'static str] {
    match section.key(section.selector).map(|key| key.kind) {
        Some(ValueType::Choice(words)) => words,
        _ => &[""],
    }
}

/// Mutually exclusive keys.
const EITHER: &[(&str, &[&str])] = &[
    ("radar", &["pri", "prf"]),
    ("radar.pulse", &["code", "phases"]),
    ("scene", &["reference", "reference_range"]),
    ("scene.clutter", &["density", "count"]),
    ("scene.clutter", &["sigma0", "gamma", "cover"]),
];

/// Write a section as text with the selector at `variant`. With `all`, every key is written, otherwise the required keys; of exclusive keys that
/// with the number `choice`, or the last.
fn write_section(text: &mut String, section: &Section, variant: &str, all: bool, choice: usize) {
    if !section.path.is_empty() {
        let _ = writeln!(text, "{}", section.header());
    }
    for key in &section.keys {
        if !key.when.is_empty() && !key.when.contains(&variant) {
            continue;
        }
        let either = EITHER
            .iter()
            .find(|(path, names)| *path == section.path && names.contains(&key.name));
        let wanted = match either {
            Some((_, names)) => names[choice.min(names.len() - 1)] == key.name,
            None => all || matches!(key.need, Requirement::Required(_)),
        };
        if key.name == section.selector {
            let _ = writeln!(text, "{} = \"{variant}\"", key.name);
        } else if wanted {
            let _ = writeln!(text, "{} = {}", key.name, key.example());
        }
    }
}

/// Scenario with `section` at `variant`, and the required part of all other sections.
fn scenario_with(section: &Section, variant: &str, all: bool, choice: usize) -> String {
    let mut text = String::new();
    for other in &SCHEMA.sections {
        if std::ptr::eq(other, section) {
            write_section(&mut text, section, variant, all, choice);
        } else if other.path == "radar" {
            let kind = if section.path == "radar.pulse" {
                "pulsed"
            } else {
                "ideal"
            };
            write_section(&mut text, other, kind, false, 0);
        } else if other.path == "radar.pulse" {
            if section.path == "radar" && variant == "pulsed" {
                write_section(&mut text, other, "lfm", false, 0);
            }
        } else if other.presence == Presence::Always {
            write_section(&mut text, other, variants(other)[0], false, 0);
        }
    }
    text
}

/// NumPy array of 2 x 3 heights: 0, 1, 2 / 10, 11, 12.
fn heights() -> Vec<u8> {
    let header = "{'descr': '<f8', 'fortran_order': False, 'shape': (2, 3), }";
    let mut bytes = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    bytes.extend(format!("{header:<117}\n").bytes());
    for height in [0.0, 1.0, 2.0, 10.0, 11.0, 12.0f64] {
        bytes.extend(height.to_le_bytes());
    }
    bytes
}

/// Folder with the files named by the examples of keys.
fn files() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let csv = "time_s,x_m,y_m,z_m\n0,-3,-5000,3000\n0.03,0,-5000,3000\n0.06,3,-5000,3000\n";
    std::fs::write(folder.path().join("track.csv"), csv).unwrap();
    let pattern = "azimuth_deg,gain_db\n-5,-3\n0,0\n5,-3\n";
    std::fs::write(folder.path().join("pattern.csv"), pattern).unwrap();
    std::fs::write(
        folder.path().join("track.log"),
        include_str!("inspvaxa.txt"),
    )
    .unwrap();
    // Two by two grey pixels.
    for name in ["picture.png", "cover.png"] {
        let file = std::fs::File::create(folder.path().join(name)).unwrap();
        let mut png = png::Encoder::new(file, 2, 2);
        png.set_color(png::ColorType::Grayscale);
        png.set_depth(png::BitDepth::Eight);
        let mut png = png.write_header().unwrap();
        png.write_image_data(&[0, 85, 170, 255]).unwrap();
    }
    std::fs::write(folder.path().join("heights.npy"), heights()).unwrap();
    folder
}

/// Every key of the table, with every value of its section's selector, makes a valid scenario and is read by a builder:
/// `experiment` asserts this in debug builds, and this test repeats it for others.
#[test]
fn every_key_is_accepted_and_read() {
    let folder = files();
    let mut seen = BTreeSet::new();
    for section in &SCHEMA.sections {
        for variant in variants(section) {
            for (all, choice) in [(false, 0), (true, 0), (true, 1), (true, 2)] {
                let mut text = scenario_with(section, variant, all, choice);
                // The beat frequency of a distant scene exceeds half the sample rate.
                if *variant == "fmcw" {
                    text = text.replace("0, -5, 3 km", "0, -50, 3 m");
                }
                // Terrain has the extent of the scene.
                if section.path.starts_with("scene.terrain") {
                    text = text.replacen(
                        "[scene]\n",
                        "[scene]\nx = \"-9, 9 m\"\ny = \"-9, 9 m\"\n",
                        1,
                    );
                }
                if section.path == "log" {
                    text = format!("collection_start = \"2017-05-04T14:00:00Z\"\n{text}");
                }
                if *variant == "novatel" {
                    text = text.replace("track.csv", "track.log");
                }
                // A log states places on the Earth, which needs the scene's origin.
                if *variant == "novatel" || section.path == "log" {
                    text =
                        text.replace("[scene.origin]\n", "[scene.origin]\nlatitude = \"0 deg\"\n");
                }
                let scenario = Scenario::new("all.toml", &text, folder.path());
                match scenario.experiment() {
                    // The key table of pulses is that of recordings, too.
                    Err(error) if *variant == "recorded" => {
                        let error = error.to_string();
                        assert!(
                            error.contains("applies to descriptions of recordings"),
                            "{error}"
                        );
                    }
                    Err(error) => panic!("{} {variant}: {error}\n{text}", section.path),
                    Ok(_) => assert_ne!(*variant, "recorded"),
                }
                let header = section.header();
                for key in &section.keys {
                    let line = format!("\n{} = ", key.name);
                    let part = match &*section.path {
                        "" => format!("\n{text}"),
                        _ => {
                            let start = text.find(&header).unwrap();
                            let rest = &text[start + header.len()..];
                            rest[..rest.find("\n[").unwrap_or(rest.len())].to_owned()
                        }
                    };
                    if part.contains(&line) {
                        seen.insert((&*section.path, key.name));
                    }
                }
            }
        }
    }
    for section in &SCHEMA.sections {
        for key in &section.keys {
            assert!(
                seen.contains(&(&*section.path, key.name)),
                "{} {}",
                section.path,
                key.name
            );
        }
    }
}

#[test]
fn key_table_is_consistent() {
    let reference = reference();
    let mut paths = BTreeSet::new();
    for section in &SCHEMA.sections {
        assert!(paths.insert(&*section.path), "{} twice", section.path);
        let parent = section.parent();
        assert!(
            parent.is_none_or(|path| paths.contains(path)),
            "{}",
            section.path
        );
        let mut names: BTreeSet<&str> = SCHEMA.within(&section.path).map(Section::name).collect();
        for key in &section.keys {
            assert!(
                names.insert(key.name),
                "{} {} twice",
                section.path,
                key.name
            );
            assert!(key.doc.ends_with('.'), "{}", key.doc);
            let words = variants(section);
            assert!(
                key.when.iter().all(|value| words.contains(value)),
                "{}",
                key.name
            );
            assert!(
                reference.contains(&format!("  {} (", key.name)),
                "{}",
                key.name
            );
        }
    }
    assert!(reference.lines().all(|line| line.chars().count() <= 110));
}

/// Every example, cut to a few pulses, is recorded with finite samples that are not all zero.
#[test]
fn every_example_records_finite_samples() {
    for name in examples::names() {
        let text = examples::text(name).unwrap();
        let whole = Scenario::new(name, text, ".");
        assert_eq!(whole.experiment().unwrap().name, name);
        let mut short = whole.clone();
        short.set("radar.pulses", "6").unwrap();
        short.set("method", "sum").unwrap();
        if name == "distributed" {
            short.set("scene.clutter[0].density", "0.05").unwrap();
            short.set("scene.building[0].spacing", "3 m").unwrap();
        }
        let experiment = short.experiment().unwrap();
        for pair in experiment.pairs() {
            let recording = experiment.record(pair).unwrap();
            let collection = recording.collection();
            let width = collection.num_samples;
            let count = collection.pulses.len();
            assert_eq!(count * experiment.radar.transmitters.len(), 6, "{name}");
            let mut samples = vec![Complex32::ZERO; count * width];
            recording.read(0..count, &mut samples).unwrap();
            check_finite(name, 0, width, &samples).unwrap();
            assert!(samples.iter().any(|z| z.norm() > 1e-3), "{name}");
        }
    }
}

/// Valid scenario.
const SOUND: &str = "\
[radar]
kind = \"pulsed\"
pulses = 64
pri = \"1 ms\"
centre = \"10 GHz\"
sample_rate = \"250 MHz\"
samples = 512
[radar.pulse]
kind = \"lfm\"
bandwidth = \"200 MHz\"
duration = \"1 us\"
[[radar.receiver]]
boresight = \"0, 1, 0\"
[platform]
kind = \"linear\"
position = \"0, -5, 3 km\"
velocity = \"100, 0, 0 m/s\"
";

/// Apply changes to the valid scenario, and check that an error at this line and column contains `part`.
fn refuse(changes: &[(&str, &str)], line: usize, column: usize, part: &str) {
    let mut text = SOUND.to_owned();
    for (old, new) in changes {
        assert!(text.contains(old), "{old}");
        text = text.replace(old, new);
    }
    let error = Scenario::new("a.toml", &text, ".")
        .experiment()
        .unwrap_err();
    let fault = error
        .faults
        .iter()
        .find(|fault| fault.message.contains(part));
    let fault = fault.unwrap_or_else(|| panic!("no '{part}' in: {error}"));
    assert_eq!(
        (fault.line, fault.column),
        (Some(line), Some(column)),
        "{error}"
    );
}

/// Scenario with a scene in front of the valid one, in which the sections of `scene` begin at line 1.
fn with_scene(scene: &str) -> Result<crate::scene::Scene, ScenarioError> {
    let folder = files();
    let text = format!("{scene}\n{SOUND}");
    let built = Scenario::new("a.toml", &text, folder.path()).experiment();
    built.map(|experiment| experiment.scene)
}

#[test]
fn objects_stand_on_the_terrain_of_an_array() {
    // Heights rise by 1 m over 10 m of x and by 10 m over 20 m of y: h = (x + 10) / 10 + (y + 10) / 2.
    let scene = with_scene(
        r#"
        [scene]
        x = "-10, 10 m"
        y = "-10, 10 m"
        [scene.terrain]
        kind = "file"
        file = "heights.npy"
        [[scene.building]]
        position = "2, 4, 0.5 m"
        size = "2, 2, 2 m"
        spacing = "1 m"
        [[scene.tree]]
        position = "-3, 1, 0 m"
        attenuation = "1 dB"
        [[scene.vehicle]]
        position = "0, 0, 0 m"
        [[scene.point]]
        position = "1, 1, 7 m"
        "#,
    )
    .unwrap();
    let height_m = |x: f64, y: f64| (x + 10.0) / 10.0 + (y + 10.0) / 2.0;
    // A foot, half a metre above the ground, and the box's centre a metre above it.
    assert!((scene.blocks[0].centre_m.z - (height_m(2.0, 4.0) + 1.5)).abs() < 1e-3);
    assert!((scene.blocks[1].centre_m.z - (height_m(0.0, 0.0) + 0.75)).abs() < 1e-3);
    assert!((scene.canopies[0].centre_m.z - (height_m(-3.0, 1.0) + 5.0)).abs() < 1e-3);
    assert_eq!(scene.points[0].position_m.z, 7.0);
    // Ground that rises away from the radar hides nothing.
    assert!(scene.terrain_shadow.is_none());
}

#[test]
fn map_divides_clutter_into_classes() {
    // Two by two pixels of the grey levels 0, 85 / 170, 255, the top row at the larger y.
    let patch = |value: u32| {
        let scene = with_scene(&format!(
            r#"
            [[scene.clutter]]
            x = "0, 10 m"
            y = "0, 10 m"
            count = 400
            gamma = "-10 dB"
            map = "cover.png"
            map_value = {value}
            "#
        ));
        scene.unwrap().points
    };
    let upper_right = patch(85);
    assert!(
        (60..140).contains(&upper_right.len()),
        "{}",
        upper_right.len()
    );
    let inside = |p: &crate::Scatterer| p.position_m.x >= 5.0 && p.position_m.y >= 5.0;
    assert!(upper_right.iter().all(inside));
    assert_eq!(
        patch(0).len() + patch(85).len() + patch(170).len() + patch(255).len(),
        400
    );
    assert!(patch(7).is_empty());
}

#[test]
fn impossible_scenes_are_refused_with_advice() {
    let clutter = |keys: &str| {
        format!("[[scene.clutter]]\nx = \"0, 9 m\"\ny = \"0, 9 m\"\ncount = 9\n{keys}")
    };
    let terrain = |keys: &str| {
        format!(
            "[scene]\nx = \"0, 9 m\"\ny = \"0, 9 m\"\n[scene.terrain]\nkind = \"file\"\nfile = \"{keys}\""
        )
    };
    for (scene, part) in [
        (clutter(""), "needs 'sigma0', 'gamma' or 'cover'"),
        (
            clutter("sigma0 = \"0 dB\"\ngamma = \"0 dB\""),
            "expected one of sigma0, gamma and cover",
        ),
        (clutter("cover = \"shrubs\""), "choose a class by gamma"),
        (clutter("sigma0 = \"0 dB\"\nmap = \"no.png\""), "no.png"),
        (terrain("no.npy"), "no.npy"),
        (
            terrain("picture.png"),
            "give latitude and longitude of [scene.origin]",
        ),
        (
            terrain("heights.npy\"\nspacing = \"-1 m"),
            "must be above 0",
        ),
        ("[scene.terrain]\nslope_x = 0.1".to_owned(), "no extent"),
        (
            "[scene]\nx = \"0, 9 m\"\ny = \"0, 9 m\"\n[scene.terrain]\nslope_x = 1e300".to_owned(),
            "height at node",
        ),
        (
            "[[scene.vehicle]]\nposition = \"0, 0, 0 m\"\nsize = \"4, 0, 1 m\"".to_owned(),
            "vehicle",
        ),
        (
            "[[scene.tree]]\nposition = \"0, 0, 0 m\"\nheight = \"1 m\"".to_owned(),
            "crown",
        ),
    ] {
        let error = with_scene(&scene).unwrap_err().to_string();
        assert!(error.contains(part), "{scene}: {error}");
    }
}

#[test]
fn inconsistent_scenarios_are_refused_at_line_and_column() {
    assert!(Scenario::new("a.toml", SOUND, ".").experiment().is_ok());
    refuse(
        &[("\"1 ms\"", "\"500 ns\"")],
        4,
        7,
        "pulse repetition interval of 500",
    );
    refuse(
        &[("\"200 MHz\"", "\"300 MHz\"")],
        10,
        13,
        "exceeds the sample rate of 250",
    );
    refuse(
        &[("\"0, 1, 0\"", "\"0, 0, 0\"")],
        13,
        13,
        "cannot have length zero",
    );
    refuse(
        &[("\"0, 1, 0\"", "\"0, 0, 2\"")],
        12,
        1,
        "no elevation axis",
    );
    refuse(
        &[("\"100, 0, 0 m/s\"", "\"0, 0, 0 m/s\"")],
        14,
        1,
        "no aperture",
    );
    refuse(
        // With 65 pulses, one is in the middle.
        &[
            ("\"0, -5, 3 km\"", "\"0, 0, 0 km\""),
            ("pulses = 64", "pulses = 65"),
        ],
        14,
        1,
        "inside the scene",
    );
    refuse(
        &[("samples = 512", "samples = 512\nwindow_start = \"1 us\"")],
        8,
        16,
        "but the receive window",
    );
    refuse(
        &[("samples = 512", "samples = 200")],
        7,
        11,
        "but the receive window",
    );
}

#[test]
fn invalid_bands_and_rates_are_refused_at_line_and_column() {
    refuse(&[("\"10 GHz\"", "\"10 MHz\"")], 6, 15, "below 0 Hz");
    refuse(
        &[
            ("\"100, 0, 0 m/s\"", "\"9e6, 0, 0 m/s\""),
            ("\"1 ms\"", "\"9e3 s\""),
        ],
        14,
        1,
        "1e9 m",
    );
    refuse(
        &[
            ("\"pulsed\"", "\"fmcw\"\nbandwidth = \"1 GHz\""),
            ("sample_rate = \"250", "sample_rate = \"1"),
            (
                "[radar.pulse]\nkind = \"lfm\"\nbandwidth = \"200 MHz\"\nduration = \"1 us\"\n",
                "",
            ),
        ],
        7,
        15,
        "beyond half the sample rate",
    );
    refuse(&[("pri = \"1 ms\"\n", "")], 1, 1, "[radar] needs 'pri'");
    refuse(
        &[("pri = \"1 ms\"", "pri = \"1 ms\"\nprf = \"1 kHz\"")],
        5,
        7,
        "not both",
    );
}

#[test]
fn velocity_spread_out_of_range_is_refused_at_line_and_column() {
    let clutter = |spread: &str| {
        let keys = "density = 1\nsigma0 = \"-20 dB\"\nx = \"-5, 5 m\"\ny = \"-5, 5 m\"";
        format!(
            "velocity = \"100, 0, 0 m/s\"\n[[scene.clutter]]\n{keys}\nvelocity_spread = {spread}\n"
        )
    };
    let change = |spread: &str, column: usize, part: &str| {
        refuse(
            &[("velocity = \"100, 0, 0 m/s\"\n", &clutter(spread))],
            23,
            column,
            part,
        );
    };
    for spread in ["\"-0.1 m/s\"", "\"101 m/s\""] {
        change(spread, 19, "0 to 100 m/s");
    }
    change("\"1e300 m/s\"", 19, "too large");
    change("\"nan m/s\"", 19, "expected a number, then a unit");
    change("nan", 19, "is a number without a unit");
    change("\"0.1 m\"", 19, "expected a speed, found a length");
}

#[test]
fn logs_without_date_origin_or_own_name_are_refused_at_line_and_column() {
    const DATE: (&str, &str) = (
        "[radar]\n",
        "collection_start = \"2017-05-04T14:00:00Z\"\n[radar]\n",
    );
    let speed = "velocity = \"100, 0, 0 m/s\"\n";
    let logs = |origin: &str, logs: &[&str]| {
        let logs: String = logs.iter().map(|log| format!("[[log]]\n{log}\n")).collect();
        format!("{speed}{origin}{logs}")
    };
    let log = "file = \"a.log\"\nformat = \"nmea\"";
    let origin = "[scene.origin]\nlatitude = \"40 deg\"\n";
    let sound = SOUND
        .replace(DATE.0, DATE.1)
        .replace(speed, &logs(origin, &[log]));
    let experiment = Scenario::new("a.toml", &sound, ".").experiment().unwrap();
    assert_eq!(experiment.logs.len(), 1);
    refuse(&[(speed, &logs(origin, &[log]))], 20, 1, "collection_start");
    refuse(&[DATE, (speed, &logs("", &[log]))], 19, 1, "[scene.origin]");
    let wrong_date = ("[radar]\n", "collection_start = \"yesterday\"\n[radar]\n");
    refuse(&[wrong_date], 1, 20, "expected a date");
    refuse(
        &[DATE, (speed, &logs(origin, &[log, log]))],
        25,
        8,
        "two navigation logs",
    );
    for name in ["../a.log", "/a.log", "a/b.log", ".."] {
        let other = log.replace("a.log", name);
        refuse(
            &[DATE, (speed, &logs(origin, &[&other]))],
            22,
            8,
            "without folders",
        );
    }
    let outage = format!("{log}\noutages = [\"2 s, 1 s\"]");
    refuse(
        &[DATE, (speed, &logs(origin, &[&outage]))],
        24,
        11,
        "end of an outage",
    );
    let drift = format!("{log}\ndrift = \"5 mm/s^2\"");
    refuse(
        &[DATE, (speed, &logs(origin, &[&drift]))],
        24,
        9,
        "without inertial sensors",
    );
    let fast = format!("{log}\nrate = \"1001 Hz\"");
    refuse(&[DATE, (speed, &logs(origin, &[&fast]))], 24, 8, "1000 Hz");
    let fast = format!("{log}\nrate = \"1000 Hz\"");
    let long = ("pri = \"1 ms\"", "pri = \"1000 s\"");
    let many = (speed, &*logs(origin, &[&fast]));
    refuse(&[DATE, long, many], 24, 8, "at most 10000000");
}
