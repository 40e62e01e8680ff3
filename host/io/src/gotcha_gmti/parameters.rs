//! Parameters of a collection from its MATLAB files.

use std::borrow::Cow;
use std::path::Path;

use super::names::Files;
use super::settings::plausible_prf;
use crate::container::Source;
use crate::matlab::{MatError, find_variable};
use crate::matlab_fields::Fields;
use subaperture_model::phase_history::ReadError;

/// Memory of the parameters of a pulse, bytes: those of a channel, positions and ranges, and a copy of one vector while it is read.
pub(super) const PULSE_BYTES: u64 = 10 * 8;

const AUXILIARY: &str =
    "readPrm (Fsamp, deltaRbin), circshiftFloorPHradius and PHradius_sampleError";
const POSITIONS: &str = "APCpos, APCMag, Gamma and PHradius";

/// Parameters of a channel: `aux_SPIE`.
pub(super) struct Auxiliary {
    /// Sampling frequency, hertz.
    pub(super) sampling_hz: f64,
    /// Displacement of the reference range, range bins.
    pub(super) range_bins: Vec<f64>,
    /// Circular shift of the samples, samples before decimation.
    pub(super) shifts: Vec<f64>,
    /// Error of the shift, samples before decimation.
    pub(super) shift_errors: Vec<f64>,
    /// Pulse repetition frequency, hertz, if recorded.
    pub(super) prf_hz: Option<f64>,
}

impl Auxiliary {
    /// Read `source` for `count` pulses; `since` is the reason for their number.
    pub(super) fn read(
        source: &Source,
        count: usize,
        since: &str,
        memory_bytes: u64,
    ) -> Result<Self, ReadError> {
        with_structure(
            source,
            ("aux_SPIE", AUXILIARY),
            count,
            memory_bytes,
            |fields| {
                let reading = fields.part("readPrm", "Fsamp and deltaRbin")?;
                let prf_hz = match fields.has("PRF") {
                    false => None,
                    true => Some(
                        plausible_prf(fields.first_positive("PRF", "hertz")?).map_err(|fault| {
                            MatError::Malformed(format!("aux_SPIE.PRF: {fault}"))
                        })?,
                    ),
                };
                Ok(Self {
                    sampling_hz: reading.first_positive("Fsamp", "hertz")?,
                    range_bins: reading.values("deltaRbin", count, since)?,
                    shifts: fields.values("circshiftFloorPHradius", count, since)?,
                    shift_errors: fields.values_or_one("PHradius_sampleError", count, since)?,
                    prf_hz,
                })
            },
        )
    }
}

/// Parameters common to the channels: `paux`.
pub(super) struct Positions {
    /// Coordinates of the antenna, pulse after pulse, metres.
    pub(super) antennas_m: Vec<f64>,
    /// Range to the scene centre, metres.
    pub(super) ranges_m: Vec<f64>,
    /// Chirp rate, hertz per second.
    pub(super) chirp_hz_s: f64,
    /// Frequency of the polar format's reference radius, hertz.
    pub(super) radii_hz: Vec<f64>,
}

impl Positions {
    /// Open the file of antenna positions, or state how to make it.
    pub(super) fn open(files: &Files) -> Result<Source, ReadError> {
        let path = files.positions();
        let original = path.with_extension("");
        Source::open(&path).map_err(|error| match error {
            ReadError::Io { source, .. } if source.kind() == std::io::ErrorKind::NotFound => {
                let [original, name] = [&original, &path].map(|path| file_name(path));
                ReadError::malformed(
                    &path,
                    format!(
                        "expected the antenna positions in this file, found no file: AFRL's {original} is read by its own readPAUXData.m \
                         only; in MATLAB, paux = readPAUXData('{original}'); save('{name}', 'paux', '-v6')"
                    ),
                )
            }
            other => other,
        })
    }

    /// Read `source` for `count` pulses; `since` is the reason for their number.
    pub(super) fn read(
        source: &Source,
        count: usize,
        since: &str,
        memory_bytes: u64,
    ) -> Result<Self, ReadError> {
        with_structure(source, ("paux", POSITIONS), count, memory_bytes, |fields| {
            let read = Self {
                antennas_m: fields.matrix("APCpos", [3, count], since)?,
                ranges_m: fields.values("APCMag", count, since)?,
                chirp_hz_s: fields.first_positive("Gamma", "hertz per second")?,
                radii_hz: fields.values("PHradius", count, since)?,
            };
            match read.ranges_m.iter().position(|&r| r <= 0.0) {
                None => Ok(read),
                Some(n) => Err(MatError::Malformed(format!(
                    "paux.APCMag of pulse {n}: expected a positive range in metres, found {}",
                    read.ranges_m[n]
                ))),
            }
        })
    }
}

fn file_name(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default();
    name.to_string_lossy().into_owned()
}

/// Read values of a structure of a MATLAB file, by its name and that of its fields, for `count` pulses.
fn with_structure<T>(
    source: &Source,
    (variable, content): (&str, &str),
    count: usize,
    memory_bytes: u64,
    read: impl FnOnce(&Fields) -> Result<T, MatError>,
) -> Result<T, ReadError> {
    let own_bytes = PULSE_BYTES.saturating_mul(count as u64);
    source.check_memory(source.len().saturating_add(own_bytes), memory_bytes)?;
    let left_bytes = memory_bytes - own_bytes;
    let bytes = source.bytes(0, source.len(), "the file")?;
    let fault = |error: MatError| match error {
        MatError::Malformed(fault) => source.malformed(fault),
        MatError::Memory(needed_bytes) => ReadError::Memory {
            path: source.path().to_owned(),
            needed_bytes: needed_bytes.saturating_add(own_bytes),
            allowed_bytes: memory_bytes,
        },
    };
    let found = find_variable(&bytes, variable, left_bytes).map_err(fault)?;
    let structure: Cow<[u8]> = found.map_err(|others| {
        let others = match others.as_slice() {
            [] => "none".to_owned(),
            some => some.join(", "),
        };
        source.malformed(format!(
            "expected a structure '{variable}' with {content}; variables found: {others}"
        ))
    })?;
    let fields = Fields::of(&structure, variable, content).map_err(fault)?;
    read(&fields).map_err(fault)
}
