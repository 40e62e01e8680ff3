//! MPGA on a public recording: horizontal steps of a scanner with a MIMO array.
//!
//! The array of eight virtual elements was moved to three columns, by equal steps, and in each column to 64 heights (folders
//! `1` to `3` of `data1210/sardata1210` in github.com/zhuoming34/timmw_and_zeddepth, Apache-2.0). Steps and carrier are not documented. The heights separate echoes by elevation. Array phases are calibrated from the same echoes,
//! up to the part that is linear along the array, which only shifts directions.
//!
//! A step of several wavelengths leaves the whole turns of phases open. Steps from 1 to 16 element spacings are tried; the joint
//! least squares [`joint::solve`] of poses and targets decides by its residual. Phases and element spacing determine the ratio of step
//! to spacing whatever the wavelength.

use std::f64::consts::{PI, TAU};
use std::path::{Path, PathBuf};

use glam::DVec2;
use num_complex::{Complex32, Complex64};
use subaperture::io::open::{Options, open_channels};
use subaperture::io::recording::examples;
use subaperture::motion::joint::{Estimate, Prior, solve};
use subaperture::motion::{Array, Heading, Pose, Sighting, Target};
use subaperture::phase_history::PhaseHistory;

const COLUMNS: usize = 3;
const ELEMENTS: usize = 8;
/// Nearest range searched, step and number of ranges; metres.
const NEAR_M: f64 = 0.6;
const STEP_M: f64 = 0.02;
const RANGES: usize = 190;
/// Directions in elevation, over `sin(elevation) * height step / (wavelength / 2)` of one turn.
const ELEVATIONS: usize = 128;
/// Trial directions along the array.
const DIRECTIONS: usize = 720;
/// Weakest echo, relative to the strongest.
const FLOOR: f64 = 1e-3;
/// Least share of an echo's power that agrees with one direction.
const COHERENT: f64 = 0.6;

/// Assumed standard deviation of phases: echoes are not alone in their cells.
const PHASE_SIGMA_RAD: f64 = 0.2;

/// Rounds of unwrapping about the estimate.
const ROUNDS: usize = 5;

/// Echo of one range and elevation: its values in the elements of each column.
struct Cell {
    range_m: f64,
    values: [[Complex64; ELEMENTS]; COLUMNS],
}

/// Folder of the recording's three columns, if given.
fn columns() -> Option<PathBuf> {
    let near =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/ti-mimo-scan/sardata1210");
    let folder = std::env::var_os("SUBAPERTURE_TI_SCAN").map_or(near, PathBuf::from);
    folder.join("3/64/adc_data.bin").exists().then_some(folder)
}

/// Values over range and elevation, in the elements' order along the array.
fn column(folder: &Path, number: usize) -> Vec<Vec<Complex64>> {
    let text = examples::text("ti-mimo").unwrap();
    let files = format!("{}/{number}/{{1..64}}/adc_data.bin", folder.display());
    let described = text.replace("stop2/{01..64}.bin", &files);
    let own = tempfile::tempdir().unwrap();
    let path = own.path().join("column.toml");
    std::fs::write(&path, described).unwrap();
    let channels = open_channels::<&str>(&path, None, &Options::default()).unwrap();
    assert_eq!(channels.len(), ELEMENTS);
    channels.iter().map(|(_, history)| cells(history)).collect()
}

/// Focused values of a channel, range by range, each over elevation. Hann windows.
fn cells(history: &dyn PhaseHistory) -> Vec<Complex64> {
    let collection = history.collection();
    let (heights, width) = (collection.pulses.len(), collection.num_samples);
    let mut samples = vec![Complex32::ZERO; heights * width];
    history.read(0..heights, &mut samples).unwrap();
    let hann = |i: usize, count: usize| 0.5 - 0.5 * (TAU * (i as f64 + 0.5) / count as f64).cos();
    let light_m_s = 299_792_458.0;
    let mut values = vec![Complex64::ZERO; RANGES * ELEVATIONS];
    for (n, (pulse, row)) in collection
        .pulses
        .iter()
        .zip(samples.chunks_exact(width))
        .enumerate()
    {
        for range in 0..RANGES {
            let path_m = 2.0 * (NEAR_M + STEP_M * range as f64) - pulse.reference_path_m;
            let turn = Complex64::cis(TAU * pulse.step_hz * path_m / light_m_s);
            let mut phasor = Complex64::cis(TAU * pulse.start_hz * path_m / light_m_s);
            let mut sum = Complex64::ZERO;
            for (k, sample) in row.iter().enumerate() {
                let sample = Complex64::new(sample.re.into(), sample.im.into());
                sum += sample * phasor * hann(k, width);
                phasor *= turn;
            }
            sum *= hann(n, heights);
            for (e, value) in values[range * ELEVATIONS..][..ELEVATIONS]
                .iter_mut()
                .enumerate()
            {
                *value +=
                    sum * Complex64::cis(TAU * (n * e % ELEVATIONS) as f64 / ELEVATIONS as f64);
            }
        }
    }
    values
}

