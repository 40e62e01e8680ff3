//! Expected values of the items of Schone 2020 on moving target indication (sections 1.2 and 6.2).
//!
//! Signal model: clutter is the same in all receivers after registration, noise is independent, and a target at the radial velocity `v` has the phase
//! `4 pi v tau_c / lambda` in a receiver of lag `tau_c`. A window `w` over `N` samples keeps `(sum w)^2 / (N sum w^2)` of the SNR.

use std::f64::consts::PI;

use subaperture_signal::window::Window;

use crate::figures::{About, Figure, Within, at_most, figure};
use crate::sub_cpis::{LIGHT_M_S, NUM_PULSES, decibels, sinc};

/// Radar of the scene: 10 GHz, 150 MHz at 200 frequencies, pulses of 1 ms at 125 m/s, 5 km before the scene and 1 km above it, noise of 10 dB.
const WAVELENGTH_M: f64 = LIGHT_M_S / 10e9;
const BANDWIDTH_HZ: f64 = 150e6;
const FREQUENCIES: f64 = 200.0;
const RADAR_M_S: f64 = 125.0;
const PRI_S: f64 = 1e-3;
const NOISE: f64 = 10.0;
/// Lags of the phase centres of receivers 0.4 and 1 m behind the first, seconds.
const LAGS_S: [f64; 3] = [0.0, 0.2 / RADAR_M_S, 0.5 / RADAR_M_S];

fn range_m() -> f64 {
    5000f64.hypot(1000.0)
}

/// Cosine of the grazing angle.
fn level() -> f64 {
    5000.0 / range_m()
}

/// Resolution along the track and across it on the ground, metres.
fn cells_m() -> [f64; 2] {
    let aperture_m = NUM_PULSES as f64 * PRI_S * RADAR_M_S;
    [
        WAVELENGTH_M * range_m() / (2.0 * aperture_m),
        LIGHT_M_S / (2.0 * BANDWIDTH_HZ * level()),
    ]
}

fn power_db(ratio: f64) -> f64 {
    decibels(ratio.sqrt())
}

/// Expected checks of an item.
pub(crate) fn figures(id: &str) -> Option<Vec<Figure>> {
    Some(match id {
        "s-6-1" => detected(),
        "s-6-2" => integrated(),
        "s-6-2-keystone" => keystone(),
        _ => return None,
    })
}

fn detected() -> Vec<Figure> {
    // Clutter of -5 dB per square metre in a resolution cell, and noise after the coherent sum.
    let [along_m, across_m] = cells_m();
    let clutter = 10f64.powf(-0.5) * along_m * across_m;
    let noise = NOISE / (NUM_PULSES as f64 * FREQUENCIES);
    let cancelled_db = power_db(1.0 + clutter / noise);
    // The fastest target, 1.2 m/s.
    let displaced_m = 1.2 * level() * range_m() / RADAR_M_S;
    vec![
        figure(
            "clutter cancelled between two receivers; predicted by clutter and noise",
            "moving targets only",
            "{} dB, predicted {} dB",
            [About(cancelled_db, 1.0), About(cancelled_db, 0.0)],
            "1 + CNR; median over blocks",
        ),
        figure(
            "targets detected, of those in the scene; false targets",
            "not done",
            "{} of {}, {} false",
            [About(3.0, 0.0), About(3.0, 0.0), About(0.0, 0.0)],
            "the scene, and 1e-6 false alarms per cell",
        ),
        figure(
            "largest displacement in the image, R v_r / V being predicted, and largest error of it",
            "not given",
            "{} m, error {} m",
            [About(displaced_m, 0.1), at_most(along_m / 4.0)],
            "R v_r / V, to the range of the target, 0.1 %",
        ),
        figure(
            "largest error of a corrected position along the track and across it, a resolution cell at most",
            "not done",
            "{} m and {} m",
            [at_most(along_m), at_most(across_m / 4.0)],
            "the truth",
        ),
        figure(
            "largest error of a radial velocity, 0.05 m/s at most",
            "not done",
            "{} m/s",
            // The same error moves the position.
            [at_most(along_m * RADAR_M_S / range_m())],
            "the truth",
        ),
        figure(
            "mean power of the refocused targets relative to their cross-sections",
            "not done",
            "{} dB",
            [About(0.0, 1.5)],
            "clutter 20 dB lower in the pixel of each, three standard deviations of the mean; pixels of half a cell",
        ),
    ]
}

/// Part of the SNR that the window keeps.
fn kept(count: usize) -> f64 {
    let weights = Window::default().weights(count);
    let squares: f64 = weights.iter().map(|w| w * w).sum();
    weights.iter().sum::<f64>().powi(2) / (count as f64 * squares)
}

