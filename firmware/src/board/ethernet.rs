//! TCP link of the AN500 over its Ethernet controller.
//!
//! The module has the static address 10.0.2.15/24, that of a guest in QEMU's user network, and accepts connections on TCP
//! port 4000. One host is served at a time. A new connection replaces the current one, because a host that reconnects may not
//! have closed its previous connection yet. Received and unsent bytes of a closed or replaced connection are discarded. A
//! connection is also closed if the host does not answer for 30 s. Without a connection, output is discarded, as on a serial
//! line that is not connected.
//!
//! The receive window is smaller than the controller's receive FIFO of 10 560 bytes. The FIFO therefore holds all frames that a
//! host may send during a processing step.
//!
//! smoltcp runs inside of the calls of the link; there is no interrupt handler. Its time is that of timer 0, so it must be
//! polled once in 171 s. Timer 1 ends a sleep when a retransmission is due.

use cortex_m::peripheral::NVIC;
use embedded_io::{ErrorKind, ErrorType, Read, ReadReady, Write, WriteReady};
use smoltcp::iface::{
    Config, Interface, PollIngressSingleResult, PollResult, SocketHandle, SocketSet, SocketStorage,
};
use smoltcp::phy::{Device, TxToken};
use smoltcp::socket::tcp::{Socket, SocketBuffer, State};
use smoltcp::time::{Duration, Instant};
use smoltcp::wire::{
    ArpOperation, ArpPacket, ArpRepr, EthernetAddress, EthernetFrame, EthernetProtocol,
    EthernetRepr, IpCidr, Ipv4Address, Ipv4Cidr,
};
use static_cell::ConstStaticCell;

use super::cmsdk::{CLOCK_HZ, Registers, timer};
use super::interrupt::Interrupt;
use super::lan9118::{Frames, Lan9118};

/// Address in QEMU's user network, whose host is 10.0.2.2.
const ADDRESS: Ipv4Cidr = Ipv4Cidr::new(Ipv4Address::new(10, 0, 2, 15), 24);
/// Port of the link.
pub const PORT: u16 = 4000;

/// Receive window in bytes.
const RECEIVE_BYTES: usize = 8192;
/// Size of a send buffer in bytes.
const SEND_BYTES: usize = 16_384;
/// A connection whose host does not answer for this time is closed.
const TIMEOUT: Duration = Duration::from_secs(30);
/// Interval at which a silent host is asked for an answer.
const KEEP_ALIVE: Duration = Duration::from_secs(5);
/// Maximum number of frames in each direction per poll, so that the time of a poll is bounded.
const FRAMES_A_POLL: usize = 8;
/// Number of bytes read after which the network is polled although more were received.
const BYTES_A_POLL: usize = 1024;

const ETHERNET: Interrupt = Interrupt(13);
const ALARM: Interrupt = Interrupt(9);

/// A connection that is served, and one that may replace it.
const SOCKETS: usize = 2;

/// Buffers of a socket.
struct Buffers {
    received: [u8; RECEIVE_BYTES],
    to_send: [u8; SEND_BYTES],
}

static BUFFERS: ConstStaticCell<[Buffers; SOCKETS]> = ConstStaticCell::new(
    [const {
        Buffers {
            received: [0; RECEIVE_BYTES],
            to_send: [0; SEND_BYTES],
        }
    }; SOCKETS],
);
static STORAGE: ConstStaticCell<[SocketStorage<'static>; SOCKETS]> =
    ConstStaticCell::new([SocketStorage::EMPTY; SOCKETS]);
static FRAMES: ConstStaticCell<Frames> = ConstStaticCell::new(Frames::EMPTY);

/// TCP link over Ethernet.
pub struct TcpLink {
    device: Lan9118,
    interface: Interface,
    sockets: SocketSet<'static>,
    handles: [SocketHandle; SOCKETS],
    /// Index of the socket whose connection is served.
    connected: Option<usize>,
    clock: Clock,
    alarm: Registers,
    /// Number of bytes read since the last poll.
    taken: usize,
}

/// Error of the TCP link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TcpError {
    /// There is no connection, or it ended during the write; the bytes are discarded.
    NotConnected,
}

impl core::fmt::Display for TcpError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("TCP link without a connection: the bytes were discarded")
    }
}

impl core::error::Error for TcpError {}

