//! Points near a straight track, seen by antennas with a Gaussian beam, and the plain sum over the pulses that illuminate each block.

use std::ops::Range;

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use subaperture::geometry::{ImageGrid, SceneFrame};
use subaperture::phase_history::{
    Collection, InMemory, PhaseHistory, Pulse, PulseRange, Sweep, Weights,
};
use subaperture_tests::plain_history::{complex, plain_pulse, plain_sum};
use subaperture_tests::plain_sum::hamming;

pub(crate) const GRID: &str = "x=-24:20.6:0.6,y=297:303.1:0.75";
pub(crate) const WIDTH_RAD: f64 = 0.07;

/// Sine of the angle of a place forward of broadside, on a track along x.
fn sine(pulse: &Pulse, place_m: DVec3) -> f64 {
    let from = place_m - pulse.transmitter_m;
    from.x / from.length()
}

/// Pulses along 96 m in 2.4 s, whose antennas point `squint_rad` forward of broadside, by the pulse's number.
pub(crate) fn strip(
    name: &str,
    num_pulses: usize,
    squint_rad: impl Fn(usize) -> f64,
) -> (Collection, Vec<Complex32>) {
    let step_m = 96.0 / num_pulses as f64;
    let interval_s = 2.4 / num_pulses as f64;
    let pulses = (0..num_pulses).map(|n| {
        let antenna_m = DVec3::new(step_m * (n as f64 - 0.5 * num_pulses as f64), 0.0, 60.0);
        Pulse {
            transmitter_m: antenna_m,
            receiver_m: antenna_m,
            reference_m: DVec3::ZERO,
            reference_path_m: 0.0,
            start_hz: 9.95e9,
            step_hz: 3e6,
            time_s: interval_s * n as f64,
            sweep: Sweep::AT_ONCE,
            recorded_path_m: None,
        }
    });
    let collection = Collection {
        name: name.to_owned(),
        frame: SceneFrame::Local,
        pulses: pulses.collect(),
        num_samples: 32,
        timed: true,
        extent: None,
    };
    let points_m = [[-15.0, 299.0, 0.0], [0.3, 301.2, 0.0], [12.0, 300.0, 0.0]];
    let mut samples = Vec::new();
    for (n, pulse) in collection.pulses.iter().enumerate() {
        let plain = plain_pulse(pulse, 1.0);
        let seen = points_m.map(|point_m| {
            let off = (sine(pulse, point_m.into()).asin() - squint_rad(n)) / WIDTH_RAD;
            (point_m, [(-4.0 * 2f64.ln() * off * off).exp(), 0.0])
        });
        for k in 0..collection.num_samples {
            let [re, im] = plain.echo(k, &seen);
            samples.push(Complex32::new(re as f32, im as f32));
        }
    }
    (collection, samples)
}

/// The plain sum at every pixel over the pulses that illuminate its block, with the tests' own Hamming window over these pulses. `check` compares
/// them with the pulses whose antennas point within half the width of the block's middle.
pub(crate) fn expected(
    history: &InMemory,
    grid: &ImageGrid,
    weights: &Weights,
    squint_rad: impl Fn(usize) -> f64,
    check: impl Fn(&Range<usize>, &[usize]),
) -> Vec<Complex64> {
    let lit = weights.illumination.as_ref().unwrap();
    let columns = grid.columns.count;
    let mut values = vec![Complex64::ZERO; grid.num_pixels() as usize];
    for block in 0..lit.num_blocks() {
        let [rows, across] = lit.place(block);
        let middle = [rows.start + rows.len() / 2, across.start + across.len() / 2];
        let middle_m = grid.position_m(middle[0], middle[1]);
        let pulses = &history.collection().pulses;
        let off_rad = |n: usize| (sine(&pulses[n], middle_m).asin() - squint_rad(n)).abs();
        let sees: Vec<usize> = (0..pulses.len())
            .filter(|&n| off_rad(n) <= 0.5 * WIDTH_RAD)
            .collect();
        let range = lit.pulses(block);
        check(&range, &sees);
        let part = PulseRange::new(history, range.clone());
        let own = Weights {
            fast: hamming(32),
            slow: hamming(range.len()),
            illumination: None,
            windows: None,
        };
        let pixels: Vec<usize> = rows
            .flat_map(|row| across.clone().map(move |column| row * columns + column))
            .collect();
        let points_m: Vec<[f64; 3]> = pixels
            .iter()
            .map(|i| grid.position_m(i / columns, i % columns).to_array())
            .collect();
        let sums = complex(&plain_sum(&part, &own).at(&points_m));
        for (pixel, sum) in pixels.into_iter().zip(sums) {
            values[pixel] = sum;
        }
    }
    values
}