fn integrated() -> Vec<Figure> {
    let count = 26.0;
    // SINR of 1 m^2 in a sub-CPI of 40 pulses: the part of the target's vector that is orthogonal to that of clutter, as the variance of the phasors.
    let sinr = |velocity: f64| {
        let phases = LAGS_S.map(|lag_s| 4.0 * PI * velocity * level() * lag_s / WAVELENGTH_M);
        let mean = [f64::cos, f64::sin].map(|of| phases.map(of).iter().sum::<f64>() / 3.0);
        let orthogonal = 3.0 * (1.0 - mean[0].powi(2) - mean[1].powi(2));
        orthogonal * 40.0 * FREQUENCIES * kept(40) * kept(200) / NOISE
    };
    let sinr_db = power_db(sinr(1.5));
    // `Pfa^(1 / (1 + SINR)) = Pd`, at velocities whose phases are small: their variance is that of the lags.
    let least = 1e-6f64.ln() / 0.5f64.ln() - 1.0;
    let slope = sinr(1e-3).sqrt() / 1e-3;
    let [one, all] = [1.0, count].map(|count: f64| (least / count).sqrt() / slope);
    vec![
        figure(
            "gain of the coherent sum of sub-CPIs over one; predicted is their number",
            "theoretically possible",
            "{} dB, predicted {} dB",
            [About(power_db(count), 0.05), About(power_db(count), 0.0)],
            "10 log10 26",
        ),
        figure(
            "SINR of 1 m^2 at 1.5 m/s in one sub-CPI and in all; predicted by noise",
            "not given",
            "{} dB and {} dB, predicted {} dB and {} dB",
            [
                About(sinr_db, 0.5),
                About(sinr_db + power_db(count), 0.5),
                About(sinr_db, 0.0),
                About(sinr_db + power_db(count), 0.0),
            ],
            "signal model; the estimated covariance",
        ),
        figure(
            "minimum detectable velocity of 1 m^2 in one sub-CPI and in all; predicted by noise",
            "not given",
            "{} m/s and {} m/s, predicted {} m/s and {} m/s",
            [
                About(one, 0.1 * one),
                About(all, 0.1 * all),
                About(one, 0.01 * one),
                About(all, 0.01 * all),
            ],
            "Swerling 1 at a known covariance, small phases",
        ),
        figure(
            "minimum detectable velocity in all sub-CPIs relative to one, a half at most",
            "improved",
            "{}",
            [About(1.0 / count.sqrt(), 0.02)],
            "1 / sqrt(26) for small phases",
        ),
    ]
}

fn keystone() -> Vec<Figure> {
    // Amplitude without Keystone: in each part of the band the target has another Doppler frequency. Over frequency and pulses the phase of the walk is a product: the
    // mean over the band of the response of the slow-time window, here by sums over half the points in each.
    let walk = |velocity: f64| {
        let half = |count: usize| {
            let weights = Window::default().weights(count);
            let sum: f64 = weights.iter().sum();
            let place = move |i: usize| (i as f64 + 0.5) / count as f64 - 0.5;
            weights
                .into_iter()
                .enumerate()
                .map(move |(i, w)| (place(i), w / sum))
        };
        let cells = 2.0 * velocity * level() * 260.0 * PRI_S * BANDWIDTH_HZ / LIGHT_M_S;
        let term = |(u, a): (f64, f64)| {
            let row = half(130).map(|(t, b)| a * b * (2.0 * PI * cells * u * t).cos());
            row.sum::<f64>()
        };
        half(100).map(term).sum::<f64>()
    };
    let fastest_db = decibels(walk(28.0));
    // Less than without windows, where the mean is that of the range response.
    assert!(walk(28.0) > sinc(0.5 * 7.0).abs() && walk(0.0) > 0.999);
    vec![
        figure(
            "target of 28 m/s without Keystone; predicted is the mean of the range response over the range walk",
            "degraded",
            "{} dB, predicted {} dB",
            [About(fastest_db, 0.5), About(fastest_db, 0.1)],
            "mean of the range response over the range walk, with both windows",
        ),
        figure(
            "six targets of 3 to 28 m/s without Keystone: largest difference from the prediction",
            "not given",
            "{} dB",
            [at_most(0.5)],
            "the same mean",
        ),
        figure(
            "six targets of 3 to 28 m/s with Keystone: largest difference from their cross-sections",
            "not given",
            "{} dB",
            [at_most(0.2)],
            "noise, 53 dB below; the covariance",
        ),
        figure(
            "change of SINR by Keystone at 0.1, 1 and 5 m/s, 0.1 dB at most",
            "ideally none",
            "{} dB, {} dB and {} dB",
            [Within(0.0, 0.1), Within(0.0, 0.1), Within(0.0, 0.1)],
            "noise alone remains after the filter, with and without Keystone",
        ),
    ]
}
