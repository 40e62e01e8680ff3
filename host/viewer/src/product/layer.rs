//! Vector layers over an image: GeoJSON and tracks.

use glam::DVec3;
use serde::Serialize;
use subaperture_io::geojson::{self, Feature, Kind, Position};
use subaperture_model::geometry::{Geodetic, ImageGrid, SceneFrame};

use super::Product;

/// Maximum number of positions of a layer that a browser can draw.
const MAX_POSITIONS: usize = 200_000;

/// Named vector layer.
#[derive(Clone, Debug)]
pub struct Layer {
    /// Name shown on the page.
    pub(super) name: String,
    features: Vec<Feature>,
    /// Whether positions are metres in the scene frame even if the frame is georeferenced.
    in_scene: bool,
}

impl Layer {
    /// Make a layer of GeoJSON features. Coordinates are interpreted by the image: longitude, latitude and ellipsoidal
    /// height for a georeferenced image (height defaults to that of the image centre), metres in the scene frame for an
    /// image with a local frame, and column and row for an image without a grid.
    ///
    /// # Errors
    /// If the layer has more positions than can be drawn. The message gives the number.
    pub fn of_features(name: String, features: Vec<Feature>) -> Result<Self, String> {
        let shapes = features.iter().flat_map(|feature| &feature.shapes);
        let count: usize = shapes.map(|shape| shape.positions.len()).sum();
        if count > MAX_POSITIONS {
            return Err(format!(
                "{count} positions; {MAX_POSITIONS} are the maximum: remove features that need not be shown"
            ));
        }
        Ok(Self {
            name,
            features,
            in_scene: false,
        })
    }

    /// Make a layer of a track in the scene frame, decimated to the number of positions that can be drawn.
    pub fn of_track(name: String, positions_m: &[DVec3]) -> Self {
        let every = positions_m.len().div_ceil(MAX_POSITIONS).max(1);
        let kept = positions_m.iter().step_by(every);
        let positions: Vec<Position> = kept.map(|p| ([p.x, p.y], Some(p.z))).collect();
        let feature = Feature {
            properties: vec![("track".to_owned(), name.clone())],
            shapes: vec![geojson::Shape {
                kind: Kind::Line,
                positions,
            }],
        };
        Self {
            name,
            features: vec![feature],
            in_scene: true,
        }
    }

    /// Shapes in rows and columns of an image, as JSON.
    pub(super) fn over(&self, product: &Product) -> String {
        let features = self.features.iter().map(|feature| {
            let shapes = feature.shapes.iter().map(|shape| {
                let places = shape.positions.iter();
                Places {
                    kind: match shape.kind {
                        Kind::Points => "points",
                        Kind::Line => "line",
                        Kind::Outline => "outline",
                    },
                    places: places.map(|p| self.place(product, p)).collect(),
                }
            });
            Placed {
                properties: &feature.properties,
                shapes: shapes.collect(),
            }
        });
        let over = Over {
            name: &self.name,
            features: features.collect(),
        };
        serde_json::to_string(&over).expect("a layer is of numbers and text")
    }

    /// Fractional row and column of a position.
    fn place(&self, product: &Product, ([a, b], c): &Position) -> [f64; 2] {
        let Some(grid) = &product.grid else {
            return [*b, *a];
        };
        let position = match product.frame {
            SceneFrame::Earth { .. } if !self.in_scene => {
                let geodetic = Geodetic {
                    latitude_deg: *b,
                    longitude_deg: *a,
                    height_m: c.unwrap_or_else(|| middle_height_m(product, grid)),
                };
                product.frame.from_ecf_m(geodetic.to_ecf_m())
            }
            _ => DVec3::new(*a, *b, c.unwrap_or(grid.origin_m.z)),
        };
        let [row_value, column_value] = grid.coordinates(position);
        [
            (row_value - grid.rows.start) / grid.rows.step,
            (column_value - grid.columns.start) / grid.columns.step,
        ]
    }
}

