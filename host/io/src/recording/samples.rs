//! Samples of all pulses from any format, pulse by pulse.
//!
//! `dca1000` is the format of the TI DCA1000 and most other capture programs: int16, little-endian; in every sweep
//! the samples of one receiver after those of the other. The order of the numbers ([`Order`]) is two I then two Q
//! over two LVDS lanes (xWR16xx, xWR18xx), I and Q alternating, or real numbers.
//!
//! Real samples of dechirped sweeps are converted to complex ones: [`super::analytic`].

use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use num_complex::Complex32;

use super::arrays::Source;
use super::keys::{FormatKeys, Layout, Order, Sign, WaveformKeys};
use crate::input::open_file;
use crate::npy::{Array, Range, Values as Numbers};
use subaperture_describe::declare::Located;
use subaperture_describe::error::{ALLOW_MORE_MEMORY, Fault};
use subaperture_model::phase_history::PhaseSign;

/// Source of the sign in a description.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SignStated {
    /// Samples are real: their analytic signal has the sign of image formers.
    Real,
    /// Stated by the key `recording.phase`.
    Stated(PhaseSign),
    /// Not stated. Histories are then read as `minus`.
    Unstated,
}

/// Samples as recorded, one row for every receiver in every sweep.
pub(super) struct Samples {
    /// Arrays of the files, and the number of sweeps before each.
    pieces: Vec<(Arc<Array>, usize)>,
    pub(super) num_sweeps: usize,
    pub(super) num_receivers: usize,
    pub(super) num_samples: usize,
    /// Step between samples, and between rows, in values.
    sample_stride: usize,
    row_stride: usize,
    /// Sign of the phase, if stated.
    phase: Option<PhaseSign>,
    /// Whether the samples are real numbers.
    pub(super) real: bool,
}

/// Rows that form a pulse.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rows {
    /// First sweep, step to the next, and number of sweeps.
    pub(super) first: usize,
    pub(super) every: usize,
    pub(super) count: usize,
    /// Index of the receiver, from 0.
    pub(super) receiver: usize,
}

impl Samples {
    /// Source of the sign of the phase.
    pub(super) fn sign(&self) -> SignStated {
        match (self.real, self.phase) {
            (true, _) => SignStated::Real,
            (false, Some(sign)) => SignStated::Stated(sign),
            (false, None) => SignStated::Unstated,
        }
    }

    /// Mean of the rows of each pulse, pulse by pulse.
    pub(super) fn of(&self, pulses: impl ExactSizeIterator<Item = Rows>) -> Vec<Complex32> {
        let mut samples = vec![Complex32::ZERO; pulses.len() * self.num_samples];
        for (row, rows) in samples.chunks_exact_mut(self.num_samples).zip(pulses) {
            for turn in 0..rows.count {
                self.add(rows.first + turn * rows.every, rows.receiver, row);
            }
            if rows.count > 1 {
                row.iter_mut().for_each(|z| *z /= rows.count as f32);
            }
        }
        samples
    }

    /// Check of real values as float32. (The reader has checked complex ones.)
    fn range(&self) -> Range {
        let mut range = Range::default();
        for (array, _) in &self.pieces {
            if let Numbers::Real(values) = &array.values {
                values.iter().for_each(|value| range.take(&[*value]));
            }
        }
        range
    }

    fn add(&self, sweep: usize, receiver: usize, row: &mut [Complex32]) {
        let piece = self.pieces.partition_point(|(_, before)| *before <= sweep) - 1;
        let (array, before) = &self.pieces[piece];
        let start = ((sweep - before) * self.num_receivers + receiver) * self.row_stride;
        let places = (0..self.num_samples).map(|k| start + k * self.sample_stride);
        for (z, i) in row.iter_mut().zip(places) {
            *z += match &array.values {
                Numbers::Real(values) => Complex32::new(values[i] as f32, 0.0),
                Numbers::Complex(values) if self.phase == Some(PhaseSign::Plus) => values[i].conj(),
                Numbers::Complex(values) => values[i],
            };
        }
    }
}

/// Read the samples named by `[recording]`.
pub(super) fn read(kind: &WaveformKeys, source: &Source) -> Result<Samples, Fault> {
    let recording = source.recording;
    let phase = recording.phase.map(|phase| match phase {
        Sign::Plus => PhaseSign::Plus,
        Sign::Minus => PhaseSign::Minus,
    });
    let samples = match &recording.format {
        FormatKeys::Dca1000(keys) => dca1000(source, &keys.samples, phase)?,
        FormatKeys::Npz(keys) => array(source, Some(&keys.array), keys.layout, phase)?,
        FormatKeys::Npy(keys) => array(source, None, keys.layout, phase)?,
    };
    let takes_complex = match kind {
        WaveformKeys::Pulsed(_) => Some("pulsed"),
        WaveformKeys::Stepped(_) => Some("stepped"),
        WaveformKeys::Fmcw(_) | WaveformKeys::Profiles(_) => None,
    };
    if samples.real
        && let Some(kind) = takes_complex
    {
        return Err(recording.file.fault(
            format!(
                "kind = \"{kind}\": expected complex samples, found real ones: save both parts, I + j Q. (Real samples are supported for kind = \"profiles\" \
                 and of kind = \"fmcw\", whose beats have one sign.)"
            ),
        ));
    }
    if let Some(what) = samples.range().fault() {
        return Err(recording.file.fault(what));
    }
    if samples.num_sweeps == 0 || samples.num_samples < 2 {
        return Err(recording.file.fault(format!(
            "expected at least one pulse of two samples, found {} pulses of {} samples",
            samples.num_sweeps, samples.num_samples
        )));
    }
    Ok(samples)
}

