//! Image chips from patch maps against the exact sum over pulses and frequencies. Maps are evaluated from their definition in
//! float64, so that nodes, kernel and phase are tested.

use std::f64::consts::TAU;

use num_complex::{Complex32, Complex64};
use subaperture_core::accumulate::{Kernel, PixelGrid, add_patch_map};
use subaperture_core::stream::{
    BlockFloat, MapHeader, MapSamples, Node, Patch, PatchMap, Setup, nodes, power_of_two,
};
use subaperture_core::{Pulse, Sc16};

const C: f64 = 299_792_458.0;
const F: usize = 32;

/// 200 MHz about 10 GHz, bins half a resolution cell wide in both axes.
const SETUP: Setup = Setup {
    num_pulses: 12,
    num_channels: 1,
    num_frequencies: F as u16,
    range_length: 64,
    doppler_length: 24,
    start_hz: 9.9e9,
    step_hz: 6.25e6,
};

/// Point positions in metres and the phases of their amplitudes in turns.
const POINTS: [([f64; 3], f64); 6] = [
    ([0.0, 0.0, 0.0], 0.0),
    ([11.3, -1.6, 0.0], 0.3),
    ([-23.8, 2.9, 0.4], 0.8),
    ([30.1, 1.1, -0.2], 0.1),
    ([-4.4, -3.3, 0.0], 0.6),
    ([18.9, 3.7, 0.1], 0.45),
];

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
}

fn path(pulse: &Pulse, point: [f64; 3]) -> f64 {
    distance(pulse.transmitter_m, point) + distance(point, pulse.receiver_m)
}

/// Bistatic antennas at 8 km on curved tracks, tapered weights, and a reference path that follows no point, so that no error
/// cancels by chance.
fn track(count: usize) -> Vec<Pulse> {
    (0..count)
        .map(|m| {
            let t = m as f64 - (count as f64 - 1.0) / 2.0;
            Pulse {
                number: m as u32,
                time_s: 1e-3 * t,
                transmitter_m: [0.7 * t, -7800.0 + 0.05 * t, 1800.0 + 2e-3 * t * t],
                receiver_m: [300.0 + 0.6 * t, -7900.0 - 1e-3 * t * t, 1500.0],
                reference_path_m: 15_900.0 + 0.3 * t,
                weight: 1.0 - 0.3 * (t / count as f64).abs() as f32,
            }
        })
        .collect()
}

fn frequency_hz(k: usize) -> f64 {
    SETUP.start_hz + k as f64 * SETUP.step_hz
}

/// Samples `[pulse][frequency]` of the points.
fn echoes(pulses: &[Pulse]) -> Vec<Complex64> {
    let mut samples = vec![];
    for pulse in pulses {
        for k in 0..F {
            samples.push(
                POINTS
                    .iter()
                    .map(|&(point, turns)| {
                        let relative = path(pulse, point) - pulse.reference_path_m;
                        Complex64::cis(TAU * (turns - frequency_hz(k) * relative / C))
                    })
                    .sum(),
            );
        }
    }
    samples
}

/// Map by the definition in `crate::stream`, with uniform fast-time weights.
fn map_of(pulses: &[Pulse], samples: &[Complex64], patch: &Patch) -> Vec<Complex32> {
    let m = pulses.len();
    let reference_hz = frequency_hz(F / 2);
    let compensated: Vec<_> = samples
        .iter()
        .enumerate()
        .map(|(i, z)| {
            let pulse = &pulses[i / F];
            let rho = path(pulse, patch.centre_m) - pulse.reference_path_m;
            z * Complex64::cis(TAU * frequency_hz(i % F) * rho / C) * f64::from(pulse.weight)
        })
        .collect();
    let (reach_d, reach_r) = (i32::from(patch.doppler_reach), i32::from(patch.range_reach));
    let mut map = vec![];
    for d in -reach_d..=reach_d {
        let spectrum: Vec<Complex64> = (0..F)
            .map(|k| {
                let ratio = frequency_hz(k) / reference_hz;
                let cycles = ratio * f64::from(d) / f64::from(SETUP.doppler_length);
                (0..m)
                    .map(|i| {
                        let u = i as f64 - (m as f64 - 1.0) / 2.0;
                        compensated[i * F + k] * Complex64::cis(-TAU * cycles * u)
                    })
                    .sum()
            })
            .collect();
        for r in -reach_r..=reach_r {
            let cycles = f64::from(r) / f64::from(SETUP.range_length);
            let value: Complex64 = spectrum
                .iter()
                .enumerate()
                .map(|(k, z)| z * Complex64::cis(TAU * cycles * (k as f64 - (F / 2) as f64)))
                .sum();
            let value = value / (m * F) as f64;
            map.push(Complex32::new(value.re as f32, value.im as f32));
        }
    }
    map
}

