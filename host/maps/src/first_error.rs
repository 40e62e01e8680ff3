//! Writer below an encoder that loses the causes of errors, or panics after one.

use std::cell::{Cell, RefCell};
use std::io::{self, Seek, SeekFrom, Write};
use std::rc::Rc;

/// Writer that keeps the first error of the writer below. After it, no more is written and all calls succeed.
pub(crate) struct FirstError<W> {
    out: W,
    error: KeptError,
    /// Position after the calls so far, as if all had been written.
    position: u64,
    end: u64,
}

/// First error, shared with the owner of the writer.
#[derive(Clone, Default)]
pub(crate) struct KeptError(Rc<Kept>);

#[derive(Default)]
struct Kept {
    failed: Cell<bool>,
    error: RefCell<Option<io::Error>>,
}

impl KeptError {
    /// Return the error, if any, once.
    pub(crate) fn check(&self) -> io::Result<()> {
        self.0.error.borrow_mut().take().map_or(Ok(()), Err)
    }

    /// Make a call, unless an earlier one failed.
    fn keep(&self, call: impl FnOnce() -> io::Result<()>) {
        if self.0.failed.get() {
            return;
        }
        if let Err(error) = call() {
            self.0.failed.set(true);
            self.0.error.replace(Some(error));
        }
    }
}

impl<W> FirstError<W> {
    /// Over a writer at its start.
    pub(crate) fn new(out: W) -> Self {
        Self {
            out,
            error: KeptError::default(),
            position: 0,
            end: 0,
        }
    }

    pub(crate) fn error(&self) -> KeptError {
        self.error.clone()
    }
}

impl<W: Write> Write for FirstError<W> {
    fn write(&mut self, data: &[u8]) -> io::Result<usize> {
        self.error.keep(|| self.out.write_all(data));
        self.position += data.len() as u64;
        self.end = self.end.max(self.position);
        Ok(data.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.error.keep(|| self.out.flush());
        Ok(())
    }
}

impl<W: Seek> Seek for FirstError<W> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let at = match to {
            SeekFrom::Start(at) => Some(at),
            SeekFrom::Current(by) => self.position.checked_add_signed(by),
            SeekFrom::End(by) => self.end.checked_add_signed(by),
        };
        let at = at.ok_or(io::ErrorKind::InvalidInput)?;
        self.error
            .keep(|| self.out.seek(SeekFrom::Start(at)).map(drop));
        self.position = at;
        Ok(at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A disk of four bytes.
    struct Full(Vec<u8>);

    impl Write for Full {
        fn write(&mut self, data: &[u8]) -> io::Result<usize> {
            match 4 - self.0.len() {
                0 => Err(io::ErrorKind::StorageFull.into()),
                room => {
                    let taken = room.min(data.len());
                    self.0.extend_from_slice(&data[..taken]);
                    Ok(taken)
                }
            }
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    impl Seek for Full {
        fn seek(&mut self, _: SeekFrom) -> io::Result<u64> {
            panic!("no seek after an error")
        }
    }

    #[test]
    fn first_error_is_kept_with_its_kind_and_later_calls_succeed() {
        let mut out = FirstError::new(Full(Vec::new()));
        let error = out.error();
        out.write_all(b"abc").unwrap();
        error.check().unwrap();
        out.write_all(b"def").unwrap();
        out.write_all(b"gh").unwrap();
        assert_eq!(out.stream_position().unwrap(), 8);
        assert_eq!(out.seek(SeekFrom::End(-1)).unwrap(), 7);
        out.flush().unwrap();
        assert_eq!(out.out.0, b"abcd");
        assert_eq!(
            error.check().unwrap_err().kind(),
            io::ErrorKind::StorageFull
        );
        // Nor is anything written once the error was asked for.
        out.seek(SeekFrom::Start(0)).unwrap();
        out.write_all(b"i").unwrap();
        error.check().unwrap();
    }
}
