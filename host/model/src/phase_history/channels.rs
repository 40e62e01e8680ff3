//! Parallel channels of one recording: receivers, transmitters or polarisations.
//!
//! **Shared pulses.** All channels of a [`Channels`] have the same number of pulses in order of time, and pulse `n`
//! of each belongs to the same *turn* (one cycle of transmissions). Receivers record the same echo at the same time;
//! alternating transmitters follow one another within the turn. In recordings with times, no pulse of a turn is later
//! than any pulse of the next turn. The channels share the scene frame. They may differ in antennas, frequencies,
//! number of samples and polarisation.
//!
//! Methods that compare channels (along-track interferometry, motion from several receivers, polarimetry) use pulse
//! `n` of each. Image formers use one channel ([`Channels::channel`]) or the [`CoherentSum`] of all.

use std::collections::{HashMap, HashSet};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::ops::Range;

use super::joined::numbers;
use super::{CoherentSum, Excluding, InMemory, Joined, PhaseHistory, ReadError, misplaced};

/// Description of a channel.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash, serde::Serialize)]
#[non_exhaustive]
pub struct Channel {
    /// Name, unique in the recording.
    pub name: String,
    /// Name of the transmitting antenna, if known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transmitter: Option<String>,
    /// Name of the receiving antenna, if known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub receiver: Option<String>,
    /// Transmitted polarisation, such as `V`, if known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tx_polarization: Option<String>,
    /// Received polarisation, if known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rcv_polarization: Option<String>,
}

impl Channel {
    /// Create a channel from its name.
    pub fn new(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            ..Self::default()
        }
    }

    /// Add the names of its antennas.
    #[must_use]
    pub fn of_antennas(self, transmitter: impl Into<String>, receiver: impl Into<String>) -> Self {
        Self {
            transmitter: Some(transmitter.into()),
            receiver: Some(receiver.into()),
            ..self
        }
    }

    /// Add its polarisations, transmitted and received, if known.
    #[must_use]
    pub fn polarized(self, transmitted: Option<String>, received: Option<String>) -> Self {
        Self {
            tx_polarization: transmitted,
            rcv_polarization: received,
            ..self
        }
    }

    /// Whether the polarisations are equal to those of `other` as far as known.
    fn polarized_as(&self, other: &Self) -> bool {
        let alike = |a: &Option<String>, b: &Option<String>| match (a, b) {
            (Some(a), Some(b)) => a == b,
            _ => true,
        };
        alike(&self.tx_polarization, &other.tx_polarization)
            && alike(&self.rcv_polarization, &other.rcv_polarization)
    }

    /// Transmitted and received polarisation, such as `HV`.
    fn polarization(&self) -> String {
        let letter = |known: &Option<String>| known.clone().unwrap_or_else(|| "?".to_owned());
        letter(&self.tx_polarization) + &letter(&self.rcv_polarization)
    }
}

/// Error of selecting or combining channels.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ChannelError {
    /// No channel was given.
    #[error("no channel given")]
    None,
    /// A name occurs twice.
    #[error("duplicate channel '{name}'")]
    Twice {
        /// Name of the channel.
        name: String,
    },
    /// No channel has this name.
    #[error("unknown channel '{wanted}': expected one of: {}", listed(names))]
    Unknown {
        /// Requested channel.
        wanted: String,
        /// Names of all channels.
        names: Vec<String>,
    },
    /// Channels have different numbers of pulses.
    #[error("channel '{}' has {} pulses, but channel '{}' has {}: expected channels with the same pulses", names[0], counts[0], names[1], counts[1])]
    Pulses {
        /// Names of two such channels.
        names: [String; 2],
        /// Their numbers of pulses.
        counts: [usize; 2],
    },
    /// A pulse is later than the next pulse of another channel.
    #[error("pulse {pulse} of channel '{}' at {} s is later than the next of channel '{}' at {} s: expected channels with the same pulses", names[0], times_s[0], names[1], times_s[1])]
    Moments {
        /// Names of two such channels.
        names: [String; 2],
        /// Pulse index, from 0.
        pulse: usize,
        /// Time of the pulse, and of the other channel's next one, seconds.
        times_s: [f64; 2],
    },
    /// Only one of two channels has times.
    #[error("channel '{}' has times, but channel '{}' does not: expected channels with the same pulses", names[0], names[1])]
    Untimed {
        /// Name of the channel with times, and of the one without.
        names: [String; 2],
    },
    /// Channels have different scene frames.
    #[error("channels '{}' and '{}' have different scene frames", names[0], names[1])]
    Frames {
        /// Names of two such channels.
        names: [String; 2],
    },
    /// Channels to be summed have different numbers of samples.
    #[error("channel '{}' has {} samples per pulse, but channel '{}' has {}: a coherent sum needs equal numbers", names[0], counts[0], names[1], counts[1])]
    Samples {
        /// Names of two such channels.
        names: [String; 2],
        /// Their numbers of samples.
        counts: [usize; 2],
    },
    /// Channels to be summed or joined have different polarisations.
    #[error("channel '{}' is of polarisation {} and channel '{}' of {}: a scatterer answers each of them otherwise, \
        and their sum is no image", names[0], polarizations[0], names[1], polarizations[1])]
    Polarizations {
        /// Names of two such channels.
        names: [String; 2],
        /// Transmitted and received polarisation of each, such as `HV`; `?` if unknown.
        polarizations: [String; 2],
    },
    /// Channels to be summed have the same antennas, times and band in all pulses.
    #[error("channels '{}' and '{}' have the same antennas, times and band in every pulse: their sum has no more information than one of them, \
        or they differ in polarisation, and their sum is no image", names[0], names[1])]
    SameLooks {
        /// Names of both channels.
        names: [String; 2],
    },
    /// Recordings to be joined have different channels.
    #[error("{} has channel '{name}', but {} does not", recordings[0], recordings[1])]
    Missing {
        /// Name of the channel.
        name: String,
        /// Recording with the channel, and one without: file names if known.
        recordings: [String; 2],
    },
}

