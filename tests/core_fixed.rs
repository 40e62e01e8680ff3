//! The fixed-point engine against a float64 evaluation of the defining sum, and its stages.

use std::f64::consts::TAU;

use num_complex::{Complex, Complex64};
use proptest::prelude::*;
use subaperture_core::fixed_point::{FixedSlices, PulsePhase, fft, sine};
use subaperture_core::stream::{
    BlockFloat, Capacity, Engine, FixedEngine, MapHeader, MapSamples, Node, Patch, PatchMap, Setup,
    SetupError, Work,
};
use subaperture_core::{LengthError, Pulse, Sc16, Turns};

const C_M_S: f64 = 299_792_458.0;

/// Sizes of a case.
#[derive(Clone, Copy, Debug)]
struct Shape {
    pulses: u16,
    frequencies: u16,
    range_length: u16,
    doppler_length: u16,
    doppler_reach: u16,
    range_reach: u16,
}

const fn shape(sizes: [u16; 6]) -> Shape {
    let [
        pulses,
        frequencies,
        range_length,
        doppler_length,
        doppler_reach,
        range_reach,
    ] = sizes;
    Shape {
        pulses,
        frequencies,
        range_length,
        doppler_length,
        doppler_reach,
        range_reach,
    }
}

const THESIS: Shape = shape([30, 424, 1024, 64, 20, 100]);
const SHAPES: [Shape; 8] = [
    THESIS,
    shape([30, 64, 512, 64, 31, 255]),
    shape([7, 33, 64, 16, 5, 20]),
    shape([1, 40, 64, 8, 3, 31]),
    shape([7, 1, 2, 16, 7, 0]),
    shape([16, 5, 8, 16, 4, 3]),
    shape([1, 1, 2, 1, 0, 0]),
    shape([200, 16, 16, 256, 100, 7]),
];

/// A sub-CPI: everything an engine is told.
struct Case {
    setup: Setup,
    patch: Patch,
    weights: Vec<f32>,
    pulses: Vec<Pulse>,
    samples: Vec<Sc16>,
}

/// A generator of tests' numbers: Knuth's MMIX.
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        let next = self.0.wrapping_mul(6_364_136_223_846_793_005);
        self.0 = next.wrapping_add(1_442_695_040_888_963_407);
        self.0 >> 32
    }

    /// In -1 .. 1.
    fn uniform(&mut self) -> f64 {
        self.bits() as f64 / 2f64.powi(31) - 1.0
    }
}

impl Case {
    /// Pulses 0.15 m apart, 7 km from a patch off the reference point, bistatic; Hamming weights over the
    /// frequencies, raised cosine over the pulses; no samples yet.
    fn new(shape: Shape) -> Self {
        let setup = Setup {
            num_pulses: shape.pulses,
            num_frequencies: shape.frequencies,
            range_length: shape.range_length,
            doppler_length: shape.doppler_length,
            start_hz: 9.3e9,
            step_hz: 1.5e6,
        };
        let patch = Patch {
            centre_m: [12.0, -31.0, 0.5],
            range_reach: shape.range_reach,
            doppler_reach: shape.doppler_reach,
        };
        let pulses = (0..u32::from(shape.pulses)).map(|m| {
            let along_m = 0.15 * (f64::from(m) - 0.5 * f64::from(shape.pulses - 1));
            Pulse {
                number: m,
                time_s: f64::from(m) * 1e-3,
                transmitter_m: [along_m, -6900.0 + 0.01 * along_m, 2500.0],
                receiver_m: [along_m + 20.0, -6800.0, 2400.0 + 0.02 * along_m],
                reference_path_m: 14_450.0 + 0.003 * along_m,
                weight: 0.6 + 0.4 * (0.02 * along_m).cos() as f32,
            }
        });
        let hamming = |k: u16| {
            let x = (f64::from(k) + 0.5) / f64::from(shape.frequencies);
            0.54 - 0.46 * (TAU * x).cos()
        };
        let sum: f64 = (0..shape.frequencies).map(hamming).sum();
        let weights = (0..shape.frequencies).map(|k| (hamming(k) / sum) as f32);
        Self {
            setup,
            patch,
            weights: weights.collect(),
            pulses: pulses.collect(),
            samples: Vec::new(),
        }
    }

