//! Expected values of the items of Chim 2018.

use std::f64::consts::{LN_2, PI};

use num_complex::Complex64;

use crate::figures::{About, Expected, Figure, Within, at_most, figure};
use crate::sub_cpis::{LIGHT_M_S, decibels, sinc};

/// The L-band radar, 1.7 to 2.0 GHz.
const BANDWIDTH_HZ: f64 = 300e6;
const CELL_M: f64 = LIGHT_M_S / (2.0 * BANDWIDTH_HZ);
const WAVELENGTH_M: f64 = LIGHT_M_S / 1.85e9;
/// Half-power width of an unweighted aperture's response, in resolution cells.
const HALF_POWER: f64 = 0.886;

/// Expected checks of an item.
pub(crate) fn figures(id: &str) -> Option<Vec<Figure>> {
    Some(match id {
        "c-2-10" => ambiguity(),
        "c-2-22" => residual_phase(),
        "c-3-1" => long_aperture(),
        "c-3-2" => short_aperture(),
        "c-3-3" => omega_k(),
        "c-3-4" => painting(),
        "c-4-5" => truck(),
        "c-5-13" => stepped(),
        _ => return None,
    })
}

/// Error bound of the items' formers, dB.
const ASKED_DB: f64 = -60.0;

fn ambiguity() -> Vec<Figure> {
    let (duration_s, rate_hz_s) = (1e-6, 200e6 / 1e-6);
    let delay_s = -13e6 / rate_hz_s;
    // Samples are a 1600th of the sweep apart: 8 per cycle of 200 MHz.
    let sample_s = 1.0 / (8.0 * 200e6);
    vec![
        figure(
            "largest difference from (2.10), of the peak",
            "none",
            "{}",
            [at_most(sample_s / duration_s)],
            "(2.10) itself, to one of the samples that are summed",
        ),
        figure(
            "delay at which an echo shifted by 13 MHz peaks, -nu / k",
            "-65.0 ns",
            "{} ns",
            [About(delay_s * 1e9, sample_s * 1e9)],
            "-nu / k, to a sample",
        ),
        figure(
            "its level there",
            "focused as well",
            "{} dB",
            [About(
                decibels(1.0 + delay_s / duration_s),
                decibels(1.0 + sample_s / duration_s),
            )],
            "(T - |tau|) / T, to a sample",
        ),
    ]
}

fn residual_phase() -> Vec<Figure> {
    let delay_s = 2.0 * 100.0 / LIGHT_M_S;
    let phase_rad = PI * 3e12 * delay_s * delay_s;
    vec![
        figure(
            "residual video phase at 100 m, where the beat is at a tau: magnitude",
            "8.39 rad",
            "{} rad",
            [About(phase_rad, 0.0)],
            "pi a tau^2, half of the thesis's value",
        ),
        figure(
            "largest difference from pi a tau^2",
            "not given",
            "{} rad",
            [at_most(f64::from(f32::EPSILON) / 2.0)],
            "samples are rounded to float32",
        ),
        figure(
            "largest residual after removal",
            "removed",
            "{} rad",
            [at_most(10f64.powf(-50.0 / 20.0))],
            "-50 dB, a receiver's for beats up to half its sampling rate: the farthest is at 2 of 2.5 MHz",
        ),
    ]
}

fn long_aperture() -> Vec<Figure> {
    let (range_m, most_sine) = (30.0, 0.4f64);
    let curved_m = range_m * (1.0 / (1.0 - most_sine * most_sine).sqrt() - 1.0);
    // An echo a tenth of a cell off its line keeps sinc(0.1), 98 %, and counts as straight.
    let tenth = 0.1;
    let straight = || [at_most(tenth * CELL_M), at_most(tenth)];
    vec![
        figure(
            "curvature after the azimuth FFT",
            "curved",
            "{} m, {} cells",
            [
                About(curved_m, tenth * CELL_M),
                About(curved_m / CELL_M, tenth),
            ],
            "R0 (1 / cos - 1) at a sine of 0.4, to a tenth of a cell",
        ),
        figure(
            "deviation of the line from R0 / cos(theta), RMS",
            "the exact hyperbola",
            "{} m, {} of a cell",
            straight(),
            "0, to a tenth of a cell",
        ),
        figure(
            "the line against (3.6) within 6.65 degrees, half the beam of 4.5, at most",
            "R0 (1 + lambda^2 f_x^2 / 8)",
            "{} m, {} of a cell",
            straight(),
            "3/8 R0 sine^4, 2 mm, to a tenth of a cell",
        ),
        figure(
            "curvature after correction",
            "straight",
            "{} m, {} of a cell",
            straight(),
            "0, to a tenth of a cell",
        ),
        figure(
            "the image's error against the exact matched filter",
            "focused",
            "{} dB",
            [at_most(-25.0)],
            "an error of 5.6 % takes half a decibel of a peak at most",
        ),
    ]
}

