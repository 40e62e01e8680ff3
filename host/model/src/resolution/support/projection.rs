//! Projection of the support on a line, and the impulse response along it.

use std::array;
use std::cell::OnceCell;
use std::f64::consts::PI;

use num_complex::Complex64;
use subaperture_signal::phase::phasor;

use crate::resolution::theory::{Expected, expected_of};

/// Number of bins over the extent. Each weight is distributed to two bins (linear interpolation). Its transform is exact except for a
/// factor `sinc^2(s / (BINS cells))`, which is divided out, and zero-mean terms below `(2 pi s / (BINS cells))^2 / 8`: 3e-4 of
/// a weight at 30 cells.
const BINS: usize = 4096;
/// Number of interleaved phasor recurrences.
const CHAINS: usize = 8;
/// Search steps per cell for the half-power point.
const FINE: usize = 16;
/// Largest half-width of a response, cells.
const MAX_CELLS: usize = 512;
/// Largest number of root-finding iterations for a width.
const MAX_TRIES: usize = 60;
/// Half-power width of a uniform band, cells: twice the root of `sinc^2 = 1 / 2`.
const EVEN_WIDTH: f64 = 0.885_892_941_378_904_6;

/// Distribution of weights over spatial frequency along a line.
#[derive(Clone, Debug)]
pub struct Projection {
    low: f64,
    high: f64,
    bins: Vec<f64>,
    sum: f64,
    width: OnceCell<Option<f64>>,
}

/// Smallest and largest frequency of segments with weight.
pub(super) fn extent(segments: impl Iterator<Item = ([f64; 2], f64)>) -> Option<[f64; 2]> {
    let (low, high) = segments.filter(|(_, weight)| *weight != 0.0).fold(
        (f64::INFINITY, f64::NEG_INFINITY),
        |(low, high), ([a, b], _)| (low.min(a.min(b)), high.max(a.max(b))),
    );
    (low.is_finite() && high.is_finite()).then_some([low, high])
}

impl Projection {
    /// Build from weighted frequency segments; over each segment the `fast` weights
    /// are spread in equal cells. `None` without weight, or if all frequencies are equal to rounding.
    pub fn new(
        segments: impl Iterator<Item = ([f64; 2], f64)> + Clone,
        fast: &[f64],
    ) -> Option<Self> {
        let [low, high] = extent(segments.clone())?;
        let span = high - low;
        // An extent of rounding size is no extent.
        if fast.is_empty() || span <= 1e-9 * low.abs().max(high.abs()) {
            return None;
        }
        let bins_a_cycle = BINS as f64 / span;
        let mut bins = vec![0.0; BINS + 1];
        for ([from, to], weight) in segments {
            if weight == 0.0 {
                continue;
            }
            let cell = (to - from) / fast.len() as f64;
            for (k, fast) in fast.iter().enumerate() {
                let frequency = from + (k as f64 + 0.5) * cell;
                let place = ((frequency - low) * bins_a_cycle).clamp(0.0, BINS as f64);
                let bin = (place as usize).min(BINS - 1);
                let part = place - bin as f64;
                bins[bin] += weight * fast * (1.0 - part);
                bins[bin + 1] += weight * fast * part;
            }
        }
        let sum: f64 = bins.iter().sum();
        (sum > 0.0 && sum.is_finite()).then_some(Self {
            low,
            high,
            bins,
            sum,
            width: OnceCell::new(),
        })
    }

    /// Extent between the outermost samples, cycles per metre.
    pub fn extent(&self) -> f64 {
        self.high - self.low
    }

    /// Impulse response at `s_m` metres from the peak (1 at the peak), at baseband.
    pub fn at(&self, s_m: f64) -> Complex64 {
        let step = self.extent() / BINS as f64 * s_m;
        // Interleaved recurrences: no phasor waits for the previous one.
        let turn = phasor(CHAINS as f64 * step);
        let first = -0.5 * self.extent() * s_m;
        let phases: [Complex64; CHAINS] = array::from_fn(|i| phasor(first + i as f64 * step));
        let [mut cosines, mut sines] = [phases.map(|z| z.re), phases.map(|z| z.im)];
        let [mut real, mut imaginary] = [[0.0; CHAINS]; 2];
        let (whole, rest) = self.bins.as_chunks::<CHAINS>();
        for weights in whole {
            for (i, weight) in weights.iter().enumerate() {
                let (cos, sin) = (cosines[i], sines[i]);
                real[i] += weight * cos;
                imaginary[i] += weight * sin;
                cosines[i] = cos * turn.re - sin * turn.im;
                sines[i] = cos * turn.im + sin * turn.re;
            }
        }
        for (i, weight) in rest.iter().enumerate() {
            real[i] += weight * cosines[i];
            imaginary[i] += weight * sines[i];
        }
        let value = Complex64::new(real.iter().sum(), imaginary.iter().sum());
        value / (self.sum * sinc(step).powi(2))
    }

