//! Sums over the pixels of a patch, interpolated from range-Doppler maps by the device.

use bytemuck::cast_slice;
use subaperture_focus::device::{Curve, DeviceError, PatchMap, PatchSums, Station, pixel_stride};

use crate::adapter::Adapter;
use crate::paths::fixed;

/// Side of the shader's workgroup.
const GROUP: usize = 16;

pub(crate) struct MapSums<'a> {
    gpu: &'a Adapter,
    stations: usize,
    lines: usize,
    pixels: wgpu::Buffer,
}

impl<'a> MapSums<'a> {
    pub(crate) fn new(
        gpu: &'a Adapter,
        stations: usize,
        lines: usize,
    ) -> Result<Self, DeviceError> {
        let bytes = 8 * (stations * pixel_stride(lines)) as u64;
        gpu.fits("the pixels of a patch take", bytes)?;
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        let pixels = gpu.buffer(bytes, usage);
        gpu.check()?;
        Ok(Self {
            gpu,
            stations,
            lines,
            pixels,
        })
    }
}

/// Parameters of a line, in the order of the shader. The map has `range_bins` bins per period.
fn line(curve: &Curve, range_bins: usize) -> [u32; 8] {
    let [a, b, c, d, e] = curve.terms.map(f32::to_bits);
    let start = curve.start.rem_euclid(range_bins as f64) as u32;
    [start, a, b, c, d, e, 0, 0]
}

/// Parameters of a station, in the order of the shader; `step` is the spacing of lines.
fn station(station: &Station, step: f64) -> [u32; 12] {
    let [a, b, c, d, e] = station.bins.map(f32::to_bits);
    let [at_0, slope, rest @ ..] = station.cycles;
    let [x, y, z] = rest.map(|term| (term as f32).to_bits());
    let (first, step) = (fixed(at_0 - slope), fixed(slope * step));
    [
        station.start as i32 as u32,
        a,
        b,
        c,
        d,
        e,
        first,
        step,
        x,
        y,
        z,
        0,
    ]
}

impl PatchSums for MapSums<'_> {
    fn add(&mut self, map: &PatchMap) -> Result<(), DeviceError> {
        let (gpu, reading) = (self.gpu, map.reading);
        let bins = map.values.len() / 2 / map.range_bins;
        gpu.fits("the values of a map take", size_of_val(map.values) as u64)?;
        let line_step = 2.0 / (self.lines.max(2) - 1) as f64;
        let [low, high] = reading.clamp;
        let sizes = [
            bins as u32,
            map.range_bins as u32,
            self.lines as u32,
            self.stations as u32,
            map.first_bin as i32 as u32,
            pixel_stride(self.lines) as u32,
            (line_step as f32).to_bits(),
            reading.bin_scale.to_bits(),
            low.to_bits(),
            high.to_bits(),
            0,
            0,
        ];
        let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let header = gpu.buffer(size_of_val(&sizes) as u64, usage);
        gpu.queue.write_buffer(&header, 0, cast_slice(&sizes));
        let kernels = map.kernels.concat();
        let curves = reading.curves.iter();
        let curves: Vec<[u32; 8]> = curves.map(|curve| line(curve, map.range_bins)).collect();
        let stations = reading.stations.iter();
        let stations: Vec<[u32; 12]> = stations.map(|own| station(own, line_step)).collect();
        let [kernels, values, curves, stations] = [
            cast_slice(kernels.as_flattened()),
            cast_slice(map.values),
            cast_slice(&curves),
            cast_slice(&stations),
        ]
        .map(|bytes: &[u8]| gpu.storage(bytes));
        let crossed = gpu.buffer(8 * (bins * self.lines) as u64, wgpu::BufferUsages::STORAGE);
        let buffers = [
            &header,
            &kernels,
            &values,
            &curves,
            &stations,
            &crossed,
            &self.pixels,
        ];
        // Buffers that each step uses, and its invocations.
        let steps = [
            (&[0u32, 1, 2, 3, 5][..], [bins, self.lines]),
            (&[0, 1, 4, 5, 6][..], [self.lines, self.stations]),
        ];
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        for (pipeline, (used, counts)) in gpu.map_pipelines.iter().zip(steps) {
            let used = used
                .iter()
                .map(|&binding| (binding, buffers[binding as usize]));
            let bind_group = gpu.bind(pipeline, used);
            let [across, down] = counts.map(|count| count.div_ceil(GROUP) as u32);
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &bind_group, &[]);
            pass.dispatch_workgroups(across, down, 1);
        }
        gpu.queue.submit([encoder.finish()]);
        gpu.check()
    }

    fn take(self: Box<Self>) -> Result<Vec<f32>, DeviceError> {
        self.gpu.read(&self.pixels)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn range_bins_are_reduced_to_a_period() {
        let curve = Curve {
            start: -3.0,
            terms: [1.0, 0.0, 0.0, 0.0, 0.0],
        };
        let own = line(&curve, 100);
        assert_eq!((own[0], own[1]), (97, 1f32.to_bits()));
    }

    #[test]
    fn linear_phase_starts_at_the_first_line() {
        let own = Station {
            start: -2.0,
            bins: [0.0; 5],
            cycles: [10.5, 0.25, 2.0, 0.0, 0.0],
        };
        let parameters = station(&own, 0.5);
        assert_eq!(parameters[0] as i32, -2);
        // 10.25 cycles, and an eighth from line to line.
        assert_eq!(parameters[6..8], [1 << 30, 1 << 29]);
        assert_eq!(parameters[8], 2f32.to_bits());
    }
}
