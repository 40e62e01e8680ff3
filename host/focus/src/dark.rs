//! Reason for the error of a dark grid: the plan keeps the bound, and the image exceeds it.
//!
//! Errors follow the scatterers, the image contains only their samples. A grid is dark for one of two reasons.
//!
//! 1. Its pixels are farther apart than the resolution, and the scatterers lie between them. A scatterer midway between two pixels `s` resolution
//!    cells apart is shown with the power `sinc(s / 2)^2` of its peak: -4 dB at `s` = 1, -10 dB at 1.5, a null at 2. From
//!    1.5 resolution cells on, a finer grid is the remedy.
//! 2. Bright scatterers lie outside it. The remedy is a grid that includes them.

use super::{ImageSpec, Reason, Remedy, stray};

/// Spacing of the pixels, in resolution cells, from which a grid misses scatterers that lie on it.
const COARSE_CELLS: f64 = 1.5;

/// Spacing of the pixels along rows and columns, the larger one, in resolution cells without windows; 0 for one pixel.
pub(super) fn spacing_cells(spec: &ImageSpec) -> f64 {
    let [rows, columns] = stray::spacings_cells(spec);
    rows.max(columns)
}

/// Reason for the error of an image of `spec` whose plan keeps the bound, with the remedies of its grid.
pub fn reason(spec: &ImageSpec) -> Reason {
    reason_at(spacing_cells(spec))
}

/// Reason for the error of an image on a grid with pixels `spacing_cells` apart.
pub(super) fn reason_at(spacing_cells: f64) -> Reason {
    match spacing_cells >= COARSE_CELLS {
        true => Reason::new(format!(
            "the grid is dark: its pixels are {spacing_cells:.1} resolution cells apart, and scatterers between them appear only by their side lobes"
        ))
        .helped_by(&[Remedy::FinerGrid]),
        false => Reason::new("the grid is dark: bright scatterers lie outside it")
            .helped_by(&[Remedy::GridWith]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coarse_grid_needs_finer_pixels_and_fine_grid_needs_its_scatterers() {
        for (spacing_cells, remedy) in [
            (0.0, Remedy::GridWith),
            (1.0, Remedy::GridWith),
            (1.5, Remedy::FinerGrid),
            (20.0, Remedy::FinerGrid),
        ] {
            assert_eq!(reason_at(spacing_cells).remedies, [remedy]);
        }
        assert!(reason_at(2.34).why.contains("2.3 resolution cells"));
    }
}
