//! Blocks of a file at a URL, kept in memory.

use std::collections::VecDeque;
use std::io;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use super::{BLOCK_BYTES, FileState, KEPT_BLOCKS, RemoteFile, opened};
use subaperture_model::phase_history::{FileIdentity, InputFile, ReadError};

/// Open file at a URL with its kept blocks.
#[derive(Debug)]
pub(crate) struct Remote {
    file: Box<dyn RemoteFile>,
    opened: FileState,
    /// Blocks by number, the last used at the end.
    blocks: Mutex<VecDeque<(u64, Block)>>,
}

/// Content of a block; empty until it is read.
type Block = Arc<Mutex<Vec<u8>>>;

impl Remote {
    /// Open the file at a URL.
    ///
    /// # Errors
    /// [`io::ErrorKind::Unsupported`] without an opener; the opener's error.
    pub(crate) fn open(url: &str) -> io::Result<Self> {
        let file = opened(url)?;
        Ok(Self {
            opened: file.state()?,
            file,
            blocks: Mutex::default(),
        })
    }

    /// Size at opening, bytes.
    pub(crate) fn len(&self) -> u64 {
        self.opened.bytes
    }

    /// Memory of the kept blocks at most, bytes.
    pub(crate) fn held_bytes(&self) -> u64 {
        self.opened.bytes.min(BLOCK_BYTES * KEPT_BLOCKS as u64)
    }

    /// Compare the file with its state at opening; `path` is for errors.
    ///
    /// # Errors
    /// [`ReadError::Changed`]; [`ReadError::Io`].
    pub(crate) fn check_unchanged(&self, path: &Path) -> Result<(), ReadError> {
        let path = path.to_owned();
        let was = &self.opened;
        match self.file.state() {
            Ok(now) if now == *was => Ok(()),
            Ok(now) => Err(ReadError::Changed {
                path,
                how: format!(
                    "it had {} bytes and version {}, and has {} bytes and version {}",
                    was.bytes, was.version, now.bytes, now.version
                ),
            }),
            Err(source) => Err(ReadError::Io { path, source }),
        }
    }

    /// Path, size and version, unchanged since the file was opened.
    ///
    /// # Errors
    /// As [`Self::check_unchanged`].
    pub(crate) fn input(&self, path: &Path) -> Result<InputFile, ReadError> {
        self.check_unchanged(path)?;
        Ok(InputFile {
            path: path.to_owned(),
            bytes: self.opened.bytes,
            identity: FileIdentity::Version(self.opened.version.clone()),
        })
    }

    /// Fill `bytes` from `offset` on.
    ///
    /// # Errors
    /// As [`RemoteFile::read_at`].
    pub(crate) fn read_at(&self, offset: u64, bytes: &mut [u8]) -> io::Result<()> {
        let end = offset.checked_add(bytes.len() as u64);
        if end.is_none_or(|end| end > self.opened.bytes) {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        let (mut offset, mut left) = (offset, bytes);
        while !left.is_empty() {
            let within = (offset % BLOCK_BYTES) as usize;
            let count = left.len().min(BLOCK_BYTES as usize - within);
            let (part, rest) = left.split_at_mut(count);
            self.with_block(offset / BLOCK_BYTES, |block| {
                part.copy_from_slice(&block[within..within + count]);
            })?;
            (offset, left) = (offset + count as u64, rest);
        }
        Ok(())
    }

    /// Pass the content of a block to `take`. Other threads that need the same block wait while it is read.
    fn with_block(&self, number: u64, take: impl FnOnce(&[u8])) -> io::Result<()> {
        let block = self.block(number);
        // A block is filled after its read, so a panic of another thread leaves it empty.
        let mut held = block.lock().unwrap_or_else(PoisonError::into_inner);
        if held.is_empty() {
            let first = number * BLOCK_BYTES;
            let mut bytes = vec![0; (self.opened.bytes - first).min(BLOCK_BYTES) as usize];
            self.file.read_at(first, &mut bytes)?;
            *held = bytes;
        }
        take(&held);
        Ok(())
    }

    /// The kept block, or an empty one in place of the block unused for longest.
    fn block(&self, number: u64) -> Block {
        let mut blocks = self.blocks.lock().unwrap_or_else(PoisonError::into_inner);
        let kept = blocks.iter().position(|(of, _)| *of == number);
        let entry = match kept.and_then(|at| blocks.remove(at)) {
            Some(entry) => entry,
            None => {
                if blocks.len() == KEPT_BLOCKS {
                    blocks.pop_front();
                }
                (number, Block::default())
            }
        };
        let block = Arc::clone(&entry.1);
        blocks.push_back(entry);
        block
    }
}

#[cfg(feature = "hdf5")]
impl hdf5_pure::Source for Remote {
    fn len(&self) -> u64 {
        self.len()
    }

