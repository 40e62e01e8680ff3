//! Image and moving targets of one recording: Schone 2020, sections 1.2, 3.1 and 6.1.

use glam::DVec3;

use super::forming::ERROR_DB;
use super::gmti_scene::{
    ANTENNA_M, BANDWIDTH_HZ, FREQUENCIES, GRID, Mover, NOISE, NOISE_TEXT, PRI_S, PULSES, SPEED_M_S,
    WAVELENGTH_M, clutter, db, mean, record,
};
use crate::{Check, Context, Finding, Item, ItemError, NOT_DONE, NOT_GIVEN, Picture};
use subaperture_focus::Numerics;
use subaperture_focus::formers::auto::Auto;
use subaperture_gmti::{Chip, Imaging, MovingTargets, Target, detection, find};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::Image;
use subaperture_plot::{Mark, Panel, Scale, panels};
use subaperture_signal::window::Window;

pub(super) const ITEMS: [Item; 1] = [Item {
    id: "s-6-1",
    source: "Schone 2020, sections 1.2 and 6.1",
    title: "Image and moving targets of one recording",
    work: 10.0,
    reproduce: detected,
}];

/// Radar cross-section of clutter of -5 dB per square metre.
const SIGMA0: f64 = 0.316_227_766;

/// Resolution cell along the track and across it on the ground, metres.
fn cell_m() -> [f64; 2] {
    let range_m = ANTENNA_M.length();
    let ground = -ANTENNA_M.y / range_m;
    let aperture_m = PULSES as f64 * PRI_S * SPEED_M_S;
    [
        WAVELENGTH_M * range_m / (2.0 * aperture_m),
        SPEED_OF_LIGHT_M_S / (2.0 * BANDWIDTH_HZ * ground),
    ]
}

fn imaging<'a>(context: &Context<'a>, grid: &'a ImageGrid) -> Imaging<'a> {
    Imaging {
        former: &Auto { error_db: ERROR_DB },
        grid,
        windows: [Window::default(); 2],
        memory_bytes: context.memory_bytes,
        numerics: Numerics::default(),
        monitor: context.monitor,
    }
}

/// Targets on a road across the track.
const ON_ROAD: [Mover; 3] = [
    Mover {
        place: [0.0, -40.0],
        velocity_m_s: 1.0,
        cross_section_m2: 20.0,
    },
    Mover {
        place: [0.0, -5.0],
        velocity_m_s: -1.2,
        cross_section_m2: 20.0,
    },
    Mover {
        place: [0.0, 30.0],
        velocity_m_s: 0.6,
        cross_section_m2: 20.0,
    },
];

/// Clutter to noise ratio of a pixel outside of the road: the windows cancel, as a window widens the cell by its loss of SNR.
fn clutter_to_noise() -> f64 {
    let [along_m, across_m] = cell_m();
    SIGMA0 * along_m * across_m * (PULSES * FREQUENCIES) as f64 / NOISE
}

