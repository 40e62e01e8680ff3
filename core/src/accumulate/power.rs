//! Noncoherent accumulation: sum of the power of maps, bin by bin.
//!
//! **Equation**: `power[d][r] += |map[d][r]|^2`. **Neglected**: migration between sub-CPIs; a scatterer must stay
//! within one bin. Patch maps are relative to the patch centre, where it does so for longer. **Cost**: 4 bytes per bin;
//! two multiply-adds per bin and map. **Accuracy**: relative error of a sum of `n` float32 terms below
//! `(n + 2) 2^-24` (`tests/stream/accumulate.rs`).

use num_complex::Complex32;

use super::AccumulateError;
use crate::{LengthError, Map};

/// Add the power of `samples` to `power`, element by element.
///
/// # Errors
/// [`LengthError`] if the lengths differ. Nothing is then written.
pub fn add_power(power: &mut [f32], samples: &[Complex32]) -> Result<(), LengthError> {
    LengthError::check("power", samples.len(), power.len())?;
    for (sum, sample) in power.iter_mut().zip(samples) {
        *sum += sample.norm_sqr();
    }
    Ok(())
}

/// Sum of the power of maps of one shape with at most `CAPACITY` bins.
///
/// ```
/// use subaperture_core::accumulate::PowerMap;
/// use subaperture_core::{Axes, Complex32, Map, Shape};
/// let shape = Shape { num_pulses: 2, num_frequencies: 2, num_range_bins: 2, num_doppler_bins: 2 };
/// let samples = [Complex32::new(3.0, 4.0); 4];
/// let map = Map::new(Axes::new(shape, 1.0e9, 1.0e6)?, &samples)?;
/// let mut power = PowerMap::<4>::new();
/// power.accumulate(&map)?;
/// power.accumulate(&map)?;
/// assert_eq!((power.power()[0], power.num_maps()), (50.0, 2));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct PowerMap<const CAPACITY: usize> {
    /// Doppler and range bins.
    bins: [usize; 2],
    num_maps: u32,
    /// Bins of the map, followed by unused elements.
    power: [f32; CAPACITY],
    num_bins: usize,
}

impl<const CAPACITY: usize> PowerMap<CAPACITY> {
    /// Size in bytes.
    pub const BYTES: usize = size_of::<Self>();

    /// Create an empty accumulator.
    pub const fn new() -> Self {
        Self {
            bins: [0; 2],
            num_maps: 0,
            power: [0.0; CAPACITY],
            num_bins: 0,
        }
    }

    /// Add the power of a map. The first map after [`PowerMap::clear`] sets the shape.
    ///
    /// # Errors
    /// [`AccumulateError`] if the map exceeds the capacity or has another shape. The sum is then unchanged.
    pub fn accumulate(&mut self, map: &Map<'_>) -> Result<(), AccumulateError> {
        let shape = map.axes().shape();
        let bins = [shape.num_doppler_bins, shape.num_range_bins];
        self.add(bins, map.samples().iter().copied())
    }

    pub(super) fn add(
        &mut self,
        bins: [usize; 2],
        samples: impl Iterator<Item = Complex32>,
    ) -> Result<(), AccumulateError> {
        if self.num_maps == 0 {
            let wanted = bins[0].saturating_mul(bins[1]);
            let Some(power) = self.power.get_mut(..wanted) else {
                return Err(AccumulateError::Capacity {
                    capacity: CAPACITY,
                    wanted,
                });
            };
            power.fill(0.0);
            (self.bins, self.num_bins) = (bins, wanted);
        }
        if bins != self.bins {
            return Err(AccumulateError::Shape {
                expected: self.bins,
                got: bins,
            });
        }
        for (sum, sample) in self.power.iter_mut().zip(samples) {
            *sum += sample.norm_sqr();
        }
        self.num_maps = self.num_maps.saturating_add(1);
        Ok(())
    }

    /// Summed power, `[doppler][range]`. Empty before the first map.
    pub fn power(&self) -> &[f32] {
        self.power.get(..self.num_bins).unwrap_or_default()
    }

    /// Number of Doppler and range bins. Zeros before the first map.
    pub fn bins(&self) -> [usize; 2] {
        self.bins
    }

    /// Number of maps summed.
    pub fn num_maps(&self) -> u32 {
        self.num_maps
    }

    /// Remove all maps.
    pub fn clear(&mut self) {
        self.num_maps = 0;
        self.bins = [0; 2];
        self.num_bins = 0;
    }
}

impl<const CAPACITY: usize> Default for PowerMap<CAPACITY> {
    fn default() -> Self {
        Self::new()
    }
}
