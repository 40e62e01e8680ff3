//! Expected values of the items of Chim 2018 on near-range autofocus and motion from echoes: chapters 6 and 7.

use std::f64::consts::{PI, TAU};

use crate::figures::{About, Expected, Figure, Within, at_most, figure};
use crate::sub_cpis::LIGHT_M_S;

/// Expected checks of an item.
pub(crate) fn figures(id: &str) -> Option<Vec<Figure>> {
    Some(match id {
        "c-6-6" => room(),
        "c-7-5" => arrival(),
        "c-7-8" => track(),
        "c-7-12" => bursts(),
        "c-7-13" => ramp(),
        _ => return None,
    })
}

fn room() -> Vec<Figure> {
    // 1.5 mm RMS along the rail and 0.4 mm across change phases by 2 k = 3200 rad/m times their projection on the line of sight, by 1.4 to
    // 3 rad RMS for reflectors 6 to 30 degrees off: the coherent part of a point falls by 3 dB and more.
    let blurred = Within(-20.0, -3.0);
    // 0.35 rad RMS costs 0.5 dB.
    let sharp = Within(-0.5, 0.3);
    vec![
        figure(
            "peaks before autofocus relative to the true track, dB",
            "blurred",
            "{}, {}, {}, {}",
            [blurred; 4],
            "phases of 1.4 rad rms and more",
        ),
        figure(
            "gain of the peaks by stock PGA, dB",
            "little, or even worse",
            "{}, {}, {}, {}",
            [Within(-20.0, 20.0); 4],
            "one phase for all suits no more than one direction",
        ),
        figure(
            "peaks after modified PGA relative to the true track, dB",
            "sharpened",
            "{}, {}, {}, {}",
            [sharp; 4],
            "a residual phase of a third of a radian",
        ),
        figure(
            "entropy before autofocus, by stock PGA, by modified PGA, on the true track",
            "the modified one's is the sharper",
            "{}, {}, {}, {}",
            // Entropy of four points with one pixel to three by three pixels each, ln 4 = 1.4 to ln 36 = 3.6, plus their side lobes; of a
            // constant image ln 38800 = 10.6.
            [
                Within(5.0, 9.0),
                Within(4.0, 8.0),
                Within(1.4, 4.5),
                Within(1.4, 4.5),
            ],
            "four points, of one cell each where they are sharp",
        ),
        figure(
            "peak at (0.6, 3) before autofocus and after 1, 2 and 3 rounds relative to the true track, dB",
            "converging",
            "{}, {}, {}, {}",
            // In between any value, but not above the true track's.
            [blurred, Within(-20.0, 0.3), Within(-20.0, 0.3), sharp],
            "as the peaks above",
        ),
        figure(
            "entropy after three rounds of modified PGA minus that after the last",
            "converged at around iteration 3",
            "{}",
            [Within(0.0, 0.02)],
            "the same image",
        ),
    ]
}

/// The radar of 77 to 80 GHz, whose receivers are half a wavelength apart.
const WAVELENGTH_M: f64 = LIGHT_M_S / 78.5e9;
/// Distance from the transmitter to the first receiver.
const APART_M: f64 = 0.02;
const REFLECTORS_M: [[f64; 2]; 4] = [[0.6, 3.0], [0.1, 4.0], [-0.9, 2.2], [1.6, 5.6]];
const SQUINT_DEG: f64 = 0.5;

/// Largest error of the angle of arrival from a phase difference at a distance of this many baselines, radians, by exact distances.
fn off_rad(baselines: f64) -> f64 {
    let angles = (-90..=90).map(|degrees: i32| f64::from(degrees).to_radians());
    let off = angles.map(|angle: f64| {
        let (x, y) = (baselines * angle.sin(), baselines * angle.cos());
        let apart = (x + 0.5).hypot(y) - (x - 0.5).hypot(y);
        (apart.clamp(-1.0, 1.0).asin() - angle).abs()
    });
    off.fold(0.0, f64::max)
}

