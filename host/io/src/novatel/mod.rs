//! NovAtel logs in ASCII: where a vehicle was, and how it was turned.
//!
//! A record is a line `#NAME,header;body*crc` (OEM7 Commands and Logs Reference Manual). Read are
//!
//! | record | position | height given as | attitude |
//! |---|---|---|---|
//! | `INSPVAA` | inertial solution | above the WGS 84 ellipsoid | roll, pitch, azimuth |
//! | `INSPVAXA` | inertial solution | above mean sea level, with the undulation | roll, pitch, azimuth |
//! | `BESTPOSA` | best position | above mean sea level, with the undulation | none |
//!
//! Heights are converted to ellipsoidal ones (mean sea level plus undulation). Records of other names, with long
//! (`#`) or short (`%`) header, are counted; so are those that say they have no solution. The CRC-32
//! is the reflected polynomial 0xEDB88320 over the text between `#` and `*`, from 0 and without a final
//! complement.
//!
//! Roll is right-handed about forward and pitch about right (nose up positive), azimuth is clockwise from
//! north; turns are azimuth, then pitch, then roll. Times are GPS weeks and seconds; their difference
//! is exact to a nanosecond. The log's seconds have a millisecond or better; at 30 m/s a millisecond is 3 cm.
//!
//! Cost: one pass, a line at a time; 150 bytes a record kept.

mod line;
mod track;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

pub use track::Attitude;

use subaperture_model::geometry::Geodetic;

/// Bytes a line may have. The longest records of the manual have some kilobytes.
const LONGEST_LINE: u64 = 1 << 16;

/// Why a log was not read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NovatelError {
    /// The operating system refused.
    #[error("cannot read {path}: {source}")]
    Io {
        /// File concerned.
        path: PathBuf,
        /// Cause.
        source: io::Error,
    },
    /// A line is not what it should be.
    #[error("{path}, line {line}: {what}")]
    Line {
        /// File concerned.
        path: PathBuf,
        /// The line, from 1.
        line: u64,
        /// What is wrong with it.
        what: String,
    },
}

/// What to do with lines that are damaged: a wrong CRC, or no record at all.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Damage {
    /// Refuse the log.
    #[default]
    Refuse,
    /// Count them and go on.
    Skip,
}

/// A moment of GPS time.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct GpsTime {
    /// Weeks since 6 January 1980.
    pub week: u32,
    /// Seconds of the week, 0 to 604800.
    pub seconds: f64,
}

impl GpsTime {
    /// Seconds from `earlier` to this moment.
    pub fn since(&self, earlier: GpsTime) -> f64 {
        let weeks = f64::from(self.week) - f64::from(earlier.week);
        weeks * 604_800.0 + (self.seconds - earlier.seconds)
    }
}

/// Which record a position came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// `INSPVAA`.
    Inspva,
    /// `INSPVAXA`.
    Inspvax,
    /// `BESTPOSA`.
    Bestpos,
}

/// A position, and what came with it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Record {
    /// Its line in the file, from 1.
    pub line: u64,
    /// Where it came from.
    pub source: Source,
    /// When.
    pub time: GpsTime,
    /// Where, with the height above the ellipsoid.
    pub place: Geodetic,
    /// Velocity north, east and up, metres a second; none with `BESTPOSA`.
    pub velocity_m_s: Option<[f64; 3]>,
    /// Attitude; none with `BESTPOSA`.
    pub attitude: Option<Attitude>,
}

/// What was read of a log.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Log {
    /// Positions in the file's order.
    pub records: Vec<Record>,
    /// Records that say they have no solution.
    pub unsolved: u64,
    /// Records of other names, by name.
    pub skipped: BTreeMap<String, u64>,
    /// Damaged lines; 0 with [`Damage::Refuse`].
    pub damaged: u64,
}

/// Reads a log.
///
/// # Errors
/// [`NovatelError`], with the line: if damaged lines are not skipped, or a record whose CRC is right does not
/// have the fields it should.
pub fn read(path: &Path, damage: Damage) -> Result<Log, NovatelError> {
    let file = File::open(path).map_err(|source| NovatelError::Io {
        path: path.to_owned(),
        source,
    })?;
    read_from(BufReader::new(file), path, damage)
}

/// Reads a log from a stream; `path` is for errors.
///
/// # Errors
/// As [`read`].
pub fn read_from(
    mut stream: impl BufRead,
    path: &Path,
    damage: Damage,
) -> Result<Log, NovatelError> {
    let mut log = Log::default();
    let mut bytes = Vec::new();
    for number in 1.. {
        bytes.clear();
        let mut limited = stream.by_ref().take(LONGEST_LINE);
        let read = limited.read_until(b'\n', &mut bytes);
        let count = read.map_err(|source| NovatelError::Io {
            path: path.to_owned(),
            source,
        })?;
        if count == 0 {
            break;
        }
        let refused = |what: String| NovatelError::Line {
            path: path.to_owned(),
            line: number,
            what,
        };
        let text = bytes.trim_ascii();
        if text.is_empty() {
            continue;
        }
        match line::checked(text) {
            Ok(record) => match line::parse(&record, number).map_err(refused)? {
                line::Parsed::Record(record) => log.records.push(record),
                line::Parsed::Unsolved => log.unsolved += 1,
                line::Parsed::Other(name) => *log.skipped.entry(name).or_default() += 1,
            },
            Err(what) if damage == Damage::Refuse => return Err(refused(what)),
            Err(_) => log.damaged += 1,
        }
    }
    Ok(log)
}
