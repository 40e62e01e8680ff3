//! `subap simulate`: simulate a collection as CPHD 1.1 or as raw echoes.

use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Context;
use serde_json::json;
use subaperture::focus::forecast::{self, Forecast};
use subaperture::io::cphd::{self, Channel, Domain, ReferenceSurface, Sgn, WriteOptions};
use subaperture::io::ours::{Kind, TEXT_MARK};
use subaperture::io::recording::{self, Raw};
use subaperture::io::together::FileSet;
use subaperture::io::written::FileKind;
use subaperture::phase_history::PhaseHistory;
use subaperture::radar::MountedAntennas;
use subaperture::receive::Echoes;
use subaperture::simulate::scenario::{self, Scenario};
use subaperture::simulate::{Experiment, Noise, Recording, Variation};

use crate::ahead::{Ahead, reading};
use crate::args::{DeclaredSurface, SignalDomain, Simulate};
use crate::config::{Session, record_of_run};
use crate::{messages, text};

/// Write the files, complete or not at all, or print information about scenarios.
pub(crate) fn run(session: &Session, typed: &Simulate) -> anyhow::Result<()> {
    let start = Instant::now();
    if typed.keys {
        text::say(scenario::reference())?;
    }
    if let Some(name) = &typed.example {
        text::say(scenario::examples::text(name).context("--example: no such name")?)?;
    }
    if let Some(path) = &typed.scenario {
        let mut claims = session.claims(&typed.writing, &[path]);
        if let Some(out) = &typed.out {
            claims.file(out, Kind::Collection)?;
        }
        let preparing = session.progress("preparing");
        let experiment = experiment(session, path, typed)?;
        let logs = log_paths(typed, &experiment);
        for log in &logs {
            claims.is_named_output(log);
            claims.file(log, Kind::NavigationLog)?;
        }
        let recordings = record(session, &experiment)
            .with_context(|| format!("cannot simulate {}", path.display()))?;
        preparing.finish();
        if let Some(folder) = &typed.echoes {
            let ids: Vec<&str> = recordings.iter().map(|(id, _)| id.as_str()).collect();
            claims.folder(folder, recording::names(&ids))?;
        }
        let channels: Vec<Channel> = recordings
            .iter()
            .map(|(id, recording)| {
                let channel = Channel::new(id.clone(), recording);
                channel.with_antennas(recording.echoes().carried())
            })
            .collect();
        let options = options(typed, experiment.collection_start.as_deref());
        let sizes = experiment
            .logs
            .iter()
            .map(|log| log.max_bytes(&experiment.radar));
        let sizes = logs.iter().cloned().zip(sizes).collect();
        let ahead = ahead(session, typed, &options, &channels, &recordings, sizes)?;
        if ahead.announce(session, &typed.rehearsal)? {
            return Ok(());
        }
        let mut written = Written::default();
        written.add_logs(&experiment, &logs)?;
        if let Some(folder) = &typed.echoes {
            written.add_echoes(session, folder, &recordings)?;
        }
        if let Some(out) = &typed.out {
            written.add_history(session, &options, out, &channels)?;
        }
        return written.commit(session, start);
    }
    if let (Some(preset), Some(out)) = (typed.preset, &typed.out) {
        let mut claims = session.claims::<&Path>(&typed.writing, &[]);
        claims.file(out, Kind::Collection)?;
        let simulated = preset.simulate(&variation(typed));
        let channels = [Channel::new("1", &simulated)];
        let options = options(typed, None);
        let ahead = ahead(session, typed, &options, &channels, &[], Vec::new())?;
        if ahead.announce(session, &typed.rehearsal)? {
            return Ok(());
        }
        let mut written = Written::default();
        written.add_history(session, &options, out, &channels)?;
        return written.commit(session, start);
    }
    Ok(())
}

/// Number of samples above which the time is predicted.
const MANY_SAMPLES: u64 = 1 << 21;

/// Memory per sample of a pulse in the file writer, and in each simulating thread, bytes: sums in float64, a transform of
/// twice the length and its tables.
const ROW_BYTES: u64 = 24;
const THREAD_ROW_BYTES: u64 = 160;

/// Experiment of the scenario with the overriding settings.
fn experiment(session: &Session, path: &Path, typed: &Simulate) -> anyhow::Result<Experiment> {
    let mut scenario = Scenario::read_within(path, session.memory_bytes)
        .with_context(|| format!("cannot read {}", path.display()))?;
    for (key, value) in &typed.set {
        scenario.set(key, value)?;
    }
    if let Some(seed) = typed.seed {
        scenario.set("seed", &seed.to_string())?;
    }
    Ok(scenario.experiment_within(session.memory_bytes)?)
}

