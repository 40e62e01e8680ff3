//! The live image after every push, against the plain sum and against backprojection of the same pulses.

use std::sync::atomic::{AtomicUsize, Ordering};

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use subaperture::focus::bp::Backprojection;
use subaperture::focus::exact::Exact;
use subaperture::focus::live::{Live, LiveError, Settings};
use subaperture::focus::{FormError, ImageFormer, Task};
use subaperture::geometry::ImageGrid;
use subaperture::image::Image;
use subaperture::monitor::Monitor;
use subaperture::phase_history::{PhaseHistory, Pulse, PulseRange, Weights};
use subaperture::radar::Motion;
use subaperture::signal::window::Window;
use subaperture::simulate::{Experiment, Recording};
use subaperture_tests::experiment::{
    IDEAL, PAIR, difference_db, experiment, five_points, fmcw, point, read_whole,
};
use subaperture_tests::plain_history::{complex, pixels_m, plain_pulse, plain_samples};
use subaperture_tests::plain_sum::hamming;

const PULSES: usize = 96;

fn pass() -> Experiment {
    let mut experiment = experiment(IDEAL, five_points());
    experiment.radar.num_pulses = PULSES;
    experiment
}

fn grid() -> ImageGrid {
    "x=-16:16:1.23,y=-16:16:1.19,z=0".parse().unwrap()
}

/// Pulses with their samples.
struct Pulses {
    pulses: Vec<Pulse>,
    samples: Vec<Complex32>,
    width: usize,
}

impl Pulses {
    fn of(recording: &Recording) -> Self {
        Self {
            pulses: recording.collection().pulses.clone(),
            samples: read_whole(recording),
            width: recording.collection().num_samples,
        }
    }

    fn row(&self, n: usize) -> &[Complex32] {
        &self.samples[n * self.width..(n + 1) * self.width]
    }

    fn push(&self, live: &mut Live, n: usize) {
        live.push(&self.pulses[n], self.row(n)).unwrap();
    }
}

/// Contribution of one pulse to every pixel, weighted over its samples and not normalised.
fn one_pulse(
    pulse: &Pulse,
    row: &[Complex32],
    weights: &[f64],
    grid: &ImageGrid,
) -> Vec<Complex64> {
    let (pulse, row) = (plain_pulse(pulse, 1.0), plain_samples(row));
    let pixel = |at: DVec3| {
        let path_m = pulse.relative_path_m(at.to_array());
        pulse.matched(&row, weights, |_| path_m)
    };
    complex(&pixels_m(grid).into_iter().map(pixel).collect::<Vec<_>>())
}

fn error_db(image: &Image, expected: &[Complex64]) -> f64 {
    difference_db(&image.pixels, expected)
}

fn widened(image: &Image) -> Vec<Complex64> {
    let pixels = image.pixels.iter();
    pixels
        .map(|z| Complex64::new(z.re.into(), z.im.into()))
        .collect()
}

/// The image of pulses `from..to` by `former`, without windows.
fn formed(
    former: &dyn ImageFormer,
    history: &dyn PhaseHistory,
    [from, to]: [usize; 2],
    grid: &ImageGrid,
) -> Image {
    let stretch = PulseRange::new(history, from..to);
    let weights = Weights::new(stretch.collection(), Window::None, Window::None);
    let task = Task {
        memory_bytes: 1 << 28,
        ..Task::new(&stretch, grid, &weights)
    };
    former.form_best(&task).unwrap().image
}

fn unweighted() -> Settings {
    Settings::default().window(Window::None)
}

