//! Extent of a patch's pixels around its centre in range and Doppler.

use rayon::prelude::*;
use subaperture_core::stream::{Patch, Setup};

use crate::image::kernels::Kernels;
use subaperture_focus::patch::Rectangle;
use subaperture_focus::sub_cpi::SubCpi;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;

/// Maximum path and path rate of a patch's pixels relative to the patch centre.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Reach {
    /// Path in metres.
    pub(super) path_m: f64,
    /// Path rate in metres per pulse.
    pub(super) rate_m: f64,
}

impl Reach {
    /// Extent over all of `sub_cpis`, evaluated at 5 x 5 points of the patch extended by one pixel: pixels belong to the nearest
    /// centre, and patches may differ by one row or column.
    pub(super) fn of(grid: &ImageGrid, rectangle: &Rectangle, sub_cpis: &[SubCpi]) -> Self {
        let fractions = |count: usize| {
            let beyond = 1.0 / (count.max(2) - 1) as f64;
            [-beyond, 0.25, 0.5, 0.75, 1.0 + beyond]
        };
        let centre = rectangle.centre_m(grid);
        let mut reach = Self::default();
        for sub_cpi in sub_cpis {
            let datum = sub_cpi.datum(centre);
            for row in fractions(rectangle.size.rows) {
                for column in fractions(rectangle.size.columns) {
                    let point = rectangle.point_m(grid, row, column);
                    let (path_m, rate_m) = sub_cpi.line(&datum, point);
                    reach = reach.max(Self {
                        path_m: path_m.abs(),
                        rate_m: rate_m.abs(),
                    });
                }
            }
        }
        reach
    }

    /// Extent of each of `rectangles`.
    pub(super) fn of_each(
        grid: &ImageGrid,
        rectangles: &[Rectangle],
        sub_cpis: &[SubCpi],
    ) -> Vec<Self> {
        rectangles
            .par_iter()
            .map(|rectangle| Self::of(grid, rectangle, sub_cpis))
            .collect()
    }

    /// Maximum of both extents.
    pub(super) fn max(self, other: Self) -> Self {
        Self {
            path_m: self.path_m.max(other.path_m),
            rate_m: self.rate_m.max(other.rate_m),
        }
    }

    /// Doppler bins per cycle that contain the Doppler band of this extent: `twice_nyquist`, or more if the band and the
    /// kernel's margin need them. `None` if the pulse spacing is too large for the band.
    pub(super) fn doppler_length(
        &self,
        cycles_m: f64,
        twice_nyquist: u16,
        taps: usize,
    ) -> Option<u16> {
        // 2 (span D + margin + 1) + 1 <= D, with one for the ceiling.
        let free = 1.0 - 2.0 * self.rate_m * cycles_m;
        if free <= 0.0 {
            return None;
        }
        let least = (2.0 * Kernels::margin(taps) as f64 + 3.0) / free;
        (least <= f64::from(u16::MAX)).then(|| twice_nyquist.max(least.ceil() as u16))
    }

    /// Patch whose gate contains this extent and a kernel of `taps`. `None` if it needs more bins than a patch can have.
    pub(super) fn patch(&self, setup: &Setup, centre_m: [f64; 3], taps: usize) -> Option<Patch> {
        let margin = Kernels::margin(taps) as f64;
        let range_bins_m = f64::from(setup.range_length) * setup.step_hz / SPEED_OF_LIGHT_M_S;
        let doppler_bins_m =
            f64::from(setup.doppler_length) * setup.centre_hz() / SPEED_OF_LIGHT_M_S;
        let bins = |reach: f64| {
            let bins = reach.ceil() + margin;
            (2.0 * bins < f64::from(u16::MAX)).then_some(bins as u16)
        };
        Some(Patch {
            centre_m,
            range_reach: bins(self.path_m * range_bins_m)?,
            doppler_reach: bins(self.rate_m * doppler_bins_m)?,
        })
    }
}
