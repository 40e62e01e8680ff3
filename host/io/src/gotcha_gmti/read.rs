//! Phase history of a channel, read on demand.

use std::ops::Range;
use std::path::Path;
use std::sync::{Arc, OnceLock};

use num_complex::Complex32;

use super::geometry::{SAMPLES, collection, displace_receivers, reference_displacements_m};
use super::names::{CHANNELS, Files};
use super::parameters::{Auxiliary, PULSE_BYTES, Positions};
use super::settings::Settings;
use crate::container::{SignalFormat, Source};
use crate::remote;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::phase_history::{
    Channel, ChannelError, Collection, Defect, InputFile, PhaseConvention, PhaseHistory,
    PhaseReference, PhaseSign, Pulse, ReadError, check_finite, pulse_defects, which_channel,
};

/// Bytes of a stored pulse.
const ROW_BYTES: u64 = 8 * SAMPLES as u64;

/// Number of pulses examined for their byte order.
const EXAMINED: usize = 16;

/// Magnitudes of plausible samples other than 0. Of float32 with exchanged bytes and random mantissas a third is within them.
const PLAUSIBLE: Range<f32> = 1e-12..1e12;

/// A channel of a collection of the Gotcha GMTI challenge.
///
/// Opening reads the parameters. Samples are read on demand by positioned reads of at most 1 MiB, so several threads can read from one
/// `GotchaGmti`. Memory: the [`Collection`], and during opening the MATLAB files and 80 bytes per pulse.
pub struct GotchaGmti {
    channel: u8,
    samples: Source,
    parameters: [Arc<Source>; 2],
    collection: Collection,
    warnings: Vec<String>,
    /// Defects of pulses, determined on first use.
    defects: OnceLock<Vec<Defect>>,
}

/// Parameters of all channels.
struct Common {
    files: Files,
    settings: Settings,
    source: Arc<Source>,
    positions: Positions,
}

impl GotchaGmti {
    /// Open a channel by its name, `1` to `3`, or the channel of `path` for `None`, with at most `memory_bytes` of memory.
    ///
    /// # Errors
    /// [`ReadError::Malformed`] for a name that is not that of a channel's samples, a missing file of antenna positions, a file of another size or
    /// content, naming the field; [`ReadError::Channels`] for an unknown channel; [`ReadError::Mismatch`] for offsets of receivers without a
    /// direction of the track; [`ReadError::Memory`]; [`ReadError::Io`].
    pub fn open(
        path: impl AsRef<Path>,
        channel: Option<&str>,
        settings: &Settings,
        memory_bytes: u64,
    ) -> Result<Self, ReadError> {
        let files = files_of(path.as_ref())?;
        let channel = match channel {
            None => files.channel(),
            Some(wanted) => chosen(&CHANNELS, wanted)?,
        };
        let first = samples_of(&files, channel)?;
        let common = Common::open(files, settings, &first, memory_bytes)?;
        common.channel(channel, first, memory_bytes)
    }

    /// Open channels by their names, or all that exist for `None`. Together they use at most `memory_bytes`.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn open_channels<S: AsRef<str>>(
        path: impl AsRef<Path>,
        channels: Option<&[S]>,
        settings: &Settings,
        memory_bytes: u64,
    ) -> Result<Vec<Self>, ReadError> {
        let files = files_of(path.as_ref())?;
        let exists = |channel: &u8| {
            let path = files.samples(*channel);
            remote::url(&path).is_some() || path.exists()
        };
        let present: Vec<u8> = CHANNELS.into_iter().filter(exists).collect();
        let numbers: Vec<u8> = match channels {
            None => present,
            Some(wanted) => {
                let numbers = wanted.iter().map(|name| chosen(&present, name.as_ref()));
                numbers.collect::<Result<_, _>>()?
            }
        };
        let &[first, ..] = &numbers[..] else {
            return Err(ChannelError::None.into());
        };
        let source = samples_of(&files, first)?;
        let common = Common::open(files, settings, &source, memory_bytes)?;
        let mut left_bytes = memory_bytes.saturating_sub(common.held_bytes());
        let mut opened: Vec<Self> = Vec::with_capacity(numbers.len());
        let mut first = Some(source);
        for channel in numbers {
            let source = match first.take() {
                Some(source) => source,
                None => samples_of(&common.files, channel)?,
            };
            let next = common.channel(channel, source, left_bytes)?;
            left_bytes = left_bytes.saturating_sub(next.held_bytes());
            opened.push(next);
        }
        if opened.len() > 1 && settings.receiver_offsets_m.is_none() {
            for one in &mut opened {
                one.warnings.push(format!(
                    "{}: the files do not state the positions of the receivers: all channels are at APCpos until receiver_offset states them",
                    one.collection.name
                ));
            }
        }
        Ok(opened)
    }

    fn pulse_defects(&self) -> &[Defect] {
        self.defects.get_or_init(|| {
            let examined = match self.samples.is_remote() {
                true => Ok(Vec::new()),
                false => pulse_defects(self, &|n| n),
            };
            // A pulse that cannot be read is an error of reading it.
            examined.unwrap_or_default()
        })
    }
}

