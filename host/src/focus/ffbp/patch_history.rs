//! A patch's own phase history, its refinement to a smaller patch, and the image of a small one.

use std::collections::BTreeMap;
use std::ops::Range;

use glam::DVec3;
use num_complex::Complex32;

use super::track::Track;
use super::{Target, oversampling};
use crate::SPEED_OF_LIGHT_M_S;
use crate::focus::rdbp::patch::Rectangle;
use crate::geometry::ImageGrid;
use crate::phase_history::Collection;
use crate::signal::phase::{narrow, phasor, phasor32};
use crate::signal::range_profile::RangeProfiler;
use crate::signal::windowed_sinc::WindowedSinc;

/// A decimated history must be at most this much of the one before, or is not made.
const WORTHWHILE: f64 = 0.8;
/// Allowance for what lies between the places at which paths are looked at.
const MARGIN: f64 = 1.05;

/// One pulse, recorded or decimated.
#[derive(Clone, Copy)]
struct Antennas {
    transmitter_m: DVec3,
    receiver_m: DVec3,
    /// Path to which its phase is compensated.
    datum_m: f64,
}

impl Antennas {
    fn path_m(&self, point: DVec3) -> f64 {
        let out_m = point.distance(self.transmitter_m);
        if self.transmitter_m == self.receiver_m {
            2.0 * out_m
        } else {
            out_m + point.distance(self.receiver_m)
        }
    }
}

/// Samples of some pulses and frequencies, pulse by pulse.
#[derive(Default)]
pub(super) struct PatchHistory {
    start_hz: f64,
    step_hz: f64,
    num_samples: usize,
    /// Place of the first pulse on the track, and from pulse to pulse.
    first_u: f64,
    step_u: f64,
    antennas: Vec<Antennas>,
    samples: Vec<Complex32>,
}

impl PatchHistory {
    /// Bytes a pulse beside its samples.
    pub(super) const PULSE_BYTES: u64 = size_of::<Antennas>() as u64;

    /// Recorded pulses, samples still to be filled in.
    pub(super) fn of_pulses(collection: &Collection, pulses: Range<usize>) -> Self {
        let track = &collection.pulses[pulses];
        Self {
            start_hz: track[0].start_hz,
            step_hz: track[0].step_hz,
            num_samples: collection.num_samples,
            first_u: 0.0,
            step_u: 1.0,
            antennas: track
                .iter()
                .map(|p| Antennas {
                    transmitter_m: p.transmitter_m,
                    receiver_m: p.receiver_m,
                    datum_m: p.reference_path_m,
                })
                .collect(),
            samples: vec![Complex32::ZERO; track.len() * collection.num_samples],
        }
    }

    pub(super) fn samples_mut(&mut self) -> &mut [Complex32] {
        &mut self.samples
    }

    pub(super) fn num_pulses(&self) -> usize {
        self.antennas.len()
    }

    fn frequency_hz(&self, k: f64) -> f64 {
        self.start_hz + k * self.step_hz
    }
}

/// One thread's buffers: a history a level, and a leaf's.
#[derive(Default)]
pub(super) struct Scratch {
    pub(super) levels: Vec<PatchHistory>,
    pub(super) leaf: Leaf,
}

/// What imaging a small patch needs.
#[derive(Default)]
pub(super) struct Leaf {
    profilers: BTreeMap<usize, RangeProfiler>,
    profile: Vec<Complex32>,
    fft: Vec<Complex32>,
    points: Vec<DVec3>,
    sums: Vec<Complex32>,
}

/// Makes smaller histories, and images of them.
pub(super) struct Refiner<'a, const W: usize> {
    grid: &'a ImageGrid,
    kernel: WindowedSinc,
    oversampling: f64,
}

impl<'a, const W: usize> Refiner<'a, W> {
    pub(super) fn new(grid: &'a ImageGrid, share: f64) -> Self {
        Self {
            grid,
            kernel: WindowedSinc::new(W, 0.25),
            oversampling: oversampling(share),
        }
    }

