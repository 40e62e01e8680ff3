//! From the engine's sum to recordings: echoes of every waveform, received, against the definition of phase history;
//! true antenna positions in a file. Receiver impairments are tested in `receiver.rs`.

use std::f64::consts::TAU;
use std::sync::Arc;

use glam::DVec3;
use num_complex::Complex64;
use subaperture::focus::exact::Exact;
use subaperture::focus::{ImageFormer, Task};
use subaperture::geometry::{Axis, ImageGrid};
use subaperture::image::{Comparison, Image};
use subaperture::io::cphd::{Channel, Cphd, WriteOptions, write};
use subaperture::monitor::Silent;
use subaperture::phase_history::{Band, PhaseHistory, TrackError, Weights};
use subaperture::radar::{Motion, Pattern, PhaseNoise, PulseShape, Receiver, Waveform};
use subaperture::receive::{Deskewed, Skew};
use subaperture::signal::window::Window;
use subaperture::simulate::{Experiment, Pair};
use subaperture_tests::experiment::{
    FLIGHT, IDEAL, Line, PAIR, antenna, definition, difference_db, experiment, five_points, fmcw,
    point, pulsed, read_whole,
};

const C: f64 = 299_792_458.0;

/// Raw samples are float32: each part has an RMS error of 2^-25 of its size, 4e-8, which passes the filter like noise.
/// The pulse's energy is spread over fewer samples than the window has, and `|P|` falls to half at the band's edge or
/// with the code, so that the errors may grow by up to a factor of 10: -147 dB plus up to 20 dB. Float32 phase history
/// adds -148 dB.
const FLOAT_DB: f64 = -125.0;

#[test]
fn phase_history_of_every_waveform_matches_definition() {
    let code = Waveform::Pulsed {
        centre_hz: 10e9,
        sample_rate_hz: 250e6,
        num_samples: 600,
        window_start_s: 3.1e-6,
        shape: PulseShape::PhaseCode {
            // Barker code of 13 chips.
            phases_rad: "+++++--++-+-+"
                .chars()
                .map(|c| if c == '+' { 0.0 } else { std::f64::consts::PI })
                .collect(),
            chip_s: 10e-9,
        },
    };
    let stepped = Waveform::Stepped {
        band: Band {
            start_hz: 1.2e9,
            step_hz: 4e6,
            count: 50,
        },
        step_s: 5e-3,
        dwell_s: 1e-3,
    };
    let waveforms = [
        ("ideal", IDEAL),
        ("stepped", stepped),
        ("rising", pulsed(10e9, 200e6, true)),
        ("falling", pulsed(10e9, 150e6, false)),
        ("code", code),
    ];
    for (name, waveform) in waveforms {
        let experiment = experiment(waveform, five_points());
        let recording = experiment.record(PAIR).unwrap();
        let expected = definition(recording.collection(), &five_points());
        let error_db = difference_db(&read_whole(&recording), &expected);
        println!(
            "{name}: {error_db:.1} dB, {} samples",
            recording.collection().num_samples
        );
        assert!(error_db < FLOAT_DB, "{name}: {error_db}");
        // The reference range of the middle pulse, at which amplitudes are 1.
        let path_m = recording.collection().pulses[16].reference_path_m;
        assert!((path_m - 1000.0).abs() < 1e-3, "{path_m}");
    }
}

fn image(history: &dyn PhaseHistory) -> Image {
    let axis = Axis {
        start: -15.0,
        step: 0.4,
        count: 76,
    };
    let grid = ImageGrid::horizontal(axis, axis, 0.0);
    let weights = Weights::new(history.collection(), Window::default(), Window::default());
    let task = Task {
        memory_bytes: 1 << 28,
        ..Task::new(history, &grid, &weights)
    };
    Exact.form(&task).unwrap().image
}

