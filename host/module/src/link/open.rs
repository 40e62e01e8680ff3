//! Opening of lines to a module: TCP, serial, emulator.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::path::{Path, PathBuf};
use std::time::Duration;

use serial2::SerialPort;

#[cfg(unix)]
use super::emulator::Emulator;
use super::place::ModuleAddress;
use super::transport::{Transport, is_not_yet, read_stream, write_stream};

/// Timeout of a connection attempt.
const CONNECT_LIMIT: Duration = Duration::from_secs(5);

/// Bytes written to a serial line at a time: those of 5.6 ms, so that reading is not delayed, and at least this many.
const SERIAL_CHUNK_BYTES: usize = 512;

/// Timeout of a write to a serial line.
const SERIAL_WRITE: Duration = Duration::from_millis(5);

/// Open the line to `place`. `firmware` is the program to emulate, if not at the default location; `verbose` shows the output
/// of the emulator.
///
/// # Errors
/// States what could not be opened and what to do.
pub fn open(
    place: &ModuleAddress,
    firmware: Option<&Path>,
    verbose: bool,
) -> io::Result<Box<dyn Transport>> {
    Ok(match place {
        ModuleAddress::Tcp { host, port } => Box::new(Tcp::connect(host, *port)?),
        ModuleAddress::Serial { device, baud } => Box::new(Serial::open(device, *baud)?),
        #[cfg(unix)]
        ModuleAddress::Emulate(module) => Box::new(Emulator::start(*module, firmware, verbose)?),
        #[cfg(not(unix))]
        ModuleAddress::Emulate(_) => {
            let _ = (firmware, verbose);
            return Err(io::Error::new(
                ErrorKind::Unsupported,
                "emulation is only available on Unix systems: start an emulator whose serial line is a TCP port and use \
                 tcp://HOST:PORT",
            ));
        }
    })
}

/// TCP connection.
#[derive(Debug)]
struct Tcp {
    host: String,
    port: u16,
    stream: TcpStream,
}

impl Tcp {
    fn connect(host: &str, port: u16) -> io::Result<Self> {
        Ok(Self {
            host: host.to_owned(),
            port,
            stream: connect(host, port)?,
        })
    }
}

fn connect(host: &str, port: u16) -> io::Result<TcpStream> {
    let advice = |error: io::Error| {
        let text = format!(
            "cannot reach {host}:{port}: {error}; check that the module's line is served there"
        );
        io::Error::new(error.kind(), text)
    };
    let mut last = io::Error::new(ErrorKind::NotFound, "the name has no address");
    for address in (host, port).to_socket_addrs().map_err(advice)? {
        match TcpStream::connect_timeout(&address, CONNECT_LIMIT) {
            Ok(stream) => {
                stream.set_nodelay(true)?;
                stream.set_nonblocking(true)?;
                return Ok(stream);
            }
            Err(error) => last = error,
        }
    }
    Err(advice(last))
}

impl Transport for Tcp {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> io::Result<usize> {
        read_stream(&mut self.stream, buffer, wait)
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        write_stream(&mut self.stream, bytes)
    }

    fn reconnect(&mut self) -> io::Result<()> {
        self.stream = connect(&self.host, self.port)?;
        Ok(())
    }
}

/// Serial line.
#[derive(Debug)]
struct Serial {
    device: PathBuf,
    baud: u32,
    port: Option<SerialPort>,
}

impl Serial {
    fn open(device: &Path, baud: u32) -> io::Result<Self> {
        let mut serial = Self {
            device: device.to_owned(),
            baud,
            port: None,
        };
        serial.reconnect()?;
        Ok(serial)
    }

    fn port(&mut self) -> io::Result<&mut SerialPort> {
        let gone = || io::Error::new(ErrorKind::NotConnected, "the serial line is not open");
        self.port.as_mut().ok_or_else(gone)
    }
}

impl Transport for Serial {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> io::Result<usize> {
        let port = self.port()?;
        // A timeout of zero would disable it.
        port.set_read_timeout(wait.max(Duration::from_millis(1)))?;
        match port.read(buffer) {
            Err(error) if is_not_yet(&error) => Ok(0),
            // A device that was unplugged is always ready and returns no bytes.
            Ok(0) if !buffer.is_empty() => Err(io::Error::new(
                ErrorKind::UnexpectedEof,
                "the serial device was disconnected",
            )),
            read => read,
        }
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        // A byte takes ten bits.
        let most = SERIAL_CHUNK_BYTES.max(self.baud as usize / 10 * 56 / 10_000);
        let port = self.port()?;
        port.set_write_timeout(SERIAL_WRITE)?;
        match port.write(&bytes[..bytes.len().min(most)]) {
            Err(error) if is_not_yet(&error) => Ok(0),
            written => written,
        }
    }

    fn reconnect(&mut self) -> io::Result<()> {
        // The port is opened exclusively, so the old one must be closed first.
        self.port = None;
        let (device, baud) = (self.device.display(), self.baud);
        // 8 data bits, no parity, one stop bit, no flow control: the library's defaults.
        let port = SerialPort::open(&self.device, baud).map_err(|error| {
            let text = format!(
                "cannot open {device} at {baud} bits per second: {error}; check that the module is connected and that \
                 you have permission to use the device"
            );
            io::Error::new(error.kind(), text)
        })?;
        port.discard_buffers()?;
        self.port = Some(port);
        Ok(())
    }

    fn baud(&self) -> Option<u32> {
        Some(self.baud)
    }
}
