//! A recorded NovAtel log: its checksums, positions and attitudes, and the track through them.

use std::path::Path;

use glam::DVec3;
use subaperture::geometry::{Geodetic, SceneFrame};
use subaperture::navigation::{Kind, Log, Options, Place};
use subaperture::track::{SampledTrack, Trajectory};

/// 115 s of a walk with a ProPak6, 20 records per second.
fn recording() -> Option<Log> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../shared/data/novatel/spandriver_propak6-ins-ppp.ascii.asc");
    if !path.exists() {
        println!("skipped: {} not found", path.display());
        return None;
    }
    let log = Log::read(&path, &Options::default()).unwrap();
    // Every CRC is valid.
    assert_eq!((log.account.faulty(), log.account.lost_bytes), (0, 0));
    Some(log)
}

fn earth(place: Option<Place>) -> Geodetic {
    match place {
        Some(Place::Earth(place)) => place,
        other => panic!("{other:?}"),
    }
}

#[test]
fn every_line_of_recording_is_accounted_for() {
    let Some(log) = recording() else { return };
    // Counted in the file with grep: 7096 lines.
    assert_eq!(log.of(Kind::Inspvax).count(), 2289);
    assert_eq!(log.of(Kind::Bestpos).count(), 2288);
    assert_eq!(log.account.others["CORRIMUDATAA"], 2289);
    assert_eq!(log.account.others["INSCOVA"], 115);
    assert_eq!(log.account.others["TIMEA"], 115);
    assert!(log.account.unsolved.is_empty());
    let first = log.records[0];
    assert_eq!((first.time.week, first.time.seconds), (1820, 160_205.9));
    assert!((earth(first.place).height_m - (326.2121 - 36.5)).abs() < 1e-9);
    // The file has 0.0227 m for latitude, 0.0219 m for longitude.
    assert_eq!(
        first.place_sigma_m,
        Some(DVec3::new(0.0219, 0.0227, 0.0377))
    );
    // Twenty records per second without a gap.
    for coverage in log.coverage() {
        assert!((coverage.interval_s - 0.05).abs() < 1e-6 && coverage.gaps.is_empty());
    }
    assert_eq!(first.attitude.unwrap().azimuth_deg, 94.203_550_384);
}

#[test]
fn track_agrees_with_recorded_velocities_and_other_positions() {
    let Some(log) = recording() else { return };
    let first = log.records[0];
    let place = earth(first.place);
    let (sin_lon, cos_lon) = place.longitude_deg.to_radians().sin_cos();
    let (sin_lat, cos_lat) = place.latitude_deg.to_radians().sin_cos();
    let frame = SceneFrame::Earth {
        origin_ecf_m: place.to_ecf_m(),
        x_axis_ecf: DVec3::new(-sin_lon, cos_lon, 0.0),
        y_axis_ecf: DVec3::new(-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat),
    };
    let fixes = log.fixes(Kind::Inspvax, &frame, first.time).unwrap();
    let track = SampledTrack::new(&fixes).unwrap();
    assert!((fixes.last().unwrap().time_s - 114.4).abs() < 1e-9);
    let mut errors = Vec::new();
    let mut fastest: f64 = 0.0;
    for record in log.of(Kind::Inspvax) {
        let t = record.time.since(first.time);
        let h = 1e-3;
        let velocity = (track.pose(t + h).position_m - track.pose(t - h).position_m) / (2.0 * h);
        let recorded = record.velocity_m_s.unwrap();
        fastest = fastest.max(recorded.length());
        errors.push(velocity.distance(recorded));
    }
    errors.sort_by(f64::total_cmp);
    let median = errors[errors.len() / 2];
    println!(
        "velocity of the spline against the recorded one: median {median:.4} m/s of {fastest:.2} m/s"
    );
    // The receiver corrects its positions by up to 6 cm between records, but not its velocities: differences of positions over two records
    // deviate by 0.032 m/s in the median, and by more than 0.45 m/s in 1 %. Half as much again is allowed for the spline. East in place of
    // north, or a wrong sign, would deviate by most of the walk's speed, 0.74 m/s RMS.
    assert!(fastest > 1.0 && median < 0.05, "{median} of {fastest}");
    // The best position is that of the antenna, less than 1 m from the inertial unit.
    let best = log.fixes(Kind::Bestpos, &frame, first.time).unwrap();
    let apart = best
        .iter()
        .map(|f| f.position_m.distance(track.pose(f.time_s).position_m));
    let farthest = apart.fold(0.0, f64::max);
    println!("antenna and inertial unit: {farthest:.3} m apart at most");
    assert!(farthest < 1.0);
}
