//! Near-field angles of arrival, and their effect on motion estimation: Chim 2018, 7.3.5, Figs 7.5 and 7.6.

use glam::DVec2;

use super::chim_rail::REFLECTORS_M;
use crate::{Check, Context, Finding, Item, ItemError, NOT_DONE, NOT_GIVEN, Picture};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_motion::{Array, Heading, Pairwise, Pose, Sighting, Target};
use subaperture_plot::{Chart, Curve, Stroke, lines};

pub(super) const ITEMS: [Item; 1] = [Item {
    id: "c-7-5",
    source: "Chim 2018, Figs 7.5 and 7.6",
    title: "Angles of arrival near by, estimated by a phase difference",
    work: 0.1,
    reproduce: near_by,
}];

const WAVELENGTH_M: f64 = SPEED_OF_LIGHT_M_S / 78.5e9;
/// Receiver baseline, metres.
const BASELINE_M: f64 = 0.5 * WAVELENGTH_M;
/// Transmitter offset from the first receiver along the array, metres (B_T of the thesis).
const TRANSMITTER_M: f64 = -0.02;
/// Sines of the angles drawn.
const SINES: [f64; 7] = [-0.95, -0.8, -0.35, 0.0, 0.35, 0.8, 0.95];
/// Distances of the error curves, baselines.
const DISTANCES: [f64; 3] = [1.0, 2.0, 5.0];
/// Target distance for a transmitter apart from the receivers, metres.
const RANGE_M: f64 = 2.0;
/// Largest angle evaluated, degrees.
const WIDEST_DEG: i32 = 60;
const STEP_M: f64 = 1e-3;

/// Two receivers about the origin; the transmitter does not affect their phase difference.
fn receivers() -> Array {
    Array {
        transmitters_m: vec![DVec2::ZERO],
        receivers_m: vec![
            DVec2::new(-0.5 * BASELINE_M, 0.0),
            DVec2::new(0.5 * BASELINE_M, 0.0),
        ],
        wavelength_m: WAVELENGTH_M,
    }
}

/// Radar of the thesis's experiments, with a separate transmitter.
fn radar() -> Array {
    Array {
        transmitters_m: vec![DVec2::new(TRANSMITTER_M, 0.0)],
        receivers_m: vec![DVec2::ZERO, DVec2::new(BASELINE_M, 0.0)],
        wavelength_m: WAVELENGTH_M,
    }
}

/// Position at a range and an angle from the array's normal.
fn place(range_m: f64, angle_rad: f64) -> DVec2 {
    range_m * DVec2::new(angle_rad.sin(), angle_rad.cos())
}

fn target(at_m: DVec2) -> Target {
    Target {
        at_m,
        ..Target::default()
    }
}

/// Sine of the estimated angle of arrival: phase difference over its value along the baseline, (7.18) and (7.13).
fn sine(at_m: DVec2) -> f64 {
    let array = receivers();
    let lines = array.lines(&Pose::default(), &target(at_m));
    (lines[1].value - lines[0].value) / (array.rad_m() * BASELINE_M)
}

/// True angle at a range for an estimated sine, by bisection.
fn true_angle_rad(range_m: f64, estimated: f64) -> f64 {
    let quarter = std::f64::consts::FRAC_PI_2;
    let (mut low, mut high) = (-quarter, quarter);
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        match sine(place(range_m, middle)) < estimated {
            true => low = middle,
            false => high = middle,
        }
    }
    0.5 * (low + high)
}

/// Estimated minus true angle, radians.
fn error_rad(range_m: f64, angle_rad: f64) -> f64 {
    sine(place(range_m, angle_rad)).clamp(-1.0, 1.0).asin() - angle_rad
}

fn angles_rad(widest_deg: i32) -> impl Iterator<Item = f64> {
    (-widest_deg..=widest_deg).map(|degrees| f64::from(degrees).to_radians())
}

/// Largest error over all angles at a distance in baselines, degrees.
fn largest_error_deg(baselines: f64) -> f64 {
    let all = angles_rad(90).map(|angle| error_rad(baselines * BASELINE_M, angle).abs());
    all.fold(0.0, f64::max).to_degrees()
}

