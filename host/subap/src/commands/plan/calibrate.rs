//! `subap plan calibrate`: measure the timing model of this computer for use in planning.

use serde_json::json;
use subaperture::focus::TimeModel;
use subaperture::io::ours::Kind;
use subaperture::io::together::FileSet;
use subaperture::io::written::FileKind;

use crate::args::PlanCalibrate;
use crate::config::Session;
use crate::text;

/// Measure the timing model and write it.
pub(super) fn run(session: &Session, typed: &PlanCalibrate) -> anyhow::Result<()> {
    let mut claims = session.claims::<&str>(&typed.writing, &[]);
    claims.file(&typed.out, Kind::Record)?;
    let measuring = session.progress("measuring");
    let name = typed.name.as_deref().unwrap_or("measured");
    let model = TimeModel::measured(name.to_owned());
    measuring.finish();
    let mut files = FileSet::new();
    let text_of_model = model.to_text();
    files.write_bytes(&typed.out, FileKind::TimingModel, text_of_model.as_bytes())?;
    let files = files.commit()?;
    if session.json() {
        return text::say_json("time-model", json!({ "files": files, "model": model }));
    }
    if session.prints_text() {
        let out = typed.out.display();
        text::say(format!(
            "{out}: timing model of this computer; use it with subap focus or subap plan focus --model {out}"
        ))?;
    }
    Ok(())
}
