//! Accumulators of the core, end to end: a point simulated in float64 must focus to amplitude 1 and phase 0.

use std::f64::consts::{PI, TAU};

use num_complex::{Complex32, Complex64};
use subaperture_core::accumulate::{Centre, PixelGrid, add_map, add_power};
use subaperture_core::keystone::KeystoneTable;
use subaperture_core::{Axes, Map, Params, Plan, Shape, Tables, Window};

const C: f64 = 299_792_458.0;
const FREQUENCIES: usize = 32;
const START_HZ: f64 = 9.9e9;
const STEP_HZ: f64 = 6.25e6;

fn length(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
}

/// Samples of a unit scatterer at a relative path.
fn echo(num_frequencies: usize, path_m: f64) -> Vec<Complex32> {
    (0..num_frequencies)
        .map(|k| {
            let z = Complex64::cis(-TAU * (START_HZ + k as f64 * STEP_HZ) * path_m / C);
            Complex32::new(z.re as f32, z.im as f32)
        })
        .collect()
}

fn along(start: [f64; 3], velocity: [f64; 3], pulses: f64) -> [f64; 3] {
    [0, 1, 2].map(|i| start[i] + velocity[i] * pulses)
}

/// Antennas on straight tracks, bistatic and both moving. The reference path is that of a moving point plus a clock drift, so
/// that no error cancels by chance.
struct Tracks {
    pulses: usize,
}

impl Tracks {
    const TRANSMITTER: ([f64; 3], [f64; 3]) = ([-300.0, -4000.0, 2000.0], [0.11, 0.02, -0.01]);
    const RECEIVER: ([f64; 3], [f64; 3]) = ([500.0, -4100.0, 1500.0], [0.07, -0.05, 0.03]);
    const REFERENCE: ([f64; 3], [f64; 3]) = ([3.0, -2.0, 1.0], [0.001, 0.002, 0.0]);

    /// Two-way path to `point` and reference path, `p` pulses from the mean pulse of the sub-CPI.
    fn paths(p: f64, point: [f64; 3]) -> (f64, f64) {
        let (t, r) = (
            along(Self::TRANSMITTER.0, Self::TRANSMITTER.1, p),
            along(Self::RECEIVER.0, Self::RECEIVER.1, p),
        );
        let reference = along(Self::REFERENCE.0, Self::REFERENCE.1, p);
        (
            length(point, t) + length(point, r),
            length(reference, t) + length(reference, r) + 0.0005 * p,
        )
    }

    fn pulse(&self, m: usize, point: [f64; 3]) -> Vec<Complex32> {
        let (path, reference) = Self::paths(m as f64 - (self.pulses as f64 - 1.0) / 2.0, point);
        echo(FREQUENCIES, path - reference)
    }

    /// Centre state. The rate of the reference path is a central difference, with an error of its third derivative over 24: below
    /// 1e-12 m per pulse here.
    fn centre() -> Centre {
        let reference = |p| Self::paths(p, [0.0; 3]).1;
        Centre {
            transmitter_m: Self::TRANSMITTER.0,
            transmitter_m_per_pulse: Self::TRANSMITTER.1,
            receiver_m: Self::RECEIVER.0,
            receiver_m_per_pulse: Self::RECEIVER.1,
            reference_path_m: reference(0.0),
            reference_path_m_per_pulse: reference(0.5) - reference(-0.5),
        }
    }

    /// Maximum deviation of the relative path from a straight line over the sub-CPI, in radians.
    fn curvature_rad(&self, point: [f64; 3]) -> f64 {
        let half = (self.pulses as f64 - 1.0) / 2.0;
        let relative = |p| {
            let (path, reference) = Self::paths(p, point);
            path - reference
        };
        let bend = (relative(half) + relative(-half)) / 2.0 - relative(0.0);
        TAU * (START_HZ + FREQUENCIES as f64 * STEP_HZ) / C * bend.abs()
    }
}

