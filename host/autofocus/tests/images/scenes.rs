//! Small far scenes of points, texture and speckle with phase errors of four kinds, to compare autofocus methods.

use glam::DVec3;
use subaperture_autofocus::{
    Axis, Correction, Measure, Method, Sharpened, Stopping, Subject, sharpen,
};
use subaperture_focus::bp::Backprojection;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::monitor::Silent;
use subaperture_model::phase_history::InMemory;
use subaperture_signal::window::Window;

use super::textbook::{Kernel, phase_error_rad, range_lines, residual_rad, without_trend};
use super::{Radar, Random};

/// Kind of scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Scene {
    /// Sixteen points of unequal brightness, speckle 20 dB below the mean of them.
    Points,
    /// Speckle whose power follows a gamma distribution of this order, correlated over a few cells: K-distributed texture.
    Texture(f64),
    /// Homogeneous speckle, without points or texture.
    Speckle,
}

/// Kind of phase error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Kind {
    Quadratic,
    Polynomial,
    Sinusoid,
    Walk,
}

pub(crate) const SCENES: [Scene; 3] = [Scene::Points, Scene::Texture(1.0), Scene::Speckle];
pub(crate) const KINDS: [Kind; 4] = [
    Kind::Quadratic,
    Kind::Polynomial,
    Kind::Sinusoid,
    Kind::Walk,
];

/// Scene, phase error and sampling of a simulated case.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Case {
    pub(crate) scene: Scene,
    pub(crate) kind: Kind,
    /// Rms of the error without constant and slope, radians.
    pub(crate) rms_rad: f64,
    /// Number of pulses of the aperture.
    pub(crate) pulses: usize,
    /// Number of range cells of the scene, and its cross-range cells as a fraction of the unambiguous ones.
    pub(crate) cells: usize,
    pub(crate) filled: f64,
    /// Signal-to-noise ratio of a pixel, dB.
    pub(crate) snr_db: f64,
    pub(crate) seed: u64,
}

impl Case {
    pub(crate) fn new(scene: Scene, kind: Kind) -> Self {
        Self {
            scene,
            kind,
            rms_rad: 3.0,
            pulses: 128,
            cells: 64,
            filled: 0.7,
            snr_db: 20.0,
            seed: 1,
        }
    }
}

/// Resolution in cross-range and range, metres, at 10 GHz.
const ACROSS_M: f64 = 2.0;
const ALONG_M: f64 = 1.0;
pub(crate) const HZ: f64 = 10e9;
const RANGE_M: f64 = 10_000.0;

/// A recording with a known phase error.
pub(crate) struct Disturbed {
    pub(crate) history: InMemory,
    pub(crate) error_rad: Vec<f64>,
    pub(crate) grid: ImageGrid,
    lines_m: Vec<DVec3>,
}

/// Phase error of a kind with this rms, without constant and slope.
pub(crate) fn error_rad(kind: Kind, rms_rad: f64, count: usize, random: &mut Random) -> Vec<f64> {
    let place = |n: usize| 2.0 * (n as f64 + 0.5) / count as f64 - 1.0;
    let mut error: Vec<f64> = match kind {
        Kind::Quadratic => {
            let sign = (random.uniform() - 0.5).signum();
            (0..count).map(|n| sign * place(n).powi(2)).collect()
        }
        Kind::Polynomial => {
            // Legendre polynomials of degree 2 to 8.
            let weights: Vec<f64> = (2..=8).map(|_| random.gauss()).collect();
            let value = |n: usize| {
                let u = place(n);
                let (mut before, mut at, mut sum) = (1.0, u, 0.0);
                for (degree, weight) in (2..=8).zip(&weights) {
                    let d = f64::from(degree);
                    let next = ((2.0 * d - 1.0) * u * at - (d - 1.0) * before) / d;
                    (before, at) = (at, next);
                    sum += weight * at;
                }
                sum
            };
            (0..count).map(value).collect()
        }
        Kind::Sinusoid => {
            let (cycles, first) = (2.0 + 3.0 * random.uniform(), 6.0 * random.uniform());
            let value = |n: usize| (std::f64::consts::PI * cycles * place(n) + first).sin();
            (0..count).map(value).collect()
        }
        Kind::Walk => {
            let mut at = 0.0;
            let step = |_| {
                at += random.gauss();
                at
            };
            (0..count).map(step).collect()
        }
    };
    without_trend(&mut error);
    let rms = (error.iter().map(|e| e * e).sum::<f64>() / count as f64).sqrt();
    error.iter().map(|e| e * rms_rad / rms).collect()
}

