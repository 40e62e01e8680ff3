use crate::trial::{Numbers, turned, wide};
use num_complex::{Complex32, Complex64};
use subaperture_kernels::decimation::*;
use subaperture_kernels::lanes::Instructions;

const TAPS: usize = 6;

/// Defining sum of phase-rotated pulses in float64: `[pulse][sample]`.
fn expected(
    old: &[Vec<Complex64>],
    taps: &[f32; TAPS],
    pulses: bool,
    samples: bool,
) -> Vec<Vec<Complex64>> {
    let over = |old: &[Complex64]| -> Vec<Complex64> {
        let mut new = vec![Complex64::ZERO; old.len() / 2 + TAPS - 1];
        for (k, z) in old.iter().enumerate() {
            match k % 2 {
                0 => new[k / 2 + TAPS / 2 - 1] += z,
                _ => (0..TAPS).for_each(|i| new[k / 2 + i] += z * f64::from(taps[i])),
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
    if pulses {
        let columns = transposed(rows);
        rows = transposed(columns.iter().map(|column| over(column)).collect());
    }
    if samples {
        rows = rows.iter().map(|row| over(row)).collect();
    }
    rows
}

pub(crate) struct Case {
    pulses: Vec<Vec<Complex32>>,
    phase_ramps: Vec<PhaseRamp>,
    taps: [f32; TAPS],
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
            taps: [0; TAPS].map(|_| numbers.signed() as f32),
        }
    }

    pub(crate) fn made(
        &self,
        instructions: Instructions,
        [pulses, samples]: [bool; 2],
        at_a_time: usize,
        recorded: bool,
    ) -> Vec<Vec<Complex32>> {
        let layout = Layout::new(self.pulses[0].len());
        // Misaligned on purpose.
        let mut planes = vec![0.0; 1 + layout.values() * self.pulses.len()];
        let planes = &mut planes[1..];
        let ones = vec![1.0; layout.count()];
        for (row, pulse) in planes.chunks_exact_mut(layout.values()).zip(&self.pulses) {
            layout.spread(pulse, &ones, 1.0, row);
        }
        let flat: Vec<Complex32> = self.pulses.concat();
        let slow = vec![1.0; self.pulses.len()];
        let count = if pulses {
            halved(self.pulses.len(), TAPS)
        } else {
            self.pulses.len()
        };
        let mut scratch = DecimationScratch::default();
        let mut all = Vec::new();
        for first in (0..count).step_by(at_a_time) {
            let part = first..(first + at_a_time).min(count);
            let mut halving = Decimation {
                pulses,
                samples,
                layout,
                rows: Rows::Planes(&[]),
                first: 0,
                phase_ramps: &[],
            };
            let needed = match pulses {
                true => needed(TAPS, &part, self.pulses.len()),
                false => part.clone(),
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

pub(crate) const MODES: [[bool; 2]; 4] =
    [[false, false], [true, false], [false, true], [true, true]];

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
            let expected = expected(&old, &case.taps, mode[0], mode[1]);
            for recorded in [false, true] {
                let got = case.made(Instructions::Portable, mode, usize::MAX >> 1, recorded);
                assert_eq!(got.len(), expected.len());
                // Up to 7 terms of 1 per dimension, each with a phase error of at most 1e-5 (16 recurrence steps, up to half a cycle) and rounding.
                let allowed = 49.0 * 1.3e-5;
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
