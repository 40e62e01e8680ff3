//! The samples of all pulses, from any format, pulse-major.
//!
//! `dca1000` is what a TI DCA1000 records of an xWR14xx, xWR16xx or xWR18xx over two LVDS lanes: int16, little-endian, two
//! I then two Q; of every sweep the samples of one receiver after those of the other.

use std::fs::File;
use std::io::Read;
use std::path::Path;
use std::sync::Arc;

use num_complex::Complex32;

use super::arrays::Source;
use crate::description::error::Found;
use crate::description::values::Values;
use crate::io::npy::{Array, Values as Numbers};

/// Samples as recorded.
pub(super) struct Samples {
    array: Arc<Array>,
    pub(super) num_pulses: usize,
    pub(super) num_samples: usize,
    /// Values from sample to sample, from pulse to pulse, and before the first.
    sample_stride: usize,
    pulse_stride: usize,
    offset: usize,
    /// Whether the sign of the phase is turned.
    conjugate: bool,
    /// Whether they are real numbers.
    pub(super) real: bool,
}

impl Samples {
    /// Those of some pulses, one after another.
    pub(super) fn of(&self, pulses: &[usize]) -> Vec<Complex32> {
        let mut samples = Vec::with_capacity(pulses.len() * self.num_samples);
        for pulse in pulses {
            let start = self.offset + pulse * self.pulse_stride;
            let places = (0..self.num_samples).map(|k| start + k * self.sample_stride);
            match &self.array.values {
                Numbers::Real(values) => {
                    samples.extend(places.map(|i| Complex32::new(values[i] as f32, 0.0)));
                }
                Numbers::Complex(values) if self.conjugate => {
                    samples.extend(places.map(|i| values[i].conj()));
                }
                Numbers::Complex(values) => samples.extend(places.map(|i| values[i])),
            }
        }
        samples
    }
}

/// Reads the samples that `[recording]` names.
pub(super) fn read(top: &Values, source: &Source) -> Result<Samples, Found> {
    let recording = source.recording;
    let conjugate = recording.text("phase") == "plus";
    let samples = match recording.text("format") {
        "dca1000" => dca1000(source, conjugate)?,
        _ => array(source, conjugate)?,
    };
    let kind = top.section("radar").text("kind");
    if samples.real && kind != "profiles" {
        return Err(recording.fault(
            "file",
            format!("its samples are real, and of kind = \"{kind}\" they are complex"),
        ));
    }
    if samples.num_pulses == 0 || samples.num_samples < 2 {
        return Err(recording.fault(
            "file",
            format!(
                "holds {} pulses of {} samples; at least one of two is wanted",
                samples.num_pulses, samples.num_samples
            ),
        ));
    }
    Ok(samples)
}

fn array(source: &Source, conjugate: bool) -> Result<Samples, Found> {
    let recording = source.recording;
    let (key, name) = match recording.text("format") {
        "npz" => ("array", Some(recording.text("array").to_owned())),
        _ => ("file", None),
    };
    let array = source.hold((source.file(), name));
    let array = array.map_err(|what| recording.fault(key, what))?;
    let [rows, columns] = array.shape[..] else {
        return Err(recording.fault(
            key,
            format!(
                "has shape {:?}; two axes, pulses and samples, are wanted",
                array.shape
            ),
        ));
    };
    let turned = recording.text("layout") == "samples-pulses";
    let (num_pulses, num_samples) = if turned {
        (columns, rows)
    } else {
        (rows, columns)
    };
    Ok(Samples {
        num_pulses,
        num_samples,
        sample_stride: if turned { columns } else { 1 },
        pulse_stride: if turned { 1 } else { columns },
        offset: 0,
        conjugate,
        real: array.real().is_some(),
        array,
    })
}

fn dca1000(source: &Source, conjugate: bool) -> Result<Samples, Found> {
    let recording = source.recording;
    let samples = recording.count("samples") as usize;
    let receivers = recording.count("receivers") as usize;
    let receiver = recording.count("receiver") as usize;
    if receiver > receivers {
        return Err(recording.fault(
            "receiver",
            format!("there are {receivers} receivers: choose one of them, or raise receivers"),
        ));
    }
    let fault = |what: String| recording.fault("file", what);
    let read = |name: &(_, _), left| lanes(Path::new(&name.0), left);
    let array = source
        .arrays
        .hold((source.file(), None), source.memory_bytes, read);
    let array = array.map_err(fault)?;
    let (held, pulse_stride) = (array.shape[0], samples * receivers);
    if !held.is_multiple_of(pulse_stride) {
        let (whole, over) = (held / pulse_stride, held % pulse_stride);
        return Err(recording.fault(
            "samples",
            format!(
                "{} holds {held} samples, which is {whole} sweeps of {samples} from each of {receivers} receivers and \
                 {over} samples over: check samples and receivers{}",
                source.file().display(),
                others(held, samples, receivers)
            ),
        ));
    }
    Ok(Samples {
        num_pulses: held / pulse_stride,
        num_samples: samples,
        sample_stride: 1,
        pulse_stride,
        offset: (receiver - 1) * samples,
        conjugate,
        real: false,
        array,
    })
}

/// Numbers of receivers and of samples that would come out even, in words.
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
        words += &format!("; receivers = {} would come out even", counts.join(" or "));
    }
    if !near.is_empty() {
        words += &format!("; so would samples = {}", near.join(" or "));
    }
    if words.is_empty() {
        words += ", and whether the file is whole";
    }
    words
}

/// All samples of a file of two I, two Q.
fn lanes(path: &Path, memory_bytes: u64) -> Result<Array, String> {
    let named = |error: std::io::Error| format!("cannot read {}: {error}", path.display());
    let mut file = File::open(path).map_err(named)?;
    let length = file.metadata().map_err(named)?.len();
    if length == 0 || !length.is_multiple_of(8) {
        return Err(format!(
            "{}: {length} bytes are no pairs of complex samples, 8 bytes each",
            path.display()
        ));
    }
    // Samples take twice the bytes of the file, which is held beside them.
    if length.saturating_mul(3) > memory_bytes {
        return Err(format!(
            "{}: {} bytes of memory are needed and {memory_bytes} are left: raise --memory",
            path.display(),
            length.saturating_mul(3)
        ));
    }
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes).map_err(named)?;
    let number = |pair: &[u8]| f32::from(i16::from_le_bytes([pair[0], pair[1]]));
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
