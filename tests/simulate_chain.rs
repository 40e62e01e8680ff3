//! From the engine's sum to recordings: every waveform's echoes, received, against the definition of phase
//! history; what a receiver adds, against theory; the truth in a file.

use std::f64::consts::TAU;
use std::sync::Arc;

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use subaperture::focus::exact::Exact;
use subaperture::focus::{ImageFormer, Silent, Task, Weights};
use subaperture::geometry::{Axis, ImageGrid};
use subaperture::image::{Comparison, Image};
use subaperture::io::cphd::{Channel, Cphd, WriteOptions, write};
use subaperture::phase_history::{Band, PhaseHistory, TrackError};
use subaperture::receive::{Compressed, Deskewed, Echoes, Filter, Skew};
use subaperture::signal::window::Window;
use subaperture::simulate::radar::{
    Clock, Converter, Interferer, LinkBudget, Motion, PhaseNoise, PulseShape, Receiver,
    ThermalNoise, Waveform,
};
use subaperture::simulate::{Experiment, Pair, Reference};
use subaperture_tests::experiment::{
    FLIGHT, IDEAL, Line, PAIR, antenna, definition, difference_db, experiment, five_points, point,
    read_whole,
};

const C: f64 = 299_792_458.0;

/// A sweep of `bandwidth_hz` in 1 us, sampled at 250 MHz for 2.5 us from 3.1 us on: 465 m to 840 m.
fn pulsed(centre_hz: f64, bandwidth_hz: f64, rising: bool) -> Waveform {
    Waveform::Pulsed {
        centre_hz,
        sample_rate_hz: 250e6,
        num_samples: 625,
        window_start_s: 3.1e-6,
        shape: PulseShape::Lfm {
            bandwidth_hz,
            duration_s: 1e-6,
            rising,
        },
    }
}

fn fmcw(falling: bool) -> Waveform {
    Waveform::Fmcw {
        start_hz: if falling { 10.1e9 } else { 9.9e9 },
        chirp_hz_s: if falling { -2e13 } else { 2e13 },
        sample_rate_hz: 50e6,
        num_samples: 501,
        mixer_delay_s: 3.2e-6,
    }
}

/// Raw samples are float32: each errs by 2^-25 of its size RMS in each part, 4e-8, like noise, which the
/// filter treats as it treats noise. The pulse's energy being spread over fewer samples than the window
/// has, and `|P|` falling to half at the band's edge or with the code, the errors may grow by some parts
/// of 10: -147 dB and up to 20. Reading phase history as float32 adds -148 dB.
const FLOAT_DB: f64 = -125.0;

#[test]
fn every_waveform_received_is_the_definition() {
    let code = Waveform::Pulsed {
        centre_hz: 10e9,
        sample_rate_hz: 250e6,
        num_samples: 600,
        window_start_s: 3.1e-6,
        shape: PulseShape::PhaseCode {
            // Barker's code of 13 chips.
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
        // Amplitudes at a range of their own: the middle pulse's is that of the reference.
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
        history,
        grid: &grid,
        weights: &weights,
        memory_bytes: 1 << 28,
        monitor: &Silent,
    };
    Exact.form(&task).unwrap().image
}

/// Sweeps of 200 MHz in 10 us: 1 rad of residual video phase at the scene's edge and 0.1 us of skew, a
/// hundredth of the sweep. The pulsed radar has the very same frequencies, so the images must be the same
/// but for what deskewing leaves within the scene: side lobes of Fresnel's ripple, which lies outside.
#[test]
fn deskewed_sweeps_focus_as_pulses_do() {
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

/// A scatterer at the reference point reads 1 in every sample, however the radar moves meanwhile, if the
/// track is known: compensation follows the delay sample by sample.
#[test]
fn motion_within_a_sweep_is_compensated_at_the_reference() {
    let stepped = Waveform::Stepped {
        band: Band {
            start_hz: 1.2e9,
            step_hz: 4e6,
            count: 50,
        },
        step_s: 5e-3,
        dwell_s: 1e-3,
    };
    // Towards the scene, so that uncompensated phases would turn by many cycles.
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
                // The window's mean; Fresnel's ripple of the sweep's edges averages to below 1e-3.
                let mean: Complex64 = row
                    .iter()
                    .zip(&weights)
                    .map(|(z, w)| Complex64::new(z.re.into(), z.im.into()) * *w)
                    .sum();
                let error = (mean / norm - 1.0).norm();
                assert!(error < 1e-3, "pulse {n}: {error}");
            } else {
                // Float32, and 1e-9 turns of float64 in the delays.
                let worst = row.iter().map(|z| (z - 1.0).norm()).fold(0.0, f32::max);
                assert!(worst < 1e-6, "pulse {n}: {worst}");
            }
            // The middle sample is what the geometry tells of.
            let pulse = recording.collection().pulses[n];
            let truth = recording.true_antennas().unwrap()[n];
            assert_eq!([pulse.transmitter_m, pulse.receiver_m], truth);
        }
    }
}

