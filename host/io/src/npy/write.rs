//! NumPy arrays written a few values at a time, for arrays that need not fit in memory.

use std::io::{self, BufWriter, Write};
use std::marker::PhantomData;

use num_complex::Complex32;

use super::header::MAGIC;

/// Number type of written arrays, little-endian.
pub trait Number: Copy {
    /// NumPy's name of the type.
    const KIND: &'static str;

    /// Write a value.
    ///
    /// # Errors
    /// Errors of the stream.
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

/// Header of an array of this shape.
pub(super) fn header<T: Number>(shape: &[usize]) -> Vec<u8> {
    let sizes: Vec<String> = shape.iter().map(usize::to_string).collect();
    // A Python tuple of one element needs a trailing comma.
    let comma = if shape.len() == 1 { "," } else { "" };
    let text = format!(
        "{{'descr': '{}', 'fortran_order': False, 'shape': ({}{comma}), }}",
        T::KIND,
        sizes.join(", ")
    );
    // NumPy requires the data to begin at a multiple of 64 bytes, after a newline.
    let length = (10 + text.len() + 1).next_multiple_of(64) - 10;
    let mut bytes = MAGIC.to_vec();
    bytes.extend([1, 0]);
    bytes.extend((length as u16).to_le_bytes());
    bytes.extend(format!("{text:<width$}\n", width = length - 1).bytes());
    bytes
}

/// Writer of an array in C order (last axis fastest).
pub struct ArrayWriter<W: Write, T> {
    stream: BufWriter<W>,
    /// Number of values not yet written.
    left: usize,
    kind: PhantomData<T>,
}

impl<W: Write, T: Number> ArrayWriter<W, T> {
    /// Begin an array of this shape.
    ///
    /// # Errors
    /// Errors of the stream.
    ///
    /// # Panics
    /// Panics if the shape has more than `usize::MAX` values.
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

    /// Write the next values.
    ///
    /// # Errors
    /// Errors of the stream.
    ///
    /// # Panics
    /// Panics if there are more values than the shape has.
    pub fn put(&mut self, values: &[T]) -> io::Result<()> {
        let left = self.left.checked_sub(values.len());
        self.left = left.expect("at most as many values as the shape has");
        for value in values {
            value.write(&mut self.stream)?;
        }
        Ok(())
    }

    /// Finish the array.
    ///
    /// # Errors
    /// Errors of the stream.
    ///
    /// # Panics
    /// Panics if values are missing.
    pub fn finish(mut self) -> io::Result<()> {
        assert_eq!(self.left, 0, "values are missing");
        self.stream.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn written_bytes_equal_numpy_save() {
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
