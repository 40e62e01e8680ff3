//! Receiver impairments against theory: noise, clock errors, interference; independent of the order of reading.

use std::f64::consts::TAU;
use std::sync::Arc;

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use subaperture::phase_history::{Band, PhaseHistory};
use subaperture::radar::{
    Clock, Converter, Interferer, LinkBudget, PhaseNoise, Receiver, Reference, ThermalNoise,
    Waveform,
};
use subaperture::receive::{Compressed, Echoes, Filter};
use subaperture::signal::window::Window;
use subaperture::simulate::Experiment;
use subaperture_tests::experiment::{
    FLIGHT, IDEAL, Line, PAIR, experiment, five_points, fmcw, point, pulsed, read_whole,
};

const C: f64 = 299_792_458.0;

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

/// Thermal noise by the radar equation, written out: 4 W, gains of 30 and 20, losses of 2 dB, noise figure 1.604 dB,
/// antenna temperature 100 K; 1 m² at 500 m (geometric mean of the two ranges), bandwidth as sampled.
#[test]
fn thermal_noise_power_matches_radar_equation() {
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
        // At least 20000 exponential variables: standard error 0.7 %; five times this is allowed. The range is 500.003
        // m.
        let ratio = power(&samples) / expected;
        assert!((ratio - 1.0).abs() < 0.035, "{ratio}");
    }
}

/// White noise of power `s^2` becomes `N s^2 mean(1 / |P|^2)` after the inverse filter and `N s^2 / mean |P|^2` after
/// the matched filter. Within a chirp's band, `|P|^2` is on average `rate^2 T / B` except for the part outside, 2 % for
/// `B T = 200`. The ratio of the two is that of the means, above 1.
#[test]
fn matched_filter_passes_less_noise_than_inverse_filter() {
    let mut empty = experiment(pulsed(10e9, 200e6, true), Vec::new());
    empty.radar.num_pulses = 200;
    empty.radar.receiver.noise = Some(ThermalNoise::Relative { power_db: -10.0 });
    let through = |filter| {
        let history = Compressed::new(empty.echoes(PAIR).unwrap(), filter).unwrap();
        power(&read_whole(&history))
    };
    let (inverse, matched) = (through(Filter::Inverse), through(Filter::Matched));
    let expected = 0.1 * 625.0 * 200e6 / (250e6f64.powi(2) * 1e-6);
    // 100000 values: standard error 0.3 %.
    let ratio = matched / expected;
    println!(
        "matched {ratio:.4} of N s^2 B / (rate^2 T), inverse {:.4}",
        inverse / expected
    );
    assert!((ratio - 1.0).abs() < 0.04, "{ratio}");
    assert!(inverse > 1.01 * matched, "{inverse} {matched}");
}

/// Delay of a single scatterer relative to the reference, from the mean phase step between frequencies, with a small
/// weight of the band's edges.
fn relative_delay_s(row: &[Complex32], step_hz: f64) -> f64 {
    let weights = Window::Hamming.weights(row.len() - 1);
    let pairs = row.windows(2).zip(weights).map(|(pair, weight)| {
        let wide = |z: Complex32| Complex64::new(z.re.into(), z.im.into());
        wide(pair[1]) * wide(pair[0]).conj() * weight
    });
    -pairs.sum::<Complex64>().arg() / (TAU * step_hz)
}

/// A clock that is fast by 1e-4 lengthens all ranges by 1e-4, 5 cm at 500 m, and samples its pulses earlier than
/// recorded. The range is measured by the phase slope: exact for pulses except for float32. For FMCW, the ripple of the
/// sweep's edges, at most 3 % in phase and weighted by a tenth, gives less than 1 mm over 350 steps of 0.4 MHz.
#[test]
fn fast_clock_lengthens_ranges() {
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

/// Jitter of 1 ns: over 400 pulses the RMS delay has a standard error of `1 / sqrt(800)`, 3.5 %. An FMCW sweep mixed
/// with its own copy is not affected by the sampling time: beat frequencies stay the same.
#[test]
fn jitter_shifts_pulses_but_not_fmcw_beats() {
    for (waveform, expected_s) in [
        (IDEAL, 1e-9),
        (pulsed(10e9, 200e6, true), 1e-9),
        (fmcw(false), 0.0),
    ] {
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
        assert!((rms_s - expected_s).abs() < 0.15e-9, "{rms_s}");
    }
}

/// A tone 30 MHz from a pulsed receiver's centre frequency appears with full power in every sample of the fraction of
/// pulses given by its duty cycle; beyond half the sample rate it does not appear. In an FMCW sweep it appears for
/// `rate / chirp`: 125 of 501 samples. Noise over 20 MHz has the given power.
#[test]
fn interference_has_stated_power_frequency_and_duty() {
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
        // 30 MHz at a sample rate of 250 MHz.
        let turn = relative_delay_s(row, 1.0) + 30.0 / 250.0;
        assert!((turn - turn.round()).abs() < 1e-6, "{turn}");
    }
    // Binomial: 150 of 500, standard deviation 10.2; five times this is allowed.
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
    // 20 MHz for 2.5 us: 50 independent values per pulse, 25000 in total: standard error 0.6 %.
    let ratio = power(&disturbed(pulsed(10e9, 200e6, true), noise)) / full;
    assert!((ratio - 1.0).abs() < 0.04, "{ratio}");
}

/// Experiment with all receiver impairments.
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

/// Samples do not depend on the order of reading or the number of threads, and differ for another seed.
#[test]
fn samples_depend_only_on_the_seed() {
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