const PARAMS: Params<'static> = Params {
    start_hz: START_HZ,
    step_hz: STEP_HZ,
    fast_window: Window::Rectangular,
    slow_window: Window::Rectangular,
};

/// Axes and samples of the exact map of these pulses.
fn map_of(pulses: &[Vec<Complex32>], range_bins: usize, doppler_bins: usize) -> MapOf {
    let shape = Shape {
        num_pulses: pulses.len(),
        num_frequencies: pulses[0].len(),
        num_range_bins: range_bins,
        num_doppler_bins: doppler_bins,
    };
    let mut fast = vec![0.0; shape.num_frequencies];
    let mut slow = vec![0.0; shape.num_pulses];
    let tables = Tables {
        fast_weights: &mut fast,
        slow_weights: &mut slow,
        keystone: KeystoneTable::ChirpZ {
            length: shape.chirp_length(),
        },
    };
    let plan = Plan::new(shape, &PARAMS, tables).unwrap();
    let mut history = vec![Complex32::ZERO; shape.history_len()];
    let mut scratch = vec![Complex32::ZERO; plan.scratch_len()];
    let mut samples = vec![Complex32::ZERO; shape.map_len()];
    for (m, pulse) in pulses.iter().enumerate() {
        plan.window(m, pulse, &mut history).unwrap();
    }
    plan.process(&history, &mut scratch, &mut samples).unwrap();
    MapOf {
        axes: *plan.axes(),
        samples,
    }
}

struct MapOf {
    axes: Axes,
    samples: Vec<Complex32>,
}

impl MapOf {
    fn view(&self) -> Map<'_> {
        Map::new(self.axes, &self.samples).unwrap()
    }
}

fn one_pixel(point: [f64; 3]) -> PixelGrid {
    PixelGrid {
        origin_m: point,
        column_step_m: [0.0; 3],
        row_step_m: [0.0; 3],
        num_columns: 1,
        num_rows: 1,
    }
}

/// Pixel on the scatterer, from a map oversampled by 8 in both axes.
///
/// Tolerance: linear interpolation, pi^2/24 (1/8^2 + 1/8^2) = 0.0129 of the peak. For an even number of frequencies or
/// pulses the centroid of the aperture is half a cell from the reference, which rotates the phase by a sawtooth that
/// interpolation also follows: second moment 1/12 + (1/(2N))^2, a factor 1 + 3/N^2. Curvature of the path: its largest
/// phase. Rounding: 1e-5.
fn focused(num_pulses: usize, point: [f64; 3]) -> (Complex32, f64) {
    let tracks = Tracks { pulses: num_pulses };
    let pulses: Vec<_> = (0..num_pulses).map(|m| tracks.pulse(m, point)).collect();
    let map = map_of(&pulses, 256, 128);
    let (grid, centre) = (one_pixel(point), Tracks::centre());
    let mut pixel = [Complex32::ZERO];
    let inside = add_map(&mut pixel, &grid, &map.view(), &centre, 1.0).unwrap();
    assert_eq!(inside, 1);
    let padding = |bins: f64, n: f64| (1.0 + 3.0 / (n * n)) * (n / bins).powi(2);
    let between =
        PI * PI / 24.0 * (padding(256.0, FREQUENCIES as f64) + padding(128.0, num_pulses as f64));
    (pixel[0], between + tracks.curvature_rad(point) + 1e-5)
}

#[test]
fn simulated_point_focuses_to_amplitude_one_and_phase_zero() {
    for point in [
        [0.0, 0.0, 0.0],
        [4.0, 9.0, 0.0],
        [-11.3, 2.7, 1.9],
        [7.7, -8.1, -3.3],
    ] {
        for m in [16, 15, 1] {
            let (pixel, tolerance) = focused(m, point);
            let error = f64::from((pixel - 1.0).norm());
            println!("{point:?}, {m} pulses: error {error:.5}, tolerance {tolerance:.5}");
            assert!(tolerance < 0.02, "the tolerance is too large");
            assert!(error < tolerance, "{pixel}, {tolerance}");
        }
    }
}

