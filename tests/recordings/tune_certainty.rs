//! Certainty that `tune` states against the truth, over many walks along a rail with an offset clock of the radar.
//!
//! A clock offset affects focus only as far as the walk is uneven; on an even walk it only shifts the image. Points that enter or leave the
//! patch of pixels must not be taken for focus.

use std::f64::consts::TAU;
use std::path::Path;

use glam::DVec3;
use subaperture::SPEED_OF_LIGHT_M_S;
use subaperture::autofocus::{
    Axis, Measure, Model, Order, Problem, Search, Sight, Tuned, Verdict, determine,
};
use subaperture::focus::FormError;
use subaperture::io::recording::{RecordingFile, Take};
use subaperture::monitor::Silent;
use subaperture::signal::window::Window;
use subaperture_tests::numpy;

/// Random numbers independent of the library: splitmix64.
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    fn normal(&mut self) -> f64 {
        (-2.0 * (1.0 - self.unit()).ln()).sqrt() * (TAU * self.unit()).cos()
    }
}

const BINS: usize = 400;
const BIN_M: f64 = 0.0125;
const PULSES: usize = 120;
const PRI_S: f64 = 0.05;

/// A walk, and the offset between the clocks of radar and track.
struct Walk {
    speed_m_s: f64,
    unevenness: f64,
    /// Rates of both sways. With a single rate the walk is periodic, and its clock determined only up to whole periods.
    rates: [f64; 2],
    phases: [f64; 2],
    offset_s: f64,
}

impl Walk {
    fn random(random: &mut Random, unevenness: f64) -> Self {
        let rate = TAU / random.between(2.5, 4.5);
        Self {
            speed_m_s: random.between(0.4, 0.6),
            unevenness,
            rates: [rate, rate / random.between(1.3, 1.7)],
            phases: [random.between(0.0, TAU), random.between(0.0, TAU)],
            offset_s: random.between(3.5, 8.5),
        }
    }

    /// Position along x; the speed varies by the unevenness.
    fn place_m(&self, t: f64) -> DVec3 {
        let sways = self.rates.iter().zip(self.phases);
        let sway: f64 = sways
            .map(|(rate, phase)| (rate * t + phase).sin() / rate)
            .sum();
        DVec3::new(self.speed_m_s * (t + self.unevenness * sway), 0.0, 0.0)
    }
}

/// Write a NumPy file of float64.
fn npy(path: &Path, shape: &str, values: impl Iterator<Item = f64>) {
    let bytes: Vec<u8> = values.flat_map(f64::to_le_bytes).collect();
    std::fs::write(path, numpy::array("<f8", shape, &bytes)).unwrap();
}

/// Write the recording of a walk past some reflectors (real pulses at 4 GHz in noise), and return its description and pixels around the
/// scene.
fn record(folder: &Path, walk: &Walk, random: &mut Random) -> (RecordingFile, String) {
    let middle_m = walk.place_m(walk.offset_s + 0.5 * PULSES as f64 * PRI_S);
    let points: Vec<(DVec3, f64)> = (0..5)
        .map(|_| {
            let place = DVec3::new(random.between(-1.6, 1.6), random.between(2.4, 4.3), 0.0);
            (middle_m + place, random.between(0.5, 1.5))
        })
        .collect();
    let times: Vec<f64> = (0..1700).map(|i| f64::from(i) * 0.01).collect();
    npy(&folder.join("t.npy"), "(1700,)", times.iter().copied());
    npy(
        &folder.join("p.npy"),
        "(1700, 3)",
        times.iter().flat_map(|&t| walk.place_m(t).to_array()),
    );
    let mut waveform = Vec::with_capacity(PULSES * BINS);
    for n in 0..PULSES {
        let from = walk.place_m(walk.offset_s + n as f64 * PRI_S);
        for i in 0..BINS {
            let range_m = 1.5 + i as f64 * BIN_M;
            let echoes: f64 = points
                .iter()
                .map(|(point, amplitude)| {
                    let late_s = 2.0 * (range_m - from.distance(*point)) / SPEED_OF_LIGHT_M_S;
                    amplitude
                        * (-0.5 * (TAU * 0.5e9 * late_s).powi(2)).exp()
                        * (TAU * 4e9 * late_s).cos()
                })
                .sum();
            waveform.push(echoes + 0.3 * random.normal());
        }
    }
    npy(&folder.join("scan.npy"), "(120, 400)", waveform.into_iter());
    let text = "[recording]\nformat = \"npy\"\nfile = \"scan.npy\"\n\
                [radar]\nkind = \"profiles\"\nfirst_range = \"1.5 m\"\nrange_step = \"1.25 cm\"\nband = \"3.2, 4.8 GHz\"\n\
                pri = \"50 ms\"\nfirst_pulse = \"0 s\"\n\
                [platform]\nkind = \"arrays\"\ntimes = \"t.npy\"\npositions = \"p.npy\"\n";
    let (low, high) = (middle_m.x - 1.2, middle_m.x + 1.2);
    let grid = format!("x={low:.2}:{high:.2}:0.08,y=2.3:4.4:0.08");
    (RecordingFile::new("walk.toml", text, folder), grid)
}

