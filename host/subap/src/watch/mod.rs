//! Live display of a running capture: in the terminal, in a browser, and as an image.
//!
//! ```text
//! capture ── LiveStep (try) ──> follower: sweeps, the board ── LiveSweep (try) ──> imaging: a push a sweep, a picture twice a second
//!                                          board <── the terminal, five times a second; the page
//! ```
//!
//! Each consumer has its own thread behind a bounded queue that never blocks the capture. A slow consumer misses sweeps, which are counted;
//! the capture is not affected.

mod frame;
#[cfg(feature = "page")]
mod page;
mod terminal;

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::Context;
use subaperture::live_capture::Imaging;
use subaperture::radio::Transceiver;
use subaperture::radio::capture::{EndReason, Queues, Summary, capture_ready, prepare};
use subaperture::radio::chirp::{self, ChirpSummary};
use subaperture::radio::experiment::{ChirpExperiment, Experiment};
use subaperture::radio::live::{
    BurstView, LiveBurst, LiveState, LiveStep, LiveSweep, SweepAssembler, View,
};
use subaperture::radio::plan::Plan;
use subaperture::radio::profile::{Calibration, Options};
use subaperture::radio::sigmf::Setup;

use crate::args::Watching;
use crate::config::Session;
use crate::interrupt;

/// Time between two pictures of the image.
const PICTURE: Duration = Duration::from_millis(500);
/// Maximum number of steps queued for assembly to sweeps: 3 MB.
const STEPS: usize = 8192;
/// Maximum number of carriers in sweeps queued for imaging: 12 MB.
const CARRIERS: usize = 1 << 18;

/// Constructor of the imaging of a capture, called after the radio is configured.
pub(crate) type MakeImaging<'a> = &'a dyn Fn(&Setup, &SweepAssembler) -> anyhow::Result<Imaging>;

/// Result of a capture with its image.
pub(crate) struct Watched {
    pub(crate) summary: Summary,
    pub(crate) imaging: Option<Imaging>,
    /// Number of sweeps skipped because imaging was too slow.
    pub(crate) skipped: u64,
}

/// Run a capture with its display.
pub(crate) fn captured(
    session: &Session,
    radio: &mut dyn Transceiver,
    experiment: &Experiment,
    watching: &Watching,
    in_terminal: bool,
    out: &Path,
) -> anyhow::Result<Summary> {
    let watched = imaged(session, radio, experiment, watching, in_terminal, out, None)?;
    Ok(watched.summary)
}

/// Run a capture with its display, and with an image if `make` is given.
pub(crate) fn imaged(
    session: &Session,
    radio: &mut dyn Transceiver,
    experiment: &Experiment,
    watching: &Watching,
    in_terminal: bool,
    out: &Path,
    make: Option<MakeImaging>,
) -> anyhow::Result<Watched> {
    let plan = &experiment.plan;
    let ready = prepare(radio, plan)?;
    let (mut follower, board) = follower(radio, experiment, &ready.setup, out)?;
    let mut imaging = make.map(|make| make(&ready.setup, &follower)).transpose()?;
    let board = Arc::new(board);
    #[cfg(feature = "page")]
    let page = page::serve(watching, &board)?;
    #[cfg(not(feature = "page"))]
    let _ = watching;
    let _keeping = interrupt::Keeping::begin();
    let (live, steps) = sync_channel(STEPS);
    let (sweeps, to_image) = sync_channel((CARRIERS / plan.steps.max(1)).clamp(4, 256));
    let (ended, skipped) = (AtomicBool::new(false), AtomicU64::new(0));
    let summary = thread::scope(|scope| {
        let (board, skipped, imaging) = (&*board, &skipped, imaging.as_mut());
        let waits = radio.waits();
        // The terminal is restored whatever the outcome of the capture.
        let over = Over(&ended);
        let thread = || thread::Builder::new();
        thread()
            .spawn_scoped(scope, move || {
                follow(&mut follower, board, steps, waits, sweeps, skipped)
            })
            .context(NO_THREAD)?;
        let imaged = thread()
            .spawn_scoped(scope, move || image(imaging, board, to_image))
            .context(NO_THREAD)?;
        let shown = thread()
            .spawn_scoped(scope, || {
                terminal::show(session, board, in_terminal, &ended)
            })
            .context(NO_THREAD)?;
        let summary = capture_ready(
            radio,
            plan,
            ready,
            out,
            queues(session, plan),
            Some(&live),
            interrupt::flag(),
        );
        drop(live);
        let imaged = imaged.join();
        if let Ok(summary) = &summary {
            board.end(why(plan, summary));
        }
        drop(over);
        let _ = shown.join();
        if let Err(panic) = imaged {
            std::panic::resume_unwind(panic);
        }
        anyhow::Ok(summary?)
    })?;
    #[cfg(feature = "page")]
    drop(page);
    Ok(Watched {
        summary,
        imaging,
        skipped: skipped.into_inner(),
    })
}

