//! Phase history from L0B files, read on demand.

use std::ops::Range;
use std::path::Path;
use std::sync::{Arc, OnceLock};

use num_complex::Complex32;

use super::echoes::{KEPT_BYTES, Pulses, Sent, sent};
use super::metadata::{L0bChannel, L0bInfo, Parsed, pulse_times_s};
use super::orbit::Orbit;
use super::tree::Tree;
use crate::container::Source;
use crate::container::channels::history_name;
use crate::raw_check::stored;
use crate::raw_check::{Named, Report};
use crate::receive::{Compressed, EchoCollection, EchoPulse, Filter};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::phase_history::{
    Channel, Collection, Defect, DefectKind, InputFile, PhaseConvention, PhaseHistory,
    PhaseReference, PhaseSign, Pulse, ReadError, check_finite, which_channel,
};
use subaperture_model::radar::{PulseShape, Waveform};

/// Bytes per sample for the transform plan and one pulse being transformed, as for CPHD.
const TRANSFORM_BYTES: u64 = 2 * 8 * 16;

/// Maximum memory of the cache of decompressed chunks, bytes.
const MAX_CACHE_BYTES: u64 = 128 << 20;

/// Bytes of the library's smallest cache, and of a piece of samples.
const READING_BYTES: u64 = 3 << 20;

/// Memory of an entry of the chunk index, bytes.
const ENTRY_BYTES: u64 = 96;

/// `calType` of a pulse that is transmitted.
const TRANSMITTED: u8 = 0;

/// Channel of an L0B file as phase history: its echoes, each divided by the spectrum of its pulse.
///
/// Opening reads the orbit and the pulses' times. Samples are read on demand, so several threads can read from one
/// `L0b`. Memory: the [`Collection`], about 400 bytes per pulse, the transform plan, about 256 bytes per sample of one
/// pulse, and decompressed chunks of samples, as many as lie side by side and at most 128 MiB.
///
/// [`PhaseHistory::warnings`] and [`PhaseHistory::defects`] examine the decoded samples on the first call: evenly spaced pulses, at most
/// 4 million samples or 32 pulses, whichever is more. Files at URLs are not examined, because their bytes would be transferred.
pub struct L0b {
    container: Arc<Container>,
    channel: usize,
    compressed: Compressed<Pulses>,
    start_ns: Option<i64>,
    left_out: u64,
    /// Gaps in the times of all pulses, with those of calibration.
    gaps: Option<DefectKind>,
    held_bytes: u64,
    /// Warnings and defects, determined on first use.
    report: OnceLock<Report>,
}

/// State shared by the channels of a file.
struct Container {
    tree: Arc<Tree>,
    info: L0bInfo,
    orbit: Orbit,
}

impl Container {
    fn open(path: &Path, memory_bytes: u64) -> Result<Self, ReadError> {
        let tree = Tree::open(Source::open(path)?)?;
        let Parsed { info, orbit } = Parsed::read(&tree, memory_bytes)?;
        Ok(Self {
            tree: Arc::new(tree),
            info,
            orbit,
        })
    }

    fn names(&self) -> Vec<&str> {
        let channels = self.info.channels.iter();
        channels.map(|channel| channel.name.as_str()).collect()
    }

    /// Intervals of valid samples: `num_swaths` sets of the intervals of all pulses.
    fn swaths(&self, channel: &L0bChannel, memory_bytes: u64) -> Result<Vec<Vec<f64>>, ReadError> {
        let path = format!("{}/numberOfSubSwaths", channel.sent);
        let count = self.tree.number(&path)?;
        if !(count >= 1.0 && count.fract() == 0.0 && count <= f64::from(u16::MAX)) {
            return Err(self.tree.source().malformed(format!(
                "{path}: expected a whole number of at least 1, found {count}"
            )));
        }
        let needed = channel.num_pulses.saturating_mul(16 * count as u64 + 32);
        self.tree.source().check_memory(needed, memory_bytes)?;
        (1..=count as u64)
            .map(|n| {
                let path = format!("{}/validSamplesSubSwath{n}", channel.sent);
                (self.tree).table(&path, channel.num_pulses, 2, memory_bytes)
            })
            .collect()
    }

