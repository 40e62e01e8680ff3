//! The log of the board as defmt frames: levels and typed arguments, decoded by the symbols of the ELF.

use std::collections::BTreeMap;
use std::fs;
use std::io::{ErrorKind, Read, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::{Duration, Instant};

use object::{Object, ObjectSection, ObjectSymbol};
use serde_json::Value;
use subaperture_core::link::{
    Command, Configuration, Encoder, Receiver, Report, max_received_bytes,
};
use subaperture_core::stream::Setup;
use subaperture_tests::firmware::{Build, TIME_LIMIT, build, emulator, sections};

/// The section of the texts that defmt's frames refer to.
fn has_texts(elf: &Path) -> bool {
    sections(elf).iter().any(|section| section.name == ".defmt")
}

/// Connect to the emulated serial line once the emulator has opened it.
fn connect(socket: &Path) -> UnixStream {
    let started = Instant::now();
    loop {
        match UnixStream::connect(socket) {
            Ok(stream) => return stream,
            Err(error) => assert!(started.elapsed() < TIME_LIMIT, "{error}"),
        }
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[test]
fn board_of_h743_logs_by_defmt_unless_left_out() {
    let with = build(&Build::bin("application", "board-h743"));
    let without = build(&Build::bin("application", "board-h743,no-log"));
    assert!(has_texts(&with));
    assert!(!has_texts(&without));
}

/// Format strings by their index: the symbols of the section `.defmt`, whose names are JSON.
fn format_strings(elf: &Path) -> BTreeMap<u16, Value> {
    let elf = fs::read(elf).unwrap();
    let elf = object::File::parse(&*elf).unwrap();
    let section = elf.section_by_name(".defmt").expect(".defmt").index();
    let symbols = elf.symbols();
    let of_section = symbols.filter(|symbol| symbol.section_index() == Some(section));
    of_section
        .filter_map(|symbol| {
            let entry = serde_json::from_str(symbol.name().ok()?).ok()?;
            Some((symbol.address() as u16, entry))
        })
        .collect()
}

/// Decode a frame in reverse zero-compressing COBS, without its final zero. It is read from its end. A byte below 128 precedes
/// 7 bytes and has one bit per byte, set for a zero; a greater one precedes a block without zeros.
fn unstuff(frame: &[u8]) -> Vec<u8> {
    let (mut decoded, mut rest) = (Vec::new(), frame.iter().rev().copied());
    while let Some(code) = rest.next() {
        match code {
            0x00 => panic!("zero in a frame"),
            0x01..=0x7f => decoded.extend((0..7).rev().map(|bit| match code >> bit & 1 {
                0 => rest.next().expect("a byte"),
                _ => 0,
            })),
            0x80..=0xfe => {
                decoded.push(0);
                decoded.extend(rest.by_ref().take(usize::from(code & 0x7f) + 7));
            }
            0xff => decoded.extend(rest.by_ref().take(134)),
        }
    }
    decoded.reverse();
    decoded
}

/// Arguments of a frame that are still to be formatted.
struct Arguments<'a> {
    strings: &'a BTreeMap<u16, Value>,
    bytes: &'a [u8],
}

impl Arguments<'_> {
    fn take<const N: usize>(&mut self) -> [u8; N] {
        let (first, rest) = self.bytes.split_first_chunk().expect("an argument");
        self.bytes = rest;
        *first
    }

    /// The next format string and its tag.
    fn string(&mut self) -> (&str, &str) {
        let entry = &self.strings[&u16::from_le_bytes(self.take())];
        let field = |name: &str| entry[name].as_str().expect("a text");
        (field("tag"), field("data"))
    }

    /// A value of a type that has its own format string. One with `|` has a variant per discriminant.
    fn value(&mut self) -> String {
        let format = self.string().1.to_owned();
        let variants: Vec<&str> = format.split('|').collect();
        let variant = match variants.len() {
            1 => 0,
            _ => usize::from(self.take::<1>()[0]),
        };
        self.format(variants[variant])
    }

    fn format(&mut self, format: &str) -> String {
        let (mut text, mut rest) = (String::new(), format);
        while let Some(at) = rest.find(['{', '}']) {
            text.push_str(&rest[..at]);
            rest = &rest[at..];
            if let Some(after) = rest.strip_prefix("{{") {
                text.push('{');
                rest = after;
            } else if let Some(after) = rest.strip_prefix("}}") {
                text.push('}');
                rest = after;
            } else {
                let (parameter, after) = rest[1..].split_once('}').expect("a parameter");
                let (kind, hint) = parameter.split_once(':').unwrap_or((parameter, "?"));
                assert_eq!(hint, "?", "{parameter}");
                text.push_str(&match kind {
                    "" | "=?" => self.value(),
                    "=u16" => u16::from_le_bytes(self.take()).to_string(),
                    "=u32" => u32::from_le_bytes(self.take()).to_string(),
                    "=str" => {
                        let length = u32::from_le_bytes(self.take()) as usize;
                        let (text, rest) = self.bytes.split_at(length);
                        self.bytes = rest;
                        String::from_utf8(text.to_vec()).expect("UTF-8")
                    }
                    other => panic!("type {other}"),
                });
                rest = after;
            }
        }
        text + rest
    }
}

/// Levels and messages of the frames that a program wrote.
fn decode(elf: &Path, frames: &[u8]) -> Vec<(String, String)> {
    let strings = format_strings(elf);
    let frames = frames
        .split(|byte| *byte == 0)
        .filter(|frame| !frame.is_empty());
    frames
        .map(|frame| {
            let bytes = unstuff(frame);
            let mut arguments = Arguments {
                strings: &strings,
                bytes: &bytes,
            };
            let (tag, format) = arguments.string();
            let (tag, format) = (tag.to_owned(), format.to_owned());
            (tag, arguments.format(&format))
        })
        .collect()
}

#[test]
fn defmt_frames_contain_levels_and_typed_arguments() {
    let elf = build(&Build::bin("application", "defmt"));
    let folder = tempfile::tempdir().unwrap();
    let socket = folder.path().join("line");
    let line = format!("unix:{},server=on,wait=off", socket.display());
    let mut module = emulator(&elf, &["-serial", &line]);
    let mut stream = connect(&socket);
    stream
        .set_read_timeout(Some(Duration::from_millis(100)))
        .unwrap();

    // A damaged frame, a setup that is too large, and a request for the status, whose answer comes last.
    let large = Command::Configure(Configuration {
        id: 1,
        setup: Setup {
            num_pulses: 9999,
            num_channels: 1,
            num_frequencies: 64,
            range_length: 64,
            doppler_length: 16384,
            start_hz: 1e9,
            step_hz: 1e6,
        },
        total_pulses: 0,
        send_maps: true,
    });
    let (mut encoder, mut wire) = (Encoder::new(), [0; 256]);
    stream.write_all(&[1, 2, 3, 0]).unwrap();
    for command in [Command::Hello, large, Command::Status] {
        let frame = encoder.encode(&command, &mut wire).unwrap();
        stream.write_all(frame).unwrap();
    }
    let mut buffer = vec![0; max_received_bytes(1024)];
    let mut receiver = Receiver::new(&mut buffer);
    let (mut answered, started) = (false, Instant::now());
    while !answered {
        assert!(started.elapsed() < TIME_LIMIT, "no status");
        let mut bytes = [0; 256];
        let count = match stream.read(&mut bytes) {
            Ok(count) => count,
            Err(error) if error.kind() == ErrorKind::WouldBlock => continue,
            Err(error) => panic!("{error}"),
        };
        let mut bytes = &bytes[..count];
        while let Some(frame) = receiver.receive::<Report<'_>>(&mut bytes) {
            answered |= matches!(frame.unwrap().message, Report::Status(_));
        }
    }
    module.kill().unwrap();
    module.wait().unwrap();
    let mut frames = Vec::new();
    let mut output = module.stdout.take().unwrap();
    output.read_to_end(&mut frames).unwrap();

    let all = decode(&elf, &frames);
    println!("{all:?}");
    let expected = [
        ("defmt_info", "Started { faults: 0 }"),
        ("defmt_warn", "Refused(Setup(Size {"),
        ("defmt_warn", "FramesDamaged { frames: 1 }"),
    ];
    let (banner, events) = all.split_first().unwrap();
    assert_eq!(banner.0, "defmt_info");
    assert!(
        banner.1.starts_with("subaperture 0.") && banner.1.contains("on "),
        "{banner:?}"
    );
    for (event, (level, message)) in events.iter().zip(&expected) {
        assert_eq!(event.0, *level);
        assert!(event.1.starts_with(message), "{event:?}");
    }
    assert_eq!(events.len(), expected.len());
    assert!(
        events[1].1.contains(": Pulses, wanted: 9999, most: "),
        "{events:?}"
    );
    // The program contains no text of an argument: names of variants are in the section that is not loaded.
    let names = b"Refused";
    assert!(!frames.windows(names.len()).any(|bytes| bytes == names));
}
