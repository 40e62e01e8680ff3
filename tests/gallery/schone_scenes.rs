//! Expected values of the items of Schone 2020 on whole scenes: differences, movers, time and memory (chapters 4 and 5).

use std::f64::consts::PI;

use crate::figures::{About, Figure, Within, at_least, at_most, figure};
use crate::schone_points::{LOBE_DB, READING_DB, SINC_DB, cell_m, cross_range_m, wavelength_m};
use crate::sub_cpis::{NUM_PULSES, RANGE_M, SPACING_M, decibels, sinc};

/// Speed of the radar.
const RADAR_M_S: f64 = 125.0;
const TARGET_M_S: f64 = 3.53553;
/// Time from the first pulse of Table 4.1 to the last.
const DURATION_S: f64 = (NUM_PULSES - 1) as f64 * 1e-3;

/// Expected checks of an item.
pub(crate) fn figures(id: &str) -> Option<Vec<Figure>> {
    Some(match id {
        "s-4-10" => difference(),
        "s-4-11" => large_scene(),
        "s-4-12" => smeared(),
        "s-4-13" => at_its_velocity(),
        "s-4-14" => fast(),
        "s-table-5-1" => times(),
        "s-5-2" => memory(),
        _ => return None,
    })
}

fn difference() -> Vec<Figure> {
    // Hamming-weighted responses: Keystone's sinc -43.9 dB, interpolation 0.2 % in range and 0.08 % in Doppler.
    let error = 10f64.powf(-43.9 / 20.0) + 0.002 + 0.0008;
    // The ratio of two complex Gaussian amplitudes exceeds x with probability 1 / (1 + x^2 / error^2), for 200 % 1 - error^2 / 4.
    let beyond = error * error / 4.0;
    // Where this ratio is in the largest thousandth, the image's power is a thousandth of its usual value.
    let dark_db = 10.0 * 0.001f64.log10();
    vec![
        figure(
            "simulated scene: pixels within 0 to 200 %",
            "a majority",
            "{} %",
            [at_least(100.0 * (1.0 - 4.0 * beyond))],
            "an error of 0.9 % in speckle; four times as many for shadows",
        ),
        figure(
            "simulated scene: median difference",
            "in general very small",
            "{} %",
            [at_most(100.0 * error)],
            "Keystone's sinc and reading",
        ),
        figure(
            "simulated scene: where the largest thousandth of differences lie, against the image's median",
            "very dark",
            "{} dB",
            [About(dark_db, 6.0)],
            "speckle under an even error; that it is larger where the image is bright takes some",
        ),
        figure(
            "simulated scene: brightest pixel",
            "less than 0.1 dB apart",
            "{} dB",
            [at_most(0.1)],
            "the thesis's words",
        ),
    ]
}

fn large_scene() -> Vec<Figure> {
    // The corner at (-4, -12, 0) m in front of a radar at (0, -4000, 3000) m.
    let range_m = 4f64.hypot(3988.0).hypot(3000.0);
    let lobe_m = |length: f64| wavelength_m() * range_m / (2.0 * length * SPACING_M);
    // Lobes are as wide as a cell, with a Hamming window 1.5 times.
    let place = |length| About(lobe_m(length), 0.75 * cross_range_m());
    // Linear interpolation with a padding of P: the mean of the first lobe over positions between two bins is 1 / (6 P^2), in the middle
    // between them 1.5 times that, 3.5 dB. Other differences, -70 dB, add 2.4 dB to the lower one.
    let level_db = |padding: f64| -decibels(6.0 * padding * padding);
    vec![
        figure(
            "simulated scene, 29 pulses (for 249), Doppler 4x: place of the first lobe, by geometry and found",
            "20.6 m",
            "{} m",
            [place(29.0)],
            "lambda R / (2 D), to half a lobe",
        ),
        figure(
            "simulated scene, 58 pulses (for 499), Doppler 4x: place of the first lobe, by geometry and found",
            "10.3 m",
            "{} m",
            [place(58.0)],
            "lambda R / (2 D), to half a lobe",
        ),
        figure(
            "simulated scene: first lobe of the longer sub-CPI",
            "closer",
            "at {} m against {} m",
            [place(58.0), place(29.0)],
            "lambda R / (2 D), to half a lobe",
        ),
        figure(
            "simulated scene: first lobe with Doppler padded 16 times against 4",
            "weaker",
            "{} dB against {} dB",
            [About(level_db(16.0), 3.5 + 2.4), About(level_db(4.0), 3.5)],
            "linear reading's lobe, 1 / (6 P^2)",
        ),
    ]
}

