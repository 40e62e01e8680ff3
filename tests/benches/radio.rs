//! A capture at a B210's highest rate, from the simulated radio to disk: two channels at 30.72 MS/s of 16-bit I and Q, 245.8 MB/s. `cargo bench --bench
//! radio`; the recordings, 1.2 GB each, are in the folder for temporary files (`TMPDIR`) and removed.
//!
//! Two runs: as fast as this machine can, which shows the margin, and at the rate of a device. The radio has a converter of 12 bits, I/Q
//! imbalance, DC offset and random phases, but no noise and no settling, so that it repeats periods (`radio::simulated`). The bench thus
//! measures the path of the samples from the buffers of bursts through the mixing with the reference tone and the queue to the disk. Bursts
//! last 120 ms; between them two retunes take 4 ms and the command 1 ms, so a real device does not send all the time.

use std::fs;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use subaperture::describe::Description;
use subaperture::radio::capture::{EndReason, Queues, capture};
use subaperture::radio::plan::Plan;
use subaperture::radio::simulated::{Analogue, SimulatedRadio, Wiring};
use subaperture::simulate::scenario::Scenario;
use subaperture_xtask::processor::{self, Of};

/// Required rate, bytes per second.
const NEEDED: f64 = 8.0 * 30.72e6;

const PLAN: &str = r#"
    [plan]
    start = "1.1 GHz"
    stop = "1.3 GHz"
    steps = 20
    dwell = "120 ms"
    tone = "1.92 MHz"
    sweeps = 2
    [radio]
    master_clock = "30.72 MHz"
    sample_rate = "30.72 MHz"
    bandwidth = "30 MHz"
"#;

const SCENE: &str = r#"
    [radar]
    kind = "ideal"
    pulses = 1
    pri = "1 s"
    centre = "1.2 GHz"
    bandwidth = "200 MHz"
    samples = 50
    [[radar.receiver]]
    offset = "0, 0.1, 0 m"
    [platform]
    kind = "fixed"
    position = "0, 0, 0 m"
    [scene]
    reference = "6.3, 0, 0 m"
    [[scene.point]]
    position = "6.3, 0, 0 m"
"#;

fn main() {
    let description = Description::new("plan.toml", PLAN, ".");
    let plan = Plan::describe(&description).expect("the plan is right");
    let scenario = Scenario::new("scene.toml", SCENE, ".");
    let experiment = scenario.experiment().expect("the scene is right");
    let folder = tempfile::tempdir().expect("a temporary folder");
    let queues = Queues::within(&plan, 512 << 20);
    println!("{} bursts fit the queue", queues.disk);
    println!("| run | s | MB/s | of 245.8 MB/s | processors at work | longest queue | waits |");
    println!("|---|---|---|---|---|---|---|");
    for true_time in [false, true] {
        let analogue = Analogue {
            settling: None,
            frequency_offset_hz: 0.0,
            ..Analogue::b210()
        };
        let wiring = Wiring::loopback(15e-9, 20e-9, None);
        let mut radio =
            SimulatedRadio::new(&experiment, wiring, analogue).expect("the scene has its antenna");
        if true_time {
            radio = radio.in_real_time();
        }
        let path = folder.path().join("bench");
        let (began, work_s) = (Instant::now(), processor::seconds(Of::Own));
        let stop = AtomicBool::new(false);
        let summary =
            capture(&mut radio, &plan, &path, queues, None, &stop).expect("the capture begins");
        let took_s = began.elapsed().as_secs_f64();
        assert!(matches!(summary.ended, EndReason::Done), "{summary:?}");
        assert_eq!((summary.lost_samples, summary.flagged), (0, [0; 5]));
        let work_s = processor::seconds(Of::Own)
            .zip(work_s)
            .map(|(now, then)| now - then);
        let bytes = bytes_of(&path);
        let rate = bytes / took_s;
        let shares = work_s.map_or("not known".to_owned(), |work_s| {
            format!("{:.2}", work_s / took_s)
        });
        println!(
            "| {} | {took_s:.2} | {:.0} | {:.2} | {shares} | {} | {} |",
            if true_time {
                "true time"
            } else {
                "as fast as it can"
            },
            rate / 1e6,
            rate / NEEDED,
            summary.longest_queue,
            summary.waits
        );
        for ending in ["sigmf-data", "sigmf-meta"] {
            let _ = fs::remove_file(path.with_extension(ending));
        }
    }
}

fn bytes_of(path: &Path) -> f64 {
    let about = fs::metadata(path.with_extension("sigmf-data"));
    about.map_or(0.0, |about| about.len() as f64)
}