fn header_of(pulses: &[Pulse], patch: &Patch) -> MapHeader {
    MapHeader {
        sub_cpi: 0,
        patch_index: 0,
        channel: 0,
        num_pulses: pulses.len() as u16,
        patch: *patch,
        time_s: [pulses[0].time_s, pulses[pulses.len() - 1].time_s],
        weight_sum: pulses.iter().map(|pulse| pulse.weight).sum(),
        nodes: nodes(pulses),
    }
}

/// Image by its definition: `sum w_m w_f z exp(+j 2 pi f path / c) / sum w_m`.
fn exact(pulses: &[Pulse], samples: &[Complex64], grid: &PixelGrid) -> Vec<Complex64> {
    let weights: f64 = pulses.iter().map(|pulse| f64::from(pulse.weight)).sum();
    (0..grid.num_rows * grid.num_columns)
        .map(|i| {
            let pixel = grid.position_m(i / grid.num_columns, i % grid.num_columns);
            let sum: Complex64 = samples
                .chunks(F)
                .zip(pulses)
                .map(|(samples, pulse)| {
                    let rho = path(pulse, pixel) - pulse.reference_path_m;
                    let sum: Complex64 = samples
                        .iter()
                        .enumerate()
                        .map(|(k, z)| z * Complex64::cis(TAU * frequency_hz(k) * rho / C))
                        .sum();
                    sum * f64::from(pulse.weight)
                })
                .sum();
            sum / (F as f64 * weights)
        })
        .collect()
}

/// Relative RMS difference in decibels.
fn difference_db(pixels: &[Complex32], exact: &[Complex64]) -> f64 {
    assert_eq!(pixels.len(), exact.len());
    let (mut error, mut power) = (0.0, 0.0);
    for (pixel, exact) in pixels.iter().zip(exact) {
        let pixel = Complex64::new(pixel.re.into(), pixel.im.into());
        error += (pixel - exact).norm_sqr();
        power += exact.norm_sqr();
    }
    10.0 * (error / power).log10()
}

/// Grid of `columns` of 2 m and `rows` of 0.37 m around a centre.
fn grid(centre: [f64; 3], columns: usize, rows: usize) -> PixelGrid {
    PixelGrid {
        origin_m: [
            centre[0] - (columns - 1) as f64,
            centre[1] - 0.185 * (rows - 1) as f64,
            centre[2],
        ],
        column_step_m: [2.0, 0.0, 0.0],
        row_step_m: [0.0, 0.37, 0.0],
        num_columns: columns,
        num_rows: rows,
    }
}

/// A half-width of 4.1 m in range is at most 8.2 m of path, 10.9 bins, plus half a kernel of 16 taps. A half-width of 36 m in
/// cross-range changes the path by at most `36 (0.7 + 0.6) / 8000 m` per pulse, 4.7 bins.
const PATCH: Patch = Patch {
    centre_m: [0.0, 0.0, 0.0],
    range_reach: 20,
    doppler_reach: 13,
};

/// `(a, b)` computed independently by the test.
fn line(header: &MapHeader, point: [f64; 3]) -> (f64, f64) {
    let m = f64::from(header.num_pulses);
    let [early, late] = header.nodes.map(|node| {
        let path = |q| distance(node.transmitter_m, q) + distance(q, node.receiver_m);
        path(point) - path(header.patch.centre_m)
    });
    let spacing = 2.0 * ((m * m - 1.0) / 12.0).sqrt();
    ((early + late) / 2.0, (late - early) / spacing)
}

