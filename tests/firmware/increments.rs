//! Increments from the emulated module: bit-identical to the core on this machine, and close to the true motion.

use std::time::Duration;

use subaperture::module::link::{Buffers, Session, Settings};
use subaperture::monitor::Silent;
use subaperture::phase_history::PhaseHistory;
use subaperture_tests::odometer_scene::{Scene, between, pose};

use crate::emulated::{Begin, Emulated, Wire, application};

/// The serial line transfers about ten thousand bytes per second; a pulse has a thousand.
const PULSES: usize = 16;

#[test]
fn module_increments_are_bit_identical_to_core() {
    let scene = Scene::new(2).with_snr_db(40.0, 7);
    let recorded = scene.recorded(PULSES);
    let channels: Vec<&dyn PhaseHistory> = recorded.iter().map(|own| own as _).collect();
    let mut module = Emulated::connected(&application()[0], Wire::Tcp, Begin::Reset);
    let mut buffers = Buffers::new();
    let settings = Settings {
        answer: Duration::from_millis(500),
        ..Settings::default()
    };
    let mut session = Session::open(&mut module, &mut buffers, settings, &mut Silent).unwrap();
    let task = scene.motion_run(&channels, false);
    let outcome = session.increments(&task, &mut Silent);
    println!("{}", session.counts());
    outcome.ending.unwrap();
    assert_eq!(outcome.increments, scene.increments(PULSES));
    for own in outcome.increments.iter().skip(6) {
        let motion = own.motion.expect("four targets");
        let (moved_m, turn_rad) = between(pose(own.since as usize), pose(own.pulse as usize));
        let off_m = (motion.moved_m[0] - moved_m[0]).hypot(motion.moved_m[1] - moved_m[1]);
        // Four standard deviations of a step at 40 dB, 6e-6 m (`tests/stream/odometer.rs`); of a rotation, a thousandth of that in metres
        // over the receivers' distance of 2 mm.
        assert!(
            off_m < 3e-5 && (motion.turn_rad - turn_rad).abs() < 0.02,
            "{own:?}"
        );
    }
}
