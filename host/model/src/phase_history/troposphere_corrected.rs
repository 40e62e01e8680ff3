//! Compensation of the tropospheric delay of a recording.

use std::ops::Range;

use glam::DVec3;
use num_complex::Complex32;

use super::{Beam, Collection, NoBeam, PhaseHistory, ReadError};
use crate::antenna::MountedAntennas;
use crate::geometry::{ImageGrid, Troposphere};

/// Phase history compensated for the troposphere: the same samples, with reference paths adjusted by the tropospheric
/// excess at the pulse's reference point. Recorded reference paths are assumed to be geometric, as in CPHD.
///
/// Neglected: the difference of the extra path between other points and the reference point ([`Self::residual_m`]).
///
/// Memory: a copy of the geometry, 264 bytes per pulse.
pub struct TroposphereCorrected<'a> {
    history: Box<dyn PhaseHistory + 'a>,
    collection: Collection,
    air: Troposphere,
}

impl<'a> TroposphereCorrected<'a> {
    /// Compensate `history` for the delays of `air`.
    ///
    /// # Errors
    /// [`ReadError::Mismatch`] if the recording does not state its position on the Earth.
    pub fn new(history: Box<dyn PhaseHistory + 'a>, air: Troposphere) -> Result<Self, ReadError> {
        let mut collection = history.collection().clone();
        for pulse in &mut collection.pulses {
            let legs = [pulse.transmitter_m, pulse.receiver_m];
            let extra = |antenna| air.extra_path_m(&collection.frame, pulse.reference_m, antenna);
            let extra_m = match legs[0] == legs[1] {
                true => extra(legs[0]).map(|leg| 2.0 * leg),
                false => extra(legs[0]).zip(extra(legs[1])).map(|(a, b)| a + b),
            };
            let Some(extra_m) = extra_m else {
                return Err(ReadError::Mismatch(format!(
                    "{}: the recording does not state its position on the Earth, so that its tropospheric delay is unknown",
                    collection.name
                )));
            };
            // The samples are later than their reference path states by this path.
            pulse.reference_path_m -= extra_m;
        }
        Ok(Self {
            history,
            collection,
            air,
        })
    }

    /// Two-way extra path of the middle pulse's reference point, metres.
    pub fn extra_path_m(&self) -> f64 {
        let middle = self.collection.pulses.len() / 2;
        let recorded = self.history.collection().pulses.get(middle);
        let own = self.collection.pulses.get(middle);
        match recorded.zip(own) {
            Some((recorded, own)) => recorded.reference_path_m - own.reference_path_m,
            None => 0.0,
        }
    }

    /// Largest difference, metres, between the two-way extra path at the corners of a grid and the compensated extra path, over the first, the middle and the last pulse.
    pub fn residual_m(&self, grid: &ImageGrid) -> f64 {
        let last = self.collection.pulses.len().saturating_sub(1);
        let (rows, columns) = (grid.rows.count - 1, grid.columns.count - 1);
        let corners = [[0, 0], [0, columns], [rows, 0], [rows, columns]];
        let mut most = 0.0f64;
        for n in [0, last / 2, last] {
            let pulses = [&self.history.collection().pulses, &self.collection.pulses];
            let [Some(recorded), Some(own)] = pulses.map(|pulses| pulses.get(n)) else {
                continue;
            };
            let taken_m = recorded.reference_path_m - own.reference_path_m;
            for [row, column] in corners {
                let place = grid.position_m(row, column);
                let leg = |antenna: DVec3| {
                    let extra = self
                        .air
                        .extra_path_m(&self.collection.frame, place, antenna);
                    extra.unwrap_or(0.0)
                };
                let there_m = leg(own.transmitter_m) + leg(own.receiver_m);
                most = most.max((there_m - taken_m).abs());
            }
        }
        most
    }
}

impl PhaseHistory for TroposphereCorrected<'_> {
    fn collection(&self) -> &Collection {
        &self.collection
    }

    fn inner(&self) -> Option<&dyn PhaseHistory> {
        Some(&*self.history)
    }

    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError> {
        self.history.read(pulses, samples)
    }

    fn samples_in_memory(&self, pulses: Range<usize>) -> Option<&[Complex32]> {
        self.history.samples_in_memory(pulses)
    }

    fn true_antennas(&self) -> Option<&[[DVec3; 2]]> {
        self.history.true_antennas()
    }

    fn antennas(&self) -> Option<MountedAntennas> {
        self.history.antennas()
    }

    fn stated_beam(&self) -> Result<Option<Beam>, NoBeam> {
        self.history.stated_beam()
    }
}
