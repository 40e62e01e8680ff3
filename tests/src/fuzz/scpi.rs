//! Answers of a network analyser: blocks, numbers, entries of the error queue.

use subaperture::radio::vna::ByteOrder;
use subaperture::radio::vna::answer::{block, number, numbers, queue_entry};

pub(super) const WORDS: &[&str] = &[
    "#",
    "#0",
    "#1",
    "#216",
    "#6000016",
    "#9999999999",
    "\n",
    "\r\n",
    "-113,\"",
    "+0,\"No error\"",
    "E+009",
    "NaN",
    "inf",
];

/// Longest block that is accepted, bytes.
const MOST_BYTES: usize = 4096;

pub(super) fn seeds() -> Vec<Vec<u8>> {
    let values = [1.5f64, -2.0].map(f64::to_le_bytes).concat();
    let of = |header: &[u8]| [header, &values, b"\n"].concat();
    vec![
        of(b"#216"),
        of(b"#6000016"),
        of(b"#19"),
        b"+1.00000000000E+009\n".to_vec(),
        b"-113,\"Undefined header;SENS1:X?\"\n".to_vec(),
        b"+0,\"No error\"\n".to_vec(),
    ]
}

pub(super) fn read(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(bytes);
    if let Ok(number) = number(&text) {
        assert!(number.is_finite());
    }
    if let Ok((_, message)) = queue_entry(&text) {
        assert!(!message.chars().any(char::is_control), "{message:?}");
    }
    let found = block(bytes, MOST_BYTES);
    // More bytes never change an answer that did not need them.
    let part = block(&bytes[..bytes.len() / 2], MOST_BYTES);
    if let Ok(Some(place)) = &part {
        assert_eq!(found.as_ref().ok(), Some(&Some(place.clone())));
    }
    match found {
        Ok(None) => "incomplete".to_owned(),
        Ok(Some(place)) => {
            assert!(place.len() <= MOST_BYTES && (3..=11).contains(&place.start));
            let Some(data) = bytes.get(place) else {
                return "incomplete".to_owned();
            };
            let [little, big] =
                [ByteOrder::Little, ByteOrder::Big].map(|order| numbers(data, order));
            match (little, big) {
                (Ok(little), Ok(big)) => {
                    assert_eq!(little.len(), data.len() / 8);
                    let swapped = big.iter().map(|n| n.to_bits().swap_bytes());
                    assert!(little.iter().map(|n| n.to_bits()).eq(swapped));
                    format!("{} numbers", little.len())
                }
                (Err(error), Err(_)) => error.to_string(),
                _ => panic!("the byte order changes the count"),
            }
        }
        Err(error) => error.to_string(),
    }
}
