//! What the response of a windowed band should be, and of any support ([`crate::support`]), whose projection
//! on the line of a cut takes the band's place.
//!
//! The transform of `n` weights `w_k` that fill a band of one cycle a cell, evaluated directly,
//!
//! ```text
//! D(x) = sum_k w_k cos(2 pi (k - (n - 1) / 2) x / n) / sum_k w_k
//! ```
//!
//! at `x` cells from the peak; a cell is one over the band's width, `c / (2 B)` in range of a monostatic
//! radar. Unweighted it is Dirichlet's kernel: 0.886 cells wide, first null at 1 cell, PSLR -13.26 dB.
//! Weights are taken as symmetric about the middle, as all of [`subaperture_signal::window`] are.
//!
//! Widths are found by bisection, lobes on a grid of 1/64 cell with a parabola, energies by Simpson's
//! rule on it. Cost: `128 span n` cosines.

use std::f64::consts::PI;

/// Steps a cell.
const FINE: usize = 64;

/// Side lobes by one rule of what the main lobe is, dB.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct SideLobes {
    /// Highest local maximum outside the main lobe over the peak, of power; `None` if there is none.
    pub pslr_db: Option<f64>,
    /// Energy outside the main lobe, within the span, over the energy inside it.
    pub islr_db: Option<f64>,
}

/// A response in theory; lengths in cells, or in whatever [`expected_of`] was given them in.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Expected {
    /// Width between the points of half the peak's power.
    pub width_3db: f64,
    /// First minimum; `None` if there is none within the span.
    pub null: Option<f64>,
    /// Side lobes where the main lobe ends at the first minimum.
    pub null_rule: SideLobes,
    /// Side lobes where it ends a given number of widths from the peak.
    pub fixed_rule: SideLobes,
}

/// `D(x)` of these weights.
pub fn transform(weights: &[f64], cells: f64) -> f64 {
    let middle = (weights.len() as f64 - 1.0) / 2.0;
    let turn = 2.0 * PI * cells / weights.len() as f64;
    let terms = weights.iter().enumerate();
    let sum: f64 = terms
        .map(|(k, w)| w * ((k as f64 - middle) * turn).cos())
        .sum();
    sum / weights.iter().sum::<f64>()
}

/// The response out to `span` cells on both sides; the fixed rule's main lobe reaches
/// `main_lobe_widths` widths. `None` of no weights, or if the half-power points are not within the span.
pub fn expected(weights: &[f64], span: f64, main_lobe_widths: f64) -> Option<Expected> {
    if weights.is_empty() {
        return None;
    }
    let power = |x: f64| transform(weights, x).powi(2);
    expected_of(&power, 1.0, span, main_lobe_widths)
}

/// The same of any response by its power over the peak's, the same on both sides of the peak, as that of weights
/// which are not negative is; `cell` is the scale on which it changes.
pub fn expected_of(
    power: &dyn Fn(f64) -> f64,
    cell: f64,
    span: f64,
    main_lobe_widths: f64,
) -> Option<Expected> {
    let span = span / cell;
    if !(cell > 0.0 && span > 0.0 && span <= 1e4) {
        return None;
    }
    let power = |x: f64| power(x * cell);
    let count = (span * FINE as f64).floor() as usize;
    let samples: Vec<f64> = (0..=count).map(|i| power(i as f64 / FINE as f64)).collect();
    let below = samples.iter().position(|&p| p < 0.5)?;
    let (mut low, mut high) = ((below - 1) as f64 / FINE as f64, below as f64 / FINE as f64);
    for _ in 0..50 {
        let middle = low.midpoint(high);
        if power(middle) > 0.5 {
            low = middle;
        } else {
            high = middle;
        }
    }
    let width_3db = 2.0 * low;
    let turn_up = samples.windows(2).position(|p| p[1] > p[0]);
    let null = turn_up.map(|turn_up| least(&power, turn_up));
    let side_lobes = |end: Option<f64>| SideLobes {
        pslr_db: end.and_then(|end| highest(&samples, end).map(|p| 10.0 * p.log10())),
        islr_db: end.filter(|&end| end < span).map(|end| {
            let beyond = simpson(&power, end, span);
            10.0 * (beyond / simpson(&power, 0.0, end)).log10()
        }),
    };
    Some(Expected {
        width_3db: width_3db * cell,
        null: null.map(|null| null * cell),
        null_rule: side_lobes(null),
        fixed_rule: side_lobes(Some(main_lobe_widths * width_3db)),
    })
}

