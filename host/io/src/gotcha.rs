//! AFRL GOTCHA volumetric data set: MATLAB v5 files.
//!
//! A file is one degree of azimuth: a structure `data` with `fp` (frequency x pulse, complex
//! single, K x N), `freq` (K, hertz), and per pulse the antenna's `x`, `y`, `z` and `r0`, its range
//! to scene centre (N each, metres). Fields `th`, `phi` and `af` (autofocus) are not used: the first
//! two follow from the position, and `af` does not sharpen the released images.
//!
//! The recorded phase is `-4 pi f (R - r0) / c` (Casteel et al. 2007; confirmed by focusing), which is this library's
//! convention with transmitter and receiver at (x, y, z) and the reference at the origin. The frame is local; the
//! scene's extent is not recorded.
//!
//! **Reference path.** The phase was compensated to the range before the range was stored. `r0` is stored as float32,
//! which has steps of 1 mm near 10 km, and x, y and z have steps of half of that. Their roundings are of similar size
//! but differ in effect. The error of `R(p) - R(0)` from a rounded position is the rounding times the *difference* of
//! two lines of sight, 1 % at 100 m from the centre. The error of `R(p) - r0` contains both roundings in full, 0.12
//! rad RMS at 9.6 GHz, independent from pulse to pulse. The reference path is therefore `2 |(x, y, z)|` if `r0`
//! equals that within the roundings in every pulse, and otherwise `2 r0` in all pulses.
//!
//! `freq` is stored as float32, which represents only multiples of 1024 Hz near 9.6 GHz. Start and step are therefore
//! those of the straight line fitted by least squares. A deviation from it of more than four such multiples, or a
//! quarter of the step, is an error (frequencies not equally spaced), and so is a band below 1 MHz (probably in GHz
//! or MHz). Rounding (296 Hz RMS) leaves standard deviations of 29 Hz and 0.12 Hz for start and step of K = 424
//! samples: a phase of less than 0.0001 rad over 100 m of path.
//!
//! Times are not recorded. [`Pulse::time_s`] is the pulse index, as if the PRI were 1 s: valid for the order, not for
//! velocities.
//!
//! Memory: the file, its unpacked data if it is packed, and its samples at once. [`needed_bytes`] computes the need
//! for the released files before reading. MATLAB may store numbers in fewer bytes, so the need is checked again once
//! the number of samples is known.

use std::borrow::Cow;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use glam::DVec3;
use num_complex::Complex32;

use super::frequencies::fit_line;
use super::input::Stamp;
use super::matlab::{Content, MatError, find_variable};
use super::matlab_fields::Fields;
use subaperture_model::geometry::SceneFrame;
use subaperture_model::phase_history::{
    Collection, InMemory, InputFile, PhaseConvention, PhaseReference, PhaseSign, Pulse, ReadError,
    Sweep, check_finite,
};

/// Peak memory of [`read`] in bytes for an unpacked file of this size (the released files are unpacked): file,
/// samples and geometry.
pub fn needed_bytes(file_bytes: u64) -> u64 {
    file_bytes.saturating_mul(2).saturating_add(1 << 20)
}

/// Read a whole file with at most `memory_bytes` of memory.
/// [`PhaseHistory::inputs`](subaperture_model::phase_history::PhaseHistory::inputs) of the result contains its
/// CRC-32.
///
/// # Errors
/// [`ReadError::Malformed`] if it is not a GOTCHA file, naming the field; [`ReadError::NotFinite`] for a NaN or
/// infinite sample; [`ReadError::Memory`]; [`ReadError::Io`].
pub fn read(path: impl AsRef<Path>, memory_bytes: u64) -> Result<InMemory, ReadError> {
    let path = path.as_ref();
    let io = |source| ReadError::Io {
        path: path.to_owned(),
        source,
    };
    let mut file = File::open(path).map_err(io)?;
    let metadata = file.metadata().map_err(io)?;
    let stamp = Stamp::of(&file).map_err(io)?;
    if !metadata.is_file() {
        return Err(malformed(path, "not a regular file"));
    }
    let memory = |needed_bytes| ReadError::Memory {
        path: path.to_owned(),
        needed_bytes,
        allowed_bytes: memory_bytes,
    };
    let needed = needed_bytes(metadata.len());
    if needed > memory_bytes {
        return Err(memory(needed));
    }
    let mut bytes = Vec::new();
    usize::try_from(metadata.len())
        .ok()
        .and_then(|len| bytes.try_reserve_exact(len).ok())
        .ok_or_else(|| memory(needed))?;
    file.by_ref()
        .take(metadata.len())
        .read_to_end(&mut bytes)
        .map_err(io)?;
    stamp.check(&file, path)?;
    from_bytes(path, bytes, memory_bytes)
}

