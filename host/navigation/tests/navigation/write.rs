//! Writers of logs, independent of the readers.

/// NovAtel's CRC bit by bit: reflected 0xEDB88320 from 0, without a final complement.
pub(crate) fn crc(bytes: &[u8]) -> u32 {
    bytes.iter().fold(0, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |c, _| match c & 1 {
            1 => (c >> 1) ^ 0xEDB8_8320,
            _ => c >> 1,
        })
    })
}

/// A line of NovAtel ASCII; `text` begins with `#` or `%`.
pub(crate) fn ascii(text: &str) -> String {
    format!("{text}*{:08x}\r\n", crc(&text.as_bytes()[1..]))
}

/// An NMEA sentence; `text` is the text between `$` and `*`.
pub(crate) fn nmea(text: &str) -> String {
    let sum = text.bytes().fold(0, |sum, byte| sum ^ byte);
    format!("${text}*{sum:02X}\r\n")
}

/// A NovAtel binary message with a long header.
pub(crate) fn binary(id: u16, week: u16, ms: u32, body: &[u8]) -> Vec<u8> {
    let mut bytes = vec![0xAA, 0x44, 0x12, 28];
    bytes.extend(id.to_le_bytes());
    bytes.extend([0, 0x20]);
    bytes.extend((body.len() as u16).to_le_bytes());
    bytes.extend([0, 0, 100, 180]);
    bytes.extend(week.to_le_bytes());
    bytes.extend(ms.to_le_bytes());
    bytes.extend([0; 8]);
    closed(bytes, body)
}

/// A NovAtel binary message with a short header.
pub(crate) fn short(id: u16, week: u16, ms: u32, body: &[u8]) -> Vec<u8> {
    let mut bytes = vec![0xAA, 0x44, 0x13, body.len() as u8];
    bytes.extend(id.to_le_bytes());
    bytes.extend(week.to_le_bytes());
    bytes.extend(ms.to_le_bytes());
    closed(bytes, body)
}

fn closed(mut bytes: Vec<u8>, body: &[u8]) -> Vec<u8> {
    bytes.extend(body);
    let crc = crc(&bytes);
    bytes.extend(crc.to_le_bytes());
    bytes
}

/// A field of a body.
pub(crate) enum Field {
    D(f64),
    F(f32),
    U(u32),
    Skip(usize),
}

pub(crate) fn body(fields: &[Field]) -> Vec<u8> {
    let mut bytes = Vec::new();
    for field in fields {
        match *field {
            Field::D(value) => bytes.extend(value.to_le_bytes()),
            Field::F(value) => bytes.extend(value.to_le_bytes()),
            Field::U(value) => bytes.extend(value.to_le_bytes()),
            Field::Skip(count) => bytes.resize(bytes.len() + count, 0),
        }
    }
    bytes
}

pub(crate) const HEADER: &str = "COM1,0,58.5,FINESTEERING,2209,502061.000,02000020,18bc,16809";

pub(crate) fn inspva(seconds: f64, latitude: f64) -> String {
    ascii(&format!(
        "#INSPVAA,{HEADER};2209,{seconds:.3},{latitude:.11},-114.03067932,1081.0036,1.5,-2.0,0.25,3.0,-1.5,270.0,INS_SOLUTION_GOOD"
    ))
}

/// The body of INSPVA.
pub(crate) fn inspva_body(week: u32, seconds: f64, latitude: f64) -> Vec<u8> {
    use Field::{D, U};
    body(&[
        U(week),
        D(seconds),
        D(latitude),
        D(-114.030_679_32),
        D(1081.0036),
        D(1.5),
        D(-2.0),
        D(0.25),
        D(3.0),
        D(-1.5),
        D(270.0),
        U(3),
    ])
}

/// The 17 numbers of an SBET's record.
pub(crate) fn sbet(numbers: &[f64; 17]) -> Vec<u8> {
    numbers
        .iter()
        .flat_map(|number| number.to_le_bytes())
        .collect()
}
