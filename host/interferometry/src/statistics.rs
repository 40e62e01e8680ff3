//! Statistics of the sample coherence.
//!
//! The magnitude `d` of the sample coherence of two circular complex Gaussian images of coherence `D`, over `L` independent looks, has the density (Touzi et
//! al. 1999, equation 8)
//!
//! ```text
//! p(d) = 2 (L - 1) (1 - D^2)^L d (1 - d^2)^(L - 2) 2F1(L, L; 1; d^2 D^2)
//! ```
//!
//! Term by term, the series of `2F1` makes `d^2` a mixture of beta distributions with negative binomial weights,
//!
//! ```text
//! K ~ NB(L, D^2),    d^2 given K ~ Beta(K + 1, L - 1)
//! P(d < t) = sum_k P(K = k) I_{t^2}(k + 1, L - 1) = P(K < J),    J ~ NB(L - 1, t^2)
//! p(d)     = 2 d (L - 1) / (1 - d^2)^2 P(K = M),                 M ~ NB(L, d^2)
//! E d      = sum_k P(K = k) Gamma(k + 3/2) Gamma(k + L) / ( Gamma(k + 1) Gamma(k + L + 1/2) )
//! ```
//!
//! where `I` is the regularised incomplete beta function, itself a negative binomial tail. All terms are positive, so that no digits cancel, and `L` need not be
//! whole. The relative error is below 1e-10 for probabilities below 1/2, and the absolute error below 1e-7 for all others. **Cost** is proportional to `L / (1 - D^2)`: 1 ms
//! at 100 looks and a coherence of 0.999.

use crate::InterferometryError;
use crate::negative_binomial::NegativeBinomial;

/// Largest coherence of a distribution. Above it, phase noise of the radar dominates in practice.
pub const MAX_COHERENCE: f64 = 0.9999;

/// Largest number of independent looks of a distribution.
pub const MAX_LOOKS: f64 = 1000.0;

/// Precision of thresholds and inverted medians, in `d^2` or `D^2`.
const PRECISION: f64 = 1e-12;

/// Distribution of the sample coherence magnitude.
#[derive(Debug)]
pub struct CoherenceDistribution {
    coherence: f64,
    looks: f64,
    weights: NegativeBinomial,
}

impl CoherenceDistribution {
    /// Distribution for a true coherence, 0 to [`MAX_COHERENCE`], and a number of independent looks above 1, which need not be whole.
    ///
    /// # Errors
    /// [`InterferometryError::Coherence`], [`InterferometryError::Looks`].
    pub fn new(coherence: f64, looks: f64) -> Result<Self, InterferometryError> {
        if !(0.0..=MAX_COHERENCE).contains(&coherence) {
            return Err(InterferometryError::Coherence(coherence));
        }
        if !(looks > 1.0 && looks <= MAX_LOOKS) {
            return Err(InterferometryError::Looks(looks));
        }
        Ok(Self {
            coherence,
            looks,
            weights: NegativeBinomial::new(looks, coherence * coherence, usize::MAX),
        })
    }

    /// True coherence of the images.
    pub fn coherence(&self) -> f64 {
        self.coherence
    }

    /// Number of independent looks.
    pub fn looks(&self) -> f64 {
        self.looks
    }

    /// Probability density at `d`; 0 outside 0 to 1.
    pub fn density(&self, d: f64) -> f64 {
        if !(d > 0.0 && d < 1.0) {
            return 0.0;
        }
        let square = d * d;
        let other = NegativeBinomial::new(self.looks, square, self.weights.end());
        let first = self.weights.first.max(other.first);
        let own = &self.weights.terms[(first - self.weights.first).min(self.weights.terms.len())..];
        let theirs = &other.terms[(first - other.first).min(other.terms.len())..];
        let equal: f64 = own.iter().zip(theirs).map(|(a, b)| a * b).sum();
        2.0 * d * (self.looks - 1.0) / ((1.0 - square) * (1.0 - square)) * equal
    }

