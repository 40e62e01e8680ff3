//! Reading maps one at a time.

use std::collections::HashSet;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use subaperture_core::stream::MapHeader;

use super::fields::{self, Fields};
use super::{
    END, HEAD, HEADER_BYTES, MAGIC, MAP, MOST_MAPS, MOST_TEXT_BYTES, PREAMBLE_BYTES, SECTION_BYTES,
    TAIL, TRAILER_BYTES, VERSION, fault, preamble, samples_bytes, section_crc,
};
use crate::maps::{Closing, Maps, OwnedMap, Run};
use subaperture_io::input::Stamp;
use subaperture_model::phase_history::{InputFile, ReadError};

/// Bytes of a place and a header in the index.
const ENTRY_BYTES: u64 = 8 + HEADER_BYTES as u64;

/// An open file of maps.
#[derive(Debug)]
pub struct MapFile {
    source: Source,
    run: Run,
    closing: Option<Closing>,
    places: Vec<u64>,
    headers: Vec<MapHeader>,
}

/// A section's head.
struct Section {
    tag: [u8; 4],
    crc: u32,
    length: u64,
}

/// What stands at a place that should hold a section.
enum Found {
    /// One that lies wholly within the file.
    Whole(Section),
    /// The file's end.
    End,
}

impl MapFile {
    /// Opens a file and reads its index; if it lost its end, all of it up to the last whole map.
    ///
    /// # Errors
    /// [`ReadError`] if it cannot be read, is no file of maps, or is damaged before its first map.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        let mut source = Source::open(path)?;
        source.check_preamble()?;
        let head = match source.section(PREAMBLE_BYTES)? {
            Found::Whole(section) if section.tag == HEAD => section,
            _ => return Err(source.malformed("its first section is no whole HEAD")),
        };
        let payload = source.payload(PREAMBLE_BYTES, &head, MOST_TEXT_BYTES, "HEAD")?;
        let run = fields::run(&payload)
            .map_err(|what| source.malformed(format!("its section HEAD: {what}")))?;
        let mut file = Self {
            source,
            run,
            closing: None,
            places: Vec::new(),
            headers: Vec::new(),
        };
        if let Some(tail) = file.source.tail_place()? {
            file.read_tail(tail)?;
        } else {
            file.scan(PREAMBLE_BYTES + SECTION_BYTES + head.length)?;
        }
        file.check_headers()?;
        Ok(file)
    }

    /// Whether the file has its end, and with it all that was written.
    pub fn is_complete(&self) -> bool {
        self.closing.is_some()
    }

    /// Where it lies.
    pub fn path(&self) -> &Path {
        &self.source.path
    }

    /// Its size and checksum, for an image's record; reads it whole.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn input(&self) -> Result<InputFile, ReadError> {
        let crc = self
            .source
            .crc(0, self.source.length, crc32fast::Hasher::new())?;
        self.source.check_unchanged()?;
        Ok(InputFile {
            path: self.source.path.clone(),
            bytes: self.source.length,
            crc32: format!("{crc:08x}"),
        })
    }

    /// Takes closing and index from the tail at `place`.
    fn read_tail(&mut self, place: u64) -> Result<(), ReadError> {
        let source = &self.source;
        let Found::Whole(section) = source.section(place)? else {
            return Err(source.malformed("its section TAIL is cut short"));
        };
        let most = MOST_TEXT_BYTES + MOST_MAPS * ENTRY_BYTES;
        let payload = source.payload(place, &section, most, "TAIL")?;
        let mut fields = Fields(&payload);
        let parsed = fields::closing(&mut fields).and_then(|closing| {
            let count = fields.u64()?;
            let mut entries = Vec::new();
            if count > MOST_MAPS {
                return Err(format!(
                    "{count} maps, and at most {MOST_MAPS} are possible"
                ));
            }
            for _ in 0..count {
                entries.push((fields.u64()?, fields::header(&mut fields)?));
            }
            fields.end()?;
            Ok((closing, entries))
        });
        let (closing, entries) =
            parsed.map_err(|what| source.malformed(format!("its section TAIL: {what}")))?;
        self.closing = Some(closing);
        (self.places, self.headers) = entries.into_iter().unzip();
        Ok(())
    }

    /// Takes one section after the other from `place` on, up to the first that is not whole.
    fn scan(&mut self, mut place: u64) -> Result<(), ReadError> {
        while let Found::Whole(section) = self.source.section(place)? {
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
                    if self.places.len() as u64 > MOST_MAPS {
                        return Err(self
                            .source
                            .malformed(format!("it has more than {MOST_MAPS} maps")));
                    }
                }
                // All is there, but for the pointer to it.
                TAIL => return self.read_tail(place),
                _ if tag[0].is_ascii_lowercase() => {}
                _ => {
                    return Err(self
                        .source
                        .malformed(format!("a section '{}' is not known", tag.escape_ascii())));
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
                None => "it is there twice".to_owned(),
                Some(what) => what,
            };
            return Err(self.source.malformed(format!(
                "the map of sub-CPI {sub_cpi}, patch {patch}: {what}"
            )));
        }
        Ok(())
    }
}

