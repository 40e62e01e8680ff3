//! Polar format algorithm: the aperture as samples of the scene's two-dimensional spectrum.
//!
//! With every pulse referred to a centre `q`, the path to a nearby point is linear in its position,
//! `path_n(p) - path_n(q) = g_n . (p - q)`, `g_n = u_t + u_r` (unit vectors from the antennas to `q`),
//! and the matched filter becomes
//!
//! ```text
//! a[n][k] = w_slow[n] w_fast[k] z[n][k] exp(+j 2 pi f_k (path_n(q) - reference_path_n) / c)
//! I(p)    = sum_n sum_k a[n][k] exp(+j 2 pi K_nk . p'),      K_nk = f_k g_n / c
//! ```
//!
//! a Fourier sum over samples on a polar raster (hence the name), where `K` is projected onto the
//! grid plane. The textbook method resamples that raster to a rectangular one. It then needs the
//! density of the samples as a weight, and approximates a filter with a *uniform* spectrum. The exact
//! sum that is the reference here weighs every *sample* equally. Gridding each sample onto
//! the rectangular raster with a kernel whose transform is divided out of the image (`raster`)
//! computes that sum without a density estimate, and is therefore used.
//!
//! **Distortion.** `p' = p - q` holds only at the centre. Elsewhere the curved wave front displaces and
//! defocuses. The displacement is corrected: `p'` is the position at which the linear paths fit the true
//! ones best over the aperture, by least squares over 16 pulses.
//!
//! **Residual.** The remaining path error cannot be corrected. At offsets `x` across and `y` along the line
//! of sight, range `R`, half angle `theta_m`, monostatic, straight track: a two-way path of
//!
//! ```text
//! e(theta) = (y^2 - x^2) theta^2 / R
//! ```
//!
//! less its mean, with an RMS phase of `(2 pi / lambda) |y^2 - x^2| theta_m^2 / R * 2 / (3 sqrt 5)`, which
//! is the relative RMS error. A quadratic phase of `pi / 2` at the ends of the aperture, the usual limit, is
//! reached at a radius of `2 rho sqrt(R / lambda)`, where `rho` is the cross-range resolution (Carrara, Goodman and
//! Majewski 1995, chapter 3); -60 dB is reached at 1/22 of it. [`PolarFormat`] predicts the error of
//! its worst pixel with the true paths.
//!
//! Neglected: that residual; periodic images of the kernels (below the requested bound). A grid around an antenna, whose pixel positions the raster cannot
//! represent, is refused.
//!
//! Cost: `W^2` complex multiply-adds per sample, two transforms, `W^2` and 16 paths per pixel;
//! it does not grow with pulses times pixels (`cost`). Memory: three rasters of about `(2 D W_K)^2` values, where `D` is the extent of the
//! grid and `W_K` that of the spectrum, in each direction.
//!
//! Accuracy: `tests/formers/pfa_ffbp.rs`, near the centre against the bound and far from it against the
//! formula above.

mod cost;
mod plane;
mod raster;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use glam::DVec3;
use num_complex::Complex32;
use rayon::prelude::*;
use serde_json::json;

use super::Entry;
use super::algorithm::Algorithm;
use super::error_bound::error_bound;
use super::options::ERROR_DB;
use crate::budget::Budget;
use crate::former_choices::misfit;
use crate::goal::misses;
use crate::patch::PatchSize;
use crate::pixels::for_each;
use crate::read_ahead::{BLOCKS_HELD, blocks_of, read_ahead};
use crate::{
    Decision, ErrorGoal, FormError, Forming, ImageSpec, MARGIN_DB, Reason, Remedy, Tile, Work,
    rounding,
};
use subaperture_kernels::compensation::{self, Ramp};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::monitor::{Monitor, during};
use subaperture_signal::kaiser_bessel::KaiserBessel;
use subaperture_signal::phase::phasor32;

use plane::{Extent, Plane};
use raster::{Raster, RasterSize, Readable, Track};

/// Former by the polar format algorithm.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PolarFormat {
    /// Bound on the relative RMS error of the image, dB (negative). The kernels keep it; the
    /// error from wave front curvature depends on the grid.
    pub error_db: f64,
    /// Point about which paths are linearised, scene frame, metres; default: the grid centre.
    pub centre_m: Option<DVec3>,
}

