//! Byte transport to a module.
//!
//! A [`Transport`] never blocks longer than requested, so that one thread can alternate between reading and writing: a module
//! whose output is not read does not read either. This file contains the socket implementation that TCP and the emulator
//! share; [`super::open()`] opens the lines. **Errors**: those of the system; the session then reconnects.

use std::io::{self, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::Duration;

/// If fewer bytes than this were received, wait a little for more.
const FEW_BYTES: usize = 1024;

/// Additional wait time for more bytes.
const GATHER: Duration = Duration::from_micros(500);

/// Line to a module.
pub trait Transport: Send {
    /// Read received bytes, waiting up to `wait`. Returns 0 if there are none.
    ///
    /// # Errors
    /// If the line has failed.
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> io::Result<usize>;

    /// Write as many bytes as the line accepts immediately. Returns 0 if none.
    ///
    /// # Errors
    /// If the line has failed.
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize>;

    /// Reconnect the line.
    ///
    /// # Errors
    /// If that fails; it may be tried again.
    fn reconnect(&mut self) -> io::Result<()>;

    /// Bit rate in bits per second, if the line has one.
    fn baud(&self) -> Option<u32> {
        None
    }
}

/// Stream for [`read_stream`] and [`write_stream`]; must be set to nonblocking first.
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
    // A serial line behind a socket delivers single bytes: wait for more to arrive.
    std::thread::sleep(GATHER.min(wait));
    match stream.read(&mut buffer[count..]) {
        Ok(more) => Ok(count + more),
        // The next call returns the same error.
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
