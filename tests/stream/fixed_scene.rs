//! Pulses and memory for tests of the fixed-point path, and the defining sum in float64.

use std::f64::consts::TAU;

use num_complex::{Complex, Complex64};
use subaperture_core::fixed_point::{FixedSlices, PulsePhase};
use subaperture_core::stream::{
    Capacity, Engine, FixedEngine, MapHeader, MapSamples, Node, Patch, PatchMap, Setup, Work,
};
use subaperture_core::{Pulse, Sc16};

pub(crate) const C_M_S: f64 = 299_792_458.0;

/// Dimensions of a case.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shape {
    pub(crate) pulses: u16,
    pub(crate) frequencies: u16,
    pub(crate) range_length: u16,
    pub(crate) doppler_length: u16,
    pub(crate) doppler_reach: u16,
    pub(crate) range_reach: u16,
}

pub(crate) const fn shape(sizes: [u16; 6]) -> Shape {
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

pub(crate) const THESIS: Shape = shape([30, 424, 1024, 64, 20, 100]);
pub(crate) const SHAPES: [Shape; 8] = [
    THESIS,
    shape([30, 64, 512, 64, 31, 255]),
    shape([7, 33, 64, 16, 5, 20]),
    shape([1, 40, 64, 8, 3, 31]),
    shape([7, 1, 2, 16, 7, 0]),
    shape([16, 5, 8, 16, 4, 3]),
    shape([1, 1, 2, 1, 0, 0]),
    shape([200, 16, 16, 256, 100, 7]),
];

/// A sub-CPI with all inputs of an engine.
pub(crate) struct Case {
    pub(crate) setup: Setup,
    pub(crate) patch: Patch,
    pub(crate) weights: Vec<f32>,
    pub(crate) pulses: Vec<Pulse>,
    pub(crate) samples: Vec<Sc16>,
}

/// Pseudo-random generator: Knuth's MMIX.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn bits(&mut self) -> u64 {
        let next = self.0.wrapping_mul(6_364_136_223_846_793_005);
        self.0 = next.wrapping_add(1_442_695_040_888_963_407);
        self.0 >> 32
    }

    /// Uniform in -1 .. 1.
    pub(crate) fn uniform(&mut self) -> f64 {
        self.bits() as f64 / 2f64.powi(31) - 1.0
    }
}

impl Case {
    /// Pulses 0.15 m apart, 7 km from a patch off the reference point, bistatic; Hamming weights over the frequencies, raised
    /// cosine over the pulses; no samples yet.
    pub(crate) fn new(shape: Shape) -> Self {
        let setup = Setup {
            num_pulses: shape.pulses,
            num_channels: 1,
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

    /// Round `samples` to 16 bits, with their largest part `level_db` below full scale.
    pub(crate) fn with_samples(mut self, samples: &[Complex64], level_db: f64) -> Self {
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
    pub(crate) fn points(&self, amplitudes: &[f64]) -> Vec<Complex64> {
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

    pub(crate) fn noise(&self) -> Vec<Complex64> {
        let mut random = Random(11);
        self.sum_over(|_, _| Complex64::new(random.uniform(), random.uniform()))
    }

    pub(crate) fn sum_over(
        &self,
        mut sample: impl FnMut(&Pulse, f64) -> Complex64,
    ) -> Vec<Complex64> {
        let mut samples = Vec::new();
        for pulse in &self.pulses {
            for k in 0..self.setup.num_frequencies {
                samples.push(sample(pulse, frequency_hz(&self.setup, k.into())));
            }
        }
        samples
    }

    pub(crate) fn work(&self) -> Work<'_, Sc16> {
        Work {
            setup: &self.setup,
            patch: &self.patch,
            weights: &self.weights,
            pulses: &self.pulses,
            samples: &self.samples,
        }
    }

    /// Defining sum in float64: over the pulses for each frequency, then over the frequencies.
    pub(crate) fn exact(&self) -> Vec<Complex64> {
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

pub(crate) fn frequency_hz(setup: &Setup, k: usize) -> f64 {
    setup.start_hz + k as f64 * setup.step_hz
}

pub(crate) fn path_m(pulse: &Pulse, point_m: [f64; 3]) -> f64 {
    let distance_m = |a: [f64; 3]| {
        let square = |i: usize| (a[i] - point_m[i]).powi(2);
        (square(0) + square(1) + square(2)).sqrt()
    };
    distance_m(pulse.transmitter_m) + distance_m(pulse.receiver_m) - pulse.reference_path_m
}

/// Buffers of exactly the required lengths.
pub(crate) struct Memory {
    pub(crate) cells: Vec<Sc16>,
    pub(crate) column_exponents: Vec<i8>,
    pub(crate) row_exponents: Vec<i8>,
    pub(crate) work: Vec<Complex<i32>>,
    pub(crate) phases: Vec<PulsePhase>,
    pub(crate) folded: Vec<Complex<i32>>,
}

impl Memory {
    pub(crate) fn new(capacity: &Capacity) -> Self {
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

    pub(crate) fn buffers(&mut self) -> FixedSlices<'_> {
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

/// Smallest capacity for a case.
pub(crate) fn capacity(case: &Case) -> Capacity {
    Capacity {
        pulses: case.setup.num_pulses,
        // Rows hold a pulse's frequencies, later the gate.
        frequencies: case.setup.row_stride(&case.patch) as u16,
        range_bins: case.setup.range_length,
        doppler_bins: case.patch.num_doppler_bins() as u16,
        patches: 1,
    }
}

/// The engine's map as values, read by [`PatchMap::at`]; its bits; and the number of saturated results.
pub(crate) fn run(case: &Case) -> (Vec<Complex64>, Vec<u8>, u32) {
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
        channel: 0,
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

/// Signal-to-error ratio in dB, both summed over the map.
pub(crate) fn signal_to_error_db(values: &[Complex64], exact: &[Complex64]) -> f64 {
    assert_eq!(values.len(), exact.len());
    let errors = values.iter().zip(exact);
    let error: f64 = errors.map(|(a, b)| (a - b).norm_sqr()).sum();
    let power: f64 = exact.iter().map(Complex64::norm_sqr).sum();
    10.0 * (power / error.max(1e-300)).log10()
}
