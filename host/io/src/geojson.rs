//! GeoJSON (RFC 7946) as shapes to draw: points, lines and outlines, each with its properties as text.
//!
//! A `FeatureCollection`, a `Feature` or a bare geometry of any of the seven types is read. Geometries of several
//! parts become one shape per part, polygons the outline of each ring. A feature with null geometry has no shape.
//! Coordinates are as in the file; the standard specifies longitude and latitude in degrees, then height above the
//! ellipsoid in metres.
//!
//! **Memory**: at most the limit given, and a buffer. At most [`MAX_BYTES`] of a file are read. **Errors** state the
//! feature.

use std::path::Path;

use serde_json::Value;

use super::ReadError;
use super::input::open_file;
use super::json::{self, JsonError, Limits};

/// Maximum file size in bytes.
pub const MAX_BYTES: u64 = 16 << 20;

/// Maximum magnitude of a coordinate.
const FARTHEST: f64 = 1e9;

/// Maximum number of properties per feature, and of characters of each.
const MAX_PROPERTIES: usize = 24;
const MAX_LETTERS: usize = 200;

/// Connection of the positions of a shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Separate points.
    Points,
    /// Open line from the first position to the last.
    Line,
    /// Closed line.
    Outline,
}

/// Two coordinates, and the third if present.
pub type Position = ([f64; 2], Option<f64>);

/// Part of a feature.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape {
    /// Connection of the positions.
    pub kind: Kind,
    /// At least one position; two for a line or an outline. The last position of an outline does not repeat the
    /// first.
    pub positions: Vec<Position>,
}

/// Feature: shapes and properties.
#[derive(Clone, Debug, PartialEq)]
pub struct Feature {
    /// Shapes of the feature.
    pub shapes: Vec<Shape>,
    /// Names and values of the properties that are text, numbers or booleans, truncated.
    pub properties: Vec<(String, String)>,
}

/// Read a file with at most `memory_bytes` of memory.
///
/// # Errors
/// [`ReadError::Io`]; [`ReadError::Malformed`] if it is not GeoJSON or needs more memory.
pub fn read(path: &Path, memory_bytes: u64) -> Result<Vec<Feature>, ReadError> {
    let io = ReadError::io(path);
    let file = open_file(path).map_err(&io)?;
    let format = |what| ReadError::malformed(path, what);
    // Features take at most half of the memory of their values: a position takes 32 bytes, doubled while a list
    // grows, against a list of numbers.
    let root = json::value(file, limits(memory_bytes / 3 * 2)).map_err(|error| match error {
        JsonError::Io(source) => io(source),
        JsonError::Long { of: "JSON", most } => format(format!(
            "expected at most {most} bytes of shapes, found more: remove shapes that need not be drawn"
        )),
        JsonError::Memory { .. } => format(format!(
            "shapes need more than {memory_bytes} bytes of memory: remove shapes that need not be drawn, or allow more \
             memory"
        )),
        error => format(error.to_string()),
    })?;
    features(&root).map_err(format)
}

const fn limits(value_bytes: u64) -> Limits {
    Limits {
        bytes: MAX_BYTES,
        string_bytes: 1 << 20,
        value_bytes,
    }
}

/// Parse GeoJSON text.
///
/// # Errors
/// Description of the fault, with the feature.
pub fn parse(bytes: &[u8]) -> Result<Vec<Feature>, String> {
    let root = json::value(bytes, limits(u64::MAX)).map_err(|error| error.to_string())?;
    features(&root)
}

fn features(root: &Value) -> Result<Vec<Feature>, String> {
    match root["type"].as_str() {
        Some("FeatureCollection") => {
            let all = root["features"]
                .as_array()
                .ok_or("FeatureCollection: expected a list of features")?;
            let each = all.iter().enumerate();
            each.map(|(i, one)| feature(one).map_err(|what| format!("feature {}: {what}", i + 1)))
                .collect()
        }
        Some("Feature") => Ok(vec![feature(root)?]),
        Some(_) => {
            let mut shapes = Vec::new();
            geometry(root, &mut shapes)?;
            Ok(vec![Feature {
                shapes,
                properties: Vec::new(),
            }])
        }
        None => Err("not GeoJSON: expected a type such as FeatureCollection".to_owned()),
    }
}

fn feature(value: &Value) -> Result<Feature, String> {
    if value["type"] != "Feature" {
        return Err("expected type Feature".to_owned());
    }
    let mut shapes = Vec::new();
    if !value["geometry"].is_null() {
        geometry(&value["geometry"], &mut shapes)?;
    }
    let cut = |text: &str| text.chars().take(MAX_LETTERS).collect::<String>();
    let said = value["properties"].as_object().into_iter().flatten();
    let properties = said.filter_map(|(name, value)| {
        let text = match value {
            Value::String(text) => cut(text),
            Value::Number(number) => number.to_string(),
            Value::Bool(truth) => truth.to_string(),
            _ => return None,
        };
        Some((cut(name), text))
    });
    Ok(Feature {
        shapes,
        properties: properties.take(MAX_PROPERTIES).collect(),
    })
}

