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
//! **Antenna weights.** With antenna patterns ([`AntennaPatterns`]) the pulses of a block have the two-way amplitude `A_n` of the patterns at the block's centre
//! `c` as weights, an approximately matched filter (Chim 2018, 3.2.1), and each pixel is divided by the response of a point scatterer on it:
//!
//! ```text
//! I(p) = sum_n w_n W_n(c) s_n(p) / sum_n w_n W_n(c) A_n(p),    W_n(c) = |A_n(c)|, 0 below -20 dB of the largest and at the opposite sign
//! ```
//!
//! with the slow-time window `w_n` and the compressed pulse `s_n(p)`. A point scatterer with amplitude 1 on boresight reads 1 on every pixel, and noise is higher towards the
//! edge of the beam. A pixel at which no pulse reaches -40 dB two-way is zero. Blocks are small enough for a loss of at most 0.1 dB against the matched filter of each pixel. A beam
//! further limits the pulses. Patterns are those of one frequency.
//!
//! [`InBeam`] adapts any former to such images. It makes a plan for each block with the pulses and pixels of that block. Its plan contains those of all blocks,
//! so that a stored plan is complete and tiles are bit-identical to the whole image. [`estimate`] derives width and squint from the azimuth Doppler
//! spectrum of the recording.
//!
//! **Neglected.** Within a block the aperture does not follow the pixel: it is shifted by at most a sixteenth of its length, which makes the effective window asymmetric by that amount.
//! The beam is an interval of angles; the antenna pattern within it is compensated only by antenna weights. Ambiguities received within the beam, from points whose Doppler frequency there
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
mod matched;
mod moments;
mod normalisation;
mod track;

use std::sync::Arc;

use glam::DVec3;
use serde::Deserialize;
use serde_json::Value;

use crate::former_choices::FormerChoices;
use crate::{Decision, ErrorGoal, FormError, Forming, GridPoints, ImageFormer, ImageSpec};
use subaperture_model::antenna::AntennaPatterns;
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

/// Adapter that forms each point from the pulses that illuminate it, with weights matched to antenna patterns if there are any.
pub struct InBeam {
    former: Arc<dyn ImageFormer>,
    limits: Limits,
}

/// Beam, antenna patterns, or both.
struct Limits {
    beam: Option<Beam>,
    patterns: Option<Arc<AntennaPatterns>>,
}

/// Settings keys of the beam and of the antenna patterns.
const KEY: &str = "beam";
const PATTERNS_KEY: &str = "antenna_patterns";

/// Weights of pulses by antenna patterns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AntennaWeights {
    /// Patterns have no effect on weights.
    #[default]
    None,
    /// Pulses are weighted by the two-way pattern, and pixels divided by the response of a point scatterer.
    Matched,
}

impl AntennaWeights {
    /// Beam of an image for which `beam` is chosen: with matched weights the patterns select the pulses, unless another beam is requested.
    pub fn beam(self, beam: BeamChoice) -> BeamChoice {
        match (self, beam) {
            (Self::Matched, BeamChoice::Stated) => BeamChoice::None,
            _ => beam,
        }
    }

    /// Antenna patterns that the weights of a recording need; `None` without antenna weights.
    ///
    /// # Errors
    /// [`FormError::Unsuited`] if the recording describes none.
    pub fn patterns(
        self,
        history: &dyn PhaseHistory,
    ) -> Result<Option<AntennaPatterns>, FormError> {
        if self == Self::None {
            return Ok(None);
        }
        let collection = history.collection();
        let times_s: Vec<f64> = collection.pulses.iter().map(|pulse| pulse.time_s).collect();
        let mounted = history.antennas();
        let patterns = mounted.and_then(|mounted| AntennaPatterns::new(&mounted, &times_s));
        patterns.map(Some).ok_or_else(|| {
            FormError::unsuited(format!(
                "{}: expected antenna patterns with attitudes at all pulses for antenna weights, found none: describe the antennas of a raw recording \
                 ([[radar.transmitter]], [[radar.receiver]]), or form the image without antenna weights",
                collection.name
            ))
        })
    }
}

impl InBeam {
    /// Wrap `former` for images in `beam`.
    ///
    /// # Errors
    /// [`FormError::Unsuited`] if the beam has no width or looks along the track.
    pub fn new(former: Box<dyn ImageFormer>, beam: Beam) -> Result<Self, FormError> {
        check_sound(&beam)?;
        let limits = Limits {
            beam: Some(beam),
            patterns: None,
        };
        Ok(Self {
            former: former.into(),
            limits,
        })
    }

