//! Rigid-body tracks exported by OptiTrack Motive as comma-separated values.
//!
//! ```text
//! Format Version,1.23,Take Name,walk,...,Rotation Type,Quaternion,Length Units,Meters,Coordinate Space,Global
//!
//! ,Type,Rigid Body,Rigid Body,...            or without the words Type and Name
//! ,Name,radar,radar,...
//! ,ID,1,1,...
//! ,,Rotation,Rotation,Rotation,Rotation,Position,Position,Position,Mean Marker Error
//! Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,
//! 0,0.000000,0.1,...
//! ```
//!
//! Times are in seconds, positions in the unit stated by the first line, rotations quaternions or Euler angles in
//! degrees according to its `Rotation Type`: `Quaternion`, or an order such as `XYZ`. Angles are right-handed, and
//! each rotation is about the body's axis after the previous ones (intrinsic): `XYZ` means `R_x R_y R_z`. The axes
//! are y up unless the caller states otherwise. Frames without the body have empty cells and are skipped, so callers
//! must check the times of the fixes. A body's own axes are those of the capture volume at the time the body was
//! defined, converted like the track.

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;

use glam::{DQuat, DVec3};

use super::track_axes::TrackAxes;
use super::track_csv::{TrackCsvError, each_line};
use subaperture_model::track::Fix;

/// Maximum line length in bytes; takes of many markers have long lines.
const LONGEST_LINE: u64 = 1 << 20;

/// Maximum number of lines before the table.
const MAX_HEADERS: usize = 32;

/// Maximum coordinate in metres and maximum time in seconds.
const FARTHEST: f64 = 1e9;

/// Read the fixes of a rigid body. `None` selects the only body.
///
/// # Errors
/// [`TrackCsvError`] with the line.
pub fn read(path: &Path, body: Option<&str>, axes: TrackAxes) -> Result<Vec<Fix>, TrackCsvError> {
    let file = File::open(path).map_err(|source| TrackCsvError::Io {
        path: path.to_owned(),
        source,
    })?;
    read_from(BufReader::new(file), path, body, axes)
}

/// Like [`read`], from a stream; `path` is for errors.
///
/// # Errors
/// As [`read`].
pub fn read_from(
    stream: impl BufRead,
    path: &Path,
    body: Option<&str>,
    axes: TrackAxes,
) -> Result<Vec<Fix>, TrackCsvError> {
    let mut headers: Vec<Vec<String>> = Vec::new();
    let mut columns: Option<Columns> = None;
    let mut fixes = Vec::new();
    let lines = each_line(stream, path, LONGEST_LINE, |text| {
        let cells: Vec<&str> = text
            .trim_end_matches(['\r', '\n'])
            .split(',')
            .map(|cell| cell.trim().trim_matches('"'))
            .collect();
        match &columns {
            Some(_) if cells.iter().all(|cell| cell.is_empty()) => {}
            Some(columns) => fixes.extend(columns.fix(&cells, axes)?),
            None if cells[0] == "Frame" => columns = Some(Columns::of(&headers, &cells, body)?),
            None => {
                if headers.is_empty() && cells[0] != "Format Version" {
                    return Err(
                        "expected 'Format Version' at the start of a Motive export; for other columns use kind = \"csv\"".to_owned(),
                    );
                }
                if headers.len() == MAX_HEADERS {
                    return Err(
                        "expected a line that begins with 'Frame' before the table".to_owned()
                    );
                }
                headers.push(cells.into_iter().map(str::to_owned).collect());
            }
        }
        Ok(())
    })?;
    let whole = |what: &str| TrackCsvError::Line {
        path: path.to_owned(),
        line: lines.max(1),
        what: what.to_owned(),
    };
    match columns {
        None => Err(whole(
            "expected a line that begins with 'Frame', found the end of the file",
        )),
        Some(_) if fixes.is_empty() => Err(whole("the body is missing in all frames")),
        Some(_) => Ok(fixes),
    }
}

/// Columns of the body's values.
struct Columns {
    count: usize,
    position: [usize; 3],
    rotation: Option<Rotation>,
    unit_m: f64,
}

/// Columns of a rotation.
enum Rotation {
    /// x, y, z and w of a quaternion.
    Quaternion([usize; 4]),
    /// Axes (0 to 2) in rotation order, and the column of each angle.
    Euler([(usize, usize); 3]),
}

impl Rotation {
    fn columns(&self) -> Vec<usize> {
        match self {
            Self::Quaternion(columns) => columns.to_vec(),
            Self::Euler(turns) => turns.iter().map(|&(_, column)| column).collect(),
        }
    }
}

