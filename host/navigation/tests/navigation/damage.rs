//! Logs with truncated lines, wrong checksums and foreign bytes: valid messages are read and faults are reported.

use std::path::Path;

use subaperture_navigation::{Kind, Log, NavigationError, Options, Wrong};

use crate::write::{ascii, binary, inspva, inspva_body, nmea, sbet};

fn read(bytes: &[u8]) -> Log {
    Log::read_from(bytes, Path::new("log"), &Options::default()).unwrap()
}

fn at(n: usize) -> (f64, f64) {
    (502_061.0 + n as f64 * 0.05, 51.1 + n as f64 * 1e-7)
}

fn line(n: usize) -> String {
    let (seconds, latitude) = at(n);
    inspva(seconds, latitude)
}

fn seconds(log: &Log) -> Vec<f64> {
    log.records
        .iter()
        .map(|record| record.time.seconds)
        .collect()
}

/// A hundred lines: 10 to 19 are missing, 40 is truncated without a line end, 50 is truncated, 60 has a wrong digit, and 70 to 72 are noise.
#[test]
fn truncated_lines_and_wrong_crcs_are_counted() {
    let mut text = Vec::new();
    for n in 0..100 {
        let whole = line(n);
        match n {
            10..=19 => {}
            // Without a line end: the next line starts within it.
            40 => text.extend(whole[..60].bytes()),
            50 => text.extend([&whole[..70], "\r\n"].concat().bytes()),
            60 => text.extend(whole.replace("1081.0036", "1081.0037").bytes()),
            70..=72 => text.extend((0..120u8).map(|k| k.wrapping_mul(151))),
            _ => text.extend(whole.bytes()),
        }
    }
    let log = read(&text);
    let lost = |n: &usize| matches!(n, 10..=19 | 40 | 50 | 60 | 70..=72);
    let kept: Vec<f64> = (0..100).filter(|n| !lost(n)).map(|n| at(n).0).collect();
    let near = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-9;
    assert_eq!(log.records.len(), kept.len(), "{}", log.account);
    assert!(seconds(&log).iter().zip(&kept).all(near));
    let account = &log.account;
    assert_eq!(account.wrong[&Wrong::Cut], 2, "{account}");
    assert_eq!(account.wrong[&Wrong::Checksum], 1, "{account}");
    let text_of_account = account.to_string();
    // Message 40 is on line 31 of the file, after messages 0 to 9 and 20 to 39.
    assert!(
        text_of_account.contains("line 31: INSPVAA is cut short"),
        "{text_of_account}"
    );
    assert!(
        text_of_account.contains("line 40: INSPVAA is cut short"),
        "{text_of_account}"
    );
    assert!(
        text_of_account.contains("line 50: INSPVAA is damaged: its CRC is"),
        "{text_of_account}"
    );
    let [coverage] = &log.coverage()[..] else {
        panic!("{:?}", log.coverage())
    };
    assert!((coverage.interval_s - 0.05).abs() < 1e-9);
    let missing: Vec<u64> = coverage.gaps.iter().map(|gap| gap.missing).collect();
    assert_eq!(missing, [10, 1, 1, 1, 3]);
    assert!((coverage.gaps[0].from.seconds - at(9).0).abs() < 1e-9);
    assert!((coverage.gaps[0].to.seconds - at(20).0).abs() < 1e-9);
}

#[test]
fn reading_resumes_after_damaged_binary_messages() {
    let message = |n: usize| {
        let (seconds, latitude) = at(n);
        binary(
            507,
            2209,
            502_061_000,
            &inspva_body(2209, seconds, latitude),
        )
    };
    let mut bytes = Vec::new();
    for n in 0..30 {
        let whole = message(n);
        match n {
            // Truncated body, truncated header, wrong bit, wrong length.
            5 => bytes.extend(&whole[..50]),
            10 => bytes.extend(&whole[..9]),
            15 => {
                let at = bytes.len() + 60;
                bytes.extend(&whole);
                bytes[at] ^= 4;
            }
            20 => {
                let at = bytes.len() + 9;
                bytes.extend(&whole);
                bytes[at] = 0xff;
            }
            25 => bytes.extend(line(n).bytes()),
            _ => bytes.extend(&whole),
        }
    }
    // The file ends within the last message.
    bytes.truncate(bytes.len() - 20);
    let log = read(&bytes);
    let kept: Vec<f64> = (0..29)
        .filter(|n| ![5, 10, 15, 20].contains(n))
        .map(|n| at(n).0)
        .collect();
    let near = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-9;
    assert_eq!(log.records.len(), kept.len(), "{}", log.account);
    assert!(seconds(&log).iter().zip(&kept).all(near));
    assert_eq!(log.account.faulty(), 5, "{}", log.account);
    assert!(log.account.lost_bytes > 0 && log.account.bytes == bytes.len() as u64);
}

