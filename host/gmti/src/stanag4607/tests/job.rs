//! Bytes of the Job Definition Segment, worked out by hand from Table 3-14 of AEDP-4607.

use super::super::{Job, StanagError};

const AREA_DEG: [[f64; 2]; 4] = [[45.0, -45.0], [45.0, 45.0], [-45.0, 45.0], [-45.0, -45.0]];

/// Start of the expected error, and the change that causes it.
type Case = (&'static str, fn(&mut Job));

#[test]
fn job_definition_has_the_bytes_of_the_table() {
    let mut job = Job::new(0x0a0b_0c0d, AREA_DEG);
    let corners = [
        [0x40, 0, 0, 0, 0xe0, 0, 0, 0],
        [0x40, 0, 0, 0, 0x20, 0, 0, 0],
        [0xc0, 0, 0, 0, 0x20, 0, 0, 0],
        [0xc0, 0, 0, 0, 0xe0, 0, 0, 0],
    ];
    let head = b"\x0a\x0b\x0c\x0d\xff      \x00\x63";
    let tail = b"\x01\x00\x00\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff\x80\x00\xff\xff\xff\xff\xff\x00\x00";
    let expected = [head.as_slice(), corners.as_flattened(), tail].concat();
    assert_eq!(job.segment().unwrap(), expected);
    assert_eq!(expected.len(), 68);

    job.sensor_type = 1;
    job.sensor_model = "M2".into();
    job.target_filtering = 5;
    job.priority = 1;
    job.radar_mode = 4;
    job.revisit_interval_s = 12.34;
    job.along_track_deviation_m = Some(0.3);
    job.cross_track_deviation_m = Some(1000.0);
    job.altitude_deviation_m = Some(2000.0);
    job.track_deviation_deg = Some(0.1);
    job.speed_deviation_m_s = Some(65.534);
    job.slant_range_deviation_m = Some(2.56);
    job.cross_range_deviation_deg = Some(45.0);
    job.velocity_deviation_m_s = Some(0.128);
    job.min_detectable_velocity_m_s = Some(1.0);
    job.detection_probability = Some(0.904);
    job.false_alarm_density_per_m2 = Some(1e-6);
    job.terrain_model = 7;
    job.geoid_model = 3;
    // 123 ds; 3, 10000, 20000 dm; 1 degree; 65534 mm/s; 256 cm; 45 degrees; 13 cm/s; 10 dm/s; 90 %; 60 dB.
    let head = b"\x0a\x0b\x0c\x0d\x01M2    \x05\x01";
    let tail = b"\x04\x00\x7b\x00\x03\x27\x10\x4e\x20\x01\xff\xfe\x01\x00\x20\x00\x00\x0d\x0a\x5a\x3c\x07\x03";
    let expected = [head.as_slice(), corners.as_flattened(), tail].concat();
    assert_eq!(job.segment().unwrap(), expected);
}

#[test]
fn values_outside_of_the_job_definition_are_refused() {
    let cases: [Case; 12] = [
        ("J1 ", |job| job.id = 0),
        ("J4 ", |job| job.target_filtering = 8),
        ("J5 ", |job| job.priority = 100),
        ("J8 ", |job| job.bounding_area_deg[1][0] = 90.0),
        ("J13 ", |job| job.bounding_area_deg[3][1] = -181.0),
        ("J15 ", |job| job.revisit_interval_s = 6553.6),
        ("J19 ", |job| job.track_deviation_deg = Some(45.1)),
        ("J20 ", |job| job.speed_deviation_m_s = Some(65.535)),
        ("J22 ", |job| job.cross_range_deviation_deg = Some(180.0)),
        ("J25 ", |job| job.detection_probability = Some(1.01)),
        ("J26 ", |job| job.false_alarm_density_per_m2 = Some(0.0)),
        ("J28 ", |job| job.geoid_model = 4),
    ];
    for (field, change) in cases {
        let mut job = Job::new(1, AREA_DEG);
        change(&mut job);
        let error = job.segment().unwrap_err().to_string();
        assert!(error.starts_with(field), "{error}");
    }
}

#[test]
fn bounding_area_is_convex_and_clockwise() {
    let across = [[1.0, 179.0], [1.0, -179.0], [0.0, -179.0], [0.0, 179.0]];
    assert!(Job::new(1, across).segment().is_ok());
    let mut anticlockwise = AREA_DEG;
    anticlockwise.reverse();
    let [a, b, c, d] = AREA_DEG;
    for corners in [
        anticlockwise,
        [a, c, b, d],
        [a, b, b, d],
        [a, b, [10.0, 10.0], d],
    ] {
        let error = Job::new(1, corners).segment().unwrap_err();
        assert!(matches!(error, StanagError::BoundingArea { .. }), "{error}");
    }
}
