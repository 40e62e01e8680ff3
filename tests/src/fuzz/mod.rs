//! Every reader of bytes, given bytes of any kind.
//!
//! A [`Target`] reads bytes that anybody may have made and asserts what is promised of any: it returns (no
//! panic), in two seconds, within its bytes of memory; what it accepts is finite and physical; an image that is
//! formed of it is finite; and where there is a writer, what was read and written again reads the same.
//!
//! The same targets are run in two ways:
//! - `tests/damage/fuzz_targets.rs` on the seeds and for some seconds of mutation ([`Mutator`]), with every test run;
//! - `tests/fuzz` by cargo-fuzz, guided by coverage, for hours: `cargo xtask fuzz TARGET SECONDS`.
//!
//! Seeds are made by the project's own writers, or by hand where it has none. After a mutation
//! [`Target::repair`] makes lengths and checksums right again, so that it gets past the door.

mod array_recordings;
mod arrays;
mod captures;
mod container;
mod crsd;
mod endpoint;
mod images;
mod jobs;
mod maps;
mod mutate;
mod plans;
mod product;
mod recordings;
mod repair;
mod scratch;
mod session;
mod shapes;
mod sicd;
pub mod stuffing;
mod terrain;
mod texts;
mod tracks;
pub mod trial;
mod wire;

pub use mutate::Mutator;

/// Bytes that readers are allowed.
pub const MEMORY_BYTES: u64 = 16 << 20;

/// A reader, and what is promised of it.
pub struct Target {
    /// Its name, which is that of its fuzzing program too.
    pub name: &'static str,
    /// Reads bytes; what came of it, in words. Panics where a promise is broken.
    pub read: fn(&[u8]) -> String,
    /// Small inputs that are sound.
    pub seeds: fn() -> Vec<Vec<u8>>,
    /// Makes lengths and checksums right, as far as there is anything to be recognised.
    pub repair: fn(&mut Vec<u8>),
    /// Words of the format.
    pub words: &'static [&'static str],
    /// Bytes that may be allocated at once for an input of this length.
    pub most_bytes: fn(usize) -> usize,
}

/// Nothing to repair.
fn as_it_is(_bytes: &mut Vec<u8>) {}

/// Of readers with a budget: that, what an image of a few pixels takes, and copies of a small input.
fn budgeted(input_bytes: usize) -> usize {
    MEMORY_BYTES as usize + (4 << 20) + 8 * input_bytes
}

/// Of texts: what they describe within the budget, and a tree of values for each few bytes of them.
fn described(input_bytes: usize) -> usize {
    budgeted(input_bytes) + 100 * input_bytes
}

/// Of readers of text without one: a tree of values for each byte or two of it.
fn in_proportion(input_bytes: usize) -> usize {
    (2 << 20) + 400 * input_bytes
}

