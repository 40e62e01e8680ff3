//! Sessions with a module over lossy lines: no wrong map is ever accepted, every loss is counted, and after further runs
//! no map is missing.
//!
//! The module is the firmware's own endpoint in a thread of this process. Maps are compared with the core run here on the same
//! pulses: they must be bit-identical, since both run the same core on the same machine.

use std::time::Duration;

use subaperture::module::link::{
    Buffers, Counts, HostCore, LinkError, Outcome, Session, SessionObserver, Settings, TransferEnd,
    Verified,
};
use subaperture::monitor::Silent;
use subaperture::phase_history::InMemory;
use subaperture_core::link::{Arithmetic, Encoding};
use subaperture_tests::faults::{Faults, FaultyLine};
use subaperture_tests::link_scene::{
    Keep, Kept, MAPS, PULSES, expected, job, judge, recorded, scene,
};
use subaperture_tests::module::{Manner, Module};

fn settings() -> Settings {
    Settings {
        answer: Duration::from_millis(30),
        idle: Duration::from_secs(5),
        first_number: 77,
        ..Settings::default()
    }
}

/// Run the scene on a module behind a faulty line. Every accepted map has been verified.
fn session(faults: Faults, settings: Settings) -> (Outcome, Kept) {
    session_with(Module::behind(faults, Manner::default()), settings)
}

/// Like `session`, with a given module.
fn session_with(mut module: FaultyLine<Module>, settings: Settings) -> (Outcome, Kept) {
    let scene = scene();
    let recording = recorded(&scene);
    let mut job = job(&scene, &recording, Encoding::Complex32);
    let (mut buffers, mut keep) = (Buffers::new(), Keep::default());
    let mut session = Session::open(&mut module, &mut buffers, settings, &mut Silent).unwrap();
    let outcome = session.transfer(&mut job, &mut keep, &mut Silent);
    println!("{}", outcome.counts);
    judge(&keep.0);
    let counts = &outcome.counts;
    assert_eq!(counts.maps_wanted, MAPS as u64);
    assert_eq!(counts.maps_taken, keep.0.len() as u64);
    assert_eq!(outcome.missing.len() + keep.0.len(), MAPS);
    assert!(outcome.missing.iter().all(|key| !keep.0.contains_key(key)));
    (outcome, keep.0)
}

fn assert_complete(outcome: &Outcome) {
    assert!(
        matches!(outcome.ending, TransferEnd::Complete),
        "{outcome:?}"
    );
}

#[test]
fn clean_line_delivers_all_maps_in_one_run() {
    let (outcome, _) = session(Faults::default(), settings());
    assert_complete(&outcome);
    let counts = &outcome.counts;
    assert_eq!(counts.runs, 1);
    assert_eq!(counts.pulses_sent, PULSES as u64);
    assert_eq!(counts.module_pulses.accepted, PULSES as u64);
    let lost = counts.maps_lost + counts.maps_repeated + counts.maps_refused;
    assert_eq!((lost, counts.maps_fetched_again), (0, 0));
    for frames in [counts.frames_to_module, counts.frames_from_module] {
        assert_eq!((frames.damaged, frames.lost, frames.repeated), (0, 0, 0));
        assert!(frames.taken > 0);
    }
    assert!(counts.bytes_to_module > (PULSES * 16 * 8) as u64);
    assert!(counts.bytes_from_module > (MAPS * 5 * 13 * 8) as u64);
}

#[test]
fn bit_errors_only_cost_time() {
    for (seed, bit_errors) in [(1, 1e-5), (2, 1e-5), (3, 1e-4)] {
        let faults = Faults {
            seed,
            bit_errors,
            ..Faults::default()
        };
        let settings = Settings {
            retries: 1000,
            ..settings()
        };
        let (outcome, _) = session(faults, settings);
        assert_complete(&outcome);
        if bit_errors > 5e-5 {
            // About 40 kB in each direction and run: 30 bit errors.
            let counts = &outcome.counts;
            assert!(counts.frames_to_module.damaged > 0);
            assert!(counts.frames_from_module.damaged > 0);
            assert!(counts.maps_fetched_again > 0);
        }
    }
}

#[test]
fn line_too_bad_for_any_map_ends_with_error() {
    let faults = Faults {
        seed: 4,
        bit_errors: 1e-3,
        ..Faults::default()
    };
    let settings = Settings {
        retries: 1,
        ..settings()
    };
    let (outcome, _) = session(faults, settings);
    assert!(
        !matches!(outcome.ending, TransferEnd::Complete),
        "{outcome:?}"
    );
    assert!(outcome.counts.frames_from_module.damaged > 0);
}