    /// Bytes of the chunks of samples that lie side by side, the largest chunk's, and those of the index; 0 if samples are not chunked.
    fn chunk_bytes(&self, channel: &L0bChannel) -> Result<[u64; 3], ReadError> {
        let path = channel.samples();
        let set = self.tree.data_set(&path)?;
        let fault = |error| self.tree.fault(&path, "chunks", &error);
        let size = set.element_size().map_err(fault)?;
        let Some(shape) = set.chunk_shape().map_err(fault)? else {
            return Ok([0; 3]);
        };
        let (rows, columns) = match shape[..] {
            [rows, columns] if rows > 0 && columns > 0 => (rows, columns),
            _ => {
                return Err(self.tree.source().malformed(format!(
                    "{path}: expected chunks of [pulses, samples], found {shape:?}"
                )));
            }
        };
        let chunk = rows.saturating_mul(columns).saturating_mul(size);
        let abreast = channel.num_samples.div_ceil(columns);
        let deep = channel.num_pulses.div_ceil(rows);
        Ok([
            abreast.saturating_mul(chunk),
            chunk,
            abreast.saturating_mul(deep).saturating_mul(ENTRY_BYTES),
        ])
    }
}

impl L0b {
    /// Open channel `channel`, by its name or its number from 1, or the first for `None`, with at most `memory_bytes` of memory.
    ///
    /// # Errors
    /// [`ReadError::Malformed`] if the file is not an L0B file, is damaged, is of a kind that the [module](super) does
    /// not support, or has no such channel; the text states the path in the file. [`ReadError::Io`].
    /// [`ReadError::Memory`] before more memory is allocated than allowed.
    pub fn open(
        path: impl AsRef<Path>,
        channel: Option<&str>,
        memory_bytes: u64,
    ) -> Result<Self, ReadError> {
        let container = Container::open(path.as_ref(), memory_bytes)?;
        let chosen = match channel {
            None => 0,
            Some(wanted) => which_channel(&container.names(), wanted)
                .map_err(|error| container.tree.source().malformed(error.to_string()))?,
        };
        Self::of(Arc::new(container), chosen, memory_bytes)
    }

    /// Open several channels, each by its name or its number from 1, or all. Together the channels use at most `memory_bytes`.
    ///
    /// # Errors
    /// As [`Self::open`]; [`ReadError::Channels`] if the file has no such channel.
    pub fn open_channels<S: AsRef<str>>(
        path: impl AsRef<Path>,
        channels: Option<&[S]>,
        memory_bytes: u64,
    ) -> Result<Vec<Self>, ReadError> {
        let container = Arc::new(Container::open(path.as_ref(), memory_bytes)?);
        let names = container.names();
        let chosen: Vec<usize> = match channels {
            None => (0..names.len()).collect(),
            Some(wanted) => {
                let places = wanted
                    .iter()
                    .map(|name| which_channel(&names, name.as_ref()));
                places.collect::<Result<_, _>>()?
            }
        };
        let mut left_bytes = memory_bytes;
        let mut opened = Vec::new();
        for channel in chosen {
            let next = Self::of(Arc::clone(&container), channel, left_bytes)?;
            left_bytes = left_bytes.saturating_sub(next.held_bytes);
            opened.push(next);
        }
        Ok(opened)
    }

    /// Metadata of the file.
    pub fn info(&self) -> &L0bInfo {
        &self.container.info
    }

    /// Channel that was opened.
    pub fn channel(&self) -> &L0bChannel {
        &self.info().channels[self.channel]
    }

