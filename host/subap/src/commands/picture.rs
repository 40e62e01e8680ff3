//! `subap picture`: an image's picture again, with other levels or colours, and nothing formed again.

use std::io::Write;

use anyhow::bail;
use glam::DVec3;
use serde_json::{Value, json};
use subaperture::io::atomic::write_atomically;
use subaperture::io::ours::Kind;
use subaperture::io::product;
use subaperture::plot::{self, Orientation, Panel, Source};

use super::stored;
use crate::args::Picture;
use crate::config::Session;
use crate::text;

/// Reads a product and writes its picture.
pub(crate) fn run(session: &Session, typed: &Picture) -> anyhow::Result<()> {
    let Some(folder) = stored::product_folder(&typed.image) else {
        bail!(
            "{}: no image: give the folder of a product (with image.json and image.npy)",
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
    if session.json() {
        let path = typed.out.display().to_string();
        return text::say_json("picture", json!({ "path": path }));
    }
    if session.tells() {
        text::say(typed.out.display().to_string())?;
    }
    Ok(())
}

/// A unit vector of the record.
fn direction(value: &Value) -> Option<DVec3> {
    let number = |i: usize| value[i].as_f64();
    DVec3::new(number(0)?, number(1)?, number(2)?).try_normalize()
}
