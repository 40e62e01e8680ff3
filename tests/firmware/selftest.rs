//! The firmware under emulation: the same bits as on the host, in the documented memory; sections, faults, and programs that must not link.

use object::elf::{SHF_ALLOC, SHF_WRITE};
use object::{Object, ObjectSection, SectionFlags};
use subaperture_core::selftest::{MotionSelfTest, OdometerSelfTest, SelfTest, SweepSelfTest};
use subaperture_tests::firmware::{
    Build, INSTRUCTION_TIME, build, emulate, flash_bytes, module, sections, try_build,
};

/// RAM other than the self-test's buffers: the count of resets, flags and alignment.
const OTHER_RAM_BYTES: u64 = 256;
/// Code and constants: 147 kB when written. Most of it are FFTs of all lengths; increments from echoes have 19 kB, increments from samples
/// 39 kB, range profiles 14 kB.
const FLASH_BUDGET_BYTES: u64 = 149 * 1024;

#[test]
fn target_computes_same_bits_as_host_in_documented_memory() {
    let elf = build(&Build::bin("selftest", ""));
    let mut host = Box::new(SelfTest::new());
    let host = host.run().unwrap();
    let motion = MotionSelfTest::new().unwrap().run().unwrap();
    let odometer = OdometerSelfTest::new().run().unwrap();
    let sweep = SweepSelfTest::new().run().unwrap();
    let expected = format!(
        "buffers {} bytes\nchecksum 0x{host:08x}\nmotion {} bytes\nchecksum 0x{motion:08x}\n\
         odometer {} bytes\nchecksum 0x{odometer:08x}\nsweep {} bytes\nchecksum 0x{sweep:08x}\n",
        size_on_target(),
        motion_size_on_target(),
        odometer_size_on_target(),
        sweep_size_on_target()
    );
    assert_eq!(emulate(&elf, &[]), expected);

    let bytes = std::fs::read(&elf).unwrap();
    let file = object::File::parse(&*bytes).unwrap();
    let ram: u64 = file
        .sections()
        .filter(|section| {
            let both = u64::from(SHF_ALLOC | SHF_WRITE);
            matches!(section.flags(), SectionFlags::Elf { sh_flags } if sh_flags & both == both)
        })
        .map(|section| section.size())
        .sum();
    let flash = flash_bytes(&elf);
    println!("RAM {ram} bytes, flash {flash} bytes");
    let tests = size_on_target() + odometer_size_on_target() + sweep_size_on_target();
    let budget = tests + OTHER_RAM_BYTES;
    assert!(ram >= size_on_target(), "the buffers are statics");
    assert!(ram <= budget, "RAM {ram} bytes, budget {budget}");
    assert!(flash > 0, "something is loaded");
    assert!(
        flash <= FLASH_BUDGET_BYTES,
        "flash {flash} bytes, budget {FLASH_BUDGET_BYTES}"
    );
}

/// Antennas of six channels, four targets of the previous pulse, and a few numbers.
fn motion_size_on_target() -> u64 {
    // A target: position, six phases and a weight, a count, a name, padding.
    let target = 16 + 48 + 8 + 4 + 4;
    // Centre, nearest channels and the vector between them, wavenumber; number of targets seen; the last increment.
    let others = 16 + 8 + 16 + 8 + 8 + 24;
    // Number of channels, with padding.
    6 * 32 + 4 * target + others + 8
}

/// Samples, weights, a profile and its power for two channels of 32 frequencies in 128 bins; and the state of targets, channels and
/// settings.
fn odometer_size_on_target() -> u64 {
    let stated = 8 * 2 * 32 + 4 * 32 + 12 * 128;
    // Four targets: detections 16 bytes, and 8 per channel; tracks 88.
    let targets = 4 * (16 + 16 + 88);
    // Two channels, targets of the previous pulse, settings with derived values, and progress.
    let rest = 560;
    stated + targets + rest
}

/// Tones of 8 samples, 50 carriers and 128 bins; and settings, the blocks of a burst and progress.
fn sweep_size_on_target() -> u64 {
    let stated = 24 * 8 + 20 * 50 + 8 * 128;
    let (setup, blocks, rest) = (32, 31 * 12, 60);
    stated + setup + blocks + rest
}

/// Sizes of the buffers, added up.
fn size_on_target() -> u64 {
    let (m, f, r, d, l) = (32, 64, 128, 64, 128);
    let weights = 4 * (m + f);
    let (matrix, history) = (4 * f * m * m, 8 * f * m);
    let (scratch, map) = (3 * 8 * l, 8 * d * r);
    let (image, power) = (8 * 256, 4 * r * d);
    weights + matrix + history + scratch + map + image + power
}

