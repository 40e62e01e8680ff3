//! `subap view`: images in a browser of this machine.

mod maps;
mod sources;

use std::net::{Ipv4Addr, SocketAddr};
use std::sync::Arc;
use std::thread;
use std::time::Duration;

use anyhow::Context;
use serde_json::json;
use subaperture::io::{geojson, track_csv};
use subaperture::viewer::Server;
use subaperture::viewer::product::{Bounds, Gallery, Layer};

use crate::args::View;
use crate::config::Session;
use crate::{interrupt, messages, text};

/// What a request takes at the most while it is computed, but for the responses of points with thousands of pixels a width.
const COMPUTING_BYTES: u64 = 32 << 20;
/// Tiles of a store that are kept, for each image.
const KEPT_BYTES: u64 = 48 << 20;
/// Least for overviews.
const LEAST_OVERVIEW_BYTES: u64 = 1 << 20;

/// How often it is looked whether to end.
const EVERY: Duration = Duration::from_millis(50);

/// Serves the page until a signal comes.
pub(crate) fn run(session: &Session, typed: &View) -> anyhow::Result<()> {
    let mut products = Vec::with_capacity(typed.images.len());
    for path in &typed.images {
        products.push(sources::open(path)?);
    }
    let mut layers = Vec::with_capacity(typed.layer.len());
    for path in &typed.layer {
        layers.push(layer(path)?);
    }
    let mut doppler = Vec::with_capacity(typed.maps.len());
    for path in &typed.maps {
        doppler.push(maps::open(session, path, typed.sub_cpi)?);
    }
    let bounds = bounds(session, products.len() as u64);
    session.note(1, || {
        format!(
            "at most {} for overviews, {} requests computed at once",
            text::bytes(bounds.overview_bytes.into()),
            bounds.computing
        )
    });
    let here = SocketAddr::from((Ipv4Addr::LOCALHOST, typed.port.unwrap_or(0)));
    let address = typed.listen.unwrap_or(here);
    let gallery = Arc::new(Gallery::new(products, layers, bounds).with_maps(doppler));
    let server = Server::show(address, gallery)?;
    let address = server.address();
    if !address.ip().is_loopback() {
        messages::warning(format!(
            "--listen {address}: whoever reaches this address can look at the images, and nothing is encrypted; leave --listen out to show them to \
             this machine alone"
        ));
    }
    match session.json() {
        true => text::say_json("view", json!({ "url": server.url() }))?,
        false => text::say(server.url())?,
    }
    messages::note("open this address in a browser; Ctrl-C ends it");
    while !interrupt::pressed() {
        thread::sleep(EVERY);
    }
    Ok(())
}

/// What of the memory is for what.
fn bounds(session: &Session, images: u64) -> Bounds {
    let rest = session.memory_bytes.saturating_sub(KEPT_BYTES * images);
    let computing = (rest / 2 / COMPUTING_BYTES).clamp(1, session.threads as u64);
    let left = rest.saturating_sub(computing * COMPUTING_BYTES);
    Bounds {
        overview_bytes: left.max(LEAST_OVERVIEW_BYTES),
        computing: computing as usize,
    }
}

/// A layer of a file, by its ending: a track, or GeoJSON.
fn layer(path: &std::path::Path) -> anyhow::Result<Layer> {
    let name = path.file_name().unwrap_or(path.as_os_str());
    let name = name.to_string_lossy().into_owned();
    if path
        .extension()
        .is_some_and(|ending| ending.eq_ignore_ascii_case("csv"))
    {
        let fixes = track_csv::read(path)?;
        let way: Vec<_> = fixes.iter().map(|fix| fix.position_m).collect();
        return Ok(Layer::of_track(name, &way));
    }
    let features = geojson::read(path)?;
    Layer::of_features(name, features)
        .map_err(anyhow::Error::msg)
        .with_context(|| path.display().to_string())
}
