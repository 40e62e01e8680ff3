//! Channels of the file, and the scene.

use glam::DVec3;

use super::orbit::Orbit;
use super::scene::LookSide;
use super::tree::Tree;
use crate::container::Source;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::{Extent, SceneFrame};
use subaperture_model::phase_history::{Channel, ReadError};

/// One channel: a frequency, a transmitted and a received polarisation.
#[derive(Clone, Debug, PartialEq)]
pub struct L0bChannel {
    /// Frequency and polarisations, such as `A-HV` for frequency A, transmitted H and received V.
    pub name: String,
    /// Transmitted polarisation: H, V, L or R.
    pub tx_polarization: String,
    /// Received polarisation: H or V.
    pub rcv_polarization: String,
    /// Number of pulses, calibration pulses included.
    pub num_pulses: u64,
    /// Samples of each pulse.
    pub num_samples: u64,
    /// Centre frequency (`centerFrequency`), hertz.
    pub centre_hz: f64,
    /// Bandwidth of the channel (`rangeBandwidth`), hertz.
    pub bandwidth_hz: f64,
    /// Sampling rate of complex samples, hertz.
    pub sample_rate_hz: f64,
    /// Slope of the chirp, hertz per second; negative for a falling sweep.
    pub chirp_hz_s: f64,
    /// Duration of the pulse, seconds.
    pub duration_s: f64,
    /// Slant range of sample 0, metres.
    pub first_range_m: f64,
    /// `rangeDelayAdjustment`, seconds; 0 if absent.
    pub delay_adjustment_s: f64,
    /// Path of the group of the transmitted polarisation.
    pub(super) sent: String,
    /// Path of the group of the samples.
    pub(super) received: String,
}

impl L0bChannel {
    /// Description of the channel.
    pub fn about(&self) -> Channel {
        let [tx, rcv] = [&self.tx_polarization, &self.rcv_polarization];
        Channel::new(self.name.clone()).polarized(Some(tx.clone()), Some(rcv.clone()))
    }

    /// Path of the data set of samples.
    pub(super) fn samples(&self) -> String {
        let Self {
            received,
            tx_polarization: tx,
            rcv_polarization: rcv,
            ..
        } = self;
        format!("{received}/{tx}{rcv}")
    }

    /// Distance between samples, metres of slant range.
    fn step_m(&self) -> f64 {
        SPEED_OF_LIGHT_M_S / (2.0 * self.sample_rate_hz)
    }

    /// Slant ranges with complete echoes in the receive window, metres.
    fn complete_m(&self) -> [f64; 2] {
        let pulse_m = 0.5 * SPEED_OF_LIGHT_M_S * self.duration_s;
        let last_m = self.first_range_m + (self.num_samples as f64 - 1.0) * self.step_m();
        [self.first_range_m, last_m - pulse_m]
    }
}

/// Metadata of an L0B file.
#[derive(Clone, Debug, PartialEq)]
pub struct L0bInfo {
    /// Radar: `LSAR` or `SSAR`.
    pub instrument: String,
    /// Name of the mission (`missionId`).
    pub mission: Option<String>,
    /// Side on which the radar looks.
    pub look: LookSide,
    /// Scene frame: origin at the middle of the swath of the first channel.
    pub frame: SceneFrame,
    /// Part of the scene whose echoes are complete, in the scene frame.
    pub extent: Extent,
    /// Channels, sorted by name; at least one.
    pub channels: Vec<L0bChannel>,
}

/// Metadata, with the orbit.
pub(super) struct Parsed {
    pub(super) info: L0bInfo,
    pub(super) orbit: Orbit,
}

