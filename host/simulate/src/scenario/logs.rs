//! Navigation logs from `[[log]]`.

use std::path::Component;

use subaperture_io::date::nanoseconds;
use subaperture_model::radar::Radar;
use subaperture_navigation::GpsTime;
use subaperture_navigation::write::{Deviations, LogFormat};

use super::error::Fault;
use super::keys::{LogFormatKey, NavigationLogKeys, ScenarioKeys};
use crate::navigation_log::NavigationLog;

/// Largest number of records of a log.
const MAX_RECORDS: f64 = 1e7;

/// Navigation logs of a scenario; also checks the date of the collection.
pub(super) fn build(top: &ScenarioKeys, radar: &Radar) -> Result<Vec<NavigationLog>, Fault> {
    let start =
        match &top.collection_start {
            None => None,
            Some(text) => Some(nanoseconds(text).and_then(GpsTime::of_unix_ns).ok_or_else(
                || {
                    text.fault(
                        "expected a date from 1980 on as 2017-05-04T14:00:00Z, with Z for UTC",
                    )
                },
            )?),
        };
    let mut logs: Vec<NavigationLog> = Vec::with_capacity(top.log.len());
    for keys in &top.log {
        let Some(start) = start else {
            return Err(Fault::new(
                &keys.header,
                "a navigation log states GPS time: give the date of time 0, collection_start = \"2017-05-04T14:00:00Z\" at the \
                 beginning of the scenario",
            ));
        };
        if !top.scene.origin.is_given() {
            return Err(Fault::new(
                &keys.header,
                "a navigation log states latitude and longitude: give those of the scene in [scene.origin]",
            ));
        }
        let log = log(keys, radar, start)?;
        if logs.iter().any(|other| other.file == log.file) {
            return Err(keys
                .file
                .fault("two navigation logs have this name: rename one"));
        }
        logs.push(log);
    }
    Ok(logs)
}

fn log(keys: &NavigationLogKeys, radar: &Radar, start: GpsTime) -> Result<NavigationLog, Fault> {
    let mut parts = keys.file.components();
    let file = match (parts.next(), parts.next()) {
        (Some(Component::Normal(name)), None) => name.to_str(),
        _ => None,
    };
    let file = file.ok_or_else(|| {
        keys.file
            .fault("expected a file name without folders: the log is written next to the recording")
    })?;
    if keys.outages.iter().any(|(from_s, to_s)| to_s <= from_s) {
        return Err(keys
            .outages
            .fault("expected the end of an outage after its start"));
    }
    if let Some(drift) = &keys.drift_m_s2
        && matches!(keys.format, LogFormatKey::Nmea | LogFormatKey::Bestpos)
    {
        return Err(drift.fault(
            "a receiver without inertial sensors has no records in outages: remove 'drift', or set format = \"inspvax\"",
        ));
    }
    let log = NavigationLog {
        file: file.to_owned(),
        format: match keys.format {
            LogFormatKey::Nmea => LogFormat::Nmea,
            LogFormatKey::Inspvax => LogFormat::Inspvax,
            LogFormatKey::Bestpos => LogFormat::Bestpos,
            LogFormatKey::Sbet => LogFormat::Sbet,
        },
        start,
        rate_hz: *keys.rate_hz,
        deviations: Deviations {
            horizontal_m: keys.horizontal_m,
            vertical_m: keys.vertical_m,
            velocity_m_s: keys.velocity_m_s,
            attitude_deg: keys.attitude_rad.to_degrees(),
        },
        lever_arm_m: keys.lever_arm_m,
        undulation_m: keys.undulation_m,
        outages_s: keys.outages.to_vec(),
        drift_m_s2: keys.drift_m_s2.as_deref().copied(),
    };
    let count = log.times_s(radar).count() as f64;
    if count > MAX_RECORDS {
        return Err(keys.rate_hz.fault(format!(
            "the log would have {count} records, expected at most {MAX_RECORDS}: lower its rate"
        )));
    }
    Ok(log)
}
