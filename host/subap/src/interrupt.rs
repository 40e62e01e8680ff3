//! Handling of Ctrl-C, SIGTERM and SIGHUP: the first signal ends work cleanly, the second at once.
//!
//! Long work polls [`pressed`] and stops by itself. Work that cannot poll, such as a read from a silent pipe, is ended after
//! [`PATIENCE`]. Files are renamed into place only when complete, and incomplete ones are removed, so no partial output remains.
//! Work that saves partial results announces this with [`Keeping`].

use std::process::exit;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;
use std::time::Duration;

use subaperture::io::unfinished;

use crate::failure::{INTERRUPTED, Interrupted};
use crate::messages;

/// Time that work may take to stop by itself.
const PATIENCE: Duration = Duration::from_millis(700);

static PRESSED: AtomicBool = AtomicBool::new(false);
static KEEPERS: AtomicUsize = AtomicUsize::new(0);

/// Install the signal handlers.
pub(crate) fn listen() {
    let listening = ctrlc::set_handler(|| {
        if PRESSED.swap(true, Ordering::SeqCst) {
            unfinished::remove_all();
            exit(INTERRUPTED.into());
        }
        // Without this thread, work stops by itself or at the second signal.
        let _ = thread::Builder::new().spawn(second_signal_ends_the_process);
    });
    if let Err(error) = listening {
        // The default handling of signals remains in effect.
        messages::warning(format!("Ctrl-C will end the program at once: {error}"));
    }
}

/// Wait for the work to stop, then end the process.
fn second_signal_ends_the_process() {
    thread::sleep(PATIENCE);
    while KEEPERS.load(Ordering::SeqCst) > 0 {
        thread::sleep(PATIENCE / 10);
    }
    unfinished::remove_all();
    messages::error("interrupted; finished files are complete, others were not written");
    messages::end(INTERRUPTED);
    exit(INTERRUPTED.into());
}

/// Whether a signal was received.
pub(crate) fn pressed() -> bool {
    PRESSED.load(Ordering::SeqCst)
}

/// Flag set by a signal, for code that polls it directly.
pub(crate) fn flag() -> &'static AtomicBool {
    &PRESSED
}

/// Fail if a signal was received.
pub(crate) fn check() -> Result<(), Interrupted> {
    if pressed() { Err(Interrupted) } else { Ok(()) }
}

/// While a value of this type exists, the first signal does not end the process because partial results are being saved. The holder polls
/// [`pressed`] frequently.
pub(crate) struct Keeping(());

impl Keeping {
    /// Announce that partial results will be saved.
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
