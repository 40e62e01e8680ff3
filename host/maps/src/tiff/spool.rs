//! Tiles on their way: deflated, in files without a name, until it is known where each is to lie.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;

use flate2::Compression;
use flate2::write::ZlibEncoder;

/// The tiles of one level, in the order in which they were made.
#[derive(Debug)]
pub(crate) struct Spool {
    file: File,
    bytes: u64,
    /// Of each tile, row by row, where it begins here and how long it is.
    pub(crate) tiles: Vec<[u64; 2]>,
}

impl Spool {
    /// A spool on the disk of `folder`.
    pub(crate) fn new(folder: &Path, tiles: usize) -> io::Result<Self> {
        Ok(Self {
            file: tempfile::tempfile_in(folder)?,
            bytes: 0,
            tiles: vec![[0; 2]; tiles],
        })
    }

    /// Deflates a tile's bytes.
    pub(crate) fn put(&mut self, index: usize, bytes: &[u8]) -> io::Result<()> {
        let mut packer = ZlibEncoder::new(Vec::new(), Compression::default());
        packer.write_all(bytes)?;
        let packed = packer.finish()?;
        self.file.write_all(&packed)?;
        self.tiles[index] = [self.bytes, packed.len() as u64];
        self.bytes += packed.len() as u64;
        Ok(())
    }

    /// Bytes of all tiles, each between its size and its last bytes.
    pub(crate) fn bytes(&self) -> u64 {
        self.bytes + AROUND * self.tiles.len() as u64
    }

    /// Where each tile begins, of those copied to `first` and on; row by row.
    pub(crate) fn offsets(&self, first: u64) -> Vec<u64> {
        let mut next = first + LEADER;
        let mut offsets = Vec::with_capacity(self.tiles.len());
        for [_, bytes] in &self.tiles {
            offsets.push(next);
            next += bytes + AROUND;
        }
        offsets
    }

    /// Copies the tiles row by row; before each stand its size, and after it its last four bytes once more, as GDAL has them, by which a reader
    /// needs no second request to know how long a tile is.
    pub(crate) fn copy_to(&mut self, out: &mut impl Write) -> io::Result<()> {
        let mut tile = Vec::new();
        for [at, bytes] in &self.tiles {
            tile.resize(*bytes as usize, 0);
            self.file.seek(SeekFrom::Start(*at))?;
            self.file.read_exact(&mut tile)?;
            out.write_all(&(tile.len() as u32).to_le_bytes())?;
            out.write_all(&tile)?;
            out.write_all(&tile[tile.len().saturating_sub(TRAILER as usize)..])?;
        }
        Ok(())
    }
}

/// Bytes before a tile.
const LEADER: u64 = 4;
/// Bytes after it.
const TRAILER: u64 = 4;
const AROUND: u64 = LEADER + TRAILER;