    fn report(&self) -> &Report {
        self.report.get_or_init(|| {
            let mut report = Report::default();
            let (name, channel) = (&self.collection().name, self.channel());
            let named = Named {
                recording: name,
                channel: Some(&channel.name),
                receiver: None,
            };
            if self.left_out > 0 {
                report.warnings.push(format!(
                    "{name}: {} of {} pulses left out: calibration without transmission (calType other than 0)",
                    self.left_out, channel.num_pulses
                ));
            }
            let num_pulses = self.collection().pulses.len();
            if let Some(gaps) = &self.gaps {
                let count = num_pulses + self.left_out as usize;
                report.add(named.defect([count; 2], gaps.clone()), "");
            }
            if channel.delay_adjustment_s != 0.0 {
                report.warnings.push(format!(
                    "{name}: rangeDelayAdjustment of {:?} s is not applied, because its sign is not documented: ranges may be wrong by {:.3} m",
                    channel.delay_adjustment_s,
                    0.5 * SPEED_OF_LIGHT_M_S * channel.delay_adjustment_s.abs()
                ));
            }
            if !self.container.tree.source().is_remote() {
                let echoes = self.compressed.echoes();
                let stored = stored::Stored {
                    named,
                    format: "NISAR L0B",
                    num_pulses,
                    num_samples: channel.num_samples as usize,
                    integer_range: None,
                };
                let read = |n: usize, row: &mut [Complex32]| echoes.read_stored(n, row);
                report.extend(stored.examine(|n| echoes.row(n), read));
            }
            report
        })
    }

