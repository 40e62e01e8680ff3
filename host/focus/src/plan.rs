//! A plan: how an image will be formed, written down so that anyone can carry it out, in any parts, anywhere.
//!
//! A [`Plan`] is made of a collection's geometry, a grid and limits, before any sample is read. It holds all that the bits
//! of a pixel depend on beside the samples, and it is text (JSON). [`Opened::form`] forms any tiles of it within any memory;
//! tiles that were formed apart are the same to the bit as those that were formed together ([`super::former`]).
//!
//! **Tiles** are rectangles of one size, row by row; those at the last row and column are smaller. Their size is the
//! former's grain, as often as makes about [`TILE_PIXELS`] of them.
//!
//! **What is kept of each tile** beside its pixels ([`TileRecord`]) tells, once all are there, the error that the image
//! turned out to have ([`Opened::judge`]), as [`super::accuracy`] has it. A plan is not changed by what is found: for an image
//! that misses its bound there is another plan of the same request, for less ([`Plan::for_less`]).

use std::collections::BTreeMap;

use num_complex::Complex32;
use serde::{Deserialize, Serialize};

use super::accuracy::{self, Asked, Judgement, Misses};
use super::cost::Cost;
use super::patch::{PatchSize, Rectangle};
use super::sampled::{Probes, Sampled, TileRecord};
use super::time_model::{TimeModel, TimeModelError};
use super::{Aim, FormError, Forming, ImageFormer, Means, Tile, Transforms, Work, formers};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::{Image, Tiling, copy_common};
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::{Collection, Weights};
use subaperture_signal::window::Window;

/// What the text of a plan begins with.
pub const SCHEMA: &str = "subaperture-plan-1";

/// Pixels of a tile, about: 8 MiB.
pub const TILE_PIXELS: usize = 1 << 20;

/// Tiles of an image, about, if it has pixels for tiles of [`LEAST_TILE_PIXELS`].
const TILES: usize = 64;

/// Fewer pixels are no tile: its files would take longer than forming it.
const LEAST_TILE_PIXELS: usize = 1 << 12;

/// What a plan is asked for beside the former.
#[derive(Clone, Copy)]
pub struct Request<'a> {
    /// Geometry and frequencies.
    pub collection: &'a Collection,
    /// The pixels.
    pub grid: &'a ImageGrid,
    /// Window over fast time.
    pub fast: Window,
    /// Window over slow time.
    pub slow: Window,
    /// Bytes that tables and one worker's buffers may take ([`Aim::scratch_bytes`]).
    pub scratch_bytes: u64,
    /// Whether a bound may be missed.
    pub misses: Misses,
    /// By what means.
    pub means: Means<'a>,
}

/// How an image will be formed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    schema: String,
    /// The former's name.
    pub former: String,
    /// Its settings, as [`ImageFormer::settings`] has them.
    pub settings: serde_json::Value,
    /// What it chose.
    choices: serde_json::Value,
    /// The same in short: a JSON object.
    pub summary: serde_json::Value,
    /// The pixels.
    pub grid: ImageGrid,
    /// Window over fast time, by name.
    pub window: String,
    /// Window over slow time, by name.
    pub slow_window: String,
    /// The limit on scratch that it was made for, bytes.
    pub scratch_bytes: u64,
    /// By whose transforms: whoever carries it out uses these.
    pub transforms: Transforms,
    /// By what times it was chosen, and its stages foretold.
    pub time_model: TimeModel,
    /// Bound on the error, dB, if there is one.
    pub bound_db: Option<f64>,
    /// Whether that may be missed.
    pub misses_allowed: bool,
    /// Planned relative RMS error, dB.
    pub planned_db: f64,
    /// What was planned for in place of the bound, dB, if the scene makes more of errors than a plan knows.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub planned_for_db: Option<f64>,
    /// Of every tile but those at the ends.
    pub tile: PatchSize,
    /// What the image takes, formed in one pass.
    pub cost: Cost,
    /// Real operations for a tile alone.
    pub tile_operations: f64,
    /// What is held meanwhile by a thread, pixels and all, the recording apart, bytes.
    pub tile_bytes: u64,
    /// Of which recording.
    pub recording: Fingerprint,
}

/// By what a recording is known again.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Fingerprint {
    /// Pulses.
    pub pulses: usize,
    /// Frequencies a pulse.
    pub samples: usize,
    /// FNV-1a of all positions, reference paths, frequencies and motions within pulses, in hexadecimal.
    pub geometry: String,
}

