//! One measurement in a separate process: a former, a case, a number of threads.
//!
//! **Time** is that of forming the image from samples in memory, including the plan and the error estimate of every image: the minimum over
//! some rounds. **Processor time** is that of all threads, without other programs: the minimum too. **Error** is relative RMS over the image,
//! unscaled and after the best complex factor: the error against the float64 sum at some hundred pixels, weighted by the pixels that they
//! represent, over the power of all. **Memory** is the peak of the process, including the samples and about 10 MiB of program.
//! **Operations** are those that the former states ([`subaperture::focus::cost`]): real additions, multiplications and roots. **Bytes** are
//! a lower limit of transfers: samples read once, pixels written once.

use std::time::Instant;

use serde::{Deserialize, Serialize};
use serde_json::json;
use subaperture::focus::formers::{FORMERS, former};
use subaperture::focus::stages::{StageTime, StageTimer, StageTimes};
use subaperture::focus::{BoundPolicy, ImageFormer, ImageSpec, Plan, Task, machine};
use subaperture::monitor::Silent;
use subaperture::num_complex::{Complex32, Complex64};
use subaperture::phase_history::{PhaseHistory, Weights};
use subaperture::signal::window::Window;

use crate::case::Case;
use crate::recording::{self, Judged};

/// Rounds end after this total time, seconds.
const ENOUGH_S: f64 = 1.0;
/// Maximum number of rounds.
const MAX_TURNS: usize = 5;
/// Default memory budget of formers, bytes.
pub(crate) const MEMORY_BYTES: u64 = 8 << 30;

/// Error bound where none is given, dB.
const USUAL_DB: f64 = -60.0;

/// A former of the command line: `NAME`, `NAME:DB`, or `rdbp-thesis`, the thesis's mode.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Asked {
    /// As typed.
    pub(crate) text: String,
    name: String,
    settings: serde_json::Value,
    /// Whether it is the first of the list, `exact`, which forms a part of the image.
    pub(crate) is_oracle: bool,
}

impl Asked {
    /// Parse the text.
    ///
    /// # Errors
    /// The accepted forms.
    pub(crate) fn parse(text: &str) -> Result<Self, String> {
        let (name, db) = match text.split_once(':') {
            Some((name, db)) => (name, Some(db)),
            None => (text, None),
        };
        let db: f64 = match db.map(str::parse) {
            None => USUAL_DB,
            Some(Ok(db)) => db,
            Some(Err(_)) => {
                return Err(format!("'{text}': a bound is a number of dB, as in bp:-45"));
            }
        };
        let known = FORMERS.iter().find(|entry| entry.name == name);
        let (name, settings) = match (name.strip_suffix("-thesis"), known) {
            (_, Some(entry)) => (name, entry.within(db).settings()),
            (Some(name), None) => (name, json!({ "mode": { "thesis": {} } })),
            (None, None) => (name, json!({})),
        };
        former(name, &settings).map_err(|error| error.to_string())?;
        Ok(Self {
            text: text.to_owned(),
            name: name.to_owned(),
            settings,
            is_oracle: name == FORMERS[0].name,
        })
    }

    /// Formers measured by default: the whole list, some with coarser bounds too, the thesis's mode.
    pub(crate) fn usual() -> Vec<Self> {
        let names = FORMERS.iter().flat_map(|entry| match entry.name {
            "bp" => vec!["bp:-45", "bp"],
            "rdbp" => vec!["rdbp-thesis", "rdbp:-30", "rdbp:-45", "rdbp"],
            "ffbp" => vec!["ffbp:-45", "ffbp"],
            // `auto` is one of the others.
            "auto" => vec![],
            name => vec![name],
        });
        let names = names.map(|name| Self::parse(name).expect("these are known"));
        names.collect()
    }

    /// Side of the part of a case's image that this former forms, pixels.
    pub(crate) fn side(&self, case: &Case) -> usize {
        match self.is_oracle {
            true => case.part_for_exact(),
            false => case.side,
        }
    }

    fn former(&self) -> Box<dyn ImageFormer> {
        former(&self.name, &self.settings).expect("it was made before")
    }
}

/// Result of a measurement.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Measured {
    /// Minimum of time, seconds.
    pub(crate) seconds: f64,
    /// Minimum of the processor time of all threads, seconds.
    pub(crate) processor_s: f64,
    /// Number of rounds.
    pub(crate) turns: usize,
    /// Pixels times pulses.
    pub(crate) pairs: f64,
    /// Relative RMS error, dB.
    pub(crate) error_db: f64,
    /// The same after the best complex factor, dB.
    pub(crate) scaled_db: f64,
    /// Peak memory of the process, bytes; 0 where the system does not report it.
    pub(crate) peak_bytes: u64,
    /// Real operations stated by the former; 0 if it states none.
    pub(crate) operations: f64,
    /// Lower limit of bytes transferred.
    pub(crate) least_bytes: f64,
    /// Remark for the reader, with the shares of the former's stages in the time of all threads.
    pub(crate) note: String,
}

