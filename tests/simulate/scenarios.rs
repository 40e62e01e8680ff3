//! The two engines of the simulator against each other, and against the definition, on random scenarios: all kinds of
//! radars and tracks, points, corners and movers, antenna beams, receiver noise.
//!
//! A scenario is a TOML text, as written by a user, run with both methods. The fast sum must agree with the plain one
//! to -90 dB (`simulate::engine`), as relative RMS over a channel's pulses. The noise is identical in both, sample by
//! sample. proptest shrinks failures to the simplest case.
//!
//! `SUBAPERTURE_SCENARIOS` is the number of scenarios, 300 by default.

use std::fmt::Write;
use std::sync::atomic::{AtomicU32, Ordering};

use num_complex::Complex32;
use proptest::prelude::*;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};
use subaperture::phase_history::PhaseHistory;
use subaperture::receive::Echoes;
use subaperture::simulate::scenario::Scenario;
use subaperture::simulate::{Experiment, Pair};
use subaperture_tests::experiment::{definition, difference_db, read_whole};

const C: f64 = 299_792_458.0;

/// Error bound of the engine.
const BOUND_DB: f64 = -90.0;

/// Random numbers and choices that define a scenario; all of them shrink towards the simplest case.
#[derive(Clone, Debug)]
struct Case {
    /// Ideal, stepped, FMCW, pulsed chirp, pulsed code.
    radar: u8,
    /// Linear, circular, rail, arc, waypoints, spline, fixed.
    track: u8,
    /// Isotropic, Gaussian beam, aperture beam.
    pattern: u8,
    /// Stop-and-go or intra-pulse motion.
    moves: bool,
    spreading: bool,
    falling: bool,
    noise: bool,
    /// None, sway, vibration, acceleration, wobble.
    perturbation: u8,
    receivers: u8,
    pulses: u8,
    samples: u16,
    /// Logarithms of carrier, relative bandwidth, range, speed.
    scales: [f64; 4],
    /// Size of the scene, squint and height of the radar.
    view: [f64; 3],
    points: Vec<[f64; 4]>,
    corners: u8,
    movers: u8,
}

prop_compose! {
    fn case()(
        (radar, track, pattern) in (0..5u8, 0..7u8, 0..3u8),
        (moves, spreading, falling, noise) in any::<(bool, bool, bool, bool)>(),
        (perturbation, receivers) in (0..5u8, 1..3u8),
        (pulses, samples) in (2..7u8, 2..200u16),
        scales in prop::array::uniform4(0.0..1.0f64),
        view in prop::array::uniform3(0.0..1.0f64),
        points in prop::collection::vec(prop::array::uniform4(-1.0..1.0f64), 1..20),
        (corners, movers) in (0..3u8, 0..3u8),
    ) -> Case {
        Case {
            radar, track, pattern, moves, spreading, falling, noise, perturbation, receivers, pulses, samples, scales,
            view, points, corners, movers,
        }
    }
}

impl Case {
    /// Logarithmic interpolation from `from` to `to`.
    fn scale(&self, n: usize, from: f64, to: f64) -> f64 {
        from * (to / from).powf(self.scales[n])
    }

    fn text(&self) -> String {
        let mut text = String::new();
        let carrier_hz = self.scale(0, 0.3e9, 90e9);
        let bandwidth_hz = carrier_hz * self.scale(1, 2e-3, 0.5);
        let range_m = self.scale(2, 3.0, 30e3);
        // The scene is small compared with the range, and not smaller than some resolution cells.
        let half_m = range_m * (0.003 + 0.25 * self.view[0]);
        let speed_m_s = self.scale(3, 0.1, 300.0);
        self.scene(&mut text, half_m);
        self.radar(&mut text, carrier_hz, bandwidth_hz, range_m, half_m);
        self.platform(&mut text, range_m, speed_m_s);
        text
    }