fn arrival() -> Vec<Figure> {
    let share = APART_M / 2.0;
    let wide = 60f64.to_radians();
    vec![
        figure(
            "distance of lines of constant phase difference from hyperbolas, baselines",
            "hyperbolas",
            "{}",
            // Phases of a few radians, exact to 1e-15.
            [at_most(1e-10)],
            "a hyperbola has a constant difference of distances from two points",
        ),
        figure(
            "largest error of the angle at 1, 2 and 5 baselines",
            "not given",
            "{}, {}, {} degrees",
            [1.0, 2.0, 5.0].map(|baselines| About(off_rad(baselines).to_degrees(), 1e-6)),
            "plain distances",
        ),
        figure(
            "of a target at 2.4 m, by receivers half a wavelength apart",
            "not given",
            "{} rad",
            // B^2 / (8 r^2) sin(theta) cos(theta), largest at 45 degrees; phases of a thousand radians per metre are exact to 1e-12.
            [About(
                (0.5 * WAVELENGTH_M / 0.9f64.hypot(2.2)).powi(2) / 16.0,
                1e-10,
            )],
            "the difference of two roots to the third order",
        ),
        figure(
            "error of the factor of 2 dx, at most: as if all antennas were one",
            "an error near by",
            "{}",
            // Half of the legs, B / R cos^2: B / 2R straight ahead, to second order in B / R.
            [About(share / 2.0, 1e-4)],
            "the transmitter's own direction",
        ),
        figure(
            "with B / Range taken off, (7.33)",
            "reduced",
            "{}",
            [About(share - share / 2.0 * wide.cos().powi(2), 1e-4)],
            "B / R minus the value",
        ),
        figure(
            "by directions from the middle of both antennas",
            "not done",
            "{}",
            // Half of the second derivative of a sine along the array, 3 sin cos^2 / R^2 (maximum 2 / sqrt 27), times (B / 2)^2.
            [About(
                1.5 * (share / 2.0).powi(2) * 2.0 / 27f64.sqrt(),
                1e-6,
            )],
            "two directions about their middle",
        ),
        figure(
            "error of a step of 1 mm by the two least squares here, without noise",
            "not given",
            "{} mm",
            // Ranges are measured from the phase centre, which is wrong by (B / 2)^2 / 2R, a hundred-thousandth of the range; so are
            // directions and the step. The angles between reflectors increase this by a factor of three.
            [at_most(3.0 * 1e-5)],
            "residual of the phase-centre approximation",
        ),
    ]
}

/// Standard deviation of a phase: 30 dB over all samples, less 1.4 dB for the 50 dB Taylor window.
fn phase_rad() -> f64 {
    (0.5 / 10f64.powf(2.86)).sqrt()
}

/// Standard deviation of the sine of an angle of arrival: with two receivers half a wavelength apart phases differ by pi times the sine.
fn sine() -> f64 {
    2f64.sqrt() * phase_rad() / PI
}

/// Inverse of the sum of `u u^T` over the directions of the reflectors, seen from a position on the rail: variances of azimuth and range
/// for unit errors along `u`, and their covariance.
fn dilution(rail_m: f64) -> [f64; 3] {
    let [mut xx, mut yy, mut xy] = [0.0; 3];
    for [x, y] in REFLECTORS_M {
        let range_m = (x - rail_m).hypot(y);
        let (s, c) = ((x - rail_m) / range_m, y / range_m);
        xx += s * s;
        yy += c * c;
        xy += s * c;
    }
    let determinant = xx * yy - xy * xy;
    [yy / determinant, xx / determinant, -xy / determinant]
}

/// Standard deviations of a step along azimuth and range: two phases of each of two channels, for paths that change by twice the step.
fn step_sigma_m(rail_m: f64) -> [f64; 2] {
    let path_m = phase_rad() * WAVELENGTH_M / TAU;
    let [x, y, _] = dilution(rail_m);
    // The difference of two pulses has twice the variance, the mean of two channels half of it.
    [x, y].map(|variance| 0.5 * path_m * variance.sqrt())
}

/// Mean scale error and scatter per metre of azimuth, along azimuth and range, caused by direction errors.
fn by_directions_m(steps: usize) -> [(f64, f64); 2] {
    // At the middle of the rail.
    let [x, y, xy] = dilution(0.5);
    let step_m = 1.0 / steps as f64;
    // Directions are means of two pulses, of variance e^2 / 2, and each adds to the normal matrix along azimuth. Their errors enter two
    // steps each, so all together count as if every pulse's counted fully.
    let added = 4.0 * 0.5 * sine().powi(2);
    let all_m = step_m * sine() * (steps as f64).sqrt();
    [
        (-added * x, all_m * x.sqrt()),
        (-added * xy, all_m * y.sqrt()),
    ]
}