#[test]
fn losses_are_reported_without_retries() {
    let faults = Faults {
        seed: 5,
        dropped_pulses: 0.05,
        ..Faults::default()
    };
    let settings = Settings {
        retries: 0,
        ..settings()
    };
    let (outcome, kept) = session(faults, settings);
    assert!(
        matches!(outcome.ending, TransferEnd::Incomplete),
        "{outcome:?}"
    );
    let counts = &outcome.counts;
    // Only pulses are lost. Sub-CPIs with a lost pulse inside are discarded, and only those are missing.
    assert!(counts.module_pulses.lost > 0);
    assert!(counts.frames_to_module.lost >= counts.module_pulses.lost);
    assert_eq!(counts.maps_lost, 0);
    let missing: std::collections::BTreeSet<u32> =
        outcome.missing.iter().map(|key| key.0).collect();
    assert_eq!(
        outcome.missing.len(),
        2 * missing.len(),
        "both patches of each"
    );
    // The next sub-CPI is unaffected.
    let after = missing.iter().filter(|&&n| kept.contains_key(&(n + 1, 0)));
    assert!(after.count() > 0);
}

#[test]
fn lost_tail_of_pulses_is_sent_again() {
    for seed in 6..9 {
        let faults = Faults {
            seed,
            dropped_pulses: 0.2,
            ..Faults::default()
        };
        let settings = Settings {
            retries: 100,
            ..settings()
        };
        let (outcome, _) = session(faults, settings);
        assert_complete(&outcome);
        assert!(outcome.counts.maps_fetched_again > 0);
        assert!(outcome.counts.module_pulses.sub_cpis_incomplete > 0);
    }
}

#[test]
fn module_that_receives_no_pulse_is_abandoned() {
    // Everything else arrives: the module greets, is configured, and answers.
    let faults = Faults {
        seed: 12,
        dropped_pulses: 1.0,
        ..Faults::default()
    };
    let settings = Settings {
        idle: Duration::from_millis(100),
        ..settings()
    };
    let (outcome, kept) = session(faults, settings);
    let TransferEnd::Failed(error) = &outcome.ending else {
        panic!("{outcome:?}");
    };
    println!("{error}");
    assert!(kept.is_empty());
    assert!(outcome.counts.pulses_sent > 0);
    assert!(outcome.counts.reconnects > 1, "{}", outcome.counts);
}

#[test]
fn retries_end_when_no_map_is_missing() {
    let settings = Settings {
        retries: u32::MAX,
        ..settings()
    };
    let (outcome, _) = session(Faults::default(), settings);
    assert_complete(&outcome);
    assert_eq!(outcome.counts.runs, 1);
}

#[test]
fn extremely_low_pulse_rate_does_not_panic() {
    struct Once(bool);
    impl SessionObserver for Once {
        fn update(&mut self, counts: &Counts) {
            self.0 = counts.pulses_sent + counts.runs > 0 && counts.seconds > 0.2;
        }
        fn cancelled(&self) -> bool {
            self.0
        }
    }
    let scene = scene();
    let recording = recorded(&scene);
    let mut job = job(&scene, &recording, Encoding::Complex32);
    let mut module = Module::start(Manner::default());
    let (mut buffers, mut keep) = (Buffers::new(), Keep::default());
    let settings = Settings {
        rate_hz: Some(1e-300),
        ..settings()
    };
    let mut session = Session::open(&mut module, &mut buffers, settings, &mut Silent).unwrap();
    let outcome = session.transfer(&mut job, &mut keep, &mut Once(false));
    assert!(
        matches!(outcome.ending, TransferEnd::Failed(LinkError::Cancelled)),
        "{outcome:?}"
    );
}

#[test]
fn truncated_frames_are_lost_and_maps_repeated() {
    for seed in 9..12 {
        let faults = Faults {
            seed,
            cuts: 3e-4,
            ..Faults::default()
        };
        let settings = Settings {
            retries: 100,
            ..settings()
        };
        let (outcome, _) = session(faults, settings);
        assert_complete(&outcome);
        let counts = &outcome.counts;
        assert!(counts.frames_from_module.damaged + counts.frames_from_module.lost > 0);
    }
}

