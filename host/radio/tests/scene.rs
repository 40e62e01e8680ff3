//! Scene, radio and plan shared by the tests.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use subaperture_describe::Description;
use subaperture_radio::Transceiver;
use subaperture_radio::capture::{Queues, Summary, capture};
use subaperture_radio::plan::Plan;
use subaperture_radio::simulated::{Analogue, Coupled, SimulatedRadio, Wiring};
use subaperture_simulate::Experiment;
use subaperture_simulate::scenario::Scenario;

/// Receiver impairments of a B210; amplitudes are relative to a range of 6.3 m.
const RADAR: &str = r#"
    [radar]
    kind = "ideal"
    pulses = 1
    pri = "1 s"
    centre = "1.2 GHz"
    bandwidth = "200 MHz"
    samples = 50
    spreading = true
    [[radar.receiver]]
    offset = "0, 0.1, 0 m"
    [radar.noise]
    power = "-20 dB"
    [radar.phase_noise]
    levels = ["1 kHz, -90 dBc/Hz", "100 kHz, -95 dBc/Hz", "500 kHz, -110 dBc/Hz"]
    [radar.clock]
    offset = "2 ppm"
    [radar.converter]
    bits = 12
    full_scale = "26 dB"
    [platform]
    kind = "fixed"
    position = "0, 0, 0 m"
    [scene]
    reference = "6.3, 0, 0 m"
"#;

/// Scene of C 5.6: part of a wall at 1 m, a corner reflector at 6.3 m, a wall at 16 m; amplitudes 0.79, 1 and 0.78 at
/// the antenna.
pub(crate) const THESIS: &[(f64, f64)] = &[(1.0, 0.0004), (6.3, 1.0), (16.0, 25.0)];

/// Point targets at ranges along x, with cross sections in m².
pub(crate) fn experiment(points: &[(f64, f64)], seed: u64) -> Experiment {
    let mut text = format!("seed = {seed}\n{RADAR}");
    for (range_m, square_m) in points {
        text += &format!(
            "[[scene.point]]\nposition = \"{range_m}, 0, 0 m\"\ncross_section = \"{square_m} m^2\"\n"
        );
    }
    Scenario::new("scene.toml", text, ".").experiment().unwrap()
}

/// Half of the path from the transmitter to a range along x and to the receiver, which is offset by 0.1 m.
pub(crate) fn half_path_m(range_m: f64) -> f64 {
    0.5 * (range_m + (range_m * range_m + 0.01).sqrt())
}

/// Loopback wiring of C Fig. 5.4 with 3 m of cable, antennas on 2 m of cable, and leakage three times as strong as the
/// corner reflector.
pub(crate) fn wiring() -> Wiring {
    let leakage = Coupled {
        delay_s: 0.5e-9,
        amplitude: 3.0,
    };
    Wiring::loopback(15e-9, 20e-9, Some(leakage))
}

/// Radio with all impairments.
pub(crate) fn radio(experiment: &Experiment) -> SimulatedRadio<'_> {
    SimulatedRadio::new(experiment, wiring(), Analogue::b210()).unwrap()
}

/// Plan from 1.1 to 1.3 GHz in 50 steps, with additional lines.
pub(crate) fn plan(more: &str) -> Plan {
    let text = format!("[plan]\nstart = \"1.1 GHz\"\nstop = \"1.3 GHz\"\nsteps = 50\n{more}");
    Plan::describe(&Description::new("plan.toml", text, ".")).unwrap()
}

/// Run a capture to its end.
pub(crate) fn captured(radio: &mut dyn Transceiver, plan: &Plan, path: &Path) -> Summary {
    capture(
        radio,
        plan,
        path,
        Queues::default(),
        None,
        &AtomicBool::new(false),
    )
    .unwrap()
}
