//! `subap gmti`: targets of the example, their file and picture, and refused input.

use std::fs;
use std::path::Path;

use num_complex::{Complex32, Complex64};
use serde_json::Value;
use subaperture::io::{geojson, npy};
use subaperture_tests::subap::run;

/// Position, metres, and radial velocity, m/s, of the example's movers: velocity across the track times the cosine of the grazing angle.
const MOVERS: [([f64; 2], f64); 3] = [
    ([0.0, 0.0], -0.9806),
    ([-25.0, -40.0], 1.4704),
    ([20.0, 30.0], 0.4904),
];

/// Write the recording `gmti.cphd` of the example with these settings.
fn simulate(folder: &Path, settings: &str) {
    let text = run(folder, "simulate --example gmti")
        .succeeded()
        .to_owned();
    fs::write(folder.join("gmti.toml"), text).unwrap();
    let line = format!("simulate gmti.toml -o gmti.cphd {settings}");
    run(folder, line.trim_end()).succeeded();
}

#[test]
fn gmti_finds_the_targets_of_the_example() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    simulate(at, "");
    let printed = run(at, "gmti gmti.cphd -o targets.geojson")
        .succeeded()
        .to_owned();
    assert!(printed.contains("3 moving targets"), "{printed}");
    let record: Value =
        serde_json::from_slice(&fs::read(at.join("targets.geojson")).unwrap()).unwrap();
    assert_eq!(record["schema"], "subaperture-moving-targets");
    let features = record["features"].as_array().unwrap();
    assert_eq!(features.len(), MOVERS.len());
    for (place, velocity_m_s) in MOVERS {
        let properties = features.iter().map(|feature| &feature["properties"]);
        let distance = |target: &Value| {
            let got = [0, 1].map(|i| target["position_m"][i].as_f64().unwrap());
            (got[0] - place[0]).hypot(got[1] - place[1])
        };
        let nearest = properties
            .min_by(|a, b| distance(a).total_cmp(&distance(b)))
            .unwrap();
        let got_m_s = nearest["radial_velocity_m_s"].as_f64().unwrap();
        let sigma_m_s = nearest["velocity_deviation_m_s"].as_f64().unwrap();
        println!(
            "{place:?}: {:.2} m off, {got_m_s:.4} of {velocity_m_s} m/s",
            distance(nearest)
        );
        assert!(distance(nearest) < 3.0, "{nearest}");
        assert!(
            (got_m_s - velocity_m_s).abs() < 4.0 * sigma_m_s,
            "{nearest}"
        );
    }
    // The file is a layer of the viewer; degrees of longitude and latitude near the scene's origin.
    let layer = geojson::read(&at.join("targets.geojson"), 1 << 20).unwrap();
    assert_eq!(layer.len(), MOVERS.len());
    let picture = fs::read(at.join("targets.png")).unwrap();
    assert!(picture.starts_with(b"\x89PNG"));
    // Its own files are replaced, others are not.
    run(at, "gmti gmti.cphd -o targets.geojson --json").succeeded();
    fs::write(at.join("mine.geojson"), "{}").unwrap();
    run(at, "gmti gmti.cphd -o mine.geojson").failed(1, &["mine.geojson"]);
    let alone = run(at, "gmti gmti.cphd -o other.geojson --channels T1R1");
    alone.failed(1, &["at least two channels"]);
    let training = "--guard 0 --training 1 --channels T1R1,T1R2 --grid x=0:0.5:0.5,y=0:0.5:0.5";
    run(at, &format!("gmti gmti.cphd -o other.geojson {training}"))
        .failed(1, &["training cells", "larger grid"]);
    assert!(!at.join("other.geojson").exists());
}

/// Integration over sub-CPIs finds the movers of the example at their places.
#[test]
fn gmti_integrates_targets_over_sub_cpis() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    simulate(at, "");
    let line = "gmti gmti.cphd --sub-cpis 26 --max-speed 10 -o t.geojson";
    let printed = run(at, line).succeeded().to_owned();
    assert!(printed.contains("3 moving targets"), "{printed}");
    let record: Value = serde_json::from_slice(&fs::read(at.join("t.geojson")).unwrap()).unwrap();
    assert_eq!(record["integration"]["sub_cpis"], 26);
    for feature in record["features"].as_array().unwrap() {
        let place = [0, 1].map(|i| feature["properties"]["position_m"][i].as_f64().unwrap());
        let near =
            |(mover, _): &&([f64; 2], f64)| (place[0] - mover[0]).hypot(place[1] - mover[1]) < 2.0;
        assert!(MOVERS.iter().find(near).is_some(), "{place:?}");
    }
    let refused = "gmti gmti.cphd -o u.geojson --sub-cpis";
    run(at, &format!("{refused} 300")).failed(1, &["fewer than 300 sub-CPIs"]);
    run(at, &format!("{refused} 26 --channels T1R1,T1R3"))
        .failed(1, &["at least 3 channels", "found 2"]);
    run(at, &format!("{refused} 2")).failed(1, &["at least 3 sub-CPIs"]);
    run(at, &format!("{refused} 26 --doppler-bins 2")).failed(1, &["1, 3 or 5"]);
    run(at, "gmti gmti.cphd -o u.geojson --max-speed 9").failed(2, &["--sub-cpis"]);
    assert!(!at.join("u.geojson").exists());
}

