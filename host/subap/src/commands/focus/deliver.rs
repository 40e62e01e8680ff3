//! Writing of a complete image with its record and picture, and the summary printed for it.

use std::path::{Path, PathBuf};

use anyhow::Context;
use serde_json::{Value, json};
use subaperture::focus::auto::selected;
use subaperture::focus::beam::{Beam, seeing};
use subaperture::geometry::ImageGrid;
use subaperture::image::{Image, ImageSource};
use subaperture::io::input::{checksum, open_file};
use subaperture::io::product::{self, CompleteProduct, Product, TiledProduct};
use subaperture::io::tiles::{self, TileStore};
use subaperture::io::together::FileSet;
use subaperture::io::written::{FileKind, WrittenFile};
use subaperture::phase_history::{InputFile, PhaseHistory};
use subaperture::plot::{self, Panel, Source};

use super::job::{Job, products};
use super::record::{About, Record};
use crate::args::{Focus, TrackSource};
use crate::commands::export::Written;
use crate::commands::gmti::{self, Found};
use crate::config::Session;
use crate::{interrupt, messages, text};

/// Pixels of a complete image.
pub(super) enum Whole<'a> {
    Memory(&'a Image),
    Array(Box<CompleteProduct>),
    Tiles(&'a TileStore),
}

impl Whole<'_> {
    pub(super) fn parts(&self) -> &dyn ImageSource {
        match self {
            Self::Memory(image) => *image,
            Self::Array(grown) => &**grown,
            Self::Tiles(store) => *store,
        }
    }

    fn source(&self) -> Source<'_> {
        match self {
            Self::Memory(image) => Source::Whole(image),
            parts => Source::ImageSource(parts.parts()),
        }
    }
}

impl Whole<'_> {
    /// Write the record and picture of the image. Returns all files.
    fn write_metadata(
        self,
        out: &Path,
        mut metadata: Value,
        quicklook: &[u8],
    ) -> anyhow::Result<Vec<WrittenFile>> {
        Ok(match self {
            Self::Memory(image) => Product {
                image,
                metadata: &metadata,
                quicklook,
            }
            .write(out)?,
            Self::Array(grown) => grown.write(&metadata, quicklook)?,
            Self::Tiles(store) => {
                metadata["image"]["file"] = tiles::NAME.into();
                TiledProduct {
                    store,
                    metadata: &metadata,
                    quicklook,
                }
                .write(out)?
            }
        })
    }
}

/// Moving targets detected in the images of the channels.
pub(super) struct Targets<'a> {
    /// File for the record.
    pub(super) path: &'a Path,
    pub(super) record: Value,
    pub(super) found: &'a Found,
}

impl Targets<'_> {
    /// Write the record together with the image, both complete or neither.
    fn write_with(&self, product: &Product, out: &Path) -> anyhow::Result<Vec<WrittenFile>> {
        let mut files = FileSet::new();
        product.add_to(&mut files, out)?;
        let bytes = serde_json::to_vec_pretty(&self.record)?;
        files.write_bytes(self.path, FileKind::MovingTargets, &bytes)?;
        Ok(files.commit()?)
    }
}

impl Job<'_> {
    /// Write a complete image by the named former with its record and picture, and with moving targets if they were detected.
    pub(super) fn deliver(
        &self,
        grid: &ImageGrid,
        (former, beam): (&str, Option<Beam>),
        about: About,
        image: Whole,
        targets: Option<&Targets>,
    ) -> anyhow::Result<()> {
        let Self { session, typed, .. } = *self;
        interrupt::check()?;
        let checksums = session.progress("checksums");
        let mut inputs = self.history.inputs()?;
        let track = typed.track.as_ref().and_then(TrackSource::file);
        let logs = typed.logs.navigation.iter().map(PathBuf::as_path);
        let surfacing = &typed.image.grid;
        let geoid = surfacing.geoid.as_ref().and_then(|geoid| geoid.file());
        // A folder of elevation models is named by the relief.
        let ground = surfacing.surface.file().into_iter().chain(geoid);
        let ground = ground.filter(|path| path.is_file());
        let motion = typed.target.motion.as_deref();
        let auxiliary = track.into_iter().chain(typed.phase.as_deref());
        let auxiliary = auxiliary.chain(motion).chain(logs);
        for path in auxiliary.chain(ground) {
            inputs.push(auxiliary_file(path)?);
        }
        checksums.finish();
        let report = about.check.as_ref().map(ToString::to_string);
        // The resolution is that of the pulses whose beam covers the image centre.
        let middle_m = grid.position_m(grid.rows.count / 2, grid.columns.count / 2);
        let seeing = beam.map(|beam| seeing(&beam, self.history, middle_m));
        let seeing = seeing.transpose().ok().flatten();
        let mut record = Record::of(self, grid, about, &inputs)?;
        if let Some(seeing) = &seeing {
            record.seen = Some((seeing.collection(), middle_m));
        }
        let resolved = record.settings["resolved"].as_object();
        let former = resolved.map_or(former, |resolved| selected(resolved, former));
        let title = format!("{}, {former}", self.survey.get().name);
        deliver(session, typed, image, &record, &title, targets)?;
        match report {
            Some(check) if !session.json() => Ok(text::say(check)?),
            _ => Ok(()),
        }
    }
}

