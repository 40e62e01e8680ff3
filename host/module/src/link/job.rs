//! Work of a module: settings, patches, and pulses in the module's encoding.
//!
//! **Scale.** 16-bit samples are the recording's samples times `scale`, one factor for the whole recording, chosen so that the
//! largest part of any sample is 32766 of 32768: the full range without the value that indicates clipping. Maps are too large
//! by `scale`, and image formation divides by it.
//!
//! **Channels.** With `C` channels, pulse `n` of channel `c` is sent as number `n C + c`, with the antennas of its channel.
//!
//! **Cost**: one pass over the recording to find the scale; 64 pulses of each channel in memory.

use num_complex::Complex32;
use subaperture_core::dpca::Dpca;
use subaperture_core::link::{Encoding, write_complex32s, write_sc16s};
use subaperture_core::stream::{MapHeader, Patch, Setup};
use subaperture_core::{Pulse, Sc16};

use subaperture_model::phase_history::{self, PhaseHistory, ReadError};

/// Number of pulses read at a time.
const BLOCK_PULSES: usize = 64;

/// Largest part of a scaled sample.
const LARGEST: f32 = 32766.0 / 32768.0;

/// Work of a module.
pub struct Job<'a> {
    /// Settings of the stream processor, with as many channels as the pulses.
    pub setup: Setup,
    /// Fast-time window weights, one per frequency. They sum to 1.
    pub fast_weights: Vec<f32>,
    /// Patches.
    pub patches: Vec<Patch>,
    /// Pulses.
    pub pulses: PulseSource<'a>,
}

impl<'a> Job<'a> {
    /// Number of sub-CPIs, including a last one with fewer pulses.
    pub fn num_sub_cpis(&self) -> u32 {
        self.wanted().num_sub_cpis()
    }

    /// Maps expected from a job.
    pub(super) fn wanted(&self) -> Wanted<'a> {
        let num_channels = self.pulses.channels.len();
        assert_eq!(
            usize::from(self.setup.num_channels),
            num_channels,
            "channels of the setup and of the pulses"
        );
        Wanted {
            num_numbers: self.setup.numbers_per_sub_cpi().max(1),
            num_channels,
            patches: self.patches.clone(),
            pulses: &self.pulses.channels[0].collection().pulses,
        }
    }
}

/// Expected maps: one per patch and sub-CPI.
pub(super) struct Wanted<'a> {
    /// Pulse numbers per sub-CPI.
    num_numbers: u32,
    pub(super) num_channels: usize,
    pub(super) patches: Vec<Patch>,
    /// Pulses of the first channel.
    pulses: &'a [phase_history::Pulse],
}

impl Wanted<'_> {
    /// No expected maps, for a session without a job.
    pub(super) fn empty() -> Self {
        Self {
            num_numbers: 1,
            num_channels: 1,
            patches: Vec::new(),
            pulses: &[],
        }
    }

    /// Number of sub-CPIs, including a last one with fewer pulses.
    pub(super) fn num_sub_cpis(&self) -> u32 {
        self.end().div_ceil(self.num_numbers)
    }

    /// Number after that of the last pulse.
    fn end(&self) -> u32 {
        (self.pulses.len() * self.num_channels) as u32
    }

    /// Total number of maps.
    pub(super) fn num_maps(&self) -> u64 {
        u64::from(self.num_sub_cpis()) * self.patches.len() as u64
    }

    /// Number of the first pulse of sub-CPI `n`. Beyond the last one, the number of pulses.
    pub(super) fn first_pulse(&self, n: u32) -> u32 {
        n.saturating_mul(self.num_numbers).min(self.end())
    }

    /// First sub-CPI that begins at or after pulse `number`.
    pub(super) fn sub_cpi_from(&self, number: u32) -> u32 {
        number.div_ceil(self.num_numbers)
    }

    /// Whether there is a map of this sub-CPI and patch.
    pub(super) fn has(&self, (sub_cpi, patch): (u32, u16)) -> bool {
        sub_cpi < self.num_sub_cpis() && usize::from(patch) < self.patches.len()
    }

    /// Whether a map with this header is expected. Maps are of one channel.
    pub(super) fn asks_for(&self, header: &MapHeader) -> bool {
        if header.sub_cpi >= self.num_sub_cpis() {
            return false;
        }
        let first = self.first_pulse(header.sub_cpi) as usize;
        let end = self.first_pulse(header.sub_cpi + 1) as usize;
        let times_s = [self.pulses[first].time_s, self.pulses[end - 1].time_s];
        self.patches.get(usize::from(header.patch_index)) == Some(&header.patch)
            && usize::from(header.num_pulses) == end - first
            && header.time_s == times_s
    }
}

