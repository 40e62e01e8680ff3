//! Phase history from CPHD files, read on demand.

use std::ops::Range;
use std::path::Path;
use std::sync::{Arc, OnceLock};

use glam::DVec3;
use num_complex::Complex32;
use subaperture_fft::{Fft, Transforms};

use super::antenna_vectors::AntennaVector;
use super::conventions::{Domain, Sgn};
use super::header::Header;
use super::metadata::{ChannelInfo, CphdInfo};
use super::preamble::Preamble;
use super::pvp::Layout;
use super::toa::{Bins, Transform};
use super::vectors::{Missing, Vectors};
use crate::container::channels::{Table, history_name, open_one, open_several};
use crate::container::lines::in_xml;
use crate::container::{CHUNK_BYTES, ChannelFile, FileChannel, Source};
use crate::date;
use subaperture_model::antenna::MountedAntennas;
use subaperture_model::phase_history::{
    Beam, Channel, Collection, Defect, InputFile, NoBeam, PhaseConvention, PhaseHistory,
    PhaseReference, PhaseSign, Pulse, ReadError, check_finite, misplaced, named_pulses,
    pulse_defects,
};

/// Maximum memory per vector in addition to its [`Pulse`] in bytes: AmpSF, a shift, and a spare byte.
const KEPT_BYTES: u64 = 8 + 8 + 1;

/// Bytes per sample for the transform of TOA vectors: the plan and one vector being transformed, up to eight complex
/// float64 each if the length has large prime factors.
const TRANSFORM_BYTES: u64 = 2 * 8 * 16;

/// One channel of a CPHD file.
///
/// Opening reads the header, the XML and the channel's PVP. Samples are read on demand by positioned reads of at most
/// 1 MiB (or one vector in the TOA domain), so several threads can read from one `Cphd`. Memory: the [`Collection`],
/// up to 17 bytes per vector, 48 more with true positions, and in the TOA domain the transform plan, about 256 bytes
/// per sample of one vector.
///
/// - Samples are `AmpSF` times the stored value if there is an `AmpSF`. Vectors whose `SIGNAL` is other than 1 (no
///   signal, noise, calibration) are left out, so that a unit scatterer has the value 1. Vectors at impossible
///   positions ([`misplaced`]) are left out as well. [`PhaseHistory::warnings`] reports both.
/// - TOA vectors of `N` samples are delivered at the frequencies `fx_C + m / (N SCSS)`, `fx_C = (FX1 + FX2) / 2`, for
///   the integers `m` with `FX1 <= f < FX2`. Their number must be the same for every vector. The transform is in
///   float64 and adds no error to that of the stored float32 samples.
/// - `SGN = +1` samples are conjugated.
/// - Added parameters `TxPosTrue` and `RcvPosTrue`, as [`write`](super::write()) makes them, are the
///   true positions of the antennas.
/// - If `aFRR2` is given, samples were taken one after another at a rate of `2 / (c aFRR2)` hertz per second
///   ([`Sweep`](subaperture_model::phase_history::Sweep)). Velocities are `TxVel` and `RcvVel`; accelerations are the
///   slopes of these from vector to vector.
/// - `reference_path_m` is the path through `SRPPos`, computed from the stored positions. Their rounding (1e-9 m as
///   float64 in ECF, more if they were once float32) cancels in path differences. The [module](super) documentation
///   describes the atmosphere.
pub struct Cphd {
    container: Arc<Container>,
    channel: usize,
    collection: Collection,
    /// Offset of the channel's samples in the file.
    signal_offset: u64,
    /// Samples per vector as stored.
    stored_samples: usize,
    /// AmpSF of every vector, if the file has it.
    amp_sf: Option<Vec<f64>>,
    /// Vectors of the file that were left out.
    missing: Missing,
    /// Warnings about omitted vectors, one sentence each.
    warnings: Vec<String>,
    /// Missing vectors and vectors of zeros, examined when first requested.
    defects: OnceLock<Vec<Defect>>,
    arrival: Option<Arrival>,
    /// True positions of the antennas, if the file has them.
    true_antennas: Option<Vec<[DVec3; 2]>>,
    /// Axes and boresights of the antennas, if the beam needs those of each vector.
    antennas: Option<Vec<[AntennaVector; 2]>>,
    held_bytes: u64,
}

