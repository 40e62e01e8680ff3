//! Theoretical impulse response of a windowed band, or of any support ([`crate::resolution::support`]) whose projection
//! on a cut replaces the band.
//!
//! The transform of `n` weights `w_k` over a band of one cycle per cell is evaluated directly,
//!
//! ```text
//! D(x) = sum_k w_k cos(2 pi (k - (n - 1) / 2) x / n) / sum_k w_k
//! ```
//!
//! at `x` cells from the peak; a cell is one over the bandwidth, `c / (2 B)` in range for a monostatic
//! radar. Unweighted it is the Dirichlet kernel: 3 dB width 0.886 cells, first null at 1 cell, PSLR -13.26 dB.
//! Weights are assumed symmetric about the centre, as all of [`subaperture_signal::window`] are.
//!
//! Widths are found by bisection, sidelobes on a grid of 1/64 cell with a parabola, energies by Simpson's
//! rule on that grid. **Cost** `128 span n` cosines.

use std::f64::consts::PI;

/// Steps per cell.
const FINE: usize = 64;

/// Sidelobe ratios for one definition of the main lobe, dB.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct SideLobes {
    /// Peak sidelobe ratio (PSLR), dB: highest local maximum outside the main lobe; `None` if there is none.
    pub pslr_db: Option<f64>,
    /// Integrated sidelobe ratio (ISLR), dB: energy outside the main lobe, within the span, over the energy inside.
    pub islr_db: Option<f64>,
}

/// Theoretical response; lengths in cells, or in the unit given to [`expected_of`].
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Expected {
    /// 3 dB width.
    pub width_3db: f64,
    /// First minimum; `None` if it is outside the span.
    pub null: Option<f64>,
    /// Sidelobes for a main lobe up to the first minimum.
    pub null_rule: SideLobes,
    /// Sidelobes for a main lobe of a fixed number of 3 dB widths.
    pub fixed_rule: SideLobes,
}

/// Transform `D(x)` of the weights at `cells` from the peak.
pub fn transform(weights: &[f64], cells: f64) -> f64 {
    let middle = (weights.len() as f64 - 1.0) / 2.0;
    let turn = 2.0 * PI * cells / weights.len() as f64;
    let terms = weights.iter().enumerate();
    let sum: f64 = terms
        .map(|(k, w)| w * ((k as f64 - middle) * turn).cos())
        .sum();
    sum / weights.iter().sum::<f64>()
}

/// Theoretical response within `span` cells on both sides; the fixed main lobe extends
/// `main_lobe_widths` 3 dB widths. `None` without weights, or if the half-power points are outside the span.
pub fn expected(weights: &[f64], span: f64, main_lobe_widths: f64) -> Option<Expected> {
    if weights.is_empty() {
        return None;
    }
    let power = |x: f64| transform(weights, x).powi(2);
    expected_of(&power, 1.0, span, main_lobe_widths)
}

/// As [`expected`], for any symmetric response given as power relative to the peak (non-negative weights);
/// `cell` is the scale on which it varies.
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

/// Minimum near sample `i`, by trisection.
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

/// Highest maximum beyond `end` cells, by a parabola through three samples.
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

/// Simpson's rule with at least [`FINE`] steps per cell.
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
    fn theoretical_responses_agree_with_published_values() {
        // A long uniform band is sin(pi x) / (pi x): half power at x = 0.44295, first null at 1,
        // first sidelobe -13.261 dB. Its energy between the nulls is 0.902823 of the whole, 1, and
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
        // Harris 1978, table 1: Hamming has a 3 dB width of 1.30 cells, highest sidelobe -43 dB.
        let e = expected(&Window::Hamming.weights(1000), 10.0, 1.5).unwrap();
        near(e.width_3db, 1.30, 5e-3);
        near(e.null.unwrap(), 2.0, 1e-3);
        near(e.null_rule.pslr_db.unwrap(), -42.7, 0.3);
        let taylor = Window::Taylor { side_lobe_db: 35.0 };
        let e = expected(&taylor.weights(1000), 10.0, 1.5).unwrap();
        near(e.null_rule.pslr_db.unwrap(), -35.0, 0.3);
        // Few samples: the Dirichlet kernel sin(pi x) / (n sin(pi x / n)).
        let d = transform(&[1.0; 5], 1.3);
        near(d, (1.3 * PI).sin() / (5.0 * (1.3 * PI / 5.0).sin()), 1e-12);
        assert_eq!(expected(&[], 10.0, 1.5), None);
        assert_eq!(expected(&[1.0; 9], 0.4, 1.5), None);
        // Half power at 0.44, but no null within 0.6: measures that need it are `None`.
        let short = expected(&[1.0; 9], 0.6, 1.5).unwrap();
        assert_eq!((short.null, short.null_rule.pslr_db), (None, None));
    }
}