impl Fingerprint {
    /// That of a collection.
    pub fn of(collection: &Collection) -> Self {
        let mut hash = 0xcbf2_9ce4_8422_2325u64;
        let mut add = |value: f64| {
            for byte in value.to_bits().to_le_bytes() {
                hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
            }
        };
        for pulse in &collection.pulses {
            let places = [pulse.transmitter_m, pulse.receiver_m, pulse.reference_m];
            places.iter().flat_map(|p| p.to_array()).for_each(&mut add);
            let numbers = [pulse.reference_path_m, pulse.start_hz, pulse.step_hz];
            numbers.into_iter().for_each(&mut add);
            let sweep = &pulse.sweep;
            let motions = [
                sweep.transmitter_m_s,
                sweep.transmitter_m_s2,
                sweep.receiver_m_s,
                sweep.receiver_m_s2,
                sweep.reference_m_s.unwrap_or_default(),
            ];
            add(sweep.sample_s);
            motions.iter().flat_map(|v| v.to_array()).for_each(&mut add);
        }
        Self {
            pulses: collection.pulses.len(),
            samples: collection.num_samples,
            geometry: format!("{hash:016x}"),
        }
    }
}

/// Why a plan cannot be carried out.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlanError {
    /// The text is none of a plan.
    #[error("this is no plan: {0}")]
    Text(String),
    /// It is of another version of the program.
    #[error("the plan is of the form '{found}', and {SCHEMA} is read: plan again")]
    Schema {
        /// What it says of itself.
        found: String,
    },
    /// There is no such former, or not with such settings.
    #[error(transparent)]
    Former(#[from] formers::UnknownFormer),
    /// A window that there is not.
    #[error("of the plan: {0}")]
    Window(#[from] subaperture_signal::window::WindowError),
    /// A time model that is none.
    #[error(transparent)]
    Model(#[from] TimeModelError),
    /// A grid that is none.
    #[error(transparent)]
    Grid(#[from] subaperture_model::geometry::GridError),
    /// It was made for another recording.
    #[error(
        "the plan was made for a recording of {} pulses of {} samples, geometry {}, and this one has {} of {}, \
         geometry {}",
        planned.pulses, planned.samples, planned.geometry, found.pulses, found.samples, found.geometry
    )]
    Recording {
        /// What it was made for.
        planned: Fingerprint,
        /// What is there.
        found: Fingerprint,
    },
    /// The former refuses.
    #[error(transparent)]
    Form(#[from] FormError),
}

impl Plan {
    /// Plans an image.
    ///
    /// # Errors
    /// [`FormError`] as the former's; [`FormError::BoundMissed`] if the planned error misses a bound that is not to be
    /// missed.
    pub fn new(
        former: &dyn ImageFormer,
        request: &Request,
        monitor: &dyn Monitor,
    ) -> Result<Self, FormError> {
        Self::made(former, former.bound_db(), request, monitor)
    }

    /// Plans the image of the same request for an error of `error_db`, less than the former's bound
    /// ([`Judgement::next_plan_db`]); the bound stays what is asked of the image. `None` if the former has no way to make its
    /// errors smaller.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn for_less(
        former: &dyn ImageFormer,
        error_db: f64,
        request: &Request,
        monitor: &dyn Monitor,
    ) -> Result<Option<Self>, FormError> {
        let Some(stricter) = former.planning_for(error_db) else {
            return Ok(None);
        };
        Ok(Some(Self {
            planned_for_db: Some(error_db),
            ..Self::made(&*stricter, former.bound_db(), request, monitor)?
        }))
    }

    fn made(
        former: &dyn ImageFormer,
        bound_db: Option<f64>,
        request: &Request,
        monitor: &dyn Monitor,
    ) -> Result<Self, FormError> {
        let &Request {
            collection, grid, ..
        } = request;
        super::check(collection, grid)?;
        super::check_surface(former, grid)?;
        let weights = Weights::new(collection, request.fast, request.slow);
        let aim = Aim {
            collection,
            grid,
            weights: &weights,
            scratch_bytes: request.scratch_bytes,
            means: request.means,
        };
        let asked = former.asked(request.misses);
        let swept = accuracy::swept(former, &aim, &asked)?;
        let decision = former.decide(&aim, &asked, monitor)?;
        let tile = tile_size(grid, decision.grain);
        let share = (tile.rows * tile.columns) as f64 / grid.num_pixels() as f64;
        let mut summary = decision.settings;
        if let Some(summary) = summary.as_object_mut() {
            request.means.note(summary);
        }
        Ok(Self {
            schema: SCHEMA.to_owned(),
            former: former.name().to_owned(),
            settings: former.settings(),
            choices: decision.choices,
            summary,
            grid: grid.clone(),
            window: request.fast.to_string(),
            slow_window: request.slow.to_string(),
            scratch_bytes: request.scratch_bytes,
            transforms: request.means.transforms,
            time_model: request.means.model.clone(),
            bound_db,
            misses_allowed: request.misses == Misses::Allowed,
            planned_db: accuracy::with_sweep(decision.planned_db, swept),
            planned_for_db: None,
            tile_operations: decision.cost.tile_operations(share).round(),
            tile_bytes: (8 * (tile.rows * tile.columns) as u64)
                .saturating_add(decision.cost.bytes(share)),
            cost: decision.cost,
            tile,
            recording: Fingerprint::of(collection),
        })
    }

    /// As text.
    pub fn to_text(&self) -> String {
        let mut text = serde_json::to_string_pretty(self).expect("a plan is of numbers and text");
        text.push('\n');
        text
    }

    /// From text.
    ///
    /// # Errors
    /// [`PlanError::Text`]; [`PlanError::Schema`]; [`PlanError::Grid`].
    pub fn from_text(text: &str) -> Result<Self, PlanError> {
        let wrong = |error: serde_json::Error| PlanError::Text(error.to_string());
        let value: serde_json::Value = serde_json::from_str(text).map_err(wrong)?;
        let schema = value["schema"].as_str().unwrap_or_default();
        if schema != SCHEMA {
            return Err(PlanError::Schema {
                found: schema.to_owned(),
            });
        }
        let plan: Self = serde_json::from_value(value).map_err(wrong)?;
        plan.time_model.check()?;
        match plan.grid.fault() {
            Some(fault) => Err(fault.into()),
            None if !plan.has_tiles() => Err(PlanError::Text(
                "its tiles are empty, or larger than the image".to_owned(),
            )),
            None => Ok(plan),
        }
    }

    fn has_tiles(&self) -> bool {
        let (grid, tile) = (&self.grid, self.tile);
        (1..=grid.rows.count).contains(&tile.rows)
            && (1..=grid.columns.count).contains(&tile.columns)
    }

    /// The image cut into tiles.
    pub fn tiling(&self) -> Tiling {
        Tiling {
            image: [self.grid.rows.count, self.grid.columns.count],
            tile: [self.tile.rows, self.tile.columns],
        }
    }

    /// Tiles, in all.
    pub fn num_tiles(&self) -> usize {
        self.tiling().count()
    }

    /// The windows.
    ///
    /// # Errors
    /// [`PlanError::Window`].
    pub fn windows(&self) -> Result<[Window; 2], PlanError> {
        let window =
            |name: &str| -> Result<Window, PlanError> { name.parse().map_err(PlanError::from) };
        Ok([window(&self.window)?, window(&self.slow_window)?])
    }

    /// What was asked of the error.
    pub fn asked(&self) -> Asked {
        Asked {
            bound_db: self.bound_db,
            misses: match self.misses_allowed {
                true => Misses::Allowed,
                false => Misses::Refused,
            },
        }
    }

    /// The weights that it means for a collection.
    ///
    /// # Errors
    /// [`PlanError::Window`].
    pub fn weights(&self, collection: &Collection) -> Result<Weights, PlanError> {
        let [fast, slow] = self.windows()?;
        Ok(Weights::new(collection, fast, slow))
    }

    /// Ready to form tiles of the recording that it was made for, with the weights of [`Self::weights`].
    ///
    /// # Errors
    /// [`PlanError`].
    pub fn open<'a>(
        &'a self,
        collection: &'a Collection,
        weights: &'a Weights,
    ) -> Result<Opened<'a>, PlanError> {
        let found = Fingerprint::of(collection);
        if found != self.recording {
            return Err(PlanError::Recording {
                planned: self.recording.clone(),
                found,
            });
        }
        let former = formers::former(&self.former, &self.settings)?;
        super::check_surface(&*former, &self.grid)?;
        let aim = Aim {
            collection,
            grid: &self.grid,
            weights,
            scratch_bytes: self.scratch_bytes,
            means: Means {
                transforms: self.transforms,
                model: &self.time_model,
            },
        };
        Ok(Opened {
            plan: self,
            aim,
            forming: former.open(aim, &self.choices)?,
            probes: Probes::new(aim, self.planned_db),
        })
    }
}

