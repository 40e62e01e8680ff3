//! SMSC LAN9118 Ethernet controller: frames in and out of its FIFOs, as a device of smoltcp.
//!
//! Registers and bits are those of the data sheet (SMSC DS-LAN9118). The controller is reset, receives frames for its own
//! address and broadcasts, and checks and adds the frame check sequence. Its PHY negotiates after a reset without a command.
//! Full duplex is assumed. The interrupt is asserted after a frame was received.

use smoltcp::phy::{self, DeviceCapabilities, Medium};
use smoltcp::time::Instant;
use smoltcp::wire::EthernetAddress;

use super::cmsdk::Registers;

/// Longest frame with header, without its check sequence.
const FRAME_BYTES: usize = 1514;

/// Buffers of a received and a sent frame, in whole words with the check sequence.
#[derive(Debug)]
pub(super) struct Frames {
    received: [u8; 1520],
    to_send: [u8; 1520],
}

impl Frames {
    pub(super) const EMPTY: Self = Self {
        received: [0; 1520],
        to_send: [0; 1520],
    };
}

/// Number of reads of a register after which a controller that does not answer is given up.
const ATTEMPTS: u32 = 1_000_000;

/// LAN9118 with its frame buffers.
#[derive(Debug)]
pub(super) struct Lan9118 {
    registers: Registers,
    frames: &'static mut Frames,
}

impl Lan9118 {
    /// Reset and start the controller. `None` if it does not answer.
    pub(super) fn start(registers: Registers, frames: &'static mut Frames) -> Option<Self> {
        let controller = Self { registers, frames };
        controller.wait_for(BYTE_TEST, u32::MAX, BYTE_ORDER)?;
        controller.registers.write(HW_CFG, HW_RESET);
        controller.wait_for(HW_CFG, HW_RESET, 0)?;
        controller
            .registers
            .write(HW_CFG, HW_WHOLE_FRAMES | HW_TX_5K);
        controller.registers.write(RX_CFG, 0);
        controller
            .registers
            .write(TX_CFG, TX_ON | TX_STATUS_OVERRUN);
        // An interrupt for each received frame, active high.
        controller.registers.write(FIFO_INT, 0);
        controller.registers.write(INT_STS, u32::MAX);
        controller.registers.write(INT_EN, RX_STATUS_LEVEL);
        controller
            .registers
            .write(IRQ_CFG, IRQ_ENABLE | IRQ_ACTIVE_HIGH | IRQ_PUSH_PULL);
        controller.mac_write(MAC_CR, MAC_FULL_DUPLEX | MAC_TX | MAC_RX)?;
        Some(controller)
    }

    /// Hardware address from the controller's EEPROM, or a locally administered one if the EEPROM has no unicast address.
    pub(super) fn address(&self) -> EthernetAddress {
        let low = self.mac_read(MAC_ADDRL).unwrap_or(0).to_le_bytes();
        let high = self.mac_read(MAC_ADDRH).unwrap_or(0).to_le_bytes();
        let address = EthernetAddress([low[0], low[1], low[2], low[3], high[0], high[1]]);
        if address.is_unicast() && address.0 != [0; 6] {
            address
        } else {
            EthernetAddress([0x02, 0, 0, 0, 0, 1])
        }
    }

    /// Number of received frames in the FIFO.
    pub(super) fn frames_received(&self) -> u32 {
        (self.registers.read(RX_FIFO_INF) >> 16) & 0xff
    }

    /// Withdraw the interrupt until the next frame is received.
    pub(super) fn clear_interrupt(&self) {
        self.registers.write(INT_STS, u32::MAX);
    }

    fn wait_for(&self, register: usize, mask: u32, wanted: u32) -> Option<()> {
        (0..ATTEMPTS)
            .any(|_| self.registers.read(register) & mask == wanted)
            .then_some(())
    }

    fn mac_write(&self, register: u32, value: u32) -> Option<()> {
        self.wait_for(MAC_CSR_CMD, MAC_BUSY, 0)?;
        self.registers.write(MAC_CSR_DATA, value);
        self.registers.write(MAC_CSR_CMD, MAC_BUSY | register);
        self.wait_for(MAC_CSR_CMD, MAC_BUSY, 0)
    }

    fn mac_read(&self, register: u32) -> Option<u32> {
        self.wait_for(MAC_CSR_CMD, MAC_BUSY, 0)?;
        self.registers
            .write(MAC_CSR_CMD, MAC_BUSY | MAC_IS_READ | register);
        self.wait_for(MAC_CSR_CMD, MAC_BUSY, 0)?;
        Some(self.registers.read(MAC_CSR_DATA))
    }

    /// Whether the FIFO has room for the longest frame and its two commands.
    fn has_room(&self) -> bool {
        let free_bytes = self.registers.read(TX_FIFO_INF) & 0xffff;
        free_bytes as usize >= FRAME_BYTES + 12
    }

