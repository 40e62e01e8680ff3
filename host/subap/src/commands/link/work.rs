//! Work of the embedded module: its plan, the job, and the transfer of maps to a file.

use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use serde_json::{Map, Value, json};
use subaperture::geometry::ImageGrid;
use subaperture::io::npy;
use subaperture::io::written::{FileKind, WrittenFile};
use subaperture::module::detections::lag_pulses;
use subaperture::module::link::{self, HostCore, Identity, Job, PulseSource, Request, Verified};
use subaperture::module::maps::{Arithmetic, Run};
use subaperture::module::maps_file as maps;
use subaperture::module::maps_file::{MAX_MAPS, MapWriter};
use subaperture::module::plan::{ModuleCapacity, ModulePlan, ModuleProduct, Requirements};
use subaperture::phase_history::{Collection, PhaseHistory, Weights};
use subaperture_core::dpca::{Dpca, DpcaError};
use subaperture_core::link as wire;

use super::outcome::{Received, closing, report};
use super::picture::Picture;
use super::receiving::{Keep, Watching};
use crate::ahead::Ahead;
use crate::args::Link;
use crate::commands::plan::gaps;
use crate::config::{Session, module_error_db, record_of_run};
use crate::failure::Usage;
use crate::{interrupt, messages};
use subaperture::io::product::record::grid as grid_record;

/// Plan for a module of this capacity.
pub(super) fn plan(
    session: &Session,
    typed: &Link,
    channels: &[&dyn PhaseHistory],
    grid: &ImageGrid,
    identity: &Identity,
    product: ModuleProduct,
) -> anyhow::Result<ModulePlan> {
    let mut capacity = identity.capacity;
    if typed.dpca {
        // The map of the first channel and a row are kept among the pixels of an image.
        let rows = identity.image.pixels / u32::from(capacity.frequencies.max(1));
        let rows = u16::try_from(rows).unwrap_or(u16::MAX).saturating_sub(1);
        if rows == 0 {
            bail!(
                "--dpca: expected a module with room for at least {} pixels, found {}: use a firmware of another size",
                2 * u32::from(capacity.frequencies),
                identity.image.pixels
            );
        }
        capacity.doppler_bins = capacity.doppler_bins.min(rows);
    }
    let requirements = Requirements {
        error_db: module_error_db(typed.error_db, product),
        room: ModuleCapacity::Built(capacity),
        arithmetic: match identity.arithmetic {
            wire::Arithmetic::Float => Arithmetic::Float,
            wire::Arithmetic::Fixed => Arithmetic::Fixed,
        },
        product,
    };
    let channels: Vec<&Collection> = channels
        .iter()
        .map(|channel| channel.collection())
        .collect();
    let plan = ModulePlan::new(&channels, grid, &requirements)?;
    session.note(1, || {
        format!(
            "{} patches, {} sub-CPIs of {} pulses, predicted error {:.1} dB",
            plan.patches.len(),
            plan.num_sub_cpis,
            plan.setup.num_pulses,
            plan.predicted_db
        )
    });
    if let Some(gaps) = gaps(&plan) {
        session.note(1, || format!("track: {gaps}"));
    }
    let num_maps = plan.num_maps();
    if product == ModuleProduct::Maps && num_maps > MAX_MAPS {
        bail!(
            "expected at most {MAX_MAPS} maps per file, found {num_maps}: give a smaller --grid, or link the \
             recordings one by one"
        );
    }
    Ok(plan)
}

/// Weights scaled to a sum of 1.
pub(super) fn normalised(weights: &[f64]) -> Vec<f32> {
    let sum: f64 = weights.iter().sum();
    weights.iter().map(|w| (w / sum) as f32).collect()
}

/// Clutter cancellation of two channels by their lag along the track.
pub(super) fn cancellation(channels: &[&dyn PhaseHistory]) -> anyhow::Result<Dpca> {
    let channels = channels.iter().map(|channel| channel.collection());
    let channels: Vec<&Collection> = channels.collect();
    match lag_pulses(&channels) {
        Ok(lag_pulses) => Ok(Dpca { lag_pulses }),
        Err(DpcaError::Channels { found }) => Err(Usage(format!(
            "--dpca: expected 2 channels, found {found}: give two of them by --channels"
        ))
        .into()),
        Err(error) => Err(error).context("--dpca"),
    }
}