error_bound!(PolarFormat { centre_m: None });

impl PolarFormat {
    /// Set the point about which paths are linearised, scene frame, metres.
    #[must_use]
    pub fn centre_m(self, centre_m: DVec3) -> Self {
        Self {
            centre_m: Some(centre_m),
            ..self
        }
    }
}

impl Algorithm for PolarFormat {
    const ENTRY: Entry = Entry::new::<Self>(
        "pfa",
        "polar format: far scenes, small against their distance",
        &[ERROR_DB],
    );

    type Choices = Choices;

    fn decide(
        &self,
        spec: &ImageSpec,
        goal: &ErrorGoal,
        _: &dyn Monitor,
    ) -> Result<Decision<Choices>, FormError> {
        let collection = spec.collection;
        let plane = Plane::new(collection, spec.grid, self.centre_m);
        let extent = plane.image_extent(spec.grid);
        let [residual, rough] = plane.residual(collection, spec.weights, spec.grid);
        let rounded = rounding::path_phase_rad(spec.collection, spec.grid);
        let planned = |taps| rounding::total_db(&[residual, raster::error(taps), rounded]);
        // Where curvature uses up the margin, longer kernels may keep the bound.
        let taps = match self.taps() {
            4 if misses(planned(4), Some(self.error_db)) => 6,
            taps => taps,
        };
        let size = RasterSize::new(plane.spectrum(collection), extent, taps)?;
        let (kernels, planned_db) = (raster::error(taps), planned(taps));
        goal.check(planned_db, || {
            if residual > kernels {
                Reason::new("paths over so large a grid are not linear in the position")
                    .helped_by(&[Remedy::SmallerGrid, Remedy::OtherFormer(&["rdbp"])])
            } else {
                Reason::new("its interpolation kernels limit the error")
                    .helped_by(&[Remedy::OtherFormer(&["rdbp", "bp"])])
            }
        })?;
        Ok(Decision {
            choices: Choices {
                taps,
                centre_m: plane.centre_m.to_array(),
            },
            settings: json!({
                "centre_m": plane.centre_m.to_array(),
                "raster": size.cells,
                "kernel_taps": taps,
                "curvature_error_db": 20.0 * libm::log10(residual.max(1e-15)),
                "stray_error_db": rounding::total_db(&[rough, kernels, rounded]),
            }),
            planned_db,
            grain: PatchSize::PIXEL,
            cost: cost::cost(spec, &size),
        })
    }

    fn open<'a>(
        &self,
        spec: ImageSpec<'a>,
        choices: Choices,
    ) -> Result<Box<dyn Forming + 'a>, FormError> {
        if !choices.centre_m.iter().all(|x| x.abs() <= 1e12) {
            return Err(misfit(
                PolarFormat::ENTRY.name,
                "expected a centre within 1e12 m of the scene's origin",
            ));
        }
        Ok(match choices.taps {
            4 => Box::new(Opened::<4>::new(spec, choices)),
            _ => Box::new(Opened::<6>::new(spec, choices)),
        })
    }
}

/// Parameters fixed by a plan.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub(crate) struct Choices {
    taps: usize,
    centre_m: [f64; 3],
}

/// Plan opened for forming. The transform, which all tiles share, is computed with the first tile and kept.
struct Opened<'a, const W: usize> {
    spec: ImageSpec<'a>,
    plane: Plane<'a>,
    extent: Extent,
    norm: f64,
    transform: Mutex<Option<Arc<Readable<W>>>>,
}

impl<'a, const W: usize> Opened<'a, W> {
    fn new(spec: ImageSpec<'a>, choices: Choices) -> Self {
        let centre_m = DVec3::from(choices.centre_m);
        let plane = Plane::new(spec.collection, spec.grid, Some(centre_m));
        Self {
            extent: plane.image_extent(spec.grid),
            plane,
            norm: spec.weights.normalisation(),
            spec,
            transform: Mutex::new(None),
        }
    }

