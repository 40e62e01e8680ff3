//! Scene frame of an image, read from its record.

use glam::DVec3;
use serde_json::Value;

use subaperture_model::geometry::SceneFrame;

/// The `frame` of an image's record (`image.json`).
///
/// # Errors
/// Description of the fault.
pub fn frame_of(metadata: &Value) -> Result<SceneFrame, String> {
    let frame = &metadata["frame"];
    let vector = |name: &str| {
        let numbers: Option<Vec<f64>> = frame[name]
            .as_array()
            .and_then(|list| list.iter().map(Value::as_f64).collect());
        match numbers.as_deref() {
            Some(&[x, y, z]) => Ok(DVec3::new(x, y, z)),
            _ => Err(format!("frame.{name}: expected three numbers")),
        }
    };
    match frame["kind"].as_str() {
        Some("local") => Ok(SceneFrame::Local),
        Some("earth") => {
            let frame = SceneFrame::Earth {
                origin_ecf_m: vector("origin_ecf_m")?,
                x_axis_ecf: vector("x_axis_ecf")?,
                y_axis_ecf: vector("y_axis_ecf")?,
            };
            match frame.is_sound() {
                true => Ok(frame),
                false => Err("frame: expected axes that are orthogonal unit vectors".to_owned()),
            }
        }
        _ => Err("frame.kind: expected local or earth".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::product::record;

    #[test]
    fn written_frames_read_back() {
        let earth = SceneFrame::Earth {
            origin_ecf_m: DVec3::new(6_378_137.0, 0.1, -0.2),
            x_axis_ecf: DVec3::Y,
            y_axis_ecf: DVec3::Z,
        };
        for frame in [SceneFrame::Local, earth] {
            let metadata = serde_json::json!({ "frame": record::frame(&frame) });
            assert_eq!(frame_of(&metadata), Ok(frame));
        }
        for (text, part) in [
            ("{}", "kind"),
            (
                r#"{"frame":{"kind":"earth","origin_ecf_m":[1,2]}}"#,
                "origin_ecf_m",
            ),
            (
                r#"{"frame":{"kind":"earth","origin_ecf_m":[1,2,3],"x_axis_ecf":[1,0,0],"y_axis_ecf":[1,0,0]}}"#,
                "orthogonal",
            ),
        ] {
            let wrong = frame_of(&serde_json::from_str(text).unwrap()).unwrap_err();
            assert!(wrong.contains(part), "{wrong}");
        }
    }
}
