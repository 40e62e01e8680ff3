//! The firmware under emulation: the same bits as on the host, in the memory that is stated.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use object::elf::{SHF_ALLOC, SHF_WRITE};
use object::{Object, ObjectSection, ObjectSegment, SectionFlags};
use subaperture_core::selftest::SelfTest;

const TARGET: &str = "thumbv7em-none-eabihf";
/// The run takes about 0.2 s; a hang must not hang the tests.
const TIME_LIMIT: Duration = Duration::from_secs(60);
/// RAM beside the self-test's buffers: flags and alignment.
const OTHER_RAM_BYTES: u64 = 256;
/// Code and constants: 80 kB when this was written (97 kB without float64 in hardware), of which the
/// FFTs of all lengths are most.
const FLASH_BUDGET_BYTES: u64 = 96 * 1024;

/// Builds the firmware below the workspace's target folder, in one of its own: cargo locks each.
fn build() -> PathBuf {
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("firmware");
    let output = Command::new(env!("CARGO"))
        .current_dir(workspace)
        .args(["build", "--package", "subaperture-firmware", "--release"])
        .arg("--locked")
        .args(["--target", TARGET, "--target-dir"])
        .arg(&folder)
        .output()
        .expect("cargo runs");
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(
        !stderr.contains("can't find crate for `core`"),
        "the target is missing: rustup target add {TARGET}"
    );
    assert!(output.status.success(), "{stderr}");
    folder.join(TARGET).join("release/subaperture-firmware")
}

/// Runs an ELF to its end under emulation; what it printed.
fn emulate(elf: &Path) -> String {
    let mut emulator = Command::new("qemu-system-arm")
        .args(["-M", "mps2-an500", "-nographic", "-monitor", "none"])
        .args(["-semihosting-config", "enable=on,target=native", "-kernel"])
        .arg(elf)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the emulator is missing: apt-get install qemu-system-arm");
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
    let elf = build();
    let mut host = Box::new(SelfTest::new());
    let host = host.run().unwrap();
    let expected = format!(
        "buffers {} bytes\nchecksum 0x{host:08x}\n",
        size_on_target()
    );
    assert_eq!(emulate(&elf), expected);

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