impl Parsed {
    /// Read the metadata of a file, with at most `memory_bytes` of memory.
    pub(super) fn read(tree: &Tree, memory_bytes: u64) -> Result<Self, ReadError> {
        let source = tree.source();
        let instrument = instrument(tree)?;
        let root = format!("/science/{instrument}");
        let named = format!("{root}/identification");
        let flag = tree.number(&format!("{named}/diagnosticModeFlag"))?;
        if flag != 0.0 {
            return Err(source.malformed(format!(
                "{named}/diagnosticModeFlag: expected 0 (science mode), found {flag}: in diagnostic modes samples are those of single receivers or \
                 of another band; convert the file to science mode with its producer's tool"
            )));
        }
        let side = tree.text(&format!("{named}/lookDirection"))?;
        let look = match side.to_ascii_lowercase().as_str() {
            "left" => LookSide::Left,
            "right" => LookSide::Right,
            _ => {
                return Err(source.malformed(format!(
                    "{named}/lookDirection: expected left or right, found '{side}'"
                )));
            }
        };
        let products = tree.groups(&root)?;
        if !products.iter().any(|name| name == "RRSD") {
            let others: Vec<&str> = (products.iter().map(String::as_str))
                .filter(|name| *name != "identification")
                .collect();
            return Err(source.malformed(format!(
                "{root}: expected the product RRSD (raw echoes, L0B), found {}: not phase history",
                match others.is_empty() {
                    true => "no product".to_owned(),
                    false => others.join(", "),
                }
            )));
        }
        let root = format!("{root}/RRSD");
        if !(tree.groups(&root)?.iter()).any(|name| name == "lowRateTelemetry") {
            return Err(source.malformed(format!(
                "{root}: expected a group lowRateTelemetry (layout of 2020 and later), found no such group"
            )));
        }
        let orbit = Orbit::read(
            tree,
            &format!("{root}/lowRateTelemetry/orbit"),
            memory_bytes,
        )?;
        let channels = channels(tree, &format!("{root}/swaths"))?;
        let left_bytes = memory_bytes.saturating_sub(orbit.held_bytes());
        let (frame, extent) = scene(tree, &channels[0], &orbit, look, left_bytes)?;
        let mission = format!("{named}/missionId");
        let has_mission = (tree.data_sets(&named)?.iter()).any(|name| name == "missionId");
        let mission = has_mission.then(|| tree.text(&mission)).transpose()?;
        let info = L0bInfo {
            instrument,
            mission: mission.filter(|name| !name.is_empty()),
            look,
            frame,
            extent,
            channels,
        };
        Ok(Self { info, orbit })
    }
}

/// Name of the group of the radar.
fn instrument(tree: &Tree) -> Result<String, ReadError> {
    let groups = tree.groups("/science")?;
    let mut known = (groups.into_iter()).filter(|name| ["LSAR", "SSAR"].contains(&name.as_str()));
    match (known.next(), known.next()) {
        (Some(name), None) => Ok(name),
        (None, _) => Err(tree
            .source()
            .malformed("/science: expected a group LSAR or SSAR, found no such group")),
        (Some(_), Some(_)) => Err(tree
            .source()
            .malformed("/science: expected one of the groups LSAR and SSAR, found both")),
    }
}

/// Letter in the name of a group, if it is an expected one.
fn letter(name: &str, start: &str, allowed: &str) -> Option<String> {
    let rest = name.strip_prefix(start)?;
    (rest.len() == 1 && allowed.contains(rest)).then(|| rest.to_owned())
}

/// Channels below a group, sorted by name.
fn channels(tree: &Tree, swaths: &str) -> Result<Vec<L0bChannel>, ReadError> {
    let mut found = Vec::new();
    for band in tree.groups(swaths)? {
        let Some(frequency) = letter(&band, "frequency", "AB") else {
            continue;
        };
        let band = format!("{swaths}/{band}");
        for sent in tree.groups(&band)? {
            let Some(tx) = letter(&sent, "tx", "HVLR") else {
                continue;
            };
            let sent = format!("{band}/{sent}");
            for received in tree.groups(&sent)? {
                if let Some(rcv) = letter(&received, "rx", "HV") {
                    found.push(channel(tree, &frequency, [&tx, &rcv], &sent)?);
                }
            }
        }
    }
    match found.is_empty() {
        false => Ok(found),
        true => Err(tree.source().malformed(format!(
            "{swaths}: expected groups such as frequencyA/txH/rxH, found no such group"
        ))),
    }
}

