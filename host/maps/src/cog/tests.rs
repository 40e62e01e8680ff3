//! Tests of COG files against the format specifications; GDAL reads the command's files (`tests/images/maps.rs`).

use std::collections::BTreeMap;
use std::io::Read;

use num_complex::Complex32;

use subaperture_model::geometry::{Geodetic, ImageGrid, SceneFrame};
use subaperture_model::image::Image;
use subaperture_model::monitor::Silent;
use subaperture_model::resolution::support::RecordedLooks;
use subaperture_signal::window::Window;

use super::*;
use crate::Source;

/// Values of each field of a directory, by tag.
type Fields = BTreeMap<u16, Vec<u64>>;

/// Whether a file is BigTIFF, and its directories.
fn read(file: &[u8]) -> (bool, Vec<Fields>) {
    let number = |at: u64, bytes: u64| {
        let mut number = [0; 8];
        number[..bytes as usize].copy_from_slice(&file[at as usize..(at + bytes) as usize]);
        u64::from_le_bytes(number)
    };
    assert_eq!(&file[..2], b"II");
    let big = match number(2, 2) {
        42 => false,
        43 => {
            assert_eq!((number(4, 2), number(6, 2)), (8, 0));
            true
        }
        other => panic!("version {other}"),
    };
    let [word, entry, count_bytes] = if big { [8, 20, 8] } else { [4, 12, 2] };
    let mut next = number(if big { 8 } else { 4 }, word);
    let mut directories = Vec::new();
    while next != 0 {
        let count = number(next, count_bytes);
        let mut fields = Fields::new();
        for i in 0..count {
            let at = next + count_bytes + i * entry;
            let size =
                [0, 1, 1, 2, 4, 8, 1, 1, 2, 4, 8, 4, 8, 4, 0, 0, 8][number(at + 2, 2) as usize];
            let (many, value) = (number(at + 4, word), at + 4 + word);
            let first = if many * size > word {
                number(value, word)
            } else {
                value
            };
            let numbers = (0..many).map(|k| number(first + k * size, size)).collect();
            assert!(fields.insert(number(at, 2) as u16, numbers).is_none());
        }
        directories.push(fields);
        next = number(next + count_bytes + count * entry, word);
    }
    (big, directories)
}

/// Decode a float32 tile, predictor included.
fn tile(file: &[u8], fields: &Fields, index: usize, bands: usize) -> Vec<f32> {
    let (at, bytes) = (fields[&324][index] as usize, fields[&325][index] as usize);
    assert_eq!(file[at - 4..at], (bytes as u32).to_le_bytes());
    assert_eq!(
        file[at + bytes - 4..at + bytes],
        file[at + bytes..at + bytes + 4]
    );
    let mut raw = Vec::new();
    flate2::read::ZlibDecoder::new(&file[at..at + bytes])
        .read_to_end(&mut raw)
        .unwrap();
    let line = TILE * bands;
    assert_eq!(raw.len(), TILE * line * 4);
    let mut samples = Vec::new();
    for row in raw.chunks_mut(line * 4) {
        for i in bands..row.len() {
            row[i] = row[i].wrapping_add(row[i - bands]);
        }
        samples
            .extend((0..line).map(|i| f32::from_be_bytes([0, 1, 2, 3].map(|k| row[k * line + i]))));
    }
    samples
}

