//! Every message of the link: its bytes, round trip, and size.

mod values;

use proptest::prelude::*;
use subaperture_core::cfar::Detection;
use subaperture_core::link::{
    Command, EncodeError, Encoder, Encoding, LinkCounters, MAX_ACCUMULATED_BYTES, MAX_ANTENNAS,
    MAX_LIST_BYTES, MAX_TEXT_BYTES, Message, MotionConfiguration, Received, Receiver, Report, Row,
    complex32s, detection_bytes, detections, f32s, max_frame_bytes, max_received_bytes, row_bytes,
    sc16s, write_block_row, write_complex32s, write_detections, write_f32s, write_sc16s,
};
use subaperture_core::stream::BlockFloat;
use subaperture_core::{Complex32, Sc16};

use values::{SAMPLES, Values, values};

/// Encode all messages, send them in pieces of `piece` bytes, and expect all of them.
macro_rules! there_and_back {
    ($kind:ident, $messages:expr, $piece:expr) => {{
        let mut encoder = Encoder::new();
        let mut wire = Vec::new();
        let mut buffer = vec![0; max_frame_bytes(SAMPLES)];
        let mut expected = Vec::new();
        let mut number = 1;
        for message in $messages {
            let bytes = encoder.encode(&message, &mut buffer).expect("it fits");
            prop_assert_eq!(bytes.last(), Some(&0));
            prop_assert!(!bytes[..bytes.len() - 1].contains(&0));
            wire.extend_from_slice(bytes);
            if message.opens() {
                number = 0;
            }
            expected.push(Received {
                sequence: number,
                lost: 0,
                message,
            });
            number += 1;
        }
        let mut received = vec![0; max_received_bytes(SAMPLES)];
        let mut receiver = Receiver::new(&mut received);
        let mut due = expected.iter();
        for mut piece in wire.chunks($piece) {
            while let Some(frame) = receiver.receive::<$kind>(&mut piece) {
                prop_assert_eq!(frame.as_ref().ok(), due.next());
            }
        }
        prop_assert_eq!(due.next(), None);
        let frames = expected.len() as u32;
        prop_assert_eq!(
            receiver.counters(),
            &LinkCounters {
                frames,
                ..Default::default()
            }
        );
    }};
}

