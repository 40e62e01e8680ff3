//! Moving targets: Schone 2020, Figs 4.12, 4.13 and 4.14.

use glam::DVec3;

use super::forming::{experiment, form, record, side_by_side, thesis, thesis_with};
use crate::{Check, Context, Finding, Item, ItemError, Picture};
use subaperture_focus::moving::{Moving, VelocityPlane, velocity_resolution_m_s};
use subaperture_focus::rdbp::Thesis;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::{Image, power};
use subaperture_model::phase_history::{Collection, InMemory, PhaseHistory};
use subaperture_plot::{Colours, HeatMap, Panel, Scale, heat, quicklook};
use subaperture_simulate::{Preset, Variation};

pub(super) const ITEMS: [Item; 3] = [
    Item {
        id: "s-4-12",
        source: "Schone 2020, Fig. 4.12",
        title: "A moving target, imaged as if it stood still",
        work: 2.4,
        reproduce: smeared,
    },
    Item {
        id: "s-4-13",
        source: "Schone 2020, Fig. 4.13",
        title: "A moving target at its own velocity, and at many",
        work: 6.0,
        reproduce: focused,
    },
    Item {
        id: "s-4-14",
        source: "Schone 2020, Fig. 4.14",
        title: "A fast target needs Keystone",
        work: 1.9,
        reproduce: fast,
    },
];

/// Velocity of the target, metres per second: 5 m/s at 45 degrees.
const VELOCITY_M_S: DVec3 = DVec3::new(3.53553, 3.53553, 0.0);
/// Velocity of the fast target, metres per second.
const FAST_M_S: DVec3 = DVec3::new(0.0, 50.0, 0.0);
/// Pulses per sub-CPI, as in Fig. 4.1.
const SUB_CPI: usize = 40;
/// Pulses per sub-CPI for the fast target, which moves 0.4 m in it.
const FAST_SUB_CPI: usize = 80;
/// x below which the image focused for a stationary scene contains the mover only, metres.
const NOTHING_STILL_M: f64 = -60.0;
/// Levels of the pictures.
const SCALE: Scale = Scale::Fixed {
    top_db: 0.0,
    span_db: 50.0,
};

/// Table 4.1 with 40 stationary scatterers, and the target, which is at the centre in the middle of
/// the collection.
fn still_scene_and_target(context: &Context) -> Result<InMemory, ItemError> {
    let mut experiment = experiment("mover", include_str!("scenes/mover.toml"))?;
    let preset = Preset::Table41.simulate(&Variation::default());
    // Without the central scatterer, where the target passes.
    experiment.scene.points = preset.scatterers()[1..].to_vec();
    record(context, &experiment)
}

/// Time to which the movers' positions refer, seconds.
fn middle_s(collection: &Collection) -> f64 {
    let time_s =
        |pulse: Option<&subaperture_model::phase_history::Pulse>| pulse.map_or(0.0, |p| p.time_s);
    time_s(collection.pulses.first()).midpoint(time_s(collection.pulses.last()))
}

fn grid(text: &str) -> ImageGrid {
    text.parse().expect("the grid is well-formed")
}

/// Position and level (dB) of the strongest pixel among the `wanted` positions.
fn strongest(
    image: &Image,
    grid: &ImageGrid,
    wanted: impl Fn(DVec3) -> bool,
) -> Result<(DVec3, f64), ItemError> {
    let places = (0..image.pixels.len()).map(|i| {
        (
            grid.position_m(i / image.columns, i % image.columns),
            power(image.pixels[i]),
        )
    });
    places
        .filter(|(place, _)| wanted(*place))
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(place, level)| (place, 10.0 * level.log10()))
        .ok_or_else(|| ItemError::Measure("no pixel is where it is looked for".to_owned()))
}

fn picture(
    name: &str,
    caption: &str,
    image: &Image,
    grid: &ImageGrid,
) -> Result<Picture, ItemError> {
    Ok(Picture {
        name: name.to_owned(),
        caption: caption.to_owned(),
        png: quicklook(&Panel {
            scale: SCALE,
            ..Panel::new(image, grid, caption)
        })?,
    })
}

