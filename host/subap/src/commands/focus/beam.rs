//! Antenna beam of an image: given by options, stated by the recording, or estimated from the Doppler spectrum; and weights by antenna patterns.

use subaperture::focus::ImageFormer;
use subaperture::focus::beam::{
    AntennaWeights, Beam, BeamChoice, BeamSource, BeamWarning, ChosenBeam, InBeam, Rejected,
    choose, limited,
};
use subaperture::geometry::ImageGrid;
use subaperture::phase_history::PhaseHistory;

use crate::args::{BeamWidth, Imaging};
use crate::config::Session;
use crate::failure::Usage;
use crate::messages;

/// The requested former with the antenna beam for an image of `history` on `grid`. The beam is reported.
pub(crate) fn former(
    session: &Session,
    typed: &Imaging,
    history: &dyn PhaseHistory,
    grid: &ImageGrid,
) -> anyhow::Result<Box<dyn ImageFormer>> {
    let plain = typed.forming.former.former()?;
    let weights = AntennaWeights::from(typed.forming.antenna_weights);
    let patterns = weights.patterns(history)?;
    let choice = weights.beam(choice(typed));
    if let BeamChoice::Given {
        width_rad,
        squint_rad,
    } = choice
        && let beam = Beam::new(width_rad, squint_rad, BeamSource::Given)
        && let Err(error) = InBeam::new(typed.forming.former.former()?, beam)
    {
        let fault = format!("--beam and --squint need antennas that move along the track: {error}");
        return Err(Usage(fault).into());
    }
    let progress = session.progress("choosing the beam");
    let chosen = choose(choice, history, grid, &progress)?;
    progress.finish();
    for warning in chosen.warnings(grid) {
        messages::warning(match warning {
            BeamWarning::Rejected(Rejected::Undecided { .. }) => format!(
                "{warning}. Give the approximate direction with --beam auto --squint DEG, or use all pulses with --beam none"
            ),
            BeamWarning::Ghosts(_) => {
                format!(
                    "{warning}: choose a narrower grid, or a narrower beam with --beam DEG or --doppler-band HZ"
                )
            }
            _ => warning.to_string(),
        });
    }
    if let Some(beam) = &chosen.beam {
        messages::note(&describe(&chosen, beam, choice != BeamChoice::Stated));
    }
    Ok(limited(plain, patterns, chosen.beam)?)
}

fn choice(typed: &Imaging) -> BeamChoice {
    let squint_rad = typed.forming.squint.map(f64::to_radians);
    if let Some(width_hz) = typed.forming.doppler_band {
        return BeamChoice::DopplerBand {
            width_hz,
            centroid_hz: typed.forming.doppler_centroid,
        };
    }
    match typed.forming.beam {
        None => BeamChoice::Stated,
        Some(BeamWidth::None) => BeamChoice::None,
        Some(BeamWidth::Estimated) => BeamChoice::Estimated {
            near_rad: squint_rad,
        },
        Some(BeamWidth::Given(width_rad)) => BeamChoice::Given {
            width_rad,
            squint_rad: squint_rad.unwrap_or(0.0),
        },
    }
}

fn describe(chosen: &ChosenBeam, beam: &Beam, requested: bool) -> String {
    let modulo = chosen.ambiguity_rad.map_or(String::new(), |modulo| {
        format!(
            ", modulo {:.3} deg (--squint selects the ambiguity)",
            modulo.to_degrees()
        )
    });
    let none = match requested {
        true => "",
        false => "; --beam none uses all pulses for all pixels",
    };
    let turns = match beam.aims.is_empty() {
        true => "",
        false => " on average, turning with the antennas",
    };
    format!(
        "beam: {:.3} deg wide, {:.3} deg forward of broadside{turns}{modulo}, {}{none}",
        beam.width_rad.to_degrees(),
        beam.squint_rad.to_degrees(),
        beam.source.name(),
    )
}
