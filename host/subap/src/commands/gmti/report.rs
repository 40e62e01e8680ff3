//! Targets and tracks as text.

use std::path::Path;

use subaperture::gmti::Target;
use subaperture::gmti::tracker::{Status, Track};

use super::found::Found;
use crate::text;

/// Print cancellation, targets and tracks, which were written to `out`.
pub(crate) fn say(out: &Path, found: &Found) -> anyhow::Result<()> {
    for channel in &found.channels {
        let Some(compared) = &channel.compared else {
            continue;
        };
        text::say(format!(
            "channel {}: lag {:+.3} ms, clutter cancelled by {:.1} dB, coherence {:.6}",
            channel.name,
            1e3 * channel.lag_s,
            compared.cancellation.ratio_db,
            compared.cancellation.coherence
        ))?;
    }
    text::say(format!(
        "{}: {}, {} side lobes left out, {:.0} cells tested",
        out.display(),
        found.counted(),
        found.side_lobes,
        found.cells
    ))?;
    if let Some(sensitivity) = &found.sensitivity {
        let mdv = match sensitivity.mdv_m_s {
            Some(mdv_m_s) => format!("{mdv_m_s:.3} m/s"),
            None => "none".to_owned(),
        };
        text::say(format!(
            "minimum detectable velocity of a target of {} m^2 (Swerling 1, Pd 0.5): {mdv}",
            sensitivity.cross_section_m2
        ))?;
    }
    let targets = || {
        let dwells = found.dwells.iter();
        dwells
            .flatten()
            .zip(1..)
            .map(|(target, i)| target_row(i, target))
    };
    if found.num_targets() > 0 {
        let header = [
            "no.",
            "t (s)",
            "x, y (m)",
            "sigma (m)",
            "radial velocity (m/s)",
            "sigma (m/s)",
            "cross-range velocity (m/s)",
            "SNR (dB)",
            "in the image at (m)",
        ];
        text::say(text::table(&header, &targets().collect::<Vec<_>>()))?;
    }
    let tracks: Vec<Vec<String>> = found.tracks().filter_map(track_row).collect();
    if !tracks.is_empty() {
        let header = [
            "track",
            "from, to (s)",
            "updates",
            "x, y (m)",
            "velocity x, y (m/s)",
            "sigma (m/s)",
            "status",
        ];
        text::say(text::table(&header, &tracks))?;
    }
    Ok(())
}

fn target_row(number: usize, target: &Target) -> Vec<String> {
    let place = match target.position_m {
        Some([x, y, _]) => format!("{x:.1}, {y:.1}"),
        None => "outside the plane".to_owned(),
    };
    let [image_x, image_y, _] = target.image_position_m;
    let error = target
        .covariance_m2
        .map_or(String::new(), |[[xx, _], [_, yy]]| {
            format!("{:.2}, {:.2}", xx.sqrt(), yy.sqrt())
        });
    let across = target.cross_range.map_or(String::new(), |across| {
        format!("{:+.2} +- {:.2}", across.velocity_m_s, across.deviation_m_s)
    });
    vec![
        number.to_string(),
        format!("{:.2}", target.time_s),
        place,
        error,
        format!("{:+.3}", target.radial_velocity_m_s),
        format!("{:.3}", target.velocity_deviation_m_s),
        across,
        format!("{:.1}", target.snr_db),
        format!("{image_x:.1}, {image_y:.1}"),
    ]
}

fn track_row(track: &Track) -> Option<Vec<String>> {
    let (first, last) = (track.history.first()?, track.history.last()?);
    let updates = track
        .history
        .iter()
        .filter(|update| update.detection.is_some());
    let [x, y, vx, vy] = last.mean;
    let deviation = (last.covariance[2][2] + last.covariance[3][3]).sqrt();
    let status = match track.status {
        Status::Tentative => "tentative".to_owned(),
        Status::Confirmed { .. } => "confirmed".to_owned(),
        Status::Deleted { time_s } => format!("deleted at {time_s:.2} s"),
    };
    Some(vec![
        format!("T{}", track.id),
        format!("{:.2}, {:.2}", first.time_s, last.time_s),
        format!("{} of {}", updates.count(), track.history.len()),
        format!("{x:.1}, {y:.1}"),
        format!("{vx:+.2}, {vy:+.2}"),
        format!("{deviation:.2}"),
        status,
    ])
}
