//! Increments and range profiles of the emulated module, by the command. That they are bit-identical to the core's is verified by
//! `increments.rs` and `profiles.rs`.

use std::fs;
use std::path::Path;

use serde_json::Value;
use subaperture::io::npy;
use subaperture::io::open::{Options, open_channels};
use subaperture::radio::profile::Sweep;
use subaperture::radio::sigmf::Recording;
use subaperture::radio::{Reference, profile};
use subaperture::signal::window::Window;
use subaperture::targets::Arrangement;
use subaperture_tests::subap::{run, write_thesis_experiment};

use crate::emulated::application;

/// Report of `subap link` on the emulated module with these arguments.
fn link(folder: &Path, arguments: &str) -> Value {
    let firmware = application()[0].display().to_string();
    let line = format!("link emulate:float {arguments} --json --firmware {firmware}");
    let ran = run(folder, &line);
    serde_json::from_str(ran.succeeded()).unwrap()
}

/// The walk of 1 m between four points, recorded without errors of navigation. Noise of -15 dB per sample and 151 samples give an SNR of 35 dB,
/// at which increments of a 1 m track with two receivers are some 3 % short (`subaperture::motion`).
#[test]
fn track_of_increments_follows_the_recorded_motion() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let example = run(at, "simulate --example walk");
    let drifting = "drift = \"8, 8, 0 cm\"";
    let scene = example.succeeded();
    assert!(scene.contains(drifting));
    let exact = scene.replace(drifting, "drift = \"0, 0, 0 cm\"");
    fs::write(at.join("walk.toml"), exact).unwrap();
    run(at, "simulate walk.toml --set radar.pulses=48 -o walk.cphd").succeeded();
    let report = link(at, "walk.cphd --send increments -o track.csv");
    assert_eq!(report["increments"], 48, "{report}");
    assert_eq!(report["ending"], "complete");
    let counted = |pointer: &str| report.pointer(pointer).and_then(Value::as_f64).unwrap();
    let down = counted("/counters/bytes_from_module");
    let up = counted("/counters/bytes_to_module");
    assert_eq!(report["down_up_ratio"], down / up);
    // Statuses of at most 64 bytes are requested by time: a slow emulator sends more of them.
    let statuses = counted("/counters/frames_from_module/taken") - 48.0;
    assert!(down < 0.03 * up + 64.0 * statuses, "{report}");
    let channels =
        open_channels::<String>(&at.join("walk.cphd"), None, &Options::default()).unwrap();
    // The plan counts the content of the messages: by hand, 45 bytes of an increment, and 14 bytes and the samples of a channel.
    let planned = run(at, "plan module walk.cphd --ram 512K --json");
    let planned: Value = serde_json::from_str(planned.succeeded()).unwrap();
    let products = planned["products"].as_array().unwrap();
    let increments = products.iter().find(|one| one["product"] == "increments");
    let planned = increments.expect("increments")["down_up_ratio"][0].as_f64();
    let samples = channels.channel(0).collection().num_samples as f64;
    let by_hand = 45.0 / (channels.len() as f64 * (14.0 + 8.0 * samples));
    assert!(
        (planned.unwrap() - by_hand).abs() < 1e-12,
        "{planned:?} {by_hand}"
    );
    let fixes = subaperture::io::track_csv::read(&at.join("track.csv")).unwrap();
    assert_eq!(fixes.len() as u64, report["poses"].as_u64().unwrap());
    // A target is confirmed within eight pulses.
    assert!(fixes.len() >= 40, "{}", fixes.len());
    let recorded = |time_s: f64| {
        let pulses = &channels.channel(0).collection().pulses;
        let n = pulses.iter().position(|pulse| pulse.time_s == time_s);
        let pulses = channels
            .iter()
            .map(|(_, history)| history.collection().pulses[n.unwrap()]);
        Arrangement::of_pulses(&pulses.collect::<Vec<_>>())
            .unwrap()
            .origin_m
    };
    let (first, last) = (&fixes[0], &fixes[fixes.len() - 1]);
    assert!(first.position_m.distance(recorded(first.time_s)) < 1e-9);
    let moved_m = recorded(last.time_s) - recorded(first.time_s);
    let error_m = (last.position_m - recorded(last.time_s)).length();
    println!("{} poses, error {error_m} m of {moved_m}", fixes.len());
    assert!(error_m < 0.05 * moved_m.length(), "{error_m} {moved_m}");
    // Other commands read the track.
    run(
        at,
        "focus walk.cphd --track track.csv --channels all --out image",
    )
    .succeeded();
}

