//! Antenna track over a sub-CPI, reduced to the two Gauss nodes at which a map is interpolated.
//!
//! **Equation.** A quadratic is fitted to the positions by least squares on polynomials that are orthogonal over the
//! pulses, `1`, `u` and `u^2 - (M^2 - 1)/12` with `u_m = m - (M - 1)/2`. It is evaluated at `u = -u_g` and
//! `u = +u_g`, where `u_g^2 = (M^2 - 1)/12` is the mean of `u_m^2`. These are the nodes of the two-point
//! Gauss rule for a uniform weight on the pulses. The straight line through the values of a quadratic at these
//! nodes is the least-squares line of that quadratic, so a path computed at the two nodes has an error from its
//! curvature only, with zero mean and zero slope. The third polynomial is zero at the nodes, so only the first two
//! sums are computed. They average the jitter of measured positions.
//!
//! **Neglected**: third and higher orders of the track at the nodes. With a single pulse both nodes are at its
//! position. Pulse weights are not used.
//!
//! **Units**: metres; `u` in pulses. **Cost**: two passes over `M` positions in float64, no further memory.
//! **Accuracy**: rounding only. Positions are taken relative to the first one, so that digits are kept far from
//! the origin (`tests/stream/kernel.rs`: within 4e-9 m at 7e6 m, where a position resolves 1e-9 m).
//! Positions that are not finite give nodes that are not finite.

use super::Node;
use crate::Pulse;

/// Antenna positions at the nodes `u = -u_g` and `u = +u_g` of the quadratic fitted to the pulses' positions. The
/// origin if there are no pulses.
///
/// ```
/// use subaperture_core::{Pulse, stream};
/// // Seven pulses, u = -3 ..= 3, so that u_g = 2; the transmitter at x = 5 + u, y = u^2.
/// let pulses: [Pulse; 7] = core::array::from_fn(|m| {
///     let u = m as f64 - 3.0;
///     Pulse { transmitter_m: [5.0 + u, u * u, 0.0], ..Pulse::EMPTY }
/// });
/// let [early, late] = stream::nodes(&pulses);
/// let error = |a: [f64; 3], b: [f64; 3]| (0..3).map(|i| (a[i] - b[i]).abs()).sum::<f64>();
/// assert!(error(early.transmitter_m, [3.0, 4.0, 0.0]) < 1e-14);
/// assert!(error(late.transmitter_m, [7.0, 4.0, 0.0]) < 1e-14);
/// assert_eq!(early.receiver_m, [0.0; 3]);
/// ```
pub fn nodes(pulses: &[Pulse]) -> [Node; 2] {
    let transmitter = Line::fit(pulses, |pulse| pulse.transmitter_m);
    let receiver = Line::fit(pulses, |pulse| pulse.receiver_m);
    let offset = node_offset_pulses(pulses.len());
    [-offset, offset].map(|u| Node {
        transmitter_m: transmitter.at(u),
        receiver_m: receiver.at(u),
    })
}

/// Node offset `u_g` in pulses from the middle of the sub-CPI. 0 for a single pulse.
pub(crate) fn node_offset_pulses(num_pulses: usize) -> f64 {
    let m = num_pulses.max(1) as f64;
    libm::sqrt((m * m - 1.0) / 12.0)
}

/// First two terms of the least-squares fit.
struct Line {
    mean_m: [f64; 3],
    slope_m_per_pulse: [f64; 3],
}

impl Line {
    fn fit(pulses: &[Pulse], position_m: impl Fn(&Pulse) -> [f64; 3]) -> Self {
        let origin_m = pulses.first().map_or([0.0; 3], &position_m);
        let middle = (pulses.len() as f64 - 1.0) / 2.0;
        let (mut sums, mut moments, mut norm) = ([0.0; 3], [0.0; 3], 0.0);
        for (m, pulse) in pulses.iter().enumerate() {
            let u = m as f64 - middle;
            let position_m = position_m(pulse);
            for axis in 0..3 {
                let relative_m = position_m[axis] - origin_m[axis];
                sums[axis] += relative_m;
                moments[axis] += relative_m * u;
            }
            norm += u * u;
        }
        let count = pulses.len().max(1) as f64;
        let slope = |moment: f64| if norm > 0.0 { moment / norm } else { 0.0 };
        Self {
            mean_m: [0, 1, 2].map(|axis| origin_m[axis] + sums[axis] / count),
            slope_m_per_pulse: moments.map(slope),
        }
    }

    fn at(&self, u: f64) -> [f64; 3] {
        [0, 1, 2].map(|axis| self.mean_m[axis] + self.slope_m_per_pulse[axis] * u)
    }
}
