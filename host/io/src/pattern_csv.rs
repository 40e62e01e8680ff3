//! Antenna pattern as comma-separated values.
//!
//! The first line names the columns, `azimuth_deg,elevation_deg,gain_db`, or `azimuth_deg,gain_db` for a cut that applies to all elevations. Every further
//! line is one direction: azimuth about the up vector, positive to the left of the boresight, elevation towards the up vector, and the gain. The
//! directions form a full lattice: each elevation has all azimuths. Lines may have any order. Empty lines and lines that begin with `#` are skipped.
//!
//! ```text
//! azimuth_deg,elevation_deg,gain_db
//! -10,0,-12.2
//! 0,0,0
//! 10,0,-12.1
//! ```
//!
//! At most [`MOST`] directions are read; memory is some 60 bytes for each.

use std::fmt::Write as _;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

use subaperture_describe::declare::Located;
use subaperture_describe::error::Fault;
use subaperture_model::antenna::PatternTable;

use super::ours::TEXT_MARK;
use super::track_csv::{TrackCsvError, each_line};

/// Maximum number of directions.
pub const MOST: usize = 1 << 18;

/// Maximum line length in bytes.
const LONGEST_LINE: u64 = 256;

const HEADER: &str = "azimuth_deg,elevation_deg,gain_db";
const CUT: &str = "azimuth_deg,gain_db";

/// Reader of the tables that a description names; their paths are relative to `folder`.
pub fn tables_in(folder: &Path) -> impl Fn(&Located<PathBuf>) -> Result<PatternTable, Fault> {
    |file| read(&folder.join(&**file)).map_err(|error| file.fault(error.to_string()))
}

/// Read an antenna pattern.
///
/// # Errors
/// [`TrackCsvError`] with the line.
pub fn read(path: &Path) -> Result<PatternTable, TrackCsvError> {
    let file = File::open(path).map_err(|source| TrackCsvError::Io {
        path: path.to_owned(),
        source,
    })?;
    read_from(BufReader::new(file), path)
}

/// Direction with its gain and its line.
struct Row {
    azimuth_deg: f64,
    elevation_deg: f64,
    gain_db: f64,
    line: u64,
}

/// Read an antenna pattern from a stream; `path` is for errors.
///
/// # Errors
/// As [`read`].
pub fn read_from(stream: impl BufRead, path: &Path) -> Result<PatternTable, TrackCsvError> {
    let mut columns = 0;
    let mut rows: Vec<Row> = Vec::new();
    let mut line = 0;
    let lines = each_line(stream, path, LONGEST_LINE, |text| {
        line += 1;
        let text = text.trim();
        if text.is_empty() || text.starts_with('#') {
            return Ok(());
        }
        let cells: Vec<&str> = text.split(',').map(str::trim).collect();
        if columns == 0 {
            let is = |header: &str| cells.iter().copied().eq(header.split(','));
            if !is(HEADER) && !is(CUT) {
                return Err(format!(
                    "expected the header {HEADER} or {CUT}, found '{text}'"
                ));
            }
            columns = cells.len();
            return Ok(());
        }
        if cells.len() != columns {
            return Err(format!(
                "expected {columns} values as in the header, found {}",
                cells.len()
            ));
        }
        if rows.len() == MOST {
            return Err(format!(
                "expected at most {MOST} directions: widen the steps of azimuth and elevation"
            ));
        }
        let elevation_deg = match columns {
            2 => 0.0,
            _ => number("elevation_deg", cells[1], 90.0)?,
        };
        rows.push(Row {
            azimuth_deg: number("azimuth_deg", cells[0], 180.0)?,
            elevation_deg,
            gain_db: number("gain_db", cells[columns - 1], 400.0)?,
            line,
        });
        Ok(())
    })?;
    let at_line = |line: u64, fault: String| TrackCsvError::at_line(path, line.max(1), fault);
    if rows.is_empty() {
        let fault = match columns {
            0 => format!("expected the header {HEADER} or {CUT}, found the end of the file"),
            _ => "expected at least one direction, found the end of the file".to_owned(),
        };
        return Err(at_line(lines, fault));
    }
    table(rows).map_err(|(line, fault)| at_line(line, fault))
}

/// Number of a cell within `most` of 0.
fn number(name: &str, cell: &str, most: f64) -> Result<f64, String> {
    match cell.parse::<f64>() {
        // Adding 0 makes -0 equal to 0 in every order.
        Ok(value) if value.abs() <= most => Ok(value + 0.0),
        _ => Err(format!(
            "{name}: expected a number from -{most} to {most}, found '{cell}'"
        )),
    }
}

