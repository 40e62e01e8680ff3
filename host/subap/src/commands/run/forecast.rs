//! Time and memory forecast of a job by stage, from short measured parts of the work. Writes no files.

use serde_json::{Value, json};
use subaperture::focus::formers;
use subaperture::focus::{ImageFormer, Numerics, Task};
use subaperture::geometry::ImageGrid;
use subaperture::io::atomic::free_bytes;
use subaperture::job::State;
use subaperture::planner::forecast::{cost, forecast_of};

use super::chain::{Link, Stage};
use super::job::Job;
use crate::args::ImageFormat;
use crate::commands::focus::beam;
use crate::commands::forming::{survey, without_delay};
use crate::commands::surface;
use crate::config::Session;
use crate::text;

/// Expected cost of a stage; `None` if it is small or the stage is up to date.
#[derive(Clone, Copy, Default)]
struct Cost {
    seconds: Option<f64>,
    disk_bytes: Option<u64>,
}

/// Print which stages will run, why, and their expected cost.
pub(super) fn print(
    session: &Session,
    job: &Job,
    chain: &[Link],
    state: &State,
) -> anyhow::Result<()> {
    let mut rows = Vec::new();
    for link in chain {
        let why = state.why(&job.out, &link.basis, &link.before)?;
        rows.push((link, why));
    }
    let measured = match rows.iter().any(|(_, why)| why.is_some()) {
        true => Some(Measured::new(session, job)?),
        false => None,
    };
    let costs: Vec<Cost> = rows
        .iter()
        .map(|(link, why)| match (why, &measured) {
            (Some(_), Some(measured)) => measured.cost(link.stage, job),
            _ => Cost::default(),
        })
        .collect();
    let seconds: f64 = costs.iter().filter_map(|cost| cost.seconds).sum();
    let disk_bytes: u64 = costs.iter().filter_map(|cost| cost.disk_bytes).sum();
    let memory_bytes = measured
        .as_ref()
        .map_or(0, |measured| measured.memory_bytes);
    let free = free_bytes(&job.out);
    if session.json() {
        let stages: Vec<Value> = rows
            .iter()
            .zip(&costs)
            .map(|((link, why), cost)| {
                json!({
                    "stage": link.name(),
                    "to_do": why.is_some(),
                    "why": why.as_ref().map(ToString::to_string),
                    "time_s": cost.seconds,
                    "disk_bytes": cost.disk_bytes,
                })
            })
            .collect();
        return text::say_json(
            "run-forecast",
            json!({
                "folder": job.out.display().to_string(),
                "stages": stages,
                "time_s": seconds,
                "memory_bytes": memory_bytes,
                "memory_allowed_bytes": session.memory.total_bytes,
                "disk_bytes": disk_bytes,
                "free_bytes": free,
            }),
        );
    }
    let lines = rows.iter().zip(&costs).map(|((link, why), cost)| {
        let (to_do, why) = match why {
            None => ("up to date".to_owned(), String::new()),
            Some(why) => ("to do".to_owned(), why.to_string()),
        };
        let seconds = cost
            .seconds
            .map(|s| format!("about {}", text::seconds(rounded(s))));
        let disk = cost.disk_bytes.map(|bytes| text::bytes(bytes.into()));
        let cell = |cost: Option<String>| match &why[..] {
            "" => String::new(),
            _ => cost.unwrap_or_else(|| "little".to_owned()),
        };
        vec![
            link.name().to_owned(),
            to_do,
            cell(seconds),
            cell(disk),
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
            job.out.display(),
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

/// Round an estimate to two significant digits.
fn rounded(seconds: f64) -> f64 {
    format!("{seconds:.1e}").parse().unwrap_or(seconds)
}

/// Cost of the processing, from measured parts of it.
struct Measured {
    grid: ImageGrid,
    pixels: u64,
    /// Peak memory of the process.
    memory_bytes: u64,
    focus_s: Option<f64>,
    autofocus_s: Option<f64>,
    /// The whole grid by the exact sum.
    exact_s: Option<f64>,
}

impl Measured {
    /// Measure on the recorded track, also if the job estimates another one.
    fn new(session: &Session, job: &Job) -> anyhow::Result<Self> {
        let focus = &job.focus;
        let forming = &focus.image.forming;
        surface::check(&focus.image)?;
        let recorded = session.open(&focus.input)?;
        let recorded = without_delay(&focus.image, recorded)?;
        let history = recorded.history();
        let survey = survey(history)?;
        let grid = surface::grid(session, &focus.image, history, || &survey)?;
        let former = beam::former(session, &focus.image, history, &grid)?;
        let [fast, slow] = forming.windows.both();
        let progress = session.progress("measuring");
        let mut memory_bytes = 0;
        let mut time = |grid: &ImageGrid, former: &dyn ImageFormer, numerics: Numerics| {
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
        let focus_s = time(&grid, &*former, forming.numerics(None))?;
        let autofocus_s = match &job.autofocus {
            None => None,
            Some(autofocus) => {
                let grid = autofocus.settings.grid.as_ref().unwrap_or(&grid);
                let one = time(grid, &*autofocus.former.former()?, Numerics::default())?;
                one.map(|one_s| one_s * (autofocus.settings.rounds + 1) as f64)
            }
        };
        let exact_s = match job.check {
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

    fn cost(&self, stage: Stage, job: &Job) -> Cost {
        let pixels = self.pixels as f64;
        let formats = job.products.formats.iter();
        match stage {
            Stage::Track => Cost::default(),
            Stage::Autofocus => Cost {
                // An upper limit: autofocus stops when the image is sharp.
                seconds: self.autofocus_s,
                disk_bytes: None,
            },
            Stage::Focus => Cost {
                seconds: self.focus_s,
                disk_bytes: Some(8 * self.pixels),
            },
            Stage::Check => Cost {
                seconds: self.exact_s.map(|all_s| all_s * job.check as f64 / pixels),
                disk_bytes: None,
            },
            Stage::Picture | Stage::Quality => Cost::default(),
            Stage::Products => Cost {
                seconds: None,
                disk_bytes: Some(formats.map(|format| self.bytes(*format)).sum()),
            },
        }
    }

    /// Size of a product: greys before compression; maps with overviews, on a raster about as large as the image.
    fn bytes(&self, format: ImageFormat) -> u64 {
        match format {
            ImageFormat::Sicd | ImageFormat::Zarr => 8 * self.pixels,
            ImageFormat::Sidd | ImageFormat::Png => self.pixels,
            ImageFormat::Cog | ImageFormat::Kmz => self.pixels * 4 / 3,
        }
    }
}
