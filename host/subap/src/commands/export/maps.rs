//! Export of an orthorectified image as GeoTIFF, KMZ, or PNG with a world file.

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
use subaperture::io::written::WrittenFile;
use subaperture::maps::{self, Levels, MapError, Ortho, Projection, Raster, Source, cog::Layout};
use subaperture::on_map::SicdOnMap;

use super::one::{One, Written, recorded, whole};
use crate::args::{ImageFormat, MapLayout, MapProjection, RemapName};
use crate::config::Session;
use crate::failure::Usage;
use crate::{log, messages};

/// Map formats of `subap export`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MapFormat {
    /// Cloud-optimised GeoTIFF.
    Cog,
    /// KMZ ground overlay for Google Earth.
    Kmz,
    /// PNG picture with a world file.
    Png,
}

impl MapFormat {
    /// Map format of an image format.
    pub(super) fn of(format: ImageFormat) -> Self {
        match format {
            ImageFormat::Cog => Self::Cog,
            ImageFormat::Kmz => Self::Kmz,
            _ => Self::Png,
        }
    }

    /// Sidecar files of a map.
    fn sidecars(self, out: &Path) -> Vec<PathBuf> {
        match self {
            Self::Cog => vec![out.with_extension("json")],
            Self::Png => maps::picture::sidecars(out).into(),
            Self::Kmz => Vec::new(),
        }
    }
}

/// Checked options of a map.
struct Wanted<'a> {
    one: &'a One<'a>,
    format: MapFormat,
    layout: MapLayout,
    projection: MapProjection,
    remap: RemapName,
}

/// Check that the options are consistent.
pub(super) fn check(one: &One, format: MapFormat) -> Result<(), Usage> {
    Wanted::of(one, format).map(|_| ())
}

/// Claim the map and its sidecar files.
pub(super) fn claim(one: &One, format: MapFormat, claims: &mut OutputClaims) -> anyhow::Result<()> {
    let kind = match format {
        MapFormat::Png => Kind::Picture,
        _ => Kind::Map,
    };
    // Sidecar files of a picture written by subap belong to it, although they have no room for a mark.
    let replaced = one.out.exists();
    claims.file(one.out, kind)?;
    for path in &format.sidecars(one.out) {
        if format == MapFormat::Cog {
            claims.file(path, Kind::Item)?;
            continue;
        }
        if path.exists() && !replaced && !one.writing.force {
            bail!(
                "{}: a file of this name exists where a sidecar of {} is written: move it, or give --force",
                path.display(),
                one.out.display()
            );
        }
        claims.unmarked(path)?;
    }
    Ok(())
}

