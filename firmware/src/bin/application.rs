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
        let endpoint = endpoint.with_log(board::log_event, fault::resets());
        #[cfg(any(feature = "board-an500", feature = "spi-front-end"))]
        {
            let mut board = board;
            let front_end = module::FRONT_END.try_take();
            let front_end = front_end.and_then(|buffer| board::front_end(&mut board, buffer));
            let (Some(mut front_end), Some(queue)) = (front_end, module::GEOMETRY.try_take())
            else {
                fault::die(format_args!("front end already taken at program start"));
            };
            serve(board, endpoint.with_front_end(&mut front_end, queue))
        }
        #[cfg(not(any(feature = "board-an500", feature = "spi-front-end")))]
        serve(board, endpoint)
    }
}

#[cfg(not(target_os = "none"))]
fn main() {
    println!("this program runs on a board only");
}
