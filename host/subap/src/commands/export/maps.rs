//! An image on the map: GeoTIFF, KMZ, a picture with a world file.

use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use anyhow::{Context, bail};
use serde_json::{Value, json};
use subaperture::geometry::SceneFrame;
use subaperture::io::ours::Kind;
use subaperture::io::product::{self, OpenProduct};
use subaperture::maps::{self, Levels, MapError, Ortho, Projection, Raster, Source, cog::Layout};
use subaperture::resolution::support::{Looks, RecordedLooks};
use subaperture::signal::window::Window;

use crate::args::{Export, MapLayout, MapProjection, RemapName};
use crate::config::Session;
use crate::failure::Usage;
use crate::{log, messages, text};

/// Formats of maps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MapFormat {
    /// Cloud-optimised GeoTIFF.
    Cog,
    /// Google Earth's.
    Kmz,
    /// A picture with a world file.
    Png,
}

/// What was typed, once it makes sense together.
struct Wanted<'a> {
    typed: &'a Export,
    folder: &'a Path,
    format: MapFormat,
    layout: MapLayout,
    projection: MapProjection,
    remap: RemapName,
}

/// Reads a product and writes its map.
pub(super) fn run(
    session: &Session,
    typed: &Export,
    format: MapFormat,
    folder: &Path,
) -> anyhow::Result<()> {
    let wanted = Wanted::of(typed, format, folder)?;
    let beside = wanted.beside();
    let mut claims = session.claims(&typed.writing, &[folder]);
    let kind = match wanted.format {
        MapFormat::Png => Kind::Picture,
        _ => Kind::Map,
    };
    // Files beside a picture of ours are its own, though they have no room for a mark.
    let replaced = typed.out.exists();
    claims.file(&typed.out, kind)?;
    for path in &beside {
        if wanted.format == MapFormat::Cog {
            claims.file(path, Kind::Item)?;
            continue;
        }
        if path.exists() && !replaced && !typed.writing.force {
            bail!(
                "{}: it lies where a file beside {} is to be: move it, or give --force",
                path.display(),
                typed.out.display()
            );
        }
        claims.unmarked(path)?;
    }
    let stored = product::open(folder)?;
    let frame = frame(typed, &stored)?;
    let looks = looks(&stored.metadata).ok_or(MapError::Unseen)?;
    let source = Source {
        pixels: &stored.pixels,
        grid: &stored.grid,
        frame: &frame,
        looks: &looks,
    };
    let covering = |pixel_m| {
        let projection = |centre: &_| match wanted.projection {
            MapProjection::Utm => Projection::utm(centre),
            MapProjection::Geographic => Ok(Projection::geographic(centre)),
        };
        Raster::covering(&stored.grid, &frame, projection, pixel_m)
    };
    let mut raster = covering(typed.maps.pixel)?;
    if let Some(looks) = typed.maps.looks {
        raster = covering(Some(raster.pixel_m * looks as f64))?;
    }
    let ortho = Ortho::new(source, raster)?;
    if ortho.error_db() > WORTH_SAYING_DB {
        messages::warning(format!(
            "reading the image between its pixels leaves an error of {:.0} dB, for they are only {:.2} and {:.2} times as fine as its \
             band needs: form it on a finer grid for less",
            ortho.error_db(),
            ortho.oversampling()[0],
            ortho.oversampling()[1]
        ));
    }
    wanted.write(session, &stored.metadata, &ortho)?;
    wanted.say(session, &ortho, &beside)
}

/// Errors above this are worth a warning.
const WORTH_SAYING_DB: f64 = -40.0;

impl<'a> Wanted<'a> {
    fn of(typed: &'a Export, format: MapFormat, folder: &'a Path) -> Result<Self, Usage> {
        let maps = &typed.maps;
        let is_map = format == MapFormat::Cog;
        let wrong = |what: &str| Err(Usage(what.to_owned()));
        if typed.speed.is_some() {
            return wrong("--speed is of --format sicd: leave it out");
        }
        if maps.layout.is_some() && !is_map {
            return wrong("--layout is of --format cog: leave it out");
        }
        let layout = maps.layout.unwrap_or_default();
        let greys = maps.remap.is_some() || maps.top.is_some() || maps.span.is_some();
        if greys && layout != MapLayout::Db {
            return wrong(
                "--remap, --top and --span are of greys, and --layout amplitude and complex have none: leave them out",
            );
        }
        if layout == MapLayout::Complex && maps.looks.is_some_and(|looks| looks > 1) {
            return wrong(
                "--looks averages power, of which --layout complex has none: leave it out",
            );
        }
        let projection = match (format, maps.projection) {
            (MapFormat::Kmz, Some(MapProjection::Utm)) => {
                return wrong("--format kmz is in longitude and latitude: leave --projection out");
            }
            (MapFormat::Kmz, None) => MapProjection::Geographic,
            (_, given) => given.unwrap_or(MapProjection::Utm),
        };
        Ok(Self {
            typed,
            folder,
            format,
            layout,
            projection,
            remap: maps.remap.unwrap_or(match is_map {
                true => RemapName::Db,
                false => RemapName::Density,
            }),
        })
    }

