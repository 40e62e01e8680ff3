//! Application of the embedded module: pulses in over the serial link, maps out.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod target {
    use cortex_m_rt::entry;
    use subaperture_core::accumulate::ChipKernel;
    use subaperture_firmware::board::{self, Board, Current};
    use subaperture_firmware::serve::serve;
    use subaperture_firmware::{fault, log, module, sizes};

    #[entry]
    fn main() -> ! {
        let Some(board) = Current::take() else {
            fault::die(format_args!("board already taken at program start"));
        };
        log!(
            info,
            "subaperture {} {} on {}",
            env!("CARGO_PKG_VERSION"),
            sizes::NAME,
            Current::NAME
        );
        let kernel = ChipKernel::new();
        let Some(endpoint) = module::endpoint(&kernel) else {
            fault::die(format_args!("buffer already taken at program start"));
        };
        serve(board, endpoint.with_log(board::log_event, fault::resets()))
    }
}

#[cfg(not(target_os = "none"))]
fn main() {
    println!("this program runs on a board only");
}
