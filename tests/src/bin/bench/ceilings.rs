//! Measured limits of the machine: float32 products with sums in its best instruction set, and memory copies.
//!
//! Both use as many threads as the measurement that they are compared with. A product with a sum counts as two operations, a copied byte as
//! one read and one written. Neither limit is exact for a former: roots, loads and look-ups count as operations or not at all, float64 has
//! half the lanes, and caches are faster than memory, so that the share of memory's limit can exceed 100 %.

use std::hint::black_box;
use std::time::Instant;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use subaperture_kernels::ceiling::{a_round, multiply_adds};
use subaperture_kernels::lanes::Instructions;

/// Limits of the machine per second.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) struct Ceilings {
    /// Number of threads.
    pub(crate) threads: usize,
    /// Real operations.
    pub(crate) operations: f64,
    /// Bytes read and written.
    pub(crate) bytes: f64,
}

/// Rounds of a thread in one measurement: about a hundredth of a second.
const ROUNDS: usize = 4_000_000;
/// Bytes copied: more than caches hold.
const BYTES: usize = 256 << 20;
/// Number of measurements; the best one counts.
const TURNS: usize = 7;

/// Measure both limits.
pub(crate) fn measure() -> Ceilings {
    let threads = rayon::current_num_threads();
    let instructions = Instructions::best();
    let all = shortest_s(|| {
        (0..threads).into_par_iter().for_each(|_| {
            black_box(multiply_adds(
                instructions,
                black_box(0.5),
                black_box(1.0),
                ROUNDS,
            ));
        });
    });
    let from = vec![1u8; BYTES];
    let mut to = vec![0u8; BYTES];
    let part = BYTES / threads;
    let copied = shortest_s(|| {
        let parts = to.par_chunks_mut(part).zip(from.par_chunks(part));
        parts.for_each(|(to, from)| to.copy_from_slice(from));
        black_box(&to);
    });
    Ceilings {
        threads,
        operations: 2.0 * (a_round(instructions) * ROUNDS * threads) as f64 / all,
        bytes: 2.0 * BYTES as f64 / copied,
    }
}

fn shortest_s(mut work: impl FnMut()) -> f64 {
    let turns = (0..TURNS).map(|_| {
        let start = Instant::now();
        work();
        start.elapsed().as_secs_f64()
    });
    turns.fold(f64::INFINITY, f64::min)
}
