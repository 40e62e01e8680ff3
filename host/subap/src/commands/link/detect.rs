//! `subap link --send detections`: the module detects targets on its maps, and sends their list.

use std::fmt::Write as _;
use std::io::Write as _;
use std::time::Instant;

use anyhow::bail;
use serde_json::json;
use subaperture::io::atomic::write_atomically;
use subaperture::io::ours::TEXT_MARK;
use subaperture::io::written::{FileKind, WrittenFile};
use subaperture::module::detections::{LocatedDetection, Locator};
use subaperture::module::link::{self, DetectionSink, Job, SinkError, TransferEnd};
use subaperture_core::cfar::{Cfar, Detection, TrainingWindow};

use super::outcome::{ending_name, refuse_failure};
use super::receiving::Watching;
use super::work::Work;
use crate::config::record_of_run;
use crate::text;

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

/// Maximum number of detections kept: 32 on each of 10^6 maps would take 2 GiB.
const MAX_DETECTIONS: usize = 1 << 20;

/// Sink that locates detections.
struct Locating<'a> {
    locator: Locator<'a>,
    located: Vec<LocatedDetection>,
}

impl DetectionSink for Locating<'_> {
    fn accept(&mut self, sub_cpi: u32, patch: u16, list: &[Detection]) -> Result<(), SinkError> {
        if self.located.len() + list.len() > MAX_DETECTIONS {
            return Err(format!(
                "detections: expected at most {MAX_DETECTIONS}: give a smaller --false-alarms or a smaller --grid"
            )
            .into());
        }
        let located = list
            .iter()
            .filter_map(|detection| self.locator.locate(sub_cpi, patch, detection));
        self.located.extend(located);
        Ok(())
    }
}

impl Work<'_> {
    /// Settings of the detector.
    pub(super) fn cfar(&self) -> Cfar {
        let [range, doppler] = WINDOWS;
        Cfar {
            range,
            doppler,
            false_alarm_probability: self.typed.false_alarms,
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
        let Self {
            session,
            typed,
            history,
            grid,
            plan,
            ..
        } = *self;
        let mut sink = Locating {
            locator: Locator::new(history.collection(), grid, plan),
            located: Vec::new(),
        };
        let outcome = module.detect(job, &self.cfar(), &mut sink, watch);
        watch.bar.finish();
        let counts = &outcome.counts;
        if counts.maps_taken == 0 {
            refuse_failure(&outcome.ending)?;
            bail!("no list was received: the line loses too many frames; no file was written");
        }
        let mut located = sink.located;
        located.sort_by_key(|detection| (detection.sub_cpi, detection.patch));
        let scale = f64::from(job.pulses.amplitude_scale()).powi(2);
        let list = csv(&located, scale);
        write_atomically(&typed.out, list.len() as u64, |file| {
            file.write_all(list.as_bytes())
        })?;
        let complete = counts.maps_taken == counts.maps_wanted;
        let ratio = counts.down_up_ratio();
        if session.json() {
            text::say_json(
                "link",
                json!({
                    "detections": located.len(),
                    "maps": counts.maps_taken,
                    "ending": ending_name(&outcome.ending, !complete),
                    "counters": counts.to_json(),
                    "down_up_ratio": ratio,
                    "run": record_of_run(session, start.elapsed()),
                    "files": [WrittenFile::new(&typed.out, FileKind::Detections)],
                }),
            )?;
        } else if session.prints_text() {
            text::say(format!(
                "{}: {} detections on {} maps in {}",
                typed.out.display(),
                located.len(),
                counts.maps_taken,
                text::duration(start.elapsed())
            ))?;
            text::say(counts.to_string())?;
            text::say(format!(
                "ratio     {ratio:.4} bytes from the module for each byte to it"
            ))?;
        }
        if complete {
            return Ok(());
        }
        if let TransferEnd::Complete | TransferEnd::Incomplete = outcome.ending {
            bail!(
                "the detections of {} of {} maps are missing in {}: the line loses too many frames",
                outcome.missing.len(),
                counts.maps_wanted,
                typed.out.display()
            );
        }
        refuse_failure(&outcome.ending)
    }
}

/// Table of the detections. Powers are divided by `scale`, the factor by which the module's pulses are stronger than the recording.
fn csv(located: &[LocatedDetection], scale: f64) -> String {
    let mut text = format!(
        "# {TEXT_MARK} {}; position of a target at rest\n\
         sub_cpi,patch,time_s,range_bin,doppler_bin,path_m,path_rate_m_s,x_m,y_m,z_m,power_db,snr_db\n",
        env!("CARGO_PKG_VERSION")
    );
    for one in located {
        let LocatedDetection { detection, .. } = one;
        let optional = |value: Option<f64>| value.map_or_else(String::new, |v| v.to_string());
        let at = |axis: usize| optional(one.position_m.map(|position_m| position_m[axis]));
        let power_db = |power: f32| 10.0 * (f64::from(power) / scale).log10();
        // Writing to a string cannot fail.
        let _ = writeln!(
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
    }
    text
}
