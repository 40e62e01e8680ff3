//! Every former against the sum that defines the image, written out in [`subaperture_tests::plain_sum`]. That module also makes the
//! samples; it uses no code of the library, not even its windows.

use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

use glam::DVec3;
use subaperture::focus::formers::{FORMERS, former};
use subaperture::focus::{ImageFormer, Task};
use subaperture::geometry::{ImageGrid, SceneFrame};
use subaperture::phase_history::{Collection, InMemory, Pulse, Sweep, Weights};
use subaperture_tests::experiment::difference_db;
use subaperture_tests::plain_history::{complex, pixels_m, plain_echoes, plain_sum};
use subaperture_tests::plain_sum::{Complex, LIGHT_M_S, PlainPulse, PlainSum, hamming};

/// Error bound of every former that accepts one, dB.
const BOUND_DB: f64 = -60.0;

/// Rounding of pixels to float32 is 2^-25 in RMS, -150 dB. Rounding of a path of 10 km to float64 is 1e-12 m, 2e-10 rad at 10 GHz, -190 dB.
const EXACT_DB: f64 = -140.0;

/// Recording, grid, weights, and the image by the defining sum.
struct Scene {
    history: InMemory,
    grid: ImageGrid,
    weights: Weights,
    expected: Vec<num_complex::Complex64>,
}

impl Scene {
    /// Ten scatterers within `half_m` of the origin and Hamming weights over frequencies and pulses. `antennas` gives transmitter and
    /// receiver by pulse number, 0 in the middle.
    fn new(
        num_pulses: usize,
        (start_hz, step_hz, num_samples): (f64, f64, usize),
        antennas: impl Fn(f64) -> [[f64; 3]; 2],
        half_m: f64,
        grid: &str,
    ) -> Self {
        let origin_m = |a: [f64; 3]| (a[0] * a[0] + a[1] * a[1] + a[2] * a[2]).sqrt();
        let pulse = |n: usize| {
            let [transmitter_m, receiver_m] = antennas(n as f64 - (num_pulses as f64 - 1.0) / 2.0);
            Pulse {
                time_s: n as f64 * 1e-3,
                transmitter_m: DVec3::from_array(transmitter_m),
                receiver_m: DVec3::from_array(receiver_m),
                reference_m: DVec3::ZERO,
                reference_path_m: origin_m(transmitter_m) + origin_m(receiver_m),
                start_hz,
                step_hz,
                sweep: Sweep::AT_ONCE,
                recorded_path_m: None,
            }
        };
        let collection = Collection {
            name: "defined".to_owned(),
            num_samples,
            pulses: (0..num_pulses).map(pulse).collect(),
            frame: SceneFrame::Local,
            extent: None,
            timed: true,
        };
        // The plastic number's powers: places spread evenly without a lattice.
        let place = |a: f64, i: f64| half_m * (2.0 * (a * i + 0.5).fract() - 1.0);
        let scatterer = |i: u32| {
            let i = f64::from(i);
            let (x, y) = (place(0.754_877_666, i), place(0.569_840_291, i));
            ([x, y, 0.0], [i.cos(), i.sin()])
        };
        let scatterers: Vec<([f64; 3], Complex)> = (0..10).map(scatterer).collect();
        let samples = plain_echoes(&collection, &scatterers);
        let weights = Weights {
            fast: hamming(num_samples),
            slow: hamming(num_pulses),
            illumination: None,
            windows: None,
        };
        let history = InMemory::new(collection, samples).unwrap();
        let grid: ImageGrid = grid.parse().unwrap();
        let points_m: Vec<[f64; 3]> = pixels_m(&grid).iter().map(DVec3::to_array).collect();
        let expected = complex(&plain_sum(&history, &weights).at(&points_m));
        Self {
            history,
            grid,
            weights,
            expected,
        }
    }

    /// Measured and predicted error of a former, dB.
    fn errors_db(&self, former: &dyn ImageFormer) -> [f64; 2] {
        let task = Task::new(&self.history, &self.grid, &self.weights);
        let formed = former.form_best(&task).unwrap();
        assert!(!formed.bound_missed, "{}: bound missed", former.name());
        let measured_db = difference_db(&formed.image.pixels, &self.expected);
        println!(
            "{}: {measured_db:.1} dB, predicted {:.1} dB",
            former.name(),
            formed.predicted_error_db
        );
        [measured_db, formed.predicted_error_db]
    }

