//! Text output to the emulator's standard output, for self-tests. The `hprintln` of cortex-m-semihosting borrows a
//! `RefCell`, whose panic the linker cannot rule out.

use core::fmt::{self, Write};
use core::sync::atomic::{AtomicUsize, Ordering};

use cortex_m_semihosting::{nr, syscall};

/// Console handle; 0 before it was opened. The emulator's handles start at 1.
static CONSOLE: AtomicUsize = AtomicUsize::new(0);

struct Console(usize);

impl Write for Console {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let mut rest = text.as_bytes();
        while !rest.is_empty() {
            // SAFETY: the call reads exactly the bytes of `rest`; it returns the number of bytes not written.
            let left = unsafe { syscall!(WRITE, self.0, rest.as_ptr(), rest.len()) };
            if left >= rest.len() {
                return Err(fmt::Error);
            }
            rest = rest.get(rest.len() - left..).unwrap_or_default();
        }
        Ok(())
    }
}

/// Write a line. Discarded if the emulator does not accept it.
pub(super) fn line(message: fmt::Arguments<'_>) {
    let mut handle = CONSOLE.load(Ordering::Relaxed);
    if handle == 0 {
        let name = c":tt".to_bytes_with_nul();
        // SAFETY: the call reads the zero-terminated name, and its length without the terminator.
        handle = unsafe { syscall!(OPEN, name.as_ptr(), nr::open::W_TRUNC, name.len() - 1) };
        if handle == usize::MAX {
            return;
        }
        CONSOLE.store(handle, Ordering::Relaxed);
    }
    let mut console = Console(handle);
    let _ = console.write_fmt(message);
    let _ = console.write_str("\n");
}
