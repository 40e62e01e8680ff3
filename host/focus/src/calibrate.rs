//! Calibration of the timing model for this machine in about one second: single-threaded kernels on cached data.
//!
//! Each kernel is run repeatedly for [`TURN`], and its shortest time is used: other load only increases times. Where several
//! values of the model belong to one kernel, all are scaled by the ratio of the measured time to that of the default model; times of
//! planning and paths are scaled with that of a phasor.

use std::hint::black_box;
use std::time::{Duration, Instant};

use num_complex::{Complex32, Complex64};
use subaperture_fft::Transforms;

use crate::time_model::{TIMES_NS, TimeModel};
use subaperture_kernels::compensation::{GroupRamp, Ramp, refer_to_planes};
use subaperture_kernels::decimation::{
    Decimation, DecimationScratch, Layout, PhaseRamp, Rows, Taps, decimated,
};
use subaperture_kernels::doppler::{BLOCK, DopplerProduct, MapRows};
use subaperture_kernels::horner;
use subaperture_kernels::lanes::{GROUP, Instructions};
use subaperture_kernels::paths::{Antennas, Points};
use subaperture_kernels::reading::weighted;
use subaperture_kernels::tile::{Pieces, Raster, TilePulse, TileScratch, add_points};
use subaperture_signal::phase::phasor;
use subaperture_signal::range_profile::RangeProfiler;
use subaperture_signal::scaled_dft::{ScaledDft, Shape};

/// Measurement duration of a kernel.
const TURN: Duration = Duration::from_millis(60);

/// Taps of a decimation filter, and of a raster interpolation kernel.
const DECIMATION_TAPS: usize = 8;
const RASTER_TAPS: usize = 6;

/// Degree, bins and pulses of the backprojection test, and pixels per tile side.
const DEGREE: usize = 3;
const BINS: usize = 2048;
const PULSES: usize = 32;
const SIDE: usize = 32;

impl TimeModel {
    /// Measure the times of this machine under a given name; takes about one second on one thread.
    pub fn measured(name: String) -> Self {
        let default = Self::DEFAULT;
        let phasor_ns = phasor_ns();
        let slower = phasor_ns / default.phasor_ns;
        let (tiles, point_ns, piece_ns) = backprojection();
        let [turn_ns, pulse_tap_ns, sample_tap_ns] = decimation();
        let tap_ns = raster_tap_ns();
        let reading = tap_ns / default.raster_tap_ns;
        let sum_ns = sum_ns();
        let model = Self {
            name: name.into(),
            transform_ns: transform_ns(),
            map_transform_ns: map_transform_ns(),
            piece_ns: piece_ns / (DEGREE + 1) as f64,
            leaf_piece_ns: piece_ns,
            tile_pulse_ns: tiles * default.tile_pulse_ns,
            tile_group_ns: tiles * default.tile_group_ns,
            narrow_plane_ns: tiles * default.narrow_plane_ns,
            wide_plane_ns: tiles * default.wide_plane_ns,
            scattered_plane_ns: tiles * default.scattered_plane_ns,
            leaf_pulse_ns: tiles * default.leaf_pulse_ns,
            leaf_group_ns: tiles * default.leaf_group_ns,
            point_ns,
            blurred_point_ns: slower * default.blurred_point_ns,
            turn_ns,
            pulse_tap_ns,
            sample_tap_ns,
            history_pulse_ns: slower * default.history_pulse_ns,
            patch_ns: slower * default.patch_ns,
            compensation_ns: compensation_ns(),
            doppler_tap_ns: doppler_tap_ns(),
            map_pixel_ns: reading * default.map_pixel_ns,
            map_tap_ns: reading * default.map_tap_ns,
            map_fit_ns: slower * default.map_fit_ns,
            map_sample_ns: reading * default.map_sample_ns,
            map_sample_tap_ns: reading * default.map_sample_tap_ns,
            column_transform_ns: reading * default.column_transform_ns,
            map_line_bin_ns: reading * default.map_line_bin_ns,
            map_station_ns: reading * default.map_station_ns,
            sum_ns,
            swept_sum_ns: slower * default.swept_sum_ns,
            raster_tap_ns: tap_ns,
            phasor_ns,
        };
        debug_assert_eq!(model.check(), Ok(()));
        model
    }
}

/// Shortest time per item of `work` on `count` items, ns; always valid and positive.
fn shortest_ns(count: usize, mut work: impl FnMut()) -> f64 {
    let begun = Instant::now();
    let mut shortest = Duration::MAX;
    while begun.elapsed() < TURN {
        let start = Instant::now();
        work();
        shortest = shortest.min(start.elapsed());
    }
    let each_ns = 1e9 * shortest.as_secs_f64() / count as f64;
    each_ns.clamp(1e3 * TIMES_NS.start(), 1e-3 * TIMES_NS.end())
}

fn noise(count: usize) -> Vec<Complex32> {
    let value = |i: usize| phasor((i * i % 1009) as f64 * 0.618_034);
    (0..count)
        .map(|i| Complex32::new(value(i).re as f32, value(i).im as f32))
        .collect()
}

