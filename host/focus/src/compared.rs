//! Image error estimated from pixels compared with the exact sum, by the formula of [`super::accuracy`].

use num_complex::{Complex32, Complex64};

use super::sampled::TileRecord;
use super::second_look::{Estimate, square_error};
use super::{ImageSpec, RecordedEnergy, rounding, stray};
use subaperture_kernels::folded_sums;

/// Factors `C` of the formula in [`super::accuracy`] where only evenly spread pixels are compared: error as planned, error larger than planned,
/// and error possibly concentrated in few pixels.
const SCATTER: f64 = 1.6;
const LARGER_SCATTER: f64 = 2.0;
const UNEVEN_SCATTER: f64 = 10.0;

/// Ratio of shown to planned error power above which the error counts as concentrated.
const UNEVEN: f64 = 4.0;

/// Ratio of mean square to term power below which a grid counts as dark.
const DARK: f64 = 0.3;

/// Ratio of the compared pixels' mean square to that of the image below which the image has its power, and its error, in pixels that were not compared.
const REPRESENTATIVE: f64 = 0.5;

/// Relative mean square error above which the formed pixels are dominated by the error rather than the scene.
const SPOILT: f64 = 0.01;

/// Smallest reported error, dB: float32 rounding of the image.
const MIN_DB: f64 = -200.0;

/// Planned error of a former, dB.
#[derive(Clone, Copy, Debug)]
pub(super) struct Planned {
    /// Relative RMS error of the plan, dB.
    pub(super) planned_db: f64,
    /// Part of the planned error that can focus scatterers outside the grid to points on it ([`stray`]), dB.
    pub(super) stray_db: f64,
    /// Ranges from which these scatterers can contribute.
    pub(super) from: stray::From,
}

impl Planned {
    /// Treat the whole planned error as able to focus scatterers from anywhere.
    pub(super) fn of(planned_db: f64) -> Self {
        Self {
            planned_db,
            stray_db: planned_db,
            from: stray::From::Anywhere,
        }
    }

    /// Read `stray_error_db` and `stray_from` from the settings of a decision. Defaults: the whole planned error, from anywhere.
    pub(super) fn of_settings(planned_db: f64, settings: &serde_json::Value) -> Self {
        Self {
            planned_db,
            stray_db: settings["stray_error_db"].as_f64().unwrap_or(planned_db),
            from: match settings["stray_from"].as_str() {
                Some(SWATH) => stray::From::Swath,
                _ => stray::From::Anywhere,
            },
        }
    }
}

impl Planned {
    /// Upper bound on the power that scatterers outside the grid leave on it, relative to the image energy `shown`. `recorded` is the sample
    /// energy at all ranges and at the ranges of the grid.
    pub(super) fn outside(
        &self,
        spec: &ImageSpec,
        recorded: [RecordedEnergy; 2],
        shown: f64,
    ) -> f64 {
        let recorded = match self.from {
            stray::From::Anywhere => recorded[0],
            stray::From::Swath => recorded[1],
        };
        libm::pow(10.0, self.stray_db / 10.0) * stray::outside(spec, recorded, shown) / shown
    }
}

/// Settings value of `stray_from` for scatterers at the ranges of the grid.
pub(super) const SWATH: &str = "swath";

/// Sums over the compared pixels of all tiles, and the image energy.
pub(super) struct Compared {
    /// Sum of squared errors and sum of squared exact values over the compared pixels.
    error: f64,
    exact: f64,
    /// Number of compared pixels, and number of all pixels.
    pub(super) count: usize,
    pub(super) total: usize,
    /// Mean square of the image, `M`.
    mean: f64,
    /// Power of all terms, `T`.
    terms: f64,
}

impl Compared {
    pub(super) fn of(spec: &ImageSpec, records: &[TileRecord]) -> Self {
        let total = spec.grid.num_pixels() as usize;
        let (mut error, mut exact, mut count) = (0.0, 0.0, 0usize);
        for seen in records.iter().flat_map(|record| &record.seen) {
            let formed = Complex32::new(seen.formed[0], seen.formed[1]);
            let expected = Complex64::new(seen.exact[0], seen.exact[1]);
            error += square_error(formed, expected);
            exact += expected.norm_sqr();
            count += 1;
        }
        Self {
            error,
            exact,
            count,
            total,
            mean: records.iter().map(|record| record.power).sum::<f64>() / total as f64,
            terms: records.iter().fold(0.0f64, |most, r| most.max(r.terms)),
        }
    }

