//! Phase history as CPHD 1.1.0 files.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{self, Write};
use std::path::Path;
use std::sync::Arc;

use num_complex::Complex32;
use subaperture_fft::{Fft, Transforms};

use super::antenna_fit::Described;
use super::conventions::{Domain, Sgn};
use super::describe;
use super::entry::Entry;
use super::header::{self, Sizes};
use super::prepare::Prepared;
use super::pvp::record_bytes;
use super::toa::Transform;
use super::write_options::{Channel, WriteError, WriteOptions};
use crate::atomic::{self, AtomicFile};
use crate::container::{CHUNK_BYTES, SECTION_END, encode};
use crate::together::FileSet;
use crate::written::{ChannelSize, FileKind, WrittenFile};
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::check_finite;

/// Write `channels` to `path` atomically: to a hidden file in the same folder, which is then renamed.
///
/// Samples are CF8. In the FX domain they read back bit-identical. In the TOA domain there are at least 1.25 times as
/// many, over one period `1 / step_hz` of delay around the SRP's; the only loss is float32 rounding. The first
/// channel is the reference channel.
///
/// Values that CPHD requires and a [`PhaseHistory`](subaperture_model::phase_history::PhaseHistory) does not contain:
/// - `TxTime` is the pulse's time and `RcvTime` that plus the delay of the SRP's echo; `TxPos` and
///   `RcvPos` are the pulse's positions, taken to be valid at those times.
/// - Velocities are those of the sweep if samples are taken one after another
///   ([`Sweep`](subaperture_model::phase_history::Sweep)), otherwise central differences of the positions (one-sided
///   at the ends).
/// - `aFRR1` and `aFRR2` state the rate of such a sweep, as for a linear frequency-modulated pulse. Phases must then
///   follow the reference point.
/// - `SRPPos` is the reference point. Where `reference_path_m` differs by more than 20 nm from the path of the
///   reference point, the SRP is moved along the bisector until they agree, since CPHD stores no other path;
///   `SRPFixed` is then false.
/// - `CollectType` is `MONOSTATIC` if transmitter and receiver are at most 1 mrad apart as seen from
///   the SRP, in every pulse of the reference channel.
/// - `ModeType` is `SPOTLIGHT` if all pulses share their reference point, else `STRIPMAP`; dwell is
///   given as the whole collection for all of the image area.
/// - `TOA1` to `TOA2` are 0.8 of the unambiguous delay; a missing extent is replaced by the square that this swath
///   covers.
/// - `RefVectorIndex` is the vector nearest the middle at which the reference geometry is well conditioned. For
///   motion exactly along the line of sight there is no slant plane: twist, slope and layover are written as 0, and
///   sarkit's `cphdcheck`, whose equations are 0 / 0, reports these three. For a platform at rest, or a single pulse,
///   it also reports side of track and Doppler cone angle (written as L and 90). It reports nothing else.
/// - `ImageGrid` is a proposal at range resolution.
/// - `Antenna` describes the antennas of channels that have [`Channel::antennas`], as gain polynomials about axes
///   that are polynomials of time up to order 5. Antennas whose axes deviate from such polynomials by more than 1 %
///   of their narrowest half-power width are omitted ([`describes_antennas`]).
/// - If all channels have true antenna positions, these are written as added parameters (`AddedPVP`), `TxPosTrue` and
///   `RcvPosTrue`, in ECF.
///
/// Memory: 256 bytes per pulse of all channels, plus the larger of 8 MiB and two pulses.
///
/// # Errors
/// [`WriteError`]; [`WriteError::Unsuited`] for a local scene frame, a frame that is not level with a surface of
/// constant height, times that do not ascend, and pulses compensated to a path that no scene point has (such as 0).
pub fn write(
    path: impl AsRef<Path>,
    channels: &[Channel],
    options: &WriteOptions,
    monitor: &dyn Monitor,
) -> Result<Vec<WrittenFile>, WriteError> {
    let mut alone = FileSet::new();
    add_to(&mut alone, path.as_ref(), channels, options, monitor)?;
    Ok(alone.commit()?)
}