/// Pixels by bilinear interpolation.
fn bilinear(map: &PatchMap<'_>, grid: &PixelGrid) -> Vec<Complex32> {
    let wavenumber = frequency_hz(F / 2) / C;
    (0..grid.num_rows * grid.num_columns)
        .map(|i| {
            let pixel = grid.position_m(i / grid.num_columns, i % grid.num_columns);
            let (a, b) = line(&map.header, pixel);
            let d = -b * f64::from(SETUP.doppler_length) * wavenumber;
            let r = a * f64::from(SETUP.range_length) * SETUP.step_hz / C;
            let (d0, r0) = (d.floor(), r.floor());
            let (fd, fr) = ((d - d0) as f32, (r - r0) as f32);
            let (d0, r0) = (d0 as i32, r0 as i32);
            let along = |d| map.at(d, r0) * (1.0 - fr) + map.at(d, r0 + 1) * fr;
            let phase = Complex64::cis(TAU * wavenumber * a);
            let phase = Complex32::new(phase.re as f32, phase.im as f32);
            (along(d0) * (1.0 - fd) + along(d0 + 1) * fd) * phase
        })
        .collect()
}

/// One sub-CPI, one patch: the chip against the exact sum.
///
/// Expected: the RMS error of the kernels in both axes (module `accumulate::kernel`, times sqrt 2) for data that fill the
/// band: 8 taps -63.9 dB, 10 taps -77.2 dB. In addition the curvature of the relative path, which more taps do not reduce:
/// an aperture of `t = 12 (0.7 + 0.6)/2 / 8000 = 1e-3` rad bends the path of points 36 m off by at most
/// `36 t^2 / 4 = 9e-6 m` at its ends, 1.9e-3 rad; `sqrt(4/45)` of it remains about the mean: -65 dB, and less nearer the
/// middle; 16 taps show -71 dB. The powers are added, plus 1 dB for terms that this sum omits.
#[test]
fn chip_of_one_sub_cpi_matches_exact_sum() {
    let pulses = track(12);
    let samples = echoes(&pulses);
    let grid = grid([0.5, 0.1, 0.0], 37, 23);
    let exact = exact(&pulses, &samples, &grid);
    let values = map_of(&pulses, &samples, &PATCH);
    let map = PatchMap {
        header: header_of(&pulses, &PATCH),
        samples: MapSamples::Float(&values),
    };
    let weight = 12.0 / map.header.weight_sum;

    fn chip<const TAPS: usize, const PHASES: usize>(
        map: &PatchMap<'_>,
        grid: &PixelGrid,
        weight: f32,
    ) -> Vec<Complex32> {
        let kernel = Kernel::<TAPS, PHASES>::new();
        let mut chip = vec![Complex32::ZERO; grid.num_pixels().unwrap()];
        let all = chip.len();
        let reached = add_patch_map(&mut chip, grid, &SETUP, map, &kernel, weight);
        assert_eq!(reached, Ok(all));
        chip
    }
    let linear: Vec<_> = bilinear(&map, &grid).iter().map(|z| z * weight).collect();
    for (name, pixels, bound_db) in [
        ("8 taps", chip::<8, 128>(&map, &grid, weight), -62.1),
        ("10 taps", chip::<10, 128>(&map, &grid, weight), -69.0),
        ("16 taps", chip::<16, 1024>(&map, &grid, weight), -70.0),
    ] {
        let db = difference_db(&pixels, &exact);
        println!("{name}: {db:.1} dB");
        assert!(db < bound_db);
    }
    let db = difference_db(&linear, &exact);
    println!("bilinear: {db:.1} dB");
    assert!(db > -25.0, "the kernels' bounds would be meaningless");
}

