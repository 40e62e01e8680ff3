//! Reader of pixels from tiles: any part of the image, after the CRC-32 of each tile is verified.
//!
//! **Memory**: the part requested and a buffer of 64 KiB; no memory is sized by the metadata.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};

use num_complex::Complex32;
use serde::Deserialize;

use super::array::tile_bytes;
use super::{MARK_LIMITS, StoreError, TileStore};
use crate::ReadError;
use crate::input::{Stamp, open_file};
use crate::json;
use subaperture_model::image::{Image, ImageSource, ImageSourceError, PixelBlock, PixelBlocks};

/// Number of values read at a time.
const AT_ONCE: usize = 1 << 10;

/// Maximum number of tiles remembered as verified, about 50 bytes each. In larger images all tiles are verified on
/// every read.
const MAX_VERIFIED: usize = 1 << 12;

/// Content of a tile's mark.
#[derive(Deserialize)]
struct Mark {
    crc32: Option<String>,
}

impl ImageSource for TileStore {
    fn size(&self) -> (usize, usize) {
        let [rows, columns] = self.tiling.image;
        (rows, columns)
    }

    fn places(&self) -> PixelBlocks {
        PixelBlocks::within_tiles(self.tiling)
    }

    fn window(&self, place: &PixelBlock) -> Result<Image, ImageSourceError> {
        Ok(self.part(place)?)
    }
}

impl TileStore {
    /// Read a part of the image.
    ///
    /// # Errors
    /// [`StoreError`], also if a tile is missing or differs from its mark.
    pub fn part(&self, place: &PixelBlock) -> Result<Image, StoreError> {
        self.part_of(place, |_| true)
    }

    /// Like [`Self::part`], with zeros for missing tiles.
    ///
    /// # Errors
    /// [`StoreError`] if an existing tile differs from its mark.
    pub fn part_so_far(&self, place: &PixelBlock) -> Result<Image, StoreError> {
        self.part_of(place, |index| self.has(index))
    }

    fn part_of(
        &self,
        place: &PixelBlock,
        is_there: impl Fn(usize) -> bool,
    ) -> Result<Image, StoreError> {
        let [rows, columns] = place;
        let mut window = Image {
            rows: rows.len(),
            columns: columns.len(),
            pixels: Vec::new(),
        };
        let there: Vec<usize> = {
            let mut there = Vec::new();
            for index in self.tiling.meeting(place).filter(|&index| is_there(index)) {
                // Checked before memory is allocated, so that it is bounded by the size of the files.
                self.check_size(index)?;
                there.push(index);
            }
            there
        };
        let count = window.rows.saturating_mul(window.columns);
        let reserved = window.pixels.try_reserve_exact(count);
        reserved.map_err(|_| {
            ReadError::malformed(&self.folder, format!("no memory for {count} pixels of it"))
        })?;
        window.pixels.resize(count, Complex32::ZERO);
        for index in there {
            self.copy(index, place, &mut window.pixels)?;
        }
        Ok(window)
    }

    /// Read every n-th row and column of a tile from `first` on, counted within the tile. Reads these rows only and
    /// therefore cannot verify the tile's CRC-32.
    ///
    /// # Errors
    /// [`StoreError`] if the tile cannot be read or is too short.
    ///
    /// # Panics
    /// Panics if there is no such tile, or a step is zero.
    pub fn glance(
        &self,
        index: usize,
        first: [usize; 2],
        steps: [usize; 2],
    ) -> Result<Image, StoreError> {
        self.check_size(index)?;
        let [rows, columns] = self.tiling.place(index);
        let path = self.chunk(index);
        let failed = ReadError::io(&path);
        let mut file = open_file(&path).map_err(&failed)?;
        let mut image = Image {
            rows: 0,
            columns: (first[1]..columns.len()).step_by(steps[1]).len(),
            pixels: Vec::new(),
        };
        for row in (first[0]..rows.len()).step_by(steps[0]) {
            let across = first[1]..columns.len();
            let mut at = first[1];
            each_value(&mut file, row, &across, self.tiling.tile[1], |value| {
                if (at - first[1]).is_multiple_of(steps[1]) {
                    image.pixels.push(value);
                }
                at += 1;
            })
            .map_err(&failed)?;
            image.rows += 1;
        }
        Ok(image)
    }

    /// Read a tile, row-major.
    ///
    /// # Errors
    /// [`StoreError`], also if it differs from its mark.
    ///
    /// # Panics
    /// Panics if there is no such tile.
    pub fn read(&self, index: usize) -> Result<Vec<Complex32>, StoreError> {
        Ok(self.part(&self.tiling.place(index))?.pixels)
    }

