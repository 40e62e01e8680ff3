//! Long sub-CPIs on the large scene: Schone 2020, Fig. 4.11.
//!
//! GOTCHA and the simulated scene are compensated to the scene centre pulse by pulse: near
//! the centre no quadratic phase remains. Grating lobes there come from linear interpolation in
//! Doppler, whose lobe of order `k` has the level `1 / (6 P^2 k^2)` at a padding of `P` ([`subaperture_focus::rdbp::thesis`]).

use glam::{DVec2, DVec3};

use super::forming::{backprojection, form_large, pixel_at, side_by_side_at, thesis_with};
use super::large_scene::{Scene, begun, scale_of, scenes, sub_cpi};
use crate::{Check, Context, Finding, Item, ItemError, Picture};
use subaperture_focus::ImageFormer;
use subaperture_focus::rdbp::Thesis;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::{Comparison, Image, power};
use subaperture_planner::grating::lobes;
use subaperture_plot::{Chart, Curve, Stroke, lines};
use subaperture_signal::window::Window;

pub(super) const ITEMS: [Item; 1] = [Item {
    id: "s-4-11",
    source: "Schone 2020, Fig. 4.11",
    title: "Long sub-CPIs on a large scene, and finer Doppler",
    work: 31.0,
    reproduce,
}];

/// Pulses per sub-CPI in the thesis, and Doppler padding.
const CASES: [(usize, usize); 3] = [(249, 4), (499, 4), (499, 16)];
/// Search half-width about a lobe, metres.
const NEAR_M: f64 = 2.0;
/// Tolerance of a lobe's position, metres: half its width.
const PLACE_M: f64 = 1.0;
/// Sample spacing of a cut, metres.
const STEP_M: f64 = 0.1;

/// Difference of one of the three images from backprojection.
struct Case {
    name: String,
    image: Image,
    /// Position of the first lobe by geometry, metres in cross-range.
    predicted_m: f64,
    /// Measured position, metres.
    found_m: f64,
    /// Level relative to the scatterer, dB.
    level_db: f64,
    /// Cut with the lobe: cross-range and level.
    cut: Vec<(f64, f64)>,
}

fn reproduce(context: &Context) -> Result<Finding, ItemError> {
    let scenes = scenes(context)?;
    let mut finding = begun(
        context,
        "Sub-CPIs of 249 and 499 pulses cause grating lobes about the brightest corner, closer for 499. With Doppler \
         padded 16 times instead of 4 they stay where they are and are weaker.",
        "Sub-CPIs that span as much of sqrt(lambda R) as the thesis's; phases compensated to the scene's centre, as in GOTCHA, \
         so that lobes are those of linear interpolation in Doppler. Hamming windows. The measurement is the difference from \
         backprojection, phase included, in cross-range through the brightest pixel at its range.",
        &scenes,
    );
    for (index, scene) in scenes.iter().enumerate() {
        examine(context, [4 * index, 4 * scenes.len()], scene, &mut finding)?;
    }
    Ok(finding)
}

fn examine(
    context: &Context,
    [first, count]: [usize; 2],
    scene: &Scene,
    finding: &mut Finding,
) -> Result<(), ItemError> {
    let (history, grid) = (scene.history.as_ref(), &scene.close);
    let by = |place, former: &dyn ImageFormer| {
        form_large(
            context,
            [place, count],
            history,
            grid,
            former,
            Window::Hamming,
        )
    };
    let traditional = by(first, &backprojection())?;
    let peak = traditional
        .peak()
        .ok_or_else(|| ItemError::Measure(format!("{}: the image is empty", scene.title)))?;
    let scatterer = grid.position_m(peak.row, peak.column);
    let mut cases = Vec::new();
    for ((pulses, padding), place) in CASES.into_iter().zip(first + 1..) {
        let length = sub_cpi(scene, pulses)?;
        let options = Thesis {
            doppler_padding: padding,
            ..Thesis::default()
        };
        let image = by(place, &thesis_with(length, options))?;
        let lobe = lobes(history.collection(), length, scatterer, f64::INFINITY, 1);
        let predicted_m = lobe.first().map_or(f64::NAN, |lobe| lobe.cross_range_m);
        let antenna_m =
            history.collection().pulses[history.collection().pulses.len() / 2].transmitter_m;
        let cut = cut(&image, &traditional, grid, scatterer, antenna_m);
        let (found_m, level_db) = strongest(&cut, predicted_m);
        cases.push(Case {
            name: format!("{length} pulses (for {pulses}), Doppler {padding}x"),
            image,
            predicted_m,
            found_m,
            level_db,
            cut,
        });
    }
    let floor_db = median_db(&cases[1].cut);
    if floor_db < lobe_db(CASES[1].1) - 10.0 {
        judge_lobes(scene, &cases, finding);
    } else {
        finding.method.push_str(&format!(
            " In {} a lobe of {:.0} dB, 1 / (6 P^2) at a padding of P = {}, is below other differences, {floor_db:.0} dB in \
             the median: whole images are compared instead.",
            scene.title,
            lobe_db(CASES[1].1),
            CASES[1].1
        ));
        judge_images(scene, &traditional, &cases, finding)?;
    }
    show(scene, &traditional, &cases, finding)
}

/// Level of the first lobe of linear interpolation at a Doppler padding.
fn lobe_db(padding: usize) -> f64 {
    -20.0 * (6.0 * (padding * padding) as f64).log10()
}

