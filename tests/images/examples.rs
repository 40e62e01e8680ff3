//! The library's examples (`host/subaperture/examples`) run as programs, with their output checked.

use std::path::Path;
use std::process::{Command, Stdio};

use subaperture::io::{npy, product};
use subaperture::phase_history::PhaseHistory;
use subaperture::simulate::{Preset, Variation};
use subaperture_tests::error_db;
use subaperture_tests::subap::{example, run};

/// Output of the example when run in `folder`.
fn prints(folder: &Path, name: &str, arguments: &[&str]) -> String {
    let mut command = Command::new(example(name));
    command.args(arguments).current_dir(folder);
    let output = command.stdin(Stdio::null()).output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{name}: {stderr}");
    String::from_utf8(output.stdout).unwrap()
}

/// The numbers of the line that begins with `label`.
fn numbers(text: &str, label: &str) -> Vec<f64> {
    let line = text.lines().find_map(|line| line.strip_prefix(label));
    let line = line.unwrap_or_else(|| panic!("no '{label}' in {text}"));
    let words = line.split(|c: char| c.is_whitespace() || c == ',');
    words.filter_map(|word| word.parse().ok()).collect()
}

#[test]
fn example_reads_and_focuses_recording() {
    let folder = tempfile::tempdir().unwrap();
    run(
        folder.path(),
        "simulate --preset table-4-1 -o table.cphd -q",
    )
    .succeeded();
    let text = prints(folder.path(), "read_and_focus", &["table.cphd", "lot"]);
    // The bound of the program's text.
    assert!(numbers(&text, "predicted error:")[0] < -60.0, "{text}");
    let stored = product::read(&folder.path().join("lot")).unwrap();
    assert_eq!(stored.metadata["settings"]["algorithm"], "auto");
    assert_eq!(stored.metadata["inputs"][0]["path"], "table.cphd");
    // The command accepts the folder as one of its own, and its own image is the same.
    run(folder.path(), "focus table.cphd --out other -q").succeeded();
    let compared = run(folder.path(), "compare lot other");
    assert!(compared.succeeded().contains("error   none"));
    run(folder.path(), "quality lot").succeeded();
    run(folder.path(), "picture lot -o lot.png").succeeded();
    // The example replaces its own files, but not those of other programs.
    prints(folder.path(), "read_and_focus", &["table.cphd", "lot"]);
    std::fs::create_dir(folder.path().join("full")).unwrap();
    std::fs::write(folder.path().join("full/image.npy"), b"a diary").unwrap();
    let mut again = Command::new(example("read_and_focus"));
    again
        .args(["table.cphd", "full"])
        .current_dir(folder.path());
    let output = again.output().unwrap();
    assert!(!output.status.success());
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(stderr.contains("NotOurs"), "{stderr}");
}

/// A single point of amplitude 1 on a pixel has amplitude 1 there.
#[test]
fn example_focuses_arrays_as_phase_history() {
    let text = prints(Path::new("."), "own_history", &[]);
    assert_eq!(
        numbers(&text.replace(['x', 'y'], " "), "brightest:"),
        [2.0, -1.0]
    );
    // The bound of -60 dB is 0.009 dB of a magnitude.
    assert!(numbers(&text, "level:")[0].abs() < 0.01, "{text}");
}

/// Half-power widths of an even band are 0.886 of `c / (2 B cos g)` and of `lambda R / (2 L)`.
#[test]
fn example_measures_simulated_point() {
    let text = prints(Path::new("."), "simulate_and_measure", &[]);
    let place = numbers(&text.replace(['x', 'y'], " "), "point:");
    let off = (place[0] - 3.0).hypot(place[1] - 4.0);
    assert!(off < 0.005, "{text}");
    assert!(numbers(&text, "level:")[0].abs() < 0.02, "{text}");
    let range_m = 3000f64.hypot(2000.0);
    let across_m = 0.886 * (0.2998 / 10.0) * range_m / (2.0 * 256.0 * 5e-3 * 100.0);
    let along_m = 0.886 * (299.8 / (2.0 * 300.0)) * range_m / 3000.0;
    for (label, width_m) in [("width across:", across_m), ("width along:", along_m)] {
        let found = numbers(&text, label);
        // Printed to a millimetre; the point lies 5 m from the middle of the pass.
        assert!(
            found.iter().all(|m| (m / width_m - 1.0).abs() < 0.01),
            "{width_m}: {text}"
        );
        assert_eq!(found.len(), 2, "{text}");
    }
}

#[test]
fn example_tiles_form_whole_image() {
    let text = prints(Path::new("."), "tiles", &[]);
    assert!(numbers(&text, "predicted error:")[0] < -60.0, "{text}");
    assert_eq!(
        numbers(&text, "pixels that differ from the whole image:"),
        [0.0]
    );
    let tiles = text.lines().filter(|line| line.starts_with("tile "));
    assert!(tiles.count() > 1, "{text}");
}

/// Image of all pulses, and the error bounds printed for partial images.
#[test]
fn example_live_image_equals_image_of_its_pulses() {
    let folder = tempfile::tempdir().unwrap();
    let text = prints(folder.path(), "live", &["."]);
    // 28 bytes for each of 100 x 100 pixels, and the window.
    let samples = Preset::Table41
        .simulate(&Variation::default())
        .collection()
        .num_samples;
    assert_eq!(numbers(&text, "memory:"), [(280_000 + 8 * samples) as f64]);
    for count in [260, 520, 780, 1040] {
        let error_db = numbers(&text, &format!("after {count} pulses: error below"));
        assert!(error_db[0] < -60.0, "{text}");
    }
    let image = npy::read(&folder.path().join("live.npy")).unwrap();
    let line = "focus table.cphd -a exact --slow-window none --grid x=-40:40:0.8,y=-40:40:0.8,z=0 --out exact -q";
    run(
        folder.path(),
        "simulate --preset table-4-1 -o table.cphd -q",
    )
    .succeeded();
    run(folder.path(), line).succeeded();
    let exact = npy::read(&folder.path().join("exact/image.npy")).unwrap();
    let error = error_db(&image, &exact);
    assert!(error < -60.0, "{error}");
    let picture = std::fs::read(folder.path().join("live.png")).unwrap();
    assert!(picture.starts_with(b"\x89PNG"));
}

#[test]
fn example_own_former_meets_error_bound() {
    let text = prints(Path::new("."), "own_former", &[]);
    let predicted_db = numbers(&text, "predicted error:")[0];
    let error_db = numbers(&text, "error:")[0];
    assert!(error_db < predicted_db && predicted_db <= -100.0, "{text}");
}
