//! Phase history in the form of [`crate::plain_sum`], and its results as the library's types.

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use subaperture::geometry::ImageGrid;
use subaperture::phase_history::{Collection, PhaseHistory, Pulse, Weights};

use crate::experiment::read_whole;
use crate::plain_sum::{Complex, PlainPulse, PlainSum};

/// A pulse of the plain sum with a slow-time weight.
pub fn plain_pulse(pulse: &Pulse, weight: f64) -> PlainPulse {
    PlainPulse {
        transmitter_m: pulse.transmitter_m.to_array(),
        receiver_m: pulse.receiver_m.to_array(),
        reference_path_m: pulse.reference_path_m,
        start_hz: pulse.start_hz,
        step_hz: pulse.step_hz,
        weight,
    }
}

/// Samples as pairs of float64.
pub fn plain_samples(samples: &[Complex32]) -> Vec<Complex> {
    samples.iter().map(|z| [z.re.into(), z.im.into()]).collect()
}

/// A history with its weights for the plain sum.
pub fn plain_sum(history: &dyn PhaseHistory, weights: &Weights) -> PlainSum {
    let pulses = history.collection().pulses.iter().zip(&weights.slow);
    PlainSum {
        pulses: pulses
            .map(|(pulse, &slow)| plain_pulse(pulse, slow))
            .collect(),
        samples: plain_samples(&read_whole(history)),
        fast: weights.fast.clone(),
    }
}

/// Echoes of scatterers by the plain sum, rounded to float32.
pub fn plain_echoes(collection: &Collection, scatterers: &[([f64; 3], Complex)]) -> Vec<Complex32> {
    let mut samples = Vec::new();
    for pulse in &collection.pulses {
        let pulse = plain_pulse(pulse, 1.0);
        for k in 0..collection.num_samples {
            let [re, im] = pulse.echo(k, scatterers);
            samples.push(Complex32::new(re as f32, im as f32));
        }
    }
    samples
}

/// Pixel positions of a grid by row, metres.
pub fn pixels_m(grid: &ImageGrid) -> Vec<DVec3> {
    let columns = grid.columns.count;
    (0..grid.rows.count * columns)
        .map(|i| grid.position_m(i / columns, i % columns))
        .collect()
}

/// Image of a history on a grid by the plain sum.
pub fn plain_image(
    history: &dyn PhaseHistory,
    weights: &Weights,
    grid: &ImageGrid,
) -> Vec<Complex64> {
    let points_m: Vec<[f64; 3]> = pixels_m(grid).iter().map(DVec3::to_array).collect();
    complex(&plain_sum(history, weights).at(&points_m))
}

/// Values as complex numbers.
pub fn complex(values: &[Complex]) -> Vec<Complex64> {
    let values = values.iter();
    values.map(|&[re, im]| Complex64::new(re, im)).collect()
}
