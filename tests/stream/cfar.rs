//! CFAR detector of the core: false-alarm rate, position accuracy, edges and limits.

use std::f64::consts::{PI, TAU};

use num_complex::{Complex32, Complex64};
use proptest::prelude::*;
use subaperture_core::Sc16;
use subaperture_core::cfar::{CellCounts, Cfar, CfarError, Column, Detection, TrainingWindow};
use subaperture_core::stream::{
    BlockFloat, MapHeader, MapSamples, Node, Patch, PatchMap, power_of_two,
};
use subaperture_tests::random::Random;

/// From 0 (excluded) to 1.
fn unit(random: &mut Random) -> f64 {
    ((random.bits() >> 11) as f64 + 0.5) / (1u64 << 53) as f64
}

/// Power of complex Gaussian noise of mean power 1.
fn noise_power(random: &mut Random) -> f64 {
    -unit(random).ln()
}

fn reach(guard: u16, training: u16) -> TrainingWindow {
    TrainingWindow { guard, training }
}

fn detect<const CAPACITY: usize>(
    cfar: &Cfar,
    power: &[f32],
    width: usize,
) -> (CellCounts, heapless::Vec<Detection, CAPACITY>) {
    let mut columns = vec![Column::default(); width];
    let mut detections = heapless::Vec::new();
    let tally = cfar
        .detect(power, width, &mut columns, &mut detections)
        .unwrap();
    (tally, detections)
}

/// Every ring summed separately. Returns the number of cells tested, the number above the threshold, and the peaks among them.
fn one_by_one(cfar: &Cfar, power: &[f32], width: usize) -> (u32, u32, Vec<(i64, i64)>) {
    let rows = (power.len() / width) as i64;
    let at = |row: i64, column: i64| {
        let inside = row >= 0 && row < rows && column >= 0 && column < width as i64;
        let value = inside.then(|| power[row as usize * width + column as usize])?;
        (value.is_finite() && value >= 0.0).then_some(f64::from(value))
    };
    let (gd, gr) = (i64::from(cfar.doppler.guard), i64::from(cfar.range.guard));
    let od = gd + i64::from(cfar.doppler.training);
    let or = gr + i64::from(cfar.range.training);
    let (mut tested, mut above, mut peaks) = (0, 0, vec![]);
    for row in 0..rows {
        for column in 0..width as i64 {
            let mut ring = vec![];
            for d in -od..=od {
                for r in -or..=or {
                    if d.abs() > gd || r.abs() > gr {
                        ring.extend(at(row + d, column + r));
                    }
                }
            }
            let (Some(power), n) = (at(row, column), ring.len() as f64) else {
                continue;
            };
            if ring.is_empty() {
                continue;
            }
            tested += 1;
            let alpha = n * (cfar.false_alarm_probability.powf(-1.0 / n) - 1.0);
            if power <= alpha * ring.iter().sum::<f64>() / n {
                continue;
            }
            above += 1;
            let exceeded = (-1..=1)
                .flat_map(|d| (-1..=1).map(move |r| (d, r)))
                .filter_map(|(d, r)| at(row + d, column + r))
                .any(|neighbour| neighbour > power);
            if !exceeded {
                peaks.push((row - rows / 2, column - width as i64 / 2));
            }
        }
    }
    (tested, above, peaks)
}