/// Time of a phasor, ns; the phasors are summed so that the compiler keeps them.
fn phasor_ns() -> f64 {
    const COUNT: usize = 4096;
    shortest_ns(COUNT, || {
        let turns = |i: usize| i as f64 * 0.372_1;
        let sum: Complex64 = (0..COUNT).map(|i| phasor(turns(black_box(i)))).sum();
        black_box(sum);
    })
}

/// Time of a transform, measured on a range profile, ns.
fn transform_ns() -> f64 {
    let window = vec![1.0; 256];
    let profiler = RangeProfiler::new(DEGREE, &window, 4.0, Transforms::Fastest);
    let length = profiler.length();
    let pulse = noise(window.len());
    let mut profile = vec![Complex32::ZERO; length + 1];
    let mut scratch = vec![Complex32::ZERO; profiler.scratch_length()];
    let steps = length as f64 * libm::log2(length as f64);
    shortest_ns(1, || profiler.profile(&pulse, &mut profile, &mut scratch)) / steps
}

/// Time of a chirp-z transform, measured on two slow-time transforms of a patch including copies, ns.
fn map_transform_ns() -> f64 {
    let (inputs, outputs) = (64, 40);
    let shape = Shape {
        inputs,
        input_centre: 31.5,
        input_drift: 0.0,
        outputs,
        output_centre: 20.0,
        spacing: 1.0 / 128.0,
    };
    let dft = ScaledDft::new(Transforms::Fastest, &[1.0], shape, |_, _| 1.0);
    let samples = noise(inputs);
    let mut scratch = vec![Complex32::ZERO; dft.scratch_length()];
    let mut row = vec![Complex32::ZERO; outputs];
    let length = (inputs + outputs) as f64;
    let steps = 2.0 * length * libm::log2(length);
    let once_ns = shortest_ns(16, || {
        for _ in 0..16 {
            dft.transform(0, &samples, &mut scratch, |d, value| row[d] = value);
        }
        black_box(&row);
    });
    once_ns / steps
}

/// Ratio of the tile time to that of the default model; times of a point and of a profile interval, ns.
fn backprojection() -> (f64, f64, f64) {
    let instructions = Instructions::best();
    let raster = Raster {
        centre_m: [0.0; 3],
        along_m: [0.2, 0.0, 0.0],
        across_m: [0.0, 0.2, 0.0],
        rows: SIDE,
        columns: SIDE,
    };
    let bin_m = 0.125;
    let pulse = |n: usize| {
        let at_m = [n as f64 * 0.1, 1732.0, 1000.0];
        TilePulse {
            antennas: Antennas {
                transmitter_m: at_m,
                receiver_m: at_m,
                datum_m: 4000.0,
            },
            turns_m: 1.0 / (bin_m * BINS as f64),
            cycles_a_bin: 33.3 * bin_m,
        }
    };
    let pulses: Vec<TilePulse> = (0..PULSES).map(pulse).collect();
    let layout = Pieces::new(DEGREE, BINS, Pieces::margin_for(&raster, 1.0 / bin_m));
    let profile = noise(BINS);
    let mut pieces = vec![0.0; PULSES * layout.values()];
    let own = &mut pieces[..layout.values()];
    let piece_ns = shortest_ns(layout.row(), || {
        layout.make(instructions, &profile, 1.0, own);
    });
    let mut tile = TileScratch::default();
    let mut sums = vec![Complex32::ZERO; SIDE * SIDE];
    let took_ns = shortest_ns(PULSES, || {
        tile.look(BINS, &pulses, &raster);
        tile.add(instructions, &layout, &pulses, &pieces, &mut sums);
    });
    let default = TimeModel::DEFAULT;
    let group_ns = default.tile_group_ns + default.narrow_plane_ns * (DEGREE + 1) as f64;
    let predicted_ns = default.tile_pulse_ns + group_ns * (SIDE * SIDE / GROUP) as f64;
    let mut points = Points::default();
    for i in 0..SIDE * SIDE {
        points.push([0.2 * (i % SIDE) as f64, 0.2 * (i / SIDE) as f64, 0.0]);
    }
    let own = &pieces[..layout.values()];
    let point_ns = shortest_ns(points.len(), || {
        add_points(instructions, &layout, &pulses[0], own, &points, &mut sums);
    });
    black_box(&sums);
    (took_ns / predicted_ns, point_ns, piece_ns)
}

