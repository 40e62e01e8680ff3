//! Where a capture's state hangs, and whoever likes looks at it.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::level::Level;
use super::picture::Picture;
use super::step::Counts;

/// How a capture stands after its latest sweep.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Status {
    /// The capture's name.
    pub name: String,
    /// Carriers a sweep.
    pub steps: usize,
    /// Sweeps planned; 0 for as many as there is time.
    pub sweeps: u64,
    /// Index of the latest sweep; `None` before the first.
    pub sweep: Option<u64>,
    /// Carriers of it that are of use.
    pub usable: usize,
    /// Of it late, with lost samples, unsteady, clipped, unlocked.
    pub flagged: [usize; 5],
    /// Of it, reference and echo.
    pub levels: [Level; 2],
    /// Sweeps a second of the device's time, over the last ones; `None` before the second.
    pub rate_hz: Option<f64>,
    /// Since the capture began.
    pub counts: Counts,
    /// Bytes free on the recording's disk; `None` where nobody can tell.
    pub free_bytes: Option<u64>,
    /// Seconds until they are used up, at the plan's rate.
    pub disk_lasts_s: Option<f64>,
    /// Ranges of a row's first place and of its last, metres.
    pub ranges_m: [f64; 2],
    /// Whether levels are relative to a calibration's reflector; otherwise to the reference.
    pub calibrated: bool,
    /// Why it ended; `None` while it runs.
    pub ended: Option<String>,
}

/// The range profile of a sweep, reduced.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// The sweep's index.
    pub sweep: u64,
    /// Level at each place, dB; empty if too little of the sweep came.
    pub levels_db: Vec<f32>,
}

struct State {
    status: Status,
    rows: VecDeque<Arc<Row>>,
    picture: Option<Arc<Picture>>,
    /// Grows with each change.
    revision: u64,
    /// Of the picture.
    picture_revision: u64,
}

/// A capture's state. Whoever looks waits for nobody but another that copies it.
pub struct Board {
    most_rows: usize,
    state: Mutex<State>,
}

impl Board {
    /// With room for some rows, before the first sweep.
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

    /// A panic elsewhere leaves whole values: each is replaced at once.
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A number that is another after each change.
    pub fn revision(&self) -> u64 {
        self.lock().revision
    }

    /// The state, and its revision.
    pub fn status(&self) -> (Status, u64) {
        let state = self.lock();
        (state.status.clone(), state.revision)
    }

    /// Rows that it keeps at most.
    pub fn most_rows(&self) -> usize {
        self.most_rows
    }

    /// The rows kept of sweeps after `sweep`, all without, oldest first.
    pub fn rows_after(&self, sweep: Option<u64>) -> Vec<Arc<Row>> {
        let state = self.lock();
        let newer = |row: &&Arc<Row>| sweep.is_none_or(|sweep| row.sweep > sweep);
        state.rows.iter().filter(newer).cloned().collect()
    }

    /// The latest row that holds a profile.
    pub fn latest_row(&self) -> Option<Arc<Row>> {
        let state = self.lock();
        let full = |row: &&Arc<Row>| !row.levels_db.is_empty();
        state.rows.iter().rev().find(full).cloned()
    }

    /// The image as it was put up last, and its revision; 0 is none.
    pub fn picture(&self) -> (Option<Arc<Picture>>, u64) {
        let state = self.lock();
        (state.picture.clone(), state.picture_revision)
    }

    /// Puts up an image. One that is not whole ([`Picture::is_whole`]) is left out.
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

    /// Says why the capture ended.
    pub fn end(&self, why: &str) {
        let mut state = self.lock();
        state.status.ended = Some(why.to_owned());
        state.revision += 1;
    }

    /// Puts up a sweep.
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
    fn rows_are_bounded_and_told_once() {
        let board = Board::new(Status::default(), 3);
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
    fn a_picture_that_is_too_large_or_ragged_is_left_out() {
        let board = Board::new(Status::default(), 1);
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
            picture(1024, MOST_PIXELS_AND_A_ROW),
        ] {
            board.show_picture(bad);
            assert_eq!(board.picture(), (None, 0));
        }
        board.show_picture(picture(2, 6));
        let (shown, revision) = board.picture();
        assert_eq!((shown.unwrap().rows(), revision), (3, 2));
    }

    const MOST_PIXELS_AND_A_ROW: usize = super::super::MOST_PIXELS + 1024;
}