/// Record every pair of antennas, with its channel's identifier.
fn record<'a>(
    session: &Session,
    experiment: &'a Experiment,
) -> anyhow::Result<Vec<(String, Recording<'a>)>> {
    let pairs = experiment.pairs();
    let mut held: u64 = 0;
    let mut recordings = Vec::new();
    for pair in &pairs {
        let id = experiment.about(*pair).name;
        // Optional tables use half of the remaining memory.
        let left = session.memory_bytes.saturating_sub(held) / 2;
        let recording = experiment.record_within(*pair, left)?;
        held = held.saturating_add(recording.held_bytes());
        if held > session.memory_bytes {
            anyhow::bail!(
                "the pulses of {} channels need {}; --memory allows {}: simulate fewer pulses, or raise \
                 --memory",
                recordings.len() + 1,
                text::bytes(held.into()),
                text::bytes(session.memory_bytes.into())
            );
        }
        recordings.push((id, recording));
    }
    let width = experiment.radar.waveform.num_samples() as u64;
    let row_bytes = ROW_BYTES + session.threads as u64 * THREAD_ROW_BYTES;
    let needed = width.saturating_mul(row_bytes).saturating_add(held);
    if needed > session.memory_bytes {
        anyhow::bail!(
            "simulating pulses of {width} samples in {} threads needs {}; --memory leaves {}: simulate \
             fewer samples, give fewer --threads, or raise --memory",
            text::bytes(needed.into()),
            session.threads,
            text::bytes(session.memory_bytes.into())
        );
    }
    Ok(recordings)
}

fn variation(typed: &Simulate) -> Variation {
    let seed = typed.seed.unwrap_or(0);
    Variation {
        noise: typed.noise_db.map(|power_db| Noise { power_db, seed }),
        perturbation_m: typed.perturb,
        seed,
    }
}

/// Paths of the scenario's navigation logs: next to the CPHD file, or else next to the folder of echoes.
fn log_paths(typed: &Simulate, experiment: &Experiment) -> Vec<PathBuf> {
    let recording = typed.out.as_ref().or(typed.echoes.as_ref());
    let folder = recording.and_then(|path| path.parent());
    let folder = folder.unwrap_or(Path::new(""));
    let logs = experiment.logs.iter();
    logs.map(|log| folder.join(&log.file)).collect()
}

/// Predicted cost of the files, with the sizes of navigation logs. Each channel takes as long per pulse as the first.
fn ahead(
    session: &Session,
    typed: &Simulate,
    options: &WriteOptions,
    channels: &[Channel],
    recordings: &[(String, Recording)],
    logs: Vec<(PathBuf, u64)>,
) -> anyhow::Result<Ahead> {
    let first = channels[0].history.collection();
    let pulses = |channel: &Channel| channel.history.collection().pulses.len() as u64;
    let all: u64 = channels.iter().map(pulses).sum();
    let measure = typed.rehearsal.dry_run || all * first.num_samples as u64 > MANY_SAMPLES;
    let mut disk = logs;
    let mut parts: Vec<Forecast> = Vec::new();
    if let Some(out) = &typed.out {
        disk.push((out.clone(), cphd::file_bytes(channels, options)?));
        if measure {
            parts.push(reading(channels[0].history)?);
        }
    }
    if let (Some(folder), Some((_, recording))) = (&typed.echoes, recordings.first()) {
        let echoes = recording.echoes();
        let width = echoes.collection().waveform.num_samples();
        disk.push((folder.clone(), 8 * all * width as u64));
        if measure {
            let count = echoes.collection().pulses.len();
            parts.push(forecast::reading(count, width, |pulses, samples| {
                echoes.read(pulses, samples)
            })?);
        }
    }
    let times = all as f64 / first.pulses.len() as f64;
    let parts = parts.into_iter().map(|part| Forecast {
        seconds: part.seconds * times,
        ..part
    });
    let time = measure.then(|| parts.sum());
    let held = channels.iter().map(|channel| channel.history.held_bytes());
    let work = format!(
        "{} pulses of {} frequencies, {} in all",
        first.pulses.len(),
        first.num_samples,
        match channels.len() {
            1 => "one channel".to_owned(),
            count => format!("{count} channels"),
        }
    );
    Ok(Ahead::new(session, work, held.sum(), time, disk))
}