/// A value within three standard deviations, plus another tolerance.
fn within_three((mean, sigma): (f64, f64), scale: f64, more: f64) -> Expected {
    About(scale * mean, scale * 3.0 * sigma + more)
}

fn track() -> Vec<Figure> {
    let [azimuth, (bias_m, sigma_m)] = by_directions_m(1000);
    let drift_m = -0.999 * SQUINT_DEG.to_radians().sin();
    // Error of a random-walk track after removal of a straight line, which only shifts the image: a fifteenth of its variance at the end.
    // Half of the azimuth part counts for a reflector 30 degrees off. Three times that is allowed, in path and phase.
    let off_m = ((azimuth.1 * 0.5).powi(2) + sigma_m.powi(2)).sqrt() / 15f64.sqrt();
    let phases = (3.0 * 2.0 * TAU / WAVELENGTH_M * off_m).powi(2);
    let lost_db = 10.0 * phases / std::f64::consts::LN_10;
    vec![
        figure(
            "targets tracked within the range mask",
            "4 major traces",
            "{}",
            [About(4.0, 0.0)],
            "the reflectors, each of them all the time",
        ),
        figure(
            "sine of the angle of arrival per pulse: rms error",
            "not given",
            "{}",
            // 4000 values, and the loss of the window to a tenth.
            [About(sine(), 0.05 * sine())],
            "noise of phases",
        ),
        figure(
            "azimuth error at the end of the track",
            "about 2 mm",
            "{} mm",
            [within_three(azimuth, 1e3, 0.1)],
            "directions that err, in the middle of the rail",
        ),
        figure(
            "range at the end of the track",
            "a significant discrepancy, by squint",
            "{} mm",
            [within_three((drift_m + bias_m, sigma_m), 1e3, 0.1)],
            "a metre at half a degree, and directions that err",
        ),
        figure(
            "estimated squint, true value 0.5 degrees",
            "not given",
            "{} degrees",
            [About(
                SQUINT_DEG,
                (3.0 * sigma_m + bias_m.abs()).to_degrees(),
            )],
            "that of the range over a metre",
        ),
        figure(
            "largest error along the rail, joint estimate of poses and positions",
            "not done",
            "{} mm",
            // For a pose, 3.3 of the standard deviations of a thousand; and three of the scale, which has an error of 0.024 mm at 30 dB
            // (host/motion, C 7.5).
            [at_most(
                1e3 * 3.3 * step_sigma_m(0.5)[0] / 2f64.sqrt() + 3.0 * 0.024,
            )],
            "noise of a pose, and the bound of the scale",
        ),
        figure(
            "largest error of the reflector positions by the joint estimate",
            "not done",
            "{} mm",
            // Three times the error of a thousand pulses' angles at the farthest reflector.
            [at_most(1e3 * 3.0 * sine() / 1000f64.sqrt() * 5.8)],
            "angles of arrival",
        ),
        figure(
            "peaks on the MPGA track relative to the motor's, dB",
            "slightly off the optimal",
            "{}, {}, {}, {}",
            [Within(-lost_db, 0.1); 4],
            "phases of a random walk",
        ),
        figure(
            "peaks on the jointly estimated track relative to the motor's, dB",
            "not done",
            "{}, {}, {}, {}",
            // Phases of 0.05 rad.
            [About(0.0, 0.05); 4],
            "noise of a pose",
        ),
    ]
}

