//! Expected values of the items of Schone 2020 on one point: range migration, sub-CPIs, grating lobes (chapters 2 and 4).
//!
//! Tolerances named "reading" are the largest loss of an amplitude by linear interpolation between bins: for a response padded `P` times
//! `pi^2 / (24 P^2)`, 1.5 times its mean; 0.036 dB in range (`P` = 10), 0.014 dB in Doppler (16).

use std::f64::consts::PI;

use crate::figures::{About, Figure, Within, at_most, figure};
use crate::sub_cpis::{
    BANDWIDTH_HZ, CENTRE_HZ, LIGHT_M_S, NUM_PULSES, RANGE_M, SPACING_M, decibels, level_db, lobe_m,
    peak_of_one_db, sinc, width_of_one_m,
};

/// Half-power width of an unweighted aperture's response, in resolution cells.
const HALF_POWER: f64 = 0.886;
/// Interpolation loss in range and Doppler together, dB.
pub(crate) const READING_DB: f64 = 0.036 + 0.014;
/// Effect of an amplitude error of -32.9 dB, that of Keystone's sinc without a window, dB.
pub(crate) const SINC_DB: f64 = 0.2;

pub(crate) fn wavelength_m() -> f64 {
    LIGHT_M_S / CENTRE_HZ
}

pub(crate) fn cell_m(bandwidth_hz: f64) -> f64 {
    LIGHT_M_S / (2.0 * bandwidth_hz)
}

/// Cross-range resolution `lambda R / 2L` of Table 4.1.
pub(crate) fn cross_range_m() -> f64 {
    wavelength_m() * RANGE_M / (2.0 * NUM_PULSES as f64 * SPACING_M)
}

/// Expected checks of an item.
pub(crate) fn figures(id: &str) -> Option<Vec<Figure>> {
    Some(match id {
        "s-table-2-1" => migration(),
        "s-2-2" => unfocused(),
        "s-2-3" => keystone(),
        "s-table-4-1" => resolutions(),
        "s-4-1" => scene(),
        "s-4-2" => point(),
        "s-4-3" => long_sub_cpis(),
        "s-4-4" => cuts(),
        "s-4-5" => array(),
        "s-4-6" => single_sub_cpi(),
        _ => return None,
    })
}

/// Table 2.1: 400 MHz, 1024 pulses of 0.5 ms, 10 m/s.
const MIGRATION_M: f64 = 10.0 * 1023.0 * 0.5e-3;

fn migration() -> Vec<Figure> {
    vec![
        figure(
            "migration",
            "5.12 m",
            "{} m",
            [About(MIGRATION_M, 0.0)],
            "v T between the first pulse and the last",
        )
        .printed(),
        figure(
            "range resolution",
            "0.375 m",
            "{} m",
            [About(cell_m(400e6), 0.0)],
            "c / 2B",
        )
        .printed(),
        figure(
            "length of the CPI",
            "5.12 s",
            "{} s",
            [About(1024.0 * 0.5e-3, 0.0)],
            "pulses times their interval; the caption has ten times as much",
        )
        .printed(),
    ]
}

fn unfocused() -> Vec<Figure> {
    let cells = MIGRATION_M / cell_m(400e6);
    // Number of Doppler cells, 2 v B / c over 1 / T; the power is spread evenly over range and Doppler cells.
    let spread_db = -20.0 * cells.log10();
    // Gibbs: the edge of a rectangle truncated in the other domain overshoots by 9 %, and here there is an edge in each dimension.
    let overshoot_db = 2.0 * decibels(1.0895);
    vec![
        figure(
            "range cells that the target crosses",
            "several",
            "{}",
            [About(cells, 0.0)],
            "v T over c / 2B",
        ),
        figure(
            "extent in range within 3 dB of the map's peak, against a resolution of 0.375 m",
            "several cells",
            "{} m",
            [About(MIGRATION_M, cell_m(400e6))],
            "the motion, to half a cell at either end",
        ),
        figure(
            "peak of the map, 0 dB being a focused target",
            "poor",
            "{} dB",
            [Within(spread_db, spread_db + overshoot_db)],
            "the power spread evenly, and Gibbs' overshoot",
        ),
    ]
}