fn smeared(context: &Context) -> Result<Finding, ItemError> {
    let history = still_scene_and_target(context)?;
    let grid = grid("x=-180:60.1:0.3,y=-45:45.1:0.3");
    let image = form(context, [0, 1], &history, &grid, &thesis(SUB_CPI))?;
    let (place, level_db) = strongest(&image, &grid, |at| at.x < NOTHING_STILL_M)?;

    // Pixels within 10 dB of the smear's peak.
    let smear = (0..image.pixels.len())
        .filter(|&i| 10.0 * power(image.pixels[i]).log10() > level_db - 10.0)
        .map(|i| grid.position_m(i / image.columns, i % image.columns).x)
        .filter(|&x| x < NOTHING_STILL_M);
    let (low, high) = smear.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
        (low.min(x), high.max(x))
    });
    let pulses = &history.collection().pulses;
    let duration_s = pulses[pulses.len() - 1].time_s - pulses[0].time_s;
    let radar_m_s = pulses[0]
        .transmitter_m
        .distance(pulses[pulses.len() - 1].transmitter_m)
        / duration_s;
    let range_m = pulses[pulses.len() / 2].transmitter_m.length();
    Ok(Finding {
        thesis: "A target at 5 m/s and 45 degrees is not focused and smears across the stationary background."
            .to_owned(),
        method: format!(
            "Table 4.1 with 40 still unit scatterers and a moving one, sub-CPIs of {SUB_CPI}. Motion along the line \
             of sight displaces the target by R v_r / V, motion along the track spreads it over 2 v_x T. Scaled down: 40 \
             scatterers instead of the thesis's distributed scene, for which it gives no scatterer list; pulses are the thesis's."
        ),
        checks: vec![
            Check::claim(
                "peak of the target, 0 dB being focused",
                "not focused",
                format!("{level_db:.1} dB"),
                level_db < -3.0,
            ),
            Check::number(
                "length of the smear within 10 dB, 2 v_x T being predicted",
                2.0 * VELOCITY_M_S.x * duration_s,
                high - low,
                1.5,
                1,
                "m",
            ),
            Check::number(
                "displacement along the track, R v_r / V being predicted",
                -range_m * VELOCITY_M_S.y / radar_m_s,
                place.x,
                VELOCITY_M_S.x * duration_s + 1.0,
                1,
                "m",
            ),
        ],
        why: None,
        pictures: vec![picture(
            "image",
            "All taken to stand still; the smear at the left is the target",
            &image,
            &grid,
        )?],
    })
}

fn focused(context: &Context) -> Result<Finding, ItemError> {
    let history = still_scene_and_target(context)?;
    let epoch_s = middle_s(history.collection());
    let positions = grid("x=-45:45.1:0.3,y=-45:45.1:0.3");
    let moving = Moving::new(&history, VELOCITY_M_S, epoch_s)?;
    let image = form(context, [0, 2], &moving, &positions, &thesis(SUB_CPI))?;
    let (place, level_db) = strongest(&image, &positions, |_| true)?;
    let (_, background_db) = strongest(&image, &positions, |at| at.length() > 5.0)?;

    let velocities = grid("x=-6:13.05:0.1,y=3.35:3.7205:0.002");
    let plane = VelocityPlane {
        position_m: DVec3::ZERO,
        epoch_s,
        error_db: super::forming::ERROR_DB,
    };
    let response = form(context, [1, 2], &history, &velocities, &plane)?;
    let (found, _) = strongest(&response, &velocities, |_| true)?;
    let resolution =
        |along| velocity_resolution_m_s(history.collection(), DVec3::ZERO, epoch_s, along);
    let (tangential, radial) = (resolution(DVec3::X), resolution(DVec3::Y));
    let levels: Vec<f32> = response
        .pixels
        .iter()
        .map(|&z| 10.0 * power(z).log10() as f32)
        .collect();
    Ok(Finding {
        thesis: "At the target's own velocity it is fully focused and the stationary scene is not. At its place, \
                 over velocities, it peaks at its velocity, far sharper along the line of sight than across."
            .to_owned(),
        method: format!(
            "The pulses of Fig. 4.12, sub-CPIs of {SUB_CPI}; position and velocity refer to the middle of the collection. \
             Scaled down: 40 scatterers, as in Fig. 4.12."
        ),
        checks: vec![
            Check::claim(
                "peak at the right velocity, 0 dB being focused",
                "fully focused",
                format!("{level_db:.2} dB"),
                level_db.abs() <= 0.5,
            ),
            Check::claim(
                "its distance from the target's place, half a resolution cell at most",
                "at its place",
                format!("{:.2} m", place.length()),
                place.length() <= 0.3,
            ),
            Check::claim(
                "strongest stationary scatterer",
                "unfocused",
                format!("{background_db:.1} dB"),
                background_db < -3.0,
            ),
            Check::number("v_x of the peak", VELOCITY_M_S.x, found.x, tangential / 2.0, 2, "m/s"),
            Check::number("v_y of the peak", VELOCITY_M_S.y, found.y, radial / 2.0, 3, "m/s"),
            Check::claim(
                "resolution across the line of sight against along it",
                "poor against high",
                format!("{tangential:.1} m/s against {radial:.3} m/s"),
                tangential > 10.0 * radial,
            ),
        ],
        why: None,
        pictures: vec![
            picture("image", "Imaged at the target's velocity", &image, &positions)?,
            Picture {
                name: "velocities".to_owned(),
                caption: "The target's place at many velocities; mind the two scales".to_owned(),
                png: heat(&HeatMap {
                    values: &levels,
                    rows: velocities.rows,
                    columns: velocities.columns,
                    title: "response at the target's place".to_owned(),
                    across_label: "v_x, across the line of sight (m/s)".to_owned(),
                    up_label: "v_y, along the line of sight (m/s)".to_owned(),
                    unit: "dB".to_owned(),
                    range: (-40.0, 0.0),
                    colours: Colours::Grey,
                    proportional: false,
                })?,
            },
        ],
    })
}