/// State shared by the channels of a file.
pub(crate) struct Container {
    source: Source,
    header: Header,
    info: CphdInfo,
    layout: Layout,
}

impl ChannelFile for Container {
    fn open(source: Source, memory_bytes: u64) -> Result<Self, ReadError> {
        let Preamble {
            header,
            info,
            layout,
        } = Preamble::read(&source, memory_bytes)?;
        let layout = layout.map_err(|error| in_xml(&source, header.blocks.xml, &error))?;
        Ok(Self {
            source,
            header,
            info,
            layout,
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
            reference: (&info.ref_channel, "CPHD/Channel/RefChId"),
            record_bytes: self.layout.num_bytes,
            format: info.signal_format,
            compression: info.compression.as_deref(),
        }
    }
}

/// Transform plan from TOA to FX vectors.
struct Arrival {
    bins: Bins,
    fft: Arc<dyn Fft<f64>>,
    /// `SC0 / (N SCSS)` of every vector.
    shifts: Vec<f64>,
}

impl Cphd {
    /// Open channel `channel`, or the reference channel for `None`, with at most `memory_bytes` of memory.
    ///
    /// # Errors
    /// [`ReadError::Malformed`] if the file is not CPHD, is truncated, lacks a required element or has no such
    /// channel; the text states the position. [`ReadError::Io`]. [`ReadError::Memory`] before more memory is
    /// allocated than allowed.
    pub fn open(
        path: impl AsRef<Path>,
        channel: Option<&str>,
        memory_bytes: u64,
    ) -> Result<Self, ReadError> {
        Self::of_source(Source::open(path.as_ref())?, channel, memory_bytes)
    }

    /// As [`Self::open`], from a file in memory; `name` stands for its path. Its bytes are kept and count as memory.
    ///
    /// # Errors
    /// As [`Self::open`], without [`ReadError::Io`].
    pub fn from_bytes(
        name: impl AsRef<Path>,
        bytes: Vec<u8>,
        channel: Option<&str>,
        memory_bytes: u64,
    ) -> Result<Self, ReadError> {
        let source = Source::of_bytes(bytes, name.as_ref());
        Self::of_source(source, channel, memory_bytes)
    }

    fn of_source(
        source: Source,
        channel: Option<&str>,
        memory_bytes: u64,
    ) -> Result<Self, ReadError> {
        let mut opened: Self = open_one(source, channel, memory_bytes)?;
        let misplaced = opened.misplaced();
        opened.leave_out(&misplaced);
        match opened.collection.pulses.is_empty() && !misplaced.is_empty() {
            true => Err(opened.nothing_left()),
            false => Ok(opened),
        }
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
        let mut opened: Vec<Self> =
            open_several(Source::open(path.as_ref())?, channels, memory_bytes)?;
        // A vector left out of one channel is left out of all, so that pulses still correspond.
        let vectors = |one: &Self| one.channel().num_vectors;
        let shared = opened
            .windows(2)
            .all(|pair| vectors(&pair[0]) == vectors(&pair[1]));
        let all = |of: &dyn Fn(&Self) -> Vec<usize>| {
            let mut numbers: Vec<usize> = opened.iter().flat_map(of).collect();
            numbers.sort_unstable();
            numbers.dedup();
            numbers
        };
        if shared {
            let misplaced = all(&Self::misplaced);
            let missing = all(&|one| one.missing.0.clone());
            for one in &mut opened {
                one.retain(&missing);
                one.leave_out(&misplaced);
            }
        } else {
            for one in &mut opened {
                let misplaced = one.misplaced();
                one.leave_out(&misplaced);
            }
        }
        let empty = |one: &&Self| one.collection.pulses.is_empty() && !one.missing.0.is_empty();
        match opened.iter().find(empty) {
            Some(one) => Err(one.nothing_left()),
            None => Ok(opened),
        }
    }

