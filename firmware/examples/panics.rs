//! Contains a possible panic: with the feature `no-panic` it must not link.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod target {
    use cortex_m_rt::entry;
    use subaperture_firmware::board::{Board, Current, end};

    #[entry]
    fn main() -> ! {
        let Some(board) = Current::take() else {
            end(false);
        };
        // An index unknown to the compiler.
        let table = [1u32, 2, 3];
        let value = table[core::hint::black_box(board.ticks() as usize & 3)];
        end(value > 0)
    }
}

#[cfg(not(target_os = "none"))]
fn main() {
    println!("this program runs on a board only");
}
