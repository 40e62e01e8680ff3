//! Strip-map images: each point is formed from the pulses whose beam illuminates it.
//!
//! In a strip map the beam passes each point once. Pulses outside this pass hold no echo of the point, and the matched filter of the point is undersampled
//! in slow time there. Echoes of points whose Doppler frequency differs by a multiple of the pulse repetition frequency then add up to ghosts (azimuth
//! ambiguities). A point `p` is therefore formed from the pulses
//!
//! ```text
//! { n : |theta_n(p) - squint| <= width / 2 },    sin theta_n(p) = v_n . (p - a_n) / |p - a_n|
//! ```
//!
//! where `a_n` is the antenna position (midpoint of transmitter and receiver) and `v_n` its heading. The slow-time window spans these pulses from
//! first to last, and the sum is divided by their weights: a unit scatterer seen equally by all of them reads 1, as in every image of this crate.
//!
//! The grid is divided into blocks of one size, over which the aperture centre moves by at most an eighth of the aperture length. Each block is formed from
//! the pulses that illuminate its centre. This division defines the image: the blocks ([`BlockIllumination`]) are part of its weights, and the float64 reference sum
//! uses the same weighted pulses ([`crate::accuracy`]).
//!
//! [`InBeam`] adapts any former to such images. It makes a plan for each block with the pulses and pixels of that block. Its plan contains those of all blocks,
//! so that a stored plan is complete and tiles are bit-identical to the whole image. [`estimate`] derives width and squint from the azimuth Doppler
//! spectrum of the recording.
//!
//! **Neglected.** Within a block the aperture does not follow the pixel: it is shifted by at most a sixteenth of its length, which makes the effective window asymmetric by that amount.
//! The beam is an interval of angles; the antenna pattern within it is not compensated. Ambiguities received within the beam, from points whose Doppler frequency there
//! differs by a multiple of the pulse repetition frequency, cannot be separated and remain. The bound on echoes of scatterers outside the grid ([`crate::accuracy`]) treats the grid
//! as one block.
//!
//! **Errors.** Each block, and so the image, meets the error bound of the former against its own reference sum. A track with two passes over a point
//! is refused. **Cost.** The cost of the former for each block with its own pulses, plus one more pass over all pulses for the reference sum. A process
//! that forms some of the tiles reads the pulses of their blocks only; the pass is left to the process that finds all tiles.

mod band;
mod blocks;
mod centroid;
mod choice;
mod choices;
mod estimate;
mod forming;
mod moments;
mod track;

use std::sync::Arc;

use glam::DVec3;
use serde_json::Value;

use crate::former_choices::FormerChoices;
use crate::{Decision, ErrorGoal, FormError, Forming, GridPoints, ImageFormer, ImageSpec};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::{
    BlockIllumination, Collection, PhaseHistory, PulseRange, Weights,
};
use subaperture_signal::window::Window;

pub use centroid::{DopplerCentroid, doppler_centroid};
pub use choice::{BeamChoice, BeamWarning, ChosenBeam, Ghosts, Rejected, choose};
pub use estimate::{Demanded, Estimate, EstimateError, demanded, estimate};
pub use subaperture_model::phase_history::{Aim, Beam, BeamSource, NoBeam};

use track::Track;

/// Adapter that forms each point from the pulses that illuminate it.
pub struct InBeam {
    former: Arc<dyn ImageFormer>,
    beam: Beam,
}

/// Settings key of the beam.
const KEY: &str = "beam";

impl InBeam {
    /// Wrap `former` for images in `beam`.
    ///
    /// # Errors
    /// [`FormError::Unsuited`] if the beam has no width or looks along the track.
    pub fn new(former: Box<dyn ImageFormer>, beam: Beam) -> Result<Self, FormError> {
        check_sound(&beam)?;
        Ok(Self {
            former: former.into(),
            beam,
        })
    }

    /// Separate the settings of the wrapped former from the beam; `None` for settings without a beam.
    pub(crate) fn split(settings: &Value) -> Option<(Value, Result<Beam, serde_json::Error>)> {
        let mut own = settings.as_object()?.clone();
        let beam = own.remove(KEY)?;
        Some((Value::Object(own), serde_json::from_value(beam)))
    }
}

