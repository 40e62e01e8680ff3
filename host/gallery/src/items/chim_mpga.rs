//! The radar's track from its echoes, and images on it: Chim 2018, 7.4 and 7.5.1, Figs 7.7 to 7.11.

use std::f64::consts::TAU;

use glam::DVec2;
use num_complex::{Complex32, Complex64};

use super::chim_rail::{PRI_S, REFLECTORS_M, SQUINT_DEG, WALL_M, found, increments, recorded, way};
use super::chim_strip::{Map, band, profiles};
use super::forming::{backprojection, form_weighted, grid_about, side_by_side};
use crate::{Check, Context, Finding, Item, ItemError, Picture};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::{Axis, ImageGrid};
use subaperture_model::image::power;
use subaperture_model::phase_history::{InMemory, OnTrack, PhaseHistory};
use subaperture_model::track::{Fix, SampledTrack};
use subaperture_motion::chain;
use subaperture_motion::squint::{Leg, Squint, squint, travelled};
use subaperture_plot::{Chart, Curve, Stroke, lines};
use subaperture_signal::phase::{narrow, widen};
use subaperture_signal::window::Window;
use subaperture_targets::Recovered;

pub(super) const ITEMS: [Item; 1] = [Item {
    id: "c-7-8",
    source: "Chim 2018, Figs 7.8 to 7.11",
    title: "The track of a radar on a rail from its echoes, and images on it",
    work: 40.0,
    reproduce: track,
}];

const PULSES: usize = 1000;
const SPEED_M_S: f64 = 1.0;
/// Ranges of the profiles that are shown.
const SHOWN_M: (f64, f64) = (0.5, 12.5);
/// Pulses and range bins of a pixel of theirs.
const BLOCK: usize = 2;
const BINS: usize = 4;
/// Images formed, for the bar.
const IMAGES: usize = 2 + 3 * REFLECTORS_M.len();