/// Options of the CPHD writer.
fn options(typed: &Simulate, collection_start: Option<&str>) -> WriteOptions {
    let unstated = WriteOptions::default();
    WriteOptions {
        collection_start: collection_start.map_or(unstated.collection_start, str::to_owned),
        domain: match typed.domain {
            SignalDomain::Fx => Domain::Fx,
            SignalDomain::Toa => Domain::Toa,
        },
        surface: match typed.reference_surface {
            DeclaredSurface::Planar => ReferenceSurface::Planar,
            DeclaredSurface::Hae => ReferenceSurface::Hae,
        },
        sgn: if typed.sgn < 0 { Sgn::Minus } else { Sgn::Plus },
        ..unstated
    }
}

/// Files that are complete but not yet renamed into place, with their lines of text.
#[derive(Default)]
struct Written {
    files: FileSet,
    lines: Vec<String>,
}

impl Written {
    fn add_echoes(
        &mut self,
        session: &Session,
        folder: &Path,
        recordings: &[(String, Recording)],
    ) -> anyhow::Result<()> {
        let raw: Vec<Raw> = recordings
            .iter()
            .map(|(id, recording)| Raw {
                id: id.clone(),
                echoes: recording.echoes(),
                antennas: Some(recording.echoes().carried()),
            })
            .collect();
        let progress = session.progress("simulating");
        recording::add_to(&mut self.files, folder, &raw, &progress)?;
        for raw in &raw {
            let is_directive = raw
                .antennas
                .as_ref()
                .is_some_and(MountedAntennas::is_directive);
            if is_directive && !recording::describes_antennas(raw) {
                messages::warning(format!(
                    "channel {}: its antenna patterns are not in the description, because the antennas turn and do not keep to the heading of \
                     the track: give the beam to subap focus by --beam",
                    raw.id
                ));
            }
        }
        progress.finish();
        for raw in &raw {
            let collection = raw.echoes.collection();
            let (pulses, samples) = (collection.pulses.len(), collection.waveform.num_samples());
            let name = named(folder, &raw.id, recordings.len());
            self.lines.push(format!(
                "{name}: raw data of {pulses} pulses x {samples} samples"
            ));
        }
        Ok(())
    }

    fn add_logs(&mut self, experiment: &Experiment, paths: &[PathBuf]) -> anyhow::Result<()> {
        for (index, (log, path)) in experiment.logs.iter().zip(paths).enumerate() {
            let remark = format!("{TEXT_MARK} simulate");
            let most_bytes = log.max_bytes(&experiment.radar);
            self.files
                .write(path, FileKind::NavigationLog, most_bytes, |file| {
                    let mut out = BufWriter::new(file);
                    experiment.write_log(index, &remark, &mut out)?;
                    out.flush()
                })?;
            let rate = text::hertz(log.rate_hz);
            self.lines
                .push(format!("{}: navigation log at {rate}", path.display()));
        }
        Ok(())
    }

    fn add_history(
        &mut self,
        session: &Session,
        options: &WriteOptions,
        out: &Path,
        channels: &[Channel],
    ) -> anyhow::Result<()> {
        let progress = session.progress("simulating");
        cphd::add_to(&mut self.files, out, channels, options, &progress)?;
        progress.finish();
        for channel in channels {
            if channel.antennas.is_some() && !cphd::describes_antennas(channel) {
                messages::warning(format!(
                    "channel {}: antenna patterns are not in the file, because a pattern is a table, or a fifth-order polynomial in \
                     time does not fit the antennas' attitude: give the beam with subap focus --beam, or write the raw data with --echoes",
                    channel.id
                ));
            }
        }
        for channel in channels {
            let collection = channel.history.collection();
            let (pulses, samples) = (collection.pulses.len(), collection.num_samples);
            let name = named(out, &channel.id, channels.len());
            self.lines
                .push(format!("{name}: {pulses} pulses of {samples} frequencies"));
        }
        Ok(())
    }

    /// Rename all files into place and report them.
    fn commit(self, session: &Session, start: Instant) -> anyhow::Result<()> {
        let files = self.files.commit()?;
        if session.json() {
            let run = record_of_run(session, start.elapsed());
            return text::say_json("simulate", json!({ "run": run, "files": files }));
        }
        if session.prints_text() {
            for line in self.lines {
                text::say(line)?;
            }
        }
        Ok(())
    }
}

/// Name of an output, with its channel if there are several.
fn named(path: &Path, id: &str, channels: usize) -> String {
    match channels {
        1 => path.display().to_string(),
        _ => format!("{} {id}", path.display()),
    }
}
