//! Costs of the module: memory by region, stack, instructions by stage, bytes on the link.
//!
//! [`measure`] builds and runs one configuration, [`render`] writes `firmware/REPORT.md` for all, and `tests/firmware/budgets.rs` checks
//! their budgets. The same compiler gives the same figures on every machine.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};

use subaperture_xtask::root;

use crate::firmware::{Build, INSTRUCTION_TIME, emulate, flash_bytes, sections, try_build};

/// Configurations of the module: name, features.
pub const CONFIGURATIONS: [(&str, &str); 4] = [
    ("small fixed", "size-small,fixed"),
    ("medium float", ""),
    ("medium fixed", "fixed"),
    ("large float", "size-large"),
];

/// Clock of the STM32H743 as the board's firmware sets it.
const CLOCK_HZ: u64 = 400_000_000;

/// Bytes per second of the board's serial line: 921600 baud, ten bits per byte.
const LINE_BYTES_PER_SECOND: u64 = 92_160;

/// Figures of one configuration by name.
#[derive(Clone, Debug)]
pub struct Figures {
    /// Name of the configuration.
    pub name: &'static str,
    values: BTreeMap<String, u64>,
}

impl Figures {
    /// Value of a figure.
    ///
    /// # Panics
    /// If no figure has that name.
    pub fn get(&self, name: &str) -> u64 {
        match self.values.get(name) {
            Some(value) => *value,
            None => panic!("{}: no figure '{name}' was measured", self.name),
        }
    }

    /// Names of all figures.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.values.keys().map(String::as_str)
    }

    /// Bytes of RAM in all, with the stack used.
    fn ram_bytes(&self) -> u64 {
        ["axi", "sram123", "dtcm", "stack"]
            .iter()
            .map(|name| self.get(name))
            .sum()
    }

    /// Instructions of a map without Keystone over those of its range transforms.
    pub fn ratio(&self) -> f64 {
        (self.get("map") - self.get("keystone")) as f64 / self.get("ffts") as f64
    }
}

/// Build and measure one of [`CONFIGURATIONS`].
///
/// # Errors
/// Output of a build that failed.
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
    let most = |names: &[&str]| -> Result<u64, String> {
        let counts: Result<Vec<u64>, String> =
            names.iter().map(|name| get(&values, name)).collect();
        Ok(counts?.into_iter().max().unwrap_or(0))
    };
    let step_worst = most(&[
        "column_worst",
        "row_worst",
        "products_worst",
        "odometer_worst",
        "random_work_worst",
    ])?;
    let send_worst = most(&["send_worst", "random_send_worst"])?;
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
        ("step_worst", step_worst),
        ("wait_worst", step_worst + send_worst),
        (
            "wait_bytes",
            (step_worst + send_worst) * LINE_BYTES_PER_SECOND / CLOCK_HZ,
        ),
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

/// Path of the report.
pub fn place() -> PathBuf {
    root().join("firmware/REPORT.md")
}

/// Measure all configurations.
///
/// # Errors
/// As [`measure`].
pub fn measure_all() -> Result<Vec<Figures>, String> {
    CONFIGURATIONS
        .iter()
        .map(|(name, features)| measure(name, features))
        .collect()
}

