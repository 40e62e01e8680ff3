//! Smoothed best estimate of trajectory (SBET, Applanix): a file of records of 17 numbers, without a header.
//!
//! | number | quantity | unit |
//! |---|---|---|
//! | 0 | time | seconds of an unstated GPS week; beyond its end they continue or restart from 0 |
//! | 1, 2 | latitude, longitude | radians |
//! | 3 | height above the ellipsoid | metres |
//! | 4, 5, 6 | velocity along x and y of the wander frame, and up | metres a second |
//! | 7, 8, 9 | roll (right side down), pitch (nose up), heading in the wander frame | radians |
//! | 10 | wander angle | radians |
//! | 11 to 13, 14 to 16 | acceleration and rates of the body | not read |
//!
//! all float64, little-endian. The wander frame is north and east rotated counterclockwise by the wander angle: true heading is heading minus wander
//! angle, and velocities rotate in the same sense. [`crate::Log`] reports velocities that contradict the positions, as in a file with the other sign.
//!
//! There is no checksum: a record is valid if its numbers are finite and plausible and its time is at most [`LONGEST_STEP_S`] after the previous one.
//! After an invalid record, reading continues at the next two plausible records in a row, at any byte.

use std::io::{self, BufRead};

use glam::DVec3;
use std::f64::consts::{FRAC_PI_2, PI};

use subaperture_model::geometry::Geodetic;

use crate::account::{Clock, Fault, ReadReport, Wrong, count};
use crate::time::WEEK_S;
use crate::{Attitude, GpsTime, Kind, Options, Place, Record};

/// Size of a record, bytes.
pub(crate) const RECORD: usize = 17 * 8;

/// Largest time from one record to the next, seconds.
const LONGEST_STEP_S: f64 = 3600.0;

/// Largest time between the two records at which reading continues after damage, seconds.
const CLOSE_S: f64 = 1.0;

/// First 11 numbers of a record, if all are plausible.
pub(crate) fn plausible(bytes: &[u8]) -> Option<[f64; 11]> {
    let number = |n: usize| {
        bytes
            .get(8 * n..)?
            .first_chunk()
            .map(|&b| f64::from_le_bytes(b))
    };
    let mut numbers = [0.0; 17];
    for (n, value) in numbers.iter_mut().enumerate() {
        *value = number(n).filter(|value| value.is_finite())?;
    }
    let [
        time,
        latitude,
        longitude,
        height,
        vx,
        vy,
        vz,
        roll,
        pitch,
        heading,
        wander,
        ..,
    ] = numbers;
    let sound = (0.0..=1.3e6).contains(&time)
        && latitude.abs() <= FRAC_PI_2
        && longitude.abs() <= PI
        && (-1e4..=1e6).contains(&height)
        && [vx, vy, vz].iter().all(|v| v.abs() <= 1e4)
        && roll.abs() <= PI
        && pitch.abs() <= FRAC_PI_2 + 1e-9
        && heading.abs() <= 2.0 * PI
        && wander.abs() <= 2.0 * PI
        // Denormal values come from misaligned bytes.
        && [time, latitude, longitude].iter().all(|v| *v == 0.0 || v.abs() > 1e-300);
    sound.then_some([
        time, latitude, longitude, height, vx, vy, vz, roll, pitch, heading, wander,
    ])
}

/// Whether a file with these first bytes may be an SBET: two plausible records in a row, or a single one.
pub(crate) fn begins(head: &[u8]) -> bool {
    match (plausible(head), head.get(RECORD..)) {
        (Some(_), Some([])) => true,
        (Some(first), Some(rest)) => {
            plausible(rest).is_some_and(|next| follows(first[0], next[0], LONGEST_STEP_S).is_some())
        }
        _ => false,
    }
}

/// Weeks to add to `time_s` so that it is at most `longest_s` after `before_s`: 0, or 1 where the seconds of the week restart.
fn follows(before_s: f64, time_s: f64, longest_s: f64) -> Option<u32> {
    [0, 1].into_iter().find(|&weeks| {
        let step_s = time_s + f64::from(weeks) * WEEK_S - before_s;
        step_s > 0.0 && step_s <= longest_s
    })
}