    /// Power of the response relative to the peak.
    pub fn power(&self, s_m: f64) -> f64 {
        self.at(s_m).norm_sqr()
    }

    /// 3 dB width, metres; `None` if the response does not fall to half power
    /// within 512 cells.
    pub fn width_3db_m(&self) -> Option<f64> {
        *self.width.get_or_init(|| {
            let step = 1.0 / (self.extent() * FINE as f64);
            let below = (1..=MAX_CELLS * FINE).find(|&i| self.power(i as f64 * step) < 0.5)? as f64;
            let above = |s_m: f64| self.power(s_m) - 0.5;
            let half = crossing(above, (below - 1.0) * step, below * step);
            Some(2.0 * half)
        })
    }

    /// Rayleigh resolution, metres: peak to null of the uniform band without windows that has this half-power width.
    pub fn resolution_m(&self) -> Option<f64> {
        Some(self.width_3db_m()? / EVEN_WIDTH)
    }

    /// Width and sidelobes within `span_m` metres on both sides; the fixed main lobe extends `main_lobe_widths`
    /// 3 dB widths. `None` if the half-power points are outside the span.
    pub fn expected(&self, span_m: f64, main_lobe_widths: f64) -> Option<Expected> {
        let cell_m = self.resolution_m()?;
        expected_of(&|s| self.power(s), cell_m, span_m, main_lobe_widths)
    }
}

/// Root of `f`, positive at `low` and not at `high`, by regula falsi with the Illinois rule:
/// about eight evaluations instead of forty by bisection.
fn crossing(f: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    let (mut at_low, mut at_high) = (f(low), f(high));
    let mut last = 0.0;
    for _ in 0..MAX_TRIES {
        if at_high == 0.0 || high - low <= 1e-14 * high {
            return high;
        }
        let middle = (low * at_high - high * at_low) / (at_high - at_low);
        let at_middle = f(middle);
        if at_middle > 0.0 {
            (low, at_low) = (middle, at_middle);
            at_high *= if last > 0.0 { 0.5 } else { 1.0 };
        } else {
            (high, at_high) = (middle, at_middle);
            at_low *= if last < 0.0 { 0.5 } else { 1.0 };
        }
        last = at_middle;
        // Limit of float64.
        if at_middle.abs() < 1e-14 {
            return middle;
        }
    }
    low.midpoint(high)
}

fn sinc(x: f64) -> f64 {
    match x.abs() < 1e-8 {
        true => 1.0,
        false => libm::sin(PI * x) / (PI * x),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uniform_band_gives_sinc_and_rotated_square_gives_sinc_squared() {
        // 1000 cells from 60 to 62 cycles per metre: sinc(2 s), width 0.886 / 2, null at 0.5, PSLR -13.26 dB.
        let band = [([60.0, 62.0], 1.0)];
        let even = Projection::new(band.into_iter(), &vec![1.0; 1000]).unwrap();
        assert!((even.extent() - 2.0).abs() < 1e-12);
        assert!((even.width_3db_m().unwrap() - EVEN_WIDTH / 2.0).abs() < 1e-5);
        assert!((even.resolution_m().unwrap() - 0.5).abs() < 1e-5);
        for s in [0.1, 0.37, 0.74, 5.3] {
            let wanted = sinc(2.0 * s);
            let off = (even.at(s) - wanted).norm();
            // The Dirichlet kernel of 1000 differs from sinc by a relative (pi 2 s / 1000)^2 / 6; binning adds
            // the bound above.
            assert!(off < 3e-4, "{s}: {off}");
        }
        let expected = even.expected(5.0, 1.5).unwrap();
        assert!((expected.null.unwrap() - 0.5).abs() < 1e-3);
        assert!((expected.null_rule.pslr_db.unwrap() + 13.261).abs() < 5e-3);
        // A square of one cycle per metre, projected at 45 degrees: pulses shift the band, a triangle of
        // base 2 / sqrt 2, whose response is sinc^2(s / sqrt 2): half power where sinc^4 is, x = 0.31897.
        let half = 0.5f64.sqrt();
        let square = (0..1000).map(|n| {
            let offset = half * (f64::from(n) + 0.5) / 1000.0;
            ([offset, offset + half], 1.0)
        });
        let square = Projection::new(square, &[1.0; 200]).unwrap();
        let width = square.width_3db_m().unwrap();
        assert!((width - 2.0 * 0.318_97 / half).abs() < 2e-4, "{width}");
    }

    #[test]
    fn projection_without_weight_or_extent_is_none() {
        assert!(Projection::new([].into_iter(), &[1.0]).is_none());
        assert!(Projection::new([([3.0, 3.0], 1.0)].into_iter(), &[1.0; 9]).is_none());
        assert!(Projection::new([([1.0, 3.0], 0.0)].into_iter(), &[1.0; 9]).is_none());
        let nan = [([f64::NAN, 1.0], 1.0)];
        assert!(Projection::new(nan.into_iter(), &[1.0; 9]).is_none());
    }
}