fn keystone() -> Vec<Figure> {
    // Bins are half a Doppler cell and an eighth of a range cell apart: the nearest is within half of that.
    let missed_db = decibels(sinc(0.25) * sinc(1.0 / 16.0));
    vec![
        figure(
            "peak of the map, 0 dB being focused",
            "one point",
            "{} dB",
            [Within(missed_db, 0.0)],
            "a focused target, at the nearest bin",
        ),
        figure(
            "extent in range within 3 dB",
            "0.33 m",
            "{} m",
            [About(HALF_POWER * cell_m(400e6), cell_m(400e6) / 8.0)],
            "0.886 c / 2B, to a bin",
        ),
    ]
}

fn resolutions() -> Vec<Figure> {
    // Half-power width of the sampled response: an annular sector of +-0.74 degrees is an even band up to its squared sine, 0.02 %, and
    // 0.886 is rounded by as much.
    let about = |metres: f64| [About(metres, 0.001 * metres)];
    vec![
        figure(
            "range resolution, c / 2B",
            "0.749 m",
            "{} m",
            about(cell_m(BANDWIDTH_HZ)),
            "c / 2B",
        ),
        figure(
            "cross-range resolution, lambda R / 2L",
            "0.577 m",
            "{} m",
            about(cross_range_m()),
            "lambda R / 2L",
        ),
    ]
}

/// Variance of the phase that a sub-CPI of `length` neglects, `phi u^2` with `u` from -1 to 1 and `phi = 2 pi (D/2)^2 / (lambda R)`: the
/// relative power of the error.
fn neglected(length: f64) -> f64 {
    let half_m = length * SPACING_M / 2.0;
    (2.0 * PI * half_m * half_m / (wavelength_m() * RANGE_M)).powi(2) * 4.0 / 45.0
}

fn scene() -> Vec<Figure> {
    let error_db = 10.0 * neglected(40.0).log10();
    let correlation = |db: f64| (1.0 - 10f64.powf(db / 10.0)).sqrt();
    let of_scene = |[correlated, differing]: [&'static str; 2]| {
        [
            figure(
                correlated,
                "almost identical",
                "{}",
                [Within(
                    correlation(error_db + 1.0),
                    correlation(error_db - 1.0),
                )],
                "sqrt(1 - error^2) of the next line",
            ),
            figure(
                differing,
                "almost identical",
                "{} dB",
                [About(error_db, 1.0)],
                "the phase that a sub-CPI neglects; Keystone's sinc (-32.9 dB) and reading (-48 dB) add 0.4 dB, lobes beyond the image take some",
            ),
        ]
    };
    let names = [
        [
            "correlation of the two complex images, 41 scatterers",
            "relative RMS difference, phase included, 41 scatterers",
        ],
        [
            "correlation of the two complex images, farm",
            "relative RMS difference, phase included, farm",
        ],
    ];
    names.into_iter().flat_map(of_scene).collect()
}

fn point() -> Vec<Figure> {
    let loss_db = 10.0 * (1.0 - neglected(40.0)).log10();
    // Power is interpolated linearly between pixels of 0.1 m: at half of a sinc^2, f'' / f' is 0.7 per cell, and each side is off by an
    // eighth of that times the square of the pixel.
    let pixel_m = 0.1;
    let across_m = HALF_POWER * cross_range_m();
    let along_m = HALF_POWER * cell_m(BANDWIDTH_HZ);
    let tolerance = |cell_m: f64| 2.0 * 0.7 * pixel_m * pixel_m / (8.0 * cell_m);
    let across = About(across_m, tolerance(cross_range_m()));
    let along = About(along_m, tolerance(cell_m(BANDWIDTH_HZ)));
    vec![
        figure(
            "peak of the second against the first",
            "the same",
            "{} dB",
            [Within(loss_db - READING_DB, loss_db)],
            "the phase that a sub-CPI neglects, and reading",
        ),
        figure(
            "3 dB width in cross-range: second against first",
            "the same",
            "{} m against {} m",
            [across, across],
            "0.886 lambda R / 2L, to the reading of widths",
        ),
        figure(
            "3 dB width in range: second against first",
            "the same",
            "{} m against {} m",
            [along, along],
            "0.886 c / 2B, to the reading of widths",
        ),
    ]
}

/// Tolerance of a grating lobe's level: Keystone's sinc, at worst -32.9 dB of the peak, changes one of -25 dB by 3.5 dB; for those measured
/// here half a decibel suffices, because it is uncorrelated between sub-CPIs.
pub(crate) const LOBE_DB: f64 = 0.5;