    fn nothing_left(&self) -> ReadError {
        let what = "expected a vector with an echo of the scene (SIGNAL 1) and plausible positions in all channels, found no such vector";
        self.container.source.malformed(what)
    }

    /// Numbers of the vectors at positions that no vehicle can have.
    fn misplaced(&self) -> Vec<usize> {
        let pulses = misplaced(&self.collection).into_iter().flatten();
        pulses.map(|pulse| self.missing.vector(pulse)).collect()
    }

    /// Leave out these vectors, which are misplaced in this or another channel.
    fn leave_out(&mut self, misplaced: &[usize]) {
        let Some(&first) = misplaced.first() else {
            return;
        };
        let at = self.missing.pulse(first).map_or(String::new(), |pulse| {
            let pulse = &self.collection.pulses[pulse];
            let [transmitter, receiver] = [pulse.transmitter_m, pulse.receiver_m]
                .map(|place| self.collection.frame.to_ecf_m(place))
                .map(|p| format!("{:.0}, {:.0}, {:.0} m", p.x, p.y, p.z));
            format!(" (TxPos {transmitter}, RcvPos {receiver} in vector {first})")
        });
        self.warnings.push(format!(
            "{}: {} left out, since no vehicle can be at the recorded positions{at}",
            self.collection.name,
            vectors_named(misplaced, self.channel().num_vectors)
        ));
        self.retain(misplaced);
    }

    /// Leave out the vectors with these ascending numbers.
    fn retain(&mut self, without: &[usize]) {
        fn only<T>(values: &mut Vec<T>, gone: &[usize]) {
            let (mut at, mut next) = (0, 0);
            values.retain(|_| {
                let out = gone.get(next) == Some(&at);
                next += usize::from(out);
                at += 1;
                !out
            });
        }
        let gone: Vec<usize> = without
            .iter()
            .filter_map(|&vector| self.missing.pulse(vector))
            .collect();
        only(&mut self.collection.pulses, &gone);
        if let Some(values) = &mut self.amp_sf {
            only(values, &gone);
        }
        if let Some(values) = &mut self.true_antennas {
            only(values, &gone);
        }
        if let Some(values) = &mut self.antennas {
            only(values, &gone);
        }
        if let Some(arrival) = &mut self.arrival {
            only(&mut arrival.shifts, &gone);
        }
        let missing = &mut self.missing.0;
        missing.extend_from_slice(without);
        missing.sort_unstable();
        missing.dedup();
    }

    /// The metadata of the file.
    pub fn info(&self) -> &CphdInfo {
        &self.container.info
    }

    /// All channels of the file.
    pub fn channels(&self) -> &[ChannelInfo] {
        &self.info().channels
    }

    /// Channel that was opened.
    pub fn channel(&self) -> &ChannelInfo {
        &self.info().channels[self.channel]
    }

    /// Missing vectors and vectors of zeros. Those at a URL are not examined. Vectors that cannot be read give no defect here: forming the image fails with
    /// the reason.
    fn pulse_defects(&self) -> &[Defect] {
        self.defects.get_or_init(|| {
            if self.container.source.is_remote() {
                return Vec::new();
            }
            pulse_defects(self, &|pulse| self.missing.vector(pulse)).unwrap_or_default()
        })
    }

    /// Read stored samples from flat index `first` on, converted only in number format.
    fn read_stored(&self, first: usize, samples: &mut [Complex32]) -> Result<(), ReadError> {
        let source = &self.container.source;
        source.read_samples(
            self.info().signal_format,
            self.signal_offset,
            first,
            samples,
        )
    }

