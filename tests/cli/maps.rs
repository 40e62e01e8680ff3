//! `subap focus --from-maps` and `subap plan module`.

use std::path::Path;

use serde_json::{Map, Value};
use subaperture::focus::exact::Exact;
use subaperture::focus::{ImageFormer, Task};
use subaperture::geometry::ImageGrid;
use subaperture::io::npy;
use subaperture::module::maps::{Arithmetic, Run, RunTotals};
use subaperture::module::maps_file::MapWriter;
use subaperture::module::plan::{ModuleCapacity, ModulePlan, ModuleProduct, Requirements};
use subaperture::phase_history::{PhaseHistory, Weights};
use subaperture::signal::window::Window;
use subaperture::simulate::{PointTargetHistory, Preset, Variation};
use subaperture_tests::error_db;
use subaperture_tests::maps::{fast_weights, maps};
use subaperture_tests::subap::{listing, run};

const GRID: &str = "x=-10:10:1,y=-10:10:1";

fn simulated() -> (PointTargetHistory, Weights) {
    let history = Preset::Table41.simulate(&Variation::default());
    let weights = Weights::new(history.collection(), Window::None, Window::None);
    (history, weights)
}

/// Write the maps of a run on `GRID` to `path`, for the sub-CPIs that `keep` selects.
fn write(path: &Path, keep: impl Fn(u32) -> bool) {
    let (history, weights) = simulated();
    let collection = history.collection();
    let requirements = Requirements {
        product: ModuleProduct::Maps,
        error_db: -60.0,
        room: ModuleCapacity::Ram { bytes: 1 << 20 },
        arithmetic: Arithmetic::Float,
    };
    let plan = ModulePlan::new(&[collection], &GRID.parse().unwrap(), &requirements).unwrap();
    let fast = fast_weights(&weights.fast);
    let setup = Run {
        name: "bench run".to_owned(),
        setup: plan.setup,
        arithmetic: Arithmetic::Float,
        fast_window: "none".to_owned(),
        fast_weights: fast.clone(),
        frame: collection.frame,
        provenance: Map::new(),
    };
    let mut writer = MapWriter::create(path, &setup).unwrap();
    for map in maps(&history, &plan.setup, &plan.patches, &fast, &weights.slow) {
        if keep(map.header.sub_cpi) {
            writer.append(&map.view()).unwrap();
        }
    }
    let closing = RunTotals {
        num_pulses: collection.pulses.len() as u64,
        weight_sum: weights.slow.iter().sum(),
        counters: Map::new(),
    };
    writer.finish(&closing).unwrap();
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

#[test]
fn image_from_maps_is_an_image_product() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    write(&at("a.maps"), |_| true);
    let ran = run(
        folder.path(),
        &format!("focus --from-maps a.maps --out image --grid {GRID}"),
    );
    assert!(ran.succeeded().contains("20 x 20 pixels"), "{ran:?}");
    assert!(ran.is_untroubled(), "{ran:?}");
    assert!(at("image/image.png").exists());
    let image = npy::read(&at("image/image.npy")).unwrap();
    let (history, weights) = simulated();
    let grid: ImageGrid = GRID.parse().unwrap();
    let task = Task::new(&history, &grid, &weights);
    let measured_db = error_db(&image, &Exact.form(&task).unwrap().image);
    println!("{measured_db:.1} dB");
    assert!(measured_db <= -60.0, "{measured_db}");
    let record = json(&at("image/image.json"));
    assert_eq!(record["settings"]["algorithm"], "from-maps");
    assert_eq!(record["settings"]["resolved"]["maps_missing"], 0);
    assert_eq!(record["collection"]["name"], "bench run");
    assert_eq!(record["inputs"][0]["path"], "a.maps");

    // Without a grid the image covers the patches less their margin, and all pixels are inside.
    let ran = run(folder.path(), "focus --from-maps a.maps --out own");
    ran.succeeded();
    assert!(ran.is_untroubled(), "{ran:?}");
    let record = json(&at("own/image.json"));
    let axis = |name: &str| {
        let axis = &record["grid"][name];
        let start = axis["start"].as_f64().unwrap();
        let step = axis["step"].as_f64().unwrap();
        (start, start + step * axis["count"].as_f64().unwrap(), step)
    };
    println!("{:?} {:?}", axis("columns"), axis("rows"));
    for (low, high, step) in [axis("columns"), axis("rows")] {
        assert!((-16.0..=-9.0).contains(&low) && (8.0..=16.0).contains(&high) && step < 1.0);
    }
    assert_eq!(record["settings"]["resolved"]["pixels_outside"], 0);
}

