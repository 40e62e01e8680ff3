//! Uniformly spaced axis of a grid, and the error of an invalid grid.

/// `start + i step` for `i < count`. Metres, or radians for an angle.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Axis {
    /// Value of element 0.
    pub start: f64,
    /// Step from element to element; positive.
    pub step: f64,
    /// Number of elements of the axis.
    pub count: usize,
}

impl Axis {
    /// Value of element `i`.
    #[inline]
    pub fn at(&self, i: usize) -> f64 {
        self.start + i as f64 * self.step
    }

    /// `start:stop:step` with `stop` excluded: `ceil((stop - start) / step)` elements, where a stop
    /// within 1e-9 steps of an element counts as that element.
    pub fn from_range(start: f64, stop: f64, step: f64) -> Result<Self, GridError> {
        let steps = (stop - start) / step;
        if !(step > 0.0 && steps.is_finite() && steps > 0.0) {
            return Err(GridError(format!(
                "range {start}:{stop}:{step} has no elements: give start < stop and a positive step"
            )));
        }
        let count = (steps - 1e-9).ceil().max(1.0);
        if count > MAX_ELEMENTS {
            return Err(GridError(format!(
                "range {start}:{stop}:{step}: expected at most 1e9 elements, found {count:.3e}"
            )));
        }
        Ok(Self {
            start,
            step,
            count: count as usize,
        })
    }
}

/// Error of an invalid grid description, with a remedy.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("grid: {0}")]
pub struct GridError(pub String);

/// Maximum number of elements of an axis.
pub(super) const MAX_ELEMENTS: f64 = 1e9;