#[test]
fn image_after_every_push_is_that_of_pulses_so_far() {
    let (experiment, grid) = (pass(), grid());
    let recording = experiment.record(PAIR).unwrap();
    let pulses = Pulses::of(&recording);
    for (window, weights) in [
        (Window::None, vec![1.0; pulses.width]),
        (Window::Hamming, hamming(pulses.width)),
    ] {
        let mut live = Live::new(&grid, pulses.width, &Settings::default().window(window)).unwrap();
        assert!(live.image().pixels.iter().all(|z| *z == Complex32::ZERO));
        let mut sum = vec![Complex64::ZERO; grid.num_pixels() as usize];
        let mut worst_db = f64::NEG_INFINITY;
        for n in 0..PULSES {
            pulses.push(&mut live, n);
            assert_eq!(live.num_pulses(), n + 1);
            let own = one_pulse(&pulses.pulses[n], pulses.row(n), &weights, &grid);
            sum.iter_mut().zip(own).for_each(|(sum, z)| *sum += z);
            let norm = (n + 1) as f64 * weights.iter().sum::<f64>();
            let expected: Vec<Complex64> = sum.iter().map(|z| z / norm).collect();
            let (image, accuracy) = (live.image(), live.accuracy());
            let measured_db = error_db(&image, &expected);
            worst_db = worst_db.max(measured_db);
            assert!(measured_db < -60.0, "{n}: {measured_db}");
            assert!(
                measured_db < accuracy.predicted_db() + 1.0,
                "{n}: {accuracy:?}"
            );
            assert!(accuracy.predicted_db() < -60.0, "{n}: {accuracy:?}");
            if window == Window::None && n % 16 == 6 {
                let bp = formed(&Backprojection::default(), &recording, [0, n + 1], &grid);
                let off_db = error_db(&image, &widened(&bp));
                // Both round profiles of differently scaled samples to float32: 3.3e-7 each, -126 dB; bp also rounds its sums.
                assert!(off_db < -120.0, "{n}: {off_db}");
            }
        }
        println!(
            "{window}: {worst_db:.1} dB at the worst push, {:?}",
            live.accuracy()
        );
    }
}

#[test]
fn image_is_independent_of_push_order() {
    let (experiment, grid) = (pass(), grid());
    let pulses = Pulses::of(&experiment.record(PAIR).unwrap());
    let in_order = |order: &dyn Fn(usize) -> usize| {
        let mut live = Live::new(&grid, pulses.width, &unweighted()).unwrap();
        (0..PULSES).for_each(|n| pulses.push(&mut live, order(n)));
        live.image()
    };
    let forth = in_order(&|n| n);
    // 37 has no common factor with 96.
    for order in [&(|n| PULSES - 1 - n) as &dyn Fn(usize) -> usize, &|n| {
        n * 37 % PULSES
    }] {
        // Contributions of pulses are bit-identical; the order of float64 sums changes them by 1e-16, which may change their rounding to
        // float32.
        let off_db = error_db(&in_order(order), &widened(&forth));
        assert!(off_db < -150.0, "{off_db}");
    }
}

#[test]
fn live_image_keeps_bound_without_excess() {
    let (experiment, grid) = (pass(), grid());
    let recording = experiment.record(PAIR).unwrap();
    let pulses = Pulses::of(&recording);
    let exact = widened(&formed(&Exact, &recording, [0, PULSES], &grid));
    for bound_db in [-30.0, -50.0, -80.0] {
        let settings = unweighted().error_db(bound_db);
        let mut live = Live::new(&grid, pulses.width, &settings).unwrap();
        (0..PULSES).for_each(|n| pulses.push(&mut live, n));
        let (measured_db, accuracy) = (error_db(&live.image(), &exact), live.accuracy());
        println!("{bound_db} dB asked: {measured_db:.1} dB, {accuracy:?}");
        // The error is not much below the bound: 4 dB of margin, lengths rounded up (by a quarter at most: 6 to 8 dB), and 7 to 9 dB less
        // for a flat band.
        assert!(
            measured_db < bound_db && measured_db > bound_db - 22.0,
            "{measured_db}"
        );
        assert!(measured_db < accuracy.predicted_db() + 1.0 && accuracy.predicted_db() < bound_db);
    }
    // Samples beyond float32 are refused pulse by pulse.
    let mut live = Live::new(&grid, pulses.width, &unweighted().error_db(-140.0)).unwrap();
    let error = live.push(&pulses.pulses[0], pulses.row(0)).unwrap_err();
    assert!(
        matches!(error, LiveError::Form(FormError::BoundMissed { .. })),
        "{error}"
    );
    assert_eq!(live.num_pulses(), 0);
}