/// Sliding sums equal sums computed anew for every cell, for rings of all shapes, also larger than the map, and for maps with
/// NaN cells.
#[test]
fn sliding_sums_match_direct_sums() {
    let mut random = Random(1);
    let mut found = 0;
    for (range, doppler) in [
        (reach(0, 1), reach(0, 0)),
        (reach(1, 3), reach(0, 0)),
        (reach(0, 0), reach(2, 3)),
        (reach(2, 4), reach(1, 2)),
        (reach(1, 0), reach(1, 2)),
        (reach(2, 3), reach(3, 0)),
        (reach(40, 3), reach(1, 1)),
        (reach(2, 300), reach(50, 200)),
    ] {
        for (rows, width) in [(1, 17), (17, 1), (9, 14), (20, 31), (5, 130)] {
            let cfar = Cfar {
                range,
                doppler,
                false_alarm_probability: 0.05,
            };
            let power: Vec<f32> = (0..rows * width)
                .map(|_| match unit(&mut random) {
                    x if x < 0.02 => f32::NAN,
                    x if x < 0.03 => f32::INFINITY,
                    x if x < 0.04 => -1.0,
                    _ => noise_power(&mut random) as f32,
                })
                .collect();
            let (tested, above, peaks) = one_by_one(&cfar, &power, width);
            let (tally, detections) = detect::<700>(&cfar, &power, width);
            assert_eq!(
                (tally.tested, tally.above, tally.dropped),
                (tested, above, 0)
            );
            let mut places: Vec<_> = detections
                .iter()
                .map(|d| (d.doppler_bin, d.range_bin))
                .collect();
            assert_eq!(places.len(), peaks.len());
            // Interpolation shifts by at most half a bin: each peak matches its own.
            for (d, r) in &peaks {
                let near = |&(a, b): &(f32, f32)| {
                    (a - *d as f32).abs() <= 0.5 && (b - *r as f32).abs() <= 0.5
                };
                let place = places
                    .iter()
                    .position(near)
                    .expect("a detection at the peak");
                places.swap_remove(place);
            }
            assert!(detections.is_sorted_by(|a, b| a.power >= b.power));
            found += peaks.len();
        }
    }
    println!("{found} peaks");
    assert!(found > 100);
}

/// The fraction of cells above the threshold in exponential noise equals the requested probability, at edges too: the maps are
/// hardly larger than the ring, so almost every ring is cut.
///
/// Tolerance: cells of one map share training cells, different maps share none. The standard error is therefore taken from the
/// scatter between maps, and four of it are allowed: one run in 16 000 would fail by chance, and this run is always the
/// same.
#[test]
fn false_alarm_rate_matches_requested_probability() {
    const ROWS: usize = 12;
    const WIDTH: usize = 20;
    let mut random = Random(2);
    for (range, doppler) in [(reach(2, 6), reach(0, 0)), (reach(2, 4), reach(1, 3))] {
        for (probability, maps) in [(0.1, 2000), (1e-2, 4000), (1e-3, 10_000), (1e-4, 60_000)] {
            let cfar = Cfar {
                range,
                doppler,
                false_alarm_probability: probability,
            };
            let (mut sum, mut squares) = (0.0, 0.0);
            for _ in 0..maps {
                let power: [f32; ROWS * WIDTH] =
                    std::array::from_fn(|_| noise_power(&mut random) as f32);
                let (tally, _) = detect::<1>(&cfar, &power, WIDTH);
                assert_eq!(tally.tested as usize, power.len());
                let rate = f64::from(tally.above) / f64::from(tally.tested);
                sum += rate;
                squares += rate * rate;
            }
            let maps = f64::from(maps);
            let rate = sum / maps;
            let error = ((squares / maps - rate * rate) / maps).sqrt();
            let deviation = (rate - probability) / error;
            println!(
                "asked {probability:.0e}: {rate:.3e}, {deviation:+.1} standard errors of {:.1} %",
                100.0 * error / probability
            );
            assert!(deviation.abs() < 4.0);
            assert!(error / probability < 0.06, "the bound is too large");
        }
    }
}

/// Power summed over four maps exceeds the threshold less often, as the module documentation states.
#[test]
fn summed_power_has_fewer_false_alarms() {
    let mut random = Random(3);
    let cfar = Cfar {
        range: reach(2, 8),
        doppler: reach(0, 0),
        false_alarm_probability: 0.01,
    };
    let power: Vec<f32> = (0..100_000)
        .map(|_| (0..4).map(|_| noise_power(&mut random)).sum::<f64>() as f32)
        .collect();
    let (tally, _) = detect::<1>(&cfar, &power, 1000);
    let rate = f64::from(tally.above) / f64::from(tally.tested);
    println!("{rate:.1e} in place of 1e-2");
    assert!(rate < 1e-3);
}

/// Response of `n` samples with or without a Hamming window, `x` bins off in a transform of length `n padding`.
fn response(n: usize, padding: usize, hamming: bool, x: f64) -> Complex64 {
    let mut sum = Complex64::ZERO;
    let mut weights = 0.0;
    for i in 0..n {
        let u = i as f64 - (n as f64 - 1.0) / 2.0;
        let weight = if hamming {
            0.54 + 0.46 * (TAU * u / n as f64).cos()
        } else {
            1.0
        };
        weights += weight;
        sum += weight * Complex64::cis(TAU * u * x / (n * padding) as f64);
    }
    sum / weights
}

