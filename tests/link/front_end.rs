//! Front ends of the module, and sessions with samples from them: every accepted map is bit-identical to that of the core on
//! this machine, and pulses that a front end loses cost their own sub-CPIs only.

use std::collections::BTreeSet;
use std::num::NonZeroU16;
use std::time::Duration;

use embedded_hal::spi::{ErrorKind, ErrorType, Operation, SpiDevice};
use embedded_hal_mock::eh1::digital::{Mock as Pin, State, Transaction as Level};
use embedded_hal_mock::eh1::spi::{Mock as Spi, Transaction};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use subaperture::module::accumulated::by_host_core;
use subaperture::module::link::{
    Buffers, HostCore, LinkError, Outcome, PulseSource, Session, Settings, TransferEnd, Verified,
};
use subaperture::monitor::Silent;
use subaperture::phase_history::InMemory;
use subaperture_core::link::{Arithmetic, Encoding, Refusal};
use subaperture_firmware::front_end::frame::{self, HEAD_BYTES, Order, SYNC, frame_bytes};
use subaperture_firmware::front_end::{Coding, FrameStream, FrontEnd, SpiConverter};
use subaperture_tests::faults::{Faults, FaultyLine};
use subaperture_tests::front_end::{Port, digitised, framed};
use subaperture_tests::link_scene::{
    COHERENT, Keep, MAPS, PULSES, image_scene, job, recorded, scene,
};
use subaperture_tests::module::{Manner, Module};

/// Pulses per sub-CPI of the scene.
const M: usize = 4;

/// All pulses that a front end provides, without waiting for more.
fn received(front_end: &mut dyn FrontEnd) -> Vec<(u32, Vec<u8>)> {
    let mut pulses = Vec::new();
    let mut idle = 0;
    // A stream needs several calls for a pulse.
    while idle < 200 {
        match front_end.pulse() {
            Some((number, samples)) => {
                pulses.push((number, samples.to_vec()));
                front_end.release();
                idle = 0;
            }
            None => idle += 1,
        }
    }
    pulses
}

fn random_samples(random: &mut ChaCha8Rng, count: usize) -> Vec<u8> {
    (0..4 * count).map(|_| random.next_u32() as u8).collect()
}

#[test]
fn frame_has_documented_bytes() {
    let samples = [0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 0x77, 0x88];
    let mut buffer = [0; frame_bytes(2)];
    let bytes = frame::write(0x0102_0304, Order::QuadratureFirst, &samples, &mut buffer).unwrap();
    let mut expected = vec![0xA5, 0x5A, 0xF0, 0x0F, 4, 3, 2, 1, 2, 0, 1, 0];
    expected.extend(samples);
    expected.extend(crc32fast::hash(&expected[4..]).to_le_bytes());
    assert_eq!(bytes, expected);
    assert_eq!(
        frame::write(0, Order::InPhaseFirst, &samples[..7], &mut buffer),
        None
    );
    assert_eq!(
        frame::write(0, Order::InPhaseFirst, &[0; 12], &mut buffer),
        None
    );
}

/// The sent order of the parts is recorded in the frame; received samples are in-phase first.
#[test]
fn frames_in_pieces_of_any_size_are_received() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let sent: Vec<(u32, Vec<u8>)> = (0..40)
        .map(|number| (number, random_samples(&mut random, 1 + number as usize % 9)))
        .collect();
    let frames = sent.iter().flat_map(|(number, samples)| {
        let mut buffer = vec![0; frame_bytes(samples.len() / 4)];
        if number % 2 == 0 {
            return framed(*number, samples);
        }
        let swapped: Vec<u8> = samples
            .chunks(4)
            .flat_map(|z| [z[2], z[3], z[0], z[1]])
            .collect();
        frame::write(*number, Order::QuadratureFirst, &swapped, &mut buffer).unwrap();
        buffer
    });
    let port = Port::with(frames);
    let mut buffer = [0; frame_bytes(9)];
    let mut stream = FrameStream::new(port, &mut buffer);
    assert_eq!(stream.max_samples(), 9);
    assert_eq!(received(&mut stream), sent);
}

/// Samples that contain the synchronisation, noise before a frame, cut frames, frames longer than the buffer, and bit errors.
#[test]
fn damage_costs_damaged_frames_only() {
    let mut random = ChaCha8Rng::seed_from_u64(2);
    let (mut bytes, mut intact) = (Vec::new(), Vec::new());
    for number in 0..400 {
        let mut samples = random_samples(&mut random, 8);
        if number % 3 == 0 {
            let at = random.next_u32() as usize % 28;
            samples[at..at + 4].copy_from_slice(&SYNC);
        }
        let mut frame = framed(number, &samples);
        match number % 7 {
            1 => {
                let cut = random.next_u32() as usize % frame.len();
                frame.truncate(cut);
            }
            3 => {
                let bit = random.next_u32() as usize % (8 * frame.len());
                frame[bit / 8] ^= 1 << (bit % 8);
            }
            5 => frame = framed(number, &random_samples(&mut random, 9)),
            _ => intact.push((number, samples)),
        }
        bytes.extend(frame);
        let noise = random.next_u32() as usize % 5;
        bytes.extend((0..noise).map(|_| random.next_u32() as u8));
    }
    let mut buffer = [0; frame_bytes(8)];
    let mut stream = FrameStream::new(Port::with(bytes), &mut buffer);
    let received = received(&mut stream);
    assert!(received.iter().all(|pulse| intact.contains(pulse)));
    // A frame after a damaged one can be lost with it if the wrong length covers it.
    println!("{} of {} intact frames", received.len(), intact.len());
    assert!(received.len() * 10 >= intact.len() * 9);
}

