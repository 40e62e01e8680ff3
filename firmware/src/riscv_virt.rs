//! QEMU's `virt` machine for 32-bit RISC-V: start-up, output and exit. Not a board; used to compare results bit by bit.
//!
//! The UART (16550) is at 0x10000000 and accepts a byte at any time. The emulator exits when its test device at 0x100000 is
//! written (0x5555: success; 0x3333 with a code in the upper half: failure).

use core::fmt::{self, Write};
use core::panic::PanicInfo;

// Set up the stack and the floating-point unit if present (mstatus.FS = 1; the bits read as 0 otherwise), then call
// the program's `riscv_main`.
core::arch::global_asm!(
    ".section .text.start, \"ax\"
     .global _start
     _start:
         la sp, _stack_start
         li t0, 0x2000
         csrs mstatus, t0
         call riscv_main
     1:  j 1b"
);

const UART: *mut u8 = 0x1000_0000 as *mut u8;
const TEST_DEVICE: *mut u32 = 0x0010_0000 as *mut u32;

struct Uart;

impl Write for Uart {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for byte in text.bytes() {
            // SAFETY: transmit register of the machine.
            unsafe { UART.write_volatile(byte) };
        }
        Ok(())
    }
}

/// Write a line.
pub fn log(message: fmt::Arguments<'_>) {
    // Cannot fail: the UART accepts everything.
    let _ = Uart.write_fmt(message);
    let _ = Uart.write_str("\n");
}

/// Exit the emulator with success or failure.
pub fn end(success: bool) -> ! {
    let word = if success { 0x5555 } else { 0x1_3333 };
    // SAFETY: test device of the machine.
    unsafe { TEST_DEVICE.write_volatile(word) };
    loop {
        core::hint::spin_loop();
    }
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    log(format_args!("{info}"));
    end(false)
}
