//! Core's stream processor on the host, in both arithmetics, with pulses as sent over the link.

use num_complex::{Complex32, Complex64};
use subaperture_core::Sc16;
use subaperture_core::link::{AssembledMap, Encoding};
use subaperture_core::stream::{Patch, Setup};

use super::measure::{error_db, ratio_db};
use crate::link::{HostCore, Job, PulseSource};
use crate::maps::OwnedMap;
use subaperture_focus::{FormError, Reason, Remedy};
use subaperture_model::phase_history::{Band, PhaseHistory, ReadError};

/// Maximum range transform length of the core, and maximum frequencies per pulse.
const LONGEST_RANGE: usize = 4096;

/// Maximum pulses of a sub-CPI; its map has twice as many Doppler bins, and the core supports 4096.
const MAX_PULSES: usize = 2048;

/// Dimensions of maps that contain all power of a sub-CPI: twice the bins that pulses and frequencies have, as in a module plan,
/// minus one in each axis, since a map is symmetric about its centre.
pub(super) fn sizes(
    band: &Band,
    num_pulses: usize,
    centre_m: [f64; 3],
) -> Result<(Setup, Patch), FormError> {
    if band.count > LONGEST_RANGE {
        return Err(FormError::unsuited(format!(
            "frequencies per pulse: expected at most {LONGEST_RANGE} for the core, found {}: the recording cannot be \
             cross-checked",
            band.count
        )));
    }
    if num_pulses > MAX_PULSES {
        let why = format!(
            "pulses per sub-CPI: expected at most {MAX_PULSES} for the core, found {num_pulses}"
        );
        let remedies = [Remedy::Smaller(&["sub_cpi"])];
        return Err(FormError::Unsuited(Reason::new(why).helped_by(&remedies)));
    }
    let range_length = (2 * band.count).next_power_of_two().min(LONGEST_RANGE);
    let doppler_length = 2 * num_pulses;
    let setup = Setup {
        num_pulses: num_pulses as u16,
        num_channels: 1,
        num_frequencies: band.count as u16,
        range_length: range_length as u16,
        doppler_length: doppler_length as u16,
        start_hz: band.start_hz,
        step_hz: band.step_hz,
    };
    let patch = Patch {
        centre_m,
        range_reach: (range_length / 2 - 1) as u16,
        doppler_reach: (doppler_length / 2 - 1) as u16,
    };
    Ok((setup, patch))
}

/// Core in one arithmetic.
pub(super) struct Core<'a> {
    host: HostCore<'a>,
    encoding: Encoding,
    /// Factor applied to its samples.
    scale: f32,
}

impl<'a> Core<'a> {
    pub(super) fn new(
        history: &'a dyn PhaseHistory,
        (setup, patch): (&Setup, &Patch),
        (fast, slow): (&[f32], &[f64]),
        encoding: Encoding,
    ) -> Result<Self, FormError> {
        let pulses = PulseSource::new(&[history], slow, encoding)?;
        let scale = pulses.amplitude_scale();
        let job = Job {
            setup: *setup,
            fast_weights: fast.to_vec(),
            patches: vec![*patch],
            pulses,
        };
        let host = HostCore::new(job).map_err(|e| FormError::unsuited(format!("core: {e}")))?;
        Ok(Self {
            host,
            encoding,
            scale,
        })
    }

    /// Relative RMS error of a sub-CPI's map in dB.
    pub(super) fn error_db(
        &mut self,
        sub_cpi: u32,
        expected: &[Complex64],
    ) -> Result<f64, ReadError> {
        let maps = self.host.maps(sub_cpi)?;
        let (header, bytes) = maps.first().ok_or_else(|| {
            ReadError::Mismatch(format!("core produced no map of sub-CPI {sub_cpi}"))
        })?;
        let map = OwnedMap::from(&AssembledMap {
            map: sub_cpi,
            header: *header,
            encoding: self.encoding,
            bytes,
        });
        let scale = 1.0 / f64::from(self.scale);
        let values = map.into_values().into_iter();
        let values = values.map(|z| Complex64::new(z.re.into(), z.im.into()) * scale);
        Ok(error_db(&values.collect::<Vec<_>>(), expected))
    }

    /// Relative RMS error of rounding the samples to 16 bits, in dB. A map contains all their power, so it has this error as well.
    pub(super) fn rounding_db(&self, samples: &[Complex32]) -> f64 {
        let (mut error, mut power) = (0.0, 0.0);
        for &z in samples {
            let kept = Sc16::from_complex32(z * self.scale).0.to_complex32() / self.scale;
            error += f64::from((kept - z).norm_sqr());
            power += f64::from(z.norm_sqr());
        }
        ratio_db(error, power)
    }
}
