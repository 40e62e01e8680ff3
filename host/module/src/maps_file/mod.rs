//! File format `*.maps`: the maps of a run, written as they arrive and read one at a time.
//!
//! All values are little-endian. The file starts with a preamble of 16 bytes, followed by sections:
//!
//! | bytes | preamble |
//! |---|---|
//! | 8 | `SUBAPMAP` |
//! | 4 | version, 1 |
//! | 4 | CRC-32 of the preceding 12 bytes |
//!
//! | bytes | section |
//! |---|---|
//! | 4 | tag, ASCII |
//! | 4 | CRC-32 of tag, length and payload |
//! | 8 | length of the payload |
//! | length | payload |
//!
//! | tag | payload |
//! |---|---|
//! | `HEAD` | first section: setup, arithmetic, window, weights, frame, provenance ([`Run`]) |
//! | `MAP ` | one map: its header of 152 bytes, then its samples as the module sent them: float32 pairs, or 16-bit pairs followed by the exponents |
//! | `TAIL` | last section: totals ([`RunTotals`]), and for every map its file offset (8 bytes) and its header |
//!
//! The tail is followed by 8 bytes with its file offset and by `SUBAPEND`. Readers may skip an unknown section if its tag
//! begins with a lower-case letter; any other change requires a new version.
//!
//! **Complete or absent.** [`MapWriter`] writes a hidden file next to its target, syncs it to disk and renames it in
//! [`MapWriter::finish`]. A killed writer leaves that file, `.subap-*.part`. [`MapFile::open`] reads it, like any other
//! truncated file, up to the last complete map, and [`MapFile::is_complete`] then returns false.
//!
//! **Memory.** The writer holds one map; the reader holds 168 bytes per map and the map being read. Sizes are checked against
//! the file size and against limits ([`MAX_MAPS`], [`MAX_SAMPLES`]) before memory is allocated.
//!
//! **Errors.** Every byte is covered by a checksum. Damage is reported as an error that names the section or map, or leaves
//! the file incomplete; it never changes a value. `tests/link/maps_file.rs` damages every byte of a file and truncates it at
//! every position.

mod fields;
mod read;
mod write;

pub use read::MapFile;
pub use write::MapWriter;

use glam::DVec3;
use subaperture_core::stream::{BlockFloat, Capacity, MapHeader, Patch, Setup};

use crate::maps::Arithmetic;
#[cfg(doc)]
use crate::maps::{Run, RunTotals};
use subaperture_model::phase_history::physical::{position_fault, time_fault};

/// Maximum number of maps in a file.
pub const MAX_MAPS: u64 = 1 << 20;

/// Maximum number of samples in a map.
pub const MAX_SAMPLES: u64 = 1 << 24;

const MAGIC: &[u8; 8] = b"SUBAPMAP";
const END: &[u8; 8] = b"SUBAPEND";
const VERSION: u32 = 1;
const PREAMBLE_BYTES: u64 = 16;
const SECTION_BYTES: u64 = 16;
const TRAILER_BYTES: u64 = 16;
const HEADER_BYTES: usize = 152;

/// Maximum size in bytes of a `HEAD`, and of a `TAIL` without its index: names and JSON objects.
const MAX_TEXT_BYTES: u64 = 16 << 20;

const HEAD: [u8; 4] = *b"HEAD";
const MAP: [u8; 4] = *b"MAP ";
const TAIL: [u8; 4] = *b"TAIL";

/// Limits of the data types only.
const ANY_SIZE: Capacity = Capacity {
    pulses: u16::MAX,
    frequencies: u16::MAX,
    range_bins: u16::MAX,
    doppler_bins: u16::MAX,
    patches: u16::MAX,
};

/// First 16 bytes of every file.
fn preamble() -> [u8; PREAMBLE_BYTES as usize] {
    let mut bytes = [0; PREAMBLE_BYTES as usize];
    bytes[..8].copy_from_slice(MAGIC);
    bytes[8..12].copy_from_slice(&VERSION.to_le_bytes());
    let crc = crc32fast::hash(&bytes[..12]);
    bytes[12..].copy_from_slice(&crc.to_le_bytes());
    bytes
}

/// CRC-32 of a section, to be updated with its payload.
fn section_crc(tag: [u8; 4], length: u64) -> crc32fast::Hasher {
    let mut crc = crc32fast::Hasher::new();
    crc.update(&tag);
    crc.update(&length.to_le_bytes());
    crc
}

/// File size in bytes for `num_sub_cpis` sub-CPIs with maps of these patches, without names, weights and totals.
pub fn file_bytes(num_sub_cpis: u64, patches: &[Patch], arithmetic: Arithmetic) -> u64 {
    let header = HEADER_BYTES as u64;
    // The map and its index entry.
    let map = |patch| SECTION_BYTES + header + samples_bytes(patch, arithmetic) + 8 + header;
    let sub_cpi: u64 = patches.iter().map(map).sum();
    PREAMBLE_BYTES + num_sub_cpis * sub_cpi + 2 * SECTION_BYTES + TRAILER_BYTES
}

/// Size of a map's samples in bytes.
fn samples_bytes(patch: &Patch, arithmetic: Arithmetic) -> u64 {
    match arithmetic {
        Arithmetic::Float => 8 * patch.map_len() as u64,
        Arithmetic::Fixed => {
            let blocks = BlockFloat::blocks(patch.num_range_bins());
            4 * patch.map_len() as u64 + (patch.num_doppler_bins() * blocks) as u64
        }
    }
}

/// Fault of a map header, if any.
fn fault(header: &MapHeader, setup: &Setup) -> Option<String> {
    if !(1..=setup.num_pulses).contains(&header.num_pulses) {
        return Some(format!(
            "pulses: expected 1 to {1}, found {0}",
            header.num_pulses, setup.num_pulses
        ));
    }
    if header.patch.map_len() as u64 > MAX_SAMPLES {
        return Some(format!(
            "samples: expected at most {MAX_SAMPLES}, found {}",
            header.patch.map_len()
        ));
    }
    if let Err(error) = setup.check_patch(&header.patch, &ANY_SIZE) {
        return Some(error.to_string());
    }
    let antennas = header.nodes.iter().flat_map(|node| {
        [
            ("transmitter", node.transmitter_m),
            ("receiver", node.receiver_m),
        ]
    });
    let mut places = antennas.chain([("patch", header.patch.centre_m)]);
    if let Some(what) = places.find_map(|(name, at)| position_fault(name, DVec3::from(at))) {
        return Some(what);
    }
    if let Some(what) = header.time_s.into_iter().find_map(time_fault) {
        return Some(what);
    }
    (!header.weight_sum.is_finite()).then(|| "sum of pulse weights is not finite".to_owned())
}
