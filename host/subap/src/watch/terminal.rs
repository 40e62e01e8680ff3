//! Terminal view of a capture: redrawn in place on a terminal, otherwise occasional lines.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use console::Term;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use subaperture::monitor::Monitor;
use subaperture::radio::live::{LiveState, Status};

use super::frame::{frame, line};
use crate::config::Session;
use crate::messages;

/// How often it is drawn.
const FRAME: Duration = Duration::from_millis(200);

/// Shows the board until the capture has ended.
pub(super) fn show(session: &Session, board: &LiveState, in_place: bool, ended: &AtomicBool) {
    let terminal = Term::stderr();
    match in_place && session.tells() && terminal.is_term() {
        true => draw(board, &terminal, ended),
        false => tell(session, board, ended),
    }
}

/// Waits for a change; false once the capture has ended.
fn changed(board: &LiveState, seen: &mut u64, ended: &AtomicBool) -> bool {
    while !ended.load(Ordering::Relaxed) {
        let revision = board.revision();
        if revision != *seen {
            *seen = revision;
            return true;
        }
        thread::sleep(FRAME / 4);
    }
    false
}

/// In place, by the bar's own means: messages go above it.
fn draw(board: &LiveState, terminal: &Term, ended: &AtomicBool) {
    let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
    if let Ok(style) = ProgressStyle::with_template("{msg}") {
        bar.set_style(style);
    }
    messages::show_bar(Some(bar.downgrade()));
    let mut seen = 0;
    while changed(board, &mut seen, ended) {
        let (rows, columns) = terminal.size();
        let (status, _) = board.status();
        let row = board.latest_row();
        let lines = frame(&status, row.as_deref(), columns.into(), rows.into());
        bar.set_message(lines.join("\n"));
        bar.tick();
        thread::sleep(FRAME);
    }
    // The last stays on the screen.
    bar.abandon();
    messages::show_bar(None);
}

/// As other long work is told.
fn tell(session: &Session, board: &LiveState, ended: &AtomicBool) {
    let progress = session.progress("capturing");
    let mut seen = 0;
    while changed(board, &mut seen, ended) {
        let (status, _) = board.status();
        progress.tell(line(&status, board.latest_row().as_deref()));
        if let Some(done) = done(&status) {
            progress.progress(done);
        }
        thread::sleep(FRAME);
    }
}

/// Part of the sweeps that are taken, where their number is known.
fn done(status: &Status) -> Option<f64> {
    let taken = status.sweep? + 1;
    (status.sweeps > 0).then(|| taken as f64 / status.sweeps as f64)
}