fn track(context: &Context) -> Result<Finding, ItemError> {
    let recorded = recorded(context, way(SPEED_M_S, &[])?, PULSES, |_| true)?;
    let found = found(context, &recorded)?;
    let increments = increments(&found.seen)?;
    if increments.len() + 1 != PULSES {
        return Err(ItemError::Measure(format!(
            "{} of {PULSES} pulses have a pose",
            increments.len() + 1
        )));
    }
    // Sums along the array's own axes, as the thesis draws and images; the heading, which noise adds up in too, bears on nothing then.
    let mut at_m = DVec2::ZERO;
    let rest = increments.iter().map(|&increment| {
        at_m += travelled([increment]);
        at_m
    });
    let places_m: Vec<DVec2> = std::iter::once(DVec2::ZERO).chain(rest).collect();
    let turned = chain(increments.iter().copied())[PULSES - 1];
    // How the array is turned against the rail is in no phase: that the rail is straight tells it.
    let leg = Leg::along_axis(travelled(increments.iter().copied()), 1e-3);
    let squint = squint(&[leg]).map_err(|error| ItemError::Measure(error.to_string()))?;

    let history = &recorded[0].1;
    let on_pairs = on_track(history, &found, &laid_on_rail(&places_m, &squint, &found))?;
    let together: Vec<Fix> = found
        .moments
        .iter()
        .map(|moment| Fix {
            time_s: moment.time_s,
            position_m: moment.position_m,
            attitude: Some(moment.attitude),
        })
        .collect();
    let on_together = on_track(history, &found, &together)?;

    let axis = |start, step, count| Axis { start, step, count };
    let grid = ImageGrid::horizontal(axis(-1.2, 0.008, 388), axis(1.9, 0.04, 100), 0.0);
    let image = |place: usize, history: &dyn PhaseHistory, grid: &ImageGrid| {
        let window = Window::default();
        form_weighted(
            context,
            [place, IMAGES],
            history,
            grid,
            &backprojection(),
            window,
        )
    };
    let images = [image(0, history, &grid)?, image(1, &on_pairs, &grid)?];
    let mut peaks_db = [[0.0; REFLECTORS_M.len()]; 3];
    let histories: [&dyn PhaseHistory; 3] = [history, &on_pairs, &on_together];
    for (i, history) in histories.into_iter().enumerate() {
        for (j, place_m) in REFLECTORS_M.into_iter().enumerate() {
            let near = grid_about(place_m, 0.1, 0.1, 0.002);
            let peak = image(2 + REFLECTORS_M.len() * i + j, history, &near)?.peak();
            peaks_db[i][j] = peak.map_or(f64::NAN, |peak| 10.0 * power(peak.value).log10());
        }
    }
    let [reference_db, pairs_db, together_db] = peaks_db;
    let below = |peaks: [f64; 4]| [0, 1, 2, 3].map(|i| peaks[i] - reference_db[i]);
    let told = |values: [f64; 4]| values.map(|v| format!("{v:.2}")).join(", ");

    // Along the array and where it looks, as in the thesis; the carriage went along x by as much as the first pulse and the n-th are apart.
    let azimuth_off_m: Vec<f64> = places_m
        .iter()
        .enumerate()
        .map(|(n, at_m)| at_m.x - travelled_m(n) * SQUINT_DEG.to_radians().cos())
        .collect();
    let end_m = azimuth_off_m[PULSES - 1];
    let drift_m = places_m[PULSES - 1].y;
    let together_off_m: Vec<f64> = together
        .iter()
        .enumerate()
        .map(|(n, fix)| fix.position_m.x - together[0].position_m.x - travelled_m(n))
        .collect();
    let most = |all: &[f64]| all.iter().fold(0.0, |most: f64, m| most.max(m.abs()));
    let [azimuth, range] = positions(&places_m)?;
    let places_off_m = REFLECTORS_M.map(|at_m| {
        let off = found
            .places
            .iter()
            .map(|place| place.position_m.distance(at_m));
        off.fold(f64::INFINITY, f64::min)
    });
    Ok(Finding {
        thesis: "Four corner reflectors in a room, a radar driven along 1 m by a stepper motor, two channels: four traces in the range \
                 profiles (Fig. 7.8), the track by MPGA beside the motor's (7.9), \"the maximum discrepancy at the end of the track is \
                 about 2 millimeter\" in azimuth, a drift in range by the squint of the antennas, and images on both tracks (7.10, \
                 7.11), of which the second is \"slightly off the optimal, but should still retain most target features\"."
            .to_owned(),
        method: format!(
            "Made again by simulation, for the recording is not public: 77 to 80 GHz, receivers half a wavelength apart, the transmitter 2 cm \
             beside them, {PULSES} pulses, 1 mm from one to the next, 30 dB for a reflector, the array turned by {SQUINT_DEG} degrees against the rail, which the recording does not tell. \
             Four reflectors at 2 to 6 m, and each once more in the wall behind them, 14 dB down, beyond the {WALL_M} m that are \
             looked at. Targets by CFAR, motion by the thesis's two least squares (C 7.3.4, with the directions of near targets as they are), summed up; \
             beside it the estimate of all poses and places together. Images of one channel by backprojection."
        ),
        checks: vec![
            Check::claim(
                "targets followed within the mask",
                "4 major traces",
                format!("{}", found.places.len()),
                found.places.len() == REFLECTORS_M.len(),
            ),
            Check::claim(
                "azimuth at the end of the track, beyond the motor's",
                "about 2 mm",
                format!("{:.2} mm", 1e3 * end_m),
                end_m.abs() < 2.5e-3,
            ),
            Check::claim(
                "range at the end of the track",
                "a significant discrepancy, by squint",
                format!("{:.2} mm", 1e3 * drift_m),
                drift_m.abs() > 1e-3,
            ),
            Check::claim(
                &format!("squint that this tells, where it is {SQUINT_DEG} degrees"),
                "not given",
                format!("{:.3} degrees", squint.squint_rad.to_degrees()),
                (squint.squint_rad.to_degrees() - SQUINT_DEG).abs() < 0.1,
            ),
            Check::claim(
                "heading found at the end, where it does not turn",
                "not given",
                format!("{:.2} degrees", turned.heading_rad.to_degrees()),
                turned.heading_rad.abs() < 0.1,
            ),
            Check::claim(
                "peaks on the track by MPGA, of those on the motor's, dB",
                "slightly off the optimal",
                told(below(pairs_db)),
                below(pairs_db).iter().all(|&db| db.abs() < 3.0),
            ),
            Check::claim(
                "largest error along the rail by all poses and places together",
                "not done",
                format!("{:.3} mm", 1e3 * most(&together_off_m)),
                most(&together_off_m) < end_m.abs().max(1e-3),
            ),
            Check::claim(
                "peaks on that track, of those on the motor's, dB",
                "not done",
                told(below(together_db)),
                below(together_db).iter().all(|&db| db.abs() < 0.5),
            ),
            Check::claim(
                "places of the reflectors by that track, off at most",
                "not done",
                format!("{:.1} mm", 1e3 * most(&places_off_m)),
                most(&places_off_m) < 0.02,
            ),
        ],
        why: None,
        pictures: vec![
            traces(history)?,
            azimuth,
            range,
            errors(&azimuth_off_m, &together_off_m)?,
            side_by_side(
                "images",
                "on the motor's track (Fig. 7.10) and on that by MPGA (7.11)",
                &[
                    ("the motor's track", &images[0], &grid),
                    ("the track by MPGA", &images[1], &grid),
                ],
            )?,
        ],
    })
}

