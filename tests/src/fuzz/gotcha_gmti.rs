//! The Gotcha GMTI challenge: the lengths of two MATLAB files (16 bits, little endian), the files, and samples.

use subaperture::io::gotcha_gmti::{GotchaGmti, Settings};

use super::MEMORY_BYTES;
use super::recordings::examine;
use super::repair;
use super::scratch::with_files;
use crate::gotcha_gmti::{Content, SAMPLES};
use crate::matlab::Value;

pub(super) const WORDS: &[&str] = &[
    "aux_SPIE",
    "paux",
    "readPrm",
    "Fsamp",
    "deltaRbin",
    "circshiftFloorPHradius",
    "PHradius_sampleError",
    "PRF",
    "APCpos",
    "APCMag",
    "Gamma",
    "PHradius",
    "\0\0\0\0",
    "\x0e\0\0\0",
    "\x0f\0\0\0",
];

/// Bytes of a pulse.
const ROW: usize = 8 * SAMPLES;

fn input(content: &Content) -> Vec<u8> {
    let files = [content.auxiliary_file(), content.positions_file()];
    let lengths = files
        .iter()
        .flat_map(|file| (file.len() as u16).to_le_bytes());
    lengths
        .chain(files.concat())
        .chain(content.samples.clone())
        .collect()
}

pub(super) fn seeds() -> Vec<Vec<u8>> {
    let whole = Content::default();
    let mut each = whole.clone();
    *each.field("PHradius_sampleError") = Value::Double(3, 1, vec![0.5; 3]);
    let mut untimed = whole.clone();
    untimed.auxiliary.retain(|(name, _)| *name != "PRF");
    [whole, each, untimed].iter().map(input).collect()
}

/// Auxiliary data, positions and samples, as long as the input suffices.
fn parts(bytes: &[u8]) -> [&[u8]; 3] {
    let Some(([a, b, c, d], rest)) = bytes.split_first_chunk() else {
        return [&[], &[], bytes];
    };
    let [first, second] = [[*a, *b], [*c, *d]]
        .map(u16::from_le_bytes)
        .map(usize::from);
    let (auxiliary, rest) = rest.split_at(first.min(rest.len()));
    let (positions, samples) = rest.split_at(second.min(rest.len()));
    [auxiliary, positions, samples]
}

pub(super) fn repair(bytes: &mut Vec<u8>) {
    let [mut auxiliary, mut positions, samples] = parts(bytes).map(<[u8]>::to_vec);
    repair::matlab(&mut auxiliary);
    repair::matlab(&mut positions);
    let mut whole: Vec<u8> = [auxiliary.len(), positions.len()]
        .iter()
        .flat_map(|length| (*length as u16).to_le_bytes())
        .collect();
    for part in [auxiliary, positions, samples] {
        whole.extend(part);
    }
    *bytes = whole;
}

pub(super) fn read(bytes: &[u8]) -> String {
    let [auxiliary, positions, samples] = parts(bytes);
    let mut samples = samples.to_vec();
    samples.resize(samples.len().next_multiple_of(ROW), 0);
    let files = [
        ("a_chan1_b_PH", &samples[..]),
        ("a_chan1_b_PH_auxSaveData.mat", auxiliary),
        ("a_b_PAUX.mat", positions),
    ];
    let settings = Settings {
        receiver_offsets_m: Some([0.5, 0.0, -0.5]),
        prf_hz: None,
    };
    with_files(&files, |folder| {
        let path = folder.join("a_chan1_b_PH");
        match GotchaGmti::open(&path, None, &settings, MEMORY_BYTES) {
            Ok(history) => examine(&history, bytes),
            Err(error) => error.to_string(),
        }
    })
}