    fn scene(&self, text: &mut String, half_m: f64) {
        text.push_str("[scene]\nreference = \"0, 0, 0 m\"\n");
        for (n, [x, y, z, a]) in self.points.iter().enumerate() {
            let (x, y, z) = (x * half_m, y * half_m, 0.1 * z * half_m);
            let n = n as u8;
            if n < self.movers {
                let _ = write!(
                    text,
                    "[[scene.mover]]\nkind = \"linear\"\nposition = \"{x}, {y}, {z} m\"\n\
                     velocity = \"{}, {}, 0 m/s\"\n",
                    20.0 * a,
                    -13.0 * a
                );
            } else if n < self.movers + self.corners {
                let _ = write!(
                    text,
                    "[[scene.corner]]\nposition = \"{x}, {y}, {z} m\"\nboresight = \"{a}, -1, 0.6\"\nedge = \"30 cm\"\n"
                );
            } else {
                let _ = write!(
                    text,
                    "[[scene.point]]\nposition = \"{x}, {y}, {z} m\"\ncross_section = \"{} dBsm\"\nphase = \"{} deg\"\n",
                    10.0 * a,
                    180.0 * x / half_m
                );
            }
        }
    }

    fn radar(
        &self,
        text: &mut String,
        carrier_hz: f64,
        bandwidth_hz: f64,
        range_m: f64,
        half_m: f64,
    ) {
        let (samples, pulses) = (self.samples, self.pulses);
        let mut radar = format!("[radar]\npulses = {pulses}\ncentre = \"{carrier_hz} Hz\"\n");
        let sweep = if self.falling { "down" } else { "up" };
        let mut pulse = String::new();
        // Echoes of the scene, seen from any direction, arrive within this time.
        let scene_s = 2.0 * 2.0 * 1.5 * half_m / C;
        let lasts_s = match self.radar {
            0 => {
                let _ = write!(
                    radar,
                    "kind = \"ideal\"\nsamples = {samples}\nbandwidth = \"{bandwidth_hz} Hz\"\n"
                );
                1e-6
            }
            1 => {
                let step_s = 2e-6;
                let _ = write!(
                    radar,
                    "kind = \"stepped\"\nsamples = {samples}\nbandwidth = \"{bandwidth_hz} Hz\"\nstep_time = \"{step_s} s\"\n"
                );
                f64::from(samples) * step_s
            }
            2 => {
                // Four times the largest beat frequency.
                let sweep_s = 200.0 * scene_s + 1e-5;
                let rate_hz = f64::from(samples) / sweep_s;
                let beat_hz = bandwidth_hz / sweep_s * scene_s;
                let bandwidth_hz = bandwidth_hz * (rate_hz / (4.0 * beat_hz)).min(1.0);
                let _ = write!(
                    radar,
                    "kind = \"fmcw\"\nsamples = {samples}\nbandwidth = \"{bandwidth_hz} Hz\"\nsample_rate = \"{rate_hz} Hz\"\n\
                     sweep = \"{sweep}\"\nmixer_delay = \"{} s\"\n",
                    2.0 * range_m / C
                );
                sweep_s
            }
            kind => {
                // A window of at most 4000 samples; the bandwidth is reduced for that.
                let chips = 13.0;
                let wide_hz = bandwidth_hz.min(2000.0 / scene_s);
                let (rate_hz, duration_s) = (1.5 * wide_hz, chips / wide_hz);
                let samples = ((scene_s + duration_s) * rate_hz).ceil() + 20.0;
                let _ = write!(
                    radar,
                    "kind = \"pulsed\"\nsamples = {samples}\nsample_rate = \"{rate_hz} Hz\"\n"
                );
                pulse = match kind {
                    3 => format!(
                        "[radar.pulse]\nkind = \"lfm\"\nbandwidth = \"{wide_hz} Hz\"\nduration = \"{duration_s} s\"\n\
                         sweep = \"{sweep}\"\n"
                    ),
                    _ => format!(
                        "[radar.pulse]\nkind = \"code\"\ncode = \"barker-13\"\nchip = \"{} s\"\n",
                        1.0 / wide_hz
                    ),
                };
                samples / rate_hz + 2.0 * range_m / C
            }
        };
        let motion = if self.moves { "true" } else { "stop-and-go" };
        let _ = write!(
            radar,
            "pri = \"{} s\"\nmotion = \"{motion}\"\nspreading = {}\n{pulse}",
            1.1 * lasts_s + 1e-4,
            self.spreading
        );
        text.push_str(&radar);
        for n in 0..self.receivers {
            let beam = match self.pattern {
                0 => String::new(),
                kind => format!(
                    "pattern = \"{}\"\nazimuth = \"40 deg\"\nelevation = \"60 deg\"\nboresight = \"0.2, 1, -0.4\"\n",
                    ["gaussian", "aperture"][usize::from(kind - 1)]
                ),
            };
            let _ = write!(
                text,
                "[[radar.receiver]]\noffset = \"{}, 0.1, 0 m\"\n{beam}",
                0.3 * f64::from(n)
            );
        }
        if self.noise {
            text.push_str("[radar.noise]\npower = \"-20 dB\"\n");
        }
    }