fn short_aperture() -> Vec<Figure> {
    // A tenth of the aperture's resolution, lambda / 2L; a fifth of a range cell.
    let tolerance_deg = 0.1 * (WAVELENGTH_M / 2.0).to_degrees();
    let seen = |x: f64, y: f64| -> [Expected; 4] {
        let range_m = x.hypot(y);
        let angle_deg = (x / range_m).asin().to_degrees();
        [
            About(angle_deg, tolerance_deg),
            About(angle_deg, 0.0),
            About(range_m, CELL_M / 5.0),
            About(range_m, 0.0),
        ]
    };
    let focused = "approximately focused at its angle of arrival";
    let shape = "{} degrees for {}, {} m for {}";
    let from = "the angle and the range, to a tenth and a fifth of the resolution";
    // 21 pulses.
    let width = HALF_POWER / (21.0 * 0.05);
    vec![
        figure(
            "angle and range of the scatterer at (0, 30) m",
            focused,
            shape,
            seen(0.0, 30.0),
            from,
        ),
        figure(
            "angle and range of the scatterer at (-8, 26) m",
            focused,
            shape,
            seen(-8.0, 26.0),
            from,
        ),
        figure(
            "angle and range of the scatterer at (10, 34) m",
            focused,
            shape,
            seen(10.0, 34.0),
            from,
        ),
        figure(
            "3 dB width over azimuth frequency, 0.886 / L in theory",
            "0.84 1/m",
            "{} 1/m",
            [About(width, 0.02 * width / HALF_POWER)],
            "0.886 / L, to a fiftieth of the resolution; the quadratic phase of 0.32 rad widens it by 0.3 %",
        ),
        figure(
            "the same for the long aperture of Fig. 3.1",
            "a line",
            "{} 1/m and more",
            [About(4.0 * 0.4 / WAVELENGTH_M, 0.0)],
            "4 sine / lambda of the line's ends",
        ),
    ]
}

fn omega_k() -> Vec<Figure> {
    let wavenumber = 4.0 * PI / WAVELENGTH_M;
    let (offset_m, sine) = (3.0, 0.3f64);
    let cosine = (1.0 - sine * sine).sqrt();
    let bent_rad = offset_m * wavenumber * (1.0 - cosine);
    // The last element within the sine of 0.3 is up to one step of 2 pi / 30 m before it; rows are off by up to half a step of the band.
    let step_rad = offset_m * sine / cosine * 2.0 * PI / 30.0;
    // The end of the aperture lies 4.6 m beyond the position seen at 0.3: 3.7 in units of Fresnel's integral.
    let beyond_m = 15.0 - 33.0 * sine / cosine;
    let ripple_rad =
        1.0 / (PI * 2f64.sqrt() * beyond_m * (wavenumber * cosine.powi(3) / (PI * 33.0)).sqrt());
    let from = "0, to the ripple of a finite aperture";
    vec![
        figure(
            "phase across azimuth before the mapping, at the end: closed form (3.9), measured",
            "",
            "{} rad",
            [Within(
                bent_rad - step_rad - ripple_rad,
                bent_rad + ripple_rad,
            )],
            "(3.9) at the last element within a sine of 0.3",
        )
        .computed(),
        figure(
            "deviation from the closed form, RMS",
            "none",
            "{} rad",
            [at_most(ripple_rad)],
            from,
        ),
        figure(
            "phase across azimuth after the mapping, RMS",
            "none",
            "{} rad",
            [at_most(ripple_rad)],
            from,
        ),
        figure(
            "the image's error against the exact matched filter",
            "well focused",
            "{} dB",
            [at_most(ASKED_DB)],
            "the error asked for",
        ),
    ]
}

