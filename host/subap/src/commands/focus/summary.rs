//! Summary of a plan in a few lines.

use serde_json::Value;
use subaperture::focus::Plan;

use crate::args::Part;
use crate::text;

/// Format the work, choices, planned error and tiles of a plan, or of a part of it.
pub(crate) fn describe(plan: &Plan, part: Part) -> String {
    let [down, across] = plan.tiling().tiles();
    let grid = &plan.grid;
    let tiles = match part {
        Part::WHOLE => String::new(),
        part => format!(", part {part}: {} of them", part.of(plan.num_tiles()).len()),
    };
    let choices = plan.summary.as_object().into_iter().flatten();
    let choices: Vec<String> = choices
        .map(|(key, value)| match value {
            Value::String(text) => format!("{} {text}", key.replace('_', " ")),
            value => format!("{} {value}", key.replace('_', " ")),
        })
        .collect();
    format!(
        "{:<16} {} pulses of {} samples onto {} x {} pixels by {}\n{:<16} {}\n{:<16} {:.1} dB{}\n{:<16} {across} x {down} of {} x \
         {} pixels{tiles}\n{:<16} at most {} per thread",
        "work",
        plan.recording.pulses,
        plan.recording.samples,
        grid.columns.count,
        grid.rows.count,
        plan.former,
        "choices",
        choices.join(", "),
        "planned error",
        plan.planned_db,
        plan.bound_db
            .map_or(String::new(), |bound| format!(", bound {bound} dB")),
        "tiles",
        plan.tile.columns,
        plan.tile.rows,
        "scratch",
        text::bytes(plan.scratch_bytes.into()),
    )
}