#[test]
fn missing_maps_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.maps");
    write(&path, |sub_cpi| sub_cpi != 1);
    let line = "focus --from-maps a.maps --out image --grid x=-40:40:1,y=-10:10:1";
    let ran = run(folder.path(), line);
    ran.succeeded();
    for part in ["maps are missing", "pixels lie outside every patch"] {
        assert!(ran.stderr.contains(part), "{ran:?}");
    }
    let whole = std::fs::read(&path).unwrap();
    std::fs::write(&path, &whole[..whole.len() / 2]).unwrap();
    let ran = run(
        folder.path(),
        &format!("focus --from-maps a.maps --out cut --grid {GRID}"),
    );
    ran.succeeded();
    assert!(ran.stderr.contains("a.maps is truncated"), "{ran:?}");
    let line = "focus --from-maps a.maps --out coarse --error-db -120";
    run(folder.path(), line).failed(1, &["the predicted error is", "--allow-error"]);
    let ran = run(folder.path(), &format!("{line} --allow-error"));
    ran.failed(3, &["the predicted error is"]);
    assert!(ran.stdout.contains("coarse"));
    // Longer kernels need a larger margin around a pixel than the patches have.
    assert!(
        ran.stderr.contains("larger error with --error-db"),
        "{ran:?}"
    );
}

#[test]
fn wrong_usage_and_invalid_files_leave_no_file() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.maps"), b"SUBAPMAPxxxxyyyy").unwrap();
    let before = listing(folder.path());
    for (line, code, parts) in [
        ("focus --out d", 2, vec!["INPUT"]),
        (
            "focus a.mat --from-maps a.maps --out d",
            2,
            vec!["--from-maps", "INPUT"],
        ),
        (
            "focus --from-maps a.maps --out d --window none",
            2,
            vec!["--from-maps", "--window"],
        ),
        (
            "focus --from-maps a.maps --out d --algorithm bp",
            2,
            vec!["--algorithm"],
        ),
        (
            "focus --from-maps a.maps --out d --check 10",
            2,
            vec!["--check"],
        ),
        (
            "focus --from-maps a.maps --out d --sub-cpi 10",
            2,
            vec!["--sub-cpi"],
        ),
        (
            "focus --from-maps a.maps --out d",
            1,
            vec!["a.maps", "damaged"],
        ),
        ("focus --from-maps none.maps --out d", 1, vec!["none.maps"]),
        ("focus --from-maps . --out d", 1, vec!["folder"]),
        ("plan", 2, vec!["module"]),
        ("plan module a.cphd", 2, vec!["--ram"]),
        ("plan module --ram 512K", 2, vec!["INPUT"]),
        ("plan module --ram 100 a.cphd", 2, vec!["--ram", "512K"]),
        ("plan module --ram 512K --link 0 a.cphd", 2, vec!["--link"]),
        (
            "plan module --ram 512K --pulse-rate -3 a.cphd",
            2,
            vec!["--pulse-rate"],
        ),
        ("plan module --ram 512K none.cphd", 1, vec!["none.cphd"]),
    ] {
        run(folder.path(), line).failed(code, &parts);
    }
    assert_eq!(listing(folder.path()), before);
}

#[test]
fn plan_states_patches_that_fit_the_module() {
    let folder = tempfile::tempdir().unwrap();
    run(folder.path(), "simulate --preset table-4-1 --out a.cphd").succeeded();
    let grid = "--grid x=-40:40:1,y=-40:40:1";
    let ran = run(
        folder.path(),
        &format!("plan module --ram 512K {grid} a.cphd"),
    );
    let text = ran.succeeded();
    println!("{text}");
    for part in [
        "sub-CPIs",
        "patches",
        "pulse samples, two stores",
        "all buffers",
        "real time",
        "921600 baud",
    ] {
        assert!(text.contains(part), "no '{part}' in {text}");
    }
    let plan = |options: &str| -> Value {
        let ran = run(
            folder.path(),
            &format!("plan module --json {grid} a.cphd {options}"),
        );
        serde_json::from_str(ran.succeeded()).unwrap()
    };
    let float = plan("--ram 512K");
    let total = float["ram"]["total_bytes"].as_u64().unwrap();
    assert!(total <= 512 << 10);
    assert!(float["predicted_error_db"].as_f64().unwrap() <= -64.0);
    // 10 bits per byte; both numbers by hand.
    let pulses = float["setup"]["num_pulses"].as_u64().unwrap();
    let frequencies = float["setup"]["num_frequencies"].as_u64().unwrap();
    assert_eq!(float["link"]["up_bytes"], pulses * (72 + 8 * frequencies));
    let up_s = float["link"]["up_bytes"].as_f64().unwrap() * 10.0 / 921_600.0;
    assert!((float["link"]["up_s"].as_f64().unwrap() - up_s).abs() < 1e-9);
    // The same plan in 16 bits needs about half of the memory; twice the link rate allows twice the patches.
    let fixed = plan("--ram 512K --fixed --link 1843200 --pulse-rate 2");
    assert_eq!(fixed["arithmetic"], "fixed");
    assert_eq!(
        fixed["sub_cpi_s"],
        fixed["setup"]["num_pulses"].as_f64().unwrap() / 2.0
    );
    assert_eq!(fixed["keeps_up"], true);

    assert_eq!(float["recommended"], "image");
    let products = float["products"].as_array().unwrap();
    let products: Vec<&Value> = products.iter().map(|load| &load["product"]).collect();
    assert_eq!(products, ["maps", "image", "detections"]);
    // A module accumulates no image on a polar grid.
    let polar = "plan module --ram 512K --grid r=2:20:1,theta=0:90:3 a.cphd";
    let ran = run(folder.path(), &format!("{polar} --json"));
    let maps: Value = serde_json::from_str(ran.succeeded()).unwrap();
    assert_eq!(maps["recommended"], "maps");
    let ran = run(folder.path(), &format!("{polar} --send image"));
    ran.failed(1, &["flat Cartesian grid", "a polar grid"]);

    let least = run(
        folder.path(),
        &format!("plan module --ram 2K {grid} a.cphd"),
    );
    least.failed(1, &["no plan that keeps -66 dB fits", "least memory"]);
    let bytes = least.stderr.split("least memory: ").nth(1).unwrap();
    let bytes = bytes.split(' ').next().unwrap();
    run(
        folder.path(),
        &format!("plan module --ram {bytes} {grid} a.cphd"),
    )
    .succeeded();
}

