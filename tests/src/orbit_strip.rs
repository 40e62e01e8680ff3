//! Strip map from orbit by formulas of this file: a circular orbit in an inertial frame, scatterers on the rotating Earth, light times solved in
//! the inertial frame, echoes of a chirp in 4-bit samples with a bias, pulses that are missing.

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::path::Path;

use glam::DVec3;
use num_complex::Complex64;

use crate::numpy::{array, stored};
use crate::random::Random;

/// Speed of light, m/s.
pub const C: f64 = 299_792_458.0;
const RADIUS_M: f64 = 7.071e6;
/// Inclination of the orbit.
const TILT: f64 = 1.713;
const EARTH_RAD_S: f64 = 7.292_115e-5;
/// Semi-major axis and squared eccentricity of WGS 84.
const AXIS_M: f64 = 6_378_137.0;
const E2: f64 = 6.694_379_990_141_317e-3;

/// Start of the first pulse, seconds on the clock of the orbit.
pub const START_S: f64 = 4321.0;
/// Number of pulses of the strip.
pub const PULSES: usize = 1000;
/// Number of samples per pulse.
pub const SAMPLES: usize = 1200;
/// Pulse repetition frequency, hertz.
pub const PRF_HZ: f64 = 1200.0;
/// Carrier frequency of the chirp, hertz.
pub const CENTRE_HZ: f64 = 5.405e9;
/// Complex sampling rate, hertz.
pub const RATE_HZ: f64 = 24e6;
/// Bandwidth of the chirp, hertz.
pub const BAND_HZ: f64 = 20e6;
/// Duration of the chirp, seconds.
pub const PULSE_S: f64 = 20e-6;
const RANGE_M: f64 = 850e3;
/// Squint of the beam, degrees forward of broadside.
pub const SQUINT_DEG: f64 = -1.6;
/// Full half-power width of the antenna, degrees.
pub const BEAM_DEG: f64 = 0.12;
/// Standard deviation of the noise and bias of both parts, in steps of the quantiser.
const NOISE: f64 = 0.8;
const BIAS: [f64; 2] = [0.3, -0.2];

/// Position and velocity in the inertial frame.
fn inertial(t: f64) -> [DVec3; 2] {
    let rate = (3.986_004_418e14 / RADIUS_M.powi(3)).sqrt();
    let (sin, cos) = (rate * t).sin_cos();
    let (across, up) = (TILT.cos(), TILT.sin());
    [
        DVec3::new(cos, sin * across, sin * up) * RADIUS_M,
        DVec3::new(-sin, cos * across, cos * up) * (RADIUS_M * rate),
    ]
}

/// Rotation about the Earth's axis from Earth-fixed to inertial axes.
fn turned(t: f64, v: DVec3) -> DVec3 {
    let (sin, cos) = (EARTH_RAD_S * t).sin_cos();
    DVec3::new(cos * v.x - sin * v.y, sin * v.x + cos * v.y, v.z)
}

/// Position and velocity in ECEF.
pub fn state(t: f64) -> [DVec3; 2] {
    let [place, speed] = inertial(t);
    let place = turned(-t, place);
    let carried = DVec3::new(-place.y, place.x, 0.0) * EARTH_RAD_S;
    [place, turned(-t, speed) - carried]
}

/// Latitude and longitude in radians and height in metres, by iteration of the normal's length.
fn geodetic(p: DVec3) -> [f64; 3] {
    let flat = p.x.hypot(p.y);
    let mut latitude = p.z.atan2(flat * (1.0 - E2));
    let mut height = 0.0;
    for _ in 0..20 {
        let normal = AXIS_M / (1.0 - E2 * latitude.sin().powi(2)).sqrt();
        height = flat * latitude.cos() + p.z * latitude.sin() - AXIS_M * AXIS_M / normal;
        latitude = p.z.atan2(flat * (1.0 - E2 * normal / (normal + height)));
    }
    [latitude, p.y.atan2(p.x), height]
}

/// Scene: its origin on the ground, and its axes.
pub struct Ground {
    /// Origin in ECEF, metres.
    pub origin: DVec3,
    /// Latitude and longitude of the origin, radians, and height, metres.
    pub place: [f64; 3],
    axes: [DVec3; 3],
}

impl Ground {
    /// Position in ECEF of a point in the scene's axes, metres.
    pub fn ecef(&self, p: DVec3) -> DVec3 {
        self.origin + self.axes[0] * p.x + self.axes[1] * p.y + self.axes[2] * p.z
    }

