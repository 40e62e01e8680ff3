//! Simulated scenes of movers in clutter, and errors of their channels.

use std::ops::Range;
use std::sync::OnceLock;

use glam::DVec3;
use num_complex::Complex32;
use subaperture_focus::Numerics;
use subaperture_focus::formers::auto::Auto;
use subaperture_gmti::Imaging;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::monitor::Silent;
use subaperture_model::phase_history::{
    Channel, Channels, Collection, InMemory, PhaseHistory, ReadError,
};
use subaperture_signal::window::Window;
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
    scenario(seed, movers, sections, receivers, noise_db)
        .experiment()
        .unwrap()
}

/// Scenario of the scene with other sections, to which keys can be added.
pub(crate) fn scenario(
    seed: u64,
    movers: &[(&str, &str, &str)],
    sections: &str,
    receivers: &[&str],
    noise_db: f64,
) -> Scenario {
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
}

/// Number of scenes with random movers: `SUBAPERTURE_SCENES`, or `fewest` if it is not set.
pub(crate) fn number_of_scenes(fewest: u64) -> u64 {
    std::env::var("SUBAPERTURE_SCENES").map_or(fewest, |text| text.parse().unwrap())
}

/// Standard deviation of the radial velocity of clutter with internal motion, m/s.
pub(crate) const SPREAD_M_S: f64 = 0.1;

/// Grid of a strip.
pub(crate) const STRIP_GRID: &str = "x=-60:60:0.3,y=-15:15:0.5,z=0";

/// Scenario of clutter with internal motion over this extent, metres, with this number of points per square metre.
pub(crate) fn moving_clutter(
    seed: u64,
    movers: &[Truth],
    [half_x_m, half_y_m]: [f64; 2],
    density: f64,
) -> Scenario {
    let mut scenario = scenario_of_movers(seed, movers, &THREE, 10.0);
    for (key, value) in [
        ("x", format!("{}, {half_x_m} m", -half_x_m)),
        ("y", format!("{}, {half_y_m} m", -half_y_m)),
        ("density", density.to_string()),
        ("velocity_spread", format!("{SPREAD_M_S} m/s")),
    ] {
        scenario
            .set(&format!("scene.clutter[0].{key}"), &value)
            .unwrap();
    }
    scenario
}

/// Strip without movers, with 30 points per resolution cell: with fewer, the power of cancelled clutter has a heavy tail.
pub(crate) fn strip() -> &'static Channels<'static> {
    static STRIP: OnceLock<Channels<'static>> = OnceLock::new();
    STRIP.get_or_init(|| strip_of_seed(11))
}

/// Strip of other clutter.
pub(crate) fn strip_of_seed(seed: u64) -> Channels<'static> {
    let scenario = moving_clutter(seed, &[], [60.0, 15.0], 40.0);
    recorded(&scenario.experiment().unwrap())
}

/// Recording with the echoes of movers.
pub(crate) fn with_movers(recording: &Channels, movers: &[Truth]) -> Channels<'static> {
    let mut scenario = scenario_of_movers(0, movers, &THREE, -300.0);
    for (key, value) in [("density", "0.001"), ("sigma0", "-300 dB")] {
        scenario
            .set(&format!("scene.clutter[0].{key}"), value)
            .unwrap();
    }
    let movers = recorded(&scenario.experiment().unwrap());
    let sum = |((about, a), (_, b)): ((&Channel, &dyn PhaseHistory), (_, &dyn PhaseHistory))| {
        let collection = a.collection().clone();
        let count = collection.pulses.len();
        let [mut samples, other] = [a, b].map(|history| {
            let mut samples = vec![Complex32::ZERO; count * collection.num_samples];
            history.read(0..count, &mut samples).unwrap();
            samples
        });
        samples.iter_mut().zip(other).for_each(|(z, w)| *z += w);
        let history: Box<dyn PhaseHistory> = Box::new(InMemory::new(collection, samples).unwrap());
        (about.clone(), history)
    };
    Channels::new(recording.iter().zip(movers.iter()).map(sum).collect()).unwrap()
}

/// Images of -60 dB with the default windows.
pub(crate) fn imaging(grid: &ImageGrid) -> Imaging<'_> {
    Imaging {
        former: &Auto { error_db: -60.0 },
        grid,
        windows: [Window::default(); 2],
        memory_bytes: 1 << 30,
        numerics: Numerics::default(),
        monitor: &Silent,
    }
}

/// Recording of all channels, read once.
pub(crate) fn recorded(experiment: &Experiment) -> Channels<'static> {
    let channels = experiment.channels(1 << 30).unwrap();
    channels.in_memory().unwrap()
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

/// Scenario of these movers.
pub(crate) fn scenario_of_movers(
    seed: u64,
    movers: &[Truth],
    receivers: &[&str],
    noise_db: f64,
) -> Scenario {
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
    scenario(seed, &list, "", receivers, noise_db)
}
