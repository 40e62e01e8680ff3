//! Backprojection on the cases of the field's comparisons: `cargo bench --bench cases -- a|b [former[,dB]]...`

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

const C: f64 = 299_792_458.0;

fn history(num_pulses: usize, num_samples: usize, side_m: f64, scatterers: usize) -> InMemory {
    let (centre_hz, band_hz) = (10e9, 600e6);
    let step_hz = band_hz / num_samples as f64;
    let start_hz = centre_hz - (num_samples / 2) as f64 * step_hz;
    let mut state = 1u64;
    let mut unit = move || {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    let pulses: Vec<Pulse> = (0..num_pulses)
        .map(|n| {
            let u = n as f64 / (num_pulses - 1) as f64 - 0.5;
            let wobble = DVec3::new(
                0.3 * (9.0 * u).sin(),
                0.02 * (40.0 * u).sin(),
                0.2 * (23.0 * u).cos(),
            );
            let at = DVec3::new(120.0 * u, -1732.0, 1000.0) + wobble;
            Pulse {
                time_s: 0.001 * n as f64,
                transmitter_m: at,
                receiver_m: at,
                reference_m: DVec3::ZERO,
                reference_path_m: 2.0 * at.length(),
                start_hz,
                step_hz,
                sweep: Sweep::AT_ONCE,
            }
        })
        .collect();
    let scene: Vec<(DVec3, Complex64)> = (0..scatterers)
        .map(|_| {
            let at = DVec3::new(unit() - 0.5, unit() - 0.5, 0.0) * side_m;
            (at, Complex64::from_polar(1.0, 6.28 * unit()))
        })
        .collect();
    let mut samples = vec![Complex32::ZERO; num_pulses * num_samples];
    samples
        .par_chunks_exact_mut(num_samples)
        .zip(&pulses)
        .for_each(|(row, pulse)| {
            let mut sums = vec![Complex64::ZERO; num_samples];
            for &(at, amplitude) in &scene {
                let delay_s = (2.0 * at.distance(pulse.transmitter_m) - pulse.reference_path_m) / C;
                let turn =
                    |hz: f64| Complex64::cis(-std::f64::consts::TAU * (hz * delay_s).fract());
                let (mut z, step) = (amplitude * turn(start_hz), turn(step_hz));
                for sum in &mut sums {
                    *sum += z;
                    z *= step;
                }
            }
            for (out, sum) in row.iter_mut().zip(sums) {
                *out = Complex32::new(sum.re as f32, sum.im as f32);
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
    InMemory::new(collection, samples).unwrap()
}

/// The image at a point: the sum over all pulses and frequencies, by itself.
fn sum(history: &InMemory, weights: &Weights, point: DVec3) -> Complex64 {
    let collection = history.collection();
    let mut row = vec![Complex32::ZERO; collection.num_samples];
    let mut sum = Complex64::ZERO;
    for (n, pulse) in collection.pulses.iter().enumerate() {
        history.read(n..n + 1, &mut row).expect("samples in memory");
        let delay_s = (2.0 * point.distance(pulse.transmitter_m) - pulse.reference_path_m) / C;
        let turn = |hz: f64| Complex64::cis(std::f64::consts::TAU * (hz * delay_s).fract());
        let (mut z, step) = (turn(pulse.start_hz) * weights.slow[n], turn(pulse.step_hz));
        for (sample, weight) in row.iter().zip(&weights.fast) {
            sum += z * Complex64::new(sample.re.into(), sample.im.into()) * weight;
            z *= step;
        }
    }
    sum * weights.normalisation()
}

fn main() {
    let args: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| a != "--bench")
        .collect();
    let scatterers: usize = std::env::var("SCATTERERS").map_or(60, |s| s.parse().unwrap());
    let (pulses, samples, side) = match args[0].as_str() {
        "a" => (1040, 1024, 512),
        "b" => (4096, 4096, 1024),
        "c" => (4096, 4096, 4096),
        _ => panic!("a, b or c"),
    };
    let spacing = 0.2;
    let half = side as f64 * spacing / 2.0;
    let history = history(pulses, samples, 2.0 * half, scatterers);
    let grid: ImageGrid = format!(
        "x={}:{}:{spacing},y={}:{}:{spacing}",
        -half, half, -half, half
    )
    .parse()
    .unwrap();
    let collection = history.collection().clone();
    let weights = Weights::new(&collection, Window::Hamming, Window::Hamming);
    let task = Task {
        history: &history,
        grid: &grid,
        weights: &weights,
        memory_bytes: 8 << 30,
        monitor: &Silent,
    };
    let places: Vec<(usize, usize)> = (0..512)
        .map(|i| (i * 7919 % side, i * 104729 % side))
        .collect();
    let points: Vec<DVec3> = places.iter().map(|&(r, c)| grid.position_m(r, c)).collect();
    let start = Instant::now();
    let exact: Vec<Complex64> = points
        .par_iter()
        .map(|&point| sum(&history, &weights, point))
        .collect();
    println!(
        "the sum at some points: {:.2} s, {} pixels a side, {} threads",
        start.elapsed().as_secs_f64(),
        side,
        rayon::current_num_threads()
    );
    for spec in &args[1..] {
        let (name, db) = spec.split_once(',').unwrap_or((spec, "-60"));
        let former = FORMERS
            .iter()
            .find(|f| f.name == name)
            .unwrap()
            .within(db.parse().unwrap());
        let start = Instant::now();
        let formed = former.form_best(&task).unwrap();
        let seconds = start.elapsed().as_secs_f64();
        let (mut error, mut power) = (0.0, 0.0);
        for (&(r, c), e) in places.iter().zip(&exact) {
            let z = formed.image.pixels[r * side + c];
            error += (Complex64::new(z.re.into(), z.im.into()) - e).norm_sqr();
            power += e.norm_sqr();
        }
        let work = (side * side * pulses) as f64;
        println!(
            "{name} {db}: {seconds:.3} s, {:.2} GBP/s, {:.1} dB, {}",
            work / seconds * 1e-9,
            10.0 * (error / power).log10(),
            serde_json::to_string(&formed.settings).unwrap()
        );
    }
}
