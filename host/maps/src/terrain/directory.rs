//! Check of a TIFF's first directory before any allocation: a tag may claim more values than the file has bytes.

use std::io::{self, Read, Seek, SeekFrom};

/// Upper bound of the memory of a decoded tag value, bytes.
const VALUE_BYTES: u64 = 64;

/// Largest number of tags in a directory.
const MAX_TAGS: u64 = 4096;

/// Check that tags lie within the file and within a memory bound. Leaves the file at its beginning.
pub(crate) fn check<R: Read + Seek>(file: &mut R, allowed_bytes: u64) -> Result<(), String> {
    let checked = checked(file, allowed_bytes)
        .unwrap_or_else(|error| Err(format!("cannot read the TIFF directory: {error}")));
    file.rewind().map_err(|error| error.to_string())?;
    checked
}

fn checked<R: Read + Seek>(file: &mut R, allowed_bytes: u64) -> io::Result<Result<(), String>> {
    let end = file.seek(SeekFrom::End(0))?;
    file.rewind()?;
    let mut start = [0; 8];
    file.read_exact(&mut start)?;
    let little = match &start[..2] {
        b"II" => true,
        b"MM" => false,
        _ => return Ok(Err("expected a TIFF header (II or MM, 42 or 43)".to_owned())),
    };
    let mut numbers = Numbers { file, little };
    let big = match numbers.of(&start[2..4]) {
        42 => false,
        43 => true,
        _ => return Ok(Err("expected a TIFF header (II or MM, 42 or 43)".to_owned())),
    };
    let directory = match big {
        false => numbers.of(&start[4..8]),
        true => numbers.read(8)?,
    };
    numbers.file.seek(SeekFrom::Start(directory))?;
    let count = numbers.read(if big { 8 } else { 2 })?;
    if count > MAX_TAGS {
        return Ok(Err(format!(
            "the TIFF directory has {count} tags, expected at most {MAX_TAGS}"
        )));
    }
    for _ in 0..count {
        let tag = numbers.read(2)?;
        let kind = numbers.read(2)?;
        let word = if big { 8 } else { 4 };
        let values = numbers.read(word)?;
        let place = numbers.read(word)?;
        let size = match kind {
            3 | 8 => 2,
            4 | 9 | 11 | 13 => 4,
            5 | 10 | 12 | 16..=18 => 8,
            _ => 1,
        };
        let bytes = values.saturating_mul(size);
        let beyond = bytes > word as u64 && place.saturating_add(bytes) > end;
        if beyond || values.saturating_mul(VALUE_BYTES) > allowed_bytes {
            return Ok(Err(format!(
                "tag {tag} claims {values} values, more than the file or the memory limit holds; the file is truncated or damaged"
            )));
        }
    }
    Ok(Ok(()))
}

/// Unsigned integers in the file's byte order.
struct Numbers<'a, R> {
    file: &'a mut R,
    little: bool,
}

impl<R: Read> Numbers<'_, R> {
    fn of(&self, bytes: &[u8]) -> u64 {
        let fold = |number: u64, byte: &u8| number << 8 | u64::from(*byte);
        match self.little {
            true => bytes.iter().rev().fold(0, fold),
            false => bytes.iter().fold(0, fold),
        }
    }

    fn read(&mut self, bytes: usize) -> io::Result<u64> {
        let mut own = [0; 8];
        self.file.read_exact(&mut own[..bytes])?;
        Ok(self.of(&own[..bytes]))
    }
}