/// Text of the report.
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
    use Show::{Bytes, Count, Kilo, Milliseconds, Ratio, Seconds, Share, Tenths};
    table(
        "Sizes",
        &[
            ("pulses per sub-CPI, `M`", Count("pulses")),
            ("frequencies, `F`", Count("frequencies")),
            ("range transform, `R`", Count("range_length")),
            ("map rows", Count("rows_of_map")),
            ("bins per row", Count("bins_of_row")),
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
        "Instructions per map, thousands",
        &[
            ("begin: phases", Kilo("begin")),
            ("columns: compensation", Kilo("compensation")),
            ("columns: keystone", Kilo("keystone")),
            ("rows", Kilo("rows")),
            ("range transforms within rows", Kilo("ffts")),
            ("**map**", Kilo("map")),
            ("share of range transforms", Share("ffts")),
            ("share of keystone", Share("keystone")),
            ("share of the rest", Share("rest")),
            ("map without keystone, relative to range transforms", Ratio),
            (
                "keystone per pair of pulses and bin",
                Tenths("keystone_tenths_a_pair"),
            ),
        ],
    );
    table(
        "Other instructions, thousands",
        &[
            ("one range transform", Kilo("fft")),
            ("`nodes` of a sub-CPI", Kilo("nodes")),
            ("receiving the pulses of a sub-CPI", Kilo("receive_pulses")),
            (
                "products of a map: 992 pixels, detections",
                Kilo("products"),
            ),
            ("encoding a map", Kilo("send_map")),
            (
                "sub-CPI in total: pulses, all maps, encoding",
                Kilo("sub_cpi"),
            ),
            ("longest step: column", Kilo("column_worst")),
            ("longest step: row", Kilo("row_worst")),
            ("longest step: chip or detection", Kilo("products_worst")),
            ("longest received frame", Kilo("receive_worst")),
            ("longest sent frame", Kilo("send_worst")),
        ],
    );
    table(
        "Longest pieces of work over random setups, thousands of instructions",
        &[
            ("random setups", Count("random_setups")),
            ("step", Kilo("random_work_worst")),
            ("received frame", Kilo("random_receive_worst")),
            ("sent frame", Kilo("random_send_worst")),
            ("longest step of all", Kilo("step_worst")),
            ("longest wait of a received byte", Kilo("wait_worst")),
        ],
    );
    table(
        "Milliseconds at 400 MHz, computed with one cycle per instruction; not measured on a device",
        &[
            ("a map", Milliseconds("map")),
            ("sub-CPI in total", Milliseconds("sub_cpi")),
            ("an increment", Milliseconds("odometer_work")),
            ("forming a range profile", Milliseconds("profiler_work")),
            (
                "longest wait of a received byte",
                Milliseconds("wait_worst"),
            ),
            (
                "bytes received meanwhile at 921600 baud, of 8192",
                Bytes("wait_bytes"),
            ),
        ],
    );
    table(
        "Motion increments: a pulse with four targets",
        &[
            ("channels", Count("odometer_channels")),
            ("frequencies", Count("odometer_frequencies")),
            ("range transform", Count("odometer_bins")),
            (
                "configuration, thousands of instructions",
                Kilo("odometer_configure"),
            ),
            (
                "receiving the channels' samples, thousands",
                Kilo("odometer_receive"),
            ),
            ("estimating the increment, thousands", Kilo("odometer_work")),
            ("longest step, thousands", Kilo("odometer_worst")),
            ("the pulse, bytes", Bytes("odometer_up_bytes")),
            ("its increment, bytes", Bytes("increment_bytes")),
        ],
    );
    table(
        "Range profiles: a sweep of a stepped-frequency radar",
        &[
            ("carriers", Count("profiler_carriers")),
            ("samples per carrier", Count("profiler_samples")),
            ("bins", Count("profiler_bins")),
            (
                "receiving a carrier's samples, thousands of instructions",
                Kilo("profiler_step"),
            ),
            (
                "longest received part of 64 samples, thousands",
                Kilo("profiler_receive_worst"),
            ),
            ("forming the profile, thousands", Kilo("profiler_work")),
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
    write_parts(&mut text, all);
    text.push_str(TAIL);
    text
}

/// A microcontroller: name, core, clock in MHz, RAM in bytes (from its data sheet), and whether it executes the measured instructions.
struct Part(&'static str, &'static str, u64, u64, bool);

const PARTS: [Part; 5] = [
    Part("STM32G474", "Cortex-M4F", 170, 131_072, true),
    Part("nRF5340", "Cortex-M33", 128, 524_288, true),
    Part("RP2350", "Cortex-M33", 150, 532_480, true),
    Part("ESP32-C6", "RV32IMAC", 160, 524_288, false),
    Part("STM32H743", "Cortex-M7", 400, 950_272, true),
];

/// Table of the parts that have the memory for each configuration.
fn write_parts(text: &mut String, all: &[Figures]) {
    let names: Vec<&str> = all.iter().map(|figures| figures.name).collect();
    let _ = write!(
        text,
        "\n## Will it fit?\n\n| part | core | MHz | RAM, kB | {} |\n|---|---|---:|---:{}|\n",
        names.join(" | "),
        "|---:".repeat(all.len())
    );
    for Part(name, core, clock_mhz, ram_bytes, measured) in PARTS {
        let cells = all.iter().map(|figures| {
            if figures.ram_bytes() > ram_bytes {
                return "no".to_owned();
            }
            match measured {
                true => format!(
                    "{:.1} ms",
                    figures.get("map") as f64 / (1e3 * clock_mhz as f64)
                ),
                false => "yes".to_owned(),
            }
        });
        let cells: Vec<String> = cells.collect();
        let _ = writeln!(
            text,
            "| {name} | {core} | {clock_mhz} | {} | {} |",
            ram_bytes / 1000,
            cells.join(" | ")
        );
    }
    let needed: Vec<String> = all
        .iter()
        .map(|figures| (figures.ram_bytes() / 1000).to_string())
        .collect();
    let _ = writeln!(text, "| RAM needed, kB | | | | {} |", needed.join(" | "));
}

/// Format of a figure.
#[derive(Clone, Copy)]
enum Show {
    Count(&'static str),
    Bytes(&'static str),
    /// Thousands.
    Kilo(&'static str),
    /// Milliseconds at [`CLOCK_HZ`], one instruction per cycle.
    Milliseconds(&'static str),
    /// Share of the instructions of a map.
    Share(&'static str),
    Tenths(&'static str),
    /// Transfer time at [`LINE_BYTES_PER_SECOND`].
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
            Self::Milliseconds(name) => {
                format!("{:.2}", value(name) * 1e3 / CLOCK_HZ as f64)
            }
            Self::Share(name) => format!("{:.0} %", 100.0 * value(name) / value("map")),
            Self::Tenths(name) => format!("{:.1}", value(name) / 10.0),
            Self::Seconds(name) => format!("{:.1}", value(name) / LINE_BYTES_PER_SECOND as f64),
            Self::Ratio => format!("{:.2}", figures.ratio()),
        }
    }
}

const HEAD: &str = "\
# Cost of the embedded module

Written by `cargo xtask module-report`, compared by `cargo xtask module-report --check`; the budgets are in
`tests/firmware/budgets.rs`.

**Method.** Instructions: the program `cycles` under QEMU's Cortex-M7, with time tied to instructions
(`-icount shift=5`). A sub-CPI passes through the endpoint as on the board, and every call is
timed. One patch fills the map buffer; a second one with one Doppler bin has columns of compensation
and one sum, so that the keystone transform is the difference. Cycles on a real STM32H743 were not measured. Memory: section
sizes of the application linked for the STM32H743ZI. Stack: the part overwritten after the run of `cycles`, with chip,
detections, increments and profiles. Link: bytes of the frames of that run. Increments: for pulses of the maximum size of the
odometer, after two pulses that confirm the targets; its buffers are in DTCM. Range profiles: for a sweep with the maximum number
of carriers of the profiler, 512 samples each in parts of 64; its buffers are in DTCM as well.
";

const TAIL: &str = "
A part fits if its RAM holds all buffers of the configuration and the stack used; the milliseconds are of a map, computed with one
cycle per instruction. They are a lower bound: waits for flash and memory are not included, and no part was measured.
The firmware is built for the STM32H743 only. Cortex-M4F and M33 execute the same instructions as the Cortex-M7 here, whose
float64 arithmetic is software as well. On RISC-V the core passes its self-test bit by bit (RV32IMAFC, emulated); its instructions
were not counted. `subap plan module --ram` plans buffers for any other size.

## Lower bounds, and the remaining cost

*Range transforms.* microfft (float32), `fixed_point::fft` (integers): one of `R` points per map row. Under the same
counter, 1024 and 128 points take 112 and 11.8 thousand instructions with `arm_cfft_q31` of CMSIS-DSP (commit ec1bb752,
GCC 12.2, `-O3`), 59.8 and 6.9 thousand with `arm_cfft_q15`. Those scale every stage by a fixed factor, and `arm_cfft_q31` keeps
the upper halves of products without rounding; `fixed_point::fft` rounds them, and scales a stage only if it must, which takes
the magnitude of every part. It takes 1.2 times as many instructions as `arm_cfft_q31` with 128 points, 1.4 times with 1024.

*Keystone* folds pulses `u` and `-u` and processes the bins `d` and `-d` together, so its unit is a pair of
pulses at a pair of bins. In float32 a unit takes 4 products and 4 sums for the bins, 4 products and
2 sums to rotate the phasor, and 4 loads: 18 instructions, without fused multiply-add. In fixed point it
takes 4 products with 64-bit sums for the bins, 4 products with rounded 32-bit sums and 2 shifts to rotate the phasor, and
2 double loads: 12. The rest is loop control, the first phasors of a bin (one, in fixed point one for
even bins, otherwise two) and stores; in fixed point also scaling and narrowing of every bin.

Four 64-bit sums do not fit in registers together with phasor and step. The fixed-point transform therefore
takes three steps for every eight pairs: phasors into memory (9 instructions per unit), even sums (5) and odd
sums (5). 19 instructions per unit and some 250 per pair of bins give 50 for 8 pairs of pulses, 35 for 16 and
27 for 31.

*Remaining cost* of a map: compensation (a rotation and a product per sample, a directly computed phasor
every 16 frequencies), filling and reading the range transform buffer, and initially two float64 square
roots per pulse, in software.

*Longest steps.* A row of a map is a single step, with its range transform. A chip is summed in steps of 32 pixels and a map
searched in steps of 128 cells, so that their steps do not grow with chip, map or detector. The random setups draw the sizes of
setup, patch, chip and detector within the capacity of the build. Between two steps the firmware reads the line and encodes
at most one frame: a received byte waits in the buffer of the serial port for a step and a frame at most.

*An increment* takes one transform per channel, a search, and three rounds over the targets. Each round adds an echo back and
subtracts it again, with three evaluations at its range in every channel: a product with a phasor and three sums per sample. The
motion estimate itself, in float64, is the smallest part.
";
