//! Comparison of decoded values with the given ones, within the resolution of each field.

use serde_json::Value;
use subaperture_gmti::stanag4607::{Dwell, Job, TargetClass, TargetReport};

const SA32_DEG: f64 = 180.0 / 4_294_967_296.0;
const BA32_DEG: f64 = 360.0 / 4_294_967_296.0;
const BA16_DEG: f64 = 360.0 / 65_536.0;

/// Compare with values in SI units: name, value, value of a unit of the name. `resolution` is in units of the name.
fn nearest(found: &Value, expected: &[(&str, f64, f64, f64)]) {
    for &(name, value, unit, resolution) in expected {
        let off = found[name]
            .as_f64()
            .unwrap_or_else(|| panic!("{name}: {found}"))
            - value / unit;
        assert!(
            off.abs() <= resolution * 0.500_001,
            "{name}: {off} from {value}"
        );
    }
}

/// Compare with values that are rounded up to a unit of the name.
fn rounded_up(found: &Value, expected: &[(&str, f64, f64)]) {
    for &(name, value, unit) in expected {
        let off = found[name]
            .as_f64()
            .unwrap_or_else(|| panic!("{name}: {found}"))
            - value / unit;
        assert!((-1e-6..1.0).contains(&off), "{name}: {off} from {value}");
    }
}

pub(super) fn equal(found: &Value, expected: &[(&str, Value)]) {
    for (name, value) in expected {
        assert_eq!(found[name], *value, "{name}");
    }
}

/// Longitude or track as written, 0 to 360 degrees.
fn positive_deg(degrees: f64) -> f64 {
    degrees.rem_euclid(360.0)
}

pub(super) fn check_mission(found: &Value) {
    let expected = [
        ("kind", "MissionSegment".into()),
        ("mission_plan", "PLAN 17     ".into()),
        ("flight_plan", "EDMO-EDMO   ".into()),
        ("platform_type", 27.into()),
        ("platform_configuration", "v2.1      ".into()),
        ("reference_year", 2024.into()),
        ("reference_month", 2.into()),
        ("reference_day", 29.into()),
    ];
    equal(found, &expected);
}

pub(super) fn check_job(found: &Value, job: &Job) {
    let expected = [
        ("kind", "JobDefinitionSegment".into()),
        ("job_id", job.id.into()),
        ("sensor_type", 34.into()),
        ("sensor_model", "X4    ".into()),
        ("target_filtering", 1.into()),
        ("priority", 12.into()),
        ("radar_mode", 139.into()),
        ("nominal_revisit_interval_deciseconds", 613.into()),
        ("nominal_detection_probability_percent", 87.into()),
        // -10 log10(2e-7) is 66.99.
        ("nominal_false_alarm_density_negative_decibels", 67.into()),
        ("terrain_elevation_model", 7.into()),
        ("geoid_model", 1.into()),
    ];
    equal(found, &expected);
    for (corner, [latitude, longitude]) in job.bounding_area_deg.into_iter().enumerate() {
        let pair = &found["bounding_area"][corner];
        let off = |index: usize, degrees: f64| (pair[index].as_f64().unwrap() - degrees).abs();
        assert!(off(0, latitude) <= SA32_DEG / 2.0, "{pair}");
        assert!(off(1, positive_deg(longitude)) <= BA32_DEG / 2.0, "{pair}");
    }
    let uncertainty = |name: &str| format!("nominal_sensor_{name}");
    let [along, across, altitude, track, speed] = [
        "position_along_track_uncertainty_decimeters",
        "position_cross_track_uncertainty_decimeters",
        "position_altitude_uncertainty_decimeters",
        "track_uncertainty_degrees",
        "speed_uncertainty_millimeters_per_second",
    ]
    .map(uncertainty);
    let expected = [
        (along.as_str(), 1.23, 0.1),
        (&across, 4.56, 0.1),
        (&altitude, 7.89, 0.1),
        (&track, 0.4, 1.0),
        (&speed, 0.0123, 0.001),
        (
            "nominal_slant_range_standard_deviation_centimeters",
            0.987,
            0.01,
        ),
        (
            "nominal_minimum_detectable_velocity_decimeters_per_second",
            0.71,
            0.1,
        ),
        (
            "nominal_radial_velocity_standard_deviation_centimeters_per_second",
            0.345,
            0.01,
        ),
    ];
    rounded_up(found, &expected);
    let angle = found["nominal_cross_range_standard_deviation"]
        .as_f64()
        .unwrap();
    assert!((0.123..0.123 + BA16_DEG).contains(&angle), "{angle}");
}

