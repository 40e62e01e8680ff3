//! Selection of pulses, their times, and the antenna positions.

use std::path::Path;

use super::arrays::Source;
use super::in_flight::InFlight;
use super::keys::{
    AntennaKeys, PlatformKeys, PulsesUsed, RadarKeys, RecordingDescription, RecordingKeys,
};
use super::samples::Rows;
use super::track::{self, Track};
use crate::pattern_csv::tables_in;
use subaperture_describe::declare::Located;
use subaperture_describe::error::Fault;
use subaperture_describe::place::OriginKeys;
use subaperture_describe::radar;
use subaperture_model::geometry::SceneFrame;
use subaperture_model::phase_history::{self, DefectKind};
use subaperture_model::radar::Antenna;
use subaperture_signal::phase::{cis, narrow};

use glam::{DQuat, DVec3};
use num_complex::{Complex32, Complex64};

/// Selection of the pulses in use.
pub(super) struct Pulses {
    pub(super) frame: SceneFrame,
    /// Whether times are stated.
    pub(super) timed: bool,
    pub(super) chosen: Vec<Chosen>,
    pub(super) antennas: Antennas,
    /// Gaps in the recorded times of the selected block of pulses, and its number of pulses.
    pub(super) gaps: Option<(DefectKind, usize)>,
    /// Motion of a pulsed radar between transmission and reception, unless neglected.
    pub(super) in_flight: Option<InFlight>,
}

impl Pulses {
    /// Rows of the pulse `index` in a channel.
    pub(super) fn rows(&self, recording: &RecordingKeys, index: usize, channel: usize) -> Rows {
        let channel = &self.antennas.channels[channel];
        Rows {
            first: index * recording.sweeps_a_pulse() + channel.transmitter,
            every: *recording.transmitters,
            count: *recording.average,
            receiver: channel.receiver,
        }
    }
}

/// Transmitters and receivers along the track.
pub(super) struct Antennas {
    track: Track,
    pub(super) channels: Vec<Channel>,
}

/// A pair of antennas.
#[derive(Clone, Debug)]
pub(super) struct Channel {
    /// Names of both antennas.
    names: [String; 2],
    /// Index of the transmitter among the alternating ones, and of the receiver among the recorded ones, from 0.
    pub(super) transmitter: usize,
    pub(super) receiver: usize,
    /// Positions on the body, body axes, and patterns.
    pub(super) antennas: [Antenna; 2],
    /// Delay of the transmitter's sweep after that of the pulse, seconds.
    after_s: f64,
    /// Correction of the pair's phase offset and level.
    pub(super) calibration: Complex32,
}

impl Channel {
    /// Description of the channel, with a name like that of a simulated one.
    pub(super) fn about(&self) -> phase_history::Channel {
        let name = format!("T{}R{}", self.transmitter + 1, self.receiver + 1);
        let [transmitter, receiver] = self.names.clone();
        phase_history::Channel::new(name).of_antennas(transmitter, receiver)
    }
}

impl Antennas {
    /// Warnings about the track.
    pub(super) fn warnings(&self) -> &[String] {
        &self.track.warnings
    }

    /// Positions of the antennas of a channel.
    pub(super) fn at_m(&self, channel: usize, time_s: f64) -> [DVec3; 2] {
        let pose = self.track.body.pose(time_s);
        let receiver = self.track.receiver.as_ref();
        let receiver = receiver.map_or(pose, |body| body.pose(time_s));
        let [transmitter_m, receiver_m] =
            (self.channels[channel].antennas.each_ref()).map(|antenna| antenna.offset_m);
        [pose.point_m(transmitter_m), receiver.point_m(receiver_m)]
    }

    /// Attitudes of the bodies that carry transmitter and receiver.
    pub(super) fn attitudes(&self, time_s: f64) -> [DQuat; 2] {
        let attitude = self.track.body.pose(time_s).attitude;
        let receiver = self.track.receiver.as_ref();
        [
            attitude,
            receiver.map_or(attitude, |body| body.pose(time_s).attitude),
        ]
    }
}

/// Selected pulse.
#[derive(Clone, Copy, Debug)]
pub(super) struct Chosen {
    /// Index in the recording, and channel in [`Antennas::channels`].
    pub(super) index: usize,
    pub(super) channel: usize,
    pub(super) time_s: f64,
    /// Positions of transmitter and receiver in metres.
    pub(super) antennas_m: [DVec3; 2],
    /// Whether the platform moves.
    pub(super) moving: bool,
}

/// Half of the interval over which a speed is computed, seconds: long against the noise of a track, short against an
/// acceleration.
const HALF_SPAN_S: f64 = 0.05;