    /// Scale, conjugate and check stored vectors from `first` on.
    fn condition(&self, first: usize, samples: &mut [Complex32]) -> Result<(), ReadError> {
        let width = self.stored_samples;
        for (i, vector) in samples.chunks_exact_mut(width).enumerate() {
            if let Some(amp_sf) = &self.amp_sf {
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
        check_finite(
            &self.container.source.name(),
            self.missing.vector(first),
            width,
            samples,
        )
    }
}

impl FileChannel for Cphd {
    type File = Container;

    fn of(container: Arc<Container>, channel: usize, memory_bytes: u64) -> Result<Self, ReadError> {
        let Container {
            source,
            header,
            info,
            layout,
            ..
        } = &*container;
        let chosen = &info.channels[channel];
        let pvp_offset = header.blocks.pvp.offset + chosen.arrays.pvp_offset;
        let signal_offset = header.blocks.signal.offset + chosen.arrays.signal_offset;
        let too_large = || source.malformed(format!("channel '{}' is too large", chosen.id));
        let stored_samples = usize::try_from(chosen.num_samples).map_err(|_| too_large())?;
        let num_vectors = usize::try_from(chosen.num_vectors).map_err(|_| too_large())?;

        let antenna_fields = match info.needs_antenna_vectors(chosen) {
            true => layout.antennas.as_ref().ok(),
            false => None,
        };
        let held_bytes = held_bytes(chosen, info.domain, layout, antenna_fields.is_some())
            .saturating_add(source.held_bytes());
        let records = chosen.num_vectors.saturating_mul(layout.num_bytes);
        source.check_memory(
            held_bytes.saturating_add(records.min(CHUNK_BYTES as u64)),
            memory_bytes,
        )?;

        let mut vectors = Vectors::to_be_read(info, stored_samples);
        vectors
            .reserve(num_vectors, layout)
            .map_err(|_| too_large())?;
        let mut antennas = Vec::new();
        if antenna_fields.is_some() {
            (antennas.try_reserve_exact(num_vectors)).map_err(|_| too_large())?;
        }
        let width = usize::try_from(layout.num_bytes).map_err(|_| too_large())?;
        source.read_records(
            "PVP",
            pvp_offset,
            num_vectors,
            width,
            |index, record| match layout.decode(index, record, info.domain)? {
                Some(vector) => {
                    antennas.extend(antenna_fields.map(|fields| fields.decode(index, record)));
                    vectors.push(index, &vector)
                }
                None => {
                    vectors.missing.0.push(index as usize);
                    Ok(())
                }
            },
        )?;
        let missing = std::mem::take(&mut vectors.missing);
        if vectors.pulses.is_empty() && num_vectors > 0 {
            return Err(source.malformed(format!(
                "channel '{}': SIGNAL is 0 in all of its {num_vectors} vectors: expected 1 in those that hold echoes of the scene",
                chosen.id
            )));
        }
        vectors.set_accelerations();

        let arrival = vectors.bins.map(|bins| Arrival {
            bins,
            fft: Transforms::Portable.forward(stored_samples),
            shifts: vectors.shifts,
        });
        let name = history_name(
            info.core_name.as_deref(),
            source.path(),
            &chosen.id,
            info.channels.len(),
        );
        let collection = Collection {
            name: name.clone(),
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
            warnings: no_signal(&name, &missing, num_vectors)
                .into_iter()
                .chain(
                    info.unused_patterns(
                        chosen,
                        layout.antennas.as_ref().err().map(String::as_str),
                    ),
                )
                .collect(),
            missing,
            defects: OnceLock::new(),
            arrival,
            true_antennas: layout.has_true_antennas().then_some(vectors.true_antennas),
            antennas: antenna_fields.is_some().then_some(antennas),
            held_bytes,
            container,
        })
    }
}

impl PhaseHistory for Cphd {
    fn collection(&self) -> &Collection {
        &self.collection
    }

    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError> {
        assert!(
            pulses.end <= self.collection.pulses.len(),
            "pulses {pulses:?} are beyond the last one"
        );
        assert_eq!(samples.len(), pulses.len() * self.collection.num_samples);
        let width = self.stored_samples;
        let Some(arrival) = &self.arrival else {
            let mut at = pulses.start;
            let mut left = samples;
            while at < pulses.end {
                // Vectors adjacent in the file are read together.
                let first = self.missing.vector(at);
                let follows = |n: &usize| self.missing.vector(at + n) == first + n;
                let count = (1..pulses.end - at).take_while(follows).count() + 1;
                let (part, rest) = left.split_at_mut(count * width);
                self.read_stored(first * width, part)?;
                self.condition(at, part)?;
                (at, left) = (at + count, rest);
            }
            return Ok(());
        };
        let mut transform = Transform::new(arrival.bins, Arc::clone(&arrival.fft));
        let mut toa = vec![Complex32::ZERO; width];
        for (pulse, fx) in pulses.zip(samples.chunks_exact_mut(arrival.bins.count)) {
            self.read_stored(self.missing.vector(pulse) * width, &mut toa)?;
            self.condition(pulse, &mut toa)?;
            transform.frequency(&toa, arrival.shifts[pulse], fx);
            // Products of finite float32 values can overflow.
            check_finite(
                &self.container.source.name(),
                self.missing.vector(pulse),
                fx.len(),
                fx,
            )?;
        }
        Ok(())
    }

