//! `subap plan focus`: a plan of an image, in a file that any machine can carry out.

use std::io::Write;
use std::time::Instant;

use serde_json::json;
use subaperture::io::atomic::write_atomically;
use subaperture::io::ours::Kind;
use subaperture::phase_history::PhaseHistory;
use subaperture::planner::forecast::{Settings, cost};

use crate::args::{Mode, Part, PlanFocus};
use crate::commands::focus::{Job, tiled};
use crate::commands::forming;
use crate::config::{DEFAULT_ERROR_DB, Session};
use crate::failure::Usage;
use crate::text;

/// Makes the plan, writes it, and says what it will take.
pub(super) fn run(session: &Session, typed: &PlanFocus) -> anyhow::Result<()> {
    if let Some(option) = typed.stray() {
        return Err(Usage(format!(
            "{option} says nothing to a plan: give it to subap focus --plan"
        ))
        .into());
    }
    let typed = &typed.focus;
    let mut claims = session.claims(&typed.writing, &typed.input.paths);
    claims.file(&typed.out, Kind::Record)?;
    let history = session.open(&typed.input)?;
    let survey = forming::survey(&history)?;
    let plan = tiled::make_plan(&Job {
        session,
        typed,
        history: &history,
        survey: &survey,
        start: Instant::now(),
    })?;
    let settings = Settings {
        error_db: typed.error_db.unwrap_or(DEFAULT_ERROR_DB),
        sub_cpi: typed.sub_cpi,
        is_thesis: typed.mode == Some(Mode::Thesis),
    };
    let cost = cost(
        &plan.former,
        history.collection(),
        &plan.grid,
        &settings,
        session.memory_bytes,
    );
    let text_of_plan = plan.to_text();
    write_atomically(&typed.out, text_of_plan.len() as u64, |file| {
        file.write_all(text_of_plan.as_bytes())
    })?;
    if session.json() {
        return text::say_json(
            "plan",
            json!({
                "file": typed.out.display().to_string(),
                "former": plan.former,
                "planned_error_db": plan.planned_db,
                "choices": plan.summary,
                "tiles": plan.num_tiles(),
                "tile": [plan.tile.rows, plan.tile.columns],
                "scratch_bytes": plan.scratch_bytes,
                "operations": cost.as_ref().map(|cost| cost.operations),
                "total_bytes": cost.as_ref().map(|cost| cost.total_bytes as f64),
            }),
        );
    }
    let mut lines = tiled::describe(&plan, Part::WHOLE);
    if let Some(cost) = cost {
        lines.push_str(&format!(
            "\n{:<16} {:.2e}, in all",
            "operations", cost.operations
        ));
    }
    text::say(lines)?;
    if session.tells() {
        text::say(format!(
            "{}: the plan; subap focus INPUT --plan {} -o DIR carries it out",
            typed.out.display(),
            typed.out.display()
        ))?;
    }
    Ok(())
}
