//! Registered images of all channels on one grid: clutter has the same value in each.
//!
//! ```text
//! channels ── alignment (section, lags) ── balance (gain, phase, delay) ── former, one image per channel ── registration ──> images
//! ```
//!
//! Each image is formed by a former within its error bound, with the channel's own antenna positions. Its error remains after clutter
//! is cancelled: a bound of -60 dB limits cancellation to about 57 dB.

use glam::DVec3;
use num_complex::Complex64;
use rayon::prelude::*;
use serde_json::{Map, Value};
use subaperture_focus::{ImageFormer, Numerics, Task};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::{Image, power};
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::{Channels, Pulse, Weights};
use subaperture_signal::window::Window;

use crate::adaptive::widen;
use crate::alignment::Alignment;
use crate::balance::{self, Balanced, ChannelBalance};
use crate::error::GmtiError;
use crate::registration::{self, PhaseModel, View, median};

/// Memory of detection per pixel, bytes: results of bands, statistic, groups.
const DETECTION_BYTES: u64 = 40;

/// Settings of channel images.
#[derive(Clone, Copy)]
pub struct Imaging<'a> {
    /// Former of each image.
    pub former: &'a dyn ImageFormer,
    /// Pixel grid of all images.
    pub grid: &'a ImageGrid,
    /// Windows over frequency and slow time.
    pub windows: [Window; 2],
    /// Memory limit of images and formers, bytes.
    pub memory_bytes: u64,
    /// Transforms and timing model.
    pub numerics: Numerics<'a>,
    /// Receiver of progress and source of cancellation.
    pub monitor: &'a dyn Monitor,
}

/// Registered images of all channels.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct ChannelImages {
    /// Image of each channel.
    pub images: Vec<Image>,
    /// Balance that was removed from the samples of each channel.
    pub balances: Vec<ChannelBalance>,
    /// Phase model that was removed from each image but the first.
    pub models: Vec<PhaseModel>,
    /// Largest predicted relative RMS error of an image, dB.
    pub predicted_error_db: f64,
    /// Choices and figures of the former for each image.
    pub settings: Vec<Map<String, Value>>,
    /// Frequency of sample `K/2`, the reference of phases, hertz.
    pub centre_hz: f64,
    /// Weights with which each image was formed.
    pub(crate) weights: Vec<Weights>,
    /// View of the grid's centre in the middle of the aperture.
    pub view: View,
}

impl Imaging<'_> {
    /// Form the registered images of `channels`.
    ///
    /// # Errors
    /// [`GmtiError`].
    pub fn form(
        &self,
        channels: &Channels,
        alignment: &Alignment,
    ) -> Result<ChannelImages, GmtiError> {
        let grid = self.grid;
        let band = balance::similar_band(channels)?;
        let held_bytes = self.image_bytes(channels.len());
        let needed_bytes = self.held_bytes(channels.len());
        if needed_bytes > self.memory_bytes {
            return Err(GmtiError::Memory {
                channels: channels.len(),
                needed_bytes,
                allowed_bytes: self.memory_bytes,
            });
        }
        let centre_m = grid.position_m(grid.rows.count / 2, grid.columns.count / 2);
        let balances = balance::balance(channels, alignment, centre_m)?;
        let [fast, slow] = self.windows;
        let weights = alignment.weights(band.count, fast, slow);
        let mut images = Vec::with_capacity(channels.len());
        let mut settings = Vec::with_capacity(channels.len());
        let mut predicted_error_db = f64::NEG_INFINITY;
        for (c, weights) in weights.iter().enumerate() {
            let history = Balanced::new(channels.channel(c), &balances[c]);
            let task = Task {
                memory_bytes: self.memory_bytes - held_bytes,
                monitor: self.monitor,
                numerics: self.numerics,
                ..Task::new(&history, grid, weights)
            };
            let formed = self.former.form(&task)?;
            predicted_error_db = predicted_error_db.max(formed.predicted_error_db);
            settings.push(formed.settings);
            images.push(formed.image);
        }
        let view = self.view(channels, alignment, centre_m, band.centre_hz());
        let mut models = Vec::new();
        if let Some((reference, others)) = images.split_first_mut() {
            for image in others {
                let model = registration::estimate(reference, image, grid, &view);
                let model = model.ok_or_else(|| {
                    GmtiError::Unsuited("the image has no power: no clutter to register".to_owned())
                })?;
                registration::remove(image, grid, &view, &model);
                models.push(model);
            }
        }
        Ok(ChannelImages {
            images,
            balances,
            models,
            predicted_error_db,
            settings,
            centre_hz: band.centre_hz(),
            weights,
            view,
        })
    }

    /// Memory of the images of channels, bytes.
    fn image_bytes(&self, channels: usize) -> u64 {
        (channels as u64).saturating_mul(8 * self.grid.num_pixels())
    }

    /// Memory of the images of channels and of their detection, bytes.
    pub(crate) fn held_bytes(&self, channels: usize) -> u64 {
        let detection_bytes = DETECTION_BYTES * self.grid.num_pixels();
        self.image_bytes(channels).saturating_add(detection_bytes)
    }

    fn view(
        &self,
        channels: &Channels,
        alignment: &Alignment,
        centre_m: DVec3,
        centre_hz: f64,
    ) -> View {
        let pulses = alignment.middle_pulses();
        let track = &channels.channel(0).collection().pulses[pulses];
        let place = Pulse::phase_centre_m;
        let antenna_m = place(&track[track.len() / 2]);
        let velocity = place(&track[track.len() - 1]) - place(&track[0]);
        View::new(
            antenna_m,
            velocity,
            centre_m,
            SPEED_OF_LIGHT_M_S / centre_hz,
        )
    }
}

