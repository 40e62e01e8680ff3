//! Writing of a complete image with its record and picture, and the summary printed for it.

use std::path::Path;

use serde_json::{Value, json};
use subaperture::image::{Image, ImageSource};
use subaperture::io::product::{self, CompleteProduct, Product, TiledProduct};
use subaperture::io::tiles::{self, TileStore};
use subaperture::io::written::WrittenFile;
use subaperture::plot::{self, Panel, Source};

use super::record::Record;
use crate::args::Focus;
use crate::commands::export::Written;
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

/// Write the output folder and report it.
pub(super) fn deliver(
    session: &Session,
    typed: &Focus,
    image: Whole,
    record: &Record,
    title: &str,
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
    let files = if let Whole::Memory(image) = &image {
        product::write_drawing::<anyhow::Error>(out, image, || record.to_json(title), draw)?
    } else {
        let quicklook = &draw()?;
        image.write_metadata(out, record.to_json(title), quicklook)?
    };
    writing.finish();
    let products = super::products(typed).write(session)?;
    if session.json() {
        return text::say_json("focus", summary(record, files, &products));
    }
    report(session, typed, record, &products)
}

/// The result as JSON. All settings and figures are in the record, which is among its files.
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
            "columns": { "count": grid.columns.count, "step": grid.columns.step },
            "rows": { "count": grid.rows.count, "step": grid.rows.step },
        },
        "predicted_error_db": resolved["predicted_error_db"],
        "measured_error_db": measured,
        "times_s": messages::times(),
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
