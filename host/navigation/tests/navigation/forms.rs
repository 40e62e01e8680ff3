//! Unusual but valid forms of logs.

use std::path::Path;

use glam::DVec3;
use subaperture_navigation::{Clock, Kind, Log, Options, Place, Wrong};

use crate::write::{nmea, sbet};

fn read_with(bytes: &[u8], options: &Options) -> Log {
    Log::read_from(bytes, Path::new("log"), options).unwrap()
}

fn read(text: &str) -> Log {
    read_with(text.as_bytes(), &Options::default())
}

fn heights(log: &Log) -> Vec<f64> {
    let height = |place| match place {
        Some(Place::Earth(place)) => place.height_m,
        other => panic!("{other:?}"),
    };
    log.records.iter().map(|r| height(r.place)).collect()
}

fn gga(second: f64, altitude_m: f64, geoid: &str) -> String {
    nmea(&format!(
        "GPGGA,1106{second:05.2},4415.0,N,12130.0,W,4,12,0.8,{altitude_m:.3},M,{geoid},M,,"
    ))
}

#[test]
fn missing_undulation_is_taken_from_nearest_sentence() {
    // Altitude 50 m, geoid -20 m: 30 m above the ellipsoid wherever the field is missing.
    for missing in [[1, 3], [0, 2], [0, 1], [2, 3]] {
        let text: String = (0..4)
            .map(|n| {
                gga(
                    n as f64,
                    50.0,
                    if missing.contains(&n) { "" } else { "-20.0" },
                )
            })
            .collect();
        let log = read(&text);
        assert_eq!(heights(&log), [30.0; 4], "{missing:?}");
        assert!(log.account.doubts.is_empty(), "{}", log.account);
    }
    // Without any undulation, 0 m is used and reported.
    let log = read(&(gga(0.0, 50.0, "") + &gga(1.0, 51.0, "")));
    assert_eq!(heights(&log), [50.0, 51.0]);
    let doubts: Vec<&String> = log.account.doubts.iter().collect();
    assert!(doubts[0].contains("heights assume 0 m"), "{doubts:?}");
}

#[test]
fn missing_height_is_taken_from_nearest_sentence() {
    let rmc = |second: f64| {
        nmea(&format!(
            "GPRMC,1106{second:05.2},A,4415.0,N,12130.0,W,3.6,90.0,311216,,,A"
        ))
    };
    let log = read(&(rmc(0.0) + &rmc(1.0) + &gga(2.0, 50.0, "-20.0") + &rmc(3.0)));
    assert_eq!(heights(&log), [30.0; 4]);
    let alone = read(&(rmc(0.0) + &rmc(1.0)));
    assert_eq!(heights(&alone), [0.0; 2]);
    let text = alone.account.to_string();
    assert!(
        text.contains("records assume 0 m above the ellipsoid"),
        "{text}"
    );
}

#[test]
fn sentences_without_undulation_wait_in_bounded_memory() {
    // More records than may wait: the first ones use 0 m, and the report says that heights jump.
    let mut text = String::new();
    for n in 0..10_050 {
        let (hour, minute, second) = (n / 3600, n / 60 % 60, n % 60);
        let geoid = if n < 10_020 { "" } else { "-20.0" };
        text += &nmea(&format!(
            "GPGGA,{hour:02}{minute:02}{second:02}.00,4415.0,N,12130.0,W,4,12,0.8,50.0,M,{geoid},M,,"
        ));
    }
    let log = read(&text);
    let heights = heights(&log);
    assert_eq!(heights.len(), 10_050);
    assert_eq!((heights[0], heights[10_049]), (50.0, 30.0));
    let text = log.account.to_string();
    assert!(text.contains("heights jump there"), "{text}");
}

