//! Samples from the front end of the emulated board, a serial port with frames: images by the command, and increments.

use std::io::Write;
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::Child;
use std::thread::JoinHandle;
use std::time::Duration;

use crate::emulated::application;
use subaperture::io::cphd::{Channel, WriteOptions, write};
use subaperture::io::npy;
use subaperture::module::link::{Buffers, Session, Settings, open};
use subaperture::monitor::Silent;
use subaperture::phase_history::PhaseHistory;
use subaperture_core::Sc16;
use subaperture_core::link::write_sc16s;
use subaperture_tests::error_db;
use subaperture_tests::firmware::emulator;
use subaperture_tests::front_end::{digitised, framed};
use subaperture_tests::link_recording::recording;
use subaperture_tests::odometer_scene::Scene;
use subaperture_tests::subap::run;

/// The emulated board with frames for its front end.
struct Board {
    emulator: Child,
    port: u16,
    feeder: Option<JoinHandle<()>>,
}

impl Board {
    /// Start `elf` with a link on a free TCP port.
    fn start(elf: &Path, frames: Vec<u8>) -> Self {
        let front_end = TcpListener::bind("127.0.0.1:0").unwrap();
        let frames_at = format!("tcp:{}", front_end.local_addr().unwrap());
        let free = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = free.local_addr().unwrap().port();
        drop(free);
        let link = format!("tcp:127.0.0.1:{port},server=on,wait=off,nodelay=on");
        let serial = ["-serial", &link, "-serial", "null", "-serial", &frames_at];
        let emulator = emulator(elf, &serial);
        let (mut line, _) = front_end.accept().unwrap();
        // The emulator ends before all frames are read if the test fails.
        let feeder = std::thread::spawn(move || drop(line.write_all(&frames)));
        while TcpStream::connect(("127.0.0.1", port)).is_err() {
            std::thread::sleep(Duration::from_millis(20));
        }
        Self {
            emulator,
            port,
            feeder: Some(feeder),
        }
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        let _ = self.emulator.kill();
        let _ = self.emulator.wait();
        if let Some(feeder) = self.feeder.take() {
            let _ = feeder.join();
        }
    }
}

/// The image of samples from the front end is bit-identical to that of the same samples over the link, which the command compares
/// with the core on this machine, as it does the power image. Far fewer bytes go to the module.
#[test]
fn image_of_front_end_samples_equals_that_of_link() {
    let folder = tempfile::tempdir().unwrap();
    let (digital, frames) = digitised(&recording());
    let path = folder.path().join("a.cphd");
    let channel = Channel::new("one", &digital);
    write(&path, &[channel], &WriteOptions::default(), &Silent).unwrap();
    for (name, elf) in ["float", "fixed"].iter().zip(application()) {
        let board = Board::start(elf, frames.concat());
        let mut images = Vec::new();
        let mut sent = Vec::new();
        for options in ["--front-end", "--verify"] {
            let out = format!("{name}{options}");
            let line = format!(
                "link tcp://127.0.0.1:{} a.cphd --send image {options} --out {out} \
                 --grid x=-6:6:0.5,y=-6:6:0.5,z=0 --json",
                board.port
            );
            let ran = run(folder.path(), &line);
            let report: serde_json::Value = serde_json::from_str(ran.succeeded()).unwrap();
            let bytes = report["counters"]["bytes_to_module"].as_u64().unwrap();
            println!("{name} {options}: {bytes} bytes to the module");
            sent.push(bytes);
            images.push(npy::read(&folder.path().join(out).join("image.npy")).unwrap());
        }
        let line = format!(
            "link tcp://127.0.0.1:{} a.cphd --send image --power --verify --out {name}-power \
             --grid x=-6:6:0.5,y=-6:6:0.5,z=0",
            board.port
        );
        run(folder.path(), &line).succeeded();
        let power = npy::read(&folder.path().join(format!("{name}-power/image.npy"))).unwrap();
        assert!(power.pixels.iter().all(|z| z.re >= 0.0 && z.im == 0.0));
        assert!(2 * sent[0] < sent[1], "{sent:?}");
        let [front_end, link] = &images[..] else {
            unreachable!("two images");
        };
        assert!(
            front_end.pixels == link.pixels,
            "{name}: {:.1} dB",
            error_db(front_end, link)
        );
    }
}

/// Increments of front-end samples are bit-identical to those of the core. The host sends the settings only.
#[test]
fn increments_of_front_end_samples_equal_those_of_core() {
    const PULSES: usize = 24;
    let scene = Scene {
        short: true,
        ..Scene::new(2).with_snr_db(40.0, 3)
    };
    let samples = (0..PULSES).flat_map(|n| scene.pulse(n));
    let frames = (0..).zip(samples).flat_map(|(number, samples)| {
        let narrow: Vec<Sc16> = samples.iter().map(|z| Sc16::from_complex32(*z).0).collect();
        let mut bytes = vec![0; 4 * narrow.len()];
        framed(number, write_sc16s(&narrow, &mut bytes).unwrap())
    });
    let board = Board::start(&application()[1], frames.collect());
    let recorded = scene.recorded(PULSES);
    let channels: Vec<&dyn PhaseHistory> = recorded.iter().map(|own| own as _).collect();
    let address = format!("tcp://127.0.0.1:{}", board.port);
    let mut line = open(&address.parse().unwrap(), None, false).unwrap();
    let mut buffers = Buffers::new();
    let mut session =
        Session::open(&mut *line, &mut buffers, Settings::default(), &mut Silent).unwrap();
    let task = scene.motion_run(&channels, true);
    let outcome = session.increments(&task, &mut Silent);
    println!("{}", session.counts());
    outcome.ending.unwrap();
    assert_eq!(outcome.increments, scene.increments(PULSES));
    assert!(session.counts().bytes_to_module < 1000);
}
