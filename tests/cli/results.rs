//! Results of the commands on simulated data and, if present, on real data.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;
use subaperture::io::cphd::{Channel, WriteOptions, write};
use subaperture::monitor::Silent;
use subaperture::phase_history::{InMemory, PhaseHistory};
use subaperture::simulate::{Preset, Variation};
use subaperture_tests::experiment::read_whole;
use subaperture_tests::matlab;
use subaperture_tests::subap::{listing, root, run};

fn json(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

/// The real GOTCHA files; `None` with a message if they are missing.
fn gotcha() -> Option<Vec<PathBuf>> {
    let files: Vec<PathBuf> = ["az001", "az002"]
        .iter()
        .map(|azimuth| {
            root().join(format!(
                "../shared/data/gotcha/data_3dsar_pass1_{azimuth}_HH.mat"
            ))
        })
        .collect();
    for file in &files {
        if !file.exists() {
            println!("skipped: {} not found", file.display());
            return None;
        }
    }
    Some(files)
}

fn words(files: &[PathBuf]) -> String {
    files
        .iter()
        .map(|file| file.display().to_string())
        .collect::<Vec<_>>()
        .join(" ")
}

/// The number after `label` in `text`.
fn number_after(text: &str, label: &str) -> f64 {
    let rest = text
        .split_once(label)
        .unwrap_or_else(|| panic!("no '{label}' in {text}"))
        .1;
    rest.split_whitespace().next().unwrap().parse().unwrap()
}

/// Assert that every number of a crosscheck is within its bound.
fn assert_crosscheck(text: &str) {
    let float_db = number_after(text, "core, float32: ");
    let fixed_db = number_after(text, "core, fixed point: ");
    let rdbp_db = number_after(text, "host, rdbp: ");
    let bound_db = number_after(text, "its plan's bound: ");
    assert!(float_db <= -100.0 && fixed_db <= -60.0, "{text}");
    // 40 pulses are given rather than planned: on a track with half a metre of sway the error is -59.8 dB.
    assert!(rdbp_db <= bound_db && bound_db <= -59.0, "{text}");
}

/// A recording whose first pulse is 70 dB above the others: scaled to its largest sample, 16 bits represent the others too coarsely.
#[test]
fn crosscheck_exits_3_and_names_exceeded_bound() {
    let folder = tempfile::tempdir().unwrap();
    let history = Preset::Table41.simulate(&Variation::default());
    let collection = history.collection().clone();
    let width = collection.num_samples;
    let mut samples = read_whole(&history);
    samples[width..].iter_mut().for_each(|z| *z *= 3e-4);
    let loud = InMemory::new(collection, samples).unwrap();
    let channels = [Channel::new("1", &loud)];
    let path = folder.path().join("loud.cphd");
    write(&path, &channels, &WriteOptions::default(), &Silent).unwrap();
    run(folder.path(), "crosscheck loud.cphd").failed(
        3,
        &[
            "core, fixed point: error of -",
            "above the bound of -60 dB",
            "too weak for 16-bit",
        ],
    );
    let ran = run(folder.path(), "crosscheck loud.cphd --json");
    assert_eq!(ran.code, Some(3));
    let report: Value = serde_json::from_str(&ran.stdout).unwrap();
    assert_eq!(report["within_bound"], false);
    assert!(report["float"]["worst_db"].as_f64().unwrap() <= -100.0);
    assert!(report["fixed"]["worst_db"].as_f64().unwrap() > -60.0);
    assert!(report["fixed"]["worst_sub_cpi"].as_u64().unwrap() > 0);
    assert_eq!(report["compared"].as_array().unwrap().len(), 26);
    for compared in report["compared"].as_array().unwrap() {
        let db = |key: &str| compared[key].as_f64().unwrap();
        assert!(db("rdbp_db") <= db("rdbp_bound_db"), "{compared}");
    }
}

#[test]
fn simulate_then_info_and_crosscheck() {
    let folder = tempfile::tempdir().unwrap();
    for (name, options) in [
        ("plain", ""),
        ("other", "--domain toa --sgn +1"),
        ("rough", "--noise-db -20 --perturb 0.5 --seed 7"),
    ] {
        let line = format!("simulate --preset table-4-1 -o {name}.cphd {options}");
        run(folder.path(), &line).succeeded();
        let info = run(folder.path(), &format!("info --json {name}.cphd"));
        let info: Value = serde_json::from_str(info.succeeded()).unwrap();
        assert_eq!(info["num_pulses"], 1040, "{name}");
        // Table 4.1: 200 MHz at 10 GHz, 5 km, 0.125 m per pulse: lambda R / (2 d) = 599.6 m.
        let near = |key: &str, expected: f64, relative: f64| {
            let value = info[key].as_f64().unwrap_or(f64::NAN);
            assert!(
                (value / expected - 1.0).abs() < relative,
                "{name}: {key} is {value}"
            );
        };
        near("slant_range_m", 5000.0, 1e-3);
        near("aperture_length_m", 1039.0 * 0.125, 0.01);
        if name != "rough" {
            near("unambiguous_cross_range_m", 599.58, 1e-2);
        }
        assert_eq!(info["side"], "left");
        let crosscheck = run(folder.path(), &format!("crosscheck {name}.cphd"));
        let text = crosscheck.succeeded();
        assert!(text.contains("26 of 26 sub-CPIs of 40 pulses"), "{text}");
        assert_crosscheck(text);
    }
    assert!(
        run(folder.path(), "info plain.cphd")
            .succeeded()
            .contains("1040 pulses of 256")
    );
}

#[test]
fn focus_writes_image_record_and_picture() {
    let folder = tempfile::tempdir().unwrap();
    run(folder.path(), "simulate --preset table-4-1 -o scene.cphd").succeeded();
    let grid = "--grid x=-6:6:0.25,y=-5:5:0.25,z=0 --window none --slow-window none";
    for algorithm in ["exact", "bp", "rdbp", "rda", "omega-k"] {
        let line = format!("focus scene.cphd --out {algorithm} -a {algorithm} {grid} --check 5000");
        let ran = run(folder.path(), &line);
        let error_db = number_after(ran.succeeded(), "pixels: ");
        // `exact` differs from the comparison by float32 rounding of the image, at most 2^-25 RMS: -150 dB.
        let bound_db = match algorithm {
            "exact" => -140.0,
            // Both plan for this; over all pixels, since few pixels of this sparse scene contain its power.
            _ => -60.0,
        };
        assert!(error_db < bound_db, "{algorithm}: {error_db}");
        let out = folder.path().join(algorithm);
        assert_eq!(listing(&out).len(), 3);
        let record = json(&out.join("image.json"));
        assert_eq!(record["schema_version"], 1);
        assert_eq!(record["settings"]["algorithm"], algorithm);
        assert_eq!(record["settings"]["window"], "none");
        assert_eq!(record["grid"]["columns"]["count"], 48);
        assert_eq!(record["grid"]["rows"]["count"], 40);
        assert_eq!(record["frame"]["kind"], "earth");
        assert_eq!(record["inputs"][0]["crc32"].as_str().unwrap().len(), 8);
        assert_eq!(record["check"]["num_pixels"], 48 * 40);
        // A unit scatterer lies at the origin, which is a pixel.
        assert!(
            fs::read(out.join("image.png"))
                .unwrap()
                .starts_with(b"\x89PNG")
        );
    }
    let ran = run(folder.path(), "compare rdbp/image.npy exact/image.npy");
    assert!(number_after(ran.succeeded(), "relative RMS error ") < -60.0);
    // The same file twice: no error, also as JSON.
    let ran = run(folder.path(), "compare --json bp/image.npy bp/image.npy");
    let same: Value = serde_json::from_str(ran.succeeded()).unwrap();
    assert!((same["correlation"].as_f64().unwrap() - 1.0).abs() < 1e-12);
}

#[test]
fn images_are_bit_identical_for_any_thread_count() {
    let folder = tempfile::tempdir().unwrap();
    run(folder.path(), "simulate --preset table-4-1 -o scene.cphd").succeeded();
    for algorithm in ["bp", "rdbp"] {
        for threads in [1, 3] {
            let line = format!(
                "focus scene.cphd -q --out {algorithm}{threads} -a {algorithm} --threads {threads} \
                 --grid x=-6:6:0.25,y=-5:5:0.25"
            );
            let ran = run(folder.path(), &line);
            let text = ran.succeeded();
            assert!(
                text.starts_with(&format!("{algorithm}{threads}: 48 x 40 pixels")),
                "{text}"
            );
            assert_eq!(ran.stderr, "", "-q is quiet");
        }
        let image = |threads| {
            fs::read(
                folder
                    .path()
                    .join(format!("{algorithm}{threads}/image.npy")),
            )
            .unwrap()
        };
        assert!(image(1) == image(3), "{algorithm}");
    }
}

#[test]
fn moving_target_has_no_default_grid() {
    // The radar of Table 2.1 recedes along its line of sight: it has no cross-range resolution.
    let folder = tempfile::tempdir().unwrap();
    run(folder.path(), "simulate --preset table-2-1 -o scene.cphd").succeeded();
    let info = run(folder.path(), "info scene.cphd");
    let text = info.succeeded();
    assert!(text.contains("none in cross-range"), "{text}");
    assert!(!text.contains("inf") && !text.contains("NaN"), "{text}");
    run(folder.path(), "focus scene.cphd --out out").failed(1, &["no default grid", "--grid"]);
    assert_eq!(listing(folder.path()).len(), 1);
}

#[test]
fn demo_keeps_its_bounds() {
    let folder = tempfile::tempdir().unwrap();
    // A quarter of the scene, coarser: a fraction of the seconds of the whole.
    let ran = run(
        folder.path(),
        "demo --out demo --grid x=-20:20:0.5,y=-20:20:0.5",
    );
    assert!(ran.succeeded().contains("rdbp precise, 26 x 40"));
    // Errors on another grid than the default are shown but not judged.
    assert!(ran.stdout.contains("not judged") && !ran.stdout.contains("MISSED"));
    let demo = folder.path().join("demo");
    for name in [
        "overview.png",
        "errors.md",
        "errors.json",
        "difference-thesis-130.png",
    ] {
        assert!(demo.join(name).is_file(), "{name}");
    }
    let errors = json(&demo.join("errors.json"));
    let error_db = |folder: &str| {
        let formers = errors["formers"].as_array().unwrap();
        let former = formers
            .iter()
            .find(|former| former["folder"] == folder)
            .unwrap();
        former["comparison"]["error_db"].as_f64().unwrap()
    };
    assert!(error_db("precise-40") <= -60.0);
    assert!(error_db("precise-130") <= -45.0);
    assert!(error_db("bp") <= -50.0);
    // Every former has a folder.
    for former in ["ffbp", "omega-k", "rda", "pfa"] {
        assert!(error_db(former) <= -50.0, "{former}");
    }
    // The thesis's mode shows its grating lobes: at 130 pulses nearly as strong as the image.
    assert!(error_db("thesis-130") > -10.0 && error_db("thesis-40") < -10.0);
    for name in [
        "exact",
        "bp",
        "thesis-40",
        "precise-40",
        "thesis-130",
        "precise-130",
        "ffbp",
        "omega-k",
        "rda",
        "pfa",
    ] {
        assert!(demo.join(name).join("image.npy").is_file(), "{name}");
    }
}

#[test]
fn dark_part_of_scene_keeps_bound() {
    // Between the scatterers the image has almost no power to relate an error to.
    let folder = tempfile::tempdir().unwrap();
    let ran = run(
        folder.path(),
        "demo --out demo --grid x=11:15:0.5,y=11:15:0.5",
    );
    assert!(!ran.succeeded().contains("MISSED"));
    let errors = json(&folder.path().join("demo/errors.json"));
    for former in errors["formers"].as_array().unwrap() {
        assert!(former["bound_db"].is_null() && former["within_bound"].is_null());
    }
}

/// The valid GOTCHA file of the tests with its samples times `scale`.
fn scaled_gotcha(scale: f32) -> Vec<u8> {
    let mut fields = matlab::gotcha_fields();
    for (name, value) in &mut fields {
        if let ("fp", matlab::Value::Complex(_, _, real, imaginary)) = (*name, value) {
            real.iter_mut().chain(imaginary).for_each(|v| *v *= scale);
        }
    }
    matlab::gotcha(fields)
}

#[test]
fn figures_are_independent_of_scale() {
    // 1e25 squared is above float32, 1e-25 squared below it.
    let folder = tempfile::tempdir().unwrap();
    let mut found = Vec::new();
    for (name, scale) in [("one", 1.0), ("strong", 1e25), ("faint", 1e-25)] {
        let path = folder.path().join(format!("{name}.mat"));
        fs::write(path, scaled_gotcha(scale)).unwrap();
        for algorithm in ["exact", "bp"] {
            let out = format!("{name}-{algorithm}");
            let line = format!(
                "focus {name}.mat -a {algorithm} --check 9 --grid x=-40:40:5,y=-40:40:5 --out {out}"
            );
            let text = run(folder.path(), &line).succeeded().to_owned();
            assert!(!text.contains("inf") && !text.contains("NaN"), "{text}");
            let record = json(&folder.path().join(out).join("image.json"));
            let number = |value: &Value| value.as_f64().unwrap();
            let peak = &record["brightest"];
            found.push((
                peak["row"].clone(),
                peak["column"].clone(),
                number(&peak["level_db"]) - 20.0 * f64::from(scale).log10(),
                number(&record["check"]["relative_rms_db"]),
                number(&record["check"]["relative_to_image_db"]),
            ));
        }
    }
    for pair in found.chunks(2) {
        for (got, expected) in pair.iter().zip(&found[..2]) {
            assert_eq!((&got.0, &got.1), (&expected.0, &expected.1));
            // Scaled samples are rounded again, to 6e-8 of their size: 1e-6 dB of the level.
            assert!((got.2 - expected.2).abs() < 1e-5, "{got:?} {expected:?}");
            // These errors consist of rounding; they stay far below the image.
            assert!(got.3 < -50.0 && got.4 < -50.0, "{got:?}");
        }
    }
}

#[test]
fn image_of_zeros_has_no_brightest_point() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("zero.mat"), scaled_gotcha(0.0)).unwrap();
    for algorithm in ["exact", "bp"] {
        let line = format!(
            "focus zero.mat -a {algorithm} --check 5 --grid x=-2:2:1,y=-2:2:1 --out {algorithm}"
        );
        let ran = run(folder.path(), &line);
        let text = ran.succeeded();
        assert!(text.contains("the image is zero"), "{text}");
        assert!(text.contains("undefined of their power"), "{text}");
        assert!(!text.contains("inf") && !text.contains("NaN"), "{text}");
        let record = json(&folder.path().join(algorithm).join("image.json"));
        assert!(record["brightest"].is_null());
        assert!(record["check"]["relative_rms_db"].is_null());
        assert!(record["check"]["relative_to_image_db"].is_null());
    }
}

