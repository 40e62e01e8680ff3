//! Frames over lossy lines: no wrong frame is accepted, and every missing frame is counted.

use subaperture_core::Pulse;
use subaperture_core::link::{
    Command, Damage, Encoder, Encoding, Event, LinkCounters, Receiver, Report, max_frame_bytes,
    max_received_bytes,
};
use subaperture_tests::fuzz::stuffing;

/// SplitMix64 (Steele, Lea and Flood 2014).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn below(&mut self, count: usize) -> usize {
        (self.next() % count as u64) as usize
    }

    /// Uniform in `(0, 1]`.
    fn unit(&mut self) -> f64 {
        ((self.next() >> 11) + 1) as f64 / (1u64 << 53) as f64
    }
}

/// Samples of pulse `number`, with zeros and with sequences of nonzero bytes longer than one COBS code covers.
fn samples(number: u32) -> Vec<u8> {
    let mut random = Random(number.into());
    let zeros = random.below(3) == 0;
    let byte = |random: &mut Random| match random.below(8) {
        0 if zeros => 0,
        _ => random.next() as u8 | 1,
    };
    (0..8 * (number as usize % 60))
        .map(|_| byte(&mut random))
        .collect()
}

const MAX_SAMPLES: usize = 60;

/// Pulse that contains its number in several places.
fn pulse(number: u32, samples: &[u8]) -> Command<'_> {
    Command::Pulse {
        pulse: Pulse {
            number,
            time_s: f64::from(number) / 1000.0,
            transmitter_m: [f64::from(number), 0.0, 7000.0],
            ..Pulse::EMPTY
        },
        encoding: Encoding::Complex32,
        samples,
    }
}

/// Frames of `Hello` and pulses 1, 2, ...: the sequence number is the pulse's number.
fn frames(pulses: u32) -> Vec<Vec<u8>> {
    let mut encoder = Encoder::new();
    let mut buffer = vec![0; max_frame_bytes(MAX_SAMPLES)];
    let mut all = vec![
        encoder
            .encode(&Command::Hello, &mut buffer)
            .expect("room")
            .to_vec(),
    ];
    for number in 1..=pulses {
        let samples = samples(number);
        let bytes = encoder.encode(&pulse(number, &samples), &mut buffer);
        all.push(bytes.expect("room").to_vec());
    }
    all
}

/// Receive frames. Every accepted frame must be the one that was sent with its number. Returns their numbers and the
/// counters.
fn listen(mut bytes: &[u8], room: usize) -> (Vec<u32>, LinkCounters) {
    let mut buffer = vec![0; room];
    let mut receiver = Receiver::new(&mut buffer);
    let mut numbers = Vec::new();
    let mut damaged = LinkCounters::default();
    while let Some(result) = receiver.receive::<Command>(&mut bytes) {
        match result {
            Ok(frame) => {
                let number = frame.sequence;
                let samples = samples(number);
                let sent = if number == 0 {
                    Command::Hello
                } else {
                    pulse(number, &samples)
                };
                assert_eq!(frame.message, sent, "a wrong frame was accepted");
                numbers.push(number);
                damaged.frames += 1;
                damaged.lost += frame.lost;
            }
            Err(Damage::Corrupt) => damaged.corrupt += 1,
            Err(Damage::Malformed) => damaged.malformed += 1,
            Err(Damage::TooLong) => damaged.too_long += 1,
            Err(Damage::Version(_)) => damaged.version += 1,
            Err(Damage::Repeated(_)) => damaged.repeated += 1,
        }
    }
    // The accepted frames are the counted ones: none of these frames is intact but malformed.
    assert_eq!(&damaged, receiver.counters());
    (numbers, damaged)
}

const ROOM: usize = max_received_bytes(MAX_SAMPLES);

fn undamaged(frames: u32) -> LinkCounters {
    LinkCounters {
        frames,
        ..LinkCounters::default()
    }
}

/// Every bit of a frame between two good ones is flipped; only the two neighbours are received. A flip of the terminating
/// zero destroys the next frame as well, unless a zero precedes it.
#[test]
fn any_single_bit_error_is_detected() {
    // Samples 40 to 59 are at least 320 bytes: longer than one COBS code covers.
    let all = frames(59);
    for place in [1, 2, 7, 40, 41, 42, 57] {
        let frame = &all[place];
        for bit in 0..8 * frame.len() {
            let mut wrong = frame.clone();
            wrong[bit / 8] ^= 1 << (bit % 8);
            let line = [&all[place - 1], wrong.as_slice(), &[0], &all[place + 1]].concat();
            let (numbers, counters) = listen(&line, ROOM);
            let place = place as u32;
            assert_eq!(numbers, [place - 1, place + 1], "bit {bit}");
            assert_eq!(counters.lost, 1, "bit {bit}");
            assert!(
                counters.corrupt + counters.malformed > 0,
                "bit {bit}: {counters:?}"
            );
        }
    }
}