/// The former's grain, as often as makes tiles neither many nor large.
fn tile_size(grid: &ImageGrid, grain: PatchSize) -> PatchSize {
    let total = grid.rows.count.saturating_mul(grid.columns.count);
    let pixels = (total / TILES).clamp(LEAST_TILE_PIXELS, TILE_PIXELS) as f64;
    let side = |count: usize, grain: usize| {
        let grains = (pixels.sqrt() / grain as f64).round().max(1.0) as usize;
        (grains * grain).min(count)
    };
    PatchSize {
        rows: side(grid.rows.count, grain.rows),
        columns: side(grid.columns.count, grain.columns),
    }
}

/// A plan that is ready to be carried out.
pub struct Opened<'a> {
    plan: &'a Plan,
    aim: Aim<'a>,
    forming: Box<dyn Forming + 'a>,
    /// Once all pulses were read, the sums of them all: what tiles share may be kept, and pulses not read again.
    probes: Probes<'a>,
}

/// Where formed tiles go.
pub trait Sink {
    /// Takes tile `index`.
    ///
    /// # Errors
    /// Any, which ends the work.
    fn take(
        &mut self,
        index: usize,
        tile: Tile,
        record: TileRecord,
    ) -> Result<(), Box<dyn std::error::Error + Send + Sync>>;
}