/// Mean power of an image from `count` of the 161 pulses, 1 m and more from the scatterer, dB: for every pulse the band's response at its
/// distance, with the phase of the middle frequency.
fn painted_db(count: usize) -> f64 {
    let place_m = [0.4f64, 0.5];
    let distance_m =
        |pulse: usize, at: [f64; 2]| (at[0] + 4.0 - 0.05 * pulse as f64).hypot(at[1] + 10.0);
    let axis = || (-60..=60).map(|i| f64::from(i) * 0.05);
    let (mut sum, mut pixels) = (0.0, 0.0);
    for y in axis() {
        for x in axis() {
            if (x - place_m[0]).hypot(y - place_m[1]) < 1.0 {
                continue;
            }
            let painted: Complex64 = (0..count)
                .map(|i| i * 160 / (count - 1).max(1))
                .map(|pulse| {
                    let off_m = distance_m(pulse, [x, y]) - distance_m(pulse, place_m);
                    sinc(off_m / CELL_M) * Complex64::cis(4.0 * PI / WAVELENGTH_M * off_m)
                })
                .sum();
            sum += (painted / count as f64).norm_sqr();
            pixels += 1.0;
        }
    }
    10.0 * f64::log10(sum / pixels)
}

fn painting() -> Vec<Figure> {
    vec![
        figure(
            "radius of the first pulse's arc about its antenna, 11.385 m: largest difference",
            "a circle about the antenna",
            "{} m",
            [at_most(0.05 / 2.0)],
            "0, to half a pixel; the radius is that of (4.4, 10.5) m",
        ),
        figure(
            "distance of the two-pulse peak from the scatterer",
            "constructive at the target",
            "{} m",
            [About(0.0, 0.0)],
            "the pixel that it is in",
        ),
        figure(
            "peak of all pulses relative to a unit scatterer",
            "constructive at the target",
            "{} dB",
            [About(0.0, decibels(1.0 + 10f64.powf(ASKED_DB / 20.0)))],
            "one, to the error asked for",
        ),
        figure(
            "mean power at 1 m and more from the scatterer with 1, 2, 8 and all pulses, dB",
            "destructive elsewhere",
            "{}, {}, {}, {}",
            // Errors of -60 dB change levels by at most 1 dB, that of the last one, -42 dB.
            [(1, 0.1), (2, 0.1), (8, 0.2), (161, 1.0)]
                .map(|(count, tolerance)| About(painted_db(count), tolerance)),
            "the sum of the arcs, to the error asked for",
        ),
        figure(
            "the final image's error against the exact matched filter",
            "focused",
            "{} dB",
            [at_most(ASKED_DB)],
            "the error asked for",
        ),
    ]
}

fn truck() -> Vec<Figure> {
    let beam = 13.3f64.to_radians();
    // Transform of the two-way beam, exp(-8 ln 2 (theta / beam)^2) in power.
    let gaussian_m = 2f64.sqrt() * LN_2 * WAVELENGTH_M / (PI * beam);
    let quoted = "0.13 m";
    vec![
        figure(
            "range resolution, c / 2B",
            "0.5 m",
            "{} m",
            [About(CELL_M, 0.0)],
            "c / 2B",
        ).printed(),
        figure(
            "width in range: 0.886 c / 2B, measured",
            "0.443 m",
            "{} m",
            [About(HALF_POWER * CELL_M, 0.01 * CELL_M)],
            "0.886 c / 2B; looking aside by 5 degrees widens the band by 2 % at its edges, less in the mean",
        ),
        figure(
            "azimuth resolution by (2.40), lambda / (4 sin 6.65 deg)",
            quoted,
            "{} m",
            [About(WAVELENGTH_M / (4.0 * (beam / 2.0).sin()), 0.0)],
            "(2.40)",
        ).printed(),
        figure(
            "the same with the full beam in place of half",
            quoted,
            "{} m",
            [About(WAVELENGTH_M / (4.0 * beam.sin()), 0.0)],
            "(2.40) with the full beam",
        ).printed(),
        figure(
            "width in azimuth, measured",
            "0.13 m",
            "{} m",
            [About(gaussian_m, 0.01 * gaussian_m)],
            "the beam's transform; wavelengths within 8 % to both sides and sines for angles are each below 1 %",
        ).printed(),
        figure(
            "width in azimuth by closed form for this beam, 4 sqrt 2 ln 2 lambda / (4 pi beam)",
            "not given",
            "{} m",
            [About(gaussian_m, 0.0)],
            "the beam's transform",
        ),
    ]
}