    /// Makes `own`, the history of `rectangle`, from that of a patch around it. False if it would not be
    /// smaller; `own` is then left as it was.
    pub(super) fn refine(
        &self,
        parent: &PatchHistory,
        track: &Track,
        rectangle: Rectangle,
        own: &mut PatchHistory,
    ) -> bool {
        let centre = rectangle.centre_m(self.grid);
        let [by_pulse, by_sample] = self.decimation(parent, rectangle, centre);
        if by_pulse == 1 && by_sample == 1 {
            return false;
        }
        // Elements before the first: as far as the kernel reaches.
        let lead = W / 2 - 1;
        let decimated = |count: usize, by: usize| match by {
            1 => count,
            _ => (count - 1) / by + W,
        };
        let before = |by: usize| if by == 1 { 0.0 } else { (lead * by) as f64 };
        own.num_samples = decimated(parent.num_samples, by_sample);
        own.start_hz = parent.frequency_hz(-before(by_sample));
        own.step_hz = parent.step_hz * by_sample as f64;
        own.first_u = parent.first_u - before(by_pulse) * parent.step_u;
        own.step_u = parent.step_u * by_pulse as f64;
        own.antennas.clear();
        if by_pulse == 1 {
            own.antennas.extend_from_slice(&parent.antennas);
        } else {
            let count = decimated(parent.num_pulses(), by_pulse);
            own.antennas.extend((0..count).map(|i| {
                let [transmitter_m, receiver_m] = track.at(own.first_u + i as f64 * own.step_u);
                Antennas {
                    transmitter_m,
                    receiver_m,
                    datum_m: 0.0,
                }
            }));
        }
        for antennas in &mut own.antennas {
            antennas.datum_m = antennas.path_m(centre);
        }
        own.samples.clear();
        own.samples
            .resize(own.antennas.len() * own.num_samples, Complex32::ZERO);

        let fast_weights: Vec<[f32; W]> = self.phases(by_sample);
        let slow_weights: Vec<[f32; W]> = self.phases(by_pulse);
        let mut row = vec![Complex32::ZERO; own.num_samples];
        let rows = parent.samples.chunks_exact(parent.num_samples);
        for (n, (antennas, samples)) in parent.antennas.iter().zip(rows).enumerate() {
            let delay_s = (antennas.path_m(centre) - antennas.datum_m) / SPEED_OF_LIGHT_M_S;
            let mut turn = phasor(parent.start_hz * delay_s);
            let step = phasor(parent.step_hz * delay_s);
            row.fill(Complex32::ZERO);
            for (k, z) in samples.iter().enumerate() {
                let value = z * narrow(turn);
                turn *= step;
                if by_sample == 1 {
                    row[k] = value;
                } else {
                    let weights = &fast_weights[k % by_sample];
                    let cells = &mut row[k / by_sample..k / by_sample + W];
                    for (cell, weight) in cells.iter_mut().zip(weights) {
                        *cell += value * weight;
                    }
                }
            }
            let width = own.num_samples;
            if by_pulse == 1 {
                own.samples[n * width..(n + 1) * width].copy_from_slice(&row);
            } else {
                let first = n / by_pulse;
                for (i, &weight) in slow_weights[n % by_pulse].iter().enumerate() {
                    let cells = &mut own.samples[(first + i) * width..(first + i + 1) * width];
                    for (cell, value) in cells.iter_mut().zip(&row) {
                        *cell += value * weight;
                    }
                }
            }
        }
        true
    }

    /// Weights of every fraction that a decimation meets.
    fn phases(&self, by: usize) -> Vec<[f32; W]> {
        (0..by)
            .map(|i| self.kernel.weights::<W>(i as f32 / by as f32))
            .collect()
    }

