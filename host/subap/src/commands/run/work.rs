//! Processing of each stage of a job: the command of the same name, without console output.

use std::fs;
use std::io::Write;
use std::path::Path;

use anyhow::bail;
use serde_json::{Value, json};
use subaperture::io::atomic::write_atomically;
use subaperture::io::claim::OutputClaims;
use subaperture::io::tiles::{self, TileStore};
use subaperture::io::written::{FileKind, WrittenFile};
use subaperture::job::{RunReason, StageOutput, State};

use super::chain::{Link, Stage};
use super::job::{Job, PICTURE_PNG, TRACK_CSV, TRACK_PNG};
use crate::args;
use crate::commands::export::Products;
use crate::commands::{autofocus, focus, picture, quality, track};
use crate::config::Session;

/// File names of the records of stages, and the folder of the plots.
pub(super) const AUTOFOCUS_JSON: &str = "autofocus.json";
pub(super) const CHECK_JSON: &str = "check.json";
pub(super) const QUALITY_JSON: &str = "quality.json";
pub(super) const PLOTS: &str = "quality";

/// Outcome of a stage.
pub(super) struct StageOutcome {
    pub(super) name: &'static str,
    /// Why the stage was run; `None` if its outputs were up to date.
    pub(super) why: Option<RunReason>,
    /// Processing time, seconds; for a reused stage that of its run.
    pub(super) seconds: f64,
}

/// Processing of the stages of one job.
pub(super) struct Worker<'a> {
    /// Session without output of results.
    pub(super) session: &'a Session,
    pub(super) job: &'a Job,
    pub(super) writing: args::Writing,
    /// Whether the folder contained the state of a job before this run.
    pub(super) is_job_folder: bool,
}

impl Worker<'_> {
    fn out(&self) -> &Path {
        &self.job.out
    }

    /// Refuse to replace an image that no job formed.
    pub(super) fn refuse_foreign_image(&self) -> anyhow::Result<()> {
        let store = self.out().join(tiles::NAME);
        if !self.is_job_folder && !self.writing.force && store.exists() {
            bail!(
                "{}: this image was not formed by a job: choose another folder by the key out, or replace the image by --force",
                store.display()
            );
        }
        Ok(())
    }

    /// Prepare a stage: remove its entry from the state. Returns whether the stage resumes an earlier run.
    pub(super) fn begin(
        &self,
        link: &Link,
        why: &RunReason,
        state: &mut State,
    ) -> anyhow::Result<bool> {
        let (name, fingerprint) = (link.name(), link.basis.fingerprint());
        if link.stage != Stage::Focus {
            state.forget(name);
            state.write(self.out())?;
            return Ok(false);
        }
        // Only focusing resumes; also if the record of the image is missing and its tiles are complete.
        let resumes = match why {
            RunReason::Begun => true,
            RunReason::Output(path) => path != tiles::NAME,
            _ => false,
        };
        if !resumes {
            // A run that is killed while tiles are removed must not resume with the rest of them.
            state.forget(name);
            state.begin(name, "");
            state.write(self.out())?;
            TileStore::discard(self.out())?;
        }
        state.begin(name, &fingerprint);
        state.write(self.out())?;
        Ok(resumes && self.out().join(tiles::NAME).exists())
    }

    /// Run a stage. Returns its output files.
    pub(super) fn work(&self, stage: Stage) -> anyhow::Result<Vec<WrittenFile>> {
        let job = self.job;
        let missing = "a stage of the chain has settings";
        match stage {
            Stage::Track => {
                track::run(self.session, job.track.as_ref().expect(missing))?;
                Ok(vec![
                    self.file(TRACK_CSV, FileKind::Track),
                    self.file(TRACK_PNG, FileKind::Picture),
                ])
            }
            Stage::Autofocus => {
                let autofocus = job.autofocus.as_ref().expect(missing);
                let (record, mut files) = autofocus::estimate(self.session, autofocus)?;
                files.push(self.record(AUTOFOCUS_JSON, record)?);
                Ok(files)
            }
            Stage::Focus => {
                focus::run(self.session, &job.focus)?;
                Ok(vec![
                    self.file(tiles::NAME, FileKind::Image),
                    self.file("image.json", FileKind::Record),
                    self.file("image.png", FileKind::Picture),
                ])
            }
            Stage::Check => {
                let check = focus::checked(self.session, &job.focus, job.check)?;
                Ok(vec![self.record(CHECK_JSON, json!(check))?])
            }
            Stage::Picture => {
                picture::run(self.session, &job.picture)?;
                Ok(vec![self.file(PICTURE_PNG, FileKind::Picture)])
            }
            Stage::Quality => self.quality(),
            Stage::Products => self.products(),
        }
    }

    /// File of this name in the job's folder.
    fn file(&self, name: &str, kind: FileKind) -> WrittenFile {
        WrittenFile::new(self.out().join(name), kind)
    }

    fn quality(&self) -> anyhow::Result<Vec<WrittenFile>> {
        let plots = self.out().join(PLOTS);
        let mut claims = self.claims();
        let (report, drawn) = quality::of_job(
            self.session,
            &self.job.quality,
            self.job.points,
            &plots,
            &mut claims,
        )?;
        let record = self.record(QUALITY_JSON, report)?;
        Ok([record].into_iter().chain(drawn).collect())
    }

    fn products(&self) -> anyhow::Result<Vec<WrittenFile>> {
        let products = Products {
            folder: self.out(),
            formats: &self.job.products.formats,
            place: self.job.products.place,
            writing: self.writing,
        };
        let _claims = products.claim(self.session, &self.job.focus.input.files)?;
        let written = products.write(self.session)?;
        Ok(written.into_iter().flat_map(|one| one.files).collect())
    }

    /// Remove outputs of an earlier run that are unchanged since: with other settings, files of other names would remain.
    pub(super) fn remove_outputs(&self, outputs: &[StageOutput]) {
        for output in outputs {
            if !matches!(output.is_unchanged(self.out()), Ok(true)) {
                continue;
            }
            let path = self.out().join(&output.stamp.path);
            // If this fails, a file too many remains.
            let _ = match path.is_dir() {
                true => fs::remove_dir_all(&path),
                false => fs::remove_file(&path),
            };
        }
    }

    fn claims(&self) -> OutputClaims {
        self.session
            .claims(&self.writing, &self.job.focus.input.files)
    }

    /// Write a record, with its schema and version added to the object `value`.
    fn record(&self, name: &str, mut value: Value) -> anyhow::Result<WrittenFile> {
        let schema = name.trim_end_matches(".json");
        if let Some(object) = value.as_object_mut() {
            let entry = object.entry("schema");
            entry.or_insert_with(|| format!("subaperture-{schema}").into());
            object.entry("schema_version").or_insert_with(|| 1.into());
        }
        let text = serde_json::to_string_pretty(&value)? + "\n";
        let file = self.file(name, FileKind::Record);
        write_atomically(&file.path, text.len() as u64, |file| {
            file.write_all(text.as_bytes())
        })?;
        Ok(file)
    }
}
