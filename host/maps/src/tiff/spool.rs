//! Temporary store of compressed tiles, in anonymous files, until their final offsets are known.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;

use flate2::Compression;
use flate2::write::ZlibEncoder;

/// Tiles of one level, in the order of computation.
#[derive(Debug)]
pub(crate) struct Spool {
    file: File,
    bytes: u64,
    /// Offset in the spool and length of each tile, row by row, bytes.
    pub(crate) tiles: Vec<[u64; 2]>,
}

impl Spool {
    /// Create a spool on the disk of `folder`.
    pub(crate) fn new(folder: &Path, tiles: usize) -> io::Result<Self> {
        Ok(Self {
            file: tempfile::tempfile_in(folder)?,
            bytes: 0,
            tiles: vec![[0; 2]; tiles],
        })
    }

    /// Compress and store a tile.
    pub(crate) fn put(&mut self, index: usize, bytes: &[u8]) -> io::Result<()> {
        let mut packer = ZlibEncoder::new(Vec::new(), Compression::default());
        packer.write_all(bytes)?;
        let packed = packer.finish()?;
        self.file.write_all(&packed)?;
        self.tiles[index] = [self.bytes, packed.len() as u64];
        self.bytes += packed.len() as u64;
        Ok(())
    }

    /// Size of all tiles with leaders and trailers, bytes.
    pub(crate) fn bytes(&self) -> u64 {
        self.bytes + AROUND * self.tiles.len() as u64
    }

    /// File offset of each tile, row by row, when [`Self::copy_to`] writes at `first`.
    pub(crate) fn offsets(&self, first: u64) -> Vec<u64> {
        let mut next = first + LEADER;
        let mut offsets = Vec::with_capacity(self.tiles.len());
        for [_, bytes] in &self.tiles {
            offsets.push(next);
            next += bytes + AROUND;
        }
        offsets
    }

    /// Copy the tiles row by row, each with a leader (its size) and a trailer (its last four bytes repeated), as in GDAL's COG: a reader
    /// needs no second request for a tile's length.
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

/// Size of a tile's leader, bytes.
const LEADER: u64 = 4;
/// Size of a tile's trailer, bytes.
const TRAILER: u64 = 4;
const AROUND: u64 = LEADER + TRAILER;
