//! Receiving of maps: their sink, and the progress line.

use std::time::Instant;

use subaperture::module::link::{Counts, MapSink, SessionObserver, SinkError};
use subaperture::module::maps::OwnedMap;
use subaperture::module::maps_file::MapWriter;
use subaperture::monitor::Monitor;
use subaperture_core::link::{AssembledMap, Event};

use super::picture::Picture;
use crate::config::Session;
use crate::progress::Progress;
use crate::{interrupt, messages};

/// Sink that writes maps to the file and adds them to the picture.
pub(super) struct Keep<'a> {
    pub(super) writer: &'a mut MapWriter,
    pub(super) picture: Option<Picture>,
}

impl MapSink for Keep<'_> {
    fn accept(&mut self, map: &AssembledMap<'_>) -> Result<(), SinkError> {
        let map = OwnedMap::from(map);
        self.writer.append(&map.view())?;
        if let Some(picture) = &mut self.picture {
            picture.take(map);
        }
        Ok(())
    }
}

/// Monitor that shows a progress line.
pub(in crate::commands) struct Watching {
    pub(super) bar: Progress,
    pub(super) verbose: bool,
    /// Time and byte counts of the last display.
    pub(super) last: Option<(Instant, u64, u64)>,
}

impl Watching {
    pub(in crate::commands) fn new(session: &Session) -> Self {
        Self {
            bar: session.progress("linking"),
            verbose: session.verbosity() > 0,
            last: None,
        }
    }
}

impl SessionObserver for Watching {
    fn update(&mut self, counts: &Counts) {
        let now = Instant::now();
        let (bytes_out, bytes_in) = (counts.bytes_to_module, counts.bytes_from_module);
        let Some((then, before_out, before_in)) = self.last else {
            self.last = Some((now, bytes_out, bytes_in));
            return;
        };
        let passed_s = (now - then).as_secs_f64();
        if passed_s < 0.5 {
            return;
        }
        self.last = Some((now, bytes_out, bytes_in));
        let rate = |now: u64, before: u64| (now - before) as f64 / passed_s / 1e3;
        let damaged = counts.frames_from_module.damaged + counts.frames_to_module.damaged;
        self.bar.set_label(format!(
            "{}, {:.0} kB/s sent, {:.0} kB/s received, {damaged} damaged frames, {} lost maps",
            match counts.maps_wanted {
                0 => format!("{} pulses", counts.pulses_sent),
                wanted => format!("{} of {wanted} maps", counts.maps_done()),
            },
            rate(bytes_out, before_out),
            rate(bytes_in, before_in),
            counts.maps_lost
        ));
        if counts.maps_wanted > 0 {
            let done = counts.maps_done() as f64 / counts.maps_wanted as f64;
            self.bar.progress(done);
        }
    }

    fn event(&mut self, event: &Event) {
        messages::note(&format!("module: {}: {event}", event.level()));
    }

    fn log(&mut self, text: &str) {
        if self.verbose {
            messages::note(text);
        }
    }

    fn cancelled(&self) -> bool {
        interrupt::pressed()
    }
}
