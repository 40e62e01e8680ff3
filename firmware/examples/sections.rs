//! Verifies that named sections are zero when the program starts, whatever the memory contained before.
//!
//! The first run fills them with ones and resets, which preserves memory (as the reset count shows). The second run checks
//! them. The first also measures the stack usage of a call that needs 10 000 bytes.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod target {
    use cortex_m_rt::entry;
    use subaperture_firmware::board::{Board, Current, end};
    use subaperture_firmware::{fault, memory, place};

    // Odd sizes, since the ends of the sections are rounded up.
    place!(axi static IN_AXI: [u8; 300_001] = [0; 300_001]);
    place!(sram static IN_SRAM: [u8; 200_003] = [0; 200_003]);

    #[entry]
    fn main() -> ! {
        let Some(mut board) = Current::take() else {
            end(false);
        };
        let (axi, sram) = (IN_AXI.take(), IN_SRAM.take());
        let not_zero = axi.iter().chain(sram.iter()).filter(|byte| **byte != 0);
        let not_zero = not_zero.count();
        board.log(format_args!(
            "resets {}, bytes not zero {not_zero}",
            fault::resets()
        ));
        if fault::resets() > 0 || not_zero > 0 {
            end(not_zero == 0);
        }
        axi.fill(0xff);
        sram.fill(0xff);
        // Keep the compiler from removing writes that are never read.
        core::hint::black_box((&axi, &sram));

        let before = memory::stack_high_water_bytes();
        use_stack();
        let after = memory::stack_high_water_bytes();
        board.log(format_args!("stack rose by {}", after - before));
        fault::die(format_args!("once more"))
    }

    #[inline(never)]
    fn use_stack() {
        core::hint::black_box(&mut [1u8; 10_000]);
    }
}

#[cfg(not(target_os = "none"))]
fn main() {
    println!("this program runs on a board only");
}