fn long_sub_cpis() -> Vec<Figure> {
    let level = |length| About(level_db(lobe_m(length, 1), length), LOBE_DB);
    vec![
        figure(
            "first lobe of 8 sub-CPIs against that of 10",
            "closer",
            "at {} m against {} m",
            [130, 104].map(|length| About(lobe_m(length, 1), 0.0)),
            "lambda R / (2 D)",
        ),
        figure(
            "level of the first lobe: 8 against 10",
            "stronger",
            "{} dB against {} dB",
            [level(130), level(104)],
            "the plain sum over sub-CPIs",
        ),
        figure(
            "level of the first lobe of 10",
            "very high",
            "{} dB",
            [level(104)],
            "the plain sum over sub-CPIs",
        ),
    ]
}

fn cuts() -> Vec<Figure> {
    let (nearest_m, farthest_m) = (lobe_m(130, 1), lobe_m(130, 4));
    let [nearest_db, farthest_db] = [nearest_m, farthest_m].map(|place| level_db(place, 130));
    // Side lobes of backprojection are those of a unit aperture: sub-CPIs of a single pulse neglect no phase.
    let [bp_near_db, bp_far_db] = [nearest_m, farthest_m].map(|place| level_db(place, 1));
    let shared_m = lobe_m(52, 1);
    let reading = 10f64.powf(READING_DB / 20.0) - 1.0;
    vec![
        figure(
            "largest difference of a range cut from backprojection's, of the peak",
            "identical",
            "{} dB",
            [at_most(decibels(2.0 * reading))],
            "reading, of the cut and of the peak that it is divided by",
        ),
        figure(
            "first lobe of 8 sub-CPIs",
            "slightly less than 4 dB below",
            "{} dB",
            [About(nearest_db, 0.25)],
            "the plain sum over sub-CPIs; within the thesis's wording, -4 to -3.5",
        ),
        figure(
            "above backprojection's side lobes there",
            "25 dB",
            "{} dB",
            [About(nearest_db - bp_near_db, LOBE_DB)],
            "the plain sums",
        )
        .printed(),
        figure(
            "outermost lobe of 8 sub-CPIs",
            "more than 25 dB below",
            "{} dB",
            [About(farthest_db, LOBE_DB)],
            "the plain sum over sub-CPIs",
        ),
        figure(
            "above backprojection's side lobes there",
            "17 dB",
            "{} dB",
            [About(farthest_db - bp_far_db, LOBE_DB)],
            "the plain sums",
        )
        .printed(),
        figure(
            "lobe of 20 against that of 10 at the same place",
            "-3 dB",
            "{} dB",
            [About(
                level_db(shared_m, 52) - level_db(shared_m, 104),
                LOBE_DB,
            )],
            "the plain sums",
        )
        .printed(),
    ]
}

fn array() -> Vec<Figure> {
    vec![
        figure(
            "place of lobe 1",
            "11.53 m",
            "{} m",
            [About(lobe_m(52, 1), 0.0625)],
            "lambda R / (2 D), to a pixel of 0.0625 m",
        ),
        figure(
            "level of lobe 1: predicted from geometry, measured",
            "-21.1 dB",
            "{} dB",
            [About(level_db(lobe_m(52, 1), 52), LOBE_DB)],
            "the plain sum over sub-CPIs",
        ),
    ]
}

fn single_sub_cpi() -> Vec<Figure> {
    let [width_m, longer_m] = [104, 130].map(width_of_one_m);
    // One step of the sum's cut, and the interpolation between pixels of 0.1 m.
    let tolerance_m = 0.03;
    let peak = |length| {
        let level_db = peak_of_one_db(length);
        Within(level_db - READING_DB - SINC_DB, level_db + SINC_DB)
    };
    vec![
        figure(
            "3 dB width in cross-range: 104 pulses against all 1040",
            "much wider",
            "{} m against {} m",
            [
                About(width_m, tolerance_m),
                About(HALF_POWER * cross_range_m(), 0.005),
            ],
            "the plain sum; 0.886 lambda R / 2L, to the reading of widths",
        ),
        figure(
            "3 dB width in cross-range: 130 pulses against 104, which theory makes 0.80",
            "smeared, not better",
            "{}",
            [About(longer_m / width_m, 2.0 * tolerance_m / width_m)],
            "the plain sums",
        ),
        figure(
            "peak: 130 pulses against 104",
            "smeared",
            "{} dB against {} dB",
            [peak(130), peak(104)],
            "the plain sums, Keystone's sinc and reading",
        ),
    ]
}
