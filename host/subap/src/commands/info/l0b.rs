//! Descriptions of NISAR L0B files, from their metadata.

use std::fmt::Write;
use std::path::Path;

use serde_json::{Value, json};
use subaperture::io::l0b::{L0bInfo, LookSide};

use crate::text;

/// Format, radar and channels.
pub(super) fn describe(path: &Path, info: &L0bInfo) -> String {
    let mut described = format!(
        "{:<16} NISAR L0B, {}, mission {}\n",
        path.display(),
        info.instrument,
        info.mission.as_deref().unwrap_or("not given"),
    );
    for channel in &info.channels {
        let _ = writeln!(
            described,
            "{:<16} {}: {} pulses of {} samples, {} about {}",
            "  channel",
            channel.name,
            channel.num_pulses,
            channel.num_samples,
            text::hertz(channel.bandwidth_hz),
            text::hertz(channel.centre_hz)
        );
    }
    described
}

pub(super) fn to_json(path: &Path, info: &L0bInfo) -> Value {
    json!({
        "path": path.to_string_lossy(),
        "format": "NISAR L0B",
        "instrument": info.instrument,
        "mission": info.mission,
        "look": match info.look {
            LookSide::Left => "left",
            LookSide::Right => "right",
        },
        "reference_channel": info.channels[0].name,
        "channels": info.channels.iter().map(|channel| json!({
            "id": channel.name,
            "vectors": channel.num_pulses,
            "samples": channel.num_samples,
            "tx_polarization": channel.tx_polarization,
            "rcv_polarization": channel.rcv_polarization,
            "centre_hz": channel.centre_hz,
            "bandwidth_hz": channel.bandwidth_hz,
            "sample_rate_hz": channel.sample_rate_hz,
            "chirp_hz_s": channel.chirp_hz_s,
            "duration_s": channel.duration_s,
        })).collect::<Vec<_>>(),
    })
}
