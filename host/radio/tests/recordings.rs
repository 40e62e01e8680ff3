//! Recordings: SigMF conformity, recovery after interruption, and replay.

use std::fs::{self, OpenOptions};
use std::io::Write;
use std::path::Path;

use num_complex::Complex32;
use subaperture_radio::capture::EndReason;
use subaperture_radio::record::Recorder;
use subaperture_radio::replay::Replay;
use subaperture_radio::sigmf::{Recording, Setup, Step, Writer};
use subaperture_radio::{
    About, Burst, Configuration, Event, RadioError, Received, Sample, Sensors, Side, Transceiver,
};
use tempfile::TempDir;

use crate::scene::{THESIS, captured, experiment, plan, radio};

fn setup() -> Setup {
    let plan = plan("");
    Setup {
        name: "test".to_owned(),
        hardware: "none".to_owned(),
        sample_rate_hz: 1e6,
        period: 8,
        samples: 16,
        start_hz: 1.1e9,
        step_hz: 4e6,
        steps: 50,
        transmit_gain_db: 60.0,
        receive_gain_db: [40.0; 2],
        receive_antennas: plan.radio.receive_antennas,
        reach_m: None,
        reference: plan.reference,
        antennas: plan.antennas,
    }
}

fn step(index: usize) -> Step {
    Step {
        start: 0,
        samples: 16,
        lower_hz: 1.098e9 + 4e6 * index as f64,
        upper_hz: 1.102e9 + 4e6 * index as f64,
        carrier_hz: 1.1e9 + 4e6 * index as f64,
        sweep: 0,
        step: index,
        time_s: 0.005 * index as f64,
        gain_db: [40.0; 2],
        bursts: 1,
        flags: vec![],
        lost: vec![(3, 5)],
    }
}

fn channels(index: usize) -> [Vec<Sample>; 2] {
    [0, 1].map(|c| {
        (0..16)
            .map(|i| Sample::new(100 * index as i16 + i, -i - 50 * c))
            .collect()
    })
}

fn write(path: &Path, steps: usize) -> Writer {
    let mut writer = Writer::create(path, setup()).unwrap();
    for index in 0..steps {
        let [a, b] = channels(index);
        writer.append(step(index), [&a, &b]).unwrap();
    }
    writer
}

/// Keys, types and sample order conform to SigMF, checked here as JSON and bytes.
#[test]
fn finished_recording_conforms_to_sigmf() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("new/folder/name");
    write(&path, 3).finish().unwrap();
    let text = fs::read(path.with_extension("sigmf-meta")).unwrap();
    let meta: serde_json::Value = serde_json::from_slice(&text).unwrap();
    let global = &meta["global"];
    assert_eq!(global["core:datatype"], "ci16_le");
    assert_eq!(global["core:num_channels"], 2);
    assert_eq!(global["core:sample_rate"], 1e6);
    assert!(global["core:version"].is_string());
    assert_eq!(meta["captures"].as_array().unwrap().len(), 3);
    assert_eq!(meta["captures"][2]["core:sample_start"], 32);
    assert_eq!(meta["captures"][2]["core:frequency"], 1.108e9);
    assert_eq!(meta["annotations"][1]["core:sample_start"], 16);
    assert_eq!(meta["annotations"][1]["subaperture:carrier_hz"], 1.104e9);
    let data = fs::read(path.with_extension("sigmf-data")).unwrap();
    assert_eq!(data.len(), 3 * 16 * 8);
    // Step 2, sample 1: I and Q of the reference, then of the echo.
    let parts: Vec<i16> = data[33 * 8..34 * 8]
        .chunks(2)
        .map(|b| i16::from_le_bytes([b[0], b[1]]))
        .collect();
    assert_eq!(parts, [201, -1, 201, -51]);
    assert!(!path.with_extension("sigmf-journal").exists());
    let mut recording = Recording::open(&path.with_extension("sigmf-data")).unwrap();
    let mut read = [vec![], vec![]];
    recording.read(2, &mut read).unwrap();
    assert_eq!(read, channels(2));
    assert_eq!(
        recording.steps()[2],
        Step {
            start: 32,
            ..step(2)
        }
    );
}

