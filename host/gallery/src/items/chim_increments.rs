//! Motion from chirp to chirp: Chim 2018, 7.5.2, Figs 7.12 and 7.13.

use glam::DVec2;

use super::chim_rail::{PRI_S, SQUINT_DEG, found, increments, recorded, spread, way};
use crate::{Check, Context, Finding, Item, ItemError, Picture};
use subaperture_plot::{Chart, Curve, Stroke, stacked};
use subaperture_targets::Recovered;

pub(super) const ITEMS: [Item; 2] = [
    Item {
        id: "c-7-12",
        source: "Chim 2018, Fig. 7.12",
        title: "The radar's motion from chirp to chirp, in bursts and over pauses",
        work: 8.0,
        reproduce: bursts,
    },
    Item {
        id: "c-7-13",
        source: "Chim 2018, Fig. 7.13",
        title: "The radar's motion from chirp to chirp, as its motor starts",
        work: 34.0,
        reproduce: ramp,
    },
];

/// The motor's speed; a tenth of a millimetre a chirp.
const SPEED_M_S: f64 = 0.1;
const STEP_M: f64 = SPEED_M_S * PRI_S;
/// Chirps of a burst, and the duration of the pause after it, in chirps.
const BURST: usize = 10;
const PAUSE: usize = 3;
const BURSTS: usize = 40;
/// Chirps until the motor is at its speed, and all that are shown.
const RAMP: usize = 1500;
const CHIRPS: usize = 2000;

/// Motion along the array and where it looks, from chirp to chirp: by the thesis's pairs, and between the poses that all chirps tell together.
struct Motion {
    by_pairs_m: Vec<DVec2>,
    together_m: Vec<DVec2>,
}

impl Motion {
    fn of(found: &Recovered) -> Result<Self, ItemError> {
        let by_pairs = increments(&found.seen)?;
        let by_pairs_m: Vec<DVec2> = by_pairs.iter().map(|one| one.moved_m).collect();
        let pairs = found.moments.windows(2);
        let together_m: Vec<DVec2> = pairs
            .map(|pair| (pair[1].position_m - pair[0].position_m).truncate())
            .collect();
        match by_pairs_m.len() == together_m.len() {
            true => Ok(Self {
                by_pairs_m,
                together_m,
            }),
            false => Err(ItemError::Measure(
                "pulses without a pose: the reflectors are not seen all the time".to_owned(),
            )),
        }
    }

    /// The thesis's figure, range over azimuth, beside how the carriage moved.
    fn picture(&self, title: &str, shown: usize, truth_m: &[f64]) -> Result<Picture, ItemError> {
        let chart = |title: &str, label: &str, of: fn(&DVec2) -> f64, share: f64| {
            let found = self.by_pairs_m.iter().map(of).take(shown);
            let truth = truth_m.iter().map(|m| share * m).take(shown);
            Chart {
                title: title.to_owned(),
                across_label: "chirp".to_owned(),
                up_label: format!("change of {label} (mm)"),
                curves: vec![
                    curve("computed", found, Stroke::Solid),
                    curve("the carriage", truth, Stroke::Dashed),
                ],
                ..Chart::default()
            }
        };
        let squint = SQUINT_DEG.to_radians();
        let png = stacked(&[
            chart(title, "range", |m| m.y, -squint.sin()),
            chart("", "azimuth", |m| m.x, squint.cos()),
        ])?;
        Ok(Picture {
            name: "motion".to_owned(),
            caption: "Change of range (upper) and of azimuth (lower) from chirp to chirp, computed and as the carriage moved".to_owned(),
            png,
        })
    }
}

/// Metres from chirp to chirp, in millimetres.
fn curve(name: &str, values_m: impl Iterator<Item = f64>, stroke: Stroke) -> Curve {
    Curve {
        name: name.to_owned(),
        points: values_m
            .enumerate()
            .map(|(n, m)| (n as f64, 1e3 * m))
            .collect(),
        stroke,
    }
}

