//! `subap link --send profiles`: the module computes the range profiles of a capture of a stepped-frequency radar.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::Context;
use num_complex::{Complex, Complex32};
use serde_json::{Value, json};
use subaperture::SPEED_OF_LIGHT_M_S;
use subaperture::geometry::Axis;
use subaperture::image::Image;
use subaperture::io::atomic::write_atomically;
use subaperture::io::claim::OutputClaims;
use subaperture::io::npy;
use subaperture::io::together::FileSet;
use subaperture::io::written::{FileKind, WrittenFile};
use subaperture::module::link::{
    self, Outcome, Profile, ProfileRun, SessionObserver, SweepBurst, SweepSource, TransferEnd,
};
use subaperture::monitor::Silent;
use subaperture::phase_history::ReadError;
use subaperture::radio::sigmf::{Recording, SigmfError};
use subaperture::signal::window::Window;
use subaperture_core::sweep;

use super::line::{Line, with_module};
use super::outcome::{Received, report};
use super::receiving::Watching;
use super::work::normalised;
use crate::args::Link;
use crate::commands::profile::{MAX_ROWS, drawn};
use crate::commands::sweeps::{firsts, for_module};
use crate::config::{Session, command_line, record_of_run};
use crate::failure::Usage;
use crate::{interrupt, messages};

/// Names in the output folder; the waterfall is drawn of two or more sweeps.
const NAMES: [&str; 3] = ["profiles.npy", "profiles.json", "waterfall.png"];

/// Time between two looks at a running capture; more if a look takes long.
const LOOK: Duration = Duration::from_millis(100);

/// Least time between two pictures.
const PICTURE: Duration = Duration::from_secs(1);

/// Capture as a source of sweeps.
struct Capture<'a> {
    recording: Recording,
    /// Settings of the module's profiler.
    setup: sweep::Setup,
    /// First step of each sweep, and the end of the last.
    firsts: Vec<usize>,
    channels: [Vec<Complex<i16>>; 2],
    /// Largest number of sweeps whose profiles fit the memory.
    most: usize,
    memory_bytes: u64,
    /// Set when a running capture has ended; `None` if the recording is not written to.
    ended: Option<&'a AtomicBool>,
}

impl<'a> Capture<'a> {
    fn new(
        session: &Session,
        recording: Recording,
        ended: Option<&'a AtomicBool>,
    ) -> anyhow::Result<Self> {
        let setup = for_module(recording.setup())?;
        // Profiles, and the image of them that is written.
        let profile_bytes = 2 * u64::from(setup.bins) * size_of::<Complex32>() as u64;
        let memory_bytes = session.memory_bytes / 2;
        Ok(Self {
            firsts: firsts(&recording),
            recording,
            setup,
            channels: Default::default(),
            most: (memory_bytes / profile_bytes) as usize,
            memory_bytes,
            ended,
        })
    }

    fn num_sweeps(&self) -> usize {
        self.firsts.len().saturating_sub(1)
    }

    /// Read the steps again that a running capture has recorded.
    fn look(&mut self, over: bool) -> Result<(), ReadError> {
        let path = self.recording.path().to_owned();
        match Recording::open_within(&path, self.memory_bytes) {
            // Between both, the capture is writing its metadata.
            Ok(recording) if over || recording.interrupted() => {
                self.firsts = firsts(&recording);
                self.recording = recording;
            }
            Err(error) if over => return Err(malformed(path, &error)),
            _ => {}
        }
        Ok(())
    }
}

fn malformed(path: PathBuf, error: &SigmfError) -> ReadError {
    ReadError::Malformed {
        path,
        what: error.to_string(),
    }
}

impl SweepSource for Capture<'_> {
    fn has(&mut self, sweep: u32) -> Result<bool, ReadError> {
        if sweep as usize >= self.most {
            messages::warning(format!(
                "profiles of more than {sweep} sweeps need more memory: raise --memory; the recording has all sweeps"
            ));
            return Ok(false);
        }
        loop {
            if (sweep as usize) < self.num_sweeps() {
                return Ok(true);
            }
            let Some(ended) = self.ended else {
                return Ok(false);
            };
            let (over, start) = (ended.load(Ordering::Acquire), Instant::now());
            self.look(over)?;
            if over || interrupt::pressed() {
                return Ok((sweep as usize) < self.num_sweeps() && !interrupt::pressed());
            }
            thread::sleep(LOOK.max(9 * start.elapsed()));
        }
    }

    fn burst(
        &mut self,
        sweep: u32,
        index: usize,
        burst: &mut SweepBurst,
    ) -> Result<bool, ReadError> {
        let n = self.firsts[sweep as usize] + index;
        if n >= self.firsts[sweep as usize + 1] {
            return Ok(false);
        }
        let read = self.recording.read(n, &mut self.channels);
        read.map_err(|error| malformed(self.recording.path().to_owned(), &error))?;
        let step = &self.recording.steps()[n];
        burst.carrier = step.step as u16;
        burst.lost = step.lost.iter().map(|&(from, to)| from..to).collect();
        let [reference, echo] = &self.channels;
        let pairs = reference.iter().zip(echo);
        burst.samples = pairs.map(|(reference, echo)| [*reference, *echo]).collect();
        Ok(true)
    }
}