fn fast(context: &Context) -> Result<Finding, ItemError> {
    let history = record(
        context,
        &experiment("fast", include_str!("scenes/fast.toml"))?,
    )?;
    let moving = Moving::new(&history, FAST_M_S, middle_s(history.collection()))?;
    let grid = grid("x=-20:20.05:0.1,y=-8:8.01:0.05");
    let without_keystone = Thesis {
        keystone: false,
        ..Thesis::default()
    };
    let formers = [
        thesis_with(FAST_SUB_CPI, without_keystone),
        thesis(FAST_SUB_CPI),
    ];
    let mut images = Vec::new();
    for (index, former) in formers.iter().enumerate() {
        images.push(form(context, [index, 2], &moving, &grid, former)?);
    }
    let mut peaks = [0.0; 2];
    let mut artefacts = [0.0; 2];
    for (i, image) in images.iter().enumerate() {
        peaks[i] = strongest(image, &grid, |_| true)?.1;
        // Beyond the fifth null across, at lambda R / 2L = 1.5 m each.
        artefacts[i] = strongest(image, &grid, |at| at.x.abs() > 8.0)?.1 - peaks[i];
    }
    Ok(Finding {
        thesis: "Excluding Keystone a very fast target has a very weak response and strong artefacts; with Keystone \
                 the image is as good as that of a stationary scene."
            .to_owned(),
        method: format!(
            "50 m/s away from a radar of 1 GHz at 1 km, {FAST_SUB_CPI} pulses of 0.1 ms a sub-CPI, in which the target \
             moves 0.4 m: 2.7 range cells. Both images use its velocity. Scale: the thesis does not state its parameters."
        ),
        checks: vec![
            // Mean of sin(pi u) / (pi u) over +-1.33 cells.
            Check::number(
                "peak without Keystone; predicted is the mean of the range response over the target's motion",
                -7.9,
                peaks[0],
                1.0,
                1,
                "dB",
            ),
            Check::claim(
                "peak with Keystone, 0 dB being focused",
                "as good as a stationary scene",
                format!("{:.2} dB", peaks[1]),
                peaks[1].abs() <= 0.5,
            ),
            Check::claim(
                "strongest artefact beyond 8 m in cross-range, below its own peak: without and with",
                "very high without",
                format!("{:.1} dB and {:.1} dB", artefacts[0], artefacts[1]),
                artefacts[0] > artefacts[1] + 6.0,
            ),
        ],
        why: None,
        pictures: vec![side_by_side(
            "images",
            "A fast target at its velocity, without and with Keystone",
            &[
                ("without Keystone", &images[0], &grid),
                ("with Keystone", &images[1], &grid),
            ],
        )?],
    })
}
