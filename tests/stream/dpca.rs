//! Clutter cancellation of two channels against theory, on simulated clutter, noise and a moving target.
//!
//! Paths are computed in float64 for every scatterer, pulse and channel, from the positions of the antennas: the alignment of the channels is
//! not part of the simulation.

use std::f64::consts::{PI, TAU};

use num_complex::{Complex32, Complex64};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use subaperture_core::cfar::{Cfar, Column, Detection, TrainingWindow};
use subaperture_core::dpca::{Balance, Difference, Dpca, DpcaError};
use subaperture_core::stream::{
    Engine, FixedBuffers, FloatBuffers, Patch, Progress, Sample, Setup, SubCpiProcessor,
};
use subaperture_core::{Pulse, Sc16};

const C: f64 = 299_792_458.0;
/// Pulses per sub-CPI and channel, frequencies, range bins, Doppler bins per cycle, Doppler rows.
const M: usize = 32;
const F: usize = 32;
const R: usize = 64;
const D: usize = 64;
const ROWS: usize = 21;
/// Pulses between sub-CPIs of the same scene: their noise is independent.
const SUB_CPIS: usize = 8;

/// Speed in metres per pulse, and pulse repetition interval in seconds: 125 m/s.
const STEP_M: f64 = 0.125;
const PRI_S: f64 = 1e-3;
const RANGE_M: f64 = 1000.0;

/// Gain of the receiver of channel 1, noise included.
const GAIN: Complex64 = Complex64::new(0.36, 0.71);

const SETUP: Setup = Setup {
    num_pulses: M as u16,
    num_channels: 2,
    num_frequencies: F as u16,
    range_length: R as u16,
    doppler_length: D as u16,
    start_hz: 9.95e9,
    // A bandwidth of 1 %.
    step_hz: 3.125e6,
};

const PATCH: Patch = Patch {
    centre_m: [0.0, RANGE_M, 0.0],
    range_reach: 15,
    doppler_reach: 10,
};

fn wavelength_m() -> f64 {
    C / SETUP.centre_hz()
}

/// Slow-time weights of both channels.
#[derive(Clone, Copy, PartialEq)]
enum Window {
    /// Those of the cancellation.
    Displaced,
    /// The same Hann window in both channels.
    Equal,
}

/// Point with a velocity and an amplitude.
#[derive(Clone, Copy)]
struct Point {
    position_m: [f64; 2],
    velocity_m_s: [f64; 2],
    amplitude: Complex64,
}

fn uniform(rng: &mut ChaCha8Rng) -> f64 {
    (f64::from(rng.next_u32()) + 0.5) / 4_294_967_296.0
}

/// Circular Gaussian number of power 1.
fn gaussian(rng: &mut ChaCha8Rng) -> Complex64 {
    let radius = (-uniform(rng).ln()).sqrt();
    Complex64::cis(TAU * uniform(rng)) * radius
}

/// Stationary scatterers over three quarters of the unambiguous Doppler extent and 70 m of path, of mean total power 1.
fn clutter() -> Vec<Point> {
    const COUNT: usize = 500;
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let mut point = || Point {
        position_m: [
            90.0 * (uniform(&mut rng) - 0.5),
            RANGE_M + 35.0 * (uniform(&mut rng) - 0.5),
        ],
        velocity_m_s: [0.0; 2],
        amplitude: gaussian(&mut rng) / (COUNT as f64).sqrt(),
    };
    (0..COUNT).map(|_| point()).collect()
}