/// As [`read`], from a file in memory; `name` stands for its path. Its bytes count as memory.
///
/// # Errors
/// As [`read`], without [`ReadError::Io`].
pub fn from_bytes(
    name: impl AsRef<Path>,
    bytes: Vec<u8>,
    memory_bytes: u64,
) -> Result<InMemory, ReadError> {
    let path = name.as_ref();
    let input = InputFile::with_crc32(
        path,
        bytes.len() as u64,
        format!("{:08x}", crc32fast::hash(&bytes)),
    );
    let (mut collection, samples) = parse(bytes, memory_bytes).map_err(|error| match error {
        MatError::Malformed(what) => malformed(path, &what),
        MatError::Memory(needed_bytes) => ReadError::Memory {
            path: path.to_owned(),
            needed_bytes,
            allowed_bytes: memory_bytes,
        },
    })?;
    collection.name = path
        .file_stem()
        .unwrap_or(path.as_os_str())
        .to_string_lossy()
        .into_owned();
    // Checked here in addition to `InMemory`, so that the error names the path.
    check_finite(
        &path.display().to_string(),
        0,
        collection.num_samples,
        &samples,
    )?;
    let convention = PhaseConvention::stated(PhaseSign::Minus, PhaseReference::Point(DVec3::ZERO));
    Ok(InMemory::new(collection, samples)?
        .with_inputs(vec![input])
        .with_convention(convention)
        .with_pulse_defects())
}

fn malformed(path: &Path, what: &str) -> ReadError {
    ReadError::Malformed {
        path: path.to_owned(),
        what: what.to_owned(),
    }
}

/// Takes ownership of the file's bytes, so that they are freed before the samples are returned.
fn parse(file: Vec<u8>, memory_bytes: u64) -> Result<(Collection, Vec<Complex32>), MatError> {
    if file.is_empty() {
        return Err(MatError::Malformed("the file is empty".to_owned()));
    }
    let data = find_variable(&file, "data", memory_bytes)?.map_err(|others| {
        let found = match others.as_slice() {
            [] => "none".to_owned(),
            some => some.join(", "),
        };
        MatError::Malformed(format!(
            "not a GOTCHA file: expected a structure 'data' with fp, freq, x, y, z and r0; \
             variables found: {found}"
        ))
    })?;
    let unpacked_bytes = match &data {
        Cow::Borrowed(_) => 0,
        Cow::Owned(bytes) => bytes.len(),
    };
    let held_bytes = (file.len() + unpacked_bytes) as u64;
    let fields = Fields::of(&data, "data", "fp, freq, x, y, z and r0")?;
    let (samples, num_samples, num_pulses) = samples(&fields, held_bytes, memory_bytes)?;
    let since = format!("data.fp has {num_samples} rows");
    let (start_hz, step_hz) = fit_line(&fields.values("freq", num_samples, &since)?)
        .map_err(|what| MatError::Malformed(format!("data.freq: {what}")))?;
    let since = format!("data.fp has {num_pulses} columns");
    let per_pulse = |name| fields.values(name, num_pulses, &since);
    let (x, y, z, r0) = (
        per_pulse("x")?,
        per_pulse("y")?,
        per_pulse("z")?,
        per_pulse("r0")?,
    );
    if let Some(n) = r0.iter().position(|&r| r <= 0.0) {
        return Err(MatError::Malformed(format!(
            "data.r0 of pulse {n}: expected a positive range in metres, found {}",
            r0[n]
        )));
    }
    let antenna = |n: usize| DVec3::new(x[n], y[n], z[n]);
    let by_position = (0..num_pulses).all(|n| is_range_of(r0[n], antenna(n)));
    let pulse = |n: usize| {
        let antenna = antenna(n);
        let range_m = if by_position { antenna.length() } else { r0[n] };
        Pulse {
            time_s: n as f64,
            transmitter_m: antenna,
            receiver_m: antenna,
            reference_m: DVec3::ZERO,
            reference_path_m: 2.0 * range_m,
            start_hz,
            step_hz,
            sweep: Sweep::AT_ONCE,
            recorded_path_m: None,
        }
    };
    let pulses: Vec<Pulse> = (0..num_pulses).map(pulse).collect();
    let fault = |(n, pulse): (usize, &Pulse)| pulse.fault(num_samples).map(|what| (n, what));
    if let Some((n, what)) = pulses.iter().enumerate().find_map(fault) {
        return Err(MatError::Malformed(format!("pulse {n}: {what}")));
    }
    let collection = Collection {
        name: String::new(),
        num_samples,
        pulses,
        frame: SceneFrame::Local,
        extent: None,
        timed: false,
    };
    Ok((collection, samples))
}

