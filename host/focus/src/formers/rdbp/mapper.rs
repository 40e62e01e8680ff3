//! The maps of one patch: samples compensated to its centre, Keystone and Doppler, range, and every pixel read.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use subaperture_fft::Fft;

use crate::Aim;
use crate::exact::add_pulse;
use crate::patch::{Rectangle, Segment};
use crate::sub_cpi::SubCpi;
use subaperture_kernels::compensation::{self, Ramp};
use subaperture_kernels::lanes::Instructions;
use subaperture_kernels::paths::{Line, Points};
use subaperture_kernels::reading::Map;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::monitor::{Monitor, during};
use subaperture_model::phase_history::Band;
use subaperture_signal::fast_length::fast_length;
use subaperture_signal::kaiser_bessel::KaiserBessel;
use subaperture_signal::phase::{narrow, phasor};
use subaperture_signal::scaled_dft::{ScaledDft, Shape};

/// The stages.
pub(super) const MAPS: &str = "maps";
pub(super) const PIXELS: &str = "pixels";

/// Pixels whose paths are held at a time.
const RUN: usize = 64;

/// What is asked of the Doppler transform of each length of sub-CPIs, and bins for each cycle a pulse.
pub(super) type Shapes = BTreeMap<usize, (Shape, f64)>;

/// Doppler processing for sub-CPIs of one length.
struct DopplerStage {
    dft: ScaledDft,
    /// Bin of zero Doppler, and bins per cycle a pulse.
    centre: f64,
    bins_per_cycle: f64,
}

/// Everything that does not change from map to map.
pub(super) struct Mapper<'a, const W: usize> {
    aim: Aim<'a>,
    kernel: KaiserBessel,
    /// Fast-time window over the kernel's spectrum.
    range_weights: Vec<f32>,
    stages: BTreeMap<usize, DopplerStage>,
    range_fft: Arc<dyn Fft<f32>>,
    norm: f64,
    instructions: Instructions,
    centre_cycles_m: f64,
    range_bins_m: f64,
}

/// One thread's buffers.
pub(super) struct Scratch {
    /// Compensated samples, frequency by frequency, `M` each.
    slow: Vec<Complex32>,
    /// The map, Doppler bin by Doppler bin, `L + W - 1` range values each, the first repeated.
    map: Vec<Complex32>,
    fft: Vec<Complex32>,
    /// Places of a run of pixels, and the lines of their paths.
    points: Points,
    lines: Vec<Line>,
}

