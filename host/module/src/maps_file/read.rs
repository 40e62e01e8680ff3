//! Reader of maps files.

use std::collections::HashSet;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use subaperture_core::stream::MapHeader;

use super::fields::{self, Fields};
use super::{
    END, HEAD, HEADER_BYTES, MAGIC, MAP, MAX_MAPS, MAX_TEXT_BYTES, PREAMBLE_BYTES, SECTION_BYTES,
    TAIL, TRAILER_BYTES, VERSION, fault, preamble, samples_bytes, section_crc,
};
use crate::maps::{Maps, OwnedMap, Run, RunTotals};
use subaperture_io::input::{Stamp, open_file};
use subaperture_model::phase_history::{InputFile, ReadError};

/// Bytes of an offset and a header in the index.
const ENTRY_BYTES: u64 = 8 + HEADER_BYTES as u64;

/// Open maps file.
#[derive(Debug)]
pub struct MapFile {
    source: Source,
    run: Run,
    closing: Option<RunTotals>,
    places: Vec<u64>,
    headers: Vec<MapHeader>,
}

/// Header of a section.
struct Section {
    tag: [u8; 4],
    crc: u32,
    length: u64,
}

/// Content at a file offset that should hold a section.
enum SectionAt {
    /// A section that lies entirely within the file.
    Whole(Section),
    /// End of the file.
    End,
}

impl MapFile {
    /// Open a file and read its index. A truncated file is scanned up to its last complete map.
    ///
    /// # Errors
    /// [`ReadError`] if the file cannot be read, is not a maps file, or is damaged before its first map.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        Self::open_within(path, u64::MAX)
    }

    /// Like [`Self::open`], with at most `memory_bytes` of memory.
    ///
    /// # Errors
    /// As for [`Self::open`]; [`ReadError::Memory`] before the limit is exceeded.
    pub fn open_within(path: &Path, memory_bytes: u64) -> Result<Self, ReadError> {
        let mut source = Source::open(path)?;
        source.check_preamble()?;
        let head = match source.section(PREAMBLE_BYTES)? {
            SectionAt::Whole(section) if section.tag == HEAD => section,
            _ => return Err(source.malformed("first section is not a complete HEAD")),
        };
        // The texts of a run are copied from the payload.
        source.check_memory(2 * head.length.min(MAX_TEXT_BYTES), memory_bytes)?;
        let payload = source.payload(PREAMBLE_BYTES, &head, MAX_TEXT_BYTES, "HEAD")?;
        let run = fields::run(&payload)
            .map_err(|what| source.malformed(format!("section HEAD: {what}")))?;
        let mut file = Self {
            source,
            run,
            closing: None,
            places: Vec::new(),
            headers: Vec::new(),
        };
        if let Some(tail) = file.source.tail_place()? {
            file.read_tail(tail, memory_bytes)?;
        } else {
            file.scan(PREAMBLE_BYTES + SECTION_BYTES + head.length, memory_bytes)?;
        }
        file.check_headers()?;
        Ok(file)
    }

    /// Whether the file has its end, and thus all that was written.
    pub fn is_complete(&self) -> bool {
        self.closing.is_some()
    }

    /// Path of the file.
    pub fn path(&self) -> &Path {
        &self.source.path
    }

    /// Size and checksum of the file for an image's record. Reads the whole file.
    ///
    /// # Errors
    /// [`ReadError`] if the file cannot be read.
    pub fn input(&self) -> Result<InputFile, ReadError> {
        let crc = self
            .source
            .crc(0, self.source.length, crc32fast::Hasher::new())?;
        self.source.check_unchanged()?;
        Ok(InputFile::with_crc32(
            &self.source.path,
            self.source.length,
            format!("{crc:08x}"),
        ))
    }

    /// Read totals and index from the tail at `place`.
    fn read_tail(&mut self, place: u64, memory_bytes: u64) -> Result<(), ReadError> {
        let source = &self.source;
        let SectionAt::Whole(section) = source.section(place)? else {
            return Err(source.malformed("section TAIL is truncated"));
        };
        let most = MAX_TEXT_BYTES + MAX_MAPS * ENTRY_BYTES;
        // The index is held as bytes and as entries, which are then split.
        source.check_memory(3 * section.length.min(most), memory_bytes)?;
        let payload = source.payload(place, &section, most, "TAIL")?;
        let mut fields = Fields(&payload);
        let parsed = fields::closing(&mut fields).and_then(|closing| {
            let count = fields.u64()?;
            let mut entries = Vec::new();
            if count > MAX_MAPS {
                return Err(format!("maps: expected at most {MAX_MAPS}, found {count}"));
            }
            for _ in 0..count {
                entries.push((fields.u64()?, fields::header(&mut fields)?));
            }
            fields.end()?;
            Ok((closing, entries))
        });
        let (closing, entries) =
            parsed.map_err(|what| source.malformed(format!("section TAIL: {what}")))?;
        self.closing = Some(closing);
        (self.places, self.headers) = entries.into_iter().unzip();
        Ok(())
    }

    /// Read sections from `place` up to the first incomplete one.
    fn scan(&mut self, mut place: u64, memory_bytes: u64) -> Result<(), ReadError> {
        while let SectionAt::Whole(section) = self.source.section(place)? {
            let Section { tag, crc, length } = section;
            let payload = place + SECTION_BYTES;
            if self.source.crc(payload, length, section_crc(tag, length))? != crc {
                break;
            }
            match tag {
                MAP if length >= HEADER_BYTES as u64 => {
                    let mut bytes = [0; HEADER_BYTES];
                    self.source.read(payload, &mut bytes)?;
                    let header = fields::header(&mut Fields(&bytes));
                    self.headers
                        .push(header.map_err(|what| self.source.malformed(what))?);
                    self.places.push(place);
                    let held = 3 * self.places.len() as u64 * ENTRY_BYTES;
                    self.source.check_memory(held, memory_bytes)?;
                    if self.places.len() as u64 > MAX_MAPS {
                        return Err(self
                            .source
                            .malformed(format!("maps: expected at most {MAX_MAPS}, found more")));
                    }
                }
                // Everything is present except for the trailer that points to the tail.
                TAIL => return self.read_tail(place, memory_bytes),
                _ if tag[0].is_ascii_lowercase() => {}
                _ => {
                    return Err(self
                        .source
                        .malformed(format!("unknown section '{}'", tag.escape_ascii())));
                }
            }
            place = payload + length;
        }
        Ok(())
    }

    fn check_headers(&self) -> Result<(), ReadError> {
        let mut seen = HashSet::new();
        for header in &self.headers {
            let (sub_cpi, patch) = (header.sub_cpi, header.patch_index);
            let what = match fault(header, &self.run.setup) {
                None if seen.insert((sub_cpi, patch)) => continue,
                None => "duplicate".to_owned(),
                Some(what) => what,
            };
            return Err(self
                .source
                .malformed(format!("map of sub-CPI {sub_cpi}, patch {patch}: {what}")));
        }
        Ok(())
    }
}