/// Pulses of a recording, encoded for the link.
pub struct PulseSource<'a> {
    channels: Vec<&'a dyn PhaseHistory>,
    slow_weights: Vec<f32>,
    /// Clutter cancellation whose weights replace the slow-time weights, and number of pulses of a sub-CPI.
    displaced: Option<(Dpca, u16)>,
    encoding: Encoding,
    /// Whether the samples come from the front end of the module, and the recording provides the geometry only.
    from_front_end: bool,
    scale: f32,
    /// Samples of some pulses, `[channel][pulse]`, and the first and the number of these pulses.
    block: Vec<Complex32>,
    first: usize,
    count: usize,
    bytes: Vec<u8>,
    clamped: u64,
}

impl<'a> PulseSource<'a> {
    /// Create a source of the pulses of `channels`, which share their pulses ([`Channels`]), with slow-time weights, one per pulse.
    /// For [`Encoding::Sc16`] the recording is read once to find its scale.
    ///
    /// # Errors
    /// [`ReadError`] if the recording cannot be read, there is no channel, channels differ in their number of pulses or samples,
    /// or the number of weights differs from the number of pulses.
    ///
    /// [`Channels`]: subaperture_model::phase_history::Channels
    pub fn new(
        channels: &[&'a dyn PhaseHistory],
        slow_weights: &[f64],
        encoding: Encoding,
    ) -> Result<Self, ReadError> {
        let sizes = |history: &dyn PhaseHistory| {
            let collection = history.collection();
            (collection.pulses.len(), collection.num_samples)
        };
        let Some(first) = channels.first() else {
            return Err(ReadError::Mismatch("no channel given".to_owned()));
        };
        let collection = first.collection();
        let count = collection.pulses.len();
        for other in channels {
            if sizes(*other) != sizes(*first) {
                let ((count, samples), (other_count, other_samples)) =
                    (sizes(*first), sizes(*other));
                return Err(ReadError::Mismatch(format!(
                    "{}: expected {count} pulses of {samples} samples as in the first channel, found {other_count} of \
                     {other_samples}",
                    other.collection().name
                )));
            }
        }
        if slow_weights.len() != count || u32::try_from(count * channels.len()).is_err() {
            return Err(ReadError::Mismatch(format!(
                "{}: slow-time weights: expected one per pulse ({count}), found {}",
                collection.name,
                slow_weights.len()
            )));
        }
        let mut source = Self {
            channels: channels.to_vec(),
            slow_weights: slow_weights.iter().map(|&weight| weight as f32).collect(),
            displaced: None,
            encoding,
            from_front_end: false,
            scale: 1.0,
            block: Vec::new(),
            first: 0,
            count: 0,
            bytes: vec![0; encoding.sample_bytes() * collection.num_samples],
            clamped: 0,
        };
        if encoding == Encoding::Sc16 {
            let mut largest = 0.0f32;
            for first in (0..count).step_by(BLOCK_PULSES) {
                source.load(first)?;
                let parts = source.block.iter().flat_map(|z| [z.re.abs(), z.im.abs()]);
                largest = parts.fold(largest, f32::max);
            }
            let scale = LARGEST / largest;
            // A recording that is zero or almost zero is not scaled.
            source.scale = if scale.is_finite() && scale > 0.0 {
                scale
            } else {
                1.0
            };
        }
        Ok(source)
    }

    /// Create a source of geometry for pulses whose samples come from the front end of the module, with slow-time weights, one
    /// per pulse. The samples of the recording are not read.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn from_front_end(
        channels: &[&'a dyn PhaseHistory],
        slow_weights: &[f64],
    ) -> Result<Self, ReadError> {
        // In this encoding no scale is searched.
        let source = Self::new(channels, slow_weights, Encoding::Complex32)?;
        Ok(Self {
            encoding: Encoding::Sc16,
            from_front_end: true,
            ..source
        })
    }

    /// Replace the slow-time weights by those of a clutter cancellation, in sub-CPIs of `num_pulses` pulses ([`Dpca::weight`]).
    #[must_use]
    pub fn displaced(self, dpca: &Dpca, num_pulses: u16) -> Self {
        Self {
            displaced: Some((*dpca, num_pulses.max(1))),
            ..self
        }
    }

    /// Slow-time weight of a pulse in a channel.
    fn slow_weight(&self, index: usize, channel: usize) -> f32 {
        let Some((dpca, num_pulses)) = &self.displaced else {
            return self.slow_weights[index];
        };
        let place = index % usize::from(*num_pulses);
        let rest = self.slow_weights.len() - (index - place);
        let count = rest.min(usize::from(*num_pulses));
        dpca.weight(channel as u16, place as u16, count as u16)
    }

    /// Whether the samples come from the front end of the module.
    pub fn is_from_front_end(&self) -> bool {
        self.from_front_end
    }

    /// Channels of the recording.
    pub(super) fn channels(&self) -> &[&'a dyn PhaseHistory] {
        &self.channels
    }

    /// Number of pulses, counted once per channel.
    pub fn len(&self) -> u32 {
        (self.slow_weights.len() * self.channels.len()) as u32
    }

    /// Whether there are no pulses.
    pub fn is_empty(&self) -> bool {
        self.slow_weights.is_empty()
    }

    /// Factor applied to the samples; 1 in floating point.
    pub fn amplitude_scale(&self) -> f32 {
        self.scale
    }

    /// Encoding of the samples.
    pub fn encoding(&self) -> Encoding {
        self.encoding
    }

    /// Sum of the given slow-time weights of all pulses of a channel.
    pub fn weight_sum(&self) -> f64 {
        self.slow_weights
            .iter()
            .map(|&weight| f64::from(weight))
            .sum()
    }

    /// Number of sample parts clamped so far.
    pub(super) fn clamped(&self) -> u64 {
        self.clamped
    }

    /// Read the block of all channels that begins with pulse `first`.
    fn load(&mut self, first: usize) -> Result<(), ReadError> {
        let collection = self.channels[0].collection();
        let end = (first + BLOCK_PULSES).min(collection.pulses.len());
        let each = (end - first) * collection.num_samples;
        self.count = 0;
        self.block.clear();
        self.block
            .resize(each * self.channels.len(), Complex32::ZERO);
        let parts = self.block.chunks_exact_mut(each.max(1));
        for (channel, part) in self.channels.iter().zip(parts) {
            channel.read(first..end, part)?;
        }
        self.first = first;
        self.count = end - first;
        Ok(())
    }

    /// Metadata and encoded samples of pulse `number`, counted from 0. No samples if they come from the front end.
    ///
    /// # Errors
    /// [`ReadError`] if the pulse cannot be read.
    ///
    /// # Panics
    /// Panics if `number` is out of range.
    pub fn pulse(&mut self, number: u32) -> Result<(Pulse, &[u8]), ReadError> {
        let (index, channel) = (
            number as usize / self.channels.len(),
            number as usize % self.channels.len(),
        );
        let collection = self.channels[channel].collection();
        let about = &collection.pulses[index];
        let pulse = Pulse {
            number,
            time_s: about.time_s,
            transmitter_m: about.transmitter_m.to_array(),
            receiver_m: about.receiver_m.to_array(),
            reference_path_m: about.reference_path_m,
            weight: self.slow_weight(index, channel),
        };
        if self.from_front_end {
            return Ok((pulse, &[]));
        }
        let width = collection.num_samples;
        if !(self.first..self.first + self.count).contains(&index) {
            self.load(index - index % BLOCK_PULSES)?;
        }
        let start = (channel * self.count + index - self.first) * width;
        let samples = &self.block[start..start + width];
        let bytes = match self.encoding {
            Encoding::Complex32 => write_complex32s(samples, &mut self.bytes),
            Encoding::Sc16 => {
                let narrow: Vec<Sc16> = samples
                    .iter()
                    .map(|&sample| {
                        let (narrow, clamped) = Sc16::from_complex32(sample * self.scale);
                        self.clamped += u64::from(clamped);
                        narrow
                    })
                    .collect();
                write_sc16s(&narrow, &mut self.bytes)
            }
        };
        Ok((pulse, bytes.expect("the buffer has the length of a pulse")))
    }
}
