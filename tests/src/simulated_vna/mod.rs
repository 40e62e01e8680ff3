//! Simulated vector network analyser: SCPI over TCP on this machine, with injected faults.
//!
//! It shares no code with the library: commands, blocks and echoes are written after the command references and formulas of this folder. A command
//! that the family does not have is error -113 in its queue.

mod commands;
mod sweep;

use std::io::{ErrorKind, Read, Write};
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{JoinHandle, sleep};
use std::time::Duration;

use commands::Analyser;
pub use sweep::{Scene, Target, echo};

/// Time between two looks for the end of the simulation.
const LOOK: Duration = Duration::from_millis(5);

/// Family of analysers with the same commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    /// Keysight PNA and ENA E5080.
    Pna,
    /// Keysight ENA such as E5071C.
    Ena,
    /// Rohde & Schwarz ZNB and ZVA.
    Znb,
    /// Copper Mountain with its program.
    Cmt,
}

/// Fault of a sweep, or of the answers about it.
#[derive(Clone, Debug, PartialEq)]
pub enum Fault {
    /// The connection is closed in place of the values.
    CloseBefore,
    /// The connection is closed in the middle of the values.
    CloseWithin,
    /// The connection is closed after the values.
    CloseAfter,
    /// The values are sent so late.
    Late(Duration),
    /// Half of the values are sent.
    Truncated,
    /// The stated length is off by so many bytes.
    WrongLength(i64),
    /// So many points more or less.
    Points(i64),
    /// One value is this.
    Value(f64),
    /// Entries of the error queue.
    Errors(Vec<(i32, String)>),
    /// `*OPC?` is never answered.
    NeverComplete,
    /// `*OPC?` is answered so.
    Completion(String),
    /// Values and frequencies have the other byte order than announced.
    OtherByteOrder,
    /// Frequencies are higher by a step.
    OtherFrequencies,
    /// The connection is closed, and no other accepted for a time.
    Refuse(Duration),
    /// These bytes in place of the values.
    Instead(Vec<u8>),
    /// The trigger goes to hold.
    Hold,
    /// This text in place of an entry of the error queue.
    Queue(String),
}

/// Properties and faults of an instrument.
pub struct Options {
    /// Family whose commands it takes.
    pub family: Family,
    /// Identification, the answer to `*IDN?`.
    pub identity: String,
    /// Time of a sweep.
    pub sweep: Duration,
    /// Time until a pulse arrives at the trigger input.
    pub pulse: Duration,
    /// Highest power, dBm, to which higher ones are set.
    pub most_power_dbm: f64,
    /// Widest bandwidth, hertz, to which wider ones are set.
    pub most_bandwidth_hz: f64,
    /// Error of the frequencies at all times, hertz.
    pub off_hz: f64,
    /// Faults with the number of their sweep, counted from 0, repeated ones included.
    pub faults: Vec<(usize, Fault)>,
    /// Source of the echoes.
    pub scene: Scene,
}

impl Options {
    /// Faultless instrument of a family.
    pub fn new(family: Family, scene: Scene) -> Self {
        let identity = match family {
            Family::Pna => "Keysight Technologies,N5222B,MY00000001,A.16.00",
            Family::Ena => "Agilent Technologies,E5071C,MY00000002,B.13.00",
            Family::Znb => "Rohde&Schwarz,ZNB20-2Port,1311601062100001,3.45",
            Family::Cmt => "CMT,S5065,00000003,22.2.1/1.01",
        };
        Self {
            family,
            identity: identity.to_owned(),
            sweep: Duration::from_millis(1),
            pulse: Duration::from_millis(30),
            most_power_dbm: 10.0,
            most_bandwidth_hz: 1e6,
            off_hz: 0.0,
            faults: Vec::new(),
            scene,
        }
    }
}

/// Answer to a command.
enum Reply {
    Silence,
    Send(Vec<u8>),
    SendAndClose(Vec<u8>),
    Refuse(Duration),
}

/// Running instrument; it ends when dropped.
pub struct SimulatedVna {
    /// TCP port on 127.0.0.1.
    pub port: u16,
    ended: Arc<AtomicBool>,
    log: Arc<Mutex<Vec<String>>>,
    thread: Option<JoinHandle<()>>,
}

impl SimulatedVna {
    /// Start an instrument.
    ///
    /// # Panics
    /// If this machine has no free port.
    pub fn start(options: Options) -> Self {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).expect("a free port");
        let port = listener.local_addr().expect("an address").port();
        let (ended, log) = (Arc::new(AtomicBool::new(false)), Arc::default());
        let (over, line) = (Arc::clone(&ended), Arc::clone(&log));
        let thread = std::thread::spawn(move || serve(options, listener, &over, &line));
        Self {
            port,
            ended,
            log,
            thread: Some(thread),
        }
    }

    /// Commands received so far.
    pub fn received(&self) -> Vec<String> {
        let log = self.log.lock().unwrap_or_else(PoisonError::into_inner);
        log.clone()
    }
}

impl Drop for SimulatedVna {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::SeqCst);
        if let Some(thread) = self.thread.take() {
            let joined = thread.join();
            assert!(
                joined.is_ok() || std::thread::panicking(),
                "the instrument panicked"
            );
        }
    }
}

fn serve(options: Options, listener: TcpListener, ended: &AtomicBool, log: &Mutex<Vec<String>>) {
    let place = listener.local_addr().expect("an address");
    let mut analyser = Analyser::new(options);
    let mut listening = Some(listener);
    while !ended.load(Ordering::SeqCst) {
        let Some(listener) = &listening else {
            listening = TcpListener::bind(place).ok();
            sleep(LOOK);
            continue;
        };
        listener.set_nonblocking(true).expect("a socket");
        match listener.accept() {
            Ok((stream, _)) => {
                analyser.connected();
                if let Some(pause) = talk(&mut analyser, stream, ended, log) {
                    listening = None;
                    sleep(pause);
                }
            }
            Err(error) => {
                assert_eq!(error.kind(), ErrorKind::WouldBlock);
                sleep(LOOK);
            }
        }
    }
}

/// Answer commands until the connection is closed. Returns for how long no other is accepted.
fn talk(
    analyser: &mut Analyser,
    mut stream: TcpStream,
    ended: &AtomicBool,
    log: &Mutex<Vec<String>>,
) -> Option<Duration> {
    stream.set_nonblocking(false).expect("a socket");
    stream.set_read_timeout(Some(LOOK)).expect("a socket");
    let (mut pending, mut piece) = (Vec::new(), [0; 4096]);
    while !ended.load(Ordering::SeqCst) {
        match stream.read(&mut piece) {
            Ok(0) => return None,
            Ok(count) => pending.extend(&piece[..count]),
            Err(error) if error.kind() == ErrorKind::WouldBlock => {}
            Err(_) => return None,
        }
        while let Some(end) = pending.iter().position(|&byte| byte == b'\n') {
            let line: Vec<u8> = pending.drain(..=end).collect();
            let line = String::from_utf8_lossy(&line).trim().to_owned();
            log.lock()
                .unwrap_or_else(PoisonError::into_inner)
                .push(line.clone());
            // The host may have closed the connection: then the next read ends it.
            match analyser.take(&line) {
                Reply::Silence => {}
                Reply::Send(bytes) => drop(stream.write_all(&bytes)),
                Reply::SendAndClose(bytes) => {
                    drop(stream.write_all(&bytes));
                    return None;
                }
                Reply::Refuse(pause) => return Some(pause),
            }
        }
    }
    None
}