/// How far the carriage went until pulse `n`.
fn travelled_m(n: usize) -> f64 {
    SPEED_M_S * PRI_S * n as f64
}

/// Places along the array's own axes, laid upon the rail.
fn laid_on_rail(places_m: &[DVec2], squint: &Squint, found: &Recovered) -> Vec<Fix> {
    let arrangement = &found.seen.arrangement;
    let turn = DVec2::from_angle(squint.squint_rad);
    let fix = |(at_m, &time_s): (&DVec2, &f64)| Fix {
        time_s,
        position_m: arrangement.origin_m + turn.rotate(*at_m).extend(0.0),
        attitude: Some(arrangement.attitude),
    };
    places_m.iter().zip(&found.seen.times_s).map(fix).collect()
}

/// The first channel's antennas on a track.
fn on_track(
    history: &InMemory,
    found: &Recovered,
    fixes: &[Fix],
) -> Result<OnTrack<'static>, ItemError> {
    let arrangement = &found.seen.arrangement;
    let track = SampledTrack::new(fixes).map_err(|e| ItemError::Measure(e.to_string()))?;
    let [transmitter, receiver] = arrangement.of_channels[0];
    let arms_m = [
        arrangement.transmitters_m[transmitter],
        arrangement.receivers_m[receiver],
    ];
    let span_s = (fixes[0].time_s, fixes[fixes.len() - 1].time_s);
    Ok(OnTrack::new(
        Box::new(history.clone()),
        &track,
        arms_m,
        span_s,
    )?)
}

/// Range profiles of the first channel, as Fig. 7.8: pulses across, range up.
fn traces(history: &InMemory) -> Result<Picture, ItemError> {
    let band = band(history)?;
    let mut samples = vec![Complex32::ZERO; PULSES * band.count];
    history.read(0..PULSES, &mut samples)?;
    // Phases of whole paths, so that all pulses have one axis.
    let pulses = &history.collection().pulses;
    for (pulse, row) in pulses.iter().zip(samples.chunks_exact_mut(band.count)) {
        for (k, z) in row.iter_mut().enumerate() {
            let turns = band.frequency_hz(k) * (pulse.reference_path_m / SPEED_OF_LIGHT_M_S);
            *z = narrow(widen(*z) * Complex64::cis(-TAU * turns.fract()));
        }
    }
    let (powers, ranges) = profiles(&samples, &band, Window::default(), 0.0, SHOWN_M);
    // Means of some pulses and bins each, enough for a picture.
    let rows = ranges.count / BINS;
    let mean = |i: usize| {
        let (row, column) = (i / (PULSES / BLOCK), i % (PULSES / BLOCK));
        let cells = (0..BINS * BLOCK).map(|j| {
            let (bin, pulse) = (row * BINS + j % BINS, column * BLOCK + j / BINS);
            powers[pulse * ranges.count + bin]
        });
        cells.sum::<f32>() / (BINS * BLOCK) as f32
    };
    let by_range: Vec<f32> = (0..rows * (PULSES / BLOCK)).map(mean).collect();
    let map = Map {
        name: "profiles",
        caption: "Range profiles of one channel (Fig. 7.8)",
        labels: ["pulse", "range (m)"],
        rows: Axis {
            start: ranges.start + 0.5 * (BINS - 1) as f64 * ranges.step,
            step: BINS as f64 * ranges.step,
            count: rows,
        },
        columns: Axis {
            start: 0.5 * (BLOCK - 1) as f64,
            step: BLOCK as f64,
            count: PULSES / BLOCK,
        },
    };
    Ok(map.levels(&by_range)?)
}

