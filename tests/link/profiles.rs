//! Range profiles from a module over lines with faults: every one is the core's own to the bit, or tells how much of it is missing.
//!
//! The module is the firmware's own station in a thread of this process; the core run here on the same counts is compared with.

use std::time::Duration;

use num_complex::Complex;
use subaperture::monitor::Silent;
use subaperture::onboard::link::{
    Buffers, LinkError, Mismatch, Profile, Profiles, Ranging, Session, Settings, SweepBurst,
    SweepSource,
};
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

/// What a module behind such a line brings of a scene.
fn over(faults: Faults, scene: &SweepScene) -> (Vec<Profile>, Profiles) {
    let mut line: FaultyLine<Module> = Module::behind(faults, Manner::default());
    let mut buffers = Buffers::new();
    let mut session = Session::open(&mut line, &mut buffers, settings(), &mut Silent).unwrap();
    let weights = scene.weights();
    let mut source = scene.clone();
    let mut task = Ranging {
        setup: scene.setup,
        weights: &weights,
        sweeps: scene.sweeps,
        source: &mut source,
    };
    let mut came = Vec::new();
    let told = session.profiles(&mut task, &mut |profile| came.push(profile), &mut Silent);
    assert_eq!(came.len(), told.taken as usize);
    (came, told)
}

fn scene() -> SweepScene {
    let mut scene = SweepScene::new(10, 104, 32);
    scene.sweeps = 3;
    scene.left_out = vec![5];
    scene.lost = vec![(9, 40..52)];
    scene
}

fn assert_the_cores(profile: &Profile, scene: &SweepScene) {
    let (values, usable, _) = scene.profile(profile.sweep);
    assert_eq!((profile.usable, profile.missing), (usable, 0));
    assert_eq!(profile.values, values);
}

#[test]
fn a_clean_line_brings_every_profile() {
    let scene = scene();
    let (came, told) = over(Faults::default(), &scene);
    told.ending.unwrap();
    assert_eq!((told.taken, told.again), (3, 0));
    for (sweep, profile) in (0..).zip(&came) {
        assert_eq!(profile.sweep, sweep);
        assert_the_cores(profile, &scene);
    }
}

/// Some of what goes either way is lost. Samples are sent again, twice at most; a profile that is not whole even then is of the blocks that came: noise of 3 counts over 12000 tells
/// one block from another by some 1e-4. A carrier of which less than half came is left out: one of 9 takes away a third of the RMS, two 0.47.
#[test]
fn a_bad_line_brings_the_same_or_says_what_is_missing() {
    for (bit_errors, sweeps) in [(3e-6, 4), (4e-5, 2)] {
        let mut scene = scene();
        scene.sweeps = sweeps;
        let faults = Faults {
            seed: 3,
            bit_errors,
            ..Faults::default()
        };
        let (came, told) = over(faults, &scene);
        told.ending.unwrap();
        let missing: Vec<u32> = came.iter().map(|own| own.missing).collect();
        println!("{} sent again, samples missing {missing:?}", told.again);
        assert!(told.again > 0);
        let is_mild = bit_errors < 1e-5;
        assert_eq!(missing.iter().all(|missing| *missing == 0), is_mild);
        for profile in &came {
            if profile.missing == 0 {
                assert_the_cores(profile, &scene);
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
fn a_module_that_begins_anew_is_told_of() {
    let faults = Faults {
        // In the middle of the second sweep, of 9 bursts of some 870 bytes.
        restarts_at: vec![12_000],
        ..Faults::default()
    };
    let (came, told) = over(faults, &scene());
    assert!(
        matches!(told.ending, Err(LinkError::BeganAnewAtSweep(1))),
        "{:?}",
        told.ending
    );
    assert_eq!(came.len(), 1);
    assert_the_cores(&came[0], &scene());
}

#[test]
fn what_cannot_be_is_refused() {
    let wide = SweepScene::new(65, 104, 128);
    let (_, told) = over(Faults::default(), &wide);
    let error = SetupError::Size {
        what: Quantity::Carriers,
        wanted: 65,
        least: 2,
        most: 64,
    };
    assert!(
        matches!(told.ending, Err(LinkError::Refused(Refusal::Sweep(own))) if own == error),
        "{:?}",
        told.ending
    );
    let mut module = Module::start(Manner::default());
    let mut buffers = Buffers::new();
    let mut session = Session::open(&mut module, &mut buffers, settings(), &mut Silent).unwrap();
    let mut source = scene();
    let mut task = Ranging {
        setup: source.setup,
        weights: &[0.05; 9],
        sweeps: 1,
        source: &mut source,
    };
    let told = session.profiles(&mut task, &mut |_| panic!("no profile"), &mut Silent);
    let mismatch = Mismatch::Weights {
        weights: 9,
        carriers: 10,
    };
    assert!(matches!(told.ending, Err(LinkError::Mismatch(own)) if own == mismatch));
}

/// A scene whose bursts somebody has changed.
struct Changed(SweepScene, fn(&mut SweepBurst));

impl SweepSource for Changed {
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
    let mut task = Ranging {
        setup: scene().setup,
        weights: &weights,
        sweeps: 1,
        source: &mut source,
    };
    let mut came = Vec::new();
    let told = session.profiles(&mut task, &mut |profile| came.push(profile), &mut Silent);
    (came, told)
}

/// The line is not blamed for what does not fit the setup, and what is lost may reach beyond a burst's end.
#[test]
fn bursts_that_do_not_fit_are_said_to_be_so() {
    let told = of_changed(|burst| burst.samples.push([Complex::new(0, 0); 2])).1;
    let error = told.ending.unwrap_err().to_string();
    assert!(
        error.contains("burst 0 of sweep 0 is of 105 samples"),
        "{error}"
    );
    let told = of_changed(|burst| burst.carrier += 1).1;
    let error = told.ending.unwrap_err().to_string();
    assert!(error.contains("carrier 10, counted from 0"), "{error}");
    let (came, told) = of_changed(|burst| burst.lost = vec![90..90, 100..2000]);
    told.ending.unwrap();
    assert_eq!(came[0].missing, 0);
}
