//! Doppler centroid of a strip map: of the echoes, of the geometry and of the stated beam.

use std::ops::Range;

use glam::DVec3;

use super::band::DopplerScale;
use super::estimate::{EstimateError, MIN_PULSES, any, shown};
use super::moments::moments;
use super::track::Track;
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::PhaseHistory;

/// Largest number of pulses to read, and the number of their blocks.
const MOST_PULSES: usize = 2048;
const BLOCKS: usize = 8;

/// Largest difference from a stated beam, as a fraction of the PRF, that is no disagreement.
const SAME: f64 = 0.1;

/// Doppler centroid at the centre frequency. It is positive for echoes from forward of broadside.
#[derive(Clone, Copy, Debug)]
pub struct DopplerCentroid {
    /// Pulse repetition frequency, hertz.
    pub prf_hz: f64,
    /// Centroid of the azimuth spectrum, hertz, from -PRF/2 to PRF/2.
    pub fraction_hz: f64,
    /// Number of PRFs to add to the fraction, if the wavelength diversity of the samples resolves it.
    pub ambiguity: Option<i64>,
    /// Doppler frequency of the given point at the middle pulse by the track, hertz.
    pub point_hz: f64,
    /// Doppler frequency in the middle of the stated beam, hertz.
    pub stated_hz: Option<f64>,
    /// Number of pulses that were read.
    pub num_pulses: usize,
}

impl DopplerCentroid {
    /// Centroid with its resolved ambiguity, hertz.
    pub fn resolved_hz(&self) -> Option<f64> {
        let number = self.ambiguity? as f64;
        Some(self.fraction_hz + number * self.prf_hz)
    }

    /// Difference of the echoes' centroid from another frequency modulo the PRF, hertz, from -PRF/2 to PRF/2.
    pub fn off_hz(&self, other_hz: f64) -> f64 {
        let turns = (self.fraction_hz - other_hz) / self.prf_hz;
        (turns - turns.round()) * self.prf_hz
    }

    /// Difference from the stated beam, hertz, if it exceeds a tenth of the PRF.
    pub fn disagreement_hz(&self) -> Option<f64> {
        let off_hz = self.off_hz(self.stated_hz?);
        (off_hz.abs() > SAME * self.prf_hz).then_some(off_hz)
    }
}

/// Estimate the Doppler centroid from the azimuth spectrum of at most 2048 pulses, in 8 blocks evenly distributed over the recording.
///
/// # Errors
/// [`EstimateError::NoStrip`] for recordings without times, with a curved or unevenly sampled track or few pulses; [`EstimateError::Flat`] if the
/// spectrum shows no beam; [`EstimateError::Form`] if reading fails.
pub fn doppler_centroid(
    history: &dyn PhaseHistory,
    point_m: DVec3,
    monitor: &dyn Monitor,
) -> Result<DopplerCentroid, EstimateError> {
    let collection = history.collection();
    let track = Track::of(collection, &any(history))?;
    let spacing = track.spacing().map_err(EstimateError::NoStrip)?;
    let count = track.len();
    let DopplerScale { prf_hz, ahead_hz } = DopplerScale::of(collection, &spacing)?;
    if count < MIN_PULSES {
        return Err(EstimateError::NoStrip(format!(
            "expected at least {MIN_PULSES} pulses, found {count}"
        )));
    }
    let blocks = blocks(count);
    let moments = moments(history, &spacing.numbers, &blocks, monitor)?;
    shown(&moments)?;
    let centre = moments.centre();
    let stated = history.stated_beam().ok().flatten();
    Ok(DopplerCentroid {
        prf_hz,
        fraction_hz: centre * prf_hz,
        ambiguity: moments
            .decided()
            .map(|[turns, _]| (turns - centre).round() as i64),
        point_hz: track.sine(count / 2, point_m) * ahead_hz,
        stated_hz: stated.map(|beam| libm::sin(beam.squint_rad) * ahead_hz),
        num_pulses: blocks.iter().map(ExactSizeIterator::len).sum(),
    })
}

/// Blocks of pulses to read.
fn blocks(count: usize) -> Vec<Range<usize>> {
    if count <= MOST_PULSES {
        return std::iter::once(0..count).collect();
    }
    let each = MOST_PULSES / BLOCKS;
    let first = |block: usize| block * (count - each) / (BLOCKS - 1);
    (0..BLOCKS)
        .map(|block| first(block)..first(block) + each)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_are_bounded_and_reach_both_ends() {
        assert_eq!((blocks(2048).len(), &blocks(2048)[0]), (1, &(0..2048)));
        for count in [2049, 5000, 1_000_000] {
            let blocks = blocks(count);
            assert_eq!((blocks[0].start, blocks[7].end), (0, count));
            assert!(blocks.iter().all(|block| block.len() == 256));
        }
    }

    #[test]
    fn differences_are_modulo_the_prf() {
        let centroid = DopplerCentroid {
            prf_hz: 1000.0,
            fraction_hz: 450.0,
            ambiguity: Some(-3),
            point_hz: 0.0,
            stated_hz: Some(-7540.0),
            num_pulses: 64,
        };
        assert_eq!(centroid.resolved_hz(), Some(-2550.0));
        assert!((centroid.off_hz(-7540.0) + 10.0).abs() < 1e-9);
        assert_eq!(centroid.disagreement_hz(), None);
        let other = DopplerCentroid {
            stated_hz: Some(-7700.0),
            ..centroid
        };
        assert!((other.disagreement_hz().unwrap() - 150.0).abs() < 1e-9);
    }
}