#[test]
fn point_amplitude_is_mean_of_beam_and_spreading_over_pulses() {
    // 256 pulses over 25.5 m at 500 m with a beam of 2 degrees (17 m): the middle is illuminated by most of them, the
    // edges by few. Beam and spreading are written out here from their formulas.
    const PULSES: usize = 256;
    let width_rad = 2f64.to_radians();
    let places = [0.0, -7.3, 14.1];
    for (beam, spreading) in [(true, false), (false, true), (true, true)] {
        for x in places {
            let mut experiment = experiment(IDEAL, vec![point(x, 0.0, 1.0)]);
            experiment.radar.num_pulses = PULSES;
            experiment.radar.spreading = spreading;
            experiment.track = Arc::new(Line {
                start_m: DVec3::new(-12.75, -480.0, 140.0),
                ..FLIGHT
            });
            for one in [
                &mut experiment.radar.transmitters,
                &mut experiment.radar.receivers,
            ] {
                if beam {
                    one[0].pattern = Pattern::Gaussian {
                        azimuth_rad: width_rad,
                        elevation_rad: 1.0,
                    };
                }
            }
            let recording = experiment.record(PAIR).unwrap();
            for window in [Window::None, Window::default()] {
                let weights = Weights::new(recording.collection(), Window::default(), window);
                let at = DVec3::new(x, 0.0, 0.0);
                let [got] =
                    Exact::at_points(&recording, &weights, &[at], 1 << 28, &Silent).unwrap()[..]
                else {
                    panic!("one point has one value")
                };
                let range_m = |n: usize, x: f64| (x + 12.75 - 0.1 * n as f64).hypot(500.0);
                let lit = |n: usize| {
                    let azimuth = (x + 12.75 - 0.1 * n as f64).atan2(480.0) / width_rad;
                    let elevation = (140.0 / range_m(n, x)).asin();
                    // Two-way pattern, exp(-2 ln 2 (...)) for each antenna, with a width of one radian in elevation.
                    let two_way = 0.0625f64.powf(azimuth * azimuth + elevation * elevation);
                    // R0 is the range of the reference in pulse 128 of 256.
                    let spread = (range_m(128, 0.0) / range_m(n, x)).powi(2);
                    (if beam { two_way } else { 1.0 }) * (if spreading { spread } else { 1.0 })
                };
                let sum: f64 = (0..PULSES).map(|n| weights.slow[n] * lit(n)).sum();
                let expected = sum / weights.slow.iter().sum::<f64>();
                println!("beam {beam}, spreading {spreading}, {x} m: {expected:.4}");
                // Float32 samples, and phases of 2e5 rad in float64.
                assert!((got - expected).norm() < 1e-6, "{got} {expected}");
            }
        }
    }
}

/// Sweeps of 200 MHz in 10 us: 1 rad of residual video phase at the scene's edge, and a skew of 0.1 us, a hundredth of
/// the sweep. The pulsed radar has the same frequencies, so that the images agree except for the deskew error within
/// the scene: sidelobes of the Fresnel ripple, which lies outside.
#[test]
fn deskewed_fmcw_image_matches_pulsed_image() {
    for falling in [false, true] {
        let swept = experiment(fmcw(falling), five_points());
        let deskewed = swept.record(PAIR).unwrap();
        let band = deskewed.collection().band().unwrap();
        assert!(band.count % 2 == 1 && band.count > 300, "{band:?}");
        let centre_hz = band.frequency_hz(band.count / 2);
        let bandwidth_hz = (band.count - 1) as f64 * band.step_hz;
        let pulsed = experiment(pulsed(centre_hz, bandwidth_hz, true), five_points());
        let compressed = pulsed.record(PAIR).unwrap();
        let same = compressed.collection().band().unwrap();
        assert_eq!(same.count, band.count);
        assert!((same.start_hz - band.start_hz).abs() < 1e-3);

        let expected = image(&compressed);
        let error_db = |history: &dyn PhaseHistory| {
            let comparison = Comparison::between(&image(history), &expected).unwrap();
            comparison.error_db.unwrap()
        };
        let skewed = Deskewed::new(swept.echoes(PAIR).unwrap(), None, Skew::Left).unwrap();
        let (with_db, without_db) = (error_db(&deskewed), error_db(&skewed));
        println!(
            "deskewed {with_db:.1} dB, skew left {without_db:.1} dB, {} samples",
            band.count
        );
        assert!(with_db < -50.0, "{with_db}");
        assert!(without_db > -20.0, "{without_db}");
    }
}

