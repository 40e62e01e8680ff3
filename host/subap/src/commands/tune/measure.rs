//! Measure of sharpness searched by `subap tune`, and its values in words.

use subaperture::autofocus::Measure;

use crate::args::{Tune, Vary};

/// Name of the measure and its unit.
pub(super) fn measure_name(typed: &Tune) -> String {
    match typed.grid.clone() {
        Some(_) => typed.measure.to_string(),
        None => "power at the points".to_owned(),
    }
}

/// Whether smaller values of the measure are sharper; the merit is then its negative.
pub(super) fn less_is_better(typed: &Tune) -> bool {
    typed.grid.is_some() && typed.measure == Measure::Entropy
}

/// Measure with this merit.
pub(super) fn figure(typed: &Tune, merit: f64) -> f64 {
    if less_is_better(typed) { -merit } else { merit }
}

/// Round to a ten-thousandth of the step, far below the resolution of the search.
pub(super) fn rounded(vary: &Vary, value: f64) -> f64 {
    let digits = (4.0 - vary.axis.step.log10()).ceil().clamp(0.0, 15.0) as usize;
    format!("{value:.digits$}").parse().unwrap_or(value)
}
