//! Vectors as baseband echoes of a pulse.

use std::ops::Range;
use std::sync::Arc;

use glam::DVec3;
use num_complex::Complex32;

use super::metadata::CrsdInfo;
use super::pulses::{Sent, Wave};
use super::vectors::Received;
use crate::container::SignalFormat;
use crate::container::Source;
use crate::receive::{EchoCollection, EchoPulse, Echoes};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::phase_history::{InputFile, ReadError, check_finite};
use subaperture_model::radar::{PulseShape, Waveform};
use subaperture_signal::phase::{narrow, phasor, widen};

/// Conversion of a vector's samples to those of an echo.
#[derive(Clone, Copy, Debug)]
struct Turn {
    /// Number of the vector in the file.
    vector: usize,
    scale: f64,
    /// Phase of sample 0 and phase increment per sample, in turns.
    turns: f64,
    turns_a_sample: f64,
    window_start_s: f64,
    /// Velocities of transmitter and receiver in the scene frame.
    velocities_m_s: [DVec3; 2],
}

/// Memory per vector in bytes.
pub(super) const KEPT_BYTES: u64 = (size_of::<Turn>() + size_of::<EchoPulse>()) as u64;

/// Position and format of a channel's stored samples.
#[derive(Clone)]
pub(super) struct Stored {
    pub(super) source: Arc<Source>,
    pub(super) format: SignalFormat,
    pub(super) offset: u64,
    pub(super) num_samples: usize,
    pub(super) sample_rate_hz: f64,
}

/// Echoes of a channel.
#[derive(Clone)]
pub(super) struct Vectors {
    stored: Stored,
    collection: EchoCollection,
    turns: Vec<Turn>,
    /// Waveform common to all pulses.
    wave: Option<Wave>,
    /// Band both transmitted and received, common to all vectors.
    band_hz: [f64; 2],
}

impl Vectors {
    /// Create an empty list.
    pub(super) fn to_be_read(info: &CrsdInfo, stored: Stored, name: String) -> Self {
        Self {
            collection: EchoCollection {
                name,
                // Set by the first vector.
                waveform: Waveform::Pulsed {
                    centre_hz: 0.0,
                    sample_rate_hz: stored.sample_rate_hz,
                    num_samples: stored.num_samples,
                    window_start_s: 0.0,
                    shape: PulseShape::Lfm {
                        bandwidth_hz: 0.0,
                        duration_s: 0.0,
                        rising: true,
                    },
                },
                pulses: Vec::new(),
                frame: info.frame,
                extent: Some(info.image_area),
                timed: true,
            },
            stored,
            turns: Vec::new(),
            wave: None,
            band_hz: [f64::NEG_INFINITY, f64::INFINITY],
        }
    }

    /// Reserve memory for exactly `count` vectors.
    pub(super) fn reserve(
        &mut self,
        count: usize,
    ) -> Result<(), std::collections::TryReserveError> {
        self.turns.try_reserve_exact(count)?;
        self.collection.pulses.try_reserve_exact(count)
    }

    /// Add vector `index`, an echo of `sent`.
    pub(super) fn push(
        &mut self,
        index: u64,
        sent: &Sent,
        received: &Received,
        reference_m: DVec3,
    ) -> Result<(), String> {
        let fault = |what: String| Err(format!("vector {index}: {what}"));
        let wave = *self.wave.get_or_insert(sent.wave);
        if !sent.wave.is_as(&wave) {
            let [first, this] = [wave, sent.wave].map(|wave| {
                let Wave {
                    centre_hz,
                    chirp_hz_s,
                    length_s,
                } = wave;
                format!("{centre_hz:?} Hz, {chirp_hz_s:?} Hz/s and {length_s:?} s")
            });
            return fault(format!(
                "expected the same FxFreq0, FxRate and TXmt in all pulses, found {this} after {first}; varying pulses are not supported: convert \
                 the file to CPHD 1.1 with its producer's tool"
            ));
        }
        let rate_hz = self.stored.sample_rate_hz;
        let length = sent.wave.length_s * rate_hz;
        if length > self.stored.num_samples as f64 {
            return fault(format!(
                "its pulse of {length:.0} samples is longer than the vector of {}",
                self.stored.num_samples
            ));
        }
        let half_hz = 0.5 * rate_hz;
        let seen_hz = [
            received.reference_hz - half_hz,
            received.reference_hz + half_hz,
        ];
        for band_hz in [sent.band_hz, received.band_hz, seen_hz] {
            self.band_hz[0] = self.band_hz[0].max(band_hz[0]);
            self.band_hz[1] = self.band_hz[1].min(band_hz[1]);
        }
        // Difference of whole seconds first, to keep all digits.
        let after_s =
            (received.start.0 as f64 - sent.time.0 as f64) + (received.start.1 - sent.time.1);
        let Wave {
            centre_hz,
            chirp_hz_s,
            length_s,
        } = wave;
        let frame = &self.collection.frame;
        let [transmitter_m, at_start_m] =
            [sent.position, received.position].map(|position| frame.from_ecf_m(position));
        let velocities_m_s =
            [sent.velocity, received.velocity].map(|velocity| frame.direction_from_ecf(velocity));
        if !velocities_m_s
            .iter()
            .all(|v| v.length() < 0.01 * SPEED_OF_LIGHT_M_S)
        {
            return fault("TxVel or RcvVel is impossibly large; repair or drop it".to_owned());
        }
        let receiver_m = arrival_m(
            [transmitter_m, at_start_m, reference_m],
            velocities_m_s[1],
            after_s,
        );
        self.turns.push(Turn {
            vector: index as usize,
            scale: received.scale,
            turns: received.phase
                - sent.phase
                - centre_hz * after_s
                - chirp_hz_s * length_s * length_s / 8.0,
            turns_a_sample: (received.reference_hz - centre_hz) / rate_hz,
            window_start_s: after_s + 0.5 * length_s,
            velocities_m_s,
        });
        self.collection.pulses.push(EchoPulse {
            time_s: sent.time.0 as f64 + sent.time.1,
            transmitter_m,
            receiver_m,
            reference_m,
            reference_path_m: transmitter_m.distance(reference_m)
                + receiver_m.distance(reference_m),
        });
        Ok(())
    }

