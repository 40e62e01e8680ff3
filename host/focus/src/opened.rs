//! Plan opened by its former: forms tiles, and measures the error of the complete image.

use std::borrow::Cow;

use super::accuracy::{self, Judgement};
use super::compared::Planned;
use super::coverage::Coverage;
use super::patch::Rectangle;
use super::plan::Plan;
use super::sampled::{Probes, Sampled, TileRecord};
use super::second_look::add_all;
use super::sink::Sink;
use super::{FormError, Forming, ImageFormer, ImageSpec, Tile, Work};
use subaperture_model::image::ImageSource;
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::PhaseHistory;

/// Plan opened for forming tiles.
pub struct Opened<'a> {
    plan: &'a Plan,
    spec: ImageSpec<'a>,
    forming: Box<dyn Forming + 'a>,
    coverage: Coverage<'a>,
    /// Sums of all pulses once each has been read; data shared by tiles may then be kept instead of reading pulses again.
    probes: Probes<'a>,
}

impl<'a> Opened<'a> {
    /// Open `plan` by `former`, which made it for `spec`.
    pub(super) fn new<F: ImageFormer + ?Sized>(
        former: &F,
        plan: &'a Plan,
        spec: ImageSpec<'a>,
    ) -> Result<Self, FormError> {
        super::check_surface(former, spec.grid)?;
        super::beam::check(former, spec.weights)?;
        // A stricter plan needs exact sums of its own accuracy rather than that of the bound.
        let bound_db = plan.bound_db.unwrap_or(f64::NEG_INFINITY);
        let least_db = match plan.planned_for_db {
            Some(_) => bound_db.min(plan.planned_db),
            None => bound_db,
        };
        Ok(Self {
            plan,
            spec,
            forming: former.open(spec, &plan.choices)?,
            coverage: Coverage::new(spec, former.grid_points()),
            probes: Probes::new(spec, least_db),
        })
    }
}

/// Memory for everything except the recording's own buffers, bytes.
fn left_bytes(work: &Work) -> u64 {
    work.memory_bytes.saturating_sub(work.history.held_bytes())
}

/// Progress of one of several passes over the pulses.
struct Pass<'a> {
    monitor: &'a dyn Monitor,
    done: f64,
    share: f64,
}

impl Monitor for Pass<'_> {
    fn progress(&self, fraction: f64) {
        self.monitor.progress(self.done + self.share * fraction);
    }

    fn cancelled(&self) -> bool {
        self.monitor.cancelled()
    }

    fn begins(&self, stage: &'static str) {
        self.monitor.begins(stage);
    }

    fn ends(&self, stage: &'static str) {
        self.monitor.ends(stage);
    }
}

