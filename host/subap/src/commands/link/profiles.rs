//! `subap link --send profiles`: the module computes the range profiles of a capture of a stepped-frequency radar.

use std::time::Instant;

use anyhow::bail;
use num_complex::{Complex, Complex32};
use serde_json::{Value, json};
use subaperture::SPEED_OF_LIGHT_M_S;
use subaperture::geometry::Axis;
use subaperture::image::Image;
use subaperture::io::npy;
use subaperture::io::together::FileSet;
use subaperture::io::written::{FileKind, WrittenFile};
use subaperture::module::link::{Outcome, Profile, ProfileRun, SweepBurst, SweepSource};
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
use crate::{interrupt, messages, text};

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
        // The last sweep of a capture that was killed or is still running may be incomplete.
        if !recording.interrupted() {
            firsts.push(steps.len());
        }
        Self {
            recording,
            firsts,
            channels: Default::default(),
        }
    }

    fn num_sweeps(&self) -> usize {
        self.firsts.len().saturating_sub(1)
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
            "{sweeps} profiles of {bins} values need {}: raise --memory above twice that",
            text::bytes(needed_bytes.into())
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

    let (mut content, mut files) = (None, Vec::new());
    if !profiles.is_empty() {
        let spacing_m = SPEED_OF_LIGHT_M_S / (2.0 * setup.step_hz * bins as f64);
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
        files = write(typed, &profiles, &record, (bins, spacing_m), &setup.name)?;
        content = Some(format!(
            "{} profiles of {bins} values, {spacing_m:.3} m apart,",
            profiles.len()
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
    let outcome = Outcome::without_maps(counts, found.ending);
    report(session, typed, &outcome, &received, start)
}

/// Write the profiles, NaN where a sweep has none, with their record and a waterfall.
fn write(
    typed: &Link,
    profiles: &[Profile],
    record: &Value,
    (bins, spacing_m): (usize, f64),
    name: &str,
) -> anyhow::Result<Vec<WrittenFile>> {
    let nothing = Complex32::new(f32::NAN, f32::NAN);
    let mut pixels = Vec::with_capacity(profiles.len() * bins);
    for profile in profiles {
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
    let lacking = profiles.iter().filter(|profile| profile.missing > 0);
    let lacking: Vec<u32> = lacking.map(|profile| profile.sweep).collect();
    if let Some(first) = lacking.first() {
        messages::warning(format!(
            "{} sweeps, the first of them {first}, lack samples lost on the line: see samples_missing in {}",
            lacking.len(),
            NAMES[1]
        ));
    }
    let image = Image {
        rows: profiles.len(),
        columns: bins,
        pixels,
    };
    let [array, about, picture] = NAMES.map(|name| typed.out.join(name));
    let mut files = FileSet::new();
    let bytes = npy::file_bytes(image.pixels.len() as u64);
    files.write(&array, FileKind::Array, bytes, |file| {
        npy::write_to(file, &image)
    })?;
    let record = serde_json::to_string_pretty(record)? + "\n";
    files.write_bytes(&about, FileKind::Record, record.as_bytes())?;
    if image.rows > 1 {
        let waterfall = waterfall(&image, spacing_m, name)?;
        files.write_bytes(&picture, FileKind::Picture, &waterfall)?;
    }
    Ok(files.commit()?)
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