    /// Probability of a sample coherence below `d`.
    pub fn probability_below(&self, d: f64) -> f64 {
        match d {
            d if d <= 0.0 => 0.0,
            d if d >= 1.0 => 1.0,
            d => below(&self.weights, self.looks, d * d),
        }
    }

    /// Mean of the sample coherence. It exceeds the coherence (bias), most for a coherence of 0.
    pub fn mean(&self) -> f64 {
        let l = self.looks;
        let first = self.weights.first as f64;
        let mut mean_given = libm::exp(
            libm::lgamma(first + 1.5) - libm::lgamma(first + 1.0) + libm::lgamma(first + l)
                - libm::lgamma(first + l + 0.5),
        );
        let mut sum = 0.0;
        for (k, weight) in (self.weights.first..).zip(&self.weights.terms) {
            let k = k as f64;
            sum += weight * mean_given;
            mean_given *= (k + 1.5) * (k + l) / ((k + 1.0) * (k + l + 0.5));
        }
        sum
    }

    /// Threshold below which the sample coherence lies with this probability.
    ///
    /// # Errors
    /// [`InterferometryError::Probability`].
    pub fn threshold(&self, probability: f64) -> Result<f64, InterferometryError> {
        if !(probability > 0.0 && probability < 1.0) {
            return Err(InterferometryError::Probability(probability));
        }
        let at = |square: f64| below(&self.weights, self.looks, square) < probability;
        Ok(bisected(1.0, at).sqrt())
    }
}

/// Coherence whose sample coherence over `looks` independent looks has this median; 0 for medians below that of a coherence of 0, and at most
/// [`MAX_COHERENCE`].
///
/// # Errors
/// [`InterferometryError::Looks`]; [`InterferometryError::Coherence`] if the median is not 0 to 1.
pub fn coherence_of_median(median: f64, looks: f64) -> Result<f64, InterferometryError> {
    if !(0.0..=1.0).contains(&median) {
        return Err(InterferometryError::Coherence(median));
    }
    // The median ascends with the coherence.
    let exceeds_half = |coherence: f64| -> Result<bool, InterferometryError> {
        let distribution = CoherenceDistribution::new(coherence, looks)?;
        Ok(distribution.probability_below(median) > 0.5)
    };
    if !exceeds_half(0.0)? {
        return Ok(0.0);
    }
    if exceeds_half(MAX_COHERENCE)? {
        return Ok(MAX_COHERENCE);
    }
    let most = MAX_COHERENCE * MAX_COHERENCE;
    Ok(bisected(most, |square| exceeds_half(square.sqrt()).unwrap_or(false)).sqrt())
}

/// `P(K < J)` for `J` of the shape `looks - 1` and parameter `square`.
fn below(weights: &NegativeBinomial, looks: f64, square: f64) -> f64 {
    let other = NegativeBinomial::new(looks - 1.0, square, weights.end());
    let (mut sum, mut mass, mut fewer) = (0.0, 0.0, 0.0);
    let mut k = weights.first;
    for (j, term) in (other.first..).zip(&other.terms) {
        while k < j && k < weights.end() {
            fewer += weights.terms[k - weights.first];
            k += 1;
        }
        sum += term * fewer;
        mass += term;
    }
    // Numbers beyond all weights, where K is smaller for certain.
    let beyond = match other.end() > weights.end() {
        true => (1.0 - mass).max(0.0),
        false => 0.0,
    };
    (sum + beyond).min(1.0)
}

/// Largest value from 0 to `most` at which a condition holds that holds up to some value.
fn bisected(most: f64, holds: impl Fn(f64) -> bool) -> f64 {
    let (mut low, mut high) = (0.0, most);
    while high - low > PRECISION {
        let middle = 0.5 * (low + high);
        match holds(middle) {
            true => low = middle,
            false => high = middle,
        }
    }
    0.5 * (low + high)
}
