//! Spectra and images of a strip along a straight track.

use std::sync::{Arc, Mutex};

use num_complex::Complex32;

use super::choice::Fitted;
use crate::spec::ImageSpec;

/// Plan of a method opened for forming. The image over range and along-track position, which all tiles share, is computed with the first tile
/// and kept.
pub(crate) struct Strip<'a, M> {
    pub(super) spec: ImageSpec<'a>,
    pub(super) method: M,
    pub(super) fitted: Fitted,
    pub(super) image: Mutex<Option<Arc<Vec<Complex32>>>>,
}