/// All messages are read, whatever bytes are between them.
#[test]
fn foreign_bytes_between_messages_lose_no_message() {
    let junk: [&[u8]; 8] = [
        b"<OK\r\n[COM1]",
        b"#",
        b"%%%###$$$",
        &[0xAA, 0x44, 0x12],
        &[0xAA, 0x44, 0x13, 0x05],
        &[0xAA; 40],
        b"$GPGGA,1234",
        b"#INSPVAXA,",
    ];
    for junk in junk {
        let mut bytes = Vec::new();
        for n in 0..6 {
            bytes.extend(junk);
            match n % 2 {
                0 => bytes.extend(line(n).bytes()),
                _ => {
                    let (seconds, latitude) = at(n);
                    bytes.extend(binary(
                        507,
                        2209,
                        1000,
                        &inspva_body(2209, seconds, latitude),
                    ));
                }
            }
        }
        let log = read(&bytes);
        // AA 44 13 05 looks like a message of 21 bytes until its CRC is checked.
        assert_eq!(log.records.len(), 6, "{junk:?}: {}", log.account);
    }
}

#[test]
fn sentences_with_wrong_checksum_or_earlier_time_are_left_out() {
    let gga = |time: &str| {
        nmea(&format!(
            "GPGGA,{time},5109.0,N,11401.8,W,1,12,0.9,97.5,M,45.0,M,,"
        ))
    };
    let damaged = gga("120002.00").replace("5109.0", "5108.0");
    let cut = gga("120003.00")[..30].to_owned() + "\r\n";
    let text = gga("120001.00")
        + &damaged
        + &cut
        + &gga("120004.00")
        + &gga("120003.50")
        + &gga("120005.00");
    let log = read(text.as_bytes());
    assert_eq!(log.records.len(), 3, "{log:?}");
    let wrong = &log.account.wrong;
    assert_eq!(
        (
            wrong[&Wrong::Checksum],
            wrong[&Wrong::Cut],
            wrong[&Wrong::Disorder]
        ),
        (1, 1, 1)
    );
}

#[test]
fn sbet_reading_resumes_after_lost_bytes() {
    let record = |n: usize| {
        let mut numbers = [0.25; 17];
        numbers[0] = 1000.0 + n as f64 * 0.005;
        sbet(&numbers)
    };
    let mut bytes: Vec<u8> = (0..50).flat_map(record).collect();
    bytes.drain(20 * 136 + 5..20 * 136 + 60);
    bytes.truncate(bytes.len() - 30);
    let log = read(&bytes);
    assert_eq!(log.records.len(), 48, "{}", log.account);
    assert!(log.records.iter().all(|r| r.kind == Kind::Sbet));
    assert_eq!(log.account.faulty(), 2, "{}", log.account);
    let coverage = &log.coverage()[0];
    assert_eq!(coverage.gaps.len(), 1);
    assert_eq!(coverage.gaps[0].missing, 1);
}

#[test]
fn invalid_csv_rows_are_left_out() {
    let text =
        "time_s,x_m,y_m,z_m\n1,2,3,4\n2,2,3\n3,2,x,4\n4,2,inf,4\n3.5,1,1,1\n3.4,1,1,1\n5,2,3,4\n";
    let log = read(text.as_bytes());
    let times: Vec<f64> = seconds(&log);
    assert_eq!(times, [1.0, 3.5, 5.0]);
    let text_of_account = log.account.to_string();
    assert!(
        text_of_account.contains("line 3: 3 values")
            && text_of_account.contains("CSV at 3.400 s after 3.500 s"),
        "{text_of_account}"
    );
}

#[test]
fn log_without_a_valid_fix_reports_its_messages() {
    let empty = Log::read_from(&b""[..], Path::new("a.log"), &Options::default());
    assert!(matches!(empty, Err(NavigationError::NoRecords { .. })));
    let text = ascii("#TIMEA,COM1,0,58.5,FINESTEERING,2209,502061.000,02000020,18bc,16809;VALID")
        + &line(1)[..80];
    let error =
        Log::read_from(text.as_bytes(), Path::new("a.log"), &Options::default()).unwrap_err();
    let text_of_account = error.to_string();
    assert!(
        text_of_account.contains("a.log: no record of NovAtel")
            && text_of_account.contains("1 TIMEA"),
        "{text_of_account}"
    );
    assert!(
        text_of_account.contains("line 2: INSPVAA is cut short"),
        "{text_of_account}"
    );
}
