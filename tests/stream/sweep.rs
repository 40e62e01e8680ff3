//! Range profiles of the core: against the defining sums, against the host's radio on the same recording, and bit by bit.

use std::f64::consts::TAU;

use num_complex::{Complex, Complex32, Complex64};
use subaperture_core::selftest::SweepSelfTest;
use subaperture_core::sweep::{BurstError, Profiler, Quantity, Setup, SetupError};
use subaperture_radio::profile::{Reference, Sweep};
use subaperture_radio::sigmf::{Recording, Setup as Recorded, Step, Writer};
use subaperture_tests::sweep_scene::{BINS, CARRIERS, PERIOD, SceneProfiler, SweepScene};

/// Changes only if the arithmetic changes: find the reason, then update the value.
const CHECKSUM: u32 = 0x033d_034d;

/// Relative RMS error of float32: sums are exact; a phasor of the tone has an error of at most 1.6e-7, equal in both channels; a
/// mean of 8 products, a quotient of about 17 of them, a weight and a product each round by 6e-8 a few times, the transform by
/// -137 dB, the last phasor by 1.6e-7. In total about 4e-7, -128 dB; a factor of four is allowed.
const BOUND_DB: f64 = -115.0;

fn off_db(got: &[Complex32], expected: &[Complex64]) -> f64 {
    assert_eq!(got.len(), expected.len());
    let (mut off, mut all) = (0.0, 0.0);
    for (got, expected) in got.iter().zip(expected) {
        let got = Complex64::new(got.re.into(), got.im.into());
        off += (got - expected).norm_sqr();
        all += expected.norm_sqr();
    }
    10.0 * (off / all).log10()
}

/// Sweep with all kinds of faults.
fn faulty(carriers: u16, samples: u32, bins: u16) -> SweepScene {
    let mut scene = SweepScene::new(carriers, samples, bins);
    scene.left_out = vec![7, 30];
    // One block; the first and the last; more than half of the blocks, which rejects the burst.
    scene.lost = vec![
        (3, 100..120),
        (4, 0..1),
        (4, samples as usize - 60..samples as usize),
        (12, 10..700),
    ];
    scene.unsteady = vec![20, 21, 40];
    scene
}

/// Mean, quotient and profile as defined in `core::sweep`, in float64, from the same samples. The selection of complete blocks
/// is written out here separately; a synthesiser that settles by one and a half turns in 120 samples must be rejected.
#[test]
fn profiles_match_defining_sums() {
    let scene = faulty(50, 1000, 128);
    let (values, usable, taken) = scene.profile(0);
    let block = 1000 / PERIOD / 16 * PERIOD;
    let mut responses = vec![None; 50];
    let mut came = 0;
    for (n, burst) in scene.bursts(0).iter().enumerate() {
        let mut counts = burst
            .samples
            .iter()
            .map(|pair| Some(*pair))
            .collect::<Vec<_>>();
        burst
            .lost
            .iter()
            .for_each(|gap| counts[gap.clone()].fill(None));
        came += counts.iter().flatten().count() as u32;
        let (mut cross, mut power, mut whole) = (Complex64::ZERO, 0.0, 0);
        for block in counts.chunks_exact(block) {
            let mut means = [Complex64::ZERO; 2];
            let all: Option<Vec<_>> = block.iter().copied().collect();
            let Some(all) = all else { continue };
            for (i, pair) in all.iter().enumerate() {
                let turn = Complex64::cis(-TAU * (i % PERIOD) as f64 / PERIOD as f64);
                for (mean, z) in means.iter_mut().zip(pair) {
                    *mean += Complex64::new(z.re.into(), z.im.into()) * turn;
                }
            }
            whole += 1;
            cross += means[1] * means[0].conj();
            power += means[0].norm_sqr();
        }
        let bursts = scene.bursts(0);
        let settles = bursts
            .get(n + 1)
            .is_some_and(|next| next.carrier == burst.carrier);
        if 2 * whole >= 1000 / block && !settles {
            responses[usize::from(burst.carrier)] = Some(cross / power);
        }
    }
    assert_eq!((usable, taken), (47, came));
    assert_eq!(responses.iter().flatten().count(), 47);
    let weights = scene.weights();
    let expected: Vec<Complex64> = (0..128)
        .map(|l| {
            let each = responses.iter().zip(&weights).enumerate();
            let each = each.filter_map(|(n, (z, w))| {
                // The range is `l c / (2 R step)`: turns of each frequency.
                let hz = scene.setup.start_hz + n as f64 * scene.setup.step_hz;
                let turns = hz * f64::from(l) / (128.0 * scene.setup.step_hz);
                Some((*z)? * f64::from(*w) * Complex64::cis(TAU * turns.fract()))
            });
            each.sum()
        })
        .collect();
    let off = off_db(&values, &expected);
    println!("{off:.1} dB");
    assert!(off < BOUND_DB, "{off}");
}

