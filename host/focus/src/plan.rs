//! Image formation plan: a complete description that can be carried out in parts, on any machine.
//!
//! A [`Plan`] is made from a collection's geometry, a grid and limits, before any sample is read. It contains everything that a
//! pixel depends on except the samples, as text (JSON). [`Opened::form`](super::Opened::form) forms any tiles of it within any memory limit;
//! tiles formed separately are bit-identical to tiles formed together ([`super::former`]).
//!
//! **Tiles** are rectangles of one size in row-major order; those at the last row and column are smaller. Their size is a multiple of the
//! former's grain that gives about [`TILE_PIXELS`] pixels.
//!
//! **Tile records** ([`TileRecord`](super::TileRecord)) are kept with the pixels of each tile. The records of all tiles determine the actual error of the image
//! ([`Opened::judge_again`](super::Opened::judge_again)) by the rules of [`super::accuracy`]. The plan stays unchanged by the result; for an image
//! that exceeds its bound, [`Plan::for_less`] makes another plan of the same image with a smaller planned error.
//! [`super::Execution`] does all of this.

use serde::{Deserialize, Serialize};

use super::accuracy;
use super::compared::Planned;
use super::cost::Cost;
use super::coverage::{self, Coverage};
use super::error::UnknownFormer;
pub use super::fingerprint::Fingerprint;
use super::former_choices::FormerChoices;
use super::goal::{BoundPolicy, ErrorGoal, misses};
use super::patch::PatchSize;
pub use super::sink::{ImageSink, InMemory, Sink};
use super::time_model::{TimeModel, TimeModelError};
use super::{FormError, ImageFormer, ImageSpec, Numerics, Tile, Transforms};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::Tiling;
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::{Collection, PhaseHistory, Weights};
use subaperture_signal::window::Window;

/// Schema name at the start of a plan's text.
pub const SCHEMA: &str = "subaperture-plan-2";

/// Window name of weights that do not sample windows ([`Weights::windows`]). A plan with such weights cannot be opened from its text.
const OTHER_WEIGHTS: &str = "other";

/// Approximate pixels of a tile: 8 MiB.
pub const TILE_PIXELS: usize = 1 << 20;

/// Approximate number of tiles of an image, provided that each has at least [`MIN_TILE_PIXELS`].
const TILES: usize = 64;

/// Minimum pixels of a tile; the files of a smaller one would take longer than its formation.
const MIN_TILE_PIXELS: usize = 1 << 12;

/// Plan for forming an image.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    schema: String,
    /// Name of the former.
    pub former: String,
    /// Settings of the former ([`ImageFormer::settings`]).
    pub settings: serde_json::Value,
    /// Parameters chosen by the former.
    pub(super) choices: FormerChoices,
    /// Summary of the choices: a JSON object.
    pub summary: serde_json::Value,
    /// Pixel grid of the image.
    pub grid: ImageGrid,
    /// Name of the fast-time window.
    pub window: String,
    /// Name of the slow-time window.
    pub slow_window: String,
    /// Limit on scratch memory of one worker, bytes.
    pub scratch_bytes: u64,
    /// Transforms that the plan was made for and must be carried out with.
    pub transforms: Transforms,
    /// Timing model that the choices and the stage forecasts are based on.
    pub time_model: TimeModel,
    /// Bound on the relative RMS error, dB; `None` for no bound.
    pub bound_db: Option<f64>,
    /// Whether the error bound may be exceeded.
    pub misses_allowed: bool,
    /// Planned relative RMS error, dB.
    pub planned_db: f64,
    /// Planning target in place of the bound, dB, for a scene that enlarges errors beyond the plan.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub planned_for_db: Option<f64>,
    /// Tile size, pixels; tiles at the last row and column may be smaller.
    pub tile: PatchSize,
    /// Operations and memory for the image formed in one pass.
    pub cost: Cost,
    /// Real operations for one tile formed alone.
    pub tile_operations: f64,
    /// Memory per thread, bytes, including pixels and excluding the recording.
    pub tile_bytes: u64,
    /// Fingerprint of the recording's geometry.
    pub recording: Fingerprint,
}

