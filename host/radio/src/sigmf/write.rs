//! Writer of SigMF recordings.

use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};

use subaperture_io::atomic::write_atomically;

use super::metadata::{Global, Setup, Step};
use super::{DATA, JOURNAL, META, SigmfError, beside};
use crate::transceiver::Sample;

/// Recording opened for writing.
#[derive(Debug)]
pub struct Writer {
    setup: Setup,
    data: File,
    journal: File,
    paths: [PathBuf; 3],
    /// Samples written per channel.
    written: u64,
    bytes: Vec<u8>,
}

impl Writer {
    /// Create the recording `path` (a name; suffixes are added).
    ///
    /// # Errors
    /// If one of its files exists or cannot be created; then no file is left.
    pub fn create(path: &Path, setup: Setup) -> Result<Self, SigmfError> {
        let paths = [DATA, META, JOURNAL].map(|ending| beside(path, ending));
        if let Some(there) = paths.iter().find(|path| path.symlink_metadata().is_ok()) {
            return Err(SigmfError::Exists(there.clone()));
        }
        // The metadata are written first: this creates missing folders, and the file is valid without steps.
        write_meta(&paths[1], &setup, None)?;
        let new = |path: &Path| {
            File::create_new(path).map_err(|source| match source.kind() {
                ErrorKind::AlreadyExists => SigmfError::Exists(path.to_owned()),
                _ => SigmfError::io(path)(source),
            })
        };
        let remove = |made: &[PathBuf]| {
            for path in made {
                let _ = fs::remove_file(path);
            }
        };
        let data = new(&paths[0]).inspect_err(|_| remove(&paths[1..2]))?;
        let journal = new(&paths[2]).inspect_err(|_| remove(&paths[..2]))?;
        Ok(Self {
            data,
            journal,
            setup,
            paths,
            written: 0,
            bytes: Vec::new(),
        })
    }

    /// Samples written so far per channel.
    pub fn written(&self) -> u64 {
        self.written
    }

    /// Append a step with two channels of `step.samples` samples. The writer sets its position in the recording.
    ///
    /// # Errors
    /// If writing fails, for example because the disk is full. Earlier steps stay intact, and so does the recording if
    /// nothing more is appended.
    ///
    /// # Panics
    /// If a channel's length differs from `step.samples`.
    pub fn append(&mut self, mut step: Step, channels: [&[Sample]; 2]) -> Result<(), SigmfError> {
        assert!(
            channels.iter().all(|channel| channel.len() == step.samples),
            "the channels' lengths equal the step's"
        );
        step.start = self.written;
        self.bytes.resize(8 * step.samples, 0);
        let pairs = channels[0].iter().zip(channels[1]);
        for (bytes, (reference, echo)) in self.bytes.chunks_exact_mut(8).zip(pairs) {
            let parts = [reference.re, reference.im, echo.re, echo.im].map(i16::to_le_bytes);
            for (to, part) in bytes.chunks_exact_mut(2).zip(parts) {
                to.copy_from_slice(&part);
            }
        }
        self.data
            .write_all(&self.bytes)
            .map_err(SigmfError::io(&self.paths[0]))?;
        self.written += step.samples as u64;
        let mut line =
            serde_json::to_vec(&step).map_err(|e| SigmfError::io(&self.paths[2])(e.into()))?;
        line.push(b'\n');
        self.journal
            .write_all(&line)
            .map_err(SigmfError::io(&self.paths[2]))
    }

    /// Sync the data to disk, and write the metadata with all steps.
    ///
    /// # Errors
    /// If writing fails. The journal then stays, and the recording opens with it.
    pub fn finish(self) -> Result<(), SigmfError> {
        self.data
            .sync_all()
            .map_err(SigmfError::io(&self.paths[0]))?;
        self.journal
            .sync_all()
            .map_err(SigmfError::io(&self.paths[2]))?;
        write_meta(&self.paths[1], &self.setup, Some(&self.paths[2]))?;
        fs::remove_file(&self.paths[2]).map_err(SigmfError::io(&self.paths[2]))
    }
}

/// Remove the files of a recording, as far as they exist.
pub(crate) fn discard(path: &Path) {
    for ending in [DATA, META, JOURNAL] {
        let _ = fs::remove_file(beside(path, ending));
    }
}

/// Write the metadata. Steps are copied line by line from the journal, so that memory does not grow with them.
fn write_meta(path: &Path, setup: &Setup, journal: Option<&Path>) -> Result<(), SigmfError> {
    write_atomically(path, 0, |file| {
        let mut out = BufWriter::new(file);
        out.write_all(b"{\n\"global\": ")?;
        serde_json::to_writer_pretty(&mut out, &Global::of(setup))?;
        out.write_all(b",\n\"captures\": [\n")?;
        let mut first = true;
        each_line(journal, |line| {
            let step: Step = serde_json::from_slice(line)?;
            let segment = serde_json::json!({ "core:sample_start": step.start, "core:frequency": step.carrier_hz });
            separate(&mut out, &mut first)?;
            Ok(serde_json::to_writer(&mut out, &segment)?)
        })?;
        if journal.is_none() {
            let segment = serde_json::json!({ "core:sample_start": 0 });
            serde_json::to_writer(&mut out, &segment)?;
        }
        out.write_all(b"\n],\n\"annotations\": [\n")?;
        first = true;
        each_line(journal, |line| {
            separate(&mut out, &mut first)?;
            out.write_all(line)
        })?;
        out.write_all(b"\n]\n}\n")?;
        out.flush()
    })?;
    Ok(())
}

fn separate(out: &mut impl Write, first: &mut bool) -> io::Result<()> {
    if !std::mem::take(first) {
        out.write_all(b",\n")?;
    }
    Ok(())
}

/// Call `take` with every complete line of the journal, without its line end.
fn each_line(
    journal: Option<&Path>,
    mut take: impl FnMut(&[u8]) -> io::Result<()>,
) -> io::Result<()> {
    let Some(path) = journal else { return Ok(()) };
    let mut lines = BufReader::new(File::open(path)?);
    let mut line = Vec::new();
    loop {
        line.clear();
        if lines.read_until(b'\n', &mut line)? == 0 || line.pop() != Some(b'\n') {
            return Ok(());
        }
        take(&line)?;
    }
}
