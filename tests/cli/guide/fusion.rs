//! The page on fusion: its table of errors, predictions and levels is that of its commands.

use std::fs;
use std::path::Path;

use subaperture::glam::{DQuat, DVec2, DVec3};
use subaperture::io::open::{Options as Opening, open_channels};
use subaperture::navigation::{Log, Options};
use subaperture::simulate::scenario::{Scenario, examples};
use subaperture::track::{Fix, SampledTrack, Trajectory};
use subaperture::track_fusion::{About, Mounting, Navigation};
use subaperture_tests::subap::{root, run};

use super::Page;

pub(super) const FUSION: &str = "host/guide/src/howto/fusion.md";
const OUTAGE_S: [f64; 2] = [3.0, 7.5];
const ARM: &str = "--lever-arm=-0.2,0,0.3";
/// Middle of transmitter and receivers ahead of the body's origin, metres.
const MIDDLE_M: f64 = 0.5 * 0.5 * (0.2 + 0.307);
/// Reflector whose level is in the table.
const REFLECTOR_M: DVec2 = DVec2::new(1.5, 11.5);

/// Row of the table: RMS errors outside of the outage, in it, and in it after fitting, prediction there, millimetres; level, dB.
#[derive(Debug)]
struct Row {
    name: String,
    numbers: [Option<f64>; 5],
    /// Half of the last printed digits.
    rounding: [f64; 5],
}

fn rows() -> Vec<Row> {
    let page = fs::read_to_string(root().join(FUSION)).unwrap();
    let lines = page
        .lines()
        .filter(|l| l.starts_with("| ") && l.contains(" mm |"));
    lines
        .map(|line| {
            let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
            let [name, rest @ ..] = &cells[..] else {
                panic!("{line}")
            };
            let rest: [&str; 5] = rest.try_into().unwrap();
            let text = |cell: &str| cell.split(' ').next().unwrap().to_owned();
            Row {
                name: (*name).to_owned(),
                numbers: rest.map(|cell| text(cell).parse().ok()),
                rounding: rest.map(|cell| {
                    let digits = text(cell)
                        .split_once('.')
                        .map_or(0, |(_, after)| after.len());
                    0.5 * 10f64.powi(-i32::try_from(digits).unwrap())
                }),
            }
        })
        .collect()
}

/// True positions of the middle of the antennas at the pulses.
fn truth_m() -> Vec<DVec2> {
    let text = examples::text("fusion").unwrap();
    let walk = Scenario::new("fusion.toml", text, ".")
        .experiment()
        .unwrap();
    let middle = |n: usize| {
        let pose = walk.track.pose(0.025 * n as f64);
        (pose.position_m + pose.attitude * (DVec3::X * MIDDLE_M)).truncate()
    };
    (0..400).map(middle).collect()
}

fn lost(n: usize) -> bool {
    (OUTAGE_S[0]..=OUTAGE_S[1]).contains(&(0.025 * n as f64))
}

/// Positions at the pulses on the curve through fixes.
fn on_curve_m(fixes: &[Fix]) -> Vec<DVec2> {
    let track = SampledTrack::new(fixes).unwrap();
    let at = |n: usize| track.pose(0.025 * n as f64).position_m.truncate();
    (0..400).map(at).collect()
}

/// Positions by a log alone, without the lever arm.
fn by_log_m(folder: &Path, name: &str) -> Vec<DVec2> {
    let log = Log::read(&folder.join(name), &Options::default()).unwrap();
    let cphd = folder.join("fusion.cphd");
    let channels = open_channels::<&str>(&cphd, None, &Opening::default()).unwrap();
    let about = About::of(&channels).unwrap();
    let navigation = Navigation::of_logs(&[(name.to_owned(), log)], &about).unwrap();
    let mounting = Mounting {
        arm_m: DVec3::new(-0.2, 0.0, 0.3),
    };
    on_curve_m(&navigation.alone(&about, DQuat::IDENTITY, &mounting))
}

/// Positions of a track file, and its sum of variances of x and y, for each pulse.
fn by_file_m(path: &Path) -> (Vec<DVec2>, Vec<f64>) {
    let text = fs::read_to_string(path).unwrap();
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let column = |name: &str| header.iter().position(|known| *known == name).unwrap();
    let [x, y] = ["x_m", "y_m"].map(column);
    let variances = ["variance_x_m2", "variance_y_m2"].map(column);
    lines
        .filter(|line| !line.is_empty())
        .map(|line| {
            let numbers: Vec<f64> = line.split(',').map(|n| n.parse().unwrap()).collect();
            let variance = variances.map(|k| numbers[k]).iter().sum::<f64>();
            (DVec2::new(numbers[x], numbers[y]), variance)
        })
        .unzip()
}