/// Pulses selected by `[recording]` from all `count`, in every channel. `given` overrides the selection, with numbers
/// as in [`super::Take::pulses`].
pub(super) fn select(
    top: &RecordingDescription,
    source: &Source,
    count: usize,
    given: Option<&[usize]>,
) -> Result<Pulses, Fault> {
    let (recording, radar, platform) = (&top.recording, &top.radar, &top.platform);
    let origin = top.scene.origin.as_ref();
    let frame = origin.map_or(SceneFrame::Local, OriginKeys::frame);
    let (times_s, timed) = times(radar, source, count)?;
    let channels = channels(radar, recording, (&times_s, timed), source.folder)?;
    let latest_s = channels.iter().map(|c| c.after_s).fold(0.0, f64::max);
    let ends = times_s
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &t| {
            (low.min(t), high.max(t))
        });
    let ends = (ends.0, ends.1 + latest_s);
    let antennas = Antennas {
        track: track::build((platform, radar), source, &frame, ends, count)?,
        channels,
    };
    let track = &antennas.track;
    let asked = asked(recording, count, antennas.channels.len(), given)?;
    let in_flight = InFlight::of(top)?;
    let least_m_s = recording.moving_above_m_s;
    let only_moving = *recording.pulses == PulsesUsed::Moving;
    let mut chosen = Vec::new();
    for (index, channel) in asked {
        let time_s = times_s[index] + antennas.channels[channel].after_s;
        let tracked = track.is_valid_at(time_s);
        let moving = tracked && speed_m_s(track, time_s) > least_m_s;
        if given.is_none() && only_moving && !moving {
            continue;
        }
        if given.is_none() && !tracked {
            return Err(outside(platform, track, index, time_s));
        }
        chosen.push(Chosen {
            index,
            channel,
            time_s,
            antennas_m: match &in_flight {
                Some(in_flight) => {
                    in_flight.antennas_m(time_s, |time_s| antennas.at_m(channel, time_s))
                }
                None => antennas.at_m(channel, time_s),
            },
            moving,
        });
    }
    let bounded = track.bounded.as_ref().filter(|_| given.is_none());
    if let Some(fault) =
        bounded.and_then(|bounded| chosen.iter().find_map(|pulse| bounded.fault(pulse.time_s)))
    {
        return Err(Fault::new(&platform.header, fault));
    }
    if chosen.is_empty() {
        return Err(recording.pulses.fault(format!(
            "the platform does not move in any pulse from {:.3} to {:.3} s on its clock: check \
                 radar.first_pulse, or lower moving_above",
            ends.0, ends.1
        )));
    }
    Ok(Pulses {
        frame,
        timed,
        chosen,
        antennas,
        gaps: gaps(recording, &times_s),
        in_flight,
    })
}

/// Gaps in the recorded times of the selected block of pulses, and its number of pulses.
fn gaps(recording: &RecordingKeys, times_s: &[f64]) -> Option<(DefectKind, usize)> {
    recording.times.as_ref()?;
    let first = *recording.first;
    let count = recording.count.as_deref().copied().unwrap_or(usize::MAX);
    let block = &times_s[first..times_s.len().min(first.saturating_add(count))];
    Some((DefectKind::gaps(block, first)?, block.len()))
}

/// Index and channel of every selected pulse, before pulses of a platform at rest are left out.
pub(super) fn asked(
    recording: &RecordingKeys,
    count: usize,
    num_channels: usize,
    given: Option<&[usize]>,
) -> Result<Vec<(usize, usize)>, Fault> {
    let first = *recording.first;
    let most = recording.count.as_deref().copied().unwrap_or(usize::MAX);
    if first >= count {
        return Err(recording.first.fault(format!(
            "'first' is {first}, but the last pulse is {}: lower it",
            count - 1
        )));
    }
    if let Some(asked) = &recording.count
        && **asked > count - first
    {
        return Err(asked.fault(
            format!(
                "'count' is {}, but from pulse {first} on there are {}: lower it, or remove it to use all",
                **asked,
                count - first
            ),
        ));
    }
    Ok(match given {
        Some(given) => given
            .iter()
            .map(|label| (label / num_channels, label % num_channels))
            .collect(),
        None => (first..count)
            .take(most)
            .step_by(recording.every)
            .flat_map(|index| (0..num_channels).map(move |channel| (index, channel)))
            .collect(),
    })
}

fn outside(platform: &PlatformKeys, track: &Track, index: usize, time_s: f64) -> Fault {
    if let Some((from, to)) = track.gap_s(time_s) {
        return Fault::new(
            &platform.header,
            format!(
                "pulse {index} at {time_s:.3} s is in a gap of the motion capture from {from:.3} to {to:.3} s: \
                 choose other pulses, or fill the gap in the capture software"
            ),
        );
    }
    let (from, to) = track.span_s.unwrap_or_default();
    Fault::new(
        &platform.header,
        format!(
            "pulse {index} at {time_s:.3} s is outside the track from {from:.3} to {to:.3} s{}: check \
             radar.first_pulse, or choose other pulses",
            if track.bounded.is_some() {
                " (state vectors, and half an interval before and after them)"
            } else {
                ""
            }
        ),
    )
}

