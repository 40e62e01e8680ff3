//! Range profiles from a module over lossy lines: each is bit-identical to the core's, or reports how much is missing.
//!
//! The module is the firmware's own endpoint in a thread of this process; the reference is the core run on the same samples.

use std::time::Duration;

use num_complex::Complex;
use subaperture::module::link::{
    Buffers, LinkError, Mismatch, Profile, ProfileRun, Profiles, Session, Settings, SweepBurst,
    SweepSource,
};
use subaperture::monitor::Silent;
use subaperture::phase_history::ReadError;
use subaperture_core::link::Refusal;
use subaperture_core::sweep::{Quantity, SetupError};
use subaperture_tests::faults::{Faults, FaultyLine};
use subaperture_tests::module::{Manner, Module};
use subaperture_tests::sweep_scene::SweepScene;

fn settings() -> Settings {
    Settings {
        answer: Duration::from_millis(30),
        idle: Duration::from_secs(5),
        first_number: 40,
        ..Settings::default()
    }
}

/// Result of a range-profile run on `scene` by a module behind a faulty line.
fn over(faults: Faults, scene: &SweepScene) -> (Vec<Profile>, Profiles) {
    let mut line: FaultyLine<Module> = Module::behind(faults, Manner::default());
    let mut buffers = Buffers::new();
    let mut session = Session::open(&mut line, &mut buffers, settings(), &mut Silent).unwrap();
    let weights = scene.weights();
    let mut source = scene.clone();
    let mut task = ProfileRun {
        setup: scene.setup,
        weights: &weights,
        source: &mut source,
    };
    let mut came = Vec::new();
    let reported = session.profiles(&mut task, &mut |profile| came.push(profile), &mut Silent);
    assert_eq!(came.len(), reported.taken as usize);
    (came, reported)
}

fn scene() -> SweepScene {
    let mut scene = SweepScene::new(10, 104, 32);
    scene.sweeps = 3;
    scene.left_out = vec![5];
    scene.lost = vec![(9, 40..52)];
    scene
}

fn assert_equals_core(profile: &Profile, scene: &SweepScene) {
    let (values, usable, _) = scene.profile(profile.sweep);
    assert_eq!((profile.usable, profile.missing), (usable, 0));
    assert_eq!(profile.values, values);
}

#[test]
fn clean_line_delivers_every_profile() {
    let scene = scene();
    let (came, reported) = over(Faults::default(), &scene);
    reported.ending.unwrap();
    assert_eq!((reported.taken, reported.again), (3, 0));
    for (sweep, profile) in (0..).zip(&came) {
        assert_eq!(profile.sweep, sweep);
        assert_equals_core(profile, &scene);
    }
}

/// Frames are lost in both directions. Samples are repeated, twice at most; a profile that is still incomplete is computed
/// from the blocks received: noise of 3 counts over 12000 makes blocks differ by about 1e-4. A carrier with less than half of
/// its samples is rejected: one of 9 removes a third of the RMS, two remove 0.47.
#[test]
fn lossy_line_delivers_profiles_or_reports_missing_samples() {
    for (bit_errors, sweeps) in [(3e-6, 4), (4e-5, 2)] {
        let mut scene = scene();
        scene.sweeps = sweeps;
        let faults = Faults {
            seed: 3,
            bit_errors,
            ..Faults::default()
        };
        let (came, reported) = over(faults, &scene);
        reported.ending.unwrap();
        let missing: Vec<u32> = came.iter().map(|own| own.missing).collect();
        println!("{} sent again, samples missing {missing:?}", reported.again);
        assert!(reported.again > 0);
        let is_mild = bit_errors < 1e-5;
        assert_eq!(missing.iter().all(|missing| *missing == 0), is_mild);
        for profile in &came {
            if profile.missing == 0 {
                assert_equals_core(profile, &scene);
                continue;
            }
            let (values, usable, _) = scene.profile(profile.sweep);
            assert!(profile.usable + 2 >= usable, "{}", profile.usable);
            let norm = |values: &mut dyn Iterator<Item = f32>| values.sum::<f32>().sqrt();
            let all = norm(&mut values.iter().map(|z| z.norm_sqr()));
            let both = values.iter().zip(&profile.values);
            let off = norm(&mut both.map(|(a, b)| (a - b).norm_sqr())) / all;
            let most = if profile.usable == usable { 1e-3 } else { 0.7 };
            println!("{} of {usable} carriers, off {off}", profile.usable);
            assert!(off < most, "{off}");
        }
    }
}

