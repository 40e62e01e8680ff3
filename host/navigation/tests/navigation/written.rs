//! Written logs, parsed here by their definitions and read back by the readers.

use std::path::Path;

use glam::DVec3;
use subaperture_model::geometry::Geodetic;
use subaperture_navigation::write::{Deviations, LogFormat, VehicleState};
use subaperture_navigation::{Attitude, GpsTime, Kind, Log, Options, Place};

use crate::write::crc;

const DEVIATIONS: Deviations = Deviations {
    horizontal_m: 0.0125,
    vertical_m: 0.02,
    velocity_m_s: 0.015,
    attitude_deg: 0.05,
};

/// Height of the geoid, metres.
const UNDULATION_M: f64 = -33.4;

/// Ten states around the end of a GPS week: on 2017-05-06 at 23:59:42 UTC it is 18 s later by GPS, the end of week 1947.
fn states() -> Vec<VehicleState> {
    let start = GpsTime {
        week: 1947,
        seconds: 604_799.75,
    };
    (0..10)
        .map(|n| {
            let at = f64::from(n);
            VehicleState {
                time: start.later(0.05 * at),
                place: Geodetic {
                    latitude_deg: 40.428_312_345_67 + 2.25e-7 * at,
                    longitude_deg: -86.999_999_999_9 - 7.36e-7 * at,
                    height_m: 187.612_34 + 0.006_25 * at,
                },
                velocity_m_s: DVec3::new(-1.25, 0.5, 0.125),
                attitude_deg: [-2.5, 1.25, 291.8],
                deviations: DEVIATIONS,
            }
        })
        .collect()
}

fn written(format: LogFormat) -> Vec<u8> {
    let mut bytes = Vec::new();
    let remark = "written by a test";
    let states = states();
    let all = states.iter().copied();
    format.write(&mut bytes, remark, UNDULATION_M, all).unwrap();
    assert!(bytes.len() as u64 <= 11 * format.max_record_bytes());
    bytes
}

fn read(bytes: &[u8]) -> Log {
    let options = Options {
        week: Some(1947),
        ..Options::default()
    };
    let log = Log::read_from(bytes, Path::new("log"), &options).unwrap();
    assert_eq!(log.account.faulty(), 0, "{}", log.account);
    assert_eq!(log.account.lost_bytes, 0);
    assert!(log.account.doubts.is_empty(), "{}", log.account);
    log
}

/// Angle of a text `ddmm.mmmmmmm` and its letter, degrees.
fn degrees(text: &str, letter: &str) -> f64 {
    let dot = text.find('.').unwrap();
    let whole: f64 = text[..dot - 2].parse().unwrap();
    let minutes: f64 = text[dot - 2..].parse().unwrap();
    assert!(minutes < 60.0, "{text}");
    let sign = if ["S", "W"].contains(&letter) {
        -1.0
    } else {
        1.0
    };
    sign * (whole + minutes / 60.0)
}

#[test]
fn nmea_sentences_have_checksums_and_stated_fields() {
    let text = String::from_utf8(written(LogFormat::Nmea)).unwrap();
    let sentences: Vec<Vec<&str>> = text
        .lines()
        .map(|line| {
            let (body, sum) = line.strip_prefix('$').unwrap().split_once('*').unwrap();
            let expected = body.bytes().fold(0, |sum, byte| sum ^ byte);
            assert_eq!(sum, format!("{expected:02X}"), "{line}");
            body.split(',').collect()
        })
        .collect();
    assert_eq!(sentences[0], ["PSBAP", "written by a test"]);
    assert_eq!(sentences.len(), 1 + 4 * 10);
    let gga = &sentences[1 + 4 * 5];
    // GPS time 0 s of week 1948 is 18 s after UTC.
    assert_eq!(gga[..2], ["GPGGA", "235942.000"]);
    let state = states()[5];
    // Half of a step of 1e-7 minutes.
    let step_deg = 0.5e-7 / 60.0 + 1e-14;
    let latitude = degrees(gga[2], gga[3]);
    assert!((latitude - state.place.latitude_deg).abs() <= step_deg);
    // 59.999999994 minutes are rounded to the next degree, not to 60 minutes.
    assert_eq!(&sentences[1][4..6], ["08700.0000000", "W"]);
    let longitude = degrees(gga[4], gga[5]);
    assert!((longitude - state.place.longitude_deg).abs() <= step_deg);
    let number = |field: &str| field.parse::<f64>().unwrap();
    let height = number(gga[9]) + number(gga[11]);
    assert!((height - state.place.height_m).abs() <= 0.5e-4 + 1e-9);
    assert_eq!(number(gga[11]), UNDULATION_M);
    let rmc = &sentences[1 + 4 * 5 + 1];
    assert_eq!((rmc[0], rmc[2], rmc[9]), ("GPRMC", "A", "060517"));
    assert!((number(rmc[7]) * 1852.0 / 3600.0 - 1.25f64.hypot(0.5)).abs() < 1e-4);
    assert!((number(rmc[8]) - 291.801_409_486).abs() < 1e-4);
    let gst = &sentences[1 + 4 * 5 + 2];
    assert_eq!(gst[6..], ["0.0125", "0.0125", "0.0200"]);
    let hdt = &sentences[1 + 4 * 5 + 3];
    assert_eq!(hdt[..], ["GPHDT", "291.8000", "T"]);
}

