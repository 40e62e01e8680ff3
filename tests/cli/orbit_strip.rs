//! A strip from orbit from its description to a map by the command: state vectors in ECEF, a squinted beam, 4-bit samples with a bias, and
//! missing pulses.

use std::fs;

use glam::DVec3;
use serde_json::{Value, json};
use subaperture_tests::orbit_strip::{self as strip, Missing, START_S};
use subaperture_tests::python;
use subaperture_tests::subap::run;

/// Pixel spacing, below half of the resolution in the ground plane (8 m along the track, 13 m across), metres.
const PIXEL_M: f64 = 3.0;

#[test]
fn strip_from_orbit_has_points_in_place_and_defects_reported() {
    let ground = strip::ground();
    let target = strip::point_in_beam_at(
        &ground,
        START_S + 0.17 * strip::PULSES as f64 / strip::PRF_HZ,
    );
    let ghost = strip::ghost_m(&ground, target, 1.0);
    let points = [
        target,
        target + DVec3::new(-330.0, 70.0, 0.0),
        DVec3::ZERO,
        DVec3::new(500.0, -1200.0, 0.0),
    ];
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    strip::write(at, &strip::echoes(&ground, &points, 2.0), Missing::Absent);
    fs::write(
        at.join("orbit.csv"),
        strip::csv(&strip::vector_times(10.0), true),
    )
    .unwrap();
    let platform = "kind = \"csv\"\nfile = \"orbit.csv\"\nframe = \"ecef\"";
    let text = strip::description(&ground, platform, &strip::antennas());
    fs::write(at.join("strip.toml"), text).unwrap();

    let info = run(at, "info strip.toml --json");
    let json: Value = serde_json::from_str(info.succeeded()).unwrap();
    println!("{}", info.stderr);
    let absent = (0..strip::PULSES).filter(|&n| strip::missing(n)).count();
    info.reports(&format!("{absent} pulses are missing"));
    info.reports("I/Q bias of 0.");
    let centroid_hz = json["doppler"]["stated_beam_hz"].as_f64().unwrap();
    assert!(
        (centroid_hz - strip::centroid_hz()).abs() < 1.0,
        "{centroid_hz}"
    );

    // Maps of the points and of the ghost, each with a margin.
    for (name, centre, [half_x, half_y]) in [
        ("points", points[1].midpoint(points[0]), [300.0, 180.0]),
        ("ghost", ghost, [150.0, 150.0]),
    ] {
        let axis = |at: f64, half: f64| {
            format!("{}:{}:{PIXEL_M}", (at - half).round(), (at + half).round())
        };
        let grid = format!(
            "x={},y={},z=0",
            axis(centre.x, half_x),
            axis(centre.y, half_y)
        );
        let focus = run(at, &format!("focus strip.toml --grid {grid} --out {name}"));
        focus.succeeded();
        println!("{}{}", focus.stdout, focus.stderr);
        let export =
            format!("export {name} --format cog --layout amplitude --looks 1 -o {name}.tif");
        run(at, &export).succeeded();
    }
    let ecf = |point: DVec3| ground.ecef(point).to_array();
    let expected = json!({
        "points_ecf_m": [ecf(points[0]), ecf(points[1])],
        "pixel_m": PIXEL_M,
        "target_ecf_m": ecf(target),
        "ghost_ecf_m": ecf(ghost),
    });
    fs::write(at.join("expected.json"), expected.to_string()).unwrap();
    let files = ["points.tif", "ghost.tif", "expected.json"].map(|name| at.join(name));
    python::script("strip_check.py", files);
}