/// The host reads the same samples from a recording, mixes and selects them by its own code, and transforms them, here with zeros for missing carriers like the core, which fills no gaps.
#[test]
fn profiles_match_host() {
    let scene = faulty(64, 1000, 256);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sweep");
    let setup = Recorded {
        name: "the same".to_owned(),
        hardware: "none".to_owned(),
        sample_rate_hz: 1e6,
        period: PERIOD,
        samples: 1000,
        start_hz: 1.1e9,
        step_hz: 4e6,
        steps: 64,
        transmit_gain_db: 0.0,
        receive_gain_db: [0.0; 2],
        receive_antennas: ["A".to_owned(), "B".to_owned()],
        reference: Default::default(),
        antennas: None,
        reach_m: None,
    };
    let mut writer = Writer::create(&path, setup).unwrap();
    for burst in scene.bursts(0) {
        let carrier_hz = 1.1e9 + f64::from(burst.carrier) * 4e6;
        let step = Step {
            start: 0,
            samples: 1000,
            lower_hz: carrier_hz - 2e6,
            upper_hz: carrier_hz + 2e6,
            carrier_hz,
            sweep: 0,
            step: burst.carrier.into(),
            time_s: 0.0,
            gain_db: [0.0; 2],
            bursts: 1,
            flags: Vec::new(),
            lost: burst.lost.iter().map(|gap| (gap.start, gap.end)).collect(),
        };
        let channel = |c: usize| burst.samples.iter().map(|pair| pair[c]).collect::<Vec<_>>();
        writer.append(step, [&channel(0), &channel(1)]).unwrap();
    }
    writer.finish().unwrap();
    let mut recording = Recording::open(&path).unwrap();
    let sweep = Sweep::read(&mut recording, 0, Reference::Loopback).unwrap();
    let (values, usable, _) = scene.profile(0);
    assert_eq!(usize::from(usable), sweep.usable());
    let unambiguous_m = 299_792_458.0 / 8e6;
    // The host's windows differ: weights are applied to the values, with no window.
    let weights = scene.weights();
    let weighted = Sweep {
        values: (sweep.values.iter().zip(&weights))
            .map(|(z, w)| Some(z.unwrap_or_default() * f64::from(*w) * 64.0))
            .collect(),
        ..sweep
    };
    let none = subaperture_signal::window::Window::None;
    let expected = weighted.profile(none, 4, unambiguous_m).unwrap();
    assert!((expected.spacing_m - unambiguous_m / 256.0).abs() < 1e-9);
    let off = off_db(&values, &expected.values);
    println!("{off:.1} dB");
    assert!(off < BOUND_DB, "{off}");
    // The result is the scene to half a bin; the zero of the cable is that of the sums.
    for (range_m, _) in &scene.scatterers {
        let bin = range_m / expected.spacing_m;
        let near = (bin.round() as usize).saturating_sub(3)..bin.round() as usize + 4;
        let top = near.max_by(|a, b| values[*a].norm().total_cmp(&values[*b].norm()));
        let off = top.unwrap() as f64 - bin;
        assert!(off.abs() <= 0.75, "{range_m} m: {off} bins");
    }
}

/// A part lost between others counts as missing samples; a repeated part restarts the burst, and a repeated sweep the sweep.
#[test]
fn burst_parts_may_have_any_size_and_be_lost() {
    let scene = SweepScene::new(8, 200, 16);
    let (expected, usable, taken) = scene.profile(0);
    assert_eq!((usable, taken), (8, 8 * 200));
    let mut profiler = Box::new(SceneProfiler::new());
    profiler.configure(&scene.setup).unwrap();
    let weights = scene.weights();
    profiler.set_weights(0, weights.iter().copied()).unwrap();
    profiler.start(0);
    for attempt in 0..3 {
        for (n, burst) in scene.bursts(0).iter().enumerate() {
            let mut first = 0;
            for (k, part) in burst.samples.chunks(1 + 13 * (n + attempt)).enumerate() {
                // In the second attempt a part of each burst is lost.
                if attempt != 1 || k != 3 {
                    let part = part.iter().copied();
                    profiler.push(0, burst.carrier, first, part).unwrap();
                }
                first += (1 + 13 * (n + attempt)) as u32;
            }
        }
        let profile = profiler.finish(0).unwrap();
        if attempt == 1 {
            assert!(profile.taken < 8 * 200 && profile.usable == 8);
            assert_ne!(profile.values, expected);
        } else {
            assert_eq!((profile.taken, profile.usable), (8 * 200, 8));
            assert_eq!(profile.values, expected);
        }
        // As often as requested.
        let again = profiler.finish(0).unwrap().values.to_vec();
        assert_eq!(profiler.profile().unwrap().values, again);
    }
    // Two of eight are missing: two thirds are available.
    for burst in &scene.bursts(1)[..6] {
        let samples = burst.samples.iter().copied();
        profiler.push(1, burst.carrier, 0, samples).unwrap();
    }
    let profile = profiler.finish(1).unwrap();
    assert_eq!((profile.usable, profile.values.len()), (6, 16));
    for burst in &scene.bursts(2)[..5] {
        let samples = burst.samples.iter().copied();
        profiler.push(2, burst.carrier, 0, samples).unwrap();
    }
    let profile = profiler.finish(2).unwrap();
    assert_eq!((profile.usable, profile.values.len()), (5, 0));
    assert_eq!(profiler.finish(1).err(), Some(BurstError::Repeated));
    // A sweep that was never sent.
    let profile = profiler.finish(9).unwrap();
    assert_eq!((profile.sweep, profile.usable, profile.taken), (9, 0, 0));
}