struct Clock<'a>(&'a RecordingFile);

impl Model for Clock<'_> {
    fn take(&self, values: &[f64], pulses: Option<&[usize]>) -> Result<Take, FormError> {
        let text = format!("{} s", values[0]);
        let varied = self.0.with([("radar.first_pulse", text.as_str())]).unwrap();
        Ok(varied.take(u64::MAX, pulses)?)
    }
}

fn tune(file: &RecordingFile, grid: &str, measure: Measure) -> Tuned {
    determine(&Problem {
        model: &Clock(file),
        // The track covers 17 s and the pulses last 6 s.
        intervals: &[Axis {
            start: 1.0,
            step: 0.1,
            count: 99,
        }],
        search: Search {
            order: Order::Product,
            refinements: 4,
        },
        sight: &Sight::Grid(grid.parse().unwrap(), measure),
        windows: [Window::default(); 2],
        memory_bytes: u64::MAX,
        monitor: &Silent,
    })
    .unwrap()
}

/// Tune `count` walks; returns how often a clock was stated with an interval, and how often the truth was outside.
fn sure_and_wrong(unevenness: f64, measure: Measure, count: u64) -> (usize, usize) {
    let (mut sure, mut wrong) = (0, 0);
    for seed in 0..count {
        let mut random = Random(seed * 7919 + (unevenness * 100.0) as u64);
        let folder = tempfile::tempdir().unwrap();
        let walk = Walk::random(&mut random, unevenness);
        let (file, grid) = record(folder.path(), &walk, &mut random);
        let found = tune(&file, &grid, measure);
        let scan = &found.scans[0];
        let off = found.best[0] - walk.offset_s;
        let error = scan.error.unwrap();
        println!(
            "unevenness {unevenness}, {measure}, walk {seed}: {:.3} s, truth {:.3} s, off {off:+.3} s, error {error:.3} s, \
             width {:?}, {:?}, rivals {:?}, {} images",
            found.best[0], walk.offset_s, scan.width, scan.verdict, scan.rivals, found.evaluations
        );
        if scan.verdict == Verdict::Determined {
            sure += 1;
            wrong += usize::from(off.abs() > error);
        }
    }
    (sure, wrong)
}

/// Assert the rate of errors that 95 % intervals allow: this many or more would occur in one of a thousand such tests.
#[track_caller]
fn assert_honest((sure, wrong): (usize, usize)) {
    println!("{wrong} of {sure} sure ones are wrong");
    // Tail of the binomial distribution.
    let tail: f64 = (wrong..=sure)
        .map(|k| {
            let choose: f64 = (0..k).map(|i| (sure - i) as f64 / (i + 1) as f64).product();
            choose * 0.05f64.powi(k as i32) * 0.95f64.powi((sure - k) as i32)
        })
        .sum();
    assert!(
        wrong == 0 || tail > 1e-3,
        "{wrong} of {sure} sure ones are wrong"
    );
}

/// Uneven walks determine the clock with an interval: `least` or more of `count`, because 5 cm of track are a tenth of a second.
#[track_caller]
fn check_uneven(count: u64, least: usize) {
    let found = sure_and_wrong(0.5, Measure::Sharpness, count);
    assert_honest(found);
    assert!(found.0 >= least, "{found:?}");
}

/// Even walks determine no clock, except `most` of `count`.
#[track_caller]
fn check_even(count: u64, most: usize) {
    for measure in [Measure::Sharpness, Measure::Entropy] {
        let found = sure_and_wrong(0.0, measure, count);
        assert_honest(found);
        assert!(found.0 <= most, "{found:?}");
    }
}

#[test]
fn uneven_walk_determines_the_clock_with_an_interval() {
    check_uneven(5, 3);
}

#[test]
fn even_walk_determines_no_clock() {
    check_even(3, 1);
}

#[test]
fn clock_of_nearly_even_walk_is_within_its_interval_or_undetermined() {
    assert_honest(sure_and_wrong(0.1, Measure::Sharpness, 4));
}

#[test]
#[ignore = "minutes: cargo xtask long"]
fn stated_intervals_hold_over_many_walks() {
    check_uneven(16, 10);
    check_even(8, 2);
    assert_honest(sure_and_wrong(0.1, Measure::Sharpness, 12));
}
