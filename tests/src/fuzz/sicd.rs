//! Complex images of any origin: SICD in NITF.

use glam::DVec3;
use num_complex::Complex32;
use subaperture::geometry::{Geodetic, ImageGrid, SceneFrame};
use subaperture::image::{Image, ImageSource};
use subaperture::io::product::Antennas;
use subaperture::monitor::Silent;
use subaperture::resolution::support::RecordedLooks;
use subaperture::sicd::{Formed, Georeference, Sicd, SicdFile};
use subaperture::signal::window::Window;

use super::scratch::with_files;

pub(super) const WORDS: &[&str] = &[
    "NITF02.10",
    "NSIF01.00",
    "SICD000",
    "XML_DATA_CONTENT",
    "urn:SICD:1.1.0",
    "urn:SICD:1.5",
    "BISTATIC",
    "RcvAPCPoly",
    "RE32F_IM32F",
    "RGAZIM",
    "RGZERO",
    "<PolarAngPoly><Coef exponent1=\"40\">1e99</Coef></PolarAngPoly>",
    "exponent1=\"999999999\"",
    "e308",
    "-1",
    "RE16I_IM16I",
    "AMP8I_PHS8I",
    "<AmpTable size=\"256\">",
    "<Amplitude index=\"0\">1</Amplitude>",
    "NumRows",
    "NumCols",
    "INT",
    "SI ",
    "NC",
    "C8",
    "999",
    "9999999999",
];

/// Images of a few pixels seen from 5 km, monostatic and bistatic, by our writer.
pub(super) fn seeds() -> Vec<Vec<u8>> {
    [0.0, 3000.0].map(seed).into()
}

/// Image of a receiver at a distance from the transmitter, metres.
fn seed(apart_m: f64) -> Vec<u8> {
    let track = |n: i32| DVec3::new(f64::from(n) * 20.0, -4000.0, 3000.0);
    let antennas: Vec<DVec3> = (-4..=4).map(track).collect();
    let apart = |place: &DVec3| *place + DVec3::X * apart_m;
    let receivers: Vec<DVec3> = antennas.iter().map(apart).collect();
    let grid: ImageGrid = "x=0:1:0.25,y=0:0.75:0.25,z=0".parse().expect("a grid");
    let formed = Formed {
        name: "a & b".to_owned(),
        frame: SceneFrame::Local,
        antennas: Antennas {
            start_ns: Some(1_700_000_000_000_000_000),
            timed: true,
            times_s: (0..9).map(|n| 0.2 * f64::from(n)).collect(),
            transmitters_m: antennas.clone(),
            receivers_m: receivers.clone(),
        },
        looks: RecordedLooks {
            band_cells: 64,
            bands_hz: vec![[9.8e9, 10.2e9]],
            transmitters_m: antennas.iter().map(DVec3::to_array).collect(),
            receivers_m: receivers.iter().map(DVec3::to_array).collect(),
        },
        windows: [Window::None; 2],
        former: "bp".to_owned(),
        polarizations: [Some("V".to_owned()), Some("H".to_owned())],
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
    let sicd = Sicd::new(&formed, &placing, 0).expect("a valid SICD");
    let image = Image {
        rows: formed.grid.rows.count,
        columns: formed.grid.columns.count,
        pixels: (0..formed.grid.num_pixels())
            .map(|n| Complex32::cis(n as f32))
            .collect(),
    };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("seed.nitf");
    sicd.write(&path, &image, &Silent)
        .expect("a file is written");
    std::fs::read(path).expect("it is read")
}

pub(super) fn read(bytes: &[u8]) -> String {
    with_files(&[("image.nitf", bytes)], |folder| {
        let file = match SicdFile::open(&folder.join("image.nitf")) {
            Ok(file) => file,
            Err(error) => return error.to_string(),
        };
        let (rows, columns) = file.size();
        assert!(rows > 0 && columns > 0 && rows * columns <= bytes.len());
        if let Some(plane) = file.plane() {
            let corner = plane.grid.position_m(rows - 1, columns - 1);
            assert!(plane.frame.to_ecf_m(corner).is_finite(), "{plane:?}");
        }
        if let Ok(projection) = file.projection() {
            let ends = [[0.0; 2], [rows, columns].map(|count| count as f64)];
            for pixel in ends {
                let along_m = projection.along_of(pixel);
                if let Some(place) = projection.on_height(along_m, projection.scp().height_m) {
                    let point = place.to_ecf_m();
                    assert!(point.is_finite(), "{place:?}");
                    let back = projection.along_m(point);
                    assert!(back.is_none_or(|b| b.iter().all(|x| x.is_finite())));
                }
            }
        }
        if let Some(band) = file.band() {
            assert!(band.widths().iter().all(|w| *w > 0.0 && *w <= 1.0));
            let middle = band.middle([rows as f64, -(columns as f64)]);
            assert!(middle.is_none_or(|k| k.iter().all(|k| k.is_finite())));
        }
        let _ = (file.name(), file.start());
        let mut count = 0;
        for place in file.places() {
            let part = file
                .window(&place)
                .expect("a window of an opened file is read");
            assert_eq!(part.pixels.len(), part.rows * part.columns);
            count += part.pixels.len();
        }
        assert_eq!(count, rows * columns);
        format!("a SICD {}", file.version())
    })
}
