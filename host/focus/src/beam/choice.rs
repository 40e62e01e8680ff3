//! Choice of the beam of an image.

use std::fmt;

use super::band::beam_of_band;
use super::{Beam, BeamSource, Demanded, Estimate, EstimateError, blocks, demanded, estimate};
use crate::FormError;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::PhaseHistory;
use subaperture_signal::window::Window;

/// Which beam selects the pulses of each point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum BeamChoice {
    /// The beam stated by the recording. Without one, the beam that the azimuth Doppler spectrum clearly shows, where points are seen over more angles
    /// than the pulse spacing samples. All pulses for all pixels where such a beam does not suit the recording or excludes no pulse.
    #[default]
    Stated,
    /// A beam of this full width centred this far forward of broadside, radians.
    Given {
        /// Full width between the edges, radians.
        width_rad: f64,
        /// Squint, radians, positive forward of broadside.
        squint_rad: f64,
    },
    /// The beam of the azimuth Doppler spectrum.
    Estimated {
        /// Approximate squint, radians, which selects among the ambiguous ones; `None` for that of [`estimate`].
        near_rad: Option<f64>,
    },
    /// The part of the beam within a processed Doppler band. It needs pulse times and an evenly sampled straight track.
    DopplerBand {
        /// Full width, hertz at the centre frequency. Azimuth ambiguities are suppressed where it is less than the pulse repetition frequency.
        width_hz: f64,
        /// Doppler centroid, hertz, positive for echoes from forward of broadside; `None` for the middle of the stated beam, or else that of [`estimate`].
        centroid_hz: Option<f64>,
    },
    /// All pulses for all pixels.
    None,
}

/// Beam chosen for an image.
#[derive(Clone, Debug)]
pub struct ChosenBeam {
    /// The beam; `None` for an image formed from all pulses.
    pub beam: Option<Beam>,
    /// Spacing of the ambiguous squints, radians, where the samples do not resolve the ambiguity.
    pub ambiguity_rad: Option<f64>,
    /// Number of pixels that no pulse illuminates; they are zero.
    pub num_unseen: u64,
    /// Reason that a stated or a shown beam is not used.
    pub rejected: Option<Rejected>,
    /// Azimuth ambiguities within the grid that no beam suppresses. `None` for a curved or uneven track, where targets do not repeat at one distance.
    pub ghosts: Option<Ghosts>,
}

/// Azimuth ambiguities: the grid is wider than the pulse spacing samples, and no beam limits the angles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ghosts {
    /// Angles over the grid.
    pub demanded: Demanded,
}

impl fmt::Display for Ghosts {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let deg = |sine: f64| libm::asin(sine.min(1.0)).to_degrees();
        let Demanded {
            unambiguous,
            across,
            repeat_m,
            ..
        } = self.demanded;
        write!(
            f,
            "image: ghosts of targets are possible about {repeat_m:.0} m from them along the track: the grid spans {:.2} deg at a pulse, and the pulse spacing samples {:.2} deg \
             without ambiguity",
            deg(across),
            deg(unambiguous)
        )
    }
}

/// Reason that an automatic beam is not used.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Rejected {
    /// The beam does not suit the recording or the grid.
    Unsuited {
        /// Origin of the beam.
        source: BeamSource,
        /// The reason, a clause.
        why: String,
    },
    /// The Doppler spectrum shows a beam with an ambiguous squint.
    Undecided {
        /// Beam that the spectrum shows.
        estimate: Estimate,
        /// Angles over the grid.
        demanded: Demanded,
    },
}

impl fmt::Display for Rejected {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Unsuited { source, why } => write!(
                f,
                "beam: every pixel is formed from all pulses, because the beam {} does not suit this image: {why}",
                source.name()
            ),
            Self::Undecided { estimate, demanded } => write!(
                f,
                "image: ghosts are possible: points are seen over up to {:.2} deg, and the Doppler spectrum shows a beam of {:.3} deg with an ambiguous squint of \
                 {:.3} deg forward of broadside, modulo {:.3} deg",
                libm::asin(demanded.most.min(1.0)).to_degrees(),
                estimate.beam.width_rad.to_degrees(),
                estimate.beam.squint_rad.to_degrees(),
                estimate.ambiguity_rad.to_degrees()
            ),
        }
    }
}

/// Warning about the beam of an image.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum BeamWarning<'a> {
    /// An automatic beam is not used.
    Rejected(&'a Rejected),
    /// No beam suppresses the azimuth ambiguities within the grid.
    Ghosts(&'a Ghosts),
    /// Pixels that no pulse illuminates.
    Unseen {
        /// Number of these pixels.
        pixels: u64,
        /// Number of all pixels of the grid.
        of: u64,
    },
}

impl fmt::Display for BeamWarning<'_> {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Rejected(rejected) => rejected.fmt(f),
            Self::Ghosts(ghosts) => ghosts.fmt(f),
            Self::Unseen { pixels, of } => write!(
                f,
                "{pixels} of {of} pixels are illuminated by no pulse: they are zero"
            ),
        }
    }
}

