//! Processing of each stage of a job: the command of the same name, without console output.

use std::fs;
use std::io::Write;
use std::path::Path;

use anyhow::bail;
use serde_json::{Value, json};
use subaperture::io::atomic::write_atomically;
use subaperture::io::claim::OutputClaims;
use subaperture::io::tiles::{self, TileStore};
use subaperture::job::{FileStamp, RunReason, State, stamp};

use super::chain::{Link, Stage};
use super::options::{AUTOFOCUS_PNG, CORRECTION, Options, PICTURE_PNG, TRACK_CSV, TRACK_PNG};
use crate::args::{self, ImageFormat};
use crate::commands::export::Products;
use crate::commands::{autofocus, focus, picture, quality, track};
use crate::config::Session;

/// The names of records that stages leave.
pub(super) const AUTOFOCUS_JSON: &str = "autofocus.json";
pub(super) const CHECK_JSON: &str = "check.json";
pub(super) const QUALITY_JSON: &str = "quality.json";
pub(super) const PLOTS: &str = "quality";

/// The image's own files.
const IMAGE: [&str; 3] = [tiles::NAME, "image.json", "image.png"];

/// Who does a job's stages.
pub(super) struct Worker<'a> {
    /// Which says no results.
    pub(super) session: &'a Session,
    pub(super) options: &'a Options,
    pub(super) writing: args::Writing,
    /// Whether the folder was a job's before this run.
    pub(super) ours: bool,
}

impl Worker<'_> {
    fn out(&self) -> &Path {
        &self.options.out
    }

    /// Refuses, before any work, what may not be replaced.
    pub(super) fn refuse_others(&self) -> anyhow::Result<()> {
        let store = self.out().join(tiles::NAME);
        if !self.ours && !self.writing.force && store.exists() {
            bail!(
                "{}: an image is there that is no job's: say another folder with out, or give --force to form another in its place",
                store.display()
            );
        }
        Ok(())
    }

    /// Makes ready for a stage: what it had done is no longer done. Whether it goes on with what an earlier run had begun.
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
        // Only the image is gone on with. Its record may be lost, and its tiles whole.
        let goes_on = match why {
            RunReason::Begun => true,
            RunReason::Output(path) => path != tiles::NAME,
            _ => false,
        };
        if !goes_on {
            // While tiles go nobody is to go on with them.
            state.forget(name);
            state.begin(name, "");
            state.write(self.out())?;
            TileStore::discard(self.out())?;
        }
        state.begin(name, &fingerprint);
        state.write(self.out())?;
        Ok(goes_on && self.out().join(tiles::NAME).exists())
    }

    /// Does a stage; the files that it left, from the job's folder.
    pub(super) fn work(&self, stage: Stage) -> anyhow::Result<Vec<String>> {
        let options = self.options;
        let names = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
        match stage {
            Stage::Track => {
                let told = options.track.as_ref().expect("the chain has what is told");
                track::run(self.session, &told.typed)?;
                Ok(names(&[TRACK_CSV, TRACK_PNG]))
            }
            Stage::Autofocus => {
                let told = options
                    .autofocus
                    .as_ref()
                    .expect("the chain has what is told");
                let found = autofocus::found(self.session, &told.typed)?;
                self.record(AUTOFOCUS_JSON, found)?;
                Ok(names(&[CORRECTION, AUTOFOCUS_PNG, AUTOFOCUS_JSON]))
            }
            Stage::Focus => {
                focus::run(self.session, &options.focus.typed)?;
                Ok(names(&IMAGE))
            }
            Stage::Check => {
                let check =
                    focus::checked(self.session, &options.focus.typed, options.check as usize)?;
                self.record(CHECK_JSON, json!(check))?;
                Ok(names(&[CHECK_JSON]))
            }
            Stage::Picture => {
                picture::run(self.session, &options.picture.typed)?;
                Ok(names(&[PICTURE_PNG]))
            }
            Stage::Quality => self.quality(),
            Stage::Products => self.products(),
        }
    }

    fn quality(&self) -> anyhow::Result<Vec<String>> {
        let plots = self.out().join(PLOTS);
        let mut claims = self.claims();
        let points = self.options.points as usize;
        let (report, drawn) = quality::of_job(
            self.session,
            &self.options.quality,
            points,
            &plots,
            &mut claims,
        )?;
        self.record(QUALITY_JSON, report)?;
        let drawn = drawn.into_iter().map(|name| format!("{PLOTS}/{name}"));
        Ok(std::iter::once(QUALITY_JSON.to_owned())
            .chain(drawn)
            .collect())
    }

    fn products(&self) -> anyhow::Result<Vec<String>> {
        let products = Products {
            folder: self.out(),
            formats: &self.options.formats,
            place: self.options.place,
            writing: self.writing,
        };
        let _claims = products.claim(self.session, &self.options.focus.typed.input.paths)?;
        products.write(self.session)?;
        let files = self.options.formats.iter().flat_map(|format| {
            let beside: &[&str] = match format {
                ImageFormat::Cog => &["map.json"],
                ImageFormat::Png => &["map.pgw", "map.prj"],
                _ => &[],
            };
            std::iter::once(format.file_name()).chain(beside.iter().copied())
        });
        Ok(files.map(str::to_owned).collect())
    }

    /// What products were left by an earlier run, by another image or of other formats, is not to be taken for this one's.
    pub(super) fn sweep(&self, outputs: &[FileStamp]) {
        for output in outputs {
            let path = self.out().join(&output.path);
            // What was changed since is no longer ours.
            if !matches!(stamp(&path, &output.path), Ok(Some(now)) if now == *output) {
                continue;
            }
            // A failure leaves a file more than there should be.
            let _ = match path.is_dir() {
                true => fs::remove_dir_all(&path),
                false => fs::remove_file(&path),
            };
        }
    }

    fn claims(&self) -> OutputClaims {
        self.session
            .claims(&self.writing, &self.options.focus.typed.input.paths)
    }

    /// Writes a record of this name; `value` is an object with its schema.
    fn record(&self, name: &str, mut value: Value) -> anyhow::Result<()> {
        let schema = name.trim_end_matches(".json");
        if let Some(object) = value.as_object_mut() {
            let entry = object.entry("schema");
            entry.or_insert_with(|| format!("subaperture-{schema}").into());
            object.entry("schema_version").or_insert_with(|| 1.into());
        }
        let text = serde_json::to_string_pretty(&value)? + "\n";
        write_atomically(&self.out().join(name), text.len() as u64, |file| {
            file.write_all(text.as_bytes())
        })?;
        Ok(())
    }
}
