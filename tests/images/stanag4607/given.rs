//! Packets with a value in every field that is written.

use subaperture::geometry::Geodetic;
use subaperture_gmti::stanag4607::{
    Classification, Dwell, Exercise, Job, LineOfSightVelocity, Mission, SensorDeviation,
    SensorVelocity, TargetClass, TargetReport,
};

/// 29 February 2024, 23:59:58.7654321 UTC.
const START_NS: i64 = 1_709_251_198_765_432_100;

pub(super) fn mission() -> Mission {
    let mut mission = Mission::new("XN", "UAV 7", Exercise::OperationSynthesized, START_NS);
    mission.mission_id = 3_000_000_001;
    mission.mission_plan = "PLAN 17".into();
    mission.flight_plan = "EDMO-EDMO".into();
    mission.platform_type = 27;
    mission.platform_configuration = "v2.1".into();
    mission
}

pub(super) fn job() -> Job {
    let area = [[48.3, -0.2], [48.4, 0.1], [48.1, 0.2], [48.2, -0.1]];
    let mut job = Job::new(4_000_000_007, area);
    job.sensor_type = 34;
    job.sensor_model = "X4".into();
    job.target_filtering = 1;
    job.priority = 12;
    job.radar_mode = 139;
    job.revisit_interval_s = 61.27;
    job.along_track_deviation_m = Some(1.23);
    job.cross_track_deviation_m = Some(4.56);
    job.altitude_deviation_m = Some(7.89);
    job.track_deviation_deg = Some(0.4);
    job.speed_deviation_m_s = Some(0.0123);
    job.slant_range_deviation_m = Some(0.987);
    job.cross_range_deviation_deg = Some(0.123);
    job.velocity_deviation_m_s = Some(0.345);
    job.min_detectable_velocity_m_s = Some(0.71);
    job.detection_probability = Some(0.87);
    job.false_alarm_density_per_m2 = Some(2e-7);
    job.terrain_model = 7;
    job.geoid_model = 1;
    job
}

pub(super) fn dwells() -> [Dwell; 2] {
    let empty = Dwell {
        revisit_index: 65_535,
        dwell_index: 0,
        is_last: false,
        centre_utc_ns: START_NS,
        sensor: Geodetic {
            latitude_deg: -89.123_456_789,
            longitude_deg: 179.987_654_321,
            height_m: -12.345,
        },
        sensor_deviation: None,
        sensor_velocity: None,
        area_centre_deg: [-89.0, -179.9],
        range_half_extent_m: 123.4,
        angle_half_extent_deg: 1.234,
        targets: Vec::new(),
    };
    let mut full = empty.clone();
    full.dwell_index = 513;
    full.is_last = true;
    // On the second day of the mission.
    full.centre_utc_ns = START_NS + 5_000_600_000;
    full.sensor = Geodetic {
        latitude_deg: 48.123_456_789,
        longitude_deg: -0.123_456_789,
        height_m: 3456.789,
    };
    full.sensor_deviation = Some(SensorDeviation {
        along_track_m: 0.321,
        cross_track_m: 1.234,
        altitude_m: 2.345,
    });
    full.sensor_velocity = Some(SensorVelocity {
        track_deg: -12.345,
        speed_m_s: 87.654_3,
        up_m_s: -1.23,
    });
    full.area_centre_deg = [48.2, 0.05];
    full.range_half_extent_m = 5432.1;
    full.angle_half_extent_deg = 12.345;
    full.targets = (0..300).map(target).collect();
    [empty, full]
}

fn target(index: u16) -> TargetReport {
    let n = f64::from(index);
    let mut target = TargetReport::new(48.1 + 0.000_777 * n, -0.1 + 0.000_999 * n);
    target.index = Some(index);
    target.height_m = Some(-100.4 + 7.3 * n);
    target.velocity = Some(LineOfSightVelocity {
        away_m_s: 30.003 - 0.217 * n,
        wrap_m_s: 12.345 + 2.0 * n,
        deviation_m_s: Some(0.0234 + 0.01 * n),
    });
    target.snr_db = Some(-20.3 + 0.4 * n);
    target.classification = Some(Classification {
        class: if index == 0 {
            TargetClass::Unknown
        } else {
            TargetClass::Vehicle
        },
        simulated: index % 2 == 1,
        probability: Some(n / 300.0),
    });
    target.slant_range_deviation_m = Some(0.0123 * n);
    target.cross_range_deviation_m = Some(3.21 * n);
    target.height_deviation_m = Some(0.8 * n);
    target
}
