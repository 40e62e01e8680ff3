//! Tracks found of public recordings of several receivers, where they are at hand.

use std::path::Path;

use subaperture::io::open::{Options, open_channels};
use subaperture::io::recording::examples;
use subaperture::monitor::Silent;
use subaperture::targets::{Fault, Settings, TargetsError, recover};

/// A scanner that moves its array up, across the plane in which the array tells angles: nothing of its 63 mm is to be seen, and what is
/// seen is no motion in that plane. It is said that the track is not to be trusted.
#[test]
fn a_scan_across_the_plane_of_its_array_is_no_track() {
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
    // As described the receivers are a fiftieth more than half a wavelength apart in the middle of the band: angles are in doubt.
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
    // Of the 63 mm nothing: but some 18 phases are in doubt, and each may put the track off by half a wavelength, 1.9 mm.
    assert!(moved_m < 18.0 * 0.0019, "{moved_m}");
    let is_misfit = |fault: &Fault| matches!(fault, Fault::Misfit { .. });
    assert!(found.seen.faults.iter().any(is_misfit));
}