/// Pulses `[pulse][channel]` of all sub-CPIs and their samples, without the gain of channel 1. The receivers are `2 lag` steps apart, so that the phase centre
/// of channel 1 is `lag` steps behind.
fn echoes(points: &[Point], lag: f64) -> Vec<Vec<Complex64>> {
    let mut all = Vec::new();
    for n in 0..SUB_CPIS * M {
        let along_m = STEP_M * (n as f64 - (SUB_CPIS * M) as f64 / 2.0);
        let time_s = PRI_S * (n as f64 - (SUB_CPIS * M) as f64 / 2.0);
        for channel in 0..2 {
            let receiver_m = receiver(along_m, channel, lag);
            let mut samples = vec![Complex64::ZERO; F];
            for point in points {
                let place: [f64; 2] =
                    std::array::from_fn(|i| point.position_m[i] + point.velocity_m_s[i] * time_s);
                let path_m = place[1].hypot(place[0] - along_m)
                    + place[1].hypot(place[0] - receiver_m)
                    - 2.0 * RANGE_M;
                let phasor = |hz: f64| Complex64::cis(-TAU * (hz * path_m / C).fract());
                let (mut value, step) = (
                    point.amplitude * phasor(SETUP.start_hz),
                    phasor(SETUP.step_hz),
                );
                for sample in &mut samples {
                    *sample += value;
                    value *= step;
                }
            }
            all.push(samples);
        }
    }
    all
}

fn receiver(along_m: f64, channel: usize, lag: f64) -> f64 {
    along_m + [1.0, -1.0][channel] * lag * STEP_M
}

fn pulses(lag: f64, window: Window) -> Vec<Pulse> {
    let numbers = (0..SUB_CPIS * M).flat_map(|n| [(n, 0), (n, 1)]);
    let pulse = |(n, channel): (usize, usize)| {
        let along_m = STEP_M * (n as f64 - (SUB_CPIS * M) as f64 / 2.0);
        let m = (n % M) as u16;
        let lag_pulses = match window {
            Window::Displaced => lag,
            Window::Equal => 0.0,
        };
        Pulse {
            number: (2 * n + channel) as u32,
            time_s: PRI_S * n as f64,
            transmitter_m: [along_m, 0.0, 0.0],
            receiver_m: [receiver(along_m, channel, lag), 0.0, 0.0],
            reference_path_m: 2.0 * RANGE_M,
            weight: Dpca { lag_pulses }.weight(channel as u16, m, M as u16),
        }
    };
    numbers.map(pulse).collect()
}

/// Hamming window; the sum is 1.
fn fast_weights() -> Vec<f32> {
    let shape = |k: usize| 0.54 - 0.46 * (TAU * (k as f64 + 0.5) / F as f64).cos();
    let sum: f64 = (0..F).map(shape).sum();
    (0..F).map(|k| (shape(k) / sum) as f32).collect()
}

/// Result of one sub-CPI.
struct Cancelled {
    gain: Complex32,
    /// Aligned values of both channels by cell, Doppler bins outermost.
    values: Vec<[Complex32; 2]>,
    difference: Vec<f32>,
    /// Detections on channel 0 and on the difference.
    found: [Vec<Detection>; 2],
}

const CFAR: Cfar = Cfar {
    range: TrainingWindow {
        guard: 3,
        training: 6,
    },
    doppler: TrainingWindow {
        guard: 4,
        training: 4,
    },
    false_alarm_probability: 1e-6,
};

