//! The antennas' track over a sub-CPI, by two places on it.

use super::Node;
use crate::Pulse;

/// Antennas at Gauss's nodes.
pub fn nodes(pulses: &[Pulse]) -> [Node; 2] {
    let Some(first) = pulses.first() else {
        return [Node::default(); 2];
    };
    let m = pulses.len() as f64;
    let mean_square = (m * m - 1.0) / 12.0;
    let place = libm::sqrt(mean_square);
    let fit = |position: fn(&Pulse) -> [f64; 3]| {
        let origin = position(first);
        let (mut sums, mut norms) = ([[0.0; 3]; 3], [0.0; 3]);
        let mut u = -(m - 1.0) / 2.0;
        for pulse in pulses {
            let here = position(pulse);
            for ((sum, norm), p) in
                sums.iter_mut()
                    .zip(&mut norms)
                    .zip([1.0, u, u * u - mean_square])
            {
                *norm += p * p;
                for ((axis, x), x0) in sum.iter_mut().zip(here).zip(origin) {
                    *axis += (x - x0) * p;
                }
            }
            u += 1.0;
        }
        let order = pulses.len();
        move |u: f64| {
            let mut at = origin;
            let terms = [1.0, u, u * u - mean_square];
            for ((sum, norm), term) in sums.iter().zip(norms).zip(terms).take(order) {
                for (axis, s) in at.iter_mut().zip(sum) {
                    *axis += s / norm * term;
                }
            }
            at
        }
    };
    let transmitter = fit(|pulse| pulse.transmitter_m);
    let receiver = fit(|pulse| pulse.receiver_m);
    [-place, place].map(|u| Node {
        transmitter_m: transmitter(u),
        receiver_m: receiver(u),
    })
}
