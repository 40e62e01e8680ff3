//! Main loop of the application: an endpoint on a board's serial link.

use embedded_hal::digital::OutputPin;
use embedded_io::{Read, ReadReady, Write, WriteReady};

use crate::board::Board;
use crate::endpoint::Endpoint;
use crate::engine::WireEngine;
use crate::memory;
use subaperture_core::link::{Event, State};

/// Maximum number of reads between two writes, so that neither direction starves.
const READS: usize = 16;

/// Serve the link forever. Each iteration reads what was received, writes what the line accepts, and does one processing
/// step, so none of the three blocks another. The watchdog is fed once per iteration and detects a hang. The light is on
/// while there is work.
pub fn serve<B: Board, E: WireEngine>(mut board: B, mut endpoint: Endpoint<'_, E>) -> ! {
    let mut bytes = [0; 64];
    let (mut was, mut lit, mut run_ticks) = (State::Idle, false, 0u64);
    loop {
        board.feed_watchdog();
        for _ in 0..READS {
            let Ok(true) = board.link().read_ready() else {
                break;
            };
            // Bytes lost to an overrun are detected by the frame's checksum.
            if let Ok(count) = board.link().read(&mut bytes) {
                endpoint.receive(bytes.get(..count).unwrap_or(&[]));
            }
        }
        let pending = endpoint.pending();
        if !pending.is_empty()
            && let Ok(true) = board.link().write_ready()
        {
            // If the line rejects bytes, the rest of the frame is lost; the host detects it.
            let sent = board.link().write(pending).unwrap_or(pending.len());
            endpoint.sent(sent);
        }
        let before = board.ticks();
        let busy = endpoint.work();
        let ticks = board.ticks().wrapping_sub(before);
        if busy {
            run_ticks = run_ticks.saturating_add(ticks.into());
        }
        if let Some(most_us) = B::MAX_STEP_US {
            let taken_us = ticks.checked_div(B::TICKS_HZ / 1_000_000).unwrap_or(0);
            if taken_us > most_us {
                endpoint.record(Event::StepTooLong { taken_us, most_us });
            }
        }
        if busy != lit {
            lit = busy;
            // A light that cannot be switched is not a reason to stop.
            let _ = board.light().set_state(busy.into());
        }
        let state = endpoint.state();
        if state != was && state == State::Done {
            endpoint.record(Event::RunCost {
                stack_bytes: memory::stack_high_water_bytes() as u32,
                stack_size_bytes: memory::stack_bytes() as u32,
                kiloticks: u32::try_from(run_ticks / 1000).unwrap_or(u32::MAX),
                ticks_hz: B::TICKS_HZ,
            });
            run_ticks = 0;
        }
        was = state;
    }
}
