//! Causes every kind of failure in turn: a fault, a watchdog expiry, a panic. Each must end in a reset.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod target {
    use cortex_m_rt::entry;
    use subaperture_firmware::board::{Board, Current, end};
    use subaperture_firmware::fault;

    #[entry]
    fn main() -> ! {
        let Some(mut board) = Current::take() else {
            end(false);
        };
        board.log(format_args!("resets {}", fault::resets()));
        match fault::resets() {
            0 => cortex_m::asm::udf(),
            1 => {
                board.feed_watchdog();
                loop {
                    cortex_m::asm::nop();
                }
            }
            2 => panic!("on purpose"),
            _ => end(true),
        }
    }
}

#[cfg(not(target_os = "none"))]
fn main() {
    println!("this program runs on a board only");
}
