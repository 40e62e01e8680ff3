//! Fuzz targets: every reader of bytes on arbitrary input.
//!
//! A [`Target`] reads arbitrary bytes and asserts the promises for any input: it returns without panic, within two seconds and its memory;
//! accepted values are finite and physical; an image formed from them is finite; and where there is a writer, written values are read
//! unchanged.
//!
//! The same targets are run by
//! - `tests/damage/fuzz_targets.rs` on the seeds and some seconds of mutations ([`Mutator`]), with every test run;
//! - `tests/fuzz` by cargo-fuzz, guided by coverage, for hours: `cargo xtask fuzz TARGET SECONDS`.
//!
//! Seeds are made by the project's own writers, or by hand where there is none. After a mutation [`Target::repair`] corrects lengths and
//! checksums, so that the input passes the first checks.

mod array_recordings;
mod arrays;
mod captures;
mod container;
mod crsd;
mod endpoint;
mod gotcha_gmti;
mod images;
mod jobs;
mod l0b;
mod maps;
mod mutate;
mod plans;
mod product;
mod recordings;
mod repair;
mod scpi;
mod scratch;
mod session;
mod shapes;
mod sicd;
pub mod stuffing;
mod terrain;
mod texts;
mod touchstone;
mod tracks;
pub mod trial;
mod wire;

pub use mutate::Mutator;

/// Memory budget of readers, bytes.
pub const MEMORY_BYTES: u64 = 16 << 20;

/// A reader and its promises.
pub struct Target {
    /// Name, also that of its fuzzing program.
    pub name: &'static str,
    /// Read bytes; returns a description of the outcome. Panics where a promise is broken.
    pub read: fn(&[u8]) -> String,
    /// Small valid inputs.
    pub seeds: fn() -> Vec<Vec<u8>>,
    /// Correct lengths and checksums, as far as the format is recognised.
    pub repair: fn(&mut Vec<u8>),
    /// Words of the format.
    pub words: &'static [&'static str],
    /// Maximum of simultaneously allocated bytes for an input of this length.
    pub most_bytes: fn(usize) -> usize,
}

/// Repair of formats without lengths and checksums: no change.
fn unchanged(_bytes: &mut Vec<u8>) {}

/// Limit of readers with a budget: the budget, an image of a few pixels, and copies of a small input.
fn budgeted(input_bytes: usize) -> usize {
    MEMORY_BYTES as usize + (4 << 20) + 8 * input_bytes
}

/// Limit of descriptions: content within the budget, and a tree of values for each few bytes of text.
fn described(input_bytes: usize) -> usize {
    budgeted(input_bytes) + 100 * input_bytes
}

/// Limit of text readers without a budget: a tree of values for each byte or two of text.
fn in_proportion(input_bytes: usize) -> usize {
    (2 << 20) + 400 * input_bytes
}

/// All targets.
pub static TARGETS: [Target; 33] = [
    Target {
        name: "job",
        read: jobs::job,
        seeds: jobs::seeds,
        repair: unchanged,
        words: jobs::WORDS,
        most_bytes: in_proportion,
    },
    Target {
        name: "plan",
        read: plans::plan,
        seeds: plans::plan_seeds,
        repair: unchanged,
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
        name: "l0b",
        read: l0b::read,
        seeds: l0b::seeds,
        repair: unchanged,
        words: l0b::WORDS,
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
        name: "gotcha_gmti",
        read: gotcha_gmti::read,
        seeds: gotcha_gmti::seeds,
        repair: gotcha_gmti::repair,
        words: gotcha_gmti::WORDS,
        most_bytes: budgeted,
    },
    Target {
        name: "npy",
        read: arrays::npy,
        seeds: arrays::npy_seeds,
        repair: unchanged,
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
        repair: unchanged,
        words: texts::SCENARIO_WORDS,
        most_bytes: described,
    },
    Target {
        name: "recording",
        read: texts::recording,
        seeds: texts::recording_seeds,
        repair: unchanged,
        words: texts::RECORDING_WORDS,
        most_bytes: described,
    },
    Target {
        name: "arguments",
        read: texts::arguments,
        seeds: texts::argument_seeds,
        repair: unchanged,
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
        repair: unchanged,
        words: tracks::CSV_WORDS,
        most_bytes: in_proportion,
    },
    Target {
        name: "phase_csv",
        read: tracks::phases,
        seeds: tracks::phase_seeds,
        repair: unchanged,
        words: tracks::PHASE_WORDS,
        most_bytes: in_proportion,
    },
    Target {
        name: "pattern_csv",
        read: tracks::pattern,
        seeds: tracks::pattern_seeds,
        repair: unchanged,
        words: tracks::PATTERN_WORDS,
        most_bytes: in_proportion,
    },
    Target {
        name: "motive",
        read: tracks::motive,
        seeds: tracks::motive_seeds,
        repair: unchanged,
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
        repair: unchanged,
        words: &[],
        most_bytes: in_proportion,
    },
    Target {
        name: "sigmf",
        read: captures::read,
        seeds: captures::seeds,
        repair: unchanged,
        words: captures::WORDS,
        most_bytes: described,
    },
    Target {
        name: "sicd",
        read: sicd::read,
        seeds: sicd::seeds,
        repair: unchanged,
        words: sicd::WORDS,
        most_bytes: described,
    },
    Target {
        name: "images",
        read: images::read,
        seeds: images::seeds,
        repair: unchanged,
        words: images::WORDS,
        most_bytes: described,
    },
    Target {
        name: "terrain",
        read: terrain::read,
        seeds: terrain::seeds,
        repair: unchanged,
        words: terrain::WORDS,
        most_bytes: budgeted,
    },
    Target {
        name: "geojson",
        read: shapes::geojson,
        seeds: shapes::seeds,
        repair: unchanged,
        words: shapes::WORDS,
        most_bytes: in_proportion,
    },
    Target {
        name: "touchstone",
        read: touchstone::read,
        seeds: touchstone::seeds,
        repair: unchanged,
        words: touchstone::WORDS,
        most_bytes: described,
    },
    Target {
        name: "scpi",
        read: scpi::read,
        seeds: scpi::seeds,
        repair: unchanged,
        words: scpi::WORDS,
        most_bytes: budgeted,
    },
];

/// The target of this name.
///
/// # Panics
/// Panics if there is no such target.
pub fn target(name: &str) -> &'static Target {
    let found = TARGETS.iter().find(|target| target.name == name);
    found.unwrap_or_else(|| panic!("there is no fuzz target '{name}'"))
}

/// A number from 0 to `of - 1` that depends on every byte, for choices by the input.
fn choice(bytes: &[u8], of: u32) -> u32 {
    crc32fast::hash(bytes) % of
}