/// Table of the rows; an error has the line of the first direction that does not fit into the lattice.
fn table(mut rows: Vec<Row>) -> Result<PatternTable, (u64, String)> {
    rows.sort_by(|a, b| {
        let elevations = a.elevation_deg.total_cmp(&b.elevation_deg);
        elevations.then(a.azimuth_deg.total_cmp(&b.azimuth_deg))
    });
    let first_deg = rows[0].elevation_deg;
    let columns = rows.iter().take_while(|row| row.elevation_deg == first_deg);
    let columns = columns.count();
    for (at, row) in rows.iter().enumerate() {
        let above = &rows[at % columns];
        if at > 0 && {
            let before = &rows[at - 1];
            before.azimuth_deg == row.azimuth_deg && before.elevation_deg == row.elevation_deg
        } {
            return Err((
                row.line.max(rows[at - 1].line),
                format!(
                    "azimuth {} deg, elevation {} deg: expected one gain, found two",
                    row.azimuth_deg, row.elevation_deg
                ),
            ));
        }
        let starts = rows[at - at % columns].elevation_deg;
        if row.azimuth_deg != above.azimuth_deg || row.elevation_deg != starts {
            return Err((
                row.line,
                format!(
                    "azimuth {} deg, elevation {} deg: expected the same {columns} azimuths at each elevation, as at {first_deg} deg",
                    row.azimuth_deg, row.elevation_deg
                ),
            ));
        }
    }
    let last = &rows[rows.len() - 1];
    if !rows.len().is_multiple_of(columns) {
        return Err((
            last.line,
            format!(
                "elevation {} deg: expected {columns} azimuths, found {}",
                last.elevation_deg,
                rows.len() % columns
            ),
        ));
    }
    let azimuths = rows[..columns]
        .iter()
        .map(|row| row.azimuth_deg.to_radians());
    let elevations = rows.iter().step_by(columns);
    let gains: Vec<f64> = rows.iter().map(|row| row.gain_db).collect();
    let elevations = elevations.map(|row| row.elevation_deg.to_radians());
    PatternTable::new(azimuths.collect(), elevations.collect(), &gains)
        .map_err(|fault| (last.line, fault))
}

/// Text of a pattern, which [`read`] restores to rounding.
pub fn text(table: &PatternTable) -> String {
    let mut text = format!("# {TEXT_MARK}\n{HEADER}\n");
    let directions = table.elevation_rad().iter().flat_map(|elevation| {
        let azimuths = table.azimuth_rad().iter();
        azimuths.map(move |azimuth| [azimuth.to_degrees(), elevation.to_degrees()])
    });
    for ([azimuth, elevation], gain) in directions.zip(table.gain_db()) {
        writeln!(text, "{azimuth:?},{elevation:?},{gain:?}").expect("text grows");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pattern(text: &str) -> Result<PatternTable, String> {
        read_from(text.as_bytes(), Path::new("a.csv")).map_err(|error| error.to_string())
    }

    #[test]
    fn lattice_in_any_order_reads_back_from_its_text() {
        let table = pattern(
            "# horn\nazimuth_deg,elevation_deg,gain_db\n10,0,-20\n-10,0,-6\n\n0,5,-3\n0,0,12\n-10,5,1\n10,5,2\n",
        )
        .unwrap();
        let expected = [-6.0, 12.0, -20.0, 1.0, -3.0, 2.0].map(|db| db - 12.0);
        for (gain, expected) in table.gain_db().iter().zip(expected) {
            // dB to amplitude and back rounds to some 1e-14.
            assert!((gain - expected).abs() < 1e-12, "{gain}");
        }
        assert!((table.azimuth_rad()[0] + 10f64.to_radians()).abs() < 1e-15);
        let again = pattern(&text(&table)).unwrap();
        for (a, b) in again.gain_db().iter().zip(table.gain_db()) {
            assert!((a - b).abs() < 1e-12);
        }
        let cut = pattern("azimuth_deg,gain_db\n-1,-3\n0,0\n1,-3\n").unwrap();
        assert_eq!(cut.elevation_rad(), [0.0]);
        assert_eq!(cut.amplitude(0.0, 1.0), 1.0);
    }

    #[test]
    fn faults_name_their_line() {
        let header = "azimuth_deg,elevation_deg,gain_db\n";
        for (rows, message) in [
            ("", "line 1: expected at least one direction"),
            ("0,0\n", "line 2: expected 3 values"),
            ("0,0,nan\n", "line 2: gain_db: expected a number"),
            ("0,91,0\n", "line 2: elevation_deg: expected"),
            ("0,0,0\n190,0,0\n", "line 3: azimuth_deg: expected"),
            (
                "0,0,0\n-0,0,1\n",
                "line 3: azimuth 0 deg, elevation 0 deg: expected one gain",
            ),
            (
                "0,0,0\n1,0,0\n0,1,0\n",
                "line 4: elevation 1 deg: expected 2 azimuths, found 1",
            ),
            ("0,0,0\n1,0,0\n0,1,0\n2,1,0\n", "line 5: azimuth 2 deg"),
            (
                "0,0,0\n1,0,0\n0,1,0\n0,2,0\n",
                "line 5: azimuth 0 deg, elevation 2 deg",
            ),
        ] {
            let error = pattern(&format!("{header}{rows}")).unwrap_err();
            assert!(error.contains(message), "{rows}: {error}");
        }
        for (text, message) in [
            ("", "expected the header"),
            ("azimuth,gain\n", "line 1: expected the header"),
        ] {
            let error = pattern(text).unwrap_err();
            assert!(error.contains(message), "{text}: {error}");
        }
    }
}
