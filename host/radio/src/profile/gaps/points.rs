//! Points that explain a response, one after another, the strongest first: CLEAN (Högbom 1974) over carriers.
//!
//! The strongest place of what is left, by a transform eight times as fine as the carriers and a parabola through three places, is taken off by half, again and again, until what is left there is not above what noise of
//! its power would reach somewhere: of `K` carriers of noise the transform's largest square is some `ln K` times their power, and half as much again is rare.
//! A place lies within the reach: what comes from elsewhere is no echo, and is left.

use num_complex::Complex64;
use subaperture_fft::Transforms;
use subaperture_signal::phase::phasor;

/// Places a carrier.
const FINENESS: usize = 8;
/// Part of a point that is taken at a time: of points near each other the strongest place is neither's.
const GAIN: f64 = 0.5;
/// Times that points are taken, at the most.
const MOST_TIMES: usize = 256;
/// Power over noise's largest, from which on a place is a point's.
const SIGNIFICANT: f64 = 1.5;
/// Part of the power that is not worth more.
const ENOUGH: f64 = 1e-5;

/// Takes points within `share` of the unambiguous range out of `left`, which is 0 where a carrier is not `known`: what they are at every carrier.
pub(super) fn taken_from(left: &mut [Complex64], known: &[usize], share: f64) -> Vec<Complex64> {
    let places = FINENESS * left.len();
    let last = ((share * places as f64).ceil() as usize).min(places - 1);
    let transform = Transforms::Portable.inverse::<f64>(places);
    let count = known.len() as f64;
    let least = SIGNIFICANT * libm::log(count.max(2.0));
    let power = |left: &[Complex64]| left.iter().map(Complex64::norm_sqr).sum::<f64>();
    let began = power(left);
    let mut points = vec![Complex64::ZERO; left.len()];
    let mut profile = vec![Complex64::ZERO; places];
    for _ in 0..MOST_TIMES {
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
