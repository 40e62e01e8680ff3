//! Phase history from CRSD files, read on demand.

use std::ops::Range;
use std::path::Path;
use std::sync::{Arc, OnceLock};

use num_complex::Complex32;

use super::echoes::{KEPT_BYTES, Stored, Vectors};
use super::header::Header;
use super::metadata::{CrsdChannel, CrsdInfo, Parsed, Sequence, parse};
use super::pulses::Sent;
use super::{pulses, vectors};
use crate::container::channels::{Table, history_name, open_one, open_several};
use crate::container::lines::{in_xml, read_xml};
use crate::container::{CHUNK_BYTES, ChannelFile, FileChannel, Source};
use crate::date;
use crate::raw_check::stored;
use crate::raw_check::{Named, Report};
use crate::receive::{Compressed, Echoes, Filter};
use crate::xml::DEFAULT_MEMORY_BYTES;
use subaperture_model::phase_history::{
    Channel, Collection, Defect, DefectKind, InputFile, PhaseConvention, PhaseHistory,
    PhaseReference, PhaseSign, Pulse, ReadError, check_finite,
};

/// Bytes per sample for the transform plan and one vector being transformed, as for CPHD.
const TRANSFORM_BYTES: u64 = 2 * 8 * 16;

/// Channel of a `CRSDsar` file as phase history: its echoes, each divided by the spectrum of its pulse.
///
/// Opening reads the header, the XML, the pulses of the channel's transmit sequence and the channel's vectors.
/// Samples are read on demand, so several threads can read from one `Crsd`. Memory: the [`Collection`], about 300
/// bytes per vector, and the transform plan, about 256 bytes per sample of one vector.
///
/// [`PhaseHistory::warnings`] and [`PhaseHistory::defects`] examine the samples as stored on the first call: evenly spaced vectors, at most
/// 4 million samples or 32 vectors, whichever is more. Files at URLs are not examined, because their bytes would be transferred.
pub struct Crsd {
    container: Arc<Container>,
    channel: usize,
    compressed: Compressed<Vectors>,
    held_bytes: u64,
    /// Warnings and defects, determined on first use.
    report: OnceLock<Report>,
}

/// State shared by the channels of a file.
pub(crate) struct Container {
    source: Arc<Source>,
    header: Header,
    info: CrsdInfo,
    pulses: pulses::Layout,
    vectors: vectors::Layout,
}

impl CrsdInfo {
    /// Read only the header and the XML of a `CRSDsar` file.
    ///
    /// # Errors
    /// [`ReadError::Io`]; [`ReadError::Malformed`] if it is not CRSD, is of another kind, is truncated, or the XML
    /// lacks an element that [`CrsdInfo`] needs.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, ReadError> {
        let source = Source::open(path.as_ref())?;
        Ok(Container::open(source, DEFAULT_MEMORY_BYTES)?.info)
    }
}

impl ChannelFile for Container {
    fn open(source: Source, memory_bytes: u64) -> Result<Self, ReadError> {
        let header = Header::read(&source)?;
        let xml = read_xml(&source, header.blocks.xml, memory_bytes)?;
        let Parsed {
            info,
            pulses,
            vectors,
        } = parse(&xml, &header.version, memory_bytes)
            .map_err(|error| in_xml(&source, header.blocks.xml, &error))?;
        Ok(Self {
            source: Arc::new(source),
            header,
            info,
            pulses,
            vectors,
        })
    }

    fn table(&self) -> Table<'_> {
        let info = &self.info;
        Table {
            source: &self.source,
            blocks: &self.header.blocks,
            channels: (info.channels.iter())
                .map(|channel| (channel.id.as_str(), &channel.arrays))
                .collect(),
            reference: (&info.ref_channel, "CRSDsar/Channel/RefChId"),
            record_bytes: self.vectors.num_bytes,
            format: info.signal_format,
            compression: info.compression.as_deref(),
        }
    }

    fn check(&self) -> Result<(), String> {
        let Self { header, info, .. } = self;
        if info.waveform != "LFM" {
            return Err(format!(
                "expected TxSequence/TxWFType LFM (linear frequency modulation), found '{}': convert the file to CPHD 1.1 with \
                 its producer's tool",
                info.waveform
            ));
        }
        for Sequence {
            id,
            num_pulses,
            offset,
        } in &info.sequences
        {
            let bytes = num_pulses.checked_mul(self.pulses.num_bytes);
            let what = || format!("transmit sequence '{id}': its PPP array of {num_pulses} pulses");
            header.ppp.check_array("PPP", *offset, bytes, what)?;
        }
        Ok(())
    }
}

