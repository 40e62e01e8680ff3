//! Interface of a method of range focusing.

use num_complex::{Complex32, Complex64};
use subaperture_fft::Transforms;

use super::axes::Axes;
use super::sizes::Sizes;
use crate::error::FormError;
use crate::spec::Work;
use crate::time_model::TimeModel;

/// Transform from frequency to closest range, for one along-track wavenumber at a time.
pub(crate) trait RangeMethod: Sync {
    /// Range wavenumber assigned to a sample at `kappa`, `kx` (rad/m); not finite where the
    /// method has none.
    fn range_wavenumber(&self, kappa: f64, kx: f64) -> f64;

    /// Total phase of a sample at `kappa`, `kx` at a given range after all steps, radians.
    /// `reference_m` is the centre of the swath. The phase is `range_m kr` if the method is exact.
    fn phase_rad(&self, kappa: f64, kx: f64, range_m: f64, reference_m: f64) -> f64;

    /// Operations for all along-track wavenumbers, with the given number of samples per pulse.
    fn operations(&self, samples: usize, sizes: &Sizes) -> f64;

    /// Single-core time of these operations, ns.
    fn time_ns(&self, model: &TimeModel, samples: usize, sizes: &Sizes) -> f64;

    /// Prepare the method for given axes.
    fn stage(&self, axes: &Axes, transforms: Transforms) -> Box<dyn RangeStage>;
}

/// [`RangeMethod`] prepared for given axes.
pub(crate) trait RangeStage: Sync {
    /// Range wavenumber, as in [`RangeMethod::range_wavenumber`].
    fn range_wavenumber(&self, kappa: f64, kx: f64) -> f64;

    /// Phase rotation of a sample before [`Self::ranges`], radians.
    fn phase_rad(&self, kappa: f64, kx: f64) -> f64;

    /// Scratch values needed by [`Self::ranges`].
    fn scratch_length(&self) -> usize;

    /// `out[j] = sum_k samples[k] exp(j r_j (kr_k - carrier))` for the wavenumber `kx`. The
    /// phase rotation of [`Self::phase_rad`] must have been applied.
    fn ranges(
        &self,
        kx: f64,
        samples: &[Complex32],
        out: &mut [Complex32],
        scratch: &mut [Complex32],
    );
}

/// Report the progress of a stage.
pub(super) fn step_done(work: &Work, fraction: f64) -> Result<(), FormError> {
    if work.monitor.cancelled() {
        return Err(FormError::Cancelled);
    }
    work.monitor.progress(fraction);
    Ok(())
}

/// Ratio of `H1(z)` to its leading term, for `z` above about 5: the correction of the principle of
/// stationary phase.
pub(super) fn stationary_phase_error(z: f64) -> Complex64 {
    Complex64::new(1.0 + 15.0 / (128.0 * z * z), 3.0 / (8.0 * z))
}