/// Values of the module are float32 over at most 16 blocks, the host's float64: -115 dB (`tests/stream/sweep.rs`).
#[test]
fn profiles_of_a_capture_equal_those_of_the_host() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    write_thesis_experiment(at);
    // The module receives the sweeps during the capture.
    let few = "--set plan.steps=16 --set plan.sweeps=2";
    let firmware = application()[0].display();
    let line = format!(
        "capture thesis.toml {few} -o walk --module emulate:float --firmware {firmware} --profiles live --json"
    );
    let captured: Value = serde_json::from_str(run(at, &line).succeeded()).unwrap();
    assert_eq!(captured["files"].as_array().unwrap().len(), 5, "{captured}");

    let report = link(at, "walk.sigmf-meta --send profiles -o profiles");
    let array = |folder: &str| fs::read(at.join(folder).join("profiles.npy")).unwrap();
    assert!(array("live") == array("profiles"));
    assert_eq!(
        (&report["profiles"], &report["sweeps"]),
        (&2.into(), &2.into())
    );
    let ratio = report["down_up_ratio"].as_f64().unwrap();
    // Per sweep 128 kB are sent; 32 values of 8 bytes and some eight statuses of 100 bytes are received, and one more for each second of waiting.
    assert!(ratio < 0.02, "{ratio}");
    let plan = run(at, "plan module walk.sigmf-meta --ram 512K --json");
    let plan: Value = serde_json::from_str(plan.succeeded()).unwrap();
    let planned = &plan["products"][0];
    assert_eq!(planned["product"], "profiles");
    // 32 values of 8 bytes, of 16 carriers with 8 bytes a sample.
    let samples = plan["setup"]["samples"].as_f64().unwrap();
    let expected = 32.0 / (16.0 * samples);
    assert_eq!(planned["down_up_ratio"][1].as_f64(), Some(expected));
    let text = run(at, "plan module walk.sigmf-meta --ram 512K");
    assert!(text.succeeded().contains("--send profiles"), "{text:?}");

    let image = npy::read(&at.join("profiles/profiles.npy")).unwrap();
    assert_eq!((image.rows, image.columns), (2, 32));
    let record = fs::read(at.join("profiles/profiles.json")).unwrap();
    let record: Value = serde_json::from_slice(&record).unwrap();
    let mut recording = Recording::open(&at.join("walk.sigmf-meta")).unwrap();
    for sweep in 0..2 {
        let steps = profile::Steps::read(&mut recording, sweep).unwrap();
        let read: Sweep = steps.over(Reference::Loopback);
        let expected = read.profile(Window::default(), 2, 5.0).unwrap();
        let spacing_m = record["range_spacing_m"].as_f64().unwrap();
        assert!((spacing_m - expected.spacing_m).abs() < 1e-12);
        let row = &image.pixels[32 * sweep as usize..][..32];
        let (mut difference, mut whole) = (0.0, 0.0);
        for (own, expected) in row.iter().zip(&expected.values) {
            difference += (f64::from(own.re) - expected.re).powi(2);
            difference += (f64::from(own.im) - expected.im).powi(2);
            whole += expected.norm_sqr();
        }
        let error_db = 10.0 * (difference / whole).log10();
        println!("sweep {sweep}: {error_db:.1} dB");
        assert!(error_db < -100.0, "{error_db}");
    }
}