/// Cancel all sub-CPIs of these echoes on a processor.
fn cancel<E: Engine<Sample: Sample>>(
    mut processor: SubCpiProcessor<'_, E>,
    samples: &[Vec<Complex64>],
    (lag, window): (f64, Window),
    sample: impl Fn(Complex64) -> E::Sample,
) -> Vec<Cancelled> {
    let dpca = Dpca { lag_pulses: lag };
    dpca.check(&SETUP).unwrap();
    processor.configure(&SETUP).unwrap();
    processor
        .set_weights(0, fast_weights().into_iter())
        .unwrap();
    processor.set_patch(0, &PATCH).unwrap();
    processor.start(0).unwrap();
    let mut kept = vec![Complex32::ZERO; Dpca::kept_len(&PATCH)];
    let mut columns = [Column::EMPTY; 2 * PATCH.range_reach as usize + 1];
    let mut found = heapless::Vec::<Detection, 32>::new();
    let (mut of_first, mut all) = (Vec::new(), Vec::new());
    for (pulse, samples) in pulses(lag, window).iter().zip(samples) {
        let gain = [Complex64::ONE, GAIN][(pulse.number % 2) as usize];
        let samples: Vec<E::Sample> = samples.iter().map(|z| sample(z * gain)).collect();
        processor.push(pulse, samples.iter().copied()).unwrap();
        loop {
            match processor.work() {
                Progress::Idle => break,
                Progress::Busy => continue,
                Progress::Map => {}
            }
            let map = processor.map().unwrap();
            if map.header.channel == 0 {
                let mut rows = 0;
                while dpca.keep_row(&SETUP, &map, rows, &mut kept) {
                    rows += 1;
                }
                CFAR.detect_in_map(&map, &mut columns, &mut found).unwrap();
                of_first = found.to_vec();
                continue;
            }
            let mut balance = Balance::new();
            while balance.step(&map, &mut kept) {}
            let difference = Difference {
                dpca: &dpca,
                setup: &SETUP,
                map: &map,
                kept: &kept,
                gain: balance.gain(),
            };
            let mut search = CFAR.begin().unwrap();
            let power = |row, column| difference.power(row, column);
            while search
                .step_in_cells(difference.shape(), power, &mut columns, &mut found)
                .unwrap()
            {}
            let cells = (-10..=10).flat_map(|d| (-15..=15).map(move |r| (d, r)));
            all.push(Cancelled {
                gain: balance.gain(),
                values: cells.map(|cell| difference.values(cell)).collect(),
                difference: (0..ROWS * 31)
                    .map(|i| power(i / 31, i % 31).unwrap())
                    .collect(),
                found: [of_first.clone(), found.to_vec()],
            });
        }
    }
    assert_eq!(all.len(), SUB_CPIS);
    all
}

fn float(samples: &[Vec<Complex64>], lag: f64, window: Window) -> Vec<Cancelled> {
    let mut buffers = Box::new(FloatBuffers::<{ 2 * M }, F, R, ROWS, 1>::new());
    let narrow = |z: Complex64| Complex32::new(z.re as f32, z.im as f32);
    cancel(buffers.processor(), samples, (lag, window), narrow)
}

/// In fixed point, with the scale that makes the largest part 0.9.
fn fixed(samples: &[Vec<Complex64>], lag: f64) -> (f64, Vec<Cancelled>) {
    let mut buffers = Box::new(FixedBuffers::<{ 2 * M }, F, R, ROWS, 2, 1>::new());
    let parts = samples
        .iter()
        .flatten()
        .flat_map(|z| [z.re.abs(), z.im.abs()]);
    let scale = 0.9 / parts.fold(0.0, f64::max);
    let narrow = |z: Complex64| {
        let z = z * scale;
        Sc16::from_complex32(Complex32::new(z.re as f32, z.im as f32)).0
    };
    let processor = buffers.processor().unwrap();
    (
        scale,
        cancel(processor, samples, (lag, Window::Displaced), narrow),
    )
}

fn db(ratio: f64) -> f64 {
    10.0 * ratio.log10()
}

/// Cancellation: power of both channels over that of the difference.
fn cancellation(all: &[Cancelled]) -> f64 {
    let wide = |power: f32| f64::from(power);
    let before: f64 = all
        .iter()
        .flat_map(|one| one.values.iter().flatten())
        .map(|value| wide(value.norm_sqr()))
        .sum();
    let after: f64 = all
        .iter()
        .flat_map(|one| &one.difference)
        .copied()
        .map(wide)
        .sum();
    before / after
}

/// Sum of echoes and of noise of this power per sample.
fn with_noise(samples: &[Vec<Complex64>], power: f64, seed: u64) -> Vec<Vec<Complex64>> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut noisy = samples.to_vec();
    for sample in noisy.iter_mut().flatten() {
        *sample += gaussian(&mut rng) * power.sqrt();
    }
    noisy
}

/// Power of noise in a cell for noise of power 1 per sample: both windows.
fn noise_gain(lag: f64) -> f64 {
    let fast: f64 = fast_weights().iter().map(|w| f64::from(*w).powi(2)).sum();
    let weight = |m| f64::from(Dpca { lag_pulses: lag }.weight(0, m, M as u16));
    let slow: f64 = (0..M as u16).map(|m| weight(m).powi(2)).sum();
    fast * slow / (M * M) as f64
}

