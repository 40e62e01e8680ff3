use crate::trial::{Numbers, turned, wide};
use num_complex::{Complex32, Complex64};
use subaperture_kernels::decimation::*;
use subaperture_kernels::lanes::Instructions;

const TAPS: usize = 6;

/// Defining sum of phase-rotated pulses in float64, decimated by the given factors: `[pulse][sample]`.
fn expected(
    old: &[Vec<Complex64>],
    taps: &Taps<TAPS>,
    [pulses, samples]: [usize; 2],
) -> Vec<Vec<Complex64>> {
    let over = |old: &[Complex64], factor: usize| -> Vec<Complex64> {
        let mut new = vec![Complex64::ZERO; (old.len().max(2) - 2) / factor + TAPS];
        for (k, z) in old.iter().enumerate() {
            let tap = |i: usize| match (factor, k % factor) {
                (2, _) => taps.half[i],
                (_, 1) => taps.third[i],
                _ => taps.third[TAPS - 1 - i],
            };
            match k % factor {
                0 => new[k / factor + TAPS / 2 - 1] += z,
                _ => (0..TAPS).for_each(|i| new[k / factor + i] += z * f64::from(tap(i))),
            }
        }
        new
    };
    let transposed = |rows: Vec<Vec<Complex64>>| -> Vec<Vec<Complex64>> {
        (0..rows[0].len())
            .map(|k| rows.iter().map(|row| row[k]).collect())
            .collect()
    };
    let mut rows = old.to_vec();
    if pulses > 1 {
        let columns = transposed(rows);
        rows = transposed(columns.iter().map(|column| over(column, pulses)).collect());
    }
    if samples > 1 {
        rows = rows.iter().map(|row| over(row, samples)).collect();
    }
    rows
}

pub(crate) struct Case {
    pulses: Vec<Vec<Complex32>>,
    phase_ramps: Vec<PhaseRamp>,
    taps: Taps<TAPS>,
}

impl Case {
    pub(crate) fn new(num_pulses: usize, num_samples: usize) -> Self {
        let mut numbers = Numbers::new((100 * num_pulses + num_samples) as u64);
        Self {
            pulses: (0..num_pulses)
                .map(|_| numbers.samples(num_samples))
                .collect(),
            phase_ramps: (0..num_pulses)
                .map(|_| PhaseRamp {
                    start: 1e4 * numbers.signed(),
                    step: 3.0 * numbers.signed(),
                })
                .collect(),
            taps: Taps {
                half: [0; TAPS].map(|_| numbers.signed() as f32),
                third: [0; TAPS].map(|_| numbers.signed() as f32),
            },
        }
    }

    pub(crate) fn made(
        &self,
        instructions: Instructions,
        [pulses, samples]: [usize; 2],
        at_a_time: usize,
        recorded: bool,
    ) -> Vec<Vec<Complex32>> {
        let layout = Layout::new(self.pulses[0].len(), samples.max(2));
        // Misaligned on purpose.
        let mut planes = vec![0.0; 1 + layout.values() * self.pulses.len()];
        let planes = &mut planes[1..];
        let ones = vec![1.0; layout.count()];
        for (row, pulse) in planes.chunks_exact_mut(layout.values()).zip(&self.pulses) {
            layout.spread(pulse, &ones, 1.0, row);
        }
        let flat: Vec<Complex32> = self.pulses.concat();
        let slow = vec![1.0; self.pulses.len()];
        let count = match pulses {
            1 => self.pulses.len(),
            _ => decimated(self.pulses.len(), pulses, TAPS),
        };
        let mut scratch = DecimationScratch::default();
        let mut all = Vec::new();
        for first in (0..count).step_by(at_a_time) {
            let part = first..(first + at_a_time).min(count);
            let mut halving = Decimation {
                pulses,
                samples: samples > 1,
                layout,
                rows: Rows::Planes(&[]),
                first: 0,
                phase_ramps: &[],
            };
            let needed = match pulses {
                1 => part.clone(),
                _ => needed(pulses, TAPS, &part, self.pulses.len()),
            };
            halving.first = needed.start;
            halving.phase_ramps = &self.phase_ramps[needed.clone()];
            halving.rows = match recorded {
                true => Rows::Samples {
                    samples: &flat[needed.start * layout.count()..needed.end * layout.count()],
                    fast: &ones,
                    slow: &slow[needed.clone()],
                },
                false => Rows::Planes(
                    &planes[needed.start * layout.values()..needed.end * layout.values()],
                ),
            };
            let after = halving.after(TAPS);
            // Previous contents must be overwritten.
            let mut out = vec![f32::NAN; 3 + part.len() * after.values()];
            let out = &mut out[3..];
            halving.make(instructions, &self.taps, first, out, &mut scratch);
            for row in out.chunks_exact(after.values()) {
                let mut samples = vec![Complex32::ZERO; after.count()];
                after.gather(row, &mut samples);
                all.push(samples);
                // Zero padding after the last sample.
                let zeros = row.iter().filter(|x| **x == 0.0).count();
                assert!(zeros >= after.values() - 2 * after.count());
            }
        }
        all
    }
}

/// Decimation factors over pulses and over samples.
pub(crate) const MODES: [[usize; 2]; 9] = [
    [1, 1],
    [2, 1],
    [1, 2],
    [2, 2],
    [3, 1],
    [1, 3],
    [2, 3],
    [3, 2],
    [3, 3],
];

#[test]
fn decimation_agrees_with_defining_sum() {
    for (num_pulses, num_samples) in [(1, 1), (2, 3), (7, 40), (40, 7), (33, 130), (64, 64)] {
        let case = Case::new(num_pulses, num_samples);
        let old: Vec<Vec<Complex64>> = case
            .pulses
            .iter()
            .zip(&case.phase_ramps)
            .map(|(pulse, t)| {
                let each = pulse.iter().enumerate();
                each.map(|(k, &z)| wide(z) * turned(t.start + t.step * k as f64))
                    .collect()
            })
            .collect();
        for mode in MODES {
            let expected = expected(&old, &case.taps, mode);
            for recorded in [false, true] {
                let got = case.made(Instructions::Portable, mode, usize::MAX >> 1, recorded);
                assert_eq!(got.len(), expected.len());
                // Up to 13 terms of 1 per dimension, each with a phase error of at most 1e-5 (16 recurrence steps, up to half a cycle) and rounding.
                let allowed = 169.0 * 1.3e-5;
                for (got, expected) in got.iter().flatten().zip(expected.iter().flatten()) {
                    assert!(
                        (wide(*got) - expected).norm() < allowed,
                        "{mode:?}: {got} {expected}"
                    );
                }
            }
        }
    }
}

#[test]
fn decimation_is_bit_identical_in_all_instruction_sets_and_blocks() {
    // Any lengths, so that rows start anywhere and end within a group.
    for (num_pulses, num_samples) in [(45, 150), (1, 17), (16, 1), (19, 31), (3, 257)] {
        let case = Case::new(num_pulses, num_samples);
        for mode in MODES {
            let expected = case.made(Instructions::Portable, mode, usize::MAX >> 1, false);
            for instructions in Instructions::available() {
                for at_a_time in [1, 7, 64] {
                    for recorded in [false, true] {
                        let got = case.made(instructions, mode, at_a_time, recorded);
                        assert!(
                            got == expected,
                            "{num_pulses} x {num_samples} {mode:?} {} {at_a_time}",
                            instructions.name()
                        );
                    }
                }
            }
        }
    }
}