#[test]
fn host_that_stops_reading_loses_no_map() {
    let faults = Faults {
        stalls_at: vec![
            (6_000, Duration::from_millis(300)),
            (9_000, Duration::from_millis(100)),
        ],
        ..Faults::default()
    };
    let (outcome, _) = session(faults, settings());
    assert_complete(&outcome);
    assert_eq!(outcome.counts.maps_lost, 0);
    assert_eq!(outcome.counts.runs, 1);
}

#[test]
fn failed_line_is_reconnected() {
    let faults = Faults {
        dies_at: vec![5_000, 8_111],
        ..Faults::default()
    };
    let (outcome, _) = session(faults, settings());
    assert_complete(&outcome);
    assert_eq!(outcome.counts.reconnects, 2);
    assert_eq!(outcome.counts.maps_fetched_again, 0, "they were never lost");
}

#[test]
fn restarted_module_is_reconfigured() {
    for at in [4_321, 7_000, 9_500] {
        let faults = Faults {
            restarts_at: vec![at, at + 3_000],
            ..Faults::default()
        };
        let (outcome, _) = session(faults, settings());
        assert_complete(&outcome);
        assert!(outcome.counts.restarts >= 1, "{outcome:?}");
    }
}

#[test]
fn all_faults_together_still_deliver_every_map() {
    for seed in 20..23 {
        let faults = Faults {
            seed,
            bit_errors: 2e-5,
            cuts: 1e-4,
            dropped_pulses: 0.05,
            dies_at: vec![9_000],
            restarts_at: vec![15_000],
            stalls_at: vec![(7_000, Duration::from_millis(200))],
        };
        let settings = Settings {
            retries: 200,
            ..settings()
        };
        let (outcome, _) = session(faults, settings);
        assert_complete(&outcome);
    }
}

#[test]
fn new_session_takes_over_module_in_active_run() {
    struct Leave(u64);
    impl SessionObserver for Leave {
        fn update(&mut self, counts: &Counts) {
            self.0 = counts.maps_taken;
        }
        fn cancelled(&self) -> bool {
            self.0 >= 5
        }
    }
    let scene = scene();
    let recording = recorded(&scene);
    let mut module = Module::start(Manner::default());
    {
        let mut job = job(&scene, &recording, Encoding::Complex32);
        let (mut buffers, mut keep) = (Buffers::new(), Keep::default());
        let mut session =
            Session::open(&mut module, &mut buffers, settings(), &mut Silent).unwrap();
        let outcome = session.transfer(&mut job, &mut keep, &mut Leave(0));
        assert!(matches!(
            outcome.ending,
            TransferEnd::Failed(LinkError::Cancelled)
        ));
        assert!((5..MAPS).contains(&keep.0.len()), "{}", keep.0.len());
        assert_eq!(outcome.missing.len() + keep.0.len(), MAPS);
    }
    let mut job = job(&scene, &recording, Encoding::Complex32);
    let (mut buffers, mut keep) = (Buffers::new(), Keep::default());
    let mut session = Session::open(&mut module, &mut buffers, settings(), &mut Silent).unwrap();
    let outcome = session.transfer(&mut job, &mut keep, &mut Silent);
    assert_complete(&outcome);
    judge(&keep.0);
}

#[test]
fn fixed_rate_counts_pulses_without_room() {
    // Two maps take the module longer than the duration of four pulses.
    let manner = Manner {
        pause: Duration::from_micros(300),
        ..Manner::default()
    };
    let settings = Settings {
        rate_hz: Some(2000.0),
        ..settings()
    };
    let module = Module::behind(Faults::default(), manner);
    let (outcome, _) = session_with(module, settings);
    assert!(
        matches!(outcome.ending, TransferEnd::Incomplete),
        "{outcome:?}"
    );
    let counts = &outcome.counts;
    assert_eq!(counts.runs, 1);
    assert_eq!(counts.pulses_sent + counts.pulses_unsent, PULSES as u64);
    assert!(
        counts.module_pulses.dropped + counts.pulses_unsent > 0,
        "{counts}"
    );
    assert!(counts.maps_taken > 0);
}

#[test]
fn slow_fixed_rate_loses_no_pulse() {
    let settings = Settings {
        rate_hz: Some(100.0),
        ..settings()
    };
    let (outcome, _) = session(Faults::default(), settings);
    assert_complete(&outcome);
    // 46 pulses, 10 ms apart.
    assert!(outcome.counts.seconds > 0.44);
}

