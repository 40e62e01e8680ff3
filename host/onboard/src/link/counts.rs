//! What a session did and what became of it, in numbers.

use std::fmt;

use serde::Serialize;
use subaperture_core::link::LinkCounters;
use subaperture_core::stream::PulseCounters;

/// Frames over one direction of the link.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Frames {
    /// Taken.
    pub taken: u64,
    /// Pieces between zeros that were no whole frame of this protocol.
    pub damaged: u64,
    /// Missing in the sequence.
    pub lost: u64,
    /// Behind in the sequence, and dropped.
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

/// What counters have grown by from `before` to `now`; those of a module that began anew began at 0.
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

/// What the module says became of pulses, all runs together; as [`PulseCounters`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct ProcessorPulses {
    /// Stored.
    pub accepted: u64,
    /// Never came; of those at a run's end, by the number that it waits for in vain.
    pub lost: u64,
    /// Came again, or too late.
    pub repeated: u64,
    /// Could not be used.
    pub refused: u64,
    /// Found no room, or the beginning of their sub-CPI missing.
    pub dropped: u64,
    /// Samples at an end of the converter's range.
    pub samples_at_limit: u64,
    /// Arithmetic results that had to be clamped.
    pub results_saturated: u64,
    /// Sub-CPIs given up because pulses were missing.
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

/// What a session did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Counts {
    /// Time since the session was opened, seconds.
    pub seconds: f64,
    /// Bytes on the wire to the module.
    pub bytes_to_module: u64,
    /// Bytes on the wire from it.
    pub bytes_from_module: u64,
    /// Frames that the module received, by its own account since its first status.
    pub frames_to_module: Frames,
    /// Frames that came from it.
    pub frames_from_module: Frames,
    /// Runs begun.
    pub runs: u64,
    /// Times that the module was found to have begun anew.
    pub restarts: u64,
    /// Times that the line was connected anew.
    pub reconnects: u64,
    /// Pulses of the recording.
    pub pulses: u64,
    /// Pulses sent, those sent again included.
    pub pulses_sent: u64,
    /// Of these, sent again within a run because its tail was lost.
    pub pulses_resent: u64,
    /// Pulses not sent because the line was too slow for the rate asked for.
    pub pulses_unsent: u64,
    /// Parts of samples beyond 16 bits that had to be clamped.
    pub samples_clamped: u64,
    /// What the module says became of them.
    pub module_pulses: ProcessorPulses,
    /// Maps that there are to be: sub-CPIs times patches.
    pub maps_wanted: u64,
    /// Maps taken, each once.
    pub maps_taken: u64,
    /// Of these, in runs made to fetch what the first had lost.
    pub maps_fetched_again: u64,
    /// Maps that the module made and that did not come whole, of all runs.
    pub maps_lost: u64,
    /// Whole maps of which there was one already; not taken.
    pub maps_repeated: u64,
    /// Whole maps that are none of those asked for, of too few pulses mostly; not taken.
    pub maps_refused: u64,
}

impl Counts {
    /// Maps that are missing.
    pub fn maps_missing(&self) -> u64 {
        self.maps_wanted.saturating_sub(self.maps_taken)
    }

    /// As a JSON object.
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
        writeln!(
            f,
            "maps      {} of {} taken, {} of them fetched again; {} lost on the way, {} repeated, {} \
             not as asked for",
            self.maps_taken,
            self.maps_wanted,
            self.maps_fetched_again,
            self.maps_lost,
            self.maps_repeated,
            self.maps_refused
        )?;
        writeln!(
            f,
            "pulses    {} sent in {} runs, {} of them again, {} not for lack of time; {} clamped samples",
            self.pulses_sent,
            self.runs,
            self.pulses_resent,
            self.pulses_unsent,
            self.samples_clamped
        )?;
        let module = &self.module_pulses;
        writeln!(
            f,
            "module    {} pulses stored, {} lost, {} repeated, {} refused, {} dropped; {} sub-CPIs given \
             up; {} samples at the limit, {} results clamped",
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
            "took      {:.1} s; {} restarts of the module, {} new connections",
            self.seconds, self.restarts, self.reconnects
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counters_that_began_anew_count_from_zero() {
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
