//! Coherent sum of the channels of several receivers and transmitters (MIMO).
//!
//! Every term of the sum that formers compute has its own pulse's geometry and frequencies. The image of the pulses
//! of all channels, taken as one collection, is therefore the coherent sum of the channels' images, more precisely
//! their mean, since weights are normalised over all pulses. A unit scatterer has the value 1 as with one channel.
//!
//! **Order.** Channel after channel, each in order of time. Formers assume that consecutive pulses are on a smooth
//! track (sub-CPIs). With alternating channels the antennas would jump at every pulse (sub-CPIs of 2 pulses instead
//! of 15 in `tests/formers/channels.rs`). In this order there is one jump at each change of channel, where formers
//! start a new sub-CPI as between recordings. Times decrease there;
//! [`Collection::num_turns`](super::Collection::num_turns) is the number of pulses per channel, and slow-time windows
//! give pulse `n` of every channel the same weight ([`Weights`](super::Weights)).
//!
//! Channels that cannot be summed are refused: different polarisations, in which a scatterer has different
//! amplitudes, and channels with the same antennas, times and band, which are probably polarisations without names.
//! Other differences of the channels (gain, phase, delay) must be corrected by the recording; the remainder affects
//! the image.

use std::ops::Range;

use glam::DVec3;
use num_complex::Complex32;

use super::channels::check_summable;
use super::{
    Beam, Channel, ChannelError, Channels, Collection, Defect, InputFile, NoBeam, PhaseConvention,
    PhaseHistory, ReadError,
};
use crate::antenna::MountedAntennas;

/// Phase history of the pulses of several channels.
pub struct CoherentSum<'a> {
    channels: Channels<'a>,
    collection: Collection,
    /// True antenna positions, if all channels have them.
    true_antennas: Option<Vec<[DVec3; 2]>>,
}

/// Maximum number of channels in a title.
const MAX_NAMED: usize = 4;

impl<'a> CoherentSum<'a> {
    /// Create the coherent sum of `channels`.
    ///
    /// # Errors
    /// [`ChannelError`] if they differ in samples per pulse or in polarisation, or if two have the same geometry and
    /// band.
    pub fn new(channels: Channels<'a>) -> Result<Self, ChannelError> {
        check_summable(&channels)?;
        let first = channels.channel(0).collection();
        let pulses = (channels.iter()).flat_map(|(_, history)| &history.collection().pulses);
        let truth = channels.iter().map(|(_, history)| history.true_antennas());
        let truth: Option<Vec<&[[DVec3; 2]]>> = truth.collect();
        let collection = Collection {
            name: name(&channels),
            num_samples: first.num_samples,
            pulses: pulses.copied().collect(),
            frame: first.frame,
            extent: first.extent,
            timed: first.timed,
        };
        Ok(Self {
            collection,
            true_antennas: truth.map(|parts| parts.concat()),
            channels,
        })
    }

    /// Channels of the sum.
    pub fn side_by_side(&self) -> &Channels<'a> {
        &self.channels
    }

    /// Memory that the sum of `channels` holds in addition to the channels, bytes.
    pub fn summing_bytes(channels: &Channels) -> u64 {
        let each = channels.iter().map(|(_, history)| {
            let truth = history.true_antennas().map_or(0, size_of_val);
            size_of_val(history.collection().pulses.as_slice()) + truth
        });
        each.sum::<usize>() as u64
    }
}

/// Name of the recording with its channels.
fn name(channels: &Channels) -> String {
    let first = &channels.channel(0).collection().name;
    let mut names = channels.about().map(|about| about.name.as_str());
    let Some(own) = names.next().filter(|_| channels.len() > 1) else {
        return first.clone();
    };
    // Readers append the channel's name to that of the collection.
    let recording = first.strip_suffix(&format!(" channel {own}"));
    let mut named = vec![own];
    named.extend(names.by_ref().take(MAX_NAMED - 1));
    let more = match names.count() {
        0 => String::new(),
        count => format!(" and {count} more"),
    };
    format!(
        "{} channels {}{more}",
        recording.unwrap_or(first),
        named.join(", ")
    )
}

impl PhaseHistory for CoherentSum<'_> {
    fn collection(&self) -> &Collection {
        &self.collection
    }

    fn read(&self, wanted: Range<usize>, mut samples: &mut [Complex32]) -> Result<(), ReadError> {
        assert!(
            wanted.end <= self.collection.pulses.len(),
            "pulses {wanted:?} are beyond the last one"
        );
        let (width, each) = (self.collection.num_samples, self.channels.num_pulses());
        let mut at = wanted.start;
        while at < wanted.end {
            let (channel, from) = (at / each, at % each);
            let to = each.min(from + wanted.end - at);
            let (head, tail) = samples.split_at_mut((to - from) * width);
            self.channels.channel(channel).read(from..to, head)?;
            (samples, at) = (tail, at + to - from);
        }
        assert!(
            samples.is_empty(),
            "more samples than pulses {wanted:?} have"
        );
        Ok(())
    }

    fn true_antennas(&self) -> Option<&[[DVec3; 2]]> {
        self.true_antennas.as_deref()
    }

    fn start_ns(&self) -> Option<i64> {
        self.channels.channel(0).start_ns()
    }

    fn channels(&self) -> Vec<Channel> {
        self.channels.about().cloned().collect()
    }

    /// Antennas of a single channel. Those of several are at different places.
    fn antennas(&self) -> Option<MountedAntennas> {
        match self.channels.about().count() {
            1 => self.channels.channel(0).antennas(),
            _ => None,
        }
    }

    fn stated_beam(&self) -> Result<Option<Beam>, NoBeam> {
        self.channels.channel(0).stated_beam()
    }

    fn phase_conventions(&self) -> Vec<PhaseConvention> {
        self.channels.channel(0).phase_conventions()
    }

    fn warnings(&self) -> Vec<String> {
        let mut all = Vec::new();
        for (_, history) in self.channels.iter() {
            let new = history.warnings().into_iter();
            all.extend(
                new.filter(|warning| !all.contains(warning))
                    .collect::<Vec<_>>(),
            );
        }
        all
    }

    fn defects(&self) -> Vec<Defect> {
        let mut all = Vec::new();
        for defect in (self.channels.iter()).flat_map(|(_, history)| history.defects()) {
            if !all.contains(&defect) {
                all.push(defect);
            }
        }
        all
    }

    fn held_bytes(&self) -> u64 {
        let truth = self.true_antennas.as_deref().map_or(0, size_of_val);
        let own = size_of_val(self.collection.pulses.as_slice()) + truth;
        own as u64 + self.channels.held_bytes()
    }

    fn inputs(&self) -> Result<Vec<InputFile>, ReadError> {
        let mut all: Vec<InputFile> = Vec::new();
        for (_, history) in self.channels.iter() {
            for file in history.inputs()? {
                if !all.iter().any(|known| known.path == file.path) {
                    all.push(file);
                }
            }
        }
        Ok(all)
    }
}
