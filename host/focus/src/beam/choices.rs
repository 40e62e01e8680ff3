//! Plans of a former for each block of a grid.

use std::collections::HashMap;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::Beam;
use super::normalisation::SUMS_A_BLOCK;
use crate::compared::SWATH;
use crate::cost::{Buffer, Copies, Cost, StageCost};
use crate::former_choices::{FormerChoices, misfit};
use crate::patch::PatchSize;
use crate::{Decision, ErrorGoal, FormError, ImageFormer, ImageSpec};
use subaperture_model::antenna::{CombinedPattern, FLOOR};
use subaperture_model::geometry::{Axis, ImageGrid};
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::{BlockIllumination, Collection, Weights};

/// Real operations and nanoseconds of a two-way amplitude of two equal antennas. Measured: 50 ns for apertures, 60 ns for Gaussian patterns, 220 ns for powers
/// of cosines.
const TERM_OPERATIONS: f64 = 150.0;
const TERM_NS: f64 = 90.0;

/// Plans of all blocks; equal plans are stored once.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Choices {
    each: Vec<FormerChoices>,
    /// Index into `each` for each block; `None` for a block that no pulse illuminates.
    of_block: Vec<Option<usize>>,
}

impl Choices {
    /// Parse stored plans and check their number of blocks.
    pub(super) fn of(
        former: &'static str,
        choices: &FormerChoices,
        illumination: &BlockIllumination,
    ) -> Result<Self, FormError> {
        let choices: Self = choices.of(former)?;
        let fits = |block: usize| match choices.of_block[block] {
            Some(index) => index < choices.each.len() && !illumination.pulses(block).is_empty(),
            None => illumination.pulses(block).is_empty(),
        };
        match choices.of_block.len() == illumination.num_blocks()
            && (0..illumination.num_blocks()).all(fits)
        {
            true => Ok(choices),
            false => Err(misfit(
                former,
                "the numbers of blocks or their plans do not match the beam and the grid",
            )),
        }
    }

    /// Plan of one block; `None` for a block that no pulse illuminates.
    pub(super) fn get(&self, block: usize) -> Option<&FormerChoices> {
        Some(&self.each[self.of_block[block]?])
    }
}

/// Block treated as a separate image.
pub(super) struct Part {
    pub(super) collection: Collection,
    pub(super) grid: ImageGrid,
    pub(super) weights: Weights,
}

impl Part {
    pub(super) fn of(spec: &ImageSpec, illumination: &BlockIllumination, block: usize) -> Self {
        let [rows, columns] = illumination.place(block);
        let part = |axis: &Axis, range: &std::ops::Range<usize>| Axis {
            start: axis.at(range.start),
            count: range.len(),
            ..*axis
        };
        let whole = spec.collection;
        Self {
            collection: Collection {
                name: whole.name.clone(),
                pulses: whole.pulses[illumination.pulses(block)].to_vec(),
                ..*whole
            },
            grid: ImageGrid {
                rows: part(&spec.grid.rows, &rows),
                columns: part(&spec.grid.columns, &columns),
                ..spec.grid.clone()
            },
            weights: Weights {
                fast: spec.weights.fast.clone(),
                slow: illumination.slow(block).0.into_owned(),
                illumination: None,
                windows: None,
            },
        }
    }

    pub(super) fn spec<'a>(&'a self, whole: &ImageSpec<'a>) -> ImageSpec<'a> {
        ImageSpec {
            collection: &self.collection,
            grid: &self.grid,
            weights: &self.weights,
            ..*whole
        }
    }
}