impl Maps for MapFile {
    fn run(&self) -> &Run {
        &self.run
    }

    fn closing(&self) -> Option<&RunTotals> {
        self.closing.as_ref()
    }

    fn headers(&self) -> &[MapHeader] {
        &self.headers
    }

    fn read(&self, index: usize) -> Result<OwnedMap, ReadError> {
        let (place, expected) = (self.places[index], &self.headers[index]);
        let damaged = |what: &str| {
            self.source.malformed(format!(
                "map of sub-CPI {}, patch {} {what}: receive it again, or use an intact copy",
                expected.sub_cpi, expected.patch_index
            ))
        };
        let arithmetic = self.run.arithmetic;
        let length = HEADER_BYTES as u64 + samples_bytes(&expected.patch, arithmetic);
        let section = match self.source.section(place)? {
            SectionAt::Whole(section) if section.tag == MAP && section.length == length => section,
            _ => return Err(damaged("is not at the offset in the index")),
        };
        let payload = self
            .source
            .payload(place, &section, length, "MAP")
            .map_err(|error| match error {
                ReadError::Malformed { .. } => damaged("is damaged (its CRC-32 does not match)"),
                other => other,
            })?;
        let mut fields = Fields(&payload);
        let header = fields::header(&mut fields).map_err(|what| damaged(&what))?;
        if header != *expected {
            return Err(damaged("differs from its index entry"));
        }
        let samples =
            fields::samples(fields, &header, arithmetic).map_err(|what| damaged(&what))?;
        Ok(OwnedMap { header, samples })
    }

    fn held_bytes(&self) -> u64 {
        (size_of_val(self.headers.as_slice()) + size_of_val(self.places.as_slice())) as u64
    }
}

/// File with random access.
#[derive(Debug)]
struct Source {
    path: PathBuf,
    file: Mutex<File>,
    length: u64,
    stamp: Stamp,
}

impl Source {
    fn open(path: &Path) -> Result<Self, ReadError> {
        let opened = open_file(path).and_then(|file| {
            let about = file.metadata()?;
            Ok((Stamp::of(&file)?, file, about.len()))
        });
        match opened {
            Ok((stamp, file, length)) => Ok(Self {
                path: path.to_owned(),
                file: Mutex::new(file),
                length,
                stamp,
            }),
            Err(source) => Err(ReadError::Io {
                path: path.to_owned(),
                source,
            }),
        }
    }

    fn check_memory(&self, needed_bytes: u64, allowed_bytes: u64) -> Result<(), ReadError> {
        if needed_bytes <= allowed_bytes {
            return Ok(());
        }
        Err(ReadError::Memory {
            path: self.path.clone(),
            needed_bytes,
            allowed_bytes,
        })
    }

