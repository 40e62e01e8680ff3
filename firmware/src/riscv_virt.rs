//! QEMU's machine `virt` for 32-bit RISC-V: start, a line of output, the end. No board, only bits to compare.
//!
//! The UART (16550) is at 0x10000000 and takes a byte at any time; the emulator ends when its test device
//! at 0x100000 is told to (0x5555: success, 0x3333 and a code in the upper half: failure).

use core::fmt::{self, Write};
use core::panic::PanicInfo;

// A stack, the floating-point unit where there is one (mstatus.FS = 1; the bits read as 0 where there is
// none), then the program's `riscv_main`.
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
            // SAFETY: the machine's transmit register.
            unsafe { UART.write_volatile(byte) };
        }
        Ok(())
    }
}

/// Writes a line.
pub fn log(message: fmt::Arguments<'_>) {
    // Cannot fail: the UART takes everything.
    let _ = Uart.write_fmt(message);
    let _ = Uart.write_str("\n");
}

/// Ends the emulator.
pub fn end(success: bool) -> ! {
    let word = if success { 0x5555 } else { 0x1_3333 };
    // SAFETY: the machine's test device.
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
