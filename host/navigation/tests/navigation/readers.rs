//! Readers of all formats, on generated logs.

use std::path::Path;

use glam::DVec3;
use subaperture_model::geometry::{Geodetic, SceneFrame};
use subaperture_navigation::{Clock, Kind, Log, NavigationError, Options, Place};

use crate::write::Field::{D, F, Skip, U};
use crate::write::{ascii, binary, body, inspva, inspva_body, nmea, sbet, short};

fn read_with(bytes: &[u8], options: &Options) -> Log {
    Log::read_from(bytes, Path::new("log"), options).unwrap()
}

fn read(bytes: &[u8]) -> Log {
    read_with(bytes, &Options::default())
}

fn earth(place: Option<Place>) -> Geodetic {
    match place {
        Some(Place::Earth(place)) => place,
        other => panic!("{other:?}"),
    }
}

#[test]
fn inspva_is_equal_in_ascii_and_binary_with_long_and_short_headers() {
    let text = inspva(502_061.125, 51.150_437_111_11);
    let short_text = ascii(
        "%INSPVASA,2209,502061.120;2209,502061.125,51.15043711111,-114.03067932,1081.0036,1.5,-2.0,0.25,3.0,-1.5,270.0,\
         INS_SOLUTION_GOOD",
    );
    let of_bytes = inspva_body(2209, 502_061.125, 51.150_437_111_11);
    for log in [
        read(text.as_bytes()),
        read(short_text.as_bytes()),
        read(&binary(507, 2209, 502_061_000, &of_bytes)),
        read(&short(508, 2209, 502_061_120, &of_bytes)),
    ] {
        assert_eq!(log.account.faulty(), 0, "{}", log.account);
        assert_eq!(log.account.lost_bytes, 0);
        let [record] = log.records[..] else {
            panic!("{log:?}")
        };
        assert_eq!(record.kind, Kind::Inspva);
        // The record's own time, not its header's.
        assert_eq!((record.time.week, record.time.seconds), (2209, 502_061.125));
        let place = earth(record.place);
        assert_eq!(
            (place.latitude_deg, place.longitude_deg, place.height_m),
            (51.150_437_111_11, -114.030_679_32, 1081.0036)
        );
        // Written north, east, up.
        assert_eq!(record.velocity_m_s, Some(DVec3::new(-2.0, 1.5, 0.25)));
        let attitude = record.attitude.unwrap();
        assert_eq!(
            (attitude.roll_deg, attitude.pitch_deg, attitude.azimuth_deg),
            (Some(3.0), Some(-1.5), 270.0)
        );
    }
}

#[test]
fn inspvax_with_standard_deviations_is_equal_in_ascii_and_binary() {
    let text = ascii(
        "#INSPVAXA,SPECIAL,0,45.5,FINESTEERING,1820,160205.900,00000000,4e14,12996;INS_SOLUTION_GOOD,INS_PPP,43.40408945767,\
         -80.47024696704,326.2121,-36.5,0.001,0.0005,0.0015,1.0470,0.3137,94.203550384,0.5,0.25,0.125,0.0625,0.5,0.75,\
         1.5,1.25,1.75,0000005c,2",
    );
    let bytes = body(&[
        U(3),
        U(56),
        D(43.404_089_457_67),
        D(-80.470_246_967_04),
        D(326.2121),
        F(-36.5),
        D(0.001),
        D(0.0005),
        D(0.0015),
        D(1.0470),
        D(0.3137),
        D(94.203_550_384),
        F(0.5),
        F(0.25),
        F(0.125),
        F(0.0625),
        F(0.5),
        F(0.75),
        F(1.5),
        F(1.25),
        F(1.75),
        U(0x5c),
        Skip(2),
    ]);
    assert_eq!(bytes.len(), 126);
    for log in [
        read(text.as_bytes()),
        read(&binary(1465, 1820, 160_205_900, &bytes)),
    ] {
        let record = log.records[0];
        assert_eq!(record.kind, Kind::Inspvax);
        assert_eq!((record.time.week, record.time.seconds), (1820, 160_205.9));
        assert!((earth(record.place).height_m - 289.7121).abs() < 1e-9);
        // Latitude's, longitude's and height's: north, east, up.
        assert_eq!(record.place_sigma_m, Some(DVec3::new(0.25, 0.5, 0.125)));
        assert_eq!(
            record.velocity_sigma_m_s,
            Some(DVec3::new(0.5, 0.0625, 0.75))
        );
        assert_eq!(record.attitude_sigma_deg, Some([1.5, 1.25, 1.75]));
        assert_eq!(record.velocity_m_s, Some(DVec3::new(0.0005, 0.001, 0.0015)));
    }
}

