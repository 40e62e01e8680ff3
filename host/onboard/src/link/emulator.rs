//! The firmware under QEMU, its serial line on a pair of sockets that nobody else can reach.
//!
//! The emulator inherits its end of the pair as standard input and output; there is no port and no name to which
//! another program could connect. It is killed when the [`Emulator`] is dropped, and started anew by
//! [`Transport::reconnect`]: that is a module switched off and on.
//!
//! The firmware is a program in an emulator: what it may do is talk over its line. Semihosting, which lets a program
//! read, write and start what the user can, stays off. The firmware that is found without being named has to be
//! the user's own still ([`trusted`]), for the maps are worth no more than it is.

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
/// An emulator that ends closes its connection first, a moment before it is gone.
const END_LIMIT: Duration = Duration::from_millis(200);
/// Where the emulator finds the standard error that it inherits.
const LOG: &str = "/dev/stderr";

/// A module under emulation.
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

/// The emulator, ended when dropped.
#[derive(Debug)]
struct Process(Child);

impl Drop for Process {
    fn drop(&mut self) {
        // Gone already is as good.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Emulator {
    /// Starts `firmware`, or what `cargo xtask module` built below this folder or one above it. What the
    /// emulator and the firmware print goes to standard error if `verbose`.
    ///
    /// # Errors
    /// If emulator or firmware are missing, or the firmware found is one that others may have written.
    pub fn start(kind: Firmware, firmware: Option<&Path>, verbose: bool) -> io::Result<Self> {
        let firmware = match firmware {
            Some(path) if path.is_file() => path.to_owned(),
            Some(path) => {
                let text = format!("the firmware {} is no file", path.display());
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

    /// The reason of a line that is gone: mostly that the emulator is.
    fn explained(&mut self, error: io::Error) -> io::Error {
        let Some(running) = &mut self.running else {
            return error;
        };
        let started = Instant::now();
        while started.elapsed() < END_LIMIT {
            if let Ok(Some(status)) = running.process.0.try_wait() {
                let text = format!(
                    "{PROGRAM} ended ({status}): is {} a firmware for it? -v shows what it said",
                    self.firmware.display()
                );
                return io::Error::new(error.kind(), text);
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        error
    }
}

/// The firmware where `cargo xtask module` leaves it.
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
        // The firmware's log, its second serial line; standard output is taken.
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
