//! CPHD files as phase history, read on demand.

use std::collections::TryReserveError;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use glam::DVec3;
use num_complex::Complex32;
use subaperture_fft as fft;
use subaperture_fft::Fft;

use super::conventions::{Domain, Sgn};
use super::header::Block;
use super::metadata::{ChannelInfo, CphdInfo};
use super::preamble::{Preamble, in_xml};
use super::pvp::{Layout, Vector};
use super::source::{CHUNK_BYTES, Source};
use super::start;
use super::toa::{Bins, Transform};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::phase_history::{
    Collection, InputFile, PhaseHistory, Pulse, ReadError, Sweep, check_finite,
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
///   ([`Sweep`]); velocities are `TxVel` and `RcvVel`, accelerations the slope of these from vector to vector.
/// - `reference_path_m` is the path by way of `SRPPos`, of the positions as stored: what they were rounded to (1e-9 m
///   as float64 in ECF, more if they were float32 once) cancels in differences of paths. See the [module](super)
///   for the atmosphere.
pub struct Cphd {
    source: Source,
    info: CphdInfo,
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
        let source = Source::open(path.as_ref())?;
        let malformed = |what: String| source.malformed(what);
        let Preamble {
            header,
            info,
            layout,
            xml_offset,
        } = Preamble::read(&source, memory_bytes)?;
        let layout = layout.map_err(|e| malformed(in_xml(&e, xml_offset)))?;
        let chosen = info.channel(channel).map_err(malformed)?.clone();
        if let Some(name) = &info.compression {
            return Err(source.malformed(format!(
                "the signal arrays are compressed ('{name}'); only uncompressed CI2, CI4 and CF8 \
                 are read: decompress the file with its producer's tool"
            )));
        }
        for entry in &info.channels {
            check_extent(&info, entry, &layout, &header.pvp, &header.signal).map_err(malformed)?;
        }
        let pvp_offset = header.pvp.offset + chosen.pvp_offset;
        let signal_offset = header.signal.offset + chosen.signal_offset;
        let too_large = || source.malformed(format!("channel '{}' is too large", chosen.id));
        let stored_samples = usize::try_from(chosen.num_samples).map_err(|_| too_large())?;
        let num_vectors = usize::try_from(chosen.num_vectors).map_err(|_| too_large())?;

        let transformed = match info.domain {
            Domain::Fx => 0,
            Domain::Toa => chosen.num_samples,
        };
        let truth_bytes = if layout.has_true_antennas() {
            size_of::<[DVec3; 2]>() as u64
        } else {
            0
        };
        let held_bytes = (chosen.num_vectors)
            .saturating_mul(size_of::<Pulse>() as u64 + KEPT_BYTES + truth_bytes)
            .saturating_add(transformed.saturating_mul(TRANSFORM_BYTES));
        let records = chosen.num_vectors.saturating_mul(layout.num_bytes);
        source.check_memory(
            held_bytes.saturating_add(records.min(CHUNK_BYTES as u64)),
            memory_bytes,
        )?;

        let mut vectors = Vectors {
            domain: info.domain,
            stored_samples,
            frame: info.frame,
            pulses: Vec::new(),
            amp_sf: Vec::new(),
            has_signal: Vec::new(),
            shifts: Vec::new(),
            true_antennas: Vec::new(),
            bins: None,
        };
        vectors
            .reserve(num_vectors, &layout)
            .map_err(|_| too_large())?;
        read_records(
            &source,
            pvp_offset,
            num_vectors,
            &layout,
            |index, record| {
                let vector = layout.decode(index, record, info.domain)?;
                vectors.push(index, &vector)
            },
        )?;
        vectors.set_accelerations();

        let arrival = vectors.bins.map(|bins| Arrival {
            bins,
            fft: fft::forward(stored_samples),
            shifts: vectors.shifts,
        });
        let collection = Collection {
            name: collection_name(&info, &chosen, path.as_ref()),
            num_samples: vectors.bins.map_or(stored_samples, |b| b.count),
            pulses: vectors.pulses,
            frame: info.frame,
            extent: Some(info.image_area),
            timed: true,
        };
        let channel = info.channels.iter().position(|c| c.id == chosen.id);
        Ok(Self {
            channel: channel.expect("the channel was found above"),
            info,
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
            source,
        })
    }

    /// The metadata of the file.
    pub fn info(&self) -> &CphdInfo {
        &self.info
    }

    /// All channels of the file.
    pub fn channels(&self) -> &[ChannelInfo] {
        &self.info.channels
    }

    /// The channel that was opened.
    pub fn channel(&self) -> &ChannelInfo {
        &self.info.channels[self.channel]
    }

    /// Reads stored samples, as they are but for the format, from flat index `first` on.
    fn read_stored(&self, first: usize, samples: &mut [Complex32]) -> Result<(), ReadError> {
        let format = self.info.signal_format;
        let width = format.sample_bytes();
        let chunk = CHUNK_BYTES / width;
        let mut bytes = vec![0; samples.len().min(chunk) * width];
        for (i, part) in samples.chunks_mut(chunk).enumerate() {
            let bytes = &mut bytes[..part.len() * width];
            let at = (first + i * chunk) as u64 * width as u64;
            self.source.read_at(self.signal_offset + at, bytes)?;
            format.decode(bytes, part);
        }
        Ok(())
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
        if self.info.sgn == Sgn::Plus {
            for z in samples.iter_mut() {
                *z = z.conj();
            }
        }
        check_finite(&self.source.name(), first, width, samples)
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
            check_finite(&self.source.name(), pulse, fx.len(), fx)?;
        }
        Ok(())
    }

    fn true_antennas(&self) -> Option<&[[DVec3; 2]]> {
        self.true_antennas.as_deref()
    }

    fn start_ns(&self) -> Option<i64> {
        start::nanoseconds(self.info.collection_start.as_deref()?)
    }

    fn held_bytes(&self) -> u64 {
        self.held_bytes
    }

    fn inputs(&self) -> Result<Vec<InputFile>, ReadError> {
        let mut hasher = crc32fast::Hasher::new();
        let mut bytes = vec![0; CHUNK_BYTES];
        let mut at = 0;
        while at < self.source.len() {
            let count = (self.source.len() - at).min(CHUNK_BYTES as u64) as usize;
            self.source.read_at(at, &mut bytes[..count])?;
            hasher.update(&bytes[..count]);
            at += count as u64;
        }
        // What was read of it in the meantime is what this checksum is of, or it is an error.
        self.source.check_unchanged()?;
        Ok(vec![InputFile {
            path: self.source.path().to_owned(),
            bytes: self.source.len(),
            crc32: format!("{:08x}", hasher.finalize()),
        }])
    }
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

