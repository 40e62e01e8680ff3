//! `subap link --send profiles`: the module computes the range profiles of a capture of a stepped-frequency radar.

use std::time::Instant;

use anyhow::bail;
use num_complex::{Complex, Complex32};
use serde_json::json;
use subaperture::SPEED_OF_LIGHT_M_S;
use subaperture::geometry::Axis;
use subaperture::image::Image;
use subaperture::io::npy;
use subaperture::io::together::FileSet;
use subaperture::io::written::FileKind;
use subaperture::module::link::{Outcome, ProfileRun, SweepBurst, SweepSource, TransferEnd};
use subaperture::phase_history::ReadError;
use subaperture::radio::Reference;
use subaperture::radio::sigmf::{Recording, Setup};
use subaperture_core::sweep;

use super::outcome::{Received, report};
use super::with_module;
use crate::args::Link;
use crate::commands::profile::{MAX_ROWS, drawn};
use crate::config::{Session, command_line, record_of_run};
use crate::failure::Usage;
use crate::{interrupt, messages};

/// Names in the output folder; the waterfall is drawn of two or more sweeps.
const NAMES: [&str; 3] = ["profiles.npy", "profiles.json", "waterfall.png"];

/// Capture as a source of sweeps.
struct Capture {
    recording: Recording,
    /// First step of each sweep, and the end of the last.
    firsts: Vec<usize>,
    channels: [Vec<Complex<i16>>; 2],
}

impl Capture {
    fn new(recording: Recording) -> Self {
        let steps = recording.steps();
        let is_first = |&n: &usize| n == 0 || steps[n].sweep != steps[n - 1].sweep;
        let mut firsts: Vec<usize> = (0..steps.len()).filter(is_first).collect();
        firsts.push(steps.len());
        Self {
            recording,
            firsts,
            channels: Default::default(),
        }
    }

    fn num_sweeps(&self) -> usize {
        self.firsts.len() - 1
    }
}

impl SweepSource for Capture {
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
        let path = self.recording.path().to_owned();
        (self.recording.read(n, &mut self.channels)).map_err(|error| ReadError::Malformed {
            path,
            what: error.to_string(),
        })?;
        let step = &self.recording.steps()[n];
        burst.carrier = step.step as u16;
        burst.lost = step.lost.iter().map(|&(from, to)| from..to).collect();
        let [reference, echo] = &self.channels;
        let pairs = reference.iter().zip(echo);
        burst.samples = pairs.map(|(reference, echo)| [*reference, *echo]).collect();
        Ok(true)
    }
}