impl ImageFormer for InBeam {
    fn name(&self) -> &'static str {
        self.former.name()
    }

    fn settings(&self) -> Value {
        let mut settings = self.former.settings();
        settings[KEY] = serde_json::to_value(&self.beam).expect("a beam is of numbers");
        settings
    }

    fn bound_db(&self) -> Option<f64> {
        self.former.bound_db()
    }

    fn follows_sweeps(&self) -> bool {
        self.former.follows_sweeps()
    }

    fn follows_relief(&self) -> bool {
        self.former.follows_relief()
    }

    fn grid_points(&self) -> GridPoints {
        self.former.grid_points()
    }

    fn beam(&self) -> Option<Beam> {
        Some(self.beam.clone())
    }

    fn weights(
        &self,
        collection: &Collection,
        grid: &ImageGrid,
        fast: Window,
        slow: Window,
    ) -> Result<Weights, FormError> {
        crate::check(collection, grid)?;
        let illumination = blocks::illumination(&self.beam, collection, grid, slow)?;
        Ok(Weights {
            illumination: Some(Arc::new(illumination)),
            ..Weights::new(collection, fast, slow)
        })
    }

    fn decide(
        &self,
        spec: &ImageSpec,
        goal: &ErrorGoal,
        monitor: &dyn Monitor,
    ) -> Result<Decision, FormError> {
        let illumination = illumination_of(spec.weights)?;
        choices::decide(&*self.former, &self.beam, illumination, spec, goal, monitor)
    }

    fn open<'a>(
        &self,
        spec: ImageSpec<'a>,
        choices: &FormerChoices,
    ) -> Result<Box<dyn Forming + 'a>, FormError> {
        let illumination = Arc::clone(illumination_of(spec.weights)?);
        let former = self.former.name();
        let choices = choices::Choices::of(former, choices, &illumination)?;
        let former = Arc::clone(&self.former);
        Ok(Box::new(forming::InBlocks::new(
            former,
            spec,
            illumination,
            choices,
        )))
    }

    fn planning_for(&self, error_db: f64) -> Option<Box<dyn ImageFormer>> {
        Some(Box::new(Self {
            former: self.former.planning_for(error_db)?.into(),
            beam: self.beam.clone(),
        }))
    }
}

/// Refuse a beam without width, or one that reaches along the track.
fn check_sound(beam: &Beam) -> Result<(), FormError> {
    match beam.is_sound() {
        true => Ok(()),
        false => Err(FormError::unsuited(format!(
            "beam {:.3} deg wide, {:.3} deg forward of broadside: expected a width above 0 deg and edges less than 90 deg from broadside",
            beam.width_rad.to_degrees(),
            beam.squint_rad.to_degrees()
        ))),
    }
}

/// Illuminated blocks of weights made for a beam.
fn illumination_of(weights: &Weights) -> Result<&Arc<BlockIllumination>, FormError> {
    let why = "the weights do not state which pulses see which pixels: a former in a beam needs those of ImageFormer::weights";
    weights
        .illumination
        .as_ref()
        .ok_or_else(|| FormError::unsuited(why))
}

/// Refuse beam weights for a former that uses all pulses for every pixel, and uniform weights for a former in a beam.
///
/// # Errors
/// [`FormError::Unsuited`].
pub(crate) fn check<F: ImageFormer + ?Sized>(
    former: &F,
    weights: &Weights,
) -> Result<(), FormError> {
    match (former.beam(), &weights.illumination) {
        (Some(_), None) => illumination_of(weights).map(drop),
        (None, Some(_)) => Err(FormError::unsuited(format!(
            "the weights are those of a beam, but {} forms every pixel from all pulses",
            former.name()
        ))),
        _ => Ok(()),
    }
}

/// Restrict a history to the pulses that illuminate a point, for measurements of the image there.
///
/// # Errors
/// [`FormError::Unsuited`] if no pulse or more than one pass illuminates the point.
pub fn seeing<'a>(
    beam: &Beam,
    history: &'a dyn PhaseHistory,
    place_m: DVec3,
) -> Result<PulseRange<'a>, FormError> {
    let collection = history.collection();
    let pulses = Track::of(collection, beam)?.seeing(beam, place_m)?;
    match pulses.is_empty() {
        false => Ok(PulseRange::new(history, pulses)),
        true => Err(blocks::unseen(beam, &collection.name)),
    }
}

fn all_see(illumination: &BlockIllumination, num_pulses: usize) -> bool {
    (0..illumination.num_blocks()).all(|block| illumination.pulses(block) == (0..num_pulses))
}
