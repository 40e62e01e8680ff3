//! From a recording to an image through the firmware under emulation, by the commands.

use std::path::Path;

use crate::emulated::application;
use serde_json::Value;
use subaperture::focus::exact::Exact;
use subaperture::focus::{ImageFormer, Task};
use subaperture::geometry::ImageGrid;
use subaperture::image::Image;
use subaperture::io::npy;
use subaperture::phase_history::{PhaseHistory, Weights};
use subaperture::signal::window::Window;
use subaperture_tests::error_db;
use subaperture_tests::link_recording::{recording, write_recording};
use subaperture_tests::subap::{listing, run};

const GRID: &str = "x=-6:6:0.5,y=-6:6:0.5,z=0";

/// Forecast of `line` with `--dry-run`, which writes no file.
fn forecast(folder: &Path, line: &str) -> Value {
    let before = listing(folder);
    let ran = run(folder, &format!("{line} --dry-run --json"));
    let forecast: Value = serde_json::from_str(ran.succeeded()).unwrap();
    assert_eq!(listing(folder), before, "{line}");
    assert!(
        forecast["time_s"].as_f64().unwrap() > 0.0
            && forecast["memory_bytes"].as_u64().unwrap() > 0,
        "{forecast}"
    );
    println!("{line}: {forecast}");
    forecast
}

/// `subap link` and `subap focus --from-maps`.
fn image(folder: &Path, arithmetic: &str, elf: &Path) -> Image {
    let line = format!(
        "link emulate:{arithmetic} a.cphd -o {arithmetic}.maps --grid {GRID} --verify --window none \
         --slow-window none --firmware {}",
        elf.display()
    );
    let ahead = forecast(folder, &line);
    let ran = run(folder, &line);
    println!("{}", ran.succeeded());
    // Exact to the byte except for names, weights and counters, which are few.
    let file = folder
        .join(format!("{arithmetic}.maps"))
        .metadata()
        .unwrap();
    let disk_bytes = ahead["disk"][0]["bytes"].as_u64().unwrap();
    assert!(
        (disk_bytes..disk_bytes + 8192).contains(&file.len()),
        "{disk_bytes} bytes forecast, {}",
        file.len()
    );
    assert!(ran.stdout.contains("on this computer, 0 not"), "{ran:?}");
    assert!(ran.is_untroubled(), "{ran:?}");
    let line = format!("focus --from-maps {arithmetic}.maps --grid {GRID} --out {arithmetic}");
    let ahead = forecast(folder, &line);
    let ran = run(folder, &line);
    ran.succeeded();
    assert!(ran.is_untroubled(), "maps are missing: {ran:?}");
    let file = folder.join(arithmetic).join("image.npy");
    assert_eq!(
        ahead["disk"][0]["bytes"].as_u64(),
        Some(file.metadata().unwrap().len())
    );
    npy::read(&file).unwrap()
}

#[test]
fn image_from_module_maps_keeps_default_bound() {
    let folder = tempfile::tempdir().unwrap();
    write_recording(&folder.path().join("a.cphd"));
    let history = recording();
    let weights = Weights::new(history.collection(), Window::None, Window::None);
    let grid: ImageGrid = GRID.parse().unwrap();
    let task = Task::new(&history, &grid, &weights);
    let exact = Exact.form(&task).unwrap().image;
    for (arithmetic, elf) in ["float", "fixed"].iter().zip(application()) {
        let measured_db = error_db(&image(folder.path(), arithmetic, elf), &exact);
        println!("{arithmetic}: {measured_db:.1} dB");
        // The default bound of the command.
        assert!(measured_db <= -60.0, "{arithmetic}: {measured_db}");
    }
}

/// With `--picture` the image is fetched eight times; its pixels are those of a single transfer, bit by bit.
#[test]
fn picture_of_accumulated_image_is_drawn_during_the_transfer() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    write_recording(&at.join("a.cphd"));
    let elf = application()[1].display().to_string();
    let link = |options: &str| {
        let line = format!(
            "link emulate:fixed a.cphd --send image --verify --grid {GRID} --json {options} --firmware {elf}"
        );
        let ran = run(at, &line);
        assert!(ran.is_untroubled(), "{ran:?}");
        let report: Value = serde_json::from_str(ran.succeeded()).unwrap();
        report
    };
    let shown = link("--picture live.png --out shown");
    let once = link("--out once");
    let runs = |report: &Value| report["counters"]["runs"].as_u64().unwrap();
    let sub_cpis = shown["sub_cpis"].as_u64().unwrap();
    println!("{} runs of {sub_cpis} sub-CPIs", runs(&shown));
    assert_eq!(runs(&once), 1);
    assert_eq!(runs(&shown), sub_cpis.div_ceil(sub_cpis.div_ceil(8)));
    let pixels = |name: &str| npy::read(&at.join(name).join("image.npy")).unwrap().pixels;
    assert_eq!(pixels("shown"), pixels("once"));
    let picture = std::fs::read(at.join("live.png")).unwrap();
    assert!(picture.starts_with(b"\x89PNG"));
    let files = shown["files"].to_string();
    assert!(files.contains("live.png"), "{files}");
}
