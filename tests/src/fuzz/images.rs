//! Images of any origin by the common opener: SIDD in NITF, GeoTIFF, Zarr.

use subaperture::geometry::{Geodetic, ImageGrid, SceneFrame};
use subaperture::image::{Image, ImageSource};
use subaperture::images::{OpenImage, Reading, compare};
use subaperture::io::product::Antennas;
use subaperture::monitor::Silent;
use subaperture::num_complex::Complex32;
use subaperture::recognise;
use subaperture::resolution::support::RecordedLooks;
use subaperture::sicd::{Formed, Georeference, Greys, Sidd};
use subaperture::signal::window::Window;

use super::MEMORY_BYTES;
use super::scratch::with_files;
use crate::dem::GeoTiff;

pub(super) const WORDS: &[&str] = &[
    "NITF02.10",
    "SIDD001",
    "urn:SIDD:3.0.0",
    "MONO8I",
    "MONO16I",
    "PlaneProjection",
    "\"black_db\"",
    "INT",
    "9999",
    "II*\0",
    "MM\0*",
    "role=\"scale\">",
    "{\"zarr_format\":3,",
    "\"node_type\":\"group\"",
    "\"complex64\"",
    "\"shape\":[",
    "1000000000",
    "\"chunk_shape\":[1,1]",
    "\"codecs\":",
];

const ARRAY: &str = r#"{"zarr_format":3,"node_type":"array","shape":[3,5],"data_type":"complex64",
"chunk_grid":{"name":"regular","configuration":{"chunk_shape":[2,4]}},
"chunk_key_encoding":{"name":"default","configuration":{"separator":"/"}},
"fill_value":[0.0,0.0],"codecs":[{"name":"bytes","configuration":{"endian":"little"}}],"attributes":{}}"#;

/// A detected image of a few pixels, a map of numbers, and an array without chunks.
pub(super) fn seeds() -> Vec<Vec<u8>> {
    let track = |n: i32| [f64::from(n) * 20.0, -4000.0, 3000.0];
    let antennas: Vec<[f64; 3]> = (-4..=4).map(track).collect();
    let grid: ImageGrid = "x=0:1:0.25,y=0:0.75:0.25,z=0".parse().expect("a grid");
    let formed = Formed {
        name: "a".to_owned(),
        frame: SceneFrame::Local,
        antennas: Antennas {
            start_ns: Some(1_700_000_000_000_000_000),
            timed: true,
            times_s: (0..9).map(|n| 0.2 * f64::from(n)).collect(),
            transmitters_m: antennas.iter().copied().map(Into::into).collect(),
            receivers_m: antennas.iter().copied().map(Into::into).collect(),
        },
        looks: RecordedLooks {
            band_cells: 64,
            bands_hz: vec![[9.8e9, 10.2e9]],
            transmitters_m: antennas,
            receivers_m: Vec::new(),
        },
        windows: [Window::None; 2],
        former: "bp".to_owned(),
        polarizations: [None, None],
        grid,
    };
    let placing = Georeference {
        origin: Some(Geodetic {
            latitude_deg: 52.0,
            longitude_deg: 4.0,
            height_m: 40.0,
        }),
        ..Georeference::default()
    };
    let greys = Greys {
        name: "Decibels",
        levels_db: [-40.0, 0.0],
        of: &|power| (255.0 * power.clamp(0.0, 1.0)) as u8,
    };
    let image = Image {
        rows: formed.grid.rows.count,
        columns: formed.grid.columns.count,
        pixels: (0..formed.grid.num_pixels())
            .map(|n| Complex32::new(n as f32 / 12.0, 0.0))
            .collect(),
    };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("seed.nitf");
    let sidd = Sidd::new(&formed, &placing, &greys, 0).expect("a valid SIDD");
    sidd.write(&path, &image, &greys, &Silent)
        .expect("a file is written");
    let map = GeoTiff {
        size: [24, 20],
        origin: [221_600.0, 55_400.0],
        steps: [20.0; 2],
        points: false,
        epsg: 32631,
        tile: Some(16),
        strip_rows: 7,
        void: Some(-9999.0),
        deflate: true,
    };
    vec![
        std::fs::read(path).expect("it is read"),
        map.bytes(|column, row| (column + row) as f32),
        ARRAY.as_bytes().to_vec(),
    ]
}

/// Maximum of pixels for which an image is read completely.
const MAX_PIXELS: usize = 1 << 18;

pub(super) fn read(bytes: &[u8]) -> String {
    let name = match bytes {
        [b'{', ..] => "zarr.json",
        [b'N', ..] => "image.nitf",
        _ => "map.tif",
    };
    with_files(&[(name, bytes)], |folder| {
        let path = match name {
            "zarr.json" => folder.to_owned(),
            name => folder.join(name),
        };
        let kind = recognise(&path);
        let reading = Reading {
            memory_bytes: MEMORY_BYTES,
            ..Reading::default()
        };
        let image = match OpenImage::open(&path, &reading) {
            Ok(image) => image,
            Err(error) => return format!("{kind:?}: {error}"),
        };
        let (rows, columns) = image.pixels.size();
        assert!(rows > 0 && columns > 0);
        if name == "image.nitf" {
            assert!(rows.saturating_mul(columns) <= bytes.len());
        }
        if let Some((grid, Some(frame))) = image.grid() {
            assert!(
                frame
                    .to_ecf_m(grid.position_m(rows - 1, columns - 1))
                    .is_finite()
            );
        }
        let whole = rows.saturating_mul(columns) <= MAX_PIXELS;
        let places = image.pixels.places();
        let some = if whole { usize::MAX } else { 1 };
        for place in places.take(some) {
            match image.pixels.window(&place) {
                Ok(part) => assert_eq!(part.pixels.len(), place[0].len() * place[1].len()),
                Err(error) => return format!("{kind:?}: {error}"),
            }
        }
        if whole {
            return match compare(&image, &image) {
                Ok(compared) => format!("{kind:?}: {} pixels", compared.pixels),
                Err(error) => format!("{kind:?}: {error}"),
            };
        }
        format!("{kind:?}: {rows} x {columns}")
    })
}
