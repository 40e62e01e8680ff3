//! Random changes of bytes, reproducible by seed.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use super::Target;

/// Maximum length of an input.
const LONGEST: usize = 1 << 16;

/// Numbers at the limits of types and formats.
const NUMBERS: [u64; 18] = [
    0,
    1,
    2,
    7,
    8,
    0x7f,
    0x80,
    0xff,
    0x100,
    0x7fff,
    0x8000,
    0xffff,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_ffff,
    0x7fff_ffff_ffff_ffff,
    0x8000_0000_0000_0000,
    0xffff_ffff_ffff_ffff,
];

const FLOATS: [f64; 16] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    0.5,
    1e-9,
    1e9,
    -1e9,
    299_792_458.0,
    1e19,
    5e236,
    f64::MAX,
    f64::MIN_POSITIVE,
    5e-324,
    f64::INFINITY,
    f64::NAN,
];

const TEXTS: [&str; 22] = [
    "0",
    "1",
    "-1",
    "2",
    "3",
    "9",
    "0.0",
    "-0",
    "1e-9",
    "1e9",
    "1e18",
    "1e300",
    "1e-300",
    "1e400",
    "nan",
    "inf",
    "65535",
    "65536",
    "4294967295",
    "9223372036854775807",
    "18446744073709551616",
    "1e999999999",
];

/// Random changes of inputs.
pub struct Mutator(ChaCha8Rng);

impl Mutator {
    /// A mutator; the same seed makes the same changes.
    pub fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    fn below(&mut self, end: usize) -> usize {
        (self.0.next_u64() % end.max(1) as u64) as usize
    }

    fn one_in(&mut self, n: usize) -> bool {
        self.below(n) == 0
    }

    fn of<T: Copy>(&mut self, list: &[T]) -> T {
        list[self.below(list.len())]
    }

    /// A new input from one of `pool`, with parts of others; three in four are repaired.
    pub fn make(&mut self, target: &Target, pool: &[Vec<u8>]) -> Vec<u8> {
        let mut bytes = pool[self.below(pool.len())].clone();
        let other = self.below(pool.len());
        for _ in 0..1 << self.below(4) {
            self.change(&mut bytes, &pool[other], target.words);
        }
        bytes.truncate(LONGEST);
        if !self.one_in(4) {
            (target.repair)(&mut bytes);
        }
        bytes
    }

    /// One change.
    fn change(&mut self, bytes: &mut Vec<u8>, other: &[u8], words: &[&str]) {
        let at = self.below(bytes.len() + 1);
        let length = 1 << self.below(9);
        let end = (at + self.below(length) + 1).min(bytes.len());
        match self.below(13) {
            0 | 1 => {
                if let Some(byte) = bytes.get_mut(at) {
                    *byte ^= 1 << (self.0.next_u32() % 8);
                }
            }
            2 => {
                if let Some(byte) = bytes.get_mut(at) {
                    *byte = self.0.next_u32() as u8;
                }
            }
            3 => {
                let number = self.of(&NUMBERS);
                let width = self.of(&[1, 2, 4, 8]);
                self.put(bytes, at, &number.to_le_bytes()[..width]);
            }
            4 => {
                let number = self.of(&FLOATS);
                let narrow = self.one_in(2);
                match narrow {
                    true => self.put(bytes, at, &(number as f32).to_le_bytes()),
                    false => self.put(bytes, at, &number.to_le_bytes()),
                }
            }
            5 => drop(bytes.drain(at.min(end)..end)),
            6 => {
                let piece = bytes[at.min(end)..end].to_vec();
                bytes.splice(at..at, piece);
            }
            7 => bytes.truncate(at),
            8 => {
                // Part of another input, replacing bytes or inserted.
                let from = self.below(other.len());
                let to = (from + length).min(other.len());
                let gone = if self.one_in(2) { end } else { at };
                bytes.splice(at..gone.max(at), other[from..to].iter().copied());
            }
            9 if !words.is_empty() => {
                let word = self.of(words);
                bytes.splice(at..at, word.bytes());
            }
            10 => self.change_line(bytes),
            _ => self.change_number(bytes, at),
        }
    }

    /// Overwrite bytes with `value`, in either byte order.
    fn put(&mut self, bytes: &mut [u8], at: usize, value: &[u8]) {
        let swapped = self.one_in(2);
        // Most formats align their numbers.
        let at = if self.one_in(2) { at & !3 } else { at };
        for (i, place) in bytes.iter_mut().skip(at).take(value.len()).enumerate() {
            *place = value[if swapped { value.len() - 1 - i } else { i }];
        }
    }

    /// Replace the next decimal number after `at` by another.
    fn change_number(&mut self, bytes: &mut Vec<u8>, at: usize) {
        let digit = |byte: &u8| byte.is_ascii_digit();
        let Some(start) = bytes.iter().skip(at).position(digit) else {
            return;
        };
        let start = at + start;
        let length = bytes[start..].iter().take_while(|b| digit(b)).count();
        let text = match self.below(3) {
            0 => self.of(&TEXTS).to_owned(),
            1 => self.below(1 << length.min(40)).to_string(),
            _ => {
                let old = String::from_utf8_lossy(&bytes[start..start + length]).into_owned();
                let number: u64 = old.parse().unwrap_or(0);
                let other = [
                    number.wrapping_add(1),
                    number.wrapping_sub(1),
                    number.wrapping_mul(10),
                ];
                self.of(&other).to_string()
            }
        };
        bytes.splice(start..start + length, text.bytes());
    }

    /// Delete, repeat or move a line.
    fn change_line(&mut self, bytes: &mut Vec<u8>) {
        let mut lines: Vec<&[u8]> = bytes.split_inclusive(|&byte| byte == b'\n').collect();
        let (from, to) = (self.below(lines.len()), self.below(lines.len()));
        match (lines.get(from).copied(), self.below(3)) {
            (None, _) => return,
            (Some(_), 0) => drop(lines.remove(from)),
            (Some(line), 1) => lines.insert(to, line),
            _ => lines.swap(from, to),
        }
        *bytes = lines.concat();
    }
}
