//! CPHD files as phase history, read on demand.

use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use glam::DVec3;
use num_complex::Complex32;
use subaperture_fft::{Fft, Transforms};

use super::conventions::{Domain, Sgn};
use super::header::{Block, Header};
use super::metadata::{ChannelInfo, CphdInfo};
use super::preamble::{Preamble, in_xml};
use super::pvp::Layout;
use super::side_by_side;
use super::source::{CHUNK_BYTES, Source};
use super::start;
use super::toa::{Bins, Transform};
use super::vectors::Vectors;
use subaperture_model::phase_history::{
    Channel, Collection, InputFile, PhaseHistory, Pulse, ReadError, check_finite,
};

/// Kept of a vector besides its [`Pulse`], at most: AmpSF, SIGNAL and a shift.
const KEPT_BYTES: u64 = 8 + 1 + 8;

/// Bytes a sample of the plan that transforms a TOA vector, and of one vector being transformed: up
/// to eight complex float64 each where the length has large prime factors.
const TRANSFORM_BYTES: u64 = 2 * 8 * 16;

/// One channel of a CPHD file.
///
/// Opening reads the header, the XML and the channel's PVP; samples are read when asked for, by
/// positioned reads of at most 1 MiB (or one vector in the TOA domain), so one `Cphd` can
/// be read from many threads. Memory: the [`Collection`], up to 17 bytes a
/// vector, 48 more with true positions, and in the TOA
/// domain the plan of the transform, about 256 bytes for each sample of one vector.
///
/// - Samples are `AmpSF` times the stored value where there is an `AmpSF`; vectors whose `SIGNAL`
///   is 0 are delivered as zeros whatever is stored.
/// - TOA vectors of `N` samples are delivered at the frequencies `fx_C + m / (N SCSS)`,
///   `fx_C = (FX1 + FX2) / 2`, with integer `m` such that `FX1 <= f < FX2`: as many as the band is
///   wide in steps of `1 / (N SCSS)`, which must be the same number in every vector. The transform
///   is in float64 and exact but for the float32 of the stored samples.
/// - `SGN = +1` samples are conjugated.
/// - Added parameters `TxPosTrue` and `RcvPosTrue`, as [`write`](super::write()) makes them, are the
///   true positions of the antennas.
/// - Where `aFRR2` is given, samples were taken one after another, at a rate of `2 / (c aFRR2)` hertz a second
///   ([`Sweep`](subaperture_model::phase_history::Sweep)); velocities are `TxVel` and `RcvVel`, accelerations the slope of these from vector to vector.
/// - `reference_path_m` is the path by way of `SRPPos`, of the positions as stored: what they were rounded to (1e-9 m
///   as float64 in ECF, more if they were float32 once) cancels in differences of paths. See the [module](super)
///   for the atmosphere.
pub struct Cphd {
    container: Arc<Container>,
    channel: usize,
    collection: Collection,
    /// Where the channel's samples begin.
    signal_offset: u64,
    /// Samples a vector as stored.
    stored_samples: usize,
    /// AmpSF of every vector, if the file has it.
    amp_sf: Option<Vec<f64>>,
    /// Whether each vector has signal, if any has none.
    has_signal: Option<Vec<bool>>,
    arrival: Option<Arrival>,
    /// True positions of the antennas, if the file has them.
    true_antennas: Option<Vec<[DVec3; 2]>>,
    held_bytes: u64,
}

/// What the channels of a file share.
struct Container {
    source: Source,
    header: Header,
    info: CphdInfo,
    layout: Layout,
}

impl Container {
    fn open(path: &Path, memory_bytes: u64) -> Result<Self, ReadError> {
        let source = Source::open(path)?;
        let Preamble {
            header,
            info,
            layout,
            xml_offset,
        } = Preamble::read(&source, memory_bytes)?;
        let layout = layout.map_err(|e| source.malformed(in_xml(&e, xml_offset)))?;
        Ok(Self {
            source,
            header,
            info,
            layout,
        })
    }

    fn check_readable(&self) -> Result<(), ReadError> {
        check_readable(&self.info, &self.layout, &self.header)
            .map_err(|what| self.source.malformed(what))
    }
}

/// What it takes to turn TOA vectors into FX vectors.
struct Arrival {
    bins: Bins,
    fft: Arc<dyn Fft<f64>>,
    /// `SC0 / (N SCSS)` of every vector.
    shifts: Vec<f64>,
}

impl Cphd {
    /// Opens channel `channel`, or the file's reference channel, holding at most `memory_bytes`.
    ///
    /// # Errors
    /// [`ReadError::Io`] if the file cannot be read, [`ReadError::Malformed`] if it is not CPHD, is
    /// cut short, lacks what is needed, or has no such channel; the text says where.
    /// [`ReadError::Memory`] before more is taken than allowed.
    pub fn open(
        path: impl AsRef<Path>,
        channel: Option<&str>,
        memory_bytes: u64,
    ) -> Result<Self, ReadError> {
        let container = Container::open(path.as_ref(), memory_bytes)?;
        let chosen = container.info.channel(channel);
        let chosen = chosen.map_err(|what| container.source.malformed(what))?;
        container.check_readable()?;
        Self::of(Arc::new(container), chosen, memory_bytes)
    }