    fn malformed(&self, what: impl Into<String>) -> ReadError {
        ReadError::Malformed {
            path: self.path.clone(),
            what: what.into(),
        }
    }

    /// Fail if the file was modified since it was opened.
    fn check_unchanged(&self) -> Result<(), ReadError> {
        let file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        self.stamp.check(&file, &self.path)
    }

    fn read(&self, place: u64, bytes: &mut [u8]) -> Result<(), ReadError> {
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        file.seek(SeekFrom::Start(place))
            .and_then(|_| file.read_exact(bytes))
            .map_err(|source| ReadError::Io {
                path: self.path.clone(),
                source,
            })
    }

    fn check_preamble(&mut self) -> Result<(), ReadError> {
        let mut bytes = [0; PREAMBLE_BYTES as usize];
        if self.length >= PREAMBLE_BYTES {
            self.read(0, &mut bytes)?;
        }
        if bytes == preamble() {
            return Ok(());
        }
        let [_, _, _, _, _, _, _, _, a, b, c, d, crc @ ..] = bytes;
        let (version, crc) = (u32::from_le_bytes([a, b, c, d]), u32::from_le_bytes(crc));
        Err(self.malformed(if !bytes.starts_with(MAGIC) {
            "not a maps file: it does not begin with SUBAPMAP".to_owned()
        } else if crc32fast::hash(&bytes[..12]) != crc {
            "preamble is damaged: use an intact copy".to_owned()
        } else {
            format!("file version {version}: expected version {VERSION}: use a newer program")
        }))
    }

    /// Section header at `place`, if the section lies entirely within the file.
    fn section(&self, place: u64) -> Result<SectionAt, ReadError> {
        let left = self.length.saturating_sub(place);
        if left < SECTION_BYTES {
            return Ok(SectionAt::End);
        }
        let mut bytes = [0; SECTION_BYTES as usize];
        self.read(place, &mut bytes)?;
        let [t0, t1, t2, t3, c0, c1, c2, c3, length @ ..] = bytes;
        let length = u64::from_le_bytes(length);
        if length > left - SECTION_BYTES {
            return Ok(SectionAt::End);
        }
        Ok(SectionAt::Whole(Section {
            tag: [t0, t1, t2, t3],
            crc: u32::from_le_bytes([c0, c1, c2, c3]),
            length,
        }))
    }

    /// Payload of a section, at most `most` bytes, with its checksum verified.
    fn payload(
        &self,
        place: u64,
        section: &Section,
        most: u64,
        name: &str,
    ) -> Result<Vec<u8>, ReadError> {
        let &Section { tag, crc, length } = section;
        if length > most {
            return Err(self.malformed(format!(
                "section {name}: expected at most {most} bytes, found {length}"
            )));
        }
        let mut payload = vec![0; length as usize];
        self.read(place + SECTION_BYTES, &mut payload)?;
        let mut found = section_crc(tag, length);
        found.update(&payload);
        if found.finalize() != crc {
            return Err(self.malformed(format!(
                "section {name} is damaged (its CRC-32 does not match): use an intact copy"
            )));
        }
        Ok(payload)
    }

    /// CRC-32 of the bytes already in `hasher` followed by a range of the file.
    fn crc(
        &self,
        mut place: u64,
        mut length: u64,
        mut hasher: crc32fast::Hasher,
    ) -> Result<u32, ReadError> {
        let mut buffer = vec![0; 1 << 16];
        while length > 0 {
            let count = length.min(buffer.len() as u64);
            let part = &mut buffer[..count as usize];
            self.read(place, part)?;
            hasher.update(part);
            place += count;
            length -= count;
        }
        Ok(hasher.finalize())
    }

    /// Offset of a complete tail that ends at the trailer. `None` if there is none.
    fn tail_place(&self) -> Result<Option<u64>, ReadError> {
        let Some(end) = self.length.checked_sub(TRAILER_BYTES) else {
            return Ok(None);
        };
        let mut trailer = [0; TRAILER_BYTES as usize];
        self.read(end, &mut trailer)?;
        let [p0, p1, p2, p3, p4, p5, p6, p7, mark @ ..] = trailer;
        let place = u64::from_le_bytes([p0, p1, p2, p3, p4, p5, p6, p7]);
        if mark != *END || place < PREAMBLE_BYTES {
            return Ok(None);
        }
        let SectionAt::Whole(Section { tag, crc, length }) = self.section(place)? else {
            return Ok(None);
        };
        let fits = place
            .checked_add(SECTION_BYTES)
            .and_then(|payload| payload.checked_add(length))
            == Some(end);
        if tag != TAIL || !fits {
            return Ok(None);
        }
        let found = self.crc(place + SECTION_BYTES, length, section_crc(tag, length))?;
        Ok((found == crc).then_some(place))
    }
}
