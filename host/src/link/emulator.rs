//! The firmware under QEMU, its serial line on a TCP connection of this machine.
//!
//! The emulator connects to a port that this side listens on, chosen by the system, so that no two
//! sessions can want the same one. It is killed when the [`Emulator`] is dropped, and started anew by
//! [`Transport::reconnect`]: that is a module switched off and on.

use std::io::{self, ErrorKind};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use super::place::Module;
use super::transport::{Transport, prepare, read_stream, write_stream};

const PROGRAM: &str = "qemu-system-arm";
/// From its start to its connection the emulator takes a fraction of a second.
const START_LIMIT: Duration = Duration::from_secs(20);
/// An emulator that ends closes its connection first, a moment before it is gone.
const END_LIMIT: Duration = Duration::from_millis(200);

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
    stream: TcpStream,
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
    /// If emulator or firmware are missing, or the emulator ends at once.
    pub fn start(module: Module, firmware: Option<&Path>, verbose: bool) -> io::Result<Self> {
        let firmware = match firmware {
            Some(path) if path.is_file() => path.to_owned(),
            Some(path) => {
                let text = format!("the firmware {} is no file", path.display());
                return Err(io::Error::new(ErrorKind::NotFound, text));
            }
            None => built(module)?,
        };
        let mut emulator = Self {
            firmware,
            verbose,
            running: None,
        };
        emulator.reconnect()?;
        Ok(emulator)
    }

    fn stream(&mut self) -> io::Result<&mut TcpStream> {
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
fn built(module: Module) -> io::Result<PathBuf> {
    let name = Path::new("target/module").join(module.name());
    let here = std::env::current_dir()?;
    here.ancestors()
        .map(|folder| folder.join(&name))
        .find(|path| path.is_file())
        .ok_or_else(|| {
            let text = format!(
                "there is no {} here or above {}: build it with 'cargo xtask module', or name the \
                 firmware with --firmware",
                name.display(),
                here.display()
            );
            io::Error::new(ErrorKind::NotFound, text)
        })
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
        let listener = TcpListener::bind("127.0.0.1:0")?;
        listener.set_nonblocking(true)?;
        let port = listener.local_addr()?.port();
        let printed = || match self.verbose {
            true => Stdio::from(io::stderr()),
            false => Stdio::null(),
        };
        let child = Command::new(PROGRAM)
            .args(["-M", "mps2-an500", "-nographic", "-monitor", "none"])
            .args(["-semihosting-config", "enable=on,target=native", "-serial"])
            .arg(format!("tcp:127.0.0.1:{port},server=off,nodelay=on"))
            .arg("-kernel")
            .arg(&self.firmware)
            .stdin(Stdio::null())
            .stdout(printed())
            .stderr(printed())
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
        let mut process = Process(child);
        let started = Instant::now();
        loop {
            match listener.accept() {
                Ok((stream, _)) => {
                    prepare(&stream)?;
                    self.running = Some(Running { process, stream });
                    return Ok(());
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => {}
                Err(error) => return Err(error),
            }
            if let Some(status) = process.0.try_wait()? {
                return Err(io::Error::other(format!(
                    "{PROGRAM} ended at once ({status}); -v shows what it said"
                )));
            }
            if started.elapsed() > START_LIMIT {
                return Err(io::Error::new(
                    ErrorKind::TimedOut,
                    format!("{PROGRAM} did not connect within {START_LIMIT:?}"),
                ));
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}
