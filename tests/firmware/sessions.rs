//! Sessions with the firmware under emulation over faulty lines, across resets and power loss: no wrong map is accepted, every loss is
//! counted, and results after a fault are correct.
//!
//! Maps are compared bit by bit with those of the core on this machine from the same pulses. The emulated serial line transfers 12 to 35 kB
//! per second; a run of all 46 pulses is 10 kB to the module and 25 kB back.

use std::io;
use std::time::Duration;

use crate::emulated::{Begin, Emulated, Wire, application};
use subaperture::module::link::{
    Buffers, Emulator, Firmware, HostCore, LinkError, Outcome, Session, Settings, TransferEnd,
    Transport, Verified,
};
use subaperture::monitor::Silent;
use subaperture_core::link::{Arithmetic, Encoding};
use subaperture_tests::faults::{Faults, FaultyLine};
use subaperture_tests::firmware::{Build, build};
use subaperture_tests::link_scene::{
    CHIPS, COHERENT, Keep, Kept, MAPS, PULSES, image_scene, job, judge, judge_image, recorded,
    scene,
};

pub(crate) fn settings(retries: u32) -> Settings {
    Settings {
        answer: Duration::from_millis(200),
        idle: Duration::from_secs(5),
        retries,
        first_number: 77,
        ..Settings::default()
    }
}

/// The float application behind a faulty line.
fn module(wire: Wire, begin: Begin, faults: Faults) -> FaultyLine<Emulated> {
    FaultyLine::new(Emulated::connected(&application()[0], wire, begin), faults)
}

/// Run the scene on the module; asserts that every accepted map is correct and every loss counted.
pub(crate) fn session(module: &mut dyn Transport, settings: Settings) -> (Outcome, Kept) {
    let scene = scene();
    let recording = recorded(&scene);
    let mut work = job(&scene, &recording, Encoding::Complex32);
    let (mut buffers, mut keep) = (Buffers::new(), Keep::default());
    let mut session = Session::open(module, &mut buffers, settings, &mut Silent).unwrap();
    let outcome = session.transfer(&mut work, &mut keep, &mut Silent);
    println!("{}", outcome.counts);
    judge(&keep.0);
    account(&outcome, &keep.0);
    (outcome, keep.0)
}

/// Assert that every map and every pulse is in one of the counts.
fn account(outcome: &Outcome, kept: &Kept) {
    let counts = &outcome.counts;
    assert_eq!(counts.maps_wanted, MAPS as u64);
    assert_eq!(counts.maps_taken, kept.len() as u64);
    assert_eq!(outcome.missing.len() + kept.len(), MAPS);
    assert!(outcome.missing.iter().all(|key| !kept.contains_key(key)));
    let broken = counts.restarts + counts.reconnects > 0;
    if broken || matches!(outcome.ending, TransferEnd::Failed(_)) {
        // Counts of an interrupted run are lost with the module.
        return;
    }
    // Every pulse number of a run has one of four outcomes; a pulse that was not sent never arrived.
    let module = &counts.module_pulses;
    let ends = module.accepted + module.lost + module.refused + module.dropped;
    let sent = counts.pulses_sent - counts.pulses_resent;
    assert_eq!(sent + counts.pulses_unsent, ends, "{counts}");
    let made = counts.maps_taken + counts.maps_repeated + counts.maps_lost;
    if counts.runs == 1 && counts.maps_refused == 0 {
        // Stored pulses are in maps, except for one to three pulses of every abandoned sub-CPI. Sub-CPIs have four pulses, the last one
        // two.
        assert_eq!(made % 2, 0, "both patches of each");
        let given_up = module.sub_cpis_incomplete;
        let stored = (2 * made + given_up).saturating_sub(2)..=2 * made + 3 * given_up;
        assert!(stored.contains(&module.accepted), "{counts}");
    }
}

