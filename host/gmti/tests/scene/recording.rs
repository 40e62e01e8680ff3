//! Simulated scenes of movers in clutter, and errors of their channels.

use std::ops::Range;

use glam::DVec3;
use num_complex::Complex32;
use subaperture_model::phase_history::{
    Channel, Channels, Collection, InMemory, PhaseHistory, ReadError,
};
use subaperture_simulate::Experiment;
use subaperture_simulate::scenario::Scenario;

pub(crate) const TWO: [&str; 2] = ["0.25, 0, 0 m", "-0.25, 0, 0 m"];
pub(crate) const FOUR: [&str; 4] = ["0.6, 0, 0 m", "0.2, 0, 0 m", "-0.3, 0, 0 m", "-0.6, 0, 0 m"];
pub(crate) const THREE: [&str; 3] = ["0.4, 0, 0 m", "0, 0, 0 m", "-0.6, 0, 0 m"];

/// Radar at 5.1 km, 125 m/s, 10 GHz, 150 MHz, 1.04 s, over 120 m x 120 m of clutter. `{}` are movers and receivers.
pub(crate) fn scene(
    movers: &[(&str, &str, &str)],
    receivers: &[&str],
    noise_db: f64,
) -> Experiment {
    scene_of_seed(11, movers, receivers, noise_db)
}

pub(crate) fn scene_of_seed(
    seed: u64,
    movers: &[(&str, &str, &str)],
    receivers: &[&str],
    noise_db: f64,
) -> Experiment {
    scene_with(seed, movers, "", receivers, noise_db)
}

/// Scene with other sections.
pub(crate) fn scene_with(
    seed: u64,
    movers: &[(&str, &str, &str)],
    sections: &str,
    receivers: &[&str],
    noise_db: f64,
) -> Experiment {
    let mut text = format!(
        r#"
name = "movers in clutter"
seed = {seed}
[scene]
reference = "0, 0, 0 m"
x = "-60, 60 m"
y = "-60, 60 m"
[radar]
kind = "ideal"
pulses = 1040
pri = "1 ms"
centre = "10 GHz"
bandwidth = "150 MHz"
samples = 200
[radar.noise]
power = "{noise_db} dB"
[platform]
kind = "linear"
position = "0, -5, 1 km"
velocity = "125, 0, 0 m/s"
[[scene.clutter]]
x = "-60, 60 m"
y = "-60, 60 m"
density = 3
sigma0 = "-5 dB"
[[radar.transmitter]]
offset = "0, 0, 0 m"
"#
    );
    for receiver in receivers {
        text += &format!("[[radar.receiver]]\noffset = \"{receiver}\"\n");
    }
    for (position, velocity, section) in movers {
        text += &format!(
            "[[scene.mover]]\nkind = \"linear\"\nposition = \"{position}\"\nvelocity = \"{velocity}\"\n\
             cross_section = \"{section}\"\n"
        );
    }
    text += sections;
    Scenario::new("movers.toml", text, ".")
        .experiment()
        .unwrap()
}

/// Recording of all channels, read once.
pub(crate) fn recorded(experiment: &Experiment) -> Channels<'static> {
    let channels = experiment.channels(1 << 30).unwrap();
    let read = |(about, history): (&Channel, &dyn PhaseHistory)| {
        let collection = history.collection().clone();
        let count = collection.pulses.len();
        let mut samples = vec![Complex32::ZERO; count * collection.num_samples];
        history.read(0..count, &mut samples).unwrap();
        let history: Box<dyn PhaseHistory> = Box::new(InMemory::new(collection, samples).unwrap());
        (about.clone(), history)
    };
    Channels::new(channels.iter().map(read).collect()).unwrap()
}

/// Errors of a receiver and its recorded position.
#[derive(Clone, Copy, Default)]
pub(crate) struct Errors {
    pub(crate) gain_db: f64,
    pub(crate) phase_deg: f64,
    pub(crate) delay_s: f64,
    /// Displacement of the recorded position from the true one.
    pub(crate) displaced_m: DVec3,
}

struct Impaired<'a> {
    history: &'a dyn PhaseHistory,
    collection: Collection,
    factors: Vec<Complex32>,
}

impl<'a> Impaired<'a> {
    fn new(history: &'a dyn PhaseHistory, errors: Errors) -> Self {
        let mut collection = history.collection().clone();
        for pulse in &mut collection.pulses {
            pulse.receiver_m += errors.displaced_m;
        }
        let middle = collection.num_samples / 2;
        let factor = |k: usize| {
            let offset_hz = (k as f64 - middle as f64) * collection.pulses[0].step_hz;
            let phase =
                errors.phase_deg.to_radians() - std::f64::consts::TAU * offset_hz * errors.delay_s;
            let gain = 10f64.powf(errors.gain_db / 20.0);
            Complex32::new((gain * phase.cos()) as f32, (gain * phase.sin()) as f32)
        };
        let factors = (0..collection.num_samples).map(factor).collect();
        Self {
            history,
            collection,
            factors,
        }
    }
}

impl PhaseHistory for Impaired<'_> {
    fn collection(&self) -> &Collection {
        &self.collection
    }

    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError> {
        self.history.read(pulses, samples)?;
        for line in samples.chunks_exact_mut(self.factors.len()) {
            line.iter_mut()
                .zip(&self.factors)
                .for_each(|(z, factor)| *z *= factor);
        }
        Ok(())
    }
}

pub(crate) fn impaired<'a>(channels: &'a Channels, errors: &[Errors]) -> Channels<'a> {
    let with = |((about, history), &errors): ((&Channel, &'a dyn PhaseHistory), &Errors)| {
        let history: Box<dyn PhaseHistory + 'a> = Box::new(Impaired::new(history, errors));
        (about.clone(), history)
    };
    Channels::new(channels.iter().zip(errors).map(with).collect()).unwrap()
}

/// Uniform random numbers by Knuth's generator.
pub(crate) struct Uniform(pub(crate) u64);

impl Uniform {
    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// Horizontal position, metres, velocity, m/s, and radar cross-section, m^2, of a mover.
pub(crate) type Truth = ([f64; 2], [f64; 2], f64);

/// Scene of these movers.
pub(crate) fn scene_of_movers(
    seed: u64,
    movers: &[Truth],
    receivers: &[&str],
    noise_db: f64,
) -> Experiment {
    let text = |(place, velocity, section): &Truth| {
        [
            format!("{}, {}, 0 m", place[0], place[1]),
            format!("{}, {}, 0 m/s", velocity[0], velocity[1]),
            format!("{section} m^2"),
        ]
    };
    let texts: Vec<[String; 3]> = movers.iter().map(text).collect();
    let list: Vec<(&str, &str, &str)> = texts
        .iter()
        .map(|[place, velocity, section]| (&place[..], &velocity[..], &section[..]))
        .collect();
    scene_of_seed(seed, &list, receivers, noise_db)
}
