//! What no kernel can exceed: products and sums in registers, as many as the instructions do.
//!
//! ```text
//! x[i] <- x[i] a + b,    again and again, for sums enough to hide the latency of one
//! ```
//!
//! Of this rate benches say what share a kernel reaches.

use crate::lanes::{GROUP, Instructions, Kernel, Lanes};

/// Vectors that are worked on together: two units of four cycles' latency want eight at the least.
const VECTORS: usize = 12;

/// Products with sums, two operations each, that [`multiply_adds`] does in a round.
pub fn a_round(instructions: Instructions) -> usize {
    VECTORS * instructions.run(Count)
}

/// Does so many rounds; the sum of what comes of it.
pub fn multiply_adds(instructions: Instructions, factor: f32, term: f32, rounds: usize) -> f32 {
    instructions.run(MultiplyAdds {
        factor,
        term,
        rounds,
    })
}

struct Count;

impl Kernel for Count {
    type Output = usize;

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) -> usize {
        L::COUNT
    }
}

struct MultiplyAdds {
    factor: f32,
    term: f32,
    rounds: usize,
}

impl Kernel for MultiplyAdds {
    type Output = f32;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> f32 {
        let (factor, term) = (lanes.splat(self.factor), lanes.splat(self.term));
        let mut sums = [lanes.splat(0.0); VECTORS];
        for _ in 0..self.rounds {
            for sum in &mut sums {
                *sum = lanes.mul_add(*sum, factor, term);
            }
        }
        let mut values = [0.0; GROUP];
        let mut total = 0.0;
        for sum in sums {
            lanes.store(sum, &mut values);
            total += values[..L::COUNT].iter().sum::<f32>();
        }
        total
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `x <- x / 2 + 1` from 0 is `2 - 2^(1 - n)` after `n` rounds, without rounding.
    #[test]
    fn every_lane_does_every_round() {
        for instructions in Instructions::available() {
            let count = a_round(instructions) as f32;
            for rounds in [0, 1, 5, 10] {
                let expected = count * (2.0 - 2.0f32.powi(1 - rounds as i32));
                let got = multiply_adds(instructions, 0.5, 1.0, rounds);
                assert_eq!(got, expected, "{} {rounds}", instructions.name());
            }
        }
    }
}
