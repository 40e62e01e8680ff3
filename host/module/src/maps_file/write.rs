//! Writer of maps files.

use std::collections::HashSet;
use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use subaperture_core::stream::{MapHeader, PatchMap};

use super::{
    ANY_SIZE, END, HEAD, HEADER_BYTES, MAP, MAX_MAPS, PREAMBLE_BYTES, SECTION_BYTES, TAIL, fault,
    fields, preamble, section_crc,
};
use crate::maps::{Run, RunTotals};
use subaperture_io::atomic::{AtomicFile, WriteError};
use subaperture_io::lock::KEPT_SUFFIX;

/// Maps file being written. If dropped before [`Self::finish`], it leaves no file.
pub struct MapWriter {
    path: PathBuf,
    run: Run,
    pending: AtomicFile,
    /// Offset of the next section.
    end: u64,
    places: Vec<(u64, MapHeader)>,
    seen: HashSet<(u32, u16)>,
    payload: Vec<u8>,
}

impl MapWriter {
    /// Create the file that will become `path`, as a hidden file next to it.
    ///
    /// # Errors
    /// [`WriteError`] if the folder is not writable, the target exists, or the run's setup is invalid.
    pub fn create(path: &Path, run: &Run) -> Result<Self, WriteError> {
        let mut payload = Vec::new();
        fields::put_run(&mut payload, run);
        let failed = |source| failed(path, source);
        run.setup
            .check(&ANY_SIZE)
            .map_err(|error| failed(refused(error.to_string())))?;
        if run.fast_weights.len() != usize::from(run.setup.num_frequencies) {
            return Err(failed(refused(format!(
                "window weights: expected {1}, one per frequency, found {0}",
                run.fast_weights.len(),
                run.setup.num_frequencies
            ))));
        }
        let mut writer = Self {
            path: path.to_owned(),
            run: run.clone(),
            pending: AtomicFile::create(path, 0, KEPT_SUFFIX)?,
            end: PREAMBLE_BYTES,
            places: Vec::new(),
            seen: HashSet::new(),
            payload,
        };
        writer
            .pending
            .file()
            .write_all(&preamble())
            .and_then(|()| writer.write_section(HEAD))
            .map_err(failed)?;
        Ok(writer)
    }

    /// Append a map.
    ///
    /// # Errors
    /// [`WriteError`] if the disk is full, or if the map does not belong to this run (dimensions or arithmetic) or duplicates a
    /// patch and sub-CPI. Other maps may follow a rejected one.
    pub fn append(&mut self, map: &PatchMap) -> Result<(), WriteError> {
        let header = &map.header;
        if let Some(what) = self.objection(map) {
            let (sub_cpi, patch) = (header.sub_cpi, header.patch_index);
            let what = format!("map of sub-CPI {sub_cpi}, patch {patch}: {what}");
            return Err(failed(&self.path, refused(what)));
        }
        self.payload.clear();
        fields::put_header(&mut self.payload, header);
        fields::put_samples(&mut self.payload, map);
        let place = self.end;
        self.write_section(MAP)
            .map_err(|source| failed(&self.path, source))?;
        self.places.push((place, *header));
        self.seen.insert((header.sub_cpi, header.patch_index));
        Ok(())
    }

    /// Number of maps appended.
    pub fn num_maps(&self) -> usize {
        self.places.len()
    }

    /// Write the index, sync the file to disk and rename it into place.
    ///
    /// # Errors
    /// [`WriteError`]. If the disk has no room for the index, the file is still renamed into place: all its maps can be read, and
    /// [`MapFile::is_complete`](super::MapFile::is_complete) returns false. After any other error the target is unchanged.
    pub fn finish(mut self, closing: &RunTotals) -> Result<(), WriteError> {
        self.payload.clear();
        fields::put_closing(&mut self.payload, closing);
        self.payload
            .extend_from_slice(&(self.places.len() as u64).to_le_bytes());
        for (place, header) in &self.places {
            self.payload.extend_from_slice(&place.to_le_bytes());
            fields::put_header(&mut self.payload, header);
        }
        let tail = self.end;
        let mut trailer = tail.to_le_bytes().to_vec();
        trailer.extend_from_slice(END);
        let ended = self
            .write_section(TAIL)
            .and_then(|()| self.pending.file().write_all(&trailer));
        let path = self.path;
        let Err(source) = ended else {
            return self.pending.commit();
        };
        // Maps that took hours to receive are worth more than their index.
        let cut = cut(self.pending.file(), tail);
        let kept = cut
            .map_err(drop)
            .and_then(|()| self.pending.commit().map_err(drop));
        Err(failed(
            &path,
            match kept {
                Ok(()) => io::Error::new(
                    source.kind(),
                    format!("{source}: the file lacks its index, but every map in it can be read"),
                ),
                Err(()) => source,
            },
        ))
    }

    fn objection(&self, map: &PatchMap) -> Option<String> {
        let header = &map.header;
        if let Some(what) = fault(header, &self.run.setup) {
            return Some(what);
        }
        if !fields::is_whole(map, self.run.arithmetic) {
            return Some("samples do not match its bins and the run's arithmetic".to_owned());
        }
        if self.seen.contains(&(header.sub_cpi, header.patch_index)) {
            return Some("duplicate".to_owned());
        }
        (self.places.len() as u64 >= MAX_MAPS)
            .then(|| format!("file is full ({MAX_MAPS} maps): start another one"))
    }

    /// Write `self.payload` as a section.
    fn write_section(&mut self, tag: [u8; 4]) -> io::Result<()> {
        let length = self.payload.len() as u64;
        let mut crc = section_crc(tag, length);
        crc.update(&self.payload);
        let mut head = tag.to_vec();
        head.extend_from_slice(&crc.finalize().to_le_bytes());
        head.extend_from_slice(&length.to_le_bytes());
        let file = self.pending.file();
        let written = file
            .write_all(&head)
            .and_then(|()| file.write_all(&self.payload));
        if let Err(source) = written {
            // Overwritten by the next section. If truncation fails as well, readers stop here.
            let _ = cut(file, self.end);
            return Err(source);
        }
        self.end += SECTION_BYTES + length;
        Ok(())
    }
}

/// Truncate `file` at `end`, where writing continues.
fn cut(file: &mut File, end: u64) -> io::Result<()> {
    file.set_len(end)?;
    file.seek(SeekFrom::Start(end)).map(drop)
}

fn refused(what: String) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, what)
}

fn failed(path: &Path, source: io::Error) -> WriteError {
    WriteError::Io {
        path: path.to_owned(),
        needed_bytes: 0,
        source,
    }
}

// An index entry is an offset and a header.
const _: () = assert!(HEADER_BYTES == 4 + 4 * 2 + 24 + 16 + 4 + 2 * 48);