/// Let the module compute the profiles, and write them with their record and a waterfall.
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
    let setup = recording.setup().clone();
    let module_setup = for_module(&setup)?;
    let mut capture = Capture::new(recording);
    let (sweeps, bins) = (capture.num_sweeps(), usize::from(module_setup.bins));
    let needed_bytes = (sweeps * bins * size_of::<Complex32>()) as u64;
    if needed_bytes > session.memory_bytes / 2 {
        bail!(
            "{sweeps} profiles of {bins} values need {needed_bytes} bytes: raise --memory above twice that"
        );
    }
    let window = typed.windows.window;
    let weights = window.weights(setup.steps);
    let sum: f64 = weights.iter().sum();
    let weights: Vec<f32> = weights.iter().map(|weight| (weight / sum) as f32).collect();

    let mut profiles = Vec::new();
    let starts_s: Vec<f64> = (capture.firsts[..sweeps].iter())
        .map(|&n| capture.recording.steps()[n].time_s)
        .collect();
    // From here on, an interruption keeps the profiles received.
    let _keeping = interrupt::Keeping::begin();
    let samples = usize::from(module_setup.bins);
    let (found, counts, version) = with_module(session, typed, samples, |module, watch| {
        let mut task = ProfileRun {
            setup: module_setup,
            weights: &weights,
            sweeps: u32::try_from(sweeps)?,
            source: &mut capture,
        };
        let found = module.profiles(&mut task, &mut |profile| profiles.push(profile), watch);
        watch.bar.finish();
        Ok((found, module.counts(), module.identity().version.clone()))
    })?;

    let nothing = Complex32::new(f32::NAN, f32::NAN);
    let mut pixels = Vec::with_capacity(profiles.len() * bins);
    for profile in &profiles {
        pixels.extend_from_slice(&profile.values);
        pixels.resize(pixels.len() + bins - profile.values.len(), nothing);
    }
    let empty = profiles.iter().filter(|profile| profile.values.is_empty());
    let empty: Vec<u32> = empty.map(|profile| profile.sweep).collect();
    if let Some(first) = empty.first() {
        messages::warning(format!(
            "{} sweeps, the first of them {first}, have fewer than two thirds of their carriers: their rows are NaN",
            empty.len()
        ));
    }
    let spacing_m = SPEED_OF_LIGHT_M_S / (2.0 * setup.step_hz * bins as f64);
    let (mut content, mut files) = (None, Vec::new());
    if !profiles.is_empty() {
        let record = json!({
            "schema": "subaperture-profiles",
            "schema_version": 1,
            "run": record_of_run(session, start.elapsed()),
            "command_line": command_line(),
            "capture": input.display().to_string(),
            "module": { "place": typed.place.to_string(), "version": version },
            "window": window.to_string(),
            "start_hz": module_setup.start_hz,
            "step_hz": module_setup.step_hz,
            "carriers": setup.steps,
            "range_spacing_m": spacing_m,
            "sweeps": profiles.iter().zip(&starts_s).map(|(profile, time_s)| json!({
                "time_s": time_s,
                "carriers": profile.usable,
                "samples_missing": profile.missing,
            })).collect::<Vec<_>>(),
        });
        let image = Image {
            rows: profiles.len(),
            columns: bins,
            pixels,
        };
        let path = |name: &str| typed.out.join(name);
        let mut together = FileSet::new();
        let bytes = npy::file_bytes(image.pixels.len() as u64);
        together.write(&path(NAMES[0]), FileKind::Array, bytes, |file| {
            npy::write_to(file, &image)
        })?;
        let text = serde_json::to_string_pretty(&record)? + "\n";
        together.write_bytes(&path(NAMES[1]), FileKind::Record, text.as_bytes())?;
        if image.rows > 1 {
            let picture = waterfall(&image, spacing_m, &setup.name)?;
            together.write_bytes(&path(NAMES[2]), FileKind::Picture, &picture)?;
        }
        files = together.commit()?;
        content = Some(format!(
            "{} profiles of {bins} values, {spacing_m:.3} m apart,",
            image.rows
        ));
    }
    let numbers = [
        ("profiles", found.taken.into()),
        ("sweeps", sweeps as u64),
        ("sweeps_sent_again", found.again.into()),
    ];
    let received = Received {
        content,
        numbers: numbers.into(),
        compared: None,
        files,
    };
    let outcome = Outcome {
        counts,
        missing: Vec::new(),
        ending: found
            .ending
            .map_or_else(TransferEnd::Failed, |()| TransferEnd::Complete),
    };
    report(session, typed, &outcome, &received, start)
}

/// Settings of the module's profiler for a capture: two bins or more per resolution cell.
fn for_module(setup: &Setup) -> anyhow::Result<sweep::Setup> {
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

/// Picture of the levels of all profiles; of many, some are skipped.
fn waterfall(image: &Image, spacing_m: f64, name: &str) -> anyhow::Result<Vec<u8>> {
    let stride = image.rows.div_ceil(MAX_ROWS);
    let rows = image.pixels.chunks_exact(image.columns).step_by(stride);
    let level_db = |z: &Complex32| 20.0 * z.norm().log10();
    let levels: Vec<f32> = rows.flatten().map(level_db).collect();
    let rows = Axis {
        start: 0.0,
        step: stride as f64,
        count: levels.len() / image.columns,
    };
    let columns = Axis {
        start: 0.0,
        step: spacing_m,
        count: image.columns,
    };
    drawn(&levels, rows, columns, format!("{name}, by the module"))
}