    fn of(container: Arc<Container>, index: usize, memory_bytes: u64) -> Result<Self, ReadError> {
        let (tree, info, orbit) = (&container.tree, &container.info, &container.orbit);
        let source = tree.source();
        let channel = &info.channels[index];
        let fault = |text: String| source.malformed(format!("{}: {text}", channel.sent));
        let too_large = || fault("the channel is too large".to_owned());
        let num_samples = usize::try_from(channel.num_samples).map_err(|_| too_large())?;
        let num_pulses = usize::try_from(channel.num_pulses).map_err(|_| too_large())?;
        let [abreast_bytes, chunk_bytes, index_bytes] = container.chunk_bytes(channel)?;
        let cache_bytes = match abreast_bytes <= MAX_CACHE_BYTES.min(memory_bytes / 4) {
            true => abreast_bytes,
            false => 0,
        };
        let held_bytes = (channel.num_pulses)
            .saturating_mul(KEPT_BYTES + size_of::<Pulse>() as u64)
            .saturating_add(channel.num_samples.saturating_mul(TRANSFORM_BYTES))
            .saturating_add(orbit.held_bytes())
            .saturating_add(index_bytes)
            .saturating_add(source.held_bytes())
            .saturating_add(cache_bytes);
        // The times and the kinds of pulses, and a chunk as stored and decompressed.
        let opening_bytes = (channel.num_pulses.saturating_mul(8 + 48 + 1))
            .saturating_add(chunk_bytes.saturating_mul(2))
            .saturating_add(READING_BYTES);
        let needed_bytes = held_bytes.saturating_add(opening_bytes);
        source.check_memory(needed_bytes, memory_bytes)?;
        let left_bytes = memory_bytes - needed_bytes;

        let times_s = pulse_times_s(tree, channel, orbit, left_bytes)?;
        let kinds = tree.bytes(&format!("{}/calType", channel.sent), channel.num_pulses)?;
        let swaths = container.swaths(channel, left_bytes)?;
        let held_bytes =
            held_bytes.saturating_add(channel.num_pulses.saturating_mul(8 * swaths.len() as u64));

        let swept_hz = channel.chirp_hz_s.abs() * channel.duration_s;
        let collection = EchoCollection {
            name: history_name(None, source.path(), &channel.name, info.channels.len()),
            waveform: Waveform::Pulsed {
                centre_hz: channel.centre_hz,
                sample_rate_hz: channel.sample_rate_hz,
                num_samples,
                window_start_s: 2.0 * channel.first_range_m / SPEED_OF_LIGHT_M_S,
                shape: PulseShape::Lfm {
                    bandwidth_hz: swept_hz,
                    duration_s: channel.duration_s,
                    rising: channel.chirp_hz_s > 0.0,
                },
            },
            pulses: Vec::new(),
            frame: info.frame,
            extent: Some(info.extent),
            timed: true,
        };
        if channel.duration_s * channel.sample_rate_hz > channel.num_samples as f64 {
            return Err(fault(format!(
                "its pulse of {:.0} samples is longer than the receive window of {num_samples}",
                channel.duration_s * channel.sample_rate_hz
            )));
        }
        let size = (num_pulses, swaths.len());
        let mut echoes = Pulses::new(tree, channel, collection, size, cache_bytes as usize)?;
        let mut first_s = None;
        for (row, (&time_s, _)) in times_s
            .iter()
            .zip(&kinds)
            .enumerate()
            .filter(|(_, (_, kind))| **kind == TRANSMITTED)
        {
            let start_s = *first_s.get_or_insert(time_s);
            let sent = sent(info, orbit, time_s)
                .filter(|sent| {
                    sent.velocities_m_s
                        .iter()
                        .all(|v| v.length() < 0.01 * SPEED_OF_LIGHT_M_S)
                })
                .ok_or_else(|| {
                    fault(format!(
                        "pulse {row}: the orbit's positions or velocities are impossible"
                    ))
                })?;
            let sent = Sent {
                row,
                pulse: EchoPulse {
                    time_s: time_s - start_s,
                    ..sent.pulse
                },
                ..sent
            };
            let bound = |value: f64| value.clamp(0.0, channel.num_samples as f64) as u32;
            let valid = swaths
                .iter()
                .map(|swath| [bound(swath[2 * row]), bound(swath[2 * row + 1])]);
            echoes.push(sent, valid);
        }
        let Some(first_s) = first_s else {
            return Err(fault(
                "expected transmitted pulses (calType 0), found only calibration pulses".to_owned(),
            ));
        };
        let velocities_m_s = echoes.velocities_m_s();
        let half_hz = 0.5 * channel.bandwidth_hz;
        let compressed = Compressed::within(echoes, Filter::Inverse, [-half_hz, half_hz])
            .map_err(|error| fault(error.what))?
            .moving(|n| velocities_m_s[n]);
        let collection = compressed.collection();
        for (n, pulse) in collection.pulses.iter().enumerate() {
            if let Some(text) = pulse.fault(collection.num_samples) {
                return Err(fault(format!("transmitted pulse {n}: {text}")));
            }
        }
        let left_out = (num_pulses - collection.pulses.len()) as u64;
        let after_ns = first_s * 1e9;
        let after_ns = (after_ns.abs() < 1e18).then_some(after_ns.round() as i64);
        Ok(Self {
            channel: index,
            compressed,
            start_ns: after_ns.and_then(|after| orbit.epoch.checked_add(after)),
            left_out,
            gaps: DefectKind::gaps(&times_s, 0),
            held_bytes,
            report: OnceLock::new(),
            container,
        })
    }
}

impl PhaseHistory for L0b {
    fn collection(&self) -> &Collection {
        self.compressed.collection()
    }

    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError> {
        let first = pulses.start;
        self.compressed.read(pulses, samples)?;
        let width = self.collection().num_samples;
        check_finite(&self.container.tree.source().name(), first, width, samples)
    }

    fn warnings(&self) -> Vec<String> {
        self.report().warnings.clone()
    }

    fn defects(&self) -> Vec<Defect> {
        self.report().defects.clone()
    }

    fn start_ns(&self) -> Option<i64> {
        self.start_ns
    }

    fn channels(&self) -> Vec<Channel> {
        vec![self.channel().about()]
    }

    fn path(&self) -> Option<&Path> {
        Some(self.container.tree.source().path())
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
        Ok(vec![self.container.tree.source().input()?])
    }
}
