//! Resolution of the truck-borne radar: Chim 2018, 4.5.

use std::f64::consts::{LN_2, PI};
use std::sync::Arc;

use glam::DVec3;
use num_complex::Complex64;

use super::chim_radar::standing;
use super::chim_strip::{focused, with_task};
use super::forming::{ERROR_DB, grid_about};
use crate::{Check, Context, Finding, Item, ItemError, NOT_GIVEN};
use subaperture_focus::ImageFormer;
use subaperture_focus::rda::RangeDopplerAlgorithm;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::Image;
use subaperture_model::phase_history::Band;
use subaperture_model::radar::{Pattern, Reference, Waveform};
use subaperture_model::track::Linear;
use subaperture_planner::sampling::{cross_range_resolution_m, range_resolution_m};
use subaperture_quality::response::{Settings, Target, measure};
use subaperture_signal::window::Window;
use subaperture_simulate::engine::Method;
use subaperture_simulate::scene::Scene;
use subaperture_simulate::{Experiment, Pair, Scatterer};

pub(super) const ITEMS: [Item; 1] = [Item {
    id: "c-4-5",
    source: "Chim 2018, 4.5",
    title: "Resolutions of the L-band radar on a truck",
    work: 0.72,
    reproduce: resolutions,
}];

const RANGE_M: f64 = 30.0;
const BEAM_DEG: f64 = 13.3;
/// Pulse spacing, metres; Nyquist at 22 degrees is 0.1.
const SPACING_M: f64 = 0.06;
/// Number of pulses: 24 m of track, 22 degrees to both sides, where the two-way beam is 65 dB down.
const NUM_PULSES: usize = 401;
/// 3 dB width of the response of a uniform band, over the inverse bandwidth.
const UNWEIGHTED: f64 = 0.886;

fn pass(pattern: Pattern) -> Experiment {
    let scatterer = Scatterer {
        position_m: DVec3::ZERO,
        amplitude: Complex64::ONE,
    };
    let scene = Scene {
        points: vec![scatterer],
        ..Scene::default()
    };
    let band = Band {
        start_hz: 1.7e9,
        step_hz: 300e6 / 64.0,
        count: 64,
    };
    let radar_m = DVec3::new(0.0, -RANGE_M, 0.0);
    let mut truck = standing("truck", Waveform::Ideal { band }, pattern, radar_m, scene);
    // Drives along x, looks left.
    truck.radar.num_pulses = NUM_PULSES;
    truck.radar.pri_s = SPACING_M;
    truck.track = Arc::new(Linear {
        position_m: radar_m,
        velocity_m_s: DVec3::X,
        at_s: SPACING_M * (NUM_PULSES - 1) as f64 / 2.0,
    });
    truck.reference = Reference::Point(DVec3::ZERO);
    truck.method = Method::default();
    truck
}

/// Image relative to its peak, and 3 dB widths along the track and in range.
fn image_and_widths_m(
    context: &Context,
    experiment: &Experiment,
    grid: &ImageGrid,
) -> Result<(Image, [f64; 2]), ItemError> {
    let pair = Pair {
        transmitter: 0,
        receiver: 0,
    };
    let recording = experiment
        .record(pair)
        .map_err(|error| ItemError::Measure(error.to_string()))?;
    let former = RangeDopplerAlgorithm {
        error_db: ERROR_DB,
        secondary_compression: true,
    };
    let formed = with_task(context, &recording, grid, Window::None, |task| {
        former.form_best(task)
    })?;
    let response = measure(
        &formed.image,
        grid,
        Target::Brightest,
        &Settings {
            half_chip: Some([100, 40]),
            ..Settings::default()
        },
    )
    .map_err(|error| ItemError::Measure(error.to_string()))?;
    let widths_m = [0, 1].map(|i: usize| response.cuts[i].width_3db.unwrap_or(f64::NAN));
    let mut image = formed.image;
    let peak = image.peak().map_or(1.0, |peak| peak.value.norm());
    image.pixels.iter_mut().for_each(|z| *z /= peak);
    Ok((image, widths_m))
}

fn resolutions(context: &Context) -> Result<Finding, ItemError> {
    let beam_rad = BEAM_DEG.to_radians();
    let pattern = Pattern::Gaussian {
        azimuth_rad: beam_rad,
        elevation_rad: PI / 2.0,
    };
    let grid = grid_about(DVec3::ZERO, 3.0, 6.0, 0.05);
    let (image, [along_m, range_m]) = image_and_widths_m(context, &pass(pattern), &grid)?;

    let wavelength_m = SPEED_OF_LIGHT_M_S / 1.85e9;
    let of_half_m = cross_range_resolution_m(wavelength_m, beam_rad / 2.0);
    let of_full_m = cross_range_resolution_m(wavelength_m, beam_rad);
    // Two-way power exp(-8 ln 2 (theta / beam)^2), that is amplitude exp(-4 ln 2 (kx / (kappa beam))^2) over
    // wavenumber: its transform falls to half the power at x = 2 sqrt 2 ln 2 / (kappa beam).
    let gaussian_m = 4.0 * 2f64.sqrt() * LN_2 * wavelength_m / (4.0 * PI * beam_rad);
    let cell_m = range_resolution_m(300e6);
    Ok(Finding {
        thesis: "1.7 to 2.0 GHz: a range resolution of 0.5 m; a beam of 13.3 degrees, thus an azimuth resolution \
                 of about 0.13 m. Images by the range-Doppler algorithm."
            .to_owned(),
        method: format!(
            "A unit scatterer {RANGE_M} m from a straight track, a Gaussian beam of {BEAM_DEG} degrees for both \
             transmission and reception, {NUM_PULSES} pulses; focused by the range-Doppler algorithm without weights; \
             3 dB widths. Scaled down: one scatterer and an exactly known straight track instead of the parking lot and \
             the open area of Figs 4.4 to 4.6 with their GNSS/INS log, azimuth resampling and map overlay, because neither \
             recording is public. The thesis gives neither pulse count nor range."
        ),
        checks: vec![
            Check::printed("range resolution, c / 2B", "0.5", cell_m, 3, "m"),
            Check::number(
                "width in range: 0.886 c / 2B, measured",
                UNWEIGHTED * cell_m,
                range_m,
                0.01,
                3,
                "m",
            ),
            Check::printed(
                "azimuth resolution by (2.40), lambda / (4 sin 6.65 deg)",
                "0.13",
                of_half_m,
                2,
                "m",
            ),
            Check::printed("the same with the full beam in place of half", "0.13", of_full_m, 2, "m"),
            Check::printed("width in azimuth, measured", "0.13", along_m, 3, "m"),
            Check::claim(
                "width in azimuth by closed form for this beam, 4 sqrt 2 ln 2 lambda / (4 pi beam)",
                NOT_GIVEN,
                format!("{gaussian_m:.3} m"),
                (gaussian_m / along_m - 1.0).abs() < 0.03,
            ),
        ],
        why: Some(format!(
            "The thesis's own (2.40) gives {of_half_m:.2} m for half of 13.3 degrees; 0.13 m would take lines of \
             sight out to {:.1} degrees, where its two-way beam is {:.0} dB down. The measured width \
             counts all that the Gaussian beam lights and ends at half power, so it is less than (2.40)'s.",
            (wavelength_m / (4.0 * 0.13)).asin().to_degrees(),
            // 3 dB one way at half the beam, growing with the square of the angle.
            2.0 * 3.01 * ((wavelength_m / (4.0 * 0.13)).asin() / (beam_rad / 2.0)).powi(2)
        )),
        pictures: vec![focused(&image, &grid, "The scatterer, relative to its peak")?],
    })
}