const N: usize = 32;
const WIDTH: usize = 33;
const ROWS: usize = 25;

/// Complex map of points `(doppler_bin, range_bin, amplitude)`.
fn points(points: &[(f64, f64, Complex64)], padding: usize, hamming: bool) -> Vec<Complex64> {
    let bins = |count: usize| (0..count).map(move |i| i as f64 - (count / 2) as f64);
    let mut map = vec![Complex64::ZERO; ROWS * WIDTH];
    for &(doppler, range, amplitude) in points {
        let along: Vec<_> = bins(WIDTH)
            .map(|r| response(N, padding, hamming, r - range))
            .collect();
        for (d, row) in bins(ROWS).zip(map.chunks_exact_mut(WIDTH)) {
            let across = response(N, padding, hamming, d - doppler);
            for (cell, along) in row.iter_mut().zip(&along) {
                *cell += amplitude * across * along;
            }
        }
    }
    map
}

fn powers(map: &[Complex64]) -> Vec<f32> {
    map.iter().map(|z| z.norm_sqr() as f32).collect()
}

const NEAR_THE_POINT: Cfar = Cfar {
    range: TrainingWindow {
        guard: 4,
        training: 6,
    },
    doppler: TrainingWindow {
        guard: 4,
        training: 3,
    },
    false_alarm_probability: 1e-6,
};

/// Position and power errors of a single point, across the whole cell, without noise. The bounds are measured figures. By
/// symmetry the parabola is exact on a bin and midway between two. The order of magnitude follows from theory: with
/// `ln sinc^2(s) = -(pi s)^2/3 - (pi s)^4/90 - ...`, `s` in resolution cells, the quartic term moves the vertex through
/// three points spaced `h` by about `(pi h)^2 / 15 e (1 - 4 e^2)` bins at an offset of `e` bins: at most 0.03 for
/// `h = 1/2`, and 0.13 for `h = 1`, where higher terms matter too.
#[test]
fn detection_position_error_is_within_stated_bounds() {
    for (padding, hamming, place_bound, power_bound_db) in [
        (2, false, BOUNDS[0].0, BOUNDS[0].1),
        (2, true, BOUNDS[1].0, BOUNDS[1].1),
        (1, false, BOUNDS[2].0, BOUNDS[2].1),
        (1, true, BOUNDS[3].0, BOUNDS[3].1),
    ] {
        let (mut worst, mut worst_db) = (0f64, 0f64);
        for i in 0..=20 {
            for j in 0..=20 {
                let (doppler, range) = (f64::from(i) / 20.0 - 0.5, f64::from(j) / 20.0 - 0.5);
                let (doppler, range) = (doppler + 2.0, range - 3.0);
                let map = points(&[(doppler, range, Complex64::I)], padding, hamming);
                let (_, detections) = detect::<8>(&NEAR_THE_POINT, &powers(&map), WIDTH);
                let strongest = detections[0];
                worst = worst
                    .max((f64::from(strongest.doppler_bin) - doppler).abs())
                    .max((f64::from(strongest.range_bin) - range).abs());
                worst_db = worst_db.max(10.0 * f64::from(strongest.power).log10().abs());
            }
        }
        println!("padding {padding}, Hamming {hamming}: {worst:.4} bins, {worst_db:.3} dB");
        assert!(worst < place_bound && worst_db < power_bound_db);
    }
}

/// Measured bounds, rounded up, in bins and decibels, in the order of the test above.
const BOUNDS: [(f64, f64); 4] = [(0.021, 0.57), (0.0034, 0.036), (0.167, 5.47), (0.017, 0.80)];

/// Guard region wide enough for two targets.
const AROUND_BOTH: Cfar = Cfar {
    range: TrainingWindow {
        guard: 10,
        training: 4,
    },
    doppler: TrainingWindow {
        guard: 8,
        training: 3,
    },
    false_alarm_probability: 1e-6,
};

