//! Targets and tracks as GeoJSON (RFC 7946).

use glam::DVec3;
use serde_json::{Value, json};
use subaperture_model::geometry::SceneFrame;

use crate::target::Target;
use crate::tracker::{Plane, Track};

/// Schema of the collection of features.
const SCHEMA: &str = "subaperture-moving-targets";

/// Feature collection of the targets of all dwells, and of tracks over dwells. Positions are longitude and latitude in degrees and height above the
/// ellipsoid in metres, or metres in a scene frame without a position on the Earth.
///
/// - A target is a point; without a position it has no geometry. Properties are the members of [`Target`], its number from 1, and its dwell from 1.
/// - A confirmed track is a line. Properties: number of the track, times of the first and last update, last horizontal velocity in the scene frame.
pub fn collection(
    dwells: &[Vec<Target>],
    (tracks, plane): (&[Track], &Plane),
    frame: &SceneFrame,
) -> Value {
    let place = |position_m: DVec3| match frame.geodetic(position_m) {
        Some(place) => [place.longitude_deg, place.latitude_deg, place.height_m],
        None => position_m.to_array(),
    };
    let mut features = Vec::new();
    for (dwell, targets) in dwells.iter().enumerate() {
        for target in targets {
            let mut properties = json!(target);
            properties["number"] = (features.len() + 1).into();
            properties["dwell"] = (dwell + 1).into();
            let at = target.position_m.map(|position_m| place(position_m.into()));
            features.push(json!({
                "type": "Feature",
                "geometry": at.map(|at| json!({ "type": "Point", "coordinates": at })),
                "properties": properties,
            }));
        }
    }
    for track in tracks.iter().filter(|track| track.is_confirmed()) {
        let updates = track.history.iter();
        let line: Vec<[f64; 3]> = updates
            .map(|update| place(plane.position_m([update.mean[0], update.mean[1]])))
            .collect();
        let (Some(first), Some(last)) = (track.history.first(), track.history.last()) else {
            continue;
        };
        let velocity = plane.x_axis * last.mean[2] + plane.y_axis * last.mean[3];
        features.push(json!({
            "type": "Feature",
            "geometry": { "type": "LineString", "coordinates": line },
            "properties": {
                "track": track.id,
                "from_s": first.time_s,
                "to_s": last.time_s,
                "velocity_m_s": velocity.to_array(),
                "position_deviation_m": (last.covariance[0][0] + last.covariance[1][1]).sqrt(),
            },
        }));
    }
    json!({
        "type": "FeatureCollection",
        "schema": SCHEMA,
        "schema_version": 1,
        "features": features,
    })
}