/// Edge of the blocks whose median is the cancellation, pixels.
const BLOCK: usize = 16;

/// Comparison of two registered images of a scene of clutter.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Cancellation {
    /// Ratio of the mean power of both images to half of that of their difference, dB; median over blocks of pixels.
    pub ratio_db: f64,
    /// Coherence of both images, 0 to 1; median over blocks.
    pub coherence: f64,
}

impl ChannelImages {
    /// Mean of the registered images: clutter has the same value in each, and noise of `C` channels is lower by `10 log10 C` dB.
    pub fn mean(&self) -> Image {
        let [first, others @ ..] = &self.images[..] else {
            return Image {
                rows: 0,
                columns: 0,
                pixels: Vec::new(),
            };
        };
        let scale = 1.0 / self.images.len() as f32;
        let mut mean = first.clone();
        let lines = mean.pixels.par_chunks_mut(first.columns.max(1));
        lines.enumerate().for_each(|(row, line)| {
            let start = row * first.columns;
            for image in others {
                let own = &image.pixels[start..start + line.len()];
                line.iter_mut()
                    .zip(own)
                    .for_each(|(sum, pixel)| *sum += pixel);
            }
            line.iter_mut().for_each(|sum| *sum *= scale);
        });
        mean
    }

    /// Predicted relative RMS error of `mean`, the mean of the images, dB.
    ///
    /// Image `c` has the RMS value `s_c` and an error of at most `b s_c`, with the largest relative error `b` of all images. By the triangle
    /// inequality the error of the mean is at most `b sum_c s_c / C`, whatever the correlation of the errors. Relative to the RMS value `m` of
    /// the mean it is at most `b (sum_c s_c / C) / m`. The second factor is 1 for equal images and `C^(1/2)` for independent ones. It is measured.
    pub fn mean_error_db(&self, mean: &Image) -> f64 {
        let rms = |image: &Image| {
            let lines = image.pixels.par_chunks(image.columns.max(1));
            let powers = lines.map(|line| line.iter().map(|&pixel| power(pixel)).sum::<f64>());
            // A sum in order, so that it does not depend on the number of threads.
            let powers: Vec<f64> = powers.collect();
            powers.iter().sum::<f64>().sqrt()
        };
        let own = self.images.iter().map(rms).sum::<f64>() / self.images.len() as f64;
        self.predicted_error_db + 20.0 * libm::log10(own / rms(mean))
    }

    /// Cancellation of the clutter of a channel with the first one. For a coherence `rho` and equal powers the ratio is `1 / (1 - rho)`.
    pub fn cancellation(&self, channel: usize) -> Cancellation {
        let [a, b] = [0, channel].map(|c| &self.images[c]);
        let across = a.columns.div_ceil(BLOCK);
        let block = |i: usize| {
            let (first_row, first_column) = (i / across * BLOCK, i % across * BLOCK);
            let (mut cross, mut rest, mut powers) = (Complex64::ZERO, 0.0, [0.0; 2]);
            for row in first_row..(first_row + BLOCK).min(a.rows) {
                for column in first_column..(first_column + BLOCK).min(a.columns) {
                    let at = row * a.columns + column;
                    let values = [a, b].map(|image| widen(image.pixels[at]));
                    cross += values[1] * values[0].conj();
                    rest += (values[1] - values[0]).norm_sqr();
                    powers = [0, 1].map(|i| powers[i] + values[i].norm_sqr());
                }
            }
            let ratio = (powers[0] + powers[1]) / rest;
            (ratio, cross.norm() / (powers[0] * powers[1]).sqrt())
        };
        let blocks = (0..across * a.rows.div_ceil(BLOCK)).into_par_iter();
        let (ratios, coherences): (Vec<f64>, Vec<f64>) = blocks.map(block).unzip();
        let [ratio, coherence] = [ratios, coherences].map(median);
        Cancellation {
            ratio_db: 10.0 * ratio.log10(),
            coherence,
        }
    }
}
