//! `subap picture`: an image's picture again, with other levels or colours, and nothing formed again.

use std::io::Write;
use std::path::Path;

use anyhow::bail;
use glam::DVec3;
use serde_json::{Value, json};
use subaperture::geometry::{Axis, ImageGrid};
use subaperture::image::{Image, Parts, PartsError, Place};
use subaperture::io::atomic::write_atomically;
use subaperture::io::ours::Kind;
use subaperture::io::product;
use subaperture::plot::{self, Colours, Orientation, Panel, Scale, ShownAxis, Source};
use subaperture::sicd::SicdFile;

use super::stored;
use crate::args::Picture;
use crate::config::Session;
use crate::text;

/// Reads a product and writes its picture.
pub(crate) fn run(session: &Session, typed: &Picture) -> anyhow::Result<()> {
    if stored::is_nitf(&typed.image) {
        let (scale, colours) = (typed.look.scale(), typed.look.colours());
        let mut claims = session.claims(&typed.writing, &[&typed.image]);
        claims.file(&typed.out, Kind::Picture)?;
        of_sicd(session, &typed.image, &typed.out, scale, colours)?;
        return say(session, &typed.out);
    }
    let Some(folder) = stored::product_folder(&typed.image) else {
        bail!(
            "{}: no image: give the folder of a product (with image.json and image.npy), or a SICD",
            typed.image.display()
        );
    };
    let mut claims = session.claims(&typed.writing, &[folder]);
    claims.file(&typed.out, Kind::Picture)?;
    let drawing = session.progress("drawing");
    let stored = product::open(folder)?;
    let about = &stored.metadata["picture"];
    let name = typed.image.display().to_string();
    let title = about["title"].as_str().unwrap_or(&name);
    let picture = plot::quicklook_within(
        &Panel {
            scale: typed.look.scale(),
            colours: typed.look.colours(),
            orientation: Orientation {
                look: direction(&about["look"]),
                north: direction(&about["north"]),
            },
            ..Panel::new(Source::Parts(&stored.pixels), &stored.grid, title)
        },
        session.memory.picture_bytes,
    )?;
    let bytes = picture.len() as u64;
    write_atomically(&typed.out, bytes, |file| file.write_all(&picture))?;
    drawing.finish();
    say(session, &typed.out)
}

fn say(session: &Session, out: &Path) -> anyhow::Result<()> {
    let path = out.display().to_string();
    if session.json() {
        return text::say_json("picture", json!({ "path": path }));
    }
    if session.tells() {
        text::say(path)?;
    }
    Ok(())
}

/// Writes the picture of anyone's SICD, in its own pixels, the first row on top as such files are looked at.
fn of_sicd(
    session: &Session,
    image: &Path,
    out: &Path,
    scale: Scale,
    colours: Colours,
) -> anyhow::Result<()> {
    let drawing = session.progress("drawing");
    let file = SicdFile::open(image)?;
    let (rows, columns) = file.size();
    let (grid, unit) = match file.plane() {
        Some(plane) => (plane.grid, "m"),
        None => {
            let pixels = |count| Axis {
                start: 0.0,
                step: 1.0,
                count,
            };
            let grid = ImageGrid::horizontal(pixels(columns), pixels(rows), 0.0);
            (grid, "pixels")
        }
    };
    let turned = ImageGrid {
        rows: Axis {
            start: -grid.rows.at(rows - 1),
            ..grid.rows
        },
        ..grid
    };
    let down = RowsDown(&file);
    let picture = plot::quicklook_within(
        &Panel {
            scale,
            colours,
            axes: [
                ShownAxis::plain(format!("along rows ({unit})")),
                ShownAxis {
                    scale: -1.0,
                    ..ShownAxis::plain(format!("along columns ({unit})"))
                },
            ],
            reference: "0 dB: magnitude 1",
            ..Panel::new(Source::Parts(&down), &turned, image.display().to_string())
        },
        session.memory.picture_bytes,
    )?;
    let bytes = picture.len() as u64;
    write_atomically(out, bytes, |file| file.write_all(&picture))?;
    drawing.finish();
    Ok(())
}

/// An image, its last row first.
#[derive(Debug)]
struct RowsDown<'a>(&'a dyn Parts);

impl RowsDown<'_> {
    /// The same rows, counted from the other end.
    fn turned(&self, [rows, columns]: &Place) -> Place {
        let count = self.0.size().0;
        [count - rows.end..count - rows.start, columns.clone()]
    }
}

impl Parts for RowsDown<'_> {
    fn size(&self) -> (usize, usize) {
        self.0.size()
    }

    fn places(&self) -> Vec<Place> {
        let places = self.0.places();
        places.iter().map(|place| self.turned(place)).collect()
    }

    fn window(&self, place: &Place) -> Result<Image, PartsError> {
        let image = self.0.window(&self.turned(place))?;
        let rows = image.pixels.chunks_exact(image.columns).rev();
        Ok(Image {
            pixels: rows.flatten().copied().collect(),
            ..image
        })
    }
}

/// A unit vector of the record.
fn direction(value: &Value) -> Option<DVec3> {
    let number = |i: usize| value[i].as_f64();
    DVec3::new(number(0)?, number(1)?, number(2)?).try_normalize()
}