/// A scatterer at the reference point has amplitude 1 in every sample for any motion within the sweep, if the track is
/// known: compensation follows the delay sample by sample.
#[test]
fn intra_pulse_motion_is_compensated_at_reference_point() {
    let stepped = Waveform::Stepped {
        band: Band {
            start_hz: 1.2e9,
            step_hz: 4e6,
            count: 50,
        },
        step_s: 5e-3,
        dwell_s: 1e-3,
    };
    // Flight towards the scene: uncompensated phases would change by many cycles.
    let dive = Line {
        start_m: DVec3::new(-30.0, -490.0, 100.0),
        velocity_m_s: DVec3::new(60.0, 40.0, -3.0),
        sway_m: 0.02,
    };
    for (waveform, pri_s) in [(stepped, 0.25), (fmcw(false), 1e-3), (fmcw(true), 1e-3)] {
        let sweeps = matches!(waveform, Waveform::Fmcw { .. });
        let mut moving = experiment(waveform, vec![point(0.0, 0.0, 1.0)]);
        moving.radar.motion = Motion::True;
        moving.radar.pri_s = pri_s;
        moving.radar.num_pulses = 4;
        moving.track = Arc::new(dive);
        if sweeps {
            moving.extent = Some(subaperture::geometry::Extent {
                x_m: (-3.0, 3.0),
                y_m: (-3.0, 3.0),
            });
        }
        let recording = moving.record(PAIR).unwrap();
        let width = recording.collection().num_samples;
        let weights = Window::default().weights(width);
        let norm: f64 = weights.iter().sum();
        for (n, row) in read_whole(&recording).chunks_exact(width).enumerate() {
            if sweeps {
                // Windowed mean; the Fresnel ripple of the sweep's edges averages to below 1e-3.
                let mean: Complex64 = row
                    .iter()
                    .zip(&weights)
                    .map(|(z, w)| Complex64::new(z.re.into(), z.im.into()) * *w)
                    .sum();
                let error = (mean / norm - 1.0).norm();
                assert!(error < 1e-3, "pulse {n}: {error}");
            } else {
                // Float32, and 1e-9 turns of float64 rounding in the delays.
                let worst = row.iter().map(|z| (z - 1.0).norm()).fold(0.0, f32::max);
                assert!(worst < 1e-6, "pulse {n}: {worst}");
            }
            // The recorded geometry is that of the middle sample.
            let pulse = recording.collection().pulses[n];
            let truth = recording.true_antennas().unwrap()[n];
            assert_eq!([pulse.transmitter_m, pulse.receiver_m], truth);
        }
    }
}

/// Two alternating transmitters; two receivers receive every pulse of both, with independent noise.
#[test]
fn transmitters_alternate_between_pulses() {
    let mut array = experiment(IDEAL, five_points());
    array.radar.num_pulses = 7;
    array.radar.transmitters = vec![
        antenna("T0", DVec3::ZERO),
        antenna("T1", DVec3::new(0.3, 0.0, 0.1)),
    ];
    array.radar.receivers = vec![
        antenna("R0", DVec3::ZERO),
        antenna("R1", DVec3::new(-0.2, 0.0, 0.0)),
    ];
    let mut names = Vec::new();
    for pair in array.pairs() {
        let recording = array.record(pair).unwrap();
        let collection = recording.collection();
        assert_eq!(collection.pulses.len(), 4 - pair.transmitter);
        for (i, pulse) in collection.pulses.iter().enumerate() {
            let n = 2 * i + pair.transmitter;
            assert_eq!(pulse.time_s, n as f64 * 1e-3);
            let place = DVec3::new(-1.6 + 100.0 * pulse.time_s, -480.0, 140.0);
            let antennas = &array.radar;
            let offset = antennas.transmitters[pair.transmitter].offset_m;
            assert_eq!(pulse.transmitter_m, place + offset);
            let offset = antennas.receivers[pair.receiver].offset_m;
            assert_eq!(pulse.receiver_m, place + offset);
        }
        let expected = definition(collection, &five_points());
        assert!(difference_db(&read_whole(&recording), &expected) < FLOAT_DB);
        names.push(collection.name.clone());
    }
    assert_eq!(
        names,
        ["test T0-R0", "test T0-R1", "test T1-R0", "test T1-R1"]
    );
    let none = Pair {
        transmitter: 2,
        receiver: 0,
    };
    assert!(array.record(none).is_err());
}