    /// Asserts that formers keep their bounds and predictions; returns the measured errors, dB, by name.
    fn judge(&self, names: &[&str]) -> BTreeMap<&'static str, f64> {
        let judged = names.iter().map(|&name| {
            let entry = FORMERS.iter().find(|entry| entry.name == name).unwrap();
            let [measured_db, predicted_db] = self.errors_db(&*entry.within(BOUND_DB));
            let bound_db = if name == "exact" { EXACT_DB } else { BOUND_DB };
            assert!(measured_db <= bound_db, "{name}: {measured_db} dB");
            // 1 dB of tolerance, as the prediction may be a statistical estimate from 64 pixels.
            assert!(
                measured_db <= predicted_db + 1.0,
                "{name}: {measured_db} dB"
            );
            (entry.name, measured_db)
        });
        judged.collect()
    }
}

/// A unit scatterer `x` metres closer than the reference point, seen by a stationary radar: `sum_k exp(-j 2 pi f_k 2 x / c) / K` is the
/// phase of the middle frequency times the Dirichlet kernel.
#[test]
fn plain_sum_of_scatterer_is_dirichlet_kernel() {
    let (start_hz, step_hz, count) = (9.4e9, 3e6, 50);
    let pulse = PlainPulse {
        transmitter_m: [0.0, -800.0, 0.0],
        receiver_m: [0.0, -800.0, 0.0],
        reference_path_m: 1600.0,
        start_hz,
        step_hz,
        weight: 0.7,
    };
    let samples = (0..count).map(|k| pulse.echo(k, &[([0.0; 3], [1.0, 0.0])]));
    let samples: Vec<Complex> = samples.collect();
    for [re, im] in &samples {
        assert!((re - 1.0).abs() < 1e-15 && im.abs() < 1e-15);
    }
    let sum = PlainSum {
        pulses: vec![pulse; 3],
        samples: samples.repeat(3),
        fast: vec![1.0; count],
    };
    let nearer_m: Vec<f64> = (0..40).map(|i| f64::from(i) * 0.37 - 7.0).collect();
    let points_m: Vec<[f64; 3]> = nearer_m.iter().map(|&x| [0.0, -x, 0.0]).collect();
    for (x, [re, im]) in nearer_m.iter().zip(sum.at(&points_m)) {
        let delay_s = -2.0 * x / LIGHT_M_S;
        let half = PI * step_hz * delay_s;
        let kernel = match half == 0.0 {
            true => 1.0,
            false => (half * count as f64).sin() / (half.sin() * count as f64),
        };
        let phase = TAU * (start_hz + step_hz * (count as f64 - 1.0) / 2.0) * delay_s;
        let (expected_re, expected_im) = (kernel * phase.cos(), kernel * phase.sin());
        // Paths of 1600 m in float64 are exact to 2e-13 m, 5e-11 rad at 9.4 GHz; the phase of 3000 rad to 5e-13.
        let off = (re - expected_re).hypot(im - expected_im);
        assert!(off < 1e-10, "{x}: {re} {im}, {expected_re} {expected_im}");
    }
}

/// A straight pass that every former accepts: 50 m of track at 5 km, 200 MHz at 10 GHz.
#[test]
fn every_former_forms_the_defining_sum_of_a_straight_pass() {
    let scene = Scene::new(
        400,
        (9.9e9, 200e6 / 128.0, 128),
        |n| [[0.125 * n, -4330.0, 2500.0]; 2],
        7.0,
        "x=-9:9:0.71,y=-9:9:0.67",
    );
    let names = FORMERS.map(|entry| entry.name);
    assert_eq!(scene.judge(&names).len(), FORMERS.len());

    // The thesis's mode has no bound; its prediction holds: -18.7 dB on Table 4.1 with 40 pulses in each sub-CPI.
    let thesis = former(
        "rdbp",
        &serde_json::json!({ "mode": { "thesis": {} }, "sub_cpi": 40 }),
    );
    let [measured_db, predicted_db] = scene.errors_db(&*thesis.unwrap());
    assert!(measured_db < -12.0 && measured_db <= predicted_db + 1.0);
}

/// Formers for any track: two antennas on bent tracks, a tilted plane and a polar grid.
#[test]
fn formers_for_any_track_form_the_defining_sum_of_a_bent_bistatic_one() {
    let antennas = |n: f64| {
        let angle = n * 1.5e-4;
        let bend_m = 2e-4 * n * n;
        [
            [-6000.0, 300.0 + bend_m, 4000.0],
            [5000.0 * angle.sin(), -5000.0 * angle.cos(), 3000.0 - bend_m],
        ]
    };
    for grid in [
        "x=-14:14:1.3,y=-12:12:1.1,yaw=30,pitch=10,roll=-5",
        "r=3:16:1.1,theta=-80:80:8,cx=-10,cy=3",
    ] {
        let scene = Scene::new(300, (9.7e9, 1.9e6, 120), antennas, 12.0, grid);
        scene.judge(&["exact", "bp", "ffbp", "rdbp", "auto"]);
    }
}
