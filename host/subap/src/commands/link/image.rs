//! `subap link --send image`: the module accumulates the image, which is received once.

use std::time::{Duration, Instant};

use anyhow::bail;
use serde_json::{Value, json};
use subaperture::io::product::Antennas;
use subaperture::io::product::record::{self, Brightest};
use subaperture::io::written::WrittenFile;
use subaperture::module::accumulated::{Unsuited, assemble, by_host_core, chips};
use subaperture::module::link::{
    self, AccumulatedImage, HostCore, Identity, Job, LinkError, Outcome, TransferEnd,
};
use subaperture::plot::{Orientation, Panel};
use subaperture::resolution::support::RecordedLooks;
use subaperture::resolution::survey::Survey;
use subaperture_core::link::ChipGrid;

use super::outcome::{ending_name, refuse_failure};
use super::receiving::Watching;
use super::work::Work;
use crate::commands::forming;
use crate::config::{command_line, record_of_run};
use crate::{messages, text};

/// Error of a float32 image against the core on this computer that counts as rounding, dB: sums in another order.
const ROUNDING_DB: f64 = -110.0;

impl<'w> Work<'w> {
    /// Chips of the patches, if the module has room for them.
    pub(super) fn chips(&self, identity: &Identity) -> Result<Vec<ChipGrid>, Unsuited> {
        let (pixels, most) = (self.grid.num_pixels(), identity.image);
        if pixels > u64::from(most.pixels) {
            return Err(Unsuited::Pixels {
                pixels,
                most: most.pixels,
            });
        }
        if self.plan.num_sub_cpis > most.sub_cpis as usize {
            return Err(Unsuited::SubCpis {
                sub_cpis: self.plan.num_sub_cpis,
                most: most.sub_cpis,
            });
        }
        Ok(chips(self.plan, self.grid))
    }

    /// Let the module accumulate the image, and write it as a folder.
    pub(super) fn accumulate(
        &self,
        module: &mut link::Session<'_>,
        survey: &Survey,
        job: &mut Job<'_>,
        watch: &mut Watching,
        start: Instant,
    ) -> anyhow::Result<()> {
        let chips = self.chips(module.identity())?;
        let (outcome, received) = module.accumulate(job, &chips, watch);
        watch.bar.finish();
        if received.sub_cpis.is_empty() || received.chips.iter().any(Option::is_none) {
            refuse_failure(&outcome.ending)?;
            bail!(
                "the image was not received: the line loses too many frames; no file was written"
            );
        }
        if received.left_out > 0 {
            bail!(
                "{} contributions to pixels lie outside the maps: the module was given other patches than planned; no \
                 file was written",
                received.left_out
            );
        }
        let verified = match self.typed.verify {
            true => Some(self.verify(&chips, &received)?),
            false => None,
        };
        let files = self.write(survey, job, &outcome, &received, verified, start)?;
        self.report(&outcome, &received, verified, &files, start.elapsed())
    }

    /// Relative RMS difference from the image of the core on this computer in dB; minus infinity if bit-identical.
    fn verify(&self, chips: &[ChipGrid], received: &AccumulatedImage) -> anyhow::Result<f64> {
        let mut core = HostCore::new(self.job()?)?;
        let expected = by_host_core(&mut core, chips, &received.sub_cpis)?;
        if expected == *received {
            return Ok(f64::NEG_INFINITY);
        }
        let pixels = |image: &AccumulatedImage| {
            image
                .chips
                .iter()
                .flatten()
                .flatten()
                .copied()
                .collect::<Vec<_>>()
        };
        let (a, b) = (pixels(received), pixels(&expected));
        let power = |difference: f64, z: f64| difference + z;
        let difference = a.iter().zip(&b).map(|(a, b)| f64::from((a - b).norm_sqr()));
        let whole = b.iter().map(|b| f64::from(b.norm_sqr()));
        let ratio_db = 10.0 * (difference.fold(0.0, power) / whole.fold(0.0, power)).log10();
        if ratio_db > ROUNDING_DB {
            bail!(
                "the image differs by {ratio_db:.1} dB from that of the core on this computer, and no file was written: is the \
                 firmware of this version?"
            );
        }
        Ok(ratio_db)
    }