/// Strongest separate echoes of three columns.
fn echoes(columns: &[Vec<Vec<Complex64>>]) -> Vec<Cell> {
    let power = |range: usize, elevation: usize| -> f64 {
        let at = range * ELEVATIONS + elevation % ELEVATIONS;
        columns
            .iter()
            .flatten()
            .map(|values| values[at].norm_sqr())
            .sum()
    };
    let around = |range: usize, elevation: usize| {
        (range - 1..=range + 1).flat_map(move |r| {
            (elevation + ELEVATIONS - 1..=elevation + ELEVATIONS + 1).map(move |e| (r, e))
        })
    };
    let inner = 1..RANGES - 1;
    let all = inner.flat_map(|range| (0..ELEVATIONS).map(move |e| (range, e)));
    let most = all
        .clone()
        .map(|(range, e)| power(range, e))
        .fold(0.0, f64::max);
    all.filter(|&(range, e)| {
        let own = power(range, e);
        own > FLOOR * most && around(range, e).all(|(r, e)| power(r, e) <= own)
    })
    .map(|(range, e)| Cell {
        range_m: NEAR_M + STEP_M * range as f64,
        values: std::array::from_fn(|c| {
            std::array::from_fn(|i| columns[c][i][range * ELEVATIONS + e])
        }),
    })
    .collect()
}

/// Phase from element to element with the largest beam over all columns, and the share of power in this beam.
fn direction(cell: &Cell, gains: &[Complex64; ELEMENTS]) -> (f64, f64) {
    let total: f64 = cell.values.iter().flatten().map(Complex64::norm_sqr).sum();
    let beams = (0..DIRECTIONS).map(|d| {
        let phase = TAU * d as f64 / DIRECTIONS as f64 - PI;
        let beam = |values: &[Complex64; ELEMENTS]| {
            let terms = values.iter().zip(gains).enumerate();
            terms
                .map(|(i, (v, g))| v * g.conj() * Complex64::cis(-phase * i as f64))
                .sum::<Complex64>()
        };
        (
            phase,
            cell.values
                .iter()
                .map(|values| beam(values).norm_sqr())
                .sum::<f64>(),
        )
    });
    let (phase, most) = beams.fold(
        (0.0, 0.0),
        |best, beam| if beam.1 > best.1 { beam } else { best },
    );
    (phase, most / (ELEMENTS as f64 * total))
}

/// Phases of the elements: the remainder after the direction of each echo, without a linear part.
fn calibrated(cells: &[Cell]) -> [Complex64; ELEMENTS] {
    let mut gains = [Complex64::ONE; ELEMENTS];
    for _ in 0..20 {
        let mut sums = [Complex64::ZERO; ELEMENTS];
        for cell in cells {
            let (phase, share) = direction(cell, &gains);
            if share < COHERENT {
                continue;
            }
            for values in &cell.values {
                let flat: Vec<Complex64> = values
                    .iter()
                    .enumerate()
                    .map(|(i, v)| v * Complex64::cis(-phase * i as f64))
                    .collect();
                let mean: Complex64 = flat.iter().zip(&gains).map(|(v, g)| v * g.conj()).sum();
                for (sum, v) in sums.iter_mut().zip(flat) {
                    *sum += v * mean.conj() / mean.norm_sqr() * share;
                }
            }
        }
        // Regression over the elements' numbers, centred on 3.5, by the phases relative to the first: within half a turn.
        let phases = sums.map(|sum| (sum / sums[0]).arg());
        let slope = phases
            .iter()
            .zip(0..)
            .map(|(p, i)| p * (f64::from(i) - 3.5))
            .sum::<f64>()
            / 42.0;
        gains = std::array::from_fn(|i| Complex64::cis(phases[i] - slope * (i as f64 - 3.5)));
    }
    gains
}

/// Steps of the array from phases unwrapped about steps of `step_m`, and the sum of squared residuals.
fn solved(
    array: &Array,
    pulses: &[Vec<Sighting>],
    targets: &[Target],
    step_m: f64,
) -> ([f64; 2], f64) {
    let pose = |c: usize| Pose {
        at_m: DVec2::new(step_m * c as f64, 0.0),
        heading_rad: 0.0,
    };
    let mut estimate = Estimate {
        poses: (0..COLUMNS).map(pose).collect(),
        targets: targets.to_vec(),
        heading: Heading::Known,
    };
    let mut sum = 0.0;
    for _ in 0..ROUNDS {
        let unwrapped = unwrapped(array, pulses, &estimate);
        sum = solve(array, &unwrapped, 0, &mut estimate, &Prior::default())
            .unwrap()
            .sum;
    }
    let x = |c: usize| estimate.poses[c].at_m.x;
    ([x(1) - x(0), x(2) - x(1)], sum)
}

/// Sightings with every phase within half a turn of the estimate.
fn unwrapped(array: &Array, pulses: &[Vec<Sighting>], estimate: &Estimate) -> Vec<Vec<Sighting>> {
    let one = |sighting: &Sighting, pose: &Pose| {
        let lines = array.lines(pose, &estimate.targets[sighting.target]);
        let both = sighting.phases_rad.iter().zip(&lines);
        let near = both.map(|(phase, line)| phase + TAU * ((line.value - phase) / TAU).round());
        Sighting {
            phases_rad: near.collect(),
            ..sighting.clone()
        }
    };
    let pairs = pulses.iter().zip(&estimate.poses);
    pairs
        .map(|(sightings, pose)| {
            sightings
                .iter()
                .map(|sighting| one(sighting, pose))
                .collect()
        })
        .collect()
}