#[test]
fn novatel_records_have_crcs_and_stated_fields() {
    for (format, names) in [
        (LogFormat::Inspvax, vec!["INSPVAXA"]),
        (LogFormat::Bestpos, vec!["BESTPOSA", "BESTVELA"]),
    ] {
        let text = String::from_utf8(written(format)).unwrap();
        let lines: Vec<&str> = text.lines().skip(1).collect();
        assert_eq!(lines.len(), 10 * names.len());
        for (n, line) in lines.iter().enumerate() {
            let (body, sum) = line.strip_prefix('#').unwrap().split_once('*').unwrap();
            assert_eq!(sum, format!("{:08x}", crc(body.as_bytes())), "{line}");
            let (header, fields) = body.split_once(';').unwrap();
            let header: Vec<&str> = header.split(',').collect();
            assert_eq!((header.len(), header[0]), (10, names[n % names.len()]));
            assert_eq!(header[4], "FINESTEERING");
            let state = states()[n / names.len()];
            assert_eq!(header[5], state.time.week.to_string());
            assert_eq!(header[6].parse::<f64>().unwrap(), state.time.seconds);
            let fields: Vec<&str> = fields.split(',').collect();
            let number = |n: usize| fields[n].parse::<f64>().unwrap();
            match header[0] {
                "BESTVELA" => {
                    assert_eq!(fields.len(), 8);
                    assert_eq!((number(2), number(6)), (0.0, 0.125));
                    assert!((number(4) - 1.25f64.hypot(0.5)).abs() < 1e-5);
                    assert!((number(5) - 291.801_409_486).abs() < 1e-6);
                    continue;
                }
                "BESTPOSA" => {
                    assert_eq!(fields.len(), 21);
                    assert_eq!(fields[6], "WGS84");
                    assert_eq!([number(7), number(8), number(9)], [0.0125, 0.0125, 0.02]);
                }
                _ => {
                    assert_eq!(fields.len(), 23);
                    assert_eq!([number(6), number(7), number(8)], [0.5, -1.25, 0.125]);
                    assert_eq!([number(9), number(10), number(11)], [-2.5, 1.25, 291.8]);
                    let stated: Vec<f64> = (12..21).map(number).collect();
                    let expected = [0.0125, 0.0125, 0.02, 0.015, 0.015, 0.015, 0.05, 0.05, 0.05];
                    assert_eq!(stated, expected);
                }
            }
            assert!((number(2) - state.place.latitude_deg).abs() <= 0.5e-11 + 1e-14);
            assert!((number(3) - state.place.longitude_deg).abs() <= 0.5e-11 + 1e-14);
            let height_m = number(4) + number(5);
            assert!((height_m - state.place.height_m).abs() <= 0.5e-4 + 1e-9);
        }
    }
}

#[test]
fn sbet_records_are_17_numbers_in_radians() {
    let bytes = written(LogFormat::Sbet);
    assert_eq!(bytes.len(), 10 * 136);
    let numbers: Vec<f64> = bytes
        .chunks(8)
        .map(|bytes| f64::from_le_bytes(bytes.try_into().unwrap()))
        .collect();
    for (record, state) in numbers.chunks(17).zip(states()) {
        let expected = [
            state.time.seconds,
            state.place.latitude_deg * std::f64::consts::PI / 180.0,
            state.place.longitude_deg * std::f64::consts::PI / 180.0,
            state.place.height_m,
            0.5,
            -1.25,
            0.125,
            -2.5 * std::f64::consts::PI / 180.0,
            1.25 * std::f64::consts::PI / 180.0,
            (291.8 - 360.0) * std::f64::consts::PI / 180.0,
            0.0,
        ];
        for (n, expected) in expected.into_iter().enumerate() {
            // Some roundings of numbers of this size.
            let allowed = 8.0 * f64::EPSILON * (1.0 + expected.abs());
            assert!((record[n] - expected).abs() <= allowed, "{n}: {record:?}");
        }
        assert_eq!(record[11..], [0.0; 6]);
    }
}

