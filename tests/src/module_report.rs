//! What the module costs: memory by region, stack, instructions by stage, bytes on the link.
//!
//! [`measure`] builds and runs one configuration, [`render`] writes `firmware/REPORT.md` of all,
//! `tests/firmware/budgets.rs` holds them to their budgets. The same compiler gives the same figures on
//! every machine.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};

use subaperture_xtask::root;

use crate::firmware::{Build, INSTRUCTION_TIME, emulate, flash_bytes, sections, try_build};

/// What the module is built for: name, features.
pub const CONFIGURATIONS: [(&str, &str); 4] = [
    ("small fixed", "size-small,fixed"),
    ("medium float", ""),
    ("medium fixed", "fixed"),
    ("large float", "size-large"),
];

/// Figures of one configuration, by name.
#[derive(Clone, Debug)]
pub struct Figures {
    /// The configuration's.
    pub name: &'static str,
    values: BTreeMap<String, u64>,
}

impl Figures {
    /// A figure.
    ///
    /// # Panics
    /// If there is none of that name.
    pub fn get(&self, name: &str) -> u64 {
        match self.values.get(name) {
            Some(value) => *value,
            None => panic!("{}: no figure '{name}' was measured", self.name),
        }
    }

    /// All names.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.values.keys().map(String::as_str)
    }

    /// Map without Keystone, over its range transforms.
    pub fn ratio(&self) -> f64 {
        (self.get("map") - self.get("keystone")) as f64 / self.get("ffts") as f64
    }
}

/// Builds and measures one of [`CONFIGURATIONS`].
///
/// # Errors
/// What could not be built.
///
/// # Panics
/// If the emulator fails.
pub fn measure(name: &'static str, features: &str) -> Result<Figures, String> {
    let with = |more: &str| match features {
        "" => more.to_owned(),
        features => format!("{features},{more}"),
    };
    let cycles = try_build(&Build::bin("cycles", features))?;
    let mut values = BTreeMap::new();
    for line in emulate(&cycles, &INSTRUCTION_TIME).lines() {
        let mut words = line.split(' ');
        let (Some(stage), Some(value)) = (words.next(), words.next_back()) else {
            continue;
        };
        if let Ok(value) = value.parse() {
            // A stage measured at several lengths has its length in its name.
            let length: String = words.map(|word| format!(" {word}")).collect();
            values.insert(format!("{stage}{length}"), value);
        }
    }
    let get = |values: &BTreeMap<String, u64>, name: &str| -> Result<u64, String> {
        let value = values.get(name).copied();
        value.ok_or_else(|| format!("'cycles' printed no '{name}'"))
    };
    let length = get(&values, "range_length")?;
    let fft = if features.contains("fixed") {
        get(&values, &format!("fixed_fft {length}"))?
    } else {
        get(&values, &format!("fft {length}"))?
    };
    values.retain(|name, _| !name.contains(' '));
    let rows = get(&values, "rows_of_map")?;
    let (begin, columns) = (get(&values, "begin")?, get(&values, "columns")?);
    let compensation = get(&values, "compensation")?;
    let map = begin + columns + get(&values, "rows")?;
    let pairs = get(&values, "pulses")? / 2 * (rows / 2) * get(&values, "frequencies")?;
    let keystone = columns - compensation;
    let per_map = map + get(&values, "send_map")?;
    let patches = get(&values, "patches")?;
    for (name, value) in [
        ("fft", fft),
        ("ffts", fft * rows),
        ("map", map),
        ("keystone", keystone),
        ("keystone_tenths_a_pair", 10 * keystone / pairs.max(1)),
        ("rest", map - fft * rows - keystone),
        (
            "sub_cpi",
            get(&values, "receive_pulses")? + patches * per_map,
        ),
        ("down_bytes", patches * get(&values, "down_bytes_a_map")?),
    ] {
        values.insert(name.to_owned(), value);
    }

    let panicless = try_build(&Build::bin("application", &with("no-panic")))?;
    values.insert("flash_an500".to_owned(), flash_bytes(&panicless));
    let h743 = try_build(&Build::bin("application", &with("board-h743")))?;
    for (region, bytes) in regions(&h743) {
        values.insert(region.to_owned(), bytes);
    }
    values.insert("flash_h743".to_owned(), flash_bytes(&h743));
    Ok(Figures { name, values })
}