/// Like [`write()`], renamed together with the other files of a set.
///
/// # Errors
/// As [`write()`].
pub fn add_to(
    files: &mut FileSet,
    path: &Path,
    channels: &[Channel],
    options: &WriteOptions,
    monitor: &dyn Monitor,
) -> Result<(), WriteError> {
    check_texts(channels, options)?;
    let entries = prepare(channels, options)?;
    let xml = describe::document(&entries, options)?;
    let (sizes, layout) = lay_out(&entries, &xml, options)?;

    let failed = |source| {
        WriteError::Write(atomic::WriteError::Io {
            path: path.to_owned(),
            needed_bytes: layout.file_bytes,
            source,
        })
    };
    let mut beside = AtomicFile::create(path, layout.file_bytes, ".part")?;
    let mut out = Output {
        file: beside.file(),
        written: 0,
    };
    let fixed = (|| -> io::Result<()> {
        out.put(layout.header.as_bytes())?;
        out.pad_to(layout.xml_offset)?;
        out.put(xml.as_bytes())?;
        out.put(SECTION_END)?;
        out.pad_to(layout.pvp_offset)?;
        for entry in &entries {
            write_records(&mut out, &entry.prepared)?;
        }
        out.pad_to(layout.signal_offset)
    })();
    fixed.map_err(failed)?;
    let total = sizes.signal as f64;
    for entry in &entries {
        write_signal(entry, options, monitor, |bytes, done| {
            out.put(bytes).map_err(failed)?;
            monitor.progress((entry.signal_offset + done) as f64 / total);
            Ok(())
        })?;
    }
    let sizes = channels.iter().map(|channel| {
        let collection = channel.history.collection();
        ChannelSize {
            channel: channel.id.clone(),
            pulses: collection.pulses.len(),
            samples: collection.num_samples,
        }
    });
    let written = WrittenFile::new(path, FileKind::PhaseHistory).with_channels(sizes.collect());
    Ok(files.add(beside, written)?)
}

/// Whether [`write()`] describes the antennas of a channel: it has antennas, and their axes are polynomials of time.
pub fn describes_antennas(channel: &Channel) -> bool {
    let collection = channel.history.collection();
    let described = |carried| Described::new(carried, &collection.frame, &collection.pulses, 1.0);
    channel.antennas.as_ref().and_then(described).is_some()
}

/// Size of the file that [`write()`] writes, in bytes.
///
/// # Errors
/// As [`write()`], except those of reading and writing.
pub fn file_bytes(channels: &[Channel], options: &WriteOptions) -> Result<u64, WriteError> {
    check_texts(channels, options)?;
    let entries = prepare(channels, options)?;
    let xml = describe::document(&entries, options)?;
    Ok(lay_out(&entries, &xml, options)?.1.file_bytes)
}

fn lay_out(
    entries: &[Entry],
    xml: &str,
    options: &WriteOptions,
) -> Result<(Sizes, header::Layout), WriteError> {
    let last = &entries[entries.len() - 1];
    let sizes = Sizes {
        xml: xml.len() as u64,
        pvp: last.pvp_offset + last.prepared.pvp_bytes(),
        signal: last.signal_offset + signal_bytes(&last.prepared)?,
    };
    let layout = header::lay_out(&sizes, &options.classification, &options.release_info);
    Ok((sizes, layout.ok_or_else(too_large)?))
}

fn too_large() -> WriteError {
    WriteError::Unsuited("the file would have more than 2^63 bytes".to_owned())
}

fn signal_bytes(prepared: &Prepared) -> Result<u64, WriteError> {
    (prepared.records.len() as u64)
        .checked_mul(prepared.stored_samples as u64)
        .and_then(|n| n.checked_mul(8))
        .filter(|&n| n < 1 << 60)
        .ok_or_else(too_large)
}

fn prepare<'a>(
    channels: &'a [Channel<'a>],
    options: &WriteOptions,
) -> Result<Vec<Entry<'a>>, WriteError> {
    let Some(first) = channels.first() else {
        return Err(WriteError::Unsuited("no channel to write".to_owned()));
    };
    let frame = first.history.collection().frame;
    let mut entries: Vec<Entry> = Vec::new();
    let (mut pvp_offset, mut signal_offset) = (0, 0);
    let known = |channel: &Channel| channel.history.true_antennas().is_some();
    let with_truth = channels.iter().all(known);
    for channel in channels {
        let collection = channel.history.collection();
        let truth = channel.history.true_antennas().filter(|_| with_truth);
        let prepared = Prepared::new(collection, truth, options.domain)?;
        if !collection.frame.agrees_with(&frame) {
            return Err(WriteError::Unsuited(format!(
                "channels '{}' and '{}' have different scene frames: a CPHD file has one",
                channel.id, first.id
            )));
        }
        let (pvp, signal) = (prepared.pvp_bytes(), signal_bytes(&prepared)?);
        let middle = collection.pulses[collection.pulses.len() / 2];
        let centre_hz = middle.frequency_hz(collection.num_samples / 2);
        let antennas = channel.antennas.as_ref().and_then(|carried| {
            Described::new(carried, &collection.frame, &collection.pulses, centre_hz)
        });
        entries.push(Entry {
            channel,
            prepared,
            antennas,
            pvp_offset,
            signal_offset,
        });
        pvp_offset += pvp;
        signal_offset = signal_offset
            .checked_add(signal)
            .filter(|&n: &u64| n < 1 << 62)
            .ok_or_else(too_large)?;
    }
    Ok(entries)
}

