//! `subap link --send detections`: the module detects targets on its maps, and sends their list.

use std::fmt::Write as _;
use std::io::Write as _;
use std::time::Instant;

use subaperture::io::atomic::write_atomically;
use subaperture::io::ours::TEXT_MARK;
use subaperture::io::written::{FileKind, WrittenFile};
use subaperture::module::detections::{LocatedDetection, Locator};
use subaperture::module::link::{self, ChannelDetection, DetectionSink, Detector, Job, SinkError};
use subaperture::phase_history::Collection;
use subaperture_core::cfar::{Cfar, TrainingWindow};

use super::outcome::{Received, report};
use super::receiving::Watching;
use super::work::Work;
use crate::interrupt;

/// Guard and training cells of the detector: a map has two bins or more per resolution cell.
const WINDOWS: [TrainingWindow; 2] = [
    TrainingWindow {
        guard: 4,
        training: 8,
    },
    TrainingWindow {
        guard: 4,
        training: 4,
    },
];

/// Default probability of a false alarm per map cell.
const FALSE_ALARMS: f64 = 1e-6;

/// Maximum number of detections kept: 32 on each of 10^6 maps would take 2 GiB.
const MAX_DETECTIONS: usize = 1 << 20;

/// Sink that locates detections.
struct Locating<'a> {
    locator: Locator<'a>,
    located: Vec<LocatedDetection>,
}

impl DetectionSink for Locating<'_> {
    fn accept(
        &mut self,
        sub_cpi: u32,
        patch: u16,
        list: &[ChannelDetection],
    ) -> Result<(), SinkError> {
        if self.located.len() + list.len() > MAX_DETECTIONS {
            return Err(format!(
                "detections: expected at most {MAX_DETECTIONS}: give a smaller --false-alarms or a smaller --grid"
            )
            .into());
        }
        let located = self.locator.locate(sub_cpi, patch, list);
        self.located.extend(located);
        Ok(())
    }
}

impl Work<'_> {
    /// Settings of the detector.
    pub(super) fn detector(&self) -> Detector {
        let [range, doppler] = WINDOWS;
        Detector {
            cfar: Cfar {
                range,
                doppler,
                false_alarm_probability: self.typed.false_alarms.unwrap_or(FALSE_ALARMS),
            },
            dpca: self.dpca,
        }
    }

    /// Let the module detect targets, and write their list.
    pub(super) fn detect(
        &self,
        module: &mut link::Session<'_>,
        job: &mut Job<'_>,
        watch: &mut Watching,
        start: Instant,
    ) -> anyhow::Result<()> {
        // From here on, an interruption keeps the detections received.
        let _keeping = interrupt::Keeping::begin();
        let channels: Vec<&Collection> = (self.channels.iter())
            .map(|channel| channel.collection())
            .collect();
        let mut sink = Locating {
            locator: Locator::new(&channels, self.grid, self.plan).aligned(self.dpca),
            located: Vec::new(),
        };
        let outcome = module.detect(job, &self.detector(), &mut sink, watch);
        watch.bar.finish();
        let (maps, mut located) = (outcome.counts.maps_taken, sink.located);
        located.sort_by_key(|detection| (detection.sub_cpi, detection.patch));
        let (mut content, mut files) = (None, Vec::new());
        if maps > 0 {
            let scale = f64::from(job.pulses.amplitude_scale()).powi(2);
            let list = csv(&located, channels.len(), self.dpca.is_some(), scale);
            write_atomically(&self.typed.out, list.len() as u64, |file| {
                file.write_all(list.as_bytes())
            })?;
            content = Some(format!("{} detections on {maps} maps", located.len()));
            files.push(WrittenFile::new(&self.typed.out, FileKind::Detections));
        }
        let received = Received {
            content,
            numbers: vec![("detections", located.len() as u64), ("maps", maps)],
            compared: None,
            files,
        };
        report(self.session, self.typed, &outcome, &received, start)
    }
}

/// Table of the detections, with power and phase of each channel, and the radial velocity if the clutter was cancelled. Powers are divided by `scale`, the factor by which the module's
/// pulses are stronger than the recording.
fn csv(located: &[LocatedDetection], num_channels: usize, cancelled: bool, scale: f64) -> String {
    let mut text = format!(
        "# {TEXT_MARK} {}; position of a target at rest, and phases without that of such a target\n\
         sub_cpi,patch,time_s,range_bin,doppler_bin,path_m,path_rate_m_s,x_m,y_m,z_m,power_db,snr_db",
        env!("CARGO_PKG_VERSION")
    );
    for number in 1..=num_channels {
        // Writing to a string cannot fail.
        let _ = write!(text, ",power_{number}_db,phase_{number}_rad");
    }
    if cancelled {
        text.push_str(",radial_velocity_m_s");
    }
    text.push('\n');
    for one in located {
        let LocatedDetection { detection, .. } = one;
        let optional = |value: Option<f64>| value.map_or_else(String::new, |v| v.to_string());
        let at = |axis: usize| optional(one.position_m.map(|position_m| position_m[axis]));
        let power_db = |power: f32| 10.0 * (f64::from(power) / scale).log10();
        let _ = write!(
            text,
            "{},{},{},{},{},{},{},{},{},{},{:.3},{:.3}",
            one.sub_cpi,
            one.patch,
            one.time_s,
            detection.range_bin,
            detection.doppler_bin,
            one.path_m,
            optional(one.path_rate_m_s),
            at(0),
            at(1),
            at(2),
            power_db(detection.power),
            power_db(detection.power) - power_db(detection.noise)
        );
        for channel in &one.channels {
            let (power_db, phase_rad) = (power_db(channel.power), channel.phase_rad);
            let phase_rad = phase_rad.map_or_else(String::new, |phase| format!("{phase:.6}"));
            let _ = write!(text, ",{power_db:.3},{phase_rad}");
        }
        if cancelled {
            let velocity = one.radial_velocity_m_s;
            let _ = write!(
                text,
                ",{}",
                velocity.map_or_else(String::new, |v| format!("{v:.6}"))
            );
        }
        text.push('\n');
    }
    text
}