/// Dropping a writer leaves the same files as killing the process. An incomplete line, and data that did not reach the
/// disk, lose only the last step.
#[test]
fn interrupted_recording_opens_with_complete_steps() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("killed");
    drop(write(&path, 5));
    let steps = |path: &Path| {
        Recording::open(path).map(|recording| (recording.steps().len(), recording.interrupted()))
    };
    assert_eq!(steps(&path).unwrap(), (5, true));
    let append = |bytes: &[u8]| {
        let journal = path.with_extension("sigmf-journal");
        OpenOptions::new()
            .append(true)
            .open(journal)
            .unwrap()
            .write_all(bytes)
            .unwrap();
    };
    append(b"{\"core:sample_start\": 80, \"core:sam");
    assert_eq!(steps(&path).unwrap(), (5, true));
    let data = OpenOptions::new()
        .write(true)
        .open(path.with_extension("sigmf-data"))
        .unwrap();
    data.set_len(4 * 16 * 8 + 3).unwrap();
    assert_eq!(steps(&path).unwrap(), (4, true));
}

#[test]
fn invalid_recordings_are_refused_with_reason() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("bad");
    write(&path, 3).finish().unwrap();
    let (meta, data) = (
        path.with_extension("sigmf-meta"),
        path.with_extension("sigmf-data"),
    );
    let good = fs::read_to_string(&meta).unwrap();
    let refused = |text: &str, words: &str| {
        fs::write(&meta, text).unwrap();
        let error = Recording::open(&path).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    };
    refused("", "invalid SigMF metadata");
    refused(
        &good.replace("ci16_le", "cf32_le"),
        "2 channels of type cf32_le",
    );
    refused(
        &good.replace("subaperture:setup", "other:setup"),
        "expected a stepped-frequency capture",
    );
    refused(
        &good.replace("\"period\": 8", "\"period\": 0"),
        "invalid \"subaperture:setup\"",
    );
    refused(
        &good.replace(
            "\"core:sample_start\":32",
            "\"core:sample_start\":18446744073709551615",
        ),
        "truncated",
    );
    refused(&good.replace("[[3,5]]", "[[3,99]]"), "truncated");
    // An invalid annotation with a key of this project is an error.
    refused(
        &good.replacen("\"subaperture:sweep\":0", "\"subaperture:sweep\":\"0\"", 1),
        "annotation 0 has \"subaperture:",
    );
    // Annotations of other software are skipped.
    fs::write(
        &meta,
        good.replace(
            "\"annotations\": [",
            "\"annotations\": [{\"core:label\": \"bird\"},",
        ),
    )
    .unwrap();
    assert_eq!(Recording::open(&path).unwrap().steps().len(), 3);
    fs::remove_file(data).unwrap();
    assert!(
        Recording::open(&path)
            .unwrap_err()
            .to_string()
            .contains("bad.sigmf-data")
    );
}

/// A replayed capture is bit-identical to the original; so is one replayed from a recording of every burst, whose
/// unsteady bursts are discarded again.
#[test]
fn replayed_capture_is_bit_identical() {
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name);
    let experiment = experiment(THESIS, 21);
    let plan = plan("order = \"up-down\"\nsweeps = 2\n");
    let first = captured(&mut radio(&experiment), &plan, &at("first"));
    let all = Setup {
        samples: plan.samples(),
        ..setup()
    };
    let writer = Writer::create(&at("all"), all.clone()).unwrap();
    let mut recorder = Recorder::new(radio(&experiment), writer, all);
    captured(&mut recorder, &plan, &at("recorded"));
    recorder.finish().unwrap();
    let bursts = Recording::open(&at("all")).unwrap();
    assert_eq!(bursts.steps().len() as u64, first.bursts);
    assert!(first.bursts > first.steps);
    let data = |name: &str| fs::read(at(name).with_extension("sigmf-data")).unwrap();
    assert!(
        data("recorded") == data("first"),
        "the recorder changed the samples"
    );
    for (from, to) in [("first", "again"), ("all", "from all")] {
        let mut replay = Replay::new(Recording::open(&at(from)).unwrap());
        captured(&mut replay, &plan, &at(to));
        assert!(data(to) == data("first"), "{from}");
        let ended = replay.tune(Side::Receive, 1.1e9, None);
        assert!(matches!(ended, Err(RadioError::Ended(_))), "{ended:?}");
    }
}