/// Reads PVP records in chunks and hands each to `take`.
fn read_records(
    source: &Source,
    offset: u64,
    count: usize,
    layout: &Layout,
    mut take: impl FnMut(u64, &[u8]) -> Result<(), String>,
) -> Result<(), ReadError> {
    let width = usize::try_from(layout.num_bytes)
        .map_err(|_| source.malformed("XML: CPHD/Data/NumBytesPVP is too large"))?;
    let at_once = (CHUNK_BYTES / width).max(1);
    let mut bytes = vec![0; width * at_once.min(count)];
    let mut index = 0;
    while index < count {
        let n = at_once.min(count - index);
        let at = offset + index as u64 * layout.num_bytes;
        source.read_at(at, &mut bytes[..n * width])?;
        for record in bytes[..n * width].chunks_exact(width) {
            take(index as u64, record).map_err(|what| {
                source.malformed(format!(
                    "{what} (PVP at byte {})",
                    offset + index as u64 * layout.num_bytes
                ))
            })?;
            index += 1;
        }
    }
    Ok(())
}

/// What is kept of the PVP.
struct Vectors {
    domain: Domain,
    stored_samples: usize,
    frame: subaperture_model::geometry::SceneFrame,
    pulses: Vec<Pulse>,
    amp_sf: Vec<f64>,
    has_signal: Vec<bool>,
    shifts: Vec<f64>,
    true_antennas: Vec<[DVec3; 2]>,
    bins: Option<Bins>,
}

