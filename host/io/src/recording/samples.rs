//! Samples of all pulses from any format, pulse by pulse.
//!
//! `dca1000` is the format of the TI DCA1000 and most other capture programs: int16, little-endian; in every sweep
//! the samples of one receiver after those of the other. The order of the numbers ([`Order`]) is two I then two Q
//! over two LVDS lanes (xWR16xx, xWR18xx), I and Q alternating, or real numbers.
//!
//! `touchstone` files hold a sweep of a vector network analyser each ([`super::network`]).
//!
//! Real samples of dechirped sweeps are converted to complex ones: [`super::analytic`].

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use num_complex::Complex32;

use super::arrays::Source;
use super::int16::{lanes, others};
use super::keys::{FormatKeys, Layout, Order, Sign, WaveformKeys};
use super::network;
use super::table::Table;
use crate::npy::{Array, Range, Values as Numbers};
use crate::raw_check::balance::Correction;
use crate::touchstone;
use subaperture_describe::declare::Located;
use subaperture_describe::error::Fault;
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
    /// Corrections of bias and imbalance, of the receivers that have one.
    corrections: BTreeMap<usize, Correction>,
    /// Values of the codes that the files contain.
    table: Option<Table>,
    /// First frequency and step, hertz, if the files contain them.
    pub(super) band_hz: Option<[f64; 2]>,
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

impl Rows {
    /// Numbers of the sweeps.
    pub(super) fn sweeps(self) -> impl Iterator<Item = usize> {
        (0..self.count).map(move |turn| self.first + turn * self.every)
    }
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

    /// Mean of the rows of each pulse, pulse by pulse. Rows of zeros are left out of the mean.
    pub(super) fn of(&self, pulses: impl ExactSizeIterator<Item = Rows>) -> Vec<Complex32> {
        let mut samples = vec![Complex32::ZERO; pulses.len() * self.num_samples];
        for (row, rows) in samples.chunks_exact_mut(self.num_samples).zip(pulses) {
            let mut count = 0;
            for sweep in rows.sweeps() {
                if rows.count == 1 || !self.is_zero(sweep, rows.receiver) {
                    self.add(sweep, rows.receiver, row);
                    count += 1;
                }
            }
            if count > 1 {
                row.iter_mut().for_each(|z| *z /= count as f32);
            }
        }
        samples
    }

    /// Whether a row contains only zeros.
    pub(super) fn is_zero(&self, sweep: usize, receiver: usize) -> bool {
        self.recorded(sweep, receiver).all(|z| z == Complex32::ZERO)
    }

    /// Write a row as recorded.
    pub(super) fn read(&self, sweep: usize, receiver: usize, row: &mut [Complex32]) {
        for (z, recorded) in row.iter_mut().zip(self.recorded(sweep, receiver)) {
            *z = recorded;
        }
    }

    /// Correct the rows of a receiver.
    pub(super) fn correct(&mut self, receiver: usize, correction: Correction) {
        self.corrections.insert(receiver, correction);
    }

    /// Limits of the integer type of the files; `None` for codes and for floats.
    pub(super) fn integer_range(&self) -> Option<[f32; 2]> {
        let first = self.pieces.first()?.0.integer_range?;
        if self.table.is_some() {
            return None;
        }
        Some(first.map(|limit| limit as f32))
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

    /// Values of a row as recorded.
    fn recorded(&self, sweep: usize, receiver: usize) -> impl Iterator<Item = Complex32> + '_ {
        let piece = self.pieces.partition_point(|(_, before)| *before <= sweep) - 1;
        let (array, before) = &self.pieces[piece];
        let start = ((sweep - before) * self.num_receivers + receiver) * self.row_stride;
        (0..self.num_samples).map(move |k| {
            let i = start + k * self.sample_stride;
            match (&array.values, &self.table) {
                (Numbers::Real(values), None) => Complex32::new(values[i] as f32, 0.0),
                (Numbers::Complex(values), None) => values[i],
                (Numbers::Real(codes), Some(table)) => Complex32::new(table.real(codes[i]), 0.0),
                (Numbers::Complex(codes), Some(table)) => table.complex(codes[i]),
            }
        })
    }