/// All of them.
pub static TARGETS: [Target; 28] = [
    Target {
        name: "job",
        read: jobs::job,
        seeds: jobs::seeds,
        repair: as_it_is,
        words: jobs::WORDS,
        most_bytes: in_proportion,
    },
    Target {
        name: "plan",
        read: plans::plan,
        seeds: plans::plan_seeds,
        repair: as_it_is,
        words: plans::WORDS,
        most_bytes: described,
    },
    Target {
        name: "cphd",
        read: recordings::cphd,
        seeds: recordings::cphd_seeds,
        repair: repair::cphd,
        words: recordings::CPHD_WORDS,
        most_bytes: budgeted,
    },
    Target {
        name: "crsd",
        read: crsd::read,
        seeds: crsd::seeds,
        repair: crsd::repair,
        words: crsd::WORDS,
        most_bytes: budgeted,
    },
    Target {
        name: "matlab",
        read: recordings::matlab,
        seeds: recordings::matlab_seeds,
        repair: |bytes| repair::matlab(bytes),
        words: recordings::MATLAB_WORDS,
        most_bytes: budgeted,
    },
    Target {
        name: "matlab_packed",
        read: recordings::matlab_packed,
        seeds: recordings::matlab_seeds,
        repair: |bytes| repair::matlab(bytes),
        words: recordings::MATLAB_WORDS,
        most_bytes: budgeted,
    },
    Target {
        name: "npy",
        read: arrays::npy,
        seeds: arrays::npy_seeds,
        repair: as_it_is,
        words: arrays::WORDS,
        most_bytes: budgeted,
    },
    Target {
        name: "npz",
        read: arrays::npz,
        seeds: arrays::npz_seeds,
        repair: |bytes| repair::zip(bytes),
        words: arrays::WORDS,
        most_bytes: budgeted,
    },
    Target {
        name: "array_recordings",
        read: array_recordings::read,
        seeds: array_recordings::seeds,
        repair: |bytes| repair::zip(bytes),
        words: array_recordings::WORDS,
        most_bytes: budgeted,
    },
    Target {
        name: "picture",
        read: arrays::picture,
        seeds: arrays::picture_seeds,
        repair: |bytes| repair::png(bytes),
        words: &[
            "IHDR", "IDAT", "IEND", "PLTE", "tRNS", "acTL", "iCCP", "tEXt",
        ],
        most_bytes: arrays::picture_bytes,
    },
    Target {
        name: "maps",
        read: maps::read,
        seeds: maps::seeds,
        repair: |bytes| repair::maps(bytes),
        words: &["HEAD", "MAP ", "TAIL", "note", "SUBAPEND"],
        most_bytes: budgeted,
    },
    Target {
        name: "product",
        read: product::read,
        seeds: product::seeds,
        repair: product::repair,
        words: product::WORDS,
        most_bytes: in_proportion,
    },
    Target {
        name: "scenario",
        read: texts::scenario,
        seeds: texts::scenario_seeds,
        repair: as_it_is,
        words: texts::SCENARIO_WORDS,
        most_bytes: described,
    },
    Target {
        name: "recording",
        read: texts::recording,
        seeds: texts::recording_seeds,
        repair: as_it_is,
        words: texts::RECORDING_WORDS,
        most_bytes: described,
    },
    Target {
        name: "arguments",
        read: texts::arguments,
        seeds: texts::argument_seeds,
        repair: as_it_is,
        words: texts::ARGUMENT_WORDS,
        most_bytes: in_proportion,
    },
    Target {
        name: "novatel",
        read: tracks::log,
        seeds: tracks::novatel_seeds,
        repair: repair::novatel,
        words: tracks::NOVATEL_WORDS,
        most_bytes: in_proportion,
    },
    Target {
        name: "navigation",
        read: tracks::log,
        seeds: tracks::navigation_seeds,
        repair: repair::novatel,
        words: tracks::NAVIGATION_WORDS,
        most_bytes: in_proportion,
    },
    Target {
        name: "track_csv",
        read: tracks::csv,
        seeds: tracks::csv_seeds,
        repair: as_it_is,
        words: tracks::CSV_WORDS,
        most_bytes: in_proportion,
    },
    Target {
        name: "phase_csv",
        read: tracks::phases,
        seeds: tracks::phase_seeds,
        repair: as_it_is,
        words: tracks::PHASE_WORDS,
        most_bytes: in_proportion,
    },
    Target {
        name: "motive",
        read: tracks::motive,
        seeds: tracks::motive_seeds,
        repair: as_it_is,
        words: tracks::MOTIVE_WORDS,
        most_bytes: in_proportion,
    },
    Target {
        name: "frames",
        read: wire::read,
        seeds: wire::seeds,
        repair: repair::frames,
        words: &[],
        most_bytes: in_proportion,
    },
    Target {
        name: "endpoint",
        read: endpoint::read,
        seeds: endpoint::seeds,
        repair: repair::frames,
        words: &[],
        most_bytes: in_proportion,
    },
    Target {
        name: "session",
        read: session::read,
        seeds: session::seeds,
        repair: as_it_is,
        words: &[],
        most_bytes: in_proportion,
    },
    Target {
        name: "sigmf",
        read: captures::read,
        seeds: captures::seeds,
        repair: as_it_is,
        words: captures::WORDS,
        most_bytes: described,
    },
    Target {
        name: "sicd",
        read: sicd::read,
        seeds: sicd::seeds,
        repair: as_it_is,
        words: sicd::WORDS,
        most_bytes: described,
    },
    Target {
        name: "images",
        read: images::read,
        seeds: images::seeds,
        repair: as_it_is,
        words: images::WORDS,
        most_bytes: described,
    },
    Target {
        name: "terrain",
        read: terrain::read,
        seeds: terrain::seeds,
        repair: as_it_is,
        words: terrain::WORDS,
        most_bytes: budgeted,
    },
    Target {
        name: "geojson",
        read: shapes::geojson,
        seeds: shapes::seeds,
        repair: as_it_is,
        words: shapes::WORDS,
        most_bytes: in_proportion,
    },
];

/// The target of this name.
///
/// # Panics
/// If there is none.
pub fn target(name: &str) -> &'static Target {
    let found = TARGETS.iter().find(|target| target.name == name);
    found.unwrap_or_else(|| panic!("there is no fuzz target '{name}'"))
}

/// A number that depends on every byte, for choices that an input makes.
fn choice(bytes: &[u8], of: u32) -> u32 {
    crc32fast::hash(bytes) % of
}