/// Layer over an image, as sent to the page.
#[derive(Serialize)]
struct Over<'a> {
    name: &'a str,
    features: Vec<Placed<'a>>,
}

#[derive(Serialize)]
struct Placed<'a> {
    properties: &'a [(String, String)],
    shapes: Vec<Places>,
}

#[derive(Serialize)]
struct Places {
    kind: &'static str,
    places: Vec<[f64; 2]>,
}

/// Ellipsoidal height of the image centre, metres.
fn middle_height_m(product: &Product, grid: &ImageGrid) -> f64 {
    let middle = match product.slant {
        true => DVec3::ZERO,
        false => grid.position_m(grid.rows.count / 2, grid.columns.count / 2),
    };
    let place = product.frame.geodetic(middle);
    place.map_or(0.0, |place| place.height_m)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::product::samples::of_ones;
    use serde_json::Value;

    fn places(layer: &Layer, product: &Product) -> Vec<[f64; 2]> {
        let sent: Value = serde_json::from_str(&layer.over(product)).unwrap();
        let places = sent["features"][0]["shapes"][0]["places"]
            .as_array()
            .unwrap();
        let number = |value: &Value, i: usize| value[i].as_f64().unwrap();
        places
            .iter()
            .map(|p| [number(p, 0), number(p, 1)])
            .collect()
    }

    /// At 45 N, a degree of latitude is 111132 m on the ellipsoid's meridian (M = a (1 - e2) / (1 - e2 / 2)^(3/2) =
    /// 6367382 m), and a degree of longitude is 78847 m (N cos 45). Over 100 m the tangent plane and the ellipsoid
    /// differ by 100^2 / 2R, one millimetre, and arcs differ from chords by less.
    #[test]
    fn degrees_convert_to_rows_and_columns() {
        let origin = Geodetic {
            latitude_deg: 45.0,
            longitude_deg: 10.0,
            height_m: 300.0,
        };
        let frame = SceneFrame::east_north_up(&origin);
        let shown = of_ones("x=-200:200:2,y=-100:100:1,z=0", frame);
        let e2: f64 = 6.694_379_990_14e-3;
        let meridian = 6_378_137.0 * (1.0 - e2) / (1.0 - e2 / 2.0).powf(1.5) + 300.0;
        let across = (6_378_137.0 / (1.0 - e2 / 2.0).sqrt() + 300.0) * 0.5f64.sqrt();
        let north = 50.0 / meridian * 180.0 / std::f64::consts::PI;
        let east = 30.0 / across * 180.0 / std::f64::consts::PI;
        let text = format!(
            r#"{{"type":"MultiPoint","coordinates":[[10,45,300],[{},{}]]}}"#,
            10.0 + east,
            45.0 + north
        );
        let features = geojson::parse(text.as_bytes()).unwrap();
        let layer = Layer::of_features("l".to_owned(), features).unwrap();
        let found = places(&layer, &shown);
        let expected = [[100.0, 100.0], [150.0, 115.0]];
        for (a, b) in found.iter().zip(expected) {
            assert!(
                (a[0] - b[0]).abs() < 0.01 && (a[1] - b[1]).abs() < 0.01,
                "{found:?}"
            );
        }
        // Tracks are in metres for any image.
        let track = Layer::of_track("t".to_owned(), &[DVec3::ZERO, DVec3::new(30.0, 50.0, 7.0)]);
        assert_eq!(places(&track, &shown), expected);
        let local = of_ones("x=-200:200:2,y=-100:100:1,z=0", SceneFrame::Local);
        let features = geojson::parse(br#"{"type":"Point","coordinates":[30,50]}"#).unwrap();
        let layer = Layer::of_features("l".to_owned(), features).unwrap();
        assert_eq!(places(&layer, &local), [[150.0, 115.0]]);
    }
}