/// Axes of an Euler angle order, 0 to 2.
fn order(text: &str) -> Option<[usize; 3]> {
    let axes: Vec<usize> = text.chars().filter_map(|c| "XYZ".find(c)).collect();
    let order: [usize; 3] = axes.try_into().ok()?;
    let all = [0, 1, 2].iter().all(|axis| order.contains(axis));
    (all && text.len() == 3).then_some(order)
}

/// Unit of length in metres, and the rotation type if stated, from the first header line.
fn conventions(first: &[String]) -> Result<(f64, Option<&str>), String> {
    let said = |what: &str| {
        let at = first.iter().position(|cell| cell == what)?;
        first.get(at + 1).map(String::as_str)
    };
    let unit_m = match said("Length Units") {
        Some("Meters") => 1.0,
        Some("Centimeters") => 1e-2,
        Some("Millimeters") => 1e-3,
        Some(other) => return Err(format!("expected Length Units Meters or Millimeters, found '{other}': export again")),
        None => return Err("the first line states no Length Units: export with the header, in Meters or Millimeters".to_owned()),
    };
    if let Some(other) = said("Coordinate Space").filter(|space| *space != "Global") {
        return Err(format!(
            "expected the coordinate space Global, found '{other}': export again"
        ));
    }
    Ok((unit_m, said("Rotation Type")))
}

/// Rigid body by its name, or the only one.
fn chosen(asked: Option<&str>, bodies: &[String]) -> Result<String, String> {
    let list = || {
        bodies
            .iter()
            .map(|name| format!("'{name}'"))
            .collect::<Vec<_>>()
            .join(", ")
    };
    match (asked, bodies) {
        (Some(asked), _) if bodies.iter().any(|name| name == asked) => Ok(asked.to_owned()),
        (Some(asked), _) => Err(format!(
            "expected one of the rigid bodies {}, found '{asked}'",
            list()
        )),
        (None, [only]) => Ok(only.clone()),
        (None, _) => Err(format!(
            "the take has several rigid bodies: select one of {} by 'body'",
            list()
        )),
    }
}

impl Columns {
    fn of(headers: &[Vec<String>], letters: &[&str], body: Option<&str>) -> Result<Self, String> {
        let (first, rows) = headers
            .split_first()
            .ok_or("the table has no header lines before it")?;
        let (unit_m, kind) = conventions(first)?;
        let rows: Vec<&Vec<String>> = rows
            .iter()
            .filter(|row| row.iter().any(|cell| !cell.is_empty()))
            .collect();
        let types = rows
            .iter()
            .position(|row| row.iter().any(|cell| cell == "Rigid Body"));
        let types = types.ok_or("the take has no Rigid Body: define one, and export it")?;
        let (Some(names), Some(kinds)) = (rows.get(types + 1), rows.last()) else {
            return Err("the lines before the table lack names or kinds of its columns".to_owned());
        };
        let cell = |row: &[String], column: usize| row.get(column).cloned().unwrap_or_default();
        let of_body = |column: &usize| cell(rows[types], *column) == "Rigid Body";
        let mut bodies: Vec<String> = Vec::new();
        for column in (2..letters.len()).filter(of_body) {
            let name = cell(names, column);
            if !bodies.contains(&name) {
                bodies.push(name);
            }
        }
        let body = chosen(body, &bodies)?;
        let find = |kind: &str, letter: &str| {
            (2..letters.len()).find(|column| {
                of_body(column)
                    && cell(names, *column) == body
                    && cell(kinds, *column) == kind
                    && letters[*column] == letter
            })
        };
        let position = ["X", "Y", "Z"].map(|letter| find("Position", letter));
        let [Some(x), Some(y), Some(z)] = position else {
            return Err(format!(
                "the body '{body}' has no columns of Position X, Y and Z"
            ));
        };
        let found = ["X", "Y", "Z", "W"].map(|letter| find("Rotation", letter));
        let rotation = match (found, kind.map(|kind| (kind, order(kind)))) {
            ([None, None, None, None], _) => None,
            ([Some(x), Some(y), Some(z), Some(w)], None | Some(("Quaternion", _))) => {
                Some(Rotation::Quaternion([x, y, z, w]))
            }
            ([Some(x), Some(y), Some(z), None], Some((_, Some(axes)))) => {
                Some(Rotation::Euler(axes.map(|axis| (axis, [x, y, z][axis]))))
            }
            (found, kind) => {
                let columns = ["X", "Y", "Z", "W"].into_iter().zip(found);
                let columns: Vec<&str> = columns
                    .filter(|(_, at)| at.is_some())
                    .map(|(c, _)| c)
                    .collect();
                return Err(format!(
                    "the body '{body}' has columns of Rotation {}, and the first line's Rotation Type is {}; supported are X, Y, Z and W of \
                     'Quaternion', and X, Y and Z in degrees of 'XYZ', 'XZY', 'YXZ', 'YZX', 'ZXY' or 'ZYX': export one of them",
                    columns.join(", "),
                    kind.map_or("not given".to_owned(), |(kind, _)| format!("'{kind}'"))
                ));
            }
        };
        Ok(Self {
            count: letters.len(),
            position: [x, y, z],
            rotation,
            unit_m,
        })
    }