/// Four dwells: the movers of the example are the confirmed tracks, with their velocities.
#[test]
fn gmti_tracks_targets_over_dwells() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    simulate(at, "--set radar.pulses=2080");
    let packet = "--stanag t.4607 --nationality XN --platform UAV7 --exercise operation-simulated";
    let line = format!("gmti gmti.cphd -o t.geojson --dwell 0.52 {packet}");
    let printed = run(at, &line).succeeded().to_owned();
    assert!(printed.contains("in 4 dwells, 3 tracks"), "{printed}");
    let record: Value = serde_json::from_slice(&fs::read(at.join("t.geojson")).unwrap()).unwrap();
    let features = record["features"].as_array().unwrap();
    let tracks = features
        .iter()
        .filter(|feature| feature["geometry"]["type"] == "LineString");
    let mut across_m_s: Vec<f64> = tracks
        .map(|track| track["properties"]["velocity_m_s"][1].as_f64().unwrap())
        .collect();
    across_m_s.sort_by(f64::total_cmp);
    println!("{across_m_s:?}");
    for (got, expected) in across_m_s.iter().zip([-1.5, -0.5, 1.0]) {
        assert!((got - expected).abs() < 0.3, "{across_m_s:?}");
    }
    // One packet: its size is that of the file, and its version 30.
    let packet = fs::read(at.join("t.4607")).unwrap();
    assert_eq!(&packet[..2], b"30");
    let size = u32::from_be_bytes(packet[2..6].try_into().unwrap());
    assert_eq!(size as usize, packet.len());
    let line = "gmti gmti.cphd -o t.geojson --dwell 0.001";
    run(at, line).failed(1, &["dwell of three pulses"]);
    run(at, "gmti gmti.cphd -o t.geojson --stanag t.4607").failed(2, &["--nationality"]);
}

/// Detection performance in the example: the page, and the order of the methods by theory.
#[test]
fn gmti_evaluates_a_scenario() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let text = run(at, "simulate --example gmti").succeeded().to_owned();
    fs::write(at.join("gmti.toml"), text).unwrap();
    let settings = "--set radar.pulses=520 --sub-cpis 13 --max-speed 10 --trials 20";
    let line = format!("gmti --evaluate gmti.toml {settings} -o performance.html --json");
    let record: Value = serde_json::from_str(run(at, &line).succeeded()).unwrap();
    assert_eq!(record["schema"], "subaperture-gmti-performance");
    let methods = record["methods"].as_array().unwrap();
    let mdv = |name: &str| {
        let own = methods.iter().find(|own| own["method"] == name).unwrap();
        own["predicted_mdv_m_s"].as_f64().unwrap()
    };
    let [one, all] = ["EFA of 3, one sub-CPI", "EFA of 3, all sub-CPIs"].map(mdv);
    println!("MDV of one sub-CPI {one} m/s, of all {all} m/s");
    assert!(all < 0.6 * one, "{all} of {one}");
    for own in methods {
        let targets = own["curve"].as_array().unwrap().iter();
        let targets: u64 = targets.map(|at| at["targets"].as_u64().unwrap()).sum();
        assert_eq!(targets, 20, "{own}");
    }
    let page = fs::read_to_string(at.join("performance.html")).unwrap();
    assert_eq!(page.matches("<img").count(), 4);
    assert!(!page.contains("http"));
    let refused = "gmti --evaluate gmti.toml -o other.html";
    run(at, &format!("{refused} --dwell 1")).failed(2, &["--dwell"]);
    let invalid = format!("{refused} --sub-cpis 300 --trials 1");
    run(at, &invalid).failed(1, &["fewer than 300 sub-CPIs"]);
    run(at, "gmti gmti.cphd -o t.geojson --trials 5").failed(2, &["--evaluate"]);
    assert!(!at.join("other.html").exists());
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

