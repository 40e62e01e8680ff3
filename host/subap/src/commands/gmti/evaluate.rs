//! Detection performance in a simulated scenario, as a page.

use std::sync::Arc;
use std::time::Instant;

use anyhow::Context;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde_json::json;
use subaperture::gmti::Imaging;
use subaperture::gmti::evaluation::{Evaluation, Plan, Setup, TestTarget};
use subaperture::io::ours::Kind;
use subaperture::io::together::FileSet;
use subaperture::io::written::FileKind;
use subaperture::monitor::Silent;
use subaperture::phase_history::Channels;
use subaperture::simulate::random;
use subaperture::simulate::scenario::Scenario;
use subaperture::simulate::scene::Mover;
use subaperture::track::Linear;

use super::{methods, performance};
use crate::args::Gmti;
use crate::commands::forming;
use crate::config::{Session, record_of_run};
use crate::text;

/// Targets in each recording: apart by more than the training cells.
const TARGETS: usize = 10;

/// Motions without a target that are tested in each recording of clutter.
const ABSENT: usize = 1000;

/// Smallest radial speed, metres per second.
const SLOWEST_M_S: f64 = 0.003;

/// Simulate recordings of a scenario with random targets, test all methods of detection, and write the page.
pub(super) fn run(session: &Session, typed: &Gmti) -> anyhow::Result<()> {
    let start = Instant::now();
    let mut claims = session.claims(&typed.writing, &[&typed.input]);
    claims.file(&typed.out, Kind::Text)?;
    let scenario = scenario(session, typed)?;
    let experiment = scenario.experiment_within(session.memory_bytes)?;
    let grid = {
        let channels = experiment.channels(session.memory_bytes / 2)?;
        let survey = forming::survey(channels.channel(0))?;
        let grid = session.grid(typed.grid.as_ref(), &survey)?;
        session.check_grid(&grid, 2 + channels.len() as u64)?;
        grid
    };
    let held_bytes = {
        let samples = experiment.radar.num_pulses * experiment.radar.waveform.num_samples();
        8 * (samples * experiment.pairs().len()) as u64
    };
    let memory_bytes = session.memory_bytes.checked_sub(held_bytes).with_context(|| {
        format!(
            "the pulses of all channels need {}, but --memory allows {}: simulate fewer pulses, or raise --memory",
            text::bytes(held_bytes.into()),
            text::bytes(session.memory_bytes.into())
        )
    })?;
    let former = methods::former(typed)?;
    let imaging = Imaging {
        former: &*former,
        grid: &grid,
        windows: typed.windows.both(),
        memory_bytes,
        numerics: typed.numerics(),
        monitor: &Silent,
    };
    let integration = methods::sub_cpis(typed, &imaging);
    let setup = Setup {
        imaging,
        detection: methods::detection(typed),
        integration,
        cross_section_m2: typed.cross_section,
    };
    let plan = Plan {
        recordings: typed.trials.div_ceil(TARGETS),
        targets: TARGETS,
        absent: ABSENT,
        speeds_m_s: [SLOWEST_M_S, integration.max_speed_m_s],
    };
    let progress = session.progress("simulating and testing");
    let mut numbers = ChaCha8Rng::seed_from_u64(experiment.seed);
    let simulate = |number: u64, targets: &[TestTarget]| -> anyhow::Result<Channels<'static>> {
        let mut scenario = scenario.clone();
        scenario.set("seed", &experiment.seed.wrapping_add(number).to_string())?;
        let mut experiment = scenario.experiment_within(session.memory_bytes)?;
        experiment.scene.movers = targets.iter().map(mover).collect();
        Ok(experiment.channels(memory_bytes / 2)?.in_memory()?)
    };
    let uniform = || random::unit(&mut numbers);
    let evaluation = Evaluation::run(&setup, &plan, &progress, uniform, simulate)?;
    progress.finish();
    let report = evaluation.report(typed.false_alarms);
    let page = performance::page(&experiment.name, typed, &plan, &report)?;
    let mut files = FileSet::new();
    files.write_bytes(&typed.out, FileKind::Report, page.as_bytes())?;
    let files = files.commit()?;
    if session.json() {
        let mut record = json!(report);
        record["run"] = record_of_run(session, start.elapsed());
        record["files"] = json!(files);
        return text::say_json("gmti-performance", record);
    }
    match session.prints_text() {
        true => performance::say(typed, &report),
        false => Ok(()),
    }
}

/// Scenario with the given keys set.
fn scenario(session: &Session, typed: &Gmti) -> anyhow::Result<Scenario> {
    let path = &typed.input;
    let scenario = Scenario::read_within(path, session.memory_bytes);
    let mut scenario = scenario.with_context(|| format!("cannot read {}", path.display()))?;
    for (key, value) in &typed.set {
        scenario.set(key, value)?;
    }
    Ok(scenario)
}

fn mover(target: &TestTarget) -> Mover {
    let motion = &target.motion;
    Mover {
        motion: Arc::new(Linear {
            position_m: motion.position_m,
            velocity_m_s: motion.velocity_m_s,
            at_s: motion.epoch_s,
        }),
        amplitude: target.amplitude,
    }
}
