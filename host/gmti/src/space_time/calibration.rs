//! Corrections of the channels.

use glam::DVec3;
use num_complex::Complex64;

use crate::balance::ChannelBalance;
use crate::images::ChannelImages;
use crate::registration::{PhaseModel, View};

/// Differences of the channels from the first one.
#[derive(Clone, Debug)]
pub struct Calibration {
    /// Balance of the samples of each channel.
    pub balances: Vec<ChannelBalance>,
    /// Phase model of each channel but the first after balance, and the view of the scene for it. Empty for an array without errors of its orientation.
    pub models: Vec<PhaseModel>,
    /// View of the scene of the phase models.
    pub view: Option<View>,
}

impl Calibration {
    /// Calibration by registered images.
    pub fn of(images: &ChannelImages) -> Self {
        Self {
            balances: images.balances.clone(),
            models: images.models.clone(),
            view: Some(images.view),
        }
    }

    /// Factor of a balanced channel on the echo of a target at a position.
    pub(super) fn factor(&self, channel: usize, position_m: DVec3) -> Complex64 {
        let model = channel.checked_sub(1).and_then(|c| self.models.get(c));
        match (model, &self.view) {
            (Some(model), Some(view)) => {
                Complex64::from_polar(model.gain, view.phase_rad(model, position_m))
            }
            _ => Complex64::ONE,
        }
    }
}
