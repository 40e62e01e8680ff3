//! `subap quality --from`: points measured on finely sampled chips formed from the recording.

use std::path::Path;

use anyhow::{Context, bail};
use glam::DVec3;
use serde_json::Value;
use subaperture::focus::bp::Backprojection;
use subaperture::focus::exact::Exact;
use subaperture::focus::forecast::Forecast;
use subaperture::focus::moving::Moving;
use subaperture::focus::{ImageFormer, Task};
use subaperture::geometry::{Axis, ImageGrid};
use subaperture::io::target_csv;
use subaperture::phase_history::{Joined, PhaseHistory, Weights};
use subaperture::planner::forecast;
use subaperture::quality::response::{Settings, Target, brightest_in, measure};
use subaperture::resolution::support::{Looks, measured_gains};
use subaperture::signal::window::Window;
use subaperture::track::Displacement;

use super::report::{FormedChip, Point};
use super::source::Source;
use super::theory::{self, Basis};
use crate::ahead::{Ahead, reading};
use crate::args::{Input, Quality, several_channels};
use crate::commands::focus::auxiliary_file;
use crate::config::Session;
use crate::failure::Usage;

/// Pixel step in cells of the spectral support: 0.4 of the Nyquist step.
const STEP_CELLS: f64 = 0.4;
/// Half-width of a chip, pixels: 12 widths of an unweighted band take 27, of a Taylor-weighted one 36.
const HALF: usize = 48;
/// Number of multiplications up to which the exact sum is used; backprojection with this bound above.
const EXACT_WORK: f64 = 4e9;
const ERROR_DB: f64 = -80.0;
const BACKPROJECTION: Backprojection = Backprojection { error_db: ERROR_DB };

/// Recording from which chips are formed, with the image's settings.
pub(super) struct From<'a> {
    session: &'a Session,
    source: &'a Source,
    recorded: Joined,
    target: Option<Displacement>,
    windows: [Window; 2],
}

/// Chip to be formed.
struct Chip {
    /// Point target at the chip's centre.
    target: Target,
    grid: ImageGrid,
    looks: Looks,
    former: &'static dyn ImageFormer,
}

/// Settings with which the image's recordings were opened.
fn settings(recorded: &serde_json::Value) -> Vec<(String, String)> {
    let texts = recorded.as_array().into_iter().flatten();
    texts
        .filter_map(|text| text.as_str()?.split_once('='))
        .map(|(key, value)| (key.to_owned(), value.to_owned()))
        .collect()
}

/// Motion of the image's target from the file at `path`, which must be one of the image's `inputs`, unchanged.
fn unchanged_motion(path: &str, inputs: &Value) -> anyhow::Result<Displacement> {
    let file = auxiliary_file(Path::new(path))
        .context("--from needs the file of the target's motion with which the image was formed")?;
    let found = serde_json::to_value(&file)?;
    let mut inputs = inputs.as_array().into_iter().flatten();
    if !inputs.any(|input| *input == found) {
        bail!(
            "{path}: the image was formed with another motion of the target (the checksum of this file is {}): give the same file",
            file.identity.text()
        );
    }
    Ok(target_csv::read(Path::new(path))?)
}

impl<'a> From<'a> {
    /// Open the recordings of `--from` with the image's settings.
    pub(super) fn open(
        session: &'a Session,
        typed: &Quality,
        source: &'a Source,
    ) -> anyhow::Result<Self> {
        let Some(metadata) = &source.metadata else {
            let fault = "--from needs an image with the record of its settings: give the folder that subap focus wrote, not its \
                        image.npy";
            return Err(Usage(fault.to_owned()).into());
        };
        let given = &metadata["settings"]["given"];
        let recorded = session.open(&Input {
            files: typed.from.clone(),
            channel: given["channel"].as_str().map(str::to_owned),
            channels: given["channels"]
                .as_str()
                .and_then(|text| several_channels(text).ok()),
            set: settings(&given["set"]),
        })?;
        let num_pulses = recorded.collection().pulses.len() as u64;
        if let Some(formed_of) = metadata["collection"]["num_pulses"].as_u64()
            && formed_of != num_pulses
        {
            bail!(
                "--from has {num_pulses} pulses, but {} was formed from {formed_of}: give the same recordings",
                source.name
            );
        }
        let Some(windows) = typed
            .measuring
            .window
            .map(|window| [window; 2])
            .or(source.windows)
        else {
            bail!(
                "{}: the record states no windows: give --window",
                source.name
            );
        };
        let numbers = |value: &Value| -> Option<Vec<f64>> {
            value.as_array()?.iter().map(Value::as_f64).collect()
        };
        let velocity_m_s = numbers(&given["velocity_m_s"]);
        let target = match (given["motion"].as_str(), velocity_m_s.as_deref()) {
            (Some(path), _) => Some(unchanged_motion(path, &metadata["inputs"])?),
            (None, Some(&[x, y, z])) => Some(DVec3::new(x, y, z).into()),
            _ => None,
        };
        Ok(Self {
            session,
            source,
            recorded,
            target,
            windows,
        })
    }