#[test]
fn complete_sentences_without_checksum_are_read() {
    let plain = |text: String| text[..text.len() - 5].to_owned() + "\r\n";
    let text: String = (0..5).map(|n| plain(gga(n as f64, 50.0, "40.0"))).collect();
    let log = read(&text);
    assert_eq!(
        (log.records.len(), log.account.faulty()),
        (5, 0),
        "{}",
        log.account
    );
    assert_eq!(heights(&log), [90.0; 5]);
    let report = log.account.to_string();
    assert!(report.contains("have no checksum"), "{report}");
    // A truncated sentence is not read.
    let cut = plain(gga(5.0, 50.0, "40.0"))[..50].to_owned() + "\r\n";
    let log = read(&(text.clone() + &cut));
    assert_eq!((log.records.len(), log.account.wrong[&Wrong::Cut]), (5, 1));
    assert!(
        log.account.to_string().contains("of 14 fields"),
        "{}",
        log.account
    );
    // The last sentence without a line end is not read.
    let log = read(text.trim_end());
    assert_eq!((log.records.len(), log.account.wrong[&Wrong::Cut]), (4, 1));
    // After a sentence with a checksum, a missing one is a fault.
    let mixed = gga(9.0, 50.0, "40.0") + &plain(gga(10.0, 50.0, "40.0"));
    let log = read(&mixed);
    assert_eq!((log.records.len(), log.account.wrong[&Wrong::Cut]), (1, 1));
    assert!(
        log.account.to_string().contains("has no checksum"),
        "{}",
        log.account
    );
}

#[test]
fn abbreviated_novatel_records_are_read() {
    let record = |n: u32, end: &str| {
        format!(
            "<BESTPOS USB1 0 80.0 FINESTEERING 2300 10000{n}.000 02000000 cdba 16000{end}\
             <     SOL_COMPUTED SINGLE 44.25 -121.49999 90.0000 -20.0000 WGS84 1.5 2.5 3.5 \"0 1\" 0.000 0.000 20 20 20 20 00 00 7f 37{end}"
        )
    };
    for end in ["\n", "\r\n"] {
        let text: String = (0..5).map(|n| record(n, end) + "<OK" + end).collect();
        let log = read(&text);
        assert_eq!(heights(&log), [70.0; 5], "{}", log.account);
        let first = log.records[0];
        assert_eq!(
            (first.kind, first.time.week, first.time.seconds),
            (Kind::Bestpos, 2300, 1e5)
        );
        assert_eq!(first.place_sigma_m, Some(DVec3::new(2.5, 1.5, 3.5)));
        assert_eq!(log.account.faulty(), 0);
        assert!(
            log.account.to_string().contains("have no CRC"),
            "{}",
            log.account
        );
    }
    let inspva = "<INSPVA COM1 0 80.0 FINESTEERING 2209 1.000 02000000 cdba 16000\n\
        <     2209 1.0 51.1 -114.0 1081.0 1.5 -2.0 0.25 3.0 -1.5 270.0 INS_SOLUTION_GOOD\n";
    let log = read(inspva);
    assert_eq!(
        log.records[0].velocity_m_s,
        Some(DVec3::new(-2.0, 1.5, 0.25))
    );
    // A truncated body is a fault.
    let cut = record(6, "\n");
    let log = read(&(record(5, "\n") + &cut[..cut.len() - 90] + "\n"));
    assert_eq!(
        (log.records.len(), log.account.faulty()),
        (1, 1),
        "{}",
        log.account
    );
    let log = read(&(record(5, "\n") + cut.trim_end()));
    assert_eq!(log.records.len(), 1);
}

#[test]
fn sbet_continues_in_next_week() {
    let bytes: Vec<u8> = (0..10)
        .flat_map(|n| {
            let mut numbers = [0.1; 17];
            numbers[0] = (604_798.0 + f64::from(n) * 0.5) % 604_800.0;
            sbet(&numbers)
        })
        .collect();
    let options = Options {
        week: Some(2400),
        ..Options::default()
    };
    for (bytes, lost) in [
        (bytes.clone(), 0),
        ([&bytes[..2 * 136], &bytes[2 * 136 + 9..]].concat(), 1),
    ] {
        let log = read_with(&bytes, &options);
        assert_eq!(log.records.len(), 10 - lost, "{}", log.account);
        assert_eq!(log.account.faulty(), lost as u64);
        let last = log.records.last().unwrap().time;
        assert_eq!((last.week, last.seconds), (2401, 2.5));
        assert_eq!(last.since(log.records[0].time), 4.5);
        let weeks = log.records.iter().filter(|r| r.time.week == 2401).count();
        assert_eq!(weeks, 6);
    }
    // Seconds of an unknown week continue past its end.
    let log = read_with(&bytes, &Options::default());
    assert_eq!(log.account.clock, Clock::SecondsOfWeek);
    assert_eq!(log.records[9].time.seconds, 604_802.5);
    // The format is recognised if the second record is in the next week.
    assert_eq!(read_with(&bytes[3 * 136..], &options).records.len(), 7);
}

