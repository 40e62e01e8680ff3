//! Radar image formation: from phase history to a focused, measured image.
#![forbid(unsafe_code)]

pub use subaperture_model::{
    SPEED_OF_LIGHT_M_S, geometry, image, monitor, phase_history, quantity, radar, track, units,
};
pub use {
    subaperture_focus as focus, subaperture_io as io, subaperture_resolution as resolution,
    subaperture_signal as signal,
};

#[cfg(feature = "autofocus")]
pub use subaperture_autofocus as autofocus;
#[cfg(feature = "recording")]
pub use subaperture_describe as describe;
#[cfg(feature = "link")]
pub use subaperture_onboard as onboard;
#[cfg(feature = "planner")]
pub use subaperture_planner as planner;
#[cfg(feature = "plot")]
pub use subaperture_plot as plot;
#[cfg(feature = "quality")]
pub use subaperture_quality as quality;
#[cfg(feature = "recording")]
pub use subaperture_receive as receive;
#[cfg(feature = "simulate")]
pub use subaperture_simulate as simulate;

pub use {glam, num_complex};