impl embedded_io::Error for TcpError {
    fn kind(&self) -> ErrorKind {
        ErrorKind::NotConnected
    }
}

impl TcpLink {
    /// Start the controller and listen. `None` if there is no controller or the buffers were taken before.
    pub(super) fn start() -> Option<Self> {
        let mut device = Lan9118::start(Registers(0xa000_0000), FRAMES.try_take()?)?;
        let mut clock = Clock::new();
        let address = device.address();
        // There is no source of randomness: initial sequence numbers are predictable.
        let config = Config::new(address.into());
        let mut interface = Interface::new(config, &mut device, clock.now());
        interface.update_ip_addrs(|addresses| {
            // There is room for two.
            let _ = addresses.push(IpCidr::Ipv4(ADDRESS));
        });
        let mut sockets = SocketSet::new(&mut STORAGE.try_take()?[..]);
        let handles = BUFFERS.try_take()?.each_mut().map(|buffers| {
            let mut socket = Socket::new(
                SocketBuffer::new(&mut buffers.received[..]),
                SocketBuffer::new(&mut buffers.to_send[..]),
            );
            socket.set_nagle_enabled(false);
            socket.set_ack_delay(None);
            socket.set_timeout(Some(TIMEOUT));
            socket.set_keep_alive(Some(KEEP_ALIVE));
            sockets.add(socket)
        });
        let alarm = Registers(0x4000_1000);
        alarm.write(timer::RELOAD, u32::MAX);
        // Interrupts only end a sleep: they are masked and never taken.
        cortex_m::interrupt::disable();
        for interrupt in [ETHERNET, ALARM] {
            NVIC::unpend(interrupt);
            // SAFETY: no code relies on these interrupts being disabled; they are not taken.
            unsafe { NVIC::unmask(interrupt) };
        }
        announce(&mut device, address);
        let mut link = Self {
            device,
            interface,
            sockets,
            handles,
            connected: None,
            clock,
            alarm,
            taken: 0,
        };
        link.poll();
        Some(link)
    }

    fn socket(&mut self, index: usize) -> &mut Socket<'static> {
        self.sockets.get_mut(self.handles[index])
    }

    /// Socket whose connection is served.
    fn connection(&mut self) -> Option<&mut Socket<'static>> {
        let index = self.connected?;
        Some(self.socket(index))
    }

    fn has_received(&mut self) -> bool {
        self.connection().is_some_and(|socket| socket.can_recv())
    }

    fn has_room(&mut self) -> bool {
        // Without a connection bytes are discarded.
        self.connection().is_none_or(|socket| socket.can_send())
    }

    /// Process received frames, send due ones, and update the connections.
    fn poll(&mut self) {
        self.taken = 0;
        let now = self.clock.now();
        let (device, sockets) = (&mut self.device, &mut self.sockets);
        for _ in 0..FRAMES_A_POLL {
            let result = self.interface.poll_ingress_single(now, device, sockets);
            if matches!(result, PollIngressSingleResult::None) {
                break;
            }
        }
        for _ in 0..FRAMES_A_POLL {
            let result = self.interface.poll_egress(now, device, sockets);
            if matches!(result, PollResult::None) {
                break;
            }
        }
        self.update_connections();
    }

    /// Serve the newest connection, end those closed by the host, and let unused sockets listen.
    fn update_connections(&mut self) {
        for index in 0..SOCKETS {
            let is_current = self.connected == Some(index);
            let socket = self.socket(index);
            match socket.state() {
                State::Established if !is_current => {
                    if let Some(replaced) = self.connected.replace(index) {
                        self.socket(replaced).abort();
                    }
                    continue;
                }
                State::Established | State::Listen | State::SynReceived => continue,
                // Closed, without a pending reset.
                State::Closed if socket.remote_endpoint().is_none() => {
                    // The port is not zero and the socket is closed.
                    let _ = socket.listen(PORT);
                }
                State::Closed => {}
                _ => socket.abort(),
            }
            if is_current {
                self.connected = None;
            }
        }
    }

    /// Sleep until a frame is received or a timer of smoltcp expires. Returns early if the link has received something.
    pub(super) fn wait(&mut self) {
        // Clear pending interrupts first, then poll: an interrupt after the poll ends the sleep.
        self.device.clear_interrupt();
        self.alarm.write(timer::CTRL, 0);
        self.alarm.write(timer::INTCLEAR, 1);
        NVIC::unpend(ETHERNET);
        NVIC::unpend(ALARM);
        self.poll();
        if self.has_received() || self.device.frames_received() > 0 {
            return;
        }
        let now = self.clock.now();
        if let Some(delay) = self.interface.poll_delay(now, &self.sockets) {
            if delay == Duration::ZERO {
                return;
            }
            let ticks = delay.total_micros().saturating_mul(TICKS_A_MICROSECOND);
            let ticks = u32::try_from(ticks).unwrap_or(u32::MAX);
            self.alarm.write(timer::VALUE, ticks);
            self.alarm
                .write(timer::CTRL, timer::ENABLE | timer::INTERRUPT);
        }
        cortex_m::asm::wfi();
    }
}

