//! Tracks estimated from public recordings with several receivers, if present.

use std::path::Path;

use subaperture::io::open::{Options, open_channels};
use subaperture::io::recording::examples;
use subaperture::monitor::Silent;
use subaperture::targets::{Fault, Settings, TargetsError, recover};

/// A scanner that moves its array upwards, across the plane in which the array measures angles. The estimate contains none of the 63 mm of
/// motion, because this is not motion in that plane. A warning states that the track is unreliable.
#[test]
fn scan_across_array_plane_gives_track_with_warning() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/ti-mimo-scan/stop2");
    if !data.join("01.bin").exists() {
        println!("skipped: {} not found", data.join("01.bin").display());
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let text = examples::text("ti-mimo").unwrap();
    let described = text.replace(
        "stop2/",
        &format!("{}/", data.canonicalize().unwrap().display()),
    );
    let path = folder.path().join("scan.toml");
    std::fs::write(&path, described).unwrap();
    let open = |settings: &[(String, String)]| {
        let options = Options {
            settings,
            ..Options::default()
        };
        open_channels::<&str>(&path, None, &options).unwrap()
    };
    // By the description the receivers are 2 % more than half a wavelength apart at mid-band, so angles are ambiguous.
    let error = recover(open(&[]), &Settings::default(), &Silent).unwrap_err();
    assert!(matches!(error, TargetsError::Array(_)), "{error}");
    let spaced = |key: String, mm: f64| (key, format!("\"{mm}, 0, 0 mm\""));
    let receivers =
        (1..4).map(|r| spaced(format!("radar.receiver[{r}].offset"), 1.9 * f64::from(r)));
    let settings: Vec<(String, String)> = receivers
        .chain([spaced("radar.transmitter[1].offset".to_owned(), 7.6)])
        .collect();
    let found = recover(open(&settings), &Settings::default(), &Silent).unwrap();
    let (first, last) = (&found.moments[0], &found.moments[found.moments.len() - 1]);
    let moved_m = (last.position_m - first.position_m).truncate().length();
    println!(
        "{} poses, {:.2} mm in the array's plane",
        found.moments.len(),
        1e3 * moved_m
    );
    for fault in &found.seen.faults {
        println!("{fault}");
    }
    // None of the 63 mm is estimated, but some 18 phases are ambiguous, each of which may shift the track by half a wavelength, 1.9 mm.
    assert!(moved_m < 18.0 * 0.0019, "{moved_m}");
    let is_misfit = |fault: &Fault| matches!(fault, Fault::Misfit { .. });
    assert!(found.seen.faults.iter().any(is_misfit));
}
