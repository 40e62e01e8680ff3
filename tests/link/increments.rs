//! Motion increments from a module over lossy lines: each is bit-identical to the core's, and none is missing unless
//! reported.
//!
//! The module is the firmware's own endpoint in a thread of this process; the reference is the core run on the same samples.

use std::io;
use std::time::Duration;

use subaperture::module::link::{
    Buffers, Counts, Increment, LinkError, Mismatch, MotionRun, Odometer, Session, Settings,
    Transport,
};
use subaperture::monitor::Silent;
use subaperture::phase_history::PhaseHistory;
use subaperture_core::Sc16;
use subaperture_core::link::{Refusal, write_sc16s};
use subaperture_core::motion;
use subaperture_tests::faults::{Faults, FaultyLine};
use subaperture_tests::front_end::{Port, framed};
use subaperture_tests::module::{Manner, Module};
use subaperture_tests::odometer_scene::{Scene, setup};

const PULSES: usize = 30;

fn settings() -> Settings {
    Settings {
        answer: Duration::from_millis(30),
        idle: Duration::from_secs(5),
        first_number: 40,
        ..Settings::default()
    }
}

/// Result of a motion run on `scene` by a module behind a faulty line.
fn over(faults: Faults, scene: &Scene, setup: motion::Setup, settings: Settings) -> Odometer {
    let recorded = scene.recorded(PULSES);
    let channels: Vec<&dyn PhaseHistory> = recorded.iter().map(|own| own as _).collect();
    let mut line: FaultyLine<Module> = Module::behind(faults, Manner::default());
    let mut buffers = Buffers::new();
    let mut session = Session::open(&mut line, &mut buffers, settings, &mut Silent).unwrap();
    let task = MotionRun {
        setup,
        ..scene.motion_run(&channels, false)
    };
    session.increments(&task, &mut Silent)
}

fn expected(scene: &Scene) -> Vec<Increment> {
    scene.increments(PULSES)
}

fn scene() -> Scene {
    let mut scene = Scene::new(2).with_snr_db(30.0, 9);
    scene.reference_path_m = 6.2;
    scene
}

#[test]
fn clean_line_delivers_every_increment() {
    let reported = over(Faults::default(), &scene(), setup(), settings());
    reported.ending.unwrap();
    assert_eq!(reported.increments, expected(&scene()));
    assert_eq!((reported.unreadable, reported.again), (0, 0));
}

/// Frames are lost in both directions and repeated until they arrive.
#[test]
fn lossy_line_delivers_same_increments() {
    let expected = expected(&scene());
    let faults = Faults {
        seed: 2,
        bit_errors: 2e-5,
        dropped_pulses: 0.05,
        ..Faults::default()
    };
    let reported = over(faults, &scene(), setup(), settings());
    reported.ending.unwrap();
    assert_eq!(reported.increments, expected);
    println!("{} pulses sent again", reported.again);
    assert!(reported.again > 0);
}

/// A module that restarts has lost its targets: this is reported, and earlier increments are valid.
#[test]
fn module_restart_is_reported() {
    let faults = Faults {
        // In the middle of the pulses, which have 1100 bytes each.
        restarts_at: vec![12_000],
        ..Faults::default()
    };
    let reported = over(faults, &scene(), setup(), settings());
    let at = reported.increments.len();
    assert!(
        matches!(reported.ending, Err(LinkError::BeganAnew(pulse)) if pulse as usize == at),
        "{:?}",
        reported.ending
    );
    assert!((5..20).contains(&at), "{at}");
    assert_eq!(reported.increments, expected(&scene())[..at]);
}

