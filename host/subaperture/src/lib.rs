//! Radar image formation: from phase history to a focused, measured image.
#![forbid(unsafe_code)]

pub use subaperture_model::{
    SPEED_OF_LIGHT_M_S, geometry, image, monitor, phase_history, quantity, radar, track, units,
};
pub use {
    subaperture_autofocus as autofocus, subaperture_describe as describe,
    subaperture_focus as focus, subaperture_io as io, subaperture_onboard as onboard,
    subaperture_planner as planner, subaperture_plot as plot, subaperture_quality as quality,
    subaperture_receive as receive, subaperture_resolution as resolution,
    subaperture_signal as signal, subaperture_simulate as simulate,
};
