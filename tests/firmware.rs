//! The firmware under emulation: the same bits as on the host, in the memory that is stated; the link,
//! the sections, faults, and what the linker refuses.

use std::io::{Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use object::elf::{SHF_ALLOC, SHF_WRITE};
use object::{Object, ObjectSection, ObjectSegment, SectionFlags};
use subaperture_core::selftest::SelfTest;

const TARGET: &str = "thumbv7em-none-eabihf";
/// Most runs take about 0.2 s, the links' some seconds; a hang must not hang the tests.
const TIME_LIMIT: Duration = Duration::from_secs(60);
/// RAM beside the self-test's buffers: the count of resets, flags and alignment.
const OTHER_RAM_BYTES: u64 = 256;
/// Code and constants: 74 kB when this was written, of which the FFTs of all lengths are most.
const FLASH_BUDGET_BYTES: u64 = 96 * 1024;

/// Runs cargo on one program of the firmware, in a target folder of its own: cargo locks each.
fn cargo(kind: &str, program: &str, options: &[&str]) -> (Output, PathBuf) {
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("firmware");
    // Options choose what the program is made of; the tests run at the same time.
    let folder = folder.join(options.join(" ").replace([' ', ',', '-'], "_"));
    let output = Command::new(env!("CARGO"))
        .current_dir(workspace)
        .args(["build", "--package", "subaperture-firmware", "--locked"])
        .args(["--profile", "firmware", kind, program])
        .args(options)
        .args(["--target", TARGET, "--target-dir"])
        .arg(&folder)
        .output()
        .expect("cargo runs");
    let place = folder.join(TARGET).join("firmware");
    match kind {
        "--example" => (output, place.join("examples").join(program)),
        _ => (output, place.join(program)),
    }
}

/// Builds one program of the firmware; its ELF.
fn build(kind: &str, program: &str, options: &[&str]) -> PathBuf {
    let (output, elf) = cargo(kind, program, options);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(
        !stderr.contains("can't find crate for `core`"),
        "the target is missing: rustup target add {TARGET}"
    );
    assert!(output.status.success(), "{stderr}");
    elf
}

fn emulator(elf: &Path, options: &[&str]) -> Child {
    Command::new("qemu-system-arm")
        .args(["-M", "mps2-an500", "-display", "none", "-monitor", "none"])
        .args(["-semihosting-config", "enable=on,target=native"])
        .args(options)
        .arg("-kernel")
        .arg(elf)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the emulator is missing: apt-get install qemu-system-arm")
}

/// Runs an ELF to its end under emulation; what it printed.
fn emulate(elf: &Path, options: &[&str]) -> String {
    let mut emulator = emulator(elf, options);
    let started = Instant::now();
    let status = loop {
        if let Some(status) = emulator.try_wait().unwrap() {
            break Some(status);
        }
        if started.elapsed() > TIME_LIMIT {
            emulator.kill().unwrap();
            emulator.wait().unwrap();
            break None;
        }
        std::thread::sleep(Duration::from_millis(20));
    };
    // A few lines: they fit the pipes, so reading them after the end cannot block the emulator.
    let (mut printed, mut errors) = (String::new(), String::new());
    let (stdout, stderr) = (emulator.stdout.take(), emulator.stderr.take());
    stdout.unwrap().read_to_string(&mut printed).unwrap();
    stderr.unwrap().read_to_string(&mut errors).unwrap();
    assert!(
        status.is_some_and(|status| status.success()),
        "emulator: {status:?} (none: killed after {TIME_LIMIT:?})\n{printed}{errors}"
    );
    printed
}

#[test]
fn target_computes_the_hosts_bits_in_the_stated_memory() {
    let elf = build("--bin", "selftest", &[]);
    let mut host = Box::new(SelfTest::new());
    let host = host.run().unwrap();
    let expected = format!(
        "buffers {} bytes\nchecksum 0x{host:08x}\n",
        size_on_target()
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
    // What is loaded, initial values of .data included.
    let flash: u64 = file.segments().map(|segment| segment.file_range().1).sum();
    println!("RAM {ram} bytes, flash {flash} bytes");
    let budget = size_on_target() + OTHER_RAM_BYTES;
    assert!(ram >= size_on_target(), "the buffers are statics");
    assert!(ram <= budget, "RAM {ram} bytes, budget {budget}");
    assert!(flash > 0, "something is loaded");
    assert!(
        flash <= FLASH_BUDGET_BYTES,
        "flash {flash} bytes, budget {FLASH_BUDGET_BYTES}"
    );
}

/// The buffers by arithmetic; lengths (`usize`) and alignment differ from the host by a few words.
fn size_on_target() -> u64 {
    let (m, f, r, d, l) = (32, 64, 128, 64, 128);
    let sub_cpi = 4 * (m + f) + 8 * f * m + 8 * d * r;
    let sinc = 4 * f * m * m + 8 * d;
    let chirp_z = 3 * 8 * l;
    // 256 pixels, the grid (72 bytes of vectors, two sizes, padded), a length; then power, shape,
    // count, length.
    let image = 8 * 256 + 72 + 8 + 8;
    let power = 4 * r * d + 16 + 4 + 4;
    2 * sub_cpi + sinc + chirp_z + image + power
}

/// Sections' address and size, by name.
fn sections(elf: &Path) -> Vec<(String, u64, u64)> {
    let bytes = std::fs::read(elf).unwrap();
    let file = object::File::parse(&*bytes).unwrap();
    file.sections()
        .map(|s| (s.name().unwrap().to_owned(), s.address(), s.size()))
        .collect()
}

#[test]
fn named_sections_are_zero_at_start_and_the_stack_is_measured() {
    let elf = build("--example", "sections", &[]);
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
        let size = sections.iter().find(|s| s.0 == name).expect(name).2;
        assert!((bytes..bytes + 64).contains(&size), "{name}: {size}");
    }
}

#[test]
fn every_death_ends_in_a_counted_reset() {
    let printed = emulate(&build("--example", "faults", &[]), &[]);
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
    build("--bin", "application", &["--features", "no-panic"]);
    let (output, _) = cargo("--example", "panics", &["--features", "no-panic"]);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success(), "it linked");
    assert!(
        stderr.contains("undefined symbol: panic_is_reachable"),
        "{stderr}"
    );
    // It is the panic that is refused, not the program.
    build("--example", "panics", &[]);
}