fn median_db(cut: &[(f64, f64)]) -> f64 {
    let mut levels: Vec<f64> = cut.iter().map(|&(_, level_db)| level_db).collect();
    levels.sort_by(f64::total_cmp);
    levels.get(levels.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Checks of whole images against the thesis.
fn judge_images(
    scene: &Scene,
    traditional: &Image,
    cases: &[Case],
    finding: &mut Finding,
) -> Result<(), ItemError> {
    let mut errors_db = Vec::new();
    for case in cases {
        let comparison = Comparison::between(&case.image, traditional)
            .map_err(|error| ItemError::Measure(error.to_string()))?;
        errors_db.push(comparison.scaled_error_db.unwrap_or(f64::NAN));
    }
    let title = scene.title;
    finding.checks.extend([
        Check::claim(
            &format!("{title}: RMS difference from backprojection, longer sub-CPI against shorter"),
            "worse",
            format!("{:.1} dB against {:.1} dB", errors_db[1], errors_db[0]),
            errors_db[1] > errors_db[0],
        ),
        Check::claim(
            &format!("{title}: the same with Doppler padded 16 times against 4"),
            "weaker artefacts",
            format!("{:.1} dB against {:.1} dB", errors_db[2], errors_db[1]),
            errors_db[2] < errors_db[1],
        ),
    ]);
    Ok(())
}

fn judge_lobes(scene: &Scene, cases: &[Case], finding: &mut Finding) {
    let title = scene.title;
    for case in &cases[..2] {
        finding.checks.push(Check::number(
            &format!(
                "{title}, {}: place of the first lobe, by geometry and found",
                case.name
            ),
            case.predicted_m,
            case.found_m,
            PLACE_M,
            1,
            "m",
        ));
    }
    let [short, long, fine] = [&cases[0], &cases[1], &cases[2]];
    finding.checks.extend([
        Check::claim(
            &format!("{title}: first lobe of the longer sub-CPI"),
            "closer",
            format!("at {:.1} m against {:.1} m", long.found_m, short.found_m),
            long.found_m < short.found_m,
        ),
        Check::claim(
            &format!("{title}: first lobe with Doppler padded 16 times against 4"),
            "weaker",
            format!("{:.1} dB against {:.1} dB", fine.level_db, long.level_db),
            fine.level_db < long.level_db - 3.0,
        ),
    ]);
}

fn show(
    scene: &Scene,
    traditional: &Image,
    cases: &[Case],
    finding: &mut Finding,
) -> Result<(), ItemError> {
    let (name, title, grid) = (scene.name, scene.title, &scene.close);
    let mut panels = vec![("backprojection", traditional, grid)];
    panels.extend(
        cases
            .iter()
            .map(|case| (case.name.as_str(), &case.image, grid)),
    );
    finding.pictures.push(side_by_side_at(
        &format!("{name}-images"),
        &format!("The {title}: backprojection, and three methods with long sub-CPIs"),
        scale_of(traditional, 70.0),
        &panels,
    )?);
    let curves = cases.iter().map(|case| Curve {
        name: case.name.clone(),
        points: case.cut.clone(),
        stroke: Stroke::Solid,
    });
    let places = cases[..2].iter().map(|case| case.predicted_m);
    let chart = Chart {
        title: format!("difference from backprojection, {title}"),
        across_label: "cross-range from the brightest pixel (m)".to_owned(),
        up_label: "level below the brightest pixel (dB)".to_owned(),
        curves: curves.collect(),
        marks: places.flat_map(|place| [-place, place]).collect(),
        up: Some((-90.0, 0.0)),
        ..Chart::default()
    };
    finding.pictures.push(Picture {
        name: format!("{name}-cuts"),
        caption: format!(
            "Difference from backprojection, {title}; dotted: first lobes by geometry"
        ),
        png: lines(&chart)?,
    });
    Ok(())
}

/// Level of `image - traditional` relative to the brightest pixel, in cross-range at constant range.
fn cut(
    image: &Image,
    traditional: &Image,
    grid: &ImageGrid,
    scatterer: DVec3,
    antenna_m: DVec3,
) -> Vec<(f64, f64)> {
    let brightest = traditional
        .peak()
        .map_or(f64::NAN, |peak| power(peak.value));
    let sight = (scatterer - antenna_m).truncate();
    let reach_m = grid.columns.step * grid.columns.count as f64;
    let steps = (reach_m / STEP_M) as i32;
    (-steps..=steps)
        .filter_map(|step| {
            let across_m = f64::from(step) * STEP_M;
            // Rotation about the antenna keeps the range.
            let turned = DVec2::from_angle(across_m / sight.length()).rotate(sight);
            let pixel = pixel_at(grid, antenna_m.truncate() + turned)?;
            let level = power(image.pixels[pixel] - traditional.pixels[pixel]) / brightest;
            Some((across_m, 10.0 * level.log10()))
        })
        .collect()
}

/// Position and level of the maximum of a cut near `place_m` on either side.
fn strongest(cut: &[(f64, f64)], place_m: f64) -> (f64, f64) {
    cut.iter()
        .map(|&(across_m, level_db)| (across_m.abs(), level_db))
        .filter(|(across_m, _)| (across_m - place_m).abs() <= NEAR_M)
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .unwrap_or((f64::NAN, f64::NAN))
}