    /// Rounds `samples` to 16 bits, their largest part at `level_db` below full scale.
    fn with_samples(mut self, samples: &[Complex64], level_db: f64) -> Self {
        let peak = samples
            .iter()
            .fold(0.0f64, |peak, z| peak.max(z.re.abs()).max(z.im.abs()));
        let scale = 32767.0 / peak * 10f64.powf(level_db / 20.0);
        let part = |x: f64| (x * scale).round() as i16;
        self.samples = samples
            .iter()
            .map(|z| Sc16::from_bits(part(z.re), part(z.im)))
            .collect();
        self
    }

    /// Samples of unit scatterers of `amplitudes` at points within the patch.
    fn points(&self, amplitudes: &[f64]) -> Vec<Complex64> {
        let mut random = Random(3);
        let scatterers: Vec<_> = amplitudes
            .iter()
            .map(|amplitude| {
                let mut point_m = self.patch.centre_m;
                for x in &mut point_m[..2] {
                    *x += 4.0 * random.uniform();
                }
                (*amplitude, point_m)
            })
            .collect();
        self.sum_over(|pulse, f_hz| {
            let one = |(amplitude, point_m): &(f64, [f64; 3])| {
                let turns = f_hz * path_m(pulse, *point_m) / C_M_S;
                Complex64::from_polar(*amplitude, -TAU * turns.fract())
            };
            scatterers.iter().map(one).sum()
        })
    }

    fn noise(&self) -> Vec<Complex64> {
        let mut random = Random(11);
        self.sum_over(|_, _| Complex64::new(random.uniform(), random.uniform()))
    }

    fn sum_over(&self, mut sample: impl FnMut(&Pulse, f64) -> Complex64) -> Vec<Complex64> {
        let mut samples = Vec::new();
        for pulse in &self.pulses {
            for k in 0..self.setup.num_frequencies {
                samples.push(sample(pulse, frequency_hz(&self.setup, k.into())));
            }
        }
        samples
    }

    fn work(&self) -> Work<'_, Sc16> {
        Work {
            setup: &self.setup,
            patch: &self.patch,
            weights: &self.weights,
            pulses: &self.pulses,
            samples: &self.samples,
        }
    }

    /// The defining sum in float64: over the pulses for each frequency, then over the frequencies.
    fn exact(&self) -> Vec<Complex64> {
        let (frequencies, pulses) = (self.weights.len(), self.pulses.len());
        let (doppler_reach, range_reach) = (
            i32::from(self.patch.doppler_reach),
            i32::from(self.patch.range_reach),
        );
        let reference_hz = frequency_hz(&self.setup, frequencies / 2);
        let mut map = Vec::new();
        let compensated: Vec<Vec<Complex64>> = (0..frequencies)
            .map(|k| {
                let one = |(m, pulse): (usize, &Pulse)| {
                    let z = self.samples[m * frequencies + k];
                    let z = Complex64::new(z.re.to_num(), z.im.to_num());
                    let rho_m = path_m(pulse, self.patch.centre_m);
                    let turns = frequency_hz(&self.setup, k) * rho_m / C_M_S;
                    let weight = f64::from(pulse.weight) * f64::from(self.weights[k]);
                    z * Complex64::from_polar(weight / pulses as f64, TAU * turns.fract())
                };
                self.pulses.iter().enumerate().map(one).collect()
            })
            .collect();
        for d in -doppler_reach..=doppler_reach {
            let column = |k: usize| -> Complex64 {
                let ratio = frequency_hz(&self.setup, k) / reference_hz;
                let rate = ratio * f64::from(d) / f64::from(self.setup.doppler_length);
                let turn = |m: usize| {
                    Complex64::cis(-TAU * rate * (m as f64 - (pulses as f64 - 1.0) / 2.0))
                };
                let terms = compensated[k].iter().enumerate();
                terms.map(|(m, z)| z * turn(m)).sum()
            };
            let columns: Vec<Complex64> = (0..frequencies).map(column).collect();
            for r in -range_reach..=range_reach {
                let rate = f64::from(r) / f64::from(self.setup.range_length);
                let turn =
                    |k: usize| Complex64::cis(TAU * rate * (k as f64 - (frequencies / 2) as f64));
                let terms = columns.iter().enumerate();
                map.push(terms.map(|(k, x)| x * turn(k)).sum());
            }
        }
        map
    }
}