#[test]
fn classic_and_big_tiff_have_identical_tiles_in_cog_order() {
    let grid: ImageGrid = "x=0:60:0.1,y=0:52:0.1".parse().unwrap();
    let frame = SceneFrame::east_north_up(&Geodetic {
        latitude_deg: -33.9,
        longitude_deg: 151.2,
        height_m: 20.0,
    });
    // Antennas in the east; bandwidth and aperture angle below the pixels' sampling rate.
    let looks = RecordedLooks {
        band_cells: 8,
        bands_hz: vec![[9.5e9, 9.9e9]],
        transmitters_m: (-3..=3).map(|n| [5e3, f64::from(n) * 30.0, 2e3]).collect(),
        receivers_m: Vec::new(),
    };
    let looks = looks.looks(Window::None, Window::None).unwrap();
    let image = Image {
        rows: grid.rows.count,
        columns: grid.columns.count,
        pixels: (0..grid.num_pixels())
            .map(|i| Complex32::cis(i as f32))
            .collect(),
    };
    let source = Source {
        pixels: &image,
        grid: &grid,
        frame: &frame,
        looks: &looks,
    };
    let raster = Raster::covering(&grid, &frame, Projection::utm, None).unwrap();
    let ortho = Ortho::new(source, raster).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map.tif");
    let mut seen: Option<Vec<Vec<u32>>> = None;
    for (most, expected) in [(u64::MAX, false), (1000, true)] {
        let mut files = FileSet::new();
        add_as(
            &mut files,
            &path,
            &ortho,
            Layout::Complex,
            "a & b",
            &Silent,
            most,
        )
        .unwrap();
        files.commit().unwrap();
        let file = std::fs::read(&path).unwrap();
        let (big, directories) = read(&file);
        assert_eq!((big, directories.len()), (expected, 2));
        let [map, overview] = &directories[..] else {
            unreachable!()
        };
        assert_eq!(map[&256], [raster.columns as u64]);
        assert_eq!(map[&257], [raster.rows as u64]);
        assert_eq!(overview[&256], [raster.columns.div_ceil(2) as u64]);
        assert_eq!((map.contains_key(&254), &overview[&254]), (false, &vec![1]));
        // Zone 56 south.
        assert!(map[&34735].ends_with(&[3072, 0, 1, 32756, 3076, 0, 1, 9001]));
        let corner: Vec<f64> = map[&33922].iter().map(|&x| f64::from_bits(x)).collect();
        assert_eq!(corner, [0.0, 0.0, 0.0, raster.west, raster.north, 0.0]);
        // Order: directories, overview tiles, full-resolution tiles, up to the end of the file.
        let places: Vec<u64> = [overview, map]
            .iter()
            .flat_map(|d| d[&324].clone())
            .collect();
        assert!(places.is_sorted() && map[&324].len() == 4);
        let end = map[&324][3] + map[&325][3] + 4;
        assert_eq!(end, file.len() as u64);

        let tiles: Vec<Vec<f32>> = (0..4).map(|i| tile(&file, map, i, 2)).collect();
        let least = ortho.complex(&[0..1, 0..raster.columns]).unwrap();
        let other = tiles[1][2 * 5];
        assert_eq!(other.to_bits(), least[TILE + 5].re.to_bits());
        let halved = tile(&file, overview, 0, 2);
        assert_eq!(
            halved[2 * (7 * TILE + 9) + 1],
            tiles[0][2 * (14 * TILE + 18) + 1]
        );
        let bits = tiles
            .iter()
            .map(|t| t.iter().map(|x| x.to_bits()).collect())
            .collect();
        match &seen {
            None => seen = Some(bits),
            Some(seen) => assert!(seen == &bits, "big and small differ"),
        }
    }
    let left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().collect();
    assert_eq!(left.len(), 1, "{left:?}");
    // The real part alone, with its sign: every second value of both parts.
    let real = Layout::Real {
        name: "displacement",
        unit: "mm",
    };
    super::write(&path, &ortho, real, "real", &Silent).unwrap();
    let file = std::fs::read(&path).unwrap();
    let (_, directories) = read(&file);
    let seen = seen.unwrap();
    for (n, both) in seen.iter().enumerate() {
        let values = tile(&file, &directories[0], n, 1);
        let bits: Vec<u32> = values.iter().map(|x| x.to_bits()).collect();
        let expected: Vec<u32> = both.iter().copied().step_by(2).collect();
        assert!(bits == expected, "tile {n}");
    }
}
