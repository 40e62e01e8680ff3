//! Recorded replica of the transmitted pulse.

use std::fs;

use num_complex::Complex64;
use subaperture_tests::numpy;
use subaperture_tests::subap::run;

use super::*;

const RATE_HZ: f64 = 150e6;
const CENTRE_HZ: f64 = 10e9;
const START_S: f64 = 20e-9;
const WIDTH: usize = 256;

/// A pulse of 1 us that no formula of the program describes: a sweep of 100 MHz with a cubic phase and a rising amplitude, `u`
/// its time in microseconds.
fn pulse(u: f64) -> Complex64 {
    if !(0.0..1.0).contains(&u) {
        return Complex64::ZERO;
    }
    let turns = 50.0 * u * (u - 1.0) + 2.0 * u * u * u;
    Complex64::from_polar(0.5 + 0.4 * u, TAU * turns)
}

/// Echo of a point at the delay `tau` in pulse `n`: `exp(-j 2 pi centre tau) p(t - tau)`.
fn echoes() -> Vec<Complex64> {
    let [x, y] = TARGETS[0].0;
    let echo = |(n, k): (usize, usize)| {
        let tau = 2.0 * (x - x_m(n)).hypot(y) / C_M_S;
        let t = START_S + k as f64 / RATE_HZ;
        Complex64::from_polar(1.0, -TAU * (CENTRE_HZ * tau).rem_euclid(1.0))
            * pulse((t - tau) * 1e6)
    };
    let places = (0..PULSES).flat_map(|n| (0..WIDTH).map(move |k| (n, k)));
    places.map(echo).collect()
}

fn text(pulse: &str) -> String {
    let text =
        description(&format!("{NPY}\ntimes = \"times.npy\"")).replace("\"plus\"", "\"minus\"");
    let at = text.find("[radar]").unwrap();
    let end = text.find("[platform]").unwrap();
    let radar = format!(
        "[radar]\nkind = \"pulsed\"\ncentre = \"10 GHz\"\nsample_rate = \"150 MHz\"\nwindow_start = \"20 ns\"\n[radar.pulse]\n{pulse}\n\n"
    );
    format!("{}{radar}{}", &text[..at], &text[end..])
}

/// The image of the point with the recorded pulse reads 1: the response of the inverse filter is flat in the band. The samples
/// are not band-limited, which the tolerance includes.
#[test]
fn recorded_pulse_compresses_its_echoes() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    write_array(at, "echoes.npy", &echoes(), WIDTH);
    write_times(at, 0..PULSES);
    let replica: Vec<Complex64> = (0..150).map(|i| pulse(i as f64 / 150.0)).collect();
    write_array(at, "replica.npy", &replica, 150);
    let recorded = "kind = \"recorded\"\nsamples = \"replica.npy\"\nbandwidth = \"80 MHz\"";
    fs::write(at.join("rail.toml"), text(recorded)).unwrap();
    let grid = "--grid x=-1:1:0.02,y=2.6:5.4:0.02 -a bp -q";
    run(at, &format!("focus rail.toml --out image {grid}")).succeeded();
    let value = at_target(at, "image", TARGETS[0].0);
    assert!((value.norm() - 1.0).abs() < 0.05, "{value}");
    assert!(value.arg().abs() < 0.1, "{value}");
    // A sweep of the same band is another pulse.
    let sweep = "kind = \"lfm\"\nduration = \"1 us\"\nbandwidth = \"80 MHz\"";
    fs::write(at.join("lfm.toml"), text(sweep)).unwrap();
    run(at, &format!("focus lfm.toml --out lfm {grid}")).succeeded();
    assert!((at_target(at, "lfm", TARGETS[0].0).norm() - 1.0).abs() > 0.3);
}

#[test]
fn unusable_replica_is_refused_at_its_key() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    write_array(at, "echoes.npy", &echoes(), WIDTH);
    write_times(at, 0..PULSES);
    let key = "samples = \"replica.npy\"";
    let recorded = format!("kind = \"recorded\"\n{key}\nbandwidth = \"80 MHz\"");
    fs::write(at.join("rail.toml"), text(&recorded)).unwrap();
    run(at, "info rail.toml").failed(1, &["replica.npy", key, "^"]);
    for (file, part) in [
        (
            numpy::array("<f4", "(2,)", &[0; 8]),
            "expected the complex samples of the pulse, found real numbers",
        ),
        (
            numpy::array("<c8", "(2, 2)", &1f32.to_le_bytes().repeat(8)),
            "found shape [2, 2]",
        ),
        (numpy::array("<c8", "(2,)", &[0; 16]), "found only zeros"),
        (
            numpy::array("<c8", "(1,)", &[0, 0, 0xc0, 0x7f, 0, 0, 0, 0]),
            "sample 0 of the pulse is not a finite number",
        ),
    ] {
        fs::write(at.join("replica.npy"), file).unwrap();
        run(at, "info rail.toml").failed(1, &[part, key, "^"]);
    }
    let scenario = "[radar]\nkind = \"pulsed\"\npulses = 8\npri = \"1 ms\"\ncentre = \"10 GHz\"\nsamples = 64\nsample_rate = \"150 MHz\"\n\
        [radar.pulse]\nkind = \"recorded\"\nsamples = \"replica.npy\"\nbandwidth = \"80 MHz\"\n[platform]\nkind = \"linear\"\nposition = \"0, -500, 100 m\"\n\
        velocity = \"10, 0, 0 m/s\"\n[[scene.point]]\nposition = \"0, 0, 0 m\"\n";
    fs::write(at.join("scene.toml"), scenario).unwrap();
    run(at, "simulate scene.toml -o scene.cphd").failed(
        1,
        &["a recorded pulse applies to descriptions of recordings"],
    );
}
