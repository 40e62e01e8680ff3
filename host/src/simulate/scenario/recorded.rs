//! A platform's recorded track from a file.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use glam::DVec3;

use crate::geometry::SceneFrame;
use crate::simulate::body::Trajectory;
use crate::simulate::track::{Fix, Recorded, turned};

use super::error::Found;
use super::values::Values;

/// Longest file of a track, bytes: hours at a thousand fixes a second.
const LONGEST_BYTES: u64 = 1 << 30;

/// Columns of a CSV of positions, and of one with attitudes.
const POSITIONS: &str = "time_s,x_m,y_m,z_m";
const ATTITUDES: &str = "time_s,x_m,y_m,z_m,roll_deg,pitch_deg,yaw_deg";

/// The track in the platform's `file`.
pub(super) fn build(
    values: &Values,
    _frame: &SceneFrame,
    folder: &Path,
) -> Result<Arc<dyn Trajectory>, Found> {
    let path = folder.join(values.text("file"));
    let fail = |what: String| values.fault("file", format!("{}: {what}", path.display()));
    let bytes = fs::metadata(&path).map_err(|error| fail(error.to_string()))?;
    if bytes.len() > LONGEST_BYTES {
        return Err(fail("more than 1 GiB: is this a track?".to_owned()));
    }
    let text = fs::read_to_string(&path).map_err(|error| fail(error.to_string()))?;
    let fixes = parse_csv(&text).map_err(fail)?;
    let recorded = Recorded::new(&fixes).map_err(|error| fail(error.to_string()))?;
    Ok(Arc::new(recorded))
}

/// Lines of numbers under a line of names. Empty lines and what follows a `#` do not count.
fn parse_csv(text: &str) -> Result<Vec<Fix>, String> {
    let mut lines = text
        .lines()
        .zip(1..)
        .map(|(line, number)| (line.split('#').next().unwrap_or_default().trim(), number))
        .filter(|(line, _)| !line.is_empty());
    let Some((names, number)) = lines.next() else {
        return Err(format!("empty; write a line {POSITIONS}, then numbers"));
    };
    let names: String = names.chars().filter(|c| !c.is_whitespace()).collect();
    let columns = match names.as_str() {
        POSITIONS => 4,
        ATTITUDES => 7,
        _ => {
            return Err(format!(
                "line {number}: '{names}' are not the columns {POSITIONS} or {ATTITUDES}"
            ));
        }
    };
    lines
        .map(|(line, number)| {
            let cells: Vec<f64> = line
                .split(',')
                .map(|cell| cell.trim().parse().ok().filter(|v: &f64| v.is_finite()))
                .collect::<Option<_>>()
                .filter(|cells: &Vec<f64>| cells.len() == columns)
                .ok_or_else(|| format!("line {number}: '{line}' is not {columns} numbers"))?;
            let angle = |column: usize| cells[column].to_radians();
            Ok(Fix {
                time_s: cells[0],
                position_m: DVec3::from_slice(&cells[1..4]),
                attitude: (columns == 7).then(|| turned(angle(4), angle(5), angle(6))),
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_track_is_read_and_bad_lines_are_named() {
        let fixes = parse_csv("# made by hand\ntime_s, x_m, y_m, z_m\n0,1,2,3\n\n1.5,4,5,6 # end\n");
        let fixes = fixes.unwrap();
        assert_eq!(fixes.len(), 2);
        assert_eq!(fixes[1].time_s, 1.5);
        assert_eq!(fixes[1].position_m, DVec3::new(4.0, 5.0, 6.0));
        assert_eq!(fixes[1].attitude, None);
        // A yaw of 90 degrees turns x to y.
        let turned = parse_csv(&format!("{ATTITUDES}\n0,0,0,0,0,0,90\n")).unwrap();
        let forward = turned[0].attitude.unwrap() * DVec3::X;
        assert!(forward.distance(DVec3::Y) < 1e-15);
        for (text, part) in [
            ("", "empty"),
            ("t,x,y\n", "line 1: 't,x,y' are not the columns"),
            ("time_s,x_m,y_m,z_m\n0,1,2\n", "line 2: '0,1,2' is not 4 numbers"),
            ("time_s,x_m,y_m,z_m\n0,1,2,nan\n", "line 2"),
        ] {
            let error = parse_csv(text).unwrap_err();
            assert!(error.contains(part), "{error}");
        }
    }
}
