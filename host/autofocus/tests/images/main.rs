//! Autofocus on simulated echoes, independent of the code under test, and on real recordings where available.

mod far;
mod far_tracks;
mod gotcha;
mod near;
mod real;
mod scenes;
mod small;
mod table;
mod textbook;
mod tracks;

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use subaperture_autofocus::{
    Axis, Corrected, Correction, Measure, Method, Sharpened, Stopping, Subject, sharpen,
};
use subaperture_focus::bp::Backprojection;
use subaperture_focus::{ImageFormer, Task};
use subaperture_model::geometry::{ImageGrid, SceneFrame};
use subaperture_model::image::Image;
use subaperture_model::monitor::Silent;
use subaperture_model::phase_history::{Collection, InMemory, PhaseHistory, Pulse, Sweep, Weights};
use subaperture_signal::window::Window;

const C_M_S: f64 = 299_792_458.0;

/// Knuth's linear congruential generator.
struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Gaussian of unit variance, by Box and Muller.
    fn gauss(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }
}

/// Simulated radar on a track.
struct Radar {
    start_hz: f64,
    step_hz: f64,
    samples: usize,
    /// Recorded positions of the antennas, metres.
    recorded_m: Vec<DVec3>,
    /// True positions of the antennas, metres.
    true_m: Vec<DVec3>,
    /// Phase error of every pulse, radians.
    phases_rad: Vec<f64>,
    /// Rms noise of a sample.
    noise: f64,
}

impl Radar {
    /// Recording of points with these amplitudes, without range compensation.
    fn echoes(&self, points: &[(DVec3, f64)], random: &mut Random) -> InMemory {
        let mut samples = Vec::with_capacity(self.samples * self.true_m.len());
        for (at_m, &phase) in self.true_m.iter().zip(&self.phases_rad) {
            let mut pulse = vec![Complex64::ZERO; self.samples];
            for &(point_m, amplitude) in points {
                let delay_s = 2.0 * point_m.distance(*at_m) / C_M_S;
                let turn =
                    |hz: f64| Complex64::cis(-std::f64::consts::TAU * (hz * delay_s).fract());
                let (mut value, step) = (turn(self.start_hz), turn(self.step_hz));
                value *= amplitude;
                for sum in &mut pulse {
                    *sum += value;
                    value *= step;
                }
            }
            let error = Complex64::cis(phase);
            samples.extend(pulse.into_iter().map(|z| {
                let noise = Complex64::new(random.gauss(), random.gauss());
                let z = z * error + noise * (self.noise / 2f64.sqrt());
                Complex32::new(z.re as f32, z.im as f32)
            }));
        }
        let pulse = |(n, &at_m): (usize, &DVec3)| Pulse {
            time_s: n as f64 * 1e-3,
            transmitter_m: at_m,
            receiver_m: at_m,
            reference_m: DVec3::ZERO,
            reference_path_m: 0.0,
            start_hz: self.start_hz,
            step_hz: self.step_hz,
            sweep: Sweep::AT_ONCE,
            recorded_path_m: None,
        };
        let collection = Collection {
            name: "simulated".to_owned(),
            num_samples: self.samples,
            pulses: self.recorded_m.iter().enumerate().map(pulse).collect(),
            frame: SceneFrame::Local,
            extent: None,
            timed: true,
        };
        InMemory::new(collection, samples).unwrap()
    }
}

fn form(history: &dyn PhaseHistory, grid: &ImageGrid) -> Image {
    let task = Task {
        history,
        grid,
        weights: &Weights::new(history.collection(), Window::default(), Window::default()),
        memory_bytes: 1 << 30,
        monitor: &Silent,
        numerics: Default::default(),
    };
    Backprojection { error_db: -50.0 }
        .form_planned(&task)
        .unwrap()
        .image
}

/// Result of a method after at most `rounds` rounds; asserts that the image is not worse.
fn sharpened(
    history: &dyn PhaseHistory,
    grid: &ImageGrid,
    method: &dyn Method,
    rounds: usize,
) -> Sharpened {
    let former = Backprojection { error_db: -50.0 };
    let subject = Subject {
        history,
        grid,
        former: &former,
        windows: [Window::default(); 2],
        measure: Measure::Entropy,
        memory_bytes: 1 << 30,
        monitor: &Silent,
    };
    let stopping = Stopping {
        rounds,
        ..Stopping::default()
    };
    let found = sharpen(&subject, method, stopping).unwrap();
    for (i, round) in found.rounds.iter().enumerate() {
        println!("{}: round {i}: {round:.4?}", method.name());
    }
    println!(
        "{}: {:.4?} -> {:.4?}; {:?}: {:.4?}",
        method.name(),
        found.before,
        found.after,
        found.outcome,
        found.held_out
    );
    // Entropy by an independent sum.
    let entropies = [&found.image_before, &found.image_after].map(entropy);
    assert!(entropies[1] <= entropies[0], "{entropies:?}");
    assert_eq!(found.correction.is_some(), entropies[1] < entropies[0]);
    assert!(
        (entropies[1] - found.after.entropy).abs() < 1e-6,
        "{entropies:?}"
    );
    found
}

fn entropy(image: &Image) -> f64 {
    let powers = || image.pixels.iter().map(|z| f64::from(z.norm_sqr()));
    let total: f64 = powers().sum();
    -powers()
        .filter(|p| *p > 0.0)
        .map(|p| p / total * (p / total).ln())
        .sum::<f64>()
}

/// Recording with the correction, or unchanged.
fn corrected<'a>(history: &'a dyn PhaseHistory, found: &Sharpened) -> Corrected<'a> {
    let none = Correction::Phase {
        error_rad: vec![0.0; history.collection().pulses.len()],
    };
    Corrected::new(history, found.correction.as_ref().unwrap_or(&none)).unwrap()
}

/// Highest power within `half_m` of a position along x and y, dB, on pixels of `step_m`.
fn peak_db(history: &dyn PhaseHistory, place_m: DVec3, half_m: f64, step_m: [f64; 2]) -> f64 {
    let axis = |middle: f64, step: f64| {
        let half = (half_m / step).ceil();
        Axis {
            start: middle - half * step,
            step,
            count: 2 * half as usize + 1,
        }
    };
    let grid = ImageGrid::horizontal(
        axis(place_m.x, step_m[0]),
        axis(place_m.y, step_m[1]),
        place_m.z,
    );
    let image = form(history, &grid);
    let powers = image.pixels.iter().map(|z| z.norm_sqr());
    10.0 * f64::from(powers.fold(0.0, f32::max)).log10()
}
