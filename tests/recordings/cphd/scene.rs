//! Small collections whose samples are float64 sums of the phase equation, without code of the library.

use glam::DVec3;
use num_complex::Complex32;
use subaperture::geometry::{Extent, SceneFrame};
use subaperture::phase_history::{Collection, InMemory, Pulse, Sweep};

const C: f64 = 299_792_458.0;

/// East, north, up at 52.1 N, 4.3 E; the origin about 60 m above the ellipsoid.
pub(crate) fn frame() -> SceneFrame {
    let (lat, lon) = (52.1f64.to_radians(), 4.3f64.to_radians());
    let n = 6_378_137.0 / (1.0 - 6.694_379_990_14e-3 * lat.sin().powi(2)).sqrt();
    SceneFrame::Earth {
        origin_ecf_m: DVec3::new(
            (n + 60.0) * lat.cos() * lon.cos(),
            (n + 60.0) * lat.cos() * lon.sin(),
            (n * (1.0 - 6.694_379_990_14e-3) + 60.0) * lat.sin(),
        ),
        x_axis_ecf: DVec3::new(-lon.sin(), lon.cos(), 0.0),
        y_axis_ecf: DVec3::new(-lat.sin() * lon.cos(), -lat.sin() * lon.sin(), lat.cos()),
    }
}

/// Parameters of a collection.
#[derive(Clone, Copy)]
pub(crate) struct Scene {
    pub(crate) num_pulses: usize,
    pub(crate) num_samples: usize,
    pub(crate) start_hz: f64,
    pub(crate) step_hz: f64,
    /// Position of the transmitter as a function of time.
    pub(crate) transmitter: fn(f64) -> DVec3,
    pub(crate) receiver: fn(f64) -> DVec3,
    pub(crate) reference: fn(f64) -> DVec3,
    /// Added to the reference path, metres.
    pub(crate) path_bias_m: f64,
    pub(crate) extent: bool,
}

pub(crate) const TRACK: fn(f64) -> DVec3 =
    |t| DVec3::new(125.0 * t - 3.0, -5000.0, 1500.0 + 0.5 * (3.0 * t).sin());
pub(crate) const ORIGIN: fn(f64) -> DVec3 = |_| DVec3::ZERO;

impl Default for Scene {
    fn default() -> Self {
        Self {
            num_pulses: 32,
            num_samples: 24,
            start_hz: 9.4e9,
            step_hz: 1.25e6,
            transmitter: TRACK,
            receiver: TRACK,
            reference: ORIGIN,
            path_bias_m: 0.0,
            extent: true,
        }
    }
}

impl Scene {
    pub(crate) fn pulse(&self, n: usize) -> Pulse {
        let time_s = 0.25 + n as f64 * 1.5e-3;
        let (transmitter_m, receiver_m, reference_m) = (
            (self.transmitter)(time_s),
            (self.receiver)(time_s),
            (self.reference)(time_s),
        );
        Pulse {
            time_s,
            transmitter_m,
            receiver_m,
            reference_m,
            reference_path_m: (transmitter_m - reference_m).length()
                + (receiver_m - reference_m).length()
                + self.path_bias_m,
            start_hz: self.start_hz,
            step_hz: self.step_hz,
            sweep: Sweep::AT_ONCE,
            recorded_path_m: None,
        }
    }

    pub(crate) fn collection(&self) -> Collection {
        Collection {
            name: "synthetic <&> scene".to_owned(),
            num_samples: self.num_samples,
            pulses: (0..self.num_pulses).map(|n| self.pulse(n)).collect(),
            frame: frame(),
            extent: self.extent.then_some(Extent {
                x_m: (-40.0, 45.0),
                y_m: (-30.0, 35.5),
            }),
            timed: true,
        }
    }

    /// `sum_p a_p exp(-j 2 pi f (path(p) - reference path) / c)`, pulse-major.
    pub(crate) fn samples(&self) -> Vec<Complex32> {
        let scatterers = [
            (DVec3::ZERO, 1.0),
            (DVec3::new(11.0, -7.5, 0.3), 0.7),
            (DVec3::new(-23.0, 18.0, -1.0), 0.25),
        ];
        let mut samples = Vec::new();
        for n in 0..self.num_pulses {
            let pulse = self.pulse(n);
            for k in 0..self.num_samples {
                let f = self.start_hz + k as f64 * self.step_hz;
                let (mut re, mut im) = (0.0, 0.0);
                for (point, amplitude) in scatterers {
                    let path = (point - pulse.transmitter_m).length()
                        + (point - pulse.receiver_m).length()
                        - pulse.reference_path_m;
                    let (s, c) = (-std::f64::consts::TAU * f * path / C).sin_cos();
                    re += amplitude * c;
                    im += amplitude * s;
                }
                samples.push(Complex32::new(re as f32, im as f32));
            }
        }
        samples
    }

    pub(crate) fn recorded(&self) -> InMemory {
        InMemory::new(self.collection(), self.samples()).unwrap()
    }
}

/// Read all samples of a history.
pub(crate) fn read_all(
    history: &dyn subaperture::phase_history::PhaseHistory,
) -> Result<Vec<Complex32>, subaperture::phase_history::ReadError> {
    let c = history.collection();
    let mut samples = vec![Complex32::ZERO; c.pulses.len() * c.num_samples];
    history.read(0..c.pulses.len(), &mut samples)?;
    Ok(samples)
}

/// Real and imaginary parts as bits, so that -0 and 0 differ.
pub(crate) fn bits(samples: &[Complex32]) -> Vec<(u32, u32)> {
    samples
        .iter()
        .map(|z| (z.re.to_bits(), z.im.to_bits()))
        .collect()
}

/// `sqrt(sum |a - b|^2 / sum |b|^2)`.
pub(crate) fn relative_rms(a: &[Complex32], b: &[Complex32]) -> f64 {
    assert_eq!(a.len(), b.len());
    let square = |re: f64, im: f64| re * re + im * im;
    let (mut error, mut norm) = (0.0, 0.0);
    for (x, y) in a.iter().zip(b) {
        error += square(
            f64::from(x.re) - f64::from(y.re),
            f64::from(x.im) - f64::from(y.im),
        );
        norm += square(f64::from(y.re), f64::from(y.im));
    }
    (error / norm).sqrt()
}