pub(super) fn check_dwell(found: &Value, dwell: &Dwell) {
    let expected = [
        ("kind", "DwellSegment".into()),
        ("revisit_index", dwell.revisit_index.into()),
        ("dwell_index", dwell.dwell_index.into()),
        ("last_dwell", u8::from(dwell.is_last).into()),
        ("target_report_count", dwell.targets.len().into()),
    ];
    equal(found, &expected);
    let expected = [
        ("sensor_latitude", dwell.sensor.latitude_deg, 1.0, SA32_DEG),
        (
            "sensor_longitude",
            positive_deg(dwell.sensor.longitude_deg),
            1.0,
            BA32_DEG,
        ),
        (
            "sensor_altitude_centimeters",
            dwell.sensor.height_m,
            0.01,
            1.0,
        ),
        ("center_latitude", dwell.area_centre_deg[0], 1.0, SA32_DEG),
        (
            "center_longitude",
            positive_deg(dwell.area_centre_deg[1]),
            1.0,
            BA32_DEG,
        ),
        (
            "range_half_extent_kilometers",
            dwell.range_half_extent_m,
            1000.0,
            1.0 / 128.0,
        ),
        (
            "angle_half_extent",
            dwell.angle_half_extent_deg,
            1.0,
            BA16_DEG,
        ),
    ];
    nearest(found, &expected);
    let position = |axis: &str| format!("sensor_position_{axis}_uncertainty_centimeters");
    let names = ["along_track", "cross_track", "altitude"].map(position);
    match dwell.sensor_deviation {
        Some(deviation) => {
            let values = [
                deviation.along_track_m,
                deviation.cross_track_m,
                deviation.altitude_m,
            ];
            for (name, value) in names.iter().zip(values) {
                rounded_up(found, &[(name, value, 0.01)]);
            }
        }
        None => names
            .iter()
            .for_each(|name| assert!(found[name].is_null(), "{name}")),
    }
    match dwell.sensor_velocity {
        Some(velocity) => {
            let expected = [
                (
                    "sensor_track",
                    positive_deg(velocity.track_deg),
                    1.0,
                    BA16_DEG,
                ),
                (
                    "sensor_speed_millimeters_per_second",
                    velocity.speed_m_s,
                    0.001,
                    1.0,
                ),
                (
                    "sensor_vertical_velocity_decimeters_per_second",
                    velocity.up_m_s,
                    0.1,
                    1.0,
                ),
            ];
            nearest(found, &expected);
        }
        None => assert!(
            found["sensor_track"].is_null()
                && found["sensor_speed_millimeters_per_second"].is_null()
        ),
    }
    let absent = [
        "latitude_scale",
        "sensor_track_uncertainty_degrees",
        "platform_heading",
        "sensor_heading",
        "minimum_detectable_velocity_decimeters_per_second",
    ];
    absent
        .iter()
        .for_each(|name| assert_eq!(found[name], Value::Null, "{name}"));
    let targets = found["targets"].as_array().unwrap();
    assert_eq!(targets.len(), dwell.targets.len());
    for (found, target) in targets.iter().zip(&dwell.targets) {
        check_target(found, target);
    }
}

fn check_target(found: &Value, target: &TargetReport) {
    let classification = target.classification.unwrap();
    let class = match (classification.class, classification.simulated) {
        (TargetClass::Unknown, false) => 127,
        (_, false) => 10,
        (_, true) => 138,
    };
    let expected = [
        ("kind", "TargetReport".into()),
        ("report_index", target.index.unwrap().into()),
        ("classification", class.into()),
        ("delta_latitude", Value::Null),
        ("truth_tag_entity", Value::Null),
        ("radar_cross_section_decibels", Value::Null),
    ];
    equal(found, &expected);
    let velocity = target.velocity.unwrap();
    // D32.7 is positive when the range increases.
    let expected = [
        (
            "high_resolution_latitude",
            target.latitude_deg,
            1.0,
            SA32_DEG,
        ),
        (
            "high_resolution_longitude",
            positive_deg(target.longitude_deg),
            1.0,
            BA32_DEG,
        ),
        ("geodetic_height_meters", target.height_m.unwrap(), 1.0, 1.0),
        (
            "radial_velocity_centimeters_per_second",
            velocity.away_m_s,
            0.01,
            1.0,
        ),
        (
            "wrap_velocity_centimeters_per_second",
            velocity.wrap_m_s,
            0.01,
            1.0,
        ),
        (
            "signal_to_noise_ratio_decibels",
            target.snr_db.unwrap(),
            1.0,
            1.0,
        ),
        (
            "classification_probability_percent",
            classification.probability.unwrap(),
            0.01,
            1.0,
        ),
    ];
    nearest(found, &expected);
    let expected = [
        (
            "slant_range_uncertainty_centimeters",
            target.slant_range_deviation_m.unwrap(),
            0.01,
        ),
        (
            "cross_range_uncertainty_decimeters",
            target.cross_range_deviation_m.unwrap(),
            0.1,
        ),
        (
            "height_uncertainty_meters",
            target.height_deviation_m.unwrap(),
            1.0,
        ),
        (
            "radial_velocity_uncertainty_centimeters_per_second",
            velocity.deviation_m_s.unwrap(),
            0.01,
        ),
    ];
    rounded_up(found, &expected);
}
