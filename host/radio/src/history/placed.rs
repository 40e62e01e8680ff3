//! Phase history of a capture with known antenna positions.

use std::fs::File;
use std::ops::Range;
use std::path::PathBuf;

use glam::DVec3;
use num_complex::Complex32;
use subaperture_io::input::checksum;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::{Extent, SceneFrame};
use subaperture_model::phase_history::{
    Channel, ChannelHistory, Channels, Collection, InMemory, InputFile, PhaseHistory, Pulse,
    ReadError,
};
use subaperture_signal::phase::{narrow, phasor};

use super::HistoryError;
use super::motion::{Motion, Timing};
use super::read::Capture;
use super::track::Track;
use crate::antennas::Antennas;
use crate::profile::Sweep;

/// Geometry of a capture.
#[derive(Debug)]
pub struct Placement<'a> {
    /// Track of the body; `None` for a body at rest at the origin, or for a track that is to be estimated.
    pub track: Option<&'a Track>,
    /// Antennas on the body. `None` uses those of the recording's plan; if the plan has none, both are at the body's
    /// origin.
    pub antennas: Option<Antennas>,
    /// Motion compensation reference point, metres in the scene frame; usually the middle of the scene.
    pub reference_m: DVec3,
    /// Imaged part of the scene; `None` if unknown.
    pub extent: Option<Extent>,
    /// Position of the scene frame on the Earth; some file formats require one.
    pub frame: SceneFrame,
}

impl Placement<'_> {
    /// Placement of a radar at rest, or with an unknown track, in a local frame.
    pub fn standing(reference_m: DVec3) -> Self {
        Self {
            track: None,
            antennas: None,
            reference_m,
            extent: None,
            frame: SceneFrame::Local,
        }
    }
}

impl Placement<'_> {
    /// Convert one sweep of a receiver into a pulse and its samples, with echoes up to `reach_m`. Equivalent to
    /// [`Capture::channels`] for sweeps that arrive one at a time.
    ///
    /// # Errors
    /// If the sweep extends beyond the track, has too few carriers, or exceeds the bound on motion within a sweep.
    pub fn pulse(
        &self,
        sweep: &Sweep,
        receiver: usize,
        reach_m: f64,
    ) -> Result<(Pulse, Vec<Complex32>), HistoryError> {
        sweep.check()?;
        let timing = Timing::of(sweep);
        let (from_s, to_s) = timing.span_s;
        if let Some(track) = self.track
            && !(track.is_valid_at(from_s) && track.is_valid_at(to_s))
        {
            return Err(HistoryError::Track(format!(
                "sweep from {from_s} s to {to_s} s of device time extends beyond the track, {} s to {} s",
                track.span_s.0 + track.zero_s,
                track.span_s.1 + track.zero_s
            )));
        }
        let antennas = self.antennas.unwrap_or_default();
        let Some(&receiver_m) = antennas.receivers_m.get(receiver) else {
            return Err(HistoryError::Track(format!(
                "unknown receiver {receiver}: expected 0 or 1"
            )));
        };
        let arms_m = [antennas.transmitter_m, receiver_m];
        pulse(sweep, &timing, arms_m, self, reach_m)
    }
}

impl Capture {
    /// Motion-compensated response of receiver `receiver` (index into [`Self::receivers`]) in sweep `sweep` (index into
    /// [`Self::sweeps`]), as if the radar stood at its position at the middle of the sweep. The compensation is exact
    /// towards the placement's reference point. Without it, range-Doppler coupling moves a target that approaches with
    /// velocity `v` too near by `f v T / B`, for a sweep of duration `T` rising over the bandwidth `B`. Without a track
    /// the response is returned unchanged.
    ///
    /// # Errors
    /// If the sweep extends beyond the track.
    ///
    /// # Panics
    /// If `sweep` or `receiver` is out of range.
    pub fn still(
        &self,
        sweep: usize,
        receiver: usize,
        placement: &Placement,
    ) -> Result<Sweep, HistoryError> {
        let response = self.response(sweep, receiver);
        let antennas = placement
            .antennas
            .or(self.setup.antennas)
            .unwrap_or_default();
        let arms_m = [
            antennas.transmitter_m,
            antennas.receivers_m[self.receivers()[receiver]],
        ];
        let timing = Timing::of(response);
        if let Some(track) = placement.track
            && !(track.is_valid_at(timing.span_s.0) && track.is_valid_at(timing.span_s.1))
        {
            return Err(self.beyond(track));
        }
        let motion = Motion::new(&timing, placement.track, arms_m, response.values.len());
        let path_m = |time_s: f64| motion.path_m(placement.reference_m, time_s);
        Ok(response.compensated(path_m(timing.middle_s), path_m))
    }

    fn beyond(&self, track: &Track) -> HistoryError {
        let (from_s, to_s) = self.span_s();
        HistoryError::Track(format!(
            "no sweep lies within the track: sweeps extend from {from_s} s to {to_s} s of device time, the track from {} s to {} s. Check the device time of the \
             track's time 0",
            track.span_s.0 + track.zero_s,
            track.span_s.1 + track.zero_s
        ))
    }

