//! Negative binomial probabilities near their mode.
//!
//! ```text
//! P(k) = (1 - x)^r (r)_k / k! x^k,    k = 0, 1, ...,    (r)_k = Gamma(r + k) / Gamma(r)
//! ```
//!
//! Computed from the mode outwards by the ratio `P(k + 1) / P(k) = x (r + k) / (k + 1)`. Their sum of 1 gives the scale, with a relative error of about 1e-16 times
//! the square root of the number of terms. Where terms are cut off at a largest number, the gamma function gives the scale, with an error of about 1e-9.

/// Terms smaller than this fraction of the largest are omitted.
const NEGLIGIBLE: f64 = 1e-40;

/// Probabilities of consecutive numbers.
#[derive(Debug)]
pub(crate) struct NegativeBinomial {
    /// Number of the first term.
    pub(crate) first: usize,
    /// Probabilities of `first`, `first + 1`, ...
    pub(crate) terms: Vec<f64>,
}

impl NegativeBinomial {
    /// Probabilities of the shape `r` and parameter `x` up to the number `last`, which are all but a negligible part of those up to there. The sum over all
    /// numbers is 1.
    pub(crate) fn new(r: f64, x: f64, last: usize) -> Self {
        let mode = ((r - 1.0) * x / (1.0 - x)).max(0.0).floor();
        let start = (mode as usize).min(last);
        let ratio = |k: usize| x * (r + k as f64) / (k as f64 + 1.0);
        let mut below = Vec::new();
        let (mut k, mut term) = (start, 1.0);
        while k > 0 {
            term /= ratio(k - 1);
            if term < NEGLIGIBLE {
                break;
            }
            k -= 1;
            below.push(term);
        }
        let first = start - below.len();
        below.reverse();
        let mut terms = below;
        terms.push(1.0);
        let (mut k, mut term) = (start, 1.0);
        while k < last {
            term *= ratio(k);
            if term < NEGLIGIBLE {
                break;
            }
            k += 1;
            terms.push(term);
        }
        let scale = match k == last {
            // The sum over all numbers is unknown: one term gives the scale.
            true => exact(r, x, start),
            false => terms.iter().sum::<f64>().recip(),
        };
        for term in &mut terms {
            *term *= scale;
        }
        Self { first, terms }
    }

    /// Number after the last.
    pub(crate) fn end(&self) -> usize {
        self.first + self.terms.len()
    }
}

/// Probability of one number.
fn exact(r: f64, x: f64, k: usize) -> f64 {
    let k = k as f64;
    let log = r * libm::log1p(-x) + libm::lgamma(r + k) - libm::lgamma(r) - libm::lgamma(k + 1.0);
    let log = if k > 0.0 { log + k * libm::log(x) } else { log };
    libm::exp(log)
}
