//! The former of an image, in the beam that is typed, that the recording states, or that its Doppler spectrum shows.

use glam::DVec3;
use subaperture::focus::beam::{self, Beam, BeamSource, EstimateError, InBeam, demanded, estimate};
use subaperture::focus::{FormError, ImageFormer};
use subaperture::geometry::ImageGrid;
use subaperture::phase_history::PhaseHistory;
use subaperture::signal::window::Window;

use crate::args::{BeamWidth, Imaging};
use crate::config::Session;
use crate::failure::Usage;
use crate::messages;

/// The former that is typed for an image of `history` on `grid`, in its beam; `velocity` is that of the target in whose frame the history is given. Says
/// which beam that is.
pub(crate) fn former(
    session: &Session,
    typed: &Imaging,
    (history, velocity): (&dyn PhaseHistory, Option<DVec3>),
    grid: &ImageGrid,
) -> anyhow::Result<Box<dyn ImageFormer>> {
    let plain = typed.former.former()?;
    let Some(beam) = wanted(session, typed, (history, velocity), grid)? else {
        return Ok(plain);
    };
    let former = InBeam::new(typed.former.former()?, beam.beam);
    let former = former.map_err(|error| match beam.beam.source {
        BeamSource::Given => anyhow::Error::from(Usage(format!(
            "--beam and --squint reach along the track: {error}"
        ))),
        _ => error.into(),
    })?;
    // An unrequested beam that does not suit the recording is dropped; the image uses all pulses.
    let weights = former.weights(history.collection(), grid, Window::None, Window::None);
    let weights = match (weights, beam.asked) {
        (Ok(weights), _) => weights,
        (Err(error), true) => return Err(error.into()),
        (Err(error), false) => {
            messages::warning(format!(
                "beam: every pixel is formed from all pulses, because the beam {} does not suit this image: {error}",
                beam.beam.source.name()
            ));
            return Ok(plain);
        }
    };
    if !beam.asked && beam::sees_all(&weights) {
        return Ok(plain);
    }
    messages::note(&describe(&beam));
    if let Some(unseen @ 1..) = weights.lit.as_ref().map(|lit| lit.num_unseen()) {
        messages::warning(format!(
            "{unseen} of {} pixels are seen by no pulse: they are zero",
            grid.num_pixels()
        ));
    }
    Ok(Box::new(former))
}

/// A beam, whether it is typed, and what it is ambiguous by, radians.
struct Wanted {
    beam: Beam,
    asked: bool,
    ambiguity_rad: Option<f64>,
}

fn describe(wanted: &Wanted) -> String {
    let Beam {
        width_rad,
        squint_rad,
        source,
        ..
    } = wanted.beam;
    let modulo = wanted.ambiguity_rad.map_or(String::new(), |modulo| {
        format!(
            ", modulo {:.3} deg (--squint says about which)",
            modulo.to_degrees()
        )
    });
    let none = match wanted.asked {
        true => "",
        false => "; --beam none takes all pulses for all pixels",
    };
    format!(
        "beam: {:.3} deg wide, {:.3} deg forward of broadside{modulo}, {}{none}",
        width_rad.to_degrees(),
        squint_rad.to_degrees(),
        source.name(),
    )
}

fn wanted(
    session: &Session,
    typed: &Imaging,
    (history, velocity): (&dyn PhaseHistory, Option<DVec3>),
    grid: &ImageGrid,
) -> anyhow::Result<Option<Wanted>> {
    let squint_rad = typed.squint.map(f64::to_radians);
    let stated = history.beam();
    let target_m_s = velocity.map(|velocity| velocity.to_array());
    match typed.beam {
        Some(BeamWidth::None) => Ok(None),
        Some(BeamWidth::Given(width_rad)) => {
            let beam = Beam::new(width_rad, squint_rad.unwrap_or(0.0), BeamSource::Given);
            let beam = Beam { target_m_s, ..beam };
            Ok(Some(Wanted {
                beam,
                asked: true,
                ambiguity_rad: None,
            }))
        }
        Some(BeamWidth::Estimated) => {
            let progress = session.progress("looking at the Doppler spectrum");
            let found = estimate(history, grid, squint_rad, target_m_s, &progress)?;
            progress.finish();
            Ok(Some(Wanted {
                beam: found.beam,
                asked: true,
                ambiguity_rad: (!found.decided).then_some(found.ambiguity_rad),
            }))
        }
        None => match stated {
            Some(beam) => Ok(Some(Wanted {
                beam,
                asked: false,
                ambiguity_rad: None,
            })),
            None => shown(session, history, grid, target_m_s),
        },
    }
}

/// Largest width of an unrequested beam, as a share of the smallest range of angles under which the pulses see a place of the grid.
const NARROWER: f64 = 0.7;

/// The beam that the Doppler spectrum clearly shows, where places are seen under more angles than the spacing of pulses samples.
fn shown(
    session: &Session,
    history: &dyn PhaseHistory,
    grid: &ImageGrid,
    target_m_s: Option<[f64; 3]>,
) -> anyhow::Result<Option<Wanted>> {
    let Some(demanded) = demanded(history, grid, target_m_s) else {
        return Ok(None);
    };
    if demanded.most <= demanded.unambiguous {
        return Ok(None);
    }
    let progress = session.progress("looking at the Doppler spectrum");
    let found = match estimate(history, grid, None, target_m_s, &progress) {
        Ok(found) => found,
        Err(EstimateError::Form(error @ (FormError::Cancelled | FormError::Read(_)))) => {
            return Err(error.into());
        }
        Err(_) => return Ok(None),
    };
    progress.finish();
    if found.beam.width_rad >= NARROWER * demanded.least {
        return Ok(None);
    }
    if !found.decided {
        messages::warning(format!(
            "image: ghosts are possible, for places are seen under up to {:.2} deg and the Doppler spectrum shows a beam of {:.3} deg; where it looks is not clear:              {:.3} deg forward of broadside, modulo {:.3} deg. Say about where by --beam auto --squint DEG, or take all pulses by --beam none",
            demanded.most.min(1.0).asin().to_degrees(),
            found.beam.width_rad.to_degrees(),
            found.beam.squint_rad.to_degrees(),
            found.ambiguity_rad.to_degrees(),
        ));
        return Ok(None);
    }
    Ok(Some(Wanted {
        beam: found.beam,
        asked: false,
        ambiguity_rad: None,
    }))
}
