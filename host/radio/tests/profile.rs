//! Range profiles of the scene of C 5.6, with all impairments of the simulated radio.

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use subaperture_radio::Antennas;
use subaperture_radio::history::{self, Capture, Placement};
use subaperture_radio::profile::{
    Calibration, CalibrationError, Options, Profile, ProfileError, Ranging, Reference, Steps, Sweep,
};
use subaperture_radio::sigmf::Recording;
use subaperture_signal::window::Window;
use tempfile::TempDir;

use crate::scene::{THESIS, captured, experiment, half_path_m, plan, radio};

/// Kaiser window with sidelobes below -50 dB, so that peaks do not shift each other.
pub(crate) const WINDOW: Window = Window::Kaiser { beta: 7.0 };
/// Maximum range of the scene, metres.
pub(crate) const REACH_M: f64 = 25.0;

/// Calibration from a capture of the sky and a capture of a reflector of 4 m² at 5 m, both with impairments.
pub(crate) fn calibration(folder: &TempDir) -> Calibration {
    let mut sweeps = Vec::new();
    for (name, points, seed) in [
        ("sky", &[] as &[(f64, f64)], 11),
        ("reflector", &[(5.0, 4.0)], 12),
    ] {
        let mut experiment = experiment(&[(5.0, 4.0)], seed);
        if points.is_empty() {
            experiment.scene = Default::default();
        }
        let path = folder.path().join(name);
        captured(&mut radio(&experiment), &plan(""), &path);
        let mut recording = Recording::open(&path).unwrap();
        sweeps.push(Sweep::read(&mut recording, 0, Reference::Loopback).unwrap());
        if sweeps.len() == 2 {
            let setup = recording.setup();
            let made = Calibration::measure(
                "2026-11-23",
                setup,
                &sweeps[0],
                &sweeps[1],
                &[half_path_m(5.0)],
                3.0,
            );
            return made.unwrap();
        }
    }
    unreachable!("two captures");
}

/// Check that exactly the three objects are detected, within 2 cm of their true ranges.
///
/// Error budget: noise of -20 dB per sample is -50 dB per step and -64 dB after 50 steps with this window's loss.
/// Quantisation is less, sidelobes are below -50 dB, and a disturbance of relative amplitude `e` shifts a peak by at
/// most `1.9 e` resolutions of 0.75 m: 5 mm for -50 dB. The clock's 2 ppm are 0.03 mm. Amplitudes are relative to the
/// reflector's, `2 (6.3 / 5)^2`. Profile samples are less than a twentieth of a cell apart.
pub(crate) fn assert_thesis(profile: &Profile) {
    let peaks = profile.peaks(0.05);
    println!("{peaks:?}");
    assert_eq!(peaks.len(), 3);
    let reflector = 2.0 * 6.3 * 6.3 / 25.0;
    for (peak, (range_m, square_m)) in peaks.iter().zip(THESIS) {
        let off_m = peak.range_m - half_path_m(*range_m);
        assert!(off_m.abs() < 0.02, "{range_m} m: {off_m}");
        let amplitude = square_m.sqrt() * (6.3 / range_m).powi(2) / reflector;
        assert!(
            (peak.magnitude / amplitude - 1.0).abs() < 0.05,
            "{range_m} m: {} of {amplitude}",
            peak.magnitude
        );
    }
}

#[test]
fn thesis_scene_has_three_peaks_only_with_loopback_reference() {
    let folder = TempDir::new().unwrap();
    let calibration = calibration(&folder);
    let path = folder.path().join("scene");
    let experiment = experiment(THESIS, 13);
    let summary = captured(&mut radio(&experiment), &plan(""), &path);
    println!("{summary:?}");
    // The settling transient outlasts 2 ms, so that some steps need several bursts.
    assert!(summary.bursts > summary.steps && summary.steps == 50);
    let mut recording = Recording::open(&path).unwrap();
    let mut sweep = |reference| Sweep::read(&mut recording, 0, reference).unwrap();
    let [with, without] = [Reference::Loopback, Reference::None].map(&mut sweep);
    let calibrated = calibration.apply(recording.setup(), &with).unwrap();
    assert_thesis(&calibrated.profile(WINDOW, 24, REACH_M).unwrap());
    // Neither profile is calibrated, which would add the sky's echoes. Without the reference there are fifty random
    // phases with a window of half that width: magnitudes are Rayleigh distributed, the largest of about fifty is
    // `sqrt(ln 50) / (sqrt(pi) / 2)`, 2.2 times the mean, and exceeds 4 in about one of four thousand cases (`50
    // exp(-pi 16 / 4)`). With the reference, the leakage stands out against the half of the fifty cells that are not
    // its own.
    let [with, without] =
        [with, without].map(|sweep| sweep.profile(WINDOW, 24, REACH_M).unwrap().contrast());
    println!("contrast {with} with the reference, {without} without");
    assert!(with > 8.0 && without < 4.0);
}