fn smeared() -> Vec<Figure> {
    let length_m = 2.0 * TARGET_M_S * DURATION_S;
    let even_db = -10.0 * (length_m / cross_range_m()).log10();
    // Two points of the Cornu spiral are at most 1.35 times as far apart as its ends.
    let ripple_db = decibels(1.35);
    let displaced_m = -RANGE_M * TARGET_M_S / RADAR_M_S;
    vec![
        figure(
            "peak of the target, 0 dB being focused",
            "not focused",
            "{} dB",
            [Within(even_db - READING_DB, even_db + ripple_db)],
            "the power spread evenly over 2 v_x T, and Fresnel's ripple",
        ),
        figure(
            "length of the smear within 10 dB, 2 v_x T being predicted",
            "7.3 m",
            "{} m",
            [About(length_m, cross_range_m() + 0.3)],
            "2 v_x T, to half a cell at either end and a pixel",
        ),
        figure(
            "displacement along the track, R v_r / V being predicted",
            "-141.4 m",
            "{} m",
            [About(displaced_m, (length_m + cross_range_m()) / 2.0)],
            "R v_r / V; the brightest pixel may be anywhere in the smear",
        ),
    ]
}

fn at_its_velocity() -> Vec<Figure> {
    // Stationary scatterers are smeared like the target before, and lie outside the picture: no brighter than the mean of the smear.
    let smear_db = -10.0 * (2.0 * TARGET_M_S * DURATION_S / cross_range_m()).log10();
    // Velocity resolution at the middle of the collection: along the line of sight by the phase at its ends, across by that of t^2.
    let radial = wavelength_m() / (2.0 * DURATION_S);
    let tangential = wavelength_m() * RANGE_M / (2.0 * RADAR_M_S * DURATION_S * DURATION_S / 4.0);
    vec![
        figure(
            "peak at the right velocity, 0 dB being focused",
            "fully focused",
            "{} dB",
            [About(0.0, 0.5)],
            "focused; residual of 40 others, -26 dB or 5 %, added or subtracted",
        ),
        figure(
            "its distance from the target's place, half a resolution cell at most",
            "at its place",
            "{} m",
            [About(0.0, 0.0)],
            "the pixel of its place; the next is half as bright",
        ),
        figure(
            "strongest stationary scatterer",
            "unfocused",
            "{} dB",
            [at_most(smear_db)],
            "the power spread evenly over 2 v_x T",
        ),
        figure(
            "v_x of the peak",
            "3.54 m/s",
            "{} m/s",
            [About(TARGET_M_S, 0.1)],
            "the target's, to a step of the velocities tried",
        ),
        figure(
            "v_y of the peak",
            "3.536 m/s",
            "{} m/s",
            [About(TARGET_M_S, 0.002)],
            "the target's, to a step of the velocities tried",
        ),
        figure(
            "resolution across the line of sight against along it",
            "poor against high",
            "{} m/s against {} m/s",
            [
                About(tangential, 0.01 * tangential),
                About(radial, 0.01 * radial),
            ],
            "lambda R / (2 V T^2 / 4) and lambda / 2T, to a few pulses",
        ),
    ]
}