fn frequency_hz(setup: &Setup, k: usize) -> f64 {
    setup.start_hz + k as f64 * setup.step_hz
}

fn path_m(pulse: &Pulse, point_m: [f64; 3]) -> f64 {
    let distance_m = |a: [f64; 3]| {
        let square = |i: usize| (a[i] - point_m[i]).powi(2);
        (square(0) + square(1) + square(2)).sqrt()
    };
    distance_m(pulse.transmitter_m) + distance_m(pulse.receiver_m) - pulse.reference_path_m
}

/// Buffers of exactly the lengths that are asked for.
struct Memory {
    cells: Vec<Sc16>,
    column_exponents: Vec<i8>,
    row_exponents: Vec<i8>,
    work: Vec<Complex<i32>>,
    phases: Vec<PulsePhase>,
    folded: Vec<Complex<i32>>,
}

impl Memory {
    fn new(capacity: &Capacity) -> Self {
        let pulses = FixedSlices::pulses_len(capacity);
        Self {
            cells: vec![Sc16::from_bits(1, 2); FixedSlices::cells_len(capacity)],
            column_exponents: vec![3; FixedSlices::column_exponents_len(capacity)],
            row_exponents: vec![4; FixedSlices::row_exponents_len(capacity)],
            work: vec![Complex::new(5, 6); FixedSlices::work_len(capacity)],
            phases: vec![PulsePhase::EMPTY; pulses],
            folded: vec![Complex::new(7, 8); pulses],
        }
    }

    fn buffers(&mut self) -> FixedSlices<'_> {
        FixedSlices {
            cells: &mut self.cells,
            column_exponents: &mut self.column_exponents,
            row_exponents: &mut self.row_exponents,
            work: &mut self.work,
            phases: &mut self.phases,
            folded: &mut self.folded,
        }
    }
}

/// The least capacity for a case.
fn capacity(case: &Case) -> Capacity {
    Capacity {
        pulses: case.setup.num_pulses,
        // Rows hold a pulse's frequencies, then the gate.
        frequencies: case.setup.row_stride(&case.patch) as u16,
        range_bins: case.setup.range_length,
        doppler_bins: case.patch.num_doppler_bins() as u16,
        patches: 1,
    }
}

/// The engine's map as values, read by [`PatchMap::at`]; its bits; and the clamped results.
fn run(case: &Case) -> (Vec<Complex64>, Vec<u8>, u32) {
    let capacity = capacity(case);
    case.setup.check(&capacity).unwrap();
    case.setup.check_patch(&case.patch, &capacity).unwrap();
    let mut memory = Memory::new(&capacity);
    let mut engine = FixedEngine::new(memory.buffers(), &capacity).unwrap();
    engine.check(&case.setup, &case.patch).unwrap();
    let work = case.work();
    engine.begin(&work);
    (0..case.weights.len()).for_each(|k| engine.column(&work, k));
    (0..case.patch.num_doppler_bins()).for_each(|row| engine.row(&work, row));

    let samples = engine.map(&work);
    let MapSamples::Fixed(block_float) = samples else {
        panic!("a fixed-point engine makes fixed-point maps");
    };
    assert_eq!(block_float.mantissas.len(), case.patch.map_len());
    let parts = block_float.mantissas.iter().flat_map(|z| [z.re, z.im]);
    let mut bits: Vec<u8> = parts.flat_map(|x| x.to_bits().to_le_bytes()).collect();
    bits.extend(block_float.exponents.iter().map(|e| *e as u8));

    let header = MapHeader {
        sub_cpi: 0,
        patch_index: 0,
        num_pulses: case.setup.num_pulses,
        patch: case.patch,
        time_s: [0.0; 2],
        weight_sum: 1.0,
        nodes: [Node::default(); 2],
    };
    let map = PatchMap { header, samples };
    let (doppler_reach, range_reach) = (
        i32::from(case.patch.doppler_reach),
        i32::from(case.patch.range_reach),
    );
    let mut values = Vec::new();
    for d in -doppler_reach..=doppler_reach {
        for r in -range_reach..=range_reach {
            let value = map.at(d, r);
            values.push(Complex64::new(value.re.into(), value.im.into()));
        }
    }
    (values, bits, engine.saturated())
}