#[test]
fn calibration_file_round_trips_and_is_refused_for_other_setup() {
    let folder = TempDir::new().unwrap();
    let calibration = calibration(&folder);
    let path = folder.path().join("calibration.json");
    calibration.write(&path).unwrap();
    assert_eq!(Calibration::read(&path).unwrap(), calibration);
    let mut other = calibration.setup.clone();
    other.receive_gain_db[1] = 43.0;
    let sweep = Sweep {
        start_hz: 1.1e9,
        step_hz: 4e6,
        values: vec![None; 50],
        times_s: vec![0.0; 50],
    };
    let error = calibration.apply(&other, &sweep).unwrap_err().to_string();
    assert!(
        error.contains("a receive gain of 40 dB, but this set-up has 43")
            && error.contains("2026-11-23"),
        "{error}"
    );
    std::fs::write(&path, "{}").unwrap();
    assert!(matches!(
        Calibration::read(&path),
        Err(CalibrationError::File { .. })
    ));
    assert!(matches!(
        sweep.profile(WINDOW, 8, 20.0),
        Err(ProfileError::TooFew { left: 0, steps: 50 })
    ));
}

/// A calibration file with a changed byte is refused or read as another calibration, without a panic.
#[test]
fn damaged_calibration_file_never_panics() {
    let folder = TempDir::new().unwrap();
    let calibration = calibration(&folder);
    let path = folder.path().join("calibration.json");
    calibration.write(&path).unwrap();
    let good = std::fs::read(&path).unwrap();
    let mut refused = 0;
    for at in (0..900).step_by(5).chain((900..good.len()).step_by(211)) {
        for byte in *b"9}" {
            let mut bad = good.clone();
            bad[at] = byte;
            std::fs::write(&path, &bad).unwrap();
            let Ok(read) = Calibration::read(&path) else {
                refused += 1;
                continue;
            };
            let setup = read.setup.clone();
            let options = Options {
                calibration: Some(read),
                ..Options::default()
            };
            if let Ok(mut ranging) = Ranging::new(&setup, options) {
                let _ = ranging.sweeps(&Steps::empty(&calibration.setup));
            }
        }
    }
    assert!(refused > 100, "{refused}");
}

/// Phase history with a loopback reference: one receiver, calibrated, each sample the sum over the scene minus the path
/// to the reference point. An error of a tenth of a wavelength in range zero would give -4 dB. Noise is -50 dB of the
/// largest echo per carrier. The remaining errors are the reflector's amplitude, measured to 2 % because of its
/// sidelobes and noise, and its delay, half a millimetre: -30 dB.
#[test]
fn loopback_capture_becomes_phase_history_of_one_receiver() {
    let folder = TempDir::new().unwrap();
    let calibration = calibration(&folder);
    let path = folder.path().join("scene");
    captured(&mut radio(&experiment(THESIS, 13)), &plan(""), &path);
    let options = history::Options {
        profile: Options {
            calibration: Some(calibration),
            reach_m: Some(REACH_M),
            ..Options::default()
        },
        ..history::Options::default()
    };
    let made = Capture::open(&path, options).unwrap();
    let antennas = Antennas {
        transmitter_m: DVec3::ZERO,
        receivers_m: [DVec3::ZERO, DVec3::Y * 0.1],
    };
    let reference_m = DVec3::X * 8.0;
    let placement = Placement {
        antennas: Some(antennas),
        ..Placement::standing(reference_m)
    };
    let channels = made.channels(&placement).unwrap();
    assert_eq!((channels.len(), channels.num_pulses()), (1, 1));
    let history = channels.channel(0);
    let mut samples = vec![Complex32::ZERO; 50];
    history.read(0..1, &mut samples).unwrap();
    let (mut error, mut power) = (0.0, 0.0);
    for (k, z) in samples.iter().enumerate() {
        let hz = history.collection().pulses[0].frequency_hz(k);
        let mut expected = Complex64::ZERO;
        for (range_m, square_m) in THESIS {
            let path_m = 2.0 * (half_path_m(*range_m) - half_path_m(8.0));
            let amplitude = square_m.sqrt() * (6.3 / range_m).powi(2) * 25.0 / (2.0 * 6.3 * 6.3);
            let turns = hz * path_m / 299_792_458.0;
            expected += Complex64::cis(-std::f64::consts::TAU * turns) * amplitude;
        }
        let off = Complex64::new(z.re.into(), z.im.into()) - expected;
        error += off.norm_sqr();
        power += expected.norm_sqr();
    }
    let error_db = 10.0 * (error / power).log10();
    println!("{error_db:.1} dB");
    assert!(error_db < -30.0, "{error_db}");
}