#[test]
fn dark_grid_is_reported() {
    let mut experiment = pass();
    // A scatterer of amplitude 1 outside the grid, one of 1e-6 in it.
    experiment.scene.points = vec![point(-13.0, 12.0, 1.0), point(6.0, -10.0, 1e-6)];
    let recording = experiment.record(PAIR).unwrap();
    let pulses = Pulses::of(&recording);
    let grid: ImageGrid = "x=5.5:7:0.11,y=-11:-9.5:0.13,z=0".parse().unwrap();
    // A bound that the plan meets with a small margin.
    let settings = unweighted().error_db(-50.0);
    let mut live = Live::new(&grid, pulses.width, &settings).unwrap();
    (0..PULSES).for_each(|n| pulses.push(&mut live, n));
    let exact = widened(&formed(&Exact, &recording, [0, PULSES], &grid));
    let (measured_db, accuracy) = (error_db(&live.image(), &exact), live.accuracy());
    println!("dark grid: {measured_db:.1} dB, {accuracy:?}");
    assert!(measured_db > accuracy.planned_db, "the grid is not dark");
    assert!(measured_db < accuracy.predicted_db() + 1.0);
    assert!(measured_db > accuracy.predicted_db() - 12.0);
    assert_eq!(accuracy.num_sampled, 64);
}

/// Counts calls of `cancelled` and stops at the call `most`.
struct Counting {
    asked: AtomicUsize,
    most: usize,
}

impl Counting {
    fn new(most: usize) -> Self {
        let asked = AtomicUsize::new(0);
        Self { asked, most }
    }
}

impl Monitor for Counting {
    fn progress(&self, _: f64) {}

    fn cancelled(&self) -> bool {
        self.asked.fetch_add(1, Ordering::Relaxed) >= self.most
    }
}

#[test]
fn invalid_pulses_are_refused_and_leave_image_unchanged() {
    let (experiment, grid) = (pass(), grid());
    let pulses = Pulses::of(&experiment.record(PAIR).unwrap());
    for settings in [unweighted(), unweighted().last_pulses(5)] {
        let mut live = Live::new(&grid, pulses.width, &settings).unwrap();
        (0..7).for_each(|n| pulses.push(&mut live, n));
        let (before, accuracy, count) = (live.image(), live.accuracy(), live.num_pulses());
        let (good, row) = (&pulses.pulses[7], pulses.row(7));
        let spoilt = |spoil: &dyn Fn(&mut Pulse)| {
            let mut pulse = *good;
            spoil(&mut pulse);
            pulse
        };
        let of_samples = |at: usize, value: Complex32| {
            let mut row = row.to_vec();
            row[at] = value;
            row
        };
        let nan = Complex32::new(0.0, f32::NAN);
        let refused = [
            (*good, of_samples(3, nan), "sample 3 of the pulse"),
            (
                *good,
                of_samples(63, Complex32::new(f32::INFINITY, 0.0)),
                "sample 63",
            ),
            (*good, row[1..].to_vec(), "got 63"),
            (*good, Vec::new(), "got 0"),
            (
                spoilt(&|p| p.transmitter_m.y = f64::NAN),
                row.to_vec(),
                "transmitter",
            ),
            (
                spoilt(&|p| p.receiver_m.x = 1e300),
                row.to_vec(),
                "receiver",
            ),
            (
                spoilt(&|p| p.reference_path_m = f64::INFINITY),
                row.to_vec(),
                "reference path",
            ),
            (spoilt(&|p| p.start_hz = 0.0), row.to_vec(), "frequency"),
            (
                spoilt(&|p| p.sweep.sample_s = f64::NAN),
                row.to_vec(),
                "finite",
            ),
            // Finite samples whose products overflow.
            (
                *good,
                vec![Complex32::new(f32::MAX, f32::MAX); row.len()],
                "not a finite number",
            ),
        ];
        for (pulse, row, part) in &refused {
            let error = live.push(pulse, row).unwrap_err().to_string();
            assert!(error.contains(part), "{part}: {error}");
            assert_eq!(live.image().pixels, before.pixels, "{part}");
            assert_eq!(
                (live.accuracy(), live.num_pulses()),
                (accuracy, count),
                "{part}"
            );
        }
        // Cancelled at any point, in the new pulse or in the one that leaves the window.
        let whole = Counting::new(usize::MAX);
        let mut other = Live::new(&grid, pulses.width, &settings).unwrap();
        (0..7).for_each(|n| pulses.push(&mut other, n));
        other.push_watched(good, row, &whole).unwrap();
        for most in 0..whole.asked.load(Ordering::Relaxed) {
            let stopped = live
                .push_watched(good, row, &Counting::new(most))
                .unwrap_err();
            assert!(
                matches!(stopped, LiveError::Form(FormError::Cancelled)),
                "{stopped}"
            );
            assert_eq!(live.image().pixels, before.pixels, "{most}");
        }
        // The next push succeeds.
        pulses.push(&mut live, 7);
        assert_eq!(live.image().pixels, other.image().pixels);
    }
}

