//! Removal of detected targets from the phase history (CLEAN).
//!
//! A target of amplitude `A` and position `q(t)` has in pulse `n` of channel `c` the samples
//!
//! ```text
//! A h_c exp(-j 2 pi f_k path_c(q(t_n)) / c)
//! ```
//!
//! with the factor `h_c` of the channel. They are subtracted from the samples, so that range walk, all folds of Doppler and all side lobes are removed together.

use std::ops::Range;

use num_complex::{Complex32, Complex64};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::phase_history::{Collection, PhaseHistory, ReadError};
use subaperture_signal::phase::narrow;

use super::geometry::Motion;
use crate::turns::rotate;

/// Echo of a target in one channel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Echo {
    pub(super) motion: Motion,
    /// Amplitude in this channel, square root of the radar cross-section in m^2.
    pub(super) amplitude: Complex64,
}

/// Phase history without the echoes of targets.
pub(super) struct Cleaned<'a> {
    history: &'a dyn PhaseHistory,
    echoes: &'a [Echo],
}

impl<'a> Cleaned<'a> {
    pub(super) fn new(history: &'a dyn PhaseHistory, echoes: &'a [Echo]) -> Self {
        Self { history, echoes }
    }
}

impl PhaseHistory for Cleaned<'_> {
    fn collection(&self) -> &Collection {
        self.history.collection()
    }

    fn inner(&self) -> Option<&dyn PhaseHistory> {
        Some(self.history)
    }

    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError> {
        self.history.read(pulses.clone(), samples)?;
        let collection = self.collection();
        let count = collection.num_samples;
        let mut echo_line = vec![Complex32::ZERO; count];
        let lines = samples.chunks_exact_mut(count);
        for (pulse, line) in collection.pulses[pulses].iter().zip(lines) {
            for echo in self.echoes {
                let path_m = pulse.relative_path_m(echo.motion.at(pulse.time_s));
                let cycles_a_hz = -path_m / SPEED_OF_LIGHT_M_S;
                echo_line.fill(narrow(echo.amplitude));
                let turns = [pulse.start_hz, pulse.step_hz].map(|hz| hz * cycles_a_hz);
                rotate(&mut echo_line, turns, 1.0);
                let pairs = line.iter_mut().zip(&echo_line);
                pairs.for_each(|(z, echo)| *z -= echo);
            }
        }
        Ok(())
    }
}