/// Largest distance between lines of constant phase difference and hyperbolas `x^2 / a^2 - y^2 / b^2 = 1`, `a = B sin / 2`, `a^2 + b^2 = B^2 / 4`,
/// baselines.
fn off_hyperbolas() -> f64 {
    let off = |estimated: f64, baselines: f64| {
        let at = place(1.0, true_angle_rad(baselines * BASELINE_M, estimated)) * baselines;
        let a = 0.5 * estimated;
        let b2 = 0.25 - a * a;
        (at.x - a * (1.0 + at.y * at.y / b2).sqrt()).abs()
    };
    let sines = SINES.into_iter();
    let all =
        sines.flat_map(|estimated| (2..=40).map(move |i| off(estimated, 0.25 * f64::from(i))));
    all.fold(0.0, f64::max)
}

/// Largest errors of the factor of `2 dx` in the path change for three methods: coincident antennas; (7.33); direction from the
/// midpoint of transmitter and receiver.
fn factors_off() -> [f64; 3] {
    let array = radar();
    let mut most = [0.0f64; 3];
    for angle_rad in angles_rad(WIDEST_DEG) {
        let at_m = place(RANGE_M, angle_rad);
        // Phase of the first channel per metre along x.
        let of_phase = array.lines(&Pose::default(), &target(at_m))[0].pose.x;
        let exact = 0.5 * of_phase / array.rad_m();
        let from_middle = at_m - DVec2::new(0.5 * TRANSMITTER_M, 0.0);
        let factors = [
            angle_rad.sin(),
            angle_rad.sin() - TRANSMITTER_M / RANGE_M,
            from_middle.normalize().x,
        ];
        for (most, factor) in most.iter_mut().zip(factors) {
            *most = most.max((factor - exact).abs());
        }
    }
    most
}

/// Error of a noise-free step along the array estimated by the two least squares, metres.
fn step_off_m() -> Result<f64, ItemError> {
    let unsuited = |error: subaperture_motion::MotionError| ItemError::Measure(error.to_string());
    let array = radar();
    let mut pairwise = Pairwise::new(array.clone(), Heading::Estimated).map_err(unsuited)?;
    let mut off_m = f64::NAN;
    for x in [0.0, STEP_M] {
        let pose = Pose {
            at_m: DVec2::new(x, 0.0),
            heading_rad: 0.0,
        };
        let sighting = |(name, at_m): (usize, glam::DVec3)| {
            let lines = array.lines(&pose, &target(at_m.truncate()));
            Sighting {
                target: name,
                phases_rad: lines[..2].iter().map(|line| line.value).collect(),
                range_m: lines[2].value,
                range_sigma_m: 1e-3,
                phase_sigma_rad: 1e-3,
            }
        };
        let seen: Vec<Sighting> = REFLECTORS_M.into_iter().enumerate().map(sighting).collect();
        if let Some(moved) = pairwise.push(&seen).map_err(unsuited)? {
            off_m = (moved.increment.moved_m - DVec2::new(STEP_M, 0.0)).length();
        }
    }
    Ok(off_m)
}

fn near_by(_: &Context) -> Result<Finding, ItemError> {
    let hyperbolas = off_hyperbolas();
    let nearest_m = REFLECTORS_M[2].length();
    let in_room_rad = angles_rad(90)
        .map(|angle| error_rad(nearest_m, angle).abs())
        .fold(0.0, f64::max);
    let [plain, corrected, middle] = factors_off();
    let step_off_m = step_off_m()?;
    Ok(Finding {
        thesis: "\"The line of constant phase difference is given by a hyperbola\" (Fig. 7.5), so that the estimated angle of arrival is not \
                 the true one near by (7.6). The problem \"can be reduced\" by taking sin(theta) - B / Range for sin(theta) in the first least \
                 squares, (7.33). No numbers are given."
            .to_owned(),
        method: format!(
            "Phases from exact paths. Two receivers half a wavelength of 78.5 GHz apart, angles measured at their midpoint; lengths in baselines, so that the \
             pictures hold for any baseline. Then the radar of Fig. 7.8, whose transmitter is 2 cm from its receivers: the factor of 2 dx in the path change of a target at {RANGE_M} \
             m, up to {WIDEST_DEG} degrees off broadside; and a step of 1 mm estimated by two least squares, which measure directions at the midpoint of each channel's antennas \
             and correct each leg separately. Scale: the thesis's figures carry no numbers; the baseline is that of Fig. 7.8, without scaling."
        ),
        checks: vec![
            Check::claim(
                "distance of lines of constant phase difference from hyperbolas, baselines",
                "hyperbolas",
                format!("{hyperbolas:.1e}"),
                hyperbolas < 1e-6,
            ),
            Check::claim(
                "largest error of the angle at 1, 2 and 5 baselines",
                NOT_GIVEN,
                format!(
                    "{} degrees",
                    DISTANCES.map(|d| format!("{:.2}", largest_error_deg(d))).join(", ")
                ),
                largest_error_deg(5.0) < largest_error_deg(2.0),
            ),
            Check::claim(
                "of a target at 2.4 m, by receivers half a wavelength apart",
                NOT_GIVEN,
                format!("{in_room_rad:.1e} rad"),
                in_room_rad < 1e-6,
            ),
            Check::claim(
                "error of the factor of 2 dx, at most: as if all antennas were one",
                "an error near by",
                format!("{plain:.4}"),
                plain > 1e-3,
            ),
            Check::claim(
                "with B / Range taken off, (7.33)",
                "reduced",
                format!("{corrected:.4}"),
                corrected < plain,
            ),
            Check::claim(
                "by directions from the middle of both antennas",
                NOT_DONE,
                format!("{middle:.1e}"),
                middle < 1e-4,
            ),
            Check::claim(
                "error of a step of 1 mm by the two least squares here, without noise",
                NOT_GIVEN,
                format!("{:.1e} mm", 1e3 * step_off_m),
                step_off_m < 1e-4 * STEP_M,
            ),
        ],
        why: (corrected >= plain).then(|| {
            "Two legs make a path, and only that of the transmitter starts at B from the receiver: of 2 dx it is B / 2, across the direction. (7.33) takes B \
             off both, twice too much straight ahead and more aside. The error of the hyperbola, the subject of the figures, is negligible at this baseline."
                .to_owned()
        }),
        pictures: vec![hyperbola_picture()?, error_picture()?],
    })
}

