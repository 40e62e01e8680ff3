//! Maps of patches by their defining sum in float64: the oracle for code that makes or reads maps.

use num_complex::{Complex32, Complex64};
use rayon::prelude::*;
use subaperture::SPEED_OF_LIGHT_M_S;
use subaperture::module::maps::{OwnedMap, OwnedSamples};
use subaperture::phase_history::{PhaseHistory, Pulse};
use subaperture_core::Sc16;
use subaperture_core::stream::{BlockFloat, MapHeader, Node, Patch, Setup};

/// Maps of all sub-CPIs and `patches`, by sub-CPI. The weights `fast` sum to 1.
///
/// # Panics
/// If the history cannot be read.
pub fn maps(
    history: &dyn PhaseHistory,
    setup: &Setup,
    patches: &[Patch],
    fast: &[f32],
    slow: &[f64],
) -> Vec<OwnedMap> {
    let collection = history.collection();
    let (length, width) = (usize::from(setup.num_pulses), collection.num_samples);
    let mut all = Vec::new();
    for (number, pulses) in collection.pulses.chunks(length).enumerate() {
        let first = number * length;
        let mut samples = vec![Complex32::ZERO; pulses.len() * width];
        history
            .read(first..first + pulses.len(), &mut samples)
            .unwrap();
        let slow = &slow[first..first + pulses.len()];
        let nodes = nodes(pulses);
        all.par_extend(
            patches
                .par_iter()
                .enumerate()
                .map(|(index, &patch)| OwnedMap {
                    header: MapHeader {
                        sub_cpi: number as u32,
                        patch_index: index as u16,
                        channel: 0,
                        num_pulses: pulses.len() as u16,
                        patch,
                        time_s: [pulses[0].time_s, pulses[pulses.len() - 1].time_s],
                        weight_sum: slow.iter().sum::<f64>() as f32,
                        nodes,
                    },
                    samples: OwnedSamples::Float(map(setup, &patch, pulses, &samples, fast, slow)),
                }),
        );
    }
    all
}

/// One map, as `subaperture_core::stream` defines it.
fn map(
    setup: &Setup,
    patch: &Patch,
    pulses: &[Pulse],
    samples: &[Complex32],
    fast: &[f32],
    slow: &[f64],
) -> Vec<Complex32> {
    let tau = std::f64::consts::TAU;
    let (count, middle) = (fast.len(), (pulses.len() as f64 - 1.0) / 2.0);
    let rows = patch.num_doppler_bins();
    let delays_s: Vec<f64> = pulses
        .iter()
        .map(|p| p.relative_path_m(patch.centre_m.into()) / SPEED_OF_LIGHT_M_S)
        .collect();
    // Keystone and Doppler: lines[row][k].
    let mut lines = vec![Complex64::ZERO; rows * count];
    for k in 0..count {
        let f_hz = setup.start_hz + k as f64 * setup.step_hz;
        for m in 0..pulses.len() {
            let turns = f_hz * delays_s[m];
            let z = samples[m * count + k];
            let z = Complex64::new(z.re.into(), z.im.into())
                * Complex64::cis(tau * turns.fract())
                * (f64::from(fast[k]) * slow[m]);
            let rate =
                f_hz / setup.centre_hz() * (m as f64 - middle) / f64::from(setup.doppler_length);
            let step = Complex64::cis(-tau * rate);
            let mut turn = Complex64::cis(tau * rate * f64::from(patch.doppler_reach));
            for row in 0..rows {
                lines[row * count + k] += z * turn;
                turn *= step;
            }
        }
    }
    // Range.
    let reach = i32::from(patch.range_reach);
    let mut out = Vec::with_capacity(patch.map_len());
    for line in lines.chunks_exact(count) {
        for r in -reach..=reach {
            let angle = tau * f64::from(r) / f64::from(setup.range_length);
            let step = Complex64::cis(angle);
            let mut turn = Complex64::cis(-angle * (count / 2) as f64);
            let mut sum = Complex64::ZERO;
            for z in line {
                sum += z * turn;
                turn *= step;
            }
            sum /= pulses.len() as f64;
            out.push(Complex32::new(sum.re as f32, sum.im as f32));
        }
    }
    out
}

/// Gaussian nodes of a quadratic fitted to the antenna positions: normal equations, solved by elimination.
fn nodes(pulses: &[Pulse]) -> [Node; 2] {
    let middle = (pulses.len() as f64 - 1.0) / 2.0;
    let place = ((pulses.len() as f64).powi(2) - 1.0).sqrt() / 12f64.sqrt();
    let order = pulses.len().min(3);
    // Slow time in units of half the sub-CPI, for well-scaled equations.
    let scale = middle.max(1.0);
    let fit = |value: &dyn Fn(&Pulse) -> f64, u: f64| {
        let base = value(&pulses[0]);
        let mut system = [[0.0; 4]; 3];
        for (i, pulse) in pulses.iter().enumerate() {
            let x = (i as f64 - middle) / scale;
            let powers = [1.0, x, x * x];
            for row in 0..order {
                for column in 0..order {
                    system[row][column] += powers[row] * powers[column];
                }
                system[row][3] += powers[row] * (value(pulse) - base);
            }
        }
        for pivot in 0..order {
            let lead = system[pivot];
            for (i, row) in system.iter_mut().enumerate().take(order) {
                if i != pivot {
                    let factor = row[pivot] / lead[pivot];
                    for j in 0..4 {
                        row[j] -= factor * lead[j];
                    }
                }
            }
        }
        let x = u / scale;
        let coefficient = |i: usize| {
            if i < order {
                system[i][3] / system[i][i]
            } else {
                0.0
            }
        };
        base + coefficient(0) + coefficient(1) * x + coefficient(2) * x * x
    };
    [-place, place].map(|u| Node {
        transmitter_m: std::array::from_fn(|i| fit(&|p| p.transmitter_m[i], u)),
        receiver_m: std::array::from_fn(|i| fit(&|p| p.receiver_m[i], u)),
    })
}

/// The same map in blocks with a common exponent, each part of a sample rounded to 16 bits.
///
/// # Panics
/// If the map is in blocks already.
pub fn in_blocks(map: &OwnedMap) -> OwnedMap {
    let OwnedSamples::Float(samples) = &map.samples else {
        panic!("a map in float32 is needed");
    };
    let (mut mantissas, mut exponents) = (Vec::new(), Vec::new());
    for row in samples.chunks(map.header.patch.num_range_bins()) {
        for block in row.chunks(BlockFloat::BLOCK) {
            let largest = block
                .iter()
                .fold(0f32, |a, z| a.max(z.re.abs()).max(z.im.abs()));
            // Below 2^exponent by one part in 2^15, so that rounding cannot overflow.
            let exponent = if largest > 0.0 {
                (largest * (1.0 + 1.0 / 16384.0)).log2().floor() as i8 + 1
            } else {
                0
            };
            exponents.push(exponent);
            mantissas.extend(block.iter().map(|z| {
                let (value, clamped) = Sc16::from_complex32(z / 2f32.powi(exponent.into()));
                assert!(!clamped);
                value
            }));
        }
    }
    OwnedMap {
        header: map.header,
        samples: OwnedSamples::Fixed {
            mantissas,
            exponents,
        },
    }
}

/// Fast-time weights with sum 1, as a module uses them.
pub fn fast_weights(weights: &[f64]) -> Vec<f32> {
    let sum: f64 = weights.iter().sum();
    weights.iter().map(|w| (w / sum) as f32).collect()
}
