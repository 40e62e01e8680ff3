//! Expected values of the item on the fusion of MPGA with navigation, Chim 2018, 7.6 and 8.2.
//!
//! Errors of GNSS alone follow from the natural spline through its fixes, a linear function of true positions and independent noise. The fusion
//! with the echoes has the known shape of the track, and errors of three parameters: two of position and the heading, by least squares.

use std::f64::consts::{PI, TAU};

use num_complex::Complex64;
use subaperture::glam::{DVec2, DVec3};
use subaperture::simulate::Experiment;
use subaperture::simulate::scenario::{Scenario, examples};

use crate::figures::{About, Figure, Within, at_least, at_most, figure};
use crate::sub_cpis::{LIGHT_M_S, decibels, sinc};

const CENTRE_HZ: f64 = 1.4e9;
const BANDWIDTH_HZ: f64 = 604e6;
const PULSES: usize = 400;
const OUTAGE_S: [f64; 2] = [3.0, 7.5];
/// Standard deviations of positions, metres, and of the acceleration error in the outage, m/s^2.
const GNSS_M: f64 = 15e-3;
const INS_M: f64 = 8e-3;
const DRIFT_M_S2: f64 = 8e-3;
/// Middle of transmitter and receivers in the body, metres.
const MIDDLE_M: f64 = 0.5 * 0.5 * (0.2 + 0.307);
/// RMS error of a pose by the echoes, metres: phases have a noise of -15 dB against unit echoes, less the gain of 151 frequencies and 2 dB for the
/// window, 34.8 dB. An echo then has a range error of 0.22 mm. Two channels and three targets or more determine two coordinates, with a dilution of at
/// most 2 in azimuth.
const ECHOES_M: f64 = 0.22e-3 * 2.236;

/// Expected checks of an item.
pub(crate) fn figures(id: &str) -> Option<Vec<Figure>> {
    (id == "c-8-2").then(fusion)
}

fn lost(time_s: f64) -> bool {
    (OUTAGE_S[0]..=OUTAGE_S[1]).contains(&time_s)
}

fn times_s() -> impl Iterator<Item = f64> {
    (0..PULSES).map(|n| n as f64 * 25e-3)
}

/// Times of a log's records without those in the outage, from -1 s to 1 s after the last pulse.
fn fixes_s(rate_hz: f64) -> Vec<f64> {
    let last = ((9.975 + 1.0) * rate_hz).ceil() as i32;
    let all = (-(rate_hz as i32)..=last).map(|n| f64::from(n) / rate_hz);
    all.filter(|time_s| !lost(*time_s)).collect()
}

/// Natural cubic spline through values at times, by Gaussian elimination of the tridiagonal system of second derivatives.
struct NaturalSpline<'a> {
    times: &'a [f64],
    values: Vec<f64>,
    second: Vec<f64>,
}

impl<'a> NaturalSpline<'a> {
    fn new(times: &'a [f64], values: Vec<f64>) -> Self {
        let count = times.len();
        let step = |n: usize| times[n + 1] - times[n];
        let mut diagonal = vec![1.0; count];
        let mut right = vec![0.0; count];
        for n in 1..count - 1 {
            let slope = |k: usize| (values[k + 1] - values[k]) / step(k);
            diagonal[n] = 2.0 * (step(n - 1) + step(n));
            right[n] = 6.0 * (slope(n) - slope(n - 1));
            if n > 1 {
                let share = step(n - 1) / diagonal[n - 1];
                diagonal[n] -= share * step(n - 1);
                right[n] -= share * right[n - 1];
            }
        }
        let mut second = vec![0.0; count];
        for n in (1..count - 1).rev() {
            second[n] = (right[n] - step(n) * second[n + 1]) / diagonal[n];
        }
        Self {
            times,
            values,
            second,
        }
    }

    fn at(&self, time: f64) -> f64 {
        let n = self.times.partition_point(|t| *t <= time);
        let n = n.clamp(1, self.times.len() - 1) - 1;
        let step = self.times[n + 1] - self.times[n];
        let b = (time - self.times[n]) / step;
        let a = 1.0 - b;
        let bend = |u: f64, second: f64| (u * u * u - u) * second * step * step / 6.0;
        a * self.values[n]
            + b * self.values[n + 1]
            + bend(a, self.second[n])
            + bend(b, self.second[n + 1])
    }
}

