//! Sinks of an image that is formed tile by tile: one array, or a store that several processes fill.

use std::io;
use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use subaperture::focus::plan::{ImageSink, Sink};
use subaperture::focus::{Plan, StageCost, Tile, TileRecord};
use subaperture::geometry::ImageGrid;
use subaperture::image::{Image, ImageSource, ImageSourceError, Peak, Tiling, power};
use subaperture::io::atomic::WriteError;
use subaperture::io::claim::OutputClaims;
use subaperture::io::product::PendingProduct;
use subaperture::io::product::record::Brightest;
use subaperture::io::tiles::{Claimed, TileStore};
use subaperture::io::written::{FileKind, WrittenFile};

use super::summary::describe;
use crate::args::{Focus, Part};
use crate::config::Session;
use crate::{messages, stages, text};

/// Maximum share of the tiles formed in one pass over the pulses, so that a killed run loses little.
const PASSES: usize = 16;

/// Record and brightest pixel of a tile, stored with its pixels.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Note {
    record: TileRecord,
    /// Row and column in the image of the brightest pixel, and its power.
    peak: Option<(usize, usize, f64)>,
}

impl Note {
    fn of(tile: Tile, record: TileRecord) -> (Self, Image) {
        let Tile { place, pixels } = tile;
        let image = Image {
            rows: place.size.rows,
            columns: place.size.columns,
            pixels,
        };
        let at = |peak: Peak| {
            let (row, column) = (place.row + peak.row, place.column + peak.column);
            (row, column, power(peak.value))
        };
        let peak = image.peak().map(at);
        (Self { record, peak }, image)
    }

    fn from_mark(mark: Value) -> Result<Self, ImageSourceError> {
        serde_json::from_value(mark)
            .map_err(|error| format!("a tile's mark is damaged: {error}").into())
    }
}

/// Brightest pixel of all tiles; the first in the image of several equal ones.
fn brightest(notes: &[Note], grid: &ImageGrid) -> Option<Brightest> {
    let peaks = notes.iter().filter_map(|note| note.peak);
    let (row, column, power) =
        peaks.max_by(|a, b| a.2.total_cmp(&b.2).then((b.0, b.1).cmp(&(a.0, a.1))))?;
    Brightest::at(grid, [row, column], power)
}

fn records(notes: &[Note]) -> Vec<TileRecord> {
    notes.iter().map(|note| note.record.clone()).collect()
}

/// Image in one array, for an image larger than memory.
pub(super) struct ArraySink<'a> {
    out: &'a Path,
    growing: Option<(PendingProduct, Tiling)>,
    notes: Vec<Note>,
}

impl<'a> ArraySink<'a> {
    /// Make a sink that writes to the folder `out`.
    pub(super) fn new(out: &'a Path) -> Self {
        Self {
            out,
            growing: None,
            notes: Vec::new(),
        }
    }

    /// Brightest pixel of the complete image, and its array.
    pub(super) fn finish(self, grid: &ImageGrid) -> (Option<Brightest>, Option<PendingProduct>) {
        let array = self.growing.map(|(growing, _)| growing);
        (brightest(&self.notes, grid), array)
    }
}

impl Sink for ArraySink<'_> {
    fn take(
        &mut self,
        index: usize,
        tile: Tile,
        record: TileRecord,
    ) -> Result<(), ImageSourceError> {
        let (note, image) = Note::of(tile, record);
        if let Some((growing, tiling)) = &mut self.growing {
            growing.put(&tiling.place(index), &image.pixels)?;
        }
        self.notes.push(note);
        Ok(())
    }
}

impl ImageSink for ArraySink<'_> {
    fn begin(&mut self, plan: &Plan) -> Result<Vec<usize>, ImageSourceError> {
        // The array of an earlier plan goes first: the disk may not hold both.
        self.growing = None;
        self.notes.clear();
        let tiling = plan.tiling();
        self.growing = Some((PendingProduct::begin(self.out, tiling.image)?, tiling));
        Ok((0..plan.num_tiles()).collect())
    }

    fn records(&mut self) -> Result<Option<Vec<TileRecord>>, ImageSourceError> {
        Ok(Some(records(&self.notes)))
    }
}

/// Part of the tiles of a store, which other processes may fill as well.
pub(super) struct StoreSink<'a> {
    session: &'a Session,
    typed: &'a Focus,
    part: Part,
    store: TileStore,
    /// Claim of the image's record and picture; taken by the process that forms the last tile.
    claims: Option<OutputClaims>,
    filling: Option<Claimed>,
    /// Notes of all tiles, once the image is complete.
    notes: Vec<Note>,
    num_tiles: usize,
    /// Cost of comparing the image with the exact sum.
    comparison: StageCost,
}