/// Times of all pulses on the platform's clock, and whether they are stated.
fn times(radar: &RadarKeys, source: &Source, count: usize) -> Result<(Vec<f64>, bool), Fault> {
    let recording = source.recording;
    let first_s = radar.first_pulse_s;
    let unit_s = recording.times_unit.seconds();
    let given = [&radar.pri_s, &radar.prf_hz]
        .into_iter()
        .find(|key| key.is_some());
    let Some(array) = &recording.times else {
        let known = given.is_some();
        let pri_s = match known {
            true => radar::pri_s(&radar.pri_s, &radar.prf_hz)?,
            false => 1.0,
        };
        let start_s = first_s.unwrap_or(0.0);
        return Ok((
            (0..count).map(|n| start_s + n as f64 * pri_s).collect(),
            known,
        ));
    };
    if let Some(key) = given {
        let what = "[recording] times says when pulses were taken: give either, not both";
        return Err(key.fault(what));
    }
    let times = source.vector(array)?;
    if times.len() != count {
        return Err(array.fault(
            format!(
                "expected {count} times, one per pulse, found {}: check the array, and 'layout', which states what rows and columns \
                 of the samples are",
                times.len()
            ),
        ));
    }
    let on_platforms_clock = |&t: &f64| match first_s {
        // Subtract first: milliseconds since 1970 use most digits of a float64.
        Some(start_s) => start_s + (t - times[0]) * unit_s,
        // Computed exactly as for tracks, so that a track with these times includes all of them.
        None => t * unit_s,
    };
    Ok((times.iter().map(on_platforms_clock).collect(), true))
}

fn speed_m_s(track: &Track, time_s: f64) -> f64 {
    let (from, to) = track.span_s.unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
    let (before, after) = (
        (time_s - HALF_SPAN_S).max(from),
        (time_s + HALF_SPAN_S).min(to),
    );
    let way_m = track
        .body
        .pose(after)
        .position_m
        .distance(track.body.pose(before).position_m);
    way_m / (after - before)
}

/// All antenna pairs in use, grouped by transmitter, in the order of their sweeps.
fn channels(
    radar: &RadarKeys,
    recording: &RecordingKeys,
    (times_s, timed): (&[f64], bool),
    folder: &Path,
) -> Result<Vec<Channel>, Fault> {
    let transmitters = used(
        ("transmitter", "T"),
        &radar.transmitter,
        *recording.transmitters,
        recording.transmitter.as_ref(),
        folder,
    )?;
    let receivers = used(
        ("receiver", "R"),
        &radar.receiver,
        *recording.receivers,
        recording.receiver.as_ref(),
        folder,
    )?;
    let turns = *recording.transmitters as f64;
    let interval_s = match (radar.transmitter_interval_s, times_s) {
        (Some(interval_s), _) => interval_s,
        (None, [first, .., last]) if timed && *recording.average == 1 => {
            (last - first) / (times_s.len() - 1) as f64 / turns
        }
        _ => 0.0,
    };
    let pair = |transmitter: &Used, receiver: &Used| Channel {
        names: [transmitter.name.clone(), receiver.name.clone()],
        transmitter: transmitter.number,
        receiver: receiver.number,
        antennas: [transmitter.antenna.clone(), receiver.antenna.clone()],
        after_s: interval_s * transmitter.number as f64,
        calibration: narrow(transmitter.calibration * receiver.calibration),
    };
    let pairs = transmitters
        .iter()
        .flat_map(|t| receivers.iter().map(move |r| (t, r)));
    Ok(pairs.map(|(t, r)| pair(t, r)).collect())
}

/// Antenna in use.
struct Used {
    /// Index among all antennas of its kind, from 0.
    number: usize,
    name: String,
    antenna: Antenna,
    calibration: Complex64,
}

/// Antennas of a kind that are in use: the selected one, all described ones, or the first.
fn used(
    (kind, letter): (&str, &str),
    sections: &[AntennaKeys],
    count: usize,
    selected: Option<&Located<usize>>,
    folder: &Path,
) -> Result<Vec<Used>, Fault> {
    let plural = format!("{kind}s");
    let given = sections
        .iter()
        .map(|section| (&section.mount, &section.beam));
    let antennas: Vec<Antenna> = radar::antennas_of(given, letter, &tables_in(folder))?;
    if let Some(section) = sections.get(1)
        && sections.len() != count
    {
        return Err(Fault::new(
            &section.header,
            format!(
                "[recording] {plural} is {count}, but there are {} sections [[radar.{kind}]]: describe one, or as many \
                 as there are",
                sections.len()
            ),
        ));
    }
    let one = |number: usize| {
        // A single section describes the antenna in use.
        let section = number.min(antennas.len() - 1);
        let added = sections
            .get(section)
            .map(|keys| (keys.phase_rad, keys.level_db));
        let (phase_rad, level_db) = added.unwrap_or_default();
        Used {
            number,
            name: match section == number {
                true => antennas[section].name.clone(),
                false => format!("{letter}{}", number + 1),
            },
            antenna: antennas[section].clone(),
            calibration: cis(-phase_rad) * libm::pow(10.0, -level_db / 20.0),
        }
    };
    match selected {
        Some(asked) if **asked > count => Err(asked.fault(format!(
            "'{kind}' is {}, but there are {count} {plural}: choose one of them, or raise {plural}",
            **asked
        ))),
        Some(asked) => Ok(vec![one(**asked - 1)]),
        None if sections.len() > 1 => Ok((0..count).map(one).collect()),
        None => Ok(vec![one(0)]),
    }
}