/// The minimum next to sample `i`, by trisection.
fn least(power: &dyn Fn(f64) -> f64, i: usize) -> f64 {
    let (mut low, mut high) = (
        (i as f64 - 1.0) / FINE as f64,
        (i as f64 + 1.0) / FINE as f64,
    );
    for _ in 0..60 {
        let third = (high - low) / 3.0;
        if power(low + third) < power(high - third) {
            high -= third;
        } else {
            low += third;
        }
    }
    low.midpoint(high)
}

/// The highest maximum beyond `end` cells, with a parabola through its three samples.
fn highest(samples: &[f64], end: f64) -> Option<f64> {
    (1..samples.len().checked_sub(1)?)
        .filter(|&i| i as f64 / FINE as f64 > end)
        .filter(|&i| samples[i - 1] < samples[i] && samples[i] >= samples[i + 1])
        .map(|i| {
            let (a, b, c) = (samples[i - 1], samples[i], samples[i + 1]);
            b - (a - c).powi(2) / (8.0 * (a - 2.0 * b + c))
        })
        .reduce(f64::max)
}

/// Simpson's rule with at least [`FINE`] steps a cell.
fn simpson(power: &dyn Fn(f64) -> f64, from: f64, to: f64) -> f64 {
    let pairs = (((to - from) * FINE as f64 / 2.0).ceil() as usize).max(8);
    let step = (to - from) / (2 * pairs) as f64;
    let sum: f64 = (0..=2 * pairs)
        .map(|i| {
            let weight = match i {
                _ if i == 0 || i == 2 * pairs => 1.0,
                _ if i % 2 == 1 => 4.0,
                _ => 2.0,
            };
            weight * power(from + i as f64 * step)
        })
        .sum();
    sum * step / 3.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use subaperture_signal::window::Window;

    fn near(value: f64, wanted: f64, tolerance: f64) {
        assert!((value - wanted).abs() < tolerance, "{value}, not {wanted}");
    }

    #[test]
    fn textbook_figures() {
        // A long unweighted band is sin(pi x) / (pi x): half power at x = 0.44295, first null at 1,
        // first side lobe -13.261 dB. Its energy between the nulls is 0.902823 of the whole, 1, and
        // beyond +-X about 1 / (pi^2 X): with X = 10, 0.010132.
        let e = expected(&Window::None.weights(1000), 10.0, 1.5).unwrap();
        near(e.width_3db, 0.885_89, 1e-4);
        near(e.null.unwrap(), 1.0, 1e-5);
        near(e.null_rule.pslr_db.unwrap(), -13.261, 2e-3);
        let beyond: f64 = 1.0 - 0.902_823 - 0.010_132;
        near(
            e.null_rule.islr_db.unwrap(),
            10.0 * (beyond / 0.902_823).log10(),
            0.02,
        );
        // Harris 1978, table 1: Hamming is 1.30 cells wide, its highest side lobe -43 dB.
        let e = expected(&Window::Hamming.weights(1000), 10.0, 1.5).unwrap();
        near(e.width_3db, 1.30, 5e-3);
        near(e.null.unwrap(), 2.0, 1e-3);
        near(e.null_rule.pslr_db.unwrap(), -42.7, 0.3);
        let taylor = Window::Taylor { side_lobe_db: 35.0 };
        let e = expected(&taylor.weights(1000), 10.0, 1.5).unwrap();
        near(e.null_rule.pslr_db.unwrap(), -35.0, 0.3);
        // Fewer samples: Dirichlet's kernel, sin(pi x) / (n sin(pi x / n)), at its own points.
        let d = transform(&[1.0; 5], 1.3);
        near(d, (1.3 * PI).sin() / (5.0 * (1.3 * PI / 5.0).sin()), 1e-12);
        assert_eq!(expected(&[], 10.0, 1.5), None);
        assert_eq!(expected(&[1.0; 9], 0.4, 1.5), None);
        // Half power at 0.44, but no null within 0.6: what needs one is not said.
        let short = expected(&[1.0; 9], 0.6, 1.5).unwrap();
        assert_eq!((short.null, short.null_rule.pslr_db), (None, None));
    }
}