/// Without noise, three limits remain. The lag within the band: at most `(2 pi d L / D)^2 (B / f)^2 / 12` of the power of a channel, `d` up to 10. With the
/// displaced window no other error remains, whole lag or not: the aliases of a Hann window of 30 pulses are below -80 dB. The same window in both
/// channels leaves `(4 / 3) pi^2 (L / M)^2` of the power of a channel.
#[test]
fn displaced_window_cancels_to_the_limit_of_the_bandwidth() {
    let points = clutter();
    for lag in [2.0, 1.37, -2.6] {
        let samples = echoes(&points, lag);
        let displaced = db(cancellation(&float(&samples, lag, Window::Displaced)));
        let equal = db(cancellation(&float(&samples, lag, Window::Equal)));
        let (_, in_fixed) = fixed(&samples, lag);
        let in_fixed = db(cancellation(&in_fixed));
        let edge = TAU * 10.0 * lag / D as f64 * (F as f64 * SETUP.step_hz / SETUP.centre_hz());
        let limit = db(2.0 * 12.0 / edge.powi(2));
        let without = db(2.0 * 3.0 / 4.0 / (PI * lag / M as f64).powi(2));
        println!(
            "lag {lag}: {displaced:.1} dB, fixed {in_fixed:.1} dB, limit {limit:.1}; equal windows {equal:.1}, theory {without:.1}"
        );
        assert!(displaced > limit, "{displaced}");
        // 16-bit maps add -74 dB.
        assert!(in_fixed > limit - 0.2, "{in_fixed}");
        // First order in L / M, and speckle of 8 maps of about 80 independent cells: 3 sigma are 0.5 dB.
        assert!((equal - without).abs() < 1.5, "{equal} {without}");
    }
}

/// Theory: `1 / (1 - |rho|) = 1 + CNR`. The difference has 8 sub-CPIs of about 80 independent cells each (31 bins of a third of a resolution cell with
/// Hamming window, 21 bins likewise with Hann window): its power varies by 1 / sqrt(640) = 4 %, that of clutter is measured. Least squares lowers
/// the power by (1 - rho) / 2 = 1.5 %, the error of the gain raises it by pi / 160: 3 sigma and both are 14 %, 0.6 dB.
#[test]
fn cancellation_ratio_equals_theory() {
    let points = clutter();
    for lag in [2.0, 1.37] {
        let samples = echoes(&points, lag);
        let quiet = float(&samples, lag, Window::Displaced);
        let cells = (SUB_CPIS * ROWS * 31) as f64;
        let power = quiet.iter().flat_map(|one| &one.values);
        let power: f64 = power.map(|[first, _]| f64::from(first.norm_sqr())).sum();
        for (cnr_db, seed) in [(15.0, 1), (20.0, 2), (30.0, 3)] {
            let noise = power / cells / noise_gain(lag) * 10f64.powf(-cnr_db / 10.0);
            let noisy = with_noise(&samples, noise, seed);
            let theory = db(1.0 + 10f64.powf(cnr_db / 10.0));
            let in_float = float(&noisy, lag, Window::Displaced);
            let (_, in_fixed) = fixed(&noisy, lag);
            for (name, all) in [("float", &in_float), ("fixed", &in_fixed)] {
                let measured = db(cancellation(all));
                println!(
                    "lag {lag}, CNR {cnr_db} dB, {name}: {measured:.2} dB, theory {theory:.2} dB"
                );
                assert!((measured - theory).abs() < 0.6, "{measured} {theory}");
                for one in all {
                    // Variance of the gain: pi / 2 (1 - rho^2) / 80; four sigma, and the bias of least squares.
                    let rho = 1.0 / (1.0 + 10f64.powf(-cnr_db / 10.0));
                    let gain = Complex64::new(one.gain.re.into(), one.gain.im.into());
                    let error = (gain * GAIN - 1.0).norm();
                    let most = 4.0 * (PI / 2.0 * (1.0 - rho * rho) / 80.0).sqrt() + (1.0 - rho);
                    assert!(error < most, "{error} {most}");
                }
            }
        }
    }
}

