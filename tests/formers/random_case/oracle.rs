//! Samples and the matched filter's sum, written out.

use std::f64::consts::TAU;

use num_complex::{Complex32, Complex64};
use subaperture::geometry::SceneFrame;
use subaperture::phase_history::{Collection, InMemory, Pulse, Sweep, Weights};

use super::draw::Random;
use super::{Case, LIGHT_M_S};

/// Recorded samples: `sum_s A_s exp(-j 2 pi f_k (path_n(s) - reference_n) / c)` plus noise, rounded to float32.
pub(crate) fn history(case: &Case) -> InMemory {
    let count = case.num_pulses;
    let mut samples = Vec::with_capacity(count * case.num_samples);
    let mut random = Random::new(case.seed ^ 0x006e_6f69_7365);
    for n in 0..count {
        let [transmitter, receiver] = case.track.at(n, count);
        let reference_m = case.track.reference_path_m(n, count);
        let mut row = vec![Complex64::ZERO; case.num_samples];
        for point in &case.points {
            let path_m = (point.at_m - transmitter).length() + (point.at_m - receiver).length();
            let delay_s = (path_m - reference_m) / LIGHT_M_S;
            for (k, z) in row.iter_mut().enumerate() {
                let turns = (case.start_hz + k as f64 * case.step_hz) * delay_s;
                *z += point.amplitude * Complex64::cis(-TAU * turns.fract());
            }
        }
        for z in &mut row {
            if case.noise > 0.0 {
                *z += Complex64::new(random.normal(), random.normal()) * case.noise;
            }
            samples.push(Complex32::new(z.re as f32, z.im as f32));
        }
    }
    let pulses = (0..count).map(|n| {
        let [transmitter_m, receiver_m] = case.track.at(n, count);
        Pulse {
            time_s: n as f64,
            transmitter_m,
            receiver_m,
            reference_m: glam::DVec3::ZERO,
            reference_path_m: case.track.reference_path_m(n, count),
            start_hz: case.start_hz,
            step_hz: case.step_hz,
            sweep: Sweep::AT_ONCE,
            // The sum is defined at all places.
            recorded_path_m: Some([0.0, 1e12]),
        }
    });
    let collection = Collection {
        name: "random".to_owned(),
        num_samples: case.num_samples,
        pulses: pulses.collect(),
        frame: SceneFrame::Local,
        extent: None,
        timed: true,
    };
    InMemory::new(collection, samples).expect("samples are finite and as many as they should be")
}

/// `sum_n sum_k w_n w_k z[n][k] exp(+j 2 pi f_k (path_n(p) - reference_n) / c)`, normalised, at every pixel.
pub(crate) fn exact_sum(case: &Case, history: &InMemory, weights: &Weights) -> Vec<Complex64> {
    use subaperture::phase_history::PhaseHistory;
    let (count, width) = (case.num_pulses, case.num_samples);
    let mut samples = vec![Complex32::ZERO; count * width];
    history
        .read(0..count, &mut samples)
        .expect("samples in memory can be read");
    let fast: f64 = weights.fast.iter().sum();
    let slow: f64 = weights.slow.iter().sum();
    let rows: Vec<_> = (0..count)
        .map(|n| {
            let row = &samples[n * width..(n + 1) * width];
            let weighted: Vec<Complex64> = row
                .iter()
                .zip(&weights.fast)
                .map(|(z, w)| {
                    Complex64::new(f64::from(z.re), f64::from(z.im)) * (w * weights.slow[n])
                })
                .collect();
            let antennas = case.track.at(n, count);
            (antennas, case.track.reference_path_m(n, count), weighted)
        })
        .collect();
    let [_, columns] = case.plane.counts;
    (0..case.plane.counts[0] * columns)
        .map(|i| {
            let point = case.plane.place_m(i / columns, i % columns);
            let mut sum = Complex64::ZERO;
            for ([transmitter, receiver], reference_m, row) in &rows {
                let path_m = (point - *transmitter).length() + (point - *receiver).length();
                let delay_s = (path_m - reference_m) / LIGHT_M_S;
                let mut turn = Complex64::cis(TAU * (case.start_hz * delay_s).fract());
                let step = Complex64::cis(TAU * (case.step_hz * delay_s).fract());
                for z in row {
                    sum += z * turn;
                    turn *= step;
                }
            }
            sum / (fast * slow)
        })
        .collect()
}