/// Mean power of raw samples.
fn power(samples: &[Complex32]) -> f64 {
    samples.iter().map(|z| f64::from(z.norm_sqr())).sum::<f64>() / samples.len() as f64
}

fn read_echoes(echoes: &dyn Echoes) -> Vec<Complex32> {
    let collection = echoes.collection();
    let count = collection.pulses.len();
    let mut samples = vec![Complex32::ZERO; count * collection.waveform.num_samples()];
    echoes.read(0..count, &mut samples).unwrap();
    samples
}

/// Thermal noise by the radar equation, by hand: 4 W, gains 30 and 20, 2 dB of losses, 1.604 dB noise
/// figure, an antenna at 100 K; 1 m² at 500 m (geometric mean of ways to and fro), band as sampled.
#[test]
fn noise_has_the_power_of_the_radar_equation() {
    let budget = LinkBudget {
        power_w: 4.0,
        transmit_gain_dbi: 10.0 * 30f64.log10(),
        receive_gain_dbi: 10.0 * 20f64.log10(),
        losses_db: 2.0,
        noise_figure_db: 1.604,
        temperature_k: 100.0,
    };
    let by_hand = |centre_hz: f64, bandwidth_hz: f64| {
        let lambda = C / centre_hz;
        let four_pi = 2.0 * TAU;
        let received = 4.0 * 30.0 * 20.0 * lambda * lambda
            / (four_pi.powi(3) * 500f64.powi(4) * 10f64.powf(0.2));
        let temperature = 100.0 + (10f64.powf(0.1604) - 1.0) * 290.0;
        1.380649e-23 * temperature * bandwidth_hz / received
    };
    let band = Band {
        start_hz: 1.2e9,
        step_hz: 4e6,
        count: 50,
    };
    let stepped = Waveform::Stepped {
        band,
        step_s: 5e-3,
        dwell_s: 2e-3,
    };
    let cases = [
        (pulsed(10e9, 200e6, true), by_hand(10e9, 250e6)),
        // 2e13 Hz/s for 501 samples of 20 ns: centre 100.2 MHz above the start.
        (fmcw(false), by_hand(9.9e9 + 100.2e6, 50e6)),
        (stepped, by_hand(1.2e9 + 25.0 * 4e6, 500.0)),
    ];
    for (waveform, expected) in cases {
        let mut empty = experiment(waveform, Vec::new());
        empty.radar.num_pulses = 400;
        empty.track = Arc::new(Line {
            velocity_m_s: DVec3::ZERO,
            ..FLIGHT
        });
        empty.radar.receiver.noise = Some(ThermalNoise::Equation(budget));
        let samples = read_echoes(&empty.echoes(PAIR).unwrap());
        // At least 20000 exponential variables: standard error 0.7 %; allow five. The range is 500.003 m.
        let ratio = power(&samples) / expected;
        assert!((ratio - 1.0).abs() < 0.035, "{ratio}");
    }
}

