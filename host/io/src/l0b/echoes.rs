//! Pulses as baseband echoes: decoded samples, zero outside the sub-swaths.

use std::ops::Range;
use std::sync::Arc;

use glam::DVec3;
use hdf5_pure::{Dataset, Datatype};
use num_complex::{Complex32, Complex64};

use super::metadata::{L0bChannel, L0bInfo};
use super::orbit::Orbit;
use super::tree::Tree;
use crate::hdf5_numbers::{Kind, Part, pair};
use crate::raw_check::absent::ABSENT;
use crate::receive::{EchoCollection, EchoPulse, Echoes};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::phase_history::{InputFile, ReadError, check_finite};
use subaperture_signal::phase::{narrow, phasor, widen};

/// Number of codes of a look-up table.
const NUM_CODES: usize = 1 << 16;

/// Bytes of samples read at a time, unless a single pulse is larger.
const PIECE_BYTES: usize = 1 << 20;

/// Conversion of a stored value to a sample.
enum Decoder {
    /// Codes of the real and the imaginary part, and the value of each code.
    Table([Part; 2], Vec<f32>),
    /// Complex number of two floats.
    Number([Part; 2]),
}

impl Decoder {
    /// Decoder of a channel. NaN in a table, of unused codes, becomes 0.
    fn of(tree: &Tree, channel: &L0bChannel, datatype: &Datatype) -> Result<Self, ReadError> {
        let fault = |text: String| tree.source().malformed(text);
        let samples = channel.samples();
        let path = format!("{}/BFPQLUT", channel.received);
        let coded = (tree.data_sets(&channel.received)?.iter()).any(|name| name == "BFPQLUT");
        match (pair(datatype), coded) {
            (Some(parts), false) if parts[0].kind == Kind::Float && parts[0].bytes <= 4 => {
                Ok(Self::Number(parts))
            }
            (Some(parts), true) if parts[0].kind == Kind::Unsigned && parts[0].bytes == 2 => {
                let found = tree.numbers(&path, (16 * NUM_CODES) as u64)?;
                if found.shape != [NUM_CODES as u64] {
                    return Err(fault(format!(
                        "{path}: expected {NUM_CODES} values, one for each code of 16 bits, found the shape {:?}",
                        found.shape
                    )));
                }
                let value = |(code, &value): (usize, &f64)| match value {
                    _ if value.is_nan() => Ok(0.0),
                    _ if value.abs() <= f64::from(f32::MAX) => Ok(value as f32),
                    _ => Err(fault(format!(
                        "{path}: expected finite values or NaN, found {value} for the code {code}"
                    ))),
                };
                let table: Result<Vec<f32>, _> =
                    found.values.iter().enumerate().map(value).collect();
                Ok(Self::Table(parts, table?))
            }
            _ => Err(fault(format!(
                "{samples}: expected pairs of 16-bit codes with a table BFPQLUT, or pairs of floats of 16 or 32 bits without it, found \
                 another type of sample"
            ))),
        }
    }

    fn sample(&self, stored: &[u8]) -> Complex32 {
        let [re, im] = match self {
            Self::Table(parts, table) => parts.map(|part| table[part.number(stored) as usize]),
            Self::Number(parts) => parts.map(|part| part.number(stored) as f32),
        };
        // Unused values.
        match re.is_nan() || im.is_nan() {
            true => Complex32::ZERO,
            false => Complex32::new(re, im),
        }
    }
}

/// Memory per pulse in bytes, without the sub-swaths.
pub(super) const KEPT_BYTES: u64 =
    (size_of::<usize>() + size_of::<[DVec3; 2]>() + size_of::<EchoPulse>()) as u64;

/// Samples of a channel.
pub(super) struct Pulses {
    tree: Arc<Tree>,
    path: String,
    set: Dataset,
    /// Bytes of a stored value.
    width: usize,
    decoder: Decoder,
    collection: EchoCollection,
    /// Constant factor: the chirp's phase is 0 in its middle.
    turned: Complex64,
    /// Row of each pulse in the file.
    rows: Vec<usize>,
    velocities_m_s: Vec<[DVec3; 2]>,
    /// Valid samples of each pulse, `num_swaths` intervals each.
    valid: Vec<[u32; 2]>,
    num_swaths: usize,
}

/// A pulse to be added.
pub(super) struct Sent {
    /// Row of the file.
    pub(super) row: usize,
    pub(super) pulse: EchoPulse,
    /// Velocities of transmitter and receiver in the scene frame.
    pub(super) velocities_m_s: [DVec3; 2],
}

/// Antennas of a pulse transmitted at a time, seconds after the orbit's epoch. `None` if the echo of the scene's origin never arrives.
pub(super) fn sent(info: &L0bInfo, orbit: &Orbit, time_s: f64) -> Option<Sent> {
    let frame = &info.frame;
    let state = |time_s: f64| {
        let [position, velocity] = orbit.at(time_s);
        [
            frame.from_ecf_m(position),
            frame.direction_from_ecf(velocity),
        ]
    };
    let [transmitter_m, transmitter_m_s] = state(time_s);
    let reference_m = DVec3::ZERO;
    let [mut receiver_m, mut receiver_m_s] = [transmitter_m, transmitter_m_s];
    // Each step reduces the error by the ratio of velocity to the speed of light.
    for _ in 0..3 {
        let path_m = transmitter_m.distance(reference_m) + receiver_m.distance(reference_m);
        [receiver_m, receiver_m_s] = state(time_s + path_m / SPEED_OF_LIGHT_M_S);
    }
    let reference_path_m = transmitter_m.distance(reference_m) + receiver_m.distance(reference_m);
    reference_path_m.is_finite().then_some(Sent {
        row: 0,
        pulse: EchoPulse {
            time_s,
            transmitter_m,
            receiver_m,
            reference_m,
            reference_path_m,
        },
        velocities_m_s: [transmitter_m_s, receiver_m_s],
    })
}