/// Mean square over the pulses outside of the outage and in it.
fn split(square: impl Fn(f64) -> f64) -> [f64; 2] {
    [false, true].map(|inside| {
        let all: Vec<f64> = times_s()
            .filter(|t| lost(*t) == inside)
            .map(&square)
            .collect();
        all.iter().sum::<f64>() / all.len() as f64
    })
}

struct Walk(Experiment);

impl Walk {
    fn new() -> Self {
        let text = examples::text("fusion").unwrap();
        Self(
            Scenario::new("fusion.toml", text, ".")
                .experiment()
                .unwrap(),
        )
    }

    fn middle_m(&self, time_s: f64) -> DVec2 {
        let pose = self.0.track.pose(time_s);
        (pose.position_m + pose.attitude * (DVec3::X * MIDDLE_M)).truncate()
    }

    /// Mean square errors of the spline through the fixes of GNSS, square metres.
    fn gnss_m2(&self) -> [f64; 2] {
        // The item undoes the lever arm at the constant heading of the first pulse, as a receiver alone has none.
        let fixes_s = fixes_s(5.0);
        let axis = |pick: fn(DVec2) -> f64| {
            let at = |t: &f64| {
                let pose = self.0.track.pose(*t);
                let first = self.0.track.pose(0.0).attitude;
                let arm_m = DVec3::new(-0.2, 0.0, 0.3);
                pick(self.middle_m(*t) + (pose.attitude * arm_m - first * arm_m).truncate())
            };
            NaturalSpline::new(&fixes_s, fixes_s.iter().map(at).collect())
        };
        let [x, y] = [axis(|v| v.x), axis(|v| v.y)];
        let unit = |k: usize| {
            let values = (0..fixes_s.len()).map(|n| f64::from(u8::from(n == k)));
            NaturalSpline::new(&fixes_s, values.collect())
        };
        let units: Vec<NaturalSpline> = (0..fixes_s.len()).map(unit).collect();
        split(|t| {
            let bend = DVec2::new(x.at(t), y.at(t)) - self.middle_m(t);
            let noise: f64 = units.iter().map(|unit| unit.at(t).powi(2)).sum();
            bend.length_squared() + 2.0 * GNSS_M * GNSS_M * noise
        })
    }

    /// Mean square errors of a track of known shape fitted to the fixes of GNSS by shift and rotation, square metres.
    fn fitted_m2(&self) -> [f64; 2] {
        let fixes: Vec<DVec2> = fixes_s(5.0).iter().map(|t| self.middle_m(*t)).collect();
        let count = fixes.len() as f64;
        let mean = fixes.iter().sum::<DVec2>() / count;
        let spread: f64 = fixes.iter().map(|p| p.distance_squared(mean)).sum();
        split(|t| {
            let lever = self.middle_m(t).distance_squared(mean);
            GNSS_M * GNSS_M * (2.0 / count + lever / spread)
        })
    }

    /// Level of the weakest reflector on the spline through noiseless fixes, relative to the true track, dB.
    fn gnss_db(&self) -> f64 {
        let fixes_s = fixes_s(5.0);
        let axis = |pick: fn(DVec2) -> f64| {
            let values = fixes_s.iter().map(|t| pick(self.middle_m(*t)));
            NaturalSpline::new(&fixes_s, values.collect())
        };
        let [x, y] = [axis(|v| v.x), axis(|v| v.y)];
        let level = |place: DVec2| {
            let steps = (-5..=5).flat_map(|i| (-5..=5).map(move |j| (i, j)));
            let sums = steps.map(|(i, j)| {
                let pixel = place + DVec2::new(f64::from(i), f64::from(j)) * 0.04;
                let terms = times_s().map(|t| {
                    let on_spline = DVec2::new(x.at(t), y.at(t));
                    let off_m =
                        2.0 * (on_spline.distance(pixel) - self.middle_m(t).distance(place));
                    let phase = TAU * CENTRE_HZ * off_m / LIGHT_M_S;
                    Complex64::cis(phase) * sinc(BANDWIDTH_HZ * off_m / LIGHT_M_S)
                });
                terms.sum::<Complex64>().norm() / PULSES as f64
            });
            sums.fold(0.0, f64::max)
        };
        let points = self.0.scene.points.iter();
        let levels = points.map(|point| decibels(level(point.position_m.truncate())));
        levels.fold(f64::INFINITY, f64::min)
    }
}

const ERRORS: &str = "{} mm, {} mm, fitted {} mm, {} mm";