/// Read a product or SICD and write its map.
pub(super) fn write(session: &Session, one: &One, format: MapFormat) -> anyhow::Result<Written> {
    let wanted = Wanted::of(one, format)?;
    let image = whole(session, one.folder)?;
    if let PixelGeometry::Sicd { on_map, .. } = &image.lies {
        return write_sicd(session, &wanted, &image, on_map.as_ref().as_ref());
    }
    let (grid, record) = recorded(one, &image)?;
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

/// Read a SICD of any origin and write its map.
fn write_sicd(
    session: &Session,
    wanted: &Wanted,
    image: &OpenImage,
    on_map: Result<&SicdOnMap, &String>,
) -> anyhow::Result<Written> {
    let Pixels::Sicd(file) = &image.pixels else {
        bail!("{}: expected a SICD", image.path.display());
    };
    let model = on_map.map_err(|error| anyhow::anyhow!("{error}"))?;
    session.note(1, || {
        format!(
            "heights are taken as {:.1} m above the ellipsoid, that of the scene centre point",
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

/// Metadata of a map.
struct About {
    title: String,
    /// Start of the recording, RFC 3339.
    recorded: Option<String>,
    /// File whose modification time is the time of image formation.
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
            // The record is the last file written.
            file: match one.folder.join("image.json") {
                record if record.exists() => record,
                _ => one.folder.to_owned(),
            },
        }
    }

    /// Start of the recording, or the time of image formation; and which of the two.
    fn datetime(&self) -> anyhow::Result<(String, &'static str)> {
        if let Some(start) = &self.recorded {
            return Ok((start.clone(), "start of the recording"));
        }
        let formed = std::fs::metadata(&self.file).and_then(|about| about.modified());
        let formed = formed.context("the time of image formation is unknown")?;
        let meaning =
            "time of image formation: the record does not state when the recording started";
        Ok((log::utc(formed), meaning))
    }
}

/// Resampling error above which a warning is given, dB.
const WARNED_ERROR_DB: f64 = -40.0;

impl<'a> Wanted<'a> {
    fn of(one: &'a One<'a>, format: MapFormat) -> Result<Self, Usage> {
        let maps = &one.maps;
        let is_map = format == MapFormat::Cog;
        let wrong = |fault: &str| Err(Usage(fault.to_owned()));
        if one.speed_m_s.is_some() {
            return wrong("--speed applies to --format sicd only: leave it out");
        }
        if maps.layout.is_some() && !is_map {
            return wrong("--layout applies to --format cog only: leave it out");
        }
        let layout = maps.layout.unwrap_or_default();
        let greys = maps.remap.is_some() || maps.top.is_some() || maps.span.is_some();
        if greys && layout != MapLayout::Db {
            return wrong(
                "--remap, --top and --span apply to grey levels; --layout amplitude and complex have none: leave them out",
            );
        }
        if layout == MapLayout::Complex && maps.looks.is_some_and(|looks| looks > 1) {
            return wrong(
                "--looks averages power, which --layout complex does not contain: leave it out",
            );
        }
        let projection = match (format, maps.projection) {
            (MapFormat::Kmz, Some(MapProjection::Utm)) => {
                return wrong("--format kmz uses longitude and latitude: leave --projection out");
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

    /// Raster of the map, as `covering` fits it over the image.
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
        if ortho.error_db() > WARNED_ERROR_DB {
            messages::warning(format!(
                "interpolation of the image leaves an error of {:.0} dB, because its pixels are only {:.2} and {:.2} times as fine as its \
                 band needs: form it on a finer grid for a smaller error",
                ortho.error_db(),
                ortho.oversampling()[0],
                ortho.oversampling()[1]
            ));
        }
        let out = self.one.out;
        let levels = || {
            let reading = session.progress("finding levels");
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
        let files = match self.format {
            MapFormat::Kmz => {
                let levels = levels()?;
                let progress = session.progress("writing");
                let files = maps::kmz::write(out, ortho, levels, title, &progress)?;
                progress.finish();
                files
            }
            MapFormat::Png => {
                let levels = levels()?;
                let progress = session.progress("writing");
                let files = maps::picture::write(out, ortho, levels, &progress)?;
                progress.finish();
                files
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
                let sidecars = out.with_extension("json");
                maps::stac::add_to(&mut files, &sidecars, out, ortho, layout, &item)?;
                files.commit()?
            }
        };
        Ok(self.written(ortho, files))
    }

    fn written(&self, ortho: &Ortho, files: Vec<WrittenFile>) -> Written {
        let out = self.one.out;
        let raster = ortho.raster();
        Written {
            name: "map",
            about: json!({
                "epsg": raster.projection.epsg(),
                "rows": raster.rows,
                "columns": raster.columns,
                "pixel_m": raster.pixel_m,
                "pixels_averaged": ortho.averaged(),
                "oversampling": ortho.oversampling(),
                "resampling_error_db": ortho.error_db(),
            }),
            files,
            line: format!(
                "{}: {} x {} pixels of {}, EPSG:{}",
                out.display(),
                raster.rows,
                raster.columns,
                subaperture::quantity::metres(raster.pixel_m),
                raster.projection.epsg()
            ),
        }
    }
}

/// Choice of a map's projection by the position of the image centre.
type Projecting = fn(&Geodetic) -> Result<Projection, MapError>;

/// Scene frame of the image.
fn frame(one: &One, record: &Value) -> anyhow::Result<SceneFrame> {
    if let Some(origin) = &one.place {
        return Ok(SceneFrame::east_north_up(origin));
    }
    let image = one.image.display();
    match product::frame_of(record) {
        Ok(SceneFrame::Local) => bail!(
            "{image}: its recording does not state its position on the Earth: give the scene's origin with --place LAT,LON[,HEIGHT]"
        ),
        Ok(frame) => Ok(frame),
        Err(error) => {
            bail!("{image}: {error}: give --place LAT,LON[,HEIGHT], or form the image again")
        }
    }
}
