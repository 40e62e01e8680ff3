//! Impulse response of range-Doppler backprojection: Schone 2020, Table 4.1, Figs 4.1 to 4.6.

use std::ops::Range;

use glam::DVec3;
use num_complex::Complex32;

use super::forming::{
    POINT_SCALE, backprojection, experiment, form, grid_about, lone_scatterer, record,
    side_by_side, side_by_side_at, thesis,
};
use super::large_scene::scale_of;
use super::measure::{level_db, peak_db, points_db, strongest_near, widths_m};
use super::point_cuts::{CUT_M, CUT_STEP_M, cuts};
use crate::{Check, Context, Finding, Item, ItemError, Picture};
use subaperture_model::image::{Comparison, Image};
use subaperture_model::phase_history::{InMemory, PhaseHistory};
use subaperture_model::resolution::survey::Survey;
use subaperture_planner::grating::{Lobe, lobes};
use subaperture_plot::{Chart, Curve, Stroke, lines};
use subaperture_simulate::{Preset, Variation};

pub(super) const ITEMS: [Item; 7] = [
    Item {
        id: "s-table-4-1",
        source: "Schone 2020, Table 4.1",
        title: "The radar of all simulated images",
        work: 0.23,
        reproduce: table,
    },
    Item {
        id: "s-4-1",
        source: "Schone 2020, Fig. 4.1",
        title: "A distributed scene by both backprojections",
        work: 30.0,
        reproduce: scene,
    },
    Item {
        id: "s-4-2",
        source: "Schone 2020, Fig. 4.2",
        title: "A point by both backprojections",
        work: 2.2,
        reproduce: point,
    },
    Item {
        id: "s-4-3",
        source: "Schone 2020, Fig. 4.3",
        title: "Long sub-CPIs make grating lobes",
        work: 2.5,
        reproduce: long_sub_cpis,
    },
    Item {
        id: "s-4-4",
        source: "Schone 2020, Fig. 4.4",
        title: "Cuts of the imaging function",
        work: 7.0,
        reproduce: cuts,
    },
    Item {
        id: "s-4-5",
        source: "Schone 2020, Fig. 4.5",
        title: "Grating lobes are those of an array",
        work: 0.92,
        reproduce: array,
    },
    Item {
        id: "s-4-6",
        source: "Schone 2020, Fig. 4.6",
        title: "The imaging function of one sub-CPI",
        work: 8.8,
        reproduce: single_sub_cpi,
    },
];

fn table(_: &Context) -> Result<Finding, ItemError> {
    let simulated = lone_scatterer(DVec3::ZERO);
    let survey = Survey::of(simulated.collection())
        .ok_or_else(|| ItemError::Measure("there are no pulses".to_owned()))?;
    let range_m = survey.range_resolution_m.unwrap_or(f64::NAN);
    let cross_m = survey.cross_range_resolution_m.unwrap_or(f64::NAN);
    Ok(Finding {
        thesis: "200 MHz, PRI 1 ms, 1040 pulses, 5 km, 125 m/s.".to_owned(),
        method:
            "The table simulated at 10 GHz; resolutions from the support of its samples in spatial \
                 frequency. Scale: as in the thesis."
                .to_owned(),
        checks: vec![
            // c / 2B, and lambda R / 2 L of 1040 pulses 0.125 m apart. Over the aperture's +-0.74 degrees the
            // lowest spatial frequency in range falls by a cosine, as if of 0.8 MHz more bandwidth: 0.4 %.
            Check::number("range resolution, c / 2B", 0.749, range_m, 0.005, 3, "m"),
            Check::number(
                "cross-range resolution, lambda R / 2L",
                0.577,
                cross_m,
                0.01,
                3,
                "m",
            ),
        ],
        why: None,
        pictures: vec![],
    })
}