#[track_caller]
pub(crate) fn complete(outcome: &Outcome) {
    assert!(
        matches!(outcome.ending, TransferEnd::Complete),
        "{outcome:?}"
    );
}

/// Whether the sub-CPI after one with a missing map is complete.
fn next_is_there(outcome: &Outcome, kept: &Kept) -> bool {
    let mut missing = outcome.missing.iter();
    missing.any(|key| (0..2).all(|patch| kept.contains_key(&(key.0 + 1, patch))))
}

#[test]
fn clean_line_delivers_all_maps_in_one_run() {
    let mut module = module(Wire::Tcp, Begin::Reset, Faults::default());
    let (outcome, _) = session(&mut module, settings(0));
    complete(&outcome);
    let counts = &outcome.counts;
    assert_eq!((counts.runs, counts.maps_lost), (1, 0));
    assert_eq!(counts.module_pulses.accepted, PULSES as u64);
    for frames in [counts.frames_to_module, counts.frames_from_module] {
        assert_eq!((frames.damaged, frames.lost, frames.repeated), (0, 0, 0));
    }
}

#[test]
fn fixed_point_maps_over_bad_line_equal_those_of_core() {
    let faults = Faults {
        seed: 1,
        bit_errors: 2e-5,
        dropped_pulses: 0.02,
        ..Faults::default()
    };
    let scene = scene();
    let recording = recorded(&scene);
    let emulated = Emulated::connected(&application()[1], Wire::Tcp, Begin::Reset);
    let mut module = FaultyLine::new(emulated, faults);
    let mut buffers = Buffers::new();
    let mut session = Session::open(&mut module, &mut buffers, settings(100), &mut Silent).unwrap();
    assert_eq!(session.identity().arithmetic, Arithmetic::Fixed);
    let core = HostCore::new(job(&scene, &recording, Encoding::Sc16)).unwrap();
    let mut verified = Verified::new(Keep::default(), core);
    let mut work = job(&scene, &recording, Encoding::Sc16);
    let outcome = session.transfer(&mut work, &mut verified, &mut Silent);
    println!("{}", outcome.counts);
    complete(&outcome);
    assert_eq!(verified.counts(), (MAPS as u64, 0));
    account(&outcome, &verified.into_inner().0);
}

