//! Tracks as comma-separated values.
//!
//! The first line names the columns, in any order: `time_s`, `x_m`, `y_m`, `z_m`, or in other units `time_ms`,
//! `time_us`, `x_mm`, `x_cm` and so on, with one unit for x, y and z. For attitude it has all of `roll_deg`,
//! `pitch_deg`, `yaw_deg` or all of `roll_rad`, `pitch_rad`, `yaw_rad`, and for velocity all of `vx_m_s`, `vy_m_s`, `vz_m_s`, which only
//! [`read_states`] uses. Every further line is a fix; additional columns of [`crate::estimated_track`] are ignored. Times are seconds from the collection's start, positions metres in
//! the scene frame; angles are right-handed about x forward, y left and z up ([`turned`]). Empty lines and lines that
//! begin with `#` are skipped.
//!
//! ```text
//! time_s,x_m,y_m,z_m
//! 0.0,-100.0,-500.0,300.0
//! 0.1,-95.0,-500.0,300.1
//! ```

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use glam::{DVec3, EulerRot};

use crate::estimated_track::EXTRA_COLUMNS;
use crate::ours::TEXT_MARK;

use subaperture_model::track::{Fix, TrackError, turned};

/// Maximum line length in bytes.
const LONGEST_LINE: u64 = 4096;

/// Maximum coordinate in metres and maximum time in seconds.
const FARTHEST: f64 = 1e9;

const PLACE: [&str; 4] = ["time_s", "x_m", "y_m", "z_m"];
/// Column names of times with their unit in seconds.
const TIMES: [(&str, f64); 3] = [("time_s", 1.0), ("time_ms", 1e-3), ("time_us", 1e-6)];
const PLACES: [([&str; 3], f64); 3] = [
    (["x_m", "y_m", "z_m"], 1.0),
    (["x_cm", "y_cm", "z_cm"], 1e-2),
    (["x_mm", "y_mm", "z_mm"], 1e-3),
];
const DEGREES: [&str; 3] = ["roll_deg", "pitch_deg", "yaw_deg"];
const RADIANS: [&str; 3] = ["roll_rad", "pitch_rad", "yaw_rad"];
const VELOCITY: [&str; 3] = ["vx_m_s", "vy_m_s", "vz_m_s"];

/// Error of reading a track.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TrackCsvError {
    /// The operating system reported an error.
    #[error("cannot read {path}: {source}")]
    Io {
        /// Path of the file that failed.
        path: PathBuf,
        /// Cause.
        source: io::Error,
    },
    /// A line is malformed.
    #[error("{path}, line {line}: {what}")]
    Line {
        /// Path of the file that failed.
        path: PathBuf,
        /// Line number, from 1.
        line: u64,
        /// Description of the fault.
        what: String,
    },
    /// The positions are no smooth motion.
    #[error("{path}: {source}")]
    Track {
        /// Path of the file that failed.
        path: PathBuf,
        /// Fault of the positions or times.
        source: TrackError,
    },
}

impl TrackCsvError {
    /// Error of a malformed line.
    pub(super) fn at_line(path: &Path, line: u64, fault: String) -> Self {
        Self::Line {
            path: path.to_owned(),
            line,
            what: fault,
        }
    }
}

/// Text of a track, with attitude if the first fix has one.
pub fn text(fixes: &[Fix]) -> String {
    let turns = fixes.first().is_some_and(|fix| fix.attitude.is_some());
    let more = if turns {
        ",roll_deg,pitch_deg,yaw_deg"
    } else {
        ""
    };
    let mut text = format!("# {TEXT_MARK}\ntime_s,x_m,y_m,z_m{more}\n");
    for fix in fixes {
        let [x, y, z] = fix.position_m.to_array();
        text += &format!("{},{x},{y},{z}", fix.time_s);
        if turns {
            let (yaw, pitch, roll) = fix.attitude.unwrap_or_default().to_euler(EulerRot::ZYX);
            let [roll, pitch, yaw] = [roll, pitch, yaw].map(f64::to_degrees);
            text += &format!(",{roll},{pitch},{yaw}");
        }
        text.push('\n');
    }
    text
}

/// Read the fixes of a track.
///
/// # Errors
/// [`TrackCsvError`] with the line. The order of times is not checked here.
pub fn read(path: &Path) -> Result<Vec<Fix>, TrackCsvError> {
    let file = File::open(path).map_err(|source| TrackCsvError::Io {
        path: path.to_owned(),
        source,
    })?;
    read_from(BufReader::new(file), path)
}