impl Opened<'_> {
    /// Tiles formed in one pass over the pulses.
    fn tiles_a_pass(&self, left_bytes: u64, most_a_pass: usize) -> usize {
        let pixels = (self.plan.tile.rows * self.plan.tile.columns) as u64;
        let tile_bytes = pixels.saturating_mul(8 + self.forming.pixel_bytes());
        // A third for tiles; the rest for pulses and scratch.
        (left_bytes / 3 / tile_bytes.max(1)).clamp(1, most_a_pass.max(1) as u64) as usize
    }

    /// Number of pulses that [`Self::form`] reads for the same tiles; a pulse that is read twice counts twice.
    ///
    /// # Errors
    /// [`FormError::Memory`].
    pub fn pulses_read(
        &self,
        work: &Work,
        indices: &[usize],
        most_a_pass: usize,
    ) -> Result<u64, FormError> {
        let left_bytes = left_bytes(work);
        let tiling = self.plan.tiling();
        let mut count = match self.compares_first(indices) {
            true => self.spec.collection.pulses.len() as u64,
            false => 0,
        };
        for indices in indices.chunks(self.tiles_a_pass(left_bytes, most_a_pass)) {
            let places = indices.iter().map(|&index| tiling.place(index));
            let places: Vec<Rectangle> = places.map(|place| Rectangle::of(&place)).collect();
            let pixels = places.iter().map(|own| own.size.rows * own.size.columns);
            let tiles_bytes = 8 * pixels.sum::<usize>() as u64;
            let within = Work {
                memory_bytes: left_bytes.saturating_sub(tiles_bytes),
                ..*work
            };
            count += self.forming.pulses_read(&within, &places)?;
        }
        Ok(count)
    }

    /// Whether the pulses are read for the comparison with the exact sum before the tiles of these indices are formed.
    fn compares_first(&self, indices: &[usize]) -> bool {
        !self.forming.reads_all_pulses() && indices.len() == self.plan.num_tiles()
    }

    /// Form the tiles of the given indices in order and pass each to `sink`. Each pass over the pulses forms as many tiles as
    /// `memory_bytes` (for everything) allows, at most `most_a_pass`.
    ///
    /// # Errors
    /// [`FormError`]. Tiles already passed to the sink are complete.
    pub fn form(
        &self,
        work: &Work,
        indices: &[usize],
        most_a_pass: usize,
        sink: &mut dyn Sink,
    ) -> Result<(), FormError> {
        let left_bytes = left_bytes(work);
        let fit = self.tiles_a_pass(left_bytes, most_a_pass);
        let tiling = self.plan.tiling();
        let (total, mut done) = (indices.len() as f64, 0);
        if self.compares_first(indices) {
            add_all(&self.probes, &self.spec, work.history, work.monitor)?;
        }
        for indices in indices.chunks(fit) {
            let places = indices.iter().map(|&index| tiling.place(index));
            let mut tiles: Vec<Tile> = places
                .map(|place| Tile::new(Rectangle::of(&place)))
                .collect();
            let sampled = Sampled {
                history: work.history,
                probes: &self.probes,
                monitor: work.monitor,
            };
            let pass = Pass {
                monitor: work.monitor,
                done: done as f64 / total,
                share: indices.len() as f64 / total,
            };
            let tiles_bytes = tiles.iter().map(|tile| 8 * tile.pixels.len() as u64);
            let within = Work {
                history: match self.forming.reads_all_pulses() {
                    true => &sampled,
                    false => work.history,
                },
                memory_bytes: left_bytes.saturating_sub(tiles_bytes.sum()),
                monitor: &pass,
            };
            self.forming.form(&within, &mut tiles)?;
            for (&index, mut tile) in indices.iter().zip(tiles) {
                self.coverage.clear(&mut tile);
                tile.check_finite(self.spec.grid)?;
                let mut record = self.probes.pending(&tile);
                if !self.probes.complete(&mut record) && self.forming.reads_all_pulses() {
                    return Err(FormError::PulsesLeftOut);
                }
                sink.take(index, tile, record).map_err(FormError::Sink)?;
            }
            done += indices.len();
        }
        Ok(())
    }

    /// Measured error of the image from the records of all tiles, also by pixels drawn in proportion to power unless the evenly spread pixels settle that the bound is kept.
    /// Tiles formed from some of the pulses need a pass over all pulses of `history` for the evenly spread pixels. The drawn pixels need another pass over all pulses of `history`. Every pixel of `image`, if given, is compared in a third pass where it is
    /// small and would exceed the bound otherwise.
    ///
    /// # Errors
    /// [`FormError::Read`]; [`FormError::Cancelled`]; [`FormError::Sink`] if the image cannot be read.
    pub fn judge_again(
        &self,
        records: &[TileRecord],
        history: &dyn PhaseHistory,
        image: Option<&dyn ImageSource>,
        monitor: &dyn Monitor,
    ) -> Result<Judgement, FormError> {
        let records = self.complete(records, history, monitor)?;
        let (planned, goal) = (self.planned(), self.plan.goal());
        let spec = &self.spec;
        accuracy::judge_again(spec, history, &records, image, planned, &goal, monitor)
    }

    /// The records, with the exact sums where they are missing.
    fn complete<'r>(
        &self,
        records: &'r [TileRecord],
        history: &dyn PhaseHistory,
        monitor: &dyn Monitor,
    ) -> Result<Cow<'r, [TileRecord]>, FormError> {
        if !records.iter().any(|record| record.pending) {
            return Ok(Cow::Borrowed(records));
        }
        add_all(&self.probes, &self.spec, history, monitor)?;
        let mut records = records.to_vec();
        let mut pending = records.iter_mut().filter(|record| record.pending);
        match pending.all(|record| self.probes.complete(record)) {
            true => Ok(Cow::Owned(records)),
            false => Err(FormError::PulsesLeftOut),
        }
    }

    fn planned(&self) -> Planned {
        Planned::of_settings(self.plan.planned_db, &self.plan.summary)
    }
}
