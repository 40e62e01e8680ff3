//! A recorded strip with its description.

use std::path::Path;
use std::sync::LazyLock;

use glam::DVec3;
use num_complex::Complex64;
use subaperture::focus::ImageFormer;
use subaperture::geometry::ImageGrid;
use subaperture::io::open::{Options, open};
use subaperture::phase_history::PhaseHistory;

use subaperture_tests::orbit_strip::{self as strip, Missing, csv, vector_times};

pub(super) const CSV: &str = "kind = \"csv\"\nfile = \"orbit.csv\"\nframe = \"ecef\"";
pub(super) const ARRAYS: &str =
    "kind = \"arrays\"\ntimes = \"times\"\npositions = \"positions\"\nframe = \"ecef\"";

/// Scatterers in the scene's axes, metres.
pub(super) const POINTS_M: [DVec3; 4] = [
    DVec3::new(0.0, 0.0, 0.0),
    DVec3::new(900.0, 700.0, 0.0),
    DVec3::new(-1100.0, 500.0, 0.0),
    DVec3::new(500.0, -1200.0, 0.0),
];

pub(super) static ECHOES: LazyLock<Vec<Vec<Complex64>>> =
    LazyLock::new(|| strip::echoes(&strip::ground(), &POINTS_M, 2.0));

/// A folder with the strip, its orbit as CSV, and this description.
pub(super) fn folder(missing: Missing, platform: &str, antenna: &str) -> tempfile::TempDir {
    let folder = recorded(&ECHOES, missing);
    describe(folder.path(), platform, antenna);
    folder
}

/// A folder with echoes and the orbit as CSV, without a description.
pub(super) fn recorded(echoes: &[Vec<Complex64>], missing: Missing) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    strip::write(folder.path(), echoes, missing);
    let orbit = csv(&vector_times(10.0), true);
    std::fs::write(folder.path().join("orbit.csv"), orbit).unwrap();
    folder
}

/// Write the description of the strip into a folder.
pub(super) fn describe(folder: &Path, platform: &str, antenna: &str) {
    let text = strip::description(&strip::ground(), platform, antenna);
    std::fs::write(folder.join("strip.toml"), text).unwrap();
}

pub(super) fn history(folder: &Path) -> Box<dyn PhaseHistory> {
    open(&folder.join("strip.toml"), &Options::default()).unwrap()
}

/// Pixels within `half` steps of a place.
pub(super) fn patch(place: DVec3, half: f64, step: f64) -> ImageGrid {
    let reach = half * step;
    let axis = |at: f64| format!("{}:{}:{step}", at - reach, at + reach + 0.5 * step);
    let grid = format!("x={},y={},z={}", axis(place.x), axis(place.y), place.z);
    grid.parse().unwrap()
}

/// Former with an error bound of -50 dB. Where a former takes all samples of a pulse at one position, the bound is -30 dB: 1.5 km along the track from
/// the reference point the range rate differs by 26 m/s, the path by 0.26 mm in the half 10 us of a pulse, 0.005 wavelengths or -30 dB.
pub(super) fn former(name: &str) -> Box<dyn ImageFormer> {
    let error_db = if name == "ffbp" { -30.0 } else { -50.0 };
    subaperture::focus::formers::former(name, &serde_json::json!({ "error_db": error_db })).unwrap()
}
