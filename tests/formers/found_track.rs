//! Images on a track that the radar found of its own echoes, against those on the true one and on the recorded one: an irregular walk with a radar of
//! the L band and two receivers. Echoes are plain sums, written out here.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};
use num_complex::{Complex32, Complex64};
use subaperture::focus::bp::Backprojection;
use subaperture::focus::{ImageFormer, Task};
use subaperture::geometry::{ImageGrid, SceneFrame};
use subaperture::image::Image;
use subaperture::monitor::Silent;
use subaperture::phase_history::{
    Channel, Channels, Collection, InMemory, OnTrack, PhaseHistory, Pulse, Sweep, Weights,
};
use subaperture::signal::window::Window;
use subaperture::targets::{Arrangement, Recovered, Settings, recover};
use subaperture::track::{Fix, SampledTrack, turned};

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

const PULSES: usize = 801;
const SAMPLES: usize = 151;
const START_HZ: f64 = 1.1e9;
const STEP_HZ: f64 = 4e6;
const C_M_S: f64 = 299_792_458.0;
/// Receivers half a wavelength of 1.4 GHz apart, the transmitter beside them.
const ARMS_M: [[f64; 2]; 3] = [[0.0, 0.0], [0.2, 0.0], [0.307, 0.0]];

const REFLECTORS: [([f64; 2], f64); 7] = [
    ([-11.0, 8.0], 1.0),
    ([-6.5, 13.2], 1.3),
    ([-1.8, 9.1], 0.9),
    ([2.4, 16.3], 1.6),
    ([5.2, 11.4], 1.1),
    ([9.7, 14.8], 1.4),
    ([12.3, 9.6], 1.0),
];

/// Where the radar is, and its heading: 20 m, off a line by decimetres, the heading wandering by 5 degrees.
fn walk(n: usize) -> (DVec2, f64) {
    let u = n as f64 / 800.0;
    let sway = |cycles: f64, phase: f64| (TAU * cycles * u + phase).sin();
    let at_m = DVec2::new(
        20.0 * u - 10.0 + 0.3 * sway(2.3, 0.0),
        0.4 * sway(1.2, 0.5) + 0.08 * sway(5.1, 1.0),
    );
    let heading = 5f64.to_radians() * (0.7 * sway(1.7, 0.3) + 0.3 * sway(4.3, 2.0));
    (at_m, heading)
}

/// What is recorded of it.
fn line(n: usize) -> (DVec2, f64) {
    (DVec2::new(20.0 * n as f64 / 800.0 - 10.0, 0.0), 0.0)
}

fn antenna((at_m, heading_rad): (DVec2, f64), arm_m: [f64; 2]) -> DVec3 {
    (at_m + DVec2::from_angle(heading_rad).rotate(DVec2::from_array(arm_m))).extend(0.0)
}

fn gaussian(random: &mut ChaCha8Rng) -> f64 {
    let mut uniform = || (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64;
    let (a, b) = (1.0 - uniform(), uniform());
    (-2.0 * a.ln()).sqrt() * (TAU * b).cos()
}

/// Both channels, a unit reflector 30 dB above the noise of all samples of a pulse.
fn recorded() -> Channels<'static> {
    let noise = (SAMPLES as f64 / 2.0).sqrt() * 10f64.powf(-30.0 / 20.0);
    let mut random = ChaCha8Rng::seed_from_u64(11);
    let channel = |r: usize| {
        let (mut pulses, mut samples) = (Vec::new(), Vec::new());
        for n in 0..PULSES {
            let [tx, rx] = [ARMS_M[0], ARMS_M[r]].map(|arm_m| antenna(line(n), arm_m));
            let [true_tx, true_rx] = [ARMS_M[0], ARMS_M[r]].map(|arm_m| antenna(walk(n), arm_m));
            let reference_m = DVec3::new(0.0, 12.0, 0.0);
            let reference_path_m = tx.distance(reference_m) + rx.distance(reference_m);
            pulses.push(Pulse {
                time_s: 0.025 * n as f64,
                transmitter_m: tx,
                receiver_m: rx,
                reference_m,
                reference_path_m,
                start_hz: START_HZ,
                step_hz: STEP_HZ,
                sweep: Sweep::AT_ONCE,
            });
            for k in 0..SAMPLES {
                let hz = START_HZ + k as f64 * STEP_HZ;
                let mut sum = Complex64::new(gaussian(&mut random), gaussian(&mut random)) * noise;
                for ([x, y], amplitude) in REFLECTORS {
                    let at_m = DVec3::new(x, y, 0.0);
                    let path_m = at_m.distance(true_tx) + at_m.distance(true_rx);
                    let turns = hz * (path_m - reference_path_m) / C_M_S;
                    sum += Complex64::cis(-TAU * turns.fract()) * amplitude;
                }
                samples.push(Complex32::new(sum.re as f32, sum.im as f32));
            }
        }
        let collection = Collection {
            name: "walk".to_owned(),
            num_samples: SAMPLES,
            pulses,
            frame: SceneFrame::Local,
            extent: None,
            timed: true,
        };
        let history: Box<dyn PhaseHistory> = Box::new(InMemory::new(collection, samples).unwrap());
        (Channel::new(format!("R{r}")), history)
    };
    Channels::new(vec![channel(1), channel(2)]).unwrap()
}