/// Progress of a pass over the pulses among several.
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
    /// Forms the tiles of these indices, in this order, each pass over the pulses as many as `memory_bytes` (for
    /// everything) holds and at most `most_a_pass`, and hands each to `sink`.
    ///
    /// # Errors
    /// [`FormError`]. Tiles that the sink took are whole.
    pub fn form(
        &self,
        work: &Work,
        indices: &[usize],
        most_a_pass: usize,
        sink: &mut dyn Sink,
    ) -> Result<(), FormError> {
        let held_bytes = work.history.held_bytes();
        let left_bytes = work.memory_bytes.saturating_sub(held_bytes);
        let pixels = (self.plan.tile.rows * self.plan.tile.columns) as u64;
        let tile_bytes = pixels.saturating_mul(8 + self.forming.pixel_bytes());
        // A third, so that pulses and scratch have room.
        let fit = (left_bytes / 3 / tile_bytes.max(1)).clamp(1, most_a_pass.max(1) as u64);
        let tiling = self.plan.tiling();
        let (total, mut done) = (indices.len() as f64, 0);
        for indices in indices.chunks(fit as usize) {
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
                history: &sampled,
                memory_bytes: left_bytes.saturating_sub(tiles_bytes.sum()),
                monitor: &pass,
            };
            self.forming.form(&within, &mut tiles)?;
            for (&index, tile) in indices.iter().zip(tiles) {
                tile.check_finite(self.aim.grid)?;
                let record = self.probes.record(&tile).ok_or(FormError::PulsesLeftOut)?;
                sink.take(index, tile, record).map_err(FormError::Sink)?;
            }
            done += indices.len();
        }
        Ok(())
    }

    /// What is known of the image's error now that all tiles are formed.
    pub fn judge(&self, records: &[TileRecord]) -> Judgement {
        accuracy::judge(&self.aim, records, self.plan.planned_db)
    }
}

/// All of an image in memory.
pub struct InMemory {
    /// The image.
    pub image: Image,
    /// By tile.
    pub records: BTreeMap<usize, TileRecord>,
}

impl InMemory {
    /// An image of zeros.
    pub fn new(grid: &ImageGrid) -> Self {
        let (rows, columns) = (grid.rows.count, grid.columns.count);
        Self {
            image: Image {
                rows,
                columns,
                pixels: vec![Complex32::ZERO; rows * columns],
            },
            records: BTreeMap::new(),
        }
    }
}

impl Sink for InMemory {
    fn take(
        &mut self,
        index: usize,
        tile: Tile,
        record: TileRecord,
    ) -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
        let image = &mut self.image;
        let whole = [0..image.rows, 0..image.columns];
        copy_common(&whole, &mut image.pixels, &tile.place.place(), &tile.pixels);
        self.records.insert(index, record);
        Ok(())
    }
}