/// Channels share the memory for pulses and are sent one by one; only detections are formed of several.
#[test]
fn module_plan_counts_every_channel() {
    let folder = tempfile::tempdir().unwrap();
    let scene = r#"
name = "two receivers"
[scene]
x = "-12, 12 m"
y = "-12, 12 m"
[[scene.point]]
position = "0, 0, 0 m"
[radar]
kind = "ideal"
pulses = 64
pri = "1 ms"
centre = "10 GHz"
bandwidth = "150 MHz"
samples = 128
[[radar.transmitter]]
offset = "0, 0, 0 m"
[[radar.receiver]]
offset = "0.25, 0, 0 m"
[[radar.receiver]]
offset = "-0.25, 0, 0 m"
[platform]
kind = "linear"
position = "0, -5, 3 km"
velocity = "125, 0, 0 m/s"
"#;
    std::fs::write(folder.path().join("two.toml"), scene).unwrap();
    run(folder.path(), "simulate two.toml -o two.cphd").succeeded();
    let line = "plan module two.cphd --ram 512K --send detections";
    let plan = |options: &str| -> Value {
        let ran = run(folder.path(), &format!("{line} --json {options}"));
        serde_json::from_str(ran.succeeded()).unwrap()
    };
    let (one, two) = (plan(""), plan("--channels all"));
    // A sub-CPI is the whole recording: 64 pulses, in the second plan of two channels with 72 bytes and 128 samples each.
    for (plan, channels) in [(&one, 1), (&two, 2)] {
        assert_eq!(plan["setup"]["num_pulses"], 64);
        assert_eq!(plan["setup"]["num_channels"], channels);
        assert_eq!(plan["capacity"]["pulses"], 64 * channels);
        assert_eq!(plan["link"]["up_bytes"], 64 * channels * (72 + 8 * 128));
    }
    let products = |plan: &Value| -> Vec<String> {
        let all = plan["products"].as_array().unwrap();
        all.iter().map(|one| one["product"].to_string()).collect()
    };
    assert_eq!(products(&two), ["\"detections\"", "\"increments\""]);
    assert_eq!(two["recommended"], "detections");
    assert_eq!(one["recommended"], "image");
    // Empty lists, or 32 detections with 16 bytes and a value for each channel.
    assert_eq!(
        two["products"][0]["down_bytes"],
        serde_json::json!([18, 18 + 32 * (16 + 2 * 8)])
    );
    let text = run(folder.path(), &format!("{line} --channels all"));
    let text = text.succeeded();
    assert!(text.contains("64 pulses in 2 channels"));
    // The kept map and a row of ratios, 8 bytes each.
    let size = |name: &str| two["capacity"][name].as_u64().unwrap();
    let kept = 8 * (size("doppler_bins") + 1) * size("frequencies");
    assert_eq!(two["ram"]["dpca_bytes"], kept);
    let row = text
        .lines()
        .find(|line| line.contains("map kept by --dpca"));
    assert!(
        row.is_some_and(|row| row.contains(&kept.to_string())),
        "{text}"
    );
    let maps = run(
        folder.path(),
        "plan module two.cphd --ram 512K --channels all",
    );
    maps.failed(2, &["--send maps takes the pulses of one channel"]);
}