/// Write the output folder and report it.
pub(super) fn deliver(
    session: &Session,
    typed: &Focus,
    image: Whole,
    record: &Record,
    title: &str,
    targets: Option<&Targets>,
) -> anyhow::Result<()> {
    interrupt::check()?;
    let writing = session.progress("writing");
    let panel = Panel {
        scale: typed.look.scale(),
        colours: typed.look.colours(),
        orientation: record.orientation,
        ..Panel::new(image.source(), record.grid, title)
    };
    let draw = || {
        Ok(plot::quicklook_within(
            &panel,
            session.memory.picture_bytes,
        )?)
    };
    let out = &typed.out;
    let files = match (&image, targets) {
        (Whole::Memory(image), None) => {
            product::write_drawing::<anyhow::Error>(out, image, || record.to_json(title), draw)?
        }
        (Whole::Memory(image), Some(targets)) => {
            let product = Product {
                image,
                metadata: &record.to_json(title),
                quicklook: &draw()?,
            };
            targets.write_with(&product, out)?
        }
        _ => {
            let quicklook = &draw()?;
            image.write_metadata(out, record.to_json(title), quicklook)?
        }
    };
    writing.finish();
    let products = products(typed).write(session)?;
    if session.json() {
        let mut summary = summary(record, files, &products);
        if let Some(targets) = targets {
            summary["features"] = targets.record["features"].clone();
        }
        return text::say_json("focus", summary);
    }
    report(session, typed, record, &products)?;
    match targets {
        Some(targets) if session.prints_text() => gmti::say(targets.path, targets.found),
        _ => Ok(()),
    }
}

/// The result as JSON. The record, which is among its files, contains all settings and figures.
fn summary(record: &Record, mut files: Vec<WrittenFile>, products: &[Written]) -> Value {
    let Record {
        settings,
        grid,
        check,
        ..
    } = record;
    let resolved = &settings["resolved"];
    let former = resolved["former"]
        .as_str()
        .or(settings["algorithm"].as_str());
    files.extend(products.iter().flat_map(|product| product.files.clone()));
    // A requested check has more pixels than the comparison of every image.
    let measured = match check {
        Some(check) => json!(check.relative_to_image_db),
        None => resolved["sampled_error_db"].clone(),
    };
    json!({
        "former": former,
        "grid": {
            "kind": if grid.polar { "polar" } else { "cartesian" },
            "columns": grid.columns.count,
            "rows": grid.rows.count,
        },
        "predicted_error_db": resolved["predicted_error_db"],
        "measured_error_db": measured,
        "run_time_s": messages::run_time_s(),
        "files": files,
    })
}

/// Report the output in a few lines.
fn report(
    session: &Session,
    typed: &Focus,
    record: &Record,
    products: &[Written],
) -> anyhow::Result<()> {
    if !session.prints_text() {
        return Ok(());
    }
    text::say(format!(
        "{}: {} x {} pixels in {}",
        typed.out.display(),
        record.grid.columns.count,
        record.grid.rows.count,
        text::duration(record.taken)
    ))?;
    text::say(match record.peak {
        Some(peak) => {
            let [x, y, z] = peak.position_m;
            let level_db = peak.level_db;
            format!(
                "brightest point at x {x:.3} m, y {y:.3} m, z {z:.3} m: {}",
                text::decibels(level_db)
            )
        }
        None => "no brightest point: the image is zero".to_owned(),
    })?;
    for product in products {
        text::say(product.files[0].path.display().to_string())?;
    }
    Ok(())
}

/// Read an auxiliary file for its checksum in the record.
pub(crate) fn auxiliary_file(path: &Path) -> anyhow::Result<InputFile> {
    let named = || format!("cannot read {}", path.display());
    let mut file = open_file(path).with_context(named)?;
    let (bytes, crc32) = checksum(&mut file).with_context(named)?;
    Ok(InputFile::with_crc32(path, bytes, crc32))
}
