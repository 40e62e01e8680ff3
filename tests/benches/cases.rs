//! Formers on the cases that backprojection is compared by: time, rate and error.
//!
//! `cargo bench --bench cases -- CASE FORMER[,DB]...`, for instance `a bp,-45 bp,-75 ffbp`. The radar at 10 GHz with 600 MHz, 2 km away on a
//! bent track of 120 m, Hamming windows, pixels of 0.2 m:
//!
//! | case | pulses x samples | pixels |
//! |---|---|---|
//! | a | 1040 x 1024 | 512 x 512 |
//! | b | 4096 x 4096 | 1024 x 1024 |
//! | c | 4096 x 4096 | 4096 x 4096 |
//!
//! Rates are billions of pixel-pulses a second, equivalent to backprojection for others. Errors are against the sum over pulses and
//! frequencies in float64 at some of the pixels, written out here.

use std::f64::consts::TAU;
use std::time::Instant;

use rayon::prelude::*;
use subaperture::focus::Task;
use subaperture::focus::formers::FORMERS;
use subaperture::geometry::{ImageGrid, SceneFrame};
use subaperture::glam::DVec3;
use subaperture::monitor::Silent;
use subaperture::num_complex::{Complex32, Complex64};
use subaperture::phase_history::{Collection, InMemory, PhaseHistory, Pulse, Sweep, Weights};
use subaperture::signal::window::Window;

const LIGHT_M_S: f64 = 299_792_458.0;
const PIXEL_M: f64 = 0.2;

/// A case's pulses, samples, pixels a side, scatterers, and pixels to compare.
fn case(name: &str) -> Option<[usize; 5]> {
    match name {
        "a" => Some([1040, 1024, 512, 3000, 512]),
        "b" => Some([4096, 4096, 1024, 200, 64]),
        "c" => Some([4096, 4096, 4096, 200, 64]),
        _ => None,
    }
}

fn turned(cycles: f64) -> Complex64 {
    Complex64::cis(TAU * (cycles - cycles.round()))
}

/// Numbers that look random, evenly in -1/2 to 1/2: the same in every run.
fn numbers() -> impl FnMut() -> f64 {
    let mut state = 1u64;
    move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    }
}

/// What the radar records of scatterers on a square.
fn history(num_pulses: usize, num_samples: usize, side_m: f64, scatterers: usize) -> InMemory {
    let step_hz = 600e6 / num_samples as f64;
    let start_hz = 10e9 - (num_samples / 2) as f64 * step_hz;
    let pulse = |n: usize| {
        let u = n as f64 / (num_pulses - 1) as f64 - 0.5;
        let bent = DVec3::new(
            0.3 * (9.0 * u).sin(),
            0.02 * (40.0 * u).sin(),
            0.2 * (23.0 * u).cos(),
        );
        let at = DVec3::new(120.0 * u, -1732.0, 1000.0) + bent;
        Pulse {
            time_s: 1e-3 * n as f64,
            transmitter_m: at,
            receiver_m: at,
            reference_m: DVec3::ZERO,
            reference_path_m: 2.0 * at.length(),
            start_hz,
            step_hz,
            sweep: Sweep::AT_ONCE,
        }
    };
    let pulses: Vec<Pulse> = (0..num_pulses).map(pulse).collect();
    let mut number = numbers();
    let scene: Vec<(DVec3, Complex64)> = (0..scatterers)
        .map(|_| {
            let at = DVec3::new(number(), number(), 0.0) * side_m;
            (at, turned(number()))
        })
        .collect();
    let mut samples = vec![Complex32::ZERO; num_pulses * num_samples];
    let rows = samples.par_chunks_exact_mut(num_samples).zip(&pulses);
    rows.for_each(|(row, pulse)| {
        let mut sums = vec![Complex64::ZERO; num_samples];
        for &(at, amplitude) in &scene {
            let path_m = 2.0 * at.distance(pulse.transmitter_m) - pulse.reference_path_m;
            let delay_s = path_m / LIGHT_M_S;
            let mut value = amplitude * turned(-start_hz * delay_s);
            let step = turned(-step_hz * delay_s);
            for sum in &mut sums {
                *sum += value;
                value *= step;
            }
        }
        for (sample, sum) in row.iter_mut().zip(sums) {
            *sample = Complex32::new(sum.re as f32, sum.im as f32);
        }
    });
    let collection = Collection {
        name: "case".to_owned(),
        num_samples,
        pulses,
        frame: SceneFrame::Local,
        extent: None,
        timed: true,
    };
    InMemory::new(collection, samples).expect("samples are finite")
}