/// Let the module compute the profiles of a recorded capture.
pub(super) fn run(session: &Session, typed: &Link, start: Instant) -> anyhow::Result<()> {
    let [input] = &typed.input.files[..] else {
        let fault = "--send profiles: expected one capture".to_owned();
        return Err(Usage(fault).into());
    };
    let mut claims = session.claims(&typed.writing, &typed.input.files);
    claims.folder(&typed.out, NAMES)?;
    let recording = Recording::open_within(input, session.memory_bytes / 2)?;
    if recording.interrupted() {
        messages::warning("the capture was killed or is still running: complete sweeps are sent");
    }
    let profiling = Profiling {
        session,
        line: Line::of(typed),
        window: typed.windows.window,
        out: &typed.out,
    };
    let mut capture = Capture::new(session, recording, None)?;
    let mut watch = Watching::new(session);
    // From here on, an interruption keeps the profiles received.
    let _keeping = interrupt::Keeping::begin();
    let (received, outcome) = profiling.run(&mut capture, &mut watch, false)?;
    watch.bar.finish();
    report(session, typed, &outcome, &received, start)
}

/// Profiles of a capture by a module.
pub(crate) struct Profiling<'a> {
    pub(crate) session: &'a Session,
    pub(crate) line: Line<'a>,
    pub(crate) window: Window,
    /// Folder for the files.
    pub(crate) out: &'a Path,
}

