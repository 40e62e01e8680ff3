//! Export of an image as SIDD.

use subaperture::maps::Levels;
use subaperture::sicd::{Formed, Greys, Sidd};

use super::one::{One, Written, recorded, whole};
use super::sicd::{now_ns, placing, with_advice};
use crate::args::RemapName;
use crate::config::Session;
use crate::failure::Usage;
use crate::{interrupt, messages};

/// Refuse options that apply to maps, except those of grey levels.
pub(super) fn check(one: &One) -> Result<(), Usage> {
    let maps = &one.maps;
    if maps.projection.is_some()
        || maps.pixel.is_some()
        || maps.looks.is_some()
        || maps.layout.is_some()
    {
        let fault = "--projection, --pixel, --looks and --layout apply to maps; --format sidd keeps the image's own pixels: leave them out";
        return Err(Usage(fault.to_owned()));
    }
    Ok(())
}

/// Read a product and write it as SIDD.
pub(super) fn write(session: &Session, one: &One) -> anyhow::Result<Written> {
    let maps = &one.maps;
    let image = whole(session, one.folder)?;
    let (grid, record) = recorded(one, &image)?;
    // Default remap of exploitation tools for a complex image.
    let remap = maps.remap.unwrap_or(RemapName::Density);
    let levels = Levels::of(&image.pixels, remap.into(), maps.top, maps.span)?;
    let greys = Greys {
        name: match remap {
            RemapName::Density => "Density",
            RemapName::Db => "Decibels",
        },
        levels_db: [levels.bottom_db, levels.top_db],
        of: &|power| levels.grey(power),
    };
    let sidd = Formed::of_record(&grid, &record)
        .and_then(|formed| Sidd::new(&formed, &placing(one), &greys, now_ns()))
        .map_err(with_advice)?;
    for sentence in sidd.assumptions() {
        messages::warning(sentence);
    }
    let writing = session.progress("writing");
    let wrote = sidd.write(one.out, &image.pixels, &greys, &writing);
    interrupt::check()?;
    wrote.map_err(with_advice)?;
    writing.finish();
    Ok(Written::file(one, sidd.bytes()))
}
