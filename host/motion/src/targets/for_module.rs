//! Settings of the embedded module's odometer ([`subaperture_core::motion`]) from those of the host.

use subaperture_core::motion;
use subaperture_model::phase_history::Channels;
use subaperture_signal::window::Window;

use super::cfar::Level;
use super::detection::{Settings, TargetsError, profiler_of};
use super::profile::STRIDE;

impl Settings {
    /// Settings of the module's odometer for the pulses of a recording. Its number of targets is fixed by its firmware, and it subtracts
    /// targets by their common path ([`super::Subtraction::Common`]).
    ///
    /// # Errors
    /// [`TargetsError`]: channels or pulses differ in frequency, fewer than 8 samples, invalid settings, or another window than Taylor's.
    pub fn for_module(&self, channels: &Channels) -> Result<motion::Setup, TargetsError> {
        let Window::Taylor { side_lobe_db } = self.window else {
            return Err(TargetsError::Settings(
                "window of the module's odometer: expected taylor or taylor:DB",
            ));
        };
        let profiler = profiler_of(channels, self)?;
        let band = profiler.band;
        // Paths are ambiguous by c / step; the core refuses ranges farther apart than that.
        let near_m = 0.5 * profiler.path_m(0);
        let far_m = near_m + 0.5 * band.unambiguous_path_m() - 0.5 * profiler.cell_m();
        let [near_m, far_m] = self.ranges_m.map_or([near_m, far_m], <[f64; 2]>::from);
        let short = |count: usize| u16::try_from(count).unwrap_or(u16::MAX);
        Ok(motion::Setup {
            num_frequencies: short(band.count),
            range_length: short((STRIDE * band.count).next_power_of_two()),
            start_hz: band.start_hz,
            step_hz: band.step_hz,
            side_lobe_db,
            ranges_m: [near_m, far_m],
            guard: short(self.cfar.guard),
            training: short(self.cfar.training),
            rank: match self.cfar.level {
                Level::Mean => 0.0,
                Level::Ordered(rank) => rank,
            },
            false_alarm_probability: self.cfar.false_alarm_probability,
            least_snr_db: self.least_snr_db,
            follow: motion::TrackerSettings {
                gate_cells: self.follow.gate_cells,
                acceleration_cells: self.follow.acceleration_cells,
                apart_cells: self.follow.apart_cells,
                seen: short(self.follow.seen),
                within: short(self.follow.within),
                bridge: short(self.follow.bridge),
            },
        })
    }
}
