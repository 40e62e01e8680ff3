//! An image on the map: GeoTIFF, KMZ, a picture with a world file.

use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use anyhow::{Context, bail};
use serde_json::{Value, json};
use subaperture::geometry::{Geodetic, SceneFrame};
use subaperture::image::ImageSource;
use subaperture::images::{OpenImage, PixelGeometry, Pixels};
use subaperture::io::claim::OutputClaims;
use subaperture::io::ours::Kind;
use subaperture::io::product;
use subaperture::io::together::FileSet;
use subaperture::maps::{self, Levels, MapError, Ortho, Projection, Raster, Source, cog::Layout};
use subaperture::on_map::SicdOnMap;

use super::{One, Written};
use crate::args::{ImageFormat, MapLayout, MapProjection, RemapName};
use crate::config::Session;
use crate::failure::Usage;
use crate::{log, messages};

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

impl MapFormat {
    /// That of a format of images.
    pub(super) fn of(format: ImageFormat) -> Self {
        match format {
            ImageFormat::Cog => Self::Cog,
            ImageFormat::Kmz => Self::Kmz,
            _ => Self::Png,
        }
    }

    /// The files beside a map.
    fn beside(self, out: &Path) -> Vec<PathBuf> {
        match self {
            Self::Cog => vec![out.with_extension("json")],
            Self::Png => maps::picture::beside(out).into(),
            Self::Kmz => Vec::new(),
        }
    }
}

/// What was asked for, once it makes sense together.
struct Wanted<'a> {
    one: &'a One<'a>,
    format: MapFormat,
    layout: MapLayout,
    projection: MapProjection,
    remap: RemapName,
}

/// Refuses options that make no sense together.
pub(super) fn check(one: &One, format: MapFormat) -> Result<(), Usage> {
    Wanted::of(one, format).map(|_| ())
}

/// Claims the map and the files beside it.
pub(super) fn claim(one: &One, format: MapFormat, claims: &mut OutputClaims) -> anyhow::Result<()> {
    let kind = match format {
        MapFormat::Png => Kind::Picture,
        _ => Kind::Map,
    };
    // Files beside a picture of ours are its own, though they have no room for a mark.
    let replaced = one.out.exists();
    claims.file(one.out, kind)?;
    for path in &format.beside(one.out) {
        if format == MapFormat::Cog {
            claims.file(path, Kind::Item)?;
            continue;
        }
        if path.exists() && !replaced && !one.writing.force {
            bail!(
                "{}: it lies where a file beside {} is to be: move it, or give --force",
                path.display(),
                one.out.display()
            );
        }
        claims.unmarked(path)?;
    }
    Ok(())
}

/// Reads a product or a SICD and writes its map.
pub(super) fn write(session: &Session, one: &One, format: MapFormat) -> anyhow::Result<Written> {
    let wanted = Wanted::of(one, format)?;
    let image = super::whole(session, one.folder)?;
    if let PixelGeometry::Sicd { on_map, .. } = &image.lies {
        return write_sicd(session, &wanted, &image, on_map.as_ref().as_ref());
    }
    let (grid, record) = super::recorded(one, &image)?;
    let frame = frame(one, &record)?;
    let looks = image.looks().ok_or(MapError::Unseen)?;
    let source = Source {
        pixels: &image.pixels,
        grid: &grid,
        frame: &frame,
        looks: &looks,
    };
    let raster = wanted
        .raster(|projection, pixel_m| Raster::covering(&grid, &frame, projection, pixel_m))?;
    let ortho = Ortho::new(source, raster)?;
    wanted.write(session, &About::of_record(one, &record), &ortho)
}

/// Reads anyone's SICD and writes its map.
fn write_sicd(
    session: &Session,
    wanted: &Wanted,
    image: &OpenImage,
    on_map: Result<&SicdOnMap, &String>,
) -> anyhow::Result<Written> {
    let Pixels::Sicd(file) = &image.pixels else {
        bail!("{}: expected a SICD", image.path.display());
    };
    let model = on_map.map_err(|what| anyhow::anyhow!("{what}"))?;
    session.note(1, || {
        format!(
            "what the image shows is taken to stand {:.1} m above the ellipsoid, as its scene centre point does",
            model.height_m()
        )
    });
    let raster = wanted.raster(|projection, pixel_m| {
        Raster::covering_projected(model, file.size(), projection, pixel_m)
    })?;
    let ortho = Ortho::with_projection(file, model, raster);
    let about = About {
        title: file
            .name()
            .unwrap_or_else(|| wanted.one.image.display().to_string()),
        recorded: file.start(),
        file: wanted.one.folder.to_owned(),
    };
    wanted.write(session, &about, &ortho)
}

/// What is said of an image beside its pixels.
struct About {
    title: String,
    /// When its recording began, RFC 3339.
    recorded: Option<String>,
    /// Whose time is when it was formed.
    file: PathBuf,
}

impl About {
    fn of_record(one: &One, metadata: &Value) -> Self {
        let title = metadata["picture"]["title"].as_str();
        let start = metadata["antennas"]["start_ns"].as_i64().map(|start_ns| {
            let from_1970 = Duration::from_nanos(start_ns.unsigned_abs());
            log::utc(match start_ns < 0 {
                true => SystemTime::UNIX_EPOCH - from_1970,
                false => SystemTime::UNIX_EPOCH + from_1970,
            })
        });
        Self {
            title: title.map_or_else(|| one.image.display().to_string(), str::to_owned),
            recorded: start,
            // The record is written last.
            file: match one.folder.join("image.json") {
                record if record.exists() => record,
                _ => one.folder.to_owned(),
            },
        }
    }