    fn warnings(&self) -> Vec<String> {
        let defects = self.pulse_defects().iter().map(Defect::warning);
        self.warnings.iter().cloned().chain(defects).collect()
    }

    fn defects(&self) -> Vec<Defect> {
        self.pulse_defects().to_vec()
    }

    fn true_antennas(&self) -> Option<&[[DVec3; 2]]> {
        self.true_antennas.as_deref()
    }

    fn stated_beam(&self) -> Result<Option<Beam>, NoBeam> {
        let (pulses, samples) = (&self.collection.pulses, self.collection.num_samples);
        let vectors = self.antennas.as_deref();
        self.info().beam(self.channel(), pulses, vectors, samples)
    }

    fn antennas(&self) -> Option<MountedAntennas> {
        let (pulses, samples) = (&self.collection.pulses, self.collection.num_samples);
        let vectors = self.antennas.as_deref();
        self.info()
            .mounted(self.channel(), pulses, vectors, samples)
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
        let sign = match self.info().sgn {
            Sgn::Plus => PhaseSign::Plus,
            Sgn::Minus => PhaseSign::Minus,
        };
        vec![PhaseConvention::stated(sign, PhaseReference::Recorded)]
    }

    fn held_bytes(&self) -> u64 {
        self.held_bytes
    }

    fn inputs(&self) -> Result<Vec<InputFile>, ReadError> {
        Ok(vec![self.container.source.input()?])
    }
}

/// Vectors in words: "vectors 3, 7 to 9 (4 of 120) are".
fn vectors_named(numbers: &[usize], of: u64) -> String {
    let mut runs: Vec<Range<usize>> = Vec::new();
    for &n in numbers {
        match runs.last_mut() {
            Some(run) if run.end == n => run.end = n + 1,
            _ => runs.push(n..n + 1),
        }
    }
    match numbers.len() {
        1 => format!("vector {} (1 of {of}) is", named_pulses(&runs)),
        count => format!("vectors {} ({count} of {of}) are", named_pulses(&runs)),
    }
}

/// Warning about vectors without an echo, if any.
fn no_signal(name: &str, missing: &Missing, count: usize) -> Vec<String> {
    if missing.0.is_empty() {
        return Vec::new();
    }
    vec![format!(
        "{name}: {} left out: SIGNAL is other than 1 (no signal, noise or calibration)",
        vectors_named(&missing.0, count as u64)
    )]
}

/// Memory of an open channel in bytes.
fn held_bytes(channel: &ChannelInfo, domain: Domain, layout: &Layout, with_antennas: bool) -> u64 {
    let transformed = match domain {
        Domain::Fx => 0,
        Domain::Toa => channel.num_samples,
    };
    let truth_bytes = if layout.has_true_antennas() {
        size_of::<[DVec3; 2]>() as u64
    } else {
        0
    };
    let antenna_bytes = match with_antennas {
        true => size_of::<[AntennaVector; 2]>() as u64,
        false => 0,
    };
    (channel.num_vectors)
        .saturating_mul(size_of::<Pulse>() as u64 + KEPT_BYTES + truth_bytes + antenna_bytes)
        .saturating_add(transformed.saturating_mul(TRANSFORM_BYTES))
}
