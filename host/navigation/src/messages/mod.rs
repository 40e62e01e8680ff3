//! Messages of receivers, mixed in one stream: NovAtel ASCII and binary, and NMEA 0183.
//!
//! [`frame`] cuts the stream into messages, [`novatel`] and [`nmea`] parse them. Bytes outside messages, truncated or damaged messages and impossible
//! values are counted and reported, and do not end the reading.

mod abbreviated;
mod body;
mod frame;
mod nmea;
mod novatel;

use std::io::{self, BufRead};

use crate::account::{Clock, Fault, ReadReport, Wrong, count};
use crate::{Options, Record};
use frame::{Event, Frames, Message};
use nmea::Sentences;

pub(crate) use frame::crc;

const UNCHECKED: &str = "NMEA sentences have no checksum: damaged digits are not detected";
const ABBREVIATED: &str = "NovAtel abbreviated ASCII records have no CRC: damaged digits are not detected (LOG BESTPOSA writes a CRC)";

/// Pass every record of a stream to `take`.
pub(crate) fn each(
    stream: impl BufRead,
    options: &Options,
    take: &mut dyn FnMut(Record),
) -> io::Result<ReadReport> {
    let mut account = ReadReport {
        clock: Clock::Gps,
        ..ReadReport::default()
    };
    let mut frames = Frames::new(stream);
    let mut sentences = Sentences::new(options);
    while let Some((at, event)) = frames.next()? {
        let fault = |wrong, description| Fault {
            byte: at.byte,
            line: at.line,
            wrong,
            description,
        };
        match event {
            Event::Wrong(wrong, description) => account.fault(fault(wrong, description)),
            Event::Message(Message::Nmea { text, checked }) => {
                if !checked {
                    account.note(UNCHECKED);
                }
                let parsed = sentences.push(text, at.byte, options, &mut account, take);
                if let Err(description) = parsed {
                    account.fault(fault(Wrong::Value, description));
                }
            }
            Event::Message(message) => {
                let abbreviated = matches!(message, Message::Abbreviated { .. });
                match novatel::parse(&message, at.byte) {
                    (name, None) => count(&mut account.others, &name),
                    (name, Some(Ok(None))) => count(&mut account.unsolved, &name),
                    (_, Some(Err(description))) => account.fault(fault(Wrong::Value, description)),
                    (name, Some(Ok(Some((record, utc_s))))) => {
                        count(&mut account.read, &name);
                        if abbreviated {
                            account.note(ABBREVIATED);
                        }
                        // UTC is behind GPS time by whole seconds, except for nanoseconds.
                        let leap_s = utc_s.map(|utc_s| (-utc_s).round() as i32);
                        account.leap_seconds_s = leap_s.or(account.leap_seconds_s);
                        take(record);
                    }
                }
            }
        }
    }
    sentences.finish(options, &mut account, take);
    account.bytes = frames.bytes();
    account.lost_bytes = frames.lost_bytes;
    Ok(account)
}
