//! Errors of range and phase of targets, compared with their standard deviations and with the Cramer-Rao bound.

use std::f64::consts::TAU;

use glam::DVec2;
use subaperture_model::monitor::Silent;
use subaperture_motion::Sighting;
use subaperture_motion::targets::{Detections, Settings, detect_targets};
use subaperture_signal::window::Window;

use crate::scene::{C_M_S, Recording, Reflector, Truth, l_band, reflector};

const PULSES: usize = 400;

/// Detections of a stationary radar.
fn seen(reflectors: &[Reflector], noise: f64, window: Window) -> Detections {
    let still = [Truth::default(); PULSES];
    let radar = l_band();
    let recording = Recording {
        radar: &radar,
        truth: &still,
        recorded: &still,
        reflectors,
        noise,
        seed: 5,
    };
    let settings = Settings {
        window,
        ..Settings::default()
    };
    detect_targets(recording.channels(), &settings, &Silent).unwrap()
}

/// Mean and RMS deviation from it.
fn spread(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let values: Vec<f64> = values.collect();
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let square = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / count;
    [mean, square.sqrt()]
}

/// True path of each channel, metres.
fn paths_m(at_m: DVec2) -> [f64; 2] {
    let radar = l_band();
    [0, 1].map(|r| at_m.length() + at_m.distance(radar.receivers_m[r]))
}

/// Sightings of the target at `at_m` with their errors of range and of the phase of channel `c`.
fn errors(seen: &Detections, at_m: DVec2, c: usize) -> (Vec<Sighting>, Vec<f64>, Vec<f64>) {
    let paths_m = paths_m(at_m);
    let range_m = 0.25 * (paths_m[0] + paths_m[1]);
    let all = seen.pulses.iter().flatten();
    let own: Vec<Sighting> = all
        .filter(|sighting| (sighting.range_m - range_m).abs() < 0.05)
        .cloned()
        .collect();
    let phase_rad = -TAU * (l_band().middle_hz() * paths_m[c] / C_M_S).fract();
    let ranges = own.iter().map(|s| s.range_m - range_m).collect();
    let off = |s: &Sighting| {
        let turns = (s.phases_rad[c] - phase_rad) / TAU;
        // Paths are ambiguous by `c / step`, which would rotate the phase of a band with an even number of samples by pi; this number is odd.
        TAU * (turns - turns.round())
    };
    let phases = own.iter().map(off).collect();
    (own, ranges, phases)
}

/// The standard deviation of 400 pulses is uncertain by 3.5 %. The limit is four times that, plus 3 % for the noise estimate from 24 cells.
#[test]
fn errors_agree_with_standard_deviations_and_bound() {
    let at_m = DVec2::new(1.7, 9.3);
    let alone = [reflector(at_m.x, at_m.y, 1.0)];
    for (window, snr_db) in [
        (Window::None, 20.0),
        (Window::Taylor { side_lobe_db: 50.0 }, 15.0),
        (Window::Taylor { side_lobe_db: 50.0 }, 30.0),
        (Window::Hamming, 40.0),
    ] {
        // SNR of all samples together.
        let noise = 151f64.sqrt() * 10f64.powf(-snr_db / 20.0);
        let seen = seen(&alone, noise, window);
        let (own, ranges, phases) = errors(&seen, at_m, 1);
        assert!(own.len() > PULSES - 60, "{}", own.len());
        let count = (own.len() as f64).sqrt();
        let [range, phase] = [ranges, phases].map(|errors| spread(errors.into_iter()));
        let stated = |of: fn(&Sighting) -> f64| {
            let squares: f64 = own.iter().map(|s| of(s).powi(2)).sum();
            (squares / own.len() as f64).sqrt()
        };
        let (range_sigma, phase_sigma) =
            (stated(|s| s.range_sigma_m), stated(|s| s.phase_sigma_rad));
        // Bound for two channels of K samples each: var(path) = s^2 / (2 a^2 sum kappa^2), sum kappa^2 = (2 pi step / c)^2 K (K^2 - 1) / 12.
        let k = 151f64;
        let kappa2 = (TAU * 4e6 / C_M_S).powi(2) * k * (k * k - 1.0) / 12.0;
        let bounds = [
            0.5 * noise / (2.0 * 2.0 * kappa2).sqrt(),
            noise / (2.0 * k).sqrt(),
        ];
        println!(
            "{window}, {snr_db} dB: range {:.3} mm, stated {:.3}, bound {:.3}; phase {:.2} mrad, stated {:.2}, bound {:.2}; off by {:.3} mm, {:.2} mrad",
            1e3 * range[1],
            1e3 * range_sigma,
            1e3 * bounds[0],
            1e3 * phase[1],
            1e3 * phase_sigma,
            1e3 * bounds[1],
            1e3 * range[0],
            1e3 * phase[0],
        );
        for ([mean, rms], sigma, bound) in [
            (range, range_sigma, bounds[0]),
            (phase, phase_sigma, bounds[1]),
        ] {
            assert!((rms / sigma - 1.0).abs() < 0.17, "{rms} {sigma}");
            // Unbiased, within four standard deviations of the mean.
            assert!(mean.abs() < 4.0 * rms / count, "{mean} {rms}");
            // Windows lose up to 1.8 dB of SNR, and as much of the RMS bandwidth.
            assert!((0.86..1.6).contains(&(rms / bound)), "{rms} {bound}");
        }
    }
}

/// A neighbour two cells away is subtracted; its residual is below the noise.
#[test]
fn neighbour_biases_neither_range_nor_phase() {
    let (at_m, neighbour_m) = (DVec2::new(1.7, 9.3), DVec2::new(-2.0, 9.75));
    let scene = [
        reflector(at_m.x, at_m.y, 1.0),
        reflector(neighbour_m.x, neighbour_m.y, 1.5),
    ];
    let noise = 151f64.sqrt() * 10f64.powf(-30.0 / 20.0);
    let seen = seen(&scene, noise, Window::Taylor { side_lobe_db: 50.0 });
    let (own, ranges, phases) = errors(&seen, at_m, 0);
    assert!(own.len() > PULSES - 60, "{}", own.len());
    let [range, phase] = [ranges, phases].map(|errors| spread(errors.into_iter()));
    println!("{range:?} {phase:?}");
    // The standard deviations without the neighbour are 1.4 mm and 0.027 rad.
    assert!(
        range[0].abs() < 1e-3 && phase[0].abs() < 0.01,
        "{range:?} {phase:?}"
    );
}
