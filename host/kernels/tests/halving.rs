use crate::trial::{Numbers, turned, wide};
use num_complex::{Complex32, Complex64};
use subaperture_kernels::halving::*;
use subaperture_kernels::lanes::Instructions;

const TAPS: usize = 6;

/// What the sum says, in float64, of pulses turned: `[pulse][sample]`.
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
    turnings: Vec<Turning>,
    taps: [f32; TAPS],
}

impl Case {
    pub(crate) fn new(num_pulses: usize, num_samples: usize) -> Self {
        let mut numbers = Numbers::new((100 * num_pulses + num_samples) as u64);
        Self {
            pulses: (0..num_pulses)
                .map(|_| numbers.samples(num_samples))
                .collect(),
            turnings: (0..num_pulses)
                .map(|_| Turning {
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
        // Not where memory that is asked for begins: as odd a place as there is.
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
        let mut scratch = HalvingScratch::default();
        let mut all = Vec::new();
        for first in (0..count).step_by(at_a_time) {
            let part = first..(first + at_a_time).min(count);
            let mut halving = Halving {
                pulses,
                samples,
                layout,
                rows: Rows::Planes(&[]),
                first: 0,
                turnings: &[],
            };
            let needed = match pulses {
                true => needed(TAPS, &part, self.pulses.len()),
                false => part.clone(),
            };
            halving.first = needed.start;
            halving.turnings = &self.turnings[needed.clone()];
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
            // What was there before is written over.
            let mut out = vec![f32::NAN; 3 + part.len() * after.values()];
            let out = &mut out[3..];
            halving.make(instructions, &self.taps, first, out, &mut scratch);
            for row in out.chunks_exact(after.values()) {
                let mut samples = vec![Complex32::ZERO; after.count()];
                after.gather(row, &mut samples);
                all.push(samples);
                // Zeros behind the last.
                let zeros = row.iter().filter(|x| **x == 0.0).count();
                assert!(zeros >= after.values() - 2 * after.count());
            }
        }
        all
    }
}

pub(crate) const WAYS: [[bool; 2]; 4] =
    [[false, false], [true, false], [false, true], [true, true]];

#[test]
fn what_is_left_is_what_the_sum_says() {
    for (num_pulses, num_samples) in [(1, 1), (2, 3), (7, 40), (40, 7), (33, 130), (64, 64)] {
        let case = Case::new(num_pulses, num_samples);
        let old: Vec<Vec<Complex64>> = case
            .pulses
            .iter()
            .zip(&case.turnings)
            .map(|(pulse, t)| {
                let each = pulse.iter().enumerate();
                each.map(|(k, &z)| wide(z) * turned(t.start + t.step * k as f64))
                    .collect()
            })
            .collect();
        for way in WAYS {
            let expected = expected(&old, &case.taps, way[0], way[1]);
            for recorded in [false, true] {
                let got = case.made(Instructions::Portable, way, usize::MAX >> 1, recorded);
                assert_eq!(got.len(), expected.len());
                // Up to 7 terms of 1 a direction, each turned to 1e-5 at most (16 places 2 steps apart, of up to 1/2 turn) and rounded.
                let allowed = 49.0 * 1.3e-5;
                for (got, expected) in got.iter().flatten().zip(expected.iter().flatten()) {
                    assert!(
                        (wide(*got) - expected).norm() < allowed,
                        "{way:?}: {got} {expected}"
                    );
                }
            }
        }
    }
}

#[test]
fn bits_are_the_same_in_all_instructions_and_parts() {
    // Of any lengths, so that rows of the layout begin anywhere and end amid a group.
    for (num_pulses, num_samples) in [(45, 150), (1, 17), (16, 1), (19, 31), (3, 257)] {
        let case = Case::new(num_pulses, num_samples);
        for way in WAYS {
            let expected = case.made(Instructions::Portable, way, usize::MAX >> 1, false);
            for instructions in Instructions::available() {
                for at_a_time in [1, 7, 64] {
                    for recorded in [false, true] {
                        let got = case.made(instructions, way, at_a_time, recorded);
                        assert!(
                            got == expected,
                            "{num_pulses} x {num_samples} {way:?} {} {at_a_time}",
                            instructions.name()
                        );
                    }
                }
            }
        }
    }
}