impl Container {
    /// Pulses of a transmit sequence.
    fn sent(&self, sequence: &Sequence) -> Result<Vec<Sent>, ReadError> {
        let too_large = || self.too_large(&sequence.id);
        let count = usize::try_from(sequence.num_pulses).map_err(|_| too_large())?;
        let mut sent = Vec::new();
        sent.try_reserve_exact(count).map_err(|_| too_large())?;
        let width = self.pulses.num_bytes as usize;
        let offset = self.header.ppp.offset + sequence.offset;
        self.source
            .read_records("PPP", offset, count, width, |index, record| {
                sent.push(self.pulses.decode(index, record)?);
                Ok(())
            })?;
        Ok(sent)
    }

    fn too_large(&self, name: &str) -> ReadError {
        self.source.malformed(format!("'{name}' is too large"))
    }
}

impl Crsd {
    /// Open channel `channel`, or the reference channel for `None`, with at most `memory_bytes` of memory.
    ///
    /// # Errors
    /// [`ReadError::Malformed`] if the file is not `CRSDsar`, is truncated, lacks a required element, is of a kind
    /// that the [module](super) does not support, or has no such channel; the text states the position.
    /// [`ReadError::Io`]. [`ReadError::Memory`] before more memory is allocated than allowed.
    pub fn open(
        path: impl AsRef<Path>,
        channel: Option<&str>,
        memory_bytes: u64,
    ) -> Result<Self, ReadError> {
        open_one(Source::open(path.as_ref())?, channel, memory_bytes)
    }

    /// Open several channels, each by its identifier or its number from 1, or all. The file is opened once. Together
    /// the channels use at most `memory_bytes`.
    ///
    /// # Errors
    /// As [`Self::open`]; [`ReadError::Channels`] if the file has no such channel.
    pub fn open_channels<S: AsRef<str>>(
        path: impl AsRef<Path>,
        channels: Option<&[S]>,
        memory_bytes: u64,
    ) -> Result<Vec<Self>, ReadError> {
        open_several(Source::open(path.as_ref())?, channels, memory_bytes)
    }

    /// Metadata of the file.
    pub fn info(&self) -> &CrsdInfo {
        &self.container.info
    }

    /// Channel that was opened.
    pub fn channel(&self) -> &CrsdChannel {
        &self.info().channels[self.channel]
    }

    fn report(&self) -> &Report {
        self.report.get_or_init(|| {
            let mut report = Report::default();
            let (name, pulses) = (&self.collection().name, &self.collection().pulses);
            let (all, kept) = (self.channel().num_vectors, pulses.len() as u64);
            let named = Named {
                recording: name,
                channel: Some(&self.channel().id),
                receiver: None,
            };
            let without = all.saturating_sub(kept);
            if without > 0 {
                report.warnings.push(format!(
                    "{name}: {without} of {all} vectors left out: no echo of a pulse (SIGNAL other than 1, or no TxPulseIndex)"
                ));
            } else {
                let times_s: Vec<f64> = pulses.iter().map(|pulse| pulse.time_s).collect();
                if let Some(gaps) = DefectKind::gaps(&times_s, 0) {
                    report.add(named.defect([pulses.len(); 2], gaps), "");
                }
            }
            if !self.container.source.is_remote() {
                let echoes = self.compressed.echoes();
                let stored = stored::Stored {
                    named,
                    format: "CRSD",
                    num_pulses: pulses.len(),
                    num_samples: echoes.collection().waveform.num_samples(),
                    integer_range: echoes.integer_range(),
                };
                let read = |n: usize, row: &mut [Complex32]| echoes.read_stored(n, row);
                report.extend(stored.examine(|n| echoes.vector(n), read));
            }
            report
        })
    }
}

impl FileChannel for Crsd {
    type File = Container;