/// The image at a point: the sum over all pulses and frequencies.
fn sum(history: &InMemory, weights: &Weights, point: DVec3) -> Complex64 {
    let collection = history.collection();
    let mut row = vec![Complex32::ZERO; collection.num_samples];
    let mut sum = Complex64::ZERO;
    for (n, pulse) in collection.pulses.iter().enumerate() {
        history.read(n..n + 1, &mut row).expect("samples in memory");
        let path_m = 2.0 * point.distance(pulse.transmitter_m) - pulse.reference_path_m;
        let delay_s = path_m / LIGHT_M_S;
        let mut phasor = turned(pulse.start_hz * delay_s) * weights.slow[n];
        let step = turned(pulse.step_hz * delay_s);
        for (sample, weight) in row.iter().zip(&weights.fast) {
            sum += phasor * Complex64::new(sample.re.into(), sample.im.into()) * weight;
            phasor *= step;
        }
    }
    sum * weights.normalisation()
}

/// Seconds of processor time that this process took so far; 0 where the system does not say.
fn processor_seconds() -> f64 {
    let Ok(stat) = std::fs::read_to_string("/proc/self/stat") else {
        return 0.0;
    };
    // User and system time, in hundredths of a second, are the 12th and 13th after the name.
    let after = stat.rsplit(')').next().unwrap_or_default();
    let numbers = after.split_whitespace().skip(11).take(2);
    numbers.filter_map(|n| n.parse::<f64>().ok()).sum::<f64>() / 100.0
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let args: Vec<&str> = args
        .iter()
        .map(String::as_str)
        .filter(|a| *a != "--bench")
        .collect();
    let (name, formers) = match args.split_first() {
        None => (
            "a",
            ["bp,-45", "bp,-60", "bp,-75", "ffbp", "rdbp"].as_slice(),
        ),
        Some((name, formers)) => (*name, formers),
    };
    let [pulses, samples, side, scatterers, compared] = case(name).expect("case a, b or c");
    let side_m = side as f64 * PIXEL_M;
    let history = history(pulses, samples, side_m, scatterers);
    let half_m = side_m / 2.0;
    let axis = format!("{}:{half_m}:{PIXEL_M}", -half_m);
    let grid: ImageGrid = format!("x={axis},y={axis}").parse().expect("a grid");
    let weights = Weights::new(history.collection(), Window::Hamming, Window::Hamming);
    let task = Task {
        history: &history,
        grid: &grid,
        weights: &weights,
        memory_bytes: 8 << 30,
        monitor: &Silent,
    };
    let place = |i: usize| (i * 7919 % side, i * 104_729 % side);
    let places: Vec<(usize, usize)> = (0..compared).map(place).collect();
    let expected = places.par_iter().map(|&(row, column)| {
        let point = grid.position_m(row, column);
        sum(&history, &weights, point)
    });
    let expected: Vec<Complex64> = expected.collect();
    println!(
        "case {name}, {} threads\nformer     asked   error dB   seconds  processor   GBP/s   settings",
        rayon::current_num_threads()
    );
    for former in formers {
        let (former, asked) = former.split_once(',').unwrap_or((former, "-60"));
        let entry = FORMERS.iter().find(|entry| entry.name == former);
        let asked_db: f64 = asked.parse().expect("dB");
        let made = entry.expect("a former's name").within(asked_db);
        let (start, before) = (Instant::now(), processor_seconds());
        let formed = made.form_best(&task).expect("8 GiB are enough");
        let seconds = start.elapsed().as_secs_f64();
        let processor = processor_seconds() - before;
        let (mut error, mut power) = (0.0, 0.0);
        for (&(row, column), expected) in places.iter().zip(&expected) {
            let got = formed.image.pixels[row * side + column];
            let got = Complex64::new(got.re.into(), got.im.into());
            error += (got - expected).norm_sqr();
            power += expected.norm_sqr();
        }
        let rate = (side * side * pulses) as f64 / seconds * 1e-9;
        let settings = serde_json::to_string(&formed.settings).expect("settings are JSON");
        println!(
            "{former:<9} {asked_db:>6} {:>10.1} {seconds:>9.3} {processor:>10.2} {rate:>7.2}   {settings}",
            10.0 * (error / power).log10(),
        );
    }
}