    /// Opens these channels, each by its identifier or its number from 1, or all, side by side: the file is opened once.
    /// Together they hold at most `memory_bytes`.
    ///
    /// # Errors
    /// As [`Self::open`]; [`ReadError::Channels`] if the file has no such channel.
    pub fn open_channels<S: AsRef<str>>(
        path: impl AsRef<Path>,
        channels: Option<&[S]>,
        memory_bytes: u64,
    ) -> Result<Vec<Self>, ReadError> {
        let container = Arc::new(Container::open(path.as_ref(), memory_bytes)?);
        let infos = &container.info.channels;
        let ids: Vec<&str> = infos.iter().map(|info| info.id.as_str()).collect();
        let chosen = side_by_side::chosen(&ids, channels)?;
        container.check_readable()?;
        let open = |channel, left_bytes| Self::of(Arc::clone(&container), channel, left_bytes);
        side_by_side::opened(chosen, memory_bytes, open, |one| one.held_bytes)
    }

    fn of(container: Arc<Container>, channel: usize, memory_bytes: u64) -> Result<Self, ReadError> {
        let Container {
            source,
            header,
            info,
            layout,
            ..
        } = &*container;
        let chosen = &info.channels[channel];
        let pvp_offset = header.pvp.offset + chosen.pvp_offset;
        let signal_offset = header.signal.offset + chosen.signal_offset;
        let too_large = || source.malformed(format!("channel '{}' is too large", chosen.id));
        let stored_samples = usize::try_from(chosen.num_samples).map_err(|_| too_large())?;
        let num_vectors = usize::try_from(chosen.num_vectors).map_err(|_| too_large())?;

        let held_bytes = held_bytes(chosen, info.domain, layout);
        let records = chosen.num_vectors.saturating_mul(layout.num_bytes);
        source.check_memory(
            held_bytes.saturating_add(records.min(CHUNK_BYTES as u64)),
            memory_bytes,
        )?;

        let mut vectors = Vectors::to_be_read(info, stored_samples);
        vectors
            .reserve(num_vectors, layout)
            .map_err(|_| too_large())?;
        let width = usize::try_from(layout.num_bytes).map_err(|_| too_large())?;
        source.read_records("PVP", pvp_offset, num_vectors, width, |index, record| {
            let vector = layout.decode(index, record, info.domain)?;
            vectors.push(index, &vector)
        })?;
        vectors.set_accelerations();

        let arrival = vectors.bins.map(|bins| Arrival {
            bins,
            fft: Transforms::Portable.forward(stored_samples),
            shifts: vectors.shifts,
        });
        let collection = Collection {
            name: collection_name(info, chosen, source.path()),
            num_samples: vectors.bins.map_or(stored_samples, |b| b.count),
            pulses: vectors.pulses,
            frame: info.frame,
            extent: Some(info.image_area),
            timed: true,
        };
        Ok(Self {
            channel,
            collection,
            signal_offset,
            stored_samples,
            amp_sf: layout.has_amp_sf().then_some(vectors.amp_sf),
            has_signal: vectors
                .has_signal
                .contains(&false)
                .then_some(vectors.has_signal),
            arrival,
            true_antennas: layout.has_true_antennas().then_some(vectors.true_antennas),
            held_bytes,
            container,
        })
    }

    /// The metadata of the file.
    pub fn info(&self) -> &CphdInfo {
        &self.container.info
    }

    /// All channels of the file.
    pub fn channels(&self) -> &[ChannelInfo] {
        &self.info().channels
    }

    /// The channel that was opened.
    pub fn channel(&self) -> &ChannelInfo {
        &self.info().channels[self.channel]
    }

    /// Reads stored samples, as they are but for the format, from flat index `first` on.
    fn read_stored(&self, first: usize, samples: &mut [Complex32]) -> Result<(), ReadError> {
        let source = &self.container.source;
        source.read_samples(
            self.info().signal_format,
            self.signal_offset,
            first,
            samples,
        )
    }

    /// Scales, conjugates and checks stored vectors from `first` on.
    fn condition(&self, first: usize, samples: &mut [Complex32]) -> Result<(), ReadError> {
        let width = self.stored_samples;
        for (i, vector) in samples.chunks_exact_mut(width).enumerate() {
            if let Some(has_signal) = &self.has_signal
                && !has_signal[first + i]
            {
                vector.fill(Complex32::ZERO);
            } else if let Some(amp_sf) = &self.amp_sf {
                let scale = amp_sf[first + i];
                for z in vector.iter_mut() {
                    z.re = (f64::from(z.re) * scale) as f32;
                    z.im = (f64::from(z.im) * scale) as f32;
                }
            }
        }
        if self.info().sgn == Sgn::Plus {
            for z in samples.iter_mut() {
                *z = z.conj();
            }
        }
        check_finite(&self.container.source.name(), first, width, samples)
    }
}

