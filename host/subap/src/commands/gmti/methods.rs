//! Settings of imaging, detection and integration from the options.

use serde_json::json;
use subaperture::focus::{ImageFormer, formers};
use subaperture::gmti::detection::Settings;
use subaperture::gmti::{Imaging, space_time};

use crate::args::Gmti;

/// Former of the channels' images.
const FORMER: &str = "auto";

/// Former with the requested bound.
pub(super) fn former(typed: &Gmti) -> anyhow::Result<Box<dyn ImageFormer>> {
    Ok(formers::former(
        FORMER,
        &json!({ "error_db": typed.error_db }),
    )?)
}

/// Settings of detection in images.
pub(super) fn detection(typed: &Gmti) -> Settings {
    Settings {
        false_alarm_probability: typed.false_alarms,
        guard_cells: typed.guard,
        training_cells: typed.training,
        ..Settings::default()
    }
}

/// Settings of sub-CPIs of the default number, unless it is given.
pub(super) fn sub_cpis(typed: &Gmti, imaging: &Imaging) -> space_time::Settings {
    let default = space_time::Settings::default();
    space_time::Settings {
        sub_cpis: typed.sub_cpis.unwrap_or(default.sub_cpis),
        bins: typed.doppler_bins,
        windows: imaging.windows,
        max_speed_m_s: typed.max_speed,
        max_acceleration_m_s2: typed.max_acceleration,
        false_alarm_probability: typed.false_alarms,
        transforms: imaging.numerics.transforms,
        memory_bytes: imaging.memory_bytes,
        ..default
    }
}
