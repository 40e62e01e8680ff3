//! Recordings of an experiment: raw samples processed by [`subaperture_io::receive`].

use std::ops::Range;

use glam::DVec3;
use num_complex::Complex32;

use super::channel::Channel;
use super::experiment::{Experiment, Pair};
use super::record_error::RecordError;
use subaperture_io::receive::{Compressed, Deskewed, Echoes, Filter, Referenced, Skew};
use subaperture_model::phase_history::{
    Beam, ChannelHistory, Channels, Collection, NoBeam, PhaseHistory, ReadError,
};
use subaperture_model::radar::{MountedAntennas, Waveform};

/// Phase history of an antenna pair, computed when read.
pub struct Recording<'a>(Received<'a>);

enum Received<'a> {
    Compressed(Compressed<Channel<'a>>),
    Deskewed(Deskewed<Channel<'a>>),
    Referenced(Referenced<Channel<'a>>),
}

impl Experiment {
    /// Raw samples of a pair, with all effects of the receiver.
    ///
    /// # Errors
    /// [`RecordError`] if the pair does not exist or part of the experiment is invalid.
    pub fn echoes(&self, pair: Pair) -> Result<Channel<'_>, RecordError> {
        Channel::new(self, pair, u64::MAX)
    }

    /// Phase history of a pair. Pulses are compressed with the inverse filter; FMCW sweeps are deskewed (residual video
    /// phase and range skew removed). For other options, apply the adapters of [`subaperture_io::receive`] to
    /// [`Self::echoes`].
    ///
    /// # Errors
    /// Those of [`Self::echoes`]; [`RecordError::Receive`] if the echoes cannot be converted into phase history.
    pub fn record(&self, pair: Pair) -> Result<Recording<'_>, RecordError> {
        self.record_within(pair, u64::MAX)
    }

    /// Phase history of all pairs, each as of [`Self::record`], with tables reused between pulses of at most
    /// `table_bytes` in total.
    ///
    /// # Errors
    /// Those of [`Self::record`]; [`RecordError::Channels`] if the number of pulses is not a multiple of the number of
    /// transmitters.
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

    /// Phase history as of [`Self::record`], with tables reused between pulses of at most `table_bytes`.
    ///
    /// # Errors
    /// Those of [`Self::record`].
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
                // Without an extent, use the unambiguous delay of the samples.
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
    /// Raw samples from which the phase history is computed.
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

    fn stated_beam(&self) -> Result<Option<Beam>, NoBeam> {
        let pulses = &self.echoes().collection().pulses;
        let middles_m = pulses
            .iter()
            .map(|pulse| 0.5 * (pulse.transmitter_m + pulse.receiver_m))
            .collect::<Vec<_>>();
        let times_s = pulses.iter().map(|pulse| pulse.time_s).collect::<Vec<_>>();
        self.echoes().carried().beam(&times_s, &middles_m)
    }

    fn antennas(&self) -> Option<MountedAntennas> {
        Some(self.echoes().carried()).filter(MountedAntennas::is_directive)
    }

    fn held_bytes(&self) -> u64 {
        self.history().held_bytes()
    }
}