#[test]
fn dead_line_is_an_error() {
    let faults = Faults {
        dropped_pulses: 0.0,
        cuts: 1.0,
        ..Faults::default()
    };
    let mut module = Module::behind(faults, Manner::default());
    let mut buffers = Buffers::new();
    let settings = Settings {
        idle: Duration::from_millis(200),
        ..settings()
    };
    let error = Session::open(&mut module, &mut buffers, settings, &mut Silent).err();
    assert!(matches!(error, Some(LinkError::Silent)), "{error:?}");
}

#[test]
fn refusal_by_module_is_an_error() {
    let mut scene = scene();
    scene.patches[1].doppler_reach = 200;
    let recording = recorded(&scene);
    let mut job = job(&scene, &recording, Encoding::Complex32);
    let mut module = Module::start(Manner::default());
    let (mut buffers, mut keep) = (Buffers::new(), Keep::default());
    let mut session = Session::open(&mut module, &mut buffers, settings(), &mut Silent).unwrap();
    assert_eq!(session.identity().arithmetic, Arithmetic::Float);
    assert_eq!(session.identity().capacity.pulses, 8);
    let outcome = session.transfer(&mut job, &mut keep, &mut Silent);
    let TransferEnd::Failed(error) = outcome.ending else {
        panic!("{outcome:?}");
    };
    assert!(error.to_string().contains("Doppler"), "{error}");
    assert_eq!(outcome.missing.len(), MAPS);
}

#[test]
fn sixteen_bit_samples_use_reported_scale() {
    let scene = scene();
    let recording = recorded(&scene);
    let mut job = job(&scene, &recording, Encoding::Sc16);
    let scale = job.pulses.amplitude_scale();
    let parts = scene
        .samples
        .iter()
        .flatten()
        .flat_map(|z| [z.re.abs(), z.im.abs()]);
    let largest = parts.fold(0.0, f32::max);
    assert!((largest * scale * 32768.0 - 32766.0).abs() < 0.01);
    let mut module = Module::start(Manner::default());
    let (mut buffers, mut keep) = (Buffers::new(), Keep::default());
    let mut session = Session::open(&mut module, &mut buffers, settings(), &mut Silent).unwrap();
    let outcome = session.transfer(&mut job, &mut keep, &mut Silent);
    assert_complete(&outcome);
    assert_eq!(outcome.counts.samples_clamped, 0);
    // Rounding to 2^-15 of full scale; the echo's power there is about -20 dB of full scale, and the rounding noise is
    // 2^-15 / sqrt(6): -98 dB. Maps keep their ratio or improve it.
    let expected = expected(&scene);
    let (mut error, mut power) = (0.0, 0.0);
    for (key, (_, values)) in &keep.0 {
        for (value, expected) in values.iter().zip(&expected[key].1) {
            error += f64::from((value / scale - expected).norm_sqr());
            power += f64::from(expected.norm_sqr());
        }
    }
    let error_db = 10.0 * (error / power).log10();
    println!("error {error_db:.1} dB");
    assert!(error_db < -70.0, "{error_db}");
}

#[test]
fn maps_are_verified_against_the_core_on_the_host() {
    let scene = scene();
    let recording = recorded(&scene);
    // The module processes the scene; the host's core processes the scene, or one in which one bit of a pulse differs.
    for (changed, fixed) in [(false, false), (true, false), (false, true)] {
        let encoding = match fixed {
            true => Encoding::Sc16,
            false => Encoding::Complex32,
        };
        let mut other = recorded(&scene);
        if changed {
            let mut samples = scene.samples.concat();
            samples[16 * 5].re = f32::from_bits(samples[16 * 5].re.to_bits() ^ 0x0040_0000);
            other = InMemory::new(
                subaperture::phase_history::PhaseHistory::collection(&recording).clone(),
                samples,
            )
            .unwrap();
        }
        let core = HostCore::new(job(&scene, &other, encoding)).unwrap();
        let mut verified = Verified::new(Keep::default(), core);
        let mut job = job(&scene, &recording, encoding);
        let mut module = Module::start(Manner {
            fixed,
            ..Manner::default()
        });
        let mut buffers = Buffers::new();
        let mut session =
            Session::open(&mut module, &mut buffers, settings(), &mut Silent).unwrap();
        let outcome = session.transfer(&mut job, &mut verified, &mut Silent);
        assert_complete(&outcome);
        // Pulse 5 is in sub-CPI 1: two maps.
        let different = if changed { 2 } else { 0 };
        assert_eq!(verified.counts(), (MAPS as u64 - different, different));
        assert_eq!(verified.into_inner().0.len(), MAPS - different as usize);
    }
}
