//! An image as SIDD.

use std::path::Path;

use serde_json::json;
use subaperture::io::ours::Kind;
use subaperture::io::product;
use subaperture::maps::Levels;
use subaperture::sicd::{Formed, Greys, Sidd};

use super::sicd::{now_ns, placing, with_advice};
use crate::args::{Export, RemapName};
use crate::config::Session;
use crate::failure::Usage;
use crate::{interrupt, messages, text};

/// Reads a product and writes it.
pub(super) fn run(session: &Session, typed: &Export, folder: &Path) -> anyhow::Result<()> {
    let maps = &typed.maps;
    if maps.projection.is_some()
        || maps.pixel.is_some()
        || maps.looks.is_some()
        || maps.layout.is_some()
    {
        let what = "--projection, --pixel, --looks and --layout are of maps, and --format sidd has the image's own pixels: leave them out";
        return Err(Usage(what.to_owned()).into());
    }
    let mut claims = session.claims(&typed.writing, &[folder]);
    claims.file(&typed.out, Kind::Sicd)?;
    let stored = product::open(folder)?;
    // What exploitation tools make of a complex image.
    let remap = maps.remap.unwrap_or(RemapName::Density);
    let levels = Levels::of(&stored.pixels, remap.into(), maps.top, maps.span)?;
    let greys = Greys {
        name: match remap {
            RemapName::Density => "Density",
            RemapName::Db => "Decibels",
        },
        levels_db: [levels.bottom_db, levels.top_db],
        of: &|power| levels.grey(power),
    };
    let sidd = Formed::of_record(&stored.grid, &stored.metadata)
        .and_then(|formed| Sidd::new(&formed, &placing(typed), &greys, now_ns()))
        .map_err(with_advice)?;
    for sentence in sidd.told() {
        messages::warning(sentence);
    }
    let writing = session.progress("writing");
    let wrote = sidd.write(&typed.out, &stored.pixels, &greys, &writing);
    interrupt::check()?;
    wrote.map_err(with_advice)?;
    writing.finish();
    let path = typed.out.display().to_string();
    if session.json() {
        return text::say_json("export", json!({ "path": path, "bytes": sidd.bytes() }));
    }
    if session.tells() {
        text::say(path)?;
    }
    Ok(())
}
