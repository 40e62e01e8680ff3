//! The images that were given, opened without reading their pixels.

use std::path::Path;

use anyhow::bail;
use serde::Deserialize;
use subaperture::focus::Plan;
use subaperture::geometry::{ImageGrid, SceneFrame};
use subaperture::image::Parts;
use subaperture::io::npy::ImageFile;
use subaperture::io::product as stored_product;
use subaperture::io::tiles::TileStore;
use subaperture::quality::response::{Carrier, Geometry};
use subaperture::resolution::support::RecordedLooks;
use subaperture::sicd::SicdFile;
use subaperture::viewer::product::{Aperture, Pixels, Product};

use crate::commands::stored;

/// Opens what a path names.
pub(super) fn open(path: &Path) -> anyhow::Result<Product> {
    let name = path.display().to_string();
    if let Some(folder) = stored::product_folder(path) {
        return match stored::is_velocity_plane(folder) {
            true => array(name, &folder.join("image.npy")),
            false if folder.join("image.json").exists() => product(name, folder),
            false => growing(name, folder),
        };
    }
    if stored::is_nitf(path) {
        let file = SicdFile::open(path)?;
        return Ok(sicd(name, file));
    }
    stored::check_is_array(path)?;
    array(name, path)
}

/// An array alone.
fn array(name: String, path: &Path) -> anyhow::Result<Product> {
    let file = ImageFile::open(path)?;
    if file.size().0 * file.size().1 == 0 {
        bail!("{}: an image without pixels", path.display());
    }
    Ok(Product::new(name, Pixels::whole(Box::new(file))))
}

/// A product that is whole. Its file's CRC-32 is looked at while it is shown.
fn product(name: String, folder: &Path) -> anyhow::Result<Product> {
    let stored = stored_product::open_unread(folder)?;
    let record = &stored.metadata;
    let settings = &record["settings"];
    let window = |key: &str| settings[key].as_str().and_then(|text| text.parse().ok());
    let looks = RecordedLooks::deserialize(&record["support"]).ok();
    let looks = looks
        .zip(window("window").zip(window("slow_window")))
        .and_then(|(looks, (fast, slow))| looks.looks(fast, slow));
    let seen = Geometry::deserialize(&record["collection"]).ok();
    let grid = stored.grid;
    let mut shown = Product::new(name, stored.pixels.into());
    shown.grid = Some(grid.clone());
    // What a record of another kind does not tell is not shown.
    shown.frame = stored_product::frame_of(record).unwrap_or(SceneFrame::Local);
    shown.carrier = seen.as_ref().map(Carrier::of);
    shown.aperture = stored::aperture(record, &grid);
    shown.looks = looks;
    let (folder, record) = (folder.to_owned(), stored.metadata);
    shown.check = Some(Box::new(move || {
        stored_product::verify(&folder, &record).map_err(|error| error.to_string())
    }));
    Ok(shown)
}

/// An image that is being formed in tiles, of which its plan alone tells where they are.
fn growing(name: String, folder: &Path) -> anyhow::Result<Product> {
    let Some(store) = TileStore::open(folder)? else {
        bail!(
            "{name}: no image: a product is a folder with image.json and image.npy, or image.zarr while it is formed in tiles"
        );
    };
    let plan = Plan::from_text(store.plan()).ok();
    let size = store.size();
    let fits = |grid: &ImageGrid| (grid.rows.count, grid.columns.count) == size;
    let mut shown = Product::new(name, Pixels::tiles(store));
    shown.grid = plan.map(|plan| plan.grid).filter(fits);
    Ok(shown)
}

/// Anyone's SICD.
fn sicd(name: String, file: SicdFile) -> Product {
    let plane = file.plane();
    let mut shown = Product::new(name, Pixels::whole(Box::new(file)));
    shown.rows_down = true;
    if let Some(plane) = plane {
        shown.grid = Some(plane.grid);
        shown.frame = plane.frame;
        shown.slant = true;
        shown.aperture = plane.column_band.and_then(Aperture::columns);
    }
    shown
}
