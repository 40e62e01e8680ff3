//! Event sent to the page, in JSON.

use std::sync::Arc;

use serde::Serialize;
use subaperture_radio::live::{Level, Picture, Row, Status};

use crate::level::tenths;

/// State of a capture, as sent in an event.
#[derive(Serialize)]
pub(crate) struct Message<'a> {
    name: &'a str,
    steps: usize,
    sweeps: u64,
    sweep: Option<u64>,
    usable: usize,
    /// Flagged steps of the latest sweep.
    flagged: Named<usize>,
    reference: Channel,
    echo: Channel,
    rate_hz: Option<f64>,
    taken: u64,
    bursts: u64,
    /// Flagged steps since the start of the capture.
    flagged_ever: Named<u64>,
    events: Events,
    lost_samples: u64,
    late_sweeps: u64,
    waits: u64,
    queue: usize,
    queue_holds: usize,
    not_shown: u64,
    free_bytes: Option<u64>,
    disk_lasts_s: Option<f64>,
    ranges_m: [f64; 2],
    calibrated: bool,
    ended: Option<&'a str>,
    /// Number of waterfall rows that are kept.
    most_rows: usize,
    rows: Vec<TenthsOfDb>,
    picture: Option<About>,
}

#[derive(Serialize)]
struct Named<T> {
    late: T,
    lost: T,
    unsteady: T,
    clipped: T,
    unlocked: T,
}

#[derive(Serialize)]
struct Events {
    overflows: u64,
    underflows: u64,
    late_commands: u64,
    lost_packets: u64,
    gone: u64,
}

/// Levels in dBFS; `None` for zero amplitude.
#[derive(Serialize)]
struct Channel {
    rms_db: Option<f64>,
    peak_db: Option<f64>,
    clipped: u64,
}

#[derive(Serialize)]
struct TenthsOfDb {
    sweep: u64,
    levels: Vec<i16>,
}

/// Description of an image, without its pixels.
#[derive(Serialize)]
struct About {
    revision: u64,
    columns: usize,
    rows: usize,
    x_m: [f64; 2],
    y_m: [f64; 2],
    highest_db: Option<f32>,
    pulses: u64,
}

impl<'a> Message<'a> {
    pub(crate) fn new(
        status: &'a Status,
        rows: &[Arc<Row>],
        most_rows: usize,
        picture: Option<(&Picture, u64)>,
    ) -> Self {
        let [reference, echo] = status.levels.map(Channel::new);
        let counts = &status.counts;
        let [overflows, underflows, late_commands, lost_packets, gone] = counts.events;
        Self {
            name: &status.name,
            steps: status.steps,
            sweeps: status.sweeps,
            sweep: status.sweep,
            usable: status.usable,
            flagged: Named::new(status.flagged),
            reference,
            echo,
            rate_hz: status.rate_hz,
            taken: counts.steps,
            bursts: counts.bursts,
            flagged_ever: Named::new(counts.flagged),
            events: Events {
                overflows,
                underflows,
                late_commands,
                lost_packets,
                gone,
            },
            lost_samples: counts.lost_samples,
            late_sweeps: counts.late_sweeps,
            waits: counts.waits,
            queue: counts.queue,
            queue_holds: counts.queue_holds,
            not_shown: counts.not_shown,
            free_bytes: status.free_bytes,
            disk_lasts_s: status.disk_lasts_s,
            ranges_m: status.ranges_m,
            calibrated: status.calibrated,
            ended: status.ended.as_deref(),
            most_rows,
            rows: rows.iter().map(|row| TenthsOfDb::new(row)).collect(),
            picture: picture.map(|(picture, revision)| About {
                revision,
                columns: picture.columns,
                rows: picture.rows(),
                x_m: picture.x_m,
                y_m: picture.y_m,
                highest_db: picture.highest_db(),
                pulses: picture.pulses,
            }),
        }
    }
}

impl<T> Named<T> {
    fn new([late, lost, unsteady, clipped, unlocked]: [T; 5]) -> Self {
        Self {
            late,
            lost,
            unsteady,
            clipped,
            unlocked,
        }
    }
}

impl Channel {
    fn new(level: Level) -> Self {
        let db = |part: f64| (part > 0.0).then(|| 20.0 * part.log10());
        Self {
            rms_db: db(level.rms),
            peak_db: db(level.peak),
            clipped: level.clipped,
        }
    }
}

impl TenthsOfDb {
    fn new(row: &Row) -> Self {
        Self {
            sweep: row.sweep,
            levels: row.levels_db.iter().map(|db| tenths(*db)).collect(),
        }
    }
}

/// Levels of an image as they are sent: 16-bit tenths of dB, little-endian.
pub(crate) fn pixels(picture: &Picture) -> Vec<u8> {
    let bytes = |db: &f32| tenths(*db).to_le_bytes();
    picture.levels_db.iter().flat_map(bytes).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Zero amplitude has no level in dB, and JSON has no infinity.
    #[test]
    fn state_before_first_sweep_is_valid_json() {
        let status = Status {
            name: "a \"name\" </script>".to_owned(),
            ..Status::default()
        };
        let text = serde_json::to_string(&Message::new(&status, &[], 8, None)).unwrap();
        let read: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!(read["name"], status.name.as_str());
        assert!(read["reference"]["rms_db"].is_null() && read["sweep"].is_null());
    }
}
