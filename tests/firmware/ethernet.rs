//! Link of the emulated board over its Ethernet controller: bytes in both directions, maps and images, and lost connections.
//!
//! The emulator's user network forwards a TCP port of this machine to the module. It isolates the module from any other address.

use std::io::Write;
use std::net::TcpStream;
use std::time::{Duration, Instant};

use subaperture::module::link::{
    Buffers, ModuleAddress, ProfileRun, Session, Settings, SweepBurst, SweepSource,
};
use subaperture::monitor::Silent;
use subaperture::phase_history::ReadError;
use subaperture_core::link::Encoding;
use subaperture_tests::faults::{Faults, FaultyLine};
use subaperture_tests::firmware::{Build, TIME_LIMIT, build};
use subaperture_tests::link_scene::{COHERENT, MAPS, image_scene, job, judge_image, recorded};
use subaperture_tests::sweep_scene::SweepScene;

use crate::emulated::{Begin, Emulated, Wire};
use crate::serial_line::{echo, noise};
use crate::sessions::{complete, session, settings};

fn module(faults: Faults) -> FaultyLine<Emulated> {
    let elf = build(&Build::bin("application", "ethernet"));
    let mut emulated = Emulated::connected(&elf, Wire::Ethernet, Begin::Reset);
    // The emulator accepts connections before the module has started, and repeats them to it more and more rarely.
    let patient = Settings {
        idle: Duration::from_secs(60),
        ..settings(0)
    };
    Session::open(&mut emulated, &mut Buffers::new(), patient, &mut Silent).unwrap();
    FaultyLine::new(emulated, faults)
}

#[test]
fn maps_over_ethernet_equal_those_of_core() {
    let mut module = module(Faults::default());
    let (outcome, kept) = session(&mut module, settings(0));
    complete(&outcome);
    assert_eq!((kept.len(), outcome.counts.runs), (MAPS, 1));
    assert_eq!(outcome.counts.reconnects, 0);
}

/// The host opens a new connection while the module still serves the previous one.
#[test]
fn run_recovers_from_connections_cut_in_its_middle() {
    let faults = Faults {
        dies_at: vec![4_000, 8_000],
        ..Faults::default()
    };
    let mut module = module(faults);
    let (outcome, kept) = session(&mut module, settings(3));
    complete(&outcome);
    assert_eq!(kept.len(), MAPS);
    assert_eq!(outcome.counts.reconnects, 2, "{outcome:?}");
    assert_eq!(outcome.counts.restarts, 0, "{outcome:?}");
}

#[test]
fn image_over_ethernet_equals_that_of_core_after_a_cut() {
    let scene = image_scene();
    let recording = recorded(&scene);
    let mut work = job(&scene, &recording, Encoding::Complex32);
    let faults = Faults {
        dies_at: vec![6_000],
        ..Faults::default()
    };
    let mut module = module(faults);
    let mut buffers = Buffers::new();
    let mut session = Session::open(&mut module, &mut buffers, settings(3), &mut Silent).unwrap();
    let (outcome, image) = session.accumulate(&mut work, COHERENT, &mut Silent);
    println!("{}", outcome.counts);
    complete(&outcome);
    judge_image(&image);
    assert!(image.chips.iter().all(Option::is_some));
    assert_eq!(outcome.counts.reconnects, 1, "{outcome:?}");
}

/// The module restarts while its connection stays open: it answers the next bytes with a reset of the connection.
#[test]
fn run_recovers_from_a_reset_of_the_module() {
    let faults = Faults {
        restarts_at: vec![4_321],
        ..Faults::default()
    };
    let mut module = module(faults);
    let (outcome, kept) = session(&mut module, settings(3));
    complete(&outcome);
    assert_eq!(kept.len(), MAPS);
    let counts = &outcome.counts;
    assert!(counts.restarts + counts.reconnects >= 1, "{outcome:?}");
}

/// Bursts of a scene, computed before the run, so that the run takes the time of module and link.
struct Computed(Vec<Vec<SweepBurst>>);

impl SweepSource for Computed {
    fn has(&mut self, sweep: u32) -> Result<bool, ReadError> {
        Ok((sweep as usize) < self.0.len())
    }

    fn burst(
        &mut self,
        sweep: u32,
        index: usize,
        burst: &mut SweepBurst,
    ) -> Result<bool, ReadError> {
        let own = self.0[sweep as usize].get(index);
        if let Some(own) = own {
            burst.clone_from(own);
        }
        Ok(own.is_some())
    }
}

/// Four sweeps of 64 carriers have as many bytes as one of 256.
#[test]
fn profiles_over_ethernet_equal_those_of_core() {
    let mut scene = SweepScene::new(64, 512, 128);
    scene.sweeps = 4;
    let mut module = module(Faults::default());
    let mut buffers = Buffers::new();
    let mut session = Session::open(&mut module, &mut buffers, settings(0), &mut Silent).unwrap();
    let weights = scene.weights();
    let mut source = Computed((0..4).map(|sweep| scene.bursts(sweep)).collect());
    let mut run = ProfileRun {
        setup: scene.setup,
        weights: &weights,
        source: &mut source,
    };
    let mut profiles = Vec::new();
    let outcome = session.profiles(&mut run, &mut |profile| profiles.push(profile), &mut Silent);
    outcome.ending.unwrap();
    println!("{}", session.counts());
    assert_eq!(profiles.len(), 4);
    for profile in &profiles {
        let (values, usable, _) = scene.profile(profile.sweep);
        assert_eq!((profile.usable, profile.missing), (usable, 0));
        assert_eq!(profile.values, values);
    }
}

/// The module's echo of a TCP stream.
struct Echo {
    emulated: Emulated,
    stream: TcpStream,
}

/// Connect to the address of a module.
fn connect(emulated: &Emulated) -> TcpStream {
    let ModuleAddress::Tcp { host, port } = emulated.place() else {
        panic!("not a TCP address: {}", emulated.place());
    };
    let stream = TcpStream::connect((host.as_str(), *port)).unwrap();
    stream.set_nodelay(true).unwrap();
    stream.set_read_timeout(Some(TIME_LIMIT)).unwrap();
    stream
}

impl Echo {
    fn start() -> Self {
        let elf = build(&Build::example("echo", "ethernet"));
        let emulated = Emulated::start(&elf, Wire::Ethernet, Begin::Reset);
        let stream = connect(&emulated);
        Self { emulated, stream }
    }
}

#[test]
fn echoed_bytes_are_unchanged() {
    let mut module = Echo::start();
    // The first bytes wait for the start of the module.
    echo(&mut module.stream, 1);
    let rate = echo(&mut module.stream, 4_000_000);
    println!("Ethernet: {rate:.0} bytes a second in each direction at the same time");
    let started = Instant::now();
    for _ in 0..100 {
        echo(&mut module.stream, 64);
    }
    let trip_us = started.elapsed().as_micros() / 100;
    println!("Ethernet: {trip_us} us for 64 bytes there and back");
}

#[test]
fn new_connection_receives_no_byte_of_the_previous_one() {
    let mut module = Echo::start();
    echo(&mut module.stream, 1000);
    for _ in 0..3 {
        // Some of these bytes are unread when the connection closes.
        module.stream.write_all(&noise(20_000)).unwrap();
        // A connection that arrives before the end of the previous one replaces it.
        let next = connect(&module.emulated);
        drop(std::mem::replace(&mut module.stream, next));
        echo(&mut module.stream, 1000);
    }
}
