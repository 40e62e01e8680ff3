//! Tracks: NovAtel's logs, comma-separated values and Motive's takes.

use std::path::Path;

use glam::DVec3;
use subaperture::geometry::SceneFrame;
use subaperture::io::novatel::{self, Damage, Source};
use subaperture::io::track_axes::TrackAxes;
use subaperture::io::{motive, phase_csv, track_csv};
use subaperture::track::{Fix, SampledTrack, Trajectory};

pub(super) const NOVATEL_WORDS: &[&str] = &[
    "#INSPVAA",
    "#INSPVAXA",
    "#BESTPOSA",
    "%INSPVASA",
    ";",
    ",",
    "*",
    "\r\n",
    "INS_SOLUTION_GOOD",
    "SOL_COMPUTED",
    "WGS84",
    "UNKNOWN",
    "INS_ALIGNING",
    "FINESTEERING",
];

pub(super) const PHASE_WORDS: &[&str] = &[
    "pulse",
    "phase_rad",
    ",",
    "\n",
    "#",
    "0",
    "1",
    "NaN",
    "1e12",
];

pub(super) const CSV_WORDS: &[&str] = &[
    "time_s",
    "x_m",
    "y_m",
    "z_m",
    "roll_deg",
    "pitch_deg",
    "yaw_deg",
    "roll_rad",
    "pitch_rad",
    "yaw_rad",
    ",",
    "\n",
    "#",
    "\u{feff}",
];

pub(super) const MOTIVE_WORDS: &[&str] = &[
    "Format Version",
    "Length Units",
    "Millimeters",
    "Meters",
    "Rotation Type",
    "Quaternion",
    "Coordinate Space",
    "Global",
    "Rigid Body",
    "Rotation",
    "Position",
    "Frame",
    "Time (Seconds)",
    ",",
    "\n",
    "\"",
];

pub(super) fn motive_seeds() -> Vec<Vec<u8>> {
    let take = |units: &str, rotation: &str, letters: &str, rows: &str| {
        let columns = letters.split(',').count();
        let every = |word: &str| format!(",{word}").repeat(columns);
        let names = every("radar");
        let [bodies, numbers] = ["Rigid Body", "1"].map(every);
        format!(
            "Format Version,1.23,Take Name,walk,Rotation Type,Quaternion,Length Units,{units},Coordinate Space,Global\n\
             \n,Type{bodies}\n,Name{names}\n,ID{numbers}\n,{rotation}\nFrame,Time (Seconds),{letters}\n{rows}"
        )
        .into_bytes()
    };
    let turned = format!("{}{}", ",Rotation".repeat(4), ",Position".repeat(3));
    vec![
        take(
            "Millimeters",
            &turned,
            "X,Y,Z,W,X,Y,Z",
            "0,0.0,0,0,0,1,100,1500,-20\n1,0.01,,,,,,,\n2,0.02,0,0.38268343,0,0.92387953,110,1500,-20\n",
        ),
        take(
            "Meters",
            &",Position".repeat(3),
            "X,Y,Z",
            "0,0.0,0.1,1.5,-0.2\r\n1,0.01,0.11,1.5,-0.2\r\n2,0.02,0.12,1.6,-0.2\r\n",
        ),
    ]
}

pub(super) fn novatel_seeds() -> Vec<Vec<u8>> {
    let header = "COM1,0,58.5,FINESTEERING,2209,502061.000,02000020,18bc,16809";
    let inspva = |t: f64, latitude: f64| {
        format!(
            "#INSPVAA,{header};2209,{t:.3},{latitude:.11},-114.03067932,1081.0036,1.5,-2.0,0.25,3.0,-1.5,270.0,\
             INS_SOLUTION_GOOD*0\r\n"
        )
    };
    let bestpos = |t: f64| {
        format!(
            "#BESTPOSA,COM1,0,58.5,FINESTEERING,2209,{t:.3},02000020,18bc,16809;SOL_COMPUTED,PSRDIFF,51.15043699323,\
             -114.03067932462,{t:.4},-17.0,WGS84,0.4,0.4,0.8,\"AAAA\",6.0,0.0,47,35,35,33,00,06,39,33*0\r\n"
        )
    };
    let inspvax = format!(
        "#INSPVAXA,{header};INS_SOLUTION_GOOD,INS_RTKFIXED,51.15043711111,-114.03067932,1081.0036,-17.0,1.5,-2.0,0.25,\
         3.0,-1.5,270.0,0.1,0.1,0.1,0.01,0.01,0.01,0.1,0.1,0.1,00000000,0*0\r\n"
    );
    let logs = [
        inspva(502061.125, 51.150437)
            + &inspva(502061.25, 51.150438)
            + &inspva(502061.375, 51.150439),
        bestpos(100.0) + &bestpos(101.0) + "#TIMEA,x;y*0\r\n",
        inspvax + "\r\n%SHORTA,1;2*0\r\n",
    ];
    logs.map(|log| {
        let mut bytes = log.into_bytes();
        super::repair::novatel(&mut bytes);
        bytes
    })
    .to_vec()
}

