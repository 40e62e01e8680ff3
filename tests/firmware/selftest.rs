//! The firmware under emulation: the same bits as on the host, in the memory that is stated; the
//! sections, faults, and what the linker refuses.

use object::elf::{SHF_ALLOC, SHF_WRITE};
use object::{Object, ObjectSection, SectionFlags};
use subaperture_core::selftest::{MotionSelfTest, OdometerSelfTest, SelfTest, SweepSelfTest};
use subaperture_tests::firmware::{
    Build, INSTRUCTION_TIME, build, emulate, flash_bytes, module, sections, try_build,
};

/// RAM beside the self-test's buffers: the count of resets, flags and alignment.
const OTHER_RAM_BYTES: u64 = 256;
/// Code and constants: 147 kB when this was written, of which the FFTs of all lengths are most, increments of echoes 19 kB, those of samples 39 kB, range profiles 14 kB.
const FLASH_BUDGET_BYTES: u64 = 149 * 1024;

#[test]
fn target_computes_the_hosts_bits_in_the_stated_memory() {
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

/// Antennas of six channels, the former pulse's four targets, and a few numbers.
fn motion_size_on_target() -> u64 {
    // A target: its place, six phases and a weight, a count, a name, padded.
    let target = 16 + 48 + 8 + 4 + 4;
    // Centre, nearest channels and what is between them, wavenumber; how many were seen; the last increment.
    let others = 16 + 8 + 16 + 8 + 8 + 24;
    // And how many channels there are, padded.
    6 * 32 + 4 * target + others + 8
}

/// Samples, weights, a profile and its power of two channels of 32 frequencies in 128 bins; and what belongs to targets, channels and settings.
fn odometer_size_on_target() -> u64 {
    let stated = 8 * 2 * 32 + 4 * 32 + 12 * 128;
    // Of four targets: where they are found, 16 and 8 a channel; whom they are followed as, 88.
    let targets = 4 * (16 + 16 + 88);
    // Two channels, the former pulse's targets, settings and what follows of them, and where it stands.
    let rest = 560;
    stated + targets + rest
}

/// Tones of 8 samples, 50 carriers and 128 bins; and what belongs to settings, a burst's blocks and where it stands.
fn sweep_size_on_target() -> u64 {
    let stated = 24 * 8 + 20 * 50 + 8 * 128;
    let (setup, blocks, rest) = (32, 31 * 12, 60);
    stated + setup + blocks + rest
}

/// The buffers by arithmetic; lengths (`usize`) and alignment differ from the host by a few words.
fn size_on_target() -> u64 {
    let (m, f, r, d, l) = (32, 64, 128, 64, 128);
    let weights = 4 * (m + f);
    let (matrix, history) = (4 * f * m * m, 8 * f * m);
    let (scratch, map) = (3 * 8 * l, 8 * d * r);
    // 256 pixels, the grid (72 bytes of vectors, two sizes, padded), a length; then power, two
    // sizes, count, length.
    let image = 8 * 256 + 72 + 8 + 8;
    let power = 4 * r * d + 8 + 4 + 4;
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
    // The second start finds the ones of the first, unless they are zeroed.
    assert_eq!(second, "resets 1, bytes not zero 0");
    let rise = stack.strip_prefix("stack rose by ").expect(stack);
    let rise: u32 = rise.parse().unwrap();
    // 10 000 bytes, some of them in what `main` had used and left (it formats a line: below 1 kB).
    assert!((9_000..=10_200).contains(&rise), "{rise}");

    let sections = sections(&elf);
    for (name, bytes) in [(".axi", 300_001), (".sram", 200_003)] {
        let size = sections.iter().find(|s| s.name == name).expect(name).bytes;
        assert!((bytes..bytes + 64).contains(&size), "{name}: {size}");
    }
}

#[test]
fn every_death_ends_in_a_counted_reset() {
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

/// The application links although nothing could be called if it panicked; a program that indexes does not.
#[test]
fn a_reachable_panic_does_not_link() {
    for elf in module().unwrap() {
        assert!(flash_bytes(&elf) > 0, "{}", elf.display());
    }
    let refused = try_build(&Build::example("panics", "no-panic")).expect_err("it linked");
    assert!(
        refused.contains("undefined symbol: panic_is_reachable"),
        "{refused}"
    );
    // It is the panic that is refused, not the program.
    build(&Build::example("panics", ""));
}

/// Logs as defmt frames link on both boards.
#[test]
fn defmt_links() {
    for features in ["defmt", "board-h743,defmt"] {
        let elf = build(&Build::bin("application", features));
        // Where defmt keeps the texts that the frames refer to.
        assert!(
            sections(&elf).iter().any(|s| s.name == ".defmt"),
            "{features}"
        );
    }
}

#[test]
fn stage_costs_agree_with_their_statement() {
    let elf = build(&Build::bin("cycles", ""));
    let printed = emulate(&elf, &INSTRUCTION_TIME);
    println!("{printed}");
    let cost = |stage: &str| -> f64 {
        let line = printed.lines().find(|line| line.starts_with(stage));
        line.expect(stage)[stage.len()..].trim().parse().unwrap()
    };
    // Two instructions a round, two calls, and a tick (0.8 instructions) at either end.
    for (stage, instructions) in [("loop 1000 ", 2_000.0), ("loop 30000 ", 60_000.0)] {
        assert!(
            (0.0..=12.0).contains(&(cost(stage) - instructions)),
            "{stage}"
        );
    }
    // As the documentation of `core::fft` states them; compilers differ by a few percent.
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
fn the_h743s_memory_holds_the_self_test() {
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