impl Vectors {
    /// Makes room for `count` vectors and no more.
    fn reserve(&mut self, count: usize, layout: &Layout) -> Result<(), TryReserveError> {
        self.pulses.try_reserve_exact(count)?;
        self.has_signal.try_reserve_exact(count)?;
        if layout.has_amp_sf() {
            self.amp_sf.try_reserve_exact(count)?;
        }
        if layout.has_true_antennas() {
            self.true_antennas.try_reserve_exact(count)?;
        }
        if self.domain == Domain::Toa {
            self.shifts.try_reserve_exact(count)?;
        }
        Ok(())
    }

    fn push(&mut self, index: u64, vector: &Vector) -> Result<(), String> {
        let (start_hz, step_hz) = match self.domain {
            Domain::Fx => (vector.sc0, vector.scss),
            Domain::Toa => self.arrival_band(index, vector)?,
        };
        let pulse = Pulse {
            time_s: vector.tx_time,
            transmitter_m: self.frame.from_ecf_m(vector.tx_pos),
            receiver_m: self.frame.from_ecf_m(vector.rcv_pos),
            reference_m: self.frame.from_ecf_m(vector.srp_pos),
            // From the ECF positions, not from those in the scene frame: one rounding less.
            reference_path_m: (vector.tx_pos - vector.srp_pos).length()
                + (vector.rcv_pos - vector.srp_pos).length(),
            start_hz,
            step_hz,
            sweep: self.sweep(vector, step_hz),
        };
        let count = self.bins.map_or(self.stored_samples, |bins| bins.count);
        if let Some(what) = pulse.fault(count) {
            return Err(format!(
                "vector {index}: {what} (TxTime, TxPos, RcvPos, SRPPos, SC0 or SCSS); repair or drop it"
            ));
        }
        if !self.is_sweep(&pulse.sweep) {
            return Err(format!(
                "vector {index}: TxVel, RcvVel or aFRR2 is beyond all measure; repair or drop it"
            ));
        }
        self.pulses.push(pulse);
        if let Some(amp_sf) = vector.amp_sf {
            self.amp_sf.push(amp_sf);
        }
        if let Some(truth) = vector.true_antennas {
            self.true_antennas
                .push(truth.map(|p| self.frame.from_ecf_m(p)));
        }
        self.has_signal.push(vector.signal != Some(0));
        Ok(())
    }

    /// Motion within a vector: the rate of its sweep is `2 / (c aFRR2)`.
    fn sweep(&self, vector: &Vector, step_hz: f64) -> Sweep {
        let Some(([transmitter, receiver], a_frr2)) = vector.sweep else {
            return Sweep::AT_ONCE;
        };
        Sweep {
            sample_s: 0.5 * SPEED_OF_LIGHT_M_S * a_frr2 * step_hz,
            transmitter_m_s: self.frame.direction_from_ecf(transmitter),
            receiver_m_s: self.frame.direction_from_ecf(receiver),
            reference_m_s: Some(DVec3::ZERO),
            ..Sweep::AT_ONCE
        }
    }

    /// Whether a sweep is one that a radar can make: of a second at most a sample, slower than light.
    fn is_sweep(&self, sweep: &Sweep) -> bool {
        let slow = |v: DVec3| v.length() < SPEED_OF_LIGHT_M_S;
        sweep.sample_s.abs() < 1.0 && slow(sweep.transmitter_m_s) && slow(sweep.receiver_m_s)
    }