impl Pulses {
    /// Create an empty list for `count` pulses with `num_swaths` sub-swaths each. Decompressed chunks of up to `cache_bytes` are kept.
    pub(super) fn new(
        tree: &Arc<Tree>,
        channel: &L0bChannel,
        collection: EchoCollection,
        (count, num_swaths): (usize, usize),
        cache_bytes: usize,
    ) -> Result<Self, ReadError> {
        let path = channel.samples();
        let set = tree.cached(&path, cache_bytes)?;
        let datatype = set.datatype();
        let datatype = datatype.map_err(|error| tree.fault(&path, "a type", &error))?;
        let mut new = Self {
            decoder: Decoder::of(tree, channel, &datatype)?,
            width: datatype.type_size() as usize,
            tree: Arc::clone(tree),
            path,
            set,
            collection,
            turned: phasor(-channel.chirp_hz_s * channel.duration_s * channel.duration_s / 8.0),
            rows: Vec::new(),
            velocities_m_s: Vec::new(),
            valid: Vec::new(),
            num_swaths,
        };
        let reserved = (new.rows.try_reserve_exact(count))
            .and_then(|()| new.velocities_m_s.try_reserve_exact(count))
            .and_then(|()| new.collection.pulses.try_reserve_exact(count))
            .and_then(|()| {
                new.valid
                    .try_reserve_exact(count.saturating_mul(num_swaths))
            });
        reserved.map_err(|_| tree.source().malformed("its pulses are too many"))?;
        Ok(new)
    }

    /// Add a pulse with its intervals of valid samples.
    pub(super) fn push(&mut self, sent: Sent, valid: impl Iterator<Item = [u32; 2]>) {
        self.rows.push(sent.row);
        self.collection.pulses.push(sent.pulse);
        self.velocities_m_s.push(sent.velocities_m_s);
        self.valid.extend(valid);
    }

    /// Velocities of transmitter and receiver in the scene frame for every pulse.
    pub(super) fn velocities_m_s(&self) -> Vec<[DVec3; 2]> {
        self.velocities_m_s.clone()
    }

    /// Row of pulse `n` in the file.
    pub(super) fn row(&self, n: usize) -> usize {
        self.rows[n]
    }

    /// Read the samples of pulse `n` as decoded; [`ABSENT`] outside the sub-swaths.
    pub(super) fn read_stored(&self, n: usize, row: &mut [Complex32]) -> Result<(), ReadError> {
        self.read_run(n..n + 1, row, |z| z)?;
        check_finite(&self.tree.source().name(), n, row.len(), row)?;
        let valid = &self.valid[self.num_swaths * n..self.num_swaths * (n + 1)];
        for (i, z) in row.iter_mut().enumerate() {
            let is_valid = |&[start, end]: &[u32; 2]| (start as usize..end as usize).contains(&i);
            if !valid.iter().any(is_valid) {
                *z = ABSENT;
            }
        }
        Ok(())
    }

    /// Read pulses that are adjacent in the file, with `convert` applied to the decoded samples, and zeros outside the sub-swaths.
    fn read_run(
        &self,
        pulses: Range<usize>,
        samples: &mut [Complex32],
        convert: impl Fn(Complex32) -> Complex32,
    ) -> Result<(), ReadError> {
        let (first, count) = (self.rows[pulses.start] as u64, pulses.len() as u64);
        let stored = self.set.read_raw_rows(first, count);
        let stored = stored.map_err(|error| self.tree.fault(&self.path, "samples", &error))?;
        if stored.len() != samples.len() * self.width {
            return Err(self.tree.source().malformed(format!(
                "{}: expected {} bytes of pulse {first} and the next, found {}",
                self.path,
                samples.len() * self.width,
                stored.len()
            )));
        }
        let num_samples = samples.len() / pulses.len();
        let stored = stored.chunks_exact(num_samples * self.width);
        let rows = samples.chunks_exact_mut(num_samples).zip(stored);
        for (pulse, (row, stored)) in pulses.zip(rows) {
            row.fill(Complex32::ZERO);
            let swaths = self.num_swaths * pulse..self.num_swaths * (pulse + 1);
            for &[start, end] in &self.valid[swaths] {
                let (start, end) = (start as usize, (end as usize).min(num_samples));
                for i in start..end {
                    let value = self.decoder.sample(&stored[i * self.width..][..self.width]);
                    row[i] = convert(value);
                }
            }
        }
        Ok(())
    }
}

impl Echoes for Pulses {
    fn collection(&self) -> &EchoCollection {
        &self.collection
    }

    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError> {
        let num_samples = self.collection.waveform.num_samples();
        assert_eq!(samples.len(), pulses.len() * num_samples);
        let at_once = (PIECE_BYTES / (num_samples * self.width)).max(1);
        let (mut start, mut rest) = (pulses.start, samples);
        for run in self.rows[pulses].chunk_by(|a, b| *b == a + 1) {
            for piece in run.chunks(at_once) {
                let (part, others) = rest.split_at_mut(piece.len() * num_samples);
                self.read_run(start..start + piece.len(), part, |z| {
                    narrow(widen(z) * self.turned)
                })?;
                start += piece.len();
                rest = others;
            }
        }
        self.tree.source().check_unchanged()
    }

    fn held_bytes(&self) -> u64 {
        self.rows.len() as u64 * (KEPT_BYTES + 8 * self.num_swaths as u64)
    }

    fn inputs(&self) -> Result<Vec<InputFile>, ReadError> {
        Ok(vec![self.tree.source().input()?])
    }
}
