//! Sums over the pixels of tiles, held by the device.

use bytemuck::cast_slice;
use num_complex::Complex32;
use rayon::prelude::*;
use subaperture_focus::device::{DeviceError, Expansion, ProfileBlock, TileSums};

use crate::adapter::Adapter;
use crate::paths::{VALUES, parameters};

/// Pixels along a side of the shader's workgroup.
const GROUP: usize = 16;

/// Limits of one dispatch: pixels, which bounds its time, and bytes of parameters.
const DISPATCH_PIXELS: usize = 1 << 22;
const DISPATCH_BYTES: usize = 32 << 20;

/// Sums of some tiles in one buffer.
struct Part {
    /// End of its tiles, which begin where those of the part before end.
    end: usize,
    sums: wgpu::Buffer,
}

pub(crate) struct Sums<'a> {
    gpu: &'a Adapter,
    /// Rows and columns of each tile.
    sizes: Vec<[usize; 2]>,
    /// First sum of each tile in its part's buffer.
    offsets: Vec<u32>,
    parts: Vec<Part>,
    /// Profiles of the loaded pulses, and the shader's description of the block.
    profiles: Option<wgpu::Buffer>,
    block: wgpu::Buffer,
    /// Carrier cycles per bin of the loaded pulses, the degree of their splines and the bins of a period.
    carriers: Vec<f64>,
    degree: usize,
    length: usize,
    /// Latest work submitted to the device.
    latest: Option<wgpu::SubmissionIndex>,
}

fn pixels([rows, columns]: &[usize; 2]) -> usize {
    rows * columns
}

impl<'a> Sums<'a> {
    pub(crate) fn new(gpu: &'a Adapter, sizes: &[[usize; 2]]) -> Result<Self, DeviceError> {
        let most = (gpu.binding_bytes / 8) as usize;
        let mut offsets = Vec::with_capacity(sizes.len());
        let (mut parts, mut count) = (Vec::new(), 0);
        let part = |end: usize, count: usize| Part {
            sums: gpu.buffer(
                8 * count as u64,
                wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
            ),
            end,
        };
        for (tile, size) in sizes.iter().enumerate() {
            if count + pixels(size) > most && count > 0 {
                parts.push(part(tile, count));
                count = 0;
            }
            offsets.push(count as u32);
            count += pixels(size);
        }
        if count > 0 {
            parts.push(part(sizes.len(), count));
        }
        gpu.check()?;
        Ok(Self {
            block: gpu.buffer(
                16,
                wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            ),
            gpu,
            sizes: sizes.to_vec(),
            offsets,
            parts,
            profiles: None,
            carriers: Vec::new(),
            degree: 0,
            length: 0,
            latest: None,
        })
    }

    /// Add the loaded pulses to tiles of one part.
    fn dispatch(&mut self, part: usize, tiles: &[usize], paths: &[Expansion]) {
        let (gpu, sizes, length) = (self.gpu, &self.sizes, self.length);
        let (carriers, pulses) = (&self.carriers, self.carriers.len());
        let mut values = vec![0; VALUES * paths.len()];
        values
            .par_chunks_exact_mut(VALUES * pulses)
            .zip(paths.par_chunks_exact(pulses))
            .zip(tiles)
            .for_each(|((values, paths), &tile)| {
                let pulses = paths.iter().zip(carriers);
                for (values, (path, &kappa)) in values.chunks_exact_mut(VALUES).zip(pulses) {
                    values.copy_from_slice(&parameters(path, sizes[tile], kappa, length));
                }
            });
        let header = |&tile: &usize| {
            let [rows, columns] = sizes[tile];
            [self.offsets[tile], columns as u32, rows as u32, 0]
        };
        let headers: Vec<[u32; 4]> = tiles.iter().map(header).collect();
        let [paths, headers] =
            [cast_slice(&values), cast_slice(&headers)].map(|bytes: &[u8]| gpu.storage(bytes));
        let profiles = self.profiles.as_ref().expect("a block is loaded first");
        let pipeline = &gpu.pipelines[self.degree - 2];
        let bound = [
            &self.block,
            profiles,
            &paths,
            &headers,
            &self.parts[part].sums,
        ];
        let bind_group = gpu.bind(pipeline, (0..).zip(bound));
        let groups = |axis: usize| {
            let sides = tiles.iter().map(|&tile| sizes[tile][axis]);
            sides.max().unwrap_or(0).div_ceil(GROUP) as u32
        };
        let [down, across] = [0, 1].map(groups);
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &bind_group, &[]);
            pass.dispatch_workgroups(across, down, tiles.len() as u32);
        }
        let now = gpu.queue.submit([encoder.finish()]);
        // The copies that the queue makes are released once the device has read them: two submissions are pending at most.
        if let Some(before) = self.latest.replace(now) {
            let waiting = wgpu::PollType::Wait {
                submission_index: Some(before),
                timeout: None,
            };
            // An error of the device is reported by its handler.
            let _ = gpu.device.poll(waiting);
        }
    }
}