/// 40 bursts of 10 chirps with steps of a tenth of a millimetre, and pauses of 3.
fn bursts() -> Vec<Figure> {
    let [azimuth_m, range_m] = step_sigma_m(0.02).map(|m| 1e3 * m);
    let squint = SQUINT_DEG.to_radians();
    // Noise of a pose enters two steps with opposite signs, so the mean of the nine steps of a burst contains that of two poses; a
    // hundredth is added for errors of directions.
    let burst_mm = 0.1 * squint.cos();
    let within = About(burst_mm, 3.0 * azimuth_m / 9.0 / 40f64.sqrt() + 0.01 * 0.1);
    let over = About(4.0 * burst_mm, 3.0 * azimuth_m / 39f64.sqrt() + 0.01 * 0.4);
    // 360 steps within bursts and 39 over pauses.
    let mean_mm = 0.1 * (360.0 + 4.0 * 39.0) / 399.0;
    // Mean squares of 360 and of 39 values have errors of a twenty-seventh and a ninth, three times which are allowed; and a twentieth for
    // the loss of the window.
    let scatter = |sigma: f64, share: f64| About(sigma, (0.05 + 3.0 * share) * sigma);
    vec![
        figure(
            "change of azimuth within bursts: mean and standard deviation",
            "constant",
            "{} mm, {} mm",
            [within, scatter(azimuth_m, 1.0 / 27.0)],
            "the motor, and noise of phases",
        ),
        figure(
            "change of azimuth over pauses: mean and standard deviation",
            "longer",
            "{} mm, {} mm",
            [over, scatter(azimuth_m, 1.0 / 9.0)],
            "three chirps left out, and noise of phases",
        ),
        figure(
            "ratio of both, for a pause of 3 chirps",
            "4",
            "{}",
            [About(
                4.0,
                4.0 * (3.0 * azimuth_m / 39f64.sqrt() / 0.4 + 0.02),
            )],
            "four steps to one",
        ),
        figure(
            "ratio of the shortest pause to the longest step in a burst",
            "pauses stand out",
            "{}",
            // Four standard deviations for each of the two.
            [Within(
                (0.4 - 4.0 * azimuth_m) / (0.1 + 4.0 * azimuth_m),
                4.0,
            )],
            "noise of phases",
        ),
        figure(
            "change of range: mean and standard deviation",
            "not given",
            "{} mm, {} mm",
            [
                // A hundredth of the step for errors of directions, over 399 steps.
                About(
                    -mean_mm * squint.sin(),
                    3.0 * (range_m / 399.0 + mean_mm * sine() / 399f64.sqrt()),
                ),
                scatter(range_m, 1.0 / 27.0),
            ],
            "the squint, and noise of phases",
        ),
        figure(
            "change of azimuth within bursts, joint estimate of all chirps",
            "not done",
            "{} mm, {} mm",
            [
                About(0.1, 3.0 * azimuth_m / 9.0 / 40f64.sqrt() + 0.01 * 0.1),
                // Positions are more accurate than from one pulse; phases are not.
                scatter(azimuth_m, 1.0 / 27.0),
            ],
            "the motor, and noise of phases",
        ),
    ]
}

/// 1500 chirps from rest to a tenth of a millimetre per chirp, and 500 more.
fn ramp() -> Vec<Figure> {
    // From 0 to 125 mm along the rail.
    let [azimuth_m, _] = step_sigma_m(0.06);
    // At most as if errors of steps were independent; and a hundredth for errors of directions.
    let slope_m = azimuth_m * (12.0 / 1500f64.powi(3)).sqrt();
    let (motor_m, cosine) = (1e-4 / 1500.0, SQUINT_DEG.to_radians().cos());
    vec![
        figure(
            "slope of the ramp; the motor's is 66.7 nm per chirp",
            "measurable",
            "{} nm a chirp",
            [within_three((motor_m * cosine, slope_m), 1e9, 0.01 * 66.7)],
            "a tenth of a millimetre in 1500 chirps",
        ),
        figure(
            "change of azimuth at the start",
            "at rest",
            "{} um",
            [within_three(
                (0.0, 2.0 * azimuth_m / 1500f64.sqrt()),
                1e6,
                0.0,
            )],
            "the end of a line",
        ),
        figure(
            "change of azimuth after the ramp; the motor's is 100 um",
            "steady",
            "{} um",
            [within_three(
                (1e-4 * cosine, azimuth_m / 500f64.sqrt()),
                1e6,
                1.0,
            )],
            "the motor",
        ),
        figure(
            "standard deviation of a change of azimuth",
            "not given",
            "{} um",
            // 2000 values, and the loss of the window to a tenth.
            [About(1e6 * azimuth_m, 0.1 * 1e6 * azimuth_m)],
            "noise of phases",
        ),
        figure(
            "slope of the ramp, joint estimate of all chirps",
            "not done",
            "{} nm a chirp",
            [within_three((motor_m, slope_m), 1e9, 0.01 * 66.7)],
            "a tenth of a millimetre in 1500 chirps",
        ),
    ]
}