/// White noise of power `s^2` becomes `N s^2 mean(1 / |P|^2)` behind the inverse filter and
/// `N s^2 / mean |P|^2` behind the matched one. In a sweep's band `|P|^2` is `rate^2 T / B` on average but for
/// what lies outside, 2 % for `B T = 200`, and their ratio is that of the means, above 1.
#[test]
fn matched_filters_let_less_noise_through() {
    let mut empty = experiment(pulsed(10e9, 200e6, true), Vec::new());
    empty.radar.num_pulses = 200;
    empty.radar.receiver.noise = Some(ThermalNoise::Relative { power_db: -10.0 });
    let through = |filter| {
        let history = Compressed::new(empty.echoes(PAIR).unwrap(), filter).unwrap();
        power(&read_whole(&history))
    };
    let (inverse, matched) = (through(Filter::Inverse), through(Filter::Matched));
    let expected = 0.1 * 625.0 * 200e6 / (250e6f64.powi(2) * 1e-6);
    // 100000 values: 0.3 % of standard error.
    let ratio = matched / expected;
    println!(
        "matched {ratio:.4} of N s^2 B / (rate^2 T), inverse {:.4}",
        inverse / expected
    );
    assert!((ratio - 1.0).abs() < 0.04, "{ratio}");
    assert!(inverse > 1.01 * matched, "{inverse} {matched}");
}

/// Delay of a lone scatterer relative to the reference, from the mean turn between frequencies, the band's
/// edges weighing little.
fn relative_delay_s(row: &[Complex32], step_hz: f64) -> f64 {
    let weights = Window::Hamming.weights(row.len() - 1);
    let pairs = row.windows(2).zip(weights).map(|(pair, weight)| {
        let wide = |z: Complex32| Complex64::new(z.re.into(), z.im.into());
        wide(pair[1]) * wide(pair[0]).conj() * weight
    });
    -pairs.sum::<Complex64>().arg() / (TAU * step_hz)
}

/// A clock that is fast by 1e-4 reads all ranges long by 1e-4, 5 cm at 500 m, and takes its pulses
/// sooner than it says. The range is read off the phase's slope: exact for pulses but for float32, good to
/// the ripple of the sweep's edges, 3 % in phase at most and weighing a tenth, over 350 steps of 0.4 MHz
/// below 1 mm, for FMCW.
#[test]
fn a_fast_clock_reads_ranges_long() {
    let offset = 1e-4;
    for (waveform, tolerance_m) in [
        (IDEAL, 1e-5),
        (pulsed(10e9, 200e6, true), 1e-5),
        (fmcw(false), 1.5e-3),
    ] {
        let mut clocked = experiment(waveform, vec![point(0.0, 4.0, 1.0)]);
        clocked.reference = Reference::Range(500.0);
        clocked.radar.receiver.clock = Some(Clock {
            offset,
            jitter_s: 0.0,
        });
        let recording = clocked.record(PAIR).unwrap();
        let collection = recording.collection();
        let row = &read_whole(&recording)[20 * collection.num_samples..][..collection.num_samples];
        let got_m = 0.5 * C * relative_delay_s(row, collection.pulses[20].step_hz);
        let true_s = 20e-3 / (1.0 + offset);
        let place = DVec3::new(-1.6 + 100.0 * true_s, -480.0, 140.0);
        assert_eq!(recording.true_antennas().unwrap()[20][0], place);
        let range_m = place.distance(DVec3::new(0.0, 4.0, 0.0));
        let expected_m = range_m * (1.0 + offset) - 500.0;
        let error_m = got_m - expected_m;
        println!("{error_m:.2e} m off, {:.4} m of offset", range_m * offset);
        assert!(error_m.abs() < tolerance_m, "{got_m} {expected_m}");
    }
}

