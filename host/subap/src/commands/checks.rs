//! Output of a self-test: table, JSON and report file.

use std::path::Path;

use anyhow::bail;
use serde::Serialize;
use serde_json::json;
use subaperture::io::selftest::{Check, Report, Verdict};
use subaperture::io::written::{FileKind, WrittenFile};

use crate::config::Session;
use crate::text;

/// Print the checks of a device named `title`, write the report, and return an error if a check failed.
pub(super) fn finish<A: Serialize>(
    session: &Session,
    name: &str,
    title: &str,
    report: &Report<A>,
    out: Option<&Path>,
) -> anyhow::Result<()> {
    if let Some(out) = out {
        report.write(out)?;
    }
    if session.json() {
        let mut value = serde_json::to_value(report)?;
        let files = out.map(|out| WrittenFile::new(out, FileKind::Record));
        value["files"] = json!(files.as_slice());
        text::say_json(name, value)?;
    } else if session.prints_text() {
        text::say(title)?;
        let rows: Vec<_> = report.checks.iter().map(row).collect();
        text::say(text::table(
            &["check", "measured", "limit", "result"],
            &rows,
        ))?;
        let noted = |check: &&Check| check.verdict != Verdict::Passed && !check.note.is_empty();
        for check in report.checks.iter().filter(noted) {
            let verdict = check.verdict.name();
            text::say(format!("{}: {verdict}: {}", check.name, check.note))?;
        }
        if let Some(out) = out {
            text::say(format!("{}: report", out.display()))?;
        }
    }
    match report.failed() {
        0 => Ok(()),
        1 => bail!("1 check failed"),
        failed => bail!("{failed} checks failed"),
    }
}

fn row(check: &Check) -> Vec<String> {
    let number = |value: f64| match value.fract() == 0.0 {
        true => format!("{value}"),
        false if value.abs() < 0.1 => format!("{value:.4}"),
        false => format!("{value:.2}"),
    };
    let with_unit = |text: String| format!("{text} {}", check.unit).trim_end().to_owned();
    let limit = match (check.least, check.most) {
        (Some(least), Some(most)) => with_unit(format!("{} to {}", number(least), number(most))),
        (Some(least), None) => with_unit(format!("at least {}", number(least))),
        (None, Some(most)) => with_unit(format!("at most {}", number(most))),
        (None, None) => String::new(),
    };
    let value = check
        .value
        .map_or_else(String::new, |value| with_unit(number(value)));
    vec![
        check.name.clone(),
        value,
        limit,
        check.verdict.name().to_owned(),
    ]
}