/// Read the fixes of a track, and their velocities in metres per second if the file has them.
///
/// # Errors
/// As [`read`].
pub fn read_states(path: &Path) -> Result<(Vec<Fix>, Option<Vec<DVec3>>), TrackCsvError> {
    let file = File::open(path).map_err(|source| TrackCsvError::Io {
        path: path.to_owned(),
        source,
    })?;
    let (mut fixes, mut velocities) = (Vec::new(), Vec::new());
    each_state(BufReader::new(file), path, |fix, velocity| {
        fixes.push(fix);
        velocities.extend(velocity);
        Ok(())
    })?;
    let known = !velocities.is_empty();
    Ok((fixes, known.then_some(velocities)))
}

/// Read the fixes of a track from a stream; `path` is for errors.
///
/// # Errors
/// As [`read`].
pub fn read_from(stream: impl BufRead, path: &Path) -> Result<Vec<Fix>, TrackCsvError> {
    let mut fixes = Vec::new();
    each_fix(stream, path, |fix| {
        fixes.push(fix);
        Ok(())
    })?;
    Ok(fixes)
}

/// Call `take` with every fix of a track. Returns the number of lines.
///
/// # Errors
/// [`TrackCsvError`] with the line, also if `take` returns an error.
pub(super) fn each_fix(
    stream: impl BufRead,
    path: &Path,
    mut take: impl FnMut(Fix) -> Result<(), String>,
) -> Result<u64, TrackCsvError> {
    each_state(stream, path, |fix, _| take(fix))
}

/// Call `take` with every fix of a track and its velocity. Returns the number of lines.
///
/// # Errors
/// As [`each_fix`].
fn each_state(
    stream: impl BufRead,
    path: &Path,
    mut take: impl FnMut(Fix, Option<DVec3>) -> Result<(), String>,
) -> Result<u64, TrackCsvError> {
    let mut columns: Option<Columns> = None;
    let lines = each_line(stream, path, LONGEST_LINE, |row| {
        let row = row.trim();
        if row.is_empty() || row.starts_with('#') {
            return Ok(());
        }
        match &columns {
            None => columns = Some(Columns::parse(row)?),
            Some(columns) => {
                let (fix, velocity) = columns.state(row)?;
                take(fix, velocity)?;
            }
        }
        Ok(())
    })?;
    if columns.is_none() {
        let fault = format!(
            "expected a header such as {}, found the end of the file",
            PLACE.join(",")
        );
        return Err(TrackCsvError::at_line(path, 1, fault));
    }
    Ok(lines)
}

/// Call `take` with every line of a track file, without a byte order mark. Returns the number of lines.
///
/// # Errors
/// [`TrackCsvError`] with the line, if it has `longest` bytes or more, is not text, or `take` returns an error.
pub(super) fn each_line(
    mut stream: impl BufRead,
    path: &Path,
    longest: u64,
    mut take: impl FnMut(&str) -> Result<(), String>,
) -> Result<u64, TrackCsvError> {
    let mut bytes = Vec::new();
    let mut line = 0;
    loop {
        bytes.clear();
        let mut limited = stream.by_ref().take(longest);
        let read = limited.read_until(b'\n', &mut bytes);
        let count = read.map_err(|source| TrackCsvError::Io {
            path: path.to_owned(),
            source,
        })?;
        if count == 0 {
            return Ok(line);
        }
        line += 1;
        let taken = match std::str::from_utf8(&bytes) {
            _ if count as u64 == longest => {
                Err(format!("expected a line of fewer than {longest} bytes"))
            }
            Err(_) => Err("not text".to_owned()),
            Ok(text) => take(text.trim_start_matches('\u{feff}')),
        };
        taken.map_err(|fault| TrackCsvError::at_line(path, line, fault))?;
    }
}

/// Columns of the values.
struct Columns {
    names: Vec<String>,
    place: [usize; 4],
    /// Units of time and position in seconds and metres.
    units: [f64; 2],
    /// Columns of roll, pitch and yaw, and their unit in radians.
    angles: Option<([usize; 3], f64)>,
    /// Columns of the velocity.
    velocity: Option<[usize; 3]>,
}

