//! NumPy arrays, single and in archives, and pictures of a scene.

use num_complex::Complex32;
use subaperture::image::Image;
use subaperture::io::npy::{self, Array, ArrayWriter, Values};
use subaperture::simulate::scene::Picture;

use super::MEMORY_BYTES;
use super::scratch::with_files;
use crate::numpy::{array, stored};

pub(super) const WORDS: &[&str] = &[
    "'descr': ",
    "'fortran_order': ",
    "'shape': ",
    "'<c8'",
    "'<c16'",
    "'<f4'",
    "'|i1'",
    "'<u8'",
    "True",
    "False",
    "(1,)",
    "()",
    "(2, 3)",
    "PK\x03\x04",
    "PK\x01\x02",
    "PK\x05\x06",
    "PK\x06\x06",
    "PK\x06\x07",
    ".npy",
];

/// An image of 3 x 4 pixels.
pub(super) fn image_bytes() -> Vec<u8> {
    let image = Image {
        rows: 3,
        columns: 4,
        pixels: (0..12).map(|i| Complex32::cis(i as f32)).collect(),
    };
    let mut bytes = Vec::new();
    npy::write_to(&mut bytes, &image).expect("a vector takes every byte");
    bytes
}

pub(super) fn npy_seeds() -> Vec<Vec<u8>> {
    let mut real = Vec::new();
    let mut writer = ArrayWriter::new(&mut real, &[2, 3]).expect("a vector takes every byte");
    writer
        .put(&[0.5f64, 1.0, 2.0, -1.0, 3.5, 1e9])
        .expect("six values");
    writer.finish().expect("six values");
    vec![
        image_bytes(),
        real,
        array("<i2", "(2, 2)", &[1, 0, 2, 0, 255, 255, 0, 128]),
        array("|u1", "(3,)", &[1, 2, 3]),
        array("<c16", "(1,)", &[7; 16]),
        array("<f4", "()", &1.5f32.to_le_bytes()),
    ]
}

/// Name of the seeds' archive member.
const MEMBER: &str = "a";

pub(super) fn npz_seeds() -> Vec<Vec<u8>> {
    let one = array("<f8", "(2,)", &[0; 16]);
    let plain = stored(&[("a.npy", &one), ("b.npy", &image_bytes())]);
    // Compressed, as by `numpy.savez_compressed`.
    let mut deflate = flate2::write::DeflateEncoder::new(Vec::new(), flate2::Compression::best());
    std::io::Write::write_all(&mut deflate, &one).expect("a vector takes every byte");
    let packed = deflate.finish().expect("a vector takes every byte");
    let mut archive = stored(&[("a.npy", &packed)]);
    let crc = crc32fast::hash(&one).to_le_bytes();
    let directory = 30 + 5 + packed.len();
    for (at, size_at, method_at) in [
        (14, 22, 8),
        (directory + 16, directory + 24, directory + 10),
    ] {
        archive[at..at + 4].copy_from_slice(&crc);
        archive[size_at..size_at + 4].copy_from_slice(&(one.len() as u32).to_le_bytes());
        archive[method_at] = 8;
    }
    vec![plain, archive]
}

/// Description of an array; the number of its values agrees with its shape.
fn describe(array: &Array) -> String {
    let count: usize = array.shape.iter().product();
    let (kind, values) = match &array.values {
        Values::Real(values) => ("real", values.len()),
        Values::Complex(values) => ("complex", values.len()),
    };
    assert_eq!(count, values, "an array of another size than its shape's");
    format!("{kind} of {} dimensions", array.shape.len())
}

pub(super) fn npy(bytes: &[u8]) -> String {
    with_files(&[("input.npy", bytes)], |folder| {
        let path = folder.join("input.npy");
        let any = match Array::read(&path, None, MEMORY_BYTES) {
            Ok(array) => describe(&array),
            Err(error) => error.to_string(),
        };
        let image = match npy::read(&path) {
            Ok(image) => {
                assert_eq!(image.pixels.len(), image.rows * image.columns);
                let mut again = Vec::new();
                npy::write_to(&mut again, &image).expect("a vector takes every byte");
                // The values end the file; the header may be formatted differently.
                let values = 8 * image.pixels.len();
                assert_eq!(again[again.len() - values..], bytes[bytes.len() - values..]);
                "an image".to_owned()
            }
            Err(error) => error.to_string(),
        };
        format!("{any}; {image}")
    })
}

pub(super) fn npz(bytes: &[u8]) -> String {
    with_files(&[("input.npz", bytes)], |folder| {
        let path = folder.join("input.npz");
        let read = |name| match Array::read(&path, Some(name), MEMORY_BYTES) {
            Ok(array) => describe(&array),
            Err(error) => error.to_string(),
        };
        format!("{}; {}", read(MEMBER), read("b.npy"))
    })
}

pub(super) fn picture_seeds() -> Vec<Vec<u8>> {
    [(png::BitDepth::Eight, 6), (png::BitDepth::Sixteen, 12)]
        .map(|(depth, length)| {
            let mut out = Vec::new();
            let mut encoder = png::Encoder::new(&mut out, 3, 2);
            encoder.set_color(png::ColorType::Grayscale);
            encoder.set_depth(depth);
            let mut writer = encoder.write_header().expect("a vector takes every byte");
            let data: Vec<u8> = (0..length).map(|i| i * 20).collect();
            writer.write_image_data(&data).expect("six pixels");
            writer.finish().expect("six pixels");
            out
        })
        .to_vec()
}

/// Deflate expands at most 1032 times: for each byte a pixel, its brightness, and room to grow.
pub(super) fn picture_bytes(input_bytes: usize) -> usize {
    (4 << 20) + 8 * 1032 * input_bytes
}

pub(super) fn picture(bytes: &[u8]) -> String {
    with_files(&[("input.png", bytes)], |folder| {
        match Picture::read(&folder.join("input.png")) {
            Ok(_) => "a picture".to_owned(),
            Err(error) => error.to_string(),
        }
    })
}
