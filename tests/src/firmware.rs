//! Run the firmware under emulation, and read the sections of its ELF. It is built as `cargo xtask` builds it.

use std::fs;
use std::io::Read;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use object::{Object, ObjectSection, ObjectSegment};

pub use subaperture_xtask::firmware::{Build, TARGET, build, module, try_build};
pub use subaperture_xtask::target_folder;

/// Most runs take less than a second; the limit stops one that hangs.
pub const TIME_LIMIT: Duration = Duration::from_secs(60);

/// Options of the emulator that tie its time to instructions.
pub const INSTRUCTION_TIME: [&str; 2] = ["-icount", "shift=5"];

/// Network of an emulated module: the module can reach no other address, and TCP port `port` of this machine is forwarded to
/// the port of its link. An option of the emulator's `-nic`.
pub fn forward_port(port: u16) -> String {
    format!("user,model=lan9118,restrict=on,hostfwd=tcp:127.0.0.1:{port}-:4000")
}

/// Start an ELF under emulation. Its log, on the second UART, is the emulator's standard output. Semihosting is on, so that test programs
/// can end the emulator.
///
/// # Panics
/// If the emulator is missing.
pub fn emulator(elf: &Path, options: &[&str]) -> Child {
    let linked = options.contains(&"-serial");
    Command::new("qemu-system-arm")
        .args(["-M", "mps2-an500", "-display", "none", "-monitor", "none"])
        .args(["-semihosting-config", "enable=on,target=native"])
        .args(if linked {
            [].as_slice()
        } else {
            &["-serial", "null"]
        })
        .args(options)
        .args(["-serial", "stdio"])
        .arg("-kernel")
        .arg(elf)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the emulator is missing: apt-get install qemu-system-arm")
}

/// Run an ELF to its end under emulation, and return its output.
///
/// # Panics
/// If it fails, or does not end within [`TIME_LIMIT`].
pub fn emulate(elf: &Path, options: &[&str]) -> String {
    finish(emulator(elf, options))
}

/// Wait for the emulator of a program that prints a few lines and ends, and return its output.
///
/// # Panics
/// If it fails, or does not end within [`TIME_LIMIT`].
pub fn finish(mut emulator: Child) -> String {
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
    // A few lines fit the pipes, so reading them after the end cannot block the emulator.
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

/// A section of an ELF.
#[derive(Clone, Debug)]
pub struct Section {
    /// Name, such as `.text`.
    pub name: String,
    /// Address at run time.
    pub address: u64,
    /// Size in bytes.
    pub bytes: u64,
}

/// The sections of an ELF.
///
/// # Panics
/// If it cannot be read.
pub fn sections(elf: &Path) -> Vec<Section> {
    let bytes = fs::read(elf).unwrap();
    let file = object::File::parse(&*bytes).unwrap();
    file.sections()
        .map(|section| Section {
            name: section.name().unwrap().to_owned(),
            address: section.address(),
            bytes: section.size(),
        })
        .collect()
}

/// Bytes of an ELF that are loaded: code, constants, initial values of `.data`.
///
/// # Panics
/// If it cannot be read.
pub fn flash_bytes(elf: &Path) -> u64 {
    let bytes = fs::read(elf).unwrap();
    let file = object::File::parse(&*bytes).unwrap();
    file.segments().map(|segment| segment.file_range().1).sum()
}
