//! Logs a greeting, then echoes received bytes.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod target {
    use cortex_m_rt::entry;
    use embedded_io::{Read, Write};
    use subaperture_firmware::board::{Board, Current};
    use subaperture_firmware::fault;

    #[entry]
    fn main() -> ! {
        let Some(mut board) = Current::take() else {
            fault::die(format_args!("board already taken at program start"));
        };
        board.log(format_args!(
            "subaperture on {}, {} resets",
            Current::NAME,
            fault::resets()
        ));
        let mut buffer = [0; 64];
        loop {
            // Bytes lost to an overrun cannot be echoed.
            let Ok(count) = board.link().read(&mut buffer) else {
                continue;
            };
            let mut rest = buffer.get(..count).unwrap_or_default();
            while !rest.is_empty() {
                let sent = board.link().write(rest).unwrap_or(rest.len());
                rest = rest.get(sent..).unwrap_or_default();
            }
        }
    }
}

#[cfg(not(target_os = "none"))]
fn main() {
    println!("this program runs on a board only");
}