/// Three sub-CPIs, the last one short, and two patches: their maps add up to the whole image.
#[test]
fn sub_cpis_and_patches_sum_to_whole_image() {
    let pulses = track(31);
    let samples = echoes(&pulses);
    let kernel = Kernel::<10, 128>::new();
    let total: f32 = pulses.iter().map(|pulse| pulse.weight).sum();
    for centre in [[-18.0, 0.0, 0.0], [18.0, 0.0, 0.0]] {
        let patch = Patch {
            centre_m: centre,
            ..PATCH
        };
        let grid = grid(centre, 19, 23);
        let mut chip = vec![Complex32::ZERO; grid.num_pixels().unwrap()];
        for (pulses, samples) in pulses.chunks(12).zip(samples.chunks(12 * F)) {
            let values = map_of(pulses, samples, &patch);
            let map = PatchMap {
                header: header_of(pulses, &patch),
                samples: MapSamples::Float(&values),
            };
            let weight = pulses.len() as f32 / total;
            let reached = add_patch_map(&mut chip, &grid, &SETUP, &map, &kernel, weight);
            assert_eq!(reached, Ok(chip.len()));
        }
        let exact = exact(&pulses, &samples, &grid);
        let db = difference_db(&chip, &exact);
        println!("patch at {centre:?}: {db:.1} dB");
        assert!(db < -60.0);
        // One point in each half: the phase is checked too.
        let (point, turns) = if centre[0] > 0.0 {
            POINTS[3]
        } else {
            POINTS[2]
        };
        let mut pixel = [Complex32::ZERO];
        let at_point = PixelGrid {
            origin_m: point,
            num_columns: 1,
            num_rows: 1,
            ..grid
        };
        for (pulses, samples) in pulses.chunks(12).zip(samples.chunks(12 * F)) {
            let values = map_of(pulses, samples, &patch);
            let map = PatchMap {
                header: header_of(pulses, &patch),
                samples: MapSamples::Float(&values),
            };
            let weight = pulses.len() as f32 / total;
            add_patch_map(&mut pixel, &at_point, &SETUP, &map, &kernel, weight).unwrap();
        }
        let expected = Complex64::cis(TAU * turns);
        let pixel = pixel[0];
        let error = (Complex64::new(pixel.re.into(), pixel.im.into()) - expected).norm();
        // The difference is the sidelobes of the other five points, some resolution cells off in both axes.
        println!("point {point:?}: {pixel:.3}, {error:.3} from {expected:.3}");
        assert!(error < 0.15);
    }
}

/// A single pulse has no Doppler extent: one row is sufficient, and it is read without neighbours.
#[test]
fn single_pulse_map_has_one_row() {
    let pulses = track(1);
    let samples = echoes(&pulses);
    let patch = Patch {
        doppler_reach: 0,
        ..PATCH
    };
    let values = map_of(&pulses, &samples, &patch);
    let map = PatchMap {
        header: header_of(&pulses, &patch),
        samples: MapSamples::Float(&values),
    };
    let grid = grid([0.0; 3], 9, 15);
    let mut pixels = vec![Complex32::ZERO; 9 * 15];
    let kernel = Kernel::<10, 128>::new();
    let weight = 1.0 / map.header.weight_sum;
    let reached = add_patch_map(&mut pixels, &grid, &SETUP, &map, &kernel, weight).unwrap();
    assert_eq!(reached, pixels.len());
    let db = difference_db(&pixels, &exact(&pulses, &samples, &grid));
    println!("one pulse: {db:.1} dB");
    assert!(db < -70.0);
}

/// Stationary monostatic radar: range bins only, 75 m of two-way path, so that positions can be counted.
fn at_rest(samples: &[Complex32], range_reach: u16) -> PatchMap<'_> {
    PatchMap {
        header: MapHeader {
            sub_cpi: 0,
            patch_index: 0,
            channel: 0,
            num_pulses: 1,
            patch: Patch {
                centre_m: [0.0, 1000.0, 0.0],
                range_reach,
                doppler_reach: 0,
            },
            time_s: [0.0; 2],
            weight_sum: 1.0,
            nodes: [Node::default(); 2],
        },
        samples: MapSamples::Float(samples),
    }
}