/// Index of a cell.
fn index((doppler_bin, range_bin): (i32, i32)) -> usize {
    ((doppler_bin + 10) * 31 + range_bin + 15) as usize
}

/// Detections within a resolution cell of the target.
fn near(found: &[Detection], doppler_bin: f64) -> Vec<Detection> {
    let close = |one: &&Detection| {
        (f64::from(one.doppler_bin) - doppler_bin).abs() < 3.0 && one.range_bin.abs() < 3.0
    };
    found.iter().filter(close).copied().collect()
}

/// A target of half the mean power of the clutter approaches at 1 m/s: `phi = 4 pi v tau / lambda` = 0.84 rad for 2 pulses, so the difference has 0.66 of its
/// power, at a CNR of 30 dB 22 dB above the noise of two channels. It has 4.3 Doppler bins and stays in its range bin.
///
/// The values are `C + S` and `C + S exp(j phi)`, `C` the clutter in the cell and `S` the target, both simulated alone in channel 0. Phases vary by the noise: the
/// error is below four standard deviations, `4 sqrt(N / 2) (1 / |x_0| + 1 / |x_1|)`, and the error of the gain, 0.02 rad.
#[test]
fn mover_below_the_clutter_is_detected_on_the_difference_only() {
    const SPEED_M_S: f64 = 1.0;
    let lag = 2.0;
    let points = clutter();
    let still = echoes(&points, lag);
    let quiet = float(&still, lag, Window::Displaced);
    let cells = (SUB_CPIS * ROWS * 31) as f64;
    let power = quiet.iter().flat_map(|one| &one.values);
    let power = power
        .map(|[first, _]| f64::from(first.norm_sqr()))
        .sum::<f64>()
        / cells;
    let mover = Point {
        position_m: [0.0, RANGE_M],
        velocity_m_s: [0.0, -SPEED_M_S],
        amplitude: Complex64::from((0.5 * power).sqrt()),
    };
    let moving = echoes(&[mover], lag);
    // The kept map and the values of channel 0 do not depend on the gain.
    let alone = float(&moving, lag, Window::Displaced);
    let mut samples = still.clone();
    for (sum, part) in samples.iter_mut().flatten().zip(moving.iter().flatten()) {
        *sum += part;
    }
    let noise = 1e-3 * power;
    let noisy = with_noise(&samples, noise / noise_gain(lag), 23);
    let phi = 4.0 * PI * SPEED_M_S * lag * PRI_S / wavelength_m();
    let in_float = float(&noisy, lag, Window::Displaced);
    let (scale, in_fixed) = fixed(&noisy, lag);
    for (name, scale, all) in [("float", 1.0, &in_float), ("fixed", scale, &in_fixed)] {
        for (n, one) in all.iter().enumerate() {
            // The middle of the sub-CPI is this long after that of the run.
            let after_s = PRI_S
                * (n as f64 * M as f64 + (M as f64 - 1.0) / 2.0 - (SUB_CPIS * M) as f64 / 2.0);
            let expected_bin = 2.0 * SPEED_M_S * PRI_S / wavelength_m() * D as f64;
            let [of_first, of_difference] =
                one.found.each_ref().map(|found| near(found, expected_bin));
            assert!(of_first.is_empty(), "{name} {n}: {of_first:?}");
            assert_eq!(of_difference.len(), 1, "{name} {n}: {:?}", one.found[1]);
            let found = of_difference[0];
            let range_bin = -2.0 * SPEED_M_S * after_s * R as f64 * SETUP.step_hz / C;
            assert!(
                (f64::from(found.range_bin) - range_bin).abs() < 1.0,
                "{found:?} {range_bin}"
            );
            assert!(
                (f64::from(found.doppler_bin) - expected_bin).abs() < 1.0,
                "{found:?}"
            );
            let cell = index(found.cell());
            let wide = |z: Complex32| Complex64::new(z.re.into(), z.im.into());
            let (clutter, target) = (
                wide(quiet[n].values[cell][0]),
                wide(alone[n].values[cell][0]),
            );
            let expected = [clutter + target, clutter + target * Complex64::cis(phi)];
            let values = one.values[cell].map(|z| wide(z) / scale);
            let phase = (values[1] * values[0].conj()).arg();
            let expected_rad = (expected[1] * expected[0].conj()).arg();
            let most =
                4.0 * (noise / 2.0).sqrt() * (1.0 / expected[0].norm() + 1.0 / expected[1].norm())
                    + 0.02;
            println!(
                "{name} {n}: {:.1} dB, phase {phase:.3}, expected {expected_rad:.3} +- {most:.3}, of the target {phi:.3}",
                db(f64::from(found.power / found.noise))
            );
            let error = phase - expected_rad;
            assert!(
                (error - TAU * (error / TAU).round()).abs() < most,
                "{name} {n}"
            );
        }
    }
}

