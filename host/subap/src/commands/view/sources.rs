//! Images to view, opened without reading their pixels, except for samples of a SICD for its mean frequency.

use std::path::Path;

use glam::DVec3;
use serde::Deserialize;
use subaperture::geometry::SceneFrame;
use subaperture::images::{OpenImage, Pixels as Stored};
use subaperture::io::container::{self, Element};
use subaperture::io::product as stored_product;
use subaperture::io::xml::DEFAULT_MEMORY_BYTES;
use subaperture::quality::response::{Carrier, Geometry};
use subaperture::sicd::SicdFile;
use subaperture::viewer::product::{Pixels, Product};

use crate::commands::stored;
use crate::config::Session;

/// Open the image at a path. The CRC-32 of a product's file is verified while the image is shown.
pub(super) fn open(session: &Session, path: &Path) -> anyhow::Result<Product> {
    let image = stored::open_unread(session, path)?;
    let name = path.display().to_string();
    let looks = image.looks();
    let aperture = stored::aperture(&image)?;
    let rows_down = image.rows_down();
    let grid = image.grid().map(|(grid, frame)| (grid.clone(), frame));
    let folder = image.folder().map(Path::to_owned);
    let OpenImage { pixels, record, .. } = image;
    let antenna_m = match &pixels {
        Stored::Sicd(file) => sicd_antenna_m(file, grid.as_ref().and_then(|(_, frame)| *frame)),
        _ => record.as_ref().and_then(|record| {
            let seen = Geometry::deserialize(&record["collection"]).ok()?;
            Some(Carrier::of(&seen).antenna_m)
        }),
    };
    let whole = |parts| Pixels::whole(parts);
    let is_product = matches!(pixels, Stored::Product(_));
    let pixels = match pixels {
        Stored::Product(pixels) => pixels.into(),
        Stored::Unfinished(tiles) => Pixels::tiles(tiles.into_store()),
        other => whole(Box::new(other)),
    };
    let mut shown = Product::new(name, pixels);
    shown.rows_down = rows_down;
    shown.aperture = aperture;
    if let Some((grid, frame)) = grid {
        shown.grid = Some(grid);
        // Records of other kinds may contain no frame: then none is shown.
        shown.frame = frame.unwrap_or(SceneFrame::Local);
        shown.slant = rows_down;
    }
    shown.antenna_m = antenna_m;
    let (Some(folder), Some(record), true) = (folder, record, is_product) else {
        return Ok(shown);
    };
    shown.looks = looks;
    let seen = Geometry::deserialize(&record["collection"]).ok();
    shown.carrier = seen.as_ref().map(Carrier::of);
    shown.check = Some(Box::new(move || {
        stored_product::verify(&folder, &record).map_err(|error| error.to_string())
    }));
    Ok(shown)
}

/// Antenna position of a SICD at the aperture's centre (`SCPCOA/ARPPos`), in a scene frame.
fn sicd_antenna_m(file: &SicdFile, frame: Option<SceneFrame>) -> Option<DVec3> {
    let document = container::parse(file.xml(), DEFAULT_MEMORY_BYTES).ok()?;
    let position = Element::root(&document).find(&["SCPCOA", "ARPPos"])?;
    Some(frame?.from_ecf_m(position.xyz().ok()?))
}
