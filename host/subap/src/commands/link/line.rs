//! Line to a module, and a session on it.

use std::path::Path;
use std::time::{Duration, SystemTime};

use anyhow::Context;
use subaperture::module::link::{self, Buffers, ModuleAddress, SessionObserver, Settings};
use subaperture_core::link::{self as wire, Level};

use crate::args::Link;
use crate::config::Session;
use crate::failure::Usage;

/// Line to a module.
#[derive(Clone, Copy)]
pub(crate) struct Line<'a> {
    pub(crate) place: &'a ModuleAddress,
    /// Program of an emulated module, if not the default.
    pub(crate) firmware: Option<&'a Path>,
    /// Largest number of repetitions of sub-CPIs with missing maps.
    pub(crate) retries: u32,
    /// Pulses per second. `None`: as fast as the module accepts them.
    pub(crate) rate_hz: Option<f64>,
    /// Least severe level of the module's events to print. `None` for no events.
    pub(crate) events: Option<Level>,
}

impl<'a> Line<'a> {
    pub(super) fn of(typed: &'a Link) -> Self {
        Self {
            place: &typed.place,
            firmware: typed.firmware.as_deref(),
            retries: typed.retries,
            rate_hz: typed.rate,
            events: typed.events.map(Level::from),
        }
    }

    /// Check that a program is given only for an emulated module.
    pub(crate) fn check(&self) -> Result<(), Usage> {
        if self.firmware.is_some() && !matches!(self.place, ModuleAddress::Emulate(_)) {
            let fault = format!(
                "--firmware applies to an emulated module; {} runs its own: leave it out",
                self.place
            );
            return Err(Usage(fault));
        }
        Ok(())
    }

    /// Time limits of a session on a line of this speed, whose longest frames contain `num_samples` samples.
    fn settings(&self, baud: Option<u32>, num_samples: usize) -> Settings {
        Settings {
            // Half a second, and four times the longest frame on a line of this speed.
            answer: Duration::from_millis(500)
                + baud.map_or(Duration::ZERO, |baud| {
                    let bits = 10.0 * wire::max_frame_bytes(num_samples) as f64;
                    Duration::from_secs_f64(4.0 * bits / f64::from(baud))
                }),
            retries: self.retries,
            rate_hz: self.rate_hz,
            first_number: number_of_now(),
            events: self.events,
            ..Settings::default()
        }
    }
}

/// Open the line and a session on it, whose longest frames contain `num_samples` samples.
pub(in crate::commands) fn with_module<W: SessionObserver, T>(
    session: &Session,
    line: Line<'_>,
    num_samples: usize,
    watch: &mut W,
    task: impl FnOnce(&mut link::Session<'_>, &mut W) -> anyhow::Result<T>,
) -> anyhow::Result<T> {
    let place = line.place;
    let mut transport = link::open(place, line.firmware, session.verbosity() > 0)?;
    let settings = line.settings(transport.baud(), num_samples);
    let mut buffers = Buffers::new();
    let mut module = link::Session::open(&mut *transport, &mut buffers, settings, watch)
        .with_context(|| format!("{place}"))?;
    session.note(1, || format!("{} at {place}", module.identity().version));
    task(&mut module, watch)
}

/// Session number from the clock, different from earlier sessions in all likelihood.
fn number_of_now() -> u32 {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    now.map_or(1, |now| now.as_millis() as u32)
}
