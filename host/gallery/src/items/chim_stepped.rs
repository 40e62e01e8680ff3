//! Stepped-frequency radar: Chim 2018, 5.6 and Fig. 5.13.

use std::f64::consts::PI;

use glam::DVec3;
use num_complex::{Complex32, Complex64};

use super::chim_radar::standing;
use super::chim_strip::{band, profiles, ridge};
use crate::{Check, Context, Finding, Item, ItemError, Picture};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::Axis;
use subaperture_model::phase_history::{Band, PhaseHistory};
use subaperture_model::radar::{LinkBudget, Pattern, Reference, ThermalNoise, Waveform};
use subaperture_plot::{Chart, Curve, Stroke, lines};
use subaperture_radio::profile::{PointScatterer, ProfileError, Sweep};
use subaperture_signal::phase::phasor;
use subaperture_signal::window::Window;
use subaperture_simulate::engine::Method;
use subaperture_simulate::receiver::thermal::snr_db;
use subaperture_simulate::scene::{Corner, Scene};
use subaperture_simulate::{Experiment, Pair, Scatterer};

pub(super) const ITEMS: [Item; 1] = [Item {
    id: "c-5-13",
    source: "Chim 2018, 5.6 and Fig. 5.13",
    title: "A range profile by stepped carriers",
    work: 0.28,
    reproduce: profile,
}];

/// Ranges from the radar at `(0, -6.3, 0)` to near wall, corner reflector and far wall, metres.
pub(super) const RANGES_M: [f64; 3] = [1.0, 6.3, 16.0];

/// Precision of the laser range finder that verified them, metres.
pub(super) const LASER_M: f64 = 0.01;

/// These ranges as printed in the thesis.
pub(super) const PRINTED_M: [&str; 3] = ["1", "6.3", "16"];
const WAVELENGTH_M: f64 = SPEED_OF_LIGHT_M_S / 1.2e9;
/// Reflection coefficient of a wall of relative permittivity 5, `(sqrt 5 - 1) / (sqrt 5 + 1)`.
const REFLECTED: f64 = 0.38;
/// Spacing of wall points, metres, below half a wavelength.
const POINT_M: f64 = 0.1;
const LINK: LinkBudget = LinkBudget {
    power_w: 4.0,
    transmit_gain_dbi: 9.0,
    receive_gain_dbi: 9.0,
    losses_db: 0.0,
    noise_figure_db: 1.604,
    temperature_k: 290.0,
};
const DWELL_S: f64 = 200e-6;

/// Smooth wall facing the radar, by physical optics: every point has the amplitude `2 sqrt(pi) area
/// cos / lambda` of its cell, with the phase of -90 degrees of the integral.
fn wall(centre_m: DVec3, radar_m: DVec3, half_m: [f64; 2]) -> Vec<Scatterer> {
    let facing = (radar_m - centre_m).normalize();
    let across = DVec3::Z.cross(facing).normalize();
    let up = facing.cross(across);
    let steps = half_m.map(|half| (half / POINT_M).round() as i32);
    let mut points = Vec::new();
    for i in -steps[0]..=steps[0] {
        for k in -steps[1]..=steps[1] {
            let position_m =
                centre_m + across * (f64::from(i) * POINT_M) + up * (f64::from(k) * POINT_M);
            let cosine = (radar_m - position_m).normalize().dot(facing);
            let size = REFLECTED * 2.0 * PI.sqrt() * POINT_M * POINT_M * cosine / WAVELENGTH_M;
            points.push(Scatterer {
                position_m,
                amplitude: Complex64::new(0.0, -size),
            });
        }
    }
    points
}

/// Test scene; without `walls` the corner reflector alone.
pub(super) fn experiment(walls: bool) -> Experiment {
    let radar_m = DVec3::new(0.0, -RANGES_M[1], 0.0);
    let beam = Pattern::Gaussian {
        azimuth_rad: PI / 3.0,
        elevation_rad: PI / 3.0,
    };
    // Small part of the near wall, 40 degrees off boresight.
    let aside = 40f64.to_radians();
    let near_m = radar_m + DVec3::new(-aside.sin(), aside.cos(), 0.0) * RANGES_M[0];
    let far_m = radar_m + DVec3::Y * RANGES_M[2];
    let scene = Scene {
        points: match walls {
            true => [
                wall(near_m, radar_m, [0.2, 0.2]),
                wall(far_m, radar_m, [6.0, 2.0]),
            ]
            .concat(),
            false => Vec::new(),
        },
        corners: vec![Corner {
            position_m: DVec3::ZERO,
            boresight: DVec3::NEG_Y,
            edge_m: 0.6,
        }],
        ..Scene::default()
    };
    let waveform = Waveform::Stepped {
        band: Band {
            start_hz: 1.1e9,
            step_hz: 4e6,
            count: 50,
        },
        step_s: 1e-3,
        dwell_s: DWELL_S,
    };
    let mut experiment = standing("stepped", waveform, beam, radar_m, scene);
    experiment.radar.pri_s = 60e-3;
    experiment.radar.spreading = true;
    experiment.radar.receiver.noise = Some(ThermalNoise::Equation(LINK));
    experiment.reference = Reference::Point(DVec3::ZERO);
    experiment.method = Method::default();
    experiment
}

