//! Range-Doppler maps of a patch: compensation to its centre, Keystone and Doppler, range, interpolation of every pixel.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use subaperture_fft::Fft;

use super::doppler::{Compensation, Doppler, DopplerScratch};
use crate::ImageSpec;
use crate::exact::add_pulse;
use crate::patch::{Rectangle, Segment};
use crate::sub_cpi::SubCpi;
use subaperture_kernels::doppler::MapRows;
use subaperture_kernels::lanes::Instructions;
use subaperture_kernels::map::{Map, row_length};
use subaperture_kernels::paths::{Line, Points, Row};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::monitor::{Monitor, during};
use subaperture_model::phase_history::Band;
use subaperture_signal::fast_length::fast_length;
use subaperture_signal::kaiser_bessel::KaiserBessel;
use subaperture_signal::phase::narrow;
use subaperture_signal::scaled_dft::Shape;

/// Names of the stages.
pub(super) const MAPS: &str = "maps";
pub(super) const PIXELS: &str = "pixels";

/// Pixels whose paths are computed at a time.
const RUN: usize = 256;

/// Shape of the Doppler transform and bins per cycle per pulse, for each sub-CPI length.
pub(super) type Shapes = BTreeMap<usize, (Shape, f64)>;

/// Doppler processing for sub-CPIs of one length.
struct DopplerStage {
    doppler: Doppler,
    /// Bin of zero Doppler, and bins per cycle per pulse.
    centre: f64,
    bins_per_cycle: f64,
}

/// Data shared by all maps.
pub(super) struct Mapper<'a, const W: usize> {
    spec: ImageSpec<'a>,
    kernel: KaiserBessel,
    /// Fast-time window divided by the kernel's spectrum.
    range_weights: Vec<f32>,
    stages: BTreeMap<usize, DopplerStage>,
    range_fft: Arc<dyn Fft<f32>>,
    norm: f64,
    instructions: Instructions,
    centre_cycles_m: f64,
    range_bins_m: f64,
}

/// Scratch buffers of one thread.
pub(super) struct Scratch {
    doppler: DopplerScratch,
    /// Map in the layout of the interpolator ([`Map`]).
    map: Vec<f32>,
    /// Row of the map, and scratch of its transform.
    fft: Vec<Complex32>,
    /// Positions of a block of pixels, and the linear models of their paths.
    points: Points,
    lines: Vec<Line>,
}

impl<'a, const W: usize> Mapper<'a, W> {
    pub(super) fn new(spec: ImageSpec<'a>, band: &Band, shapes: &Shapes) -> Self {
        let transforms = spec.numerics.transforms;
        let kernel = KaiserBessel::new(W);
        let length = fast_length(2 * band.count);
        let centre = band.count / 2;
        let range_weight = |(k, w): (usize, &f64)| {
            (w / kernel.spectrum((k as f64 - centre as f64) / length as f64)) as f32
        };
        let scales = band.scales();
        let stage = |(&inputs, &(shape, bins_per_cycle)): (&usize, &(Shape, f64))| {
            let weight = |k: usize, m: usize| {
                let u = scales[k] * (m as f64 - shape.centre_of(k, band.count));
                1.0 / kernel.spectrum(u / bins_per_cycle)
            };
            let stage = DopplerStage {
                doppler: Doppler::new(spec.numerics.model, transforms, &scales, shape, weight),
                centre: shape.output_centre,
                bins_per_cycle,
            };
            (inputs, stage)
        };
        let fast = spec.weights.fast.iter().enumerate();
        Self {
            spec,
            range_weights: fast.map(range_weight).collect(),
            stages: shapes.iter().map(stage).collect(),
            range_fft: transforms.inverse(length),
            norm: spec.weights.normalisation(),
            instructions: Instructions::best(),
            centre_cycles_m: band.centre_hz() / SPEED_OF_LIGHT_M_S,
            range_bins_m: length as f64 * band.step_hz / SPEED_OF_LIGHT_M_S,
            kernel,
        }
    }

    fn row_length(&self) -> usize {
        row_length(self.range_fft.len())
    }

    fn dopplers(&self) -> impl Iterator<Item = &Doppler> {
        self.stages.values().map(|stage| &stage.doppler)
    }

    /// Values of the largest map, and scratch values of range transforms.
    fn scratch_lengths(&self) -> [usize; 2] {
        let bins = self.dopplers().map(Doppler::outputs).max().unwrap_or(0);
        let fft = &self.range_fft;
        [
            bins * self.row_length(),
            fft.len() + fft.get_inplace_scratch_len(),
        ]
    }

    pub(super) fn scratch_bytes(&self, sub_cpi_length: usize) -> u64 {
        let doppler = DopplerScratch::bytes(self.dopplers(), sub_cpi_length);
        doppler + 8 * self.scratch_lengths().iter().sum::<usize>() as u64
    }

    pub(super) fn scratch(&self, sub_cpi_length: usize) -> Scratch {
        let [map, fft] = self.scratch_lengths();
        Scratch {
            doppler: DopplerScratch::new(self.dopplers(), sub_cpi_length),
            map: vec![0.0; 2 * map],
            fft: vec![Complex32::ZERO; fft],
            points: Points::default(),
            lines: Vec::new(),
        }
    }

