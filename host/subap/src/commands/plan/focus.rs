//! `subap plan focus`: write the plan of an image to a file that any computer can execute.

use serde_json::json;
use subaperture::io::ours::Kind;
use subaperture::io::together::FileSet;
use subaperture::io::written::FileKind;

use crate::args::{Part, PlanFocus};
use crate::commands::focus::{note_delay, summary, tiled};
use crate::commands::{forming, surface};
use crate::config::Session;
use crate::stages::duration;
use crate::text;

/// Make the plan, write it, and report its cost.
pub(super) fn run(session: &Session, typed: &PlanFocus) -> anyhow::Result<()> {
    surface::check(&typed.image)?;
    let mut claims = session.claims(&typed.writing, &typed.input.files);
    claims.file(&typed.out, Kind::Record)?;
    let model = forming::time_model(&typed.image)?;
    let numerics = typed.image.forming.numerics(model.as_ref());
    let recorded = session.open(&typed.input)?;
    let recorded = forming::without_delay(&typed.image, recorded)?;
    let history = recorded.history();
    let survey = forming::survey(history)?;
    let grid = surface::grid(session, &typed.image, history, || &survey)?;
    note_delay(session, &recorded, &grid);
    let (plan, comparison) =
        tiled::plan_recording(session, &typed.image, history, &grid, numerics)?;
    let text_of_plan = plan.to_text();
    let mut files = FileSet::new();
    files.write_bytes(&typed.out, FileKind::Plan, text_of_plan.as_bytes())?;
    let files = files.commit()?;
    if session.json() {
        return text::say_json(
            "plan",
            json!({
                "files": files,
                "former": plan.former,
                "planned_error_db": plan.planned_db,
                "choices": plan.summary,
                "tiles": plan.num_tiles(),
                "tile": [plan.tile.rows, plan.tile.columns],
                "scratch_bytes": plan.scratch_bytes,
                "operations": plan.cost.operations,
                "comparison_operations": comparison.operations,
                "core_s": plan.cost.core_s() + comparison.core_s,
                "comparison_core_s": comparison.core_s,
                "total_bytes": (8 * plan.grid.num_pixels()).saturating_add(plan.cost.bytes(1.0)),
                "buffers": plan.cost.buffers,
                "tile_operations": plan.tile_operations,
                "tile_bytes": plan.tile_bytes,
            }),
        );
    }
    text::say(format!(
        "{}\n{:<16} {:.2e}, in all; {:.2e} for a tile alone; {:.2e} to compare with the exact sum\n{:<16} about {} of a core, {} of it to compare\n{:<16} {} for a tile alone, by one thread",
        summary::describe(&plan, Part::WHOLE),
        "operations",
        plan.cost.operations,
        plan.tile_operations,
        comparison.operations,
        "time",
        duration(plan.cost.core_s() + comparison.core_s),
        duration(comparison.core_s),
        "memory",
        text::bytes(plan.tile_bytes.into()),
    ))?;
    if session.prints_text() {
        text::say(format!(
            "{}: plan; execute it with subap focus INPUT --plan {} -o DIR",
            typed.out.display(),
            typed.out.display()
        ))?;
    }
    Ok(())
}