    /// Set the waveform after the last vector. Returns the usable part of the band, symmetric about its centre.
    pub(super) fn finish(&mut self) -> Option<[f64; 2]> {
        let wave = self.wave?;
        self.collection.waveform = Waveform::Pulsed {
            centre_hz: wave.centre_hz,
            sample_rate_hz: self.stored.sample_rate_hz,
            num_samples: self.stored.num_samples,
            window_start_s: self.turns[0].window_start_s,
            shape: PulseShape::Lfm {
                bandwidth_hz: (wave.chirp_hz_s * wave.length_s).abs(),
                duration_s: wave.length_s,
                rising: wave.chirp_hz_s > 0.0,
            },
        };
        Some(self.band_hz.map(|edge| edge - wave.centre_hz))
    }

    /// Velocities of transmitter and receiver in the scene frame for every echo.
    pub(super) fn velocities_m_s(&self) -> Vec<[DVec3; 2]> {
        self.turns.iter().map(|turn| turn.velocities_m_s).collect()
    }

    /// Number of the vector of echo `n` in the file.
    pub(super) fn vector(&self, n: usize) -> usize {
        self.turns[n].vector
    }

    /// Limits of the integer type of the stored samples. `None` if the scales of the vectors differ: a writer that scales each vector to the
    /// full range reaches the limits without clipping.
    pub(super) fn integer_range(&self) -> Option<[f32; 2]> {
        let is_uniform = self
            .turns
            .windows(2)
            .all(|pair| pair[0].scale == pair[1].scale);
        self.stored.format.integer_range().filter(|_| is_uniform)
    }

    /// Read the samples of echo `n` as stored, without the scale of the vector. A scale of 0 gives zeros.
    pub(super) fn read_stored(&self, n: usize, row: &mut [Complex32]) -> Result<(), ReadError> {
        let (stored, turn) = (&self.stored, &self.turns[n]);
        let first = turn.vector * stored.num_samples;
        (stored.source).read_samples(stored.format, stored.offset, first, row)?;
        if turn.scale == 0.0 {
            row.fill(Complex32::ZERO);
        }
        check_finite(&stored.source.name(), n, stored.num_samples, row)
    }

    /// Read vectors that are adjacent in the file.
    fn read_run(&self, turns: &[Turn], samples: &mut [Complex32]) -> Result<(), ReadError> {
        let stored = &self.stored;
        let width = stored.num_samples;
        let first = turns[0].vector * width;
        stored
            .source
            .read_samples(stored.format, stored.offset, first, samples)?;
        for (turn, vector) in turns.iter().zip(samples.chunks_exact_mut(width)) {
            if turn.scale == 0.0 {
                vector.fill(Complex32::ZERO);
                continue;
            }
            for (i, z) in vector.iter_mut().enumerate() {
                let turned = phasor(turn.turns + i as f64 * turn.turns_a_sample);
                *z = narrow(widen(*z) * turned * turn.scale);
            }
        }
        Ok(())
    }
}

/// Receiver position when the echo of a point arrives. Arguments: the positions of the transmitter, of the receiver
/// at the start of its window (`after_s` after the pulse), and of the point.
fn arrival_m(
    [transmitter_m, at_start_m, point_m]: [DVec3; 3],
    velocity_m_s: DVec3,
    after_s: f64,
) -> DVec3 {
    let mut receiver_m = at_start_m;
    // Each step reduces the error by the ratio of velocity to the speed of light, at most a hundredth.
    for _ in 0..8 {
        let path_m = transmitter_m.distance(point_m) + receiver_m.distance(point_m);
        receiver_m = at_start_m + velocity_m_s * (path_m / SPEED_OF_LIGHT_M_S - after_s);
    }
    receiver_m
}

impl Echoes for Vectors {
    fn collection(&self) -> &EchoCollection {
        &self.collection
    }

    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError> {
        let width = self.stored.num_samples;
        let turns = &self.turns[pulses];
        assert_eq!(samples.len(), turns.len() * width);
        let mut rest = samples;
        for run in turns.chunk_by(|a, b| b.vector == a.vector + 1) {
            let (part, others) = rest.split_at_mut(run.len() * width);
            self.read_run(run, part)?;
            rest = others;
        }
        Ok(())
    }

    fn window_start_s(&self, pulse: usize) -> f64 {
        self.turns[pulse].window_start_s
    }

    fn held_bytes(&self) -> u64 {
        self.turns.len() as u64 * KEPT_BYTES
    }

    fn inputs(&self) -> Result<Vec<InputFile>, ReadError> {
        Ok(vec![self.stored.source.input()?])
    }
}
