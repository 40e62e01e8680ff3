//! Track by GNSS, INS, echoes (MPGA) and their fusion, with an outage of GNSS: the investigation that Chim 2018, 7.6, proposes.

use glam::DVec2;

use super::chim_fusion_tracks::{
    Estimate, FUSED, GNSS, INS, MPGA, NAMES, Run, channels, failed, fit, fitted_m, recorded, walk,
};
use super::forming::{Share, backprojection, form, grid_about, side_by_side_at};
use super::measure::peak_db;
use crate::{Check, Context, Finding, Item, ItemError, NOT_DONE, Picture};
use subaperture_model::geometry::{Axis, ImageGrid};
use subaperture_model::image::Image;
use subaperture_model::track::Fix;
use subaperture_motion::targets::{Settings, on_track, recover};
use subaperture_plot::{Chart, Curve, Scale, Stroke, stacked};
use subaperture_simulate::Experiment;

pub(super) const ITEMS: [Item; 1] = [Item {
    id: "c-8-2",
    source: "Chim 2018, 7.6 and 8.2",
    title: "Track by GNSS, INS, MPGA and their fusion, with an outage of GNSS",
    work: 60.0,
    reproduce: fusion,
}];

/// Collections with independent noise of echoes and logs.
const SEEDS: u64 = 8;
/// Steps of the progress bar: the collections, one without movers, and the images.
const PARTS: usize = SEEDS as usize + 1 + NAMES.len() + 1;
/// Squared distance in standard deviations within which 95 % of Gaussian errors in two dimensions are: -2 ln 0.05.
const SQUARE_OF_95: f64 = 5.991_464_547;
/// Half side and pixel spacing of the image about a reflector, metres.
const NEAR_M: [f64; 2] = [0.2, 0.02];
/// Wavelengths of position error that cost a two-way phase of a quarter of pi.
const FOCUSED: f64 = 1.0 / 16.0;
/// Largest ratio of an RMS error to its prediction in [`SEEDS`] collections: the 99.85 % point of chi-square with 16 degrees of freedom, two in each
/// collection, is 36.5.
const LARGEST_RATIO: f64 = 1.51;
/// Smallest share within the 95 % ellipse by three standard deviations of a share among 16 independent errors.
const LEAST_SHARE: f64 = 0.95 - 3.0 * 0.0545;

fn fusion(context: &Context) -> Result<Finding, ItemError> {
    let mut runs = Vec::with_capacity(SEEDS as usize);
    for seed in 0..SEEDS {
        let monitor = Share {
            whole: context.monitor,
            place: [seed as usize, PARTS],
        };
        runs.push(Run::new(context, &monitor, &walk(seed)?)?);
    }
    let experiment = walk(0)?;
    let figures: Vec<Figures> = (0..NAMES.len()).map(|n| Figures::of(&runs, n)).collect();
    let (images, levels_db) = images(context, &experiment, &runs[0])?;
    let moved_m = moved_by_movers_m(context, &experiment, &runs[0])?;
    let wavelength_m = runs[0].found.seen.array.wavelength_m;
    let outage_s = experiment.logs[0].outages_s[0];
    let outage_s = [outage_s.0, outage_s.1];
    let mut checks = Vec::new();
    for (n, figures_of) in figures.iter().enumerate() {
        checks.push(error_check(n, &figures, wavelength_m));
        checks.extend(covariance_checks(n, figures_of));
        checks.push(level_check(n, &levels_db));
    }
    checks.extend(mover_checks(&runs, &experiment, moved_m, &figures[MPGA]));
    Ok(Finding {
        thesis: "MPGA has a pose for each pair of pulses, at the antennas and without a second clock, but no absolute position, and drifts; without contrast \
                 in the scene there is no pose (7.6). The author suggests \"a follow-up investigation on a sensor fusion solution which compose of MPGA, INS, \
                 and GNSS sensors\", which the thesis does not contain. 8.2 asks for images from vehicles and small UAVs on highly non-linear tracks."
            .to_owned(),
        method: format!(
            "The example scenario 'fusion': 1.1 to 1.7 GHz, two receivers half a wavelength apart, 10 s at 0.6 m/s with a sway of some centimetres and 1.5 \
             degrees, six point reflectors, two movers. GNSS: BESTPOS, 5 per second, 15 mm. GNSS + INS: INSPVAX, 20 per second, 8 mm and 0.1 degrees, which \
             bridges the outage from 3 s to 7.5 s with an acceleration error of 8 mm/s^2. The fixes of GNSS alone and of the inertial solution are joined by a cubic spline. The recorded positions drift by 8 cm. Errors in the plane of motion in \
             {SEEDS} collections with independent noise on the same track; images of the first one by backprojection, both channels summed. MPGA is placed \
             on the recorded positions, as its echoes determine neither position nor heading, and its covariance is that of its shape: it is compared after \
             fitting both to the truth, in images too. The fusion is one least-squares problem over the whole time (increments of MPGA, positions, inertial \
             solution). Scale: an aperture of 6 m with point reflectors at 4 to 16 m; the thesis has no such measurement."
        ),
        why: Finding::unless_all_agree(
            &checks,
            "Errors of one collection are correlated over seconds, so that eight collections are a small sample.",
        ),
        checks,
        pictures: vec![errors_over_time(&runs[0], outage_s)?, images],
    })
}