pub(super) fn csv_seeds() -> Vec<Vec<u8>> {
    [
        "time_s,x_m,y_m,z_m\n0,1,2,3\n0.5,2,2.5,3\n1,3,2,3\n",
        "\u{feff}# flight\nz_m,x_m,y_m,yaw_deg,roll_deg,pitch_deg,time_s\r\n\r\n300,1,2,90,0,0,0.5\n301,-1e1,2.5,0,30,0,1\n",
        "time_s,x_m,y_m,z_m,roll_rad,pitch_rad,yaw_rad\n0,0,0,0,0,0.5,0\n1,1,0,0,0,0.25,0.125\n",
    ]
    .map(|text| text.as_bytes().to_vec())
    .to_vec()
}

/// A track through fixes is finite wherever it is asked.
fn follow(fixes: &[Fix]) -> String {
    let places = fixes
        .iter()
        .all(|fix| fix.position_m.is_finite() && fix.time_s.is_finite());
    assert!(places, "a fix that is not finite");
    let track = match SampledTrack::new(fixes) {
        Ok(track) => track,
        Err(error) => return error.to_string(),
    };
    let (first, last) = (fixes[0].time_s, fixes[fixes.len() - 1].time_s);
    for n in 0..=8 {
        let pose = track.pose(first + (last - first) * f64::from(n) / 8.0);
        let ahead = pose.attitude * DVec3::X;
        assert!(pose.position_m.is_finite(), "{pose:?}");
        assert!((ahead.length() - 1.0).abs() < 1e-6, "{pose:?}");
    }
    "a track".to_owned()
}

pub(super) fn novatel(bytes: &[u8]) -> String {
    let path = Path::new("input.asc");
    let whole = novatel::read_from(bytes, path, Damage::Refuse);
    let log = match (&whole, novatel::read_from(bytes, path, Damage::Skip)) {
        (Ok(whole), Ok(skipped)) => {
            assert_eq!(*whole, skipped, "nothing was damaged");
            skipped
        }
        (Err(_), Ok(skipped)) => skipped,
        (Ok(_), Err(error)) => panic!("read whole, but not with damage skipped: {error}"),
        (Err(_), Err(error)) => return error.to_string(),
    };
    for record in &log.records {
        let place = record.place;
        assert!(place.latitude_deg.abs() <= 90.0 && place.longitude_deg.abs() <= 180.0);
        assert!(place.to_ecf_m().is_finite());
    }
    let mut outcome = format!("{} other kinds", log.skipped.len().min(4));
    let Some(first) = log.records.first() else {
        return outcome;
    };
    let frame = SceneFrame::Earth {
        origin_ecf_m: first.place.to_ecf_m(),
        x_axis_ecf: DVec3::Y,
        y_axis_ecf: DVec3::Z,
    };
    for source in [Source::Inspva, Source::Inspvax, Source::Bestpos] {
        outcome += &match log.fixes(source, &frame, first.time) {
            Ok(fixes) => follow(&fixes),
            Err(error) => error.to_string(),
        };
    }
    outcome
}

pub(super) fn motive(bytes: &[u8]) -> String {
    let read = |body| motive::read_from(bytes, Path::new("take.csv"), body, TrackAxes::y_up());
    match (read(None), read(Some("radar"))) {
        (Ok(only), Ok(named)) => {
            assert_eq!(only, named, "the only body is the one that is named");
            follow(&only)
        }
        (Ok(fixes), Err(_)) | (Err(_), Ok(fixes)) => follow(&fixes),
        (Err(error), Err(_)) => error.to_string(),
    }
}

pub(super) fn csv(bytes: &[u8]) -> String {
    match track_csv::read_from(bytes, Path::new("input.csv")) {
        Ok(fixes) if fixes.is_empty() => "no fixes".to_owned(),
        Ok(fixes) => follow(&fixes),
        Err(error) => error.to_string(),
    }
}

pub(super) fn phase_seeds() -> Vec<Vec<u8>> {
    [
        "pulse,phase_rad\n0,0.125\n1,-0.5\n2,1e3\n",
        "\u{feff}# written by subap\npulse, phase_rad\r\n\r\n0, -2.5e-17\r\n",
    ]
    .map(|text| text.as_bytes().to_vec())
    .to_vec()
}

/// What is read is finite, and is written and read again as it is.
pub(super) fn phases(bytes: &[u8]) -> String {
    let path = Path::new("input.csv");
    match phase_csv::read_from(bytes, path) {
        Ok(phases) => {
            assert!(phases.iter().all(|phase| phase.is_finite()));
            let again = phase_csv::read_from(phase_csv::text(&phases).as_bytes(), path);
            assert_eq!(again.expect("what was written"), phases);
            format!("{} phases", phases.len())
        }
        Err(error) => error.to_string(),
    }
}
