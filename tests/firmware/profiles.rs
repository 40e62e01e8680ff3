//! Range profiles from the emulated module are bit-identical to those of the core on this machine.

use std::time::Duration;

use subaperture::module::link::{Buffers, ProfileRun, Session, Settings};
use subaperture::monitor::Silent;
use subaperture_tests::sweep_scene::SweepScene;

use crate::emulated::{Begin, Emulated, Wire, application};

/// The serial line transfers about ten thousand bytes per second: bursts are short.
#[test]
fn module_profiles_are_bit_identical_to_core() {
    let mut scene = SweepScene::new(20, 64, 64);
    scene.lost = vec![(3, 10..14)];
    scene.left_out = vec![11];
    scene.sweeps = 2;
    let mut module = Emulated::connected(&application()[0], Wire::Tcp, Begin::Reset);
    let mut buffers = Buffers::new();
    let settings = Settings {
        answer: Duration::from_millis(500),
        ..Settings::default()
    };
    let mut session = Session::open(&mut module, &mut buffers, settings, &mut Silent).unwrap();
    let weights = scene.weights();
    let mut source = scene.clone();
    let mut task = ProfileRun {
        setup: scene.setup,
        weights: &weights,
        source: &mut source,
    };
    let mut came = Vec::new();
    let outcome = session.profiles(&mut task, &mut |profile| came.push(profile), &mut Silent);
    println!("{}", session.counts());
    outcome.ending.unwrap();
    assert_eq!(came.len(), 2);
    for profile in &came {
        let (values, usable, _) = scene.profile(profile.sweep);
        assert_eq!((profile.usable, profile.missing), (usable, 0));
        assert_eq!(usable, 19);
        assert_eq!(profile.values, values);
    }
}