fn fusion() -> Vec<Figure> {
    let walk = Walk::new();
    let wavelength_m = LIGHT_M_S / CENTRE_HZ;
    let mm = |square: f64| 1e3 * square.sqrt();
    let [gnss_out_m2, gnss_in_m2] = walk.gnss_m2();
    // Fitting reduces the sum of squares over all pulses, 181 of them in the outage.
    let whole = |[outside, inside]: [f64; 2]| (219.0 * outside + 181.0 * inside) / 400.0;
    let within_whole = |squares: [f64; 2], most: f64| {
        let all = most * most * 400.0 * whole(squares);
        [at_most(mm(all / 219.0)), at_most(mm(all / 181.0))]
    };
    // 96 fixes' numbers in 8 collections outside of the outage. Half of them are independent of the spline's bends: 3 / sqrt(2 * 384). In the outage the
    // slopes at both ends count, four numbers in each collection: 3 / sqrt(2 * 32).
    let of_gnss = [
        About(mm(gnss_out_m2), 0.11 * mm(gnss_out_m2)),
        About(mm(gnss_in_m2), 0.375 * mm(gnss_in_m2)),
    ];
    // Every other pulse is at a record, and the mean over the others is a half to four fifths of the variance, by the spline. The drift is Gaussian with two
    // numbers in each collection: 99.7 % of chi-square with 16 degrees of freedom is within 0.56 and 1.51 of its root.
    let noise_m2 = 2.0 * INS_M * INS_M;
    let [_, drift_m2] = split(|t| {
        let age = if lost(t) { t - OUTAGE_S[0] } else { 0.0 };
        2.0 * (0.5 * DRIFT_M_S2 * age * age).powi(2)
    });
    let ins_out = Within(mm(0.7 * noise_m2), mm(noise_m2) * 1.1);
    let ins_in = Within(
        mm(0.56f64.powi(2) * drift_m2),
        mm(1.51f64.powi(2) * drift_m2 + noise_m2),
    );
    // Three parameters in 8 collections: chi-square with 24 degrees of freedom. The echoes' errors and those of the scale are added.
    let fitted_m2 = walk.fitted_m2();
    let shape_m = 3.0 * ECHOES_M;
    let fused =
        fitted_m2.map(|m2| Within(mm(m2) * 0.6, mm(1.42f64.powi(2) * m2 + shape_m * shape_m)));
    let focused = at_most(1e3 * wavelength_m / 64.0);
    let share = |low: f64| [Within(100.0 * low, 100.0)];
    // A share of 95 % among 16 independent errors has a standard deviation of 5.45 %.
    let least = 0.95 - 3.0 * 0.0545;
    let ratio = Within(0.56, 1.51);
    let level = |db| [db];
    // Lengths of phase errors of independent noise.
    let phase_rad = 2.0 * TAU * CENTRE_HZ / LIGHT_M_S * INS_M;
    let ins_db = decibels((-0.7 * phase_rad * phase_rad / 2.0).exp());
    let ellipse = "the stated covariance";
    let image = "phases of the track's errors";
    let predicted = fitted_m2[1];
    let phases = phase_shape_db();
    vec![
        figure(
            "GNSS: RMS error outside of the outage and in it",
            "hardly reliable near the ground",
            ERRORS,
            [
                of_gnss.as_slice(),
                &within_whole([gnss_out_m2, gnss_in_m2], 1.375),
            ]
            .concat(),
            "a spline through noisy fixes",
        ),
        figure(
            "GNSS: errors within the stated ellipse of 95 %",
            "not done",
            "{} %",
            // At fixes the stated ones hold; at the edges of the outage, a twelfth of the pulses, the spline is worse.
            share(least),
            ellipse,
        ),
        figure(
            "GNSS: weakest reflector relative to the image on the true track",
            "not done",
            "{} dB",
            // Less than without noise, by as much as the noise blurs pulses of the outage: they are 181 of 400.
            level(Within(decibels(219.0 / 400.0) - 20.0, walk.gnss_db() + 3.0)),
            image,
        ),
        figure(
            "GNSS + INS: RMS error outside of the outage and in it",
            "hardly reliable near the ground",
            ERRORS,
            [
                [ins_out, ins_in].as_slice(),
                &within_whole([noise_m2, drift_m2 + noise_m2], 1.51),
            ]
            .concat(),
            "noise, and a constant acceleration error",
        ),
        figure(
            "GNSS + INS: errors within the stated ellipse of 95 %",
            "not done",
            "{} %",
            share(least),
            ellipse,
        ),
        figure(
            "GNSS + INS: predicted RMS error in the outage, and error over it",
            "not done",
            "{} mm, {}",
            // The nearest record may be 25 ms off.
            [
                About(mm(drift_m2 + noise_m2), 0.02 * mm(drift_m2 + noise_m2)),
                ratio,
            ],
            "the closed form of the drift",
        ),
        figure(
            "GNSS + INS: weakest reflector relative to the image on the true track",
            "not done",
            "{} dB",
            level(Within(decibels(219.0 / 400.0) - 20.0, ins_db + 0.3)),
            image,
        ),
        figure(
            "MPGA: RMS error outside of the outage and in it",
            "good enough to focus, no absolute position",
            ERRORS,
            // The recorded positions drift by 8 cm in both axes; the mean over 10 s of a drift of 1 s remains.
            [
                Within(3.0 * mm(ECHOES_M * ECHOES_M), 3.0 * 80.0 * 2f64.sqrt()),
                Within(3.0 * mm(ECHOES_M * ECHOES_M), 3.0 * 80.0 * 2f64.sqrt()),
                at_most(1e3 * shape_m),
                at_most(1e3 * shape_m),
            ],
            "phases of the echoes, and drift of the recorded positions",
        ),
        figure(
            "MPGA: errors within the stated ellipse of 95 %",
            "not done",
            "{} %",
            share(least),
            ellipse,
        ),
        figure(
            "MPGA: predicted RMS error in the outage, and error over it",
            "not done",
            "{} mm, {}",
            [at_most(1e3 * shape_m), ratio],
            "phases of the echoes",
        ),
        figure(
            "MPGA: weakest reflector relative to the image on the true track",
            "most target features are focused",
            "{} dB",
            level(Within(phases, 0.1)),
            image,
        ),
        figure(
            "MPGA + GNSS: RMS error outside of the outage and in it",
            "suggested",
            ERRORS,
            [fused[0], fused[1], focused, focused],
            "shift and rotation by the fixes of GNSS",
        ),
        figure(
            "MPGA + GNSS: errors within the stated ellipse of 95 %",
            "not done",
            "{} %",
            share(least),
            ellipse,
        ),
        figure(
            "MPGA + GNSS: predicted RMS error in the outage, and error over it",
            "not done",
            "{} mm, {}",
            // Increments taken as independent bend the track: the prediction may be larger than of a known shape.
            [Within(mm(predicted), 2.0 * mm(predicted)), ratio],
            "shift and rotation by the fixes of GNSS",
        ),
        figure(
            "MPGA + GNSS: weakest reflector relative to the image on the true track",
            "not done",
            "{} dB",
            level(Within(phases, 0.1)),
            image,
        ),
        figure(
            "MPGA + GNSS + INS: RMS error outside of the outage and in it",
            "suggested",
            ERRORS,
            [fused[0], fused[1], focused, focused],
            "shift and rotation by the fixes of GNSS",
        ),
        figure(
            "MPGA + GNSS + INS: errors within the stated ellipse of 95 %",
            "not done",
            "{} %",
            share(least),
            ellipse,
        ),
        figure(
            "MPGA + GNSS + INS: predicted RMS error in the outage, and error over it",
            "not done",
            "{} mm, {}",
            [Within(0.8 * mm(predicted), 2.0 * mm(predicted)), ratio],
            "shift and rotation by the fixes of GNSS",
        ),
        figure(
            "MPGA + GNSS + INS: weakest reflector relative to the image on the true track",
            "not done",
            "{} dB",
            level(Within(phases, 0.1)),
            image,
        ),
        figure(
            "movers found, least of all collections",
            "can be identified",
            "{} of {}",
            [at_least(2.0), About(2.0, 0.0)],
            "the scenario",
        ),
        figure(
            "MPGA: RMS difference from the track without movers in the scene",
            "assumes that all targets are stationary",
            "{} mm",
            // Two tracks with errors of phases; movers cover echoes.
            [at_most(1e3 * shape_m * 2f64.sqrt())],
            "phases of the echoes",
        ),
    ]
}

/// Loss by the phases of poses with errors of a 64th of a wavelength, dB.
fn phase_shape_db() -> f64 {
    let phase_rad: f64 = 4.0 * PI / 64.0 / 2f64.sqrt();
    decibels((-phase_rad * phase_rad / 2.0).exp())
}
