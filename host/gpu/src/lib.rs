//! Backprojection on a GPU: a [`Device`] for the former `bp`.
//!
//! Part of [Subaperture](https://docs.rs/subaperture), radar image formation; the crate `subaperture` re-exports it as the module `gpu`
//! if its feature `gpu` is enabled.
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
//! below 2^-27 cycles for tiles of 64 pixels. `e_n` and positions are float32: [`subaperture_focus::device::rounding`] bounds their error,
//! and a tile that would exceed the plan's share is left to the processor. The sine is a polynomial, because the
//! precision of WGSL's own is not specified.
//!
//! **Memory** of the device: 8 bytes per pixel formed at a time, the profiles of [`subaperture_focus::bp`]'s block of pulses, and 64 bytes for each pulse of the block
//! and tile.
//!
//! **Cost** per pixel and pulse: about 70 operations and `degree + 1` complex reads from a profile that neighbouring pixels share.

mod error;
mod paths;
mod sums;

use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use num_complex::Complex32;
use subaperture_focus::device::{Device, DeviceError, Expansion, ProfileBlock, TileSums};
use subaperture_focus::patch::PatchSize;

pub use error::GpuError;

/// Kinds of device to open.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Hardware: a discrete, integrated or virtual GPU.
    Hardware,
    /// Hardware or, without any, a driver that runs on the processor, such as Mesa's lavapipe.
    Any,
}

/// GPU opened for backprojection.
pub struct Gpu {
    name: String,
    device: wgpu::Device,
    queue: wgpu::Queue,
    /// Pipelines for spline degrees 2 and 3.
    pipelines: [wgpu::ComputePipeline; 2],
    /// Largest buffer of a shader, bytes.
    binding_bytes: u64,
    /// First error that the device has reported.
    fault: Arc<Mutex<Option<String>>>,
    pixel_ns: f64,
}

impl fmt::Debug for Gpu {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Gpu").field("name", &self.name).finish()
    }
}

/// Backends that wgpu may use: OpenGL lacks storage buffers on some drivers.
const BACKENDS: wgpu::Backends = wgpu::Backends::VULKAN.union(wgpu::Backends::METAL);

/// Side of the tiles and number of pulses of the measurement of speed, and its shortest sufficient time, s.
const SIDE: usize = 64;
const PULSES: usize = 64;
const LONG_ENOUGH_S: f64 = 0.01;
/// Largest number of its tiles.
const MAX_TILES: usize = 1024;

impl Gpu {
    /// Open the fastest kind of GPU there is: discrete, integrated, virtual, and for [`Kind::Any`] a driver on the processor. Measures its speed.
    ///
    /// # Errors
    /// [`GpuError`].
    pub fn open(kind: Kind) -> Result<Self, GpuError> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
            backends: BACKENDS,
            ..wgpu::InstanceDescriptor::new_without_display_handle()
        });
        let adapters = pollster::block_on(instance.enumerate_adapters(BACKENDS));
        let rank = |adapter: &wgpu::Adapter| match adapter.get_info().device_type {
            wgpu::DeviceType::DiscreteGpu => 0,
            wgpu::DeviceType::IntegratedGpu => 1,
            wgpu::DeviceType::VirtualGpu => 2,
            wgpu::DeviceType::Other => 3,
            wgpu::DeviceType::Cpu => 4,
        };
        let allowed = |adapter: &wgpu::Adapter| kind == Kind::Any || rank(adapter) < 4;
        let found: Vec<String> = adapters.iter().map(|own| own.get_info().name).collect();
        let adapter = adapters.into_iter().filter(allowed).min_by_key(rank);
        let adapter = adapter.ok_or(GpuError::NotFound { found })?;
        let limits = adapter.limits();
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("subaperture"),
            required_limits: limits.clone(),
            ..Default::default()
        }))
        .map_err(|error| GpuError::Refused {
            name: adapter.get_info().name,
            why: error.to_string(),
        })?;
        let fault = Arc::new(Mutex::new(None));
        let kept = fault.clone();
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
            kept.get_or_insert_with(|| error.to_string());
        }));
        let module = device.create_shader_module(wgpu::include_wgsl!("backproject.wgsl"));
        let pipelines = [2.0, 3.0].map(|degree| {
            device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some("backproject"),
                layout: None,
                module: &module,
                entry_point: None,
                compilation_options: wgpu::PipelineCompilationOptions {
                    constants: &[("degree", degree)],
                    ..Default::default()
                },
                cache: None,
            })
        });
        let info = adapter.get_info();
        let mut gpu = Self {
            name: format!("{} ({})", info.name, info.driver_info).replace(" ()", ""),
            device,
            queue,
            pipelines,
            binding_bytes: limits.max_storage_buffer_binding_size,
            fault,
            pixel_ns: f64::NAN,
        };
        gpu.pixel_ns = gpu.measure().map_err(|error| GpuError::Refused {
            name: gpu.name.clone(),
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
            let size = PatchSize {
                rows: SIDE,
                columns: SIDE,
            };
            let (sizes, all) = (vec![size; count], Vec::from_iter(0..count));
            let paths = vec![path; count * PULSES];
            let mut sums = self.start(&sizes)?;
            // The first block also creates buffers.
            sums.add(&block, &all, &paths)?;
            sums.wait()?;
            let start = Instant::now();
            sums.add(&block, &all, &paths)?;
            sums.wait()?;
            let elapsed_s = start.elapsed().as_secs_f64();
            if elapsed_s >= LONG_ENOUGH_S || count >= MAX_TILES {
                return Ok(1e9 * elapsed_s / (count * SIDE * SIDE * PULSES) as f64);
            }
            count *= 4;
        }
    }

    /// Report the first error of the device, if any.
    fn check(&self) -> Result<(), DeviceError> {
        let fault = self.fault.lock().unwrap_or_else(PoisonError::into_inner);
        match &*fault {
            Some(message) => Err(DeviceError::new(&self.name, message)),
            None => Ok(()),
        }
    }
}

impl Device for Gpu {
    fn name(&self) -> &str {
        &self.name
    }

    fn pixel_ns(&self) -> f64 {
        self.pixel_ns
    }

    fn start<'a>(&'a self, tiles: &[PatchSize]) -> Result<Box<dyn TileSums + 'a>, DeviceError> {
        Ok(Box::new(sums::Sums::new(self, tiles)?))
    }
}