/// Bytes in each RAM of the STM32H743ZI, by address (RM0433, section 2).
fn regions(elf: &Path) -> [(&'static str, u64); 3] {
    let within = |start: u64, length: u64| -> u64 {
        sections(elf)
            .iter()
            .filter(|section| (start..start + length).contains(&section.address))
            .map(|section| section.bytes)
            .sum()
    };
    [
        ("dtcm", within(0x2000_0000, 0x2_0000)),
        ("axi", within(0x2400_0000, 0x8_0000)),
        ("sram123", within(0x3000_0000, 0x4_8000)),
    ]
}

/// Where the report is.
pub fn place() -> PathBuf {
    root().join("firmware/REPORT.md")
}

/// Measures all configurations.
///
/// # Errors
/// As [`measure`].
pub fn measure_all() -> Result<Vec<Figures>, String> {
    CONFIGURATIONS
        .iter()
        .map(|(name, features)| measure(name, features))
        .collect()
}

/// The report.
pub fn render(all: &[Figures]) -> String {
    let mut text = HEAD.to_owned();
    let mut table = |title: &str, lines: &[(&str, Show)]| {
        let names: Vec<&str> = all.iter().map(|figures| figures.name).collect();
        let _ = write!(text, "\n## {title}\n\n| | {} |\n|---", names.join(" | "));
        text.push_str(&"|---:".repeat(all.len()));
        text.push_str("|\n");
        for (label, show) in lines {
            let cells: Vec<String> = all.iter().map(|figures| show.cell(figures)).collect();
            let _ = writeln!(text, "| {label} | {} |", cells.join(" | "));
        }
    };
    use Show::{Bytes, Count, Kilo, Ratio, Seconds, Share, Tenths};
    table(
        "Sizes",
        &[
            ("pulses a sub-CPI, `M`", Count("pulses")),
            ("frequencies, `F`", Count("frequencies")),
            ("range transform, `R`", Count("range_length")),
            ("rows of the map", Count("rows_of_map")),
            ("bins of a row", Count("bins_of_row")),
            ("patches", Count("patches")),
        ],
    );
    table(
        "Memory, bytes",
        &[
            ("AXI SRAM, of 524288: the stores", Bytes("axi")),
            ("SRAM1 to 3, of 294912: the map", Bytes("sram123")),
            ("DTCM, of 131072, without stack", Bytes("dtcm")),
            ("stack used", Bytes("stack")),
            ("flash on the STM32H743, kB", Kilo("flash_h743")),
            ("flash on the AN500, no panic, kB", Kilo("flash_an500")),
        ],
    );
    table(
        "Instructions of a map, thousands",
        &[
            ("begin: phases", Kilo("begin")),
            ("columns: compensation", Kilo("compensation")),
            ("columns: Keystone", Kilo("keystone")),
            ("rows", Kilo("rows")),
            ("of these, range transforms", Kilo("ffts")),
            ("**map**", Kilo("map")),
            ("share of the transforms", Share("ffts")),
            ("share of Keystone", Share("keystone")),
            ("share of the rest", Share("rest")),
            ("map without Keystone, over transforms", Ratio),
            (
                "Keystone a pair of pulses and bin",
                Tenths("keystone_tenths_a_pair"),
            ),
        ],
    );
    table(
        "Instructions of the rest, thousands",
        &[
            ("one transform of `R`", Kilo("fft")),
            ("`nodes` of a sub-CPI", Kilo("nodes")),
            ("taking a sub-CPI's pulses", Kilo("receive_pulses")),
            (
                "products of a map: 1024 pixels, detections",
                Kilo("products"),
            ),
            ("encoding a map", Kilo("send_map")),
            (
                "a sub-CPI: pulses, all maps, their encoding",
                Kilo("sub_cpi"),
            ),
            ("longest piece of work: column", Kilo("column_worst")),
            ("longest piece of work: row", Kilo("row_worst")),
            ("longest piece of work: detection", Kilo("products_worst")),
            ("longest frame taken", Kilo("receive_worst")),
            ("longest frame made", Kilo("send_worst")),
        ],
    );
    table(
        "Increments instead of maps: a pulse of four targets",
        &[
            ("channels", Count("odometer_channels")),
            ("frequencies", Count("odometer_frequencies")),
            ("range transform", Count("odometer_bins")),
            (
                "settings, thousands of instructions",
                Kilo("odometer_configure"),
            ),
            (
                "taking the channels' samples, thousands",
                Kilo("odometer_receive"),
            ),
            ("finding the increment, thousands", Kilo("odometer_work")),
            ("longest piece of work, thousands", Kilo("odometer_worst")),
            ("the pulse, bytes", Bytes("odometer_up_bytes")),
            ("its increment, bytes", Bytes("increment_bytes")),
        ],
    );
    table(
        "Range profiles instead of maps: a sweep of a stepped-carrier radar",
        &[
            ("carriers", Count("profiler_carriers")),
            ("samples a step", Count("profiler_samples")),
            ("bins", Count("profiler_bins")),
            (
                "taking a step's samples, thousands of instructions",
                Kilo("profiler_step"),
            ),
            (
                "longest part taken, of 64 samples, thousands",
                Kilo("profiler_receive_worst"),
            ),
            ("making the profile, thousands", Kilo("profiler_work")),
            ("encoding it, thousands", Kilo("profiler_send")),
            ("the sweep, bytes", Bytes("profiler_up_bytes")),
            ("its profile, bytes", Bytes("profile_bytes")),
        ],
    );
    table(
        "Link, bytes",
        &[
            ("pulses of a sub-CPI", Bytes("up_bytes")),
            ("a map and its detections", Bytes("down_bytes_a_map")),
            ("maps of a sub-CPI, all patches", Bytes("down_bytes")),
            ("the chip", Bytes("chip_bytes")),
            ("seconds at 921600 baud, pulses", Seconds("up_bytes")),
            ("seconds at 921600 baud, maps", Seconds("down_bytes")),
        ],
    );
    text.push_str(TAIL);
    text
}

/// How a figure is shown.
#[derive(Clone, Copy)]
enum Show {
    Count(&'static str),
    Bytes(&'static str),
    /// Thousands.
    Kilo(&'static str),
    /// Of a map.
    Share(&'static str),
    Tenths(&'static str),
    /// At 92160 bytes a second.
    Seconds(&'static str),
    Ratio,
}

impl Show {
    fn cell(self, figures: &Figures) -> String {
        let value = |name| figures.get(name) as f64;
        match self {
            Self::Count(name) | Self::Bytes(name) => figures.get(name).to_string(),
            Self::Kilo(name) if value(name) < 100_000.0 => format!("{:.1}", value(name) / 1e3),
            Self::Kilo(name) => format!("{:.0}", value(name) / 1e3),
            Self::Share(name) => format!("{:.0} %", 100.0 * value(name) / value("map")),
            Self::Tenths(name) => format!("{:.1}", value(name) / 10.0),
            Self::Seconds(name) => format!("{:.1}", value(name) / 92_160.0),
            Self::Ratio => format!("{:.2}", figures.ratio()),
        }
    }
}

const HEAD: &str = "\
# What the module costs

Written by `cargo xtask module-report`, compared by `cargo xtask module-report --check`; the budgets are in
`tests/firmware/budgets.rs`.

**Method.** Instructions: the program `cycles` under QEMU's Cortex-M7, whose time is tied to instructions
(`-icount shift=5`); a sub-CPI goes through the station as it does on the board, and every call is
timed. One patch fills the map buffer; a second of one Doppler bin has columns that are compensation
and one sum, so that Keystone is the difference. Cycles on a real STM32H743 were not measured. Memory: section sizes of the
application linked for the STM32H743ZI. Stack: the painted part that `cycles` had overwritten after the
run, with chip, detections, increments and profiles. Link: bytes of the frames of that run. Increments: of the largest pulses that the odometer has room for, after
two that confirm their targets; its buffers are in DTCM. Range profiles: of a sweep of all carriers that the profiler has room for, 512 samples each in parts of 64; its buffers
are in DTCM too.
";

const TAIL: &str = "
## Floors, and where the rest goes

*Range transforms.* microfft (float32), `fixed_point::fft` (integers): one of `R` points a row of the map.

*Keystone* folds pulses `u` and `-u` and serves the bins `d` and `-d` together, so a unit of it is a pair
of pulses at a pair of bins. In float32 a unit takes 4 products and 4 sums for the bins, 4 products and
2 sums to turn the phasor, and 4 loads: 18 instructions, where no multiply-add may be fused. In fixed
point it takes 8 multiplications of 32 to 64 bits, 2 double loads, and 4 instructions for each
of the phasor's two parts to round: 18. What is above that is loop control, the phasors that begin a bin
(one, in fixed point two) and the stores; in fixed point also scaling and narrowing of every bin,
and registers: four 64-bit sums do not fit beside phasor and step, and of the loop's 46 instructions 18
are loads and stores of the stack.

*The rest* of a map: compensation (a rotation and a product a sample, a fresh phasor every 16
frequencies), filling and emptying the row of the transform, and at the beginning two square roots of
float64 a pulse, in software.

*Not in pieces.* The search for detections is one piece of work, the longest there is; a row of a chip is
one too. Columns, rows and frames are short.

*An increment* is a transform of each channel; a search, and three rounds over the targets, each of which takes an echo away and adds it again, with
three looks at its range in every channel: a product with a phasor and three sums a sample. Motion itself, in float64, is the least of it.
";