    /// When the recording began, or when the image was formed; and which of them.
    fn datetime(&self) -> anyhow::Result<(String, &'static str)> {
        if let Some(start) = &self.recorded {
            return Ok((start.clone(), "when the recording began"));
        }
        let formed = std::fs::metadata(&self.file).and_then(|about| about.modified());
        let formed = formed.context("cannot tell when the image was formed")?;
        let meaning = "when the image was formed: its record does not say when it was recorded";
        Ok((log::utc(formed), meaning))
    }
}

/// Errors above this are worth a warning.
const WORTH_SAYING_DB: f64 = -40.0;

impl<'a> Wanted<'a> {
    fn of(one: &'a One<'a>, format: MapFormat) -> Result<Self, Usage> {
        let maps = &one.maps;
        let is_map = format == MapFormat::Cog;
        let wrong = |what: &str| Err(Usage(what.to_owned()));
        if one.speed_m_s.is_some() {
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
            one,
            format,
            layout,
            projection,
            remap: maps.remap.unwrap_or(match is_map {
                true => RemapName::Db,
                false => RemapName::Density,
            }),
        })
    }

    /// The map's pixels, as `covering` lays them over the image.
    fn raster(
        &self,
        covering: impl Fn(Projecting, Option<f64>) -> Result<Raster, MapError>,
    ) -> Result<Raster, MapError> {
        let own = |pixel_m| {
            let projection: Projecting = match self.projection {
                MapProjection::Utm => Projection::utm,
                MapProjection::Geographic => |centre| Ok(Projection::geographic(centre)),
            };
            covering(projection, pixel_m)
        };
        let raster = own(self.one.maps.pixel)?;
        match self.one.maps.looks {
            Some(looks) => own(Some(raster.pixel_m * looks as f64)),
            None => Ok(raster),
        }
    }

    fn write(&self, session: &Session, about: &About, ortho: &Ortho) -> anyhow::Result<Written> {
        if ortho.error_db() > WORTH_SAYING_DB {
            messages::warning(format!(
                "reading the image between its pixels leaves an error of {:.0} dB, for they are only {:.2} and {:.2} times as fine as its \
                 band needs: form it on a finer grid for less",
                ortho.error_db(),
                ortho.oversampling()[0],
                ortho.oversampling()[1]
            ));
        }
        let out = self.one.out;
        let levels = || {
            let reading = session.progress("reading levels");
            let levels = Levels::of(
                ortho.pixels(),
                self.remap.into(),
                self.one.maps.top,
                self.one.maps.span,
            )?;
            reading.finish();
            Ok::<_, MapError>(levels)
        };
        let title = &about.title;
        match self.format {
            MapFormat::Kmz => {
                let levels = levels()?;
                let progress = session.progress("writing");
                maps::kmz::write(out, ortho, levels, title, &progress)?;
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
                let mut files = FileSet::new();
                maps::cog::add_to(&mut files, out, ortho, layout, title, &progress)?;
                progress.finish();
                let id = out.file_stem().unwrap_or_default().to_string_lossy();
                let (datetime, meaning) = about.datetime()?;
                let item = maps::stac::About {
                    id: &id,
                    datetime: &datetime,
                    properties: json!({ "title": title, "subaperture:datetime": meaning }),
                };
                let beside = out.with_extension("json");
                maps::stac::add_to(&mut files, &beside, out, ortho, layout, &item)?;
                files.commit()?;
            }
        }
        Ok(self.written(ortho))
    }

    fn written(&self, ortho: &Ortho) -> Written {
        let path = |path: &Path| path.display().to_string();
        let out = self.one.out;
        let beside = self.format.beside(out);
        let raster = ortho.raster();
        Written {
            name: "map",
            about: json!({
                "path": path(out),
                "beside": beside.iter().map(|p| path(p)).collect::<Vec<_>>(),
                "epsg": raster.projection.epsg(),
                "rows": raster.rows,
                "columns": raster.columns,
                "pixel_m": raster.pixel_m,
                "pixels_averaged": ortho.averaged(),
                "oversampling": ortho.oversampling(),
                "resampling_error_db": ortho.error_db(),
            }),
            line: format!(
                "{}: {} x {} pixels of {}, EPSG:{}",
                path(out),
                raster.rows,
                raster.columns,
                subaperture::quantity::metres(raster.pixel_m),
                raster.projection.epsg()
            ),
        }
    }
}

/// The projection of a map by the middle of its image.
type Projecting = fn(&Geodetic) -> Result<Projection, MapError>;

/// Where the scene is.
fn frame(one: &One, record: &Value) -> anyhow::Result<SceneFrame> {
    if let Some(origin) = &one.place {
        return Ok(SceneFrame::east_north_up(origin));
    }
    let image = one.image.display();
    match product::frame_of(record) {
        Ok(SceneFrame::Local) => bail!(
            "{image}: its recording ties it to no place on the Earth: give --place LAT,LON[,HEIGHT] of the scene's origin"
        ),
        Ok(frame) => Ok(frame),
        Err(what) => bail!("{image}: {what}: give --place LAT,LON[,HEIGHT], or form it again"),
    }
}
