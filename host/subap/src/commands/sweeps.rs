//! Sweeps of a capture, as a module processes them.

use anyhow::bail;
use subaperture::radio::Reference;
use subaperture::radio::sigmf::{Recording, Setup};
use subaperture_core::sweep;

/// First step of each sweep and the end of the last. The last sweep of a capture that was killed or is still running may be incomplete and
/// is left out.
pub(crate) fn firsts(recording: &Recording) -> Vec<usize> {
    let steps = recording.steps();
    let is_first = |&n: &usize| n == 0 || steps[n].sweep != steps[n - 1].sweep;
    let end = (!recording.interrupted()).then_some(steps.len());
    (0..steps.len()).filter(is_first).chain(end).collect()
}

/// Settings of the module's profiler for a capture: two bins or more per resolution cell.
pub(crate) fn for_module(setup: &Setup) -> anyhow::Result<sweep::Setup> {
    if setup.reference != Reference::Loopback {
        bail!(
            "the capture uses the {} as the reference; a module divides the echo by that of the loopback cable: use subap \
             profile",
            setup.reference.name()
        );
    }
    let band = setup.band();
    Ok(sweep::Setup {
        carriers: u16::try_from(setup.steps)?,
        period: u16::try_from(setup.period)?,
        samples: u32::try_from(setup.samples)?,
        bins: u16::try_from((2 * setup.steps).next_power_of_two())?,
        start_hz: band.start_hz,
        step_hz: band.step_hz,
    })
}
