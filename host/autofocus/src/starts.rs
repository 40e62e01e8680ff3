//! Initial phase estimates from tiles: phase gradient over all range cells, with windows that narrow around the brightest
//! cell of each (Wahl, Eichel, Ghiglia and Jakowatz, Phase gradient autofocus, 1994).

use num_complex::Complex64;
use rayon::prelude::*;

use subaperture_fft::{forward, inverse};
use subaperture_signal::phase::cis;

use super::likelihood::Texture;
use super::tiles::without_trend;

/// Number of estimates with each window, and width of the narrowest window, cross-range cells.
const ROUNDS: usize = 2;
const NARROWEST: usize = 6;

/// Phase estimate after each width of the window, widest first.
pub(crate) fn by_gradient(texture: &Texture, turns: usize) -> Vec<Vec<f64>> {
    let mut phases = vec![0.0; turns];
    let mut all = Vec::new();
    let mut width = turns;
    while width >= NARROWEST.min(turns) {
        for _ in 0..ROUNDS {
            let more = step(texture, turns, &phases, width);
            phases.iter_mut().zip(more).for_each(|(p, m)| *p += m);
        }
        all.push(phases.clone());
        width = width * 2 / 3;
    }
    all
}

/// Remaining phase error, by windows of `width` cells.
fn step(texture: &Texture, turns: usize, phases: &[f64], width: usize) -> Vec<f64> {
    let (ahead, back) = (forward::<f64>(turns), inverse::<f64>(turns));
    let rows: Vec<Vec<Complex64>> = texture
        .rows()
        .par_iter()
        .map(|row| {
            let mut values: Vec<Complex64> = row
                .values
                .iter()
                .zip(phases)
                .map(|(value, &phase)| value * cis(-phase))
                .collect();
            ahead.process(&mut values);
            let power = |i: &usize| values[*i].norm_sqr();
            let brightest = (0..turns)
                .max_by(|a, b| power(a).total_cmp(&power(b)))
                .unwrap_or(0);
            values.rotate_left(brightest);
            for (i, value) in values.iter_mut().enumerate() {
                if 2 * i.min(turns - i) > width {
                    *value = Complex64::ZERO;
                }
            }
            back.process(&mut values);
            values
        })
        .collect();
    let mut more = vec![0.0; turns];
    for n in 1..turns {
        let sum: Complex64 = rows.iter().map(|g| g[n - 1].conj() * g[n]).sum();
        more[n] = more[n - 1] + libm::atan2(sum.im, sum.re);
    }
    without_trend(&mut more);
    more
}