/// Levels behind the far wall relative to it, dB: upper limit of the side lobes of all three objects, unweighted and with a Hamming window,
/// and lower limit of the near wall's, unweighted.
fn behind_db() -> [f64; 3] {
    let wavelength_m = LIGHT_M_S / 1.2e9;
    let around_m = LIGHT_M_S / (2.0 * 4e6);
    // Amplitudes by physical optics, two-way. Near wall: 0.5 m square in points of 0.1 m, 40 degrees off the axis of a Gaussian beam of 60
    // degrees.
    let points = || (-2..=2).map(|i| f64::from(i) * 0.1);
    let wall: Complex64 = points()
        .flat_map(|across| points().map(move |up| (1.0 + across * across + up * up).sqrt()))
        .map(|range_m| Complex64::cis(-4.0 * PI / wavelength_m * range_m) / range_m.powi(2))
        .sum();
    let beam = (-8.0 * LN_2 * (40.0f64 / 60.0).powi(2) / 2.0).exp();
    let near = 0.38 * 2.0 * PI.sqrt() * 0.01 / wavelength_m * wall.norm() * beam;
    // A trihedral of 0.6 m at 6.3 m, and a wall at 16 m that reflects like a mirror.
    let corner = (4.0 * PI / 3.0).sqrt() * 0.36 / wavelength_m / 6.3f64.powi(2);
    let far = 0.38 * PI.sqrt() / 16.0;
    // With 50 carriers side lobes are periodic in range.
    let envelope = |from_m: f64, at_m: f64| 1.0 / (50.0 * (PI * (at_m - from_m) / around_m).sin());
    let sides = |at_m: f64| {
        [(near, 1.0), (corner, 6.3), (far, 16.0)]
            .map(|(level, from_m)| level / far * envelope(from_m, at_m))
    };
    let most = (0..=110)
        .map(|i| sides(19.0 + 0.1 * f64::from(i)).iter().sum())
        .fold(0.0, f64::max);
    let [by_near, by_corner, by_far] = sides(30.0);
    // Largest side lobe of the Hamming window.
    let hamming = 10f64.powf(-42.7 / 20.0) * (near + corner + far) / far;
    [most, hamming, by_near - by_corner - by_far].map(decibels)
}

/// The radar with 50 steps of 4 MHz and its three objects; peaks to this part of a cell.
pub(crate) fn three_objects(part: f64, from: &'static str) -> Vec<Figure> {
    let cell_m = LIGHT_M_S / (2.0 * 200e6);
    let near = |range_m: f64| [About(range_m, cell_m * part)];
    vec![
        figure(
            "range resolution, c / 2B",
            "0.75 m",
            "{} m",
            [About(cell_m, 0.0)],
            "c / 2B",
        )
        .printed(),
        figure(
            "largest range, c / (2 4 MHz)",
            "37.47 m",
            "{} m",
            [About(LIGHT_M_S / (2.0 * 4e6), 0.0)],
            "c / (2 step)",
        )
        .printed(),
        figure(
            "wall at 1 m: range, estimated together with the others",
            "1 m",
            "{} m",
            near(1.0),
            from,
        )
        .printed(),
        figure(
            "corner reflector at 6.3 m: range, estimated together with the others",
            "6.3 m",
            "{} m",
            near(6.3),
            from,
        )
        .printed(),
        figure(
            "wall at 16 m: range, estimated together with the others",
            "16 m",
            "{} m",
            near(16.0),
            from,
        )
        .printed(),
        figure(
            "corner reflector, by the precision of the laser",
            "6.3 m, verified by a laser range finder of 0.01 m",
            "{} m",
            [About(6.3, 0.01)],
            "where it was put",
        ),
    ]
}

fn stepped() -> Vec<Figure> {
    let [most_db, hamming_db, least_db] = behind_db();
    let mut figures = vec![
        figure(
            "bandwidth, 50 steps of 4 MHz",
            "200 MHz",
            "{} MHz",
            [About(50.0 * 4.0, 0.0)],
            "50 steps of 4 MHz",
        )
        .printed(),
    ];
    figures.extend(three_objects(
        0.25,
        "where it was put, as the thesis's laser had it, to a quarter of a cell",
    ));
    figures.push(figure(
        "19 to 30 m, relative to the wall at 16 m: unweighted, Hamming",
        "no scatterer there: side lobes of a sinc",
        "{} dB, {} dB",
        [Within(least_db, most_db), at_most(hamming_db)],
        "side lobes of the three by physical optics, for and against each other",
    ));
    figures
}
