//! USB link of the H743: a serial port of the class CDC-ACM at full speed (12 Mbit/s) on pins PA11 and PA12, the user
//! connector of the Nucleo-H743ZI2. Compiled and measured for size; not run on a board.
//!
//! The core is USB2 OTG (RM0433, section 57) at 0x40080000. RC oscillator HSI48 clocks it, trimmed by the start-of-frame packets
//! of the host (CRS), because a full-speed device must keep 48 MHz within 0.25 %.
//!
//! There is no interrupt handler: calls of the link poll the core, and its interrupt only ends a sleep. While the program
//! computes, the core holds up to three packets of 64 bytes and makes the host wait, so no byte is lost. Before the host has
//! configured the device, output is discarded. A configured device waits until the host reads.
//!
//! The rate is at most 19 packets per frame of 1 ms, 1.2 MB/s. This is computed, not measured.
//!
//! The port accepts any bit rate and does not need DTR. Vendor and product number 1209:0001 are those that pid.codes reserves
//! for tests: a product needs its own.

use cortex_m::peripheral::NVIC;
use embassy_stm32::Peri;
use embassy_stm32::gpio::{AfType, Flex, OutputType, Speed};
use embassy_stm32::pac::crs::vals::Syncsrc;
use embassy_stm32::pac::{CRS, Interrupt, PWR, RCC};
use embassy_stm32::peripherals::{PA11, PA12, USB_OTG_FS};
use embassy_stm32::rcc::{self, Hsi48Config, mux};
use embedded_io::{ErrorKind, ErrorType, Read, ReadReady, Write, WriteReady};
use static_cell::{ConstStaticCell, StaticCell};
use synopsys_usb_otg::{UsbBus, UsbPeripheral};
use usb_device::bus::UsbBusAllocator;
use usb_device::device::{
    StringDescriptors, UsbDevice, UsbDeviceBuilder, UsbDeviceState, UsbVidPid,
};
use usb_device::{LangID, UsbError};
// The port implements the traits of an earlier version.
use usbd_serial::embedded_io as port_traits;
use usbd_serial::{SerialPort, USB_CLASS_CDC};

/// Test numbers of pid.codes.
const NUMBERS: UsbVidPid = UsbVidPid(0x1209, 0x0001);
/// Clock of the buses, half of the processor's.
const AHB_HZ: u32 = 200_000_000;
/// Memory of the driver for received packets, in words: those of endpoint 0 and of the port.
const PACKET_WORDS: usize = 32;

type Port = SerialPort<'static, UsbBus<Otg>, &'static mut [u8], &'static mut [u8]>;

static PACKETS: ConstStaticCell<[u32; PACKET_WORDS]> = ConstStaticCell::new([0; PACKET_WORDS]);
static RECEIVED: ConstStaticCell<[u8; 512]> = ConstStaticCell::new([0; 512]);
static TO_SEND: ConstStaticCell<[u8; 2048]> = ConstStaticCell::new([0; 2048]);
static BUS: StaticCell<UsbBusAllocator<UsbBus<Otg>>> = StaticCell::new();

/// Buffers of the driver and the port.
pub(super) struct Buffers {
    packets: &'static mut [u32; PACKET_WORDS],
    received: &'static mut [u8; 512],
    to_send: &'static mut [u8; 2048],
}

/// USB2 OTG core of the H743 with its full-speed transceiver.
struct Otg;

// SAFETY: the address is that of the core's registers (RM0433, section 2.3), and only this driver uses them: `UsbLink::start`
// takes the peripheral.
unsafe impl UsbPeripheral for Otg {
    const REGISTERS: *const () = 0x4008_0000 as *const ();
    // The core is that of the high-speed peripheral; the default transceiver is the full-speed one.
    const HIGH_SPEED: bool = true;
    const FIFO_DEPTH_WORDS: usize = 1024;
    const ENDPOINT_COUNT: usize = 9;

    fn enable() {
        // The board supplies the transceiver with 3.3 V: the regulator for 5 V stays off.
        PWR.cr3().modify(|w| {
            w.set_usb33den(true);
            w.set_usbregen(false);
        });
        while !PWR.cr3().read().usb33rdy() {}
        // The clock of an external transceiver would stop the core during a sleep.
        RCC.ahb1enr().modify(|w| {
            w.set_usb_otg_fsen(true);
            w.set_usb_otg_fs_ulpien(false);
        });
        RCC.ahb1lpenr().modify(|w| w.set_usb_otg_fs_ulpilpen(false));
        RCC.ahb1rstr().modify(|w| w.set_usb_otg_fsrst(true));
        RCC.ahb1rstr().modify(|w| w.set_usb_otg_fsrst(false));
    }

    fn ahb_frequency_hz(&self) -> u32 {
        AHB_HZ
    }
}

/// USB link of the board.
pub struct UsbLink {
    device: UsbDevice<'static, UsbBus<Otg>>,
    port: Port,
    _pins: [Flex<'static>; 2],
}

/// Error of the USB link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinkError {
    /// The host has not configured the device; the bytes are discarded.
    NotConfigured,
    /// The USB stack failed to transfer a packet.
    Stack,
}

impl core::fmt::Display for LinkError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::NotConfigured => {
                f.write_str("USB device not configured by a host: the bytes were discarded")
            }
            Self::Stack => f.write_str("USB stack failed to transfer a packet"),
        }
    }
}

impl core::error::Error for LinkError {}