    /// Fix of a row. `None` if the frame lacks the body.
    fn fix(&self, cells: &[&str], axes: TrackAxes) -> Result<Option<Fix>, String> {
        // Some exports omit the comma before an empty last column.
        if cells.len() + 1 < self.count {
            return Err(format!(
                "expected {1} values as in the header, found {0}",
                cells.len(),
                self.count
            ));
        }
        let cell = |column: usize| cells.get(column).copied().unwrap_or_default();
        let number = |column: usize, what: &str| match cell(column).parse::<f64>() {
            Ok(value) if value.abs() <= FARTHEST => Ok(value),
            _ => Err(format!(
                "{what} (column {}): expected a number, found '{}'",
                column + 1,
                cell(column)
            )),
        };
        let time_s = number(1, "Time")?;
        let rotation = self.rotation.iter().flat_map(Rotation::columns);
        let mut all = self.position.into_iter().chain(rotation);
        if all.all(|column| cell(column).is_empty()) {
            return Ok(None);
        }
        let [x, y, z] = self.position;
        let place = DVec3::new(number(x, "X")?, number(y, "Y")?, number(z, "Z")?);
        let attitude = match self.rotation {
            None => None,
            Some(Rotation::Euler(turns)) => {
                let mut attitude = DQuat::IDENTITY;
                for (axis, column) in turns {
                    let letter = ["X", "Y", "Z"][axis];
                    let angle_rad = number(column, letter)?.to_radians();
                    attitude *= DQuat::from_axis_angle(DVec3::AXES[axis], angle_rad);
                }
                Some(axes.turn_attitude(attitude.normalize()))
            }
            Some(Rotation::Quaternion([x, y, z, w])) => {
                let q = DQuat::from_xyzw(
                    number(x, "X")?,
                    number(y, "Y")?,
                    number(z, "Z")?,
                    number(w, "W")?,
                );
                if (q.length() - 1.0).abs() > 1e-2 {
                    return Err(format!(
                        "rotation: expected a quaternion of length 1, found {:.4}",
                        q.length()
                    ));
                }
                Some(axes.turn_attitude(q.normalize()))
            }
        };
        Ok(Some(Fix {
            time_s,
            position_m: axes.turn(place * self.unit_m),
            attitude,
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TAKE: &str = "Format Version,1.23,Take Name,walk,Rotation Type,Quaternion,Length Units,Millimeters,Coordinate Space,Global\n\
        \n\
        ,Type,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body Marker\n\
        ,Name,radar,radar,radar,radar,radar,radar,radar,radar,radar:Marker1\n\
        ,ID,1,1,1,1,1,1,1,1,1\n\
        ,,Rotation,Rotation,Rotation,Rotation,Position,Position,Position,Mean Marker Error,Position\n\
        Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,,X\n\
        0,0.000000,0,0,0,1,100.0,1500.0,-20.0,0.1,5\n\
        1,0.008333,,,,,,,,,\n\
        2,0.016667,0,0.38268343,0,0.92387953,110.0,1500.0,-20.0,0.1,5\n";

    /// Take with Euler angles in degrees.
    fn euler(order: &str, degrees: [f64; 3]) -> String {
        let [x, y, z] = degrees;
        format!(
            "Format Version,1.23,Take Name,walk,Rotation Type,{order},Length Units,Meters,Coordinate Space,Global\n\
             ,Type,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body\n,Name,r,r,r,r,r,r\n,ID,1,1,1,1,1,1\n\
             ,,Rotation,Rotation,Rotation,Position,Position,Position\nFrame,Time (Seconds),X,Y,Z,X,Y,Z\n\
             0,0.0,{x},{y},{z},1,2,3\n1,0.1,,,,,,\n2,0.2,{x},{y},{z},1,2,3\n"
        )
    }

    #[test]
    fn euler_angles_rotate_in_their_order() {
        // Rotations of vectors about the fixed axes x, y and z, the last of the order first.
        let about = |axis: usize, degrees: f64, v: [f64; 3]| {
            let (s, c) = degrees.to_radians().sin_cos();
            let [i, j] = [(axis + 1) % 3, (axis + 2) % 3];
            let mut turned = v;
            turned[i] = c * v[i] - s * v[j];
            turned[j] = s * v[i] + c * v[j];
            turned
        };
        let degrees = [40.0, -25.0, 70.0];
        for order in ["XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"] {
            let read = read_from(
                euler(order, degrees).as_bytes(),
                Path::new("take.csv"),
                None,
                TrackAxes::PLAIN,
            );
            let read = read.unwrap();
            assert_eq!(read.len(), 2);
            let mut expected = [0.3, -0.5, 0.8];
            for letter in order.chars().rev() {
                let axis = "XYZ".find(letter).unwrap();
                expected = about(axis, degrees[axis], expected);
            }
            let found = read[0].attitude.unwrap() * DVec3::new(0.3, -0.5, 0.8);
            assert!(
                found.distance(expected.into()) < 1e-12,
                "{order}: {found} {expected:?}"
            );
        }
        for kind in ["Quaternion", "XYX", "xyz", "Euler"] {
            let error = fixes(&euler(kind, degrees), None).unwrap_err();
            assert!(
                error.contains("Rotation X, Y, Z") && error.contains(kind),
                "{error}"
            );
        }
        let unnamed = euler("XYZ", degrees).replace("Rotation Type,XYZ,", "");
        assert!(fixes(&unnamed, None).unwrap_err().contains("not given"));
    }

    fn fixes(text: &str, body: Option<&str>) -> Result<Vec<Fix>, String> {
        let read = read_from(
            text.as_bytes(),
            Path::new("take.csv"),
            body,
            TrackAxes::y_up(),
        );
        read.map_err(|error| error.to_string())
    }

    #[test]
    fn body_is_read_in_metres_with_z_up() {
        for text in [
            TAKE.to_owned(),
            TAKE.replace(",Type,", ",,")
                .replace(",Name,", ",,")
                .replace('\n', "\r\n"),
        ] {
            let read = fixes(&text, None).unwrap();
            // The second frame lacks the body.
            assert_eq!(read.len(), 2);
            assert!(
                read[0].position_m.distance(DVec3::new(0.1, 0.02, 1.5)) < 1e-12,
                "{read:?}"
            );
            assert_eq!(read[1].time_s, 0.016667);
            // An eighth of a turn about the vertical.
            let nose = read[1].attitude.unwrap() * DVec3::X;
            assert!(
                nose.distance(DVec3::new(0.5f64.sqrt(), 0.5f64.sqrt(), 0.0)) < 1e-7,
                "{nose}"
            );
        }
        assert_eq!(fixes(TAKE, Some("radar")).unwrap().len(), 2);
    }

    #[test]
    fn faults_name_their_line() {
        for (from, to, part) in [
            (
                "Format Version",
                "time_s",
                "line 1: expected 'Format Version'",
            ),
            (
                "Millimeters",
                "Inches",
                "line 7: expected Length Units Meters or Millimeters, found 'Inches'",
            ),
            (
                "Global",
                "Local",
                "line 7: expected the coordinate space Global, found 'Local'",
            ),
            ("Frame,", "frame,", "found the end of the file"),
            ("Rigid Body,", "Bone,", "line 7: the take has no Rigid Body"),
            (
                "Rotation,Rotation,Rotation,Rotation,Position",
                "Rotation,Rotation,Rotation,Rotation,Other",
                "no columns of Position",
            ),
            (
                "110.0",
                "far",
                "line 10: X (column 7): expected a number, found 'far'",
            ),
            (
                "0.92387953",
                "2",
                "line 10: rotation: expected a quaternion of length 1, found 2.0",
            ),
            (
                "0.008333,,,,,,,,,",
                "0.008333,,",
                "line 9: expected 11 values",
            ),
            (
                "0.016667",
                "soon",
                "line 10: Time (column 2): expected a number, found 'soon'",
            ),
        ] {
            assert!(TAKE.contains(from), "{from}");
            let error = fixes(&TAKE.replace(from, to), None).unwrap_err();
            assert!(error.contains(part), "{from}: {error}");
        }
        let error = fixes(TAKE, Some("walker")).unwrap_err();
        assert!(
            error.contains("expected one of the rigid bodies 'radar', found 'walker'"),
            "{error}"
        );
        let two = TAKE
            .replace("radar,radar,radar\n", "radar,radar,cart\n")
            .replace("radar,radar,radar:", "radar,cart,radar:");
        assert!(
            fixes(&two, None)
                .unwrap_err()
                .contains("several rigid bodies")
        );
        assert!(fixes("", None).is_err());
    }

    #[test]
    fn missing_last_value_counts_as_empty() {
        let take = "Format Version,1.23,Length Units,Meters\n,Type,Rigid Body,Rigid Body,Rigid Body\n,Name,r,r,r\n\
            ,ID,1,1,1\n,,Position,Position,Position\nFrame,Time (Seconds),X,Y,Z\n0,0.5,1,2,3\n1,1.0,,\n";
        assert_eq!(fixes(take, None).unwrap().len(), 1);
        let error = fixes(&take.replace("1,1.0,,", "1,1.0,1,2"), None).unwrap_err();
        assert!(
            error.contains("line 8: Z (column 5): expected a number, found ''"),
            "{error}"
        );
    }
}
