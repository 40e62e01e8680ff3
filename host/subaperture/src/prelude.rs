//! Items that most programs use: `use subaperture::prelude::*;`.

pub use crate::focus::auto::Auto;
pub use crate::focus::beam::BeamChoice;
pub use crate::focus::bp::Backprojection;
pub use crate::focus::exact::Exact;
pub use crate::focus::ffbp::FastFactorised;
pub use crate::focus::omega_k::OmegaK;
pub use crate::focus::pfa::PolarFormat;
pub use crate::focus::rda::RangeDopplerAlgorithm;
pub use crate::focus::rdbp::RangeDopplerBackprojection;
pub use crate::geometry::ImageGrid;
pub use crate::glam::DVec3;
pub use crate::image::Image;
pub use crate::num_complex::Complex32;
pub use crate::phase_history::{Channels, PhaseHistory};
pub use crate::resolution::survey::{Survey, scene_grid};
pub use crate::signal::window::Window;
pub use crate::{Focus, FocusedImage, Focusing, SaveError, open, open_all, open_channels};