fn detected(context: &Context) -> Result<Finding, ItemError> {
    let sections = [
        NOISE_TEXT.to_owned(),
        clutter([-60.0, -4.0], [-60.0, 60.0], -5.0),
        clutter([-4.0, 4.0], [-60.0, 60.0], -20.0),
        clutter([4.0, 60.0], [-60.0, 60.0], -5.0),
        ON_ROAD.iter().map(Mover::text).collect(),
    ];
    let channels = record(context, &sections.concat())?;
    let grid: ImageGrid = GRID.parse().expect("the grid is well-formed");
    let imaging = imaging(context, &grid);
    let found = find(&channels, &imaging, &detection::Settings::default(), None)?;
    let image = &found.images.images[0];
    let mut refocused = image.clone();
    let chips = found.refocus(&channels, &imaging, 32)?;
    chips.iter().for_each(|chip| chip.put_into(&mut refocused));

    let predicted_db = db(1.0 + clutter_to_noise());
    let ratio_db = found.images.cancellation(1).ratio_db;
    let pairs: Vec<(Mover, &Target)> = ON_ROAD
        .iter()
        .filter_map(|&mover| Some((mover, nearest(&found, &mover)?)))
        .collect();
    let largest = |error: &dyn Fn(&Mover, &Target) -> f64| {
        let errors = pairs
            .iter()
            .map(|(mover, target)| error(mover, target).abs());
        // A missed target has no error.
        match pairs.len() == ON_ROAD.len() {
            true => errors.fold(0.0, f64::max),
            false => f64::NAN,
        }
    };
    let place_error = |axis: usize| {
        largest(&|mover, target| {
            let truth_m = mover.motion().at(target.time_s);
            target
                .position_m
                .map_or(f64::NAN, |m| m[axis] - truth_m[axis])
        })
    };
    let displaced_m = |mover: &Mover| mover.range_m() * mover.radial_m_s() / SPEED_M_S;
    let displacement_error =
        largest(&|mover, target| target.image_position_m[0] - mover.place[0] - displaced_m(mover));
    let velocity_error = largest(&|mover, target| target.radial_velocity_m_s - mover.radial_m_s());
    // The clutter in the pixel of a target adds to it or subtracts: 0.8 dB of one target, with a standard deviation of 0.44 dB of the mean.
    let peak = |chip: &Chip| {
        let powers = chip.image.pixels.iter().map(|z| f64::from(z.norm_sqr()));
        powers.fold(0.0, f64::max) / ON_ROAD[0].cross_section_m2
    };
    let level_db = db(mean(chips.iter().map(peak)));
    let [along_m, across_m] = cell_m();
    let false_targets = found.targets.len() - pairs.len();
    let farthest_m = ON_ROAD
        .iter()
        .map(displaced_m)
        .fold(0.0, |far: f64, m| far.max(m.abs()));
    Ok(Finding {
        thesis: "The images of receivers along the track are identical for stationary targets, and their difference contains moving \
                 targets only. The processing suits imaging and GMTI of the same data. GMTI is future work."
            .to_owned(),
        method: format!(
            "A road across the track with {} targets of 20 m^2 at 0.6 to 1.2 m/s, in clutter of -5 dB. Three receivers on 1 m; 150 MHz at 5.1 km. \
             An adaptive matched filter of the differences of the registered images detects the targets. Their radial velocities correct their \
             positions, and each is refocused under its own motion. Scale: the thesis has no scene for GMTI; carrier, speed and pulses are those \
             of Table 4.1.",
            ON_ROAD.len()
        ),
        checks: vec![
            Check::claim(
                "clutter cancelled between two receivers; predicted by clutter and noise",
                "moving targets only",
                format!("{ratio_db:.1} dB, predicted {predicted_db:.1} dB"),
                (ratio_db - predicted_db).abs() <= 1.0,
            ),
            Check::claim(
                "targets detected, of those in the scene; false targets",
                NOT_DONE,
                format!("{} of {}, {false_targets} false", pairs.len(), ON_ROAD.len()),
                pairs.len() == ON_ROAD.len() && false_targets == 0,
            ),
            Check::claim(
                "largest displacement in the image, R v_r / V being predicted, and largest error of it",
                NOT_GIVEN,
                format!("{farthest_m:.1} m, error {displacement_error:.2} m"),
                displacement_error <= along_m,
            ),
            Check::claim(
                "largest error of a corrected position along the track and across it, a resolution cell at most",
                NOT_DONE,
                format!("{:.2} m and {:.2} m", place_error(0), place_error(1)),
                place_error(0) <= along_m && place_error(1) <= across_m,
            ),
            Check::claim(
                "largest error of a radial velocity, 0.05 m/s at most",
                NOT_DONE,
                format!("{velocity_error:.3} m/s"),
                velocity_error <= 0.05,
            ),
            Check::claim(
                "mean power of the refocused targets relative to their cross-sections",
                NOT_DONE,
                format!("{level_db:.2} dB"),
                level_db.abs() <= 1.5,
            ),
        ],
        why: None,
        pictures: vec![Picture {
            name: "images".to_owned(),
            caption: "Image of one receiver with the displaced targets, and with the targets refocused at their positions on the road. Their \
                      displaced responses remain in the image."
                .to_owned(),
            png: panels(
                &[
                    panel("image, targets displaced", image, &grid, &found, |target| {
                        Some(target.image_position_m)
                    }),
                    panel("targets refocused", &refocused, &grid, &found, |target| {
                        target.position_m
                    }),
                ],
                2,
            )?,
        }],
    })
}

/// Detected target within 3 m of a target of the scene, the nearest one.
fn nearest<'a>(found: &'a MovingTargets, mover: &Mover) -> Option<&'a Target> {
    let apart_m = |target: &Target| {
        let position_m = DVec3::from(target.position_m?);
        Some(position_m.distance(mover.motion().at(target.time_s)))
    };
    let near = found
        .targets
        .iter()
        .filter_map(|target| Some((target, apart_m(target)?)));
    let nearest = near.min_by(|a, b| a.1.total_cmp(&b.1))?;
    (nearest.1 <= 3.0).then_some(nearest.0)
}

/// Image with the numbers of the targets at these positions.
fn panel<'a>(
    title: &str,
    image: &'a Image,
    grid: &'a ImageGrid,
    found: &MovingTargets,
    position_m: impl Fn(&Target) -> Option<[f64; 3]>,
) -> Panel<'a> {
    let marks = found
        .targets
        .iter()
        .zip(1..)
        .filter_map(|(target, number)| {
            Some(Mark {
                at: grid.coordinates(position_m(target)?.into()),
                label: format!("{number}"),
            })
        });
    Panel {
        scale: Scale::Fixed {
            top_db: 14.0,
            span_db: 40.0,
        },
        looks: [2, 2],
        marks: marks.collect(),
        ..Panel::new(image, grid, title)
    }
}
