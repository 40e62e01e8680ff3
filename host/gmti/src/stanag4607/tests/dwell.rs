//! Bytes of dwells and packets, worked out by hand from Tables 3-1, 3-6, 3-9 and 3-10 of AEDP-4607.

use subaperture_model::geometry::Geodetic;

use super::super::*;

/// 1 March 2024, 00:00 UTC: day 19783.
const MIDNIGHT_NS: i64 = 1_709_251_200_000_000_000;

/// Start of the expected error, and the change that causes it.
type Case = (&'static str, fn(&mut Dwell));

fn dwell() -> Dwell {
    Dwell {
        revisit_index: 1,
        dwell_index: 2,
        is_last: true,
        // 65.536 s after midnight: 0x10000 ms.
        centre_utc_ns: MIDNIGHT_NS + 65_536_000_000,
        sensor: Geodetic {
            latitude_deg: 22.5,
            longitude_deg: -90.0,
            height_m: 655.36,
        },
        sensor_deviation: None,
        sensor_velocity: None,
        area_centre_deg: [-22.5, 45.0],
        range_half_extent_m: 2500.0,
        angle_half_extent_deg: 22.5,
        targets: Vec::new(),
    }
}

fn full() -> Dwell {
    let mut full = dwell();
    full.sensor_deviation = Some(SensorDeviation {
        along_track_m: 1.0,
        cross_track_m: 10_000.0,
        altitude_m: 655.35,
    });
    full.sensor_velocity = Some(SensorVelocity {
        track_deg: -90.0,
        speed_m_s: 65.536,
        up_m_s: -0.2,
    });
    let mut target = TargetReport::new(45.0, 180.0);
    target.index = Some(3);
    target.height_m = Some(-2.0);
    target.velocity = Some(LineOfSightVelocity {
        away_m_s: -2.56,
        wrap_m_s: 5.12,
        deviation_m_s: Some(0.16),
    });
    target.snr_db = Some(-3.4);
    target.classification = Some(Classification {
        class: TargetClass::WheeledVehicle,
        simulated: true,
        probability: Some(0.5),
    });
    target.slant_range_deviation_m = Some(0.25);
    target.cross_range_deviation_m = Some(25.6);
    target.height_deviation_m = Some(4.5);
    full.targets.push(target);
    full
}

#[test]
fn dwell_without_targets_has_the_mandatory_fields() {
    let expected = [
        // D1: D2 to D9, D24 to D27.
        &[0xff, 0x00, 0x03, 0xc0, 0x00, 0x00, 0x00, 0x00][..],
        // D2, D3, D4, D5, D6.
        &[0, 1, 0, 2, 1, 0, 0, 0, 1, 0, 0],
        // D7: 22.5 degrees in SA32; D8: 270 degrees in BA32; D9: 65536 cm.
        &[0x20, 0, 0, 0, 0xc0, 0, 0, 0, 0, 1, 0, 0],
        // D24: -22.5 degrees; D25: 45 degrees; D26: 2.5 km in B16; D27: 22.5 degrees in BA16.
        &[0xe0, 0, 0, 0, 0x20, 0, 0, 0, 0x01, 0x40, 0x10, 0x00],
    ]
    .concat();
    assert_eq!(dwell().segment(19_783).unwrap(), expected);
}

#[test]
fn target_reports_have_the_given_fields() {
    let expected = [
        // D1: D2 to D9, D12 to D17, D24 to D27, D32.1 to D32.3, D32.6 to D32.15.
        &[0xff, 0x3f, 0x03, 0xc3, 0x9f, 0xf8, 0x00, 0x00][..],
        &[0, 1, 0, 2, 1, 0, 1, 0, 1, 0, 0],
        &[0x20, 0, 0, 0, 0xc0, 0, 0, 0, 0, 1, 0, 0],
        // D12: 100 cm; D13: 1000000 cm; D14: 65535 cm.
        &[0, 0, 0, 100, 0x00, 0x0f, 0x42, 0x40, 0xff, 0xff],
        // D15: 270 degrees; D16: 65536 mm/s; D17: -2 dm/s.
        &[0xc0, 0x00, 0, 1, 0, 0, 0xfe],
        &[0xe0, 0, 0, 0, 0x20, 0, 0, 0, 0x01, 0x40, 0x10, 0x00],
        // D32.1: 3; D32.2: 45 degrees in SA32; D32.3: 180 degrees in BA32; D32.6: -2 m.
        &[0, 3, 0x40, 0, 0, 0, 0x80, 0, 0, 0, 0xff, 0xfe],
        // D32.7: -256 cm/s, approaching; D32.8: 512 cm/s; D32.9: -3 dB; D32.10: 130, simulated wheeled vehicle; D32.11: 50 %.
        &[0xff, 0x00, 0x02, 0x00, 0xfd, 130, 50],
        // D32.12: 25 cm; D32.13: 256 dm; D32.14: 5 m; D32.15: 16 cm/s.
        &[0, 25, 0x01, 0x00, 5, 0, 16],
    ]
    .concat();
    assert_eq!(full().segment(19_783).unwrap(), expected);
}

#[test]
fn packet_has_its_size_and_segments() {
    let mission = Mission::new("XN", "P", Exercise::OperationSimulated, MIDNIGHT_NS + 1);
    let job = Job::new(9, [[1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.0, 0.0]]);
    let packet = encode(&mission, &job, &[dwell(), full()]).unwrap();
    let [short, long] = [43, 86];
    let size = 32 + (5 + 39) + (5 + 68) + (5 + short) + (5 + long);
    assert_eq!(packet.len(), size);
    assert_eq!(packet[2..6], (size as u32).to_be_bytes());
    // P7: operation, simulated data. P10: the job.
    assert_eq!(packet[13], 1);
    assert_eq!(packet[28..32], [0, 0, 0, 9]);
    // Types and sizes of the segments: mission, job definition, two dwells.
    let segments = [(32, 1, 44), (76, 5, 73), (149, 2, 48), (197, 2, 91)];
    for (start, kind, size) in segments {
        assert_eq!(packet[start..start + 5], [kind, 0, 0, 0, size]);
    }
    // The job ID is 0 without dwells.
    let packet = encode(&mission, &job, &[]).unwrap();
    assert_eq!(packet.len(), 149);
    assert_eq!(packet[28..32], [0; 4]);
}

#[test]
fn invalid_dwells_are_refused_with_their_place() {
    let cases: [Case; 14] = [
        ("D6 ", |dwell| dwell.centre_utc_ns = MIDNIGHT_NS - 1_000_000),
        ("D6 ", |dwell| {
            dwell.centre_utc_ns = MIDNIGHT_NS + 4_000_001_000_000_000
        }),
        ("D7 ", |dwell| dwell.sensor.latitude_deg = f64::NAN),
        ("D9 ", |dwell| dwell.sensor.height_m = -500.01),
        ("D12 ", |dwell| {
            dwell.sensor_deviation.as_mut().unwrap().along_track_m = -0.01
        }),
        ("D16 ", |dwell| {
            dwell.sensor_velocity.as_mut().unwrap().speed_m_s = 8000.001
        }),
        ("D17 ", |dwell| {
            dwell.sensor_velocity.as_mut().unwrap().up_m_s = 12.8
        }),
        ("D26 ", |dwell| dwell.range_half_extent_m = 256_000.0),
        ("D27 ", |dwell| dwell.angle_half_extent_deg = 360.0),
        ("D5 ", |dwell| {
            dwell.targets = vec![TargetReport::new(0.0, 0.0); 65_536]
        }),
        ("target report 0: D32.7 ", |dwell| {
            dwell.targets[0].velocity.as_mut().unwrap().away_m_s = 327.68;
        }),
        ("target report 0: D32.12 ", |dwell| {
            dwell.sensor_deviation = None
        }),
        ("target report 0: D32.14 ", |dwell| {
            dwell.targets[0].height_m = None
        }),
        ("target report 1: D32.9: ", |dwell| {
            dwell.targets.push(TargetReport {
                snr_db: None,
                slant_range_deviation_m: None,
                ..dwell.targets[0]
            });
        }),
    ];
    let mission = Mission::new("XN", "P", Exercise::OperationReal, MIDNIGHT_NS);
    let job = Job::new(9, [[1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.0, 0.0]]);
    for (place, change) in cases {
        let mut wrong = full();
        change(&mut wrong);
        let error = encode(&mission, &job, &[dwell(), wrong]).unwrap_err();
        let error = error.to_string();
        assert!(error.starts_with(&format!("dwell 1: {place}")), "{error}");
    }
}

#[test]
fn packet_size_is_bounded() {
    assert_eq!(packet_size(0, 0), Ok(32));
    assert_eq!(packet_size(4_294_967_258, 5), Ok(u32::MAX));
    let found = 4_294_967_296;
    assert_eq!(
        packet_size(4_294_967_259, 5),
        Err(StanagError::Size { found })
    );
}
