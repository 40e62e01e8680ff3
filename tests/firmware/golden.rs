//! Bits of the streaming core: one map of each arithmetic value by value, and the checksums of the self-tests on other machines.
//!
//! `tests/golden/*.txt` contain one map each, one value per line: Doppler bin, range bin, real and imaginary part. Float32 values are the
//! hexadecimal digits of their bits; fixed-point values are mantissas (hexadecimal, 16 bits) and the exponent of the block (decimal). They
//! change only with the arithmetic: find the reason, then write new ones with
//!
//! ```text
//! SUBAPERTURE_WRITE_GOLDEN=1 cargo test -p subaperture-tests --test firmware golden::golden_map
//! ```
//!
//! `tests/stream/float.rs` and `tests/stream/fixed.rs` show that the maps are correct; here they only have to be the same.

use std::fmt::Write;
use std::path::Path;
use std::process::{Command, Stdio};

use subaperture_core::selftest::{
    FixedStreamSelfTest, FloatStreamSelfTest, MotionSelfTest, OdometerSelfTest, SelfTest,
    SweepSelfTest,
};
use subaperture_core::stream::{BlockFloat, MapSamples, PatchMap};
use subaperture_tests::firmware::{self, Build, finish};
use subaperture_xtask::target_installed;

/// Number of the recorded map: the second patch, off the origin, of the second sub-CPI of the first run.
const KEPT: usize = 3;

#[test]
fn golden_map_of_float() {
    let (mut number, mut text) = (0, String::new());
    let see = |map: &PatchMap<'_>| keep(map, &mut number, &mut text);
    FloatStreamSelfTest::new().run_with(see).unwrap();
    compare("stream_float.txt", &text);
}

#[test]
fn golden_map_of_fixed_point() {
    let (mut number, mut text) = (0, String::new());
    let see = |map: &PatchMap<'_>| keep(map, &mut number, &mut text);
    FixedStreamSelfTest::new().run_with(see).unwrap();
    compare("stream_fixed.txt", &text);
}

/// Write the map to `text` if it is the recorded one.
fn keep(map: &PatchMap<'_>, number: &mut usize, text: &mut String) {
    if *number == KEPT {
        write_map(map, text);
    }
    *number += 1;
}

fn write_map(map: &PatchMap<'_>, text: &mut String) {
    let patch = &map.header.patch;
    let (rows, width) = (patch.num_doppler_bins(), patch.num_range_bins());
    for index in 0..rows * width {
        let d = (index / width) as i32 - i32::from(patch.doppler_reach);
        let r = (index % width) as i32 - i32::from(patch.range_reach);
        match map.samples {
            MapSamples::Float(samples) => {
                let (re, im) = (samples[index].re.to_bits(), samples[index].im.to_bits());
                writeln!(text, "{d} {r} {re:08x} {im:08x}").unwrap();
            }
            MapSamples::Fixed(block_float) => {
                let mantissa = block_float.mantissas[index];
                let blocks = index / width * BlockFloat::blocks(width);
                let exponent = block_float.exponents[blocks + index % width / BlockFloat::BLOCK];
                let (re, im) = (mantissa.re.to_bits(), mantissa.im.to_bits());
                writeln!(text, "{d} {r} {re:04x} {im:04x} {exponent}").unwrap();
            }
        }
    }
}

/// Compare with the file line by line, or write it.
fn compare(name: &str, text: &str) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("golden");
    let path = folder.join(name);
    if std::env::var_os("SUBAPERTURE_WRITE_GOLDEN").is_some() {
        std::fs::write(&path, text).unwrap();
        return;
    }
    let golden = std::fs::read_to_string(&path)
        .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let values = text.lines().count();
    assert!(values > 100, "a map of {values} values");
    assert_eq!(golden.lines().count(), values, "values of {name}");
    let pairs = golden.lines().zip(text.lines()).enumerate();
    let differ: Vec<_> = pairs.filter(|(_, (golden, got))| golden != got).collect();
    if let Some((line, (golden, got))) = differ.first() {
        panic!(
            "{} of {values} values of {name} differ; the first, line {}:\n{golden} (golden)\n{got} (now)",
            differ.len(),
            line + 1
        );
    }
}

/// `no-panic`: the program links only if no panic can be reached.
#[test]
fn cortex_m7_computes_the_same_bits() {
    let lines = Machine {
        target: "thumbv7em-none-eabihf",
        features: "no-panic",
        // The log is the second serial line.
        emulator: &["qemu-system-arm", "-M", "mps2-an500", "-serial", "null"],
    }
    .run("stream_selftest");
    let Some(lines) = lines else { return };
    assert_eq!(checksums(&lines[..2]), [float(), fixed()]);
    let [used, all] = stack(&lines[2]);
    assert!(used < all, "{used} of {all} bytes of stack");
}