fn rms_m<'a>(errors_m: impl Iterator<Item = &'a DVec2>) -> f64 {
    let (mut sum, mut count) = (0.0, 0);
    for error in errors_m {
        sum += error.length_squared();
        count += 1;
    }
    (sum / f64::from(count.max(1))).sqrt()
}

/// Figures of a track over all collections.
struct Figures {
    /// RMS error outside of the outage and in it, metres.
    errors_m: [f64; 2],
    /// The same after fitting position and heading.
    fitted_m: [f64; 2],
    /// Predicted RMS error in the outage, metres; NaN without prediction.
    predicted_m: f64,
    /// Share of errors within the stated ellipse of 95 %.
    share: f64,
}

impl Figures {
    fn of(runs: &[Run], n: usize) -> Self {
        let mut own: [Vec<DVec2>; 2] = Default::default();
        let mut fitted: [Vec<DVec2>; 2] = Default::default();
        let (mut variances_m2, mut within) = (Vec::new(), Vec::new());
        for run in runs {
            let track = &run.tracks[n];
            let after_m = fitted_m(&track.errors_m, &run.truth_m);
            // The covariance of MPGA is that of the shape.
            let stated_m = if n == MPGA { &after_m } else { &track.errors_m };
            for (i, lost) in run.lost.iter().enumerate() {
                own[usize::from(*lost)].push(track.errors_m[i]);
                fitted[usize::from(*lost)].push(after_m[i]);
                let Some(covariance) = track.covariances_m2[i] else {
                    continue;
                };
                let square = stated_m[i].dot(covariance.inverse() * stated_m[i]);
                within.push(square < SQUARE_OF_95);
                if *lost {
                    variances_m2.push(covariance.x_axis.x + covariance.y_axis.y);
                }
            }
        }
        let mean = variances_m2.iter().sum::<f64>() / variances_m2.len() as f64;
        let inside = within.iter().filter(|within| **within).count();
        Self {
            errors_m: [0, 1].map(|k| rms_m(own[k].iter())),
            fitted_m: [0, 1].map(|k| rms_m(fitted[k].iter())),
            predicted_m: mean.sqrt(),
            share: inside as f64 / within.len().max(1) as f64,
        }
    }

    /// RMS error in the outage to which the prediction applies, metres.
    fn stated_m(&self, n: usize) -> f64 {
        match n {
            MPGA => self.fitted_m[1],
            _ => self.errors_m[1],
        }
    }
}

fn error_check(n: usize, figures: &[Figures], wavelength_m: f64) -> Check {
    let own = &figures[n];
    let [outside_m, outage_m] = own.errors_m;
    let [fitted_outside_m, fitted_m] = own.fitted_m;
    let focused_m = FOCUSED * wavelength_m;
    let alone = [GNSS, INS, MPGA].map(|k| figures[k].errors_m[1]);
    let (thesis, agrees) = match n {
        // The outage leaves no focused image.
        GNSS | INS => ("hardly reliable near the ground", outage_m > focused_m),
        MPGA => (
            "good enough to focus, no absolute position",
            fitted_m < focused_m,
        ),
        _ => (
            "suggested",
            // Better than each sensor, and of the shape that the echoes determine.
            alone.into_iter().all(|alone_m| outage_m < alone_m) && fitted_m < focused_m,
        ),
    };
    Check::claim(
        &format!("{}: RMS error outside of the outage and in it", NAMES[n]),
        thesis,
        format!(
            "{:.1} mm, {:.1} mm, fitted {:.2} mm, {:.2} mm",
            1e3 * outside_m,
            1e3 * outage_m,
            1e3 * fitted_outside_m,
            1e3 * fitted_m
        ),
        agrees,
    )
}