#[test]
fn positions_and_marks_are_equal_in_ascii_and_binary() {
    let fields = "SOL_COMPUTED,PSRDIFF,51.15043699323,-114.03067932462,1097.6855,-17.0,WGS84,0.5,0.25,0.75,\"AAAA\",6.0,0.0,47,\
                  35,35,33,00,06,39,33";
    let header = "COM1,0,58.5,FINESTEERING,2209,502061.250,02000020,18bc,16809";
    let bytes = body(&[
        U(0),
        U(17),
        D(51.150_436_993_23),
        D(-114.030_679_324_62),
        D(1097.6855),
        F(-17.0),
        U(61),
        F(0.5),
        F(0.25),
        F(0.75),
        Skip(20),
    ]);
    assert_eq!(bytes.len(), 72);
    for (kind, log) in [
        (
            Kind::Bestpos,
            read(ascii(&format!("#BESTPOSA,{header};{fields}")).as_bytes()),
        ),
        (Kind::Bestpos, read(&binary(42, 2209, 502_061_250, &bytes))),
        (
            Kind::Markpos,
            read(ascii(&format!("#MARKPOSA,{header};{fields}")).as_bytes()),
        ),
        (Kind::Markpos, read(&binary(181, 2209, 502_061_250, &bytes))),
    ] {
        let record = log.records[0];
        assert_eq!(record.kind, kind);
        assert_eq!((record.time.week, record.time.seconds), (2209, 502_061.25));
        assert!((earth(record.place).height_m - 1080.6855).abs() < 1e-9);
        assert_eq!(record.place_sigma_m, Some(DVec3::new(0.25, 0.5, 0.75)));
        assert_eq!(record.attitude, None);
    }
    // The mark's own time has nanoseconds, and it states the offset of UTC.
    let text = ascii(&format!(
        "#MARKTIMEA,{header};2209,502061.250000125,-1.5e-08,2.5e-08,-17.999999998,VALID"
    ));
    let bytes = body(&[
        U(2209),
        D(502_061.250_000_125),
        D(-1.5e-8),
        D(2.5e-8),
        D(-17.999_999_998),
        U(0),
    ]);
    assert_eq!(bytes.len(), 40);
    for log in [
        read(text.as_bytes()),
        read(&binary(231, 2209, 502_061_250, &bytes)),
    ] {
        let record = log.records[0];
        assert_eq!((record.kind, record.place), (Kind::Marktime, None));
        assert_eq!(record.time.seconds, 502_061.250_000_125);
        assert_eq!(log.account.leap_seconds_s, Some(18));
    }
}

#[test]
fn records_without_solution_are_counted_and_impossible_values_reported() {
    let header = "COM1,0,58.5,FINESTEERING,2209,502061.250,02000020,18bc,16809";
    let unknown = header.replace("FINESTEERING", "UNKNOWN");
    let fields = "INS_SOLUTION_GOOD";
    let row = |t: f64, latitude: &str, status: &str| {
        format!("2209,{t},{latitude},-114.0,1081.0,1.5,-2.0,0.25,3.0,-1.5,270.0,{status}")
    };
    let log = ascii(&format!(
        "#INSPVAA,{header};{}",
        row(1.0, "51", "INS_ALIGNING")
    )) + &ascii(&format!("#INSPVAA,{unknown};{}", row(2.0, "51", fields)))
        + &ascii(&format!("#INSPVAA,{header};{}", row(3.0, "91", fields)))
        + &ascii(&format!("#INSPVAA,{header};{}", row(4.0, "NaN", fields)))
        + &ascii(&format!("#INSPVAA,{header};2209,5.0,51"))
        + &ascii(&format!("#TIMEA,{header};VALID"))
        + &ascii(&format!("#INSPVAA,{header};{}", row(6.0, "51", fields)));
    let log = read(log.as_bytes());
    assert_eq!((log.records.len(), log.account.unsolved["INSPVA"]), (1, 2));
    assert_eq!(log.account.others["TIMEA"], 1);
    let faults: Vec<String> = log.account.faults.iter().map(ToString::to_string).collect();
    assert_eq!(faults.len(), 3, "{faults:?}");
    assert!(
        faults[0].contains("line 3: INSPVA: latitude is 91"),
        "{faults:?}"
    );
    assert!(
        faults[1].contains("line 4: INSPVA: latitude is 'NaN'"),
        "{faults:?}"
    );
    assert!(
        faults[2].contains("line 5: INSPVA: no longitude"),
        "{faults:?}"
    );
}