    /// Phase history of each receiver, with pulses at device times. Sweeps beyond the track's ends are skipped, with a
    /// warning.
    ///
    /// # Errors
    /// If no sweep lies within the track, two receivers have no antenna positions, or motion within a sweep exceeds its
    /// bound.
    pub fn channels(&self, placement: &Placement) -> Result<Channels<'static>, HistoryError> {
        let antennas = placement.antennas.or(self.setup.antennas);
        if antennas.is_none() && self.receivers().len() > 1 {
            let what = "two receivers without antenna positions: give their positions on the body";
            return Err(HistoryError::Track(what.to_owned()));
        }
        let antennas = antennas.unwrap_or_default();
        if !(antennas.is_finite() && placement.reference_m.is_finite()) {
            let what = "expected finite coordinates of antennas and reference point";
            return Err(HistoryError::Track(what.to_owned()));
        }
        let timings: Vec<Timing> = self.sweeps.iter().map(|of| Timing::of(&of[0])).collect();
        let within: Vec<usize> = (0..timings.len())
            .filter(|&n| {
                let (from_s, to_s) = timings[n].span_s;
                placement
                    .track
                    .is_none_or(|track| track.is_valid_at(from_s) && track.is_valid_at(to_s))
            })
            .collect();
        if let (true, Some(track)) = (within.is_empty(), placement.track) {
            return Err(self.beyond(track));
        }
        let mut warnings = self.warnings();
        if within.len() < timings.len() {
            warnings.push(format!(
                "{} of {} sweeps extend beyond the track's ends and are skipped",
                timings.len() - within.len(),
                timings.len()
            ));
        }
        let names: Vec<String> = match self.receivers() {
            [_] => vec!["1".to_owned()],
            all => all.iter().map(|i| format!("T1R{}", i + 1)).collect(),
        };
        let mut channels: Vec<ChannelHistory<'static>> = Vec::new();
        for (place, (&receiver, name)) in self.receivers().iter().zip(names).enumerate() {
            let arms_m = [antennas.transmitter_m, antennas.receivers_m[receiver]];
            let history = self.history(place, arms_m, &within, &timings, placement)?;
            let about =
                Channel::new(name).of_antennas("transmitter", format!("receiver {receiver}"));
            let history = Placed {
                history: history.with_channels(vec![about.clone()]),
                warnings: warnings.clone(),
                path: self.path.clone(),
            };
            channels.push((about, Box::new(history)));
        }
        Ok(Channels::new(channels)?)
    }

    fn history(
        &self,
        place: usize,
        arms_m: [DVec3; 2],
        within: &[usize],
        timings: &[Timing],
        placement: &Placement,
    ) -> Result<InMemory, HistoryError> {
        let num_samples = self.setup.band().count;
        let mut pulses = Vec::with_capacity(within.len());
        let mut samples: Vec<Complex32> = Vec::with_capacity(within.len() * num_samples);
        for &n in within {
            let (sweep, timing) = (&self.sweeps[n][place], &timings[n]);
            let (pulse, of_pulse) = pulse(sweep, timing, arms_m, placement, self.reach_m)?;
            samples.extend(of_pulse);
            pulses.push(pulse);
        }
        let collection = Collection {
            name: self.setup.name.clone(),
            num_samples,
            pulses,
            frame: placement.frame,
            extent: placement.extent,
            timed: true,
        };
        Ok(InMemory::new(collection, samples)?)
    }
}

/// Convert a sweep into a pulse of a receiver, with its antennas at `arms_m` on the body.
fn pulse(
    sweep: &Sweep,
    timing: &Timing,
    arms_m: [DVec3; 2],
    placement: &Placement,
    reach_m: f64,
) -> Result<(Pulse, Vec<Complex32>), HistoryError> {
    let num_samples = sweep.values.len();
    let motion = Motion::new(timing, placement.track, arms_m, num_samples);
    let reference_m = placement.reference_m;
    let highest_hz = sweep.frequency_hz(num_samples);
    motion.check(sweep, reference_m, placement.extent, highest_hz)?;
    let at_m = motion.path_m(reference_m, timing.middle_s);
    let still = sweep.compensated(at_m, |time_s| motion.path_m(reference_m, time_s));
    let referred = still.filled(reach_m)?.into_iter().enumerate();
    let samples = referred
        .map(|(k, z)| narrow(z * phasor(sweep.frequency_hz(k) * at_m / SPEED_OF_LIGHT_M_S)))
        .collect();
    let [transmitter_m, receiver_m] = motion.antennas_m(timing.middle_s);
    let pulse = Pulse {
        time_s: timing.middle_s,
        transmitter_m,
        receiver_m,
        reference_m,
        reference_path_m: at_m,
        start_hz: sweep.start_hz,
        step_hz: sweep.step_hz,
        sweep: motion.sweep(),
        recorded_path_m: None,
    };
    Ok((pulse, samples))
}

/// Phase history of a receiver, with its warnings and source file.
struct Placed {
    history: InMemory,
    warnings: Vec<String>,
    /// Path of the recording's sample file.
    path: PathBuf,
}

impl PhaseHistory for Placed {
    fn collection(&self) -> &Collection {
        self.history.collection()
    }

    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError> {
        self.history.read(pulses, samples)
    }

    fn samples_in_memory(&self, pulses: Range<usize>) -> Option<&[Complex32]> {
        self.history.samples_in_memory(pulses)
    }

    fn channels(&self) -> Vec<Channel> {
        self.history.channels()
    }

    fn warnings(&self) -> Vec<String> {
        self.warnings.clone()
    }

    fn held_bytes(&self) -> u64 {
        self.history.held_bytes()
    }

    fn inputs(&self) -> Result<Vec<InputFile>, ReadError> {
        let read = || checksum(&mut File::open(&self.path)?);
        let (bytes, crc32) = read().map_err(|source| ReadError::Io {
            path: self.path.clone(),
            source,
        })?;
        Ok(vec![InputFile::with_crc32(&self.path, bytes, crc32)])
    }
}