#[test]
fn invalid_motion_input_is_rejected() {
    let refused = |scene: &Scene, setup: motion::Setup| {
        let reported = over(Faults::default(), scene, setup, settings());
        assert_eq!(reported.increments, []);
        match reported.ending {
            Err(LinkError::Refused(refusal)) => refusal,
            other => panic!("{other:?}"),
        }
    };
    // Rejected by the module,
    let ranges_m = [5.0, 2.0];
    let wrong = motion::Setup {
        ranges_m,
        ..setup()
    };
    let error = motion::SetupError::Ranges;
    assert_eq!(refused(&scene(), wrong), Refusal::Motion(error));
    let error = motion::SetupError::Channels { most: 4 };
    assert_eq!(refused(&Scene::new(5), setup()), Refusal::Motion(error));
    // and rejected by the host before the module is asked.
    let mismatch = |scene: &Scene, setup: motion::Setup, receivers_m: &[[f64; 2]]| {
        let recorded = scene.recorded(3);
        let channels: Vec<&dyn PhaseHistory> = recorded.iter().map(|own| own as _).collect();
        let task = MotionRun {
            setup,
            receivers_m,
            ..scene.motion_run(&channels, false)
        };
        match task.check() {
            Err(LinkError::Mismatch(mismatch)) => mismatch,
            other => panic!("{other:?}"),
        }
    };
    let receivers_m = scene().receivers_m;
    let num_frequencies = 32;
    let short = motion::Setup {
        num_frequencies,
        ..setup()
    };
    let length = Mismatch::Samples {
        channel: 0,
        samples: 64,
        frequencies: 32,
    };
    assert_eq!(mismatch(&scene(), short, &receivers_m), length);
    let start_hz = 76e9;
    let other = motion::Setup {
        start_hz,
        ..setup()
    };
    let band = Mismatch::Band {
        channel: 0,
        pulse: 0,
    };
    assert_eq!(mismatch(&scene(), other, &receivers_m), band);
    let channels = Mismatch::Channels {
        transmitters: 1,
        receivers: 1,
        channels: 2,
    };
    assert_eq!(mismatch(&scene(), setup(), &receivers_m[..1]), channels);
    let many = mismatch(&scene(), setup(), &[[0.0; 2]; 11]);
    assert_eq!(many, Mismatch::Antennas(12));
    let text = LinkError::from(many).to_string();
    assert_eq!(
        text,
        "antennas: expected at most 11, found 12: leave some out"
    );
}

/// Module that answers until pulses arrive, and then uses another protocol version.
struct Updated {
    module: Module,
    written: usize,
}

impl Transport for Updated {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> io::Result<usize> {
        let count = self.module.read(buffer, wait)?;
        if self.written < 3000 {
            return Ok(count);
        }
        // Version 4, number 300, no message: bytes with their checksum, stuffed by hand, without other zeros.
        let body = [4, 44, 1, 1, 1];
        let crc = crc32fast::hash(&body).to_le_bytes();
        assert!(!crc.contains(&0));
        let frame = [&[0, 10], &body[..], &crc, &[0]].concat();
        buffer[..frame.len()].copy_from_slice(&frame);
        Ok(frame.len())
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = self.module.write(bytes)?;
        self.written += count;
        Ok(count)
    }

    fn reconnect(&mut self) -> io::Result<()> {
        self.module.reconnect()
    }
}

#[test]
fn protocol_version_change_is_reported_and_work_counted() {
    let scene = scene();
    let recorded = scene.recorded(PULSES);
    let channels: Vec<&dyn PhaseHistory> = recorded.iter().map(|own| own as _).collect();
    let task = scene.motion_run(&channels, false);
    let mut updated = Updated {
        module: Module::start(Manner::default()),
        written: 0,
    };
    let mut buffers = Buffers::new();
    let mut session = Session::open(&mut updated, &mut buffers, settings(), &mut Silent).unwrap();
    let reported = session.increments(&task, &mut Silent);
    assert!(
        matches!(reported.ending, Err(LinkError::Version(4))),
        "{:?}",
        reported.ending
    );
    let mut module = Module::start(Manner::default());
    let mut session = Session::open(&mut module, &mut buffers, settings(), &mut Silent).unwrap();
    session.increments(&task, &mut Silent).ending.unwrap();
    let counts = session.counts();
    let pulses = PULSES as u64;
    assert_eq!((counts.pulses, counts.pulses_sent), (pulses, pulses));
    assert_eq!((counts.runs, counts.module_pulses.accepted), (1, pulses));
    // The channels of all pulses, and a few requests.
    assert!(counts.frames_to_module.taken >= 2 * pulses, "{counts:?}");
}

fn short_scene() -> Scene {
    Scene {
        short: true,
        reference_path_m: 0.0,
        ..scene()
    }
}

