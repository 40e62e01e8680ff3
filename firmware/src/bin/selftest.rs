//! Self-tests of the core on a board, or on the host for comparison.
//!
//! Prints the buffer sizes and four checksums: of maps, of motion increments from echoes and from samples, and of range
//! profiles. They are bit-identical on every machine. On the emulated board the program exits the emulator with success, or
//! with failure after any error; `tests/firmware/selftest.rs` runs it.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod target {
    use cortex_m_rt::entry;
    use subaperture_core::selftest::{MotionSelfTest, OdometerSelfTest, SelfTest, SweepSelfTest};
    use subaperture_firmware::board::{self, log};
    use subaperture_firmware::place;

    place!(axi static BUFFERS: SelfTest = SelfTest::new());
    place!(axi static ODOMETER: OdometerSelfTest = OdometerSelfTest::new());
    place!(axi static SWEEP: SweepSelfTest = SweepSelfTest::new());

    #[entry]
    fn main() -> ! {
        let maps = BUFFERS.take().run();
        match maps {
            Ok(checksum) => {
                log(format_args!("buffers {} bytes", SelfTest::BYTES));
                log(format_args!("checksum 0x{checksum:08x}"));
            }
            Err(error) => log(format_args!("{error}")),
        }
        let motion = MotionSelfTest::new().and_then(|mut test| test.run());
        match motion {
            Ok(checksum) => {
                log(format_args!("motion {} bytes", MotionSelfTest::BYTES));
                log(format_args!("checksum 0x{checksum:08x}"));
            }
            Err(error) => log(format_args!("{error}")),
        }
        let odometer = ODOMETER.take().run();
        match odometer {
            Ok(checksum) => {
                log(format_args!("odometer {} bytes", OdometerSelfTest::BYTES));
                log(format_args!("checksum 0x{checksum:08x}"));
            }
            Err(error) => log(format_args!("{error}")),
        }
        let sweep = SWEEP.take().run();
        match sweep {
            Ok(checksum) => {
                log(format_args!("sweep {} bytes", SweepSelfTest::BYTES));
                log(format_args!("checksum 0x{checksum:08x}"));
            }
            Err(error) => log(format_args!("{error}")),
        }
        board::end(maps.is_ok() && motion.is_ok() && odometer.is_ok() && sweep.is_ok())
    }
}

#[cfg(not(target_os = "none"))]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    use subaperture_core::selftest::{MotionSelfTest, OdometerSelfTest, SelfTest, SweepSelfTest};
    let mut buffers = Box::new(SelfTest::new());
    let checksum = buffers.run()?;
    println!("buffers {} bytes", SelfTest::BYTES);
    println!("checksum 0x{checksum:08x}");
    let checksum = MotionSelfTest::new()?.run()?;
    println!("motion {} bytes", MotionSelfTest::BYTES);
    println!("checksum 0x{checksum:08x}");
    let checksum = OdometerSelfTest::new().run()?;
    println!("odometer {} bytes", OdometerSelfTest::BYTES);
    println!("checksum 0x{checksum:08x}");
    let checksum = SweepSelfTest::new().run()?;
    println!("sweep {} bytes", SweepSelfTest::BYTES);
    println!("checksum 0x{checksum:08x}");
    Ok(())
}
