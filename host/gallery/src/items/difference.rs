//! Difference of two backprojection methods: Schone 2020, Figs 4.7, 4.8 and 4.10.

use super::forming::{backprojection, form_large, side_by_side_at, thesis};
use super::large_scene::{Scene, begun, scale_of, scenes, sub_cpi};
use crate::{Check, Context, Finding, Item, ItemError, Picture};
use subaperture_model::image::{Image, power};
use subaperture_plot::{Colours, HeatMap, heat};
use subaperture_quality::difference::{PercentDifference, percent_difference};
use subaperture_signal::window::Window;

pub(super) const ITEMS: [Item; 1] = [Item {
    id: "s-4-10",
    source: "Schone 2020, Figs 4.7, 4.8 and 4.10",
    title: "The percent difference of both backprojections",
    work: 35.0,
    reproduce,
}];

/// Pulses per sub-CPI of Fig. 4.8.
const THESIS_SUB_CPI: usize = 31;
/// Colour axis of the thesis, percent.
const AXIS: (f64, f64) = (0.0, 200.0);
/// Floor below which pixels are excluded, dB; includes all.
const NO_FLOOR_DB: f64 = 400.0;

fn reproduce(context: &Context) -> Result<Finding, ItemError> {
    let scenes = scenes(context)?;
    let mut finding = begun(
        context,
        "A majority of the image lies within 0 to 200 %; bright spots of the difference lie where the image is \
         very dark. The brightest corner differs by less than a tenth of a dB.",
        "Hamming windows over frequencies and pulses, as the thesis windows; difference of magnitudes over \
         backprojection's, no pixel left out.",
        &scenes,
    );
    for (index, scene) in scenes.iter().enumerate() {
        examine(context, [2 * index, 2 * scenes.len()], scene, &mut finding)?;
    }
    Ok(finding)
}

fn examine(
    context: &Context,
    [first, count]: [usize; 2],
    scene: &Scene,
    finding: &mut Finding,
) -> Result<(), ItemError> {
    let (history, grid) = (scene.history.as_ref(), &scene.grid);
    let length = sub_cpi(scene, THESIS_SUB_CPI)?;
    let by = |index, former: &dyn subaperture_focus::ImageFormer| {
        form_large(
            context,
            [first + index, count],
            history,
            grid,
            former,
            Window::Hamming,
        )
    };
    let traditional = by(0, &backprojection())?;
    let two_dimensional = by(1, &thesis(length))?;
    let difference = percent_difference(&two_dimensional, &traditional, NO_FLOOR_DB)?;
    let title = scene.title;
    finding.method.push_str(&format!(
        " The {title}: {length} pulses a sub-CPI, as much of sqrt(lambda R) as the thesis's {THESIS_SUB_CPI}."
    ));

    finding
        .checks
        .extend(checks(title, &two_dimensional, &traditional, &difference)?);
    finding.pictures.push(side_by_side_at(
        &format!("{}-images", scene.name),
        &format!("The {title} by backprojection, and by sub-CPIs of {length} pulses"),
        scale_of(&traditional, 70.0),
        &[
            ("backprojection", &traditional, grid),
            (
                &format!("sub-CPIs of {length} pulses"),
                &two_dimensional,
                grid,
            ),
        ],
    )?);
    finding.pictures.extend(maps(scene, &difference)?);
    Ok(())
}

/// Checks of the difference against the thesis.
fn checks(
    title: &str,
    two_dimensional: &Image,
    traditional: &Image,
    difference: &PercentDifference,
) -> Result<Vec<Check>, ItemError> {
    let values = &difference.map.values;
    let within = values.iter().filter(|&&v| f64::from(v) <= AXIS.1).count();
    let share = 100.0 * within as f64 / values.len() as f64;
    let dark_db = darkness_of_largest_db(traditional, values);
    let peak = traditional
        .peak()
        .ok_or_else(|| ItemError::Measure(format!("{title}: the image is empty")))?;
    let other = two_dimensional.pixels[peak.row * traditional.columns + peak.column];
    let gain_db = 10.0 * (power(other) / power(peak.value)).log10();
    Ok(vec![
        Check::claim(
            &format!("{title}: pixels within 0 to 200 %"),
            "a majority",
            format!("{share:.3} %"),
            share > 50.0,
        ),
        Check::claim(
            &format!("{title}: median difference"),
            "in general very small",
            format!("{:.2} %", difference.summary.median.unwrap_or(f64::NAN)),
            difference
                .summary
                .median
                .is_some_and(|median| median < 10.0),
        ),
        Check::claim(
            &format!(
                "{title}: where the largest thousandth of differences lie, against the image's median"
            ),
            "very dark",
            format!("{dark_db:.1} dB"),
            dark_db < -10.0,
        ),
        Check::claim(
            &format!("{title}: brightest pixel"),
            "less than 0.1 dB apart",
            format!("{:.3} dB", gain_db.abs()),
            gain_db.abs() < 0.1,
        ),
    ])
}

/// Difference maps, on the thesis's axis and on a finer one.
fn maps(scene: &Scene, difference: &PercentDifference) -> Result<Vec<Picture>, ItemError> {
    let (grid, values) = (&scene.grid, &difference.map.values);
    // The thesis's axis, and one that resolves these small differences.
    let typical = difference.summary.percentile_95.unwrap_or(AXIS.1);
    let axes = [
        ("difference", AXIS.1),
        ("difference-closer", typical.clamp(0.1, AXIS.1)),
    ];
    let map = |(name, top)| {
        let caption = format!("Percent difference, {}, 0 to {top:.1} %", scene.title);
        Ok(Picture {
            name: format!("{}-{name}", scene.name),
            png: heat(&HeatMap {
                values,
                rows: grid.rows,
                columns: grid.columns,
                title: caption.clone(),
                across_label: "x (m)".to_owned(),
                up_label: "y (m)".to_owned(),
                unit: "%".to_owned(),
                range: (AXIS.0, top),
                colours: Colours::Viridis,
                proportional: true,
            })?,
            caption,
        })
    };
    axes.into_iter().map(map).collect()
}

/// Median level of the thousandth of pixels with the largest `values`, relative to the median level
/// of all, dB.
fn darkness_of_largest_db(image: &Image, values: &[f32]) -> f64 {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[b].total_cmp(&values[a]));
    let median_db = |pixels: &[usize]| {
        let mut powers: Vec<f64> = pixels.iter().map(|&i| power(image.pixels[i])).collect();
        powers.sort_by(f64::total_cmp);
        powers
            .get(powers.len() / 2)
            .map_or(f64::NAN, |&p| 10.0 * p.log10())
    };
    median_db(&order[..order.len().div_ceil(1000)]) - median_db(&order)
}