#[test]
fn gotcha_is_focused_to_minus_60_db() {
    let Some(files) = gotcha() else { return };
    let folder = tempfile::tempdir().unwrap();
    for (algorithm, bound_db) in [("rdbp", -60.0), ("bp", -50.0)] {
        let line = format!(
            "focus {} -a {algorithm} --window none --slow-window none --check 1000 \
             --grid x=-50:50:0.2,y=-50:50:0.2,z=0 --out {algorithm}",
            words(&files)
        );
        let ran = run(folder.path(), &line);
        let error_db = number_after(ran.succeeded(), "1000 pixels: ");
        assert!(error_db <= bound_db, "{algorithm}: {error_db}");
        let record = json(&folder.path().join(algorithm).join("image.json"));
        let at = |i: usize| record["brightest"]["position_m"][i].as_f64().unwrap();
        assert!(
            (at(0) + 15.6).hypot(at(1) - 21.6) <= 0.2,
            "{} {}",
            at(0),
            at(1)
        );
        assert_eq!(record["inputs"].as_array().unwrap().len(), 2);
    }
}

#[test]
fn gotcha_default_grid_and_crosscheck() {
    let Some(files) = gotcha() else { return };
    let folder = tempfile::tempdir().unwrap();
    let info = run(folder.path(), &format!("info --json {}", words(&files)));
    let info: Value = serde_json::from_str(info.succeeded()).unwrap();
    let range_m = info["unambiguous_slant_range_m"].as_f64().unwrap();
    assert!((range_m - 101.9).abs() < 0.1, "{range_m}");
    let resolution_m = info["slant_range_resolution_m"].as_f64().unwrap();
    assert!((resolution_m - 0.24).abs() < 0.005, "{resolution_m}");
    let ran = run(folder.path(), &format!("crosscheck {}", words(&files)));
    assert_crosscheck(ran.succeeded());
}

/// Without a named former the fastest one is used, or the one that has the given options.
#[test]
fn former_follows_from_its_options() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    run(folder.path(), "simulate --preset table-4-1 -o t.cphd").succeeded();
    let settings = |options: &str| {
        let line = format!("focus t.cphd --grid x=-8:8:0.4,y=-8:8:0.4 {options} -o out --force");
        run(folder.path(), &line).succeeded();
        let record = fs::read(at("out").join("image.json")).unwrap();
        let record: serde_json::Value = serde_json::from_slice(&record).unwrap();
        record["settings"].clone()
    };
    let fastest = settings("--error-db -50");
    assert_eq!(fastest["algorithm"], "auto");
    assert_eq!(fastest["resolved"]["former"], "ffbp");
    for options in ["--sub-cpi 20", "--mode thesis"] {
        assert_eq!(settings(options)["algorithm"], "rdbp", "{options}");
    }
    run(folder.path(), "focus t.cphd -a auto --sub-cpi 20 -o x").failed(2, &["--sub-cpi"]);
}