impl Columns {
    fn parse(header: &str) -> Result<Self, String> {
        let names: Vec<String> = header.split(',').map(|n| n.trim().to_owned()).collect();
        for (n, name) in names.iter().enumerate() {
            let times = TIMES.iter().map(|(name, _)| *name);
            let places = PLACES.iter().flat_map(|(names, _)| *names);
            let angles = DEGREES.into_iter().chain(RADIANS).chain(VELOCITY);
            let known: Vec<&str> = times.chain(places).chain(angles).collect();
            if !known.contains(&name.as_str()) && !EXTRA_COLUMNS.contains(&name.as_str()) {
                return Err(format!(
                    "unknown column '{name}': expected one of {}",
                    known.join(", ")
                ));
            }
            if names[..n].contains(name) {
                return Err(format!("duplicate column '{name}'"));
            }
        }
        let at = |name: &str| names.iter().position(|n| n == name);
        let times: Vec<(usize, f64)> = TIMES
            .iter()
            .filter_map(|&(name, unit)| Some((at(name)?, unit)))
            .collect();
        let &[(time, time_unit)] = &times[..] else {
            return Err(match times.len() {
                0 => "column 'time_s' is missing".to_owned(),
                _ => "times have two units: remove one".to_owned(),
            });
        };
        let any = |names: &[&str; 3]| names.iter().any(|name| at(name).is_some());
        let given: Vec<&([&str; 3], f64)> = PLACES.iter().filter(|(names, _)| any(names)).collect();
        let (letters, place_unit) = match given[..] {
            [] => return Err("column 'x_m' is missing".to_owned()),
            [(names, unit)] => (names, *unit),
            _ => return Err("positions have two units: give x, y and z in one".to_owned()),
        };
        let mut place = [time, 0, 0, 0];
        for (place, name) in place[1..].iter_mut().zip(letters) {
            *place = at(name).ok_or_else(|| format!("column '{name}' is missing"))?;
        }
        let angles = match (DEGREES.map(at), RADIANS.map(at)) {
            ([Some(r), Some(p), Some(y)], [None, None, None]) => {
                Some(([r, p, y], 1f64.to_radians()))
            }
            ([None, None, None], [Some(r), Some(p), Some(y)]) => Some(([r, p, y], 1.0)),
            ([None, None, None], [None, None, None]) => None,
            _ => {
                return Err(format!(
                    "give all of {}, or all of {}, or none",
                    DEGREES.join(", "),
                    RADIANS.join(", ")
                ));
            }
        };
        let velocity = match VELOCITY.map(at) {
            [Some(x), Some(y), Some(z)] => Some([x, y, z]),
            [None, None, None] => None,
            _ => return Err(format!("give all of {}, or none", VELOCITY.join(", "))),
        };
        Ok(Self {
            velocity,
            names,
            place,
            units: [time_unit, place_unit],
            angles,
        })
    }