fn channel(
    tree: &Tree,
    frequency: &str,
    [tx, rcv]: [&str; 2],
    sent: &str,
) -> Result<L0bChannel, ReadError> {
    let source = tree.source();
    let of = |name: &str| format!("{sent}/{name}");
    let received = of(&format!("rx{rcv}"));
    let samples = format!("{received}/{tx}{rcv}");
    let shape = tree.shape(&samples)?;
    let (num_pulses, num_samples) = match shape[..] {
        [pulses, samples] if pulses > 0 && samples > 0 => (pulses, samples),
        _ => {
            return Err(source.malformed(format!(
                "{samples}: expected samples of shape [pulses, samples], found {shape:?}"
            )));
        }
    };
    let chirp_hz_s = tree.number(&of("chirpSlope"))?;
    if chirp_hz_s == 0.0 {
        return Err(source.malformed(format!(
            "{}: expected a slope other than 0",
            of("chirpSlope")
        )));
    }
    let adjusted = (tree.data_sets(sent)?.iter()).any(|name| name == "rangeDelayAdjustment");
    let adjustment = adjusted.then(|| tree.number(&of("rangeDelayAdjustment")));
    Ok(L0bChannel {
        name: format!("{frequency}-{tx}{rcv}"),
        tx_polarization: tx.to_owned(),
        rcv_polarization: rcv.to_owned(),
        num_pulses,
        num_samples,
        centre_hz: tree.positive(&of("centerFrequency"))?,
        bandwidth_hz: tree.positive(&of("rangeBandwidth"))?,
        sample_rate_hz: SPEED_OF_LIGHT_M_S / (2.0 * tree.positive(&of("slantRangeSpacing"))?),
        chirp_hz_s,
        duration_s: tree.positive(&of("chirpDuration"))?,
        first_range_m: first_range_m(tree, sent, num_samples)?,
        delay_adjustment_s: adjustment.transpose()?.unwrap_or(0.0),
        sent: sent.to_owned(),
        received,
    })
}

/// Slant range of sample 0, from evenly spaced ranges of all samples.
fn first_range_m(tree: &Tree, sent: &str, num_samples: u64) -> Result<f64, ReadError> {
    let path = format!("{sent}/slantRange");
    let step_m = tree.positive(&format!("{sent}/slantRangeSpacing"))?;
    // Bounded by the data set's own size; a window has some ten thousand samples.
    let ranges_m = tree.table(&path, num_samples, 1, MAX_WINDOW_BYTES)?;
    let (first_m, last_m) = (ranges_m[0], ranges_m[ranges_m.len() - 1]);
    let expected_m = first_m + step_m * (num_samples - 1) as f64;
    let even = (last_m - expected_m).abs() <= step_m / 4.0;
    if first_m > 0.0 && even {
        return Ok(first_m);
    }
    Err(tree.source().malformed(format!(
        "{path}: expected positive ranges {step_m} m apart (slantRangeSpacing), found {first_m} m to {last_m} m for {num_samples} samples"
    )))
}

/// Maximum memory for the ranges of a receive window: a million samples, 40 times those of NISAR.
const MAX_WINDOW_BYTES: u64 = 16 << 20;