    fn add(&self, sweep: usize, receiver: usize, row: &mut [Complex32]) {
        let correction = self.corrections.get(&receiver);
        let turned = self.phase == Some(PhaseSign::Plus);
        for (z, recorded) in row.iter_mut().zip(self.recorded(sweep, receiver)) {
            let value = correction.map_or(recorded, |correction| correction.apply(recorded));
            *z += if turned { value.conj() } else { value };
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
    let mut samples = match &recording.format {
        FormatKeys::Dca1000(keys) => dca1000(source, &keys.samples, phase)?,
        FormatKeys::Npz(keys) => array(source, Some(&keys.array), keys.layout, phase)?,
        FormatKeys::Npy(keys) => array(source, None, keys.layout, phase)?,
        FormatKeys::Touchstone => {
            if !matches!(kind, WaveformKeys::Stepped) {
                return Err(recording.file.fault(
                    "Touchstone files contain a value for each frequency: expected [radar] kind = \"stepped\"",
                ));
            }
            sweeps_of_analyser(source, phase)?
        }
    };
    let takes_complex = match kind {
        WaveformKeys::Pulsed(_) => Some("pulsed"),
        WaveformKeys::Stepped => Some("stepped"),
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
    if let Some(key) = &recording.table {
        let table = Table::read(key, source)?;
        let arrays = samples.pieces.iter();
        for (array, _) in arrays {
            table
                .check(array)
                .map_err(|message| recording.values_fault(message))?;
        }
        samples.table = Some(table);
    } else if let Some(message) = samples.range().fault() {
        return Err(recording.values_fault(message));
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
        corrections: BTreeMap::new(),
        table: None,
        band_hz: None,
    })
}

/// Sweeps of a vector network analyser, one file each.
fn sweeps_of_analyser(source: &Source, phase: Option<PhaseSign>) -> Result<Samples, Fault> {
    let recording = source.recording;
    if *recording.receivers != 1 {
        return Err(recording.receivers.fault(
            "a Touchstone file is one sweep of one receiver: choose it by 'parameter', and describe each receiver's files as a recording",
        ));
    }
    let ports = match &recording.parameter {
        None => None,
        Some(name) => Some(touchstone::parameter_of_name(name).ok_or_else(|| {
            name.fault(format!(
                "expected a scattering parameter such as \"s21\", found \"{}\"",
                **name
            ))
        })?),
    };
    let files = source.files()?;
    let fault = |message: String| recording.file.fault(message);
    let hold = |path: &Path, name: String, read: &dyn Fn(u64) -> Result<Array, String>| {
        let name = (path.to_path_buf(), Some(name));
        let held = source
            .arrays
            .hold(name, source.memory_bytes, |_, left| read(left));
        held.map_err(fault)
    };
    let first = files.first().cloned().unwrap_or_default();
    let parameter = format!("{ports:?}");
    let frequencies = hold(&first, "frequencies".to_owned(), &|left| {
        network::frequencies(&first, ports, left)
    })?;
    let frequencies_hz = frequencies.real().unwrap_or_default();
    let mut pieces = Vec::new();
    for path in files {
        let values = hold(&path, parameter.clone(), &|left| {
            network::values(&path, ports, frequencies_hz, left)
        })?;
        pieces.push((path, values, 1));
    }
    let (pieces, num_sweeps) = joined(source, pieces)?;
    let count = frequencies_hz.len();
    Ok(Samples {
        pieces,
        num_sweeps,
        num_receivers: 1,
        num_samples: count,
        sample_stride: 1,
        row_stride: count,
        // A delay turns a scattering parameter by exp(-j 2 pi f delay).
        phase: Some(phase.unwrap_or(PhaseSign::Minus)),
        real: false,
        corrections: BTreeMap::new(),
        table: None,
        band_hz: Some([
            frequencies_hz[0],
            (frequencies_hz[count - 1] - frequencies_hz[0]) / (count - 1) as f64,
        ]),
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
        corrections: BTreeMap::new(),
        table: None,
        band_hz: None,
    })
}