#[test]
fn bit_errors_only_cost_time() {
    for (seed, bit_errors) in [(2, 1e-5), (3, 1e-4)] {
        let faults = Faults {
            seed,
            bit_errors,
            ..Faults::default()
        };
        let mut module = module(Wire::Tcp, Begin::Reset, faults);
        let (outcome, _) = session(&mut module, settings(1000));
        complete(&outcome);
        if bit_errors > 5e-5 {
            // 8 wrong bits to the module and 20 back in the first run alone.
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
    let mut module = module(Wire::Tcp, Begin::Reset, faults);
    // A pulse arrives with a probability of 0.2, four in a row with 0.001.
    let (outcome, _) = session(&mut module, settings(0));
    assert!(
        !matches!(outcome.ending, TransferEnd::Complete),
        "{outcome:?}"
    );
    assert!(outcome.counts.frames_from_module.damaged > 0);
    assert!(outcome.counts.frames_to_module.damaged > 0);
    // The module is unaffected.
    let mut module = module_after(module);
    let (outcome, _) = session(&mut module, settings(0));
    complete(&outcome);
}

/// The same module with a repaired line.
fn module_after(module: FaultyLine<Emulated>) -> FaultyLine<Emulated> {
    FaultyLine::new(module.into_device(), Faults::default())
}

#[test]
fn lost_pulses_are_counted_and_sent_again() {
    let faults = Faults {
        seed: 5,
        dropped_pulses: 0.05,
        ..Faults::default()
    };
    let mut module = module(Wire::Tcp, Begin::Reset, faults);
    let (outcome, kept) = session(&mut module, settings(0));
    assert!(
        matches!(outcome.ending, TransferEnd::Incomplete),
        "{outcome:?}"
    );
    let counts = &outcome.counts;
    assert!(counts.module_pulses.lost > 0);
    assert_eq!(counts.maps_lost, 0, "only pulses are lost");
    assert!(next_is_there(&outcome, &kept), "{:?}", outcome.missing);

    let (outcome, _) = session(&mut module, settings(100));
    complete(&outcome);
    assert!(outcome.counts.maps_fetched_again > 0);
}

#[test]
fn truncated_frames_are_lost_and_their_maps_repeated() {
    let faults = Faults {
        seed: 6,
        cuts: 3e-4,
        ..Faults::default()
    };
    let mut module = module(Wire::Tcp, Begin::Reset, faults);
    let (outcome, kept) = session(&mut module, settings(0));
    assert!(
        matches!(outcome.ending, TransferEnd::Incomplete),
        "{outcome:?}"
    );
    assert!(next_is_there(&outcome, &kept), "{:?}", outcome.missing);
    let (outcome, _) = session(&mut module, settings(100));
    complete(&outcome);
}

/// Without reports of the module the host sends as much as the module has room for, and then waits.
#[test]
fn host_that_stops_reading_for_seconds_loses_no_map() {
    let faults = Faults {
        stalls_at: vec![(4_000, Duration::from_secs(2))],
        ..Faults::default()
    };
    let mut module = module(Wire::Terminal, Begin::Reset, faults);
    let (outcome, _) = session(&mut module, settings(0));
    complete(&outcome);
    assert!(outcome.counts.seconds > 2.0);
    assert_eq!((outcome.counts.maps_lost, outcome.counts.runs), (0, 1));
}

/// At the radar's rate no pulse is repeated: losses remain and are reported. (Pulses without room need a module slower than its line, see
/// `tests/link/session.rs`; the emulated line makes its sender wait.)
#[test]
fn losses_at_full_rate_are_counted() {
    let faults = Faults {
        seed: 7,
        dropped_pulses: 0.05,
        stalls_at: vec![(2_000, Duration::from_secs(1))],
        ..Faults::default()
    };
    let mut module = module(Wire::Tcp, Begin::Reset, faults);
    let at_a_rate = Settings {
        rate_hz: Some(40.0),
        ..settings(100)
    };
    let (outcome, kept) = session(&mut module, at_a_rate);
    assert!(
        matches!(outcome.ending, TransferEnd::Incomplete),
        "{outcome:?}"
    );
    let counts = &outcome.counts;
    assert_eq!(counts.pulses_sent + counts.pulses_unsent, PULSES as u64);
    assert!(counts.module_pulses.lost > 0, "{counts}");
    assert_eq!((counts.runs, counts.maps_lost), (1, 0));
    assert!(next_is_there(&outcome, &kept), "{:?}", outcome.missing);
}

/// A host that disappears at once, without a message to the module.
struct DeafHost<'a>(&'a mut FaultyLine<Emulated>);

impl Transport for DeafHost<'_> {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> io::Result<usize> {
        self.0.read(buffer, wait)
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write(bytes)
    }

    fn reconnect(&mut self) -> io::Result<()> {
        Err(io::ErrorKind::ConnectionRefused.into())
    }
}

#[test]
fn module_serves_next_host_after_host_disappears() {
    let faults = Faults {
        dies_at: vec![4_000, 8_000],
        ..Faults::default()
    };
    let mut module = module(Wire::Tcp, Begin::Reset, faults);
    let (outcome, _) = session(&mut DeafHost(&mut module), settings(0));
    assert!(
        matches!(outcome.ending, TransferEnd::Failed(LinkError::Line(_))),
        "{outcome:?}"
    );
    // In the middle of a run, and the line fails once more.
    module.reconnect().unwrap();
    let next = Settings {
        first_number: 1000,
        ..settings(3)
    };
    let (outcome, _) = session(&mut module, next);
    complete(&outcome);
    assert_eq!(outcome.counts.reconnects, 1);
}

