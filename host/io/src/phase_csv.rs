//! Phase errors, a pulse each, as comma-separated values: what autofocus found, to be taken away when an image is formed.
//!
//! The first line names the columns, `pulse,phase_rad`; every line after it is a pulse, from 0 on, none left out, and the phase by which
//! its samples are ahead, radians. Empty lines and lines that begin with `#` are passed over.
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

/// Bytes a line may have.
const LONGEST_LINE: u64 = 256;

/// Largest phase, radians: beyond, float64 tells less than a thousandth of a turn.
const LARGEST_RAD: f64 = 1e12;

const HEADER: &str = "pulse,phase_rad";

/// Reads the phases of all pulses, radians.
///
/// # Errors
/// [`TrackCsvError`], with the line.
pub fn read(path: &Path) -> Result<Vec<f64>, TrackCsvError> {
    let file = File::open(path).map_err(|source| TrackCsvError::Io {
        path: path.to_owned(),
        source,
    })?;
    read_from(BufReader::new(file), path)
}

/// Reads the phases of all pulses from a stream; `path` is for errors.
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
                false => Err(format!("the header is '{row}'; begin with {HEADER}")),
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
            what: format!("no header; begin with {HEADER}"),
        }),
    }
}

/// The phase in the row of this pulse.
fn phase(row: &str, pulse: usize) -> Result<f64, String> {
    let Some((number, phase)) = row.split_once(',') else {
        return Err("one value; the header names two columns".to_owned());
    };
    if number.trim().parse() != Ok(pulse) {
        return Err(format!(
            "pulse is '{}' where {pulse} is expected: every pulse has a line, from 0 on",
            number.trim()
        ));
    }
    match phase.trim().parse::<f64>() {
        Ok(value) if value.abs() <= LARGEST_RAD => Ok(value),
        _ => Err(format!(
            "phase_rad is '{}'; a number of at most {LARGEST_RAD:e} is expected",
            phase.trim()
        )),
    }
}

/// The text of phases, radians, that [`read`] takes again to the bit.
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
    fn phases_survive_a_round_trip() {
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
            ("", "line 1: no header"),
            ("# nothing\n", "line 1: no header"),
            (
                "phase_rad,pulse\n",
                "line 1: the header is 'phase_rad,pulse'",
            ),
            (
                "pulse,phase_rad\n1,0\n",
                "line 2: pulse is '1' where 0 is expected",
            ),
            (
                "pulse,phase_rad\n0,0\n0,0\n",
                "line 3: pulse is '0' where 1 is expected",
            ),
            ("pulse,phase_rad\n0\n", "line 2: one value"),
            ("pulse,phase_rad\n0,NaN\n", "line 2: phase_rad is 'NaN'"),
            ("pulse,phase_rad\n0,inf\n", "line 2: phase_rad is 'inf'"),
        ] {
            let error = phases(text).unwrap_err();
            assert!(error.contains(what), "{error}");
        }
    }
}