/// Times of a phase rotation, of a tap over pulses and of a tap over samples, ns.
fn decimation() -> [f64; 3] {
    let (num_pulses, num_samples) = (64, 256);
    let layout = Layout::new(num_samples, 2);
    let values = vec![0.5; num_pulses * layout.values()];
    let phase_ramps = vec![
        PhaseRamp {
            start: 0.3,
            step: 0.01,
        };
        num_pulses
    ];
    let took_ns = |pulses: bool, samples: bool| {
        let decimation = Decimation {
            pulses: if pulses { 2 } else { 1 },
            samples,
            layout,
            rows: Rows::Planes(&values),
            first: 0,
            phase_ramps: &phase_ramps,
        };
        let count = match pulses {
            true => decimated(num_pulses, 2, DECIMATION_TAPS),
            false => num_pulses,
        };
        let mut out = vec![0.0; count * decimation.after(DECIMATION_TAPS).values()];
        let mut scratch = DecimationScratch::default();
        let took_ns = shortest_ns(1, || {
            let taps = Taps {
                half: [0.1f32; DECIMATION_TAPS],
                third: [0.0; DECIMATION_TAPS],
            };
            decimation.make(Instructions::best(), &taps, 0, &mut out, &mut scratch);
        });
        (took_ns, out.len() as f64 / 2.0)
    };
    let samples = (num_pulses * num_samples) as f64;
    let (turn_ns, _) = took_ns(false, false);
    let taps = (DECIMATION_TAPS + 1) as f64;
    // Phase rotation is part of both; a small remainder is limited from below.
    let tap_ns = |(decimated_ns, after): (f64, f64)| {
        (decimated_ns - turn_ns).max(0.1 * decimated_ns) / (taps * after)
    };
    [
        turn_ns / samples,
        tap_ns(took_ns(true, false)),
        tap_ns(took_ns(false, true)),
    ]
}

fn compensation_ns() -> f64 {
    let (num_samples, num_pulses) = (BLOCK, 64);
    let samples = noise(num_samples * num_pulses);
    let weights = vec![0.9f32; num_samples];
    let ramp = |n: usize| GroupRamp::new(Ramp::new(0.1 * n as f64, 0.013, 1.0));
    let mut ramps: Vec<GroupRamp> = (0..num_pulses).map(ramp).collect();
    let mut planes = vec![0.0; 2 * BLOCK * num_pulses];
    let instructions = Instructions::best();
    shortest_ns(samples.len(), || {
        refer_to_planes(
            instructions,
            &samples,
            num_samples,
            &weights,
            &mut ramps,
            &mut planes,
            BLOCK,
        );
        black_box(&planes);
    })
}

/// Time of a Doppler tap, measured on a patch's slow time with a block of frequencies, ns.
fn doppler_tap_ns() -> f64 {
    let (inputs, reach) = (64, 12);
    let shape = Shape {
        inputs,
        input_centre: 31.5,
        input_drift: 0.0,
        outputs: 2 * reach + 1,
        output_centre: reach as f64,
        spacing: 1.0 / 128.0,
    };
    let product = DopplerProduct::new(&[1.0; BLOCK], &shape, |_, _| 1.0);
    let planes = vec![0.5; 2 * BLOCK * inputs];
    let mut scratch = vec![0.0; product.scratch_length()];
    let mut values = vec![0.0; 2 * shape.outputs * BLOCK];
    shortest_ns(BLOCK * inputs * shape.outputs, || {
        let mut map = MapRows {
            values: &mut values,
            row_length: BLOCK,
            length: BLOCK,
            first: 0,
        };
        product.transform(Instructions::best(), 0, &planes, &mut scratch, &mut map);
        black_box(&values);
    })
}

fn raster_tap_ns() -> f64 {
    let side = 128;
    let values = noise(side * side);
    let weights = [0.2f32; RASTER_TAPS];
    let count = 1024;
    let taps = count * RASTER_TAPS * RASTER_TAPS;
    shortest_ns(taps, || {
        let place = |i: usize| [i * 37 % (side - RASTER_TAPS), i * 91 % (side - RASTER_TAPS)];
        let sum: Complex32 = (0..count)
            .map(|i| weighted(&values, side, place(i), [&weights, &weights]))
            .sum();
        black_box(sum);
    })
}

fn sum_ns() -> f64 {
    let row = noise(1024);
    let weights = vec![1.0; row.len()];
    let steps = [Complex64::new(0.6, 0.8); horner::TOGETHER];
    shortest_ns(row.len() * horner::TOGETHER, || {
        black_box(horner::sums(Instructions::best(), &row, &weights, &steps));
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two measurements of a possibly loaded machine agree within a factor of 100 with each other and with the default.
    #[test]
    fn measured_model_is_plausible() {
        let begun = Instant::now();
        let model = TimeModel::measured("here".to_owned());
        assert!(begun.elapsed() < Duration::from_secs(20));
        model.check().unwrap();
        let numbers = |model: &TimeModel| -> Vec<(String, f64)> {
            let json = serde_json::to_value(model).unwrap();
            let entries = json.as_object().unwrap().iter();
            let numbers = entries.filter_map(|(key, value)| Some((key.clone(), value.as_f64()?)));
            numbers.collect()
        };
        for ((key, got), (_, default)) in numbers(&model).iter().zip(numbers(&TimeModel::DEFAULT)) {
            println!("{key}: {got:.3} here, {default} by default");
            assert!(got / default < 100.0 && default / got < 100.0, "{key}");
        }
    }
}
