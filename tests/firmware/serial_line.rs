//! Serial line of the emulated board: bytes in both directions.

use std::io::{Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::path::Path;
use std::process::Child;
use std::time::Instant;

use subaperture_tests::firmware::{Build, TIME_LIMIT, build, emulator};

/// The emulator with its serial port connected to this process.
struct Wired {
    emulator: Child,
    link: TcpStream,
}

impl Wired {
    fn start(elf: &Path) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let serial = format!("tcp:{}", listener.local_addr().unwrap());
        let emulator = emulator(elf, &["-serial", &serial]);
        let link = listener.accept().unwrap().0;
        link.set_read_timeout(Some(TIME_LIMIT)).unwrap();
        Self { emulator, link }
    }
}

impl Drop for Wired {
    fn drop(&mut self) {
        let _ = self.emulator.kill();
        let _ = self.emulator.wait();
    }
}

/// Bytes without a short period, in which a lost byte could remain undetected (Knuth's generator).
pub(crate) fn noise(bytes: usize) -> Vec<u8> {
    let mut state = 1u64;
    let next = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (state >> 56) as u8
    };
    std::iter::repeat_with(next).take(bytes).collect()
}

/// Send `bytes` bytes over `link` and read as many back; returns the rate in bytes per second.
pub(crate) fn echo(link: &mut TcpStream, bytes: usize) -> f64 {
    let sent = noise(bytes);
    let started = Instant::now();
    let mut received = vec![0; bytes];
    let mut writer = link.try_clone().unwrap();
    std::thread::scope(|scope| {
        scope.spawn(|| writer.write_all(&sent).unwrap());
        let result = link.read_exact(&mut received);
        if result.is_err() {
            // Otherwise the writer would wait for an emulator that has stopped.
            let _ = link.shutdown(Shutdown::Both);
        }
        result.expect("as many bytes come back as were sent");
    });
    let first = sent.iter().zip(&received).position(|(a, b)| a != b);
    assert_eq!(first, None, "the first byte that differs");
    bytes as f64 / started.elapsed().as_secs_f64()
}

/// A program slower than its input makes the sender wait, and no byte is lost: 64 kB are more than the 64 bytes it takes at a time, and all
/// are sent before the first comes back.
#[test]
fn slow_reader_receives_every_byte() {
    let elf = build(&Build::example("slow_echo", ""));
    let rate = echo(&mut Wired::start(&elf).link, 65_536);
    println!("slow echo: {rate:.0} bytes a second");
    // At most 64 bytes per millisecond, so the program did pause.
    assert!(rate < 64_000.0, "{rate}");
}

/// The emulated UART transfers bytes one at a time, with several system calls each.
#[test]
fn echoed_bytes_are_unchanged() {
    let elf = build(&Build::example("echo", ""));
    let rate = echo(&mut Wired::start(&elf).link, 131_072);
    println!("echo: {rate:.0} bytes a second there and back");
}