fn bursts(context: &Context) -> Result<Finding, ItemError> {
    let period = BURST + PAUSE;
    let recorded = recorded(context, way(SPEED_M_S, &[])?, BURSTS * period, |n| {
        n % period < BURST
    })?;
    let motion = Motion::of(&found(context.monitor, &recorded)?)?;
    let (pause, burst): (Vec<_>, Vec<_>) =
        (0..motion.by_pairs_m.len()).partition(|n| n % BURST == BURST - 1);
    let at = |all: &[usize], of: &[DVec2]| all.iter().map(|&n| of[n].x).collect::<Vec<f64>>();
    let told = |of: &[DVec2]| {
        let [burst_m, pause_m] = [at(&burst, of), at(&pause, of)];
        let [within, over] = [&burst_m, &pause_m].map(|all| spread(all.iter().copied()));
        let most_m = burst_m.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let least_m = pause_m.iter().copied().fold(f64::INFINITY, f64::min);
        (within, over, least_m / most_m)
    };
    let (within, over, apart) = told(&motion.by_pairs_m);
    let (together, _, _) = told(&motion.together_m);
    let range = spread(motion.by_pairs_m.iter().map(|m| m.y));
    let truth_m: Vec<f64> = (0..motion.by_pairs_m.len())
        .map(|n| match n % BURST == BURST - 1 {
            true => STEP_M * (PAUSE + 1) as f64,
            false => STEP_M,
        })
        .collect();
    let missing = (PAUSE + 1) as f64;
    Ok(Finding {
        thesis: "The radar, driven at a steady speed, sends bursts of a constant number of chirps, each \"followed by a pause that has a \
                 duration of 3 chirps\": between the chirps of a burst it travels \"a constant distance\", over a pause \"a longer \
                 distance\". No numbers are given."
            .to_owned(),
        method: format!(
            "Made again by simulation, for the thesis's recording is not public: the radar of Fig. 7.8, {BURSTS} bursts of {BURST} \
             chirps of 1 ms at {SPEED_M_S} m/s, 30 dB for a reflector. Chirps of the pauses are left out of a recording of all. \
             Motion from chirp to chirp by the thesis's two least squares, along the array's own axes, heading found too."
        ),
        checks: vec![
            Check::claim(
                "change of azimuth within bursts: mean, and scatter of one",
                "constant",
                format!("{:.4} mm, {:.4} mm", 1e3 * within[0], 1e3 * within[1]),
                (within[0] / STEP_M - 1.0).abs() < 0.05,
            ),
            Check::claim(
                "change of azimuth over pauses: mean, and scatter of one",
                "longer",
                format!("{:.4} mm, {:.4} mm", 1e3 * over[0], 1e3 * over[1]),
                over[0] > within[0],
            ),
            Check::claim(
                "the second over the first, where a pause is of 3 chirps",
                &format!("{missing:.0}"),
                format!("{:.2}", over[0] / within[0]),
                (over[0] / within[0] / missing - 1.0).abs() < 0.05,
            ),
            Check::claim(
                "the shortest pause over the longest step of a burst",
                "pauses stand out",
                format!("{apart:.2}"),
                apart > 1.5,
            ),
            Check::claim(
                "change of range: mean, and scatter of one",
                "not given",
                format!("{:.4} mm, {:.4} mm", 1e3 * range[0], 1e3 * range[1]),
                range[0].abs() < 0.05 * STEP_M,
            ),
            Check::claim(
                "change of azimuth within bursts, by all chirps together",
                "not done",
                format!("{:.4} mm, {:.4} mm", 1e3 * together[0], 1e3 * together[1]),
                (together[0] / STEP_M - 1.0).abs() < 0.05,
            ),
        ],
        why: None,
        pictures: vec![motion.picture(
            &format!("Bursts of {BURST} chirps, pauses of {PAUSE}"),
            8 * BURST + BURST / 2,
            &truth_m,
        )?],
    })
}