#[test]
fn converter_reads_pulses_in_transfers() {
    for (coding, flip) in [(Coding::TwosComplement, 0), (Coding::OffsetBinary, 0x80)] {
        let words = [
            [0x12, 0x34, 0x80, 0x00],
            [0xFF, 0xFE, 0x00, 0x01],
            [7, 6, 5, 4],
        ];
        let sent = words.map(|word| [word[0] ^ flip, word[1], word[2] ^ flip, word[3]]);
        // Three samples, at most two per transfer.
        let mut spi = Spi::new(&[
            Transaction::transaction_start(),
            Transaction::read_vec(sent[..2].concat()),
            Transaction::transaction_end(),
            Transaction::transaction_start(),
            Transaction::read_vec(sent[2].to_vec()),
            Transaction::transaction_end(),
        ]);
        let mut ready = Pin::new(&[Level::get(State::Low), Level::get(State::High)]);
        let mut buffer = [0; 16];
        let two = NonZeroU16::new(2).unwrap();
        let mut converter = SpiConverter::new(spi.clone(), ready.clone(), coding, two, &mut buffer);
        assert_eq!(converter.max_samples(), 4);
        converter.begin(40, 3);
        assert_eq!(converter.pulse(), None);
        let expected: Vec<u8> = words
            .iter()
            .flat_map(|word| [word[1], word[0], word[3], word[2]])
            .collect();
        // The pulse remains until it is released, without another transfer.
        assert_eq!(converter.pulse(), Some((40, &expected[..])));
        assert_eq!(converter.pulse(), Some((40, &expected[..])));
        converter.release();
        spi.done();
        ready.done();
    }
}

/// Bus that fails for the first transfer.
struct Failing(u32);

impl ErrorType for Failing {
    type Error = ErrorKind;
}

impl SpiDevice for Failing {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), ErrorKind> {
        self.0 += 1;
        for operation in operations {
            if let Operation::Read(words) = operation {
                words.fill(self.0 as u8);
            }
        }
        match self.0 {
            1 => Err(ErrorKind::Overrun),
            _ => Ok(()),
        }
    }
}

#[test]
fn failed_transfer_loses_its_pulse() {
    let mut ready = Pin::new(&[Level::get(State::High), Level::get(State::High)]);
    let mut buffer = [0; 4];
    let coding = Coding::TwosComplement;
    let one = NonZeroU16::MIN;
    let mut converter = SpiConverter::new(Failing(0), ready.clone(), coding, one, &mut buffer);
    converter.begin(8, 1);
    assert_eq!(converter.pulse(), None);
    assert_eq!(converter.pulse(), Some((9, &[2; 4][..])));
    ready.done();
}

fn settings() -> Settings {
    Settings {
        answer: Duration::from_millis(30),
        idle: Duration::from_secs(5),
        first_number: 77,
        ..Settings::default()
    }
}

/// Run the scene on a module with these frames of its front end. Returns the outcome with the sub-CPIs of the maps. Every map was
/// compared with that of the core.
fn session(fixed: bool, frames: Vec<u8>, settings: Settings) -> (Outcome, BTreeSet<u32>) {
    let scene = scene();
    let (recording, _) = digitised(&recorded(&scene));
    let encoding = [Encoding::Complex32, Encoding::Sc16][usize::from(fixed)];
    let manner = Manner {
        fixed,
        ..Manner::default()
    };
    let mut module = Module::with_front_end(manner, Port::with(frames));
    let mut buffers = Buffers::new();
    let mut session = Session::open(&mut module, &mut buffers, settings, &mut Silent).unwrap();
    let expected = [Arithmetic::Float, Arithmetic::Fixed][usize::from(fixed)];
    assert_eq!(session.identity().arithmetic, expected);
    let core = HostCore::new(job(&scene, &recording, encoding)).unwrap();
    let mut verified = Verified::new(Keep::default(), core);
    let mut work = job(&scene, &recording, encoding);
    work.pulses = geometry(&scene.pulses, &recording);
    let outcome = session.transfer(&mut work, &mut verified, &mut Silent);
    println!("{}\n{:?}", outcome.counts, outcome.ending);
    let (same, different) = verified.counts();
    assert_eq!((same, different), (outcome.counts.maps_taken, 0));
    let keys = verified.into_inner().0.into_keys();
    (outcome, keys.map(|(sub_cpi, _)| sub_cpi).collect())
}

