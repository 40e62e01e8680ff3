//! Backprojection and the interpolation of range-Doppler maps on a GPU: a [`Device`] for the formers `bp` and `rdbp`.
//!
//! Part of [Subaperture](https://docs.rs/subaperture), radar image formation; the crate `subaperture` re-exports it as the module `gpu`
//! if its feature `gpu` is enabled.
//!
//! # Backprojection
//!
//! ```text
//! sum[p] += sum_n exp(+j 2 pi kappa_n t_n(p)) value_n(t_n(p)),   t_n(p) = a + b i + c j + e_n(i, j)
//! ```
//!
//! The plan, its tiles, range profiles and path polynomials are those of the processor ([`subaperture_focus::bp`]); a pulse of a tile whose polynomial does not
//! keep the bound is added by the processor. The pixel is at column `i` and row `j` from the tile's centre; `e_n` has the terms of second and third degree.
//!
//! **Accuracy.** GPUs have no fast float64. Float32 phases of a path of kilometres would have an error of -26 dB at 10 GHz. Here the linear
//! part of the phase, `kappa (a + b i + c j)`, is computed in fractions of 2^32 of a cycle by integers, which wrap as phases do; its error is
//! below 2^-25 cycles for tiles of 64 pixels. `e_n` and positions are float32: [`subaperture_focus::device::rounding`] bounds their error,
//! and a tile that would exceed the plan's share is left to the processor. The sine is a polynomial, because the
//! precision of WGSL's own is not specified.
//!
//! **Memory** of the device: 8 bytes per pixel formed at a time, the profiles of [`subaperture_focus::bp`]'s block of pulses, and 64 bytes for each pulse of the block
//! and tile.
//!
//! **Cost** per pixel and pulse: about 70 operations and `degree + 1` complex reads from a profile that neighbouring pixels share.
//!
//! # Interpolation of maps
//!
//! The precise mode of `rdbp` makes the range-Doppler maps of a patch on the processor; the GPU interpolates them in range along the curve of every line of pixels,
//! then in Doppler at every pixel, and multiplies by the carrier ([`subaperture_focus::device::PatchSums`]). Positions, kernels and error bound are
//! those of the processor, and carrier phases are fixed-point as above; a patch whose phases would exceed its share of the error
//! ([`subaperture_focus::device::map_rounding`]) is left to the processor. **Memory** of the device: the map of a sub-aperture and the pixels of a patch, for each thread. **Cost**
//! 6 complex reads per Doppler bin and line, 12 per pixel and map. The processor's part, histories and transforms, is the larger one.
#![forbid(unsafe_code)]

mod adapter;
mod error;
mod maps;
mod paths;
mod sums;

use std::fmt;
use std::time::Instant;

use num_complex::Complex32;
use subaperture_focus::device::{
    Device, DeviceError, Expansion, PatchSums, ProfileBlock, TileSums,
};

use adapter::Adapter;
pub use adapter::Kind;
pub use error::GpuError;

/// GPU opened for backprojection.
pub struct Gpu {
    adapter: Adapter,
    pixel_ns: f64,
}

impl fmt::Debug for Gpu {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Gpu")
            .field("name", &self.adapter.name)
            .finish()
    }
}

/// Side of the tiles and number of pulses of the measurement of speed, and its shortest sufficient time, s.
const SIDE: usize = 64;
const PULSES: usize = 64;
const LONG_ENOUGH_S: f64 = 0.01;
/// Largest number of its tiles.
const MAX_TILES: usize = 1024;

impl Gpu {
    /// Open a discrete GPU, else an integrated or a virtual one, else for [`Kind::Any`] a driver on the processor, and measure its speed.
    ///
    /// # Errors
    /// [`GpuError`].
    pub fn open(kind: Kind) -> Result<Self, GpuError> {
        let mut gpu = Self {
            adapter: Adapter::open(kind)?,
            pixel_ns: f64::NAN,
        };
        gpu.pixel_ns = gpu.measure().map_err(|error| GpuError::Refused {
            name: gpu.adapter.name.clone(),
            why: error.to_string(),
        })?;
        Ok(gpu)
    }

    /// Measure the time per pixel and pulse, ns, on tiles of zeros.
    fn measure(&self) -> Result<f64, DeviceError> {
        let path = Expansion {
            legs_m: [1000.0; 2],
            at: 100.0,
            first: [0.5, 2.0],
            second: [1e-4; 3],
            third: [1e-7; 4],
        };
        let (length, margin) = (4096, 256);
        let profiles = vec![Complex32::ZERO; PULSES * (length + 2 * margin)];
        let block = ProfileBlock {
            degree: 3,
            length,
            margin,
            profiles: &profiles,
            carriers: &[8.0; PULSES],
        };
        let mut count = 4;
        loop {
            let (sizes, all) = (vec![[SIDE; 2]; count], Vec::from_iter(0..count));
            let paths = vec![path; count * PULSES];
            let mut sums = self.start(&sizes)?;
            sums.load(&block)?;
            // The first call also creates buffers.
            sums.add(&all, &paths)?;
            sums.wait()?;
            let start = Instant::now();
            sums.add(&all, &paths)?;
            sums.wait()?;
            let elapsed_s = start.elapsed().as_secs_f64();
            if elapsed_s >= LONG_ENOUGH_S || count >= MAX_TILES {
                return Ok(1e9 * elapsed_s / (count * SIDE * SIDE * PULSES) as f64);
            }
            count *= 4;
        }
    }
}

impl Device for Gpu {
    fn name(&self) -> &str {
        &self.adapter.name
    }

    fn pixel_ns(&self) -> f64 {
        self.pixel_ns
    }

    fn start<'a>(&'a self, tiles: &[[usize; 2]]) -> Result<Box<dyn TileSums + 'a>, DeviceError> {
        Ok(Box::new(sums::Sums::new(&self.adapter, tiles)?))
    }

    fn start_patch<'a>(
        &'a self,
        stations: usize,
        lines: usize,
    ) -> Result<Box<dyn PatchSums + 'a>, DeviceError> {
        Ok(Box::new(maps::MapSums::new(
            &self.adapter,
            stations,
            lines,
        )?))
    }
}
