//! Statistics of a session.

use std::fmt;

use serde::Serialize;
use subaperture_core::link::LinkCounters;
use subaperture_core::stream::PulseCounters;

/// Frame counts of one direction of the link.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Frames {
    /// Frames accepted.
    pub taken: u64,
    /// Pieces between zero bytes that were not a valid frame.
    pub damaged: u64,
    /// Frames missing in the sequence.
    pub lost: u64,
    /// Frames dropped because their number is behind in the sequence.
    pub repeated: u64,
}

impl Frames {
    pub(super) fn add(&mut self, more: Self) {
        self.taken += more.taken;
        self.damaged += more.damaged;
        self.lost += more.lost;
        self.repeated += more.repeated;
    }
}

/// Increase of the counters from `before` to `now`. After a restart of the module they count from 0.
pub(super) fn growth(before: &LinkCounters, now: &LinkCounters) -> Frames {
    let anew = now.frames < before.frames;
    let before = if anew {
        &LinkCounters::default()
    } else {
        before
    };
    let grown =
        |count: fn(&LinkCounters) -> u32| u64::from(count(now).saturating_sub(count(before)));
    Frames {
        taken: grown(|c| c.frames),
        damaged: grown(|c| c.corrupt)
            + grown(|c| c.malformed)
            + grown(|c| c.too_long)
            + grown(|c| c.version),
        lost: grown(|c| c.lost),
        repeated: grown(|c| c.repeated),
    }
}

/// Pulse counters reported by the module, summed over all runs; see [`PulseCounters`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct ProcessorPulses {
    /// Pulses stored.
    pub accepted: u64,
    /// Pulses never received. At the end of a run, derived from the pulse number the module still expects.
    pub lost: u64,
    /// Pulses received again or too late.
    pub repeated: u64,
    /// Pulses refused as unusable.
    pub refused: u64,
    /// Pulses dropped for lack of room or because the first pulse of their sub-CPI is missing.
    pub dropped: u64,
    /// Samples at a limit of the converter's range.
    pub samples_at_limit: u64,
    /// Arithmetic results that saturated.
    pub results_saturated: u64,
    /// Sub-CPIs discarded because of missing pulses.
    pub sub_cpis_incomplete: u64,
}

impl ProcessorPulses {
    pub(super) fn add(&mut self, run: &PulseCounters) {
        self.accepted += u64::from(run.accepted);
        self.lost += u64::from(run.lost);
        self.repeated += u64::from(run.repeated);
        self.refused += u64::from(run.refused);
        self.dropped += u64::from(run.dropped);
        self.samples_at_limit += u64::from(run.at_limit);
        self.results_saturated += u64::from(run.saturated);
        self.sub_cpis_incomplete += u64::from(run.incomplete);
    }
}

/// Statistics of a session.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Counts {
    /// Time since the session was opened in seconds.
    pub seconds: f64,
    /// Bytes sent to the module.
    pub bytes_to_module: u64,
    /// Bytes received from the module.
    pub bytes_from_module: u64,
    /// Frames received by the module, as it reports them since its first status.
    pub frames_to_module: Frames,
    /// Frames received from the module.
    pub frames_from_module: Frames,
    /// Number of runs started.
    pub runs: u64,
    /// Number of detected restarts of the module.
    pub restarts: u64,
    /// Number of reconnections of the line.
    pub reconnects: u64,
    /// Number of pulses in the recording.
    pub pulses: u64,
    /// Pulses sent, including repeated ones.
    pub pulses_sent: u64,
    /// Pulses repeated within a run because its tail was lost.
    pub pulses_resent: u64,
    /// Pulses not sent because the line was too slow for the requested rate.
    pub pulses_unsent: u64,
    /// Sample parts clamped to 16 bits.
    pub samples_clamped: u64,
    /// Pulse counters reported by the module.
    pub module_pulses: ProcessorPulses,
    /// Number of expected maps: sub-CPIs times patches.
    pub maps_wanted: u64,
    /// Maps accepted, each once.
    pub maps_taken: u64,
    /// Maps of the current run that the module reports as processed.
    pub maps_processed: u64,
    /// Maps accepted in additional runs for maps lost in the first.
    pub maps_fetched_again: u64,
    /// Maps of all runs that the module formed and that were not received completely.
    pub maps_lost: u64,
    /// Complete maps that duplicate an accepted one; discarded.
    pub maps_repeated: u64,
    /// Complete maps that were not requested, mostly with too few pulses; discarded.
    pub maps_refused: u64,
}

impl Counts {
    /// Number of missing maps.
    pub fn maps_missing(&self) -> u64 {
        self.maps_wanted.saturating_sub(self.maps_taken)
    }

    /// Bytes received from the module for each byte sent to it.
    pub fn down_up_ratio(&self) -> f64 {
        self.bytes_from_module as f64 / (self.bytes_to_module as f64).max(1.0)
    }

    /// Maps of this run and of earlier ones that are done: received, or reported by the module as processed.
    pub fn maps_done(&self) -> u64 {
        self.maps_taken.max(self.maps_processed)
    }

    /// Convert to a JSON object.
    pub fn to_json(&self) -> serde_json::Map<String, serde_json::Value> {
        match serde_json::to_value(self) {
            Ok(serde_json::Value::Object(object)) => object,
            _ => serde_json::Map::new(),
        }
    }
}

impl fmt::Display for Counts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let seconds = self.seconds.max(1e-3);
        let kilobytes = |bytes: u64| bytes as f64 / seconds / 1e3;
        if self.maps_wanted > 0 {
            writeln!(
                f,
                "maps      {} of {} received, {} of them in repeated runs; {} lost on the link, {} duplicates, {} \
                 not as requested",
                self.maps_taken,
                self.maps_wanted,
                self.maps_fetched_again,
                self.maps_lost,
                self.maps_repeated,
                self.maps_refused
            )?;
        }
        writeln!(
            f,
            "pulses    {} sent in {} runs, {} of them repeated, {} not sent for lack of time; {} clamped samples",
            self.pulses_sent,
            self.runs,
            self.pulses_resent,
            self.pulses_unsent,
            self.samples_clamped
        )?;
        let module = &self.module_pulses;
        writeln!(
            f,
            "module    {} pulses stored, {} lost, {} repeated, {} refused, {} dropped; {} sub-CPIs \
             discarded; {} samples at the limit, {} results saturated",
            module.accepted,
            module.lost,
            module.repeated,
            module.refused,
            module.dropped,
            module.sub_cpis_incomplete,
            module.samples_at_limit,
            module.results_saturated
        )?;
        for (name, bytes, frames) in [
            ("to it", self.bytes_to_module, &self.frames_to_module),
            ("from it", self.bytes_from_module, &self.frames_from_module),
        ] {
            writeln!(
                f,
                "{name:<9} {bytes} bytes, {:.1} kB/s; {} frames, {} damaged, {} lost, {} repeated",
                kilobytes(bytes),
                frames.taken,
                frames.damaged,
                frames.lost,
                frames.repeated
            )?;
        }
        write!(
            f,
            "time      {:.1} s; {} restarts of the module, {} new connections",
            self.seconds, self.restarts, self.reconnects
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counter_growth_after_module_restart_counts_from_zero() {
        let count = |frames, lost| LinkCounters {
            frames,
            lost,
            ..LinkCounters::default()
        };
        let on = growth(&count(10, 2), &count(15, 3));
        assert_eq!((on.taken, on.lost), (5, 1));
        let anew = growth(&count(10, 2), &count(4, 1));
        assert_eq!((anew.taken, anew.lost), (4, 1));
    }
}