/// Two targets three resolution cells apart in one axis, or two in each, 30 dB and 24 dB above the noise: both are detected at
/// their positions, without false alarms.
///
/// Tolerance: near its maximum the response of the Hamming window with twice as many bins falls as `1 - (x / 2.5)^2` in
/// amplitude, as follows from the mean square `u^2` of its samples. Noise adds a slope of about its amplitude per bin:
/// `sqrt(1 / 250) 2.5^2 / 2 = 0.2` bins standard deviation. Four fifths of a bin are 4 of these. Sidelobes at -43 dB are
/// below the noise.
#[test]
fn two_close_targets_are_both_detected() {
    let mut random = Random(4);
    let amplitude = |power: f64, turns: f64| Complex64::from_polar(power.sqrt(), TAU * turns);
    let strong = (-2.3, -4.4);
    for (apart_d, apart_r) in [(6.0, 0.0), (0.0, 6.0), (4.0, 4.0)] {
        for trial in 0..50 {
            let weak = (strong.0 + apart_d, strong.1 + apart_r);
            let targets = [
                (strong.0, strong.1, amplitude(1000.0, unit(&mut random))),
                (weak.0, weak.1, amplitude(250.0, unit(&mut random))),
            ];
            let mut map = points(&targets, 2, true);
            for cell in &mut map {
                *cell += amplitude(noise_power(&mut random), unit(&mut random));
            }
            let (_, detections) = detect::<8>(&AROUND_BOTH, &powers(&map), WIDTH);
            assert_eq!(detections.len(), 2, "trial {trial}: {detections:?}");
            for (found, (d, r, _)) in detections.iter().zip(targets) {
                assert!((f64::from(found.doppler_bin) - d).abs() < 0.8, "{found:?}");
                assert!((f64::from(found.range_bin) - r).abs() < 0.8, "{found:?}");
                assert!(found.noise > 0.5 && found.noise < 2.0, "{found:?}");
            }
        }
    }
    // Masked by the strong target, as the module documentation states: its 1000 in 2 * 1.36 cells in each axis (the noise
    // bandwidth of the window) among 234 training cells give a mean of 31, minus the part beyond the ring, and the
    // threshold is 14.2 times that.
    let targets = [
        (strong.0, strong.1, amplitude(1000.0, 0.0)),
        (strong.0, strong.1 + 8.0, amplitude(250.0, 0.0)),
    ];
    let mut map = points(&targets, 2, true);
    for cell in &mut map {
        *cell += amplitude(noise_power(&mut random), unit(&mut random));
    }
    let (_, detections) = detect::<8>(&NEAR_THE_POINT, &powers(&map), WIDTH);
    assert_eq!(detections.len(), 1, "{detections:?}");
}

#[test]
fn edge_cells_use_available_training_cells() {
    let mut power = [1.0f32; 7 * 9];
    power[0] = 1e4; // row 0, column 0
    power[6 * 9 + 4] = 2e4; // last row, middle
    power[3 * 9 + 8] = 3e4; // middle row, last column
    let cfar = Cfar {
        range: reach(1, 1),
        doppler: reach(1, 1),
        false_alarm_probability: 1e-3,
    };
    let (tally, detections) = detect::<4>(&cfar, &power, 9);
    assert_eq!((tally.tested, tally.above), (63, 3));
    let places: Vec<_> = detections
        .iter()
        .map(|d| (d.doppler_bin, d.range_bin, d.noise))
        .collect();
    // Not interpolated across the edge; along it the neighbours are equal.
    assert_eq!(
        places,
        [(0.0, 4.0, 1.0), (3.0, 0.0, 1.0), (-3.0, -4.0, 1.0)]
    );
    // The corner's ring has 3^2 - 2^2 = 5 cells, an alpha of 5 (1000^(1/5) - 1) = 14.905.
    for (value, found) in [(14.9, 0), (14.91, 1)] {
        let mut power = [1.0f32; 7 * 9];
        power[0] = value;
        assert_eq!(detect::<4>(&cfar, &power, 9).0.above, found, "{value}");
    }
}