/// Add the parts of a geometry. The JSON reader limits the depth to 128 levels.
fn geometry(value: &Value, shapes: &mut Vec<Shape>) -> Result<(), String> {
    let name = value["type"].as_str().unwrap_or_default();
    if name == "GeometryCollection" {
        let all = value["geometries"].as_array();
        let all = all.ok_or("GeometryCollection: expected a list of geometries")?;
        return all.iter().try_for_each(|one| geometry(one, shapes));
    }
    let coordinates = &value["coordinates"];
    let mut add = |kind, positions: Vec<Position>| {
        if !positions.is_empty() {
            shapes.push(Shape { kind, positions });
        }
    };
    match name {
        "Point" => add(Kind::Points, vec![position(coordinates)?]),
        "MultiPoint" => add(Kind::Points, positions(coordinates)?),
        "LineString" => add(Kind::Line, line(coordinates)?),
        "MultiLineString" => {
            for one in list(coordinates)? {
                add(Kind::Line, line(one)?);
            }
        }
        "Polygon" => {
            for one in list(coordinates)? {
                add(Kind::Outline, outline(one)?);
            }
        }
        "MultiPolygon" => {
            for polygon in list(coordinates)? {
                for one in list(polygon)? {
                    add(Kind::Outline, outline(one)?);
                }
            }
        }
        "" => return Err("geometry: expected a type".to_owned()),
        other => {
            return Err(format!(
                "expected a geometry type, found '{}'",
                shortened(other)
            ));
        }
    }
    Ok(())
}

fn shortened(text: &str) -> String {
    text.chars().take(40).collect()
}

fn list(value: &Value) -> Result<&Vec<Value>, String> {
    value
        .as_array()
        .ok_or_else(|| "expected coordinates as a list".to_owned())
}

fn positions(value: &Value) -> Result<Vec<Position>, String> {
    list(value)?.iter().map(position).collect()
}

fn line(value: &Value) -> Result<Vec<Position>, String> {
    let all = positions(value)?;
    match all.len() {
        1 => Err("line: expected two or more positions, found one".to_owned()),
        _ => Ok(all),
    }
}

fn outline(value: &Value) -> Result<Vec<Position>, String> {
    let mut all = positions(value)?;
    if all.len() > 1 && all.first() == all.last() {
        all.pop();
    }
    match all.len() {
        1 => Err("outline: expected two or more positions, found one".to_owned()),
        _ => Ok(all),
    }
}

fn position(value: &Value) -> Result<Position, String> {
    let numbers = list(value)?;
    let number = |i: usize| numbers.get(i).and_then(Value::as_f64);
    let near = |x: &f64| x.abs() <= FARTHEST;
    let (Some(a), Some(b)) = (number(0).filter(near), number(1).filter(near)) else {
        return Err(format!(
            "expected positions of two numbers between -{FARTHEST:e} and {FARTHEST:e}"
        ));
    };
    Ok(([a, b], number(2).filter(near)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_geometry_types_become_points_lines_and_outlines() {
        let text = br#"{"type":"FeatureCollection","features":[
            {"type":"Feature","properties":{"name":"a","level":-3.5,"seen":true,"list":[1],"no":null},"geometry":{"type":"Point","coordinates":[1,2]}},
            {"type":"Feature","properties":null,"geometry":{"type":"MultiPolygon","coordinates":[[[[0,0],[1,0],[1,1],[0,0]],[[2,2],[3,2],[3,3],[2,2]]]]}},
            {"type":"Feature","geometry":{"type":"GeometryCollection","geometries":[
                {"type":"MultiLineString","coordinates":[[[0,0,7],[1,1,8]],[]]},{"type":"MultiPoint","coordinates":[[5,6],[7,8]]}]}},
            {"type":"Feature","geometry":null}]}"#;
        let all = parse(text).unwrap();
        let counts: Vec<Vec<(Kind, usize)>> = all
            .iter()
            .map(|feature| {
                let each = feature.shapes.iter();
                each.map(|shape| (shape.kind, shape.positions.len()))
                    .collect()
            })
            .collect();
        assert_eq!(
            counts,
            [
                vec![(Kind::Points, 1)],
                vec![(Kind::Outline, 3), (Kind::Outline, 3)],
                vec![(Kind::Line, 2), (Kind::Points, 2)],
                vec![]
            ]
        );
        let said: Vec<(&str, &str)> = all[0]
            .properties
            .iter()
            .map(|(a, b)| (a.as_str(), b.as_str()))
            .collect();
        let mut said = said;
        said.sort_unstable();
        assert_eq!(said, [("level", "-3.5"), ("name", "a"), ("seen", "true")]);
        assert_eq!(all[2].shapes[0].positions[1], ([1.0, 1.0], Some(8.0)));
        let alone = parse(br#"{"type":"LineString","coordinates":[[0,0],[1,1]]}"#).unwrap();
        assert_eq!(alone[0].shapes[0].kind, Kind::Line);
    }

    #[test]
    fn invalid_geojson_names_the_position() {
        for (text, part) in [
            ("", "not JSON"),
            ("[]", "not GeoJSON"),
            (r#"{"type":"FeatureCollection"}"#, "expected a list"),
            (
                r#"{"type":"FeatureCollection","features":[{"type":"Feature","geometry":null},{}]}"#,
                "feature 2",
            ),
            (r#"{"type":"Point","coordinates":[1]}"#, "two numbers"),
            (r#"{"type":"Point","coordinates":[1,1e300]}"#, "two numbers"),
            (
                r#"{"type":"LineString","coordinates":[[1,2]]}"#,
                "found one",
            ),
            (r#"{"type":"Circle","coordinates":[[1,2]]}"#, "'Circle'"),
            (
                r#"{"type":"Polygon","coordinates":7}"#,
                "coordinates as a list",
            ),
        ] {
            let error = parse(text.as_bytes()).unwrap_err();
            assert!(error.contains(part), "{text}: {error}");
        }
    }
}
