//! The file of a run's maps, `*.maps`: written as maps arrive, read one map at a time.
//!
//! Little-endian throughout. The file begins with 16 bytes, then sections follow one another:
//!
//! | bytes | preamble |
//! |---|---|
//! | 8 | `SUBAPMAP` |
//! | 4 | version, 1 |
//! | 4 | CRC-32 of the 12 bytes before |
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
//! | `HEAD` | the first: setup, arithmetic, window, weights, frame, provenance ([`Run`]) |
//! | `MAP ` | one map: its header, 152 bytes, then its samples as the module sent them: float32 pairs, or 16-bit pairs followed by the exponents |
//! | `TAIL` | the last: what is known at the end ([`Closing`]), and of every map its place in the file (8 bytes) and its header |
//!
//! After the tail stand 8 bytes with its place in the file and `SUBAPEND`. A section whose tag begins
//! with a lower-case letter may be skipped by readers that do not know it; any other change raises the
//! version.
//!
//! **Complete or absent.** [`MapWriter`] fills a hidden file beside its target, forces it to disk and
//! renames it in [`MapWriter::finish`]. A killed writer leaves that file, `.subap-*.part`;
//! [`MapFile::open`] reads it, like any other that lost its end, up to the last whole map, and says so
//! ([`MapFile::is_complete`]).
//!
//! **Memory.** The writer holds one map; the reader 168 bytes for every map there is, and the one read.
//! Sizes are checked against the file's own and against limits ([`MOST_MAPS`], [`MOST_SAMPLES`]) before
//! anything is allocated.
//!
//! **Errors.** Every byte stands under a checksum: damage is an error that names the section or map, or
//! leaves the file incomplete; it never changes a value. `tests/link/maps_file.rs` damages every byte of a
//! file, and cuts it everywhere.

mod fields;
mod read;
mod write;

pub use read::MapFile;
pub use write::MapWriter;

use glam::DVec3;
use subaperture_core::stream::{BlockFloat, Capacity, MapHeader, Patch, Setup};

use crate::maps::Arithmetic;
#[cfg(doc)]
use crate::maps::{Closing, Run};
use subaperture_model::phase_history::physical::{position_fault, time_fault};

/// Most maps in a file.
pub const MOST_MAPS: u64 = 1 << 20;

/// Most samples in a map.
pub const MOST_SAMPLES: u64 = 1 << 24;

const MAGIC: &[u8; 8] = b"SUBAPMAP";
const END: &[u8; 8] = b"SUBAPEND";
const VERSION: u32 = 1;
const PREAMBLE_BYTES: u64 = 16;
const SECTION_BYTES: u64 = 16;
const TRAILER_BYTES: u64 = 16;
const HEADER_BYTES: usize = 152;

/// Most bytes of a `HEAD`, and of a `TAIL` beside its index: names and free-form JSON.
const MOST_TEXT_BYTES: u64 = 16 << 20;

const HEAD: [u8; 4] = *b"HEAD";
const MAP: [u8; 4] = *b"MAP ";
const TAIL: [u8; 4] = *b"TAIL";

/// Nothing but the types' own limits.
const ANY_SIZE: Capacity = Capacity {
    pulses: u16::MAX,
    frequencies: u16::MAX,
    range_bins: u16::MAX,
    doppler_bins: u16::MAX,
    patches: u16::MAX,
};

/// The first 16 bytes of every file.
fn preamble() -> [u8; PREAMBLE_BYTES as usize] {
    let mut bytes = [0; PREAMBLE_BYTES as usize];
    bytes[..8].copy_from_slice(MAGIC);
    bytes[8..12].copy_from_slice(&VERSION.to_le_bytes());
    let crc = crc32fast::hash(&bytes[..12]);
    bytes[12..].copy_from_slice(&crc.to_le_bytes());
    bytes
}

/// A section's CRC-32, fed with its payload afterwards.
fn section_crc(tag: [u8; 4], length: u64) -> crc32fast::Hasher {
    let mut crc = crc32fast::Hasher::new();
    crc.update(&tag);
    crc.update(&length.to_le_bytes());
    crc
}

/// Bytes of the file of so many sub-CPIs' maps of these patches, but for names, weights and what is known at the end.
pub fn file_bytes(num_sub_cpis: u64, patches: &[Patch], arithmetic: Arithmetic) -> u64 {
    let header = HEADER_BYTES as u64;
    // Itself, and its line of the index.
    let map = |patch| SECTION_BYTES + header + samples_bytes(patch, arithmetic) + 8 + header;
    let sub_cpi: u64 = patches.iter().map(map).sum();
    PREAMBLE_BYTES + num_sub_cpis * sub_cpi + 2 * SECTION_BYTES + TRAILER_BYTES
}

/// Bytes of a map's samples.
fn samples_bytes(patch: &Patch, arithmetic: Arithmetic) -> u64 {
    match arithmetic {
        Arithmetic::Float => 8 * patch.map_len() as u64,
        Arithmetic::Fixed => {
            let blocks = BlockFloat::blocks(patch.num_range_bins());
            4 * patch.map_len() as u64 + (patch.num_doppler_bins() * blocks) as u64
        }
    }
}

/// What is wrong with a map's header, if anything.
fn fault(header: &MapHeader, setup: &Setup) -> Option<String> {
    if !(1..=setup.num_pulses).contains(&header.num_pulses) {
        return Some(format!(
            "it is of {} pulses, and a sub-CPI has 1 to {}",
            header.num_pulses, setup.num_pulses
        ));
    }
    if header.patch.map_len() as u64 > MOST_SAMPLES {
        return Some(format!(
            "it has {} samples, and at most {MOST_SAMPLES} are possible",
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
    (!header.weight_sum.is_finite())
        .then(|| "the weight of its pulses is not a finite number".to_owned())
}
