//! Time and memory forecast of a job by stage, from short measured parts of the work. Writes no files.

use serde_json::{Value, json};
use subaperture::focus::formers;
use subaperture::focus::{ImageFormer, Numerics, Task};
use subaperture::geometry::ImageGrid;
use subaperture::io::atomic::free_bytes;
use subaperture::job::State;
use subaperture::planner::forecast::{cost, forecast_of};

use super::chain::{Link, Stage};
use super::options::Options;
use crate::args::ImageFormat;
use crate::commands::air::Recorded;
use crate::commands::forming;
use crate::commands::{focus, surface};
use crate::config::Session;
use crate::text;

/// What a stage will take; nothing of one that stands.
#[derive(Default)]
struct Takes {
    seconds: Option<f64>,
    disk_bytes: Option<u64>,
}

/// Says which stages are to be done, why, and what they take.
pub(super) fn tell(
    session: &Session,
    options: &Options,
    chain: &[Link],
    state: &State,
) -> anyhow::Result<()> {
    let mut rows = Vec::new();
    for link in chain {
        let why = state.why(&options.out, &link.basis, &link.before)?;
        rows.push((link, why));
    }
    let measured = match rows.iter().any(|(_, why)| why.is_some()) {
        true => Some(Measured::of(session, options)?),
        false => None,
    };
    let takes: Vec<Takes> = rows
        .iter()
        .map(|(link, why)| match (why, &measured) {
            (Some(_), Some(measured)) => measured.takes(link.stage, options),
            _ => Takes::default(),
        })
        .collect();
    let seconds: f64 = takes.iter().filter_map(|takes| takes.seconds).sum();
    let disk_bytes: u64 = takes.iter().filter_map(|takes| takes.disk_bytes).sum();
    let memory_bytes = measured
        .as_ref()
        .map_or(0, |measured| measured.memory_bytes);
    let free = free_bytes(&options.out);
    if session.json() {
        let stages: Vec<Value> = rows
            .iter()
            .zip(&takes)
            .map(|((link, why), takes)| {
                json!({
                    "stage": link.name(),
                    "to_do": why.is_some(),
                    "why": why.as_ref().map(ToString::to_string),
                    "time_s": takes.seconds,
                    "disk_bytes": takes.disk_bytes,
                })
            })
            .collect();
        return text::say_json(
            "run-forecast",
            json!({
                "folder": options.out.display().to_string(),
                "stages": stages,
                "time_s": seconds,
                "memory_bytes": memory_bytes,
                "memory_allowed_bytes": session.memory.total_bytes,
                "disk_bytes": disk_bytes,
                "free_bytes": free,
            }),
        );
    }
    let lines = rows.iter().zip(&takes).map(|((link, why), takes)| {
        let (to_do, why) = match why {
            None => ("stands".to_owned(), String::new()),
            Some(why) => ("to do".to_owned(), why.to_string()),
        };
        let seconds = takes
            .seconds
            .map(|s| format!("about {}", text::seconds(rounded(s))));
        let disk = takes.disk_bytes.map(|bytes| text::bytes(bytes.into()));
        let unknown = |assumptions: Option<String>| match (&why[..], assumptions) {
            ("", _) => String::new(),
            (_, assumptions) => assumptions.unwrap_or_else(|| "little".to_owned()),
        };
        vec![
            link.name().to_owned(),
            to_do,
            unknown(seconds),
            unknown(disk),
            why.clone(),
        ]
    });
    let lines: Vec<Vec<String>> = lines.collect();
    text::say(text::table(&["stage", "", "time", "disk", "why"], &lines))?;
    if let Some(measured) = &measured {
        let grid = &measured.grid;
        text::say(format!(
            "\n{:<16} {} x {} pixels\n{:<16} about {}\n{:<16} about {}; {} allowed (--memory)\n{:<16} {} in {}{}",
            "image",
            grid.columns.count,
            grid.rows.count,
            "time",
            text::seconds(rounded(seconds)),
            "memory",
            text::bytes(memory_bytes.into()),
            text::bytes(session.memory.total_bytes.into()),
            "disk",
            text::bytes(disk_bytes.into()),
            options.out.display(),
            match free {
                Some(free) if free < disk_bytes =>
                    format!("; {} free: too little", text::bytes(free.into())),
                Some(free) => format!("; {} free", text::bytes(free.into())),
                None => String::new(),
            }
        ))?;
    }
    Ok(())
}

