//! Conversion between samples and bytes.
//!
//! Little endian, real part first, as stated by [`Encoding`]. Readers are iterators over the bytes of a message. They
//! need no alignment and ignore an incomplete sample at the end. Writers fill a buffer from its start and return the
//! bytes written, or `None` if the buffer is too short.
//!
//! ```
//! use subaperture_core::link::{complex32s, write_complex32s};
//! use subaperture_core::Complex32;
//! let samples = [Complex32::new(1.0, -2.0), Complex32::new(0.5, 0.0)];
//! let mut buffer = [0; 20];
//! let bytes = write_complex32s(&samples, &mut buffer).expect("16 of 20 bytes");
//! assert_eq!(bytes.len(), 16);
//! assert_eq!(bytes[..4], 1.0f32.to_le_bytes());
//! assert!(complex32s(bytes).eq(samples));
//! ```

use num_complex::{Complex, Complex32};

use super::{Encoding, PixelEncoding};
use crate::Sc16;
use crate::cfar::Detection;
use crate::stream::{BlockFloat, MapSamples, PatchMap, power_of_two};

/// Read float32 values of 4 bytes.
pub fn f32s(bytes: &[u8]) -> impl ExactSizeIterator<Item = f32> + Clone + '_ {
    bytes
        .as_chunks()
        .0
        .iter()
        .map(|value| f32::from_le_bytes(*value))
}

/// Write float32 values of 4 bytes. `None` if the buffer is too short.
pub fn write_f32s<'b>(values: &[f32], buffer: &'b mut [u8]) -> Option<&'b [u8]> {
    write(values.iter().map(|value| value.to_le_bytes()), buffer)
}

/// Maximum number of antennas in a message.
pub const MAX_ANTENNAS: usize = 11;

/// Read positions in the plane, two float64 each.
pub fn places(bytes: &[u8]) -> impl ExactSizeIterator<Item = [f64; 2]> + Clone + '_ {
    bytes.as_chunks().0.iter().map(|place| {
        let [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p] = *place;
        [
            f64::from_le_bytes([a, b, c, d, e, f, g, h]),
            f64::from_le_bytes([i, j, k, l, m, n, o, p]),
        ]
    })
}

/// Write positions in the plane, two float64 each. `None` if the buffer is too short.
pub fn write_places<'b>(places: &[[f64; 2]], buffer: &'b mut [u8]) -> Option<&'b [u8]> {
    let places = places.iter().map(|[x, y]| {
        let ([a, b, c, d, e, f, g, h], [i, j, k, l, m, n, o, p]) =
            (x.to_le_bytes(), y.to_le_bytes());
        [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p]
    });
    write(places, buffer)
}

/// Read samples in [`Encoding::Complex32`].
pub fn complex32s(bytes: &[u8]) -> impl ExactSizeIterator<Item = Complex32> + Clone + '_ {
    bytes.as_chunks().0.iter().map(|sample| {
        let [a, b, c, d, e, f, g, h] = *sample;
        Complex32::new(
            f32::from_le_bytes([a, b, c, d]),
            f32::from_le_bytes([e, f, g, h]),
        )
    })
}

/// Write samples in [`Encoding::Complex32`]. `None` if the buffer is too short.
pub fn write_complex32s<'b>(samples: &[Complex32], buffer: &'b mut [u8]) -> Option<&'b [u8]> {
    let samples = samples.iter().map(|sample| {
        let ([a, b, c, d], [e, f, g, h]) = (sample.re.to_le_bytes(), sample.im.to_le_bytes());
        [a, b, c, d, e, f, g, h]
    });
    write(samples, buffer)
}

/// Read samples in [`Encoding::Sc16`].
pub fn sc16s(bytes: &[u8]) -> impl ExactSizeIterator<Item = Sc16> + Clone + '_ {
    bytes.as_chunks().0.iter().map(|sample| {
        let [a, b, c, d] = *sample;
        Sc16::from_bits(i16::from_le_bytes([a, b]), i16::from_le_bytes([c, d]))
    })
}

