//! Reading of logs in any format, recognised by content.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use crate::account::{Fault, ReadReport, Wrong};
use crate::csv::{self, Refused};
use crate::options::Options;
use crate::{GpsTime, Kind, Place, Record, messages, sbet};

/// Bytes from which a format is recognised.
const HEAD: u64 = 8192;

/// Least time between records of a kind, seconds: receivers state nanoseconds.
const MIN_STEP_S: f64 = 1e-9;

/// Format of a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// NovAtel records in ASCII or binary and NMEA sentences, in any order.
    Messages,
    /// Smoothed best estimate of trajectory (SBET).
    Sbet,
    /// Comma-separated values with units in their header.
    Csv,
}

impl Format {
    /// Recognise the format from a file's first 8192 bytes, or all of them.
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
        // NovAtel lines may be comments of other formats.
        let first = line.trim_start_matches('\u{feff}').trim_start();
        let begins = first.bytes().next();
        let named = first.to_ascii_lowercase().contains("time");
        match begins.is_some_and(|b| b.is_ascii_alphabetic()) && named && line.contains(',') {
            true => Self::Csv,
            false => Self::Messages,
        }
    }
}

/// Reason why a log was not read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NavigationError {
    /// The operating system reported an error.
    #[error("cannot read {path}: {source}")]
    Io {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The first line is not a valid header.
    #[error("{path}: {reason}")]
    Header {
        /// Path of the file.
        path: PathBuf,
        /// Expected and found columns.
        reason: String,
    },
    /// The file has no valid record.
    #[error("{path}: no record of NovAtel (INSPVA, INSPVAX, BESTPOS, MARKPOS, MARKTIME), NMEA, SBET or CSV in {bytes} bytes\n{account}", bytes = account.bytes)]
    NoRecords {
        /// Path of the file.
        path: PathBuf,
        /// Account of the file's content.
        account: Box<ReadReport>,
    },
}

/// Pass every record of a file to `take`, in the file's order, and return the account. Records of a kind ascend in time; others are counted and left out. Memory is independent of the file's size.
///
/// # Errors
/// [`NavigationError`]. Damage is no error while a record is left.
pub fn each(
    path: &Path,
    options: &Options,
    take: impl FnMut(Record),
) -> Result<ReadReport, NavigationError> {
    let file = File::open(path).map_err(|source| NavigationError::Io {
        path: path.to_owned(),
        source,
    })?;
    each_from(BufReader::new(file), path, options, take)
}

/// Whether the position is the default of receivers without a solution.
fn is_at_origin(record: &Record) -> bool {
    match record.place {
        Some(Place::Earth(place)) => place.latitude_deg == 0.0 && place.longitude_deg == 0.0,
        _ => false,
    }
}

/// [`each`] for a stream; `path` is for error messages.
///
/// # Errors
/// As [`each`].
pub fn each_from(
    mut stream: impl BufRead,
    path: &Path,
    options: &Options,
    mut take: impl FnMut(Record),
) -> Result<ReadReport, NavigationError> {
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
    let mut disorder = ReadReport::default();
    let mut count = 0u64;
    let mut at_origin = 0u64;
    let mut in_order = |mut record: Record| {
        if is_at_origin(&record) {
            at_origin += 1;
            record.place = None;
        }
        let last = &mut last[record.kind as usize];
        match *last {
            Some(before) if record.time.since(before) < MIN_STEP_S => disorder.fault(Fault {
                byte: record.byte,
                line: None,
                wrong: Wrong::Disorder,
                description: match record.time.since(before) {
                    step_s if step_s > 0.0 => format!(
                        "{} at {before} and {step_s:e} s later: expected at least {MIN_STEP_S:e} s",
                        record.kind.name()
                    ),
                    0.0 => format!("{} at {before} twice", record.kind.name()),
                    _ => format!("{} at {} after {before}", record.kind.name(), record.time),
                },
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
        Format::Csv => csv::each(whole, &mut in_order).map_err(|error| match error {
            Refused::Io(source) => refused(source),
            Refused::Header(reason) => NavigationError::Header {
                path: path.to_owned(),
                reason,
            },
        })?,
    };
    account.add(disorder);
    if at_origin > 0 {
        account.doubt(&format!(
            "{at_origin} records are at latitude 0, longitude 0, the default of receivers without a position: their positions are left out"
        ));
    }
    match count {
        0 => Err(NavigationError::NoRecords {
            path: path.to_owned(),
            account: Box::new(account),
        }),
        _ => Ok(account),
    }
}