/// Consecutive arrays, each with the number of its first sweep.
type InARow = Vec<(Arc<Array>, usize)>;

/// Concatenate files. Each of several files must contain complete pulses, since a partial pulse does not continue in
/// the next file.
fn joined(
    source: &Source,
    pieces: Vec<(PathBuf, Arc<Array>, usize)>,
) -> Result<(InARow, usize), Fault> {
    let recording = source.recording;
    let a_pulse = recording.sweeps_a_pulse();
    let mut num_sweeps = 0;
    let mut all = Vec::with_capacity(pieces.len());
    for (path, array, sweeps) in pieces {
        if !sweeps.is_multiple_of(a_pulse) {
            let key = match *recording.average > 1 {
                true => &recording.average,
                false => &recording.transmitters,
            };
            return Err(key.fault(
                format!(
                    "{} has {sweeps} sweeps of each receiver, not a multiple of {a_pulse} per pulse (transmitters times average), \
                     so {} are over: check both, receivers, and whether the file is whole",
                    path.display(),
                    sweeps % a_pulse
                ),
            ));
        }
        all.push((array, num_sweeps));
        num_sweeps += sweeps;
    }
    Ok((all, num_sweeps))
}

/// Rows and columns of an array of two axes. Receivers in a middle axis become rows.
fn rows_and_columns(array: &Array, receivers: usize, turned: bool) -> Option<(usize, usize)> {
    match array.shape[..] {
        [rows, columns] => Some((rows, columns)),
        [sweeps, middle, samples] if middle == receivers && !turned => {
            Some((sweeps * middle, samples))
        }
        _ => None,
    }
}

/// Samples of arrays: the one of this name in an archive, or NumPy files.
fn array(
    source: &Source,
    name: Option<&Located<String>>,
    layout: Layout,
    phase: Option<PhaseSign>,
) -> Result<Samples, Fault> {
    let recording = source.recording;
    let receivers = *recording.receivers;
    let turned = layout == Layout::SamplesPulses;
    let fault = |message: String| match name {
        Some(name) => name.fault(message),
        None => recording.file.fault(message),
    };
    let mut pieces: Vec<(PathBuf, Arc<Array>, usize)> = Vec::new();
    let mut size: Option<(usize, bool)> = None;
    let mut strides = (1, 1);
    for path in source.files()? {
        let array = source.hold((path.clone(), name.map(|name| (**name).clone())));
        let array = array.map_err(fault)?;
        let (rows, columns) = rows_and_columns(&array, receivers, turned).ok_or_else(|| {
            fault(
                format!(
                    "{} has shape {:?}: expected two axes, pulses and samples, or three, pulses, receivers and \
                     samples, with {receivers} receivers",
                    path.display(),
                    array.shape
                ),
            )
        })?;
        let (num_rows, num_samples) = if turned {
            (columns, rows)
        } else {
            (rows, columns)
        };
        let real = array.real().is_some();
        let (samples, all_real) = *size.get_or_insert((num_samples, real));
        if samples != num_samples || real != all_real {
            let first = &pieces[0].0;
            return Err(fault(format!(
                "{} has {num_samples} {} samples per pulse, but {} has {samples} {}: give files of one kind",
                path.display(),
                if real { "real" } else { "complex" },
                first.display(),
                if all_real {
                    "real ones"
                } else {
                    "complex ones"
                }
            )));
        }
        if !num_rows.is_multiple_of(receivers) {
            return Err(recording.receivers.fault(
                format!(
                    "{} has {num_rows} rows, not a multiple of {receivers} receivers: check receivers, and \
                     layout, which states what rows and columns are",
                    path.display()
                ),
            ));
        }
        strides = if turned { (columns, 1) } else { (1, columns) };
        if turned && !pieces.is_empty() && pieces[0].1.shape != array.shape {
            let what = "expected files of equal shape for layout = \"samples-pulses\"";
            return Err(fault(what.to_owned()));
        }
        pieces.push((path, array, num_rows / receivers));
    }
    let (pieces, num_sweeps) = joined(source, pieces)?;
    let (num_samples, real) = size.unwrap_or_default();
    Ok(Samples {
        pieces,
        num_sweeps,
        num_receivers: receivers,
        num_samples,
        sample_stride: strides.0,
        row_stride: strides.1,
        phase,
        real,
    })
}