/// Read pairs of reference and echo samples of 8 bytes.
pub fn pairs(bytes: &[u8]) -> impl ExactSizeIterator<Item = [Complex<i16>; 2]> + Clone + '_ {
    bytes.as_chunks().0.iter().map(|pair| {
        let [a, b, c, d, e, f, g, h] = *pair;
        let counts = |re, im| Complex::new(i16::from_le_bytes(re), i16::from_le_bytes(im));
        [counts([a, b], [c, d]), counts([e, f], [g, h])]
    })
}

/// Write pairs of reference and echo samples of 8 bytes. `None` if the buffer is too short.
pub fn write_pairs<'b>(pairs: &[[Complex<i16>; 2]], buffer: &'b mut [u8]) -> Option<&'b [u8]> {
    let pairs = pairs.iter().map(|[reference, echo]| {
        let ([a, b], [c, d]) = (reference.re.to_le_bytes(), reference.im.to_le_bytes());
        let ([e, f], [g, h]) = (echo.re.to_le_bytes(), echo.im.to_le_bytes());
        [a, b, c, d, e, f, g, h]
    });
    write(pairs, buffer)
}

/// Write samples in [`Encoding::Sc16`]. `None` if the buffer is too short.
pub fn write_sc16s<'b>(samples: &[Sc16], buffer: &'b mut [u8]) -> Option<&'b [u8]> {
    let samples = samples.iter().map(|sample| {
        let ([a, b], [c, d]) = (sample.re.to_le_bytes(), sample.im.to_le_bytes());
        [a, b, c, d]
    });
    write(samples, buffer)
}

/// Write a map row in [`Encoding::Sc16`]: mantissas, then block exponents. `None` if the buffer is too short.
pub fn write_block_row<'b>(
    mantissas: &[Sc16],
    exponents: &[i8],
    buffer: &'b mut [u8],
) -> Option<&'b [u8]> {
    let len = write_sc16s(mantissas, buffer)?.len();
    let (_, rest) = buffer.split_at_mut_checked(len)?;
    let total = len.checked_add(write(exponents.iter().map(|e| e.to_le_bytes()), rest)?.len())?;
    buffer.get(..total)
}

/// Write row `row` of a map, the lowest Doppler bin first, in the encoding of its samples. `None` if the map has no
/// such row or the buffer is too short.
pub fn write_map_row<'b>(map: &PatchMap<'_>, row: usize, buffer: &'b mut [u8]) -> Option<&'b [u8]> {
    let width = map.header.patch.num_range_bins();
    let part = |len: usize| {
        let start = row.checked_mul(len)?;
        Some(start..start.checked_add(len)?)
    };
    match map.samples {
        MapSamples::Float(samples) => write_complex32s(samples.get(part(width)?)?, buffer),
        MapSamples::Fixed(BlockFloat {
            mantissas,
            exponents,
        }) => {
            let exponents = exponents.get(part(BlockFloat::blocks(width))?)?;
            write_block_row(mantissas.get(part(width)?)?, exponents, buffer)
        }
    }
}

/// Number of bytes of a map row of `width` samples. Sc16 includes one exponent per [`BlockFloat::BLOCK`] samples or part
/// thereof. `None` on overflow.
pub const fn row_bytes(encoding: Encoding, width: usize) -> Option<usize> {
    let Some(samples) = width.checked_mul(encoding.sample_bytes()) else {
        return None;
    };
    match encoding {
        Encoding::Complex32 => Some(samples),
        Encoding::Sc16 => samples.checked_add(BlockFloat::blocks(width)),
    }
}

/// Number of bytes of `count` pixels of a chip. `None` on overflow.
pub const fn pixel_bytes(encoding: PixelEncoding, count: usize) -> Option<usize> {
    match encoding {
        PixelEncoding::Complex32 => row_bytes(Encoding::Complex32, count),
        PixelEncoding::Sc16 => row_bytes(Encoding::Sc16, count),
        PixelEncoding::Power => count.checked_mul(4),
    }
}

