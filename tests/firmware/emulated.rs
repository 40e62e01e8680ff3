//! The firmware under emulation as a device: its serial line can be disconnected and reconnected, and the module can be reset or lose
//! power.

use std::io::{self, BufRead, BufReader, ErrorKind, Write};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::Child;
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use subaperture::module::link::{self, ModuleAddress, Transport};

use subaperture_tests::faults::Device;
use subaperture_tests::firmware;

/// Limit for the start of the emulator, which takes a fraction of a second.
const START_LIMIT: Duration = Duration::from_secs(20);

/// The release application for the emulated board, float32 and fixed point; built on first use.
///
/// # Panics
/// If it cannot be built.
pub(crate) fn application() -> &'static [PathBuf; 2] {
    static ELFS: OnceLock<[PathBuf; 2]> = OnceLock::new();
    ELFS.get_or_init(|| firmware::module().unwrap_or_else(|error| panic!("{error}")))
}

/// Connection to the emulated serial line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Wire {
    /// A TCP port for one connection at a time. Output of the module without a connection is lost.
    Tcp,
    /// A pseudo-terminal: a serial device that buffers some 12 kB.
    Terminal,
    /// A TCP port that the emulator forwards to the module's own one, over its Ethernet controller.
    Ethernet,
}

/// Restart of the module.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Begin {
    /// Reset: the line stays connected.
    Reset,
    /// New emulator: the line breaks and memory is cleared.
    Power,
}

/// A process that is killed when dropped.
struct Process(Child);

impl Drop for Process {
    fn drop(&mut self) {
        // It may have ended before.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A running emulator.
struct Running {
    _process: Process,
    place: ModuleAddress,
    /// Commands to the emulator, and its answers.
    console: BufReader<TcpStream>,
}

impl Running {
    /// Start `elf`, on TCP at `port` or any free one.
    fn start(elf: &Path, wire: Wire, port: Option<u16>) -> io::Result<Self> {
        let started = Instant::now();
        loop {
            match Self::try_start(elf, wire, port) {
                // Another process uses the port.
                Err(error)
                    if error.kind() == ErrorKind::AddrInUse && started.elapsed() < START_LIMIT =>
                {
                    std::thread::sleep(Duration::from_millis(20));
                }
                other => return other,
            }
        }
    }

    fn try_start(elf: &Path, wire: Wire, port: Option<u16>) -> io::Result<Self> {
        let console = TcpListener::bind("127.0.0.1:0")?;
        console.set_nonblocking(true)?;
        let monitor = format!("tcp:{}", console.local_addr()?);
        let port = match port {
            Some(port) => port,
            None => TcpListener::bind("127.0.0.1:0")?.local_addr()?.port(),
        };
        let serial = match wire {
            Wire::Tcp => format!("tcp:127.0.0.1:{port},server=on,wait=off,nodelay=on"),
            Wire::Terminal => "pty".to_owned(),
            Wire::Ethernet => "null".to_owned(),
        };
        let network = match wire {
            Wire::Ethernet => firmware::forward_port(port),
            Wire::Tcp | Wire::Terminal => "none".to_owned(),
        };
        let options = ["-monitor", &monitor, "-serial", &serial, "-nic", &network];
        let mut process = Process(firmware::emulator(elf, &options));
        let started = Instant::now();
        let stream = loop {
            match console.accept() {
                Ok((stream, _)) => break stream,
                Err(error) if error.kind() == ErrorKind::WouldBlock => {}
                Err(error) => return Err(error),
            }
            if let Some(status) = process.0.try_wait()? {
                let text = format!("the emulator ended at once ({status})");
                return Err(io::Error::new(ErrorKind::AddrInUse, text));
            }
            assert!(
                started.elapsed() < START_LIMIT,
                "the emulator does not start"
            );
            std::thread::sleep(Duration::from_millis(2));
        };
        stream.set_nonblocking(false)?;
        stream.set_read_timeout(Some(START_LIMIT))?;
        let mut running = Self {
            _process: process,
            place: ModuleAddress::Tcp {
                host: "127.0.0.1".to_owned(),
                port,
            },
            console: BufReader::new(stream),
        };
        // The emulator answers once everything is open.
        let about = running
            .command("info chardev", "serial0")
            .map_err(|error| {
                let text = format!("the emulator ended at once ({error})");
                io::Error::new(ErrorKind::AddrInUse, text)
            })?;
        if wire == Wire::Terminal {
            let device = about.split_once("pty:").map(|(_, device)| device.trim());
            let device = device.ok_or_else(|| io::Error::other(about.clone()))?;
            running.place = ModuleAddress::Serial {
                device: device.into(),
                baud: 921_600,
            };
        }
        Ok(running)
    }

    /// Send a command to the emulator; returns the line of its answer that begins with `answer`.
    fn command(&mut self, command: &str, answer: &str) -> io::Result<String> {
        let stream = self.console.get_mut();
        stream.write_all(command.as_bytes())?;
        stream.write_all(b"\n")?;
        let mut line = String::new();
        loop {
            line.clear();
            if self.console.read_line(&mut line)? == 0 {
                return Err(ErrorKind::UnexpectedEof.into());
            }
            if line.trim_start().starts_with(answer) {
                return Ok(line);
            }
        }
    }
}

/// A module under emulation.
pub(crate) struct Emulated {
    elf: PathBuf,
    wire: Wire,
    begin: Begin,
    running: Option<Running>,
    line: Option<Box<dyn Transport>>,
}

impl Emulated {
    /// Start `elf`. The line is not connected before [`Transport::reconnect`].
    ///
    /// # Panics
    /// If the emulator does not start.
    pub(crate) fn start(elf: &Path, wire: Wire, begin: Begin) -> Self {
        let running = Running::start(elf, wire, None).expect("the emulator starts");
        Self {
            elf: elf.to_owned(),
            wire,
            begin,
            running: Some(running),
            line: None,
        }
    }

    /// Start `elf` and connect.
    ///
    /// # Panics
    /// If it does not start.
    pub(crate) fn connected(elf: &Path, wire: Wire, begin: Begin) -> Self {
        let mut emulated = Self::start(elf, wire, begin);
        emulated
            .reconnect()
            .expect("the emulator takes a connection");
        emulated
    }

    /// Address of its line.
    ///
    /// # Panics
    /// If it is not running.
    pub(crate) fn place(&self) -> &ModuleAddress {
        &self.running.as_ref().expect("it is running").place
    }

    fn line(&mut self) -> io::Result<&mut Box<dyn Transport>> {
        self.line.as_mut().ok_or(ErrorKind::NotConnected.into())
    }
}

impl Transport for Emulated {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> io::Result<usize> {
        self.line()?.read(buffer, wait)
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.line()?.write(bytes)
    }

    fn reconnect(&mut self) -> io::Result<()> {
        match &mut self.line {
            Some(line) => line.reconnect(),
            None => {
                self.line = Some(link::open(self.place(), None, false)?);
                Ok(())
            }
        }
    }
}

impl Device for Emulated {
    fn restart(&mut self) -> io::Result<()> {
        let running = self.running.as_mut().ok_or(ErrorKind::NotConnected)?;
        match self.begin {
            Begin::Reset => running.command("system_reset", "(qemu)").map(drop),
            Begin::Power => {
                let port = match running.place {
                    ModuleAddress::Tcp { port, .. } => Some(port),
                    _ => None,
                };
                self.running = None;
                self.running = Some(Running::start(&self.elf, self.wire, port)?);
                Ok(())
            }
        }
    }
}