    /// Wrap `former` for images with weights matched to antenna patterns, from the pulses in `beam` if there is one.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn matched(
        former: Box<dyn ImageFormer>,
        patterns: AntennaPatterns,
        beam: Option<Beam>,
    ) -> Result<Self, FormError> {
        beam.as_ref().map_or(Ok(()), check_sound)?;
        let limits = Limits {
            beam,
            patterns: Some(Arc::new(patterns)),
        };
        Ok(Self {
            former: former.into(),
            limits,
        })
    }

    /// Separate the settings of the wrapped former from those of its beam and antenna patterns; `None` for settings without either.
    pub(crate) fn split(settings: &Value) -> Option<(Value, Value)> {
        let mut own = settings.as_object()?.clone();
        let of_beam = [KEY, PATTERNS_KEY].map(|key| (key.to_owned(), own.remove(key)));
        let given = of_beam
            .into_iter()
            .filter_map(|(key, value)| Some((key, value?)));
        let given: serde_json::Map<String, Value> = given.collect();
        (!given.is_empty()).then_some((Value::Object(own), Value::Object(given)))
    }

    /// Wrap `former` by settings of [`Self::split`].
    pub(crate) fn of(
        former: Box<dyn ImageFormer>,
        settings: &Value,
    ) -> Result<Result<Self, FormError>, serde_json::Error> {
        let beam = settings.get(KEY).map(Beam::deserialize).transpose()?;
        let patterns = settings.get(PATTERNS_KEY);
        let patterns = patterns.map(AntennaPatterns::deserialize).transpose()?;
        Ok(match (beam, patterns) {
            (beam, Some(patterns)) => Self::matched(former, patterns, beam),
            (Some(beam), None) => Self::new(former, beam),
            (None, None) => Err(FormError::unsuited("expected a beam or antenna patterns")),
        })
    }
}

impl ImageFormer for InBeam {
    fn name(&self) -> &'static str {
        self.former.name()
    }

    fn settings(&self) -> Value {
        let mut settings = self.former.settings();
        if let Some(beam) = &self.limits.beam {
            settings[KEY] = serde_json::to_value(beam).expect("a beam is of numbers");
        }
        if let Some(patterns) = &self.limits.patterns {
            let value = serde_json::to_value(&**patterns);
            settings[PATTERNS_KEY] = value.expect("patterns are of numbers");
        }
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
        self.limits.beam.clone()
    }

    fn forms_blocks(&self) -> bool {
        true
    }

    fn weights(
        &self,
        collection: &Collection,
        grid: &ImageGrid,
        fast: Window,
        slow: Window,
    ) -> Result<Weights, FormError> {
        crate::check(collection, grid)?;
        let Limits { beam, patterns } = &self.limits;
        let illumination = match (patterns, beam) {
            (Some(patterns), beam) => {
                matched::illumination(patterns, beam.as_ref(), collection, grid, slow)?
            }
            (None, Some(beam)) => blocks::illumination(beam, collection, grid, slow)?,
            (None, None) => return Err(FormError::unsuited("expected a beam or antenna patterns")),
        };
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
        let limits = (self.limits.beam.as_ref(), &**illumination);
        choices::decide(&*self.former, limits, spec, goal, monitor)
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
            limits: Limits {
                beam: self.limits.beam.clone(),
                patterns: self.limits.patterns.clone(),
            },
        }))
    }
}

/// Limit the pulses and weights of `former` to a beam and to antenna patterns, where there are any.
///
/// # Errors
/// As [`InBeam::new`].
pub fn limited(
    former: Box<dyn ImageFormer>,
    patterns: Option<AntennaPatterns>,
    beam: Option<Beam>,
) -> Result<Box<dyn ImageFormer>, FormError> {
    Ok(match (patterns, beam) {
        (Some(patterns), beam) => Box::new(InBeam::matched(former, patterns, beam)?),
        (None, Some(beam)) => Box::new(InBeam::new(former, beam)?),
        (None, None) => former,
    })
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
    match (former.forms_blocks(), &weights.illumination) {
        (true, None) => illumination_of(weights).map(drop),
        (false, Some(_)) => Err(FormError::unsuited(format!(
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