/// Every format is read back within its resolution; 1e-9 m on the ground is 1e-14 degrees.
#[test]
fn written_logs_are_read_back() {
    // Steps of position in degrees, of height in metres, of velocity in m/s and of angles in degrees.
    let cases: [(_, _, f64, f64, f64, f64); 4] = [
        (LogFormat::Nmea, Kind::Nmea, 1e-7 / 60.0, 1e-4, 1e-4, 1e-4),
        (LogFormat::Inspvax, Kind::Inspvax, 1e-11, 1e-4, 1e-5, 1e-9),
        (LogFormat::Bestpos, Kind::Bestpos, 1e-11, 1e-4, 1e-5, 1e-6),
        (LogFormat::Sbet, Kind::Sbet, 1e-14, 1e-9, 1e-12, 1e-9),
    ];
    for (format, kind, place_deg, height_m, velocity_m_s, angle_deg) in cases {
        let log = read(&written(format));
        let records: Vec<_> = log.of(kind).collect();
        assert_eq!(records.len(), 10, "{format:?}");
        for (record, state) in records.iter().zip(states()) {
            assert!(record.time.since(state.time).abs() < 1e-9);
            let Some(Place::Earth(place)) = record.place else {
                panic!("{record:?}")
            };
            let away_deg = [
                place.latitude_deg - state.place.latitude_deg,
                place.longitude_deg - state.place.longitude_deg,
            ];
            for away_deg in away_deg {
                assert!(
                    away_deg.abs() <= 0.5 * place_deg + 3e-14,
                    "{format:?} {away_deg}"
                );
            }
            // Height above the sea and undulation are rounded.
            let away_m = (place.height_m - state.place.height_m).abs();
            assert!(away_m <= height_m + 1e-9, "{format:?} {away_m}");
            if let Some(velocity) = record.velocity_m_s {
                let mut expected = state.velocity_m_s;
                if kind == Kind::Nmea {
                    expected.z = 0.0;
                }
                // The direction's step turns a speed of 1.35 m/s.
                let allowed = velocity_m_s + 1.35 * angle_deg.to_radians();
                let away = (velocity - expected).abs().max_element();
                assert!(away <= allowed, "{format:?} {velocity} {expected}");
            }
            let azimuth = record.attitude.map(|attitude| attitude.azimuth_deg);
            if let Some(azimuth) = azimuth {
                assert!((azimuth - 291.8).abs() <= angle_deg, "{format:?} {azimuth}");
            }
            let stated = record.place_sigma_m;
            let expected = DVec3::new(0.0125, 0.0125, 0.02);
            match format {
                LogFormat::Sbet => assert_eq!(stated, None),
                _ => assert_eq!(stated.map(|s| s.as_vec3()), Some(expected.as_vec3())),
            }
        }
    }
    let bestvel = read(&written(LogFormat::Bestpos));
    assert_eq!(bestvel.of(Kind::Bestvel).count(), 10);
}

/// Attitudes of rotations about any axes, and back.
#[test]
fn attitudes_of_rotations_invert_their_definition() {
    for (roll, pitch, azimuth) in [
        (0.0, 0.0, 0.0),
        (2.0, -3.0, 45.0),
        (-170.0, 60.0, 200.0),
        (90.0, -80.0, 359.0),
    ] {
        let attitude = Attitude {
            roll_deg: Some(roll),
            pitch_deg: Some(pitch),
            azimuth_deg: azimuth,
        };
        let back = Attitude::of_east_north_up(attitude.to_east_north_up());
        let near = |a: f64, b: f64| (a - b).abs() < 1e-9;
        assert!(
            near(back.roll_deg.unwrap(), roll)
                && near(back.pitch_deg.unwrap(), pitch)
                && near(back.azimuth_deg, azimuth),
            "{back:?}"
        );
    }
}
