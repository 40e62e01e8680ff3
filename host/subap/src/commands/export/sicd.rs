//! Export of an image as SICD.

use std::time::{SystemTime, UNIX_EPOCH};

use subaperture::io::claim::OutputClaims;
use subaperture::io::ours::Kind;
use subaperture::sicd::{Formed, Georeference, Sicd, SicdError, SicdOptions};

use super::one::{One, Written, recorded, whole};
use crate::config::Session;
use crate::failure::Usage;
use crate::{interrupt, messages};

/// Refuse options that apply to maps.
pub(super) fn check(one: &One) -> Result<(), Usage> {
    match one.maps.is_given() {
        true => Err(Usage(
            "--projection, --pixel, --looks, --layout, --remap, --top and --span apply to maps; --format sicd keeps the image's own pixels: leave them out".to_owned(),
        )),
        false => Ok(()),
    }
}

/// Claim the path of the output file.
pub(super) fn claim(one: &One, claims: &mut OutputClaims) -> anyhow::Result<()> {
    Ok(claims.file(one.out, Kind::Sicd)?)
}

/// Read a product and write it as SICD.
pub(super) fn write(session: &Session, one: &One) -> anyhow::Result<Written> {
    let image = whole(session, one.folder)?;
    let (grid, record) = recorded(one, &image)?;
    let options = SicdOptions {
        version: one.sicd_version,
        ..SicdOptions::default()
    };
    let sicd = Formed::of_record(&grid, &record)
        .and_then(|formed| Sicd::with_options(&formed, &placing(one), now_ns(), &options))
        .map_err(with_advice)?;
    for sentence in sicd.assumptions() {
        messages::warning(sentence);
    }
    let writing = session.progress("writing");
    let wrote = sicd.write(one.out, &image.pixels, &writing);
    interrupt::check()?;
    wrote.map_err(with_advice)?;
    writing.finish();
    Ok(Written::file(one, sicd.bytes()))
}

/// Position and time to assume where the recording does not state them.
pub(super) fn placing(one: &One) -> Georeference {
    Georeference {
        origin: one.place,
        speed_m_s: one.speed_m_s.unwrap_or(Georeference::default().speed_m_s),
        ..Georeference::default()
    }
}

/// Current time, nanoseconds since 1970; 0 if the clock is out of range.
pub(super) fn now_ns() -> i64 {
    let now = SystemTime::now().duration_since(UNIX_EPOCH);
    now.map_or(0, |since| i64::try_from(since.as_nanos()).unwrap_or(0))
}

/// Add advice on options to an error.
pub(super) fn with_advice(error: SicdError) -> anyhow::Error {
    match error {
        SicdError::Nowhere => anyhow::anyhow!("{error} with --place LAT,LON[,HEIGHT]"),
        error => error.into(),
    }
}