fn files_of(path: &Path) -> Result<Files, ReadError> {
    Files::of(path).ok_or_else(|| {
        ReadError::malformed(
            path,
            "expected samples of the Gotcha GMTI challenge, PREFIX_chanN_SET_PH with N from 1 to 3, found another name",
        )
    })
}

/// Channel of a name.
fn chosen(present: &[u8], wanted: &str) -> Result<u8, ReadError> {
    let names: Vec<String> = present.iter().map(u8::to_string).collect();
    Ok(present[which_channel(&names, wanted)?])
}

/// Samples of a channel, of whole pulses.
fn samples_of(files: &Files, channel: u8) -> Result<Source, ReadError> {
    let source = Source::open(&files.samples(channel))?;
    let bytes = source.len();
    match bytes > 0 && bytes.is_multiple_of(ROW_BYTES) {
        true => Ok(source),
        false => Err(source.malformed(format!(
            "expected pulses of {SAMPLES} complex float32, a multiple of {ROW_BYTES} bytes, found {bytes} bytes; copy the file again"
        ))),
    }
}

/// Number of pulses of samples, and the reason for it.
fn pulses_of(samples: &Source) -> Result<(usize, String), ReadError> {
    let count = samples.len() / ROW_BYTES;
    let since = format!("{} has {count} pulses", samples.name());
    let count = usize::try_from(count).map_err(|_| samples.malformed("the file is too large"))?;
    Ok((count, since))
}

impl Common {
    /// Open the parameters of all channels for the pulses of `samples`.
    fn open(
        files: Files,
        settings: &Settings,
        samples: &Source,
        memory_bytes: u64,
    ) -> Result<Self, ReadError> {
        let (count, since) = pulses_of(samples)?;
        let source = Positions::open(&files)?;
        let positions = Positions::read(&source, count, &since, memory_bytes)?;
        Ok(Self {
            files,
            settings: *settings,
            source: Arc::new(source),
            positions,
        })
    }

    /// Memory during opening, bytes.
    fn held_bytes(&self) -> u64 {
        PULSE_BYTES * self.positions.ranges_m.len() as u64
    }

    fn channel(
        &self,
        channel: u8,
        samples: Source,
        memory_bytes: u64,
    ) -> Result<GotchaGmti, ReadError> {
        let (count, since) = pulses_of(&samples)?;
        let expected = self.positions.ranges_m.len();
        if count != expected {
            return Err(samples.malformed(format!(
                "expected {expected} pulses as in {}, found {count}; channels have the same pulses",
                self.source.name()
            )));
        }
        let own_bytes = (size_of::<Pulse>() as u64 + PULSE_BYTES).saturating_mul(count as u64);
        samples.check_memory(own_bytes, memory_bytes)?;
        check_byte_order(&samples, count)?;
        let source = Source::open(&self.files.auxiliary(channel))?;
        let auxiliary = Auxiliary::read(&source, count, &since, memory_bytes - own_bytes)?;
        let name = samples.path().file_name().unwrap_or_default();
        let name = name.to_string_lossy().into_owned();
        let prf_hz = self.settings.prf_hz.or(auxiliary.prf_hz);
        let mut collection = collection(name, &auxiliary, &self.positions, prf_hz)
            .map_err(|fault| samples.malformed(fault))?;
        let mut warnings = Vec::new();
        warnings.extend(displaced_swath(&collection));
        if let Some(offsets_m) = self.settings.receiver_offsets_m {
            displace_receivers(&mut collection, offsets_m[usize::from(channel) - 1])
                .map_err(|fault| ReadError::Mismatch(format!("{}: {fault}", samples.name())))?;
        }
        Ok(GotchaGmti {
            channel,
            samples,
            parameters: [Arc::new(source), Arc::clone(&self.source)],
            collection,
            warnings,
            defects: OnceLock::new(),
        })
    }
}

