//! Report of a job on one page. All numbers come from the records of its stages.

use std::fs;
use std::io::Write;
use std::path::Path;
use std::time::{Instant, SystemTime};

use anyhow::Context;
use serde_json::{Value, json};
use subaperture::io::atomic::write_atomically;
use subaperture::io::input::open_file;
use subaperture::io::json::{self, JsonError};
use subaperture::io::product::RECORD_LIMITS;
use subaperture::io::written::{FileKind, WrittenFile};
use subaperture::job::{Basis, FinishedStage, JobText, RunReason, StageOutput, State, fingerprint};
use subaperture::phase_history::InputFile;

use super::chain::{Link, REPORT, Stage};
use super::job::{AUTOFOCUS_PNG, PICTURE_PNG, TRACK_PNG};
use super::keys;
use super::tables::{self, decibels, seconds, words};
use super::work::{AUTOFOCUS_JSON, CHECK_JSON, PLOTS, QUALITY_JSON, StageOutcome, Worker};
use crate::config::Session;
use crate::html::{Cells, Page, Row, escaped};
use crate::{log, text};

/// File name of the report.
pub(super) const NAME: &str = "report.html";

/// Write the report, unless it is up to date.
pub(super) fn run_stage(
    session: &Session,
    worker: &Worker,
    text: &JobText,
    inputs: &[InputFile],
    chain: &[Link],
    state: &mut State,
    warnings: &[String],
) -> anyhow::Result<StageOutcome> {
    let out = &worker.job.out;
    let last = chain.last().expect("a job has stages");
    let made: Vec<&FinishedStage> = chain.iter().filter_map(|l| state.made(l.name())).collect();
    // The report contains times, sizes and warnings.
    let mut settings = text.settings(&keys::section_names());
    settings.insert("name".to_owned(), worker.job.name.clone().into());
    let records = json!([made, warnings]).to_string();
    let basis = Basis {
        version: last.basis.version.clone(),
        stage: REPORT.to_owned(),
        settings,
        files: last.basis.files.clone(),
        after: [(last.name().to_owned(), fingerprint(records.as_bytes()))].into(),
    };
    let why = state.why(out, &basis, &[last.name()])?;
    let Some(mut why) = why else {
        if session.prints_text() {
            text::say(format!("{REPORT:<10} up to date"))?;
        }
        return Ok(StageOutcome {
            name: REPORT,
            why: None,
            seconds: state.made(REPORT).map_or(0.0, |made| made.seconds),
        });
    };
    if let RunReason::After(_) = why {
        why = RunReason::After("the stages".to_owned());
    }
    let begun = Instant::now();
    let report = Report {
        session,
        worker,
        basis: &basis,
        inputs,
        chain,
        state,
        warnings,
    };
    let html = report.page()?;
    state.forget(REPORT);
    state.write(out)?;
    let file = WrittenFile::new(out.join(NAME), FileKind::Report);
    write_atomically(&file.path, html.len() as u64, |file| {
        file.write_all(html.as_bytes())
    })?;
    let seconds = begun.elapsed().as_secs_f64();
    let output = StageOutput::of(&file, out)?;
    state.finish(FinishedStage {
        basis,
        outputs: output.into_iter().collect(),
        seconds,
        resumed: false,
        warnings: Vec::new(),
        bound_missed: false,
    });
    state.write(out)?;
    if session.prints_text() {
        text::say(format!(
            "{REPORT:<10} done in {} ({why})",
            text::duration(begun.elapsed())
        ))?;
    }
    Ok(StageOutcome {
        name: REPORT,
        why: Some(why),
        seconds,
    })
}

/// Contents of a report.
struct Report<'a> {
    session: &'a Session,
    worker: &'a Worker<'a>,
    basis: &'a Basis,
    inputs: &'a [InputFile],
    chain: &'a [Link],
    state: &'a State,
    warnings: &'a [String],
}

