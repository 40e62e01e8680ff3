//! GPU adapter opened for the shaders: device, queue and pipelines.

use std::sync::{Arc, Mutex, PoisonError, mpsc};

use bytemuck::pod_collect_to_vec;
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
    /// Backprojection with spline degrees 2 and 3.
    pub(crate) pipelines: [wgpu::ComputePipeline; 2],
    /// Interpolation of maps in range and in Doppler.
    pub(crate) map_pipelines: [wgpu::ComputePipeline; 2],
    /// Largest buffer of a shader, bytes.
    pub(crate) binding_bytes: u64,
    /// First error that the device has reported.
    fault: Arc<Mutex<Option<String>>>,
}

/// Functions that both shaders use.
const PHASOR: &str = include_str!("phasor.wgsl");

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
        let module = |label: &str, source: &str| {
            device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(label),
                source: wgpu::ShaderSource::Wgsl([PHASOR, source].concat().into()),
            })
        };
        let pipeline =
            |module: &wgpu::ShaderModule, entry_point: &'static str, constants: &[(&str, f64)]| {
                device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                    label: Some(entry_point),
                    layout: None,
                    module,
                    entry_point: Some(entry_point),
                    compilation_options: wgpu::PipelineCompilationOptions {
                        constants,
                        ..Default::default()
                    },
                    cache: None,
                })
            };
        let backproject = module("backproject", include_str!("backproject.wgsl"));
        let pipelines =
            [2.0, 3.0].map(|degree| pipeline(&backproject, "backproject", &[("degree", degree)]));
        let read_map = module("read_map", include_str!("read_map.wgsl"));
        let map_pipelines = ["in_range", "in_doppler"].map(|step| pipeline(&read_map, step, &[]));
        let info = adapter.get_info();
        Ok(Self {
            name: format!("{} ({})", info.name, info.driver_info).replace(" ()", ""),
            device,
            queue,
            pipelines,
            map_pipelines,
            binding_bytes: limits.max_storage_buffer_binding_size,
            fault,
        })
    }

    pub(crate) fn buffer(&self, size: u64, usage: wgpu::BufferUsages) -> wgpu::Buffer {
        self.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size,
            usage,
            mapped_at_creation: false,
        })
    }

    /// Check the size of a buffer; `purpose` begins the message of the error, such as "the values of a map take".
    ///
    /// # Errors
    /// [`DeviceError`] if the buffer would be too large.
    pub(crate) fn fits(&self, purpose: &str, bytes: u64) -> Result<(), DeviceError> {
        let most = self.binding_bytes;
        match bytes <= most {
            true => Ok(()),
            false => Err(DeviceError::new(
                &self.name,
                format!("{purpose} {bytes} bytes, more than the {most} of its largest buffer"),
            )),
        }
    }

    /// Bind buffers to the bindings of a pipeline.
    pub(crate) fn bind<'b>(
        &self,
        pipeline: &wgpu::ComputePipeline,
        buffers: impl Iterator<Item = (u32, &'b wgpu::Buffer)>,
    ) -> wgpu::BindGroup {
        let entries = buffers.map(|(binding, buffer)| wgpu::BindGroupEntry {
            binding,
            resource: buffer.as_entire_binding(),
        });
        self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &pipeline.get_bind_group_layout(0),
            entries: &entries.collect::<Vec<_>>(),
        })
    }

    /// Storage buffer with these contents.
    pub(crate) fn storage(&self, bytes: &[u8]) -> wgpu::Buffer {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        let buffer = self.buffer(bytes.len() as u64, usage);
        self.queue.write_buffer(&buffer, 0, bytes);
        buffer
    }

    /// Contents of a buffer, once all work submitted before is done.
    ///
    /// # Errors
    /// [`DeviceError`].
    pub(crate) fn read<T: bytemuck::Pod>(
        &self,
        buffer: &wgpu::Buffer,
    ) -> Result<Vec<T>, DeviceError> {
        let size = buffer.size();
        let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let copy = self.buffer(size, usage);
        let mut encoder = self.device.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(buffer, 0, &copy, 0, size);
        let submission = self.queue.submit([encoder.finish()]);
        let (sender, receiver) = mpsc::channel();
        copy.map_async(wgpu::MapMode::Read, .., move |mapped| {
            // The receiver waits for this.
            let _ = sender.send(mapped);
        });
        let waited = self.device.poll(wgpu::PollType::Wait {
            submission_index: Some(submission),
            timeout: None,
        });
        self.check()?;
        let message =
            |error: &dyn std::fmt::Display| DeviceError::new(&self.name, error.to_string());
        waited.map_err(|error| message(&error))?;
        let mapped = receiver.recv().map_err(|error| message(&error))?;
        mapped.map_err(|error| message(&error))?;
        let view = copy.get_mapped_range(..).map_err(|error| message(&error))?;
        Ok(pod_collect_to_vec::<u8, T>(&view))
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