    /// The recording in the frame of the image's target, if that moves.
    fn moving(&self) -> anyhow::Result<Option<Moving<'_>>> {
        let first_s = self.recorded.collection().pulses[0].time_s;
        let moving = self
            .target
            .clone()
            .map(|target| Moving::new(&self.recorded, target, first_s));
        Ok(moving.transpose()?)
    }

    /// The recording as used for the image.
    fn history<'h>(&'h self, moving: Option<&'h Moving<'h>>) -> &'h dyn PhaseHistory {
        match moving {
            Some(moving) => moving,
            None => &self.recorded,
        }
    }

    /// Chip around a target.
    fn chip(
        &self,
        history: &dyn PhaseHistory,
        target: Target,
        settings: &Settings,
    ) -> anyhow::Result<Chip> {
        let collection = history.collection();
        let [fast, slow] = self.windows;
        let looks = Looks::new(collection, fast, slow);

        let coarse = &self.source.grid;
        let (row, column) = brightest_in(self.source.pixels(), coarse, target, settings)?;
        let (row_value, column_value) = (coarse.rows.at(row), coarse.columns.at(column));
        let support = looks.at(coarse.point_m(row_value, column_value));
        let [x, y] = coarse.directions(row_value, column_value);
        let axis = |direction: DVec3, middle: f64| {
            let extent = support
                .extent(direction)
                .map_or(0.0, |[low, high]| high - low);
            let step = STEP_CELLS / extent;
            step.is_finite().then_some(Axis {
                start: middle - HALF as f64 * step,
                step,
                count: 2 * HALF + 1,
            })
        };
        let (Some(columns), Some(rows)) = (axis(x, column_value), axis(y, row_value)) else {
            bail!(
                "the recording has no resolution along one of the image's axes, so that there is no response to measure"
            );
        };
        let grid = ImageGrid {
            rows,
            columns,
            ..coarse.clone()
        };
        let work = collection.pulses.len() as f64
            * collection.num_samples as f64
            * grid.num_pixels() as f64;
        Ok(Chip {
            target: Target::Near {
                column_value,
                row_value,
            },
            grid,
            looks,
            former: match work < EXACT_WORK {
                true => &Exact,
                false => &BACKPROJECTION,
            },
        })
    }

    /// Predicted cost of forming and measuring the chips of `targets`.
    pub(super) fn ahead(&self, targets: &[Target], settings: &Settings) -> anyhow::Result<Ahead> {
        let moving = self.moving()?;
        let history = self.history(moving.as_ref());
        let collection = history.collection();
        let [fast, slow] = self.windows;
        let weights = Weights::new(collection, fast, slow);
        let progress = self.session.progress("measuring speed");
        // A chip may be refused at its position; the others have the same number of pixels and take the same time.
        let chips = targets
            .iter()
            .map(|target| self.chip(history, *target, settings));
        let chips: Vec<Chip> = chips.collect::<Result<_, _>>()?;
        let chip = &chips[0];
        let task = Task {
            memory_bytes: self.session.memory_bytes,
            monitor: &progress,
            ..Task::new(history, &chip.grid, &weights)
        };
        let forming = forecast::forecast(chip.former, &task)?;
        // The beam is measured from all pulses.
        let beam = reading(history)?;
        let one = forming.map(|forming| [forming, beam].into_iter().sum());
        progress.finish();
        let work = format!(
            "{} chips of {} pulses, measured",
            targets.len(),
            collection.pulses.len()
        );
        let held_bytes = history.held_bytes() + self.source.grid.num_pixels() * 8;
        let time = one.map(|one: Forecast| Forecast {
            seconds: one.seconds * targets.len() as f64,
            ..one
        });
        Ok(Ahead::new(self.session, work, held_bytes, time, Vec::new()))
    }

    /// Forms a chip around a target and measures it.
    pub(super) fn point(&self, target: Target, settings: &Settings) -> anyhow::Result<Point> {
        let moving = self.moving()?;
        let history = self.history(moving.as_ref());
        let collection = history.collection();
        let [fast, slow] = self.windows;
        let Chip {
            target,
            grid,
            looks,
            former,
        } = self.chip(history, target, settings)?;
        let progress = self.session.progress("forming a chip");
        let weights = Weights::new(collection, fast, slow);
        let task = Task {
            memory_bytes: self.session.memory_bytes,
            monitor: &progress,
            ..Task::new(history, &grid, &weights)
        };
        let image = former
            .form_best(&task)
            .context("--from: no chip was formed")?
            .image;
        progress.finish();

        // The peak lies within a pixel of the image's brightest, or two pixels if that is noise.
        let coarse = &self.source.grid;
        let ImageGrid { rows, columns, .. } = &grid;
        let reach =
            (2.0 * coarse.rows.step / rows.step).max(2.0 * coarse.columns.step / columns.step);
        let fine = Settings {
            search_px: (reach.ceil() as usize).clamp(4, HALF / 2),
            looks: Some(&looks),
            ..*settings
        };
        let response = measure(&image, &grid, target, &fine)?;
        let place_m = DVec3::from(response.position_m);
        let progress = self.session.progress("measuring the beam");
        let gains = measured_gains(history, place_m, fast, &progress)?;
        progress.finish();
        let gained = looks
            .clone()
            .with_gain(|part| gains[((part * gains.len() as f64) as usize).min(gains.len() - 1)]);
        let basis = Basis::Unknown;
        Ok(Point {
            theory: theory::of_cuts(&basis, &response, &grid, Some(&looks)),
            theory_with_gain: theory::of_cuts(&basis, &response, &grid, Some(&gained)),
            formed: Some(FormedChip {
                former: former.name(),
                pixels: grid.rows.count,
                steps: [rows.step, columns.step],
            }),
            response,
        })
    }
}
