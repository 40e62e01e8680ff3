//! Amplitudes of simulated echoes through antennas of each pattern, against formulas of this file.

use std::fs;

use glam::DVec3;
use subaperture::io::recording::RecordingFile;
use subaperture::io::recording::{self, Raw};
use subaperture::monitor::Silent;
use subaperture::phase_history::PhaseHistory;
use subaperture::radar::Pattern;
use subaperture::simulate::scenario::Scenario;
use subaperture_tests::experiment::read_whole;

const POINT_M: DVec3 = DVec3::new(20.0, 480.0, 0.0);
const PULSES: usize = 9;

/// A level flight along x at 100 m; the antennas look left and 0.2 rad down, and the receiver is isotropic.
fn scenario(keys: &str) -> String {
    format!(
        r#"[scene]
reference = "0, 500, 0 m"

[[scene.point]]
position = "20, 480, 0 m"

[radar]
kind = "stepped"
step_time = "1 us"
pulses = {PULSES}
pri = "100 ms"
centre = "10 GHz"
bandwidth = "10 MHz"
samples = 2

[[radar.transmitter]]
boresight = "0, 0.980066577841242, -0.198669330795061"
up = "0, 0, 1"
{keys}

[platform]
kind = "linear"
position = "0, 0, 100 m"
velocity = "100, 0, 0 m/s"
at = "middle"
"#
    )
}

/// Azimuth and elevation of the point from a boresight, with the up vector nearest to that of the antenna, which is orthogonal to its fixed boresight.
fn angles(from_m: DVec3, boresight: DVec3) -> [f64; 2] {
    let fixed_up = DVec3::new(0.0, 0.2f64.sin(), 0.2f64.cos());
    let up = (fixed_up - boresight * boresight.dot(fixed_up)).normalize();
    let left = up.cross(boresight);
    let towards = (POINT_M - from_m).normalize();
    [
        towards.dot(left).atan2(towards.dot(boresight)),
        towards.dot(up).asin(),
    ]
}

#[test]
fn echoes_have_amplitude_of_pattern_and_their_recording_states_it() {
    let folder = tempfile::tempdir().unwrap();
    let table = "azimuth_deg,elevation_deg,gain_db\n-10,-5,-20\n-10,5,-20\n0,-5,-6.020599913279624\n0,5,0\n10,-5,-20\n10,5,-20\n";
    fs::write(folder.path().join("horn.csv"), table).unwrap();
    let fixed = DVec3::new(0.0, 0.2f64.cos(), -(0.2f64.sin()));
    let cosine = |[azimuth, elevation]: [f64; 2]| {
        let q = |width: f64| -(2f64.ln()) / (2.0 * (0.5 * width).cos().ln());
        azimuth.cos().powf(q(0.2)) * elevation.cos().powf(q(0.1))
    };
    let horn = |[azimuth, elevation]: [f64; 2]| {
        let above = (elevation.to_degrees() + 5.0) / 10.0;
        let middle = 0.5 + 0.5 * above;
        middle + (0.1 - middle) * azimuth.to_degrees().abs() / 10.0
    };
    type Amplitude<'a> = &'a dyn Fn([f64; 2]) -> f64;
    let cases: [(&str, Amplitude, bool); 4] = [
        (
            "pattern = \"cosine\"\nazimuth = \"0.2 rad\"\nelevation = \"0.1 rad\"",
            &cosine,
            false,
        ),
        ("pattern = \"table\"\ntable = \"horn.csv\"", &horn, false),
        (
            "pattern = \"table\"\ntable = \"horn.csv\"\ngains = \"two-way\"",
            // Square roots of the samples: 20 dB are 10 dB of each antenna.
            &|[azimuth, elevation]| {
                let above = (elevation.to_degrees() + 5.0) / 10.0;
                let middle = 0.5f64.sqrt() + (1.0 - 0.5f64.sqrt()) * above;
                middle + (0.1f64.sqrt() - middle) * azimuth.to_degrees().abs() / 10.0
            },
            false,
        ),
        (
            "pattern = \"cosine\"\nazimuth = \"0.2 rad\"\nelevation = \"0.1 rad\"\naim = \"15, 470, 0 m\"",
            &cosine,
            true,
        ),
    ];
    for (number, (keys, amplitude, aims)) in cases.into_iter().enumerate() {
        let scenario = Scenario::new("flight.toml", scenario(keys), folder.path());
        let experiment = scenario.experiment().unwrap();
        let recorded = experiment.record(experiment.pairs()[0]).unwrap();
        let expected: Vec<f64> = (recorded.collection().pulses.iter())
            .map(|pulse| {
                let from_m = pulse.transmitter_m;
                let aim_m = DVec3::new(15.0, 470.0, 0.0);
                let boresight = if aims {
                    (aim_m - from_m).normalize()
                } else {
                    fixed
                };
                amplitude(angles(from_m, boresight))
            })
            .collect();
        for (n, sample) in read_whole(&recorded).iter().step_by(2).enumerate() {
            let measured = f64::from(sample.norm());
            // The boresight's 15 digits and float32.
            assert!(
                (measured / expected[n] - 1.0).abs() < 1e-6,
                "{keys} {n}: {measured}"
            );
        }
        // The description of the raw echoes has the same antennas.
        let out = folder.path().join(number.to_string());
        let echoes = Raw {
            id: "1".to_owned(),
            echoes: recorded.echoes(),
            antennas: recorded.antennas(),
        };
        recording::write(&out, &[echoes], &Silent).unwrap();
        let file = RecordingFile::read(&out.join("recording.toml")).unwrap();
        let read = file.history(1 << 30).unwrap().antennas().unwrap();
        let written = recorded.antennas().unwrap();
        let [own, other] = [&written, &read].map(|mounted| &mounted.antennas[0]);
        assert_eq!(own.aim_m, other.aim_m);
        match (&own.pattern, &other.pattern) {
            (Pattern::Table(own), Pattern::Table(other)) => {
                for (a, b) in own.gain_db().iter().zip(other.gain_db()) {
                    assert!((a - b).abs() < 1e-12);
                }
            }
            (own, other) => assert_eq!(own, other),
        }
    }
}

#[test]
fn missing_and_malformed_tables_are_faults_of_their_key() {
    let folder = tempfile::tempdir().unwrap();
    let keys = "pattern = \"table\"\ntable = \"horn.csv\"";
    let fault = || {
        let scenario = Scenario::new("flight.toml", scenario(keys), folder.path());
        scenario.experiment().map(|_| ()).unwrap_err().to_string()
    };
    let missing = fault();
    assert!(
        missing.contains("table = \"horn.csv\"") && missing.contains("cannot read"),
        "{missing}"
    );
    fs::write(folder.path().join("horn.csv"), "azimuth_deg,gain_db\n0,x\n").unwrap();
    let malformed = fault();
    assert!(
        malformed.contains("line 2: gain_db: expected a number"),
        "{malformed}"
    );
}
