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
        // Without a thread for it work has to come to its own end, or the second signal ends it.
        let _ = thread::Builder::new().spawn(second_signal_ends_the_process);
    });
    if let Err(error) = listening {
        // Work goes on; the system's own way of ending it stays.
        messages::warning(format!("Ctrl-C will end work at once: {error}"));
    }
}

/// Waits for the work to end, and ends it.
fn second_signal_ends_the_process() {
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