proptest! {
    #[test]
    fn every_message_round_trips(values in values(), piece in 1..700usize) {
        there_and_back!(Command, values.commands(), piece);
        there_and_back!(Report, values.reports(), piece);
    }

    /// Arbitrary bytes give a message, no message, or damage, never a panic, independently of how they are split.
    #[test]
    fn arbitrary_bytes_never_panic(
        bytes in prop::collection::vec(prop_oneof![2 => any::<u8>(), 1 => 0..4u8], 0..400),
        piece in 1..50usize,
        room in 0..40usize,
    ) {
        let (mut buffer, mut other) = (vec![0; room], vec![0; room]);
        let (mut by_byte, mut by_piece) = (Receiver::new(&mut buffer), Receiver::new(&mut other));
        for byte in &bytes {
            let _ = by_byte.push::<Command>(*byte);
        }
        for mut part in bytes.chunks(piece) {
            while by_piece.receive::<Command>(&mut part).is_some() {}
        }
        prop_assert_eq!(by_byte.counters(), by_piece.counters());
        prop_assert_eq!(by_byte.counters().frames, 0);
    }

    /// Arbitrary bytes with a correct header and CRC give a message that encodes to the same frame, or are malformed.
    #[test]
    fn arbitrary_payload_round_trips_or_is_malformed(
        variant in 0..25u8,
        payload in prop::collection::vec(any::<u8>(), 0..60),
    ) {
        let payload: Vec<u8> = std::iter::once(variant).chain(payload).collect();
        let frame = framed(3, &[0, 0, 0, 0], &payload);
        let mut buffer = [0; 100];
        for number in [0u32, 1] {
            let frame = if number == 0 { frame.clone() } else { framed(3, &number.to_le_bytes(), &payload) };
            let mut receiver = Receiver::new(&mut buffer);
            let _ = receiver.receive::<Command>(&mut frame.as_slice());
            let counters = *receiver.counters();
            prop_assert_eq!(counters.frames + counters.malformed, 1);
            let mut receiver = Receiver::new(&mut buffer);
            let _ = receiver.receive::<Report>(&mut frame.as_slice());
            let counters = *receiver.counters();
            prop_assert_eq!(counters.frames + counters.malformed, 1);
        }
    }

    #[test]
    fn samples_round_trip(parts in prop::collection::vec(any::<(i16, i16)>(), 0..200), shift in any::<i8>()) {
        let short: Vec<Sc16> = parts.iter().map(|(re, im)| Sc16::from_bits(*re, *im)).collect();
        let floats: Vec<Complex32> = short.iter().map(|z| z.to_complex32() * 1.0e-3).collect();
        let reals: Vec<f32> = floats.iter().map(|z| z.re).collect();
        let mut buffer = vec![0; 8 * parts.len()];
        let bytes = write_complex32s(&floats, &mut buffer).expect("it fits");
        prop_assert!(complex32s(bytes).eq(floats.iter().copied()));
        let row = Row::new(Encoding::Complex32, floats.len(), bytes).expect("its length");
        prop_assert!(row.values().eq(floats.iter().copied()));
        let bytes = write_sc16s(&short, &mut buffer).expect("it fits");
        prop_assert_eq!(bytes.len(), 4 * short.len());
        prop_assert!(sc16s(bytes).eq(short.iter().copied()));
        let bytes = write_f32s(&reals, &mut buffer).expect("it fits");
        prop_assert!(f32s(bytes).eq(reals.iter().copied()));

        // Exponents from -64 up to 63, one per 32 samples or part thereof.
        let exponents: Vec<i8> =
            (0..BlockFloat::blocks(short.len())).map(|i| (shift / 2).wrapping_add(i as i8)).collect();
        let len = row_bytes(Encoding::Sc16, short.len()).expect("a number");
        prop_assert_eq!(len, 4 * short.len() + short.len().div_ceil(32));
        let mut buffer = vec![0; len];
        let bytes = write_block_row(&short, &exponents, &mut buffer).expect("it fits");
        let row = Row::new(Encoding::Sc16, short.len(), bytes).expect("its length");
        let mut count = 0;
        for (i, value) in row.values().enumerate() {
            // Exact: 16-bit mantissas times powers of two within the normal numbers.
            let scale = 2.0f64.powi(i32::from(exponents[i / 32])) / 32768.0;
            prop_assert_eq!(f64::from(value.re), f64::from(parts[i].0) * scale);
            prop_assert_eq!(f64::from(value.im), f64::from(parts[i].1) * scale);
            count += 1;
        }
        prop_assert_eq!(count, short.len());
        prop_assert_eq!(Row::new(Encoding::Sc16, short.len() + 1, bytes), None);
        if len > 0 {
            prop_assert!(write_block_row(&short, &exponents, &mut vec![0; len - 1]).is_none());
        }
    }
}

/// Frame written from the description: CRC by another library, byte stuffing by definition.
fn framed(version: u8, sequence: &[u8; 4], payload: &[u8]) -> Vec<u8> {
    let mut body = vec![version];
    body.extend(sequence);
    body.extend(payload);
    body.extend(crc32fast::hash(&body).to_le_bytes());
    assert!(body.len() < 254, "no piece longer than a code can say");
    let mut wire = Vec::new();
    for piece in body.split(|byte| *byte == 0) {
        wire.push(piece.len() as u8 + 1);
        wire.extend(piece);
    }
    wire.push(0);
    wire
}

/// A peer with another protocol version is distinguished from noise.
#[test]
fn other_protocol_version_is_counted() {
    let mut buffer = [0; 32];
    let mut receiver = Receiver::new(&mut buffer);
    let wire = framed(4, &[0; 4], &[0]);
    let result = receiver.receive::<Command>(&mut wire.as_slice());
    let damage = result
        .expect("a frame's end")
        .expect_err("not of this version");
    assert_eq!(
        damage.to_string(),
        "frame of protocol version 4: expected version 3"
    );
    assert_eq!(receiver.counters().version, 1);
    assert_eq!(receiver.counters().frames, 0);
}