#[test]
fn full_list_drops_and_counts_weakest_detections() {
    // Eleven targets, with the strongest in the middle of the scan order.
    let strengths = [5, 9, 2, 11, 7, 1, 10, 3, 8, 6, 4];
    let mut power = vec![1.0f32; 110];
    for (i, strength) in strengths.into_iter().enumerate() {
        power[10 * i + 5] = 1e6 * strength as f32;
    }
    let cfar = Cfar {
        range: reach(1, 3),
        doppler: reach(0, 0),
        false_alarm_probability: 1e-3,
    };
    let (tally, detections) = detect::<4>(&cfar, &power, 110);
    assert_eq!((tally.above, tally.dropped), (11, 7));
    let places: Vec<_> = detections.iter().map(|d| d.range_bin + 55.0).collect();
    assert_eq!(places, [35.0, 65.0, 15.0, 85.0]);
    let (tally, detections) = detect::<11>(&cfar, &power, 110);
    assert_eq!((tally.dropped, detections.len()), (0, 11));
    let (tally, _) = detect::<0>(&cfar, &power, 110);
    assert_eq!(tally.dropped, 11);
}

/// After a cell of 1e15 has passed through, the ring's sum has rounding errors of it: at most ten additions and subtractions of
/// the two columns and the ring, each with half a unit in the last place of 1e15, 1/16. The noise level is the sum over 28
/// cells: 10 / 16 / 28 = 0.022.
#[test]
fn strong_cell_leaves_only_rounding_in_sums() {
    let mut power = vec![1.0f32; 5 * 100];
    power[2 * 100 + 10] = 1e15;
    power[3 * 100 + 80] = 1e3;
    let cfar = Cfar {
        range: reach(1, 2),
        doppler: reach(1, 2),
        false_alarm_probability: 1e-6,
    };
    let (_, detections) = detect::<4>(&cfar, &power, 100);
    assert_eq!(detections.len(), 2);
    let noise = detections[1].noise;
    println!("noise {noise}");
    assert!((noise - 1.0).abs() < 0.022);
}

#[test]
fn zero_power_has_no_detections() {
    for value in [0.0, 1.0, -1.0, f32::NAN, f32::INFINITY, f32::MAX, 1e-45] {
        let (tally, detections) = detect::<4>(&NEAR_THE_POINT, &[value; 400], 20);
        assert_eq!((tally.above, detections.len()), (0, 0), "{value}");
    }
    assert_eq!(
        detect::<4>(&NEAR_THE_POINT, &[], 20).0,
        CellCounts::default()
    );
    assert_eq!(
        detect::<4>(&NEAR_THE_POINT, &[], 0).0,
        CellCounts::default()
    );
    // A single cell has no training cells.
    assert_eq!(
        detect::<4>(&NEAR_THE_POINT, &[1e9], 1).0,
        CellCounts::default()
    );
}

#[test]
fn invalid_settings_are_rejected() {
    let mut columns = [Column::default(); 10];
    let mut detections = heapless::Vec::<Detection, 4>::new();
    detections.push(Detection::default()).unwrap();
    let mut refused = |cfar: &Cfar, length: usize, width: usize| {
        let error = cfar
            .detect(&vec![0.0; length], width, &mut columns, &mut detections)
            .unwrap_err();
        assert_eq!(detections.len(), 1, "the list stays");
        error
    };
    for probability in [0.0, 1.0, -0.5, f64::NAN, f64::INFINITY] {
        let cfar = Cfar {
            false_alarm_probability: probability,
            ..NEAR_THE_POINT
        };
        assert_eq!(refused(&cfar, 100, 10), CfarError::Probability);
    }
    let cfar = Cfar {
        range: reach(2, 0),
        doppler: reach(1, 0),
        ..NEAR_THE_POINT
    };
    assert_eq!(refused(&cfar, 100, 10), CfarError::NoTraining);
    for (length, width, message) in [
        (95, 10, "power: expected 90 elements, found 95"),
        (95, 0, "power: expected 0 elements, found 95"),
        (90, 9, "columns: expected 9 elements, found 10"),
    ] {
        assert_eq!(refused(&NEAR_THE_POINT, length, width).to_string(), message);
    }
}

