//! One measurement, by a process of its own: a former, a case, some threads.
//!
//! **Time** is that of forming the image from samples in memory, planning included, and of the error's estimate that every image comes with;
//! the shortest of some turns; processor time is that of all threads in that turn, to a hundredth of a second, and what other programs take away
//! is not in it. **Error** is relative RMS over the image, as it is and after the one complex factor that makes it least: the error against the float64 sum
//! at some hundred pixels, each for those it stands for, over the power of all. **Memory** is the most that the process ever held, the samples themselves and about 10 MiB of program
//! included. **Operations** are those of the former's own account ([`subaperture::focus::cost`]): real additions, multiplications and roots.
//! **Bytes** are the least that can be moved: samples read once, pixels written once.

use std::time::Instant;

use serde::{Deserialize, Serialize};
use serde_json::json;
use subaperture::focus::formers::{FORMERS, former};
use subaperture::focus::{BoundPolicy, ImageFormer, ImageSpec, Plan, SCRATCH_BYTES, Task, machine};
use subaperture::monitor::Silent;
use subaperture::num_complex::{Complex32, Complex64};
use subaperture::phase_history::{PhaseHistory, Weights};
use subaperture::signal::window::Window;
use subaperture_xtask::processor::{self, Of};

use crate::case::Case;
use crate::recording::{self, Judged};

/// Turns go on until they took so long together, seconds.
const ENOUGH_S: f64 = 1.0;
/// No more turns.
const MAX_TURNS: usize = 5;
/// What formers may take unless told otherwise, bytes.
pub(crate) const MEMORY_BYTES: u64 = 8 << 30;

/// The bound that is meant where none is given, dB.
const USUAL_DB: f64 = -60.0;

/// A former as it is asked for: `NAME`, `NAME:DB`, or `rdbp-thesis`, the mode of that name.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Asked {
    /// As typed.
    pub(crate) text: String,
    name: String,
    settings: serde_json::Value,
    /// The first of the list, which is formed in part.
    pub(crate) is_oracle: bool,
}

impl Asked {
    /// From text.
    ///
    /// # Errors
    /// What can be asked for.
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

    /// What is measured unless something else is asked for: all of the list, backprojection with a coarser bound, the thesis's mode.
    pub(crate) fn usual() -> Vec<Self> {
        let names = FORMERS.iter().flat_map(|entry| match entry.name {
            "bp" => vec!["bp:-45", "bp"],
            "rdbp" => vec!["rdbp-thesis", "rdbp:-45", "rdbp"],
            "ffbp" => vec!["ffbp:-45", "ffbp"],
            // One of the others.
            "auto" => vec![],
            name => vec![name],
        });
        let names = names.map(|name| Self::parse(name).expect("these are known"));
        names.collect()
    }

    /// The side of the part of a case's image that it forms.
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

/// What a measurement found.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Measured {
    /// The shortest time, seconds.
    pub(crate) seconds: f64,
    /// Processor time of all threads in the same turn, seconds.
    pub(crate) processor_s: f64,
    /// How often it was formed.
    pub(crate) turns: usize,
    /// Pixels times pulses.
    pub(crate) pairs: f64,
    /// Relative RMS error, dB.
    pub(crate) error_db: f64,
    /// The same after the best complex factor.
    pub(crate) scaled_db: f64,
    /// The most that the process held, bytes; 0 where the system does not tell.
    pub(crate) peak_bytes: u64,
    /// Real operations by the former's account; 0 where there is none.
    pub(crate) operations: f64,
    /// The least bytes moved.
    pub(crate) least_bytes: f64,
    /// What a reader should know.
    pub(crate) note: String,
}

impl Measured {
    /// Billions of pixels times pulses a second.
    pub(crate) fn rate(&self) -> f64 {
        self.pairs / self.seconds * 1e-9
    }
}

/// Measures; an error is why the former refuses.
///
/// # Errors
/// That, or of the files.
pub(crate) fn measure(case: &Case, asked: &Asked, memory_bytes: u64) -> Result<Measured, String> {
    let folder = recording::ready(case)?;
    let side = asked.side(case);
    let judged = recording::judged(&folder, side)?;
    let (history, weights) = recording::history(case, &folder)?;
    let grid = case.grid(side);
    let former = asked.former();
    let task = Task {
        history: &history,
        grid: &grid,
        weights: &weights,
        memory_bytes,
        monitor: &Silent,
        numerics: Default::default(),
    };
    let begun = Instant::now();
    let mut shortest = [f64::INFINITY, 0.0];
    let mut turns = 0;
    let formed = loop {
        let (start, before_s) = (Instant::now(), processor_seconds());
        let formed = former.form_best(&task).map_err(|error| error.to_string())?;
        let seconds = start.elapsed().as_secs_f64();
        if seconds < shortest[0] {
            shortest = [seconds, processor_seconds() - before_s];
        }
        turns += 1;
        if turns == MAX_TURNS || begun.elapsed().as_secs_f64() > ENOUGH_S {
            break formed;
        }
    };
    let peak_bytes = machine::peak_bytes().unwrap_or(0);
    let [error_db, scaled_db] = errors_db(&formed.image.pixels, side, &judged);
    let weights = Weights::new(history.collection(), Window::Hamming, Window::Hamming);
    let spec = ImageSpec {
        collection: history.collection(),
        grid: &grid,
        weights: &weights,
        scratch_bytes: SCRATCH_BYTES,
        numerics: Default::default(),
    };
    // A scene that makes more of errors was formed by another plan, of which no account is kept.
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
        note: note(case, side, formed.bound_missed, replanned),
    })
}

/// That of this process so far, seconds; 0 where the system does not say.
fn processor_seconds() -> f64 {
    processor::seconds(Of::Own).unwrap_or(0.0)
}

fn note(case: &Case, side: usize, missed: bool, replanned: bool) -> String {
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
    notes.join("; ")
}

/// The relative RMS error of an image, raw and after the best complex factor, dB: the error where it is judged, over the power of all pixels.
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