impl PhaseHistory for Cphd {
    fn collection(&self) -> &Collection {
        &self.collection
    }

    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError> {
        assert!(
            pulses.end <= self.collection.pulses.len(),
            "pulses {pulses:?} are past the last one"
        );
        assert_eq!(samples.len(), pulses.len() * self.collection.num_samples);
        let width = self.stored_samples;
        let Some(arrival) = &self.arrival else {
            self.read_stored(pulses.start * width, samples)?;
            return self.condition(pulses.start, samples);
        };
        let mut transform = Transform::new(arrival.bins, Arc::clone(&arrival.fft));
        let mut toa = vec![Complex32::ZERO; width];
        for (pulse, fx) in pulses.zip(samples.chunks_exact_mut(arrival.bins.count)) {
            self.read_stored(pulse * width, &mut toa)?;
            self.condition(pulse, &mut toa)?;
            transform.frequency(&toa, arrival.shifts[pulse], fx);
            // A sum of finite float32 may still pass the largest float32.
            check_finite(&self.container.source.name(), pulse, fx.len(), fx)?;
        }
        Ok(())
    }

    fn true_antennas(&self) -> Option<&[[DVec3; 2]]> {
        self.true_antennas.as_deref()
    }

    fn start_ns(&self) -> Option<i64> {
        start::nanoseconds(self.info().collection_start.as_deref()?)
    }

    fn channels(&self) -> Vec<Channel> {
        vec![self.channel().about()]
    }

    fn held_bytes(&self) -> u64 {
        self.held_bytes
    }

    fn inputs(&self) -> Result<Vec<InputFile>, ReadError> {
        Ok(vec![self.container.source.input()?])
    }
}

/// Checks that the samples of all channels can be read and lie within their blocks.
fn check_readable(info: &CphdInfo, layout: &Layout, header: &Header) -> Result<(), String> {
    if let Some(name) = &info.compression {
        return Err(format!(
            "the signal arrays are compressed ('{name}'); only uncompressed CI2, CI4 and CF8 \
             are read: decompress the file with its producer's tool"
        ));
    }
    for entry in &info.channels {
        check_extent(info, entry, layout, &header.pvp, &header.signal)?;
    }
    Ok(())
}

/// Bytes that a channel holds while it is open.
fn held_bytes(channel: &ChannelInfo, domain: Domain, layout: &Layout) -> u64 {
    let transformed = match domain {
        Domain::Fx => 0,
        Domain::Toa => channel.num_samples,
    };
    let truth_bytes = if layout.has_true_antennas() {
        size_of::<[DVec3; 2]>() as u64
    } else {
        0
    };
    (channel.num_vectors)
        .saturating_mul(size_of::<Pulse>() as u64 + KEPT_BYTES + truth_bytes)
        .saturating_add(transformed.saturating_mul(TRANSFORM_BYTES))
}

/// Whether a channel's arrays lie within their blocks, without overflow.
fn check_extent(
    info: &CphdInfo,
    channel: &ChannelInfo,
    layout: &Layout,
    pvp: &Block,
    signal: &Block,
) -> Result<(), String> {
    let check = |name: &str, element: &str, offset: u64, size: Option<u64>, block: &Block| {
        let end = size.and_then(|size| offset.checked_add(size));
        match end {
            Some(end) if end <= block.size => Ok(()),
            _ => Err(format!(
                "channel '{}': its {name} array ({} vectors of {} samples, CPHD/Data/Channel/\
                 {element} {offset}) does not fit the {name} block of {} bytes at byte {}; the \
                 XML is damaged",
                channel.id, channel.num_vectors, channel.num_samples, block.size, block.offset
            )),
        }
    };
    let pvp_size = channel.num_vectors.checked_mul(layout.num_bytes);
    check(
        "PVP",
        "PVPArrayByteOffset",
        channel.pvp_offset,
        pvp_size,
        pvp,
    )?;
    let signal_size = channel
        .num_vectors
        .checked_mul(channel.num_samples)
        .and_then(|n| n.checked_mul(info.signal_format.sample_bytes() as u64));
    check(
        "signal",
        "SignalArrayByteOffset",
        channel.signal_offset,
        signal_size,
        signal,
    )
}

/// CoreName, or else the file's name; with the channel where there are several.
fn collection_name(info: &CphdInfo, channel: &ChannelInfo, path: &Path) -> String {
    let file = || path.file_name().map(|n| n.to_string_lossy().into_owned());
    let name = info.core_name.clone().filter(|n| !n.is_empty());
    let name = name.or_else(file).unwrap_or_default();
    if info.channels.len() > 1 {
        format!("{name} channel {}", channel.id)
    } else {
        name
    }
}
