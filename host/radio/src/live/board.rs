//! Shared state of a running capture, for any number of viewers.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::level::Level;
use super::picture::Picture;
use super::step::Counts;

/// State of a capture after its latest sweep.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Status {
    /// Name of the capture.
    pub name: String,
    /// Number of carriers per sweep.
    pub steps: usize,
    /// Planned number of sweeps; 0 runs until stopped.
    pub sweeps: u64,
    /// Index of the latest sweep; `None` before the first.
    pub sweep: Option<u64>,
    /// Number of usable carriers of the latest sweep.
    pub usable: usize,
    /// Steps of the latest sweep flagged late, with lost samples, unsteady, clipped, unlocked.
    pub flagged: [usize; 5],
    /// Levels of reference and echo in the latest sweep.
    pub levels: [Level; 2],
    /// Sweeps per second of device time, averaged over the last sweeps; `None` before the second.
    pub rate_hz: Option<f64>,
    /// Counters since the start of the capture.
    pub counts: Counts,
    /// Free bytes on the recording's disk; `None` if unknown.
    pub free_bytes: Option<u64>,
    /// Seconds until the disk is full, at the plan's data rate; `None` if unknown.
    pub disk_lasts_s: Option<f64>,
    /// Ranges of the first and last columns of a row, metres.
    pub ranges_m: [f64; 2],
    /// Whether levels are relative to a calibration's reflector; otherwise they are relative to the reference.
    pub calibrated: bool,
    /// Reason why the capture ended; `None` while it runs.
    pub ended: Option<String>,
}

/// Waterfall row: range profile of one sweep at display resolution.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Index of the sweep.
    pub sweep: u64,
    /// Level of each column, dB; empty if too few carriers were received.
    pub levels_db: Vec<f32>,
}

struct State {
    status: Status,
    rows: VecDeque<Arc<Row>>,
    picture: Option<Arc<Picture>>,
    /// Increases with each change.
    revision: u64,
    /// Revision at which the picture was last replaced.
    picture_revision: u64,
}

/// Shared state of a capture. Readers wait only while another thread copies or updates the state.
pub struct LiveState {
    most_rows: usize,
    state: Mutex<State>,
}

impl LiveState {
    /// Make a board with room for `most_rows` rows (at least one), before the first sweep.
    pub fn new(status: Status, most_rows: usize) -> Self {
        Self {
            most_rows: most_rows.max(1),
            state: Mutex::new(State {
                status,
                rows: VecDeque::new(),
                picture: None,
                revision: 1,
                picture_revision: 0,
            }),
        }
    }

    /// A panic in another thread leaves the state valid: each value is replaced as a whole.
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Revision number; changes with each update.
    pub fn revision(&self) -> u64 {
        self.lock().revision
    }

    /// Status and its revision.
    pub fn status(&self) -> (Status, u64) {
        let state = self.lock();
        (state.status.clone(), state.revision)
    }

    /// Maximum number of rows kept.
    pub fn most_rows(&self) -> usize {
        self.most_rows
    }

    /// Rows of sweeps after `sweep`, or all rows if `None`; oldest first.
    pub fn rows_after(&self, sweep: Option<u64>) -> Vec<Arc<Row>> {
        let state = self.lock();
        let newer = |row: &&Arc<Row>| sweep.is_none_or(|sweep| row.sweep > sweep);
        state.rows.iter().filter(newer).cloned().collect()
    }

    /// Latest row that contains a profile.
    pub fn latest_row(&self) -> Option<Arc<Row>> {
        let state = self.lock();
        let full = |row: &&Arc<Row>| !row.levels_db.is_empty();
        state.rows.iter().rev().find(full).cloned()
    }

    /// Latest image and its revision; revision 0 if there is no image.
    pub fn picture(&self) -> (Option<Arc<Picture>>, u64) {
        let state = self.lock();
        (state.picture.clone(), state.picture_revision)
    }

    /// Publish an image. An invalid one ([`Picture::is_whole`]) is ignored.
    pub fn show_picture(&self, picture: Picture) {
        if !picture.is_whole() {
            return;
        }
        let picture = Arc::new(picture);
        let mut state = self.lock();
        state.revision += 1;
        state.picture_revision = state.revision;
        state.picture = Some(picture);
    }

    /// Publish the reason why the capture ended.
    pub fn end(&self, why: &str) {
        let mut state = self.lock();
        state.status.ended = Some(why.to_owned());
        state.revision += 1;
    }

    /// Publish a sweep: update the status and append its row.
    pub(super) fn show_sweep(&self, change: impl FnOnce(&mut Status), row: Row) {
        let row = Arc::new(row);
        let mut state = self.lock();
        change(&mut state.status);
        if state.rows.len() == self.most_rows {
            state.rows.pop_front();
        }
        state.rows.push_back(row);
        state.revision += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(sweep: u64) -> Row {
        Row {
            sweep,
            levels_db: vec![sweep as f32],
        }
    }

    #[test]
    fn board_keeps_newest_rows_and_returns_only_those_after_a_sweep() {
        let board = LiveState::new(Status::default(), 3);
        for sweep in 0..5 {
            board.show_sweep(|status| status.sweep = Some(sweep), row(sweep));
        }
        let sweeps = |after| -> Vec<u64> {
            board
                .rows_after(after)
                .iter()
                .map(|row| row.sweep)
                .collect()
        };
        assert_eq!(sweeps(None), [2, 3, 4]);
        assert_eq!(sweeps(Some(3)), [4]);
        assert_eq!(sweeps(Some(4)), [] as [u64; 0]);
        assert_eq!(
            board.status(),
            (
                Status {
                    sweep: Some(4),
                    ..Status::default()
                },
                6
            )
        );
    }

    #[test]
    fn oversized_or_ragged_picture_is_ignored() {
        let board = LiveState::new(Status::default(), 1);
        let picture = |columns, count| Picture {
            columns,
            x_m: [0.0, 1.0],
            y_m: [0.0, 1.0],
            levels_db: vec![-3.0; count],
            pulses: 1,
        };
        for bad in [
            picture(0, 0),
            picture(3, 7),
            picture(1024, MAX_PIXELS_AND_A_ROW),
        ] {
            board.show_picture(bad);
            assert_eq!(board.picture(), (None, 0));
        }
        board.show_picture(picture(2, 6));
        let (shown, revision) = board.picture();
        assert_eq!((shown.unwrap().rows(), revision), (3, 2));
    }

    const MAX_PIXELS_AND_A_ROW: usize = super::super::MAX_PIXELS + 1024;
}
