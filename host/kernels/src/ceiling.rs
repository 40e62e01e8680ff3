//! Peak arithmetic rate: multiply-adds in registers.
//!
//! ```text
//! x[i] <- x[i] a + b,    repeated, for enough independent sums to hide the latency
//! ```
//!
//! Benchmarks compare the rate of kernels with this rate.

use crate::lanes::{GROUP, Instructions, Kernel, Lanes};

/// Independent vectors; two units with a latency of four cycles need at least eight.
const VECTORS: usize = 12;

/// Number of multiply-adds (two operations each) per round of [`multiply_adds`].
pub fn a_round(instructions: Instructions) -> usize {
    VECTORS * instructions.run(Count)
}

/// Execute `rounds` rounds; returns the sum of the results.
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
    fn every_lane_executes_every_round() {
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