impl ChosenBeam {
    /// Warnings about this beam for an image on `grid`.
    pub fn warnings(&self, grid: &ImageGrid) -> Vec<BeamWarning<'_>> {
        let mut warnings = Vec::new();
        match (&self.rejected, &self.ghosts) {
            (Some(rejected), _) => warnings.push(BeamWarning::Rejected(rejected)),
            (None, Some(ghosts)) => warnings.push(BeamWarning::Ghosts(ghosts)),
            (None, None) => {}
        }
        if let pixels @ 1.. = self.num_unseen {
            warnings.push(BeamWarning::Unseen {
                pixels,
                of: grid.num_pixels(),
            });
        }
        warnings
    }

    /// All pulses for all pixels.
    fn all_pulses(rejected: Option<Rejected>) -> Self {
        Self {
            beam: None,
            ambiguity_rad: None,
            num_unseen: 0,
            rejected,
            ghosts: None,
        }
    }

    fn of(beam: Beam) -> Self {
        Self {
            beam: Some(beam),
            ..Self::all_pulses(None)
        }
    }
}

/// Largest width of an automatic beam, relative to the smallest range of angles over which the pulses see a point of the grid.
const NARROWER: f64 = 0.7;

/// Choose the beam of an image of `history` on `grid`.
///
/// # Errors
/// [`EstimateError`]: that of [`estimate`], or [`FormError::Unsuited`] if a given or estimated beam does not suit the recording or the grid.
pub fn choose(
    choice: BeamChoice,
    history: &dyn PhaseHistory,
    grid: &ImageGrid,
    monitor: &dyn Monitor,
) -> Result<ChosenBeam, EstimateError> {
    let mut chosen = limited(choice, history, grid, monitor)?;
    // A beam narrower than the unambiguous interval receives no ambiguities but in its flanks.
    let width = chosen.beam.as_ref().map_or(2.0, |beam| {
        let edges = [-0.5, 0.5].map(|side| libm::sin(beam.squint_rad + side * beam.width_rad));
        edges[1] - edges[0]
    });
    chosen.ghosts = demanded(history, grid)
        .filter(|demanded| demanded.across.min(width) > demanded.unambiguous)
        .map(|demanded| Ghosts { demanded });
    Ok(chosen)
}

/// The beam without a statement about ambiguities.
fn limited(
    choice: BeamChoice,
    history: &dyn PhaseHistory,
    grid: &ImageGrid,
    monitor: &dyn Monitor,
) -> Result<ChosenBeam, EstimateError> {
    let chosen = match choice {
        BeamChoice::None => return Ok(ChosenBeam::all_pulses(None)),
        BeamChoice::Given {
            width_rad,
            squint_rad,
        } => ChosenBeam::of(Beam {
            target: history.target().cloned(),
            ..Beam::new(width_rad, squint_rad, BeamSource::Given)
        }),
        BeamChoice::Estimated { near_rad } => {
            let found = estimate(history, grid, near_rad, monitor)?;
            ChosenBeam {
                ambiguity_rad: (!found.decided).then_some(found.ambiguity_rad),
                ..ChosenBeam::of(found.beam)
            }
        }
        BeamChoice::DopplerBand {
            width_hz,
            centroid_hz,
        } => {
            let (beam, ambiguity_rad) =
                beam_of_band(width_hz, centroid_hz, history, grid, monitor)?;
            ChosenBeam {
                ambiguity_rad,
                ..ChosenBeam::of(beam)
            }
        }
        BeamChoice::Stated => match history.stated_beam() {
            Ok(Some(beam)) => ChosenBeam::of(beam),
            Ok(None) => shown(history, grid, monitor)?,
            Err(why) => {
                return Ok(ChosenBeam::all_pulses(Some(Rejected::Unsuited {
                    source: BeamSource::Stated,
                    why: why.to_string(),
                })));
            }
        },
    };
    let Some(beam) = &chosen.beam else {
        return Ok(chosen);
    };
    let requested = choice != BeamChoice::Stated;
    let illumination = super::check_sound(beam).and_then(|()| {
        crate::check(history.collection(), grid)?;
        blocks::illumination(beam, history.collection(), grid, Window::None)
    });
    match illumination {
        Ok(illumination)
            if !requested && super::all_see(&illumination, history.collection().pulses.len()) =>
        {
            Ok(ChosenBeam::all_pulses(None))
        }
        Ok(illumination) => Ok(ChosenBeam {
            num_unseen: illumination.num_unseen(),
            ..chosen
        }),
        Err(error @ FormError::Unsuited(_)) if !requested => {
            Ok(ChosenBeam::all_pulses(Some(Rejected::Unsuited {
                source: beam.source,
                why: error.to_string(),
            })))
        }
        Err(error) => Err(error.into()),
    }
}

/// The beam that the Doppler spectrum clearly shows, where points are seen over more angles than the pulse spacing samples.
fn shown(
    history: &dyn PhaseHistory,
    grid: &ImageGrid,
    monitor: &dyn Monitor,
) -> Result<ChosenBeam, EstimateError> {
    let Some(demanded) = demanded(history, grid) else {
        return Ok(ChosenBeam::all_pulses(None));
    };
    if demanded.most <= demanded.unambiguous {
        return Ok(ChosenBeam::all_pulses(None));
    }
    let found = match estimate(history, grid, None, monitor) {
        Ok(found) => found,
        Err(error @ EstimateError::Form(FormError::Cancelled | FormError::Read(_))) => {
            return Err(error);
        }
        Err(_) => return Ok(ChosenBeam::all_pulses(None)),
    };
    if found.beam.width_rad >= NARROWER * demanded.least {
        return Ok(ChosenBeam::all_pulses(None));
    }
    if !found.decided {
        return Ok(ChosenBeam::all_pulses(Some(Rejected::Undecided {
            estimate: found,
            demanded,
        })));
    }
    Ok(ChosenBeam::of(found.beam))
}