impl<'a, const W: usize> Mapper<'a, W> {
    pub(super) fn new(aim: Aim<'a>, band: &Band, shapes: &Shapes) -> Self {
        let transforms = aim.means.transforms;
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
                dft: ScaledDft::new(transforms, &scales, shape, weight),
                centre: shape.output_centre,
                bins_per_cycle,
            };
            (inputs, stage)
        };
        let fast = aim.weights.fast.iter().enumerate();
        Self {
            aim,
            range_weights: fast.map(range_weight).collect(),
            stages: shapes.iter().map(stage).collect(),
            range_fft: transforms.inverse(length),
            norm: aim.weights.normalisation(),
            instructions: Instructions::best(),
            centre_cycles_m: band.centre_hz() / SPEED_OF_LIGHT_M_S,
            range_bins_m: length as f64 * band.step_hz / SPEED_OF_LIGHT_M_S,
            kernel,
        }
    }

    fn row_length(&self) -> usize {
        self.range_fft.len() + W - 1
    }

    fn scratch_lengths(&self, sub_cpi_length: usize) -> [usize; 3] {
        let bins = self
            .stages
            .values()
            .map(|s| s.dft.shape().outputs)
            .max()
            .unwrap_or(0);
        let dft = self
            .stages
            .values()
            .map(|s| s.dft.scratch_length())
            .max()
            .unwrap_or(0);
        [
            sub_cpi_length * self.range_weights.len(),
            bins * self.row_length(),
            dft.max(self.range_fft.get_inplace_scratch_len()),
        ]
    }

    pub(super) fn scratch_bytes(&self, sub_cpi_length: usize) -> u64 {
        8 * self.scratch_lengths(sub_cpi_length).iter().sum::<usize>() as u64
    }

    pub(super) fn scratch(&self, sub_cpi_length: usize) -> Scratch {
        let [slow, map, fft] = self
            .scratch_lengths(sub_cpi_length)
            .map(|n| vec![Complex32::ZERO; n]);
        Scratch {
            slow,
            map,
            fft,
            points: Points::default(),
            lines: Vec::new(),
        }
    }

    /// Adds one sub-CPI, `samples` pulse by pulse, to one patch.
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
        self.compensate(sub_cpi, samples, rectangle, &mut scratch.slow);
        self.map(stage, sub_cpi.num_pulses(), scratch);
        drop(mapping);
        let _reading = during(monitor, PIXELS);
        self.read(stage, sub_cpi, samples, rectangle, scratch, segments);
    }

    /// Phase of every sample referred to the patch's centre; windows applied; transposed to
    /// frequency-major.
    fn compensate(
        &self,
        sub_cpi: &SubCpi,
        samples: &[Complex32],
        rectangle: &Rectangle,
        slow: &mut [Complex32],
    ) {
        let num_samples = self.range_weights.len();
        let num_pulses = sub_cpi.num_pulses();
        let centre = rectangle.centre_m(self.aim.grid);
        for (m, (n, row)) in sub_cpi
            .pulses
            .clone()
            .zip(samples.chunks_exact(num_samples))
            .enumerate()
        {
            let pulse = &self.aim.collection.pulses[n];
            if !pulse.sweep.is_at_once() {
                let slow_weight = self.aim.weights.slow[n] * self.norm;
                let column = slow[m..].iter_mut().step_by(num_pulses);
                for (k, ((out, z), w)) in column.zip(row).zip(&self.range_weights).enumerate() {
                    let after = k as f64 - (num_samples / 2) as f64;
                    let path_m = pulse.relative_path_after_m(centre, after);
                    let turns = pulse.frequency_hz(k) * (path_m / SPEED_OF_LIGHT_M_S);
                    *out = z * narrow(phasor(turns) * slow_weight) * w;
                }
                continue;
            }
            let delay_s = pulse.relative_path_m(centre) / SPEED_OF_LIGHT_M_S;
            let weight = self.aim.weights.slow[n] * self.norm;
            let ramp = Ramp::new(pulse.start_hz * delay_s, pulse.step_hz * delay_s, weight);
            let column = &mut slow[m..];
            compensation::refer_to_column(row, &self.range_weights, ramp, column, num_pulses);
        }
    }

    /// Keystone and Doppler, then range.
    fn map(&self, stage: &DopplerStage, num_pulses: usize, scratch: &mut Scratch) {
        let (num_samples, length) = (self.range_weights.len(), self.range_fft.len());
        let row_length = self.row_length();
        let Scratch { slow, map, fft, .. } = scratch;
        let map = &mut map[..stage.dft.shape().outputs * row_length];
        map.fill(Complex32::ZERO);
        for k in 0..num_samples {
            let place = (k + length - num_samples / 2) % length;
            let row = &slow[k * num_pulses..(k + 1) * num_pulses];
            stage
                .dft
                .transform(k, row, fft, |d, value| map[d * row_length + place] = value);
        }
        for row in map.chunks_exact_mut(row_length) {
            self.range_fft.process_with_scratch(&mut row[..length], fft);
            // Range repeats; value by value, for a row may be shorter than the kernel.
            for i in 0..W - 1 {
                row[length + i] = row[i];
            }
        }
    }

    /// Reads the map at every pixel's range and Doppler.
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
        let grid = self.aim.grid;
        let datum = sub_cpi.datum(rectangle.centre_m(grid));
        let map = Map::<W> {
            values: &map[..stage.dft.shape().outputs * self.row_length()],
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
                points.clear();
                (0..pixels.len()).for_each(|i| points.push(point(i).to_array()));
                lines.resize(pixels.len(), Line::default());
                sub_cpi.lines(self.instructions, &datum, points, lines);
                map.add(self.instructions, lines, pixels, |i| {
                    self.sum(sub_cpi, samples, point(i))
                });
            }
        }
    }

    /// A pixel whose Doppler lies outside the map, near the antennas between the places at which rates were looked
    /// at: the sum itself.
    fn sum(&self, sub_cpi: &SubCpi, samples: &[Complex32], point: DVec3) -> Complex32 {
        let weights = self.aim.weights;
        let mut sums = [Complex64::ZERO];
        let rows = samples.chunks_exact(weights.fast.len());
        for (n, row) in sub_cpi.pulses.clone().zip(rows) {
            let pulse = &self.aim.collection.pulses[n];
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