/// Jitter of 1 ns: over 400 pulses the RMS delay has a standard error of `1 / sqrt(800)`, 3.5 %.
#[test]
fn jitter_moves_pulses() {
    for waveform in [IDEAL, pulsed(10e9, 200e6, true), fmcw(false)] {
        let mut jittered = experiment(waveform, vec![point(0.0, 0.0, 1.0)]);
        jittered.radar.num_pulses = 400;
        jittered.track = Arc::new(Line {
            velocity_m_s: DVec3::ZERO,
            ..FLIGHT
        });
        jittered.radar.receiver.clock = Some(Clock {
            offset: 0.0,
            jitter_s: 1e-9,
        });
        let recording = jittered.record(PAIR).unwrap();
        let collection = recording.collection();
        let step_hz = collection.pulses[0].step_hz;
        let delays = read_whole(&recording);
        let squares = delays
            .chunks_exact(collection.num_samples)
            .map(|row| relative_delay_s(row, step_hz).powi(2));
        let rms_s = (squares.sum::<f64>() / 400.0).sqrt();
        assert!((rms_s / 1e-9 - 1.0).abs() < 0.15, "{rms_s}");
    }
}

/// A tone 30 MHz beside a pulsed receiver's centre is in every sample, of full power, in the part of the
/// pulses that its duty says; beyond half the sampling rate it is in none. It crosses a sweep for `rate / chirp`:
/// 125 of 501 samples. Noise over 20 MHz has its power.
#[test]
fn interference_has_its_power_place_and_duty() {
    let disturbed = |waveform, interferer: Interferer| {
        let mut quiet = experiment(waveform, Vec::new());
        quiet.radar.num_pulses = 500;
        quiet.radar.receiver.interference = vec![interferer];
        read_echoes(&quiet.echoes(PAIR).unwrap())
    };
    let tone = Interferer {
        frequency_hz: 10.03e9,
        bandwidth_hz: 0.0,
        power_db: 6.0,
        duty: 0.3,
    };
    let full = 10f64.powf(0.6);
    let samples = disturbed(pulsed(10e9, 200e6, true), tone);
    let hit = samples.chunks_exact(625).filter(|row| power(row) > 0.0);
    let mut count = 0;
    for row in hit {
        count += 1;
        assert!(
            row.iter()
                .all(|z| (f64::from(z.norm_sqr()) / full - 1.0).abs() < 1e-5)
        );
        // 30 MHz at 250 MHz.
        let turn = relative_delay_s(row, 1.0) + 30.0 / 250.0;
        assert!((turn - turn.round()).abs() < 1e-6, "{turn}");
    }
    // Binomial: 150 of 500, standard deviation 10.2; allow five.
    assert!((100..=200).contains(&count), "{count}");

    let away = Interferer {
        frequency_hz: 10.2e9,
        duty: 1.0,
        ..tone
    };
    assert_eq!(power(&disturbed(pulsed(10e9, 200e6, true), away)), 0.0);
    let crossing = Interferer {
        frequency_hz: 9.98e9,
        ..away
    };
    for row in disturbed(fmcw(false), crossing).chunks_exact(501) {
        let hit = row.iter().filter(|z| z.norm_sqr() > 0.0).count();
        assert!((124..=126).contains(&hit), "{hit}");
    }
    let noise = Interferer {
        bandwidth_hz: 20e6,
        ..crossing
    };
    let noise = Interferer {
        frequency_hz: 10.03e9,
        ..noise
    };
    // 20 MHz for 2.5 us: 50 independent values a pulse, 25000 in all: 0.6 % of standard error.
    let ratio = power(&disturbed(pulsed(10e9, 200e6, true), noise)) / full;
    assert!((ratio - 1.0).abs() < 0.04, "{ratio}");
}

/// Everything that a receiver can add.
fn disturbed(waveform: Waveform) -> Experiment {
    let mut all = experiment(waveform, five_points());
    all.radar.receiver = Receiver {
        noise: Some(ThermalNoise::Relative { power_db: -10.0 }),
        phase_noise: Some(PhaseNoise {
            levels: vec![(10.0, -60.0), (1e6, -100.0)],
        }),
        clock: Some(Clock {
            offset: 1e-6,
            jitter_s: 1e-11,
        }),
        interference: vec![
            Interferer {
                frequency_hz: 9.98e9,
                bandwidth_hz: 0.0,
                power_db: -6.0,
                duty: 0.5,
            },
            Interferer {
                frequency_hz: 10.01e9,
                bandwidth_hz: 5e6,
                power_db: -6.0,
                duty: 0.5,
            },
        ],
        converter: Some(Converter {
            bits: 8,
            full_scale_db: 6.0,
        }),
    };
    all
}

