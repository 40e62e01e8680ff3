//! `subap quality` and products read back.

use std::fs;

use glam::DVec3;
use num_complex::Complex64;
use serde_json::Value;
use subaperture::focus::Silent;
use subaperture::io::cphd::{self, Channel, WriteOptions};
use subaperture::io::product;
use subaperture::phase_history::PhaseHistory;
use subaperture::simulate::{Preset, Scatterer, Simulated, Variation};
use subaperture_tests::subap::{listing, run};

const GRID: &str = "--grid x=-8:8:0.28,y=-16:16:0.35";

#[test]
fn a_product_is_measured_and_shown() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let scatterer = Scatterer {
        position_m: DVec3::ZERO,
        amplitude: Complex64::cis(0.5),
    };
    let table = Preset::Table41.simulate(&Variation::default());
    let history = Simulated::new(table.collection().clone(), vec![scatterer], None);
    let channels = [Channel::new("1", &history)];
    cphd::write(
        at.join("t.cphd"),
        &channels,
        &WriteOptions::default(),
        &Silent,
    )
    .unwrap();
    run(at, &format!("focus t.cphd -o fast {GRID}")).succeeded();
    run(
        at,
        &format!("focus t.cphd -o exact --algorithm exact {GRID}"),
    )
    .succeeded();
    let line = "quality fast --at 0,0 --against exact --line-of-sight 90 --json --plots pictures";
    let report: Value = serde_json::from_str(run(at, line).succeeded()).unwrap();
    let number = |pointer: &str| {
        report
            .pointer(pointer)
            .and_then(Value::as_f64)
            .unwrap_or_else(|| panic!("no {pointer}"))
    };
    // A unit scatterer alone in the middle of the scene: to 1/128 of the cells of 0.58 m and 0.75 m. Its
    // phase is 0.5 less what an error of position in range makes of it, 4 pi / 0.03 m.
    assert!(number("/points/0/response/column_value").abs() < 0.58 / 128.0);
    let off_m = number("/points/0/response/row_value");
    assert!(off_m.abs() < 0.75 / 128.0);
    assert!(number("/points/0/response/level_db").abs() < 0.02);
    let phase_rad = number("/points/0/response/phase_rad") - 0.5 - 419.17 * off_m;
    assert!(phase_rad.abs() < 0.02, "{phase_rad}");
    assert_eq!(report["points"][0]["response"]["turn_is_known"], true);
    // Range is along y: 1.185 cells of 0.7495 m by Taylor's 35 dB window.
    let width_m = number("/points/0/response/cuts/1/width_3db");
    let wanted_m = number("/points/0/theory/1/width_3db") * 0.7495;
    assert!(
        (width_m / wanted_m - 1.0).abs() < 0.02,
        "{width_m} {wanted_m}"
    );
    let range_m = number("/points/0/response/cuts/2/width_3db");
    assert!((range_m / width_m - 1.0).abs() < 1e-6, "90 degrees are y");
    assert!(number("/against/comparison/error_db") < -60.0);
    assert!(number("/against/mean_coherence") > 0.99);
    assert!(number("/against/offset_pixels/rows").abs() < 0.01);
    assert!(number("/against/percent_difference/median") < 2.0);
    let pictures: Vec<String> = listing(&at.join("pictures"))
        .keys()
        .map(|path| path.file_name().unwrap().to_string_lossy().into_owned())
        .collect();
    assert_eq!(
        pictures,
        [
            "coherence.png",
            "percent-difference.png",
            "point-1-chip.png",
            "point-1-cross-range.png",
            "point-1-range.png",
            "point-1-x.png",
            "point-1-y.png",
        ]
    );
    let table = run(at, "quality fast --at 0,0 --against exact");
    for part in [
        "theory",
        "PSLR",
        "point at x",
        "entropy",
        "shift",
        "mean coherence",
    ] {
        assert!(table.succeeded().contains(part), "{part}: {}", table.stdout);
    }
    assert!(!table.stdout.contains("half a turn"), "{}", table.stdout);
    // An array alone is measured in pixels: the same width, in steps of 0.35 m, and its phase with a proviso.
    let pixels = run(at, "quality fast/image.npy --at 29,46");
    assert!(pixels.succeeded().contains("half a turn a pixel"));
    let line = "quality fast/image.npy --at 29,46 --window taylor --json";
    let pixels: Value = serde_json::from_str(run(at, line).succeeded()).unwrap();
    let width = pixels["points"][0]["response"]["cuts"][1]["width_3db"]
        .as_f64()
        .unwrap();
    assert!((width * 0.35 / width_m - 1.0).abs() < 1e-6, "{width}");

    // Reading back, and what does not belong together.
    let stored = product::read(&at.join("fast")).unwrap();
    assert_eq!(stored.grid, GRID["--grid ".len()..].parse().unwrap());
    assert_eq!((stored.image.rows, stored.image.columns), (92, 58));
    let path = at.join("fast/image.npy");
    let mut bytes = fs::read(&path).unwrap();
    bytes[500] ^= 1;
    fs::write(&path, &bytes).unwrap();
    run(at, "quality fast").failed(1, &["image.npy", "CRC-32", "form it again"]);
    bytes.pop();
    fs::write(&path, &bytes).unwrap();
    run(at, "quality fast").failed(1, &["image.npy", "bytes and not"]);
    fs::remove_file(&path).unwrap();
    run(at, "quality fast").failed(1, &["image.npy", "a product is a folder"]);
    fs::write(
        at.join("fast/image.json"),
        "{\"grid\": {\"kind\": \"round\"}}",
    )
    .unwrap();
    run(at, "quality fast").failed(1, &["image.json", "grid.origin_m"]);
    fs::write(at.join("fast/image.json"), "{").unwrap();
    run(at, "quality fast").failed(1, &["image.json", "not JSON"]);
}

#[test]
fn bad_requests_say_what_is_wrong() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    run(at, "simulate --preset table-4-1 -o t.cphd").succeeded();
    run(at, &format!("focus t.cphd -o a {GRID}")).succeeded();
    run(at, "focus t.cphd -o b --grid x=-3:3:0.3,y=-3:3:0.3").succeeded();
    let before = listing(at);
    for (line, code, parts) in [
        ("quality", 2, vec!["IMAGE"]),
        ("quality a --at 1", 2, vec!["--at", "10.5,-3"]),
        (
            "quality a --extent 3:1,0:1",
            2,
            vec!["--extent", "ascending"],
        ),
        ("quality a --coherence 4", 2, vec!["--coherence", "odd"]),
        ("quality nowhere", 1, vec!["nowhere"]),
        ("quality .", 1, vec!["image.json", "a product is a folder"]),
        ("quality a --at 100,0", 1, vec!["x 100 is not on the image"]),
        (
            "quality a --at 0,0 --extent 50:51,0:1",
            1,
            vec!["--extent", "no pixel lies within"],
        ),
        ("quality a --at 0,0 --against b", 1, vec!["different size"]),
        ("quality a --at 7.5,0", 1, vec!["too close to the border"]),
        ("quality t.cphd", 1, vec!["t.cphd", "not a NumPy"]),
    ] {
        run(at, line).failed(code, &parts);
    }
    assert_eq!(listing(at), before);
}