impl<'a> StoreSink<'a> {
    /// Make a sink for the part of `store` that is typed.
    pub(super) fn new(
        session: &'a Session,
        typed: &'a Focus,
        store: TileStore,
        claims: Option<OutputClaims>,
        comparison: StageCost,
    ) -> Self {
        Self {
            session,
            typed,
            comparison,
            part: typed.tiled.tiles.unwrap_or(Part::WHOLE),
            store,
            claims,
            filling: None,
            notes: Vec::new(),
            num_tiles: 0,
        }
    }

    pub(super) fn store(&self) -> &TileStore {
        &self.store
    }

    /// Brightest pixel of the complete image.
    pub(super) fn brightest(&self, grid: &ImageGrid) -> Option<Brightest> {
        brightest(&self.notes, grid)
    }
}

impl Sink for StoreSink<'_> {
    fn take(
        &mut self,
        index: usize,
        tile: Tile,
        record: TileRecord,
    ) -> Result<(), ImageSourceError> {
        let (note, image) = Note::of(tile, record);
        self.store
            .put(index, &image.pixels, &serde_json::json!(note))?;
        Ok(())
    }
}

impl ImageSink for StoreSink<'_> {
    fn begin(&mut self, plan: &Plan) -> Result<Vec<usize>, ImageSourceError> {
        let text = plan.to_text();
        if self.store.plan() != text {
            let out = &self.typed.out;
            TileStore::discard(out)?;
            self.store = TileStore::create(out, plan.tiling(), &text)?;
        }
        let part = self.part;
        self.num_tiles = plan.num_tiles();
        self.session.note(1, || describe(plan, part));
        stages::show_predicted(self.session, &plan.cost, &self.comparison);
        self.filling = Some(self.store.claim(&part.to_string().replace('/', " of "))?);
        let done = self.store.done()?;
        let of_part = part.of(self.num_tiles);
        let missing: Vec<usize> = of_part.clone().filter(|i| !done.contains_key(i)).collect();
        if missing.len() < of_part.len() {
            let there = of_part.len() - missing.len();
            messages::note(&format!(
                "{there} of {} tiles are already formed",
                of_part.len()
            ));
        }
        Ok(missing)
    }

    fn max_tiles_a_pass(&self, plan: &Plan) -> usize {
        plan.num_tiles().div_ceil(PASSES)
    }

    fn records(&mut self) -> Result<Option<Vec<TileRecord>>, ImageSourceError> {
        self.filling = None;
        let marks = self.store.done()?;
        if marks.len() < self.num_tiles {
            let (there, all, part) = (marks.len(), self.num_tiles, self.part);
            if self.session.json() {
                let part = json!({
                    "complete": false,
                    "part": part.to_string(),
                    "tiles": { "formed": there, "count": all },
                    "run_time_s": messages::run_time_s(),
                    "files": [WrittenFile::new(self.store.folder(), FileKind::Image)],
                });
                text::say_json("focus", part).map_err(io::Error::other)?;
            }
            if self.session.prints_text() {
                text::say(format!(
                    "{}: part {part} is complete; {there} of {all} tiles are formed, other processes form the rest",
                    self.store.folder().display()
                ))?;
            }
            return Ok(None);
        }
        if self.claims.is_none() {
            self.claims = claim(self.session, self.typed)?;
        }
        if self.claims.is_none() {
            // Another process writes the record.
            return Ok(None);
        }
        let notes: Result<_, _> = marks.into_values().map(Note::from_mark).collect();
        self.notes = notes?;
        Ok(Some(records(&self.notes)))
    }

    fn image(&self) -> Option<&dyn ImageSource> {
        Some(&self.store)
    }
}

/// Claim the record and the picture. `None` if another process that carries out the same plan has claimed them.
pub(super) fn claim(session: &Session, typed: &Focus) -> Result<Option<OutputClaims>, WriteError> {
    let mut claims = session.claims(&typed.writing, &typed.input.files);
    match claims.folder(&typed.out, subaperture::io::product::TILED_NAMES) {
        Ok(()) => Ok(Some(claims)),
        Err(WriteError::Locked { .. }) if typed.tiled.plan.is_some() => Ok(None),
        Err(error) => Err(error),
    }
}