/// Independent bit errors at rates of 1e-5 to 1e-3 over long streams: accepted frames are correct and
/// `sent = received + lost`.
#[test]
fn bit_errors_only_lose_frames() {
    let sent = 20_000;
    let all = frames(sent);
    let clean: Vec<u8> = all.concat();
    let (numbers, counters) = listen(&clean, ROOM);
    assert_eq!(numbers.len(), sent as usize + 1);
    assert_eq!(counters, undamaged(sent + 1));
    let (first, last) = (all[0].len(), clean.len() - all[all.len() - 1].len());
    for (rate, seed) in [(1.0e-5f64, 1), (1.0e-4, 2), (1.0e-3, 3), (1.0e-3, 9)] {
        let mut random = Random(seed);
        let mut line = clean.clone();
        // Gaps between errors are geometric: the number of bits up to the next is ln(u) / ln(1 - rate).
        let mut bit = 8 * first;
        let mut errors = 0;
        loop {
            bit += (random.unit().ln() / (-rate).ln_1p()) as usize;
            if bit >= 8 * last {
                break;
            }
            line[bit / 8] ^= 1 << (bit % 8);
            bit += 1;
            errors += 1;
        }
        // The last frame must be received from its start.
        line.insert(last, 0);
        let (numbers, counters) = listen(&line, ROOM);
        assert_eq!(numbers.last(), Some(&sent), "the last frame is whole");
        assert!(numbers.is_sorted_by(|a, b| a < b));
        assert_eq!(counters.frames + counters.lost, sent + 1);
        assert!(counters.lost > 0 && counters.frames > 0);
        // Every lost frame has an error of its own, or shares one with the frame whose terminator it hit.
        assert!(counters.lost <= 2 * errors, "{errors} errors, {counters:?}");
        println!("rate {rate:e}: {errors} wrong bits, {counters:?}");
    }
}

/// Bytes dropped, repeated and inserted, as on a line without flow control.
#[test]
fn dropped_and_inserted_bytes_only_lose_frames() {
    let sent = 5_000;
    let all = frames(sent);
    let mut random = Random(5);
    let mut line = all[0].clone();
    for frame in &all[1..all.len() - 1] {
        for byte in frame {
            match random.below(2000) {
                0 => {}
                1 => line.extend([*byte; 2]),
                2 => line.extend([*byte, random.next() as u8]),
                _ => line.push(*byte),
            }
        }
    }
    line.push(0);
    line.extend(&all[all.len() - 1]);
    let (_, counters) = listen(&line, ROOM);
    assert_eq!(counters.frames + counters.lost, sent + 1);
    assert!(counters.lost > 100, "{counters:?}");
}

/// A frame cut at any byte is lost. With a zero before the next frame, that one is not.
#[test]
fn truncated_frame_loses_only_itself() {
    let all = frames(50);
    for (place, next) in [(3u32, 4u32), (41, 42)] {
        let frame = &all[place as usize];
        for cut in 0..frame.len() - 1 {
            let line = [
                &all[place as usize - 1],
                &frame[..cut],
                &[0],
                &all[next as usize],
            ]
            .concat();
            let (numbers, counters) = listen(&line, ROOM);
            assert_eq!(numbers, [place - 1, next], "cut at {cut}");
            assert_eq!(counters.lost, 1);
            // If no byte of the frame remains, there is no error to report.
            assert_eq!(counters.corrupt + counters.malformed, u32::from(cut > 0));
        }
    }
}

#[test]
fn repeated_and_reordered_frames_are_dropped() {
    let all = frames(6);
    let line = [0, 1, 1, 2, 4, 3, 5, 2, 6]
        .map(|place: usize| all[place].as_slice())
        .concat();
    let (numbers, counters) = listen(&line, ROOM);
    assert_eq!(numbers, [0, 1, 2, 4, 5, 6]);
    let expected = LinkCounters {
        frames: 6,
        lost: 1,
        repeated: 3,
        ..LinkCounters::default()
    };
    assert_eq!(counters, expected);
}

/// Zeros between frames are ignored. Other bytes between frames are malformed or corrupt, once between two zeros.
#[test]
fn noise_that_ends_in_zero_loses_no_frame() {
    let all = frames(3);
    let noise: [&[u8]; 3] = [
        &[0, 0, 0],
        &[7, 1, 2, 0],
        &[3, 9, 9, 1, 1, 1, 1, 1, 1, 1, 1, 0],
    ];
    for (noise, malformed, corrupt) in [(noise[0], 0, 0), (noise[1], 1, 0), (noise[2], 0, 1)] {
        let line = [&all[0], &all[1], noise, &all[2], &all[3]].concat();
        let (_, counters) = listen(&line, ROOM);
        let expected = LinkCounters {
            malformed,
            corrupt,
            ..undamaged(4)
        };
        assert_eq!(counters, expected, "{noise:?}");
    }
}