    fn platform(&self, text: &mut String, range_m: f64, speed_m_s: f64) {
        let (across, height) = (0.8 * (self.view[1] - 0.5), 0.1 + 0.6 * self.view[2]);
        let [x, y, z] = [across, -1.0, height]
            .map(|v| v * range_m / (1.0 + across * across + height * height).sqrt());
        let at = |dx: f64, dy: f64| format!("{}, {}, {z} m", x + dx, y + dy);
        let platform = match self.track {
            0 => format!(
                "kind = \"linear\"\nposition = \"{}\"\nvelocity = \"{speed_m_s}, 1, 0.5 m/s\"\n",
                at(0.0, 0.0)
            ),
            1 => format!(
                "kind = \"circular\"\ncentre = \"0, 0, {z} m\"\nradius = \"{} m\"\nspeed = \"{speed_m_s} m/s\"\n\
                 bearing = \"{} deg\"\n",
                x.hypot(y),
                y.atan2(x).to_degrees()
            ),
            2 => format!(
                "kind = \"rail\"\nfrom = \"{}\"\nto = \"{}\"\nspeed = \"{speed_m_s} m/s\"\n",
                at(-0.1, 0.0),
                at(speed_m_s, 0.2)
            ),
            3 => format!(
                "kind = \"arc\"\npivot = \"{}\"\nradius = \"{} m\"\nfrom_angle = \"60 deg\"\nto_angle = \"120 deg\"\n\
                 rate = \"50 deg/s\"\n",
                at(0.0, 0.0),
                0.05 * range_m
            ),
            4 | 5 => format!(
                "kind = \"{}\"\npoints = [\"0 s, {}\", \"0.1 s, {}\", \"0.5 s, {}\"]\n",
                ["waypoints", "spline"][usize::from(self.track - 4)],
                at(0.0, 0.0),
                at(0.1 * speed_m_s, 0.003 * speed_m_s),
                at(0.5 * speed_m_s, 0.0)
            ),
            _ => format!("kind = \"fixed\"\nposition = \"{}\"\n", at(0.0, 0.0)),
        };
        let perturbation = match self.perturbation {
            0 => "",
            1 => "kind = \"sway\"\nrms = \"2, 2, 1 cm\"\ncorrelation = \"500 ms\"\n",
            2 => "kind = \"vibration\"\namplitude = \"0, 0, 1 mm\"\nfrequency = \"60 Hz\"\n",
            3 => "kind = \"acceleration\"\nacceleration = \"0, 2, 0 m/s^2\"\n",
            _ => "kind = \"wobble\"\nangles = \"2, 1, 1 deg\"\nperiod = \"300 ms\"\n",
        };
        let _ = write!(text, "[platform]\n{platform}");
        if !perturbation.is_empty() {
            let _ = write!(text, "[[platform.perturbation]]\n{perturbation}");
        }
    }
}

fn experiment(text: &str, method: &str) -> Result<Experiment, String> {
    let mut scenario = Scenario::new("random.toml", text, "/nowhere");
    scenario
        .set("method", method)
        .map_err(|error| error.to_string())?;
    scenario.experiment().map_err(|error| error.to_string())
}