#[test]
fn cost_of_push_is_independent_of_earlier_pulses() {
    let (experiment, grid) = (pass(), grid());
    let pulses = Pulses::of(&experiment.record(PAIR).unwrap());
    let work = |settings: &Settings| {
        let mut live = Live::new(&grid, pulses.width, settings).unwrap();
        let held = live.held_bytes();
        let each = (0..3 * PULSES).map(|n| {
            let counting = Counting::new(usize::MAX);
            let n = n % PULSES;
            live.push_watched(&pulses.pulses[n], pulses.row(n), &counting)
                .unwrap();
            assert_eq!(live.held_bytes(), held);
            counting.asked.load(Ordering::Relaxed)
        });
        let each: Vec<usize> = each.collect();
        (each, live.pixels_a_push())
    };
    // The monitor is called once for every patch of pixels, and once after each pulse.
    let (each, pixels) = work(&unweighted());
    let once = each[0];
    assert!(
        once >= 2 && each.iter().all(|&count| count == once),
        "{each:?}"
    );
    assert_eq!(pixels, grid.num_pixels());
    let (each, pixels) = work(&unweighted().last_pulses(20));
    let expected = (0..3 * PULSES).map(|n| if n < 20 { once } else { 2 * once });
    assert_eq!(each, expected.collect::<Vec<_>>());
    assert_eq!(pixels, 2 * grid.num_pixels());
}

#[test]
fn sliding_window_shows_last_pulses_without_residue_of_older_ones() {
    const LAST: usize = 16;
    let (experiment, grid) = (pass(), grid());
    let mut pulses = Pulses::of(&experiment.record(PAIR).unwrap());
    // One pulse 180 dB above the others: in float32 sums its rounding error would be 60 times the other pulses' sum.
    let strong = 20;
    let width = pulses.width;
    (pulses.samples[strong * width..(strong + 1) * width].iter_mut()).for_each(|z| *z *= 1e9);
    let settings = unweighted().last_pulses(LAST);
    let mut live = Live::new(&grid, width, &settings).unwrap();
    let weights = vec![1.0; width];
    for n in 0..PULSES {
        pulses.push(&mut live, n);
        let from = (n + 1).saturating_sub(LAST);
        assert_eq!(live.num_pulses(), n + 1 - from);
        let mut sum = vec![Complex64::ZERO; grid.num_pixels() as usize];
        for m in from..=n {
            let own = one_pulse(&pulses.pulses[m], pulses.row(m), &weights, &grid);
            sum.iter_mut().zip(own).for_each(|(sum, z)| *sum += z);
        }
        let norm = ((n + 1 - from) * width) as f64;
        let expected: Vec<Complex64> = sum.iter().map(|z| z / norm).collect();
        let measured_db = error_db(&live.image(), &expected);
        let accuracy = live.accuracy();
        assert!(measured_db < -60.0, "{n}: {measured_db}");
        assert!(
            measured_db < accuracy.predicted_db() + 1.0,
            "{n}: {measured_db}, {accuracy:?}"
        );
        // Every `LAST` pulses the sums are computed anew.
        if (n + 1) % LAST == 0 {
            let mut fresh = Live::new(&grid, width, &unweighted()).unwrap();
            (from..=n).for_each(|m| pulses.push(&mut fresh, m));
            assert_eq!(live.image().pixels, fresh.image().pixels, "{n}");
        } else if !(strong..strong + LAST).contains(&n) && n > LAST {
            // Between these the error is at most 3 (M + 1) 2^-53 of the strongest value, 1e9 times the scatterers' sum of about 5.
            let mut fresh = Live::new(&grid, width, &unweighted()).unwrap();
            (from..=n).for_each(|m| pulses.push(&mut fresh, m));
            let most = 3.0 * (LAST + 1) as f64 * 2f64.powi(-53) * 5e9;
            // Plus one rounding of each to float32.
            let (live, fresh) = (live.image(), fresh.image());
            for (a, b) in live.pixels.iter().zip(&fresh.pixels) {
                assert!(
                    f64::from((a - b).norm()) < most + 2.4e-7 * f64::from(b.norm()),
                    "{n}: {a} {b}"
                );
            }
        }
    }
}