/// Whether `range_m` equals the length of `antenna_m` within storage rounding. The tolerance is twice the largest
/// rounding; the released files use half of that.
pub(super) fn is_range_of(range_m: f64, antenna_m: DVec3) -> bool {
    let length_m = antenna_m.length();
    let of_position = antenna_m.abs() / length_m;
    let rounded = antenna_m.to_array().map(largest_rounding);
    let allowed_m = largest_rounding(range_m) + of_position.dot(DVec3::from(rounded));
    (range_m - length_m).abs() <= 2.0 * allowed_m
}

/// Half the step at `value` of float32 if it represents the value exactly, otherwise of float64.
fn largest_rounding(value: f64) -> f64 {
    let (value, single) = (value.abs(), value.abs() as f32);
    if f64::from(single) == value {
        (f64::from(single.next_up()) - value) / 2.0
    } else {
        (value.next_up() - value) / 2.0
    }
}

/// Samples `fp` (pulse-major in MATLAB's order), number of samples per pulse, number of pulses. `held_bytes`, the samples and all vectors
/// must fit `memory_bytes`.
fn samples(
    fields: &Fields,
    held_bytes: u64,
    memory_bytes: u64,
) -> Result<(Vec<Complex32>, usize, usize), MatError> {
    let array = fields.array("fp")?;
    let (
        &[num_samples, num_pulses],
        Content::Numeric {
            real,
            imaginary: Some(imaginary),
        },
    ) = (array.dimensions.as_slice(), &array.content)
    else {
        return Err(MatError::Malformed(format!(
            "data.fp: expected a complex matrix, frequencies x pulses, found {}",
            array.describe()
        )));
    };
    if num_pulses == 0 || num_samples < 2 {
        return Err(MatError::Malformed(format!(
            "data.fp is {num_samples} x {num_pulses}: no image can be formed from {num_pulses} pulses of \
             {num_samples} frequencies (at least 1 of 2)"
        )));
    }
    // Per sample, per frequency, and per pulse with its x, y, z and r0.
    let own_bytes = real.len() * size_of::<Complex32>()
        + num_samples * size_of::<f64>()
        + num_pulses * (size_of::<Pulse>() + 4 * size_of::<f64>());
    let needed = held_bytes + own_bytes as u64;
    if needed > memory_bytes {
        return Err(MatError::Memory(needed));
    }
    let mut samples = Vec::new();
    samples
        .try_reserve_exact(real.len())
        .map_err(|_| MatError::Memory(needed))?;
    samples.extend(
        real.iter()
            .zip(imaginary.iter())
            .map(|(re, im)| Complex32::new(re as f32, im as f32)),
    );
    Ok((samples, num_samples, num_pulses))
}