/// Power profile over range.
struct Profile {
    powers: Vec<f32>,
    axis: Axis,
}

impl Profile {
    fn peak_m(&self, near_m: f64) -> f64 {
        ridge(&self.powers, &self.axis, near_m, 0.6)
    }

    /// Largest level between two ranges, dB.
    fn level_db(&self, from_m: f64, to_m: f64) -> f64 {
        let inside = |i: &usize| (from_m..to_m).contains(&self.axis.at(*i));
        let powers = (0..self.axis.count).filter(inside).map(|i| self.powers[i]);
        10.0 * f64::from(powers.fold(0.0, f32::max)).log10()
    }

    /// Levels relative to the largest, dB.
    fn points_db(&self) -> Vec<(f64, f64)> {
        let top_db = self.level_db(f64::NEG_INFINITY, f64::INFINITY);
        let points = self.powers.iter().enumerate();
        points
            .map(|(i, p)| (self.axis.at(i), 10.0 * f64::from(*p).log10() - top_db))
            .collect()
    }
}

/// Checks of the ranges of the three objects, estimated together, and of the corner reflector by the laser's precision.
pub(super) fn three_ranges(sweep: &Sweep, reach_m: f64) -> Result<Vec<Check>, ProfileError> {
    let all = sweep.scatterers(40.0, reach_m)?;
    let nearest = |range_m: f64| {
        let off = |one: &&PointScatterer| (one.range_m - range_m).abs();
        let nearest = all.iter().min_by(|a, b| off(a).total_cmp(&off(b)));
        nearest.map_or(f64::NAN, |one| one.range_m)
    };
    let names = ["wall at 1 m", "corner reflector at 6.3 m", "wall at 16 m"];
    let each = names.into_iter().zip(RANGES_M).zip(PRINTED_M);
    let mut checks: Vec<Check> = each
        .map(|((name, range_m), printed)| {
            let quantity = format!("{name}: range, estimated together with the others");
            Check::printed(&quantity, printed, nearest(range_m), 3, "m")
        })
        .collect();
    let corner_m = nearest(RANGES_M[1]);
    checks.push(Check::claim(
        "corner reflector, by the precision of the laser",
        "6.3 m, verified by a laser range finder of 0.01 m",
        format!("{corner_m:.3} m"),
        (corner_m - RANGES_M[1]).abs() <= LASER_M,
    ));
    Ok(checks)
}

/// Recorded pulse and its band.
fn recorded(experiment: &Experiment) -> Result<(Vec<Complex32>, Band), ItemError> {
    let pair = Pair {
        transmitter: 0,
        receiver: 0,
    };
    let recording = experiment
        .record(pair)
        .map_err(|error| ItemError::Measure(error.to_string()))?;
    let band = band(&recording)?;
    let mut samples = vec![Complex32::ZERO; band.count];
    recording.read(0..1, &mut samples)?;
    Ok((samples, band))
}

/// Checks of bandwidth, resolution and largest range.
fn sizes(band: &Band) -> Vec<Check> {
    let longest_m = band.unambiguous_path_m() / 2.0;
    let cell_m = SPEED_OF_LIGHT_M_S / (2.0 * band.bandwidth_hz());
    vec![
        Check::printed(
            "bandwidth, 50 steps of 4 MHz",
            "200",
            band.bandwidth_hz() / 1e6,
            1,
            "MHz",
        ),
        Check::printed("range resolution, c / 2B", "0.75", cell_m, 3, "m"),
        Check::printed("largest range, c / (2 4 MHz)", "37.47", longest_m, 3, "m"),
    ]
}

/// Chart of the profile, unweighted and with a Hamming window.
fn chart(plain: &Profile, hamming: &Profile) -> Result<Vec<u8>, ItemError> {
    Ok(lines(&Chart {
        title: "50 carriers from 1.1 to 1.3 GHz".to_owned(),
        across_label: "range (m)".to_owned(),
        up_label: "level (dB)".to_owned(),
        curves: vec![
            Curve {
                name: "unweighted".to_owned(),
                points: plain.points_db(),
                stroke: Stroke::Solid,
            },
            Curve {
                name: "Hamming".to_owned(),
                points: hamming.points_db(),
                stroke: Stroke::Dashed,
            },
        ],
        marks: RANGES_M.to_vec(),
        up: Some((-60.0, 5.0)),
        ..Chart::default()
    })?)
}

