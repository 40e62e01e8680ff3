//! Losses of a recording: unreadable pulses, echoes lost in one channel, and motion between the pulses of a transmitter cycle.

use subaperture_model::phase_history::Channels;

use crate::targets::echo::Echo;
use crate::targets::fault::Fault;

/// Share of echoes lost in one channel that is reported.
const WEAK: f64 = 0.1;

/// Count of unreadable pulses.
#[derive(Default)]
pub(super) struct Unreadable {
    pub(super) count: usize,
    first: Option<(usize, String)>,
}

impl Unreadable {
    pub(super) fn take(&mut self, pulse: usize, reason: String) {
        self.count += 1;
        self.first.get_or_insert((pulse, reason));
    }

    pub(super) fn fault(self) -> Option<Fault> {
        let (first, reason) = self.first?;
        Some(Fault::Unreadable {
            pulses: self.count,
            first,
            reason,
        })
    }
}

/// Echoes lost in one channel alone.
pub(super) struct Lost {
    all: usize,
    of: Vec<usize>,
}

impl Lost {
    pub(super) fn new(channels: usize) -> Self {
        Self {
            all: 0,
            of: vec![0; channels],
        }
    }

    /// Whether all channels have the echo.
    pub(super) fn take(&mut self, echo: &Echo, least_snr: f64) -> bool {
        let low = |snr: &&f64| **snr < least_snr;
        match echo.snr.iter().filter(low).count() {
            0 => self.all += 1,
            1 => {
                let place = echo.snr.iter().position(|snr| *snr < least_snr);
                self.of[place.unwrap_or(0)] += 1;
            }
            _ => {}
        }
        !echo.snr.iter().any(|snr| *snr < least_snr)
    }

    pub(super) fn faults(&self, channels: &Channels) -> Vec<Fault> {
        let each = self.of.iter().zip(channels.about());
        each.map(|(&lost, about)| (lost as f64 / (lost + self.all).max(1) as f64, about))
            .filter(|(share, _)| *share > WEAK)
            .map(|(share, about)| Fault::Weak {
                channel: about.name.clone(),
                share,
            })
            .collect()
    }
}

/// Fault if motion changes phases between the pulses of a transmitter cycle.
pub(super) fn turns(channels: &Channels, rate_m: f64, rad_m: f64) -> Option<Fault> {
    let first = channels.channel(0).collection();
    let [a, b, ..] = first.pulses[..] else {
        return None;
    };
    let times = channels
        .iter()
        .map(|(_, history)| (history.collection().pulses[0].time_s - a.time_s).abs());
    let apart_s = times.fold(0.0, f64::max);
    let phase_rad = 2.0 * rate_m * rad_m * apart_s / (b.time_s - a.time_s);
    (phase_rad > 0.1).then_some(Fault::Turns { apart_s, phase_rad })
}