/// Fig. 7.5.
fn hyperbola_picture() -> Result<Picture, ItemError> {
    const UP: f64 = 3.0;
    let gap = [(f64::NAN, f64::NAN)];
    let same_phase = |estimated: f64| {
        // From the line between the receivers on.
        let nearest = 0.5 * estimated.abs();
        let at = (0..=120).map(move |i| nearest + 4.0 * (f64::from(i) / 120.0).powi(2));
        let at = at.map(move |r| place(1.0, true_angle_rad(r * BASELINE_M, estimated)) * r);
        at.map(|at| (at.x, at.y)).chain(gap)
    };
    let same_angle = |estimated: f64| {
        let far = place(6.0, estimated.asin());
        [(0.0, 0.0), (far.x, far.y)].into_iter().chain(gap)
    };
    let png = lines(&Chart {
        title: "Where targets are that seem to arrive at one angle".to_owned(),
        across_label: "along the array (baselines)".to_owned(),
        up_label: "where it looks (baselines)".to_owned(),
        curves: vec![
            Curve {
                name: "one phase difference".to_owned(),
                points: SINES.into_iter().flat_map(same_phase).collect(),
                stroke: Stroke::Solid,
            },
            Curve {
                name: "one angle of arrival".to_owned(),
                points: SINES.into_iter().flat_map(same_angle).collect(),
                stroke: Stroke::Dashed,
            },
            Curve {
                name: "receivers".to_owned(),
                points: vec![(-0.5, 0.0), (0.5, 0.0)],
                stroke: Stroke::Dots,
            },
        ],
        across: Some((-0.5 * UP, 0.5 * UP)),
        up: Some((-0.15, UP - 0.15)),
        proportional: true,
        ..Chart::default()
    })?;
    Ok(Picture {
        name: "lines".to_owned(),
        caption: "Lines of constant phase difference and of constant angle (Fig. 7.5), sines of 0, 0.35, 0.8 and 0.95".to_owned(),
        png,
    })
}

/// Fig. 7.6.
fn error_picture() -> Result<Picture, ItemError> {
    let curve = |&baselines: &f64| Curve {
        name: match baselines {
            1.0 => "1 baseline away".to_owned(),
            more => format!("{more:.0} baselines away"),
        },
        points: angles_rad(90)
            .map(|angle| {
                let error = error_rad(baselines * BASELINE_M, angle);
                (angle.to_degrees(), error.to_degrees())
            })
            .collect(),
        stroke: Stroke::Solid,
    };
    let png = lines(&Chart {
        title: "Angles of arrival estimated by a phase difference".to_owned(),
        across_label: "true angle (deg)".to_owned(),
        up_label: "estimated less true (deg)".to_owned(),
        curves: DISTANCES.iter().map(curve).collect(),
        ..Chart::default()
    })?;
    Ok(Picture {
        name: "errors".to_owned(),
        caption: "Error of the estimated angle (Fig. 7.6)".to_owned(),
        png,
    })
}
