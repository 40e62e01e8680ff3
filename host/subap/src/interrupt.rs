//! Ctrl-C, and the signals TERM and HUP: the first ends work cleanly, the second at once.
//!
//! Long work asks [`pressed`] and comes to its own end. What does not ask, such as a read from a pipe that
//! nobody writes to, is ended after [`PATIENCE`]: files appear under their names only when they are whole, and what
//! is not is removed before, so that nothing is left in part then either. Who keeps what has come so far says so with [`Keeping`].

use std::process::exit;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;
use std::time::Duration;

use subaperture::io::unfinished;

use crate::failure::{INTERRUPTED, Interrupted};
use crate::messages;

/// How long work may take to end by itself.
const PATIENCE: Duration = Duration::from_millis(700);

static PRESSED: AtomicBool = AtomicBool::new(false);
static KEEPERS: AtomicUsize = AtomicUsize::new(0);

/// Listens for the signals.
pub(crate) fn listen() {
    let listening = ctrlc::set_handler(|| {
        if PRESSED.swap(true, Ordering::SeqCst) {
            unfinished::remove_all();
            exit(INTERRUPTED.into());
        }
        thread::spawn(end_what_does_not_end);
    });
    if let Err(error) = listening {
        // Work goes on; the system's own way of ending it stays.
        messages::warning(format!("Ctrl-C will end work at once: {error}"));
    }
}

/// Waits for the work to end, and ends it.
fn end_what_does_not_end() {
    thread::sleep(PATIENCE);
    while KEEPERS.load(Ordering::SeqCst) > 0 {
        thread::sleep(PATIENCE / 10);
    }
    unfinished::remove_all();
    messages::error("interrupted; what was written is whole, and the rest is not there");
    messages::end(INTERRUPTED);
    exit(INTERRUPTED.into());
}

/// Whether a signal came.
pub(crate) fn pressed() -> bool {
    PRESSED.load(Ordering::SeqCst)
}

/// What a signal sets, for work that looks at it by itself.
pub(crate) fn flag() -> &'static AtomicBool {
    &PRESSED
}

/// Fails if a signal came.
pub(crate) fn check() -> Result<(), Interrupted> {
    if pressed() { Err(Interrupted) } else { Ok(()) }
}

/// While one lives, the first signal does not end the process: what has come is being kept. Its holder asks
/// [`pressed`] often.
pub(crate) struct Keeping(());

impl Keeping {
    /// From now on.
    pub(crate) fn begin() -> Self {
        KEEPERS.fetch_add(1, Ordering::SeqCst);
        Self(())
    }
}

impl Drop for Keeping {
    fn drop(&mut self) {
        KEEPERS.fetch_sub(1, Ordering::SeqCst);
    }
}