impl Maps for MapFile {
    fn run(&self) -> &Run {
        &self.run
    }

    fn closing(&self) -> Option<&Closing> {
        self.closing.as_ref()
    }

    fn headers(&self) -> &[MapHeader] {
        &self.headers
    }

    fn read(&self, index: usize) -> Result<OwnedMap, ReadError> {
        let (place, expected) = (self.places[index], &self.headers[index]);
        let damaged = |what: &str| {
            self.source.malformed(format!(
                "the map of sub-CPI {}, patch {} {what}: receive it again, or take a copy that is whole",
                expected.sub_cpi, expected.patch_index
            ))
        };
        let arithmetic = self.run.arithmetic;
        let length = HEADER_BYTES as u64 + samples_bytes(&expected.patch, arithmetic);
        let section = match self.source.section(place)? {
            Found::Whole(section) if section.tag == MAP && section.length == length => section,
            _ => return Err(damaged("is not where the index says")),
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
            return Err(damaged("is not the one of the index"));
        }
        let samples =
            fields::samples(fields, &header, arithmetic).map_err(|what| damaged(&what))?;
        Ok(OwnedMap { header, samples })
    }

    fn held_bytes(&self) -> u64 {
        (size_of_val(self.headers.as_slice()) + size_of_val(self.places.as_slice())) as u64
    }
}

/// A file, read at any place.
#[derive(Debug)]
struct Source {
    path: PathBuf,
    file: Mutex<File>,
    length: u64,
    stamp: Stamp,
}

impl Source {
    fn open(path: &Path) -> Result<Self, ReadError> {
        let opened = File::open(path).and_then(|file| {
            let about = file.metadata()?;
            if about.is_dir() {
                return Err(io::Error::other("it is a folder, and a file is needed"));
            }
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

    fn malformed(&self, what: impl Into<String>) -> ReadError {
        ReadError::Malformed {
            path: self.path.clone(),
            what: what.into(),
        }
    }

    /// Fails if the file has been written to since it was opened.
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
        Err(
            self.malformed(if !bytes.starts_with(MAGIC) {
                "it is no file of maps: it does not begin with SUBAPMAP".to_owned()
            } else if crc32fast::hash(&bytes[..12]) != crc {
                "its first bytes are damaged: take a copy that is whole".to_owned()
            } else {
                format!(
                    "it is of version {version} and this program reads version {VERSION}: use a newer one"
                )
            }),
        )
    }

    /// The section's head at `place`, if all of the section lies within the file.
    fn section(&self, place: u64) -> Result<Found, ReadError> {
        let left = self.length.saturating_sub(place);
        if left < SECTION_BYTES {
            return Ok(Found::End);
        }
        let mut bytes = [0; SECTION_BYTES as usize];
        self.read(place, &mut bytes)?;
        let [t0, t1, t2, t3, c0, c1, c2, c3, length @ ..] = bytes;
        let length = u64::from_le_bytes(length);
        if length > left - SECTION_BYTES {
            return Ok(Found::End);
        }
        Ok(Found::Whole(Section {
            tag: [t0, t1, t2, t3],
            crc: u32::from_le_bytes([c0, c1, c2, c3]),
            length,
        }))
    }

    /// A section's payload, at most `most` bytes, checked.
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
                "its section {name} is {length} bytes long, and at most {most} are possible"
            )));
        }
        let mut payload = vec![0; length as usize];
        self.read(place + SECTION_BYTES, &mut payload)?;
        let mut found = section_crc(tag, length);
        found.update(&payload);
        if found.finalize() != crc {
            return Err(self.malformed(format!(
                "its section {name} is damaged (its CRC-32 does not match): take a copy that is whole"
            )));
        }
        Ok(payload)
    }

    /// CRC-32 of what `hasher` has seen and then of a stretch of the file.
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

    /// Where a whole tail begins that ends where the trailer says; `None` if there is none.
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
        let Found::Whole(Section { tag, crc, length }) = self.section(place)? else {
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