fn ramp(context: &Context) -> Result<Finding, ItemError> {
    let ramp_s = RAMP as f64 * PRI_S;
    let way = way(0.0, &[(ramp_s, SPEED_M_S / ramp_s)])?;
    let recorded = recorded(context, way, CHIRPS + 1, |_| true)?;
    let motion = Motion::of(&found(context.monitor, &recorded)?)?;
    let [pairs, together] =
        [&motion.by_pairs_m, &motion.together_m].map(|of| Line::through(&of[..RAMP]));
    let full = spread(motion.by_pairs_m[RAMP..].iter().map(|m| m.x));
    let rest = spread(
        motion
            .by_pairs_m
            .iter()
            .enumerate()
            .map(|(n, m)| m.x - step_m(n)),
    );
    let truth_m: Vec<f64> = (0..CHIRPS).map(step_m).collect();
    let slope_m = STEP_M / RAMP as f64;
    Ok(Finding {
        thesis: "\"When the stepper motor starts moving, it has an acceleration which is not noticeable by just looking at it, however, \
                 measurable using the MPGA\": the first 2000 changes of pose. No numbers are given."
            .to_owned(),
        method: format!(
            "Made again by simulation: the radar of Fig. 7.8 on a carriage that reaches {SPEED_M_S} m/s, a tenth of a millimetre a chirp of 1 ms, at \
             a constant acceleration within {RAMP} chirps; {CHIRPS} changes of pose by the thesis's two least squares. A straight line through those of \
             the ramp, and the mean of what follows."
        ),
        checks: vec![
            Check::claim(
                "the ramp's slope, where the motor's is 66.7 nm a chirp",
                "measurable",
                format!("{:.2} nm a chirp", 1e9 * pairs.slope_m),
                (pairs.slope_m / slope_m - 1.0).abs() < 0.05,
            ),
            Check::claim(
                "the change of azimuth that it starts at",
                "at rest",
                format!("{:.2} um", 1e6 * pairs.start_m),
                pairs.start_m.abs() < 0.03 * STEP_M,
            ),
            Check::claim(
                "the change of azimuth afterwards, where the motor's is 100 um",
                "steady",
                format!("{:.2} um", 1e6 * full[0]),
                (full[0] / STEP_M - 1.0).abs() < 0.05,
            ),
            Check::claim(
                "scatter of one change of azimuth",
                "not given",
                format!("{:.2} um", 1e6 * rest[1]),
                rest[1] < 0.5 * STEP_M,
            ),
            Check::claim(
                "the ramp's slope by all chirps together",
                "not done",
                format!("{:.2} nm a chirp", 1e9 * together.slope_m),
                (together.slope_m / slope_m - 1.0).abs() < 0.05,
            ),
        ],
        why: None,
        pictures: vec![motion.picture("The motor starts", CHIRPS, &truth_m)?],
    })
}

/// How far the carriage goes from chirp `n` to the next.
fn step_m(n: usize) -> f64 {
    // Half way between both.
    STEP_M * ((n as f64 + 0.5) / RAMP as f64).min(1.0)
}

/// A straight line through changes of azimuth, by least squares.
struct Line {
    slope_m: f64,
    /// At the first.
    start_m: f64,
}

impl Line {
    fn through(steps_m: &[DVec2]) -> Self {
        let count = steps_m.len() as f64;
        let middle = 0.5 * (count - 1.0);
        let mean = steps_m.iter().map(|m| m.x).sum::<f64>() / count;
        let each = || {
            steps_m
                .iter()
                .enumerate()
                .map(|(n, m)| (n as f64 - middle, m.x))
        };
        let products: f64 = each().map(|(n, x)| n * (x - mean)).sum();
        let slope_m = products / each().map(|(n, _)| n * n).sum::<f64>();
        Self {
            slope_m,
            start_m: mean - slope_m * middle,
        }
    }
}