    /// Read the next valid frame; returns its length without the check sequence.
    fn read_frame(&mut self) -> Option<usize> {
        while self.frames_received() > 0 {
            let status = self.registers.read(RX_STATUS);
            // With the check sequence of four bytes.
            let bytes = ((status >> 16) & 0x3fff) as usize;
            let mut words = self.frames.received.chunks_exact_mut(4);
            for _ in 0..bytes.div_ceil(4) {
                let word = self.registers.read(RX_DATA).to_le_bytes();
                // The rest of a frame that is too long is discarded.
                if let Some(place) = words.next() {
                    place.copy_from_slice(&word);
                }
            }
            let length = bytes.saturating_sub(4);
            if status & RX_ERROR == 0 && (1..=FRAME_BYTES).contains(&length) {
                return Some(length);
            }
        }
        None
    }
}

impl phy::Device for Lan9118 {
    type RxToken<'a> = ReceivedFrame<'a>;
    type TxToken<'a> = FrameToSend<'a>;

    fn receive(&mut self, _: Instant) -> Option<(ReceivedFrame<'_>, FrameToSend<'_>)> {
        // Every received frame may be answered by one.
        if !self.has_room() {
            return None;
        }
        let length = self.read_frame()?;
        let Frames { received, to_send } = &mut *self.frames;
        let frame = ReceivedFrame(received.get(..length)?);
        let registers = &self.registers;
        Some((frame, FrameToSend { registers, to_send }))
    }

    fn transmit(&mut self, _: Instant) -> Option<FrameToSend<'_>> {
        self.has_room().then_some(FrameToSend {
            registers: &self.registers,
            to_send: &mut self.frames.to_send,
        })
    }

    fn capabilities(&self) -> DeviceCapabilities {
        let mut capabilities = DeviceCapabilities::default();
        capabilities.medium = Medium::Ethernet;
        capabilities.max_transmission_unit = FRAME_BYTES;
        capabilities
    }
}

/// Frame that was read from the FIFO.
pub(super) struct ReceivedFrame<'a>(&'a [u8]);

impl phy::RxToken for ReceivedFrame<'_> {
    fn consume<R, F: FnOnce(&[u8]) -> R>(self, use_frame: F) -> R {
        use_frame(self.0)
    }
}

/// Room for a frame in the FIFO.
pub(super) struct FrameToSend<'a> {
    registers: &'a Registers,
    to_send: &'a mut [u8; 1520],
}

impl phy::TxToken for FrameToSend<'_> {
    fn consume<R, F: FnOnce(&mut [u8]) -> R>(self, length: usize, fill: F) -> R {
        // smoltcp requests no more than the MTU.
        let length = length.min(FRAME_BYTES);
        let result = fill(&mut self.to_send[..length]);
        let bytes = length as u32;
        self.registers
            .write(TX_DATA, TX_FIRST_SEGMENT | TX_LAST_SEGMENT | bytes);
        self.registers.write(TX_DATA, bytes);
        for word in self.to_send.chunks_exact(4).take(length.div_ceil(4)) {
            let word = [word[0], word[1], word[2], word[3]];
            self.registers.write(TX_DATA, u32::from_le_bytes(word));
        }
        result
    }
}

const RX_DATA: usize = 0x00;
const TX_DATA: usize = 0x20;
const RX_STATUS: usize = 0x40;
const IRQ_CFG: usize = 0x54;
const INT_STS: usize = 0x58;
const INT_EN: usize = 0x5c;
const BYTE_TEST: usize = 0x64;
const FIFO_INT: usize = 0x68;
const RX_CFG: usize = 0x6c;
const TX_CFG: usize = 0x70;
const HW_CFG: usize = 0x74;
const RX_FIFO_INF: usize = 0x7c;
const TX_FIFO_INF: usize = 0x80;
const MAC_CSR_CMD: usize = 0xa4;
const MAC_CSR_DATA: usize = 0xa8;

/// Value of `BYTE_TEST` if words are read in the processor's byte order.
const BYTE_ORDER: u32 = 0x8765_4321;
const RX_ERROR: u32 = 1 << 15;
const IRQ_ENABLE: u32 = 1 << 8;
const IRQ_ACTIVE_HIGH: u32 = 1 << 4;
const IRQ_PUSH_PULL: u32 = 1 << 0;
/// Interrupt when the FIFO of receive status holds more entries than `FIFO_INT` states.
const RX_STATUS_LEVEL: u32 = 1 << 3;
const HW_RESET: u32 = 1 << 0;
const HW_TX_5K: u32 = 5 << 16;
const HW_WHOLE_FRAMES: u32 = 1 << 20;
const TX_ON: u32 = 1 << 1;
/// Send although the FIFO of transmit status, which is not read, is full.
const TX_STATUS_OVERRUN: u32 = 1 << 2;
const TX_FIRST_SEGMENT: u32 = 1 << 13;
const TX_LAST_SEGMENT: u32 = 1 << 12;
const MAC_BUSY: u32 = 1 << 31;
const MAC_IS_READ: u32 = 1 << 30;
const MAC_CR: u32 = 1;
const MAC_ADDRH: u32 = 2;
const MAC_ADDRL: u32 = 3;
const MAC_FULL_DUPLEX: u32 = 1 << 20;
const MAC_TX: u32 = 1 << 3;
const MAC_RX: u32 = 1 << 2;
