//! Motion between chirps by MPGA: Chim 2018, 7.5.2, Figs 7.12 and 7.13.

use glam::DVec2;

use super::chim_rail::{PRI_S, SQUINT_DEG, carriage, found, increments, recorded, spread};
use crate::{Check, Context, Finding, Item, ItemError, NOT_DONE, NOT_GIVEN, Picture};
use subaperture_motion::targets::Recovered;
use subaperture_plot::{Chart, Curve, Stroke, stacked};

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

/// Speed of the motor, metres per second; a tenth of a millimetre per chirp.
const SPEED_M_S: f64 = 0.1;
const STEP_M: f64 = SPEED_M_S * PRI_S;
/// Chirps per burst, and duration of the pause, chirps.
const BURST: usize = 10;
const PAUSE: usize = 3;
const BURSTS: usize = 40;
/// Chirps until full speed, and chirps shown.
const RAMP: usize = 1500;
const CHIRPS: usize = 2000;

/// Motion between chirps along the array and its normal: by pairs as in the thesis, and from the joint estimate of all chirps.
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

    /// Figure of the thesis (range above azimuth) with the true motion.
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

/// Motion between chirps, millimetres.
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
    let recorded = recorded(context, carriage(SPEED_M_S, &[])?, BURSTS * period, |n| {
        n % period < BURST
    })?;
    let motion = Motion::of(&found(context.monitor, &recorded)?)?;
    let (pause, burst): (Vec<_>, Vec<_>) =
        (0..motion.by_pairs_m.len()).partition(|n| n % BURST == BURST - 1);
    let at = |all: &[usize], of: &[DVec2]| all.iter().map(|&n| of[n].x).collect::<Vec<f64>>();
    let statistics = |of: &[DVec2]| {
        let [burst_m, pause_m] = [at(&burst, of), at(&pause, of)];
        let [within, over] = [&burst_m, &pause_m].map(|all| spread(all.iter().copied()));
        let most_m = burst_m.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let least_m = pause_m.iter().copied().fold(f64::INFINITY, f64::min);
        (within, over, least_m / most_m)
    };
    let (within, over, apart) = statistics(&motion.by_pairs_m);
    let (together, _, _) = statistics(&motion.together_m);
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
            "PointTargetHistory, because the thesis's recording is not public: the radar of Fig. 7.8, {BURSTS} bursts of {BURST} \
             chirps of 1 ms at {SPEED_M_S} m/s, 30 dB per reflector. The chirps of the pauses are removed from a continuous \
             recording. Motion from chirp to chirp by the thesis's two least squares, along the array's axes, heading \
             estimated too. Scale: the pause is the thesis's 3 chirps; the thesis gives no burst length, burst count or speed."
        ),
        checks: vec![
            Check::claim(
                "change of azimuth within bursts: mean and standard deviation",
                "constant",
                format!("{:.4} mm, {:.4} mm", 1e3 * within[0], 1e3 * within[1]),
                (within[0] / STEP_M - 1.0).abs() < 0.05,
            ),
            Check::claim(
                "change of azimuth over pauses: mean and standard deviation",
                "longer",
                format!("{:.4} mm, {:.4} mm", 1e3 * over[0], 1e3 * over[1]),
                over[0] > within[0],
            ),
            Check::claim(
                "ratio of both, for a pause of 3 chirps",
                &format!("{missing:.0}"),
                format!("{:.2}", over[0] / within[0]),
                (over[0] / within[0] / missing - 1.0).abs() < 0.05,
            ),
            Check::claim(
                "ratio of the shortest pause to the longest step in a burst",
                "pauses stand out",
                format!("{apart:.2}"),
                apart > 1.5,
            ),
            Check::claim(
                "change of range: mean and standard deviation",
                NOT_GIVEN,
                format!("{:.4} mm, {:.4} mm", 1e3 * range[0], 1e3 * range[1]),
                range[0].abs() < 0.05 * STEP_M,
            ),
            Check::claim(
                "change of azimuth within bursts, joint estimate of all chirps",
                NOT_DONE,
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
    let profile = carriage(0.0, &[(ramp_s, SPEED_M_S / ramp_s)])?;
    let recorded = recorded(context, profile, CHIRPS + 1, |_| true)?;
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
            "PointTargetHistory, because the thesis's recording is not public: the radar of Fig. 7.8 on a carriage that reaches {SPEED_M_S} m/s, a tenth of a \
             millimetre per chirp of 1 ms, at constant acceleration within {RAMP} chirps; {CHIRPS} changes of pose by the thesis's two least squares. A \
             straight line is fitted to the ramp, and the changes after it are averaged. Scale: {CHIRPS} changes as in the thesis, which gives neither \
             speed nor acceleration."
        ),
        checks: vec![
            Check::claim(
                "slope of the ramp; the motor's is 66.7 nm per chirp",
                "measurable",
                format!("{:.2} nm a chirp", 1e9 * pairs.slope_m),
                (pairs.slope_m / slope_m - 1.0).abs() < 0.05,
            ),
            Check::claim(
                "change of azimuth at the start",
                "at rest",
                format!("{:.2} um", 1e6 * pairs.start_m),
                pairs.start_m.abs() < 0.03 * STEP_M,
            ),
            Check::claim(
                "change of azimuth after the ramp; the motor's is 100 um",
                "steady",
                format!("{:.2} um", 1e6 * full[0]),
                (full[0] / STEP_M - 1.0).abs() < 0.05,
            ),
            Check::claim(
                "standard deviation of a change of azimuth",
                NOT_GIVEN,
                format!("{:.2} um", 1e6 * rest[1]),
                rest[1] < 0.5 * STEP_M,
            ),
            Check::claim(
                "slope of the ramp, joint estimate of all chirps",
                NOT_DONE,
                format!("{:.2} nm a chirp", 1e9 * together.slope_m),
                (together.slope_m / slope_m - 1.0).abs() < 0.05,
            ),
        ],
        why: None,
        pictures: vec![motion.picture("The motor starts", CHIRPS, &truth_m)?],
    })
}

/// True motion from chirp `n` to the next, metres.
fn step_m(n: usize) -> f64 {
    // Midpoint of both.
    STEP_M * ((n as f64 + 0.5) / RAMP as f64).min(1.0)
}

/// Least-squares line through changes of azimuth.
struct Line {
    slope_m: f64,
    /// Value at the first chirp.
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