    /// Position in the scene's axes of a point in ECEF, metres.
    pub fn local(&self, p: DVec3) -> DVec3 {
        let [east, north, up] = self.axes.map(|axis| axis.dot(p - self.origin));
        DVec3::new(east, north, up)
    }
}

/// Point of the ellipsoid in the middle of the beam, right of the track, in the middle of the pulses.
pub fn ground() -> Ground {
    let [place, speed] = state(middle_s());
    let forward = speed.normalize();
    let right = forward.cross(place).normalize();
    let down = forward.cross(right);
    let down = down * -down.dot(place).signum();
    let (sin, cos) = SQUINT_DEG.to_radians().sin_cos();
    let point = |look: f64| {
        let (aside, below) = look.sin_cos();
        place + (forward * sin + (right * aside + down * below) * cos) * RANGE_M
    };
    let (mut inside, mut above) = (0.0, 1.5);
    for _ in 0..80 {
        let look = 0.5 * (inside + above);
        match geodetic(point(look))[2] > 0.0 {
            true => above = look,
            false => inside = look,
        }
    }
    let origin = point(inside);
    let [latitude, longitude, height] = geodetic(origin);
    let (sin_b, cos_b) = latitude.sin_cos();
    let (sin_l, cos_l) = longitude.sin_cos();
    Ground {
        origin,
        place: [latitude, longitude, height],
        axes: [
            DVec3::new(-sin_l, cos_l, 0.0),
            DVec3::new(-sin_b * cos_l, -sin_b * sin_l, cos_b),
            DVec3::new(cos_b * cos_l, cos_b * sin_l, sin_b),
        ],
    }
}

/// Time of the middle of the pulses, seconds.
pub fn middle_s() -> f64 {
    START_S + 0.5 * (PULSES - 1) as f64 / PRF_HZ
}

/// Time of the start of a pulse, seconds.
pub fn pulse_s(n: usize) -> f64 {
    START_S + n as f64 / PRF_HZ
}

/// Time at which the echo of an Earth-fixed point arrives that was sent at `sent_s`: light times in the inertial frame.
pub fn arrival_s(point: DVec3, sent_s: f64) -> f64 {
    let radar = |t: f64| inertial(t)[0];
    let mut bounce_s = sent_s;
    for _ in 0..6 {
        bounce_s = sent_s + turned(bounce_s, point).distance(radar(sent_s)) / C;
    }
    let bounce = turned(bounce_s, point);
    let mut arrival_s = bounce_s;
    for _ in 0..6 {
        arrival_s = bounce_s + radar(arrival_s).distance(bounce) / C;
    }
    arrival_s
}

/// Sine of the angle of a point forward of broadside of the Earth-fixed track.
pub fn sine(point: DVec3, t: f64) -> f64 {
    let [place, speed] = state(t);
    speed.normalize().dot((point - place).normalize())
}

/// Time at which a point is in the middle of the beam.
pub fn centre_s(point: DVec3) -> f64 {
    let (mut before, mut after) = (START_S - 10.0, START_S + 10.0);
    for _ in 0..60 {
        let t = 0.5 * (before + after);
        match sine(point, t) > SQUINT_DEG.to_radians().sin() {
            true => before = t,
            false => after = t,
        }
    }
    before
}

/// Doppler frequency in the middle of the beam, hertz.
pub fn centroid_hz() -> f64 {
    let [_, speed] = state(middle_s());
    2.0 * CENTRE_HZ / C * speed.length() * SQUINT_DEG.to_radians().sin()
}

/// Direction of the track in the horizontal plane at the origin, per metre along the track.
pub fn forward(ground: &Ground) -> DVec3 {
    let [_, speed] = state(middle_s());
    let forward = ground.local(ground.origin + speed.normalize() * 1000.0) * 1e-3;
    DVec3::new(forward.x, forward.y, 0.0)
}

/// Point on the line through the origin along the track that is in the middle of the beam at a time.
pub fn point_in_beam_at(ground: &Ground, at_s: f64) -> DVec3 {
    let forward = forward(ground);
    let mut along = [-3000.0, 3000.0];
    for _ in 0..60 {
        let middle = 0.5 * (along[0] + along[1]);
        let late = centre_s(ground.ecef(forward * middle)) > at_s;
        along[usize::from(late)] = middle;
    }
    forward * along[0]
}

