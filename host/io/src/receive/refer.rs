//! Referencing of phases to the reference path, sample by sample.
//!
//! ```text
//! z[n][k] = s[n][k] exp(+j 2 pi f_k reference_path_n(t_k) / c)
//! ```
//!
//! with the reference path at the sample's own time, `t_k = k step_s` for stepped carriers (Chim 2018, 5.5). Phases are
//! float64, with one float32 rounding per sample. Cost: one phasor per sample.

use std::ops::Range;

use glam::DVec3;
use num_complex::Complex32;
use rayon::prelude::*;

use super::{Echoes, ReceiveError, collection_of, in_blocks};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::phase_history::{Band, Collection, InputFile, PhaseHistory, ReadError};
use subaperture_model::radar::Waveform;
use subaperture_signal::phase::{narrow, phasor, widen};

/// Phase history of a stepped-frequency or an ideal radar.
#[derive(Clone, Debug)]
pub struct Referenced<E> {
    echoes: E,
    collection: Collection,
    band: Band,
    /// Time from carrier to carrier, seconds.
    step_s: f64,
}

impl<E: Echoes> Referenced<E> {
    /// Reference the echoes of stepped or simultaneous carriers.
    ///
    /// # Errors
    /// [`ReceiveError`] if the waveform is another one, or its carriers are not positive and ascending.
    pub fn new(echoes: E) -> Result<Self, ReceiveError> {
        let collection = echoes.collection();
        let (band, step_s) = match collection.waveform {
            Waveform::Ideal { band } => (band, 0.0),
            Waveform::Stepped { band, step_s, .. } => (band, step_s),
            _ => {
                let what = "expected a stepped or ideal waveform: compress a pulsed or deskew an FMCW waveform instead";
                return Err(ReceiveError::new(collection, what));
            }
        };
        if !(band.start_hz > 0.0 && band.step_hz > 0.0 && band.count > 0) {
            let what = format!("{band:?}: expected positive, ascending carriers");
            return Err(ReceiveError::new(collection, what));
        }
        let axis = (band.start_hz, band.step_hz, band.count);
        let collection = collection_of(&echoes, axis, step_s);
        Ok(Self {
            echoes,
            collection,
            band,
            step_s,
        })
    }

    /// Raw echoes from which the phase history is computed.
    pub fn echoes(&self) -> &E {
        &self.echoes
    }
}

impl<E: Echoes> PhaseHistory for Referenced<E> {
    fn collection(&self) -> &Collection {
        &self.collection
    }

    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError> {
        let width = self.band.count;
        let refer = |first: usize, raw: &[Complex32], rows: &mut [Complex32]| {
            rows.par_chunks_exact_mut(width)
                .zip(raw.par_chunks_exact(width))
                .enumerate()
                .for_each(|(i, (row, echo))| {
                    for (k, (z, &s)) in row.iter_mut().zip(echo).enumerate() {
                        let after_s = k as f64 * self.step_s;
                        let path_m = self.echoes.reference_path_m(first + i, after_s);
                        let turns = self.band.frequency_hz(k) * (path_m / SPEED_OF_LIGHT_M_S);
                        *z = narrow(widen(s) * phasor(turns));
                    }
                });
        };
        in_blocks(&self.echoes, width, pulses, width, samples, refer)
    }

    fn true_antennas(&self) -> Option<&[[DVec3; 2]]> {
        self.echoes.true_antennas()
    }

    fn held_bytes(&self) -> u64 {
        self.echoes.held_bytes() + size_of_val(self.collection.pulses.as_slice()) as u64
    }

    fn inputs(&self) -> Result<Vec<InputFile>, ReadError> {
        self.echoes.inputs()
    }
}