/// A target 25 dB above the clutter: its phase is `4 pi v tau / lambda`, positive when it approaches, within `2 asin(|C| / |S|)`.
#[test]
fn phase_of_a_strong_mover_is_that_of_its_radial_velocity() {
    for (lag, speed_m_s) in [(2.0, 1.0), (2.0, -0.7), (-1.5, 0.8)] {
        let points = clutter();
        let still = echoes(&points, lag);
        let quiet = float(&still, lag, Window::Displaced);
        let values = quiet.iter().flat_map(|one| &one.values);
        let power = values
            .map(|[first, _]| f64::from(first.norm_sqr()))
            .sum::<f64>()
            / (SUB_CPIS * ROWS * 31) as f64;
        let amplitude = (power * 10f64.powf(2.5)).sqrt();
        let mover = Point {
            position_m: [0.0, RANGE_M],
            velocity_m_s: [0.0, -speed_m_s],
            amplitude: amplitude.into(),
        };
        let samples = echoes(&[points, vec![mover]].concat(), lag);
        let phi = 4.0 * PI * speed_m_s * lag * PRI_S / wavelength_m();
        for (n, one) in float(&samples, lag, Window::Displaced).iter().enumerate() {
            let strongest = one.found[1][0];
            let cell = index(strongest.cell());
            let [first, second] = one.values[cell];
            let clutter = f64::from(quiet[n].values[cell][0].norm());
            // The cell is at most half a bin off in both axes: 0.9 dB.
            let most = 2.0 * (clutter / (0.9 * amplitude)).asin() + 0.02;
            let phase = f64::from((second * first.conj()).arg());
            println!("{speed_m_s} m/s: phase {phase:.3}, expected {phi:.3} +- {most:.3}");
            assert!((phase - phi).abs() < most, "{phase} {phi}");
        }
    }
}

#[test]
fn settings_without_a_baseline_or_a_second_channel_are_refused() {
    let check = |lag_pulses, num_channels| {
        let setup = Setup {
            num_channels,
            ..SETUP
        };
        Dpca { lag_pulses }.check(&setup)
    };
    for lag in [2.0, -0.3, 16.0, -16.0] {
        assert_eq!(check(lag, 2), Ok(()));
    }
    for found in [0, 1, 3] {
        assert_eq!(check(2.0, found), Err(DpcaError::Channels { found }));
    }
    assert_eq!(check(0.0, 2), Err(DpcaError::NoLag));
    for lag in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert_eq!(check(lag, 2), Err(DpcaError::NotFinite));
    }
    let too_long = |found| Err(DpcaError::LagTooLong { found, most: 16 });
    assert_eq!(check(-16.5, 2), too_long(17));
    assert_eq!(check(1e300, 2), too_long(u32::MAX));
    assert_eq!(Dpca::check_patch(&PATCH, 22 * 31), Ok(()));
    let error = Dpca::check_patch(&PATCH, 22 * 31 - 1).unwrap_err();
    assert_eq!(
        error.to_string(),
        "map kept for the clutter cancellation: expected at most 681 values, found 682"
    );
}
