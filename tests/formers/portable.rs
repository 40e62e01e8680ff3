//! Images with the same bits on every machine by portable transforms, and these transforms against their defining sums.
//!
//! The input does not depend on the platform: geometry consists of sums and products, and samples are whole numbers. The digests below hold
//! on every machine; another digest means that the platform affects the bits.

use num_complex::{Complex32, Complex64};
use subaperture::focus::formers::former;
use subaperture::focus::plan::InMemory;
use subaperture::focus::{BoundPolicy, Formed, ImageSpec, Numerics, Plan, Task, Transforms, Work};
use subaperture::geometry::{ImageGrid, SceneFrame};
use subaperture::glam::DVec3;
use subaperture::monitor::Silent;
use subaperture::phase_history::{self, Collection, PhaseHistory, Pulse, Sweep, Weights};
use subaperture::signal::window::Window;
use subaperture_tests::digest;

/// Former, settings, and digest of the pixels.
const IMAGES: [(&str, &str, u64); 8] = [
    ("exact", "{}", 0x6a3d_7ee8_4020_87ef),
    ("bp", "{}", 0x5063_4ac9_eb33_5755),
    ("rdbp", "{}", 0xb572_2557_d097_54a9),
    (
        "rdbp",
        r#"{ "mode": { "thesis": {} } }"#,
        0xd2d3_2b0b_6f66_29ac,
    ),
    ("ffbp", "{}", 0x334b_950c_8d97_3898),
    ("pfa", "{}", 0x4213_1927_2339_d3be),
    ("omega-k", "{}", 0xdcb7_24c9_9fab_ce38),
    ("rda", "{}", 0xb35e_1eeb_f90c_1c1c),
];

/// Pseudo-random numbers from -1 to 1 that float32 represents exactly.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005);
        self.0 = self.0.wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 44) as f32 / 524_288.0 - 1.0
    }
}

/// A straight, even track at 1 km, and noise-like samples.
fn history() -> phase_history::InMemory {
    let (num_pulses, num_samples) = (300, 120);
    let pulse = |n: usize| {
        let antenna_m = DVec3::new(0.25 * n as f64 - 37.4, -1000.0, 300.0);
        Pulse {
            time_s: 0.002 * n as f64,
            transmitter_m: antenna_m,
            receiver_m: antenna_m,
            reference_m: DVec3::ZERO,
            reference_path_m: 2.0 * antenna_m.length(),
            start_hz: 5e9,
            step_hz: 1e6,
            sweep: Sweep::AT_ONCE,
            recorded_path_m: None,
        }
    };
    let collection = Collection {
        name: "portable".to_owned(),
        num_samples,
        pulses: (0..num_pulses).map(pulse).collect(),
        frame: SceneFrame::Local,
        extent: None,
        timed: true,
    };
    let mut numbers = Numbers(7);
    let samples = (0..num_pulses * num_samples)
        .map(|_| Complex32::new(numbers.next(), numbers.next()))
        .collect();
    phase_history::InMemory::new(collection, samples).unwrap()
}

fn grid() -> ImageGrid {
    "x=-20:20:0.7,y=-24:24:0.9,yaw=11".parse().unwrap()
}

fn formed(name: &str, settings: &str, numerics: Numerics) -> Formed {
    let settings = serde_json::from_str(settings).unwrap();
    let history = history();
    let windows = Weights::new(history.collection(), Window::Hamming, Window::default());
    let grid = grid();
    let task = Task {
        numerics,
        ..Task::new(&history, &grid, &windows)
    };
    former(name, &settings).unwrap().form_best(&task).unwrap()
}

/// Digest over the bits of all pixels.
fn digest_of(pixels: &[Complex32]) -> u64 {
    let numbers = pixels.iter().flat_map(|z| [z.re, z.im]);
    digest(numbers.flat_map(|x| x.to_bits().to_le_bytes()))
}