#[test]
fn invalid_settings_are_rejected() {
    let scene = SweepScene::new(50, 1000, 128);
    let with = |change: &dyn Fn(&mut Setup)| {
        let mut own = scene.setup;
        change(&mut own);
        SceneProfiler::new().configure(&own)
    };
    assert_eq!(with(&|_| ()), Ok(()));
    let size = |what, wanted, least, most| {
        Err(SetupError::Size {
            what,
            wanted,
            least,
            most,
        })
    };
    let most = CARRIERS as u32;
    assert_eq!(
        with(&|own| own.carriers = 65),
        size(Quantity::Carriers, 65, 2, most)
    );
    assert_eq!(
        with(&|own| own.carriers = 1),
        size(Quantity::Carriers, 1, 2, most)
    );
    assert_eq!(with(&|own| own.period = 2), size(Quantity::Period, 2, 3, 8));
    assert_eq!(with(&|own| own.period = 9), size(Quantity::Period, 9, 3, 8));
    for wanted in [7, (1 << 21) + 1] {
        assert_eq!(
            with(&|own| own.samples = wanted),
            size(Quantity::Samples, wanted, 8, 1 << 21)
        );
    }
    for bins in [32, 512] {
        assert_eq!(
            with(&|own| own.bins = bins),
            size(Quantity::Bins, bins.into(), 50, BINS as u32)
        );
    }
    assert_eq!(
        with(&|own| own.bins = 96),
        Err(SetupError::NoPowerOfTwo(96))
    );
    for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(with(&|own| own.step_hz = wrong), Err(SetupError::Band));
        assert_eq!(with(&|own| own.start_hz = wrong), Err(SetupError::Band));
    }
    assert_eq!(with(&|own| own.step_hz = 1e-9), Err(SetupError::Band));
    let mut profiler = SceneProfiler::new();
    assert!(!profiler.start(0) && profiler.setup().is_none());
    let one = || std::iter::once([Complex::new(1, 1); 2]);
    assert_eq!(profiler.push(0, 0, 0, one()), Err(BurstError::NotStarted));
    assert_eq!(profiler.finish(0).err(), Some(BurstError::NotStarted));
    profiler.configure(&scene.setup).unwrap();
    let weights = |first: usize, values: &[f32]| {
        let mut own = profiler.clone();
        own.set_weights(first, values.iter().copied())
    };
    assert_eq!(weights(49, &[1.0]), Ok(()));
    assert_eq!(weights(49, &[1.0; 2]), size(Quantity::Weights, 51, 0, 50));
    assert_eq!(weights(0, &[f32::NAN]), Err(SetupError::NotFinite));
    profiler.start(5);
    assert_eq!(profiler.push(4, 0, 0, one()), Err(BurstError::Repeated));
    assert_eq!(profiler.push(5, 50, 0, one()), Err(BurstError::Carrier));
    assert_eq!(profiler.push(5, 0, 1000, one()), Err(BurstError::Length));
    let none = std::iter::empty();
    assert_eq!(profiler.push(5, 0, 0, none), Err(BurstError::Length));
    assert_eq!(profiler.push(5, 0, 999, one()), Ok(()));
    assert_eq!(profiler.left_out(), 1, "a burst of one sample is left out");
    profiler.stop();
    assert_eq!(profiler.push(5, 0, 0, one()), Err(BurstError::NotStarted));
}

#[test]
fn profile_checksum_is_reproducible() {
    let mut test = SweepSelfTest::new();
    let first = test.run().unwrap();
    assert_eq!(test.run(), Ok(first), "buffers in use leave no trace");
    assert_eq!(
        first, CHECKSUM,
        "0x{first:08x} is not the recorded 0x{CHECKSUM:08x}"
    );
}

#[test]
fn memory_matches_documentation() {
    const BYTES: usize = Profiler::<32, 256, 512>::BYTES;
    let stated = 24 * 32 + 20 * 256 + 8 * 512;
    println!("{stated} bytes and {}", BYTES - stated);
    assert!(BYTES - stated < 600);
}
