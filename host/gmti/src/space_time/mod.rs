//! Space-time adaptive processing (STAP) of sub-CPIs, and its integration along the motion of a target.
//!
//! ```text
//! channels ─> Cube: range-Doppler map of each channel and sub-CPI (Keystone)
//!          ─> Tiles: covariance over channels and Doppler bins (EFA)
//!          ─> statistic: matched filter of each sub-CPI, summed along a motion
//!          ─> search: non-coherent sum over place and path curvature, then coherent sum over place, velocity and cross-range velocity ─> Mover
//! ```
//!
//! The images of [`crate::find`] focus stationary scatterers, so that targets fast along the track are lost in them. Here every target is integrated along its own
//! motion (Schone 2020, section 6.2): a target of any velocity has its whole SNR, and so has a target that the image shows outside of its grid. A
//! radial velocity beyond the unambiguous one is found from the place, which must lie within the grid.
//!
//! **Sub-CPIs.** In a sub-CPI of `T_s` seconds a target must stay in its cell: a path acceleration `a` gives the quadratic phase `pi a T_s^2 / (4 lambda)` at its ends.
//! Integration of `M` sub-CPIs adds `10 log10 M` dB to the SNR of one, if the motion is right to a fraction of a wavelength of path.
//!
//! **Sources.** Ward, "Space-time adaptive processing for airborne radar", MIT Lincoln Laboratory TR-1015, 1994 (EFA); Perry, DiPietro, Fante, "SAR imaging of moving targets",
//! IEEE Trans. AES-35, 1999 (Keystone).

mod calibration;
mod candidates;
mod clean;
mod cube;
mod geometry;
mod maps;
mod maximum;
mod search;
mod settings;
mod state;
mod statistic;
mod training;

pub use calibration::Calibration;
pub use geometry::Motion;
pub use maps::{Filtered, SpaceTime};
pub use maximum::Mover;
pub use search::find;
pub use settings::{Settings, Training};
pub use statistic::Integrated;