impl embedded_io::Error for LinkError {
    fn kind(&self) -> ErrorKind {
        match self {
            Self::NotConfigured => ErrorKind::NotConnected,
            Self::Stack => ErrorKind::Other,
        }
    }
}

impl UsbLink {
    /// Maximum duration without a poll in microseconds: a host expects the answer to a request within 50 ms (USB 2.0, section
    /// 9.2.6.4).
    pub(super) const MAX_STEP_US: u32 = 50_000;

    /// Add the clock of the core to those of the board.
    pub(super) fn add_clock(clocks: &mut rcc::Config) {
        clocks.hsi48 = Some(Hsi48Config {
            sync_from_usb: true,
        });
        clocks.mux.usbsel = mux::Usbsel::HSI48;
    }

    /// Take the buffers. `None` if they were taken before.
    pub(super) fn buffers() -> Option<Buffers> {
        Some(Buffers {
            packets: PACKETS.try_take()?,
            received: RECEIVED.try_take()?,
            to_send: TO_SEND.try_take()?,
        })
    }

    /// Connect to the bus. `None` if it was started before.
    pub(super) fn start(
        buffers: Buffers,
        _core: Peri<'static, USB_OTG_FS>,
        dm: Peri<'static, PA11>,
        dp: Peri<'static, PA12>,
    ) -> Option<Self> {
        // embassy-stm32 selects the frames of USB1. The source can be changed while the counter is off.
        CRS.cr().modify(|w| w.set_cen(false));
        CRS.cfgr()
            .modify(|w| w.set_syncsrc(Syncsrc::from_bits(CRS_USB2)));
        CRS.cr().modify(|w| w.set_cen(true));
        let pins = [Flex::new(dm), Flex::new(dp)].map(|mut pin| {
            // Function 10 of both pins is this core.
            pin.set_as_af_unchecked(10, AfType::output(OutputType::PushPull, Speed::VeryHigh));
            pin
        });
        let bus: &'static _ = BUS.try_init(UsbBus::new(Otg, buffers.packets))?;
        let port =
            SerialPort::new_with_store(bus, &mut buffers.received[..], &mut buffers.to_send[..]);
        let strings = StringDescriptors::new(LangID::EN)
            .manufacturer("Subaperture")
            .product("Subaperture module");
        let device = UsbDeviceBuilder::new(bus, NUMBERS)
            .strings(&[strings])
            .ok()?
            .device_class(USB_CLASS_CDC)
            .max_packet_size_0(64)
            .ok()?
            .build();
        Some(Self {
            device,
            port,
            _pins: pins,
        })
    }

    fn poll(&mut self) {
        self.device.poll(&mut [&mut self.port]);
    }

    fn is_configured(&self) -> bool {
        self.device.state() == UsbDeviceState::Configured
    }

    /// Sleep until a byte was received. May return early.
    pub(super) fn wait(&mut self) {
        self.sleep_unless(|link| !matches!(link.read_ready(), Ok(false)));
    }

    /// Sleep until the core needs a poll, unless `done` after one.
    fn sleep_unless(&mut self, done: impl FnOnce(&mut Self) -> bool) {
        // Interrupts masked: that of the core is enabled during the sleep only, and never taken. One after the poll ends the
        // sleep.
        cortex_m::interrupt::free(|_| {
            if done(self) {
                return;
            }
            NVIC::unpend(Interrupt::OTG_FS);
            // SAFETY: no code relies on this interrupt being disabled; it is not taken.
            unsafe { NVIC::unmask(Interrupt::OTG_FS) };
            cortex_m::asm::wfi();
            NVIC::mask(Interrupt::OTG_FS);
        });
    }
}

impl ErrorType for UsbLink {
    type Error = LinkError;
}

impl ReadReady for UsbLink {
    fn read_ready(&mut self) -> Result<bool, LinkError> {
        self.poll();
        port_traits::ReadReady::read_ready(&mut self.port).map_err(|_| LinkError::Stack)
    }
}

impl Read for UsbLink {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, LinkError> {
        if buffer.is_empty() {
            return Ok(0);
        }
        while !self.read_ready()? {
            self.wait();
        }
        self.port.read(buffer).map_err(|_| LinkError::Stack)
    }
}

impl WriteReady for UsbLink {
    fn write_ready(&mut self) -> Result<bool, LinkError> {
        self.poll();
        if !self.is_configured() {
            return Ok(true);
        }
        port_traits::WriteReady::write_ready(&mut self.port).map_err(|_| LinkError::Stack)
    }
}

impl Write for UsbLink {
    fn write(&mut self, buffer: &[u8]) -> Result<usize, LinkError> {
        if buffer.is_empty() {
            return Ok(0);
        }
        while !self.write_ready()? {
            self.sleep_unless(|link| !matches!(link.write_ready(), Ok(false)));
        }
        if !self.is_configured() {
            return Err(LinkError::NotConfigured);
        }
        self.port.write(buffer).map_err(|_| LinkError::Stack)
    }

    fn flush(&mut self) -> Result<(), LinkError> {
        let is_sent = |link: &mut Self| {
            link.poll();
            !link.is_configured() || link.port.flush() != Err(UsbError::WouldBlock)
        };
        while !is_sent(self) {
            self.sleep_unless(is_sent);
        }
        Ok(())
    }
}

/// Source of the synchronisation by USB2, which the register description of `stm32-metapac` lacks.
const CRS_USB2: u8 = 3;