    /// Write the folder of the image.
    fn write(
        &self,
        survey: &Survey,
        job: &Job<'_>,
        outcome: &Outcome,
        received: &AccumulatedImage,
        verified: Option<f64>,
        start: Instant,
    ) -> anyhow::Result<Vec<WrittenFile>> {
        let Self {
            session,
            typed,
            history,
            grid,
            plan,
            ..
        } = *self;
        let collection = history.collection();
        let image = assemble(plan, grid, received, job.pulses.amplitude_scale());
        let missing: Vec<u32> = (0..plan.num_sub_cpis as u32)
            .filter(|sub_cpi| !received.sub_cpis.contains(sub_cpi))
            .collect();
        let middle_m = grid.position_m(grid.rows.count / 2, grid.columns.count / 2);
        let orientation = Orientation::of(collection, grid);
        let title = format!("{}, by the module", survey.name);
        let inputs = history.inputs()?;
        let metadata = record::Record {
            run: record_of_run(session, start.elapsed()),
            command_line: json!(command_line()),
            grid,
            frame: &collection.frame,
            settings: json!({
                "algorithm": "module",
                "window": typed.windows.window.to_string(),
                "slow_window": typed.windows.slow_window.to_string(),
                "given": { "grid": typed.grid.is_some(), "error_db": typed.error_db },
                "resolved": {
                    "former": "module",
                    "arithmetic": plan.arithmetic,
                    "pulses_per_sub_cpi": plan.setup.num_pulses,
                    "sub_cpis": plan.num_sub_cpis,
                    "sub_cpis_missing": missing,
                    "patches": plan.patches.len(),
                    "predicted_error_db": plan.predicted_db,
                    "amplitude_scale": job.pulses.amplitude_scale(),
                    "link": outcome.counts.to_json(),
                    "verified": verified.map(verified_name),
                },
            }),
            collection: forming::about(survey, history)?,
            support: json!(RecordedLooks::of(
                collection,
                middle_m,
                [grid.x_axis, grid.y_axis]
            )),
            antennas: json!(Antennas::of(history).to_json()),
            inputs: &inputs,
            brightest: Brightest::of(&image, grid),
            picture: Some(record::Picture {
                title: &title,
                look: orientation.look,
                north: orientation.north,
            }),
            check: Value::Null,
            warnings: json!(messages::warnings()),
        };
        let panel = Panel {
            orientation,
            ..Panel::new(&image, grid, title.clone())
        };
        forming::write(session, &typed.out, &image, &panel, &metadata.to_json())
    }

    /// Report the outcome. It is an error unless the image has all sub-CPIs.
    fn report(
        &self,
        outcome: &Outcome,
        received: &AccumulatedImage,
        verified: Option<f64>,
        files: &[WrittenFile],
        taken: Duration,
    ) -> anyhow::Result<()> {
        let Self {
            session,
            typed,
            plan,
            ..
        } = *self;
        let counts = &outcome.counts;
        let ratio = counts.down_up_ratio();
        let complete = received.sub_cpis.len() == plan.num_sub_cpis;
        if session.json() {
            text::say_json(
                "link",
                json!({
                    "sub_cpis": received.sub_cpis.len(),
                    "ending": ending_name(&outcome.ending, !complete),
                    "counters": counts.to_json(),
                    "down_up_ratio": ratio,
                    "verified": verified.map(verified_name),
                    "run": record_of_run(session, taken),
                    "files": files,
                }),
            )?;
        } else if session.prints_text() {
            text::say(format!(
                "{}: {} x {} pixels of {} sub-CPIs in {}",
                typed.out.display(),
                self.grid.columns.count,
                self.grid.rows.count,
                received.sub_cpis.len(),
                text::duration(taken)
            ))?;
            text::say(counts.to_string())?;
            text::say(format!(
                "ratio     {ratio:.4} bytes from the module for each byte to it"
            ))?;
        }
        if let Some(verified) = verified
            && !session.json()
        {
            text::say(format!(
                "verified  against the core on this computer: {}",
                verified_name(verified)
            ))?;
        }
        if complete {
            return Ok(());
        }
        let so_far = format!(
            "the image in {} has {} of {} sub-CPIs",
            typed.out.display(),
            received.sub_cpis.len(),
            plan.num_sub_cpis
        );
        match &outcome.ending {
            TransferEnd::Failed(LinkError::Cancelled) => Err(LinkError::Cancelled.into()),
            TransferEnd::Failed(error) => bail!("{error}; {so_far}"),
            TransferEnd::Complete | TransferEnd::Incomplete => bail!(
                "{so_far}: {}",
                match typed.rate {
                    Some(_) => "module or line are too slow for this --rate",
                    None => "the line loses too many frames: raise --retries",
                }
            ),
        }
    }
}

fn verified_name(difference_db: f64) -> String {
    match difference_db {
        f64::NEG_INFINITY => "bit-identical".to_owned(),
        difference_db => format!("{difference_db:.1} dB"),
    }
}
