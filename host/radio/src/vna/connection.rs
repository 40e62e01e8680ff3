//! Connection to an analyser: lines of text and blocks over TCP, with time-outs.

use std::io::{ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};

use super::answer::{block, number, shown};
use super::fault::{Fault, FaultKind};

/// Longest line of an answer, bytes.
const LONGEST_LINE: usize = 1 << 16;

pub(super) struct Connection {
    stream: TcpStream,
    /// Bytes received and not yet used.
    received: Vec<u8>,
    timeout: Duration,
}

impl Connection {
    /// Open a connection. `timeout` holds for it and for each answer.
    pub(super) fn open(address: &str, port: u16, timeout: Duration) -> Result<Self, Fault> {
        let unreachable = |error: &dyn std::fmt::Display| {
            let message = format!("cannot connect to {address}, port {port}: {error}");
            Fault::new(FaultKind::Unreachable, message)
        };
        let places = (address, port)
            .to_socket_addrs()
            .map_err(|error| unreachable(&error))?;
        let mut last = unreachable(&"the name has no address");
        for place in places {
            match TcpStream::connect_timeout(&place, timeout) {
                Ok(stream) => {
                    // Without these, commands are only slower.
                    let _ = stream.set_nodelay(true);
                    let _ = stream.set_write_timeout(Some(timeout));
                    return Ok(Self {
                        stream,
                        received: Vec::new(),
                        timeout,
                    });
                }
                Err(error) => last = unreachable(&error),
            }
        }
        Err(last)
    }

    /// Send a command, which has no answer.
    pub(super) fn send(&mut self, command: &str) -> Result<(), Fault> {
        if !self.received.is_empty() {
            let message = format!(
                "expected no answer before {command}, found {}",
                shown(&self.received)
            );
            return Err(Fault::new(FaultKind::Malformed, message));
        }
        let sent = self.stream.write_all(format!("{command}\n").as_bytes());
        sent.map_err(|error| closed(&error).of(command))
    }

    /// Ask a question with a line of text as its answer.
    pub(super) fn ask(&mut self, question: &str) -> Result<String, Fault> {
        self.ask_within(question, self.timeout)
    }

    /// Ask a question whose answer takes at most `wait`.
    pub(super) fn ask_within(&mut self, question: &str, wait: Duration) -> Result<String, Fault> {
        self.send(question)?;
        self.line(wait).map_err(|fault| fault.of(question))
    }

    /// Ask for a number.
    pub(super) fn number(&mut self, question: &str) -> Result<f64, Fault> {
        let text = self.ask(question)?;
        number(&text).map_err(|fault| fault.of(question))
    }

    /// Ask for a block of at most `most_bytes`.
    pub(super) fn block(&mut self, question: &str, most_bytes: usize) -> Result<Vec<u8>, Fault> {
        self.send(question)?;
        self.block_data(most_bytes)
            .map_err(|fault| fault.of(question))
    }

    fn line(&mut self, wait: Duration) -> Result<String, Fault> {
        let deadline = Instant::now() + wait;
        loop {
            if let Some(end) = self.received.iter().position(|&byte| byte == b'\n') {
                let line: Vec<u8> = self.received.drain(..=end).collect();
                return Ok(String::from_utf8_lossy(&line).trim().to_owned());
            }
            if self.received.len() > LONGEST_LINE {
                let message = format!(
                    "expected a line of at most {LONGEST_LINE} bytes, found {}",
                    shown(&self.received)
                );
                return Err(Fault::new(FaultKind::Malformed, message));
            }
            self.receive(deadline)?;
        }
    }

    fn block_data(&mut self, most_bytes: usize) -> Result<Vec<u8>, Fault> {
        // Each piece may take the time-out: a long block may take longer.
        let mut deadline = Instant::now() + self.timeout;
        loop {
            if let Some(place) = block(&self.received, most_bytes)? {
                match self.received.get(place.end..) {
                    Some([b'\n', ..] | [b'\r', b'\n', ..]) => {
                        let mut data = std::mem::take(&mut self.received);
                        let rest = data.split_off(place.end);
                        let used = if rest[0] == b'\r' { 2 } else { 1 };
                        self.received = rest[used..].to_vec();
                        data.drain(..place.start);
                        return Ok(data);
                    }
                    None | Some([] | [b'\r']) => {}
                    Some(other) => {
                        let message = format!(
                            "expected the end of the answer after a block of {} bytes, found {}: the stated length is wrong",
                            place.len(),
                            shown(other)
                        );
                        return Err(Fault::new(FaultKind::Malformed, message));
                    }
                }
            }
            let before = self.received.len();
            self.receive(deadline).map_err(|fault| match before {
                0 => fault,
                _ => {
                    let kind = match fault.kind {
                        FaultKind::Timeout => FaultKind::Truncated,
                        kind => kind,
                    };
                    Fault::new(
                        kind,
                        format!("block ended after {before} bytes: {}", fault.message),
                    )
                }
            })?;
            deadline = Instant::now() + self.timeout;
        }
    }

    /// Receive at least a byte.
    fn receive(&mut self, deadline: Instant) -> Result<(), Fault> {
        let mut piece = [0; 1 << 14];
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            // A time-out of 0 would mean none.
            let left = left.max(Duration::from_micros(1));
            let set = self.stream.set_read_timeout(Some(left));
            match set.and_then(|()| self.stream.read(&mut piece)) {
                Ok(0) => {
                    let message = "the analyser closed the connection";
                    return Err(Fault::new(FaultKind::Closed, message));
                }
                Ok(count) => {
                    self.received.extend_from_slice(&piece[..count]);
                    return Ok(());
                }
                Err(error) => match error.kind() {
                    ErrorKind::Interrupted => {}
                    ErrorKind::WouldBlock | ErrorKind::TimedOut => {
                        let message = "no answer within the time-out";
                        return Err(Fault::new(FaultKind::Timeout, message));
                    }
                    _ => return Err(closed(&error)),
                },
            }
        }
    }
}

fn closed(error: &std::io::Error) -> Fault {
    Fault::new(FaultKind::Closed, format!("connection lost: {error}"))
}