impl Report<'_> {
    fn out(&self) -> &Path {
        &self.worker.job.out
    }

    fn has(&self, stage: Stage) -> bool {
        self.chain.iter().any(|link| link.stage == stage)
    }

    fn record(&self, name: &str) -> anyhow::Result<Value> {
        let path = self.out().join(name);
        open_file(&path)
            .map_err(JsonError::Io)
            .and_then(|file| json::value(file, RECORD_LIMITS))
            .with_context(|| format!("cannot read {}", path.display()))
    }

    fn picture(&self, name: &str) -> anyhow::Result<Vec<u8>> {
        let path = self.out().join(name);
        fs::read(&path).with_context(|| format!("cannot read {}", path.display()))
    }

    fn page(&self) -> anyhow::Result<String> {
        let image = self.record("image.json")?;
        let check = match self.has(Stage::Check) {
            true => Some(self.record(CHECK_JSON)?),
            false => None,
        };
        let quality = self.record(QUALITY_JSON)?;
        let mut page = Page::new(&self.worker.job.name);
        self.head(&mut page, &image, check.as_ref());
        if !self.warnings.is_empty() {
            page.section("warnings", "Warnings");
            page.list(self.warnings);
        }
        page.section("image", "Image");
        let title = image["picture"]["title"].as_str().unwrap_or("the image");
        page.pictures(&[(self.picture(PICTURE_PNG)?, title.to_owned())]);
        self.points(&mut page, &image, &quality)?;
        tables::statistics(&mut page, &quality["statistics"]);
        if let Some(check) = &check {
            tables::error(&mut page, &image, check);
        }
        if self.has(Stage::Autofocus) {
            tables::sharpened(
                &mut page,
                &self.record(AUTOFOCUS_JSON)?,
                self.picture(AUTOFOCUS_PNG)?,
            );
        }
        if self.has(Stage::Track) {
            page.section("track", "Track");
            let caption = "estimated track over the recorded one".to_owned();
            page.pictures(&[(self.picture(TRACK_PNG)?, caption)]);
        }
        self.products(&mut page);
        self.times(&mut page);
        self.settings(&mut page, &image);
        Ok(page.finish())
    }

    fn head(&self, page: &mut Page, image: &Value, check: Option<&Value>) {
        let now = log::utc(SystemTime::now());
        let when = now.split('.').next().unwrap_or(&now).replace('T', " ");
        page.paragraph(
            "soft",
            &escaped(&format!(
                "Report of {when} UTC by subap {}: {}",
                self.basis.version,
                image["collection"]["name"]
                    .as_str()
                    .unwrap_or("a recording"),
            )),
        );
        let (columns, rows) = (&image["grid"]["columns"], &image["grid"]["rows"]);
        let length = |value: &Value| {
            value
                .as_f64()
                .map_or("none".to_owned(), subaperture::quantity::metres)
        };
        let mut facts = vec![
            (
                "Pixels",
                format!("{} x {}", columns["count"], rows["count"]),
            ),
            ("Pulses", image["collection"]["num_pulses"].to_string()),
            ("Former", tables::former(image)),
            (
                "Windows",
                format!(
                    "{}; {} over slow time",
                    words(&image["settings"]["window"]),
                    words(&image["settings"]["slow_window"])
                ),
            ),
        ];
        if image["grid"]["kind"] == "cartesian" {
            facts.insert(
                1,
                (
                    "Distance of pixels",
                    format!("{} x {}", length(&columns["step"]), length(&rows["step"])),
                ),
            );
        }
        let predicted = &image["settings"]["resolved"]["predicted_error_db"];
        if predicted.is_number() {
            facts.push(("Predicted error", decibels(predicted)));
        }
        if let Some(check) = check {
            facts.push(("Measured error", decibels(&check["relative_to_image_db"])));
        }
        if let Some(level) = image["brightest"]["level_db"].as_f64() {
            facts.push(("Brightest pixel", text::decibels(level)));
        }
        page.facts(&facts);
    }

    fn points(&self, page: &mut Page, image: &Value, quality: &Value) -> anyhow::Result<()> {
        let points = quality["points"].as_array();
        let Some(points) = points.filter(|points| !points.is_empty()) else {
            return Ok(());
        };
        tables::points(page, points, image["grid"]["kind"] == "polar");
        let made = self.state.made(Stage::Quality.name());
        let mut pictures = Vec::new();
        for output in made.map_or(&[][..], |made| &made.outputs) {
            if let Some(name) = output.stamp.path.strip_prefix(&format!("{PLOTS}/")) {
                pictures.push((self.picture(&output.stamp.path)?, tables::caption(name)));
            }
        }
        if !pictures.is_empty() {
            page.pictures(&pictures);
        }
        Ok(())
    }

    fn products(&self, page: &mut Page) {
        let Some(made) = self.state.made(Stage::Products.name()) else {
            return;
        };
        page.section("products", "Products");
        let rows: Vec<Row> = made
            .outputs
            .iter()
            .map(|file| {
                let cells = vec![
                    format!("<code>{}</code>", escaped(&file.stamp.path)),
                    text::bytes(file.stamp.bytes.into()),
                    file.stamp.bytes.to_string(),
                    format!("<code>{}</code>", file.stamp.crc32),
                ];
                ("", cells)
            })
            .collect();
        page.table(Cells::Numbers, &["file", "size", "bytes", "CRC-32"], &rows);
    }

    fn times(&self, page: &mut Page) {
        page.section("times", "Stages");
        let mut sum_s = 0.0;
        let mut rows: Vec<Row> = Vec::new();
        for link in self.chain {
            let Some(made) = self.state.made(link.name()) else {
                continue;
            };
            sum_s += made.seconds;
            rows.push((
                "",
                vec![
                    link.name().to_owned(),
                    seconds(made.seconds),
                    match made.resumed {
                        true => "resumed; time of the last run".to_owned(),
                        false => String::new(),
                    },
                ],
            ));
        }
        rows.push((
            "theory",
            vec!["all".to_owned(), seconds(sum_s), String::new()],
        ));
        page.table(Cells::Words, &["stage", "time", ""], &rows);
        let memory = text::bytes(self.session.memory.total_bytes.into());
        let threads = self.session.threads;
        page.paragraph(
            "soft small",
            &format!(
                "Wall-clock times. The last run had {threads} threads and {memory} of memory."
            ),
        );
    }

    fn settings(&self, page: &mut Page, image: &Value) {
        page.section("settings", "Settings");
        let rows: Vec<Row> = self
            .basis
            .settings
            .iter()
            .filter(|(key, _)| key.contains('.'))
            .map(|(key, value)| {
                let value = format!("<code>{}</code>", escaped(&words(value)));
                ("", vec![format!("<code>{}</code>", escaped(key)), value])
            })
            .collect();
        page.table(Cells::Words, &["key", "value (SI units, dB)"], &rows);
        page.section("inputs", "Recordings");
        let rows: Vec<Row> = self
            .inputs
            .iter()
            .map(|input| {
                let cells = vec![
                    format!(
                        "<code>{}</code>",
                        escaped(&input.path.display().to_string())
                    ),
                    input.bytes.to_string(),
                    format!("<code>{}</code>", escaped(input.identity.text())),
                ];
                ("", cells)
            })
            .collect();
        page.table(
            Cells::Numbers,
            &["file", "bytes", "CRC-32 or version"],
            &rows,
        );
        let resolved = image["settings"]["resolved"].as_object();
        let rows: Vec<Row> = resolved
            .into_iter()
            .flatten()
            .filter(|(_, value)| !value.is_object() && !value.is_array())
            .map(|(key, value)| {
                (
                    "",
                    vec![escaped(&key.replace('_', " ")), escaped(&words(value))],
                )
            })
            .collect();
        if !rows.is_empty() {
            page.section("chosen", "Settings chosen by the former");
            page.table(Cells::Words, &["", ""], &rows);
        }
    }
}
