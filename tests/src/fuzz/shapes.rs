//! Shapes: GeoJSON.

use subaperture::io::geojson::{self, Kind};

pub(super) const WORDS: &[&str] = &[
    "{\"type\":",
    "\"FeatureCollection\"",
    "\"features\":[",
    "\"Feature\"",
    "\"geometry\":",
    "\"geometries\":[",
    "\"coordinates\":[",
    "\"properties\":{",
    "\"Point\"",
    "\"MultiPoint\"",
    "\"LineString\"",
    "\"MultiLineString\"",
    "\"Polygon\"",
    "\"MultiPolygon\"",
    "\"GeometryCollection\"",
    "[[[[",
    "1e308",
    "-180",
    "null",
    "\\u0000",
];

pub(super) fn seeds() -> Vec<Vec<u8>> {
    let texts: [&[u8]; 3] = [
        br#"{"type":"FeatureCollection","features":[{"type":"Feature","properties":{"name":"a","level":-3.5},"geometry":{"type":"Point","coordinates":[10,45,300]}},
            {"type":"Feature","properties":null,"geometry":{"type":"Polygon","coordinates":[[[0,0],[1,0],[1,1],[0,0]]]}}]}"#,
        br#"{"type":"GeometryCollection","geometries":[{"type":"LineString","coordinates":[[0,0],[1,1]]},{"type":"MultiPoint","coordinates":[[5,6]]}]}"#,
        br#"{"type":"Feature","geometry":{"type":"MultiPolygon","coordinates":[[[[0,0],[1,0],[1,1],[0,0]]],[[[2,2],[3,2],[3,3],[2,2]]]]}}"#,
    ];
    texts.map(<[u8]>::to_vec).to_vec()
}

/// Accepted shapes are finite, within limits, and have as many positions as their kind needs.
pub(super) fn geojson(bytes: &[u8]) -> String {
    let features = match geojson::parse(bytes) {
        Ok(features) => features,
        Err(error) => return error,
    };
    let mut count = 0;
    for shape in features.iter().flat_map(|feature| &feature.shapes) {
        let least = match shape.kind {
            Kind::Points => 1,
            Kind::Line | Kind::Outline => 2,
        };
        assert!(shape.positions.len() >= least, "{shape:?}");
        for ([a, b], c) in &shape.positions {
            let near = |x: f64| x.abs() <= 1e9;
            assert!(near(*a) && near(*b) && c.is_none_or(near), "{shape:?}");
        }
        count += shape.positions.len();
    }
    format!("{count} positions")
}
