//! Pixels read from tiles: any part of the image, each tile held against its CRC-32 first.
//!
//! **Memory**: the part that is asked for, and a buffer of 64 KiB; nothing is sized by what a description claims.

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

/// Values that are read at a time.
const AT_ONCE: usize = 1 << 10;

/// Most tiles that are remembered as held against their CRC-32, some 50 bytes each; with more all are looked at again.
const MAX_VERIFIED: usize = 1 << 12;

/// What a mark says of its tile.
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
    /// A part of the image, from the tiles that it lies on.
    ///
    /// # Errors
    /// [`StoreError`], also if a tile is missing, or not what its mark says.
    pub fn part(&self, place: &PixelBlock) -> Result<Image, StoreError> {
        self.part_of(place, |_| true)
    }

    /// [`Self::part`] with zeros where tiles are missing.
    ///
    /// # Errors
    /// [`StoreError`] of a tile that is there and is not what its mark says.
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
                // Before memory is taken: the files have as many bytes as is asked for.
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

    /// Pixels of every so manieth row and column of a tile, from `first` on, both counted within it: a glance, which reads these rows
    /// alone and so cannot look at the tile's CRC-32.
    ///
    /// # Errors
    /// [`StoreError`] if it cannot be read, or is too short.
    ///
    /// # Panics
    /// If there is no such tile, or a step is zero.
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

    /// Reads a tile, row-major.
    ///
    /// # Errors
    /// [`StoreError`], also if it is not what its mark says.
    ///
    /// # Panics
    /// If there is no such tile.
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

    /// Whether a tile's file has as many bytes as a tile has.
    fn check_size(&self, index: usize) -> Result<(), StoreError> {
        let path = self.chunk(index);
        let bytes = match path.metadata() {
            Ok(about) => about.len(),
            Err(source) => return Err(ReadError::Io { path, source }.into()),
        };
        match tile_bytes(&self.tiling) {
            wanted if bytes != wanted => {
                Err(self.damaged(index, format!("it has {bytes} bytes and not {wanted}")))
            }
            _ => Ok(()),
        }
    }

    /// Copies what a tile has of `place` into `pixels`, which are the place's.
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

    /// Reads all of a tile's file, for the CRC-32 that its mark says.
    fn verify(&self, index: usize, file: &mut File) -> Result<(), Fault> {
        let mark: Mark = self.read_mark(index).map_err(Fault::Mark)?;
        let (_, crc32) = crate::input::checksum(file).map_err(Fault::Io)?;
        match mark.crc32 {
            Some(stated) if stated == crc32 => Ok(()),
            Some(stated) => Err(Fault::Differs(format!(
                "its CRC-32 is {crc32} and not {stated}"
            ))),
            None => Err(Fault::Differs("no CRC-32 of it is recorded".to_owned())),
        }
    }

    /// A tile's mark, as any type.
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

/// Hands over the values of columns of a row of a tile, whose rows have `width`.
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

/// A value of eight bytes.
fn complex([a, b, c, d, e, f, g, h]: [u8; 8]) -> Complex32 {
    Complex32::new(
        f32::from_le_bytes([a, b, c, d]),
        f32::from_le_bytes([e, f, g, h]),
    )
}
