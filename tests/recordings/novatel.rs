//! A recorded NovAtel log: its checksums, positions and attitudes, and the track through them.

use std::path::Path;

use glam::DVec3;
use subaperture::geometry::SceneFrame;
use subaperture::io::novatel::{self, Damage, Source};
use subaperture::track::{SampledTrack, Trajectory};

/// 115 s of a walk with a ProPak6, 20 records a second.
fn recording() -> Option<novatel::Log> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../shared/data/novatel/spandriver_propak6-ins-ppp.ascii.asc");
    if !path.exists() {
        println!("skipped: {} not found", path.display());
        return None;
    }
    // Refuse: every CRC has to be right.
    Some(novatel::read(&path, Damage::Refuse).unwrap())
}

#[test]
fn every_line_of_the_recording_is_accounted_for() {
    let Some(log) = recording() else { return };
    // Counted in the file with grep: 7096 lines.
    let of = |source| log.records.iter().filter(|r| r.source == source).count();
    assert_eq!(of(Source::Inspvax), 2289);
    assert_eq!(of(Source::Bestpos), 2288);
    assert_eq!(log.skipped["CORRIMUDATAA"], 2289);
    assert_eq!(log.skipped["INSCOVA"], 115);
    assert_eq!(log.skipped["TIMEA"], 115);
    assert_eq!((log.unsolved, log.damaged), (0, 0));
    let first = log.records[0];
    assert_eq!((first.time.week, first.time.seconds), (1820, 160_205.9));
    assert!((first.place.height_m - (326.2121 - 36.5)).abs() < 1e-9);
    assert_eq!(first.attitude.unwrap().azimuth_deg, 94.203_550_384);
}

#[test]
fn the_track_agrees_with_recorded_velocities_and_the_other_positions() {
    let Some(log) = recording() else { return };
    let first = log.records[0];
    let place = first.place;
    let (sin_lon, cos_lon) = place.longitude_deg.to_radians().sin_cos();
    let (sin_lat, cos_lat) = place.latitude_deg.to_radians().sin_cos();
    let frame = SceneFrame::Earth {
        origin_ecf_m: place.to_ecf_m(),
        x_axis_ecf: DVec3::new(-sin_lon, cos_lon, 0.0),
        y_axis_ecf: DVec3::new(-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat),
    };
    let fixes = log.fixes(Source::Inspvax, &frame, first.time).unwrap();
    let track = SampledTrack::new(&fixes).unwrap();
    assert!((fixes.last().unwrap().time_s - 114.4).abs() < 1e-9);
    let mut errors = Vec::new();
    let inertial = log.records.iter().filter(|r| r.source == Source::Inspvax);
    let mut fastest: f64 = 0.0;
    for record in inertial {
        let t = record.time.since(first.time);
        let h = 1e-3;
        let velocity = (track.pose(t + h).position_m - track.pose(t - h).position_m) / (2.0 * h);
        let [north, east, up] = record.velocity_m_s.unwrap();
        let recorded = DVec3::new(east, north, up);
        fastest = fastest.max(recorded.length());
        errors.push(velocity.distance(recorded));
    }
    errors.sort_by(f64::total_cmp);
    let median = errors[errors.len() / 2];
    println!(
        "velocity of the spline against the recorded one: median {median:.4} m/s of {fastest:.2} m/s"
    );
    // The receiver corrects its positions by up to 6 cm from one record to the next, which its velocities do
    // not follow: plain differences of the file's positions over two records have a median of 0.032 m/s,
    // and 1 % above 0.45 m/s. Half as much again is left for the spline. East taken for north, or a wrong
    // sign, would give most of the walk's speed, 0.74 m/s RMS.
    assert!(fastest > 1.0 && median < 0.05, "{median} of {fastest}");
    // The best position is the antenna's, less than 1 m from the inertial unit.
    let best = log.fixes(Source::Bestpos, &frame, first.time).unwrap();
    let apart = best
        .iter()
        .map(|f| f.position_m.distance(track.pose(f.time_s).position_m));
    let farthest = apart.fold(0.0, f64::max);
    println!("antenna and inertial unit: {farthest:.3} m apart at most");
    assert!(farthest < 1.0);
}
