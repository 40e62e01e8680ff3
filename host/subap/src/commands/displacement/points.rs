//! Points as comma-separated values.

use std::fmt::Write;

use subaperture::geometry::SceneFrame;
use subaperture::glam::DVec3;
use subaperture::interferometry::displacement::DisplacementSeries;
use subaperture::io::ours::TEXT_MARK;

use super::rate::Rate;

/// Table of all points: position, quality, velocity, and displacement with standard deviation in each pass after the first.
pub(super) fn csv(series: &DisplacementSeries, frame: &SceneFrame, rate: &Rate) -> String {
    let mut table = format!("# {TEXT_MARK} {}\n", env!("CARGO_PKG_VERSION"));
    let placed = matches!(frame, SceneFrame::Earth { .. });
    let place = if placed {
        ",latitude_deg,longitude_deg,height_m"
    } else {
        ""
    };
    let suffix = rate.suffix;
    let _ = write!(
        table,
        "point,row,column,x_m,y_m,z_m{place},range_m,level_db,dispersion,temporal_coherence,stable,doubtful_from,velocity_{suffix},velocity_deviation_{suffix}"
    );
    for pass in 1..series.screens.len() {
        let _ = write!(table, ",displacement_{pass}_mm,deviation_{pass}_mm");
    }
    table.push('\n');
    for (n, point) in series.points.iter().enumerate() {
        let [x, y, z] = point.position_m;
        let _ = write!(
            table,
            "{n},{},{},{x:.4},{y:.4},{z:.4}",
            point.row, point.column
        );
        if placed {
            match frame.geodetic(DVec3::from_array(point.position_m)) {
                Some(at) => {
                    let _ = write!(
                        table,
                        ",{:.9},{:.9},{:.4}",
                        at.latitude_deg, at.longitude_deg, at.height_m
                    );
                }
                None => table.push_str(",,,"),
            }
        }
        let doubtful = point.doubtful_from.map(|pass| pass.to_string());
        let _ = write!(
            table,
            ",{:.4},{:.3},{:.5},{:.5},{},{},{:.6},{:.6}",
            point.range_m,
            10.0 * point.power.log10(),
            point.dispersion,
            point.coherence,
            u8::from(point.stable),
            doubtful.unwrap_or_default(),
            rate.of(point.velocity_m_s),
            rate.of(point.velocity_deviation_m_s)
        );
        for (d, s) in point.displacement_m.iter().zip(&point.deviation_m).skip(1) {
            let _ = write!(table, ",{:.5},{:.5}", 1e3 * d, 1e3 * s);
        }
        table.push('\n');
    }
    table
}