impl Measured {
    /// Giga-backprojections per second: pixels times pulses over time.
    pub(crate) fn rate(&self) -> f64 {
        self.pairs / self.seconds * 1e-9
    }
}

/// Measure a former; an error is the reason of its refusal.
///
/// # Errors
/// A refusal, or faults of the files.
pub(crate) fn measure(case: &Case, asked: &Asked, memory_bytes: u64) -> Result<Measured, String> {
    let folder = recording::ready(case)?;
    let side = asked.side(case);
    let judged = recording::judged(&folder, side)?;
    let (history, weights) = recording::history(case, &folder)?;
    let grid = case.grid(side);
    let former = asked.former();
    let task = Task {
        memory_bytes,
        ..Task::new(&history, &grid, &weights)
    };
    let begun = Instant::now();
    let mut shortest = [f64::INFINITY; 2];
    let mut stages = String::new();
    let mut turns = 0;
    let formed = loop {
        let times = StageTimes::default();
        let monitor = StageTimer {
            monitor: &Silent,
            times: &times,
        };
        let task = Task {
            monitor: &monitor,
            ..task
        };
        let (start, before_s) = (Instant::now(), processor_seconds());
        let formed = former.form_best(&task).map_err(|error| error.to_string())?;
        let seconds = start.elapsed().as_secs_f64();
        let processor_s = processor_seconds() - before_s;
        if seconds < shortest[0] {
            stages = shares(&times.taken(), processor_s);
        }
        shortest = [seconds.min(shortest[0]), processor_s.min(shortest[1])];
        turns += 1;
        if turns == MAX_TURNS || begun.elapsed().as_secs_f64() > ENOUGH_S {
            break formed;
        }
    };
    let peak_bytes = machine::peak_bytes().unwrap_or(0);
    let [error_db, scaled_db] = errors_db(&formed.image.pixels, side, &judged);
    let weights = Weights::new(history.collection(), Window::Hamming, Window::Hamming);
    let spec = ImageSpec::new(history.collection(), &grid, &weights);
    // Where the error required a second plan, its operations are not recorded.
    let replanned = formed.settings.contains_key("planned_for_db");
    let plan = Plan::new(&*former, &spec, BoundPolicy::Allowed, &Silent).ok();
    let operations = plan
        .filter(|_| !replanned)
        .map_or(0.0, |plan| plan.cost.operations);
    Ok(Measured {
        seconds: shortest[0],
        processor_s: shortest[1],
        turns,
        pairs: (side * side) as f64 * case.pulses as f64,
        error_db,
        scaled_db,
        peak_bytes,
        operations,
        least_bytes: (8 * side * side) as f64 + case.bytes() as f64,
        note: note(case, side, (formed.bound_missed, replanned), stages),
    })
}

/// Processor time of this process so far, seconds; 0 where the system does not report it.
fn processor_seconds() -> f64 {
    #[cfg(unix)]
    {
        let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
        time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
    }
    #[cfg(not(unix))]
    0.0
}

/// Shares of the stages in the processor time, such as `maps 40 %`.
fn shares(stages: &[StageTime], processor_s: f64) -> String {
    let share = |one: &StageTime| {
        let part = 100.0 * one.threads.as_secs_f64() / processor_s.max(1e-9);
        format!("{} {part:.0} %", one.stage)
    };
    stages.iter().map(share).collect::<Vec<_>>().join(", ")
}

fn note(case: &Case, side: usize, (missed, replanned): (bool, bool), stages: String) -> String {
    let mut notes = Vec::new();
    if side < case.side {
        notes.push(format!("{side} x {side} pixels of the middle"));
    }
    if missed {
        notes.push("misses its bound".to_owned());
    }
    if replanned {
        notes.push("formed twice for the bound".to_owned());
    }
    notes.push(stages);
    notes.join("; ")
}

/// Relative RMS error of an image, unscaled and after the best complex factor, dB: error at the judged pixels over the power of all pixels.
fn errors_db(pixels: &[Complex32], side: usize, judged: &[Judged]) -> [f64; 2] {
    let wide = |z: Complex32| Complex64::new(z.re.into(), z.im.into());
    let power: f64 = pixels.iter().map(|&z| wide(z).norm_sqr()).sum();
    let pairs: Vec<(f64, Complex64, Complex64)> = judged
        .iter()
        .map(|at| {
            let got = wide(pixels[at.row * side + at.column]);
            (at.stands_for, got, at.value)
        })
        .collect();
    let each = pairs.iter();
    let product: Complex64 = each.map(|(n, got, value)| got.conj() * value * n).sum();
    let own: f64 = pairs.iter().map(|(n, got, _)| got.norm_sqr() * n).sum();
    [Complex64::ONE, product / own].map(|factor| {
        let errors = pairs
            .iter()
            .map(|(n, got, value)| (got * factor - value).norm_sqr() * n);
        10.0 * (errors.sum::<f64>() / power).log10()
    })
}
