//! Non-coherent accumulation: the power of maps, bin by bin.
//!
//! **Equation**: `power[d][r] += |map[d][r]|^2`. **Neglected**: migration from sub-CPI to sub-CPI; a
//! scatterer must stay within a bin. **Cost** 4 bytes a bin; two multiply-adds a bin and map.
//! **Accuracy**: a sum of `n` float32 terms, relative error below `(n + 2) 2^-24`
//! (`tests/core_accumulate.rs`).

use heapless::Vec;
use num_complex::Complex32;

use super::AccumulateError;
use crate::{LengthError, Map, Shape};

/// Adds the power of `samples` to `power`, element by element.
///
/// # Errors
/// [`LengthError`] if the lengths differ; nothing is then written.
pub fn add_power(power: &mut [f32], samples: &[Complex32]) -> Result<(), LengthError> {
    LengthError::check("power", samples.len(), power.len())?;
    for (sum, sample) in power.iter_mut().zip(samples) {
        *sum += sample.norm_sqr();
    }
    Ok(())
}

/// Summed power of maps of one shape, of at most `CAPACITY` bins.
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
    shape: Shape,
    num_maps: u32,
    power: Vec<f32, CAPACITY>,
}

impl<const CAPACITY: usize> PowerMap<CAPACITY> {
    /// Memory in bytes.
    pub const BYTES: usize = size_of::<Self>();

    /// No maps yet.
    pub const fn new() -> Self {
        Self {
            shape: Shape {
                num_pulses: 0,
                num_frequencies: 0,
                num_range_bins: 0,
                num_doppler_bins: 0,
            },
            num_maps: 0,
            power: Vec::new(),
        }
    }

    /// Adds a map. The first since [`PowerMap::clear`] sets the shape.
    ///
    /// # Errors
    /// [`AccumulateError`] if it does not fit or is of another shape; the sum then stays.
    pub fn accumulate(&mut self, map: &Map<'_>) -> Result<(), AccumulateError> {
        let shape = map.axes().shape();
        if self.num_maps == 0 {
            let wanted = shape.map_len();
            self.power
                .resize(wanted, 0.0)
                .map_err(|_| AccumulateError::Capacity {
                    capacity: CAPACITY,
                    wanted,
                })?;
            self.shape = shape;
        }
        let other_shape = AccumulateError::Shape {
            expected: self.shape,
            got: shape,
        };
        if shape != self.shape {
            return Err(other_shape);
        }
        add_power(&mut self.power, map.samples()).map_err(|_| other_shape)?;
        self.num_maps += 1;
        Ok(())
    }

    /// Summed power, `[doppler][range]`; empty before the first map.
    pub fn power(&self) -> &[f32] {
        &self.power
    }

    /// Maps summed.
    pub fn num_maps(&self) -> u32 {
        self.num_maps
    }

    /// Forgets all maps.
    pub fn clear(&mut self) {
        self.num_maps = 0;
        self.power.clear();
    }
}

impl<const CAPACITY: usize> Default for PowerMap<CAPACITY> {
    fn default() -> Self {
        Self::new()
    }
}