/// Maximum number of names in a message.
const MAX_NAMED: usize = 20;

/// Names for a message, limited in number.
fn listed(names: &[String]) -> String {
    let first = names[..names.len().min(MAX_NAMED)].join(", ");
    match names.len() {
        count if count > MAX_NAMED => format!("{first} and {} more", count - MAX_NAMED),
        _ => first,
    }
}

/// Index of the channel with the name `wanted`, or otherwise with that number, counted from 1.
///
/// # Errors
/// [`ChannelError::Unknown`].
pub fn which_channel<S: AsRef<str>>(names: &[S], wanted: &str) -> Result<usize, ChannelError> {
    let named = names.iter().position(|name| name.as_ref() == wanted);
    // If names are numbers, a number is a name.
    let numbered = |name: &S| name.as_ref().parse::<usize>().is_ok();
    let number = match names.iter().any(numbered) {
        true => None,
        false => wanted.parse::<usize>().ok(),
    };
    let number = number.filter(|number| (1..=names.len()).contains(number));
    named
        .or(number.map(|number| number - 1))
        .ok_or_else(|| ChannelError::Unknown {
            wanted: wanted.to_owned(),
            names: names.iter().map(|name| name.as_ref().to_owned()).collect(),
        })
}

/// A channel and its pulses.
pub type ChannelHistory<'a> = (Channel, Box<dyn PhaseHistory + 'a>);

/// Channels of one recording with shared pulses, at least one.
pub struct Channels<'a>(Vec<ChannelHistory<'a>>);

impl<'a> Channels<'a> {
    /// Combine channels in this order.
    ///
    /// # Errors
    /// [`ChannelError`] if there are no channels, two have the same name, or they do not share their pulses and the
    /// scene frame.
    pub fn new(channels: Vec<ChannelHistory<'a>>) -> Result<Self, ChannelError> {
        let Some((first, rest)) = channels.split_first() else {
            return Err(ChannelError::None);
        };
        let mut seen = HashSet::new();
        if let Some((twice, _)) = channels.iter().find(|(about, _)| !seen.insert(&about.name)) {
            let name = twice.name.clone();
            return Err(ChannelError::Twice { name });
        }
        for next in rest {
            check_shared(first, next)?;
        }
        check_turns(&channels)?;
        Ok(Self(channels))
    }

    /// Number of channels, at least 1.
    #[allow(clippy::len_without_is_empty)]
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Number of pulses of every channel.
    pub fn num_pulses(&self) -> usize {
        self.0[0].1.collection().pulses.len()
    }

    /// Descriptions of the channels.
    pub fn about(&self) -> impl ExactSizeIterator<Item = &Channel> {
        self.0.iter().map(|(about, _)| about)
    }

    /// Pulses of channel `i`.
    ///
    /// # Panics
    /// Panics if there is no such channel.
    pub fn channel(&self, i: usize) -> &(dyn PhaseHistory + 'a) {
        &*self.0[i].1
    }

