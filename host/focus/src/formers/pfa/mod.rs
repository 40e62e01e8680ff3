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
//! Majewski 1995, chapter 3); -60 dB is reached at 1/22 of it. The error of the worst pixel is predicted with the true paths.
//!
//! **Patches and sub-apertures** (`layout`). A grid whose residual exceeds the bound is divided into patches, each with its own centre `q`. Where the
//! aperture is long or bends, it is divided into sub-apertures with separate rasters and positions `p'`, and their images are
//! added. The residual falls with the square of either. A stated `centre_m` excludes both.
//!
//! Neglected: that residual; periodic images of the kernels (below the requested bound). A grid around an antenna, whose pixel positions the raster cannot
//! represent, is refused.
//!
//! Cost: `W^2` complex multiply-adds per sample and patch, two transforms per patch and sub-aperture, `W^2` and 16 paths per pixel and sub-aperture (`cost`).
//! Undivided, it does not grow with pulses times pixels. Memory: three rasters of about `(2 D W_K)^2` values, where `D` is the extent of the
//! grid or patch and `W_K` that of the spectrum, in each direction.
//!
//! Accuracy: `tests/formers/pfa_ffbp.rs`, near the centre against the bound and far from it against the
//! formula above.

mod cost;
mod forming;
mod layout;
mod plane;
mod raster;

use glam::DVec3;
use serde_json::json;

use super::Entry;
use super::algorithm::Algorithm;
use super::error_bound::error_bound;
use super::options::ERROR_DB;
use crate::former_choices::misfit;
use crate::goal::misses;
use crate::patch::PatchSize;
use crate::{
    Decision, ErrorGoal, FormError, Forming, ImageSpec, MARGIN_DB, Reason, Remedy, rounding,
};
use subaperture_model::monitor::Monitor;
use subaperture_signal::kaiser_bessel::KaiserBessel;

use forming::Opened;
use layout::{Layout, Planned};

/// Former by the polar format algorithm.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PolarFormat {
    /// Bound on the relative RMS error of the image, dB (negative).
    pub error_db: f64,
    /// Point about which all paths are linearised, scene frame, metres; the grid is not divided, and the error from wave-front curvature
    /// depends on its size. Default: the centre of the grid, or of each patch where the bound requires patches.
    pub centre_m: Option<DVec3>,
}

error_bound!(PolarFormat { centre_m: None });

impl PolarFormat {
    /// Set the point about which all paths are linearised, scene frame, metres.
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
        "polar format: fastest for far scenes, small against their distance",
        &[ERROR_DB],
    );

    type Choices = Choices;

    fn decide(
        &self,
        spec: &ImageSpec,
        goal: &ErrorGoal,
        monitor: &dyn Monitor,
    ) -> Result<Decision<Choices>, FormError> {
        let rounded = rounding::path_phase_rad(spec.collection, spec.grid);
        let whole = Planned::new(spec, Layout::whole(spec.grid, self.centre_m));
        let errors = |planned: &Planned, taps| [planned.residual[0], raster::error(taps), rounded];
        let keeps = |planned: &Planned, taps| {
            !misses(
                rounding::total_db(&errors(planned, taps)),
                Some(self.error_db),
            )
        };
        // Where curvature uses up the margin, longer kernels may keep the bound.
        let taps = match self.taps() {
            4 if !keeps(&whole, 4) => 6,
            taps => taps,
        };
        let divided = match keeps(&whole, taps) || self.centre_m.is_some() {
            true => None,
            false => self.divided(spec, &whole, rounded, monitor)?,
        };
        let (planned, taps) = divided.unwrap_or((whole, taps));
        let planned_db = rounding::total_db(&errors(&planned, taps));
        let ([residual, rough], kernels) = (planned.residual, raster::error(taps));
        goal.check(planned_db, || {
            if residual > kernels {
                Reason::new("paths over so large a grid are not linear in the position")
                    .helped_by(&[Remedy::SmallerGrid, Remedy::OtherFormer(&["rdbp"])])
            } else {
                Reason::new("its interpolation kernels limit the error")
                    .helped_by(&[Remedy::OtherFormer(&["rdbp", "bp"])])
            }
        })?;
        let layout = planned.layout;
        let rasters = layout.rasters(spec, taps)?;
        let patches = layout.patches(spec.grid);
        let PatchSize { rows, columns } = patches.size();
        Ok(Decision {
            settings: json!({
                "centre_m": self.centre_m,
                "patch": [rows, columns],
                "sub_apertures": rasters.len(),
                "raster": rasters.first().map(|size| size.cells),
                "kernel_taps": taps,
                "curvature_error_db": 20.0 * libm::log10(residual.max(1e-15)),
                "stray_error_db": rounding::total_db(&[rough, kernels, rounded]),
            }),
            planned_db,
            grain: match layout.is_whole(spec.grid) {
                true => PatchSize::PIXEL,
                false => patches.size(),
            },
            cost: cost::cost(spec, &layout, &rasters),
            choices: Choices { taps, layout },
        })
    }

    fn open<'a>(
        &self,
        spec: ImageSpec<'a>,
        choices: Choices,
    ) -> Result<Box<dyn Forming + 'a>, FormError> {
        let Choices { taps, layout } = choices;
        if !layout.fits(spec.collection.pulses.len()) {
            return Err(misfit(
                PolarFormat::ENTRY.name,
                "expected patches of at least one pixel, sub-apertures of at least one pulse, and a centre within 1e12 m of the scene's origin",
            ));
        }
        Ok(match taps {
            4 => Box::new(Opened::<4>::new(spec, layout)),
            _ => Box::new(Opened::<6>::new(spec, layout)),
        })
    }
}

/// Parameters fixed by a plan.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub(crate) struct Choices {
    taps: usize,
    layout: Layout,
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

    /// Fastest layout of patches and sub-apertures that keeps the bound with a path rounding of `rounded`, and its kernel taps.
    fn divided(
        &self,
        spec: &ImageSpec,
        whole: &Planned,
        rounded: f64,
        monitor: &dyn Monitor,
    ) -> Result<Option<(Planned, usize)>, FormError> {
        let target = libm::pow(10.0, self.error_db / 20.0);
        let mut best: Option<(f64, (Planned, usize))> = None;
        for taps in [4, 6] {
            let others = raster::error(taps).powi(2) + rounded.powi(2);
            let left = match taps {
                // A bound that the kernels exceed is approached.
                6 => (target.powi(2) - others).max(others / 4.0),
                _ => target.powi(2) - others,
            };
            if taps < self.taps() || left <= 0.0 {
                continue;
            }
            let time_s = |layout: &Layout| {
                let rasters = layout.rasters(spec, taps).ok()?;
                Some(cost::cost(spec, layout, &rasters).core_s())
            };
            let found = whole.fastest(spec, left.sqrt(), time_s, &|| monitor.cancelled())?;
            if let Some((time_s, planned)) = found
                && best.as_ref().is_none_or(|(least_s, _)| time_s < *least_s)
            {
                best = Some((time_s, (planned, taps)));
            }
        }
        Ok(best.map(|(_, found)| found))
    }
}