/// Result of a motion run on the short scene, with samples from `frames` of the front end or over the link.
fn by_module(fixed: bool, frames: Option<Vec<Vec<u8>>>, settings: Settings) -> (Odometer, Counts) {
    let scene = short_scene();
    let recorded = scene.recorded(PULSES);
    let channels: Vec<&dyn PhaseHistory> = recorded.iter().map(|own| own as _).collect();
    let manner = Manner {
        fixed,
        ..Manner::default()
    };
    let from_front_end = frames.is_some();
    let mut module = match frames {
        Some(frames) => Module::with_front_end(manner, Port::with(frames.concat())),
        None => Module::start(manner),
    };
    let mut buffers = Buffers::new();
    let mut session = Session::open(&mut module, &mut buffers, settings, &mut Silent).unwrap();
    let task = scene.motion_run(&channels, from_front_end);
    let reported = session.increments(&task, &mut Silent);
    (reported, session.counts())
}

/// To a module in fixed point samples are sent in 16 bits, half as many bytes. These are exact in 16 bits.
#[test]
fn increments_of_16_bit_samples_equal_those_of_core() {
    let (float, of_float) = by_module(false, None, settings());
    let (fixed, of_fixed) = by_module(true, None, settings());
    assert_eq!(float.increments, expected(&short_scene()));
    assert_eq!(fixed.increments, float.increments);
    let [long, short] = [of_float, of_fixed].map(|counts| counts.bytes_to_module);
    assert!(short < long * 55 / 100, "{short} of {long} bytes");
}

/// Frames of the front end, one per channel of a pulse.
fn frames() -> Vec<Vec<u8>> {
    let scene = short_scene();
    let channels = (0..PULSES).flat_map(|n| scene.pulse(n));
    let frames = (0..).zip(channels).map(|(number, samples)| {
        let narrow: Vec<Sc16> = samples.iter().map(|z| Sc16::from_complex32(*z).0).collect();
        let mut bytes = vec![0; 4 * narrow.len()];
        framed(number, write_sc16s(&narrow, &mut bytes).unwrap())
    });
    frames.collect()
}

#[test]
fn increments_of_front_end_samples_equal_those_of_core() {
    for fixed in [false, true] {
        let (reported, counts) = by_module(fixed, Some(frames()), settings());
        reported.ending.unwrap();
        assert_eq!(reported.increments, expected(&short_scene()));
        assert_eq!(counts.module_pulses.accepted, PULSES as u64);
        assert!(counts.bytes_to_module < 1000, "{counts}");
    }
}

/// A lost channel costs its pulse: the next increment is relative to the pulse before.
#[test]
fn lost_frame_of_front_end_costs_its_pulse() {
    let mut some = frames();
    some.remove(2 * 12 + 1);
    let (reported, counts) = by_module(false, Some(some), settings());
    reported.ending.unwrap();
    let pulses: Vec<u32> = reported.increments.iter().map(|own| own.pulse).collect();
    let all_but_one = (0..PULSES as u32).filter(|pulse| *pulse != 12);
    assert!(pulses.into_iter().eq(all_but_one));
    assert_eq!(reported.increments[12].since, 11);
    assert_eq!(counts.module_pulses.lost, 1);
    // Before the gap all are equal.
    assert_eq!(reported.increments[..12], expected(&short_scene())[..12]);
}

#[test]
fn front_end_that_ends_early_leaves_its_increments() {
    let short_idle = Settings {
        idle: Duration::from_millis(500),
        ..settings()
    };
    let mut some = frames();
    some.truncate(2 * 20);
    let (reported, _) = by_module(false, Some(some), short_idle);
    reported.ending.unwrap();
    assert_eq!(reported.increments, expected(&short_scene())[..20]);
    let (reported, _) = by_module(false, Some(Vec::new()), short_idle);
    assert!(
        matches!(reported.ending, Err(LinkError::Stuck(_))),
        "{:?}",
        reported.ending
    );
}

#[test]
fn module_without_front_end_refuses_increments_of_it() {
    let scene = short_scene();
    let recorded = scene.recorded(PULSES);
    let channels: Vec<&dyn PhaseHistory> = recorded.iter().map(|own| own as _).collect();
    let task = scene.motion_run(&channels, true);
    let mut module = Module::start(Manner::default());
    let mut buffers = Buffers::new();
    let mut session = Session::open(&mut module, &mut buffers, settings(), &mut Silent).unwrap();
    let ending = session.increments(&task, &mut Silent).ending;
    assert!(
        matches!(ending, Err(LinkError::Refused(Refusal::Unsupported))),
        "{ending:?}"
    );
}