/// The coherent sum of both channels, the radar having been there.
fn image(fixes: &[Fix], grid: &ImageGrid) -> Image {
    let channels = recorded();
    let arrangement = Arrangement::of(&channels).unwrap();
    let track = SampledTrack::new(fixes).unwrap();
    let span_s = (fixes[0].time_s, fixes[fixes.len() - 1].time_s);
    let moved = channels
        .into_inner()
        .into_iter()
        .enumerate()
        .map(|(c, (about, history))| {
            let [t, r] = arrangement.of_channels[c];
            let arms_m = [arrangement.transmitters_m[t], arrangement.receivers_m[r]];
            let moved: Box<dyn PhaseHistory> =
                Box::new(OnTrack::new(history, &track, arms_m, span_s).unwrap());
            (about, moved)
        });
    let sum = Channels::new(moved.collect())
        .unwrap()
        .coherent_sum()
        .unwrap();
    let task = Task {
        history: &sum,
        grid,
        weights: &Weights::new(sum.collection(), Window::Hamming, Window::Hamming),
        memory_bytes: 1 << 29,
        monitor: &Silent,
        means: Default::default(),
    };
    Backprojection { error_db: -45.0 }
        .form(&task)
        .unwrap()
        .image
}

fn fixes(way: impl Fn(usize) -> (DVec2, f64), pulses: impl Iterator<Item = usize>) -> Vec<Fix> {
    let fix = |n: usize| {
        let (at_m, heading_rad) = way(n);
        Fix {
            time_s: 0.025 * n as f64,
            position_m: at_m.extend(0.0),
            attitude: Some(turned(0.0, 0.0, heading_rad)),
        }
    };
    pulses.map(fix).collect()
}

/// `-sum p ln p` of the shares of power.
fn entropy(image: &Image) -> f64 {
    let power = |z: &Complex32| f64::from(z.norm_sqr());
    let total: f64 = image.pixels.iter().map(power).sum();
    let each = image.pixels.iter().map(|z| power(z) / total);
    each.filter(|p| *p > 0.0).map(|p| -p * p.ln()).sum()
}

/// Of the brightest pixel, dB.
fn peak_db(image: &Image) -> f64 {
    let most = image
        .pixels
        .iter()
        .fold(0.0, |most: f32, z| most.max(z.norm_sqr()));
    10.0 * f64::from(most).log10()
}

/// The peak near each reflector, wherever within half a metre.
fn peaks_db(fixes: &[Fix]) -> Vec<f64> {
    let each = REFLECTORS.iter().map(|([x, y], _)| {
        let grid = format!(
            "x={}:{}:0.02,y={}:{}:0.02,z=0",
            x - 0.5,
            x + 0.5,
            y - 0.5,
            y + 0.5
        );
        peak_db(&image(fixes, &grid.parse().unwrap()))
    });
    each.collect()
}

fn found() -> (Recovered, Vec<Fix>) {
    let found = recover(recorded(), &Settings::default(), &Silent).unwrap();
    let fixes = found.moments.iter().map(|moment| Fix {
        time_s: moment.time_s,
        position_m: moment.position_m,
        attitude: Some(moment.attitude),
    });
    let fixes = fixes.collect();
    (found, fixes)
}

#[test]
fn an_image_on_the_track_found_is_as_sharp_as_on_the_true_one() {
    let (found, fixes_found) = found();
    let kept = || found.moments.iter().map(|moment| moment.pulse);
    println!("{} poses, {:?}", found.moments.len(), found.seen.faults);
    let fixes_true = fixes(walk, kept());
    let fixes_told = fixes(line, kept());
    let [true_db, found_db, told_db] =
        [&fixes_true, &fixes_found, &fixes_told].map(|fixes| peaks_db(fixes));
    println!("{true_db:.2?}\n{found_db:.2?}\n{told_db:.2?}");
    let grid: ImageGrid = "x=-14:14:0.05,y=6:19:0.05,z=0".parse().unwrap();
    let [of_true, of_found, of_told] =
        [&fixes_true, &fixes_found, &fixes_told].map(|fixes| entropy(&image(fixes, &grid)));
    println!("entropy on the true track {of_true:.4}, found {of_found:.4}, recorded {of_told:.4}");
    for (i, ([true_db, found_db], told_db)) in
        (true_db.iter().zip(&found_db).map(|(a, b)| [*a, *b]))
            .zip(&told_db)
            .enumerate()
    {
        assert!(
            (found_db - true_db).abs() < 0.5,
            "{i}: {found_db} {true_db}"
        );
        // Useless: half of the amplitude is nowhere near.
        assert!(*told_db < true_db - 6.0, "{i}: {told_db} {true_db}");
    }
    assert!(
        (of_found / of_true - 1.0).abs() < 0.01,
        "{of_found} {of_true}"
    );
    assert!(of_told > 1.1 * of_true, "{of_told} {of_true}");
}
