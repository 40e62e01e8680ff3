//! SRTM elevation tiles (HGT) of one degree by one degree.
//!
//! | property | value |
//! |---|---|
//! | file name | south-western post: `N52E004.hgt` |
//! | posts | 1201 x 1201 (3 arc seconds) or 3601 x 3601 (1 arc second); edge posts are shared with adjacent tiles |
//! | order | rows from north to south, columns from west to east |
//! | height | int16, big-endian, metres above the geoid EGM96; -32768 is no data |
//!
//! The format has no header: position comes from the file name, post spacing from the file size.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use crate::terrain::lattice::{Lattice, Projection};
use crate::terrain::raster::{Extent, Raster, check_memory};
use crate::terrain::{Region, TerrainError};

/// Numbers of posts along a side.
const SIDES: [usize; 2] = [1201, 3601];

const VOID: i16 = -32768;

/// Latitude and longitude of the south-western post from a file name, degrees.
pub(crate) fn corner(name: &str) -> Option<[f64; 2]> {
    let (stem, _) = name.split_once('.').unwrap_or((name, ""));
    let bytes = stem.as_bytes();
    if bytes.len() != 7 || !bytes.is_ascii() {
        return None;
    }
    let number = |text: &str| -> Option<f64> {
        let digits = text.bytes().all(|b| b.is_ascii_digit());
        digits.then(|| text.parse().ok()).flatten()
    };
    let sign = |byte: u8, plus: u8, minus: u8| match byte.to_ascii_uppercase() {
        b if b == plus => Some(1.0),
        b if b == minus => Some(-1.0),
        _ => None,
    };
    let latitude = sign(bytes[0], b'N', b'S')? * number(&stem[1..3])?;
    let longitude = sign(bytes[3], b'E', b'W')? * number(&stem[4..7])?;
    let sound = (-90.0..90.0).contains(&latitude) && (-180.0..180.0).contains(&longitude);
    sound.then_some([latitude, longitude])
}

/// Extent of a tile from its file name and size.
fn extent(path: &Path, bytes: u64) -> Result<Extent, TerrainError> {
    let wrong = |what: String| TerrainError::Format {
        path: path.to_owned(),
        what,
    };
    let name = path.file_name().map(|name| name.to_string_lossy());
    let corner = name.as_deref().and_then(corner).ok_or_else(|| {
        wrong(
            "expected the south-western corner as file name, such as N52E004.hgt; rename the file"
                .to_owned(),
        )
    })?;
    let side = SIDES
        .into_iter()
        .find(|&side| 2 * (side * side) as u64 == bytes)
        .ok_or_else(|| {
            wrong(format!(
                "expected 2884802 bytes (3 arc seconds) or 25934402 bytes (1 arc second), found {bytes} bytes; the file is damaged or compressed"
            ))
        })?;
    let step = 1.0 / (side - 1) as f64;
    Ok(Extent {
        lattice: Lattice {
            projection: Projection::Geographic,
            origin: [corner[1], corner[0] + 1.0],
            steps: [-step, step],
            middle_column: 0.5 * (side - 1) as f64,
        },
        rows: side,
        columns: side,
    })
}

/// Read the part of a tile that a region needs; `None` if they do not overlap.
pub(crate) fn read(
    path: &Path,
    region: &Region,
    allowed_bytes: u64,
) -> Result<Option<Raster>, TerrainError> {
    let failed = |source| TerrainError::Io {
        path: path.to_owned(),
        source,
    };
    let mut file = File::open(path).map_err(failed)?;
    let bytes = file.metadata().map_err(failed)?.len();
    let extent = extent(path, bytes)?;
    let Some(window) = extent.window(region) else {
        return Ok(None);
    };
    check_memory(path, &window, 0, allowed_bytes)?;
    let [rows, columns] = &window;
    let mut heights = Vec::with_capacity(rows.len() * columns.len());
    let mut line = vec![0u8; 2 * columns.len()];
    for row in rows.clone() {
        let at = 2 * (row * extent.columns + columns.start) as u64;
        file.seek(SeekFrom::Start(at)).map_err(failed)?;
        file.read_exact(&mut line).map_err(failed)?;
        heights.extend(line.chunks_exact(2).map(|pair| {
            match i16::from_be_bytes([pair[0], pair[1]]) {
                VOID => f32::NAN,
                height => f32::from(height),
            }
        }));
    }
    Ok(Some(Raster::new(extent.lattice, &window, heights)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn file_name_gives_south_western_corner() {
        assert_eq!(corner("N52E004.hgt"), Some([52.0, 4.0]));
        assert_eq!(corner("s01w180.HGT"), Some([-1.0, -180.0]));
        assert_eq!(corner("N52E004.SRTMGL1.hgt"), Some([52.0, 4.0]));
        for name in [
            "N52E04.hgt",
            "X52E004.hgt",
            "N5+E004.hgt",
            "N90E004.hgt",
            "",
            "N52\u{e9}00.hgt",
        ] {
            assert_eq!(corner(name), None, "{name}");
        }
    }
}