/// 16 KiB of RAM, no floating point, no division, no atomic exchange. The linker limits the statics to the memory; the stack has the rest.
#[test]
fn cortex_m0_computes_the_same_bits() {
    let lines = Machine {
        target: "thumbv6m-none-eabi",
        features: "board-microbit,no-panic",
        emulator: &["qemu-system-arm", "-M", "microbit"],
    }
    .run("stream_selftest");
    let Some(lines) = lines else { return };
    assert_eq!(checksums(&lines[..1]), [fixed()]);
    let [used, all] = stack(&lines[1]);
    let buffers: u32 = lines[0].split(' ').nth(1).unwrap().parse().unwrap();
    println!("buffers {buffers} bytes, stack {used} of {all} bytes");
    assert!(buffers + all <= 16 * 1024, "the machine's memory");
    assert!(used < all, "{used} of {all} bytes of stack");
}

#[test]
fn riscv_computes_the_same_bits() {
    let lines = Machine {
        target: "riscv32imafc-unknown-none-elf",
        features: "",
        emulator: &["qemu-system-riscv32", "-M", "virt", "-bios", "none"],
    }
    .run("stream_selftest");
    let Some(lines) = lines else { return };
    assert_eq!(checksums(&lines), [float(), fixed()]);
}

#[test]
fn aarch64_computes_the_same_bits() {
    let machine = Machine {
        target: "aarch64-unknown-linux-musl",
        features: "",
        emulator: &["qemu-aarch64"],
    };
    let Some(lines) = machine.run("stream_selftest") else {
        return;
    };
    assert_eq!(checksums(&lines), [float(), fixed()]);
    let lines = machine.run("selftest").unwrap();
    let mut plan = Box::new(SelfTest::new());
    let plan = plan.run().unwrap();
    assert_eq!(lines[1], format!("checksum 0x{plan:08x}"));
    let motion = MotionSelfTest::new().unwrap().run().unwrap();
    assert_eq!(lines[3], format!("checksum 0x{motion:08x}"));
    let odometer = OdometerSelfTest::new().run().unwrap();
    assert_eq!(lines[5], format!("checksum 0x{odometer:08x}"));
    let sweep = SweepSelfTest::new().run().unwrap();
    assert_eq!(lines[7], format!("checksum 0x{sweep:08x}"));
}

fn float() -> (String, String) {
    let checksum = FloatStreamSelfTest::new().run().unwrap();
    ("float".to_owned(), format!("0x{checksum:08x}"))
}

fn fixed() -> (String, String) {
    let checksum = FixedStreamSelfTest::new().run().unwrap();
    ("fixed".to_owned(), format!("0x{checksum:08x}"))
}

/// Names and checksums of lines such as `fixed 4496 bytes 0x01234567`.
fn checksums(lines: &[String]) -> Vec<(String, String)> {
    let parts = lines.iter().map(|line| {
        let words: Vec<&str> = line.split(' ').collect();
        let [name, _, "bytes", checksum] = words[..] else {
            panic!("{line}");
        };
        (name.to_owned(), checksum.to_owned())
    });
    parts.collect()
}

/// Bytes used and available from a line such as `stack 2164 of 11868 bytes`.
fn stack(line: &str) -> [u32; 2] {
    let words: Vec<&str> = line.split(' ').collect();
    let ["stack", used, "of", all, "bytes"] = words[..] else {
        panic!("{line}");
    };
    [used, all].map(|bytes| bytes.parse().unwrap())
}

struct Machine {
    target: &'static str,
    /// Features of the firmware's package.
    features: &'static str,
    emulator: &'static [&'static str],
}

impl Machine {
    /// Lines that a program of the firmware prints; `None` if the target or the emulator is missing.
    fn run(&self, program: &str) -> Option<Vec<String>> {
        let emulator = self.emulator[0];
        let version = Command::new(emulator).arg("--version").output();
        for (found, missing) in [
            (target_installed(self.target), self.target),
            (version.is_ok(), emulator),
        ] {
            if !found {
                println!("skipped: {missing} not found");
                return None;
            }
        }
        let build = Build {
            target: self.target,
            ..Build::bin(program, self.features)
        };
        Some(self.emulate(&firmware::build(&build)))
    }

    fn emulate(&self, elf: &Path) -> Vec<String> {
        let mut command = Command::new(self.emulator[0]);
        command.args(&self.emulator[1..]);
        if self.emulator[0].contains("-system-") {
            command
                .args(["-display", "none", "-monitor", "none", "-serial", "stdio"])
                .args(["-semihosting-config", "enable=on,target=native", "-kernel"]);
        }
        let emulator = command
            .arg(elf)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the emulator starts");
        let printed = finish(emulator);
        printed.lines().map(str::to_owned).collect()
    }
}