    fn of(container: Arc<Container>, channel: usize, memory_bytes: u64) -> Result<Self, ReadError> {
        let (source, info) = (&container.source, &container.info);
        let chosen = &info.channels[channel];
        let sequence = &info.sequences[chosen.sequence];
        let too_large = || container.too_large(&chosen.id);
        let num_samples = usize::try_from(chosen.num_samples).map_err(|_| too_large())?;
        let num_vectors = usize::try_from(chosen.num_vectors).map_err(|_| too_large())?;
        let held_bytes = (chosen.num_vectors)
            .saturating_mul(KEPT_BYTES + size_of::<Pulse>() as u64)
            .saturating_add(chosen.num_samples.saturating_mul(TRANSFORM_BYTES))
            .saturating_add(source.held_bytes());
        let pulses_bytes = sequence.num_pulses.saturating_mul(size_of::<Sent>() as u64);
        let opening_bytes = pulses_bytes.saturating_add(CHUNK_BYTES as u64);
        source.check_memory(held_bytes.saturating_add(opening_bytes), memory_bytes)?;

        let sent = container.sent(sequence)?;
        let stored = Stored {
            source: Arc::clone(source),
            format: info.signal_format,
            offset: container.header.blocks.signal.offset + chosen.arrays.signal_offset,
            num_samples,
            sample_rate_hz: chosen.sample_rate_hz,
        };
        let name = history_name(
            info.product_name.as_deref(),
            source.path(),
            &chosen.id,
            info.channels.len(),
        );
        let mut echoes = Vectors::to_be_read(info, stored, name);
        echoes.reserve(num_vectors).map_err(|_| too_large())?;
        let layout = &container.vectors;
        let offset = container.header.blocks.pvp.offset + chosen.arrays.pvp_offset;
        let width = layout.num_bytes as usize;
        source.read_records("PVP", offset, num_vectors, width, |index, record| {
            let Some(received) = layout.decode(index, record)? else {
                return Ok(());
            };
            let pulse = usize::try_from(received.pulse).ok();
            let Some(sent) = pulse.and_then(|pulse| sent.get(pulse)) else {
                return Err(format!(
                    "vector {index}: TxPulseIndex {} is not below the number of pulses of '{}', {}",
                    received.pulse,
                    sequence.id,
                    sent.len()
                ));
            };
            echoes.push(index, sent, &received, info.reference_m)
        })?;
        let Some(band_hz) = echoes.finish() else {
            return Err(source.malformed(format!(
                "channel '{}': expected a vector with an echo of a pulse (TxPulseIndex, SIGNAL), found no such vector",
                chosen.id
            )));
        };
        let velocities_m_s = echoes.velocities_m_s();
        let compressed = Compressed::within(echoes, Filter::Inverse, band_hz)
            .map_err(|error| source.malformed(error.what))?
            .moving(|n| velocities_m_s[n]);
        let collection = compressed.collection();
        for (n, pulse) in collection.pulses.iter().enumerate() {
            if let Some(what) = pulse.fault(collection.num_samples) {
                return Err(source.malformed(format!(
                    "echo {n} of channel '{}': {what} (positions, times or frequencies of its pulse and vector)",
                    chosen.id
                )));
            }
        }
        Ok(Self {
            channel,
            compressed,
            held_bytes,
            report: OnceLock::new(),
            container,
        })
    }
}

impl PhaseHistory for Crsd {
    fn collection(&self) -> &Collection {
        self.compressed.collection()
    }

    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError> {
        let first = pulses.start;
        self.compressed.read(pulses, samples)?;
        let width = self.collection().num_samples;
        check_finite(&self.container.source.name(), first, width, samples)
    }

    fn warnings(&self) -> Vec<String> {
        self.report().warnings.clone()
    }

    fn defects(&self) -> Vec<Defect> {
        self.report().defects.clone()
    }

    fn start_ns(&self) -> Option<i64> {
        date::nanoseconds(self.info().collection_start.as_deref()?)
    }

    fn channels(&self) -> Vec<Channel> {
        vec![self.channel().about()]
    }

    fn path(&self) -> Option<&Path> {
        Some(self.container.source.path())
    }

    fn phase_conventions(&self) -> Vec<PhaseConvention> {
        vec![PhaseConvention::stated(
            PhaseSign::Minus,
            PhaseReference::Raw,
        )]
    }

    fn held_bytes(&self) -> u64 {
        self.held_bytes
    }

    fn inputs(&self) -> Result<Vec<InputFile>, ReadError> {
        Ok(vec![self.container.source.input()?])
    }
}