    /// Mean square error of the compared pixels, relative to the mean square of the image.
    pub(super) fn shown(&self) -> f64 {
        self.error / self.count as f64 / self.mean
    }

    /// Largest error power expected of the image, relative to its power; `None` for a dark grid, which may have any error.
    ///
    /// It is the planned one where compared pixels are as bright as the image. Where they are weaker, pixels that were not compared have the image's power.
    /// Errors of terms that add in phase there are at most the planned part of that power, and errors of terms that cancel elsewhere are the planned part of the
    /// power of all terms: `1 + T / M` times the planned error power.
    pub(super) fn expected(&self, planned_db: f64) -> Option<f64> {
        let planned = libm::pow(10.0, planned_db / 10.0);
        match () {
            () if self.is_dark() => None,
            () if self.is_uneven() => Some(planned * (1.0 + self.terms / self.mean)),
            () => Some(planned),
        }
    }

    /// Whether the error may be concentrated in pixels that were not compared: the image is much weaker than noise of the same sample power, or
    /// the compared pixels are much weaker than the image.
    pub(super) fn is_uneven(&self) -> bool {
        let compared = self.exact / self.count as f64;
        self.is_dark() || compared < REPRESENTATIVE * self.mean
    }

    /// Whether the image is much weaker than noise of the same sample power.
    fn is_dark(&self) -> bool {
        self.mean < DARK * self.terms
    }
}

/// Measured errors of an image, dB.
pub(super) struct Measured {
    /// Error estimated from the compared pixels, dB.
    pub(super) measured_db: f64,
    /// Upper bound on the contribution of scatterers outside the grid, dB; minus infinity for no contribution.
    pub(super) outside_db: f64,
    /// Number of compared pixels.
    pub(super) count: usize,
}

/// Estimate the error of an image with planned error `planned`, from the records of all tiles and an optional second pass.
pub(super) fn measure(
    spec: &ImageSpec,
    records: &[TileRecord],
    planned: Planned,
    again: Option<Estimate>,
) -> Measured {
    let planned_db = planned.planned_db;
    let compared = Compared::of(spec, records);
    let Compared {
        mut error,
        exact,
        mut count,
        total,
        mean,
        terms,
    } = compared;
    let shown = compared.shown();
    let knows_all = count == total;
    let relative = if knows_all {
        error / exact
    } else if let Some(again) = again {
        error = again.error;
        count = again.count;
        again.upper() / total as f64 / mean
    } else if shown > SPOILT {
        UNEVEN_SCATTER * error / exact
    } else {
        let planned = libm::pow(10.0, planned_db / 10.0);
        let is_expected = compared
            .expected(planned_db)
            .is_some_and(|expected| shown <= expected);
        match () {
            () if compared.is_uneven() && is_expected => planned + SCATTER * shown,
            () if compared.is_uneven() || shown > UNEVEN * planned => UNEVEN_SCATTER * shown,
            () if shown > planned => LARGER_SCATTER * shown,
            () => SCATTER * shown,
        }
    };
    // The phases of the reference sum are rounded as well. Terms round independently, so the effect is small relative to their summed power,
    // not relative to the remainder after cancellation.
    let narrow = match records.iter().any(|record| record.narrow) {
        true => folded_sums::RMS,
        false => 0.0,
    };
    let stray = match knows_all {
        // All tiles record the same samples.
        false => {
            let recorded = records.iter().map(|record| record.recorded);
            let recorded = recorded.max_by(|a, b| a[0].all.total_cmp(&b[0].all));
            planned.outside(spec, recorded.unwrap_or_default(), total as f64 * mean)
        }
        true => 0.0,
    };
    let own = libm::hypot(rounding::path_phase_rad(spec.collection, spec.grid), narrow).powi(2)
        * terms
        / mean;
    // An image of zeros where the exact sum is zero has no error.
    let measured_db = match error == 0.0 && !own.is_finite() {
        true => MIN_DB,
        false => 10.0 * libm::log10(relative + own),
    };
    Measured {
        measured_db,
        outside_db: 10.0 * libm::log10(stray),
        count,
    }
}
