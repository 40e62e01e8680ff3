//! Stream self-tests of the core on a board, on an emulated machine, or on the host for comparison.
//!
//! Prints one line per test: name, buffer size in bytes, and a checksum that is bit-identical on every machine (the size
//! depends on the pointer size). A Cortex-M0 has memory for the fixed-point test only, and prints its stack usage. Under
//! emulation the program exits the emulator with success, or with failure after any error; `tests/firmware/golden.rs`
//! runs it.
#![cfg_attr(target_os = "none", no_std, no_main)]

use core::fmt::{Arguments, Display};

use subaperture_core::selftest::FixedStreamSelfTest;
#[cfg(not(feature = "board-microbit"))]
use subaperture_core::selftest::FloatStreamSelfTest;

/// Print a result. Returns whether it is a success.
fn show<E: Display>(
    log: fn(Arguments<'_>),
    name: &str,
    bytes: usize,
    result: Result<u32, E>,
) -> bool {
    match &result {
        Ok(checksum) => log(format_args!("{name} {bytes} bytes 0x{checksum:08x}")),
        Err(error) => log(format_args!("{error}")),
    }
    result.is_ok()
}

fn run_fixed(log: fn(Arguments<'_>), test: &mut FixedStreamSelfTest) -> bool {
    show(log, "fixed", FixedStreamSelfTest::BYTES, test.run())
}

#[cfg(not(feature = "board-microbit"))]
fn run_float(log: fn(Arguments<'_>), test: &mut FloatStreamSelfTest) -> bool {
    show(log, "float", FloatStreamSelfTest::BYTES, test.run())
}

#[cfg(target_os = "none")]
mod target {
    use static_cell::ConstStaticCell;
    use subaperture_core::selftest::FixedStreamSelfTest;
    #[cfg(not(feature = "board-microbit"))]
    use subaperture_core::selftest::FloatStreamSelfTest;
    #[cfg(target_arch = "arm")]
    use subaperture_firmware::board::{end, log};
    #[cfg(target_arch = "riscv32")]
    use subaperture_firmware::riscv_virt::{end, log};

    static FIXED: ConstStaticCell<FixedStreamSelfTest> =
        ConstStaticCell::new(FixedStreamSelfTest::new());
    #[cfg(not(feature = "board-microbit"))]
    static FLOAT: ConstStaticCell<FloatStreamSelfTest> =
        ConstStaticCell::new(FloatStreamSelfTest::new());

    #[cfg_attr(target_arch = "arm", cortex_m_rt::entry)]
    // SAFETY: the start-up code of `riscv_virt` calls this name, once.
    #[cfg_attr(target_arch = "riscv32", unsafe(export_name = "riscv_main"))]
    fn main() -> ! {
        #[cfg(not(feature = "board-microbit"))]
        let float = FLOAT
            .try_take()
            .is_some_and(|test| super::run_float(log, test));
        #[cfg(feature = "board-microbit")]
        let float = true;
        let fixed = FIXED
            .try_take()
            .is_some_and(|test| super::run_fixed(log, test));
        #[cfg(target_arch = "arm")]
        {
            use subaperture_firmware::memory::{stack_bytes, stack_high_water_bytes};
            let (used, all) = (stack_high_water_bytes(), stack_bytes());
            log(format_args!("stack {used} of {all} bytes"));
        }
        end(float && fixed)
    }
}

#[cfg(not(target_os = "none"))]
fn main() -> std::process::ExitCode {
    fn log(line: Arguments<'_>) {
        println!("{line}");
    }
    #[cfg(not(feature = "board-microbit"))]
    let float = run_float(log, &mut Box::new(FloatStreamSelfTest::new()));
    #[cfg(feature = "board-microbit")]
    let float = true;
    match float && run_fixed(log, &mut Box::new(FixedStreamSelfTest::new())) {
        true => std::process::ExitCode::SUCCESS,
        false => std::process::ExitCode::FAILURE,
    }
}
