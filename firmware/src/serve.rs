//! The loop of the application: a station on a board's serial link.

use embedded_hal::digital::OutputPin;
use embedded_io::{Read, ReadReady, Write, WriteReady};

use crate::board::Board;
use crate::engine::WireEngine;
use crate::memory;
use crate::station::Station;
use subaperture_core::link::State;

/// Reads of the link between two writes, at most, so that neither waits for the other.
const READS: usize = 16;

/// Serves the link for good. Every turn reads what has come, writes what the line takes, and does one
/// piece of work, so that none of the three waits for another; a program that hangs is found by the
/// watchdog, which is fed once a turn. The light is on while there is work.
pub fn serve<B: Board, E: WireEngine>(mut board: B, mut station: Station<'_, E>) -> ! {
    let mut bytes = [0; 64];
    let (mut was, mut lit) = (State::Idle, false);
    loop {
        board.feed_watchdog();
        for _ in 0..READS {
            let Ok(true) = board.link().read_ready() else {
                break;
            };
            // What an overrun loses is found by the frame's checksum.
            if let Ok(count) = board.link().read(&mut bytes) {
                station.receive(bytes.get(..count).unwrap_or(&[]));
            }
        }
        let pending = station.pending();
        if !pending.is_empty()
            && let Ok(true) = board.link().write_ready()
        {
            // A line that refuses bytes loses the frame's rest; the host finds that out.
            let sent = board.link().write(pending).unwrap_or(pending.len());
            station.sent(sent);
        }
        let busy = station.work();
        if busy != lit {
            lit = busy;
            // A light that cannot be switched is no reason to stop.
            let _ = board.light().set_state(busy.into());
        }
        let state = station.state();
        if state != was && state == State::Done {
            board.log(format_args!(
                "run done, {} of {} bytes of stack used",
                memory::stack_high_water_bytes(),
                memory::stack_bytes()
            ));
        }
        was = state;
    }
}