fn covariance_checks(n: usize, own: &Figures) -> Vec<Check> {
    let mut checks = vec![Check::claim(
        &format!("{}: errors within the stated ellipse of 95 %", NAMES[n]),
        NOT_DONE,
        format!("{:.1} %", 1e2 * own.share),
        own.share > LEAST_SHARE,
    )];
    if n != GNSS {
        let ratio = own.stated_m(n) / own.predicted_m;
        checks.push(Check::claim(
            &format!(
                "{}: predicted RMS error in the outage, and error over it",
                NAMES[n]
            ),
            NOT_DONE,
            format!("{:.2} mm, {ratio:.2}", 1e3 * own.predicted_m),
            ratio < LARGEST_RATIO,
        ));
    }
    checks
}

fn level_check(n: usize, levels_db: &[f64]) -> Check {
    let thesis = match n {
        MPGA => "most target features are focused",
        _ => NOT_DONE,
    };
    let focused = levels_db[n] > -1.0;
    Check::claim(
        &format!(
            "{}: weakest reflector relative to the image on the true track",
            NAMES[n]
        ),
        thesis,
        format!("{:.2} dB", levels_db[n]),
        focused == (n >= MPGA),
    )
}

fn mover_checks(
    runs: &[Run],
    experiment: &Experiment,
    moved_m: f64,
    figures: &Figures,
) -> Vec<Check> {
    let found: Vec<usize> = runs.iter().map(|run| run.found.movers.len()).collect();
    let least = found.iter().min().copied().unwrap_or(0);
    vec![
        Check::claim(
            "movers found, least of all collections",
            "can be identified",
            format!("{least} of {}", experiment.scene.movers.len()),
            least >= experiment.scene.movers.len(),
        ),
        Check::claim(
            "MPGA: RMS difference from the track without movers in the scene",
            "assumes that all targets are stationary",
            format!("{:.2} mm", 1e3 * moved_m),
            moved_m < 3.0 * figures.predicted_m,
        ),
    ]
}

/// RMS difference of the MPGA track's shape with and without movers, metres.
fn moved_by_movers_m(
    context: &Context,
    experiment: &Experiment,
    run: &Run,
) -> Result<f64, ItemError> {
    let mut still = experiment.clone();
    still.scene.movers.clear();
    let monitor = Share {
        whole: context.monitor,
        place: [SEEDS as usize, PARTS],
    };
    let all = channels(&recorded(context, &still)?)?;
    let found = recover(all, &Settings::default(), &monitor)?;
    let of = |pulse: usize| found.moments.iter().find(|moment| moment.pulse == pulse);
    let pairs = run.found.moments.iter().filter_map(|moment| {
        let other = of(moment.pulse)?;
        Some((moment.position_m.truncate(), other.position_m.truncate()))
    });
    let (with, without): (Vec<DVec2>, Vec<DVec2>) = pairs.unzip();
    let off: Vec<DVec2> = with.iter().zip(&without).map(|(a, b)| *a - *b).collect();
    Ok(rms_m(fitted_m(&off, &without).iter()))
}

/// Fixes moved by the rotation and shift that fit their positions best to the truth.
fn fitted_fixes(estimate: &Estimate, truth_m: &[DVec2]) -> Vec<Fix> {
    let each = estimate.errors_m.iter().zip(truth_m);
    let points: Vec<DVec2> = each.map(|(error, truth)| *error + *truth).collect();
    let (angle, from, to) = fit(&points, truth_m);
    let turn = glam::DQuat::from_rotation_z(angle);
    let moved = |fix: &Fix| Fix {
        position_m: turn * (fix.position_m - from.extend(0.0)) + to.extend(0.0),
        attitude: fix.attitude.map(|attitude| turn * attitude),
        ..*fix
    };
    estimate.fixes.iter().map(moved).collect()
}