    /// Fix and velocity of a line.
    fn state(&self, row: &str) -> Result<(Fix, Option<DVec3>), String> {
        let values: Vec<&str> = row.split(',').map(str::trim).collect();
        if values.len() != self.names.len() {
            return Err(format!(
                "expected {1} values as in the header, found {0}",
                values.len(),
                self.names.len()
            ));
        }
        let number = |n: usize| match values[n].parse::<f64>() {
            Ok(value) if value.abs() <= FARTHEST => Ok(value),
            _ => Err(format!(
                "{}: expected a number up to {FARTHEST:e}, found '{}'",
                self.names[n], values[n]
            )),
        };
        let [t, x, y, z] = self.place;
        let attitude = match self.angles {
            Some(([roll, pitch, yaw], unit)) => Some(turned(
                number(roll)? * unit,
                number(pitch)? * unit,
                number(yaw)? * unit,
            )),
            None => None,
        };
        let velocity_m_s = match self.velocity {
            Some([x, y, z]) => Some(DVec3::new(number(x)?, number(y)?, number(z)?)),
            None => None,
        };
        let fix = Fix {
            time_s: number(t)? * self.units[0],
            position_m: DVec3::new(number(x)?, number(y)?, number(z)?) * self.units[1],
            attitude,
        };
        Ok((fix, velocity_m_s))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fixes(text: &str) -> Result<Vec<Fix>, TrackCsvError> {
        read_from(text.as_bytes(), Path::new("way.csv"))
    }

    #[test]
    fn columns_are_matched_by_name() {
        let read = fixes(
            "\u{feff}# flight 3\nz_m, x_m,y_m,yaw_deg,roll_deg,pitch_deg,time_s\r\n\r\n300,1,2,90,0,0,0.5\n\
             301,-1e1,2.5,0,30,0,1\n",
        )
        .unwrap();
        assert_eq!(read.len(), 2);
        assert_eq!(read[0].time_s, 0.5);
        assert_eq!(read[1].position_m, DVec3::new(-10.0, 2.5, 301.0));
        assert!((read[0].attitude.unwrap() * DVec3::X).distance(DVec3::Y) < 1e-15);
        assert!(((read[1].attitude.unwrap() * DVec3::Y).z - 0.5).abs() < 1e-15);
        let radians = fixes("time_s,x_m,y_m,z_m,roll_rad,pitch_rad,yaw_rad\n0,0,0,0,0,0.5,0\n");
        let nose = radians.unwrap()[0].attitude.unwrap() * DVec3::X;
        assert!((nose.z + 0.5f64.sin()).abs() < 1e-15);
        assert_eq!(
            fixes("time_s,x_m,y_m,z_m\n1,2,3,4").unwrap()[0].attitude,
            None
        );
    }

    #[test]
    fn column_names_select_units() {
        let read = fixes("time_ms,x_mm,y_mm,z_mm\n1500,10,-20,3000\n").unwrap();
        assert_eq!(read[0].time_s, 1.5);
        assert!(read[0].position_m.distance(DVec3::new(0.01, -0.02, 3.0)) < 1e-15);
        for (header, what) in [
            ("time_s,x_mm,y_m,z_m\n", "positions have two units"),
            ("time_s,time_ms,x_m,y_m,z_m\n", "times have two units"),
            ("time_s,x_cm,y_cm\n", "'z_cm' is missing"),
            ("x_cm,y_cm,z_cm\n", "'time_s' is missing"),
        ] {
            let error = fixes(header).unwrap_err().to_string();
            assert!(error.contains(what), "{error}");
        }
    }

    #[test]
    fn velocities_are_read_with_states_only() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("orbit.csv");
        let text = "time_s,x_m,y_m,z_m,vz_m_s,vx_m_s,vy_m_s\n0,1,2,3,6,4,5\n1,5,7,9,6,4,5\n";
        std::fs::write(&path, text).unwrap();
        let (read, velocities) = read_states(&path).unwrap();
        assert_eq!(read, fixes(text).unwrap());
        assert_eq!(velocities.unwrap(), [DVec3::new(4.0, 5.0, 6.0); 2]);
        std::fs::write(&path, "time_s,x_m,y_m,z_m\n0,1,2,3\n").unwrap();
        assert_eq!(read_states(&path).unwrap().1, None);
        let error = fixes("time_s,x_m,y_m,z_m,vx_m_s\n").unwrap_err();
        let message = error.to_string();
        assert!(message.contains("line 1: give all of vx_m_s"), "{message}");
    }

    #[test]
    fn faults_name_their_line() {
        for (text, what) in [
            ("", "line 1: expected a header"),
            ("time_s,x_m,y_m\n", "line 1: column 'z_m' is missing"),
            ("time_s,x_m,y_m,z_m,x_m\n", "line 1: duplicate column 'x_m'"),
            ("time,x_m,y_m,z_m\n", "line 1: unknown column 'time'"),
            (
                "time_s,x_m,y_m,z_m,yaw_deg\n",
                "line 1: give all of roll_deg",
            ),
            ("time_s,x_m,y_m,z_m\n\n1,2,3\n", "line 3: expected 4 values"),
            (
                "time_s,x_m,y_m,z_m\n1,2,x,4\n",
                "line 2: y_m: expected a number up to 1e9, found 'x'",
            ),
            (
                "time_s,x_m,y_m,z_m\n1,2,inf,4\n",
                "line 2: y_m: expected a number up to 1e9, found 'inf'",
            ),
            (
                "time_s,x_m,y_m,z_m\n1,2,NaN,4\n",
                "line 2: y_m: expected a number up to 1e9, found 'NaN'",
            ),
        ] {
            let error = fixes(text).unwrap_err().to_string();
            assert!(error.contains(what), "{error}");
        }
        let long = "9".repeat(10_000);
        assert!(fixes(&long).unwrap_err().to_string().contains("4096 bytes"));
        assert!(read_from(&b"\xff\xfe\n"[..], Path::new("a")).is_err());
    }
}