    /// Compute the transform of all samples.
    fn transform(&self, work: &Work) -> Result<Readable<W>, FormError> {
        let collection = self.spec.collection;
        let (num_samples, num_pulses) = (collection.num_samples, collection.pulses.len());
        let mut budget = Budget::new(work.memory_bytes);
        let band = self.plane.spectrum(collection);
        let mut raster = Raster::<W>::new(band, self.extent, &mut budget)?;
        let block = budget.take_block(
            "a pulse",
            (8 * BLOCKS_HELD * num_samples) as u64,
            num_pulses.min(cost::BLOCK_PULSES),
            &[Remedy::MoreMemory],
        )?;
        read_ahead(
            work.history,
            blocks_of(num_pulses, block),
            |pulses, samples| {
                let tracks: Vec<Track> = samples
                    .par_chunks_exact_mut(num_samples)
                    .zip(pulses.clone())
                    .map(|(row, n)| {
                        let _spreading = during(work.monitor, raster::SPREADING);
                        self.refer(n, row)
                    })
                    .collect();
                raster.spread(&tracks, samples, work.monitor);
                if work.monitor.cancelled() {
                    return Err(FormError::Cancelled);
                }
                // The remaining work is transforms and interpolation.
                work.monitor
                    .progress(0.6 * pulses.end as f64 / num_pulses as f64);
                Ok(())
            },
        )?;
        let transform = raster.transform(self.spec.numerics.transforms, work.monitor);
        work.monitor.progress(0.8);
        Ok(transform)
    }

    /// Refer the weighted samples of pulse `n` to the image centre; return their spatial frequencies.
    fn refer(&self, n: usize, row: &mut [Complex32]) -> Track {
        let ImageSpec {
            collection,
            weights,
            ..
        } = self.spec;
        let pulse = &collection.pulses[n];
        let gradient = self.plane.gradient(pulse);
        let path_m =
            pulse.relative_path_m(self.plane.centre_m) + gradient.dot(self.extent.centre_m);
        let delay_s = path_m / SPEED_OF_LIGHT_M_S;
        let weight = weights.slow[n] * self.norm;
        let ramp = Ramp::new(pulse.start_hz * delay_s, pulse.step_hz * delay_s, weight);
        compensation::refer(row, &weights.fast, ramp);
        let cycles = gradient / SPEED_OF_LIGHT_M_S;
        Track {
            start: cycles * pulse.start_hz,
            step: cycles * pulse.step_hz,
        }
    }
}

impl<const W: usize> Forming for Opened<'_, W> {
    fn form(&self, work: &Work, tiles: &mut [Tile]) -> Result<(), FormError> {
        let mut kept = self
            .transform
            .lock()
            .unwrap_or_else(|held| held.into_inner());
        let transform = match &*kept {
            Some(transform) => transform.clone(),
            None => kept.insert(Arc::new(self.transform(work)?)).clone(),
        };
        drop(kept);
        let beyond = AtomicBool::new(false);
        let stage = cost::PIXELS;
        for_each(
            self.spec.grid,
            tiles,
            work.monitor,
            stage,
            |point, pixel| {
                let place_m = self.plane.place(point) - self.extent.centre_m;
                if !place_m.abs().cmple(self.extent.half_m).all() {
                    beyond.store(true, Ordering::Relaxed);
                }
                *pixel += transform.at(place_m) * phasor32(transform.carrier.dot(place_m));
            },
        );
        if work.monitor.cancelled() {
            return Err(FormError::Cancelled);
        }
        // The extent comes from sampled pixels. It contains all pixels where paths are approximately linear; near an antenna they have
        // a cusp.
        if beyond.into_inner() {
            let why = "the linear approximation of paths fails: the grid lies around an antenna";
            let remedies = [Remedy::GridWithout, Remedy::OtherFormer(&["bp"])];
            return Err(FormError::Unsuited(Reason::new(why).helped_by(&remedies)));
        }
        work.monitor.progress(1.0);
        Ok(())
    }
}

impl PolarFormat {
    /// Kernel taps that keep the error bound, 4 or 6.
    fn taps(&self) -> usize {
        // Gridding and interpolation, in two directions each.
        let target = libm::pow(10.0, (self.error_db - MARGIN_DB) / 20.0);
        if 2.0 * KaiserBessel::new(4).error(0.25) <= target {
            4
        } else {
            6
        }
    }
}
