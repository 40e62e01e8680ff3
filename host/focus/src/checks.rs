//! Checks of an image before it is planned.

use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::{Collection, Pulse};

use super::error::{FormError, Reason, Remedy};
use super::former::ImageFormer;

/// Maximum pixels along one side, and in total (35 TB). Planning iterates over the sides of a grid.
pub(super) const MAX_SIDE: usize = 1 << 26;

pub(super) const MAX_PIXELS: u64 = 1 << 42;

/// Refuse a grid larger than any storable image before planning.
///
/// # Errors
/// [`FormError::Unsuited`].
pub(super) fn check_size(grid: &ImageGrid) -> Result<(), FormError> {
    let (rows, columns) = (grid.rows.count, grid.columns.count);
    let pixels = rows as u128 * columns as u128;
    if rows.max(columns) <= MAX_SIDE && pixels <= u128::from(MAX_PIXELS) {
        return Ok(());
    }
    let why = format!(
        "the grid has {rows} x {columns} pixels, an image of {}: expected at most {MAX_SIDE} a side and {MAX_PIXELS} in total",
        subaperture_model::quantity::bytes(pixels.saturating_mul(8)),
    );
    Err(FormError::Unsuited(
        Reason::new(why).helped_by(&[Remedy::FewerPixels]),
    ))
}

/// Refuse a collection without pulses or samples, a grid without pixels, and geometry with non-finite
/// values.
pub(super) fn check(collection: &Collection, grid: &ImageGrid) -> Result<(), FormError> {
    check_not_empty(collection, grid)?;
    check_size(grid)?;
    let is_number = |p: &Pulse| {
        let places = p.transmitter_m.is_finite() && p.receiver_m.is_finite();
        let numbers = [p.reference_path_m, p.start_hz, p.step_hz];
        places && numbers.iter().all(|x| x.is_finite()) && p.sweep.is_finite()
    };
    match collection.pulses.iter().position(|p| !is_number(p)) {
        None => Ok(()),
        Some(n) => Err(FormError::unsuited(format!(
            "pulse {n} (from 0) has an antenna, a reference path or a frequency that is not a finite number: \
             repair or drop it"
        ))),
    }
}

pub(super) fn check_not_empty(collection: &Collection, grid: &ImageGrid) -> Result<(), FormError> {
    let why = if collection.pulses.is_empty() {
        "the collection has no pulses"
    } else if collection.num_samples == 0 {
        "the collection's pulses have no samples"
    } else if grid.num_pixels() == 0 {
        "the grid has no pixels"
    } else {
        return Ok(());
    };
    Err(FormError::unsuited(format!(
        "{why}: no image can be formed"
    )))
}

/// Refuse pixels on a surface for a former that requires a plane.
///
/// # Errors
/// [`FormError::Unsuited`].
pub(super) fn check_surface<F: ImageFormer + ?Sized>(
    former: &F,
    grid: &ImageGrid,
) -> Result<(), FormError> {
    match &grid.relief {
        Some(relief) if !former.follows_relief() => {
            let why = format!(
                "pixels lie on {}, and {} forms those of a plane",
                relief.surface(),
                former.name()
            );
            let remedies = [Remedy::OtherFormer(&["auto", "bp", "ffbp"])];
            Err(FormError::Unsuited(Reason::new(why).helped_by(&remedies)))
        }
        _ => Ok(()),
    }
}