pub(crate) fn disturbed(case: Case) -> Disturbed {
    let mut random = Random(case.seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
    for _ in 0..16 {
        random.uniform();
    }
    let count = case.pulses;
    let wavelength_m = super::C_M_S / HZ;
    let aperture_m = RANGE_M * wavelength_m / (2.0 * ACROSS_M);
    // The radar is in the ground plane, so that ground and slant range are equal.
    let track: Vec<DVec3> = (0..count)
        .map(|n| {
            let u = (n as f64 + 0.5) / count as f64 - 0.5;
            DVec3::new(aperture_m * u, -RANGE_M, 0.0)
        })
        .collect();
    let wide_m = ACROSS_M * count as f64 * case.filled;
    let deep_m = ALONG_M * case.cells as f64;
    let samples = (case.cells as f64 * 1.25).ceil() as usize;
    let points = scatterers(case.scene, wide_m, deep_m, &mut random);
    let error_rad = error_rad(case.kind, case.rms_rad, count, &mut random);
    let band_hz = super::C_M_S / (2.0 * ALONG_M);
    // The mean power of a pulse's samples is the total of all scatterers; compression in range and cross-range gains the number of samples.
    let power: f64 = points.iter().map(|p| p.1 * p.1).sum();
    let cells = case.cells as f64 * count as f64 * case.filled;
    let gain = samples as f64 * count as f64;
    let noise = (power / cells * gain * 10f64.powf(-case.snr_db / 10.0)).sqrt();
    let radar = Radar {
        start_hz: HZ - 0.5 * band_hz,
        step_hz: band_hz / samples as f64,
        samples,
        recorded_m: track.clone(),
        true_m: track,
        phases_rad: error_rad.clone(),
        noise,
    };
    let history = radar.echoes(&points, &mut random);
    let axis = |long_m: f64, step: f64| Axis {
        start: -long_m / 2.0,
        step,
        count: (long_m / step).round() as usize + 1,
    };
    let grid = ImageGrid::horizontal(
        axis(wide_m, ACROSS_M / 2.0),
        axis(deep_m, ALONG_M / 2.0),
        0.0,
    );
    let lines_m = (0..case.cells)
        .map(|m| DVec3::new(0.0, -deep_m / 2.0 + (m as f64 + 0.5) * ALONG_M, 0.0))
        .collect();
    Disturbed {
        history,
        error_rad,
        grid,
        lines_m,
    }
}

/// Positions and complex amplitudes of the scatterers, with random phases.
fn scatterers(scene: Scene, wide_m: f64, deep_m: f64, random: &mut Random) -> Vec<(DVec3, f64)> {
    // Three scatterers per cell on a jittered raster.
    let count = (3.0 * wide_m / ACROSS_M * deep_m / ALONG_M) as usize;
    let place = |random: &mut Random| {
        DVec3::new(
            wide_m * (random.uniform() - 0.5),
            deep_m * (random.uniform() - 0.5),
            0.0,
        )
    };
    let mut all: Vec<(DVec3, f64)> = match scene {
        Scene::Texture(order) => {
            // Power of tiles of four by four cells: gamma variates by sums of squares for halves of an order.
            let across = (wide_m / (4.0 * ACROSS_M)).ceil() as usize + 1;
            let along = (deep_m / (4.0 * ALONG_M)).ceil() as usize + 1;
            let halves = (2.0 * order).round().max(1.0) as usize;
            let tiles: Vec<f64> = (0..across * along)
                .map(|_| (0..halves).map(|_| random.gauss().powi(2)).sum::<f64>() / halves as f64)
                .collect();
            (0..count)
                .map(|_| {
                    let at_m = place(random);
                    let i = ((at_m.x + wide_m / 2.0) / (4.0 * ACROSS_M)) as usize;
                    let j = ((at_m.y + deep_m / 2.0) / (4.0 * ALONG_M)) as usize;
                    (at_m, random.gauss() * tiles[j * across + i].sqrt())
                })
                .collect()
        }
        _ => (0..count)
            .map(|_| (place(random), random.gauss()))
            .collect(),
    };
    if scene == Scene::Points {
        let scale = 30.0;
        all.extend((0..16).map(|_| {
            let at_m = place(random) * 0.95;
            (at_m, scale * (0.4 + random.uniform()))
        }));
    }
    all
}

impl Disturbed {
    /// Result of a method after at most `rounds` rounds.
    pub(crate) fn sharpened(&self, method: &dyn Method, rounds: usize) -> Sharpened {
        let subject = Subject {
            history: &self.history,
            grid: &self.grid,
            former: &Backprojection { error_db: -50.0 },
            windows: [Window::default(); 2],
            measure: Measure::Entropy,
            memory_bytes: 1 << 30,
            monitor: &Silent,
        };
        let stopping = Stopping {
            rounds,
            ..Stopping::default()
        };
        sharpen(&subject, method, stopping).unwrap()
    }

    /// Rms of the phase error after a method, radians.
    pub(crate) fn left_by(&self, method: &dyn Method, rounds: usize) -> f64 {
        match self.sharpened(method, rounds).correction {
            None => residual_rad(&self.error_rad, &vec![0.0; self.error_rad.len()]),
            Some(Correction::Phase { error_rad }) => residual_rad(&self.error_rad, &error_rad),
            Some(Correction::Track { .. }) => panic!("{} found a track", method.name()),
        }
    }

    /// Rms of the phase error after the textbook PGA, radians.
    pub(crate) fn left_by_textbook(&self, kernel: Kernel) -> f64 {
        let lines = range_lines(&self.history, &self.lines_m);
        residual_rad(&self.error_rad, &phase_error_rad(lines, kernel, 12))
    }
}
