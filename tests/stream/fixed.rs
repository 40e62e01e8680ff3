//! Fixed-point engine and its stages against a float64 evaluation of the defining sum.

use std::f64::consts::TAU;

use crate::fixed_scene::{
    C_M_S, Case, Memory, Random, SHAPES, capacity, path_m, run, shape, signal_to_error_db,
};
use num_complex::Complex64;
use proptest::prelude::*;
use subaperture_core::fixed_point::FixedSlices;
use subaperture_core::stream::{
    BlockFloat, Capacity, Engine, FixedEngine, MapSamples, Patch, SetupError, Work,
};
use subaperture_core::{LengthError, Sc16};
use subaperture_tests::digest;

type Scene = (&'static str, fn(&Case) -> Vec<Complex64>);

const SCENES: [Scene; 3] = [
    ("points and noise", |case| {
        let points = case.points(&[1.0, 0.3, 0.7, 0.1, 0.05]);
        let noise = case.noise();
        points
            .iter()
            .zip(&noise)
            .map(|(p, n)| p + n * 0.03)
            .collect()
    }),
    ("one point", |case| case.points(&[1.0])),
    ("noise", Case::noise),
];

/// Rounding a column to 16 bits causes an error of `2^-15 / sqrt 12` of the column's power of two in each part, 98 dB below
/// that power of two. The peak of a point is at least half of it, and its mean power over the rows about `D / (M (2Q + 1))` of
/// the peak's: 79 to 85 dB at 30 pulses, 70 to 76 dB at 200 pulses and 201 rows. Noise has a mean power 8 to 11 dB below its
/// peak: 81 dB and more. The second rounding is smaller than the first on points, and at most equal to it. The signal level
/// does not matter as long as a unit of the 32-bit numbers, 9 bits below that of a sample, does not.
#[test]
fn fixed_point_maps_match_defining_sum() {
    for shape in SHAPES {
        for (name, scene) in SCENES {
            for level_db in [0.0, -30.0, -60.0] {
                let case = Case::new(shape);
                let samples = scene(&case);
                let case = case.with_samples(&samples, level_db);
                let (values, _, saturated) = run(&case);
                let ratio_db = signal_to_error_db(&values, &case.exact());
                println!("{shape:?} {name}, {level_db} dB full scale: {ratio_db:.1} dB");
                assert!(ratio_db >= 70.0, "{shape:?} {name} {level_db}: {ratio_db}");
                assert_eq!(saturated, 0);
            }
        }
    }
}

/// The last sub-CPI of a run is shorter than the setup states; the weights are those of its own pulses.
#[test]
fn short_sub_cpi_matches_its_own_sum() {
    let mut case = Case::new(shape([7, 33, 64, 16, 5, 20]));
    case.setup.num_pulses = 12;
    let samples = case.noise();
    let case = case.with_samples(&samples, 0.0);
    assert!(signal_to_error_db(&run(&case).0, &case.exact()) > 70.0);
}

/// A power of two in the weights changes the exponents only.
#[test]
fn weights_scale_exactly() {
    let case = |factor: f32, pulse_factor: f32| {
        let mut case = Case::new(shape([7, 33, 64, 16, 5, 20]));
        case.weights.iter_mut().for_each(|w| *w *= factor);
        let pulses = case.pulses.iter_mut();
        pulses.for_each(|pulse| pulse.weight *= pulse_factor);
        let samples = case.noise();
        run(&case.with_samples(&samples, -3.0))
    };
    let (plain, plain_bits, _) = case(1.0, 1.0);
    let (scaled, scaled_bits, _) = case(f32::powi(2.0, -50), f32::powi(2.0, 7));
    for (a, b) in plain.iter().zip(&scaled) {
        assert_eq!(a * 2f64.powi(-43), *b);
    }
    let mantissas = 4 * plain.len();
    assert_eq!(plain_bits[..mantissas], scaled_bits[..mantissas]);
    for (a, b) in plain_bits[mantissas..]
        .iter()
        .zip(&scaled_bits[mantissas..])
    {
        assert_eq!(*a as i8 - 43, *b as i8);
    }
}

/// Weights that no window has: negative ones are correct, zeros give zeros, weights that are not finite count as saturated and
/// are treated as zero, and an exponent above 127 is clamped and counted.
#[test]
fn unusual_weights_are_handled() {
    let case = |weight: fn(usize) -> f32, pulse_weight: fn(usize) -> f32| {
        let mut case = Case::new(shape([7, 33, 64, 16, 5, 20]));
        for (k, w) in case.weights.iter_mut().enumerate() {
            *w = weight(k);
        }
        for (m, pulse) in case.pulses.iter_mut().enumerate() {
            pulse.weight = pulse_weight(m);
        }
        let samples = case.noise();
        case.with_samples(&samples, 0.0)
    };
    let signed = case(|k| [0.5, -0.25, 0.0][k % 3], |m| [-1.0, 0.3, 0.0][m % 3]);
    let (values, _, saturated) = run(&signed);
    assert!(signal_to_error_db(&values, &signed.exact()) > 70.0);
    assert_eq!(saturated, 0);

    for zero in [case(|_| 0.0, |_| 1.0), case(|_| 1.0, |_| 0.0)] {
        let (values, _, saturated) = run(&zero);
        assert!(values.iter().all(|z| *z == Complex64::ZERO));
        assert_eq!(saturated, 0);
    }
    let denormal = case(|_| f32::from_bits(1), |_| 1.0);
    assert!(run(&denormal).0.iter().all(|z| z.norm() < 1e-38));

    let (values, _, saturated) = run(&case(
        |k| if k < 2 { f32::NAN } else { 0.1 },
        |m| if m == 3 { f32::INFINITY } else { 1.0 },
    ));
    assert_eq!(saturated, 3);
    let left_out = case(
        |k| if k < 2 { 0.0 } else { 0.1 },
        |m| if m == 3 { 0.0 } else { 1.0 },
    );
    assert!(signal_to_error_db(&values, &left_out.exact()) > 70.0);

    let (_, _, saturated) = run(&case(|_| f32::MAX, |_| f32::MAX));
    assert!(saturated > 0);
}

/// Sample parts at the limits of the range, next to zero, or anywhere.
fn part(kind: u8, place: usize, random: &mut Random) -> i16 {
    let rails = [i16::MIN, i16::MAX];
    match kind {
        0 => i16::MIN,
        1 => i16::MAX,
        2 => rails[place % 2],
        3 => rails[(random.bits() % 2) as usize],
        4 => [i16::MIN, -1, 0, 1, i16::MAX][(random.bits() % 5) as usize],
        5 => [-1, 0, 1][(random.bits() % 3) as usize],
        _ => random.bits() as i16,
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    /// For any samples no sum overflows (overflow checks are on in tests), no value is clamped, and every value is correct. A
    /// column of weight `w` has parts of at most `sqrt 2 w`, so a power of two of at most twice that: rounding changes it by at
    /// most `sqrt 2  2^-16  2 sqrt 2 w = 2^-14 w`, and the columns' sum by `2^-14` since weights sum to 1; the map's own
    /// rounding by as much. All 32-bit steps are below a hundredth of it.
    #[test]
    fn any_samples_neither_overflow_nor_saturate(
        shape in prop::sample::select(SHAPES[1..].to_vec()),
        kinds in (0..7u8, 0..7u8),
        seed: u64,
    ) {
        let mut case = Case::new(shape);
        let mut random = Random(seed);
        let count = case.weights.len() * case.pulses.len();
        let samples = (0..count).map(|i| {
            let re = part(kinds.0, i, &mut random);
            Sc16::from_bits(re, part(kinds.1, i / 2, &mut random))
        });
        case.samples = samples.collect();
        let (values, _, saturated) = run(&case);
        prop_assert_eq!(saturated, 0);
        for (value, exact) in values.iter().zip(case.exact()) {
            prop_assert!((value - exact).norm() <= 1.01 * 2f64.powi(-13), "{} {}", value, exact);
        }
    }
}

/// The largest possible sums: every sample at a corner of its square and rotated so that all add up in one bin; weights whose
/// mantissas are all ones; and numbers of pulses next to a power of two, which come closest to the bounds.
#[test]
fn aligned_full_scale_samples_do_not_overflow() {
    let full = [31, 63, 127].map(|pulses| shape([pulses, 16, 16, 128, 3, 7]));
    for shape in SHAPES.into_iter().chain(full) {
        let mut case = Case::new(shape);
        let rail = |x: f64| if x < 0.0 { i16::MIN } else { i16::MAX };
        let patch_centre_m = case.patch.centre_m;
        let turned = case.sum_over(|pulse, f_hz| {
            let turns = f_hz * path_m(pulse, patch_centre_m) / C_M_S;
            Complex64::cis(-TAU * turns.fract())
        });
        let corners = turned
            .iter()
            .map(|z| Sc16::from_bits(rail(z.re), rail(z.im)));
        case.samples = corners.collect();
        let below_one = f32::from_bits(1.0f32.to_bits() - 1);
        let pulses = case.pulses.iter_mut();
        pulses.for_each(|pulse| pulse.weight = below_one);
        let (values, _, saturated) = run(&case);
        assert_eq!(saturated, 0);
        let exact = case.exact();
        assert!(signal_to_error_db(&values, &exact) > 70.0);
        assert!(exact.iter().any(|z| z.norm() > 1.1) || exact.len() < 100);
    }
}

/// Bits of a small map, equal on every machine: FNV-1a of mantissas, then exponents. Input is integers, dyadic fractions and
/// exact positions.
#[test]
fn map_bits_are_reproducible() {
    let mut case = Case::new(shape([7, 5, 8, 16, 6, 3]));
    case.weights = vec![0.125, 0.25, 0.25, 0.25, 0.125];
    for (m, pulse) in case.pulses.iter_mut().enumerate() {
        pulse.transmitter_m = [0.25 * m as f64 - 0.75, -7000.0, 2500.0];
        pulse.receiver_m = pulse.transmitter_m;
        pulse.reference_path_m = 14_800.0;
        pulse.weight = 1.0 - 0.0625 * m as f32;
    }
    let mut random = Random(5);
    let mut part = || random.bits() as i16;
    case.samples = (0..35).map(|_| Sc16::from_bits(part(), part())).collect();
    let (values, bits, saturated) = run(&case);
    assert_eq!(saturated, 0);
    assert!(signal_to_error_db(&values, &case.exact()) > 70.0);
    let hash = digest(bits);
    assert_eq!(hash, 0x341b_64ac_769a_5c49, "{hash:#018x}");
}

/// Buffers that are too short are rejected by name. A patch that is too large is rejected, and harmless if processed anyway.
#[test]
fn oversized_patch_and_short_buffers_are_rejected() {
    let case = Case::new(shape([7, 33, 64, 16, 5, 20]));
    let capacity = capacity(&case);
    type Shorten = fn(&mut Memory);
    let shortened: [(&str, usize, Shorten); 6] = [
        ("cells", 11 * 41, |memory| memory.cells.truncate(450)),
        ("column exponents", 41, |memory| {
            memory.column_exponents.truncate(40)
        }),
        // (451 + 11 * 31) / 32.
        ("row exponents", 24, |memory| {
            memory.row_exponents.truncate(23)
        }),
        ("work", 64, |memory| memory.work.truncate(63)),
        ("pulse phases", 7, |memory| memory.phases.truncate(6)),
        ("folded pulses", 7, |memory| memory.folded.truncate(6)),
    ];
    for (name, expected, shorten) in shortened {
        let mut memory = Memory::new(&capacity);
        shorten(&mut memory);
        let error = FixedEngine::new(memory.buffers(), &capacity).unwrap_err();
        let got = expected - 1;
        assert_eq!(
            error,
            LengthError {
                what: name,
                expected,
                got
            }
        );
    }

    let samples = case.noise();
    let case = case.with_samples(&samples, 0.0);
    let mut memory = Memory::new(&capacity);
    let mut engine = FixedEngine::new(memory.buffers(), &capacity).unwrap();
    for (doppler_reach, range_reach) in [(1000, 20), (7, 20), (u16::MAX, u16::MAX)] {
        let patch = Patch {
            doppler_reach,
            range_reach,
            ..case.patch
        };
        let error = engine.check(&case.setup, &patch).unwrap_err();
        assert!(matches!(error, SetupError::Size { .. }), "{error}");
        let work = Work {
            patch: &patch,
            ..case.work()
        };
        let before = engine.saturated();
        engine.begin(&work);
        engine.column(&work, 0);
        engine.row(&work, 0);
        assert_eq!(engine.saturated(), before + 1);
        let MapSamples::Fixed(map) = engine.map(&work) else {
            panic!("not fixed");
        };
        assert!(map.mantissas.is_empty() && map.exponents.is_empty());
    }
    // Out of order, out of range, without samples or weights: no panic.
    let work = Work {
        samples: &[],
        weights: &[],
        ..case.work()
    };
    engine.row(&work, 0);
    engine.begin(&work);
    engine.column(&work, usize::MAX);
    engine.column(&work, 3);
    engine.row(&work, usize::MAX);
    engine.row(&work, 10);
}

#[test]
fn row_exponent_buffer_suffices_for_any_patch() {
    for frequencies in [1, 5, 31, 32, 33, 424] {
        for doppler_bins in [1, 2, 41] {
            let capacity = Capacity {
                pulses: 1,
                frequencies,
                range_bins: 1024,
                doppler_bins,
                patches: 1,
            };
            let (room, cells) = (
                FixedSlices::row_exponents_len(&capacity),
                FixedSlices::cells_len(&capacity),
            );
            for rows in 1..=usize::from(doppler_bins) {
                assert!(rows * BlockFloat::blocks(cells / rows) <= room);
            }
        }
    }
}

#[test]
fn samples_at_converter_limit_are_counted() {
    let samples = [[0, 0], [i16::MAX, 0], [5, i16::MIN], [i16::MIN + 1, 9]];
    let reported = samples.map(|[re, im]| Sc16::from_bits(re, im).at_limit());
    assert_eq!(reported, [false, true, true, false]);
}
