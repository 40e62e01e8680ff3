//! NumPy arrays written a few values at a time, for arrays that need not fit in memory.

use std::io::{self, BufWriter, Write};
use std::marker::PhantomData;

use num_complex::Complex32;

use super::header::MAGIC;

/// A kind of number that arrays are written of, little-endian.
pub trait Number: Copy {
    /// NumPy's name of it.
    const KIND: &'static str;

    /// Writes one.
    ///
    /// # Errors
    /// Those of the stream.
    fn write(self, stream: &mut impl Write) -> io::Result<()>;
}

impl Number for f64 {
    const KIND: &'static str = "<f8";

    fn write(self, stream: &mut impl Write) -> io::Result<()> {
        stream.write_all(&self.to_le_bytes())
    }
}

impl Number for Complex32 {
    const KIND: &'static str = "<c8";

    fn write(self, stream: &mut impl Write) -> io::Result<()> {
        stream.write_all(&self.re.to_le_bytes())?;
        stream.write_all(&self.im.to_le_bytes())
    }
}

/// The header of an array of this shape.
pub(super) fn header<T: Number>(shape: &[usize]) -> Vec<u8> {
    let sizes: Vec<String> = shape.iter().map(usize::to_string).collect();
    // Of one size Python wants a comma behind it.
    let comma = if shape.len() == 1 { "," } else { "" };
    let text = format!(
        "{{'descr': '{}', 'fortran_order': False, 'shape': ({}{comma}), }}",
        T::KIND,
        sizes.join(", ")
    );
    // NumPy wants the data to begin at a multiple of 64, behind a newline.
    let length = (10 + text.len() + 1).next_multiple_of(64) - 10;
    let mut bytes = MAGIC.to_vec();
    bytes.extend([1, 0]);
    bytes.extend((length as u16).to_le_bytes());
    bytes.extend(format!("{text:<width$}\n", width = length - 1).bytes());
    bytes
}

/// An array that is being written, in C order: the last axis is fastest.
pub struct ArrayWriter<W: Write, T> {
    stream: BufWriter<W>,
    /// Values to come.
    left: usize,
    kind: PhantomData<T>,
}

impl<W: Write, T: Number> ArrayWriter<W, T> {
    /// Begins an array of this shape.
    ///
    /// # Errors
    /// Those of the stream.
    ///
    /// # Panics
    /// If the shape has more than `usize::MAX` values.
    pub fn new(stream: W, shape: &[usize]) -> io::Result<Self> {
        let left = shape
            .iter()
            .try_fold(1usize, |n, &size| n.checked_mul(size));
        let mut stream = BufWriter::new(stream);
        stream.write_all(&header::<T>(shape))?;
        Ok(Self {
            stream,
            left: left.expect("arrays have at most usize::MAX values"),
            kind: PhantomData,
        })
    }

    /// Writes the next values.
    ///
    /// # Errors
    /// Those of the stream.
    ///
    /// # Panics
    /// If they are more than the shape has.
    pub fn put(&mut self, values: &[T]) -> io::Result<()> {
        let left = self.left.checked_sub(values.len());
        self.left = left.expect("no more values than the shape has");
        for value in values {
            value.write(&mut self.stream)?;
        }
        Ok(())
    }

    /// Ends the array.
    ///
    /// # Errors
    /// Those of the stream.
    ///
    /// # Panics
    /// If values are missing.
    pub fn finish(mut self) -> io::Result<()> {
        assert_eq!(self.left, 0, "values are missing");
        self.stream.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bytes_are_those_of_numpy() {
        let mut bytes = Vec::new();
        let mut writer = ArrayWriter::new(&mut bytes, &[3]).unwrap();
        writer.put(&[1.0, -2.5]).unwrap();
        writer.put(&[0.0f64]).unwrap();
        writer.finish().unwrap();
        // numpy.save of numpy.array([1, -2.5, 0.0]).
        let header = b"\x93NUMPY\x01\0v\0{'descr': '<f8', 'fortran_order': False, 'shape': (3,), }";
        assert!(bytes.starts_with(header));
        assert_eq!(bytes[127], b'\n');
        assert!(bytes[header.len()..127].iter().all(|&b| b == b' '));
        let data = [1.0f64, -2.5, 0.0].map(f64::to_le_bytes).concat();
        assert_eq!(bytes[128..], data);
    }
}