/// The recorded track differs from the true one; both survive a file. The phases are those of the true track minus the
/// recorded reference path: the definition, except for the path difference.
#[test]
fn true_and_measured_positions_round_trip_through_cphd() {
    let mut measured = experiment(IDEAL, vec![point(3.0, 2.0, 1.0)]);
    measured.measured = Some(Arc::new(Line {
        sway_m: 0.05,
        ..FLIGHT
    }));
    let recording = measured.record(PAIR).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("truth.cphd");
    let channels = [Channel::new("1", &recording)];
    write(&path, &channels, &WriteOptions::default(), &Silent).unwrap();
    let file = Cphd::open(&path, None, 1 << 20).unwrap();
    assert_eq!(read_whole(&file), read_whole(&recording));
    let (kept, truth) = (
        file.true_antennas().unwrap(),
        recording.true_antennas().unwrap(),
    );
    assert_eq!(kept.len(), 32);
    for n in 0..32 {
        let time_s = n as f64 * 1e-3;
        let place = DVec3::new(-1.6 + 100.0 * time_s, -480.0, 140.0);
        // 2 nm: float64 in ECF coordinates.
        assert!(truth[n][0].distance(place) < 1e-12);
        assert!(kept[n][0].distance(place) < 2e-9 && kept[n][1].distance(place) < 2e-9);
        let sway = DVec3::Y * (0.05 * (TAU * 7.0 * time_s).sin());
        let pulse = file.collection().pulses[n];
        assert!(pulse.transmitter_m.distance(place + sway) < 2e-9);
    }
    // Mean square of the sway over these 32 samples, written out.
    let squares: f64 = (0..32)
        .map(|n| (0.05 * (TAU * 7e-3 * f64::from(n)).sin()).powi(2))
        .sum();
    let error = TrackError::of(&file).unwrap();
    assert!(
        (error.rms_m - (squares / 32.0).sqrt()).abs() < 1e-8,
        "{error:?}"
    );
    // The sway still increases at 31 ms, the last pulse.
    let most_m = 0.05 * (TAU * 7.0 * 31e-3).sin();
    assert!((error.max_m - most_m).abs() < 1e-8, "{error:?}");

    // Phases: the true path minus the recorded path to the reference.
    let samples = read_whole(&recording);
    let worst = (0..32).map(|n| {
        let pulse = recording.collection().pulses[n];
        let path_m = 2.0 * truth[n][0].distance(DVec3::new(3.0, 2.0, 0.0));
        let turns = -9.9e9 * ((path_m - 2.0 * pulse.transmitter_m.length()) / C);
        let expected = Complex64::cis(TAU * (turns - turns.round()));
        let got = samples[n * 64];
        (Complex64::new(got.re.into(), got.im.into()) - expected).norm()
    });
    assert!(worst.fold(0.0, f64::max) < 1e-6);
}

#[test]
fn invalid_experiments_are_refused() {
    let refusal = |experiment: &Experiment, word: &str| {
        let error = experiment.record(PAIR).err().expect("refused").to_string();
        assert!(error.contains(word), "{error}");
    };
    // A point 400 m behind the scene: its echo ends after the window.
    let far = experiment(pulsed(10e9, 200e6, true), vec![point(0.0, 400.0, 1.0)]);
    refusal(&far, "window");
    let mut wide = experiment(fmcw(false), five_points());
    wide.extent = Some(subaperture::geometry::Extent {
        x_m: (-400.0, 400.0),
        y_m: (-400.0, 400.0),
    });
    refusal(&wide, "sample rate");
    // Without an extent, the unambiguous range of the samples is used.
    wide.extent = None;
    assert!(wide.record(PAIR).is_ok());
    let mut noisy = experiment(IDEAL, five_points());
    noisy.radar.receiver.phase_noise = Some(PhaseNoise {
        levels: vec![(10.0, -60.0)],
    });
    refusal(&noisy, "phase noise");
    noisy.radar.receiver = Receiver::default();
    noisy.radar.pri_s = 0.0;
    refusal(&noisy, "repetition");
}