/// After an intended change of bits, copy the new digests from this test's output.
#[test]
fn portable_images_have_recorded_digests() {
    let mut wrong = Vec::new();
    for (name, settings, stated) in IMAGES {
        let image = formed(name, settings, Numerics::default().portable());
        assert_eq!(image.settings["transforms"], "portable");
        let got = digest_of(&image.image.pixels);
        println!("{name} {settings}: {got:#018x}");
        if got != stated {
            wrong.push(format!("{name} {settings}: {got:#018x}"));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// The fastest and the portable transforms each have float32 errors, so their images differ by no more than two images that keep the
/// planned error.
#[test]
fn portable_and_fastest_images_agree_within_planned_error() {
    for (name, settings, _) in IMAGES {
        let portable = formed(name, settings, Numerics::default().portable());
        let fastest = formed(name, settings, Numerics::default());
        assert_eq!(fastest.settings["transforms"], "fastest");
        let (mut error, mut power) = (0.0, 0.0);
        for (a, b) in portable.image.pixels.iter().zip(&fastest.image.pixels) {
            error += f64::from((a - b).norm_sqr());
            power += f64::from(b.norm_sqr());
        }
        let apart_db = 10.0 * (error / power).log10();
        println!(
            "{name} {settings}: {apart_db:.1} dB apart, {:.1} dB predicted",
            fastest.predicted_error_db
        );
        // Two independent errors of the same size add up to 3 dB more than one.
        assert!(
            power > 0.0 && apart_db < fastest.predicted_error_db.max(-140.0) + 3.1,
            "{name}"
        );
        // Their images share everything except the rounding of transforms; the planned error is -60 dB.
        assert!(apart_db < -100.0, "{name}: {apart_db}");
    }
}

/// Transforms belong to the plan: every execution uses those it was made with.
#[test]
fn plan_determines_transforms() {
    let history = history();
    let grid = grid();
    let former = former("omega-k", &serde_json::json!({})).unwrap();
    let weights = Weights::new(history.collection(), Window::Hamming, Window::default());
    let spec = ImageSpec {
        numerics: Numerics::default().portable(),
        ..ImageSpec::new(history.collection(), &grid, &weights)
    };
    let text = Plan::new(&*former, &spec, BoundPolicy::Allowed, &Silent)
        .unwrap()
        .to_text();
    let plan = Plan::from_text(&text).unwrap();
    assert_eq!(plan.transforms, Transforms::Portable);
    let weights = plan.weights(history.collection()).unwrap();
    let opened = plan.open(history.collection(), &weights).unwrap();
    let work = Work {
        history: &history,
        memory_bytes: 1 << 30,
        monitor: &Silent,
    };
    let mut image = InMemory::of(&plan);
    let all: Vec<usize> = (0..plan.num_tiles()).collect();
    opened.form(&work, &all, usize::MAX, &mut image).unwrap();
    let at_once = formed("omega-k", "{}", Numerics::default().portable());
    assert!(image.image.pixels == at_once.image.pixels);
    assert!(Plan::from_text(&text.replace("\"portable\"", "\"quick\"")).is_err());
}

/// `exp(-j 2 pi i k / n)` with an exactly reduced argument.
fn root(i: usize, k: usize, n: usize) -> Complex64 {
    Complex64::cis(-std::f64::consts::TAU * (i * k % n) as f64 / n as f64)
}

/// Lengths of every radix, products of them, and other primes. The error of a transform is about `1e-7 sqrt(log2 n)` of the RMS of the
/// values in float32, and 1e-16 of it in float64; the chirp method needs three transforms.
#[test]
fn portable_transforms_match_defining_sum() {
    let lengths = (1..=80).chain([97, 121, 169, 210, 360, 512, 1001, 1024, 1031, 2048]);
    for n in lengths {
        let mut numbers = Numbers(n as u64);
        let values: Vec<Complex64> = (0..n)
            .map(|_| Complex64::new(numbers.next().into(), numbers.next().into()))
            .collect();
        let sum = |k: usize| -> Complex64 {
            let terms = values.iter().enumerate();
            terms.map(|(i, z)| z * root(i, k, n)).sum()
        };
        let expected: Vec<Complex64> = (0..n).map(sum).collect();
        let rms = expected.iter().map(Complex64::norm_sqr).sum::<f64>().sqrt();
        let apart = |got: Vec<Complex64>| {
            let squares = got.iter().zip(&expected).map(|(a, b)| (a - b).norm_sqr());
            squares.sum::<f64>().sqrt() / rms
        };
        let allowed = 3.0 * ((n as f64).log2() + 1.0).sqrt();

        let mut wide = values.clone();
        Transforms::Portable.forward(n).process(&mut wide);
        assert!(apart(wide.clone()) < allowed * 2e-16, "{n}");
        Transforms::Portable.inverse(n).process(&mut wide);
        let back = wide
            .iter()
            .zip(&values)
            .map(|(a, b)| (a / n as f64 - b).norm());
        assert!(back.fold(0.0, f64::max) < 1e-14, "{n}");

        let narrow = |z: &Complex64| Complex32::new(z.re as f32, z.im as f32);
        let mut few: Vec<Complex32> = values.iter().map(narrow).collect();
        Transforms::Portable.forward(n).process(&mut few);
        let got = few.iter().map(|z| Complex64::new(z.re.into(), z.im.into()));
        let error = apart(got.collect());
        assert!(error < allowed * 1e-7, "{n}: {error}");
    }
    let empty: &mut [Complex32] = &mut [];
    Transforms::Portable.forward(0).process(empty);
}