#[test]
fn stages_cost_what_is_stated() {
    let elf = build("--bin", "cycles", &[]);
    let printed = emulate(&elf, &["-icount", "shift=5"]);
    println!("{printed}");
    let cost = |stage: &str| -> f64 {
        let line = printed.lines().find(|line| line.starts_with(stage));
        line.expect(stage)[stage.len()..].trim().parse().unwrap()
    };
    // Two instructions a round, a call, and a tick (0.8 instructions) at either end.
    for (stage, instructions) in [("loop 1000 ", 2_000.0), ("loop 30000 ", 60_000.0)] {
        assert!(
            (0.0..=8.0).contains(&(cost(stage) - instructions)),
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
    let h743 = ["--no-default-features", "--features", "board-h743"];
    build("--bin", "application", &h743);
    let sections = sections(&build("--bin", "selftest", &h743));
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
        let (_, address, size) = sections.iter().find(|s| s.0 == name).expect(name);
        println!("{name} {size} bytes at 0x{address:08x}");
        let region = start..=start + length;
        assert!(
            region.contains(address) && region.contains(&(address + size)),
            "{name}: {size} bytes at 0x{address:08x}"
        );
    }
    let axi = sections.iter().find(|s| s.0 == ".axi").unwrap().2;
    assert!(axi >= size_on_target(), "the buffers are in AXI SRAM");
}

/// The emulator with its serial port connected to us.
struct Wired {
    emulator: Child,
    link: TcpStream,
}

impl Wired {
    fn start(elf: &Path) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let serial = format!("tcp:{}", listener.local_addr().unwrap());
        let emulator = emulator(elf, &["-serial", &serial]);
        let link = listener.accept().unwrap().0;
        link.set_read_timeout(Some(TIME_LIMIT)).unwrap();
        Self { emulator, link }
    }

    /// Sends `bytes` bytes while it reads as many; the rate there and back in bytes a second.
    fn echo(&mut self, bytes: usize) -> f64 {
        // Knuth's generator: every value of a byte, no pattern that a lost one would hide in.
        let mut state = 1u64;
        let sent: Vec<u8> = std::iter::repeat_with(|| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 56) as u8
        })
        .take(bytes)
        .collect();
        let started = Instant::now();
        let mut received = vec![0; bytes];
        let mut writer = self.link.try_clone().unwrap();
        std::thread::scope(|scope| {
            scope.spawn(|| writer.write_all(&sent).unwrap());
            let result = self.link.read_exact(&mut received);
            if result.is_err() {
                // Or the writer would wait for an emulator that has stopped.
                let _ = self.link.shutdown(Shutdown::Both);
            }
            result.expect("as many bytes come back as were sent");
        });
        let first = sent.iter().zip(&received).position(|(a, b)| a != b);
        assert_eq!(first, None, "the first byte that differs");
        bytes as f64 / started.elapsed().as_secs_f64()
    }
}

impl Drop for Wired {
    fn drop(&mut self) {
        let _ = self.emulator.kill();
        let _ = self.emulator.wait();
    }
}

/// A program that is slower than its input holds it up and loses nothing: 64 kB are more than the
/// 64 bytes it takes at a time, and all are on their way before the first comes back.
#[test]
fn a_slow_reader_loses_nothing() {
    let elf = build("--example", "slow_echo", &[]);
    let rate = Wired::start(&elf).echo(65_536);
    println!("slow echo: {rate:.0} bytes a second");
    // 64 bytes a millisecond at most: it did rest.
    assert!(rate < 64_000.0, "{rate}");
}

/// The emulated UART moves a byte at a time, each for some system calls: a megabyte takes a minute or two.
#[test]
fn bytes_come_back_unchanged() {
    let elf = build("--bin", "application", &[]);
    let rate = Wired::start(&elf).echo(131_072);
    println!("echo: {rate:.0} bytes a second there and back");
}

#[test]
#[ignore = "takes minutes"]
fn a_megabyte_comes_back_unchanged() {
    let elf = build("--bin", "application", &[]);
    let rate = Wired::start(&elf).echo(1_000_000);
    println!("echo: {rate:.0} bytes a second there and back");
}
