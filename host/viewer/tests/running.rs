//! Test capture: a radar that moves away from a corner reflector, by the simulated radio with injected faults.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::mpsc::sync_channel;

use subaperture_describe::Description;
use subaperture_radio::Transceiver;
use subaperture_radio::capture::{Queues, Summary, capture, setup};
use subaperture_radio::fault::{Faults, Faulty};
use subaperture_radio::live::{LiveState, LiveStep, SweepAssembler, View};
use subaperture_radio::plan::Plan;
use subaperture_radio::profile::Options;
use subaperture_radio::simulated::{Analogue, SimulatedRadio, Wiring};
use subaperture_simulate::scenario::Scenario;
use tempfile::TempDir;

/// Carriers per sweep.
pub(crate) const STEPS: usize = 32;
/// Speed away from the reflector.
pub(crate) const SPEED_M_S: f64 = 1.0;

/// The radar moves from the origin along -x; the reflector is at 6 m. Amplitudes are 1 at 6 m.
const SCENE: &str = r#"
    seed = 3
    [radar]
    kind = "ideal"
    pulses = 9
    pri = "1 s"
    centre = "1.2 GHz"
    bandwidth = "200 MHz"
    samples = 32
    [radar.noise]
    power = "-20 dB"
    [platform]
    kind = "linear"
    position = "0, 0, 0 m"
    velocity = "-1, 0, 0 m/s"
    at = "start"
    [scene]
    reference = "6, 0, 0 m"
    [[scene.point]]
    position = "6, 0, 0 m"
    cross_section = "1 m^2"
"#;

/// Finished capture, shown sweep by sweep.
pub(crate) struct Running {
    pub(crate) board: Arc<LiveState>,
    pub(crate) summary: Summary,
    pub(crate) steps: Vec<LiveStep>,
    follower: SweepAssembler,
}

/// Capture `sweeps` sweeps without showing any.
pub(crate) fn captured(name: &str, sweeps: u64) -> Running {
    let folder = TempDir::new().unwrap();
    let text = format!(
        "name = \"{name}\"\n[plan]\nstart = \"1.1 GHz\"\nstop = \"1.3 GHz\"\nsteps = {STEPS}\nsweeps = {sweeps}\n"
    );
    let plan = Plan::describe(&Description::new("plan.toml", text, ".")).unwrap();
    let experiment = Scenario::new("scene.toml", SCENE.to_owned(), ".")
        .experiment()
        .unwrap();
    // The loop delay equals that of the antenna cables, so that ranges need no calibration.
    let wiring = Wiring::loopback(0.0, 0.0, None);
    let radio = SimulatedRadio::new(&experiment, wiring, Analogue::b210()).unwrap();
    let faults = Faults {
        overflow: 0.03,
        lost_packet: 0.04,
        late: 0.02,
        packet: 120,
        seed: 8,
        ..Faults::default()
    };
    let mut radio = Faulty::new(radio, faults);
    let set = radio.configure(&plan.radio).unwrap();
    let setup = setup(radio.about(), &plan, &set);
    let view = View {
        rows: 6,
        columns: 256,
        profile: Options {
            reach_m: Some(12.0),
            ..Options::default()
        },
        disk: Some(folder.path().to_owned()),
        ..View::default()
    };
    let (follower, board) = SweepAssembler::new(&plan, &setup, 1e6, view).unwrap();
    let (sender, steps) = sync_channel(1 << 12);
    let path = folder.path().join("capture");
    let stop = AtomicBool::new(false);
    let queues = Queues::default();
    let summary = capture(&mut radio, &plan, &path, queues, Some(&sender), &stop).unwrap();
    drop(sender);
    Running {
        board: Arc::new(board),
        summary,
        steps: steps.iter().collect(),
        follower,
    }
}

impl Running {
    /// Show some sweeps.
    pub(crate) fn show(&mut self, sweeps: Range<u64>) {
        for step in self
            .steps
            .iter()
            .filter(|step| sweeps.contains(&step.sweep))
        {
            self.follower.take(&self.board, step);
        }
    }

    /// Device time at mid-sweep.
    pub(crate) fn middle_s(&self, sweep: u64) -> f64 {
        let times = self.steps.iter().filter(|step| step.sweep == sweep);
        times.map(|step| step.time_s).sum::<f64>() / STEPS as f64
    }
}
