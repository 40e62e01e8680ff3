//! The radio behind the interface, which tests also use directly.

use subaperture_radio::fault::{Faults, Faulty};
use subaperture_radio::simulated::{Analogue, Coupled, SimulatedRadio, Wiring};
use subaperture_simulate::Experiment;
use subaperture_simulate::scenario::Scenario;

/// Variable that selects faults: see [`radio`].
pub(crate) const FAULTS: &str = "SUBAPERTURE_STAND_IN_FAULTS";

pub(crate) const SCENE: &str = r#"
    seed = 21
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
    levels = ["1 kHz, -90 dBc/Hz", "100 kHz, -95 dBc/Hz"]
    [radar.clock]
    offset = "2 ppm"
    [platform]
    kind = "fixed"
    position = "0, 0, 0 m"
    [scene]
    reference = "6.3, 0, 0 m"
    [[scene.point]]
    position = "6.3, 0, 0 m"
    cross_section = "1 m^2"
"#;

pub(crate) fn experiment() -> Experiment {
    Scenario::new("scene.toml", SCENE, ".")
        .experiment()
        .expect("the scene is right")
}

/// A radio with the impairments of an AD9361 and faults of its cable: `faults` for some of each, `unplug` at the 20th burst, otherwise
/// none.
pub(crate) fn radio<'a>(experiment: &'a Experiment, faults: &str) -> Faulty<SimulatedRadio<'a>> {
    let leakage = Coupled {
        delay_s: 0.5e-9,
        amplitude: 3.0,
    };
    let wiring = Wiring::loopback(15e-9, 20e-9, Some(leakage));
    let radio = SimulatedRadio::new(experiment, wiring, Analogue::b210());
    let faults = match faults {
        "faults" => Faults {
            overflow: 0.12,
            lost_packet: 0.1,
            late: 0.08,
            underflow: 0.06,
            packet: 120,
            unplug_at: None,
            seed: 5,
        },
        "unplug" => Faults {
            unplug_at: Some(20),
            ..Faults::default()
        },
        _ => Faults::default(),
    };
    Faulty::new(radio.expect("the scene has the antennas"), faults)
}