#[test]
fn named_sections_are_zero_at_start_and_the_stack_is_measured() {
    let elf = build(&Build::example("sections", ""));
    let printed = emulate(&elf, &[]);
    let lines: Vec<_> = printed.lines().collect();
    let [first, stack, _, second] = lines[..] else {
        panic!("{printed}");
    };
    assert_eq!(first, "resets 0, bytes not zero 0");
    // The second start sees values of the first one unless they are zeroed.
    assert_eq!(second, "resets 1, bytes not zero 0");
    let rise = stack.strip_prefix("stack rose by ").expect(stack);
    let rise: u32 = rise.parse().unwrap();
    // 10 000 bytes, some of them in the part that `main` had used before (it formats a line: below 1 kB).
    assert!((9_000..=10_200).contains(&rise), "{rise}");

    let sections = sections(&elf);
    for (name, bytes) in [(".axi", 300_001), (".sram", 200_003)] {
        let size = sections.iter().find(|s| s.name == name).expect(name).bytes;
        assert!((bytes..bytes + 64).contains(&size), "{name}: {size}");
    }
}

#[test]
fn every_fault_ends_in_a_counted_reset() {
    let printed = emulate(&build(&Build::example("faults", "")), &[]);
    let starts: Vec<_> = printed
        .lines()
        .filter(|line| line.starts_with("resets"))
        .collect();
    assert_eq!(starts, ["resets 0", "resets 1", "resets 2", "resets 3"]);
    for reason in ["hard fault at 0x", "exception -14", "on purpose"] {
        assert_eq!(printed.matches(reason).count(), 1, "{reason}: {printed}");
    }
}

/// The application links, so no reachable function panics; a program with indexing does not link.
#[test]
fn reachable_panic_does_not_link() {
    for elf in module().unwrap() {
        assert!(flash_bytes(&elf) > 0, "{}", elf.display());
    }
    let refused = try_build(&Build::example("panics", "no-panic")).expect_err("it linked");
    assert!(
        refused.contains("undefined symbol: panic_is_reachable"),
        "{refused}"
    );
    // The panic is the cause: the program links without that check.
    build(&Build::example("panics", ""));
}

#[test]
fn stage_costs_agree_with_documentation() {
    let elf = build(&Build::bin("cycles", ""));
    let printed = emulate(&elf, &INSTRUCTION_TIME);
    println!("{printed}");
    let cost = |stage: &str| -> f64 {
        let line = printed.lines().find(|line| line.starts_with(stage));
        line.expect(stage)[stage.len()..].trim().parse().unwrap()
    };
    // Two instructions per round, two calls, and a tick (0.8 instructions) at either end.
    for (stage, instructions) in [("loop 1000 ", 2_000.0), ("loop 30000 ", 60_000.0)] {
        assert!(
            (0.0..=12.0).contains(&(cost(stage) - instructions)),
            "{stage}"
        );
    }
    // As documented in `core::fft`; compilers differ by a few percent.
    for (stage, instructions) in [
        ("fft 64 ", 3.0e3),
        ("fft 1024 ", 90.9e3),
        ("fft 4096 ", 448e3),
    ] {
        let ratio = cost(stage) / instructions;
        assert!((0.95..1.05).contains(&ratio), "{stage}: {ratio}");
    }
}

#[test]
fn self_test_fits_memory_of_h743() {
    let sections = sections(&build(&Build::bin("selftest", "board-h743")));
    // The regions of the reference manual (RM0433, section 2), not those of `memory.x`.
    for (name, start, length) in [
        (".vector_table", 0x0800_0000, 0x20_0000),
        (".text", 0x0800_0000, 0x20_0000),
        (".rodata", 0x0800_0000, 0x20_0000),
        (".data", 0x2000_0000, 0x2_0000),
        (".bss", 0x2000_0000, 0x2_0000),
        (".axi", 0x2400_0000, 0x8_0000),
        (".sram", 0x3000_0000, 0x4_8000),
    ] {
        let section = sections.iter().find(|s| s.name == name).expect(name);
        let (address, size) = (section.address, section.bytes);
        println!("{name} {size} bytes at 0x{address:08x}");
        let region = start..=start + length;
        assert!(
            region.contains(&address) && region.contains(&(address + size)),
            "{name}: {size} bytes at 0x{address:08x}"
        );
    }
    let axi = sections.iter().find(|s| s.name == ".axi").unwrap().bytes;
    assert!(axi >= size_on_target(), "the buffers are in AXI SRAM");
}
