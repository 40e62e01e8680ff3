//! Ctrl-C: the first press ends work cleanly, the second at once.

use std::sync::atomic::{AtomicBool, Ordering};

use crate::failure::Interrupted;

static PRESSED: AtomicBool = AtomicBool::new(false);

/// Listens for Ctrl-C (and the signals TERM and HUP, which end work alike).
pub(crate) fn listen() {
    let listening = ctrlc::set_handler(|| {
        if PRESSED.swap(true, Ordering::SeqCst) {
            std::process::exit(130);
        }
    });
    if let Err(error) = listening {
        // Work goes on; the system's own way of ending it stays.
        eprintln!("subap: Ctrl-C will end work at once: {error}");
    }
}

/// Whether Ctrl-C was pressed.
pub(crate) fn pressed() -> bool {
    PRESSED.load(Ordering::SeqCst)
}

/// Fails if Ctrl-C was pressed.
pub(crate) fn check() -> Result<(), Interrupted> {
    if pressed() { Err(Interrupted) } else { Ok(()) }
}
