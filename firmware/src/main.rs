//! The core's self-test on a Cortex-M7 (QEMU's `mps2-an500`), or on the host for comparison.
//!
//! Prints the memory of the buffers and one checksum, the same to the bit wherever it runs, and exits
//! the emulator with success; any failure exits it with an error. `tests/firmware.rs` runs it.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod target {
    use cortex_m_rt::{ExceptionFrame, entry, exception};
    use cortex_m_semihosting::{debug, hprintln};
    use panic_semihosting as _;
    use subaperture_core::selftest::SelfTest;

    #[entry]
    fn main() -> ! {
        static mut BUFFERS: SelfTest = SelfTest::new();
        match BUFFERS.run() {
            Ok(checksum) => {
                hprintln!("buffers {} bytes", SelfTest::BYTES);
                hprintln!("checksum 0x{:08x}", checksum);
                debug::exit(debug::EXIT_SUCCESS);
            }
            Err(error) => {
                hprintln!("{}", error);
                debug::exit(debug::EXIT_FAILURE);
            }
        }
        unreachable!("the emulator has exited");
    }

    // `unsafe` is what cortex-m-rt asks of this handler; the body needs none.
    #[exception]
    unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
        hprintln!("hard fault at 0x{:08x}", frame.pc());
        loop {
            debug::exit(debug::EXIT_FAILURE);
        }
    }
}

#[cfg(not(target_os = "none"))]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    use subaperture_core::selftest::SelfTest;
    let mut buffers = Box::new(SelfTest::new());
    let checksum = buffers.run()?;
    println!("buffers {} bytes", SelfTest::BYTES);
    println!("checksum 0x{checksum:08x}");
    Ok(())
}