/// Geometry of the recording, with the weights of the scene.
fn geometry<'a>(pulses: &[subaperture_core::Pulse], recording: &'a InMemory) -> PulseSource<'a> {
    let weights: Vec<f64> = pulses.iter().map(|pulse| pulse.weight.into()).collect();
    PulseSource::from_front_end(&[recording], &weights).unwrap()
}

/// Geometry that is lost on the line is sent again while its samples wait, and no sub-CPI is accumulated wrongly.
#[test]
fn image_over_bad_line_equals_that_of_core() {
    let scene = image_scene();
    let (recording, frames) = digitised(&recorded(&scene));
    let module = Module::with_front_end(Manner::default(), Port::with(frames.concat()));
    let faults = Faults {
        seed: 3,
        bit_errors: 1e-4,
        ..Faults::default()
    };
    let mut line = FaultyLine::new(module, faults);
    let mut buffers = Buffers::new();
    let mut session = Session::open(&mut line, &mut buffers, settings(), &mut Silent).unwrap();
    let mut work = job(&scene, &recording, Encoding::Complex32);
    work.pulses = geometry(&scene.pulses, &recording);
    let (outcome, image) = session.accumulate(&mut work, COHERENT, &mut Silent);
    println!("{}", outcome.counts);
    assert!(
        matches!(outcome.ending, TransferEnd::Complete),
        "{outcome:?}"
    );
    assert!(outcome.counts.frames_to_module.damaged > 0);
    let mut core = HostCore::new(job(&scene, &recording, Encoding::Complex32)).unwrap();
    let expected = by_host_core(&mut core, COHERENT, &image.sub_cpis).unwrap();
    assert_eq!(image.sub_cpis.len(), MAPS / 2);
    assert_eq!(image, expected);
}

fn all_frames() -> Vec<Vec<u8>> {
    digitised(&recorded(&scene())).1
}

#[test]
fn maps_of_front_end_pulses_equal_those_of_core() {
    for fixed in [false, true] {
        let (outcome, sub_cpis) = session(fixed, all_frames().concat(), settings());
        assert!(
            matches!(outcome.ending, TransferEnd::Complete),
            "{outcome:?}"
        );
        assert_eq!(sub_cpis.len(), MAPS / 2);
        let counts = &outcome.counts;
        assert_eq!(counts.module_pulses.accepted, PULSES as u64);
        // Geometry: some 100 bytes per pulse, without the 64 or 128 bytes of its samples.
        assert!(
            counts.bytes_to_module < 110 * PULSES as u64 + 1000,
            "{counts}"
        );
    }
}

/// A later frame shows that pulses are missing; frames before the run are dropped.
#[test]
fn lost_frames_cost_their_own_sub_cpis() {
    let mut frames = all_frames();
    for lost in [5, 17, 18, 19, 20, 30] {
        frames[lost].clear();
    }
    frames[40][HEAD_BYTES] ^= 1;
    let (outcome, sub_cpis) = session(false, frames.concat(), settings());
    assert!(
        matches!(outcome.ending, TransferEnd::Incomplete),
        "{outcome:?}"
    );
    let lost: BTreeSet<u32> = [5, 17, 20, 30, 40].map(|n| n / M as u32).into();
    let all = 0..(MAPS / 2) as u32;
    assert_eq!(sub_cpis, all.filter(|n| !lost.contains(n)).collect());
    assert_eq!(outcome.counts.module_pulses.lost, 7);
    assert_eq!(outcome.counts.runs, 1);
}

/// The maps of the complete sub-CPIs are received, and no pulse is requested again.
#[test]
fn front_end_that_ends_early_ends_the_session() {
    let settings = Settings {
        idle: Duration::from_millis(400),
        ..settings()
    };
    let frames = all_frames()[..5 * M + 2].concat();
    let (outcome, sub_cpis) = session(false, frames, settings);
    assert!(
        matches!(outcome.ending, TransferEnd::Incomplete),
        "{outcome:?}"
    );
    assert_eq!(sub_cpis, (0..5).collect());
}

#[test]
fn frames_of_another_length_are_refused() {
    let frames: Vec<u8> = (0..PULSES as u32)
        .flat_map(|n| framed(n, &[0; 60]))
        .collect();
    let (outcome, _) = session(false, frames, settings());
    let TransferEnd::Failed(LinkError::Refused(refusal)) = outcome.ending else {
        panic!("{:?}", outcome.ending);
    };
    let expected = Refusal::PulseLength {
        expected: 64,
        got: 60,
    };
    assert_eq!(refusal, expected);
}

#[test]
fn module_without_front_end_refuses_the_run() {
    let scene = scene();
    let recording = recorded(&scene);
    let mut module = Module::start(Manner::default());
    let mut buffers = Buffers::new();
    let mut session = Session::open(&mut module, &mut buffers, settings(), &mut Silent).unwrap();
    let mut work = job(&scene, &recording, Encoding::Complex32);
    work.pulses = geometry(&scene.pulses, &recording);
    let outcome = session.transfer(&mut work, &mut Keep::default(), &mut Silent);
    assert!(
        matches!(
            outcome.ending,
            TransferEnd::Failed(LinkError::Refused(Refusal::Unsupported))
        ),
        "{outcome:?}"
    );
}