/// Scene position of the azimuth ambiguity of a point, one PRF of Doppler frequency later: where the range is the same and the Doppler frequency
/// differs by the PRF at the time of the point's centre, by Newton's method.
pub fn ghost_m(ground: &Ground, point: DVec3, prfs: f64) -> DVec3 {
    let at_s = centre_s(ground.ecef(point));
    let [place, speed] = state(at_s);
    let seen = |p: DVec3| {
        let from = ground.ecef(p) - place;
        let range_m = from.length();
        [range_m, 2.0 * CENTRE_HZ / C * speed.dot(from) / range_m]
    };
    let [range_m, doppler_hz] = seen(point);
    let wanted = [range_m, doppler_hz + prfs * PRF_HZ];
    let mut found = point;
    for _ in 0..20 {
        let now = seen(found);
        let east = seen(found + DVec3::X);
        let north = seen(found + DVec3::Y);
        let [a, b] = [east[0] - now[0], north[0] - now[0]];
        let [c, d] = [east[1] - now[1], north[1] - now[1]];
        let miss = [wanted[0] - now[0], wanted[1] - now[1]];
        let det = a * d - b * c;
        found += DVec3::new(d * miss[0] - b * miss[1], a * miss[1] - c * miss[0], 0.0) / det;
    }
    found
}

/// Two-way amplitude of two equal Gaussian antennas.
fn beam(point: DVec3, t: f64) -> f64 {
    let off_deg = sine(point, t).asin().to_degrees() - SQUINT_DEG;
    (2.0f64).powf(-(2.0 * off_deg / BEAM_DEG).powi(2))
}

/// Delay of the first sample after the start of the pulse.
pub fn window_s(ground: &Ground) -> f64 {
    let middle = middle_s() + 0.5 * PULSE_S;
    let delay_s = arrival_s(ground.origin, middle) - middle;
    // A round number of nanoseconds, as a description would state.
    ((delay_s - 0.5 * (SAMPLES as f64 / RATE_HZ - PULSE_S)) * 1e9).round() * 1e-9
}

/// Whether a pulse is missing: 5 % at random.
pub fn missing(n: usize) -> bool {
    Random(n as u64 * 77 + 5).uniform() < 0.05
}

/// Echo of a point with this amplitude in the middle of the beam, added to the samples of pulse `n`.
fn add(point: DVec3, level: f64, n: usize, window_s: f64, samples: &mut [Complex64]) {
    let sent_s = pulse_s(n) + 0.5 * PULSE_S;
    let level = level * beam(point, sent_s);
    if level < 1e-4 {
        return;
    }
    let arrival = arrival_s(point, sent_s);
    let step_s = 1e-4;
    // Change of the arrival with the time of transmission.
    let change =
        (arrival_s(point, sent_s + step_s) - arrival_s(point, sent_s - step_s)) / (2.0 * step_s);
    let slope = BAND_HZ / PULSE_S;
    for (k, z) in samples.iter_mut().enumerate() {
        let since_s = pulse_s(n) + window_s + k as f64 / RATE_HZ - arrival;
        let after_s = since_s / change;
        if after_s.abs() > 0.5 * PULSE_S {
            continue;
        }
        let delay_s = (arrival - sent_s) + since_s - after_s;
        let turns = 0.5 * slope * after_s * after_s - CENTRE_HZ * delay_s;
        *z += Complex64::cis(TAU * turns.rem_euclid(1.0)) * level;
    }
}

/// Samples of all pulses, 4 bits for each part; `level` is the amplitude of each point in the middle of the beam, in steps of the quantiser.
pub fn echoes(ground: &Ground, points: &[DVec3], level: f64) -> Vec<Vec<Complex64>> {
    let window_s = window_s(ground);
    let mut random = Random(2026);
    let quantised = |value: f64| value.round().clamp(-8.0, 7.0);
    let points: Vec<DVec3> = points.iter().map(|&p| ground.ecef(p)).collect();
    (0..PULSES)
        .map(|n| {
            let mut samples = vec![Complex64::ZERO; SAMPLES];
            points
                .iter()
                .for_each(|&point| add(point, level, n, window_s, &mut samples));
            for z in &mut samples {
                let noise = random.gaussians();
                let re = z.re + NOISE * noise[0] + BIAS[0];
                let im = z.im + NOISE * noise[1] + BIAS[1];
                *z = Complex64::new(quantised(re), quantised(im));
            }
            samples
        })
        .collect()
}