#[test]
fn module_restart_is_reported() {
    let faults = Faults {
        // In the middle of the second sweep, of 9 bursts of some 870 bytes.
        restarts_at: vec![12_000],
        ..Faults::default()
    };
    let (came, reported) = over(faults, &scene());
    assert!(
        matches!(reported.ending, Err(LinkError::BeganAnewAtSweep(1))),
        "{:?}",
        reported.ending
    );
    assert_eq!(came.len(), 1);
    assert_equals_core(&came[0], &scene());
}

#[test]
fn invalid_ranging_input_is_rejected() {
    let wide = SweepScene::new(65, 104, 128);
    let (_, reported) = over(Faults::default(), &wide);
    let error = SetupError::Size {
        what: Quantity::Carriers,
        wanted: 65,
        least: 2,
        most: 64,
    };
    assert!(
        matches!(reported.ending, Err(LinkError::Refused(Refusal::Sweep(own))) if own == error),
        "{:?}",
        reported.ending
    );
    let mut module = Module::start(Manner::default());
    let mut buffers = Buffers::new();
    let mut session = Session::open(&mut module, &mut buffers, settings(), &mut Silent).unwrap();
    let mut source = scene();
    let mut task = ProfileRun {
        setup: source.setup,
        weights: &[0.05; 9],
        source: &mut source,
    };
    let reported = session.profiles(&mut task, &mut |_| panic!("no profile"), &mut Silent);
    let mismatch = Mismatch::Weights {
        weights: 9,
        carriers: 10,
    };
    assert!(matches!(reported.ending, Err(LinkError::Mismatch(own)) if own == mismatch));
}

/// Scene with modified bursts.
struct Changed(SweepScene, fn(&mut SweepBurst));

impl SweepSource for Changed {
    fn has(&mut self, sweep: u32) -> Result<bool, ReadError> {
        Ok(sweep == 0)
    }

    fn burst(
        &mut self,
        sweep: u32,
        index: usize,
        burst: &mut SweepBurst,
    ) -> Result<bool, ReadError> {
        let there = self.0.burst(sweep, index, burst)?;
        (self.1)(burst);
        Ok(there)
    }
}

fn of_changed(change: fn(&mut SweepBurst)) -> (Vec<Profile>, Profiles) {
    let mut module = Module::start(Manner::default());
    let mut buffers = Buffers::new();
    let mut session = Session::open(&mut module, &mut buffers, settings(), &mut Silent).unwrap();
    let weights = scene().weights();
    let mut source = Changed(scene(), change);
    let mut task = ProfileRun {
        setup: scene().setup,
        weights: &weights,
        source: &mut source,
    };
    let mut came = Vec::new();
    let reported = session.profiles(&mut task, &mut |profile| came.push(profile), &mut Silent);
    (came, reported)
}

/// Bursts that do not fit the setup are not attributed to the line, and lost ranges may extend beyond the end of a burst.
#[test]
fn bursts_that_exceed_setup_are_rejected() {
    let reported = of_changed(|burst| burst.samples.push([Complex::new(0, 0); 2])).1;
    let error = reported.ending.unwrap_err().to_string();
    assert!(
        error.contains("burst 0 of sweep 0") && error.contains("and 105 samples"),
        "{error}"
    );
    let reported = of_changed(|burst| burst.carrier += 1).1;
    let error = reported.ending.unwrap_err().to_string();
    assert!(error.contains("found carrier 10"), "{error}");
    let (came, reported) = of_changed(|burst| burst.lost = vec![90..90, 100..2000]);
    reported.ending.unwrap();
    assert_eq!(came[0].missing, 0);
}