/// Work of the module.
pub(super) struct Work<'w> {
    pub(super) session: &'w Session,
    pub(super) typed: &'w Link,
    /// Channels, several for detections only.
    pub(super) channels: &'w [&'w dyn PhaseHistory],
    /// The first of them.
    pub(super) history: &'w dyn PhaseHistory,
    pub(super) grid: &'w ImageGrid,
    pub(super) plan: &'w ModulePlan,
    product: ModuleProduct,
    /// Weights by frequency; they sum to 1.
    fast_weights: Vec<f32>,
    slow_weights: Vec<f64>,
    /// Clutter cancellation, if requested.
    pub(super) dpca: Option<Dpca>,
}

impl<'w> Work<'w> {
    pub(super) fn new(
        session: &'w Session,
        typed: &'w Link,
        channels: &'w [&'w dyn PhaseHistory],
        grid: &'w ImageGrid,
        plan: &'w ModulePlan,
        product: ModuleProduct,
        dpca: Option<Dpca>,
    ) -> anyhow::Result<Self> {
        let history = channels[0];
        if let Some(dpca) = &dpca {
            dpca.check(&plan.setup).context("--dpca")?;
        }
        let weights = Weights::new(
            history.collection(),
            typed.windows.window,
            typed.windows.slow_window,
        );
        Ok(Self {
            session,
            typed,
            channels,
            history,
            grid,
            plan,
            product,
            fast_weights: normalised(&weights.fast),
            slow_weights: weights.slow,
            dpca,
        })
    }

    pub(super) fn job(&self) -> anyhow::Result<Job<'w>> {
        let (channels, weights) = (self.channels, &self.slow_weights);
        let encoding = self.plan.arithmetic.encoding();
        let pulses = match self.typed.front_end {
            true => PulseSource::from_front_end(channels, weights)?,
            false => PulseSource::new(channels, weights, encoding)?,
        };
        Ok(Job {
            setup: self.plan.setup,
            fast_weights: self.fast_weights.clone(),
            patches: self.plan.patches.clone(),
            pulses: match &self.dpca {
                Some(dpca) => pulses.displaced(dpca, self.plan.setup.num_pulses),
                None => pulses,
            },
        })
    }

    /// Print the predicted cost of the transfer.
    pub(super) fn rehearse(
        &self,
        module: &mut link::Session<'_>,
        job: &Job<'_>,
        watch: &mut Watching,
    ) -> anyhow::Result<()> {
        let Self { typed, plan, .. } = *self;
        let chips;
        let request = match self.product {
            ModuleProduct::Maps => Request::Maps,
            ModuleProduct::Detections => Request::Detections(self.detector()),
            ModuleProduct::Image => {
                chips = self.chips(module.identity())?;
                Request::Image(self.image(&chips))
            }
        };
        let time = link::rehearse(module, job, request, watch)?;
        watch.bar.finish();
        let work = format!(
            "{} maps of {} pulses by the module at {}; retransmissions not included",
            plan.num_maps(),
            job.pulses.len(),
            typed.place
        );
        let file_bytes = match self.product {
            ModuleProduct::Maps => {
                maps::file_bytes(plan.num_sub_cpis as u64, &plan.patches, plan.arithmetic)
            }
            ModuleProduct::Image => npy::file_bytes(self.grid.num_pixels()),
            // A few detections a map.
            ModuleProduct::Detections => 1000 * plan.num_maps(),
        };
        let picture_bytes = match &typed.picture {
            Some(_) => link::RunningImage::held_bytes(self.grid, &plan.patches),
            None => 0,
        };
        let read_bytes = self.channels.iter().map(|channel| channel.held_bytes());
        let held_bytes = read_bytes.sum::<u64>() + picture_bytes;
        let disk = vec![(typed.out.clone(), file_bytes)];
        Ahead::new(self.session, work, held_bytes, time, disk)
            .announce(self.session, &typed.rehearsal)?;
        Ok(())
    }

    /// Header of the file of maps.
    pub(super) fn run(
        &self,
        name: &str,
        identity: &Identity,
        job: &Job<'_>,
    ) -> anyhow::Result<Run> {
        Ok(Run {
            name: name.to_owned(),
            setup: self.plan.setup,
            arithmetic: self.plan.arithmetic,
            fast_window: self.typed.windows.window.to_string(),
            fast_weights: self.fast_weights.clone(),
            frame: self.history.collection().frame,
            provenance: self.provenance(identity, job)?,
        })
    }

    /// Run the job and store the received maps.
    pub(super) fn transfer(
        &self,
        module: &mut link::Session<'_>,
        run: &Run,
        job: &mut Job<'_>,
        watch: &mut Watching,
        start: Instant,
    ) -> anyhow::Result<()> {
        let typed = self.typed;
        // From here on, an interruption keeps the maps received.
        let _keeping = interrupt::Keeping::begin();
        let mut writer = MapWriter::create(&typed.out, run)?;
        let mut keep = Keep {
            writer: &mut writer,
            picture: self.picture(run)?,
        };
        let (outcome, compared) = if typed.verify {
            let core = HostCore::new(self.job()?)?;
            let mut verified = Verified::new(&mut keep, core);
            let outcome = module.transfer(job, &mut verified, watch);
            (outcome, Some(verified.counts()))
        } else {
            (module.transfer(job, &mut keep, watch), None)
        };
        watch.bar.finish();
        let picture = keep.picture.take();
        let maps = writer.num_maps() as u64;
        if maps > 0 {
            writer.finish(&closing(&outcome, job, compared, maps))?;
        }
        // The file is complete before the last picture is drawn.
        let drawn = picture.map(Picture::finish);
        let mut files = Vec::new();
        if maps > 0 {
            files.push(WrittenFile::new(&typed.out, FileKind::Maps));
        }
        let shown = typed.picture.iter().filter(|path| path.exists());
        files.extend(shown.map(|path| WrittenFile::new(path, FileKind::Picture)));
        let received = Received {
            content: (maps > 0).then(|| format!("{maps} maps")),
            numbers: vec![("maps", maps)],
            compared,
            files,
        };
        report(self.session, typed, &outcome, &received, start)?;
        if let Some(drawn) = drawn {
            let left_out = drawn?;
            if left_out > 0 {
                messages::warning(format!(
                    "{left_out} maps arrived too fast for --picture and are not in it; they are in {}",
                    typed.out.display()
                ));
            }
        }
        Ok(())
    }

    /// Picture updated during the transfer, if requested.
    fn picture(&self, run: &Run) -> anyhow::Result<Option<Picture>> {
        let Some(path) = self.typed.picture.as_deref() else {
            return Ok(None);
        };
        let image = link::RunningImage::new(
            run,
            self.grid,
            self.plan.patches.len(),
            module_error_db(self.typed.error_db, ModuleProduct::Maps),
            self.session.memory_bytes,
        );
        let title = run.name.clone();
        Picture::start(path, image, self.grid, title).map(Some)
    }

    /// Provenance of the maps.
    fn provenance(&self, identity: &Identity, job: &Job<'_>) -> anyhow::Result<Map<String, Value>> {
        let Self {
            session,
            typed,
            history,
            grid,
            plan,
            ..
        } = *self;
        let capacity = identity.capacity;
        let record = json!({
            "run": record_of_run(session, Duration::ZERO),
            "module": {
                "place": typed.place.to_string(),
                "version": identity.version,
                "capacity": {
                    "pulses": capacity.pulses,
                    "frequencies": capacity.frequencies,
                    "range_bins": capacity.range_bins,
                    "doppler_bins": capacity.doppler_bins,
                    "patches": capacity.patches,
                },
            },
            "inputs": history.inputs()?,
            "grid": grid_record(grid),
            "error_db": module_error_db(typed.error_db, ModuleProduct::Maps),
            "predicted_error_db": plan.predicted_db,
            "slow_window": typed.windows.slow_window.to_string(),
            "rate_hz": typed.rate,
            "front_end": typed.front_end,
            "amplitude_scale": job.pulses.amplitude_scale(),
        });
        match record {
            Value::Object(object) => Ok(object),
            _ => Ok(Map::new()),
        }
    }
}
