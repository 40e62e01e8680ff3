//! GPU adapter opened for the shader: device, queue and pipelines.

use std::sync::{Arc, Mutex, PoisonError};

use subaperture_focus::device::DeviceError;

use crate::error::GpuError;

/// Kinds of device to open.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Hardware: a discrete, integrated or virtual GPU.
    Hardware,
    /// Hardware or, without any, a driver that runs on the processor, such as Mesa's lavapipe.
    Any,
}

/// Adapter with its device, queue and pipelines.
pub(crate) struct Adapter {
    pub(crate) name: String,
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    /// Pipelines for spline degrees 2 and 3.
    pub(crate) pipelines: [wgpu::ComputePipeline; 2],
    /// Largest buffer of a shader, bytes.
    pub(crate) binding_bytes: u64,
    /// First error that the device has reported.
    fault: Arc<Mutex<Option<String>>>,
}

/// Backends that wgpu may use: OpenGL lacks storage buffers on some drivers.
const BACKENDS: wgpu::Backends = wgpu::Backends::VULKAN.union(wgpu::Backends::METAL);

impl Adapter {
    /// Open the first adapter by kind: discrete, integrated, virtual, and for [`Kind::Any`] a driver on the processor.
    ///
    /// # Errors
    /// [`GpuError`].
    pub(crate) fn open(kind: Kind) -> Result<Self, GpuError> {
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
        Ok(Self {
            name: format!("{} ({})", info.name, info.driver_info).replace(" ()", ""),
            device,
            queue,
            pipelines,
            binding_bytes: limits.max_storage_buffer_binding_size,
            fault,
        })
    }

    /// Report the first error of the device, if any.
    pub(crate) fn check(&self) -> Result<(), DeviceError> {
        let fault = self.fault.lock().unwrap_or_else(PoisonError::into_inner);
        match &*fault {
            Some(message) => Err(DeviceError::new(&self.name, message)),
            None => Ok(()),
        }
    }
}