    fn read_at(&self, offset: u64, bytes: &mut [u8]) -> Result<(), hdf5_pure::FormatError> {
        self.read_at(offset, bytes)
            .map_err(|error| hdf5_pure::FormatError::Source(error.to_string()))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU64, Ordering};
    use std::thread;

    use super::*;

    /// File whose byte at `n` is `n / 1000 + n` modulo 251; it counts its requests.
    #[derive(Debug)]
    struct Computed {
        bytes: u64,
        requests: Arc<AtomicU64>,
    }

    fn byte(n: u64) -> u8 {
        ((n / 1000 + n) % 251) as u8
    }

    impl RemoteFile for Computed {
        fn state(&self) -> io::Result<FileState> {
            Ok(FileState {
                bytes: self.bytes,
                version: "1".to_owned(),
            })
        }

        fn read_at(&self, offset: u64, bytes: &mut [u8]) -> io::Result<()> {
            assert!(offset + bytes.len() as u64 <= self.bytes);
            self.requests.fetch_add(1, Ordering::Relaxed);
            for (n, value) in (offset..).zip(bytes) {
                *value = byte(n);
            }
            Ok(())
        }
    }

    fn remote(bytes: u64) -> (Remote, Arc<AtomicU64>) {
        let requests = Arc::new(AtomicU64::new(0));
        let file = Computed {
            bytes,
            requests: Arc::clone(&requests),
        };
        let opened = file.state().unwrap();
        let remote = Remote {
            file: Box::new(file),
            opened,
            blocks: Mutex::default(),
        };
        (remote, requests)
    }

    #[test]
    fn neighbouring_reads_share_requests_and_memory_is_bounded() {
        let (remote, requests) = remote(3 * BLOCK_BYTES + 5);
        let mut bytes = vec![0; 1 << 20];
        for first in (0..3 * BLOCK_BYTES - (1 << 20)).step_by(1 << 20) {
            // Not aligned to blocks.
            remote.read_at(first + 7, &mut bytes).unwrap();
            let right = |(n, value): (u64, &u8)| byte(first + 7 + n) == *value;
            assert!((0..).zip(&bytes).all(right), "{first}");
        }
        assert_eq!(requests.load(Ordering::Relaxed), 3);
        assert!(remote.blocks.lock().unwrap().len() <= KEPT_BLOCKS);
        assert_eq!(remote.held_bytes(), 3 * BLOCK_BYTES + 5);
        // The last block is shorter, and there is no byte after it.
        let mut last = [0; 5];
        remote.read_at(3 * BLOCK_BYTES, &mut last).unwrap();
        assert_eq!(last[4], byte(3 * BLOCK_BYTES + 4));
        for (offset, count) in [(3 * BLOCK_BYTES, 6), (u64::MAX, 1), (u64::MAX - 1, 6)] {
            let error = remote.read_at(offset, &mut vec![0; count]).unwrap_err();
            assert_eq!(error.kind(), io::ErrorKind::UnexpectedEof);
        }
    }

    #[test]
    fn oldest_block_is_dropped() {
        let blocks = KEPT_BLOCKS as u64 + 1;
        let (remote, requests) = remote(blocks * BLOCK_BYTES);
        let mut one = [0; 1];
        let mut read = |block: u64| remote.read_at(block * BLOCK_BYTES, &mut one).unwrap();
        (0..blocks).for_each(&mut read);
        assert_eq!(requests.load(Ordering::Relaxed), blocks);
        // The second is kept, the first is read again.
        read(1);
        assert_eq!(requests.load(Ordering::Relaxed), blocks);
        read(0);
        assert_eq!(requests.load(Ordering::Relaxed), blocks + 1);
        assert_eq!(remote.blocks.lock().unwrap().len(), KEPT_BLOCKS);
    }

    #[test]
    fn threads_wait_for_the_same_block() {
        let (remote, requests) = remote(BLOCK_BYTES);
        thread::scope(|scope| {
            for n in 0..8 {
                let remote = &remote;
                scope.spawn(move || {
                    let mut own = [0; 16];
                    remote.read_at(n * 1000, &mut own).unwrap();
                    assert_eq!(own[0], byte(n * 1000));
                });
            }
        });
        assert_eq!(requests.load(Ordering::Relaxed), 1);
    }
}