/// Make a plan for every illuminated block.
pub(super) fn decide(
    former: &dyn ImageFormer,
    (beam, illumination): (Option<&Beam>, &BlockIllumination),
    spec: &ImageSpec,
    goal: &ErrorGoal,
    monitor: &dyn Monitor,
) -> Result<Decision, FormError> {
    let decisions = (0..illumination.num_blocks()).into_par_iter().map(|block| {
        if illumination.pulses(block).is_empty() {
            return Ok(None);
        }
        if monitor.cancelled() {
            return Err(FormError::Cancelled);
        }
        let part = Part::of(spec, illumination, block);
        former.decide(&part.spec(spec), goal, monitor).map(Some)
    });
    let decisions: Vec<Option<Decision>> = decisions.collect::<Result<_, FormError>>()?;
    let seen = || decisions.iter().flatten();
    let worst = seen().max_by(|a, b| a.planned_db.total_cmp(&b.planned_db));
    let worst = worst.ok_or_else(|| match beam {
        Some(beam) => super::blocks::unseen(beam, &spec.collection.name),
        None => FormError::unsuited(format!("{}: no pulse sees the grid", spec.collection.name)),
    })?;
    let most_pulses = (0..illumination.num_blocks()).map(|block| illumination.pulses(block).len());
    let mut settings = worst.settings.clone();
    let division = json!({
        "blocks": illumination.num_blocks(),
        "block": illumination.side(),
        "most_pulses": most_pulses.max(),
        "pixels_unseen": illumination.num_unseen(),
    });
    if illumination.is_matched() {
        settings["antenna_weights"] = division.clone();
        settings["antenna_weights"]["floor_db"] = (20.0 * libm::log10(FLOOR)).into();
    }
    if let Some(beam) = beam {
        let of_beam = &mut settings["beam"];
        *of_beam = division;
        of_beam["width_deg"] = beam.width_rad.to_degrees().into();
        of_beam["squint_deg"] = beam.squint_rad.to_degrees().into();
        of_beam["source"] = json!(beam.source);
        if !beam.aims.is_empty() {
            of_beam["turns"] = true.into();
        }
    }
    let stray = seen().map(
        |decision| match decision.settings["stray_error_db"].as_f64() {
            Some(db) => db,
            None => decision.planned_db,
        },
    );
    settings["stray_error_db"] = json!(stray.fold(f64::NEG_INFINITY, f64::max));
    let of_swath = seen().all(|decision| decision.settings["stray_from"] == SWATH);
    if let Some(settings) = settings.as_object_mut() {
        settings.remove("stray_from");
        if of_swath {
            settings.insert("stray_from".to_owned(), SWATH.into());
        }
    }
    let planned_db = worst.planned_db;
    let cost = cost(seen(), illumination, spec);
    let [rows, columns] = illumination.side();
    Ok(Decision {
        choices: FormerChoices::new(unlike(&decisions)),
        settings,
        planned_db,
        grain: PatchSize { rows, columns },
        cost,
    })
}

fn unlike(decisions: &[Option<Decision>]) -> Choices {
    let mut each = Vec::new();
    let mut known = HashMap::new();
    let of_block = decisions.iter().map(|decision| {
        let choices = &decision.as_ref()?.choices;
        let index = known
            .entry(choices.to_json().to_string())
            .or_insert_with(|| {
                each.push(choices.clone());
                each.len() - 1
            });
        Some(*index)
    });
    let of_block = of_block.collect();
    Choices { each, of_block }
}

/// Cost of forming all blocks one after another: summed operations, largest buffers, stages of one block.
fn cost<'a>(
    decisions: impl Iterator<Item = &'a Decision>,
    illumination: &BlockIllumination,
    spec: &ImageSpec,
) -> Cost {
    let mut stages: Vec<StageCost> = Vec::new();
    let mut buffers: Vec<Buffer> = Vec::new();
    for cost in decisions.map(|decision| &decision.cost) {
        for stage in &cost.stages {
            match stages.iter_mut().find(|known| known.name == stage.name) {
                Some(known) => {
                    known.operations += stage.operations;
                    known.core_s += stage.core_s;
                }
                // A tile forms only the blocks that overlap it.
                None => stages.push(StageCost {
                    shared: false,
                    ..stage.clone()
                }),
            }
        }
        for buffer in &cost.buffers {
            let each = match buffer.each {
                Copies::Pixels => Copies::Pass,
                each => each,
            };
            match buffers.iter_mut().find(|known| known.name == buffer.name) {
                Some(known) => known.bytes = known.bytes.max(buffer.bytes),
                None => buffers.push(Buffer {
                    each,
                    ..buffer.clone()
                }),
            }
        }
    }
    if illumination.is_matched() {
        let pulses = (0..illumination.num_blocks()).map(|block| illumination.pulses(block).len());
        let terms = SUMS_A_BLOCK * pulses.sum::<usize>() as f64;
        let stage = StageCost::new("antenna pattern", TERM_OPERATIONS * terms, TERM_NS * terms);
        stages.push(stage);
        buffers.push(Buffer {
            name: "antenna pattern".into(),
            bytes: CombinedPattern::PULSE_BYTES * spec.collection.pulses.len() as u64,
            each: Copies::Pass,
        });
    }
    let [rows, columns] = illumination.side();
    let geometry = size_of_val(spec.collection.pulses.as_slice());
    let cost = Cost {
        buffers,
        ..Cost::of(stages)
    };
    cost.holding(
        "a block's pixels",
        Copies::Pass,
        8.0 * (rows * columns) as f64,
    )
    .holding("a block's geometry", Copies::Pass, geometry as f64)
}