fn fast() -> Vec<Figure> {
    // 50 m/s, 80 pulses of 0.1 ms, range cells of 1 GHz: part of the range response in a sub-CPI whose middle is `off` cells from the
    // target's, in a Doppler cell `order` from the target's.
    let response = |off: f64, order: f64| {
        let cells = |n: f64| (n - 39.5) * 50.0 * 1e-4 / cell_m(1e9);
        let sums = (0..80).map(f64::from).map(|n| {
            let turns = order * (n - 39.5) / 80.0;
            let level = sinc(cells(n) - off) / 80.0;
            [
                level * (2.0 * PI * turns).cos(),
                level * (2.0 * PI * turns).sin(),
            ]
        });
        let [re, im] = sums.fold([0.0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
        re.hypot(im)
    };
    let largest = |order: f64| {
        (-30..=30)
            .map(|i| response(f64::from(i) / 10.0, order))
            .fold(0.0, f64::max)
    };
    // With Keystone the side lobes of the 10 m of track remain, beyond 8 m those from 5.5 cells on; over the band of 10 % they are smeared
    // by as much of their distance.
    let side_db = decibels((sinc(5.5) * sinc(5.5 * 0.1 / 2.0)).abs());
    vec![
        figure(
            "peak without Keystone; predicted is the mean of the range response over the target's motion",
            "-7.9 dB",
            "{} dB",
            [About(decibels(largest(0.0)), 0.25)],
            "the mean of the range response over the target's motion; no Keystone, interpolation 0.05 dB, pixels of 0.05 m 0.2 dB",
        ),
        figure(
            "peak with Keystone, 0 dB being focused",
            "as good as a stationary scene",
            "{} dB",
            [Within(-SINC_DB - READING_DB, 0.0)],
            "focused, less Keystone's sinc without a window, -32.9 dB, and reading",
        ),
        figure(
            "strongest artefact beyond 8 m in cross-range, below its own peak: without and with",
            "very high without",
            "{} dB and {} dB",
            [
                About(decibels(largest(1.0) / largest(0.0)), LOBE_DB),
                About(side_db, LOBE_DB),
            ],
            "the same mean one Doppler cell on; the side lobe of an even aperture",
        ),
    ]
}

fn times() -> Vec<Figure> {
    // A pixel is interpolated once per sub-CPI in place of once per pulse, which saves at most all interpolations but one. Backprojection
    // processes 16 pixels at once, with phases from a table: up to 40 times as fast as one after another.
    let saved = |pulses: f64| [Within(1.0 / 40.0, pulses)];
    let from = "no more than a reading a pulse saved, and backprojection up to 40 times as fast a reading; the thesis's own times were those of its maps";
    vec![
        figure(
            "faster than backprojection by: 31 pulses, Doppler 16x",
            "4.49 times",
            "{} times",
            saved(31.0),
            from,
        )
        .printed(),
        figure(
            "faster than backprojection by: 63 pulses, Doppler 16x",
            "4.64 times",
            "{} times",
            saved(63.0),
            from,
        )
        .printed(),
        figure(
            "faster than backprojection by: 127 pulses, Doppler 8x",
            "7.65 times",
            "{} times",
            saved(127.0),
            from,
        )
        .printed(),
        figure(
            "127 pulses and coarser Doppler against 63",
            "much faster",
            "{} times",
            [Within(0.5, 2.0 * 127.0 / 63.0)],
            "no slower and at most half the work; a machine with other work to do may be off by two",
        ),
        figure(
            "faster than backprojection by: precise mode, 4096 pulses, 1024 x 1024 pixels",
            "4.49 to 7.65 times",
            "{} times",
            [Within(0.1, 4096.0)],
            "no more than a reading a pulse saved",
        ),
    ]
}

fn memory() -> Vec<Figure> {
    // Complex float64, range upsampled 10 times, numbers of Doppler bins a power of two.
    let bins = 21_232.0 * 10.0;
    let map_gb = |doppler_bins: f64| doppler_bins * bins * 16.0 * 1e-9;
    let pixels = 400e6;
    vec![
        figure(
            "a profile",
            "3.4 MB",
            "{} MB",
            [About(bins * 16.0 * 1e-6, 0.0)],
            "the thesis's count",
        )
        .printed(),
        figure(
            "a map of 31 pulses",
            "1.74 GB",
            "{} GB",
            [About(map_gb(512.0), 0.0)],
            "the thesis's count: 31 x 16 in 512",
        )
        .printed(),
        figure(
            "a map of 499 pulses",
            "27.83 GB",
            "{} GB",
            [About(map_gb(8192.0), 0.0)],
            "the thesis's count: 499 x 16 in 8192",
        )
        .printed(),
        figure(
            "the image",
            "6.4 GB",
            "{} GB",
            [About(pixels * 16.0 * 1e-9, 0.0)],
            "the thesis's count",
        )
        .printed(),
        figure(
            "range and Doppler of all pixels",
            "6.4 GB",
            "{} GB",
            [About(pixels * 2.0 * 8.0 * 1e-9, 0.0)],
            "the thesis's count",
        )
        .printed(),
        figure(
            "lines of sight",
            "nearly 20 GB",
            "{} GB",
            [About(pixels * 3.0 * 16.0 * 1e-9, 0.0)],
            "three components of 16 bytes",
        ),
    ]
}