/// Sightings of the echoes with one direction in every column, and first estimates of their targets.
fn sightings(cells: &[Cell], gains: &[Complex64; ELEMENTS]) -> (Vec<Vec<Sighting>>, Vec<Target>) {
    let mut targets = Vec::new();
    let mut pulses = vec![Vec::new(); COLUMNS];
    for cell in cells {
        let (phase, share) = direction(cell, gains);
        if share < COHERENT {
            continue;
        }
        let phases = cell
            .values
            .map(|values| std::array::from_fn::<_, ELEMENTS, _>(|i| values[i] * gains[i].conj()));
        for (pulse, values) in pulses.iter_mut().zip(phases) {
            pulse.push(Sighting {
                target: targets.len(),
                range_m: cell.range_m,
                range_sigma_m: STEP_M,
                phases_rad: values.iter().map(|v| v.arg()).collect(),
                phase_sigma_rad: PHASE_SIGMA_RAD,
            });
        }
        let centred = phases[0].iter().enumerate();
        let mean: Complex64 = centred
            .map(|(i, v)| v * Complex64::cis(phase * (3.5 - i as f64)))
            .sum();
        // Elements are half a wavelength apart.
        let sine = phase / PI;
        targets.push(Target {
            at_m: cell.range_m * DVec2::new(sine, (1.0 - sine * sine).sqrt()),
            phase_rad: mean.arg(),
            from: Pose::default(),
        });
    }
    (pulses, targets)
}

/// The echoes whose numbers have this remainder by 2, numbered without gaps.
fn half(
    (pulses, targets): &(Vec<Vec<Sighting>>, Vec<Target>),
    remainder: usize,
) -> (Vec<Vec<Sighting>>, Vec<Target>) {
    let of_pulse = |sightings: &Vec<Sighting>| {
        let kept = sightings.iter().skip(remainder).step_by(2).cloned();
        let numbered = kept.enumerate();
        numbered
            .map(|(target, sighting)| Sighting { target, ..sighting })
            .collect()
    };
    (
        pulses.iter().map(of_pulse).collect(),
        targets.iter().skip(remainder).step_by(2).copied().collect(),
    )
}

/// Both steps in element spacings, and the ratio of the next best sum of squares, with other whole turns, to the best.
fn best(array: &Array, (pulses, targets): &(Vec<Vec<Sighting>>, Vec<Target>)) -> ([f64; 2], f64) {
    let spacing_m = array.receivers_m[1].x;
    let mut trials: Vec<([f64; 2], f64)> = (4..=64)
        .map(|quarter| 0.25 * f64::from(quarter) * spacing_m)
        .map(|step_m| solved(array, pulses, targets, step_m))
        .collect();
    trials.sort_by(|a, b| a.1.total_cmp(&b.1));
    let (steps, sum) = trials[0];
    let other = trials
        .iter()
        .find(|(own, _)| (0..2).any(|i| (own[i] - steps[i]).abs() > 0.05 * spacing_m));
    (steps.map(|step| step / spacing_m), other.unwrap().1 / sum)
}

#[test]
fn steps_of_scanner_are_estimated_from_echoes() {
    let Some(folder) = columns() else {
        println!(
            "skipped: SUBAPERTURE_TI_SCAN names no folder with columns 1 to 3 of the TI MIMO scan"
        );
        return;
    };
    let columns: Vec<_> = (1..=COLUMNS)
        .map(|number| column(&folder, number))
        .collect();
    let cells = echoes(&columns);
    let gains = calibrated(&cells);
    // Only the ratio of step to spacing is estimated; the spacing is that of TI's boards for 77 GHz.
    let spacing_m = 1.9e-3;
    let array = Array {
        transmitters_m: vec![DVec2::ZERO, DVec2::new(4.0 * spacing_m, 0.0)],
        receivers_m: (0..4)
            .map(|i| DVec2::new(spacing_m * f64::from(i), 0.0))
            .collect(),
        wavelength_m: 2.0 * spacing_m,
    };
    let all = sightings(&cells, &gains);
    let (steps, margin) = best(&array, &all);
    let total = steps[0] + steps[1];
    println!(
        "{} echoes, steps {steps:.3?} spacings, next best {margin:.2}",
        all.1.len()
    );
    // Equal steps of a stepping motor.
    assert!((steps[0] / steps[1] - 1.0).abs() < 0.03, "{steps:?}");
    assert!(margin > 1.2, "{margin}");
    // Two disjoint halves of the echoes have the same motion.
    for remainder in 0..2 {
        let (steps, margin) = best(&array, &half(&all, remainder));
        println!("half: steps {steps:.3?} spacings, next best {margin:.2}");
        assert!(
            ((steps[0] + steps[1]) / total - 1.0).abs() < 0.01,
            "{steps:?}"
        );
    }
}
