//! Module firmware under QEMU emulation, connected by a private socket pair.
//!
//! The emulator inherits its end of the pair as standard input and output, so there is no port or name that another program
//! could connect to. It is killed when the [`Emulator`] is dropped, and restarted by [`Transport::reconnect`], which
//! corresponds to a power cycle of the module.
//!
//! The firmware can only communicate over its line. Semihosting, which lets a program read, write and start what the user can,
//! is disabled. Firmware found without being named must be writable by the user only ([`trusted`]), since maps are only as
//! trustworthy as the firmware.

use std::fs::File;
use std::io::{self, ErrorKind};
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use super::UnnamedFirmware;
use super::place::Firmware;
use super::transport::{Transport, read_stream, write_stream};
use super::trust::trusted;

const PROGRAM: &str = "qemu-system-arm";
/// An emulator that exits closes its connection shortly before the process ends.
const END_LIMIT: Duration = Duration::from_millis(200);
/// Path of the standard error that the emulator inherits.
const LOG: &str = "/dev/stderr";

/// Module emulated by QEMU.
#[derive(Debug)]
pub struct Emulator {
    firmware: PathBuf,
    verbose: bool,
    running: Option<Running>,
}

#[derive(Debug)]
struct Running {
    process: Process,
    stream: UnixStream,
}

/// Emulator process, killed when dropped.
#[derive(Debug)]
struct Process(Child);

impl Drop for Process {
    fn drop(&mut self) {
        // It may have exited already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Emulator {
    /// Start `firmware`, or the firmware that `cargo xtask module` built in this or a parent folder. If `verbose`, output of the
    /// emulator and the firmware goes to standard error.
    ///
    /// # Errors
    /// If the emulator or the firmware is missing, or the firmware found is writable by other users.
    pub fn start(kind: Firmware, firmware: Option<&Path>, verbose: bool) -> io::Result<Self> {
        let firmware = match firmware {
            Some(path) if path.is_file() => path.to_owned(),
            Some(path) => {
                let text = format!("firmware {} is not a file", path.display());
                return Err(io::Error::new(ErrorKind::NotFound, text));
            }
            None => built(kind)?,
        };
        let mut emulator = Self {
            firmware,
            verbose,
            running: None,
        };
        emulator.reconnect()?;
        Ok(emulator)
    }

    fn stream(&mut self) -> io::Result<&mut UnixStream> {
        let gone = || io::Error::new(ErrorKind::NotConnected, "the emulator is not running");
        Ok(&mut self.running.as_mut().ok_or_else(gone)?.stream)
    }

    /// Add the likely cause to a line error: usually the emulator exited.
    fn explained(&mut self, error: io::Error) -> io::Error {
        let Some(running) = &mut self.running else {
            return error;
        };
        let started = Instant::now();
        while started.elapsed() < END_LIMIT {
            if let Ok(Some(status)) = running.process.0.try_wait() {
                let text = format!(
                    "{PROGRAM} ended ({status}): is {} a firmware for it? -v shows its output",
                    self.firmware.display()
                );
                return io::Error::new(error.kind(), text);
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        error
    }
}

/// Firmware at the location where `cargo xtask module` builds it.
fn built(kind: Firmware) -> io::Result<PathBuf> {
    let name = Path::new("target/module").join(kind.name());
    let here = std::env::current_dir()?;
    let found = here
        .ancestors()
        .map(|folder| folder.join(&name))
        .find(|path| path.is_file());
    let Some(found) = found else {
        let error = UnnamedFirmware::NotThere { name, here };
        return Err(io::Error::new(ErrorKind::NotFound, error));
    };
    trusted(&found)
}

impl Transport for Emulator {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> io::Result<usize> {
        read_stream(self.stream()?, buffer, wait).map_err(|error| self.explained(error))
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        write_stream(self.stream()?, bytes).map_err(|error| self.explained(error))
    }

    fn reconnect(&mut self) -> io::Result<()> {
        self.running = None;
        let (stream, theirs) = UnixStream::pair()?;
        stream.set_nonblocking(true)?;
        let input = OwnedFd::from(theirs.try_clone()?);
        // The firmware's log is its second serial line, since standard output is in use.
        let log = match self.verbose && File::options().append(true).open(LOG).is_ok() {
            true => format!("file,id=log,path={LOG},append=on"),
            false => "null,id=log".to_owned(),
        };
        let errors = match self.verbose {
            true => Stdio::from(io::stderr()),
            false => Stdio::null(),
        };
        let child = Command::new(PROGRAM)
            .args(["-M", "mps2-an500", "-display", "none", "-monitor", "none"])
            // Without this, the firmware could reach the network.
            .args(["-nic", "none"])
            .args(["-chardev", "stdio,id=link,signal=off", "-chardev", &log])
            .args(["-serial", "chardev:link", "-serial", "chardev:log"])
            .arg("-kernel")
            .arg(&self.firmware)
            .stdin(input)
            .stdout(OwnedFd::from(theirs))
            .stderr(errors)
            .spawn()
            .map_err(|error| {
                let text = match error.kind() {
                    ErrorKind::NotFound => format!(
                        "{PROGRAM} is not installed: install it (Debian: apt-get install \
                         qemu-system-arm)"
                    ),
                    _ => format!("cannot start {PROGRAM}: {error}"),
                };
                io::Error::new(error.kind(), text)
            })?;
        let process = Process(child);
        self.running = Some(Running { process, stream });
        Ok(())
    }
}
