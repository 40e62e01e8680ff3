//! A log of any format, told by what it holds.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use crate::account::{Account, Fault, Wrong};
use crate::csv::{self, Refused};
use crate::options::Options;
use crate::{GpsTime, Kind, Record, messages, sbet};

/// Bytes by which a format is told.
const HEAD: u64 = 8192;

/// Formats.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// NovAtel's records in ASCII or binary, and NMEA sentences, side by side as they come.
    Messages,
    /// Smoothed best estimate of trajectory.
    Sbet,
    /// Comma-separated values with units in their header.
    Csv,
}

impl Format {
    /// That of a file that begins so (8192 bytes, or all there are).
    fn of(head: &[u8]) -> Self {
        if sbet::begins(head) {
            return Self::Sbet;
        }
        let Some(line) = head
            .split(|&b| b == b'\n')
            .filter_map(|line| std::str::from_utf8(line).ok())
            .find(|line| !csv::is_idle(line))
        else {
            return Self::Messages;
        };
        // NovAtel's lines are comments to others, or this.
        let first = line.trim_start_matches('\u{feff}').trim_start();
        let begins = first.bytes().next();
        let named = first.to_ascii_lowercase().contains("time");
        match begins.is_some_and(|b| b.is_ascii_alphabetic()) && named && line.contains(',') {
            true => Self::Csv,
            false => Self::Messages,
        }
    }
}

/// Why a log was not read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NavigationError {
    /// The operating system refused.
    #[error("cannot read {path}: {source}")]
    Io {
        /// File concerned.
        path: PathBuf,
        /// Cause.
        source: io::Error,
    },
    /// Its first line does not say what is in it.
    #[error("{path}: {what}")]
    Header {
        /// File concerned.
        path: PathBuf,
        /// What is wrong, and what would be right.
        what: String,
    },
    /// Nothing in it can be trusted.
    #[error("{path}: no record of NovAtel (INSPVA, INSPVAX, BESTPOS, MARKPOS, MARKTIME), NMEA, SBET or CSV in {bytes} bytes\n{account}", bytes = account.bytes)]
    Nothing {
        /// File concerned.
        path: PathBuf,
        /// What was found instead.
        account: Box<Account>,
    },
}

/// Hands every record of a file to `take`, in its order, and says what was read and what was not. Records of a kind ascend in time; those that would not are
/// counted and left out. Memory does not grow with the file.
///
/// # Errors
/// [`NavigationError`]: damage is none, as long as something is left.
pub fn each(
    path: &Path,
    options: &Options,
    take: impl FnMut(Record),
) -> Result<Account, NavigationError> {
    let file = File::open(path).map_err(|source| NavigationError::Io {
        path: path.to_owned(),
        source,
    })?;
    each_from(BufReader::new(file), path, options, take)
}

/// [`each`] of a stream; `path` is for errors.
///
/// # Errors
/// As [`each`].
pub fn each_from(
    mut stream: impl BufRead,
    path: &Path,
    options: &Options,
    mut take: impl FnMut(Record),
) -> Result<Account, NavigationError> {
    let refused = |source| NavigationError::Io {
        path: path.to_owned(),
        source,
    };
    let mut head = Vec::new();
    let read = stream.by_ref().take(HEAD).read_to_end(&mut head);
    read.map_err(refused)?;
    let format = Format::of(&head);
    let whole = io::Cursor::new(&head).chain(stream);
    let mut last = [None::<GpsTime>; Kind::ALL.len()];
    let mut disorder = Account::default();
    let mut count = 0u64;
    let mut in_order = |record: Record| {
        let last = &mut last[record.kind as usize];
        match *last {
            Some(before) if record.time.since(before) <= 0.0 => disorder.fault(Fault {
                byte: record.byte,
                line: None,
                wrong: Wrong::Disorder,
                what: format!("{} at {} after {before}", record.kind.name(), record.time),
            }),
            _ => {
                *last = Some(record.time);
                count += 1;
                take(record);
            }
        }
    };
    let mut account = match format {
        Format::Messages => messages::each(whole, options, &mut in_order).map_err(refused)?,
        Format::Sbet => sbet::each(whole, options, &mut in_order).map_err(refused)?,
        Format::Csv => csv::each(whole, &mut in_order).map_err(|why| match why {
            Refused::Io(source) => refused(source),
            Refused::Header(what) => NavigationError::Header {
                path: path.to_owned(),
                what,
            },
        })?,
    };
    account.add(disorder);
    match count {
        0 => Err(NavigationError::Nothing {
            path: path.to_owned(),
            account: Box::new(account),
        }),
        _ => Ok(account),
    }
}