    fn damaged(&self, index: usize, what: String) -> StoreError {
        StoreError::Damaged {
            path: self.chunk(index),
            mark: self.mark(index),
            what,
        }
    }

    /// Check the file size of a tile.
    fn check_size(&self, index: usize) -> Result<(), StoreError> {
        let path = self.chunk(index);
        let bytes = match path.metadata() {
            Ok(about) => about.len(),
            Err(source) => return Err(ReadError::Io { path, source }.into()),
        };
        match tile_bytes(&self.tiling) {
            wanted if bytes != wanted => {
                Err(self.damaged(index, format!("expected {wanted} bytes, found {bytes}")))
            }
            _ => Ok(()),
        }
    }

    /// Copy the part of a tile within `place` into `pixels`, which cover `place`.
    fn copy(
        &self,
        index: usize,
        place: &PixelBlock,
        pixels: &mut [Complex32],
    ) -> Result<(), StoreError> {
        let path = self.chunk(index);
        let failed = ReadError::io(&path);
        let mut file = open_file(&path).map_err(&failed)?;
        let stamp = Stamp::of(&file).map_err(&failed)?;
        if !self.is_verified(index, stamp) {
            self.verify(index, &mut file).map_err(|error| match error {
                Fault::Io(source) => failed(source).into(),
                Fault::Mark(error) => error,
                Fault::Differs(what) => self.damaged(index, what),
            })?;
            self.remember(index, stamp);
        }
        let tile = self.tiling.place(index);
        let common = |i: usize| tile[i].start.max(place[i].start)..tile[i].end.min(place[i].end);
        let (rows, columns) = (common(0), common(1));
        let across = columns.start - tile[1].start..columns.end - tile[1].start;
        for row in rows {
            let first = (row - place[0].start) * place[1].len() + columns.start - place[1].start;
            let mut into = pixels[first..].iter_mut();
            let within = row - tile[0].start;
            each_value(&mut file, within, &across, self.tiling.tile[1], |value| {
                if let Some(pixel) = into.next() {
                    *pixel = value;
                }
            })
            .map_err(&failed)?;
        }
        Ok(())
    }

    fn is_verified(&self, index: usize, stamp: Stamp) -> bool {
        self.verified().get(&index) == Some(&stamp)
    }

    fn remember(&self, index: usize, stamp: Stamp) {
        let mut verified = self.verified();
        if verified.len() >= MAX_VERIFIED {
            verified.clear();
        }
        verified.insert(index, stamp);
    }

    /// Read the whole file of a tile and compare its CRC-32 with the mark.
    fn verify(&self, index: usize, file: &mut File) -> Result<(), Fault> {
        let mark: Mark = self.read_mark(index).map_err(Fault::Mark)?;
        let (_, crc32) = crate::input::checksum(file).map_err(Fault::Io)?;
        match mark.crc32 {
            Some(stated) if stated == crc32 => Ok(()),
            Some(stated) => Err(Fault::Differs(format!(
                "expected CRC-32 {stated}, found {crc32}"
            ))),
            None => Err(Fault::Differs("its CRC-32 is not recorded".to_owned())),
        }
    }

    /// Read a tile's mark as any type.
    pub(super) fn read_mark<T: serde::de::DeserializeOwned>(
        &self,
        index: usize,
    ) -> Result<T, StoreError> {
        let path = self.mark(index);
        let file = super::open(&path)?;
        json::typed(file, MARK_LIMITS).map_err(|error| match error {
            json::JsonError::Io(source) => ReadError::io(&path)(source).into(),
            error => ReadError::malformed(&path, format!("not the mark of a tile: {error}")).into(),
        })
    }
}

enum Fault {
    Io(io::Error),
    Mark(StoreError),
    Differs(String),
}

/// Pass the values of a range of columns in a row of a tile to `take`; tile rows have `width` values.
fn each_value(
    file: &mut File,
    row: usize,
    columns: &std::ops::Range<usize>,
    width: usize,
    mut take: impl FnMut(Complex32),
) -> io::Result<()> {
    file.seek(SeekFrom::Start(8 * (row * width + columns.start) as u64))?;
    let mut bytes = [0; 8 * AT_ONCE];
    let mut left = columns.len();
    while left > 0 {
        let some = left.min(AT_ONCE);
        file.read_exact(&mut bytes[..8 * some])?;
        let values = bytes[..8 * some].as_chunks().0;
        values.iter().for_each(|&value| take(complex(value)));
        left -= some;
    }
    Ok(())
}

/// Decode a value of eight bytes.
fn complex([a, b, c, d, e, f, g, h]: [u8; 8]) -> Complex32 {
    Complex32::new(
        f32::from_le_bytes([a, b, c, d]),
        f32::from_le_bytes([e, f, g, h]),
    )
}