/// Reason that a plan cannot be carried out.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlanError {
    /// The text does not contain a valid plan.
    #[error("not a valid plan: {0}")]
    Text(String),
    /// The plan has the schema of a different program version.
    #[error("expected a plan with the schema {SCHEMA}, found '{found}': plan again")]
    Schema {
        /// Schema name in the text.
        found: String,
    },
    /// Unknown former, or invalid settings for it.
    #[error(transparent)]
    Former(#[from] UnknownFormer),
    /// Unknown window name.
    #[error("window of the plan: {0}")]
    Window(#[from] subaperture_signal::window::WindowError),
    /// Invalid timing model.
    #[error(transparent)]
    Model(#[from] TimeModelError),
    /// Invalid pixel grid.
    #[error(transparent)]
    Grid(#[from] subaperture_model::geometry::GridError),
    /// The plan was made for a different recording.
    #[error(
        "the plan was made for a recording of {} pulses of {} samples with geometry {}; this recording has {} of {} \
         with geometry {}: plan again",
        planned.pulses, planned.samples, planned.geometry, found.pulses, found.samples, found.geometry
    )]
    Recording {
        /// Fingerprint stored in the plan.
        planned: Fingerprint,
        /// Fingerprint of the recording.
        found: Fingerprint,
    },
    /// The former refused to open the plan.
    #[error(transparent)]
    Form(#[from] FormError),
}

impl Plan {
    /// Make a plan for an image.
    ///
    /// # Errors
    /// [`FormError`] of the former; [`FormError::BoundMissed`] if the planned error exceeds the former's bound and that is refused.
    pub fn new<F: ImageFormer + ?Sized>(
        former: &F,
        spec: &ImageSpec,
        bound_policy: BoundPolicy,
        monitor: &dyn Monitor,
    ) -> Result<Self, FormError> {
        Self::made(former, former.bound_db(), spec, bound_policy, monitor)
    }

    /// Make a plan of the same image for a planned error of `error_db`, less than the former's bound
    /// ([`Judgement::next_plan_db`](super::Judgement::next_plan_db)). The bound of the image is unchanged. The plan may fall short of
    /// `error_db`. `None` if the former cannot reduce its error, or still exceeds a bound that must be kept.
    ///
    /// # Errors
    /// Errors of [`Self::new`].
    pub fn for_less<F: ImageFormer + ?Sized>(
        former: &F,
        error_db: f64,
        spec: &ImageSpec,
        bound_policy: BoundPolicy,
        monitor: &dyn Monitor,
    ) -> Result<Option<Self>, FormError> {
        let Some(stricter) = former.planning_for(error_db) else {
            return Ok(None);
        };
        // The plan may fall short of `error_db`.
        let allowed = BoundPolicy::Allowed;
        let plan = Self {
            planned_for_db: Some(error_db),
            misses_allowed: bound_policy == BoundPolicy::Allowed,
            ..Self::made(&*stricter, former.bound_db(), spec, allowed, monitor)?
        };
        let keeps = plan.misses_allowed || !misses(plan.planned_db, plan.bound_db);
        Ok(keeps.then_some(plan))
    }

    /// Whether `stricter` should replace this plan: its error is smaller, and its time not many times longer where the bound may be exceeded.
    pub fn is_worth_replacing(&self, stricter: &Self) -> bool {
        let plans = [self, stricter].map(|plan| (plan.planned_db, plan.cost.operations));
        accuracy::is_worth_forming_again(plans, self.goal().bound_policy)
    }

    /// Make a plan for a recording with samples available. As [`Self::new`], but with a stricter target where scatterers outside the grid are bright enough
    /// to need room within the bound. A plan carried out elsewhere without replanning then keeps the bound. All
    /// pulses are read once.
    ///
    /// Without a bound, or where the former cannot plan for a smaller error, the result equals that of [`Self::new`].
    ///
    /// # Errors
    /// Errors of [`Self::new`]; [`FormError::Read`].
    pub fn for_recording<F: ImageFormer + ?Sized>(
        former: &F,
        spec: &ImageSpec,
        bound_policy: BoundPolicy,
        history: &dyn PhaseHistory,
        monitor: &dyn Monitor,
    ) -> Result<Self, FormError> {
        let plan = Self::new(former, spec, bound_policy, monitor)?;
        let goal = plan.goal();
        if goal.bound_db.is_none() || former.planning_for(plan.planned_db).is_none() {
            return Ok(plan);
        }
        let planned = Planned::of_settings(plan.planned_db, &plan.summary);
        let room = accuracy::room_for_outside(spec, history, planned, &goal, monitor)?;
        let Some(error_db) = room else {
            return Ok(plan);
        };
        match Self::for_less(former, error_db, spec, bound_policy, monitor) {
            Ok(Some(less)) if plan.is_worth_replacing(&less) => Ok(less),
            // A stricter plan is not available; the first plan may suffice.
            Ok(_) | Err(FormError::Unsuited(_)) => Ok(plan),
            Err(error) => Err(error),
        }
    }

    fn made<F: ImageFormer + ?Sized>(
        former: &F,
        bound_db: Option<f64>,
        spec: &ImageSpec,
        bound_policy: BoundPolicy,
        monitor: &dyn Monitor,
    ) -> Result<Self, FormError> {
        let &ImageSpec {
            collection,
            grid,
            weights,
            numerics,
            scratch_bytes,
        } = spec;
        super::check(collection, grid)?;
        super::check_surface(former, grid)?;
        super::beam::check(former, weights)?;
        let goal = former.goal(bound_policy);
        let num_uncovered = Coverage::new(*spec, former.grid_points()).count_uncovered()?;
        let swept = accuracy::swept(former, spec, &goal)?;
        let decision = former.decide(spec, &goal, monitor)?;
        let tile = tile_size(grid, decision.grain);
        let share = (tile.rows * tile.columns) as f64 / grid.num_pixels() as f64;
        let mut summary = decision.settings;
        if let Some(summary) = summary.as_object_mut() {
            numerics.note(summary);
            coverage::note(num_uncovered, summary);
        }
        let [window, slow_window] = match weights.windows {
            Some(windows) => windows.map(|window| window.to_string()),
            None => [OTHER_WEIGHTS; 2].map(str::to_owned),
        };
        Ok(Self {
            schema: SCHEMA.to_owned(),
            former: former.name().to_owned(),
            settings: former.settings(),
            choices: decision.choices,
            summary,
            grid: grid.clone(),
            window,
            slow_window,
            scratch_bytes,
            transforms: numerics.transforms,
            time_model: numerics.model.clone(),
            bound_db,
            misses_allowed: bound_policy == BoundPolicy::Allowed,
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

    /// The same plan with the whole image as its only tile.
    pub(super) fn in_one_tile(&self) -> Self {
        let tile = Tile::place_of(&self.grid).size;
        Self {
            tile,
            ..self.clone()
        }
    }

    /// The same plan in one tile, if `other` has one only.
    pub(super) fn with_tiles_as(self, other: &Self) -> Self {
        match other.num_tiles() {
            1 => self.in_one_tile(),
            _ => self,
        }
    }

    /// Write the plan as JSON text.
    pub fn to_text(&self) -> String {
        let mut text = serde_json::to_string_pretty(self).expect("a plan is of numbers and text");
        text.push('\n');
        text
    }

    /// Read a plan from JSON text.
    ///
    /// # Errors
    /// [`PlanError::Text`]; [`PlanError::Schema`]; [`PlanError::Grid`].
    pub fn from_text(text: &str) -> Result<Self, PlanError> {
        let value = serde_json::from_str(text);
        Self::from_value(value.map_err(|error| PlanError::Text(error.to_string()))?)
    }

    /// Read a plan from a JSON value, for callers that bound the memory of parsing.
    ///
    /// # Errors
    /// Errors of [`Self::from_text`].
    pub fn from_value(value: serde_json::Value) -> Result<Self, PlanError> {
        let wrong = |error: serde_json::Error| PlanError::Text(error.to_string());
        let schema = value["schema"].as_str().unwrap_or_default();
        if schema != SCHEMA {
            return Err(PlanError::Schema {
                found: schema.to_owned(),
            });
        }
        let plan: Self = serde_json::from_value(value).map_err(wrong)?;
        plan.time_model.check()?;
        super::check_size(&plan.grid)?;
        match plan.grid.fault() {
            Some(fault) => Err(fault.into()),

            None if !plan.has_tiles() => Err(PlanError::Text(
                "expected tiles of at least one pixel and at most the size of the image".to_owned(),
            )),
            None => Ok(plan),
        }
    }

    fn has_tiles(&self) -> bool {
        let (grid, tile) = (&self.grid, self.tile);
        (1..=grid.rows.count).contains(&tile.rows)
            && (1..=grid.columns.count).contains(&tile.columns)
    }

    /// Tiling of the image.
    pub fn tiling(&self) -> Tiling {
        Tiling {
            image: [self.grid.rows.count, self.grid.columns.count],
            tile: [self.tile.rows, self.tile.columns],
        }
    }

    /// Number of tiles.
    pub fn num_tiles(&self) -> usize {
        self.tiling().count()
    }

    /// Fast-time and slow-time window.
    ///
    /// # Errors
    /// [`PlanError::Window`].
    pub fn windows(&self) -> Result<[Window; 2], PlanError> {
        let window =
            |name: &str| -> Result<Window, PlanError> { name.parse().map_err(PlanError::from) };
        Ok([window(&self.window)?, window(&self.slow_window)?])
    }

    /// Error requirement of the plan.
    pub fn goal(&self) -> ErrorGoal {
        ErrorGoal {
            bound_db: self.bound_db,
            bound_policy: match self.misses_allowed {
                true => BoundPolicy::Allowed,
                false => BoundPolicy::Refused,
            },
        }
    }

    /// Specification of the image for the weights of [`Self::weights`].
    pub fn spec<'a>(&'a self, collection: &'a Collection, weights: &'a Weights) -> ImageSpec<'a> {
        ImageSpec {
            collection,
            grid: &self.grid,
            weights,
            scratch_bytes: self.scratch_bytes,
            numerics: Numerics {
                transforms: self.transforms,
                model: &self.time_model,
                device: None,
            },
        }
    }
}

/// Multiple of the former's grain that gives tiles of moderate number and size.
fn tile_size(grid: &ImageGrid, grain: PatchSize) -> PatchSize {
    let total = grid.rows.count.saturating_mul(grid.columns.count);
    let pixels = (total / TILES).clamp(MIN_TILE_PIXELS, TILE_PIXELS) as f64;
    let side = |count: usize, grain: usize| {
        let grains = (pixels.sqrt() / grain as f64).round().max(1.0) as usize;
        (grains * grain).min(count)
    };
    PatchSize {
        rows: side(grid.rows.count, grain.rows),
        columns: side(grid.columns.count, grain.columns),
    }
}