#[test]
fn csv_continues_in_next_week_or_day() {
    for length in [604_800.0, 86_400.0] {
        let rows: String = (0..6)
            .map(|n| format!("{},1,2,3\n", (length - 1.5 + f64::from(n) * 0.5) % length))
            .collect();
        let log = read(&format!("time_s,x_m,y_m,z_m\n{rows}"));
        assert_eq!(log.records.len(), 6, "{}", log.account);
        assert_eq!(log.records[5].time.since(log.records[0].time), 2.5);
        assert_eq!(log.account.doubts.len(), 1);
    }
    let back = read("time_s,x_m,y_m,z_m\n500,1,2,3\n400,1,2,3\n501,1,2,3\n");
    assert_eq!((back.records.len(), back.account.disordered()), (2, 1));
}

#[test]
fn equal_times_are_reported_and_not_counted_as_damage() {
    let log = read("time_s,x_m,y_m,z_m\n0,1,2,3\n0,1,2,3\n1,1,2,3\n1,1,2,3\n");
    assert_eq!(log.records.len(), 2);
    assert_eq!((log.account.damaged(), log.account.disordered()), (0, 2));
    let text = log.account.to_string();
    assert!(
        text.contains("2 records with times that do not ascend"),
        "{text}"
    );
    assert!(text.contains("CSV at 1.000 s twice"), "{text}");
}

#[test]
fn records_closer_than_a_nanosecond_are_left_out_and_reported() {
    let log = read("time_s,x_m,y_m,z_m\n0,1,2,3\n4.9e-324,1,2,3\n1e-300,1,2,3\n1,1,2,3\n2,1,2,3\n");
    assert_eq!((log.records.len(), log.account.disordered()), (3, 2));
    let text = log.account.to_string();
    assert!(
        text.contains("5e-324 s later: expected at least 1e-9 s"),
        "{text}"
    );
    // A gap of many intervals is counted without overflow.
    let gap = read("time_s,x_m,y_m,z_m\n0,1,2,3\n1e-9,1,2,3\n2e-9,1,2,3\n1e9,1,2,3\n");
    let coverage = &gap.coverage()[0];
    assert_eq!(coverage.gaps.len(), 1);
    assert!(
        coverage.gaps[0].missing < 9_000_000_000_000_001,
        "{coverage:?}"
    );
}

#[test]
fn impossible_positions_are_left_out_and_reported() {
    let row = |n: usize| match n {
        5 => "5,0,0,0\n".to_owned(),
        12 => "12,44.25,-121.45,100\n".to_owned(),
        n => format!("{n},44.25,{:.6},100\n", -121.5 + 1e-5 * n as f64),
    };
    let rows: String = (0..40).map(row).collect();
    let log = read(&format!("time_s,lat_deg,lon_deg,height_m\n{rows}"));
    let frame = log.frame().unwrap();
    let fixes = log.fixes(Kind::Csv, &frame, log.records[0].time).unwrap();
    let placed: Vec<usize> = fixes.iter().map(|fix| fix.time_s as usize).collect();
    let expected: Vec<usize> = (0..40).filter(|n| ![5, 12].contains(n)).collect();
    assert_eq!(placed, expected, "{}", log.account);
    let text = log.account.to_string();
    assert!(
        text.contains("1 records are at latitude 0, longitude 0"),
        "{text}"
    );
    assert!(
        text.contains(
            "1 of 39 positions of CSV are impossible for a vehicle, the first at 12.000 s"
        ),
        "{text}"
    );
}