impl TileSums for Sums<'_> {
    fn load(&mut self, block: &ProfileBlock) -> Result<(), DeviceError> {
        let (gpu, pulses) = (self.gpu, block.carriers.len());
        let bytes: &[u8] = cast_slice(block.profiles);
        let size = bytes.len() as u64;
        gpu.fits(&format!("the profiles of {pulses} pulses take"), size)?;
        if self.profiles.as_ref().is_none_or(|own| own.size() < size) {
            let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
            self.profiles = Some(gpu.buffer(size, usage));
        }
        let profiles = self.profiles.as_ref().expect("created above");
        gpu.queue.write_buffer(profiles, 0, bytes);
        let stride = block.length + 2 * block.margin;
        let header = [pulses, stride, block.margin, 0].map(|value| value as u32);
        gpu.queue.write_buffer(&self.block, 0, cast_slice(&header));
        self.carriers.clear();
        self.carriers.extend_from_slice(block.carriers);
        (self.degree, self.length) = (block.degree, block.length);
        gpu.check()
    }

    fn add(&mut self, tiles: &[usize], paths: &[Expansion]) -> Result<(), DeviceError> {
        let pulses = self.carriers.len();
        let path_bytes = 4 * VALUES * pulses;
        let (mut tiles, mut paths) = (tiles, paths);
        for part in 0..self.parts.len() {
            let end = self.parts[part].end;
            while tiles.first().is_some_and(|&first| first < end) {
                let (mut count, mut sum) = (0, 0);
                for &tile in tiles.iter().take_while(|&&tile| tile < end) {
                    sum += pixels(&self.sizes[tile]);
                    let is_full =
                        sum > DISPATCH_PIXELS || (count + 1) * path_bytes > DISPATCH_BYTES;
                    if is_full && count > 0 {
                        break;
                    }
                    count += 1;
                }
                let (now, later) = paths.split_at(count * pulses);
                self.dispatch(part, &tiles[..count], now);
                (tiles, paths) = (&tiles[count..], later);
            }
        }
        self.gpu.check()
    }

    fn wait(&mut self) -> Result<(), DeviceError> {
        self.latest = None;
        let waited = self.gpu.device.poll(wgpu::PollType::wait_indefinitely());
        self.gpu.check()?;
        let message = |error: wgpu::PollError| DeviceError::new(&self.gpu.name, error.to_string());
        waited.map(|_| ()).map_err(message)
    }

    fn take(mut self: Box<Self>) -> Result<Vec<Complex32>, DeviceError> {
        let gpu = self.gpu;
        let mut all = Vec::with_capacity(self.sizes.iter().map(pixels).sum());
        for part in &self.parts {
            all.extend(gpu.read::<Complex32>(&part.sums)?);
        }
        self.latest = None;
        Ok(all)
    }
}