    /// Accelerations: the slope, at each vector, of the polynomial through its velocity and those of two vectors before and
    /// two after. (Two neighbours alone leave `(w h)^2 / 6` of a vibration of `w` radians a second, `h` seconds from
    /// vector to vector: 8 % of 1.8 Hz at 60 ms. Four leave `(w h)^4 / 30`, 0.7 %.)
    fn set_accelerations(&mut self) {
        const NEIGHBOURS: usize = 2;
        for i in 0..self.pulses.len() {
            let [first, end] = [
                i.saturating_sub(NEIGHBOURS),
                self.pulses.len().min(i + NEIGHBOURS + 1),
            ];
            let near = &self.pulses[first..end];
            let rise = |pair: &[Pulse]| pair[1].time_s > pair[0].time_s;
            if near.iter().any(|pulse| pulse.sweep.sample_s == 0.0) || !near.windows(2).all(rise) {
                continue;
            }
            let times_s: Vec<f64> = near.iter().map(|pulse| pulse.time_s).collect();
            let weights = slope_weights(&times_s, i - first);
            let slope = |of: fn(&Sweep) -> DVec3| -> DVec3 {
                let terms = near.iter().zip(&weights);
                terms
                    .map(|(pulse, &weight)| of(&pulse.sweep) * weight)
                    .sum()
            };
            let transmitter_m_s2 = slope(|sweep| sweep.transmitter_m_s);
            let receiver_m_s2 = slope(|sweep| sweep.receiver_m_s);
            let sweep = &mut self.pulses[i].sweep;
            (sweep.transmitter_m_s2, sweep.receiver_m_s2) = (transmitter_m_s2, receiver_m_s2);
        }
    }

    /// First frequency and step of a TOA vector's spectrum.
    fn arrival_band(&mut self, index: u64, vector: &Vector) -> Result<(f64, f64), String> {
        let n = self.stored_samples;
        let bandwidth_hz = vector.fx2 - vector.fx1;
        let bins = Bins::of_band(bandwidth_hz, vector.scss, n).ok_or_else(|| {
            format!(
                "vector {index}: the band FX1 to FX2 of {bandwidth_hz:?} Hz needs 1 to {n} of the \
                 bins of {:?} Hz that {n} samples {:?} s apart (SCSS) have; the vector is \
                 under-sampled or damaged",
                1.0 / (n as f64 * vector.scss),
                vector.scss
            )
        })?;
        match self.bins {
            Some(first) if first != bins => {
                return Err(format!(
                    "vector {index}: its band FX1 to FX2 holds {} frequencies and that of vector \
                     0 {}; vectors of unequal bands are not read in the TOA domain",
                    bins.count, first.count
                ));
            }
            _ => self.bins = Some(bins),
        }
        let period_s = n as f64 * vector.scss;
        self.shifts.push(vector.sc0 / period_s);
        let step_hz = 1.0 / period_s;
        let start_hz = 0.5 * (vector.fx1 + vector.fx2) + bins.first as f64 * step_hz;
        if start_hz > 0.0 && (vector.sc0 / period_s).is_finite() {
            Ok((start_hz, step_hz))
        } else {
            Err(format!(
                "vector {index}: FX1 {:?} Hz, FX2 {:?} Hz, SC0 {:?} s and SCSS {:?} s give no \
                 positive frequencies; repair or drop it",
                vector.fx1, vector.fx2, vector.sc0, vector.scss
            ))
        }
    }
}

/// What to multiply values at `times_s`, all different, by, so that their sum is the slope at time `at` of the polynomial through them.
fn slope_weights(times_s: &[f64], at: usize) -> Vec<f64> {
    let others = |skipped: usize| {
        let all = times_s.iter().enumerate();
        all.filter(move |&(k, _)| k != at && k != skipped)
    };
    let here = times_s[at];
    let weight = |j: usize| -> f64 {
        if j == at {
            return others(at).map(|(_, time)| 1.0 / (here - time)).sum();
        }
        let ratios = others(j).map(|(_, time)| (here - time) / (times_s[j] - time));
        ratios.product::<f64>() / (times_s[j] - here)
    };
    (0..times_s.len()).map(weight).collect()
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