#[test]
fn sentences_of_one_time_are_one_record() {
    let log = nmea("GPGGA,235959.50,5109.0262,N,11401.8407,W,4,12,0.9,1097.5,M,-17.0,M,,")
        + &nmea("GPRMC,235959.50,A,5109.0262,N,11401.8407,W,3.6,90.0,311216,,,A")
        + &nmea("GPGST,235959.50,1.0,,,,0.25,0.5,0.75")
        + &nmea("GPHDT,95.5,T")
        + &nmea("GPGGA,000000.50,5109.0362,N,11401.8407,W,4,12,0.9,1098.5,M,-17.0,M,,")
        + &nmea("GPVTG,180.0,T,,M,7.2,N,13.3,K")
        + &nmea("GPGGA,000001.50,5109.0462,N,11401.8407,W,0,,,,M,,M,,")
        + &nmea("GPGSV,1,1,00");
    let log = read(log.as_bytes());
    let [first, second] = log.records[..] else {
        panic!("{log:?}")
    };
    let knot = 1852.0 / 3600.0;
    assert!((earth(first.place).latitude_deg - (51.0 + 9.0262 / 60.0)).abs() < 1e-12);
    assert!((earth(first.place).longitude_deg + (114.0 + 1.8407 / 60.0)).abs() < 1e-12);
    assert_eq!(earth(first.place).height_m, 1080.5);
    assert!(
        first
            .velocity_m_s
            .unwrap()
            .distance(DVec3::new(3.6 * knot, 0.0, 0.0))
            < 1e-12
    );
    assert!(
        second
            .velocity_m_s
            .unwrap()
            .distance(DVec3::new(0.0, -7.2 * knot, 0.0))
            < 1e-12
    );
    assert_eq!(first.place_sigma_m, Some(DVec3::new(0.5, 0.25, 0.75)));
    assert_eq!(first.attitude.unwrap().azimuth_deg, 95.5);
    assert_eq!(second.attitude, None);
    // 31 December 2016 was a Saturday; that midnight had a leap second, so that the seconds of UTC from one to the other are 2 of GPS.
    assert_eq!((first.time.week, first.time.seconds), (1930, 16.5));
    assert_eq!((second.time.week, second.time.seconds), (1930, 18.5));
    assert_eq!(log.account.leap_seconds_s, Some(18));
    assert_eq!(log.account.unsolved["GGA"], 1);
    assert_eq!(log.account.others["GPGSV"], 1);
}

#[test]
fn log_without_dates_has_times_of_day_or_given_date() {
    let gga = |time: &str, minutes: f64| {
        nmea(&format!(
            "GNGGA,{time},51{minutes:07.4},N,01401.8407,E,1,12,0.9,97.5,M,45.0,M,,"
        ))
    };
    let text = gga("235958.00", 1.0) + &gga("235959.00", 1.001) + &gga("000000.00", 1.002);
    let log = read(text.as_bytes());
    assert_eq!(log.account.clock, Clock::SecondsOfDay);
    let seconds: Vec<f64> = log.records.iter().map(|r| r.time.seconds).collect();
    assert_eq!(seconds, [86_398.0, 86_399.0, 86_400.0]);
    // Monday 2 January 2017, 18 s ahead.
    let options = Options {
        date: Some((2017, 1, 2)),
        ..Options::default()
    };
    let dated = read_with(text.as_bytes(), &options);
    assert_eq!(dated.account.clock, Clock::Gps);
    let times: Vec<(u32, f64)> = dated
        .records
        .iter()
        .map(|r| (r.time.week, r.time.seconds))
        .collect();
    assert_eq!(times[2], (1930, 2.0 * 86_400.0 + 18.0));
    // A later date dates the records before it.
    let late = text + &nmea("GNZDA,000000.00,03,01,2017,,");
    assert_eq!(read(late.as_bytes()).records, dated.records);
}

fn sbet_at(n: usize, wander: f64) -> [f64; 17] {
    let t = 1000.0 + n as f64 * 0.005;
    // 2 m/s to the east at 45 degrees north.
    let easting = 2.0 * n as f64 * 0.005 / (6_378_137.0 * 0.7);
    let (sin, cos) = wander.sin_cos();
    let mut numbers = [0.0; 17];
    numbers[..11].copy_from_slice(&[
        t,
        0.785,
        0.1 + easting,
        120.0,
        -2.0 * sin,
        2.0 * cos,
        0.0,
        0.01,
        -0.02,
        1.5 + wander,
        wander,
    ]);
    numbers
}

