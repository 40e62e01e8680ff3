//! Writer of MATLAB level 5 files from MathWorks' description of the format, independent of the library's reader.

use std::io::Write;

/// Value of a field or variable.
#[derive(Clone, Debug)]
pub enum Value {
    /// Class double, stored as doubles. Rows, columns, values in column-major order.
    Double(i32, i32, Vec<f64>),
    /// Class single, stored as singles. Rows, columns, values in column-major order.
    Single(i32, i32, Vec<f32>),
    /// Class single, complex: real parts, imaginary parts.
    Complex(i32, i32, Vec<f32>, Vec<f32>),
    /// Class double, stored as 16-bit integers, as MATLAB does when they fit.
    Compact(i32, i32, Vec<i16>),
    /// A row of text.
    Text(&'static str),
    /// A structure of these dimensions, fields element after element.
    Structure(i32, i32, Vec<(&'static str, Value)>),
    /// An element of no bytes: MATLAB's short form of `[]`.
    Empty,
}

fn element(kind: u32, data: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    if (1..=4).contains(&data.len()) {
        out.extend((kind | (data.len() as u32) << 16).to_le_bytes());
        out.extend(data);
    } else {
        out.extend(kind.to_le_bytes());
        out.extend((data.len() as u32).to_le_bytes());
        out.extend(data);
    }
    out.resize(out.len().next_multiple_of(8), 0);
    out
}

fn bytes<const N: usize, T: Copy>(values: &[T], to: impl Fn(T) -> [u8; N]) -> Vec<u8> {
    values.iter().flat_map(|&v| to(v)).collect()
}

/// A `miMATRIX` element.
pub fn matrix(name: &str, value: &Value) -> Vec<u8> {
    let (class, flags, rows, columns) = match value {
        Value::Empty => return element(14, &[]),
        Value::Double(r, c, _) | Value::Compact(r, c, _) => (6, 0, *r, *c),
        Value::Single(r, c, _) => (7, 0, *r, *c),
        Value::Complex(r, c, ..) => (7, 8, *r, *c),
        Value::Text(text) => (4, 0, 1, text.len() as i32),
        Value::Structure(r, c, _) => (2, 0, *r, *c),
    };
    let mut body = element(6, &[class, flags, 0, 0, 0, 0, 0, 0]);
    body.extend(element(5, &bytes(&[rows, columns], i32::to_le_bytes)));
    body.extend(element(1, name.as_bytes()));
    match value {
        Value::Double(.., v) => body.extend(element(9, &bytes(v, f64::to_le_bytes))),
        Value::Single(.., v) => body.extend(element(7, &bytes(v, f32::to_le_bytes))),
        Value::Compact(.., v) => body.extend(element(3, &bytes(v, i16::to_le_bytes))),
        Value::Complex(.., re, im) => {
            body.extend(element(7, &bytes(re, f32::to_le_bytes)));
            body.extend(element(7, &bytes(im, f32::to_le_bytes)));
        }
        Value::Text(text) => body.extend(element(16, text.as_bytes())),
        Value::Structure(.., fields) => {
            let mut names = Vec::new();
            // Each name ends with a zero.
            let longest = fields.iter().map(|(name, _)| name.len() + 1).max();
            let length = longest.unwrap_or(1).next_multiple_of(8);
            for (name, _) in fields {
                let mut field = name.as_bytes().to_vec();
                field.resize(length, 0);
                names.extend(field);
            }
            body.extend(element(5, &(length as i32).to_le_bytes()));
            body.extend(element(1, &names));
            for (_, value) in fields {
                body.extend(matrix("", value));
            }
        }
        Value::Empty => {}
    }
    element(14, &body)
}

/// `element` compressed by zlib in a `miCOMPRESSED` element.
pub fn compressed(element: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::default());
    encoder
        .write_all(element)
        .expect("a vector takes every byte");
    let packed = encoder.finish().expect("a vector takes every byte");
    let mut out = 15u32.to_le_bytes().to_vec();
    out.extend((packed.len() as u32).to_le_bytes());
    out.extend(packed);
    out
}

/// A file of these elements.
pub fn file(elements: &[Vec<u8>]) -> Vec<u8> {
    let mut out = b"MATLAB 5.0 MAT-file, written by a test".to_vec();
    out.resize(124, b' ');
    out.extend([0, 1, b'I', b'M']);
    out.extend(elements.concat());
    out
}

/// The fields of a GOTCHA structure of 4 frequencies and 3 pulses: sample `k` of pulse `n` is
/// `k + 10 n - j (k + 10 n + 0.5)`, frequencies are 9.3 GHz + 1.5 MHz k.
pub fn gotcha_fields() -> Vec<(&'static str, Value)> {
    let index: Vec<f32> = (0..3)
        .flat_map(|n| (0..4).map(move |k| (k + 10 * n) as f32))
        .collect();
    let imaginary = index.iter().map(|i| -i - 0.5).collect();
    vec![
        ("fp", Value::Complex(4, 3, index, imaginary)),
        (
            "freq",
            Value::Double(4, 1, (0..4).map(|k| 9.3e9 + 1.5e6 * f64::from(k)).collect()),
        ),
        ("x", Value::Single(1, 3, vec![7000.0, 7001.0, 7002.0])),
        ("y", Value::Compact(3, 1, vec![1, 2, 3])),
        ("z", Value::Double(1, 3, vec![7200.5; 3])),
        (
            "r0",
            Value::Double(1, 3, vec![10_042.0, 10_043.0, 10_044.0]),
        ),
        ("th", Value::Empty),
        (
            "af",
            Value::Structure(1, 1, vec![("r_corr", Value::Double(1, 1, vec![0.0]))]),
        ),
    ]
}

/// A GOTCHA file of these fields.
pub fn gotcha(fields: Vec<(&'static str, Value)>) -> Vec<u8> {
    file(&[matrix("data", &Value::Structure(1, 1, fields))])
}