#[test]
fn power_loss_costs_only_current_run() {
    let faults = Faults {
        restarts_at: vec![4_321, 9_000],
        ..Faults::default()
    };
    let mut module = module(Wire::Tcp, Begin::Power, faults);
    let (outcome, _) = session(&mut module, settings(3));
    complete(&outcome);
    assert!(outcome.counts.reconnects >= 1, "{outcome:?}");
}

#[test]
fn reset_during_run_is_detected_and_repaired() {
    let faults = Faults {
        restarts_at: vec![4_321, 9_000],
        ..Faults::default()
    };
    let mut module = module(Wire::Tcp, Begin::Reset, faults);
    let (outcome, _) = session(&mut module, settings(3));
    complete(&outcome);
    assert!(outcome.counts.restarts >= 1, "{outcome:?}");
    assert_eq!(outcome.counts.reconnects, 0, "the line stayed");
}

#[test]
fn all_faults_together_still_deliver_every_map() {
    let faults = Faults {
        seed: 20,
        bit_errors: 2e-5,
        cuts: 1e-4,
        dropped_pulses: 0.03,
        dies_at: vec![7_000],
        restarts_at: vec![11_000],
        stalls_at: vec![(5_000, Duration::from_secs(1))],
    };
    let mut module = module(Wire::Tcp, Begin::Power, faults);
    let (outcome, _) = session(&mut module, settings(200));
    complete(&outcome);
}

/// Let the module accumulate the image of the scene; asserts that every received pixel is correct and the image complete.
fn image(faults: Faults, begin: Begin, retries: u32) -> Outcome {
    let scene = image_scene();
    let recording = recorded(&scene);
    let mut work = job(&scene, &recording, Encoding::Complex32);
    let mut module = module(Wire::Tcp, begin, faults);
    let mut buffers = Buffers::new();
    let mut session =
        Session::open(&mut module, &mut buffers, settings(retries), &mut Silent).unwrap();
    let (outcome, image) = session.accumulate(&mut work, COHERENT, &mut Silent);
    println!("{}", outcome.counts);
    judge_image(&image);
    complete(&outcome);
    assert_eq!(image.sub_cpis.len(), MAPS / CHIPS.len());
    assert!(image.chips.iter().all(Option::is_some));
    outcome
}

#[test]
fn image_survives_bit_errors_and_failures_of_the_line() {
    let faults = Faults {
        seed: 31,
        bit_errors: 5e-5,
        dies_at: vec![4_000, 8_000],
        ..Faults::default()
    };
    let outcome = image(faults, Begin::Reset, 200);
    assert_eq!(outcome.counts.restarts, 0, "{outcome:?}");
    assert!(outcome.counts.reconnects >= 2, "{outcome:?}");
}

#[test]
fn image_is_accumulated_again_after_a_reset_and_a_power_loss() {
    for begin in [Begin::Reset, Begin::Power] {
        let faults = Faults {
            restarts_at: vec![6_000],
            ..Faults::default()
        };
        let outcome = image(faults, begin, 3);
        assert!(
            outcome.counts.restarts + outcome.counts.reconnects >= 1,
            "{outcome:?}"
        );
    }
}

/// A self-test ends the emulator by semihosting, as a program could also use it to read a file or start a program. In an emulator started
/// by `subap link` semihosting is off.
#[test]
fn firmware_cannot_reach_the_host() {
    let elf = build(&Build::bin("selftest", ""));
    let mut line = Emulator::start(Firmware::Float, Some(&elf), false).unwrap();
    // The self-test would end within a fraction of a second.
    std::thread::sleep(Duration::from_secs(3));
    let read = line.read(&mut [0; 64], Duration::ZERO);
    assert_eq!(read.expect("the emulator still runs"), 0);
}
