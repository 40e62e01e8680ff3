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

/// Time between two frames.
const FRAME: Duration = Duration::from_millis(200);

/// Show the state until the capture has ended.
pub(super) fn show(session: &Session, board: &LiveState, in_place: bool, ended: &AtomicBool) {
    let terminal = Term::stderr();
    match in_place && session.shows_progress() && terminal.is_term() {
        true => draw(board, &terminal, ended),
        false => show_lines(session, board, ended),
    }
}

/// Wait for a change. Returns false when the capture has ended.
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

/// Redraw in place with the means of the progress bar: messages appear above.
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
    // The last frame stays on the screen.
    bar.abandon();
    messages::show_bar(None);
}

/// Show as progress lines like other long work.
fn show_lines(session: &Session, board: &LiveState, ended: &AtomicBool) {
    let progress = session.progress("capturing");
    let mut seen = 0;
    while changed(board, &mut seen, ended) {
        let (status, _) = board.status();
        progress.set_label(line(&status, board.latest_row().as_deref()));
        if let Some(done) = done(&status) {
            progress.progress(done);
        }
        thread::sleep(FRAME);
    }
}

/// Fraction of the sweeps captured, if their number is given.
fn done(status: &Status) -> Option<f64> {
    let taken = status.sweep? + 1;
    (status.sweeps > 0).then(|| taken as f64 / status.sweeps as f64)
}
