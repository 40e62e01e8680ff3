//! Files of 16-bit integers, as a TI DCA1000 and most other capture programs write them.

use std::io::Read;
use std::path::Path;

use num_complex::Complex32;

use super::keys::Order;
use crate::input::open_file;
use crate::npy::{Array, Values as Numbers};
use subaperture_describe::error::ALLOW_MORE_MEMORY;

/// Limits of the integers.
const RANGE: [f64; 2] = [i16::MIN as f64, i16::MAX as f64];

/// Message that lists numbers of receivers and of samples that divide the file.
pub(super) fn others(held: usize, samples: usize, receivers: usize) -> String {
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
pub(super) fn lanes(path: &Path, order: Order, memory_bytes: u64) -> Result<Array, String> {
    let named = |error: std::io::Error| format!("cannot read {}: {error}", path.display());
    let file = open_file(path).map_err(named)?;
    let length = file.metadata().map_err(named)?.len();
    let unit = order.unit_bytes();
    if length == 0 || !length.is_multiple_of(unit) {
        let unit_name = match order {
            Order::Iiqq => "pairs of complex samples",
            Order::Iqiq => "complex samples",
            Order::Real => "real samples",
        };
        return Err(format!(
            "{}: expected {unit_name} of {unit} bytes each, found {length} bytes in total",
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
            integer_range: Some(RANGE),
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
            integer_range: Some(RANGE),
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
        integer_range: Some(RANGE),
    })
}