    /// All channels with their pulses.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = (&Channel, &(dyn PhaseHistory + 'a))> {
        self.0.iter().map(|(about, history)| (about, &**history))
    }

    /// Index of the channel with this name, or otherwise with this number, counted from 1.
    ///
    /// # Errors
    /// [`ChannelError::Unknown`].
    pub fn find(&self, wanted: &str) -> Result<usize, ChannelError> {
        let names: Vec<&str> = self.about().map(|about| about.name.as_str()).collect();
        which_channel(&names, wanted)
    }

    /// Select these channels in this order, each as by [`Self::find`].
    ///
    /// # Errors
    /// [`ChannelError`] if a channel does not exist or is named twice, or if none is named.
    pub fn select<S: AsRef<str>>(self, wanted: &[S]) -> Result<Self, ChannelError> {
        let places = wanted.iter().map(|wanted| self.find(wanted.as_ref()));
        let places: Vec<usize> = places.collect::<Result<_, _>>()?;
        let named: Vec<String> = places.iter().map(|&i| self.0[i].0.name.clone()).collect();
        let mut held: Vec<Option<ChannelHistory<'a>>> = self.0.into_iter().map(Some).collect();
        let mut chosen = Vec::with_capacity(places.len());
        for (place, name) in places.into_iter().zip(named) {
            chosen.push(held[place].take().ok_or(ChannelError::Twice { name })?);
        }
        match chosen.is_empty() {
            true => Err(ChannelError::None),
            false => Ok(Self(chosen)),
        }
    }

    /// Combine the channels into one history whose image is their coherent sum.
    ///
    /// # Errors
    /// [`ChannelError`] if they differ in samples per pulse or in polarisation, or if two have the same geometry and
    /// band.
    pub fn coherent_sum(self) -> Result<CoherentSum<'a>, ChannelError> {
        CoherentSum::new(self)
    }

    /// Read all pulses of every channel into memory ([`InMemory::copy_of`]).
    ///
    /// # Errors
    /// [`ReadError`] of reading the pulses.
    pub fn in_memory(&self) -> Result<Channels<'static>, ReadError> {
        let read = self.iter().map(|(about, history)| -> Result<_, ReadError> {
            let history: Box<dyn PhaseHistory> = Box::new(InMemory::copy_of(history)?);
            Ok((about.clone(), history))
        });
        Ok(Channels::new(read.collect::<Result<_, _>>()?)?)
    }

    /// Return the channels.
    pub fn into_inner(self) -> Vec<ChannelHistory<'a>> {
        self.0
    }

    /// Memory held in bytes.
    pub fn held_bytes(&self) -> u64 {
        self.0.iter().map(|(_, history)| history.held_bytes()).sum()
    }
}

impl Channels<'static> {
    /// Leave out pulses that are [misplaced](super::misplaced()) in any channel from all channels, so that pulses
    /// still correspond.
    ///
    /// # Errors
    /// [`ReadError::Mismatch`] if no pulse remains.
    pub fn without_misplaced(self) -> Result<Self, ReadError> {
        let histories = self.iter().map(|(_, history)| history.collection());
        let mut left_out: Vec<Range<usize>> = histories.flat_map(misplaced).collect();
        if left_out.is_empty() {
            return Ok(self);
        }
        left_out.sort_by_key(|run| run.start);
        left_out.dedup();
        let mut channels = Vec::with_capacity(self.len());
        for (about, history) in self.into_inner() {
            channels.push((about, Excluding::pulses(history, &left_out)?));
        }
        Ok(Self::new(channels)?)
    }

    /// Maximum additional memory of [`Self::join`] in bytes.
    pub fn joining_bytes(recordings: &[Self]) -> u64 {
        let pulses = |channels: &Self| channels.len() as u64 * channels.num_pulses() as u64;
        match recordings {
            [one] if one.iter().all(|(_, history)| Joined::is_in_order(history)) => 0,
            all => all.iter().map(pulses).sum::<u64>() * Joined::MAX_BYTES_A_PULSE,
        }
    }

    /// Join several recordings channel by channel: each channel is the [`Joined`] of those with its name. The order
    /// of the channels is that of the first recording.
    ///
    /// # Errors
    /// [`ReadError::Channels`] if a recording lacks a channel or has it in another polarisation, or if the joined
    /// channels do not share pulses; [`ReadError::Mismatch`] as [`Joined::join`].
    pub fn join(recordings: Vec<Self>) -> Result<Self, ReadError> {
        let mut recordings = recordings.into_iter();
        let first = recordings.next().ok_or(ChannelError::None)?;
        let mut all: Vec<(Channel, Vec<Box<dyn PhaseHistory>>)> =
            (first.0.into_iter().map(|(about, part)| (about, vec![part]))).collect();
        let label = |part: &dyn PhaseHistory| match part.path() {
            Some(path) => path.display().to_string(),
            None => part.collection().name.clone(),
        };
        let first_label = all
            .first()
            .map_or_else(String::new, |(_, parts)| label(&*parts[0]));
        let missing = |name: &str, recordings: [&String; 2]| ChannelError::Missing {
            name: name.to_owned(),
            recordings: recordings.map(Clone::clone),
        };
        let names = all.iter().enumerate();
        let places: HashMap<String, usize> = names
            .map(|(i, (about, _))| (about.name.clone(), i))
            .collect();
        for (number, recording) in (2..).zip(recordings) {
            let own_label = label(recording.channel(0));
            for (about, part) in recording.0 {
                let place = places.get(&about.name);
                let (own, parts) = &mut all
                    [*place.ok_or_else(|| missing(&about.name, [&own_label, &first_label]))?];
                if !own.polarized_as(&about) {
                    return Err(polarizations(own, &about).into());
                }
                parts.push(part);
            }
            if let Some((about, _)) = all.iter().find(|(_, parts)| parts.len() < number) {
                return Err(missing(&about.name, [&first_label, &own_label]).into());
            }
        }
        let joined = all.into_iter().map(|(about, parts)| {
            let joined: Box<dyn PhaseHistory> = Box::new(Joined::join(parts)?);
            Ok((about, joined))
        });
        Ok(Self::new(joined.collect::<Result<_, ReadError>>()?)?)
    }
}