impl Profiling<'_> {
    /// Check before the capture that the folder may be written and the line can be opened.
    pub(crate) fn prepare(&self) -> anyhow::Result<()> {
        self.line.check()?;
        OutputClaims::new::<PathBuf>(&[], false).folder(self.out, NAMES)?;
        link::open(self.line.place, self.line.firmware, false)?;
        Ok(())
    }

    /// Send each recorded sweep of a running capture, until the capture has `ended` and all are sent. Returns a line about the result, and
    /// the files.
    pub(crate) fn follow(
        &self,
        recording: &Path,
        ended: &AtomicBool,
    ) -> anyhow::Result<(String, Vec<WrittenFile>)> {
        let memory_bytes = self.session.memory_bytes / 2;
        let opened = loop {
            let over = ended.load(Ordering::Acquire);
            match Recording::open_within(recording, memory_bytes) {
                Ok(opened) => break opened,
                Err(error) if over => return Err(error.into()),
                Err(_) => thread::sleep(LOOK),
            }
        };
        let mut capture = Capture::new(self.session, opened, Some(ended))?;
        let (received, outcome) = self.run(&mut capture, &mut Silent, true)?;
        if let TransferEnd::Failed(error) = outcome.ending {
            return Err(error.into());
        }
        let content = received
            .content
            .context("the capture has no complete sweep")?;
        let line = format!(
            "{} in {}; {:.4} bytes from the module for each byte to it",
            content.trim_end_matches(','),
            self.out.display(),
            outcome.counts.down_up_ratio()
        );
        Ok((line, received.files))
    }

    /// Send the sweeps and write their profiles: the picture about once a second if it is `live`, all files at the end.
    fn run(
        &self,
        capture: &mut Capture<'_>,
        watch: &mut impl SessionObserver,
        live: bool,
    ) -> anyhow::Result<(Received, Outcome)> {
        let start = Instant::now();
        let setup = capture.recording.setup().clone();
        let module_setup = capture.setup;
        let bins = usize::from(module_setup.bins);
        let weights = normalised(&self.window.weights(setup.steps));
        let spacing_m = SPEED_OF_LIGHT_M_S / (2.0 * setup.step_hz * bins as f64);
        let mut profiles = Vec::new();
        let mut drawn = start;
        let mut sink = |profile: Profile| {
            profiles.push(profile);
            if live && profiles.len() > 1 && drawn.elapsed() > PICTURE {
                drawn = Instant::now();
                let shown = &profiles[profiles.len().saturating_sub(MAX_ROWS)..];
                let picture = waterfall(shown, bins, spacing_m, &setup.name);
                let written = picture.and_then(|picture| self.show(&picture));
                if let Err(error) = written {
                    self.session.note(1, || format!("no picture: {error}"));
                }
            }
        };
        let (found, counts, version) =
            with_module(self.session, self.line, bins, watch, |module, watch| {
                let mut task = ProfileRun {
                    setup: module_setup,
                    weights: &weights,
                    source: capture,
                };
                let found = module.profiles(&mut task, &mut sink, watch);
                Ok((found, module.counts(), module.identity().version.clone()))
            })?;
        let (mut content, mut files) = (None, Vec::new());
        if !profiles.is_empty() {
            let starts = capture.firsts.iter();
            let starts_s = starts.map(|&n| capture.recording.steps().get(n).map(|s| s.time_s));
            let record = json!({
                "schema": "subaperture-profiles",
                "schema_version": 1,
                "run": record_of_run(self.session, start.elapsed()),
                "command_line": command_line(),
                "capture": capture.recording.path().display().to_string(),
                "module": { "place": self.line.place.to_string(), "version": version },
                "window": self.window.to_string(),
                "start_hz": module_setup.start_hz,
                "step_hz": module_setup.step_hz,
                "carriers": setup.steps,
                "range_spacing_m": spacing_m,
                "sweeps": profiles.iter().zip(starts_s).map(|(profile, time_s)| json!({
                    "time_s": time_s,
                    "carriers": profile.usable,
                    "samples_missing": profile.missing,
                })).collect::<Vec<_>>(),
            });
            files = self.write(&profiles, &record, (bins, spacing_m), &setup.name)?;
            content = Some(format!(
                "{} profiles of {bins} values, {spacing_m:.3} m apart,",
                profiles.len()
            ));
        }
        let numbers = [
            ("profiles", found.taken.into()),
            ("sweeps", capture.num_sweeps() as u64),
            ("sweeps_sent_again", found.again.into()),
        ];
        let received = Received {
            content,
            numbers: numbers.into(),
            compared: None,
            files,
        };
        Ok((received, Outcome::without_maps(counts, found.ending)))
    }

    /// Write the picture so far.
    fn show(&self, picture: &[u8]) -> anyhow::Result<()> {
        let path = self.out.join(NAMES[2]);
        Ok(write_atomically(&path, picture.len() as u64, |file| {
            file.write_all(picture)
        })?)
    }

    /// Write the profiles, NaN where a sweep has none, with their record and a waterfall.
    fn write(
        &self,
        profiles: &[Profile],
        record: &Value,
        (bins, spacing_m): (usize, f64),
        name: &str,
    ) -> anyhow::Result<Vec<WrittenFile>> {
        let empty = profiles.iter().filter(|profile| profile.values.is_empty());
        if let Some(first) = empty.clone().next() {
            messages::warning(format!(
                "{} sweeps, the first of them {}, have fewer than two thirds of their carriers: their rows are NaN",
                empty.count(),
                first.sweep
            ));
        }
        let lacking = profiles.iter().filter(|profile| profile.missing > 0);
        if let Some(first) = lacking.clone().next() {
            messages::warning(format!(
                "{} sweeps, the first of them {}, lack samples lost on the line: see samples_missing in {}",
                lacking.count(),
                first.sweep,
                NAMES[1]
            ));
        }
        let image = Image {
            rows: profiles.len(),
            columns: bins,
            pixels: rows(profiles.iter(), bins).collect(),
        };
        let [array, about, picture] = NAMES.map(|name| self.out.join(name));
        let mut files = FileSet::new();
        let bytes = npy::file_bytes(image.pixels.len() as u64);
        files.write(&array, FileKind::Array, bytes, |file| {
            npy::write_to(file, &image)
        })?;
        let record = serde_json::to_string_pretty(record)? + "\n";
        files.write_bytes(&about, FileKind::Record, record.as_bytes())?;
        if image.rows > 1 {
            let waterfall = waterfall(profiles, bins, spacing_m, name)?;
            files.write_bytes(&picture, FileKind::Picture, &waterfall)?;
        }
        Ok(files.commit()?)
    }
}

/// Values of all profiles, NaN for sweeps without one.
fn rows<'p>(
    profiles: impl Iterator<Item = &'p Profile>,
    bins: usize,
) -> impl Iterator<Item = Complex32> {
    let missing = Complex32::new(f32::NAN, f32::NAN);
    profiles.flat_map(move |profile| {
        let values = profile.values.iter().copied();
        values.chain(std::iter::repeat_n(missing, bins - profile.values.len()))
    })
}

/// Picture of the levels of profiles; of many, some are skipped.
fn waterfall(
    profiles: &[Profile],
    bins: usize,
    spacing_m: f64,
    name: &str,
) -> anyhow::Result<Vec<u8>> {
    let stride = profiles.len().div_ceil(MAX_ROWS);
    let levels: Vec<f32> = rows(profiles.iter().step_by(stride), bins)
        .map(|z| 20.0 * z.norm().log10())
        .collect();
    let axis = |start: f64, step: f64, count: usize| Axis { start, step, count };
    drawn(
        &levels,
        axis(
            f64::from(profiles[0].sweep),
            stride as f64,
            levels.len() / bins,
        ),
        axis(0.0, spacing_m, bins),
        format!("{name}, by the module"),
    )
}