/// Images on all tracks, and the least level of a reflector relative to the image on the true track, dB.
fn images(
    context: &Context,
    experiment: &Experiment,
    run: &Run,
) -> Result<(Picture, Vec<f64>), ItemError> {
    let axis = |start, step, count| Axis { start, step, count };
    let whole = ImageGrid::horizontal(axis(-4.0, 0.06, 251), axis(3.0, 0.06, 176), 0.0);
    let mut tracks: Vec<Vec<Fix>> = run.tracks.iter().map(|one| one.fixes.clone()).collect();
    tracks[MPGA] = fitted_fixes(&run.tracks[MPGA], &run.truth_m);
    tracks.push(run.true_fixes.clone());
    let former = backprojection();
    let mut shown: Vec<Image> = Vec::with_capacity(tracks.len());
    let mut levels_db: Vec<Vec<f64>> = Vec::with_capacity(tracks.len());
    for (n, fixes) in tracks.iter().enumerate() {
        let placed = on_track(channels(&run.recorded)?, fixes)?;
        let history = placed.coherent_sum().map_err(failed)?;
        let place = [SEEDS as usize + 1 + n, PARTS];
        shown.push(form(context, place, &history, &whole, &former)?);
        let mut levels = Vec::new();
        for point in &experiment.scene.points {
            let [half_m, step_m] = NEAR_M;
            let near = grid_about(point.position_m, half_m, half_m, step_m);
            levels.push(peak_db(&form(context, place, &history, &near, &former)?));
        }
        levels_db.push(levels);
    }
    let truth = levels_db[NAMES.len()].clone();
    let least = |levels: &Vec<f64>| {
        let each = levels.iter().zip(&truth).map(|(own, truth)| own - truth);
        each.fold(f64::INFINITY, f64::min)
    };
    let titles = NAMES.into_iter().chain(["true track"]);
    let panels: Vec<(&str, &Image, &ImageGrid)> = titles
        .zip(&shown)
        .map(|(title, image)| (title, image, &whole))
        .collect();
    let picture = side_by_side_at(
        "images",
        "Images on each track; MPGA after fitting position and heading",
        Scale::Fixed {
            top_db: 0.0,
            span_db: 40.0,
        },
        &panels,
    )?;
    Ok((
        picture,
        levels_db[..NAMES.len()].iter().map(least).collect(),
    ))
}

/// Errors in y over time with bars of two predicted standard deviations.
fn errors_over_time(run: &Run, outage_s: [f64; 2]) -> Result<Picture, ItemError> {
    /// Pulses from bar to bar.
    const EVERY: usize = 16;
    let curves = |n: usize| -> [Curve; 2] {
        let track = &run.tracks[n];
        let errors_m = match n {
            MPGA => fitted_m(&track.errors_m, &run.truth_m),
            _ => track.errors_m.clone(),
        };
        let points = run.times_s.iter().zip(&errors_m);
        let points = points.map(|(&time_s, error)| (time_s, 1e3 * error.y));
        let mut bars = Vec::new();
        for i in (0..run.times_s.len()).skip(EVERY / 2).step_by(EVERY) {
            let Some(covariance) = track.covariances_m2[i] else {
                continue;
            };
            let (time_s, middle) = (run.times_s[i], errors_m[i].y);
            let reach = 2.0 * covariance.y_axis.y.sqrt();
            bars.push((time_s, 1e3 * (middle - reach)));
            bars.push((time_s, 1e3 * (middle + reach)));
            bars.push((f64::NAN, f64::NAN));
        }
        let curve = |name: String, points| Curve {
            name,
            points,
            stroke: Stroke::Solid,
        };
        let name = match n {
            MPGA => format!("{}, fitted", NAMES[n]),
            _ => NAMES[n].to_owned(),
        };
        [
            curve(name, points.collect()),
            curve("two standard deviations".to_owned(), bars),
        ]
    };
    let chart = |n: usize, title: &str| Chart {
        title: title.to_owned(),
        across_label: "time (s)".to_owned(),
        up_label: "error in y (mm)".to_owned(),
        curves: curves(n).into(),
        marks: outage_s.to_vec(),
        ..Chart::default()
    };
    let png = stacked(&[
        chart(GNSS, "Track errors, outage of GNSS from 3 s to 7.5 s"),
        chart(INS, ""),
        chart(MPGA, ""),
        chart(FUSED[0], ""),
        chart(FUSED[1], ""),
    ])?;
    Ok(Picture {
        name: "errors".to_owned(),
        caption: "Errors in y of each track with two predicted standard deviations; GNSS alone states none in the outage"
            .to_owned(),
        png,
    })
}