    /// The files beside the map.
    fn beside(&self) -> Vec<PathBuf> {
        let out = &self.typed.out;
        match self.format {
            MapFormat::Cog => vec![out.with_extension("json")],
            MapFormat::Png => maps::picture::beside(out).into(),
            MapFormat::Kmz => Vec::new(),
        }
    }

    fn write(&self, session: &Session, metadata: &Value, ortho: &Ortho) -> anyhow::Result<()> {
        let typed = self.typed;
        let out = &typed.out;
        let levels = || {
            let reading = session.progress("reading levels");
            let levels = Levels::of(
                ortho.pixels(),
                self.remap.into(),
                typed.maps.top,
                typed.maps.span,
            )?;
            reading.finish();
            Ok::<_, MapError>(levels)
        };
        let title = match metadata["picture"]["title"].as_str() {
            Some(title) => title.to_owned(),
            None => typed.image.display().to_string(),
        };
        match self.format {
            MapFormat::Kmz => {
                let levels = levels()?;
                let progress = session.progress("writing");
                maps::kmz::write(out, ortho, levels, &title, &progress)?;
                progress.finish();
            }
            MapFormat::Png => {
                let levels = levels()?;
                let progress = session.progress("writing");
                maps::picture::write(out, ortho, levels, &progress)?;
                progress.finish();
            }
            MapFormat::Cog => {
                let layout = match self.layout {
                    MapLayout::Db => Layout::Decibels(levels()?),
                    MapLayout::Amplitude => Layout::Amplitude,
                    MapLayout::Complex => Layout::Complex,
                };
                let progress = session.progress("writing");
                maps::cog::write(out, ortho, layout, &title, &progress)?;
                progress.finish();
                let id = out.file_stem().unwrap_or_default().to_string_lossy();
                let (datetime, meaning) = self.datetime(metadata)?;
                let about = maps::stac::About {
                    id: &id,
                    datetime: &datetime,
                    properties: json!({ "title": title, "subaperture:datetime": meaning }),
                };
                maps::stac::write(&out.with_extension("json"), out, ortho, layout, &about)?;
            }
        }
        Ok(())
    }

    /// When the recording began, or when the image was formed; and which of them.
    fn datetime(&self, metadata: &Value) -> anyhow::Result<(String, &'static str)> {
        if let Some(start_ns) = metadata["antennas"]["start_ns"].as_i64() {
            let from_1970 = Duration::from_nanos(start_ns.unsigned_abs());
            let start = match start_ns < 0 {
                true => SystemTime::UNIX_EPOCH - from_1970,
                false => SystemTime::UNIX_EPOCH + from_1970,
            };
            return Ok((log::utc(start), "when the recording began"));
        }
        // The record is written last.
        let record = std::fs::metadata(self.folder.join("image.json"));
        let formed = record.and_then(|about| about.modified());
        let formed = formed.context("cannot tell when the image was formed")?;
        let meaning = "when the image was formed: its record does not say when it was recorded";
        Ok((log::utc(formed), meaning))
    }

    fn say(&self, session: &Session, ortho: &Ortho, beside: &[PathBuf]) -> anyhow::Result<()> {
        let path = |path: &Path| path.display().to_string();
        let raster = ortho.raster();
        if session.json() {
            return text::say_json(
                "map",
                json!({
                    "path": path(&self.typed.out),
                    "beside": beside.iter().map(|p| path(p)).collect::<Vec<_>>(),
                    "epsg": raster.projection.epsg(),
                    "rows": raster.rows,
                    "columns": raster.columns,
                    "pixel_m": raster.pixel_m,
                    "pixels_averaged": ortho.averaged(),
                    "oversampling": ortho.oversampling(),
                    "resampling_error_db": ortho.error_db(),
                }),
            );
        }
        if session.tells() {
            text::say(format!(
                "{}: {} x {} pixels of {}, EPSG:{}",
                path(&self.typed.out),
                raster.rows,
                raster.columns,
                subaperture::quantity::metres(raster.pixel_m),
                raster.projection.epsg()
            ))?;
        }
        Ok(())
    }
}

/// Where the scene is.
fn frame(typed: &Export, stored: &OpenProduct) -> anyhow::Result<SceneFrame> {
    if let Some(origin) = &typed.place {
        return Ok(SceneFrame::east_north_up(origin));
    }
    let image = typed.image.display();
    match product::frame_of(&stored.metadata) {
        Ok(SceneFrame::Local) => bail!(
            "{image}: its recording ties it to no place on the Earth: give --place LAT,LON[,HEIGHT] of the scene's origin"
        ),
        Ok(frame) => Ok(frame),
        Err(what) => bail!("{image}: {what}: give --place LAT,LON[,HEIGHT], or form it again"),
    }
}

/// From where the image was seen, under its windows.
fn looks(metadata: &Value) -> Option<Looks> {
    let recorded: RecordedLooks = serde_json::from_value(metadata["support"].clone()).ok()?;
    let window = |key: &str| -> Option<Window> { metadata["settings"][key].as_str()?.parse().ok() };
    recorded.looks(
        window("window").unwrap_or_default(),
        window("slow_window").unwrap_or_default(),
    )
}
