//! Radial velocity of a detected target, and the amplitudes of its pixels.
//!
//! The radial velocity maximises
//!
//! ```text
//! J(v) = K sum_p |s(v)^H S^-1 x_p|^2 / (s(v)^H S^-1 s(v))
//! ```
//!
//! over the pixels of the target, the log likelihood of a target of unknown complex amplitude in each pixel; `S` is the sum over `K` training cells. With independent pixels the variance is the Cramer-Rao bound `-1 / J''(v)`. Noise of neighbouring
//! pixels is correlated: with the amplitudes `s_p`, the whitened noise `n_p` of unit power in each component, and the part `d` of the derivative of the whitened unit steering vector that is normal to it,
//!
//! ```text
//! J' = 2 Re sum_p s_p* d^H n_p,   -J'' = 2 |d|^2 sum_p |s_p|^2,
//! var(v) = var(J') / J''^2 = rho / -J'',   rho = Re sum_pq s_p* s_q <n_p n_q*> / sum_p |s_p|^2,
//! ```
//!
//! with the correlation `<n_p n_q*>` of one component ([`crate::noise`]).

use std::collections::HashSet;

use num_complex::{Complex32, Complex64};

use crate::adaptive::{Loading, Whitener, power, product};
use crate::alignment::Alignment;
use crate::detection::{
    Settings, StatisticMap, channels, steering, train, unambiguous_m_s, velocities_m_s,
};
use crate::error::GmtiError;
use crate::images::ChannelImages;
use crate::noise::{Echo, NoiseSpectrum};

/// Steps of the velocity search, per interval between tested velocities.
const FINE: usize = 8;

/// Radial velocity of a target.
pub(crate) struct Radial {
    /// Velocity, metres per second, positive when approaching.
    pub(crate) velocity_m_s: f64,
    /// Standard deviation, metres per second.
    pub(crate) deviation_m_s: f64,
    /// Interval of ambiguity, metres per second.
    pub(crate) ambiguity_m_s: f64,
    /// Pixels of the region, in units of clutter and noise, with one covariance for all.
    pub(crate) echoes: Vec<Echo>,
}

/// Radial velocity of a target by its `used` pixels, and the echoes of a `region`.
///
/// # Errors
/// [`GmtiError::Adaptive`] if training fails.
pub(crate) fn radial(
    images: &ChannelImages,
    alignment: &Alignment,
    settings: &Settings,
    map: &StatisticMap,
    noise: &NoiseSpectrum,
    (peak, used, region): (usize, &[usize], &[usize]),
) -> Result<Radial, GmtiError> {
    let (lags_s, centre_hz) = (alignment.lags_s(), images.centre_hz);
    let size = lags_s.len();
    let covariance = train(images, map, settings, peak, (size, channels));
    let whitener = covariance.factor(Loading::Off)?;
    let mut cell = vec![Complex32::ZERO; size];
    let mut white = |pixels: &[usize]| -> Vec<Vec<Complex64>> {
        let of_pixel = |&pixel: &usize| {
            channels(images, pixel, &mut cell);
            let mut white = vec![Complex64::ZERO; size];
            whitener.whiten(&cell, &mut white);
            white
        };
        pixels.iter().map(of_pixel).collect()
    };
    let [white_used, white_region] = [used, region].map(&mut white);
    let scale = (covariance.snapshots() as f64).sqrt();
    let amplitudes = |cells, velocity_m_s: f64| {
        let steering = steering(lags_s, centre_hz, velocity_m_s);
        matched(&whitener, &steering, cells).map(move |amplitude| scale * amplitude)
    };
    let likelihood = |velocity_m_s: f64| {
        let amplitudes = amplitudes(&white_used, velocity_m_s);
        amplitudes
            .map(|amplitude| amplitude.norm_sqr())
            .sum::<f64>()
    };
    let most = unambiguous_m_s(lags_s, centre_hz);
    let count = FINE * velocities_m_s(lags_s, centre_hz).len();
    let step = 2.0 * most / count as f64;
    let places = (0..count).map(|i| (i as f64 + 0.5) * step - most);
    let mut best = places
        .map(|v| (v, likelihood(v)))
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .expect("velocities are searched");
    let mut width = step / 2.0;
    while width > 1e-7 * most {
        for v in [best.0 - width, best.0 + width] {
            let there = likelihood(v);
            if there > best.1 {
                best = (v, there);
            }
        }
        width /= 2.0;
    }
    let h = step / 4.0;
    let curvature = (2.0 * best.1 - likelihood(best.0 + h) - likelihood(best.0 - h)) / (h * h);
    let echoes = |pixels: &[usize], amplitudes: &mut dyn Iterator<Item = Complex64>| {
        let pixels = pixels.iter().zip(amplitudes);
        let echo = |(&pixel, amplitude)| noise.echo(pixel, amplitude);
        pixels.map(echo).collect::<Vec<Echo>>()
    };
    let own = echoes(used, &mut amplitudes(&white_used, best.0));
    let [[twice]] = noise.covariance(&own, |_| [1.0]);
    let correlated = twice / (2.0 * own.iter().map(Echo::power).sum::<f64>());
    let deviation = match curvature > 0.0 {
        true => (correlated / curvature).sqrt().min(most),
        false => most,
    };
    Ok(Radial {
        velocity_m_s: best.0,
        deviation_m_s: deviation,
        ambiguity_m_s: 2.0 * most,
        echoes: echoes(region, &mut amplitudes(&white_region, best.0)),
    })
}

/// Pixels within an independent cell of the `used` ones, without detected pixels outside of the group `pixels`: they belong to other targets.
///
/// The statistic of the map is not used to locate a target: its threshold cuts off weak pixels, and its covariance changes from pixel to pixel.
pub(crate) fn region(map: &StatisticMap, used: &[usize], pixels: &[usize]) -> Vec<usize> {
    let span = |of: fn(usize, usize) -> usize, reach: usize, count: usize| {
        let places = used.iter().map(|&pixel| of(pixel, map.columns));
        let ends = places.fold([usize::MAX, 0], |[low, high], place| {
            [low.min(place), high.max(place)]
        });
        ends[0].saturating_sub(reach)..(ends[1] + reach + 1).min(count)
    };
    let rows = span(|pixel, columns| pixel / columns, map.spacing.rows, map.rows);
    let columns = span(
        |pixel, columns| pixel % columns,
        map.spacing.columns,
        map.columns,
    );
    let own: HashSet<usize> = pixels.iter().copied().collect();
    let all = rows.flat_map(|row| columns.clone().map(move |column| (row, column)));
    all.map(|(row, column)| row * map.columns + column)
        .filter(|pixel| !map.detected[*pixel] || own.contains(pixel))
        .collect()
}

/// `s^H x / (s^H s)^(1/2)` of each whitened vector.
fn matched<'c>(
    whitener: &Whitener,
    steering: &[Complex64],
    cells: &'c [Vec<Complex64>],
) -> impl Iterator<Item = Complex64> + use<'c> {
    let mut white = vec![Complex64::ZERO; steering.len()];
    whitener.whiten(steering, &mut white);
    let norm = power(&white).sqrt();
    cells.iter().map(move |cell| product(&white, cell) / norm)
}