#[test]
fn sbet_heading_and_velocity_are_rotated_by_wander_angle() {
    let bytes: Vec<u8> = (0..400).flat_map(|n| sbet(&sbet_at(n, 0.4))).collect();
    let log = read(&bytes);
    assert_eq!((log.records.len(), log.account.faulty()), (400, 0));
    assert_eq!(log.account.clock, Clock::SecondsOfWeek);
    let record = log.records[7];
    assert!((earth(record.place).latitude_deg - 0.785f64.to_degrees()).abs() < 1e-12);
    assert!(
        record
            .velocity_m_s
            .unwrap()
            .distance(DVec3::new(2.0, 0.0, 0.0))
            < 1e-12
    );
    let attitude = record.attitude.unwrap();
    assert!((attitude.azimuth_deg - 1.5f64.to_degrees()).abs() < 1e-10);
    assert!((attitude.pitch_deg.unwrap() + 0.02f64.to_degrees()).abs() < 1e-12);
    assert!(log.account.notes.is_empty(), "{}", log.account);
    // The other sign of the wander angle contradicts the positions.
    let other: Vec<u8> = (0..400)
        .flat_map(|n| {
            let mut numbers = sbet_at(n, 0.4);
            numbers[10] = -0.4;
            sbet(&numbers)
        })
        .collect();
    let log = read(&other);
    assert!(
        log.account.to_string().contains("do not fit its positions"),
        "{}",
        log.account
    );
}

#[test]
fn csv_values_are_read_in_units_of_header() {
    let text = "# a flight\ntime [ms],Latitude (deg),longitude_rad,height_km,heading_deg,pitch_deg,roll_deg,velocity_east_km_h,\
                velocity_north_m_s,velocity_up_m_s,sigma_x_cm,sigma_y_cm,sigma_z_cm,flag\n\
                1500,45,0.1,0.12,90,10,20,36,0.5,0,10,20,30,x\n1600,45,0.1,0.12,,,,36,0.5,0,10,20,30,x\n";
    let log = read(text.as_bytes());
    assert_eq!(log.account.clock, Clock::Own);
    let [first, second] = log.records[..] else {
        panic!("{log:?}")
    };
    assert_eq!(first.time.seconds, 1.5);
    let place = earth(first.place);
    assert!((place.latitude_deg - 45.0).abs() < 1e-12 && (place.height_m - 120.0).abs() < 1e-12);
    assert!((place.longitude_deg - 0.1f64.to_degrees()).abs() < 1e-12);
    assert!(
        first
            .velocity_m_s
            .unwrap()
            .distance(DVec3::new(10.0, 0.5, 0.0))
            < 1e-12
    );
    assert!(
        first
            .place_sigma_m
            .unwrap()
            .distance(DVec3::new(0.1, 0.2, 0.3))
            < 1e-12
    );
    // East, nose up by 10 degrees.
    let nose = first.attitude.unwrap().to_east_north_up() * DVec3::X;
    assert!(
        nose.distance(DVec3::new(
            10f64.to_radians().cos(),
            0.0,
            10f64.to_radians().sin()
        )) < 1e-12
    );
    assert_eq!(second.attitude, None);
    assert!(log.account.to_string().contains("columns ignored: flag"));
    // Track convention: yaw, and positive pitch nose down.
    let text = "time_s,x_m,y_m,z_m,roll_deg,pitch_deg,yaw_deg\n0,1,2,3,0,10,0\n1,2,2,3,0,10,0\n";
    let log = read(text.as_bytes());
    let fixes = log
        .fixes(Kind::Csv, &SceneFrame::Local, log.records[0].time)
        .unwrap();
    assert_eq!(fixes[1].position_m, DVec3::new(2.0, 2.0, 3.0));
    let nose = fixes[0].attitude.unwrap() * DVec3::X;
    assert!(
        (nose.z + 10f64.to_radians().sin()).abs() < 1e-12 && nose.y.abs() < 1e-12,
        "{nose}"
    );
}

#[test]
fn csv_header_without_units_or_positions_is_refused() {
    for (header, text_of_error) in [
        ("time_s,x,y_m,z_m", "column 'x': '1' has no unit"),
        ("time_s,x_s,y_m,z_m", "expected a length, found a time"),
        ("time_s,x_m,y_m", "all of x, y and z"),
        ("time_s,roll_deg", "no position"),
        ("time_s,x_m,y_m,z_m,x_cm", "found two"),
        ("time_s,x_m,y_m,z_m,yaw_deg,heading_deg", "not both"),
        ("timer,x_m,y_m,z_m", "expected a column of time"),
    ] {
        let text = format!("{header}\n1,2,3,4\n");
        let error = Log::read_from(text.as_bytes(), Path::new("a.csv"), &Options::default());
        let error = error.unwrap_err();
        assert!(matches!(error, NavigationError::Header { .. }));
        assert!(error.to_string().contains(text_of_error), "{error}");
    }
}
