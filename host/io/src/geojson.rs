//! GeoJSON (RFC 7946), of which a picture needs shapes and what is said of them: points, lines and outlines, each with its properties as text.
//!
//! Read are a `FeatureCollection`, a `Feature` or a geometry alone, of any of the seven types; geometries of several parts become a shape each, polygons the outline of
//! each of their rings. A feature whose geometry is null has no shape. Coordinates are what the file has, in its order: of the standard
//! longitude and latitude in degrees, then metres above the ellipsoid.
//!
//! **Memory** as much as is allowed, and a buffer; of the file [`MAX_BYTES`] are read. **Errors** say at which feature.

use std::path::Path;

use serde_json::Value;

use super::ReadError;
use super::input::open_file;
use super::json::{self, JsonError, Limits};

/// The longest file that is read.
pub const MAX_BYTES: u64 = 16 << 20;

/// Farthest that a coordinate may lie from zero.
const FARTHEST: f64 = 1e9;

/// Properties of a feature that are kept, and letters of each.
const MAX_PROPERTIES: usize = 24;
const MAX_LETTERS: usize = 200;

/// How positions hang together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Each by itself.
    Points,
    /// From the first to the last.
    Line,
    /// And back to the first.
    Outline,
}

/// A position: two coordinates, and a third if there is one.
pub type Position = ([f64; 2], Option<f64>);

/// A part of a feature.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape {
    /// How positions hang together.
    pub kind: Kind,
    /// At least one; two of a line, and of an outline, whose last is not the first again.
    pub positions: Vec<Position>,
}

/// A thing and what is said of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Feature {
    /// Its parts.
    pub shapes: Vec<Shape>,
    /// Names and values of properties that are text, numbers, or true or false, cut to some letters.
    pub properties: Vec<(String, String)>,
}

/// Read a file, holding at most `memory_bytes`.
///
/// # Errors
/// [`ReadError::Io`]; [`ReadError::Malformed`] if it is not GeoJSON or takes more memory.
pub fn read(path: &Path, memory_bytes: u64) -> Result<Vec<Feature>, ReadError> {
    let io = ReadError::io(path);
    let file = open_file(path).map_err(&io)?;
    let format = |what| ReadError::malformed(path, what);
    // Features take a half of what their values do, at the most: a position 32 bytes, doubled while a list grows, for a list of numbers.
    let root = json::value(file, limits(memory_bytes / 3 * 2)).map_err(|error| match error {
        JsonError::Io(source) => io(source),
        JsonError::Long { of: "JSON", most } => format(format!(
            "expected at most {most} bytes of shapes, found more: leave out what is not to be seen"
        )),
        JsonError::Memory { .. } => format(format!(
            "its shapes take more than the {memory_bytes} bytes of memory that they may take: leave out what is not to be seen, or give more \
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

/// Reads a text.
///
/// # Errors
/// What is wrong with it, and at which feature.
pub fn parse(bytes: &[u8]) -> Result<Vec<Feature>, String> {
    let root = json::value(bytes, limits(u64::MAX)).map_err(|error| error.to_string())?;
    features(&root)
}

fn features(root: &Value) -> Result<Vec<Feature>, String> {
    match root["type"].as_str() {
        Some("FeatureCollection") => {
            let all = root["features"]
                .as_array()
                .ok_or("its FeatureCollection has no list of features")?;
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
        None => Err("no GeoJSON: it has no type such as FeatureCollection".to_owned()),
    }
}

fn feature(value: &Value) -> Result<Feature, String> {
    if value["type"] != "Feature" {
        return Err("its type is not Feature".to_owned());
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

/// Adds the parts of a geometry. No deeper than JSON's reader goes, 128 levels.
fn geometry(value: &Value, shapes: &mut Vec<Shape>) -> Result<(), String> {
    let name = value["type"].as_str().unwrap_or_default();
    if name == "GeometryCollection" {
        let all = value["geometries"].as_array();
        let all = all.ok_or("its GeometryCollection has no list of geometries")?;
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
        "" => return Err("a geometry without a type".to_owned()),
        other => return Err(format!("'{}' is no geometry", shortened(other))),
    }
    Ok(())
}

fn shortened(text: &str) -> String {
    text.chars().take(40).collect()
}

fn list(value: &Value) -> Result<&Vec<Value>, String> {
    value
        .as_array()
        .ok_or_else(|| "its coordinates are no list".to_owned())
}

fn positions(value: &Value) -> Result<Vec<Position>, String> {
    list(value)?.iter().map(position).collect()
}

fn line(value: &Value) -> Result<Vec<Position>, String> {
    let all = positions(value)?;
    match all.len() {
        1 => Err("a line of one position".to_owned()),
        _ => Ok(all),
    }
}

fn outline(value: &Value) -> Result<Vec<Position>, String> {
    let mut all = positions(value)?;
    if all.len() > 1 && all.first() == all.last() {
        all.pop();
    }
    match all.len() {
        1 => Err("an outline of one position".to_owned()),
        _ => Ok(all),
    }
}

fn position(value: &Value) -> Result<Position, String> {
    let numbers = list(value)?;
    let number = |i: usize| numbers.get(i).and_then(Value::as_f64);
    let near = |x: &f64| x.abs() <= FARTHEST;
    let (Some(a), Some(b)) = (number(0).filter(near), number(1).filter(near)) else {
        return Err(format!(
            "a position is not of two numbers between -{FARTHEST:e} and {FARTHEST:e}"
        ));
    };
    Ok(([a, b], number(2).filter(near)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_geometry_is_of_points_lines_and_outlines() {
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
        for (text, told) in [
            ("", "not JSON"),
            ("[]", "no GeoJSON"),
            (r#"{"type":"FeatureCollection"}"#, "no list"),
            (
                r#"{"type":"FeatureCollection","features":[{"type":"Feature","geometry":null},{}]}"#,
                "feature 2",
            ),
            (r#"{"type":"Point","coordinates":[1]}"#, "two numbers"),
            (r#"{"type":"Point","coordinates":[1,1e300]}"#, "two numbers"),
            (
                r#"{"type":"LineString","coordinates":[[1,2]]}"#,
                "one position",
            ),
            (r#"{"type":"Circle","coordinates":[[1,2]]}"#, "'Circle'"),
            (r#"{"type":"Polygon","coordinates":7}"#, "no list"),
        ] {
            let error = parse(text.as_bytes()).unwrap_err();
            assert!(error.contains(told), "{text}: {error}");
        }
    }
}