/// Map row, or part of a chip, as received.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row<'a> {
    encoding: PixelEncoding,
    samples: &'a [u8],
    exponents: &'a [u8],
}

impl<'a> Row<'a> {
    /// Interpret `bytes` as a row of `width` samples. `None` if their number is not [`row_bytes`].
    pub fn new(encoding: Encoding, width: usize, bytes: &'a [u8]) -> Option<Self> {
        Self::of_pixels(encoding.into(), width, bytes)
    }

    /// Interpret `bytes` as `count` pixels of a chip. `None` if their number is not [`pixel_bytes`].
    pub fn of_pixels(encoding: PixelEncoding, count: usize, bytes: &'a [u8]) -> Option<Self> {
        if pixel_bytes(encoding, count)? != bytes.len() {
            return None;
        }
        let samples = match encoding {
            PixelEncoding::Sc16 => count.checked_mul(Encoding::Sc16.sample_bytes())?,
            PixelEncoding::Complex32 | PixelEncoding::Power => bytes.len(),
        };
        let (samples, exponents) = bytes.split_at_checked(samples)?;
        Some(Self {
            encoding,
            samples,
            exponents,
        })
    }

    /// Values in ascending range order, exact in every encoding; power as real parts.
    pub fn values(&self) -> impl Iterator<Item = Complex32> + Clone + use<'a> {
        // All but one are empty.
        let none = [].as_slice();
        let (complex, mantissas, real) = match self.encoding {
            PixelEncoding::Complex32 => (self.samples, none, none),
            PixelEncoding::Sc16 => (none, self.samples, none),
            PixelEncoding::Power => (none, none, self.samples),
        };
        let exponents = self.exponents.iter();
        let scales = exponents.flat_map(|e| {
            core::iter::repeat_n(power_of_two(i8::from_le_bytes([*e])), BlockFloat::BLOCK)
        });
        let scaled = sc16s(mantissas).zip(scales);
        complex32s(complex)
            .chain(scaled.map(|(mantissa, scale)| mantissa.to_complex32() * scale))
            .chain(f32s(real).map(Complex32::from))
    }
}

/// Number of pixels of every part of an image chip except the last.
pub const CHIP_PART_PIXELS: usize = 64;

/// Write `scale` times some pixels of an image chip. In [`PixelEncoding::Sc16`] each block of 32 has the smallest exponent of two
/// that holds its largest part, so a pixel is rounded to `2^-15` of that part. In [`PixelEncoding::Power`] only real parts are
/// written. `None` if the buffer is too short.
pub fn write_pixels<'b>(
    encoding: PixelEncoding,
    pixels: &[Complex32],
    scale: f32,
    buffer: &'b mut [u8],
) -> Option<&'b [u8]> {
    let places = buffer.get_mut(..pixel_bytes(encoding, pixels.len())?)?;
    let scaled = |pixel: &Complex32| Complex32::new(pixel.re * scale, pixel.im * scale);
    match encoding {
        PixelEncoding::Complex32 => {
            for (place, pixel) in places.as_chunks_mut().0.iter_mut().zip(pixels) {
                let z = scaled(pixel);
                let ([a, b, c, d], [e, f, g, h]) = (z.re.to_le_bytes(), z.im.to_le_bytes());
                *place = [a, b, c, d, e, f, g, h];
            }
        }
        PixelEncoding::Power => {
            for (place, pixel) in places.as_chunks_mut().0.iter_mut().zip(pixels) {
                *place = (pixel.re * scale).to_le_bytes();
            }
        }
        PixelEncoding::Sc16 => {
            let mantissas = pixels.len().checked_mul(Encoding::Sc16.sample_bytes())?;
            let (samples, exponents) = places.split_at_mut_checked(mantissas)?;
            let bytes = 4 * BlockFloat::BLOCK;
            let blocks = samples.chunks_mut(bytes).zip(exponents);
            for ((samples, exponent), pixels) in blocks.zip(pixels.chunks(BlockFloat::BLOCK)) {
                let parts = pixels.iter().map(scaled).flat_map(|z| [z.re, z.im]);
                let power = exponent_of(parts.map(libm::fabsf).fold(0.0, f32::max));
                *exponent = power.to_le_bytes()[0];
                let inverse = power_of_two(power.saturating_neg());
                for (place, pixel) in samples.as_chunks_mut().0.iter_mut().zip(pixels) {
                    let (z, _) = Sc16::from_complex32(scaled(pixel) * inverse);
                    let ([a, b], [c, d]) = (z.re.to_le_bytes(), z.im.to_le_bytes());
                    *place = [a, b, c, d];
                }
            }
        }
    }
    Some(places)
}