    /// Add one sub-CPI, `samples` pulse by pulse, to one patch.
    pub(super) fn add(
        &self,
        sub_cpi: &SubCpi,
        samples: &[Complex32],
        rectangle: &Rectangle,
        segments: &mut [Segment],
        scratch: &mut Scratch,
        monitor: &dyn Monitor,
    ) {
        let stage = &self.stages[&sub_cpi.num_pulses()];
        let mapping = during(monitor, MAPS);
        self.map(stage, sub_cpi, samples, rectangle, scratch);
        drop(mapping);
        let _reading = during(monitor, PIXELS);
        self.read(stage, sub_cpi, samples, rectangle, scratch, segments);
    }

    /// Compute the map: compensation, Keystone and Doppler, then range.
    fn map(
        &self,
        stage: &DopplerStage,
        sub_cpi: &SubCpi,
        samples: &[Complex32],
        rectangle: &Rectangle,
        scratch: &mut Scratch,
    ) {
        let (num_samples, length) = (self.range_weights.len(), self.range_fft.len());
        let row_length = self.row_length();
        let Scratch {
            doppler, map, fft, ..
        } = scratch;
        let map = &mut map[..2 * stage.doppler.outputs() * row_length];
        map.fill(0.0);
        let compensation = Compensation {
            collection: self.spec.collection,
            fast: &self.range_weights,
            slow: &self.spec.weights.slow,
            norm: self.norm,
            instructions: self.instructions,
        };
        let mut rows = MapRows {
            values: map,
            row_length,
            length,
            first: length - num_samples / 2,
        };
        let centre = rectangle.centre_m(self.spec.grid);
        let of = &stage.doppler;
        of.map(&compensation, sub_cpi, centre, samples, doppler, &mut rows);
        let (row, fft) = fft.split_at_mut(length);
        for planes in map.chunks_exact_mut(2 * row_length) {
            let (real, imaginary) = planes.split_at_mut(row_length);
            for (z, (re, im)) in row.iter_mut().zip(real.iter().zip(&*imaginary)) {
                *z = Complex32::new(*re, *im);
            }
            self.range_fft.process_with_scratch(row, fft);
            for (z, (re, im)) in row.iter().zip(real.iter_mut().zip(&mut *imaginary)) {
                (*re, *im) = (z.re, z.im);
            }
            // Range is periodic. Values are copied one by one, since a row may be shorter than its repetition.
            for i in length..row_length {
                (real[i], imaginary[i]) = (real[i - length], imaginary[i - length]);
            }
        }
    }

    /// Interpolate the map at the range and Doppler of every pixel.
    fn read(
        &self,
        stage: &DopplerStage,
        sub_cpi: &SubCpi,
        samples: &[Complex32],
        rectangle: &Rectangle,
        scratch: &mut Scratch,
        segments: &mut [Segment],
    ) {
        let Scratch {
            map, points, lines, ..
        } = scratch;
        let grid = self.spec.grid;
        let datum = sub_cpi.datum(rectangle.centre_m(grid));
        let map = Map::<W> {
            values: &map[..2 * stage.doppler.outputs() * self.row_length()],
            length: self.range_fft.len(),
            kernel: &self.kernel,
            cycles_m: self.centre_cycles_m,
            bins_per_cycle: stage.bins_per_cycle,
            zero_bin: stage.centre,
            range_bins_m: self.range_bins_m,
        };
        for segment in segments {
            for (run, pixels) in segment.pixels.chunks_mut(RUN).enumerate() {
                let first = segment.column + run * RUN;
                let point = |i: usize| grid.position_m(segment.row, first + i);
                if grid.polar {
                    points.clear();
                    (0..pixels.len()).for_each(|i| points.push(point(i).to_array()));
                } else {
                    let across_m = grid.y_axis * grid.rows.at(segment.row);
                    let row = Row {
                        origin_m: grid.origin_m.to_array(),
                        x_axis: grid.x_axis.to_array(),
                        across_m: across_m.to_array(),
                        start_m: grid.columns.start,
                        step_m: grid.columns.step,
                        first,
                    };
                    points.set_row(self.instructions, &row, pixels.len());
                }
                lines.resize(pixels.len(), Line::default());
                sub_cpi.lines(self.instructions, &datum, points, lines);
                map.add(self.instructions, lines, pixels, |i| {
                    self.sum(sub_cpi, samples, point(i))
                });
            }
        }
    }

    /// Exact sum for a pixel with a Doppler outside the map. Such pixels occur near the antennas, between the points at which rates
    /// were sampled.
    fn sum(&self, sub_cpi: &SubCpi, samples: &[Complex32], point: DVec3) -> Complex32 {
        let weights = self.spec.weights;
        let mut sums = [Complex64::ZERO];
        let rows = samples.chunks_exact(weights.fast.len());
        for (n, row) in sub_cpi.pulses.clone().zip(rows) {
            let pulse = &self.spec.collection.pulses[n];
            add_pulse(
                pulse,
                weights.slow[n],
                &weights.fast,
                row,
                &[point],
                &mut sums,
            );
        }
        narrow(sums[0] * self.norm)
    }
}