fn profile(_: &Context) -> Result<Finding, ItemError> {
    let (scene, band) = recorded(&experiment(true))?;
    let (lone, _) = recorded(&experiment(false))?;
    let longest_m = band.unambiguous_path_m() / 2.0;
    let of = |samples: &[Complex32], window: Window| {
        let shown_m = (0.0, longest_m - 0.1);
        let (powers, axis) = profiles(samples, &band, window, RANGES_M[1], shown_m);
        Profile { powers, axis }
    };
    let (plain, hamming) = (of(&scene, Window::None), of(&scene, Window::Hamming));
    let alone_m = of(&lone, Window::None).peak_m(RANGES_M[1]);
    let displaced_m = plain.peak_m(RANGES_M[1]);
    let mut checks = sizes(&band);
    let sweep = Sweep {
        start_hz: band.start_hz,
        step_hz: band.step_hz,
        // The samples are relative to the corner reflector.
        values: (scene.iter().enumerate())
            .map(|(n, z)| {
                let frequency_hz = band.start_hz + n as f64 * band.step_hz;
                let turns = -2.0 * frequency_hz * RANGES_M[1] / SPEED_OF_LIGHT_M_S;
                Some(Complex64::new(z.re.into(), z.im.into()) * phasor(turns))
            })
            .collect(),
        times_s: vec![0.0; band.count],
    };
    let ranges = three_ranges(&sweep, longest_m);
    checks.extend(ranges.map_err(|error| ItemError::Measure(error.to_string()))?);
    let far_db = plain.level_db(15.5, 16.5);
    let behind = [&plain, &hamming].map(|p| p.level_db(19.0, 30.0) - p.level_db(15.5, 16.5));
    checks.push(Check::claim(
        "19 to 30 m, relative to the wall at 16 m: unweighted, Hamming",
        "no scatterer there: side lobes of a sinc",
        format!("{:.1} dB, {:.1} dB", behind[0], behind[1]),
        behind[0] - behind[1] > 6.0,
    ));
    let hamming_m: Vec<String> = RANGES_M
        .iter()
        .map(|&range_m| format!("{:+.3}", hamming.peak_m(range_m) - range_m))
        .collect();
    let snr = snr_db(&LINK, 1.2e9, RANGES_M[1], 1.0 / DWELL_S);
    let [near_db, corner_db] =
        [0, 1].map(|i: usize| plain.level_db(RANGES_M[i] - 0.5, RANGES_M[i] + 0.5) - far_db);
    Ok(Finding {
        thesis: "1.1 to 1.3 GHz in 50 steps: range resolution 0.75 m, largest range 37.47 m. The profile peaks at \
                 a small part of a wall at 1 m, a corner reflector at 6.3 m and a wall at 16 m, ranges that a \
                 laser range finder of 0.01 m verified; behind the wall it is sinc-like."
            .to_owned(),
        method: format!(
            "The stepped waveform: 50 carriers from 1.1 GHz, 4 MHz apart (200 / 49 MHz would make the largest \
             range {:.2} m), 4 W, two beams of 60 degrees and 9 dBi, noise figure 1.604 dB: {snr:.0} dB a \
             carrier for 1 m2 at 6.3 m. Walls by physical optics with a reflection of {REFLECTED}: 0.5 x 0.5 m at 1 m, 40 \
             degrees aside, and 12 x 4 m; a trihedral corner of 0.6 m. Near wall and corner stand {near_db:+.1} \
             and {corner_db:+.1} dB against the far wall. Ranges are estimated together by least \
             squares, because sidelobes of the walls displace the corner's peak to {displaced_m:.3} m; alone it reads {alone_m:.3} m, and with a \
             Hamming window the three peaks are off by {} m. Scaled \
             down: three objects instead of all that Fig. 5.12 shows, because the thesis gives the positions of these \
             three alone; their sizes are ours, the carriers the thesis's.",
            SPEED_OF_LIGHT_M_S / (2.0 * 200e6 / 49.0),
            hamming_m.join(", ")
        ),
        why: Finding::unless_all_agree(
            &checks,
            "The walls have a width, and the part nearest to the radar is not where the thesis's laser pointed.",
        ),
        checks,
        pictures: vec![Picture {
            name: "profile".to_owned(),
            caption: "Range profile, unweighted and under a Hamming window".to_owned(),
            png: chart(&plain, &hamming)?,
        }],
    })
}