/// A map is searched like its power, in floating point and in block floating point.
#[test]
fn map_detections_match_those_of_its_power() {
    let mut random = Random(5);
    let (rows, width) = (11usize, 41usize);
    let blocks = BlockFloat::blocks(width);
    let mut part = || ((unit(&mut random) - 0.5) * 65535.0) as i16;
    let mantissas: Vec<Sc16> = (0..rows * width)
        .map(|_| Sc16::from_bits(part(), part()))
        .collect();
    let exponents: Vec<i8> = (0..rows * blocks).map(|i| (i % 7) as i8 - 5).collect();
    let values: Vec<Complex32> = (0..rows * width)
        .map(|i| {
            let (row, column) = (i / width, i % width);
            mantissas[i].to_complex32() * power_of_two(exponents[row * blocks + column / 32])
        })
        .collect();
    let header = MapHeader {
        sub_cpi: 0,
        patch_index: 0,
        channel: 0,
        num_pulses: 8,
        patch: Patch {
            centre_m: [0.0; 3],
            range_reach: (width / 2) as u16,
            doppler_reach: (rows / 2) as u16,
        },
        time_s: [0.0; 2],
        weight_sum: 8.0,
        nodes: [Node::default(); 2],
    };
    let cfar = Cfar {
        range: reach(1, 4),
        doppler: reach(1, 2),
        false_alarm_probability: 0.1,
    };
    let power: Vec<f32> = values.iter().map(|z| z.norm_sqr()).collect();
    let expected = detect::<64>(&cfar, &power, width);
    assert!(expected.1.len() > 10);
    let fixed = BlockFloat {
        mantissas: &mantissas,
        exponents: &exponents,
    };
    for samples in [MapSamples::Float(&values), MapSamples::Fixed(fixed)] {
        let map = PatchMap { header, samples };
        let mut columns = vec![Column::default(); width];
        let mut detections = heapless::Vec::<Detection, 64>::new();
        let tally = cfar
            .detect_in_map(&map, &mut columns, &mut detections)
            .unwrap();
        assert_eq!((tally, detections), expected);
        // In steps, another search's results are discarded first.
        let mut detections = heapless::Vec::<Detection, 64>::from([Detection::default(); 7]);
        let mut search = cfar.begin().unwrap();
        let mut steps = 1;
        while search
            .step_in_map(&map, &mut columns, &mut detections)
            .unwrap()
        {
            steps += 1;
        }
        assert_eq!((search.counts(), detections), expected);
        // Three rows fill the sums; each row is slid to and tested, in one step of at most 128 cells each.
        assert_eq!(steps, 3 + 2 * rows);
        let error = cfar.detect_in_map(&map, &mut columns[1..], &mut heapless::Vec::<_, 1>::new());
        assert!(matches!(error, Err(CfarError::Length(_))));
    }
}

proptest! {
    /// Any bits in any map with any settings give a result or an error, with positions within the map and only finite numbers.
    #[test]
    fn never_panics(
        bits in proptest::collection::vec(any::<u32>(), 0..200),
        width in 0usize..20,
        reaches in any::<[u16; 4]>(),
        small in any::<bool>(),
        probability in 1e-12f64..1.0,
    ) {
        let limit = if small { 5 } else { u16::MAX };
        let [a, b, c, d] = reaches.map(|x| x % limit);
        let cfar = Cfar {
            range: reach(a, b),
            doppler: reach(c, d),
            false_alarm_probability: probability,
        };
        let power: Vec<f32> = bits.iter().map(|&bits| f32::from_bits(bits)).collect();
        let mut columns = vec![Column::default(); width];
        let mut detections = heapless::Vec::<Detection, 5>::new();
        let _ = cfar.detect(&power, width, &mut columns, &mut detections);
        for found in &detections {
            prop_assert!(found.range_bin.abs() <= width as f32 / 2.0);
            prop_assert!(found.doppler_bin.abs() <= power.len() as f32);
            prop_assert!(found.power.is_finite() && found.noise.is_finite());
        }
    }
}

#[test]
fn interpolated_peak_gain_is_bounded_by_straddle_loss() {
    // Two equal neighbours on zero: the parabola is as steep as floats allow.
    let mut power = [0.0f32; 21];
    (power[10], power[11]) = (1.0, 1.0);
    power[2] = 1e-3; // something to train on
    let cfar = Cfar {
        range: reach(2, 20),
        doppler: reach(0, 0),
        false_alarm_probability: 0.5,
    };
    let (_, detections) = detect::<2>(&cfar, &power, 21);
    let strongest = detections[0];
    assert!((strongest.range_bin - 0.5).abs() < 1e-6);
    // One row: interpolated in range only.
    assert!((f64::from(strongest.power) - (PI / 2.0).powi(2)).abs() < 1e-5);
}
