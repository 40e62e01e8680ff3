//! `subap view`: show images in a browser on this computer.

mod browser;
mod maps;
mod sources;

use std::net::{Ipv4Addr, SocketAddr};
use std::sync::Arc;
use std::thread;
use std::time::Duration;

use anyhow::{Context, bail};
use serde_json::json;
use subaperture::io::{geojson, track_csv};
use subaperture::viewer::Server;
use subaperture::viewer::product::{Bounds, Gallery, Layer, MAX_STATE_BYTES};

use crate::args::View;
use crate::config::Session;
use crate::{interrupt, messages, text};

use browser::Browser;

/// Maximum memory of a request during computation, bytes.
const COMPUTING_BYTES: u64 = 32 << 20;
/// Memory of the coarse overview of each image, bytes.
const GLANCE_BYTES: u64 = 2 << 20;
/// Memory of the server's threads (connections, overviews, state) and their allocator arenas, bytes.
const SERVER_BYTES: u64 = 2 << 20;
/// Memory of connections with their read buffers, bytes.
const CONNECTIONS_BYTES: u64 = 2 << 20;
/// Maximum memory of answers being sent, bytes.
const MAX_ANSWERS_BYTES: u64 = 16 << 20;
/// Memory of making a range-Doppler map for which there is always room, bytes.
const SMALL_MAP_BYTES: u64 = 4 << 20;
/// Minimum memory for overviews, bytes.
const MIN_OVERVIEW_BYTES: u64 = 1 << 20;

/// Polling interval of the termination signal.
const EVERY: Duration = Duration::from_millis(50);

/// Serve the page until a termination signal.
pub(crate) fn run(session: &Session, typed: &View) -> anyhow::Result<()> {
    let mut products = Vec::with_capacity(typed.images.len());
    for path in &typed.images {
        products.push(sources::open(session, path)?);
    }
    let mut layers = Vec::with_capacity(typed.layer.len());
    for path in &typed.layer {
        layers.push(layer(
            path,
            session.memory_bytes / 4 / typed.layer.len() as u64,
        )?);
    }
    let mut doppler = Vec::with_capacity(typed.maps.len());
    let (mut held_bytes, mut map_bytes) = (0, 0);
    for path in &typed.maps {
        let opened = maps::open(session, path, typed.sub_cpi)?;
        held_bytes += opened.held_bytes;
        map_bytes = opened.map_bytes.max(map_bytes);
        doppler.push(opened.maps);
    }
    let bounds = bounds(session, products.len() as u64, held_bytes, map_bytes)?;
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
            "--listen {address}: everyone who can reach this address and knows the full URL can see the images, and the connection is not encrypted, \
             so that the access key can be read; leave --listen out to show them on this machine only"
        ));
    }
    match session.json() {
        true => text::say_json("view", json!({ "url": server.url() }))?,
        false => text::say(server.url())?,
    }
    messages::note(
        "open this URL in a browser and keep it private: its last part is the access key; Ctrl-C stops the server",
    );
    let mut browser = typed.open.then(|| Browser::open(&server.url())).flatten();
    while !interrupt::pressed() {
        if browser.as_mut().is_some_and(Browser::has_ended) {
            browser = None;
        }
        thread::sleep(EVERY);
    }
    Ok(())
}

/// Division of the memory between requests, answers and overviews, in addition to the `held_bytes` of range-Doppler maps' sources. Making one map
/// takes `map_bytes`.
fn bounds(
    session: &Session,
    images: u64,
    held_bytes: u64,
    map_bytes: u64,
) -> anyhow::Result<Bounds> {
    // The share of pictures is for levels, which are those of a picture.
    let all = session.memory_bytes + session.memory.picture_bytes;
    let taken_bytes = (GLANCE_BYTES + MAX_STATE_BYTES) * images + CONNECTIONS_BYTES + SERVER_BYTES;
    let rest = all.saturating_sub(taken_bytes.saturating_add(held_bytes));
    if rest < MIN_OVERVIEW_BYTES {
        let least_bytes = session.memory.total_bytes + MIN_OVERVIEW_BYTES - rest
            + taken_bytes.saturating_add(held_bytes).saturating_sub(all);
        bail!(
            "expected at least {} of memory for the page and {images} images, found {}: raise --memory, or show fewer images",
            text::bytes(least_bytes.into()),
            text::bytes(session.memory.total_bytes.into())
        );
    }
    if map_bytes > (rest / 2).max(SMALL_MAP_BYTES) {
        bail!(
            "--maps: a range-Doppler map of {} and recordings of {} were expected to fit into {} of memory: use a shorter --sub-cpi, or raise \
             --memory",
            text::bytes(map_bytes.into()),
            text::bytes(held_bytes.into()),
            text::bytes(all.into())
        );
    }
    // As much as `focus` draws with, for the same levels as its picture.
    let picture_bytes = Some(session.memory.picture_bytes).filter(|bytes| *bytes <= rest / 4);
    let rest = rest - picture_bytes.unwrap_or(0);
    let answer_bytes = (rest / 8).min(MAX_ANSWERS_BYTES);
    let most_bytes = COMPUTING_BYTES.max(map_bytes);
    let computing = (rest / 2 / most_bytes).clamp(1, session.threads as u64);
    let request_bytes = (rest / 2 / computing).min(most_bytes);
    let left = rest.saturating_sub(computing * request_bytes + answer_bytes);
    Ok(Bounds {
        overview_bytes: left.max(MIN_OVERVIEW_BYTES),
        computing: computing as usize,
        request_bytes,
        picture_bytes,
        answer_bytes,
    })
}

/// Read a layer by the file's extension: a track, or GeoJSON.
fn layer(path: &std::path::Path, memory_bytes: u64) -> anyhow::Result<Layer> {
    let name = path.file_name().unwrap_or(path.as_os_str());
    let name = name.to_string_lossy().into_owned();
    if path
        .extension()
        .is_some_and(|ending| ending.eq_ignore_ascii_case("csv"))
    {
        let fixes = track_csv::read(path)?;
        let positions_m: Vec<_> = fixes.iter().map(|fix| fix.position_m).collect();
        return Ok(Layer::of_track(name, &positions_m));
    }
    let features = geojson::read(path, memory_bytes)?;
    Layer::of_features(name, features)
        .map_err(anyhow::Error::msg)
        .with_context(|| path.display().to_string())
}