/// A device rounds gains, 60.1 and 40.4 dB to 60 and 40, and its rate may be a fraction of the clock.
#[test]
fn recording_with_rounded_settings_replays_with_original_plan() {
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name);
    let experiment = experiment(THESIS, 21);
    let gains = |db: f64| {
        plan(&format!(
            "[radio]\ntransmit_gain = \"60.1 dB\"\nreceive_gain = \"{db} dB\"\n"
        ))
    };
    let plan = gains(40.4);
    let first = captured(&mut radio(&experiment), &plan, &at("first"));
    assert_eq!(
        (first.set.transmit_gain_db, first.set.receive_gain_db),
        (60.0, [40.0, 40.0])
    );
    let replay = || Replay::new(Recording::open(&at("first")).unwrap());
    let again = captured(&mut replay(), &plan, &at("again"));
    assert_eq!(again.set, first.set);
    let data = |name: &str| fs::read(at(name).with_extension("sigmf-data")).unwrap();
    assert!(data("again") == data("first"));
    // Settings that cannot result from rounding are refused.
    let refused = replay().configure(&gains(41.2).radio).unwrap_err();
    assert!(refused.to_string().contains("39 to 41 dB"), "{refused}");
    let mut replay = replay();
    replay.configure(&plan.radio).unwrap();
    replay.tune(Side::Receive, 1.1e9, None).unwrap();
    let burst = Burst {
        waveform: &[Complex32::ONE; 5],
        at_s: 0.0,
    };
    let mut buffers = [0, 1].map(|_| vec![Sample::ZERO; 20]);
    let [a, b] = &mut buffers;
    let refused = replay.burst(&burst, [a, b]).unwrap_err().to_string();
    assert!(
        refused.contains("5 samples") && refused.contains("expected 8"),
        "{refused}"
    );
}

/// An unreadable journal differs from a missing one: ignoring it would lose all steps of an interrupted capture.
#[cfg(unix)]
#[test]
fn unreadable_journal_is_an_error() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("killed");
    drop(write(&path, 5));
    let journal = path.with_extension("sigmf-journal");
    fs::remove_file(&journal).unwrap();
    std::os::unix::fs::symlink(&journal, &journal).unwrap();
    let error = Recording::open(&path).unwrap_err().to_string();
    assert!(error.contains("killed.sigmf-journal"), "{error}");
}

/// Radio whose synthesisers have a constant frequency error, hertz.
struct Off<T>(T, f64);

impl<T: Transceiver> Transceiver for Off<T> {
    fn about(&self) -> &About {
        self.0.about()
    }
    fn configure(&mut self, asked: &Configuration) -> Result<Configuration, RadioError> {
        self.0.configure(asked)
    }
    fn now_s(&mut self) -> Result<f64, RadioError> {
        self.0.now_s()
    }
    fn tune(&mut self, side: Side, carrier_hz: f64, at_s: Option<f64>) -> Result<f64, RadioError> {
        self.0.tune(side, carrier_hz + self.1, at_s)
    }
    fn burst(&mut self, burst: &Burst, to: [&mut [Sample]; 2]) -> Result<Received, RadioError> {
        self.0.burst(burst, to)
    }
    fn sensors(&mut self) -> Result<Sensors, RadioError> {
        self.0.sensors()
    }
    fn events(&mut self, events: &mut Vec<Event>) {
        self.0.events(events);
    }
}

#[test]
fn actual_carrier_is_recorded_and_large_carrier_error_is_refused() {
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name);
    let experiment = experiment(THESIS, 21);
    captured(&mut Off(radio(&experiment), 3.0), &plan(""), &at("near"));
    let recording = Recording::open(&at("near")).unwrap();
    assert_eq!(recording.steps()[7].carrier_hz, 1.128e9 + 3.0);
    let summary = captured(&mut Off(radio(&experiment), 5e3), &plan(""), &at("far"));
    let EndReason::Radio(error) = summary.ended else {
        panic!("{summary:?}");
    };
    assert!(
        error.to_string().contains("more than 4000 Hz off"),
        "{error}"
    );
}
