//! A capture as it runs, for those who look: the latest range profile, those before it, levels, what went wrong, the room left.
//!
//! ```text
//! capture ── LiveStep (try, never waits) ──> Follower (a thread) ── a sweep at a time ──> Board <── Status, rows ── terminal, web page
//!                                               └── LiveSweep ──> whoever forms an image of it
//! ```
//!
//! A sweep's profile is that of its recording: what [`crate::profile`] leaves out of one is left out here, filled by the same rule, transformed by
//! the same sum; to the bit, as `tests/live.rs` has it. For the waterfall it is reduced to [`View::columns`] places, each the
//! largest magnitude that it stands for, so that no peak is lost between them.
//!
//! A sweep ends with its last step, or with the first of a later one: steps that the channel had no room for are missing from it like
//! steps that were lost. With less than two of three there is no profile, and the waterfall has an empty row.
//!
//! Levels are of full scale: the RMS of a tone that fills the converter is 1 (0 dBFS), the peak is the largest I or Q. Samples that did not come are none.
//!
//! **Memory**: the board's rows, [`View::rows`] times [`View::columns`] times 4 bytes, a sweep, and a picture of at most
//! [`MOST_PIXELS`]; nothing grows with a capture's length. **Cost** in the capture: a pass over the samples of each burst, and a message of
//! some 300 bytes, and that only while somebody follows; in the follower a profile a sweep. Who looks copies under a lock that the follower takes once a
//! sweep and the capture never.

mod board;
mod follow;
mod level;
mod picture;
mod step;

pub use board::{Board, Row, Status};
pub use follow::{Follower, LiveSweep, View};
pub use level::Level;
pub use picture::{MOST_PIXELS, Picture};
pub use step::{Counts, LiveStep};