    /// How many pulses and how many frequencies can be made one: what keeps the phase of the patch's
    /// pixels within a quarter of a cycle from one to the next.
    fn decimation(&self, parent: &PatchHistory, rectangle: Rectangle, centre: DVec3) -> [usize; 2] {
        let last = parent.num_pulses() - 1;
        let highest_hz = parent
            .frequency_hz((parent.num_samples - 1) as f64)
            .max(parent.start_hz);
        let (mut depth_m, mut rate_m) = (0.0f64, 0.0f64);
        for (row, column) in [
            (0.0, 0.0),
            (0.0, 0.5),
            (0.0, 1.0),
            (0.5, 0.0),
            (0.5, 1.0),
            (1.0, 0.0),
            (1.0, 0.5),
            (1.0, 1.0),
        ] {
            let point = rectangle.point_m(self.grid, row, column);
            let offset_m = |n: usize| {
                let antennas = &parent.antennas[n];
                antennas.path_m(point) - antennas.path_m(centre)
            };
            for quarter in 0..=4 {
                let n = quarter * last / 4;
                let here_m = offset_m(n);
                depth_m = depth_m.max(here_m.abs());
                if last > 0 {
                    let next_m = offset_m(if n < last { n + 1 } else { n - 1 });
                    rate_m = rate_m.max((next_m - here_m).abs());
                }
            }
        }
        let allowed = |cycles: f64, count: usize| {
            let by = (0.25 / (cycles * MARGIN)).min(count as f64) as usize;
            let after = count as f64 / by.max(1) as f64 + W as f64;
            if by >= 2 && after <= WORTHWHILE * count as f64 {
                by
            } else {
                1
            }
        };
        [
            allowed(
                rate_m * highest_hz / SPEED_OF_LIGHT_M_S,
                parent.num_pulses(),
            ),
            allowed(
                depth_m * parent.step_hz / SPEED_OF_LIGHT_M_S,
                parent.num_samples,
            ),
        ]
    }

    /// Adds the image of `rectangle` by backprojection.
    pub(super) fn image(
        &self,
        history: &PatchHistory,
        rectangle: Rectangle,
        target: &mut Target,
        leaf: &mut Leaf,
    ) {
        let Leaf {
            profilers,
            profile,
            fft,
            points,
            sums,
        } = leaf;
        let profiler = profilers
            .entry(history.num_samples)
            .or_insert_with_key(|&count| RangeProfiler::new(&vec![1.0; count], self.oversampling));
        let length = profiler.length();
        profile.resize(length + 1, Complex32::ZERO);
        fft.resize(profiler.scratch_length(), Complex32::ZERO);
        let size = rectangle.size;
        points.clear();
        points.extend((0..size.rows * size.columns).map(|i| {
            let (row, column) = (i / size.columns, i % size.columns);
            self.grid
                .position_m(rectangle.row + row, rectangle.column + column)
        }));
        sums.clear();
        sums.resize(points.len(), Complex32::ZERO);
        let centre_cycles_m =
            history.frequency_hz((history.num_samples / 2) as f64) / SPEED_OF_LIGHT_M_S;
        let bins_m = history.step_hz / SPEED_OF_LIGHT_M_S;
        let rows = history.samples.chunks_exact(history.num_samples);
        for (antennas, row) in history.antennas.iter().zip(rows) {
            profiler.profile(row, profile, fft);
            for (point, sum) in points.iter().zip(sums.iter_mut()) {
                let path_m = antennas.path_m(*point) - antennas.datum_m;
                let turns = path_m * bins_m;
                let bin = (turns - turns.floor()) * length as f64;
                // `turns - floor` may round to 1; the last whole bin then.
                let whole = (bin as usize).min(length - 1);
                let fraction = (bin - whole as f64) as f32;
                let value = profile[whole] + (profile[whole + 1] - profile[whole]) * fraction;
                *sum += phasor32(path_m * centre_cycles_m) * value;
            }
        }
        target.add(rectangle, sums);
    }
}

impl Target<'_, '_> {
    /// Adds `values`, row by row, to the pixels of `rectangle`.
    fn add(&mut self, rectangle: Rectangle, values: &[Complex32]) {
        let first = rectangle.column - self.origin.column;
        let rows = &mut self.patch[rectangle.row - self.origin.row..];
        for (pixels, values) in rows
            .iter_mut()
            .zip(values.chunks_exact(rectangle.size.columns))
        {
            let pixels = &mut pixels[first..first + rectangle.size.columns];
            for (pixel, value) in pixels.iter_mut().zip(values) {
                *pixel += value;
            }
        }
    }
}
