//! Simulated scene of the items on moving target indication.

use glam::DVec3;
use num_complex::Complex32;

use super::forming::{experiment, hold};
use crate::{Context, ItemError};
use subaperture_gmti::space_time::Motion;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::phase_history::{Channel, Channels, InMemory, PhaseHistory, ReadError};

/// Radar of `scenes/gmti.toml`: numbers of pulses and frequencies, pulse interval, bandwidth, wavelength.
pub(super) const PULSES: usize = 1040;
pub(super) const FREQUENCIES: usize = 200;
pub(super) const PRI_S: f64 = 1e-3;
pub(super) const BANDWIDTH_HZ: f64 = 150e6;
pub(super) const WAVELENGTH_M: f64 = SPEED_OF_LIGHT_M_S / 10e9;
/// Antenna of channel 0 in the middle of the collection, and speed of the radar.
pub(super) const ANTENNA_M: DVec3 = DVec3::new(0.0, -5000.0, 1000.0);
pub(super) const SPEED_M_S: f64 = 125.0;
/// Phase centres of the receivers behind that of the first one, metres: half of the distances of the receivers.
pub(super) const BASELINES_M: [f64; 3] = [0.0, 0.2, 0.5];
/// Time to which the positions of moving targets refer.
pub(super) const MIDDLE_S: f64 = (PULSES - 1) as f64 * PRI_S / 2.0;
/// Noise power of a sample relative to a unit scatterer.
pub(super) const NOISE: f64 = 10.0;
pub(super) const NOISE_TEXT: &str = "[radar.noise]\npower = \"10 dB\"\n";

/// Grid of pixels of half a resolution cell.
pub(super) const GRID: &str = "x=-60:60:0.3,y=-60:60:0.5,z=0";

/// Section of a rectangle of clutter, metres and dB per square metre.
pub(super) fn clutter(x: [f64; 2], y: [f64; 2], sigma0_db: f64) -> String {
    format!(
        "[[scene.clutter]]\nx = \"{}, {} m\"\ny = \"{}, {} m\"\ndensity = 3\nsigma0 = \"{sigma0_db} dB\"\n",
        x[0], x[1], y[0], y[1]
    )
}

/// Target that moves across the track.
#[derive(Clone, Copy)]
pub(super) struct Mover {
    pub(super) place: [f64; 2],
    pub(super) velocity_m_s: f64,
    pub(super) cross_section_m2: f64,
}

impl Mover {
    pub(super) fn text(&self) -> String {
        let Self {
            place: [x, y],
            velocity_m_s,
            cross_section_m2,
        } = self;
        format!(
            "[[scene.mover]]\nkind = \"linear\"\nposition = \"{x}, {y}, 0 m\"\nvelocity = \"0, {velocity_m_s}, 0 m/s\"\n\
             cross_section = \"{cross_section_m2} m^2\"\n"
        )
    }

    pub(super) fn motion(&self) -> Motion {
        Motion {
            epoch_s: MIDDLE_S,
            position_m: DVec3::new(self.place[0], self.place[1], 0.0),
            velocity_m_s: DVec3::Y * self.velocity_m_s,
            acceleration_m_s2: DVec3::ZERO,
        }
    }

    /// Slant range in the middle of the collection, metres.
    pub(super) fn range_m(&self) -> f64 {
        self.motion().position_m.distance(ANTENNA_M)
    }

    /// Radial velocity in the middle of the collection, positive when approaching.
    pub(super) fn radial_m_s(&self) -> f64 {
        let sight = (self.motion().position_m - ANTENNA_M).normalize();
        -sight.y * self.velocity_m_s
    }
}

/// Record all channels of the radar with noise, clutter and targets.
pub(super) fn record(context: &Context, sections: &str) -> Result<Channels<'static>, ItemError> {
    let text = format!("{}{sections}", include_str!("scenes/gmti.toml"));
    let experiment = experiment("gmti", &text)?;
    let channels = experiment.channels(context.memory_bytes)?;
    channels_of(channels.iter().map(|(about, history)| {
        let history = hold(context, history)?;
        Ok((about.clone(), history))
    }))
}

fn channels_of(
    parts: impl Iterator<Item = Result<(Channel, InMemory), ItemError>>,
) -> Result<Channels<'static>, ItemError> {
    let boxed = parts.map(|part| {
        let (about, history) = part?;
        let history: Box<dyn PhaseHistory> = Box::new(history);
        Ok((about, history))
    });
    let channels = Channels::new(boxed.collect::<Result<_, ItemError>>()?);
    Ok(channels.map_err(ReadError::from)?)
}

/// Recording with the echoes of targets added.
pub(super) fn with_targets(
    context: &Context,
    recording: &Channels,
    movers: &[Mover],
) -> Result<Channels<'static>, ItemError> {
    let targets = record(context, &movers.iter().map(Mover::text).collect::<String>())?;
    channels_of(recording.iter().zip(targets.iter()).map(
        |((about, a), (_, b))| -> Result<_, ItemError> {
            let collection = a.collection().clone();
            let mut sum = vec![Complex32::ZERO; collection.pulses.len() * collection.num_samples];
            let mut other = sum.clone();
            a.read(0..collection.pulses.len(), &mut sum)?;
            b.read(0..collection.pulses.len(), &mut other)?;
            sum.iter_mut().zip(other).for_each(|(z, w)| *z += w);
            Ok((about.clone(), InMemory::new(collection, sum)?))
        },
    ))
}

pub(super) fn db(ratio: f64) -> f64 {
    10.0 * ratio.log10()
}

pub(super) fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len() as f64;
    values.sum::<f64>() / count
}
