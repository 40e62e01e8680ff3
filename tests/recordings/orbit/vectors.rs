//! Antenna positions from state vectors, and unsuitable state vectors.

use glam::DVec3;
use subaperture::io::recording::RecordingFile;
use subaperture::phase_history::PhaseHistory;

use super::folder::{ARRAYS, CSV, folder};
use subaperture_tests::orbit_strip::{self as strip, Missing, START_S, csv, state, vector_times};

#[test]
fn state_vectors_place_the_antennas() {
    let ground = strip::ground();
    let fast = format!("{ARRAYS}\nvelocities = \"velocities\"");
    for platform in [CSV, ARRAYS, &fast] {
        let folder = folder(Missing::Complete, platform, "");
        let mut file = RecordingFile::read(&folder.path().join("strip.toml")).unwrap();
        let moving = file.history(u64::MAX).unwrap();
        file.set("radar.motion", "stop-and-go").unwrap();
        let stopped = file.history(u64::MAX).unwrap();
        for n in (0..strip::PULSES).step_by(111) {
            let own_s = strip::pulse_s(n);
            let off_m = |found: DVec3, t: f64| found.distance(ground.local(state(t)[0]));
            // The polynomials are accurate to 2e-12 m and 8e-11 m; rounding of 7e6 m is 1e-9 m for each of some 40 terms.
            let pulse = &stopped.collection().pulses[n];
            assert!(off_m(pulse.transmitter_m, own_s) < 4e-8, "{platform}");
            assert_eq!(pulse.transmitter_m, pulse.receiver_m);
            // The middle of the pulse, and its arrival from the origin. The sample in the middle of the band is up to half a step of 20 kHz from the
            // carrier, which a chirp of 1 MHz/us sends 10 ns from its middle: 75 um. The rotation of the Earth during the flight moves the
            // origin by 1.3 m and changes the arrival by 1e-12 s.
            let pulse = &moving.collection().pulses[n];
            let sent_s = own_s + 0.5 * strip::PULSE_S;
            let arrival_s = strip::arrival_s(ground.origin, sent_s);
            assert!(off_m(pulse.transmitter_m, sent_s) < 8e-5, "{platform}");
            assert!(off_m(pulse.receiver_m, arrival_s) < 8e-5, "{platform}");
        }
    }
}

#[test]
fn unsuitable_state_vectors_are_refused() {
    let folder = folder(Missing::Complete, CSV, "");
    let text = std::fs::read_to_string(folder.path().join("strip.toml")).unwrap();
    let refuse = |from: &str, to: &str| {
        assert!(text.contains(from), "{from}");
        let file = RecordingFile::new("strip.toml", text.replace(from, to), folder.path());
        match file.history(u64::MAX) {
            Ok(_) => panic!("{to}: taken"),
            Err(error) => error.to_string(),
        }
    };
    let origin = &text[text.find("[scene.origin]").unwrap()..text.find("[radar]").unwrap()];
    for (from, to, part) in [
        ("frame = \"ecef\"", "", "positions look like ECEF"),
        (origin, "", "add [scene.origin]"),
        (
            "frame = \"ecef\"",
            "frame = \"ecef\"\naxes = \"x, -z, y\"",
            "'axes' reorders",
        ),
        ("frame = \"ecef\"", "frame = \"earth\"", "ecef"),
        (
            CSV,
            "kind = \"csv\"\nfile = \"orbit.csv\"\nframe = \"ecef\"\nvelocities = \"v\"",
            "velocities",
        ),
    ] {
        let message = refuse(from, to);
        assert!(message.contains(part), "{to}: {message}");
    }
    // Other state vectors.
    let write = |text: String| std::fs::write(folder.path().join("orbit.csv"), text).unwrap();
    let same = ("frame = \"ecef\"", "frame = \"ecef\" ");
    let far: Vec<f64> = (0..8)
        .map(|n| START_S + 5.1 + 10.0 * f64::from(n))
        .collect();
    write(csv(&far, true));
    let message = refuse(same.0, same.1);
    assert!(
        message.contains("pulse 0 at 4321.000 s is outside the track from 4321.100 to"),
        "{message}"
    );
    let near: Vec<f64> = far.iter().map(|t| t - 0.2).collect();
    write(csv(&near, true));
    let file = RecordingFile::new("strip.toml", &*text, folder.path());
    file.history(u64::MAX).unwrap();
    // Lagrange's polynomial at the end of an interval of 100 s: 5e-22 m/s^8 (100 s)^8 0.3 0.7 1.3 ... 6.7 is some 1e-2 m.
    let sparse: Vec<f64> = (0..9)
        .map(|n| START_S - 30.0 + 100.0 * f64::from(n))
        .collect();
    write(csv(&sparse, false));
    let message = refuse(same.0, same.1);
    assert!(
        message.contains("expected a hundredth of the wavelength, 5.5e-4 m"),
        "{message}"
    );
    write(csv(&vector_times(10.0)[..7], false));
    let message = refuse(same.0, same.1);
    assert!(
        message.contains("at least 8 state vectors without velocities"),
        "{message}"
    );
    // Velocities in an inertial frame.
    let lines = csv(&vector_times(10.0), true);
    let mut other = String::new();
    for (i, line) in lines.lines().enumerate() {
        let values: Vec<&str> = line.split(',').collect();
        match i {
            0 => other += line,
            _ => {
                let number = |k: usize| values[k].parse::<f64>().unwrap();
                let [vx, vy] = [
                    number(4) - 7.292e-5 * number(2),
                    number(5) + 7.292e-5 * number(1),
                ];
                other += &format!("{},{vx},{vy},{}", values[..4].join(","), values[6]);
            }
        }
        other.push('\n');
    }
    write(other);
    let message = refuse(same.0, same.1);
    assert!(
        message.contains("velocities disagree with positions"),
        "{message}"
    );
}
