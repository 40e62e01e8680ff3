//! SIDD files of all versions and pixel types as NGA's sarkit writes them.

use std::fs;

use glam::DVec3;
use subaperture::image::ImageSource;
use subaperture::io::npy;
use subaperture::sicd::SiddFile;
use subaperture_tests::subap::{folder_with_recording, run};

use crate::export::{SPACE, sarkit};

#[test]
fn grey_sidd_of_any_version_is_read_and_colours_are_refused() {
    let folder = folder_with_recording("space", SPACE);
    let at = folder.path();
    run(
        at,
        "focus space.cphd --grid x=-12:12:0.4,y=-8:8:0.25 --out image",
    )
    .succeeded();
    run(at, "export image --format sidd -o image.nitf").succeeded();
    sarkit("sidd_write.py", &[at.join("image.nitf"), at.to_owned()]);
    for version in ["1.0.0", "2.0.0", "3.0.0"] {
        for kind in ["MONO8I", "MONO16I", "MONO8LU-8", "MONO8LU-16"] {
            let name = format!("{kind}-{version}");
            let file = SiddFile::open(&at.join(format!("{name}.nitf"))).unwrap();
            assert_eq!(file.version(), version);
            assert_eq!(file.levels_db(), None);
            let remap = if version == "1.0.0" {
                "PEDF"
            } else {
                "Density"
            };
            assert_eq!(file.remap(), Some(remap));
            let (rows, columns) = file.size();
            let read = file.window(&[0..rows, 0..columns]).unwrap();
            let expected = npy::read(&at.join(format!("{name}.npy"))).unwrap();
            assert!(read == expected, "{name}");
            let part = file.window(&[5..9, 3..20]).unwrap();
            for (n, value) in part.pixels.iter().enumerate() {
                assert_eq!(
                    *value,
                    read.pixels[(5 + n / 17) * columns + 3 + n % 17],
                    "{name}"
                );
            }
            let text = fs::read_to_string(at.join(format!("{name}.json"))).unwrap();
            let places: serde_json::Value = serde_json::from_str(&text).unwrap();
            let pixels: Vec<[f64; 2]> = serde_json::from_value(places["pixels"].clone()).unwrap();
            let ecf: Vec<[f64; 3]> = serde_json::from_value(places["ecf"].clone()).unwrap();
            let plane = file.plane().unwrap();
            assert_eq!(pixels.len(), 4);
            for ([row, column], expected) in pixels.into_iter().zip(ecf) {
                let grid = &plane.grid;
                let x = grid.columns.start + column * grid.columns.step;
                let y = grid.rows.start + row * grid.rows.step;
                let place = plane.frame.to_ecf_m(DVec3::new(x, y, 0.0));
                // Rounding of Earth-centred coordinates.
                assert!(place.distance(expected.into()) < 1e-8, "{name}");
            }
            let info = run(at, &format!("info {name}.nitf")).succeeded().to_owned();
            assert!(info.contains(&format!("SIDD {version}")), "{info}");
        }
        for kind in ["RGB24I", "RGB8LU"] {
            let line = format!("info {kind}-{version}.nitf");
            run(at, &line).failed(1, &[kind, "MONO8LU", "colours"]);
        }
    }
    damaged_tables(at);
}

/// Look-up tables that lack entries, and pixel types that the header contradicts.
fn damaged_tables(at: &std::path::Path) {
    let bytes = fs::read(at.join("MONO8LU-16-3.0.0.nitf")).unwrap();
    let other = at.join("damaged.nitf");
    let refused = |from: &str, to: &str, wanted: &str| {
        assert_eq!(from.len(), to.len());
        let place = bytes
            .windows(from.len())
            .position(|at| at == from.as_bytes());
        let place = place.unwrap();
        let mut changed = bytes.clone();
        changed[place..place + to.len()].copy_from_slice(to.as_bytes());
        fs::write(&other, changed).unwrap();
        let error = SiddFile::open(&other).unwrap_err().to_string();
        assert!(error.contains(wanted), "{error}");
    };
    refused("MONO8LU<", "MONO16I<", "INT, 16 bits, as the XML states");
    refused("MONO8LU<", "MONOXLU<", "found 'MONOXLU'");
    // One table of 512 entries in place of two of 256.
    refused("200256", "100512", "found 1 of [512]");
}