/// Pass every record of a stream to `take`.
pub(crate) fn each(
    mut stream: impl BufRead,
    options: &Options,
    take: &mut dyn FnMut(Record),
) -> io::Result<ReadReport> {
    let mut account = ReadReport {
        clock: match options.week {
            Some(_) => Clock::Gps,
            None => Clock::SecondsOfWeek,
        },
        ..ReadReport::default()
    };
    let mut buffer = Vec::new();
    let mut from = 0;
    let mut last_s = None;
    // Weeks that ended since the first record.
    let mut weeks = 0u32;
    let mut lost = false;
    loop {
        if buffer.len() - from < 2 * RECORD {
            buffer.drain(..from);
            from = 0;
            let some = stream.fill_buf()?;
            let count = some.len().min(1 << 16);
            buffer.extend_from_slice(&some[..count]);
            stream.consume(count);
            if count > 0 {
                continue;
            }
        }
        let rest = &buffer[from..];
        if rest.len() < RECORD {
            account.lost_bytes += rest.len() as u64;
            if !rest.is_empty() && !lost {
                let description =
                    format!("expected {RECORD} bytes of a record, found {}", rest.len());
                account.fault(fault(account.bytes, Wrong::Cut, description));
            }
            account.bytes += rest.len() as u64;
            return Ok(account);
        }
        let numbers = plausible(rest).filter(|numbers| match lost {
            false => {
                last_s.is_none_or(|last_s| follows(last_s, numbers[0], LONGEST_STEP_S).is_some())
            }
            // Resume at a record that is followed by another, or is the last.
            true => match rest.get(RECORD..2 * RECORD) {
                Some(next) => plausible(next)
                    .is_some_and(|next| follows(numbers[0], next[0], CLOSE_S).is_some()),
                None => rest.len() == RECORD,
            },
        });
        let Some(numbers) = numbers else {
            if !lost {
                let description = match plausible(rest) {
                    Some(numbers) => {
                        format!(
                            "time is {} s after {} s, expected a later time within an hour",
                            numbers[0],
                            last_s.unwrap_or_default()
                        )
                    }
                    None => "expected the numbers of a record, found implausible ones".to_owned(),
                };
                account.fault(fault(account.bytes, Wrong::Value, description));
            }
            lost = true;
            from += 1;
            account.bytes += 1;
            account.lost_bytes += 1;
            continue;
        };
        lost = false;
        // A new week starts where seconds decrease by more than half a week, also after damage.
        if last_s.is_some_and(|last_s: f64| last_s - numbers[0] > WEEK_S / 2.0) {
            weeks = weeks.saturating_add(1);
            account.note("seconds of the GPS week restart: later records are in the next week");
        }
        last_s = Some(numbers[0]);
        count(&mut account.read, Kind::Sbet.name());
        take(record(account.bytes, &numbers, options.week, weeks));
        from += RECORD;
        account.bytes += RECORD as u64;
    }
}

fn fault(byte: u64, wrong: Wrong, description: String) -> Fault {
    Fault {
        byte,
        line: None,
        wrong,
        description,
    }
}

fn record(byte: u64, numbers: &[f64; 11], week: Option<u32>, ended: u32) -> Record {
    let &[
        time,
        latitude,
        longitude,
        height_m,
        vx,
        vy,
        up,
        roll,
        pitch,
        heading,
        wander,
    ] = numbers;
    let (sin, cos) = libm::sincos(wander);
    let time = time + f64::from(ended) * WEEK_S;
    // Seconds of an unknown week continue past its end.
    let seconds = match week {
        None => time,
        Some(_) => time.rem_euclid(WEEK_S),
    };
    let weeks = ((time - seconds) / WEEK_S).round() as u32;
    Record {
        place: Some(Place::Earth(Geodetic {
            latitude_deg: latitude.to_degrees(),
            longitude_deg: longitude.to_degrees(),
            height_m,
        })),
        velocity_m_s: Some(DVec3::new(vy * cos - vx * sin, vx * cos + vy * sin, up)),
        attitude: Some(Attitude {
            roll_deg: Some(roll.to_degrees()),
            pitch_deg: Some(pitch.to_degrees()),
            azimuth_deg: (heading - wander).to_degrees().rem_euclid(360.0),
        }),
        ..Record::at(
            byte,
            Kind::Sbet,
            GpsTime {
                week: week.unwrap_or(0).saturating_add(weeks),
                seconds,
            },
        )
    }
}
