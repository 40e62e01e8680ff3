//! Small experiments for tests of the simulator, and the definition of phase history.

use std::f64::consts::TAU;
use std::sync::Arc;

use glam::{DQuat, DVec3};
use num_complex::{Complex32, Complex64};
use subaperture::geometry::{Extent, SceneFrame};
use subaperture::phase_history::{Band, Collection, PhaseHistory};
use subaperture::radar::{
    Antenna, Motion, Pattern, PulseShape, Radar, Receiver, Reference, Waveform,
};
use subaperture::simulate::engine::Method;
use subaperture::simulate::scene::Scene;
use subaperture::simulate::{Experiment, Pair, Scatterer};
use subaperture::track::{Pose, Trajectory};

use crate::plain_history::{complex, plain_pulse};

/// A straight track with a sway across it.
#[derive(Clone, Copy, Debug)]
pub struct Line {
    /// Position at time 0, metres.
    pub start_m: DVec3,
    /// Velocity, m/s.
    pub velocity_m_s: DVec3,
    /// Amplitude of a sway of 7 Hz along y, metres.
    pub sway_m: f64,
}

impl Trajectory for Line {
    fn pose(&self, time_s: f64) -> Pose {
        let sway = DVec3::Y * (self.sway_m * (TAU * 7.0 * time_s).sin());
        Pose {
            position_m: self.start_m + self.velocity_m_s * time_s + sway,
            attitude: DQuat::IDENTITY,
        }
    }
}

/// 500 m south of the scene, eastwards at 100 m/s, 32 pulses of 1 ms.
pub const FLIGHT: Line = Line {
    start_m: DVec3::new(-1.6, -480.0, 140.0),
    velocity_m_s: DVec3::new(100.0, 0.0, 0.0),
    sway_m: 0.0,
};

/// The antenna pair of most experiments.
pub const PAIR: Pair = Pair {
    transmitter: 0,
    receiver: 0,
};

/// A chirp of `bandwidth_hz` in 1 us, sampled at 250 MHz for 2.5 us from 3.1 us on: ranges 465 m to 840 m.
pub fn pulsed(centre_hz: f64, bandwidth_hz: f64, rising: bool) -> Waveform {
    Waveform::Pulsed {
        centre_hz,
        sample_rate_hz: 250e6,
        num_samples: 625,
        window_start_s: 3.1e-6,
        shape: PulseShape::Lfm {
            bandwidth_hz,
            duration_s: 1e-6,
            rising,
        },
    }
}

/// A sweep of 200 MHz about 10 GHz in 10 us, sampled at 50 MHz.
pub fn fmcw(falling: bool) -> Waveform {
    Waveform::Fmcw {
        start_hz: if falling { 10.1e9 } else { 9.9e9 },
        chirp_hz_s: if falling { -2e13 } else { 2e13 },
        sample_rate_hz: 50e6,
        num_samples: 501,
        mixer_delay_s: 3.2e-6,
    }
}

/// An isotropic antenna at `offset_m`, looking along y.
pub fn antenna(name: &str, offset_m: DVec3) -> Antenna {
    Antenna {
        name: name.to_owned(),
        offset_m,
        boresight: DVec3::Y,
        up: DVec3::Z,
        pattern: Pattern::Isotropic,
        aim_m: None,
    }
}

/// A scatterer of `amplitude` at `(x, y, 0)`.
pub fn point(x: f64, y: f64, amplitude: f64) -> Scatterer {
    Scatterer {
        position_m: DVec3::new(x, y, 0.0),
        amplitude: amplitude.into(),
    }
}

/// Five points over 30 m, the middle one at the reference point.
pub fn five_points() -> Vec<Scatterer> {
    vec![
        point(0.0, 0.0, 1.0),
        point(-11.3, 8.7, 0.8),
        point(13.1, -12.9, 1.2),
        point(9.4, 14.2, 0.6),
        point(-14.6, -3.3, 1.0),
    ]
}

/// [`FLIGHT`] past `points` with one antenna and no perturbation.
pub fn experiment(waveform: Waveform, points: Vec<Scatterer>) -> Experiment {
    Experiment {
        name: "test".to_owned(),
        frame: SceneFrame::Earth {
            origin_ecf_m: DVec3::new(6_378_137.0, 0.0, 0.0),
            x_axis_ecf: DVec3::Y,
            y_axis_ecf: DVec3::Z,
        },
        extent: Some(Extent {
            x_m: (-15.0, 15.0),
            y_m: (-15.0, 15.0),
        }),
        radar: Radar {
            waveform,
            num_pulses: 32,
            pri_s: 1e-3,
            start_s: 0.0,
            transmitters: vec![antenna("tx", DVec3::ZERO)],
            receivers: vec![antenna("rx", DVec3::ZERO)],
            motion: Motion::StopAndGo,
            spreading: false,
            receiver: Receiver::default(),
        },
        track: Arc::new(FLIGHT),
        measured: None,
        scene: Scene {
            points,
            ..Scene::default()
        },
        reference: Reference::Point(DVec3::ZERO),
        seed: 11,
        method: Method::Sum,
        collection_start: None,
        logs: Vec::new(),
    }
}

/// 64 frequencies, 200 MHz about 10 GHz.
pub const IDEAL: Waveform = Waveform::Ideal {
    band: Band {
        start_hz: 9.9e9,
        step_hz: 3.125e6,
        count: 64,
    },
};

/// All samples of a history.
pub fn read_whole(history: &dyn PhaseHistory) -> Vec<Complex32> {
    let collection = history.collection();
    let count = collection.pulses.len();
    let mut samples = vec![Complex32::ZERO; count * collection.num_samples];
    history.read(0..count, &mut samples).unwrap();
    samples
}

/// Phase history by its definition, Schone 2020 (2.11), in float64, with the collection's geometry.
pub fn definition(collection: &Collection, points: &[Scatterer]) -> Vec<Complex64> {
    let points = points.iter();
    let points: Vec<_> = points
        .map(|s| (s.position_m.to_array(), [s.amplitude.re, s.amplitude.im]))
        .collect();
    let mut all = Vec::new();
    for pulse in &collection.pulses {
        let pulse = plain_pulse(pulse, 1.0);
        all.extend((0..collection.num_samples).map(|k| pulse.echo(k, &points)));
    }
    complex(&all)
}

/// Relative RMS difference, dB.
pub fn difference_db(a: &[Complex32], b: &[Complex64]) -> f64 {
    assert_eq!(a.len(), b.len());
    let widen = |z: &Complex32| Complex64::new(z.re.into(), z.im.into());
    let error: f64 = a
        .iter()
        .zip(b)
        .map(|(a, b)| (widen(a) - b).norm_sqr())
        .sum();
    10.0 * (error / b.iter().map(Complex64::norm_sqr).sum::<f64>()).log10()
}