fn scene(context: &Context) -> Result<Finding, ItemError> {
    let points = Preset::Table41.simulate(&Variation::default());
    let farm = record(
        context,
        &experiment("farm", include_str!("scenes/farm.toml"))?,
    )?;
    let scenes: [(&str, &dyn PhaseHistory); 2] = [("41 scatterers", &points), ("farm", &farm)];
    let grid = grid_about(DVec3::ZERO, 45.0, 45.0, 0.3);
    let mut checks = Vec::new();
    let mut pictures = Vec::new();
    for (index, (name, history)) in scenes.into_iter().enumerate() {
        let place = |image| [2 * index + image, 4];
        let traditional = form(context, place(0), history, &grid, &backprojection())?;
        let two_dimensional = form(context, place(1), history, &grid, &thesis(40))?;
        let comparison = Comparison::between(&two_dimensional, &traditional)
            .map_err(|error| ItemError::Measure(error.to_string()))?;
        let correlation = comparison.correlation.unwrap_or(f64::NAN);
        let error_db = comparison.scaled_error_db.unwrap_or(f64::NAN);
        checks.extend([
            Check::claim(
                &format!("correlation of the two complex images, {name}"),
                "almost identical",
                format!("{correlation:.4}"),
                correlation > 0.99,
            ),
            Check::claim(
                &format!("relative RMS difference, phase included, {name}"),
                "almost identical",
                format!("{error_db:.1} dB"),
                error_db < -15.0,
            ),
        ]);
        let scale = match index {
            0 => POINT_SCALE,
            _ => scale_of(&traditional, 50.0),
        };
        pictures.push(side_by_side_at(
            ["images", "farm"][index],
            &format!("Backprojection, and 26 sub-CPIs of 40 pulses: {name}"),
            scale,
            &[
                ("backprojection", &traditional, &grid),
                ("26 sub-CPIs of 40", &two_dimensional, &grid),
            ],
        )?);
    }
    Ok(Finding {
        thesis: "1040 pulses, 26 sub-CPIs of 40: the two images are almost identical.".to_owned(),
        method: "41 unit scatterers over 80 x 80 m, and a farm with a hill, fields, a wood, a house, a car and trees; backprojection, and range-Doppler backprojection with the \
                 thesis's settings (sinc Keystone, Doppler padded 16 times, range 10 times, bilinear interpolation). \
                 Scale: pulses and sub-CPIs are the thesis's; it gives no scatterer list of its distributed scene."
            .to_owned(),
        checks,
        why: None,
        pictures,
    })
}

fn point(context: &Context) -> Result<Finding, ItemError> {
    let simulated = lone_scatterer(DVec3::ZERO);
    let grid = grid_about(DVec3::ZERO, 6.0, 6.0, 0.1);
    let traditional = form(context, [0, 2], &simulated, &grid, &backprojection())?;
    let two_dimensional = form(context, [1, 2], &simulated, &grid, &thesis(40))?;
    let peaks = [&traditional, &two_dimensional].map(peak_db);
    let widths = [&traditional, &two_dimensional].map(|image| widths_m(image, &grid));
    Ok(Finding {
        thesis: "The imaging functions of both are almost identical.".to_owned(),
        method: "One scatterer at the centre, pixels of 0.1 m. Scale: as in the thesis.".to_owned(),
        checks: vec![
            Check::claim(
                "peak of the second against the first",
                "the same",
                format!("{:.2} dB", peaks[1] - peaks[0]),
                (peaks[1] - peaks[0]).abs() < 0.1,
            ),
            same("3 dB width in cross-range", widths[0].0, widths[1].0),
            same("3 dB width in range", widths[0].1, widths[1].1),
        ],
        why: None,
        pictures: vec![side_by_side(
            "images",
            "A point by backprojection, and by 26 sub-CPIs of 40 pulses",
            &[
                ("backprojection", &traditional, &grid),
                ("26 sub-CPIs of 40", &two_dimensional, &grid),
            ],
        )?],
    })
}