/// Pulse times of a channel, seconds after the orbit's epoch, with at most `memory_bytes` of memory.
pub(super) fn pulse_times_s(
    tree: &Tree,
    channel: &L0bChannel,
    orbit: &Orbit,
    memory_bytes: u64,
) -> Result<Vec<f64>, ReadError> {
    let sent = &channel.sent;
    let names = tree.data_sets(sent)?;
    // Written in both spellings.
    let name = (names.iter()).find(|name| name.eq_ignore_ascii_case("UTCtime"));
    let name = name.ok_or_else(|| {
        let text = format!("{sent}: expected a data set UTCtime, found no such data set");
        tree.source().malformed(text)
    })?;
    let path = format!("{sent}/{name}");
    let mut times_s = tree.table(&path, channel.num_pulses, 1, memory_bytes)?;
    let epoch = tree.epoch(&path)?;
    let later_s = (i128::from(epoch) - i128::from(orbit.epoch)) as f64 * 1e-9;
    times_s.iter_mut().for_each(|time_s| *time_s += later_s);
    if let Some(at) = times_s.windows(2).position(|pair| pair[0] >= pair[1]) {
        return Err(tree.source().malformed(format!(
            "{path}: expected ascending times, found pulse {} not later than the pulse before it",
            at + 1
        )));
    }
    let [first_s, last_s] = [times_s[0], times_s[times_s.len() - 1]];
    let echo_s = 2.0 * channel.complete_m()[1].max(channel.first_range_m) / SPEED_OF_LIGHT_M_S;
    let [start_s, end_s] = orbit.span_s();
    if first_s < start_s || last_s + echo_s > end_s {
        return Err(tree.source().malformed(format!(
            "{path}: expected pulses and echoes within the orbit's state vectors, {start_s} s to {end_s} s, found {first_s} s to {} s",
            last_s + echo_s
        )));
    }
    Ok(times_s)
}

/// Frame and extent at the middle of a channel's acquisition.
fn scene(
    tree: &Tree,
    channel: &L0bChannel,
    orbit: &Orbit,
    look: LookSide,
    memory_bytes: u64,
) -> Result<(SceneFrame, Extent), ReadError> {
    let source = tree.source();
    let fault = |text: String| source.malformed(format!("{}: {text}", channel.sent));
    let [near_m, far_m] = channel.complete_m();
    if near_m >= far_m {
        return Err(fault(format!(
            "expected a pulse shorter than the receive window, found {:?} s and {} samples at {:?} Hz",
            channel.duration_s, channel.num_samples, channel.sample_rate_hz
        )));
    }
    let times_s = pulse_times_s(tree, channel, orbit, memory_bytes)?;
    let [first_s, last_s] = [times_s[0], times_s[times_s.len() - 1]];
    let ground = |time_s: f64, range_m: f64| {
        let point = look.ground_m(orbit.at(time_s), range_m);
        point.filter(|point| point.is_finite()).ok_or_else(|| {
            fault(format!(
                "expected ranges from the orbit to the ground (WGS 84), found {range_m:?} m at {time_s:?} s"
            ))
        })
    };
    let (middle_s, middle_m) = (first_s.midpoint(last_s), near_m.midpoint(far_m));
    let origin = ground(middle_s, middle_m)?;
    let frame = LookSide::frame(origin, orbit.at(middle_s)[0]);
    let frame = frame
        .filter(SceneFrame::is_sound)
        .ok_or_else(|| fault("expected an orbit that passes the scene at its side".to_owned()))?;
    let at = |time_s: f64, range_m: f64| -> Result<DVec3, ReadError> {
        Ok(frame.from_ecf_m(ground(time_s, range_m)?))
    };
    let [start, end] = [at(first_s, middle_m)?.y, at(last_s, middle_m)?.y];
    let extent = Extent {
        x_m: (at(middle_s, near_m)?.x, at(middle_s, far_m)?.x),
        y_m: (start.min(end), start.max(end)),
    };
    Ok((frame, extent))
}

impl L0bInfo {
    /// Read only the metadata of a file, with at most `memory_bytes` of memory.
    ///
    /// # Errors
    /// [`ReadError::Io`]; [`ReadError::Malformed`] if the file is not an L0B file, or lacks a group or data set that
    /// the [module](super) lists; [`ReadError::Memory`].
    pub fn read(path: impl AsRef<std::path::Path>, memory_bytes: u64) -> Result<Self, ReadError> {
        let tree = Tree::open(Source::open(path.as_ref())?)?;
        Ok(Parsed::read(&tree, memory_bytes)?.info)
    }
}