/// Refuse samples of another byte order or number format.
fn check_byte_order(samples: &Source, count: usize) -> Result<(), ReadError> {
    let mut row = vec![Complex32::ZERO; SAMPLES];
    let examined = EXAMINED.min(count);
    let (mut all, mut sound, mut exchanged) = (0, 0, 0);
    for i in 0..examined {
        let n = i * count / examined;
        samples.read_samples(SignalFormat::Cf8, 0, n * SAMPLES, &mut row)?;
        for value in row.iter().flat_map(|z| [z.re, z.im]) {
            let swapped = f32::from_bits(value.to_bits().swap_bytes());
            all += usize::from(value != 0.0);
            sound += usize::from(PLAUSIBLE.contains(&value.abs()));
            exchanged += usize::from(PLAUSIBLE.contains(&swapped.abs()));
        }
    }
    if 2 * sound >= all {
        return Ok(());
    }
    let found = match 10 * exchanged >= 9 * all {
        true => "little-endian float32: exchange the bytes of each value",
        false => "values of implausible magnitude: check the format",
    };
    Err(samples.malformed(format!("expected big-endian float32, found {found}")))
}

/// Warning where the reference range leaves the middle half of the recorded ranges about the scene's origin.
fn displaced_swath(collection: &Collection) -> Option<String> {
    let step_hz = collection.pulses.first()?.step_hz;
    let swath_m = SPEED_OF_LIGHT_M_S / (2.0 * step_hz);
    let [low_m, high_m] = reference_displacements_m(collection);
    (low_m.abs().max(high_m.abs()) > swath_m / 4.0).then(|| {
        format!(
            "{}: the middle of the recorded ranges is {low_m:.1} to {high_m:.1} m beyond the origin, of a swath of {swath_m:.1} m: pixels outside of it are \
             zero; state a grid within the swath",
            collection.name
        )
    })
}

impl PhaseHistory for GotchaGmti {
    fn collection(&self) -> &Collection {
        &self.collection
    }

    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError> {
        assert!(
            pulses.end <= self.collection.pulses.len(),
            "pulses {pulses:?} are beyond the last one"
        );
        assert_eq!(samples.len(), pulses.len() * SAMPLES);
        let first = pulses.start;
        self.samples
            .read_samples(SignalFormat::Cf8, 0, first * SAMPLES, samples)?;
        check_finite(&self.samples.name(), first, SAMPLES, samples)
    }

    fn warnings(&self) -> Vec<String> {
        let defects = self.pulse_defects().iter().map(Defect::warning);
        self.warnings.iter().cloned().chain(defects).collect()
    }

    fn defects(&self) -> Vec<Defect> {
        self.pulse_defects().to_vec()
    }

    fn channels(&self) -> Vec<Channel> {
        vec![Channel::new(self.channel.to_string())]
    }

    fn path(&self) -> Option<&Path> {
        Some(self.samples.path())
    }

    fn phase_conventions(&self) -> Vec<PhaseConvention> {
        vec![PhaseConvention::stated(
            PhaseSign::Minus,
            PhaseReference::Recorded,
        )]
    }

    fn held_bytes(&self) -> u64 {
        let parameters = self.parameters.iter().map(|source| source.held_bytes());
        size_of_val(self.collection.pulses.as_slice()) as u64
            + self.samples.held_bytes()
            + parameters.sum::<u64>()
    }

    fn inputs(&self) -> Result<Vec<InputFile>, ReadError> {
        let files = std::iter::once(&self.samples).chain(self.parameters.iter().map(|f| &**f));
        files.map(Source::input).collect()
    }
}