/// If a point falls exactly on bins and its path is straight, interpolation and curvature do not contribute: the map has the
/// phase of its reference pulse and frequency, and the pixel is 1. A monostatic radar flies straight at the point, 3 Doppler
/// bins and 5 range bins from a stationary reference.
///
/// Tolerance: rounding. Two transforms of 32 points and one of 64 have 16 levels, each with an independent error of about
/// u = 2^-24 of the norm: 4 u. The norm spreads over twice as many bins as there are samples in range, and over L/M = 2 in
/// the chirp-z convolution: 2 times as much relative to the peak, 5e-7. Four times that is allowed.
fn on_a_bin(num_pulses: usize, num_frequencies: usize) {
    const TOLERANCE: f32 = 2e-6;
    let (range_bins, doppler_bins) = (5.0, 3.0);
    let reference_hz = START_HZ + (num_frequencies / 2) as f64 * STEP_HZ;
    let mean_pulse = (num_pulses as f64 - 1.0) / 2.0;
    // Paths at the map's reference pulse M/2 and at the mean pulse, and their rate.
    let rate_m = -doppler_bins * C / (16.0 * reference_hz);
    let reference_pulse_m = range_bins * C / (64.0 * STEP_HZ);
    let mean_m = reference_pulse_m - rate_m * ((num_pulses / 2) as f64 - mean_pulse);

    let path_m = |m: usize| mean_m + rate_m * (m as f64 - mean_pulse);
    let pulses: Vec<_> = (0..num_pulses)
        .map(|m| echo(num_frequencies, path_m(m)))
        .collect();
    let map = map_of(&pulses, 64, 16);
    let map = map.view();
    let exact = Complex64::cis(-TAU * reference_hz * reference_pulse_m / C);
    let exact = Complex32::new(exact.re as f32, exact.im as f32);
    let in_map = (map.at(8 + 3, 32 + 5) - exact).norm();

    let velocity = [0.0, -rate_m / 2.0, 0.0];
    let centre = Centre {
        transmitter_m: [0.0; 3],
        transmitter_m_per_pulse: velocity,
        receiver_m: [0.0; 3],
        receiver_m_per_pulse: velocity,
        reference_path_m: 2000.0,
        reference_path_m_per_pulse: 0.0,
    };
    let point = [0.0, 1000.0 + mean_m / 2.0, 0.0];
    let mut pixel = [Complex32::ZERO];
    add_map(&mut pixel, &one_pixel(point), &map, &centre, 0.5).unwrap();
    let in_image = (pixel[0] - 0.5).norm();
    println!(
        "{num_pulses} pulses, {num_frequencies} frequencies: map {in_map:.1e}, image {in_image:.1e}"
    );
    assert!(in_map < TOLERANCE && in_image < TOLERANCE / 2.0);
}

#[test]
fn on_a_bin_the_phase_is_exact() {
    on_a_bin(16, 32);
    on_a_bin(15, 32);
    on_a_bin(16, 31);
    on_a_bin(15, 31);
}

/// Sub-CPIs from different positions add in phase: eight of them still give 1.
#[test]
fn sub_cpis_add_in_phase() {
    let point = [2.5, -1.5, 0.0];
    let mut pixels = [Complex32::ZERO; 9];
    let grid = PixelGrid {
        origin_m: [1.5, -2.5, 0.0],
        column_step_m: [1.0, 0.0, 0.0],
        row_step_m: [0.0, 1.0, 0.0],
        num_columns: 3,
        num_rows: 3,
    };
    let antenna = |m: f64| [0.25 * (m - 64.0), -3000.0, 1000.0];
    for first in (0..128).step_by(16) {
        let pulses: Vec<_> = (first..first + 16)
            .map(|m| {
                let at = antenna(f64::from(m));
                echo(
                    FREQUENCIES,
                    2.0 * (length(point, at) - length([0.0; 3], at)),
                )
            })
            .collect();
        let map = map_of(&pulses, 256, 128);
        let mean_pulse = f64::from(first) + 7.5;
        let centre = Centre::monostatic(antenna(mean_pulse), [0.25, 0.0, 0.0], [0.0; 3]);
        let reached = add_map(&mut pixels, &grid, &map.view(), &centre, 1.0 / 8.0);
        assert_eq!(reached, Ok(9));
    }
    // Bilinear bound as above, 0.0130. Curvature of the relative path over 16 pulses: the reference compensates all except
    // terms in x^2 d / R^2, (2 m)^2 * 2.5 m / (3162 m)^2 * 2 = 2e-6 m, 4e-4 rad.
    let centre = pixels[4];
    assert!((centre - 1.0).norm() < 0.0135, "{centre}");
    // The resolution is C / (2 * 200 MHz) = 0.75 m and about 1.4 m: the corners are off the main lobe.
    assert!(pixels[0].norm() < 0.5);
}

