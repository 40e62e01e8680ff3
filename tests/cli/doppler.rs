//! Doppler centroid of `subap info`: of a squinted strip by its geometry, and against a wrong description of the antennas.

use std::fs;

use serde_json::Value;
use subaperture_tests::subap::run;

use crate::beam::{SPEED_M_S, WAVELENGTH_M, strip_looking};

const PRF_HZ: f64 = 300.0;

/// Largest error of the centroid: a tenth of the beam width of 2 deg, as for the estimated squint.
const MOST_HZ: f64 = 2.0 * SPEED_M_S / WAVELENGTH_M * 0.0035;

fn boresight(squint_deg: f64) -> String {
    let (sin, cos) = squint_deg.to_radians().sin_cos();
    format!("{sin}, {cos}, 0")
}

/// Doppler frequency at a squint, hertz.
fn doppler_hz(squint_deg: f64) -> f64 {
    2.0 * SPEED_M_S / WAVELENGTH_M * squint_deg.to_radians().sin()
}

#[test]
fn centroid_agrees_with_squint_and_a_wrong_beam_is_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let radar = "kind = \"stepped\"\nstep_time = \"10 us\"";
    let text = strip_looking(&boresight(5.0), radar);
    fs::write(at.join("strip.toml"), text).unwrap();
    run(at, "simulate strip.toml --echoes raw -o strip.cphd").succeeded();
    let off = |hz: f64| {
        let turns = hz / PRF_HZ;
        (turns - turns.round()) * PRF_HZ
    };
    for input in ["raw/recording.toml", "strip.cphd"] {
        let said = run(at, &format!("info {input} --json"));
        let json: Value = serde_json::from_str(said.succeeded()).unwrap();
        let doppler = &json["doppler"];
        let number = |key: &str| doppler[key].as_f64().unwrap();
        println!("{doppler}");
        assert!(
            (number("prf_hz") - PRF_HZ).abs() < 1e-6 * PRF_HZ,
            "{doppler}"
        );
        let centroid_hz = number("centroid_hz");
        assert!(centroid_hz.abs() <= 0.5 * PRF_HZ, "{doppler}");
        assert!(
            off(centroid_hz - doppler_hz(5.0)).abs() < MOST_HZ,
            "{doppler}"
        );
        assert!(
            (number("stated_beam_hz") - doppler_hz(5.0)).abs() < 0.1,
            "{doppler}"
        );
        // The point is abeam of the middle of the track.
        assert!(number("scene_hz").abs() < MOST_HZ, "{doppler}");
        assert_eq!(doppler["pulses"], 721);
        // A resolved ambiguity is the true one.
        if let Some(resolved_hz) = doppler["resolved_hz"].as_f64() {
            assert!((resolved_hz - doppler_hz(5.0)).abs() < MOST_HZ, "{doppler}");
        }
        assert!(!said.stderr.contains("Doppler:"), "{}", said.stderr);
        let text = run(at, &format!("info {input}"));
        let text = text.succeeded();
        assert!(
            text.contains("Hz modulo the PRF of 300.0 Hz, ambiguity"),
            "{text}"
        );
        assert!(text.contains("stated beam 581"), "{text}");
    }
    // A description that is wrong by 0.5 deg, a fifth of the PRF.
    let path = at.join("raw/recording.toml");
    let right = fs::read_to_string(&path).unwrap();
    let (x, other) = (5f64.to_radians().sin(), 5.5f64.to_radians().sin());
    let wrong = right.replace(&format!("\"{x}, "), &format!("\"{other}, "));
    assert_ne!(wrong, right);
    fs::write(&path, wrong).unwrap();
    let said = run(at, "info raw/recording.toml");
    said.succeeded();
    said.reports("Doppler: the centroid of the echoes differs from the stated beam by -5");
    // Recordings that are no strip have no such line.
    let spot = text_of_spotlight();
    fs::write(at.join("spot.toml"), spot).unwrap();
    run(at, "simulate spot.toml -o spot.cphd").succeeded();
    let said = run(at, "info spot.cphd");
    assert!(!said.succeeded().contains("Doppler "), "{said:?}");
    let said = run(at, "info spot.cphd --json");
    let json: Value = serde_json::from_str(said.succeeded()).unwrap();
    let why = json["doppler"]["none"].as_str().unwrap();
    assert!(why.contains("shows no beam"), "{why}");
}

/// The strip seen by isotropic antennas.
fn text_of_spotlight() -> String {
    let text =
        strip_looking("0, 1, 0", "kind = \"ideal\"").replace("\"gaussian\"", "\"isotropic\"");
    let plain = |line: &&str| {
        !["azimuth", "elevation"]
            .iter()
            .any(|key| line.starts_with(key))
    };
    text.lines().filter(plain).collect::<Vec<_>>().join("\n")
}
