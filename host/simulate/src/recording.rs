//! An experiment's recordings: raw samples taken through [`subaperture_receive`].

use std::ops::Range;

use glam::DVec3;
use num_complex::Complex32;

use super::channel::Channel;
use super::experiment::{Experiment, Pair};
use super::record_error::RecordError;
use subaperture_model::phase_history::{
    ChannelHistory, Channels, Collection, PhaseHistory, ReadError,
};
use subaperture_model::radar::Waveform;
use subaperture_receive::{Compressed, Deskewed, Echoes, Filter, Referenced, Skew};

/// Phase history of a pair of antennas, made when read.
pub struct Recording<'a>(Received<'a>);

enum Received<'a> {
    Compressed(Compressed<Channel<'a>>),
    Deskewed(Deskewed<Channel<'a>>),
    Referenced(Referenced<Channel<'a>>),
}

impl Experiment {
    /// Raw samples of a pair, with all that the receiver adds.
    ///
    /// # Errors
    /// [`RecordError`] if there is no such pair or a part of the experiment does not make sense.
    pub fn echoes(&self, pair: Pair) -> Result<Channel<'_>, RecordError> {
        Channel::new(self, pair, u64::MAX)
    }

    /// Phase history of a pair: pulses through the inverse filter, sweeps with residual video phase and
    /// range skew removed. For other choices put [`subaperture_receive`]'s adapters on [`Self::echoes`].
    ///
    /// # Errors
    /// As [`Self::echoes`], and if the echoes cannot be made phase history.
    pub fn record(&self, pair: Pair) -> Result<Recording<'_>, RecordError> {
        self.record_within(pair, u64::MAX)
    }

    /// Every pair side by side, each as [`Self::record`] makes it, with tables of what is alike from pulse to pulse of at most
    /// `table_bytes` in all.
    ///
    /// # Errors
    /// As [`Self::record`]; [`RecordError::Channels`] if the transmitters' turns leave one of them a pulse less.
    pub fn channels(&self, table_bytes: u64) -> Result<Channels<'_>, RecordError> {
        let pairs = self.pairs();
        let each_bytes = table_bytes / pairs.len().max(1) as u64;
        let channel = |pair: Pair| -> Result<ChannelHistory<'_>, RecordError> {
            let recording = self.record_within(pair, each_bytes)?;
            Ok((self.about(pair), Box::new(recording)))
        };
        let channels = pairs.into_iter().map(channel);
        Ok(Channels::new(channels.collect::<Result<_, _>>()?)?)
    }

    /// [`Self::record`] with tables of what is alike from pulse to pulse of at most `table_bytes`.
    ///
    /// # Errors
    /// As [`Self::record`].
    pub fn record_within(
        &self,
        pair: Pair,
        table_bytes: u64,
    ) -> Result<Recording<'_>, RecordError> {
        let echoes = Channel::new(self, pair, table_bytes)?;
        Ok(Recording(match self.radar.waveform {
            Waveform::Pulsed { .. } => {
                Received::Compressed(Compressed::new(echoes, Filter::Inverse)?)
            }
            Waveform::Fmcw {
                chirp_hz_s,
                sample_rate_hz,
                ..
            } => {
                // Without an extent, all that the samples can tell apart.
                let half_delay_s = match self.extent {
                    Some(_) => None,
                    None => Some(0.5 * sample_rate_hz / chirp_hz_s.abs()),
                };
                Received::Deskewed(Deskewed::new(echoes, half_delay_s, Skew::Removed)?)
            }
            Waveform::Ideal { .. } | Waveform::Stepped { .. } => {
                Received::Referenced(Referenced::new(echoes)?)
            }
        }))
    }
}

impl<'a> Recording<'a> {
    /// The raw samples behind.
    pub fn echoes(&self) -> &Channel<'a> {
        match &self.0 {
            Received::Compressed(received) => received.echoes(),
            Received::Deskewed(received) => received.echoes(),
            Received::Referenced(received) => received.echoes(),
        }
    }

    fn history(&self) -> &dyn PhaseHistory {
        match &self.0 {
            Received::Compressed(received) => received,
            Received::Deskewed(received) => received,
            Received::Referenced(received) => received,
        }
    }
}

impl PhaseHistory for Recording<'_> {
    fn collection(&self) -> &Collection {
        self.history().collection()
    }

    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError> {
        self.history().read(pulses, samples)
    }

    fn true_antennas(&self) -> Option<&[[DVec3; 2]]> {
        self.echoes().true_antennas()
    }

    fn held_bytes(&self) -> u64 {
        self.history().held_bytes()
    }
}
