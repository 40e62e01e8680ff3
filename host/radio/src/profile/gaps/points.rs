//! Extraction of point scatterers from a response, strongest first: CLEAN (Högbom 1974) over carriers.
//!
//! The strongest peak of the residual is located by an FFT with eight samples per carrier and a parabola through three
//! samples, and half of it is subtracted. This repeats until the strongest peak is not significant against noise of the
//! residual's power: for `K` carriers of noise, the largest squared sample of the FFT is about `ln K` times their
//! power, and 1.5 times that is rare. Only peaks within the reach are extracted; others are left in the residual.

use num_complex::Complex64;
use subaperture_fft::Transforms;
use subaperture_signal::phase::phasor;

/// FFT samples per carrier.
const FINENESS: usize = 8;
/// Loop gain: fraction of a peak subtracted per iteration. The peak of several close points lies at none of them.
const GAIN: f64 = 0.5;
/// Maximum number of iterations.
const MAX_TIMES: usize = 256;
/// Significance threshold: power of a peak relative to the expected largest peak of noise.
const SIGNIFICANT: f64 = 1.5;
/// Fraction of the initial power at which extraction stops.
const ENOUGH: f64 = 1e-5;

/// Extract points within `share` of the unambiguous range from `left`, which is 0 at carriers that are not `known`, and
/// return their response at every carrier.
pub(super) fn extract(left: &mut [Complex64], known: &[usize], share: f64) -> Vec<Complex64> {
    let places = FINENESS * left.len();
    let last = ((share * places as f64).ceil() as usize).min(places - 1);
    let transform = Transforms::Portable.inverse::<f64>(places);
    let count = known.len() as f64;
    let least = SIGNIFICANT * libm::log(count.max(2.0));
    let power = |left: &[Complex64]| left.iter().map(Complex64::norm_sqr).sum::<f64>();
    let began = power(left);
    let mut points = vec![Complex64::ZERO; left.len()];
    let mut profile = vec![Complex64::ZERO; places];
    for _ in 0..MAX_TIMES {
        profile[..left.len()].copy_from_slice(left);
        profile[left.len()..].fill(Complex64::ZERO);
        transform.process(&mut profile);
        let square = |place: usize| profile[place % places].norm_sqr();
        let strongest = (0..=last).max_by(|&a, &b| square(a).total_cmp(&square(b)));
        let top = strongest.unwrap_or(0);
        let there = power(left);
        if there <= ENOUGH * began || square(top) < least * there {
            break;
        }
        let [before, here, after] =
            [top + places - 1, top, top + 1].map(|place| profile[place % places].norm_sqr());
        let bend = before - 2.0 * here + after;
        let off = match bend < 0.0 {
            true => (0.5 * (before - after) / bend).clamp(-0.5, 0.5),
            false => 0.0,
        };
        let turns = (top as f64 + off) / places as f64;
        let at = |n: usize| phasor(-(n as f64) * turns);
        let sum: Complex64 = known.iter().map(|&n| left[n] * at(n).conj()).sum();
        let amplitude = sum * (GAIN / count);
        for (n, point) in points.iter_mut().enumerate() {
            *point += amplitude * at(n);
        }
        for &n in known {
            left[n] -= amplitude * at(n);
        }
    }
    points
}