const NO_THREAD: &str = "cannot start a thread to follow the capture; end other programs, or allow this one more threads";

/// Guard that sets the flag when dropped, also by a panic.
pub(crate) struct Over<'a>(pub(crate) &'a AtomicBool);

impl Drop for Over<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Release);
    }
}

/// Display options of a capture to `out`.
fn view(calibration: Option<&Path>, out: &Path) -> anyhow::Result<View> {
    Ok(View {
        profile: Options {
            calibration: calibration.map(Calibration::read).transpose()?,
            ..Options::default()
        },
        disk: Some(out.to_owned()),
        ..View::default()
    })
}

/// Run a capture of chirps with its display.
pub(crate) fn bursts(
    session: &Session,
    radio: &mut dyn Transceiver,
    experiment: &ChirpExperiment,
    watching: &Watching,
    in_terminal: bool,
    out: &Path,
) -> anyhow::Result<ChirpSummary> {
    let plan = &experiment.plan;
    let ready = chirp::prepare(radio, plan)?;
    let view = view(experiment.calibration.as_deref(), out)?;
    let (mut shown, board) = BurstView::new(&ready.setup, plan.bursts, view)?;
    let board = Arc::new(board);
    #[cfg(feature = "page")]
    let page = page::serve(watching, &board)?;
    #[cfg(not(feature = "page"))]
    let _ = watching;
    let _keeping = interrupt::Keeping::begin();
    let ended = AtomicBool::new(false);
    let summary = thread::scope(|scope| {
        let board = &*board;
        let over = Over(&ended);
        let terminal = thread::Builder::new()
            .spawn_scoped(scope, || {
                terminal::show(session, board, in_terminal, &ended)
            })
            .context(NO_THREAD)?;
        let mut emit = |burst: LiveBurst| {
            shown.take(board, burst);
        };
        let stop = interrupt::flag();
        let summary = chirp::capture_ready(radio, plan, ready, Some(out), &mut emit, stop);
        board.end(match &summary {
            Err(_) => "the radio or the disk failed",
            Ok(summary) if !summary.stopped => "all bursts captured",
            Ok(_) if plan.bursts == 0 => "stopped",
            Ok(_) => "stopped before the last burst",
        });
        drop(over);
        let _ = terminal.join();
        anyhow::Ok(summary?)
    })?;
    #[cfg(feature = "page")]
    drop(page);
    Ok(summary)
}

fn follower(
    radio: &dyn Transceiver,
    experiment: &Experiment,
    setup: &Setup,
    out: &Path,
) -> anyhow::Result<(SweepAssembler, LiveState)> {
    let view = view(experiment.calibration.as_deref(), out)?;
    let bytes = experiment.plan.bytes_a_second(&radio.about().ranges);
    Ok(SweepAssembler::new(&experiment.plan, setup, bytes, view)?)
}

fn why(plan: &Plan, summary: &Summary) -> &'static str {
    match &summary.ended {
        EndReason::Done => "all sweeps captured",
        EndReason::Stopped if plan.sweeps == 0 => "stopped",
        EndReason::Stopped => "stopped before the last sweep",
        EndReason::Radio(_) => "the radio failed",
        EndReason::Disk(_) => "the disk failed",
    }
}

/// Assemble steps to sweeps. If imaging is too slow, sweeps are skipped and counted unless the source can wait.
fn follow(
    follower: &mut SweepAssembler,
    board: &LiveState,
    steps: Receiver<LiveStep>,
    waits: bool,
    sweeps: SyncSender<LiveSweep>,
    skipped: &AtomicU64,
) {
    let hand_over = |sweep: LiveSweep| {
        let taken = match waits {
            true => sweeps.send(sweep).is_ok(),
            false => sweeps.try_send(sweep).is_ok(),
        };
        if !taken {
            skipped.fetch_add(1, Ordering::Relaxed);
        }
    };
    for step in steps {
        if let Some(sweep) = follower.take(board, &step) {
            hand_over(sweep);
        }
    }
    if let Some(sweep) = follower.end(board) {
        hand_over(sweep);
    }
}

/// Image sweeps; without imaging, drain the queue.
fn image(mut imaging: Option<&mut Imaging>, board: &LiveState, sweeps: Receiver<LiveSweep>) {
    let mut shown: Option<Instant> = None;
    for sweep in sweeps {
        let Some(imaging) = &mut imaging else {
            continue;
        };
        imaging.take(&sweep);
        if shown.is_none_or(|shown| shown.elapsed() >= PICTURE) {
            board.show_picture(imaging.picture());
            shown = Some(Instant::now());
        }
    }
    if let Some(imaging) = imaging {
        imaging.finish();
        if imaging.taken() > 0 {
            board.show_picture(imaging.picture());
        }
    }
}

/// Queue sizes of a capture: bursts waiting for the disk take half of the memory, at most 512 MiB.
pub(crate) fn queues(session: &Session, plan: &Plan) -> Queues {
    Queues::within(plan, (session.memory_bytes / 2).min(512 << 20))
}