/// How the 5 % of missing pulses are recorded.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Missing {
    /// All pulses are recorded.
    Complete,
    /// Their times and rows are absent.
    Absent,
    /// Their rows are zero.
    Zero,
}

fn doubles(name: &str, shape: &str, values: impl Iterator<Item = f64>) -> (String, Vec<u8>) {
    let data: Vec<u8> = values.flat_map(f64::to_le_bytes).collect();
    (format!("{name}.npy"), array("<f8", shape, &data))
}

/// Write `strip.npz`: echoes, pulse times, and state vectors every 10 s.
pub fn write(folder: &Path, echoes: &[Vec<Complex64>], missing_as: Missing) {
    let kept: Vec<usize> = (0..PULSES)
        .filter(|&n| missing_as != Missing::Absent || !missing(n))
        .collect();
    let mut data = Vec::new();
    for &n in &kept {
        let zero = missing_as == Missing::Zero && missing(n);
        for z in &echoes[n] {
            let z = if zero { Complex64::ZERO } else { *z };
            data.extend((z.re as f32).to_le_bytes());
            data.extend((z.im as f32).to_le_bytes());
        }
    }
    let count = kept.len();
    let times: Vec<f64> = vector_times(10.0);
    let states = |i: usize| times.iter().flat_map(move |&t| state(t)[i].to_array());
    let shape = format!("({}, 3)", times.len());
    let members = [
        (
            "echoes.npy".to_owned(),
            array("<c8", &format!("({count}, {SAMPLES})"), &data),
        ),
        doubles(
            "pulse_times",
            &format!("({count},)"),
            kept.iter().map(|&n| pulse_s(n)),
        ),
        doubles(
            "times",
            &format!("({},)", times.len()),
            times.iter().copied(),
        ),
        doubles("positions", &shape, states(0)),
        doubles("velocities", &shape, states(1)),
    ];
    let members: Vec<(&str, &[u8])> = (members.iter())
        .map(|(name, data)| (name.as_str(), data.as_slice()))
        .collect();
    std::fs::write(folder.join("strip.npz"), stored(&members)).unwrap();
}

/// Times of state vectors, the pulses within the middle interval.
pub fn vector_times(step_s: f64) -> Vec<f64> {
    (-5..7)
        .map(|n| START_S - 0.3 * step_s + f64::from(n) * step_s)
        .collect()
}

/// State vectors as a CSV file, with or without velocities.
pub fn csv(times: &[f64], moving: bool) -> String {
    let mut text = "time_s,x_m,y_m,z_m".to_owned();
    text += if moving {
        ",vx_m_s,vy_m_s,vz_m_s\n"
    } else {
        "\n"
    };
    for &t in times {
        let [p, v] = state(t);
        let _ = write!(text, "{t},{},{},{}", p.x, p.y, p.z);
        if moving {
            let _ = write!(text, ",{},{},{}", v.x, v.y, v.z);
        }
        text.push('\n');
    }
    text
}

/// Description of the recording; `platform` is the rest of the section, `antenna` the antennas' sections.
pub fn description(ground: &Ground, platform: &str, antenna: &str) -> String {
    let [latitude, longitude, height] = ground.place;
    format!(
        r#"[recording]
format = "npz"
file = "strip.npz"
array = "echoes"
times = "pulse_times"
phase = "minus"

[scene]
x = "-2, 2 km"
y = "-2, 2 km"

[scene.origin]
latitude = "{latitude} rad"
longitude = "{longitude} rad"
height = "{height} m"

[radar]
kind = "pulsed"
centre = "{CENTRE_HZ} Hz"
sample_rate = "{RATE_HZ} Hz"
window_start = "{} s"

[radar.pulse]
kind = "lfm"
bandwidth = "{BAND_HZ} Hz"
duration = "{PULSE_S} s"
{antenna}
[platform]
{platform}
"#,
        window_s(ground)
    )
}

/// Antennas with the beam of the echoes. The boresight is in body axes, y left.
pub fn antennas() -> String {
    let (sin, cos) = SQUINT_DEG.to_radians().sin_cos();
    let section = |name: &str| {
        format!(
            "\n[[radar.{name}]]\nboresight = \"{sin}, {}, {}\"\npattern = \"gaussian\"\nazimuth = \"{BEAM_DEG} deg\"\nelevation = \"5 deg\"\n",
            -cos * 0.6,
            -cos * 0.8
        )
    };
    section("transmitter") + &section("receiver")
}