/// Smallest exponent of two by which `largest` becomes a part in `[0, 1)` that does not round to 1.
fn exponent_of(largest: f32) -> i8 {
    if largest == 0.0 || !largest.is_finite() {
        return 0;
    }
    let (fraction, exponent) = libm::frexpf(largest);
    let exponent = if libm::roundf(fraction * 32768.0) < 32768.0 {
        exponent
    } else {
        exponent.saturating_add(1)
    };
    exponent.clamp(-126, 126) as i8
}

/// Maximum number of bytes of detections per frame.
pub const MAX_LIST_BYTES: usize = 160;

/// Size of a detection without its values in bytes.
const BARE_BYTES: usize = 16;

/// Size of a detection in this many channels in bytes.
pub const fn detection_bytes(channels: usize) -> usize {
    Encoding::Complex32
        .sample_bytes()
        .saturating_mul(channels)
        .saturating_add(BARE_BYTES)
}

/// Read detections in this many channels: range bin, Doppler bin, power and noise as float32, and the value of each channel's map.
pub fn detections(
    bytes: &[u8],
    channels: usize,
) -> impl ExactSizeIterator<
    Item = (
        Detection,
        impl ExactSizeIterator<Item = Complex32> + Clone + '_,
    ),
> + Clone
+ '_ {
    let records = bytes.chunks_exact(detection_bytes(channels));
    records.map(|record| {
        let (bare, values) = record.split_at_checked(BARE_BYTES).unwrap_or_default();
        let mut numbers = f32s(bare);
        let mut next = || numbers.next().unwrap_or(0.0);
        let detection = Detection {
            range_bin: next(),
            doppler_bin: next(),
            power: next(),
            noise: next(),
        };
        (detection, complex32s(values))
    })
}

/// Write detections with the first `channels` of their `values`, [`detection_bytes`] each. `None` if the buffer or a list is too
/// short.
pub fn write_detections<'b, const MAX: usize>(
    detections: &[Detection],
    values: &[[Complex32; MAX]],
    channels: usize,
    buffer: &'b mut [u8],
) -> Option<&'b [u8]> {
    let bytes = detection_bytes(channels);
    let places = buffer.get_mut(..detections.len().checked_mul(bytes)?)?;
    let values = values.get(..detections.len())?;
    let records = places.chunks_exact_mut(bytes).zip(detections);
    for ((record, detection), values) in records.zip(values) {
        let Detection {
            range_bin,
            doppler_bin,
            power,
            noise,
        } = *detection;
        let (bare, rest) = record.split_at_mut_checked(BARE_BYTES)?;
        write_f32s(&[range_bin, doppler_bin, power, noise], bare)?;
        write_complex32s(values.get(..channels)?, rest)?;
    }
    Some(places)
}

/// Write items of `N` bytes contiguously.
fn write<const N: usize>(
    items: impl ExactSizeIterator<Item = [u8; N]>,
    buffer: &mut [u8],
) -> Option<&[u8]> {
    let places = buffer.get_mut(..items.len().checked_mul(N)?)?;
    for (place, item) in places.as_chunks_mut().0.iter_mut().zip(items) {
        *place = item;
    }
    Some(places)
}
