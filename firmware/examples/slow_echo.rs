//! Echoes received bytes, but pauses for a millisecond after every 64 bytes, like a busy program.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod target {
    use cortex_m_rt::entry;
    use embedded_io::{Read, Write};
    use subaperture_firmware::board::{Board, Current, end};

    #[entry]
    fn main() -> ! {
        let Some(mut board) = Current::take() else {
            end(false);
        };
        let mut buffer = [0; 64];
        loop {
            let result = board.link().read_exact(&mut buffer);
            if result.is_err() || board.link().write_all(&buffer).is_err() {
                end(false);
            }
            let start = board.ticks();
            while board.ticks().wrapping_sub(start) < Current::TICKS_HZ / 1000 {}
        }
    }
}

#[cfg(not(target_os = "none"))]
fn main() {
    println!("this program runs on a board only");
}
