//! Phase errors per pulse as comma-separated values: the phase correction estimated by autofocus.
//!
//! The first line names the columns, `pulse,phase_rad`. Every further line is one pulse, from 0 without gaps, with
//! the phase in radians by which its samples are ahead. Empty lines and lines that begin with `#` are skipped.
//!
//! ```text
//! pulse,phase_rad
//! 0,0.125
//! 1,-0.5
//! ```

use std::fmt::Write as _;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;

use super::ours::TEXT_MARK;
use super::track_csv::{TrackCsvError, each_line};

/// Maximum line length in bytes.
const LONGEST_LINE: u64 = 256;

/// Maximum phase in radians; above it float64 resolves less than a thousandth of a turn.
const LARGEST_RAD: f64 = 1e12;

const HEADER: &str = "pulse,phase_rad";

/// Read the phases of all pulses in radians.
///
/// # Errors
/// [`TrackCsvError`] with the line.
pub fn read(path: &Path) -> Result<Vec<f64>, TrackCsvError> {
    let file = File::open(path).map_err(|source| TrackCsvError::Io {
        path: path.to_owned(),
        source,
    })?;
    read_from(BufReader::new(file), path)
}

/// Read the phases of all pulses from a stream; `path` is for errors.
///
/// # Errors
/// As [`read`].
pub fn read_from(stream: impl BufRead, path: &Path) -> Result<Vec<f64>, TrackCsvError> {
    let mut headed = false;
    let mut phases = Vec::new();
    let lines = each_line(stream, path, LONGEST_LINE, |row| {
        let row = row.trim();
        if row.is_empty() || row.starts_with('#') {
            return Ok(());
        }
        if !headed {
            headed = true;
            return match row.split(',').map(str::trim).eq(HEADER.split(',')) {
                true => Ok(()),
                false => Err(format!("expected the header {HEADER}, found '{row}'")),
            };
        }
        phases.push(phase(row, phases.len())?);
        Ok(())
    })?;
    match headed {
        true => Ok(phases),
        false => Err(TrackCsvError::Line {
            path: path.to_owned(),
            line: lines.max(1),
            what: format!("expected the header {HEADER}, found the end of the file"),
        }),
    }
}

/// Phase from the row of this pulse.
fn phase(row: &str, pulse: usize) -> Result<f64, String> {
    let Some((number, phase)) = row.split_once(',') else {
        return Err("expected two values as in the header, found one".to_owned());
    };
    if number.trim().parse() != Ok(pulse) {
        return Err(format!(
            "pulse: expected {pulse} (one line per pulse, from 0), found '{}'",
            number.trim()
        ));
    }
    match phase.trim().parse::<f64>() {
        Ok(value) if value.abs() <= LARGEST_RAD => Ok(value),
        _ => Err(format!(
            "phase_rad: expected a number up to {LARGEST_RAD:e}, found '{}'",
            phase.trim()
        )),
    }
}

/// Text of phases in radians, which [`read`] restores exactly.
pub fn text(phases_rad: &[f64]) -> String {
    let mut text = format!("# {TEXT_MARK}\n{HEADER}\n");
    for (pulse, phase) in phases_rad.iter().enumerate() {
        writeln!(text, "{pulse},{phase:?}").expect("text grows");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn phases(text: &str) -> Result<Vec<f64>, String> {
        read_from(text.as_bytes(), Path::new("phase.csv")).map_err(|error| error.to_string())
    }

    #[test]
    fn written_phases_read_back() {
        let some = [0.1, -2.5e-17, 1.0 / 3.0, -1234.5, 1e-300, 5e-324, -1e12];
        assert_eq!(phases(&text(&some)).unwrap(), some);
        assert_eq!(
            phases("\u{feff}pulse, phase_rad\r\n\r\n0, 1\r\n").unwrap(),
            [1.0]
        );
    }

    #[test]
    fn faults_name_their_line() {
        for (text, what) in [
            ("", "line 1: expected the header"),
            ("# nothing\n", "line 1: expected the header"),
            (
                "phase_rad,pulse\n",
                "line 1: expected the header pulse,phase_rad",
            ),
            ("pulse,phase_rad\n1,0\n", "line 2: pulse: expected 0"),
            ("pulse,phase_rad\n0,0\n0,0\n", "line 3: pulse: expected 1"),
            ("pulse,phase_rad\n0\n", "line 2: expected two values"),
            (
                "pulse,phase_rad\n0,NaN\n",
                "line 2: phase_rad: expected a number up to 1e12, found 'NaN'",
            ),
            (
                "pulse,phase_rad\n0,inf\n",
                "line 2: phase_rad: expected a number up to 1e12, found 'inf'",
            ),
        ] {
            let error = phases(text).unwrap_err();
            assert!(error.contains(what), "{error}");
        }
    }
}
