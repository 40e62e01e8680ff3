//! An image as SICD.

use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

use serde_json::json;
use subaperture::io::ours::Kind;
use subaperture::io::product;
use subaperture::sicd::{Formed, Placing, Sicd, SicdError};

use crate::args::Export;
use crate::config::Session;
use crate::failure::Usage;
use crate::{interrupt, messages, text};

/// Reads a product and writes it.
pub(super) fn run(session: &Session, typed: &Export, folder: &Path) -> anyhow::Result<()> {
    if typed.maps.is_given() {
        let what = "--projection, --pixel, --looks, --layout, --remap, --top and --span are of maps, and --format sicd has the image's own pixels: leave them out";
        return Err(Usage(what.to_owned()).into());
    }
    let mut claims = session.claims(&typed.writing, &[folder]);
    claims.file(&typed.out, Kind::Sicd)?;
    let stored = product::open(folder)?;
    let sicd = Formed::of_record(&stored.grid, &stored.metadata)
        .and_then(|formed| Sicd::new(&formed, &placing(typed), now_ns()))
        .map_err(with_advice)?;
    for sentence in sicd.told() {
        messages::warning(sentence);
    }
    let writing = session.progress("writing");
    let wrote = sicd.write(&typed.out, &stored.pixels, &writing);
    interrupt::check()?;
    wrote.map_err(with_advice)?;
    writing.finish();
    let path = typed.out.display().to_string();
    if session.json() {
        return text::say_json("export", json!({ "path": path, "bytes": sicd.bytes() }));
    }
    if session.tells() {
        text::say(path)?;
    }
    Ok(())
}

/// Where and when what the recording does not say is taken to be.
pub(super) fn placing(typed: &Export) -> Placing {
    Placing {
        origin: typed.place,
        speed_m_s: typed.speed.unwrap_or(Placing::default().speed_m_s),
        ..Placing::default()
    }
}

/// Now, nanoseconds since the beginning of 1970: they last until 2262; an impossible clock is 1970.
pub(super) fn now_ns() -> i64 {
    let now = SystemTime::now().duration_since(UNIX_EPOCH);
    now.map_or(0, |since| i64::try_from(since.as_nanos()).unwrap_or(0))
}

/// `error`, with what the command line can do about it.
pub(super) fn with_advice(error: SicdError) -> anyhow::Error {
    match error {
        SicdError::Nowhere => anyhow::anyhow!("{error}: say where by --place LAT,LON[,HEIGHT]"),
        error => error.into(),
    }
}
