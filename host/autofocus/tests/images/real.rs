//! Real recordings of radars on an arm, a rail and a scanner: autofocus improves the image or leaves it unchanged. Two rounds
//! with every second pulse of the longer recordings, to take only seconds.

use std::path::{Path, PathBuf};

use subaperture_autofocus::{
    MapDrift, Method, ModifiedPhaseGradient, PhaseGradient, Points, Sharpness, Unknown,
};
use subaperture_io::recording::{RecordingFile, examples};
use subaperture_model::geometry::ImageGrid;

use super::sharpened;

/// Folder of real recordings, or `None` with a message.
fn real_folder(name: &str, file: &str) -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../../shared/data")
        .join(name);
    if folder.join(file).exists() {
        return Some(folder);
    }
    println!("skipped: {} not found", folder.join(file).display());
    None
}

/// Run every method on the image of a described recording; `sharpened` asserts that the image is not worse.
fn try_all(example: &str, folder: &Path, settings: &[(&str, &str)], grid: &str) {
    let text = examples::text(example).unwrap();
    let file = RecordingFile::new(format!("{example}.toml"), text, folder);
    let history = file
        .with(settings.iter().copied())
        .unwrap()
        .history(u64::MAX)
        .unwrap();
    let grid: ImageGrid = grid.parse().unwrap();
    let phases = Sharpness {
        points: Points {
            most: 8,
            within_db: 25.0,
        },
        ..Sharpness::default()
    };
    let track = Sharpness {
        unknown: Unknown::Track,
        ..phases
    };
    let methods: [&dyn Method; 5] = [
        &PhaseGradient::default(),
        &ModifiedPhaseGradient::default(),
        &phases,
        &track,
        &MapDrift::default(),
    ];
    for method in methods {
        let found = sharpened(&history, &grid, method, 2);
        println!(
            "{example}, {}: entropy {:.4} -> {:.4}, contrast {:.3} -> {:.3}",
            method.name(),
            found.before.entropy,
            found.after.entropy,
            found.before.contrast,
            found.after.contrast
        );
    }
}

#[test]
fn autofocus_does_not_worsen_image_of_arc() {
    for (name, data) in [
        ("arcsar-8", "Prova_Esterna_8.bin"),
        ("arcsar-10", "Prova_Esterna_10.bin"),
    ] {
        if let Some(folder) = real_folder("arcsar-awr1642", data) {
            let settings = [("recording.every", "2")];
            try_all(name, &folder, &settings, "r=2:6:0.04,theta=60:120:0.4");
        }
    }
}

#[test]
fn autofocus_does_not_worsen_image_of_rail() {
    if let Some(folder) = real_folder("pulson440-rail", "rail_trial6.npz") {
        let settings = [
            ("recording.every", "2"),
            ("recording.range_bias", "0.45 m"),
            ("radar.first_pulse", "9.22 s"),
        ];
        try_all(
            "pulson-rail",
            &folder,
            &settings,
            "x=1.2:3.2:0.03,y=-4.8:-0.8:0.03,z=0.0375",
        );
    }
}

#[test]
fn autofocus_does_not_worsen_image_of_scanner() {
    if let Some(folder) = real_folder("ti-mimo-scan", "stop2/01.bin") {
        // A vertical image plane: the scanner moves vertically.
        try_all(
            "ti-mimo",
            &folder,
            &[],
            "x=0.8:4:0.04,y=-1:1:0.04,z=0,yaw=90,roll=90",
        );
    }
}