#[test]
fn pixels_outside_map_have_no_contribution() {
    let shape = Shape {
        num_pulses: 4,
        num_frequencies: 4,
        num_range_bins: 4,
        num_doppler_bins: 4,
    };
    let axes = Axes::new(shape, 1.0e9, 1.0e6).unwrap();
    let ones = [Complex32::ONE; 16];
    let map = Map::new(axes, &ones).unwrap();
    // Paths are those of a monostatic radar at the origin: range bins of 75 m two-way.
    let centre = Centre::monostatic([0.0; 3], [0.0; 3], [0.0, 1000.0, 0.0]);
    let grid = PixelGrid {
        origin_m: [0.0, 900.0, 0.0],
        column_step_m: [0.0, 20.0, 0.0],
        row_step_m: [0.0; 3],
        num_columns: 10,
        num_rows: 1,
    };
    // Bins 0 to 3 are 1000 m - 75 m to 1000 m + 37.5 m: 940, 960, 980, 1000, 1020 m.
    let mut pixels = [Complex32::ZERO; 10];
    assert_eq!(add_map(&mut pixels, &grid, &map, &centre, 1.0), Ok(5));
    for (i, pixel) in pixels.iter().enumerate() {
        assert_eq!((2..7).contains(&i), *pixel != Complex32::ZERO, "{i}");
    }
    // At the antenna the direction is undefined: the pixel has no contribution rather than NaN.
    let at_antenna = one_pixel([0.0; 3]);
    let mut pixel = [Complex32::ZERO];
    assert_eq!(add_map(&mut pixel, &at_antenna, &map, &centre, 1.0), Ok(0));
    assert_eq!(pixel, [Complex32::ZERO]);
}

#[test]
fn lengths_are_checked_and_powers_add() {
    let shape = Shape {
        num_pulses: 2,
        num_frequencies: 2,
        num_range_bins: 4,
        num_doppler_bins: 2,
    };
    // n maps of 3 + 4j: 25 n in float32 is exact.
    let samples = [Complex32::new(3.0, 4.0); 8];
    let map = Map::new(Axes::new(shape, 1.0e9, 1.0e6).unwrap(), &samples).unwrap();
    let centre = Centre::monostatic([0.0; 3], [0.0; 3], [0.0, 1000.0, 0.0]);
    let grid = PixelGrid {
        num_columns: 4,
        num_rows: 2,
        ..one_pixel([0.0; 3])
    };
    let mut few = [Complex32::ZERO; 7];
    assert!(add_map(&mut few, &grid, &map, &centre, 1.0).is_err());
    let endless = PixelGrid {
        num_columns: usize::MAX,
        ..grid
    };
    assert!(add_map(&mut few, &endless, &map, &centre, 1.0).is_err());
    assert_eq!(few, [Complex32::ZERO; 7]);

    let mut power = [0.0; 8];
    for _ in 0..1000 {
        add_power(&mut power, map.samples()).unwrap();
    }
    assert_eq!(power, [25e3; 8]);
    assert!(add_power(&mut power[..7], map.samples()).is_err());
}