fn dca1000(
    source: &Source,
    given_samples: &Located<usize>,
    phase: Option<PhaseSign>,
) -> Result<Samples, Fault> {
    let recording = source.recording;
    let (samples, receivers) = (**given_samples, *recording.receivers);
    let sweep = samples * receivers;
    let order = recording.order.unwrap_or(Order::Iiqq);
    let mut pieces = Vec::new();
    for path in source.files()? {
        let fault = |what: String| recording.file.fault(what);
        let read = |name: &(_, _), left| lanes(Path::new(&name.0), order, left);
        // The same file read in two orders gives two arrays.
        let name = (
            path.clone(),
            recording.order.map(|order| format!("{order:?}")),
        );
        let array = source.arrays.hold(name, source.memory_bytes, read);
        let array = array.map_err(fault)?;
        let held = array.shape[0];
        if !held.is_multiple_of(sweep) {
            let (whole, over) = (held / sweep, held % sweep);
            return Err(given_samples.fault(
                format!(
                    "{} has {held} samples: {whole} sweeps of {samples} from each of {receivers} receivers \
                     and a rest of {over}: check samples and receivers{}",
                    path.display(),
                    others(held, samples, receivers)
                ),
            ));
        }
        pieces.push((path, array, held / sweep));
    }
    let (pieces, num_sweeps) = joined(source, pieces)?;
    Ok(Samples {
        pieces,
        num_sweeps,
        num_receivers: receivers,
        num_samples: samples,
        sample_stride: 1,
        row_stride: samples,
        phase,
        real: order == Order::Real,
    })
}

/// Message that lists numbers of receivers and of samples that divide the file.
fn others(held: usize, samples: usize, receivers: usize) -> String {
    let even = |samples: &usize, receivers: &usize| held.is_multiple_of(samples * receivers);
    let counts: Vec<String> = (1..=8usize)
        .filter(|count| *count != receivers && even(&samples, count))
        .map(|count| count.to_string())
        .collect();
    let near: Vec<String> = (samples / 2..=samples * 2)
        .filter(|count| *count >= 2 && *count != samples && even(count, &receivers))
        .map(|count| count.to_string())
        .take(8)
        .collect();
    let mut words = String::new();
    if !counts.is_empty() {
        words += &format!("; receivers = {} would divide it", counts.join(" or "));
    }
    if !near.is_empty() {
        words += &format!("; samples = {} would divide it", near.join(" or "));
    }
    if words.is_empty() {
        words += ", and whether the file is complete";
    }
    words
}

impl Order {
    /// Bytes of the smallest group of complete samples.
    fn unit_bytes(self) -> u64 {
        match self {
            Self::Iiqq => 8,
            Self::Iqiq => 4,
            Self::Real => 2,
        }
    }

    /// Memory of the converted file and the file itself, relative to the file size.
    fn held(self) -> u64 {
        match self {
            Self::Iiqq | Self::Iqiq => 3,
            Self::Real => 5,
        }
    }
}

/// All samples of an int16 file.
fn lanes(path: &Path, order: Order, memory_bytes: u64) -> Result<Array, String> {
    let named = |error: std::io::Error| format!("cannot read {}: {error}", path.display());
    let file = open_file(path).map_err(named)?;
    let length = file.metadata().map_err(named)?.len();
    let unit = order.unit_bytes();
    if length == 0 || !length.is_multiple_of(unit) {
        let what = match order {
            Order::Iiqq => "pairs of complex samples",
            Order::Iqiq => "complex samples",
            Order::Real => "real samples",
        };
        return Err(format!(
            "{}: expected {what} of {unit} bytes each, found {length} bytes in total",
            path.display()
        ));
    }
    // Samples take two or four times the bytes of the file, which is in memory at the same time.
    let needed = length.saturating_mul(order.held());
    if needed > memory_bytes {
        return Err(format!(
            "{}: {} bytes of memory are needed, but {memory_bytes} are left: {ALLOW_MORE_MEMORY}",
            path.display(),
            needed
        ));
    }
    let mut bytes = Vec::new();
    file.take(length).read_to_end(&mut bytes).map_err(named)?;
    let number = |pair: &[u8]| f32::from(i16::from_le_bytes([pair[0], pair[1]]));
    if order == Order::Real {
        let samples: Vec<f64> = bytes
            .chunks_exact(2)
            .map(|pair| f64::from(number(pair)))
            .collect();
        return Ok(Array {
            shape: vec![samples.len()],
            values: Numbers::Real(samples),
        });
    }
    if order == Order::Iqiq {
        let samples: Vec<Complex32> = bytes
            .chunks_exact(4)
            .map(|pair| Complex32::new(number(pair), number(&pair[2..])))
            .collect();
        return Ok(Array {
            shape: vec![samples.len()],
            values: Numbers::Complex(samples),
        });
    }
    let samples: Vec<Complex32> = bytes
        .chunks_exact(8)
        .flat_map(|pair| {
            let [i0, i1, q0, q1] = [0, 2, 4, 6].map(|at| number(&pair[at..]));
            [Complex32::new(i0, q0), Complex32::new(i1, q1)]
        })
        .collect();
    Ok(Array {
        shape: vec![samples.len()],
        values: Numbers::Complex(samples),
    })
}