#[test]
fn pixels_with_taps_outside_map_have_no_contribution() {
    // Bins of one metre of range: c / (R step) = 2 m.
    let setup = Setup {
        step_hz: C / 128.0,
        ..SETUP
    };
    let ones = [Complex32::ONE; 17];
    let map = at_rest(&ones, 8);
    let kernel = Kernel::<8, 64>::new();
    let line = |origin: f64, step: f64, count| PixelGrid {
        origin_m: [0.0, origin, 0.0],
        column_step_m: [0.0, step, 0.0],
        row_step_m: [0.0; 3],
        num_columns: count,
        num_rows: 1,
    };
    // On bins: all 17 and no more.
    let mut pixels = [Complex32::ZERO; 21];
    let on_bins = line(990.0, 1.0, 21);
    assert_eq!(
        add_patch_map(&mut pixels, &on_bins, &setup, &map, &kernel, 1.0),
        Ok(17)
    );
    for (i, pixel) in pixels.iter().enumerate() {
        let expected = if (2..19).contains(&i) { 1.0 } else { 0.0 };
        assert!((pixel.norm() - expected).abs() < 1e-5, "{i}: {pixel}");
    }
    // Between bins: those with four bins on each side, from -4.5 to +4.5.
    let mut pixels = [Complex32::ZERO; 21];
    let between = line(990.5, 1.0, 21);
    assert_eq!(
        add_patch_map(&mut pixels, &between, &setup, &map, &kernel, 1.0),
        Ok(10)
    );
    for (i, pixel) in pixels.iter().enumerate() {
        let inside = (5..15).contains(&i);
        assert_eq!(*pixel != Complex32::ZERO, inside, "{i}: {pixel}");
    }
    // A map with a wrong number of samples, positions that are not finite, or far away: no contribution and no panic.
    for (map, origin) in [
        (at_rest(&ones[..5], 8), 1000.5),
        (at_rest(&[], 8), 1000.5),
        (at_rest(&ones, 8), f64::NAN),
        (at_rest(&ones, 8), 1e300),
        (at_rest(&ones, 8), -f64::INFINITY),
    ] {
        let mut pixels = [Complex32::ZERO];
        let grid = line(origin, 0.0, 1);
        assert_eq!(
            add_patch_map(&mut pixels, &grid, &setup, &map, &kernel, 1.0),
            Ok(0)
        );
        assert_eq!(pixels, [Complex32::ZERO]);
    }
    // Too few pixels, too many, and a number that overflows.
    let mut pixels = [Complex32::ZERO; 3];
    for (columns, rows) in [(2, 1), (2, 2), (0, 3), (usize::MAX, 2)] {
        let grid = PixelGrid {
            num_rows: rows,
            ..line(1000.0, 1.0, columns)
        };
        assert!(add_patch_map(&mut pixels, &grid, &setup, &map, &kernel, 1.0).is_err());
    }
    let none = line(1000.0, 1.0, 0);
    assert_eq!(
        add_patch_map(&mut [], &none, &setup, &map, &kernel, 1.0),
        Ok(0)
    );
}

/// Block floating point represents the same numbers as float: the same chip except for the order of two products, and the same
/// power bit by bit.
#[test]
fn fixed_point_maps_accumulate_like_float_maps() {
    let pulses = track(12);
    let values = map_of(&pulses, &echoes(&pulses), &PATCH);
    let width = PATCH.num_range_bins();
    let blocks = BlockFloat::blocks(width);
    let exponents: Vec<i8> = (0..PATCH.num_doppler_bins() * blocks)
        .map(|i| 3 + (i % 5) as i8)
        .collect();
    let exponent = |i: usize| exponents[i / width * blocks + i % width / BlockFloat::BLOCK];
    let mantissas: Vec<Sc16> = values
        .iter()
        .enumerate()
        .map(|(i, z)| Sc16::from_complex32(z / power_of_two(exponent(i))).0)
        .collect();
    let floats: Vec<Complex32> = mantissas
        .iter()
        .enumerate()
        .map(|(i, z)| z.to_complex32() * power_of_two(exponent(i)))
        .collect();
    let header = header_of(&pulses, &PATCH);
    let fixed = BlockFloat {
        mantissas: &mantissas,
        exponents: &exponents,
    };
    let grid = grid([0.5, 0.1, 0.0], 37, 23);
    let kernel = Kernel::<8, 128>::new();
    let [float, fixed] = [MapSamples::Float(&floats), MapSamples::Fixed(fixed)].map(|samples| {
        let map = PatchMap { header, samples };
        let mut chip = vec![Complex32::ZERO; 37 * 23];
        let reached = add_patch_map(&mut chip, &grid, &SETUP, &map, &kernel, 1.0);
        assert_eq!(reached, Ok(37 * 23));
        chip
    });
    // A scale that is a power of two causes no rounding: the products are equal.
    assert_eq!(float, fixed);
}
