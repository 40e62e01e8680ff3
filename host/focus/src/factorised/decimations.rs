//! Sequence of decimations of a history, over pulses and over samples.

use subaperture_kernels::decimation::{Taps, decimated};
use subaperture_signal::decimation_kernel::{DecimationKernel, TAPS};

/// Possible decimation factors, in the order of kernels and bands.
pub(super) const FACTORS: [usize; 2] = [2, 3];

/// Sequence of decimations with their kernels.
#[derive(Clone, Debug)]
pub(super) struct Decimations {
    /// Largest numbers of decimations over pulses and over samples.
    most: [usize; 2],
    /// Factors of the first decimation over pulses and over samples.
    first: [usize; 2],
    /// Taps at the fraction 1/2, and at 1/3.
    taps: [Vec<f32>; 2],
}

impl Decimations {
    /// Describe at most so many decimations over pulses and over samples, the first of each axis by the given factors.
    pub(super) fn new(
        most: [usize; 2],
        first: [usize; 2],
        kernels: &[DecimationKernel; 2],
    ) -> Self {
        let taps = |kernel: &DecimationKernel| kernel.taps().iter().map(|&h| h as f32).collect();
        Self {
            most,
            first,
            taps: kernels.each_ref().map(taps),
        }
    }

    /// Largest numbers of decimations over pulses and over samples.
    pub(super) fn most(&self) -> [usize; 2] {
        self.most
    }

    /// Number of taps at each fraction.
    pub(super) fn num_taps(&self) -> usize {
        self.taps[0].len()
    }

    /// Whether another decimation over pulses (axis 0) or samples (axis 1) may follow on `done` ones.
    pub(super) fn continues(&self, axis: usize, done: usize) -> bool {
        done < self.most[axis]
    }

    /// Factor of the decimation over pulses (axis 0) or samples (axis 1) that follows on `done` ones.
    pub(super) fn factor(&self, axis: usize, done: usize) -> usize {
        match done {
            0 => self.first[axis],
            _ => 2,
        }
    }

    /// Taps for the samples at `phase` between two retained ones in a decimation by `factor`.
    pub(super) fn taps(&self, factor: usize, phase: usize) -> impl Iterator<Item = f32> {
        let taps = &self.taps[factor - FACTORS[0]];
        let reversed = 2 * phase > factor;
        let last = taps.len() - 1;
        (0..=last).map(move |i| taps[if reversed { last - i } else { i }])
    }

    /// Taps in the form of the decimation.
    ///
    /// # Panics
    /// If the number of taps is not `W`.
    pub(super) fn kernel<const W: usize>(&self) -> Taps<W> {
        let [half, third] = &self.taps;
        let taps = |taps: &[f32]| taps.try_into().expect("as many taps");
        Taps {
            half: taps(half),
            third: taps(third),
        }
    }
}

/// Largest ratio of output to input length for a profitable decimation.
const WORTHWHILE: f64 = 0.8;

/// Whether decimating `count` samples by `factor` reduces their number enough.
pub(super) fn pays(count: usize, factor: usize, taps: usize) -> bool {
    decimated(count, factor, taps) as f64 <= WORTHWHILE * count as f64
}

/// Number of profitable decimations by two of `count` samples with the fewest taps.
pub(super) fn most_decimations(mut count: usize) -> usize {
    let mut times = 0;
    while pays(count, 2, TAPS[0]) {
        count = decimated(count, 2, TAPS[0]);
        times += 1;
    }
    times
}
