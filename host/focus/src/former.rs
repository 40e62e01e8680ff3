//! Interface of image formers: decide on a plan for an image, then form any part of it.
//!
//! ```text
//! ImageSpec (geometry, grid, weights, scratch) ── decide ──> Decision (choices, planned error)
//! ImageSpec, choices ── open ──> Forming ── form (pulses, tiles, memory) ──> pixels of these tiles
//! ```
//!
//! **Reproducibility.** The value of a pixel depends only on the specification, the choices and the samples. It is bit-identical for any number of threads, any
//! memory, and any tiles formed, in any place, order or number at a time. With portable transforms
//! ([`super::Transforms`]) it is also bit-identical on every machine. Therefore
//! - a parameter that affects summation order or table size is a choice, made once for the whole grid and recorded;
//! - memory determines only how many pulses are read at a time, how many threads work and how many tiles share a pass over
//!   the pulses.
//!
//! Choices have a JSON form, so that another process on another machine can open the same plan.

use super::error::FormError;
use super::formed::Formed;
use super::former_choices::FormerChoices;
use super::goal::{BoundPolicy, ErrorGoal};
use super::grid_points::GridPoints;
use super::patch::Rectangle;
use super::spec::{Decision, ImageSpec, Tile, Work};
use super::task::Task;
use super::{accuracy, execute};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::{Beam, Collection, Weights};
use subaperture_signal::window::Window;

/// Former that has opened a plan and can form tiles of one image.
pub trait Forming: Sync {
    /// Scratch memory per pixel, bytes, in addition to the 8 bytes of the tile.
    fn pixel_bytes(&self) -> u64 {
        0
    }

    /// Whether [`Self::form`] reads all pulses in ascending order, for any tiles. If not, they are read once more for the comparison with the exact
    /// sum: before the tiles if all are formed at once, otherwise when the last tile of the image exists.
    fn reads_all_pulses(&self) -> bool {
        true
    }

    /// Number of pulses that [`Self::form`] reads for tiles at the given places; a pulse that is read twice counts twice.
    ///
    /// # Errors
    /// [`FormError::Memory`].
    fn pulses_read(&self, work: &Work, _places: &[Rectangle]) -> Result<u64, FormError> {
        Ok(work.history.collection().pulses.len() as u64)
    }

    /// Add the image to tiles of zeros in one pass over the pulses.
    ///
    /// # Errors
    /// [`FormError`]; the content of the tiles is then undefined.
    fn form(&self, work: &Work, tiles: &mut [Tile]) -> Result<(), FormError>;
}

/// Image formation algorithm.
pub trait ImageFormer: Send + Sync {
    /// Name used in records and on the command line.
    fn name(&self) -> &'static str;

    /// Settings as JSON, from which [`super::formers::former`] makes an equal former.
    fn settings(&self) -> serde_json::Value;

    /// Error bound for its images ([`accuracy`]), dB; `None` for no bound.
    fn bound_db(&self) -> Option<f64>;

    /// Whether intra-pulse motion is followed sample by sample. If not, the error of the stop-and-go approximation
    /// ([`super::sweep::residual`]) is part of the planned error.
    fn follows_sweeps(&self) -> bool {
        false
    }

    /// Whether pixels on a surface above the grid plane ([`ImageGrid::relief`]) are formed within the bound. If not, a task whose grid has
    /// a surface is refused.
    fn follows_relief(&self) -> bool {
        false
    }

    /// Quantity whose values are the grid's points.
    fn grid_points(&self) -> GridPoints {
        GridPoints::Positions
    }

    /// Beam that selects the pulses of each point ([`super::beam::InBeam`]); `None` for a former that uses all pulses for every
    /// pixel.
    fn beam(&self) -> Option<Beam> {
        None
    }

    /// Whether blocks of pixels are formed from different pulses or weights ([`super::beam::InBeam`]).
    fn forms_blocks(&self) -> bool {
        self.beam().is_some()
    }

    /// Weights of the image: windows over fast and slow time and, in a beam, the pulses that illuminate each pixel.
    ///
    /// # Errors
    /// [`FormError::Unsuited`] if the beam does not suit the collection or the grid.
    fn weights(
        &self,
        collection: &Collection,
        _grid: &ImageGrid,
        fast: Window,
        slow: Window,
    ) -> Result<Weights, FormError> {
        Ok(Weights::new(collection, fast, slow))
    }

    /// Error requirement with the bound of this former.
    fn goal(&self, bound_policy: BoundPolicy) -> ErrorGoal {
        ErrorGoal {
            bound_db: self.bound_db(),
            bound_policy,
        }
    }

    /// Decide how to form the image of `spec`, provided that `goal` accepts the planned error.
    ///
    /// # Errors
    /// [`FormError`].
    fn decide(
        &self,
        spec: &ImageSpec,
        goal: &ErrorGoal,
        monitor: &dyn Monitor,
    ) -> Result<Decision, FormError>;

    /// Prepare to form the image of `spec` by choices of [`Self::decide`], possibly made on another machine.
    ///
    /// # Errors
    /// [`FormError::Choices`] if `choices` do not belong to this former and this image.
    fn open<'a>(
        &self,
        spec: ImageSpec<'a>,
        choices: &FormerChoices,
    ) -> Result<Box<dyn Forming + 'a>, FormError>;

    /// Form the image of `task` within the error bound.
    ///
    /// # Errors
    /// [`FormError`].
    fn form(&self, task: &Task) -> Result<Formed, FormError> {
        self.form_asked(task, BoundPolicy::Refused)
    }

    /// Form the image of `task` and record in [`Formed::bound_missed`] whether it exceeds the
    /// error bound.
    ///
    /// # Errors
    /// [`FormError`] except [`FormError::BoundMissed`].
    fn form_best(&self, task: &Task) -> Result<Formed, FormError> {
        self.form_asked(task, BoundPolicy::Allowed)
    }

    /// Form the image of `task` as planned, without a comparison with the exact sum. Intended for the many images of a search, whose
    /// best image is formed again.
    ///
    /// # Errors
    /// [`FormError`] except [`FormError::BoundMissed`].
    fn form_planned(&self, task: &Task) -> Result<Formed, FormError> {
        super::beam::check(self, task.weights)?;
        accuracy::keep_planned(self, task, BoundPolicy::Allowed, |decision, work, tiles| {
            self.open(task.spec(), &decision.choices)?.form(work, tiles)
        })
    }

    /// Form the image by [`Self::form`] or [`Self::form_best`], depending on `bound_policy`.
    ///
    /// # Errors
    /// [`FormError`].
    fn form_asked(&self, task: &Task, bound_policy: BoundPolicy) -> Result<Formed, FormError> {
        execute::in_memory(self, task, bound_policy)
    }

    /// Make the same former with a planned error of `error_db`; `None` if its error cannot be reduced.
    fn planning_for(&self, _error_db: f64) -> Option<Box<dyn ImageFormer>> {
        None
    }
}