fn names(a: &Channel, b: &Channel) -> [String; 2] {
    [a.name.clone(), b.name.clone()]
}

fn polarizations(a: &Channel, b: &Channel) -> ChannelError {
    ChannelError::Polarizations {
        names: names(a, b),
        polarizations: [a.polarization(), b.polarization()],
    }
}

/// Refuse two channels with different numbers of pulses, with times in only one, or with different frames.
fn check_shared(a: &ChannelHistory, b: &ChannelHistory) -> Result<(), ChannelError> {
    let (of_a, of_b) = (a.1.collection(), b.1.collection());
    let counts = [of_a.pulses.len(), of_b.pulses.len()];
    if counts[0] != counts[1] {
        return Err(ChannelError::Pulses {
            names: names(&a.0, &b.0),
            counts,
        });
    }
    if of_a.timed != of_b.timed {
        return Err(ChannelError::Untimed {
            names: match of_a.timed {
                true => names(&a.0, &b.0),
                false => names(&b.0, &a.0),
            },
        });
    }
    match of_a.frame.agrees_with(&of_b.frame) {
        true => Ok(()),
        false => Err(ChannelError::Frames {
            names: names(&a.0, &b.0),
        }),
    }
}

/// Refuse channels of which a pulse is later than the next pulse of another.
fn check_turns(channels: &[ChannelHistory]) -> Result<(), ChannelError> {
    if !channels[0].1.collection().timed {
        return Ok(());
    }
    let time_s = |c: usize, n: usize| channels[c].1.collection().pulses[n].time_s;
    let all = 0..channels.len();
    for n in 1..channels[0].1.collection().pulses.len() {
        let by_time =
            |n: usize| move |a: &usize, b: &usize| time_s(*a, n).total_cmp(&time_s(*b, n));
        let last = all.clone().max_by(by_time(n - 1)).unwrap_or(0);
        let first = all.clone().min_by(by_time(n)).unwrap_or(0);
        let times_s = [time_s(last, n - 1), time_s(first, n)];
        if times_s[0] > times_s[1] {
            return Err(ChannelError::Moments {
                names: names(&channels[last].0, &channels[first].0),
                pulse: n - 1,
                times_s,
            });
        }
    }
    Ok(())
}

/// Refuse channels that cannot be summed.
pub(super) fn check_summable(channels: &Channels) -> Result<(), ChannelError> {
    let all = &channels.0;
    let first = &all[0];
    let num_samples = first.1.collection().num_samples;
    if let Some(next) = (all.iter()).find(|(_, c)| c.collection().num_samples != num_samples) {
        return Err(ChannelError::Samples {
            names: names(&first.0, &next.0),
            counts: [num_samples, next.1.collection().num_samples],
        });
    }
    // Compare known polarisations with the first known one.
    let transmitted = channels
        .about()
        .find(|about| about.tx_polarization.is_some());
    let received = channels
        .about()
        .find(|about| about.rcv_polarization.is_some());
    for known in [transmitted, received].into_iter().flatten() {
        if let Some(other) = channels.about().find(|about| !about.polarized_as(known)) {
            return Err(polarizations(known, other));
        }
    }
    let mut hashes: Vec<(u64, usize)> = (0..all.len()).map(|c| (looks(&all[c]), c)).collect();
    hashes.sort_unstable();
    let same = hashes.windows(2).find(|pair| pair[0].0 == pair[1].0);
    match same {
        Some(pair) => Err(ChannelError::SameLooks {
            names: names(&all[pair[0].1].0, &all[pair[1].1].0),
        }),
        None => Ok(()),
    }
}

/// Hash of a channel's antennas, times and bands; the collision probability is 1e-19.
fn looks((_, history): &ChannelHistory) -> u64 {
    let mut hasher = DefaultHasher::new();
    for pulse in &history.collection().pulses {
        (pulse.time_s.to_bits(), numbers(pulse).map(f64::to_bits)).hash(&mut hasher);
    }
    hasher.finish()
}

#[cfg(test)]
mod tests;