/// The longest message of every kind fits the stated sizes. With one byte less no frame is produced and no sequence number
/// is consumed.
#[test]
fn longest_messages_fit_stated_sizes() {
    let full = Values {
        long: u32::MAX,
        other: u32::MAX,
        short: u16::MAX,
        byte: 255,
        real: -1.0e300,
        single: -1.0e30,
        place_m: [-1.1e300; 3],
        // No zero byte: the maximum number of COBS codes.
        bytes: vec![0xA5; 8 * SAMPLES],
        text: "x".repeat(MAX_TEXT_BYTES),
    };
    let list = [0xA5; MAX_LIST_BYTES];
    let mut reports = full.reports();
    let long = u32::MAX;
    let short = u16::MAX;
    reports.push(Report::Detections {
        map: long,
        sub_cpi: long,
        patch: short,
        first: short,
        total: short,
        channels: short,
        list: &list,
    });
    let bits = [0xA5; MAX_ACCUMULATED_BYTES];
    let accumulated = Report::Accumulated {
        first: long,
        bits: &bits,
    };
    let mut encoder = Encoder::new();
    let mut buffer = vec![0; max_frame_bytes(SAMPLES)];
    let mut longest = 0;
    let mut check =
        |frame: Result<&[u8], EncodeError>| longest = longest.max(frame.expect("room").len());
    for command in full.commands() {
        check(encoder.encode(&command, &mut buffer));
    }
    for report in &reports {
        check(encoder.encode(report, &mut buffer));
    }
    assert!(
        longest + 192 > max_frame_bytes(SAMPLES),
        "{longest} is far below"
    );

    let without = max_frame_bytes(0);
    // The maximum number of antennas is a message without samples.
    let places = [0xA5; 16 * MAX_ANTENNAS];
    let antennas = Command::Antennas {
        transmitters: short,
        places: &places,
    };
    let motion = Command::Motion(MotionConfiguration {
        id: long,
        setup: full.motion_setup(),
    });
    for command in [antennas, motion] {
        encoder
            .encode(&command, &mut buffer[..without])
            .expect("no samples");
    }
    let has_samples = |report: &Report| {
        matches!(
            report,
            Report::MapRow { .. }
                | Report::ChipPart { .. }
                | Report::ProfileRow { .. }
                | Report::Accumulated { .. }
        ) || matches!(report, Report::Detections { list, .. } if list.len() > MAX_LIST_BYTES)
    };
    let short_ones = reports.iter().filter(|report| !has_samples(report));
    for report in short_ones.chain([&accumulated]) {
        encoder
            .encode(report, &mut buffer[..without])
            .expect("no samples");
    }

    let mut encoder = Encoder::new();
    for report in &reports {
        let needed = encoder
            .clone()
            .encode(report, &mut buffer)
            .expect("room")
            .len();
        for room in [0, 1, 5, needed / 2, needed - 2, needed - 1] {
            let result = encoder.encode(report, &mut buffer[..room]);
            assert_eq!(result, Err(EncodeError::Room { room }));
        }
        // A number consumed by a failure would change these bytes.
        let alone = encoder
            .clone()
            .encode(report, &mut buffer)
            .expect("room")
            .to_vec();
        assert_eq!(
            encoder.encode(report, &mut buffer[..needed]).expect("room"),
            alone
        );
    }
}

#[test]
fn detections_round_trip() {
    let sent: Vec<Detection> = (0..4)
        .map(|i| Detection {
            range_bin: i as f32 + 0.25,
            doppler_bin: 7.5,
            power: 1.0e-6,
            noise: 1.0e-9 * i as f32,
        })
        .collect();
    let values: Vec<[Complex32; 3]> = (0..4)
        .map(|i| [1.0, 2.0, 3.0].map(|c| Complex32::new(c, -(i as f32))))
        .collect();
    for channels in 0..=3 {
        let bytes = 4 * detection_bytes(channels);
        // One byte more, which is no whole record.
        let mut buffer = vec![0; bytes + 1];
        let written = write_detections(&sent, &values, channels, &mut buffer).unwrap();
        assert_eq!(written.len(), bytes);
        let read: Vec<(Detection, Vec<Complex32>)> = detections(&buffer, channels)
            .map(|(detection, values)| (detection, values.collect()))
            .collect();
        let expected = sent.iter().zip(&values);
        assert!(
            read.into_iter()
                .eq(expected
                    .map(|(detection, values)| { (*detection, values[..channels].to_vec()) }))
        );
        assert_eq!(
            write_detections(&sent, &values, channels, &mut buffer[1..bytes]),
            None
        );
    }
    let mut buffer = [0; 400];
    assert_eq!(write_detections(&sent, &values, 4, &mut buffer), None);
    assert_eq!(write_detections(&sent, &values[..3], 1, &mut buffer), None);
}