/// Rotation and shift that bring points nearest to others.
fn fitted_m(points: &[DVec2], onto: &[DVec2]) -> Vec<DVec2> {
    let mean = |all: &[DVec2]| all.iter().sum::<DVec2>() / all.len() as f64;
    let (a, b) = (mean(points), mean(onto));
    let pairs = points.iter().zip(onto);
    // Sum of complex products: its argument is the rotation.
    let sum: DVec2 = pairs
        .map(|(p, q)| DVec2::new((*p - a).dot(*q - b), (*p - a).perp_dot(*q - b)))
        .sum();
    let turn = sum.normalize();
    points.iter().map(|p| turn.rotate(*p - a) + b).collect()
}

fn rms_mm(points: &[DVec2], truth: &[DVec2], inside: bool) -> f64 {
    let squares: Vec<f64> = (0..400)
        .filter(|n| lost(*n) == inside)
        .map(|n| points[n].distance_squared(truth[n]))
        .collect();
    1e3 * (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

/// Level of the brightest pixel within 60 cm of the reflector, dB.
fn level_db(folder: &Path, track: &str) -> f64 {
    let [x, y] = REFLECTOR_M.to_array();
    let grid = format!(
        "x={}:{}:0.03,y={}:{}:0.03",
        x - 0.6,
        x + 0.6,
        y - 0.6,
        y + 0.6
    );
    let line = format!("focus fusion.cphd --channels all --grid {grid} {track} --out near --force");
    run(folder, &line).succeeded();
    let record = fs::read(folder.join("near/image.json")).unwrap();
    let record: serde_json::Value = serde_json::from_slice(&record).unwrap();
    record["brightest"]["level_db"].as_f64().unwrap()
}

#[test]
fn fusion_page_states_errors_of_its_tracks() {
    let folder = Page::read(FUSION).run();
    let at = folder.path();
    let truth = truth_m();
    let file = |name: &str| {
        let (points, variances) = by_file_m(&at.join(name));
        assert_eq!(points.len(), 400, "{name}");
        let inside: Vec<f64> = (0..400)
            .filter(|n| lost(*n))
            .map(|n| variances[n])
            .collect();
        let mean = inside.iter().sum::<f64>() / inside.len() as f64;
        (points, Some(1e3 * mean.sqrt()))
    };
    // The closed form of the log: 8 mm, and half of 8 mm/s^2 times the square of the time since 3 s.
    let drift = |n: usize| 4e-3 * (0.025 * n as f64 - OUTAGE_S[0]).powi(2);
    let inside = (0..400).filter(|n| lost(*n));
    let squares: Vec<f64> = inside.map(|n| 2.0 * (64e-6 + drift(n).powi(2))).collect();
    let of_ins = 1e3 * (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
    let log = |name: &str, predicted| (by_log_m(at, name), predicted);
    let measured = [
        (
            "GNSS",
            log("gnss.log", None),
            format!("--track navigation --navigation gnss.log {ARM}"),
        ),
        (
            "GNSS + INS",
            log("ins.log", Some(of_ins)),
            format!("--track navigation --navigation ins.log {ARM}"),
        ),
        ("MPGA", file("mpga.csv"), "--track mpga.csv".to_owned()),
        (
            "MPGA + GNSS",
            file("fused.csv"),
            "--track fused.csv".to_owned(),
        ),
        (
            "MPGA + GNSS + INS",
            file("gnss-ins.csv"),
            "--track gnss-ins.csv".to_owned(),
        ),
    ];
    let rows = rows();
    let mut faults = Vec::new();
    for (name, (points, predicted), track) in &measured {
        let fitted = fitted_m(points, &truth);
        let numbers = [
            Some(rms_mm(points, &truth, false)),
            Some(rms_mm(points, &truth, true)),
            Some(rms_mm(&fitted, &truth, true)),
            *predicted,
            Some(level_db(at, track)),
        ];
        let row = rows.iter().find(|row| row.name == *name);
        let row = row.unwrap_or_else(|| panic!("no row {name} in {rows:?}"));
        for (k, (stated, measured)) in row.numbers.iter().zip(numbers).enumerate() {
            // Beyond its rounding for print a number may differ by a hundredth: libraries of other machines round otherwise.
            let allowed = row.rounding[k] + 0.01 * stated.unwrap_or(0.0).abs();
            let agrees = match (stated, measured) {
                (Some(stated), Some(measured)) => (stated - measured).abs() <= allowed,
                (None, None) => true,
                _ => false,
            };
            if !agrees {
                faults.push(format!(
                    "{name}, column {k}: {stated:?}, measured {measured:.2?}"
                ));
            }
        }
    }
    assert!(faults.is_empty(), "{faults:#?}"); // An inertial solution without a receiver's log: eight or nine positions of 8 mm outside of the outage give 4 mm, and a heading.
    let line = format!("track fusion.cphd --navigation ins.log {ARM} -o ins-only.csv");
    run(at, &line).succeeded();
    let (points, predicted) = file("ins-only.csv");
    let predicted = predicted.unwrap();
    assert!((3.0..12.0).contains(&predicted), "{predicted}");
    for inside in [false, true] {
        let error = rms_mm(&points, &truth, inside);
        assert!(error < 3.0 * predicted, "{error} {predicted}");
    }
}
