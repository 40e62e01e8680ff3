//! Bytes to a module and back, whatever carries them.
//!
//! **What it does.** A [`Transport`] never waits longer than it is told, so that one thread can read and
//! write in turn: a module that waits to be read does not read either. How that is done on sockets, which TCP and the
//! emulator have in common, is here; the lines themselves are opened by [`super::open()`]. **Errors**: the system's; the
//! session then connects anew.

use std::io::{self, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::Duration;

/// Fewer bytes than this are waited a little longer for.
const FEW_BYTES: usize = 1024;

/// How much longer.
const GATHER: Duration = Duration::from_micros(500);

/// A line to a module.
pub trait Transport: Send {
    /// Reads what has come; waits up to `wait` for it. 0 if nothing came.
    ///
    /// # Errors
    /// If the line is gone.
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> io::Result<usize>;

    /// Writes what the line takes at once, 0 if nothing.
    ///
    /// # Errors
    /// If the line is gone.
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize>;

    /// Makes the connection anew.
    ///
    /// # Errors
    /// If that cannot be; it may be tried again.
    fn reconnect(&mut self) -> io::Result<()>;

    /// Bits a second, where the line has a speed of its own.
    fn baud(&self) -> Option<u32> {
        None
    }
}

/// What [`read_stream`] and [`write_stream`] work on; set not to block before.
pub(super) trait Stream: Read + Write {
    fn set_nonblocking(&self, nonblocking: bool) -> io::Result<()>;
    fn set_read_timeout(&self, wait: Option<Duration>) -> io::Result<()>;
}

impl Stream for TcpStream {
    fn set_nonblocking(&self, nonblocking: bool) -> io::Result<()> {
        self.set_nonblocking(nonblocking)
    }

    fn set_read_timeout(&self, wait: Option<Duration>) -> io::Result<()> {
        self.set_read_timeout(wait)
    }
}

#[cfg(unix)]
impl Stream for std::os::unix::net::UnixStream {
    fn set_nonblocking(&self, nonblocking: bool) -> io::Result<()> {
        self.set_nonblocking(nonblocking)
    }

    fn set_read_timeout(&self, wait: Option<Duration>) -> io::Result<()> {
        self.set_read_timeout(wait)
    }
}

pub(super) fn read_stream(
    stream: &mut impl Stream,
    buffer: &mut [u8],
    wait: Duration,
) -> io::Result<usize> {
    let some = |count: usize| match count {
        0 => Err(io::Error::new(
            ErrorKind::UnexpectedEof,
            "the other end has closed the connection",
        )),
        count => Ok(count),
    };
    let now = match stream.read(buffer) {
        Err(error) if is_not_yet(&error) && !wait.is_zero() => {
            stream.set_nonblocking(false)?;
            stream.set_read_timeout(Some(wait))?;
            let read = stream.read(buffer);
            stream.set_nonblocking(true)?;
            read
        }
        read => read,
    };
    let count = match now {
        Ok(count) => some(count)?,
        Err(error) if is_not_yet(&error) => return Ok(0),
        Err(error) => return Err(error),
    };
    if count >= FEW_BYTES || wait.is_zero() {
        return Ok(count);
    }
    // A serial line behind a socket brings single bytes: more come while this side sleeps.
    std::thread::sleep(GATHER.min(wait));
    match stream.read(&mut buffer[count..]) {
        Ok(more) => Ok(count + more),
        // The next call finds the same again.
        Err(_) => Ok(count),
    }
}

pub(super) fn write_stream(stream: &mut impl Stream, bytes: &[u8]) -> io::Result<usize> {
    match stream.write(bytes) {
        Err(error) if is_not_yet(&error) => Ok(0),
        written => written,
    }
}

pub(super) fn is_not_yet(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted
    )
}
