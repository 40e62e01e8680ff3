//! Captures of a radio: `.sigmf-meta`, `.sigmf-journal` (absent if empty) and `.sigmf-data` in one input.

use subaperture::radio::profile::Sweep;
use subaperture::radio::sigmf::{Recording, Setup, Step, Writer};
use subaperture::radio::{Reference, Sample};
use subaperture::signal::window::Window;

use super::container::{pack, unpack};
use super::scratch::with_files;

pub(super) const WORDS: &[&str] = &[
    "\"core:sample_start\":",
    "\"core:sample_count\":",
    "\"core:freq_lower_edge\":",
    "\"core:label\":",
    "\"core:datatype\":",
    "\"ci16_le\"",
    "\"subaperture:setup\":",
    "\"subaperture:carrier_hz\":",
    "\"subaperture:sweep\":",
    "\"subaperture:step\":",
    "\"subaperture:time_s\":",
    "\"subaperture:flags\":",
    "\"subaperture:lost\":",
    "\"late\"",
    "\"lost\"",
    "[[3,5]]",
    "\"annotations\":",
    "\"captures\":",
    "\"sample_rate_hz\":",
    "\"period\":",
    "\"start_hz\":",
    "\"step_hz\":",
    "\"steps\":",
    "18446744073709551615",
    "1e999",
    "1e308",
    "null",
    "{",
    "}",
    "\n",
];

const PERIOD: usize = 8;
const SAMPLES: usize = 32;
const STEPS: usize = 6;

fn setup() -> Setup {
    let text = r#"{
        "name": "fuzz", "hardware": "none", "sample_rate_hz": 1e6, "period": 8, "samples": 32, "start_hz": 1.1e9, "step_hz": 4e6,
        "steps": 6, "transmit_gain_db": 60, "receive_gain_db": [40, 40], "receive_antennas": ["RX2", "RX2"]
    }"#;
    serde_json::from_str(text).expect("the set-up is one")
}

fn step(index: usize) -> Step {
    let carrier_hz = 1.1e9 + 4e6 * index as f64;
    Step {
        start: 0,
        samples: SAMPLES,
        lower_hz: carrier_hz - 2e6,
        upper_hz: carrier_hz + 2e6,
        carrier_hz,
        sweep: 0,
        step: index,
        time_s: 0.005 * index as f64,
        gain_db: [40.0; 2],
        bursts: 1,
        flags: Vec::new(),
        lost: if index == 2 { vec![(3, 5)] } else { Vec::new() },
    }
}

/// A closed capture, and a killed one.
pub(super) fn seeds() -> Vec<Vec<u8>> {
    let seed = |finished: bool| {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("a");
        let mut writer = Writer::create(&path, setup()).expect("a recording is begun");
        for index in 0..STEPS {
            // A tone of a quarter of full scale, and its echo.
            let tone = |scale: f64| -> Vec<Sample> {
                let sample = |i: usize| {
                    let (sin, cos) = (i as f64 / PERIOD as f64 * std::f64::consts::TAU).sin_cos();
                    Sample::new((scale * cos) as i16, (scale * sin) as i16)
                };
                (0..SAMPLES).map(sample).collect()
            };
            let channels = [tone(8000.0), tone(2000.0)];
            let written = writer.append(step(index), [&channels[0], &channels[1]]);
            written.expect("a step is written");
        }
        if finished {
            writer.finish().expect("a recording is closed");
        }
        let file = |ending: &str| std::fs::read(path.with_extension(ending)).unwrap_or_default();
        let (meta, journal) = (file("sigmf-meta"), file("sigmf-journal"));
        pack(&meta, &pack(&journal, &file("sigmf-data")))
    };
    vec![seed(true), seed(false)]
}

pub(super) fn read(bytes: &[u8]) -> String {
    let (meta, rest) = unpack(bytes);
    let (journal, data) = unpack(rest);
    let files = [
        ("a.sigmf-meta", meta),
        ("a.sigmf-journal", journal),
        ("a.sigmf-data", data),
    ];
    with_files(&files, |folder| {
        if journal.is_empty() {
            let _ = std::fs::remove_file(folder.join("a.sigmf-journal"));
        }
        let mut recording = match Recording::open(&folder.join("a.sigmf-meta")) {
            Ok(recording) => recording,
            Err(error) => return error.to_string(),
        };
        assert_eq!(recording.interrupted(), !journal.is_empty());
        let setup = recording.setup().clone();
        let mut channels: [Vec<Sample>; 2] = Default::default();
        for (index, step) in recording.steps().to_vec().iter().enumerate() {
            assert!(step.step < setup.steps && step.time_s.is_finite());
            assert!(
                step.lost
                    .iter()
                    .all(|gap| gap.0 <= gap.1 && gap.1 <= step.samples)
            );
            // The data can contain many steps; a few are enough to stay within the time.
            if index < 64 {
                recording
                    .read(index, &mut channels)
                    .expect("opened steps lie within the data");
                assert!(channels.iter().all(|channel| channel.len() == step.samples));
            }
        }
        let Some(sweep) = recording.steps().first().map(|step| step.sweep) else {
            return "a capture without steps".to_owned();
        };
        let sweep = match Sweep::read(&mut recording, sweep, Reference::Loopback) {
            Ok(sweep) => sweep,
            Err(error) => return error.to_string(),
        };
        let unambiguous_m = subaperture::SPEED_OF_LIGHT_M_S / (2.0 * setup.step_hz);
        match sweep.profile(Window::default(), 2, 0.75 * unambiguous_m) {
            Ok(profile) => {
                assert!(profile.values.iter().all(|z| z.is_finite()));
                format!("a profile of {} carriers", sweep.usable())
            }
            Err(error) => error.to_string(),
        }
    })
}