/// Two digits are what an estimate is good for.
fn rounded(seconds: f64) -> f64 {
    format!("{seconds:.1e}").parse().unwrap_or(seconds)
}

/// What was measured of the work.
struct Measured {
    grid: ImageGrid,
    pixels: u64,
    /// All that the process will take.
    memory_bytes: u64,
    focus_s: Option<f64>,
    autofocus_s: Option<f64>,
    /// By the exact sum, the whole grid.
    exact_s: Option<f64>,
}

impl Measured {
    /// On the recorded track, in place of one that is to be found first.
    fn of(session: &Session, options: &Options) -> anyhow::Result<Self> {
        let typed = &options.focus.typed;
        surface::check(&typed.image)?;
        let recorded = session.open(&typed.input)?;
        let air = Recorded::new(&typed.image.surfacing, Box::new(recorded))?;
        let history = air.history();
        let survey = forming::survey(history)?;
        let grid = surface::grid(session, &typed.image, history, || &survey)?;
        let of = (history, typed.velocity);
        let former = focus::beam::former(session, &typed.image, of, &grid)?;
        let windows = [typed.image.window, typed.image.slow_window];
        let progress = session.progress("measuring");
        let mut memory_bytes = 0;
        let mut time = |grid: &ImageGrid, former: &dyn ImageFormer, numerics: Numerics| {
            let [fast, slow] = windows;
            let task = Task {
                history,
                grid,
                weights: &former.weights(history.collection(), grid, fast, slow)?,
                numerics,
                memory_bytes: session.memory_bytes,
                monitor: &progress,
            };
            let Some(cost) = cost(former, &task) else {
                return anyhow::Ok(None);
            };
            let held_bytes = (8 * grid.num_pixels()).saturating_add(cost.bytes(1.0));
            let bytes = session.memory.own_bytes_for(grid.num_pixels())
                + history.held_bytes()
                + held_bytes.min(session.memory_bytes);
            memory_bytes = memory_bytes.max(bytes);
            Ok(forecast_of(former, &task, &cost)?.map(|time| time.seconds))
        };
        let focus_s = time(&grid, &*former, typed.image.numerics(None))?;
        let autofocus_s = match &options.autofocus {
            None => None,
            Some(assumptions) => {
                let grid = assumptions.typed.grid.as_ref().unwrap_or(&grid);
                let one = time(
                    grid,
                    &*assumptions.typed.former.former()?,
                    Numerics::default(),
                )?;
                one.map(|one_s| one_s * (assumptions.typed.rounds + 1) as f64)
            }
        };
        let exact_s = match options.check {
            0 => None,
            _ => {
                let exact = formers::former("exact", &json!({}))?;
                time(&grid, &*exact, Numerics::default())?
            }
        };
        progress.finish();
        Ok(Self {
            pixels: grid.num_pixels(),
            grid,
            memory_bytes,
            focus_s,
            autofocus_s,
            exact_s,
        })
    }

    fn takes(&self, stage: Stage, options: &Options) -> Takes {
        let pixels = self.pixels as f64;
        let formats = options.formats.iter();
        match stage {
            Stage::Track => Takes::default(),
            Stage::Autofocus => Takes {
                // At most: what is sharp ends earlier.
                seconds: self.autofocus_s,
                disk_bytes: None,
            },
            Stage::Focus => Takes {
                seconds: self.focus_s,
                disk_bytes: Some(8 * self.pixels),
            },
            Stage::Check => Takes {
                seconds: self
                    .exact_s
                    .map(|all_s| all_s * options.check as f64 / pixels),
                disk_bytes: None,
            },
            Stage::Picture | Stage::Quality => Takes::default(),
            Stage::Products => Takes {
                seconds: None,
                disk_bytes: Some(formats.map(|format| self.bytes(*format)).sum()),
            },
        }
    }

    /// What a format takes: greys before they are deflated, with overviews, for maps, whose own raster is about as large.
    fn bytes(&self, format: ImageFormat) -> u64 {
        match format {
            ImageFormat::Sicd | ImageFormat::Zarr => 8 * self.pixels,
            ImageFormat::Sidd | ImageFormat::Png => self.pixels,
            ImageFormat::Cog | ImageFormat::Kmz => self.pixels * 4 / 3,
        }
    }
}