/// Check the texts of XML and header: no control characters, and no surrounding white space, which readers trim.
fn check_texts(channels: &[Channel], options: &WriteOptions) -> Result<(), WriteError> {
    let core_name = options.core_name.as_deref().unwrap_or_default();
    let mode_id = options.mode_id.as_deref().unwrap_or_default();
    let texts = [
        ("collector_name", options.collector_name.as_str()),
        ("core_name", core_name),
        ("mode_id", mode_id),
        ("classification", &options.classification),
        ("release_info", &options.release_info),
    ];
    let ids = channels.iter().map(|c| ("channel id", c.id.as_str()));
    let names = channels
        .iter()
        .map(|c| ("collection name", c.history.collection().name.as_str()));
    for (what, text) in texts.into_iter().chain(ids).chain(names) {
        let odd = |c: char| c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}');
        if text.contains(odd) || text.trim() != text {
            return Err(WriteError::Unsuited(format!(
                "{what} {text:?}: remove control characters and white space around it"
            )));
        }
    }
    let mut seen = BTreeSet::new();
    for channel in channels {
        if channel.id.is_empty() || !seen.insert(&channel.id) {
            return Err(WriteError::Unsuited(format!(
                "channel id '{}' is empty or used twice",
                channel.id
            )));
        }
    }
    let start = options.collection_start.as_bytes();
    let shape = b"0000-00-00T00:00:00";
    let digits_fit = start.len() > shape.len()
        && shape.iter().zip(start).all(|(&s, &c)| match s {
            b'0' => c.is_ascii_digit(),
            _ => c == s,
        });
    let rest = options.collection_start.get(shape.len()..).unwrap_or("");
    let fraction = rest.strip_suffix('Z').map(|f| f.strip_prefix('.'));
    let fraction_fits = match fraction {
        Some(None) => rest == "Z",
        Some(Some(f)) => !f.is_empty() && f.bytes().all(|c| c.is_ascii_digit()),
        None => false,
    };
    if !(digits_fit && fraction_fits) {
        return Err(WriteError::Unsuited(format!(
            "collection_start '{}': write YYYY-MM-DDThh:mm:ss.ssssssZ",
            options.collection_start
        )));
    }
    Ok(())
}

/// Count the bytes written, to pad up to the next block.
struct Output<'a> {
    file: &'a mut File,
    written: u64,
}

impl Output<'_> {
    fn put(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.file.write_all(bytes)?;
        self.written += bytes.len() as u64;
        Ok(())
    }

    fn pad_to(&mut self, offset: u64) -> io::Result<()> {
        let count = offset
            .checked_sub(self.written)
            .expect("blocks do not overlap");
        self.put(&vec![0; count as usize])
    }
}

fn write_records(out: &mut Output, prepared: &Prepared) -> io::Result<()> {
    let at_once = CHUNK_BYTES / record_bytes(prepared.with_truth()) as usize;
    let mut bytes = Vec::new();
    for records in prepared.records.chunks(at_once) {
        bytes.clear();
        for record in records {
            record.encode(&mut bytes);
        }
        out.put(&bytes)?;
    }
    Ok(())
}

/// Convert and write the samples of a channel, a few MiB at a time, and report the bytes done.
fn write_signal(
    entry: &Entry,
    options: &WriteOptions,
    monitor: &dyn Monitor,
    mut put: impl FnMut(&[u8], u64) -> Result<(), WriteError>,
) -> Result<(), WriteError> {
    let history = entry.channel.history;
    let collection = history.collection();
    let (width, stored) = (collection.num_samples, entry.prepared.stored_samples);
    let num_pulses = collection.pulses.len();
    let at_once = (4 * CHUNK_BYTES / (8 * stored)).clamp(1, num_pulses);
    let mut samples = vec![Complex32::ZERO; at_once * width];
    let mut transform = (options.domain == Domain::Toa).then(|| {
        let fft: Arc<dyn Fft<f64>> = Transforms::Portable.inverse(stored);
        Transform::new(entry.prepared.bins, fft)
    });
    let mut arrivals = vec![Complex32::ZERO; if transform.is_some() { stored } else { 0 }];
    let mut bytes = Vec::new();
    let mut done = 0;
    for start in (0..num_pulses).step_by(at_once) {
        if monitor.cancelled() {
            return Err(WriteError::Cancelled);
        }
        let pulses = start..(start + at_once).min(num_pulses);
        let samples = &mut samples[..pulses.len() * width];
        history.read(pulses.clone(), samples)?;
        check_finite(&collection.name, start, width, samples)?;
        bytes.clear();
        match &mut transform {
            None => {
                conjugate_if(options.sgn, samples);
                encode(samples, &mut bytes);
            }
            Some(transform) => {
                for (pulse, fx) in pulses.clone().zip(samples.chunks_exact(width)) {
                    let record = &entry.prepared.records[pulse];
                    let shift = record.sc0 / (stored as f64 * record.scss);
                    transform.arrival(fx, shift, &mut arrivals);
                    conjugate_if(options.sgn, &mut arrivals);
                    check_finite(&collection.name, pulse, stored, &arrivals)?;
                    encode(&arrivals, &mut bytes);
                }
            }
        }
        done += bytes.len() as u64;
        put(&bytes, done)?;
    }
    Ok(())
}

fn conjugate_if(sgn: Sgn, samples: &mut [Complex32]) {
    if sgn == Sgn::Plus {
        for z in samples {
            *z = z.conj();
        }
    }
}