/// The same samples whatever the order of reading and the number of threads; others for another seed.
#[test]
fn samples_depend_on_the_seed_only() {
    for waveform in [IDEAL, pulsed(10e9, 200e6, true), fmcw(false)] {
        let mut all = disturbed(waveform);
        let recording = all.record(PAIR).unwrap();
        let width = recording.collection().num_samples;
        let pool = |threads| {
            let builder = rayon::ThreadPoolBuilder::new().num_threads(threads);
            builder.build().unwrap()
        };
        let whole = pool(1).install(|| read_whole(&recording));
        let saturated = recording.echoes().saturated_samples();
        assert!(saturated > 0);
        assert_eq!(whole, pool(3).install(|| read_whole(&recording)));
        let again = all.record(PAIR).unwrap();
        let mut row = vec![Complex32::ZERO; width];
        for n in (0..32).rev() {
            again.read(n..n + 1, &mut row).unwrap();
            assert_eq!(row, whole[n * width..][..width], "pulse {n}");
        }
        assert_eq!(again.echoes().saturated_samples(), saturated);
        all.seed = 12;
        assert_ne!(whole, read_whole(&all.record(PAIR).unwrap()));
    }
}

/// Two transmitters take turns; two receivers hear every pulse of either, with noise of their own.
#[test]
fn transmitters_take_turns() {
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

/// The recorded track differs from the true one; both survive a file. Phases are the truth's, referred with
/// the recorded one: the definition, but for the path by which it differs.
#[test]
fn true_and_measured_positions_survive_a_file() {
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
        // 2 nm: float64 in ECF.
        assert!(truth[n][0].distance(place) < 1e-12);
        assert!(kept[n][0].distance(place) < 2e-9 && kept[n][1].distance(place) < 2e-9);
        let sway = DVec3::Y * (0.05 * (TAU * 7.0 * time_s).sin());
        let pulse = file.collection().pulses[n];
        assert!(pulse.transmitter_m.distance(place + sway) < 2e-9);
    }
    // The sway's mean square over these 32 samples, by hand.
    let squares: f64 = (0..32)
        .map(|n| (0.05 * (TAU * 7e-3 * f64::from(n)).sin()).powi(2))
        .sum();
    let error = TrackError::of(&file).unwrap();
    assert!(
        (error.rms_m - (squares / 32.0).sqrt()).abs() < 1e-8,
        "{error:?}"
    );
    assert!(error.max_m <= 0.05 + 1e-8 && error.max_m > 0.0499);

    // Phases: the true path, less the recorded path to the reference.
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
fn what_cannot_be_recorded_is_refused() {
    let refusal = |experiment: &Experiment, word: &str| {
        let error = experiment.record(PAIR).err().expect("refused").to_string();
        assert!(error.contains(word), "{error}");
    };
    // A point 400 m behind the scene: its echo ends past the window.
    let far = experiment(pulsed(10e9, 200e6, true), vec![point(0.0, 400.0, 1.0)]);
    refusal(&far, "window");
    let mut wide = experiment(fmcw(false), five_points());
    wide.extent = Some(subaperture::geometry::Extent {
        x_m: (-400.0, 400.0),
        y_m: (-400.0, 400.0),
    });
    refusal(&wide, "sampling rate");
    wide.extent = None;
    refusal(&wide, "extent");
    let mut noisy = experiment(IDEAL, five_points());
    noisy.radar.receiver.phase_noise = Some(PhaseNoise {
        levels: vec![(10.0, -60.0)],
    });
    refusal(&noisy, "phase noise");
    noisy.radar.receiver = Receiver::default();
    noisy.radar.pri_s = 0.0;
    refusal(&noisy, "repetition");
}