/// Raw samples of all pulses.
fn raw(experiment: &Experiment, pair: Pair) -> Result<Vec<Complex32>, String> {
    let echoes = experiment.echoes(pair).map_err(|error| error.to_string())?;
    let collection = echoes.collection();
    let count = collection.pulses.len();
    let mut samples = vec![Complex32::ZERO; count * collection.waveform.num_samples()];
    echoes
        .read(0..count, &mut samples)
        .map_err(|error| error.to_string())?;
    Ok(samples)
}

/// Relative RMS difference, dB. Two zero signals are equal.
fn error_db(fast: &[Complex32], sum: &[Complex32]) -> f64 {
    let square = |z: Complex32| f64::from(z.re).powi(2) + f64::from(z.im).powi(2);
    let error: f64 = fast.iter().zip(sum).map(|(a, b)| square(a - b)).sum();
    let power: f64 = sum.iter().copied().map(square).sum();
    if error == 0.0 {
        f64::NEG_INFINITY
    } else {
        10.0 * (error / power).log10()
    }
}

/// Largest error of a scenario, or the reason why it is invalid.
fn compare(case: &Case, text: &str) -> Result<f64, String> {
    let (fast, sum) = (experiment(text, "fast")?, experiment(text, "sum")?);
    let mut worst_db = f64::NEG_INFINITY;
    for pair in sum.pairs() {
        let (fast, plain) = (raw(&fast, pair)?, raw(&sum, pair)?);
        assert!(plain.iter().all(|z| z.is_finite()));
        worst_db = worst_db.max(error_db(&fast, &plain));
        // Static isotropic points only: this is the definition of phase history.
        let plain_scene = sum.scene.movers.is_empty() && sum.scene.corners.is_empty();
        if case.radar == 0
            && case.pattern == 0
            && !case.moves
            && !case.spreading
            && !case.noise
            && plain_scene
        {
            let recording = sum.record(pair).map_err(|error| error.to_string())?;
            let defined = definition(recording.collection(), &sum.scene.points);
            let db = difference_db(&read_whole(&recording), &defined);
            // Float32, and phases of up to 2e7 turns in float64: 1e-9 turns.
            assert!(db < -120.0, "{db} dB from the definition\n{text}");
        }
    }
    Ok(worst_db)
}

#[test]
fn fast_sum_matches_plain_sum_on_random_scenarios() {
    let cases = std::env::var("SUBAPERTURE_SCENARIOS")
        .ok()
        .and_then(|text| text.parse().ok());
    let config = Config {
        cases: cases.unwrap_or(300),
        failure_persistence: None,
        ..Config::default()
    };
    let (compared, refused) = (AtomicU32::new(0), AtomicU32::new(0));
    let worst = std::sync::Mutex::new(f64::NEG_INFINITY);
    let random = TestRng::from_seed(RngAlgorithm::ChaCha, &[7; 32]);
    let mut runner = TestRunner::new_with_rng(config, random);
    let result = runner.run(&case(), |case| {
        let text = case.text();
        match compare(&case, &text) {
            Ok(db) => {
                compared.fetch_add(1, Ordering::Relaxed);
                let mut worst = worst.lock().unwrap();
                *worst = worst.max(db);
                prop_assert!(db < BOUND_DB, "{} dB\n{}", db, text);
            }
            Err(error) => {
                if refused.fetch_add(1, Ordering::Relaxed) < 5 {
                    println!("refused: {}", error.lines().next().unwrap_or_default());
                }
            }
        }
        Ok(())
    });
    let (compared, refused) = (compared.into_inner(), refused.into_inner());
    println!(
        "{compared} scenarios compared, {refused} refused, worst {:.1} dB",
        worst.lock().unwrap()
    );
    if let Err(error) = result {
        panic!("{error}");
    }
    // Refused scenarios do not test the engines.
    assert!(
        refused < compared / 3,
        "{refused} of {} were refused",
        refused + compared
    );
}
