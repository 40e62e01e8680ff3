//! `subap plan calibrate`: this machine's times, in a file by which plans can be made.

use std::io::Write;

use serde_json::json;
use subaperture::focus::TimeModel;
use subaperture::io::atomic::write_atomically;
use subaperture::io::ours::Kind;

use crate::args::PlanCalibrate;
use crate::config::Session;
use crate::text;

/// Measures the model and writes it.
pub(super) fn run(session: &Session, typed: &PlanCalibrate) -> anyhow::Result<()> {
    let mut claims = session.claims::<&str>(&typed.writing, &[]);
    claims.file(&typed.out, Kind::Record)?;
    let measuring = session.progress("measuring");
    let name = typed.name.as_deref().unwrap_or("measured");
    let model = TimeModel::measured(name.to_owned());
    measuring.finish();
    let text_of_model = model.to_text();
    write_atomically(&typed.out, text_of_model.len() as u64, |file| {
        file.write_all(text_of_model.as_bytes())
    })?;
    if session.json() {
        let file = typed.out.display().to_string();
        return text::say_json("time-model", json!({ "file": file, "model": model }));
    }
    if session.tells() {
        let out = typed.out.display();
        text::say(format!(
            "{out}: the times of this machine; subap focus and subap plan focus choose by them with --model {out}"
        ))?;
    }
    Ok(())
}