fn curve(name: &str, points: impl Iterator<Item = (usize, f64)>, stroke: Stroke) -> Curve {
    Curve {
        name: name.to_owned(),
        points: points.map(|(n, value)| (n as f64, value)).collect(),
        stroke,
    }
}

/// The track beside the motor's, as Fig. 7.9: azimuth and range along the array's own axes, against pulses.
fn positions(places_m: &[DVec2]) -> Result<[Picture; 2], ItemError> {
    let each = || places_m.iter().enumerate();
    let picture = |name: &str, what: &str, unit: &str, curves: Vec<Curve>| {
        let all = curves
            .iter()
            .flat_map(|curve| &curve.points)
            .map(|point| point.1);
        let png = lines(&Chart {
            title: format!("{what} of the radar (Fig. 7.9)"),
            across_label: "pulse".to_owned(),
            up_label: format!("{} ({unit})", what.to_lowercase()),
            up: Some(with_room(all)),
            curves,
            ..Chart::default()
        })?;
        Ok::<_, ItemError>(Picture {
            name: name.to_owned(),
            caption: format!("{what} of the radar by its motor and by MPGA"),
            png,
        })
    };
    Ok([
        picture(
            "azimuth",
            "Azimuth",
            "m",
            vec![
                curve(
                    "by MPGA",
                    each().map(|(n, at_m)| (n, at_m.x)),
                    Stroke::Solid,
                ),
                curve(
                    "by the motor",
                    each().map(|(n, _)| (n, travelled_m(n))),
                    Stroke::Dashed,
                ),
            ],
        )?,
        picture(
            "range",
            "Range",
            "mm",
            vec![
                curve(
                    "by MPGA",
                    each().map(|(n, at_m)| (n, 1e3 * at_m.y)),
                    Stroke::Solid,
                ),
                curve(
                    "by the motor",
                    each().map(|(n, _)| (n, 0.0)),
                    Stroke::Dashed,
                ),
            ],
        )?,
    ])
}

/// From the least to the most, and room for the legend above.
fn with_room(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let low = values.clone().fold(f64::INFINITY, f64::min);
    let high = values.fold(f64::NEG_INFINITY, f64::max);
    (low - 0.05 * (high - low), high + 0.2 * (high - low))
}

/// What azimuths are off by.
fn errors(pairs_m: &[f64], together_m: &[f64]) -> Result<Picture, ItemError> {
    let of = |all: &[f64]| {
        all.iter()
            .map(|m| 1e3 * m)
            .enumerate()
            .collect::<Vec<_>>()
            .into_iter()
    };
    let png = lines(&Chart {
        title: "What azimuths are off by".to_owned(),
        across_label: "pulse".to_owned(),
        up_label: "error along the array (mm)".to_owned(),
        curves: vec![
            curve("MPGA from pulse to pulse", of(pairs_m), Stroke::Solid),
            curve(
                "all poses and places together",
                of(together_m),
                Stroke::Solid,
            ),
        ],
        up: Some(with_room(pairs_m.iter().chain(together_m).map(|m| 1e3 * m))),
        ..Chart::default()
    })?;
    Ok(Picture {
        name: "errors".to_owned(),
        caption: "Errors in azimuth of both tracks".to_owned(),
        png,
    })
}
