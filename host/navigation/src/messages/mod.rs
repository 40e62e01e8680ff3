//! Messages of receivers, side by side in one stream: NovAtel's in ASCII and binary, and NMEA 0183.
//!
//! [`frame`] cuts the stream, [`novatel`] and [`nmea`] say what is read of messages. Bytes that belong to none, messages that are cut short or
//! damaged and values that cannot be are counted and told, never fatal.

mod abbreviated;
mod body;
mod frame;
mod nmea;
mod novatel;

use std::io::{self, BufRead};

use crate::account::{Clock, Fault, ReadReport, Wrong, count};
use crate::{Options, Record};
use frame::{Frames, Message, Met};
use nmea::Sentences;

const UNCHECKED: &str = "sentences of NMEA have no checksum: damaged digits go unnoticed";
const ABBREVIATED: &str = "records of NovAtel's abbreviated ASCII have no CRC: damaged digits go unnoticed (LOG BESTPOSA writes one)";

/// Hands every record of a stream to `take`.
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
    while let Some((at, met)) = frames.next()? {
        let fault = |wrong, what| Fault {
            byte: at.byte,
            line: at.line,
            wrong,
            what,
        };
        match met {
            Met::Wrong(wrong, what) => account.fault(fault(wrong, what)),
            Met::Message(Message::Nmea { text, checked }) => {
                if !checked {
                    account.note(UNCHECKED);
                }
                let said = sentences.push(text, at.byte, options, &mut account, take);
                if let Err(what) = said {
                    account.fault(fault(Wrong::Value, what));
                }
            }
            Met::Message(message) => {
                let abbreviated = matches!(message, Message::Abbreviated { .. });
                match novatel::parse(&message, at.byte) {
                    (name, None) => count(&mut account.others, &name),
                    (name, Some(Ok(None))) => count(&mut account.unsolved, &name),
                    (_, Some(Err(what))) => account.fault(fault(Wrong::Value, what)),
                    (name, Some(Ok(Some((record, utc_s))))) => {
                        count(&mut account.read, &name);
                        if abbreviated {
                            account.note(ABBREVIATED);
                        }
                        // UTC is behind, and less whole seconds but for nanoseconds.
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
