//! Folders of products: `image.json`, then `image.npy`, in one input.

use num_complex::Complex32;
use serde_json::{Value, json};
use subaperture::image::Image;
use subaperture::io::product::{self, Product};

use super::container::{pack, unpack};
use super::scratch::with_files;

pub(super) const WORDS: &[&str] = &[
    "\"grid\":",
    "\"files\":",
    "\"x_axis\":",
    "\"y_axis\":",
    "\"origin_m\":",
    "\"columns\":",
    "\"rows\":",
    "\"start\":",
    "\"step\":",
    "\"count\":",
    "\"kind\":",
    "\"polar\"",
    "\"cartesian\"",
    "null",
    "[0,0,0]",
    "[1,0,0]",
    "1e999",
    "{",
    "}",
    "\"x=0:1:1,y=0:1:1\"",
];

fn image() -> Image {
    Image {
        rows: 2,
        columns: 3,
        pixels: (0..6).map(|i| Complex32::cis(i as f32)).collect(),
    }
}

pub(super) fn seeds() -> Vec<Vec<u8>> {
    let axis = |start: f64, count: usize| json!({ "start": start, "step": 0.5, "count": count });
    let grid = |kind: &str| {
        json!({
            "kind": kind,
            "origin_m": [0.0, 1.0, 2.0],
            "x_axis": [1.0, 0.0, 0.0],
            "y_axis": [0.0, 1.0, 0.0],
            "columns": axis(0.1, 3),
            "rows": axis(1.0, 2),
        })
    };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let text = json!("x=0:1.5:0.5,y=0:1:0.5,yaw=30");
    [grid("cartesian"), grid("polar"), text]
        .map(|grid| {
            let product = Product {
                image: &image(),
                metadata: &json!({ "algorithm": "exact", "grid": grid }),
                quicklook: b"none",
            };
            product.write(folder.path()).expect("a product is written");
            let file =
                |name: &str| std::fs::read(folder.path().join(name)).expect("a file is read");
            pack(&file("image.json"), &file("image.npy"))
        })
        .to_vec()
}

/// Set size and checksum in the metadata to those of the image.
pub(super) fn repair(bytes: &mut Vec<u8>) {
    let (text, array) = unpack(bytes);
    let Ok(mut metadata) = serde_json::from_slice::<Value>(text) else {
        return;
    };
    if let Some(files) = metadata.get_mut("files").and_then(Value::as_object_mut) {
        let crc32 = format!("{:08x}", crc32fast::hash(array));
        files.insert(
            "image.npy".to_owned(),
            json!({ "bytes": array.len(), "crc32": crc32 }),
        );
        *bytes = pack(metadata.to_string().as_bytes(), array);
    }
}

pub(super) fn read(bytes: &[u8]) -> String {
    let (text, array) = unpack(bytes);
    let files: [(&str, &[u8]); 2] = [("image.json", text), ("image.npy", array)];
    with_files(&files, |folder| {
        let stored = match product::read(folder) {
            Ok(stored) => stored,
            Err(error) => return error.to_string(),
        };
        let grid = &stored.grid;
        // Independent of the library's check of a grid.
        let off = (grid.x_axis.length() - 1.0).abs() + (grid.y_axis.length() - 1.0).abs();
        assert!(
            off < 1e-5 && grid.x_axis.dot(grid.y_axis).abs() < 1e-5,
            "{grid:?}"
        );
        let (rows, columns) = (stored.image.rows, stored.image.columns);
        assert_eq!((rows, columns), (grid.rows.count, grid.columns.count));
        assert_eq!(stored.image.pixels.len(), rows * columns);
        for (row, column) in [
            (0, 0),
            (0, columns - 1),
            (rows - 1, 0),
            (rows - 1, columns - 1),
        ] {
            let place = grid.position_m(row, column);
            assert!(place.length() < 1e10, "{place}");
        }
        format!("a product, polar {}", grid.polar)
    })
}
