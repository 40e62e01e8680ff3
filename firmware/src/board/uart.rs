//! Interrupts of UART0, registers and bits of a CMSDK UART.

use super::interrupt::Interrupt;

pub(super) const RX: Interrupt = Interrupt(0);
pub(super) const TX: Interrupt = Interrupt(1);

pub(super) const DATA: usize = 0x0;
pub(super) const STATE: usize = 0x4;
pub(super) const CTRL: usize = 0x8;
pub(super) const INTCLEAR: usize = 0xc;
pub(super) const BAUDDIV: usize = 0x10;
pub(super) const TX_FULL: u32 = 1 << 0;
pub(super) const RX_FULL: u32 = 1 << 1;
pub(super) const RX_OVERRUN: u32 = 1 << 3;
pub(super) const TX_ENABLE: u32 = 1 << 0;
pub(super) const RX_ENABLE: u32 = 1 << 1;
pub(super) const TX_INTERRUPT: u32 = 1 << 2;
pub(super) const RX_INTERRUPT: u32 = 1 << 3;