/// Inner product `sum conj(a) b`, in float64.
fn inner(a: &[Complex32], b: &[Complex32]) -> Complex64 {
    let wide = |z: &Complex32| Complex64::new(z.re.into(), z.im.into());
    a.iter().zip(b).map(|(a, b)| wide(a).conj() * wide(b)).sum()
}

/// One pass gives the targets of `subap gmti`, and the mean of the images of the channels.
///
/// The oracle is the mean of three separately focused images, each scaled by its least-squares factor on the first. Phase centres are at most 0.5 m apart, and pulses 0.125 m: alignment leaves
/// out at most 4 of 1040 pulses of each channel, 0.4 % of the energy of its image.
#[test]
fn focus_with_gmti_detects_targets_and_writes_the_mean_image() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    simulate(at, "");
    run(at, "gmti gmti.cphd -o alone.geojson").succeeded();
    let line = "focus gmti.cphd --gmti image/targets.geojson --out image --json";
    let printed: Value = serde_json::from_str(run(at, line).succeeded()).unwrap();
    let [alone, both] = ["alone.geojson", "image/targets.geojson"].map(|name| json(&at.join(name)));
    for key in [
        "schema",
        "features",
        "channels",
        "settings",
        "sensitivity",
        "integration",
    ] {
        assert_eq!(alone[key], both[key], "{key}");
    }
    assert_eq!(printed["features"], both["features"]);
    let files = printed["files"].as_array().unwrap();
    let kinds: Vec<&str> = files
        .iter()
        .map(|file| file["kind"].as_str().unwrap())
        .collect();
    assert_eq!(kinds.len(), 4, "{kinds:?}");
    assert!(kinds.contains(&"moving targets"), "{kinds:?}");
    assert!(printed["predicted_error_db"].as_f64().unwrap() <= -60.0);
    let record = json(&at.join("image/image.json"));
    let named = record["collection"]["channels"].as_array().unwrap();
    assert_eq!(named.len(), 3);

    let read = |name: &str| npy::read(&at.join(name).join("image.npy")).unwrap().pixels;
    let mean = read("image");
    let channels = ["T1R1", "T1R2", "T1R3"].map(|channel| {
        run(
            at,
            &format!("focus gmti.cphd --channel {channel} --out {channel}"),
        )
        .succeeded();
        read(channel)
    });
    let mut expected = vec![Complex64::ZERO; mean.len()];
    let first = &channels[0];
    for channel in &channels {
        let factor = inner(first, channel) / inner(first, first) * 3.0;
        for (sum, z) in expected.iter_mut().zip(channel) {
            *sum += Complex64::new(z.re.into(), z.im.into()) / factor;
        }
    }
    let energy: f64 = expected.iter().map(Complex64::norm_sqr).sum();
    let errors = expected.iter().zip(&mean);
    let error: f64 = errors
        .map(|(z, got)| (z - Complex64::new(got.re.into(), got.im.into())).norm_sqr())
        .sum();
    println!("{:.1} dB", 10.0 * (error / energy).log10());
    assert!(error / energy < 4.0 / 1040.0, "{}", error / energy);
}

#[test]
fn focus_with_gmti_refuses_one_channel_and_options_that_do_not_apply() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    simulate(at, "");
    let line = "focus gmti.cphd --gmti t.geojson --out image";
    run(at, &format!("{line} --channels T1R1")).failed(1, &["at least two channels"]);
    run(at, "focus gmti.cphd gmti.cphd --gmti t.geojson --out image")
        .failed(2, &["one recording", "found 2"]);
    for option in [
        "--channel T1R1",
        "--tiled",
        "--resume",
        "--plan plan.json",
        "--velocity 0,1",
        "--motion motion.csv",
        "--track mpga",
        "--phase phase.csv",
        "--surface slant",
        "--troposphere exponential",
        "--beam auto",
        "--check 10",
        "--allow-error",
        "--scratch 1M",
        "--dry-run",
    ] {
        let name = option.split(' ').next().unwrap();
        run(at, &format!("{line} {option}")).failed(2, &["--gmti", name]);
    }
    // Both outputs or neither: another file at the place of the targets is not replaced.
    fs::write(at.join("t.geojson"), "{}").unwrap();
    run(at, line).failed(1, &["t.geojson"]);
    assert!(!at.join("image").exists());
    run(at, "focus gmti.cphd --gmti u.geojson --out image --window hamming --slow-window taylor --algorithm bp --error-db -50 --channels T1R1,T1R3 --product zarr")
        .succeeded();
    let record = json(&at.join("image/image.json"));
    assert_eq!(record["settings"]["algorithm"], "bp");
    assert_eq!(record["settings"]["given"]["gmti"], "u.geojson");
    assert!(at.join("image/stack.zarr").exists() && at.join("u.geojson").exists());
}
