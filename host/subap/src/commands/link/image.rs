//! `subap link --send image`: the module accumulates the image, which is received once.

use std::io::Write as _;
use std::time::Instant;

use anyhow::{Context, bail};
use num_complex::Complex32;
use serde_json::{Value, json};
use subaperture::io::atomic::write_atomically;
use subaperture::io::product::Antennas;
use subaperture::io::product::record::{self, Brightest};
use subaperture::io::written::{FileKind, WrittenFile};
use subaperture::module::accumulated::{Unsuited, assemble, by_host_core, chips};
use subaperture::module::link::{
    self, AccumulatedImage, Counts, HostCore, Identity, ImageRequest, ImageSum, Job, Outcome,
    SessionObserver,
};
use subaperture::plot::{self, Orientation, Panel};
use subaperture::resolution::support::RecordedLooks;
use subaperture::resolution::survey::Survey;
use subaperture_core::link::{ChipGrid, Event};

use super::outcome::{Received, report, verified_record};
use super::receiving::Watching;
use super::work::Work;
use crate::commands::forming;
use crate::config::{command_line, record_of_run};
use crate::{interrupt, messages};

/// Number of previews for `--picture`.
const PREVIEWS: u32 = 7;

/// Observer that draws the previews of an image.
struct Drawing<'a> {
    watch: &'a mut Watching,
    work: &'a Work<'a>,
    title: &'a str,
    amplitude_scale: f32,
    drawn: anyhow::Result<()>,
}

impl SessionObserver for Drawing<'_> {
    fn update(&mut self, counts: &Counts) {
        self.watch.update(counts);
    }

    fn event(&mut self, event: &Event) {
        self.watch.event(event);
    }

    fn preview(&mut self, image: &AccumulatedImage) {
        if self.drawn.is_ok() {
            let Self { work, title, .. } = *self;
            self.drawn = work.draw(title, image, self.amplitude_scale);
        }
    }

    fn log(&mut self, text: &str) {
        self.watch.log(text);
    }

    fn cancelled(&self) -> bool {
        self.watch.cancelled()
    }
}

impl<'w> Work<'w> {
    /// Draw an image to the file of `--picture`, if it was given.
    fn draw(
        &self,
        title: &str,
        received: &AccumulatedImage,
        amplitude_scale: f32,
    ) -> anyhow::Result<()> {
        let Some(path) = &self.typed.picture else {
            return Ok(());
        };
        let sum = self.image(&[]).sum;
        let image = assemble(self.plan, self.grid, received, sum, amplitude_scale);
        let picture = plot::quicklook(&Panel::new(&image, self.grid, title))?;
        write_atomically(path, picture.len() as u64, |file| file.write_all(&picture))
            .context("--picture")
    }

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

    /// Request for the image of these chips.
    pub(super) fn image<'c>(&self, chips: &'c [ChipGrid]) -> ImageRequest<'c> {
        let sum = match self.typed.power {
            true => ImageSum::Power,
            false => ImageSum::Coherent,
        };
        let previews = match self.typed.picture {
            Some(_) => PREVIEWS,
            None => 0,
        };
        ImageRequest {
            chips,
            sum,
            previews,
        }
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
        // From here on, an interruption keeps the image of the sub-CPIs accumulated so far.
        let _keeping = interrupt::Keeping::begin();
        let (title, amplitude_scale) = (survey.name.as_str(), job.pulses.amplitude_scale());
        let mut drawing = Drawing {
            watch,
            work: self,
            title,
            amplitude_scale,
            drawn: Ok(()),
        };
        let (outcome, received) = module.accumulate(job, self.image(&chips), &mut drawing);
        let drawn = drawing.drawn;
        watch.bar.finish();
        let (mut content, mut compared, mut files) = (None, None, Vec::new());
        if !received.sub_cpis.is_empty() && received.chips.iter().all(Option::is_some) {
            if received.left_out > 0 {
                bail!(
                    "{} contributions to pixels lie outside the maps: the module was given other patches than planned; no \
                     file was written",
                    received.left_out
                );
            }
            if self.typed.verify {
                self.verify(&chips, &received)?;
                compared = Some((self.grid.num_pixels(), 0));
            }
            files = self.write(survey, job, &outcome, &received, compared, start)?;
            drawn.and_then(|()| self.draw(title, &received, amplitude_scale))?;
            let shown = self.typed.picture.iter();
            files.extend(shown.map(|path| WrittenFile::new(path, FileKind::Picture)));
            content = Some(format!(
                "{} x {} pixels of {} sub-CPIs",
                self.grid.columns.count,
                self.grid.rows.count,
                received.sub_cpis.len()
            ));
        }
        let received = Received {
            content,
            numbers: vec![("sub_cpis", received.sub_cpis.len() as u64)],
            compared,
            files,
        };
        report(self.session, self.typed, &outcome, &received, start)
    }

    /// Check that the image is bit-identical to that of the core on this computer.
    fn verify(&self, chips: &[ChipGrid], received: &AccumulatedImage) -> anyhow::Result<()> {
        let mut core = HostCore::new(self.job()?)?;
        let expected = by_host_core(&mut core, self.image(chips), &received.sub_cpis)?;
        if expected == *received {
            return Ok(());
        }
        let pixels = |image: &AccumulatedImage| -> Vec<Complex32> {
            image.chips.iter().flatten().flatten().copied().collect()
        };
        let (a, b) = (pixels(received), pixels(&expected));
        let differences = a.iter().zip(&b).map(|(a, b)| f64::from((a - b).norm_sqr()));
        let whole: f64 = b.iter().map(|b| f64::from(b.norm_sqr())).sum();
        bail!(
            "the image differs by {:.1} dB (relative RMS) from that of the core on this computer, and no file was written: is \
             the firmware of this version?",
            10.0 * (differences.sum::<f64>() / whole).log10()
        )
    }

    /// Write the folder of the image.
    fn write(
        &self,
        survey: &Survey,
        job: &Job<'_>,
        outcome: &Outcome,
        received: &AccumulatedImage,
        compared: Option<(u64, u64)>,
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
        let sum = self.image(&[]).sum;
        let image = assemble(plan, grid, received, sum, job.pulses.amplitude_scale());
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
                    "front_end": typed.front_end,
                    "power": typed.power,
                    "amplitude_scale": job.pulses.amplitude_scale(),
                    "link": outcome.counts.to_json(),
                    "verified": verified_record(compared),
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
}
