//! Motion of a target as comma-separated values.
//!
//! The columns are those of [`crate::track_csv`]; attitudes are ignored. Every line is a position of the target, metres
//! in the scene frame, at a time in seconds of the collection. Only differences of positions count: they may be relative to the
//! first line or to any other point. Times ascend, and there are at least two lines.
//!
//! ```text
//! time_s,x_m,y_m,z_m
//! 0.0,0,0,0
//! 0.1,1.18,0,0
//! 0.2,2.32,0,0
//! ```

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;

use glam::DVec3;
use subaperture_model::track::Displacement;

use crate::track_csv::{TrackCsvError, each_fix};

/// Read the displacement of a target.
///
/// # Errors
/// [`TrackCsvError`] with the line.
pub fn read(path: &Path) -> Result<Displacement, TrackCsvError> {
    let file = File::open(path).map_err(|source| TrackCsvError::Io {
        path: path.to_owned(),
        source,
    })?;
    read_from(BufReader::new(file), path)
}

/// Read the displacement of a target from a stream; `path` is for errors.
///
/// # Errors
/// As [`read`].
pub fn read_from(stream: impl BufRead, path: &Path) -> Result<Displacement, TrackCsvError> {
    let mut times_s: Vec<f64> = Vec::new();
    let mut positions_m: Vec<DVec3> = Vec::new();
    let lines = each_fix(stream, path, |fix| {
        if let Some(&last_s) = times_s.last()
            && fix.time_s <= last_s
        {
            return Err(format!(
                "expected a time after {last_s} s, that of the line before, found {} s",
                fix.time_s
            ));
        }
        times_s.push(fix.time_s);
        positions_m.push(fix.position_m);
        Ok(())
    })?;
    if times_s.len() < 2 {
        let fault = format!(
            "expected at least two positions, found {} up to the end of the file",
            times_s.len()
        );
        return Err(TrackCsvError::at_line(path, lines, fault));
    }
    Displacement::sampled(times_s, &positions_m).map_err(|source| TrackCsvError::Track {
        path: path.to_owned(),
        source,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn displacement(text: &str) -> Result<Displacement, String> {
        read_from(text.as_bytes(), Path::new("car.csv")).map_err(|error| error.to_string())
    }

    #[test]
    fn positions_are_relative_to_any_point() {
        for start in [0.0, 1000.0] {
            let rows = [0.0, 2.0, 4.0].map(|x| format!("{},{},-1,0\n", x / 4.0, start + x));
            let read = displacement(&format!("time_s,x_m,y_m,z_m\n{}", rows.concat())).unwrap();
            assert_eq!(read.span_s(), Some([0.0, 1.0]));
            let (moved_m, m_s) = read.between(0.25, 1.0);
            // Rounding of float64 at 1000 m.
            assert!(moved_m.distance(DVec3::X * 3.0) < 1e-12, "{moved_m}");
            assert!(m_s.distance(DVec3::X * 4.0) < 1e-11, "{m_s}");
        }
    }

    #[test]
    fn faults_name_file_line_and_expectation() {
        for (text, start) in [
            ("", "car.csv, line 1: expected a header"),
            (
                "time_s,x_m,y_m\n0,0,0\n1,0,0\n",
                "car.csv, line 1: column 'z_m' is missing",
            ),
            (
                "time_s,x_m,y_m,z_m\n",
                "car.csv, line 1: expected at least two positions, found 0",
            ),
            (
                "time_s,x_m,y_m,z_m\n0,0,0,0\n\n",
                "car.csv, line 3: expected at least two positions, found 1",
            ),
            (
                "time_s,x_m,y_m,z_m\n0,0,0,0\n1,0,NaN,0\n",
                "car.csv, line 3: y_m: expected a number up to 1e9, found 'NaN'",
            ),
            (
                "time_s,x_m,y_m,z_m\n0,0,0,0\n1,0,0,0\n# late\n0.5,0,0,0\n",
                "car.csv, line 5: expected a time after 1 s, that of the line before, found 0.5 s",
            ),
            (
                "time_s,x_m,y_m,z_m\n0,0,0,0\n0,0,0,0\n",
                "car.csv, line 3: expected a time after 0 s",
            ),
            (
                "time_s,x_m,y_m,z_m\n0,0,0,0\n0.001,1e6,0,0\n",
                "car.csv: track: points 1 and 2 are 1.000e-3 s and 1.000e6 m apart",
            ),
        ] {
            let error = displacement(text).unwrap_err();
            assert!(error.starts_with(start), "{error}");
        }
    }
}