/// The recorded delays of pulse 1 end at the origin's: pixels beyond are zero as long as this pulse belongs to the aperture.
#[test]
fn pixels_outside_recorded_delays_of_a_pulse_are_zero() {
    let (experiment, grid) = (pass(), grid());
    let mut pulses = Pulses::of(&experiment.record(PAIR).unwrap());
    let settings = unweighted().last_pulses(3);
    let mut whole = Live::new(&grid, pulses.width, &settings).unwrap();
    (0..4).for_each(|n| pulses.push(&mut whole, n));
    let path_m =
        |pulse: &Pulse, at: DVec3| at.distance(pulse.transmitter_m) + at.distance(pulse.receiver_m);
    let end_m = path_m(&pulses.pulses[1], DVec3::ZERO);
    pulses.pulses[1].recorded_path_m = Some([0.5 * end_m, end_m]);
    let mut live = Live::new(&grid, pulses.width, &settings).unwrap();
    (0..4).for_each(|n| pulses.push(&mut live, n));
    let mut num_zero = 0;
    let pixels = live.image().pixels.into_iter().zip(whole.image().pixels);
    for (point_m, (own, of_whole)) in pixels_m(&grid).into_iter().zip(pixels) {
        let covered = path_m(&pulses.pulses[1], point_m) <= end_m;
        num_zero += usize::from(!covered);
        let expected = if covered { of_whole } else { Complex32::ZERO };
        assert_eq!(own, expected, "{point_m}");
    }
    assert!(num_zero > 100, "{num_zero}");
    assert!(live.accuracy().measured_db < -60.0);
    // Pulse 1 leaves the aperture of pulses 2 to 4; its values were added and subtracted at covered pixels only.
    for live in [&mut live, &mut whole] {
        pulses.push(live, 4);
    }
    assert!(difference_db(&live.image().pixels, &widened(&whole.image())) < -120.0);
}

#[test]
fn memory_is_bounded_and_refused_beyond_bound() {
    let grid = grid();
    let mut settings = unweighted().memory_bytes(1 << 20);
    let live = Live::new(&grid, 64, &settings).unwrap();
    // 28 bytes for each pixel, and the window.
    assert_eq!(live.held_bytes(), u128::from(grid.num_pixels()) * 28 + 512);
    for count in [4000, usize::MAX] {
        settings = settings.last_pulses(count);
        match Live::new(&grid, 64, &settings).err().unwrap() {
            LiveError::Memory {
                needed_bytes,
                allowed_bytes,
            } => {
                let own = u128::from(grid.num_pixels()) * 56 + 512;
                assert_eq!(needed_bytes, own + count as u128 * (64 * 8 + 264));
                assert_eq!(allowed_bytes, 1 << 20);
            }
            error => panic!("{error}"),
        }
    }
    for (samples, settings) in [(0, unweighted()), (64, unweighted().last_pulses(0))] {
        let error = Live::new(&grid, samples, &settings).err().unwrap();
        assert!(matches!(error, LiveError::Empty), "{error}");
    }
}

/// Intra-pulse motion is compensated as by backprojection.
#[test]
fn intra_pulse_motion_is_compensated() {
    let mut experiment = experiment(fmcw(false), five_points());
    experiment.radar.num_pulses = 24;
    experiment.radar.motion = Motion::True;
    let recording = experiment.record(PAIR).unwrap();
    let pulses = Pulses::of(&recording);
    assert!(pulses.pulses.iter().all(|pulse| !pulse.sweep.is_at_once()));
    let grid: ImageGrid = "x=-16:16:3.1,y=-16:16:2.9,z=0".parse().unwrap();
    let mut live = Live::new(&grid, pulses.width, &unweighted()).unwrap();
    (0..24).for_each(|n| pulses.push(&mut live, n));
    let exact = widened(&formed(&Exact, &recording, [0, 24], &grid));
    let measured_db = error_db(&live.image(), &exact);
    println!("sweeps: {measured_db:.1} dB, {:?}", live.accuracy());
    assert!(measured_db < -60.0 && live.accuracy().predicted_db() < -60.0);
}
