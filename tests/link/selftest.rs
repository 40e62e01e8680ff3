//! Self-test of a module: the firmware's endpoint in a thread of this process passes, and a wrong value, a bad line and a
//! silent module fail.

use std::collections::VecDeque;
use std::io;
use std::time::Duration;

use subaperture::io::selftest::{Check, Report, Verdict};
use subaperture::module::link::{Buffers, Session, Settings, Transport};
use subaperture::module::selftest::{Tested, run};
use subaperture::monitor::Silent;
use subaperture_core::link::{
    Encoder, Receiver, Report as Message, max_frame_bytes, max_received_bytes,
};
use subaperture_tests::faults::{Faults, FaultyLine};
use subaperture_tests::module::{Manner, Module};

fn tested(line: &mut dyn Transport) -> Report<Tested> {
    let settings = Settings {
        answer: Duration::from_millis(50),
        idle: Duration::from_secs(5),
        retries: 100,
        first_number: 7,
        ..Settings::default()
    };
    let mut buffers = Buffers::new();
    let mut session = Session::open(line, &mut buffers, settings, &mut Silent).unwrap();
    let address = "tcp://127.0.0.1:4000".parse().unwrap();
    let report = run(&mut session, &address, String::new(), &mut Silent).unwrap();
    for check in &report.checks {
        println!("{check:?}");
    }
    report
}

fn check<'a>(report: &'a Report<Tested>, name: &str) -> &'a Check {
    let mut all = report.checks.iter();
    all.find(|check| check.name == name).expect("a known check")
}

fn failed(report: &Report<Tested>) -> Vec<&str> {
    let failed = report.checks.iter();
    let failed = failed.filter(|check| check.verdict == Verdict::Failed);
    failed.map(|check| check.name.as_str()).collect()
}

/// Twelve maps; chips of 30 and 12 pixels; twelve pulses; 64 bins.
#[test]
fn module_in_either_arithmetic_passes() {
    for fixed in [false, true] {
        let manner = Manner {
            fixed,
            ..Manner::default()
        };
        let report = tested(&mut Module::start(manner));
        assert!(report.passed, "{:?}", failed(&report));
        assert_eq!(report.about.emulated, None);
        assert_eq!(
            report.about.arithmetic,
            if fixed { "fixed" } else { "float" }
        );
        for (name, count) in [
            ("maps", 12),
            ("image", 42),
            ("increments", 12),
            ("range profiles", 64),
        ] {
            let note = &check(&report, name).note;
            assert_eq!(note, &format!("{count} compared"), "{name}");
        }
        let found = &check(&report, "detections").note;
        assert_ne!(found, "0 compared");
    }
}

/// Maps, images and increments are repeated until they are complete. A sweep is sent three times at most.
#[test]
fn bad_line_fails_the_checks_of_frames_and_keeps_products_correct() {
    let faults = Faults {
        seed: 3,
        bit_errors: 4e-5,
        ..Faults::default()
    };
    let mut line = Module::behind(faults, Manner::default());
    let report = tested(&mut line);
    let failed = failed(&report);
    assert!(failed.contains(&"frames from the module") && failed.contains(&"frames to the module"));
    for product in ["maps", "image", "detections", "increments"] {
        assert!(!failed.contains(&product), "{failed:?}");
    }
    let profiles = check(&report, "range profiles");
    assert_eq!(
        profiles.verdict == Verdict::Failed,
        profiles.note.contains("samples were lost on the line"),
        "{profiles:?}"
    );
}

/// A line that ends each increment's rotation in the other bit.
struct Altered {
    module: Module,
    receiver: Receiver<'static>,
    encoder: Encoder,
    ready: VecDeque<u8>,
}

impl Transport for Altered {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> io::Result<usize> {
        let mut raw = [0; 512];
        let count = self.module.read(&mut raw, wait)?;
        let mut bytes = &raw[..count];
        while let Some(frame) = self.receiver.receive::<Message<'_>>(&mut bytes) {
            let mut message = frame.expect("a whole frame").message;
            if let Message::Increment(increment) = &mut message
                && let Some(motion) = &mut increment.motion
            {
                motion.turn_rad = f64::from_bits(motion.turn_rad.to_bits() ^ 1);
            }
            let mut out = vec![0; max_frame_bytes(1024)];
            let frame = self.encoder.encode(&message, &mut out).expect("room");
            self.ready.extend(frame);
        }
        let count = buffer.len().min(self.ready.len());
        for (place, byte) in buffer.iter_mut().zip(self.ready.drain(..count)) {
            *place = byte;
        }
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.module.write(bytes)
    }

    fn reconnect(&mut self) -> io::Result<()> {
        self.module.reconnect()
    }
}

#[test]
fn single_wrong_bit_of_an_increment_fails() {
    let report = tested(&mut Altered {
        module: Module::start(Manner::default()),
        receiver: Receiver::new(vec![0; max_received_bytes(1024)].leak()),
        encoder: Encoder::new(),
        ready: VecDeque::new(),
    });
    assert_eq!(failed(&report), ["increments"]);
    // A target is confirmed after five pulses.
    assert!(check(&report, "increments").value >= Some(5.0));
}

/// The line is dead from some byte on, and cannot be reconnected.
#[test]
fn module_that_falls_silent_fails_and_is_reported() {
    struct Dying(FaultyLine<Module>);
    impl Transport for Dying {
        fn read(&mut self, buffer: &mut [u8], wait: Duration) -> io::Result<usize> {
            self.0.read(buffer, wait)
        }
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0.write(bytes)
        }
        fn reconnect(&mut self) -> io::Result<()> {
            Err(io::Error::other("unplugged"))
        }
    }
    let faults = Faults {
        dies_at: vec![6000],
        ..Faults::default()
    };
    let report = tested(&mut Dying(Module::behind(faults, Manner::default())));
    let failed = failed(&report);
    assert!(failed.contains(&"increments") && failed.contains(&"range profiles"));
    assert_eq!(check(&report, "round trip").verdict, Verdict::NotMeasured);
    assert!(!report.passed);
}