/// A frame longer than the buffer is skipped up to its zero; one that fits exactly is accepted.
#[test]
fn overlong_frames_are_skipped() {
    let all = frames(59);
    let line = [&all[1], &all[59], &all[1 + 1]].map(Vec::as_slice).concat();
    // The minimum buffer that accepts it is its length.
    let accepted = |room: usize| listen(&[all[58].as_slice(), &all[59]].concat(), room).1;
    let exact = (0..ROOM)
        .find(|room| accepted(*room).frames == 2)
        .expect("it fits at last");
    // Version, sequence, variant, number (1 byte), 8 + 24 + 24 + 8 + 4 of the pulse, encoding, length of
    // 472 (2 bytes), samples, CRC.
    assert_eq!(exact, 1 + 4 + 1 + 1 + 68 + 1 + 2 + 8 * 59 + 4);
    assert_eq!(accepted(exact - 1).too_long, 1);
    let (numbers, counters) = listen(&line[..all[1].len() + all[59].len()], exact - 1);
    assert_eq!((numbers, counters.too_long, counters.lost), (vec![1], 1, 0));
    // Any excess length: a thousand buffers without a zero.
    let endless = vec![0x55; 1000 * ROOM];
    let line = [&all[1], endless.as_slice(), &[0], &all[2]].concat();
    let (numbers, counters) = listen(&line, ROOM);
    assert_eq!(numbers, [1, 2]);
    assert_eq!(counters.too_long, 1);
}

/// A peer that restarts is followed without a loss. If its opening message is lost, its frames are detected as behind.
#[test]
fn restarted_peer_is_followed_without_loss() {
    let all = frames(9);
    let line =
        |places: &[usize]| -> Vec<u8> { places.iter().flat_map(|i| all[*i].clone()).collect() };
    // In the middle of the count, twice in a row, and first received in the middle.
    assert_eq!(listen(&line(&[0, 1, 2, 3, 0, 1, 2]), ROOM).1, undamaged(7));
    assert_eq!(listen(&line(&[0, 0, 1, 0, 1]), ROOM).1, undamaged(5));
    assert_eq!(listen(&line(&[7, 8, 9]), ROOM).1, undamaged(3));
    // With the opening lost, all frames are behind until the peer is greeted.
    let (numbers, counters) = listen(&line(&[0, 1, 2, 3, 4, 5, 1, 2, 0, 1]), ROOM);
    assert_eq!(numbers, [0, 1, 2, 3, 4, 5, 0, 1]);
    assert_eq!((counters.repeated, counters.lost), (2, 0));
}

/// A message of the other direction is malformed, and is not counted as lost as well.
#[test]
fn message_of_other_direction_is_malformed() {
    let mut encoder = Encoder::new();
    let (mut wire, mut buffer) = ([0; 64], [0; 64]);
    let mut line = Vec::new();
    for run in [1, 2] {
        let report = Report::Event(Event::RunStarted { run });
        line.extend_from_slice(encoder.encode(&report, &mut wire).expect("room"));
    }
    line.extend_from_slice(encoder.encode(&Command::Stop, &mut wire).expect("room"));
    let mut receiver = Receiver::new(&mut buffer);
    let mut bytes = line.as_slice();
    let mut accepted = Vec::new();
    while let Some(result) = receiver.receive::<Command>(&mut bytes) {
        accepted.extend(result.ok().map(|frame| (frame.sequence, frame.lost)));
    }
    assert_eq!(accepted, [(3, 0)]);
    let expected = LinkCounters {
        malformed: 2,
        ..undamaged(1)
    };
    assert_eq!(receiver.counters(), &expected);
}

/// Frame repair used by the fuzzer, written from the format description alone.
#[test]
fn fuzzer_frame_repair_matches_core_encoder() {
    let weights: Vec<u8> = (0..150).map(|i| (i % 5) as u8).collect();
    let long: Vec<u8> = (0..160).map(|i| 1 + (i % 250) as u8).collect();
    let mut encoder = Encoder::new();
    let mut buffer = [0; 512];
    let commands = [
        Command::Hello,
        Command::Weights {
            first: 7,
            weights: &weights,
        },
        Command::Weights {
            first: 300,
            weights: &long,
        },
        Command::Status,
    ];
    for (sequence, command) in (0..).zip(commands) {
        let wire = encoder.encode(&command, &mut buffer).unwrap();
        let [body] = &stuffing::pieces(wire)[..] else {
            panic!("a frame is one piece");
        };
        assert_eq!(stuffing::frame(sequence, stuffing::message(body)), wire);
    }
}