fn long_sub_cpis(context: &Context) -> Result<Finding, ItemError> {
    let simulated = lone_scatterer(DVec3::ZERO);
    let grid = grid_about(DVec3::ZERO, 20.0, 10.0, 0.1);
    let ten = form(context, [0, 2], &simulated, &grid, &thesis(104))?;
    let eight = form(context, [1, 2], &simulated, &grid, &thesis(130))?;
    let lobe = |length: usize| {
        lobes(simulated.collection(), length, DVec3::ZERO, CUT_M, 1)
            .first()
            .copied()
            .ok_or_else(|| ItemError::Measure("no grating lobe within the cut".to_owned()))
    };
    let (first_of_ten, first_of_eight) = (lobe(104)?, lobe(130)?);
    let measured = |image: &Image, lobe: Lobe| level_db(image, &grid, lobe.cross_range_m);
    let (level_ten, level_eight) = (
        measured(&ten, first_of_ten),
        measured(&eight, first_of_eight),
    );
    Ok(Finding {
        thesis: "10 sub-CPIs of 104 pulses and 8 of 130 show high side lobes in cross-range, closer and \
                 stronger the longer the sub-CPI."
            .to_owned(),
        method: "One scatterer at the centre; the first grating lobe on either side, at lambda R / (2 D) for \
                 sub-CPI centres D apart. Scale: as in the thesis."
            .to_owned(),
        checks: vec![
            Check::claim(
                "first lobe of 8 sub-CPIs against that of 10",
                "closer",
                format!(
                    "at {:.2} m against {:.2} m",
                    first_of_eight.cross_range_m, first_of_ten.cross_range_m
                ),
                first_of_eight.cross_range_m < first_of_ten.cross_range_m,
            ),
            Check::claim(
                "level of the first lobe: 8 against 10",
                "stronger",
                format!("{level_eight:.1} dB against {level_ten:.1} dB"),
                level_eight > level_ten,
            ),
            Check::claim(
                "level of the first lobe of 10",
                "very high",
                format!("{level_ten:.1} dB"),
                level_ten > -20.0,
            ),
        ],
        why: None,
        pictures: vec![side_by_side(
            "images",
            "10 sub-CPIs of 104 pulses, and 8 of 130",
            &[
                ("10 sub-CPIs of 104", &ten, &grid),
                ("8 sub-CPIs of 130", &eight, &grid),
            ],
        )?],
    })
}

fn array(context: &Context) -> Result<Finding, ItemError> {
    const LENGTH: usize = 52;
    let simulated = lone_scatterer(DVec3::ZERO);
    let grid = grid_about(DVec3::ZERO, CUT_M, 0.0, CUT_STEP_M);
    let image = form(context, [0, 1], &simulated, &grid, &thesis(LENGTH))?;
    let predicted = lobes(simulated.collection(), LENGTH, DVec3::ZERO, CUT_M - 1.0, 4);
    let checks = predicted
        .iter()
        .flat_map(|lobe| {
            let (place_m, level_db) = strongest_near(&image, &grid, lobe.cross_range_m);
            [
                Check::number(
                    &format!("place of lobe {}", lobe.order),
                    lobe.cross_range_m,
                    place_m,
                    grid.columns.step,
                    2,
                    "m",
                ),
                Check::number(
                    &format!(
                        "level of lobe {}: predicted from geometry, measured",
                        lobe.order
                    ),
                    lobe.level_db,
                    level_db,
                    1.0,
                    1,
                    "dB",
                ),
            ]
        })
        .collect();
    let png = lines(&Chart {
        title: "20 sub-CPIs of 52 pulses".to_owned(),
        across_label: "cross-range (m)".to_owned(),
        up_label: "level (dB)".to_owned(),
        curves: vec![
            Curve {
                name: "measured".to_owned(),
                points: points_db(&image, &grid.columns),
                stroke: Stroke::Solid,
            },
            Curve {
                name: "predicted lobes".to_owned(),
                points: predicted
                    .iter()
                    .flat_map(|l| [-1.0, 1.0].map(|side| (side * l.cross_range_m, l.level_db)))
                    .collect(),
                stroke: Stroke::Dots,
            },
        ],
        marks: predicted
            .iter()
            .flat_map(|l| [-l.cross_range_m, l.cross_range_m])
            .collect(),
        up: Some((-70.0, 0.0)),
        ..Chart::default()
    })?;
    Ok(Finding {
        thesis: "An array of 20 elements, spaced by twice the distance of sub-CPI centres, has its grating \
                 lobes where the image has them."
            .to_owned(),
        method: "Grating lobe positions of that array, k lambda R / (2 D), and levels from the deviation of each \
                 sub-CPI's path from a straight line; both from geometry alone. Scale: as in the thesis."
            .to_owned(),
        checks,
        why: None,
        pictures: vec![Picture {
            name: "cut".to_owned(),
            caption: "Cross-range cut and the predicted lobes".to_owned(),
            png,
        }],
    })
}