/// Signal to error, both summed over the map, dB.
fn signal_to_error_db(values: &[Complex64], exact: &[Complex64]) -> f64 {
    assert_eq!(values.len(), exact.len());
    let errors = values.iter().zip(exact);
    let error: f64 = errors.map(|(a, b)| (a - b).norm_sqr()).sum();
    let power: f64 = exact.iter().map(Complex64::norm_sqr).sum();
    10.0 * (power / error.max(1e-300)).log10()
}

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

/// Rounding a column to 16 bits errs by `2^-15 / sqrt 12` of the column's power of two in each part, 98 dB
/// below that power of two. A point's peak is at least half of it, and its mean power over the rows
/// about `D / (M (2Q + 1))` of the peak's: 79 to 85 dB at 30 pulses, 70 to 76 dB at 200 pulses and 201
/// rows. Noise has its mean power 8 to 11 dB below the peak: 81 dB and more. The second rounding is less
/// than the first on points, and at most of its size. Level does not enter as long as a unit of the
/// 32-bit numbers, 9 bits below a sample's, does not.
#[test]
fn maps_agree_with_the_defining_sum() {
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

/// The last sub-CPI of a run is shorter than the setup says; the weights are those of its own pulses.
#[test]
fn a_short_sub_cpi_is_its_own_sum() {
    let mut case = Case::new(shape([7, 33, 64, 16, 5, 20]));
    case.setup.num_pulses = 12;
    let samples = case.noise();
    let case = case.with_samples(&samples, 0.0);
    assert!(signal_to_error_db(&run(&case).0, &case.exact()) > 70.0);
}

/// A power of two in the weights is in the exponents, and nowhere else.
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

/// Weights that no window has: negative ones are right, zeros give zeros, what is no number counts and is
/// left out, and an exponent past 127 is clamped and counted.
#[test]
fn strange_weights_are_borne() {
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

/// Parts at the ends of their range, next to zero, or anywhere.
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

    /// Whatever the samples, nothing overflows (checks are on in tests), nothing is clamped, and every
    /// value is right. A column of weight `w` has parts of at most `sqrt 2 w`, so a power of two of at
    /// most twice that: rounding moves it by at most `sqrt 2  2^-16  2 sqrt 2 w = 2^-14 w`, the columns'
    /// sum by `2^-14` as weights sum to 1; the map's own rounding as much. All 32-bit steps are below
    /// a hundredth of it.
    #[test]
    fn any_samples_are_borne(
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

/// The largest sums that there are: every sample at a corner of its square and turned so that all add up
/// at one bin; weights whose mantissas are all ones, and numbers of pulses next to a power of two, which
/// come closest to the bounds.
#[test]
fn aligned_rails_do_not_overflow() {
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

/// The bits of a small map, the same on every machine: FNV-1a of mantissas, then exponents. Input is
/// integers, dyadic fractions and positions without rounding.
#[test]
fn bits_do_not_change() {
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
    let hash = bits.iter().fold(0xcbf2_9ce4_8422_2325, |hash: u64, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3)
    });
    assert_eq!(hash, 0x341b_64ac_769a_5c49, "{hash:#018x}");
}

/// Buffers too short are refused by name; a patch too large is refused, and harmless if worked on.
#[test]
fn what_does_not_fit_is_refused() {
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
    for (what, expected, shorten) in shortened {
        let mut memory = Memory::new(&capacity);
        shorten(&mut memory);
        let error = FixedEngine::new(memory.buffers(), &capacity).unwrap_err();
        let got = expected - 1;
        assert_eq!(
            error,
            LengthError {
                what,
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
fn row_exponents_are_enough_for_any_patch() {
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
fn samples_at_the_rails_are_told() {
    let samples = [[0, 0], [i16::MAX, 0], [5, i16::MIN], [i16::MIN + 1, 9]];
    let told = samples.map(|[re, im]| Sc16::from_bits(re, im).at_limit());
    assert_eq!(told, [false, true, true, false]);
}

/// Bound of the module's head: 2 units of `2^-30`.
#[test]
fn phasors_are_right_to_two_units() {
    let one = f64::from(sine::ONE);
    let mut worst = 0f64;
    for i in 0..1_000_003u64 {
        let turns = Turns(i.wrapping_mul(0x9e37_79b9_7f4a_7c15));
        let phasor = sine::phasor(turns);
        // Of half a turn at most, so that float64 has the argument to 2^-53 turns.
        let exact = Complex64::cis(TAU * (turns.0 as i64 as f64 / 2f64.powi(64)));
        let error = (f64::from(phasor.re) - one * exact.re)
            .abs()
            .max((f64::from(phasor.im) - one * exact.im).abs());
        worst = worst.max(error);
    }
    println!("worst part of a million phasors: {worst:.2} units of 2^-30");
    assert!(worst < 2.0);
    for index in 0..sine::POINTS {
        let point = sine::unit(index);
        let exact = Complex64::cis(TAU * index as f64 / sine::POINTS as f64) * one;
        // Rounded to nearest; float64 is right to 2^-22 of a unit.
        assert!((f64::from(point.re) - exact.re).abs() < 0.500_001);
        assert!((f64::from(point.im) - exact.im).abs() < 0.500_001);
        assert_eq!(sine::phasor(Turns((index as u64) << 52)), point);
        assert_eq!(sine::unit(index + sine::POINTS), point);
    }
}

/// The transform of `input`, unscaled, and what float64 makes of the same sum.
fn transformed(input: &[Complex<i32>]) -> (Vec<Complex64>, Vec<Complex64>) {
    let length = input.len();
    let mut buffer = vec![Complex::new(0, 0); length];
    for (p, value) in input.iter().enumerate() {
        buffer[fft::place(p, length)] = *value;
    }
    let scale = 2f64.powi(fft::inverse(&mut buffer) as i32);
    let wide = |z: &Complex<i32>| Complex64::new(z.re.into(), z.im.into());
    let turns: Vec<_> = (0..length)
        .map(|i| Complex64::cis(TAU * i as f64 / length as f64))
        .collect();
    let exact = |q: usize| {
        let terms = input.iter().enumerate();
        terms.map(|(p, z)| wide(z) * turns[p * q % length]).sum()
    };
    (
        buffer.iter().map(|z| wide(z) * scale).collect(),
        (0..length).map(exact).collect(),
    )
}

/// White input of amplitude `2^31`: a stage rounds its input by shifts and its products, a unit or less in
/// RMS, where parts are `2^25` and more in RMS, below `2^28`: 150 dB for a stage, at most 8 dB less for
/// six. Amplitude `2^20`, RMS `2^19`, before any stage needs to shift: 114 dB for the first that has
/// products; later ones, on larger parts, add less than half of that between them.
#[test]
fn transforms_agree_with_the_sum() {
    for log in 1..=12 {
        let length = 1usize << log;
        for (amplitude, least_db) in [(2147483647.0, 140.0), (1048576.0, 112.0)] {
            let mut random = Random(log);
            let mut part = || (random.uniform() * amplitude) as i32;
            let input: Vec<_> = (0..length).map(|_| Complex::new(part(), part())).collect();
            let (values, exact) = transformed(&input);
            let ratio_db = signal_to_error_db(&values, &exact);
            println!("{length} points, noise of {amplitude}: {ratio_db:.1} dB");
            assert!(ratio_db > least_db);
        }
        // Coherent sums as large as there can be, from either end of the range.
        for sign in [1.0, -1.0] {
            for turn in [0, 1, length / 3] {
                let corner = |p: usize| {
                    let angle_rad = -TAU * (p * turn) as f64 / length as f64 + 0.1;
                    let z = Complex64::cis(angle_rad) * sign;
                    let rail = |x: f64| if x < 0.0 { i32::MIN } else { i32::MAX };
                    Complex::new(rail(z.re), rail(z.im))
                };
                let input: Vec<_> = (0..length).map(corner).collect();
                let (values, exact) = transformed(&input);
                assert!(signal_to_error_db(&values, &exact) > 135.0);
            }
        }
    }
    for length in [0, 1, 3, 8192] {
        let mut buffer = vec![Complex::new(1, 2); length];
        assert_eq!(fft::inverse(&mut buffer), 0);
        assert!(buffer.iter().all(|z| *z == Complex::new(1, 2)));
    }
}