impl ErrorType for TcpLink {
    type Error = TcpError;
}

impl ReadReady for TcpLink {
    fn read_ready(&mut self) -> Result<bool, TcpError> {
        if self.taken >= BYTES_A_POLL || !self.has_received() {
            self.poll();
        }
        Ok(self.has_received())
    }
}

impl Read for TcpLink {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, TcpError> {
        if buffer.is_empty() {
            return Ok(0);
        }
        loop {
            if let Some(socket) = self.connection()
                && let Ok(count) = socket.recv_slice(buffer)
                && count > 0
            {
                self.taken += count;
                return Ok(count);
            }
            self.wait();
        }
    }
}

impl WriteReady for TcpLink {
    fn write_ready(&mut self) -> Result<bool, TcpError> {
        if !self.has_room() {
            self.poll();
        }
        Ok(self.has_room())
    }
}

impl Write for TcpLink {
    fn write(&mut self, buffer: &[u8]) -> Result<usize, TcpError> {
        if buffer.is_empty() {
            return Ok(0);
        }
        let connected = self.connected;
        while !self.has_room() {
            self.wait();
        }
        if self.connected != connected {
            return Err(TcpError::NotConnected);
        }
        let socket = self.connection().ok_or(TcpError::NotConnected)?;
        socket
            .send_slice(buffer)
            .map_err(|_| TcpError::NotConnected)
    }

    fn flush(&mut self) -> Result<(), TcpError> {
        while self
            .connection()
            .is_some_and(|socket| socket.send_queue() > 0)
        {
            self.wait();
        }
        Ok(())
    }
}

/// Announce the module's address (RFC 5227, section 2.3), so that packets that wait for it are sent at once.
fn announce(device: &mut Lan9118, address: EthernetAddress) {
    let header = EthernetRepr {
        src_addr: address,
        dst_addr: EthernetAddress::BROADCAST,
        ethertype: EthernetProtocol::Arp,
    };
    let announcement = ArpRepr::EthernetIpv4 {
        operation: ArpOperation::Request,
        source_hardware_addr: address,
        source_protocol_addr: ADDRESS.address(),
        target_hardware_addr: EthernetAddress([0; 6]),
        target_protocol_addr: ADDRESS.address(),
    };
    // Room for it is in a FIFO that was just reset.
    if let Some(frame) = device.transmit(Instant::ZERO) {
        let length = header.buffer_len() + announcement.buffer_len();
        frame.consume(length, |bytes| {
            let mut frame = EthernetFrame::new_unchecked(bytes);
            header.emit(&mut frame);
            announcement.emit(&mut ArpPacket::new_unchecked(frame.payload_mut()));
        });
    }
}

const TICKS_A_MICROSECOND: u64 = CLOCK_HZ as u64 / 1_000_000;

/// Time from timer 0, which wraps after 171 s. It may stand still at first.
#[derive(Debug)]
struct Clock {
    timer: Registers,
    last: u32,
    ticks: u64,
}

impl Clock {
    fn new() -> Self {
        let timer = Registers(0x4000_0000);
        let last = !timer.read(timer::VALUE);
        let ticks = 0;
        Self { timer, last, ticks }
    }

    fn now(&mut self) -> Instant {
        let ticks = !self.timer.read(timer::VALUE);
        self.ticks += u64::from(ticks.wrapping_sub(self.last));
        self.last = ticks;
        Instant::from_micros((self.ticks / TICKS_A_MICROSECOND) as i64)
    }
}