fn single_sub_cpi(context: &Context) -> Result<Finding, ItemError> {
    let simulated = lone_scatterer(DVec3::ZERO);
    let grid = grid_about(DVec3::ZERO, 20.0, 10.0, 0.1);
    let mut images = Vec::new();
    for (length, index) in [104, 130].into_iter().zip(0..) {
        let middle = 520 - length / 2;
        let part = middle_pulses(&simulated, middle..middle + length)?;
        images.push(form(context, [index, 3], &part, &grid, &thesis(length))?);
    }
    let whole = form(context, [2, 3], &simulated, &grid, &backprojection())?;
    let [full, of_104, of_130] =
        [&whole, &images[0], &images[1]].map(|image| widths_m(image, &grid).0);
    let peaks = [peak_db(&images[0]), peak_db(&images[1])];
    Ok(Finding {
        thesis:
            "A single sub-CPI resolves far less in cross-range than the whole CPI; the one of 130 \
                 pulses is smeared, although it should resolve a little better."
                .to_owned(),
        method: "The middle sub-CPI alone, with the thesis's settings. Scale: as in the thesis."
            .to_owned(),
        checks: vec![
            Check::claim(
                "3 dB width in cross-range: 104 pulses against all 1040",
                "much wider",
                format!("{of_104:.1} m against {full:.2} m"),
                of_104 > 5.0 * full,
            ),
            Check::claim(
                "3 dB width in cross-range: 130 pulses against 104, which theory makes 0.80",
                "smeared, not better",
                format!("{:.2}", of_130 / of_104),
                of_130 / of_104 > 0.84,
            ),
            Check::claim(
                "peak: 130 pulses against 104",
                "smeared",
                format!("{:.2} dB against {:.2} dB", peaks[1], peaks[0]),
                peaks[1] < peaks[0],
            ),
        ],
        why: None,
        pictures: vec![side_by_side(
            "images",
            "One sub-CPI of 104 pulses, and one of 130",
            &[
                ("one sub-CPI of 104", &images[0], &grid),
                ("one sub-CPI of 130", &images[1], &grid),
            ],
        )?],
    })
}

/// Block of pulses as a recording.
fn middle_pulses(history: &dyn PhaseHistory, pulses: Range<usize>) -> Result<InMemory, ItemError> {
    let mut collection = history.collection().clone();
    let mut samples = vec![Complex32::ZERO; pulses.len() * collection.num_samples];
    history.read(pulses.clone(), &mut samples)?;
    collection.pulses = collection.pulses[pulses].to_vec();
    Ok(InMemory::new(collection, samples)?)
}

fn same(quantity: &str, first: f64, second: f64) -> Check {
    Check::claim(
        &format!("{quantity}: second against first"),
        "the same",
        format!("{second:.3} m against {first:.3} m"),
        (second / first - 1.0).abs() < 0.02,
    )
}
