//! Live view of a running capture: latest range profile, waterfall, levels, fault counters, free disk space.
//!
//! ```text
//! capture ── LiveStep (a real radio never waits) ──> Follower (a thread) ── per sweep ──> Board <── Status, rows ── terminal, web page
//!                                               └── LiveSweep ──> image formation
//! ```
//!
//! The profile of a live sweep is bit-identical to that of the recorded sweep (`tests/live.rs`): the rules of
//! [`crate::profile`] for skipped and interpolated carriers and its transform are shared. The waterfall reduces a
//! profile to [`View::columns`] columns, each the largest magnitude of its samples, so that no peak is lost.
//!
//! A burst of chirps is a sweep: the capture gives [`LiveBurst`], which [`BurstView`] puts on the board in the same thread, between bursts.
//!
//! A sweep ends with its last step, or with the first step of a later sweep. Steps dropped by a full queue are missing,
//! like lost steps. A sweep with less than two thirds of its carriers has no profile, and its waterfall row is empty.
//!
//! Levels are relative to full scale: a full-scale tone has an RMS of 1 (0 dBFS), and the peak is the largest I or Q.
//! Lost samples are ignored.
//!
//! **Memory**: the board's rows ([`View::rows`] times [`View::columns`] times 4 bytes), one sweep, and a picture of at
//! most [`MAX_PIXELS`]; it does not grow with time. **Cost** in the capture, only while a viewer is attached: one pass
//! over the samples of each burst and a message of some 300 bytes. The follower computes one profile per sweep. Viewers
//! copy the state under a lock that the follower takes once per sweep and the capture never takes.

mod board;
mod bursts;
mod display;
mod follow;
mod level;
mod picture;
mod step;

pub use board::{LiveState, Row, Status};
pub use bursts::{BurstView, LiveBurst};
pub use display::{LiveSweep, View};
pub use follow::SweepAssembler;
pub use level::Level;
pub use picture::{MAX_PIXELS, Picture};
pub use step::{Counts, LiveStep};
