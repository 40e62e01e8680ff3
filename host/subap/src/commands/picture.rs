//! `subap picture`: redraw an image's picture with other levels or colours.

use anyhow::{Context, bail};
use glam::DVec3;
use serde_json::{Value, json};
use subaperture::geometry::ImageGrid;
use subaperture::images::{OpenImage, PixelGeometry};
use subaperture::io::ours::Kind;
use subaperture::io::together::FileSet;
use subaperture::io::written::FileKind;
use subaperture::plot::{self, Channel, ColourSource, Orientation, Panel, ShownAxis, Source};
use subaperture::quality::aperture::Aperture;
use subaperture::quality::polarisation::{Sum, pauli};
use subaperture::quality::sub_aperture::AperturePart;

use super::stored;
use crate::args::{ColourMap, Picture};
use crate::config::Session;
use crate::text;

/// Read one image, or several on a common grid, and draw the picture.
pub(crate) fn run(session: &Session, typed: &Picture) -> anyhow::Result<()> {
    let inputs: Vec<_> = typed
        .images
        .iter()
        .map(|path| stored::product_folder(path).unwrap_or(path))
        .collect();
    let mut claims = session.claims(&typed.writing, &inputs);
    claims.file(&typed.out, Kind::Picture)?;
    let drawing = session.progress("drawing");
    let mut images = Vec::with_capacity(typed.images.len());
    for path in &typed.images {
        images.push(Pictured::of(stored::open(session, path)?));
    }
    let first = &images[0];
    for other in &images[1..] {
        stored::check_same_pixels(&first.stored, &other.stored)?;
    }
    if images.len() > 1 && (typed.sub_apertures.is_some() || typed.look.colours != ColourMap::Grey)
    {
        bail!(
            "several images are used as the colour channels: leave --sub-apertures and --colours out, or give one image"
        );
    }
    let aperture = typed.sub_apertures.map(|_| first.aperture()).transpose()?;
    let parts = match (typed.sub_apertures, &aperture) {
        (Some(count), Some(aperture)) => first.sub_apertures(aperture, count.into()),
        _ => Vec::new(),
    };
    let basis = match &images[..] {
        [hh, hv, vh, vv] => {
            Some(pauli([hh, hv, vh, vv].map(|image| {
                &image.stored.pixels as &dyn subaperture::image::ImageSource
            })))
        }
        _ => None,
    };
    let paint = match images.len() {
        1 if parts.is_empty() => ColourSource::Levels,
        1 => ColourSource::Hues(parts.iter().map(|part| Source::ImageSource(part)).collect()),
        _ => ColourSource::Channels(channels(&images, basis.as_ref())),
    };
    let mut panel = Panel {
        scale: typed.look.scale(),
        colours: typed.look.colours(),
        looks: typed.looks.map_or([1, 1], |looks| looks.0),
        rows_down: first.rows_down,
        paint,
        ..Panel::new(
            Source::ImageSource(&first.stored.pixels),
            &first.grid,
            first.title(),
        )
    };
    if let Some(axes) = &first.axes {
        panel.axes = axes.clone();
        // Levels of images from other sources may be of any magnitude.
        panel.reference = "";
    }
    let about = &first.about;
    panel.orientation = Orientation {
        look: direction(&about["look"]),
        north: direction(&about["north"]),
    };
    let pixel = pixel(&panel, first.in_metres);
    if typed.looks.is_some() {
        let [down, across] = panel.looks;
        panel.title = format!(
            "{}, {down} x {across} looks, pixels of {pixel}",
            panel.title
        );
    }
    let picture = plot::quicklook_within(&panel, session.memory.picture_bytes)?;
    let mut files = FileSet::new();
    files.write_bytes(&typed.out, FileKind::Picture, &picture)?;
    let files = files.commit()?;
    drawing.finish();
    let path = typed.out.display().to_string();
    if session.json() {
        let [rows, columns] = panel.looks;
        let shown = panel.shown_grid();
        return text::say_json(
            "picture",
            json!({
                "files": files,
                "looks": [rows, columns],
                "pixel": [shown.rows.step, shown.columns.step],
            }),
        );
    }
    if session.prints_text() {
        text::say(match typed.looks {
            Some(_) => format!("{path}: pixels of {pixel}"),
            None => path,
        })?;
    }
    Ok(())
}

/// Image with the metadata for drawing it.
struct Pictured {
    stored: OpenImage,
    grid: ImageGrid,
    rows_down: bool,
    in_metres: bool,
    /// Axis names, if they differ from the grid's.
    axes: Option<[ShownAxis; 2]>,
    /// Picture entry of the image's record.
    about: Value,
}

impl Pictured {
    fn of(stored: OpenImage) -> Self {
        let plain =
            |[across, up]: [&str; 2]| Some([ShownAxis::plain(across), ShownAxis::plain(up)]);
        let rows_down = stored.rows_down();
        let (grid, in_metres, axes) = match (stored.grid(), &stored.lies) {
            (Some((grid, _)), PixelGeometry::Grid { .. }) if !rows_down => {
                (grid.clone(), true, None)
            }
            (Some((grid, _)), _) => {
                let axes = plain(["along rows (m)", "along columns (m)"]);
                (grid.clone(), true, axes)
            }
            (None, _) => (stored.pixel_grid(), false, plain(["column", "row"])),
        };
        let about = stored
            .record
            .as_ref()
            .map(|record| record["picture"].clone());
        Self {
            grid,
            rows_down,
            in_metres,
            axes,
            about: about.unwrap_or_default(),
            stored,
        }
    }

    fn title(&self) -> String {
        let name = self.stored.path.display().to_string();
        self.about["title"].as_str().map_or(name, str::to_owned)
    }

    fn aperture(&self) -> anyhow::Result<Aperture> {
        stored::aperture(&self.stored)?.with_context(|| {
            format!(
                "{}: sub-apertures need the record of a collection of less than 90 degrees on a Cartesian grid, or a SICD that states its \
                 bandwidth",
                self.stored.path.display()
            )
        })
    }

    /// Sub-apertures from one end of the aperture to the other.
    fn sub_apertures<'a>(&'a self, aperture: &'a Aperture, count: usize) -> Vec<AperturePart<'a>> {
        let end = |k: usize| k as f64 / count as f64;
        let part = |k| {
            AperturePart::new(
                &self.stored.pixels,
                &self.grid,
                aperture,
                [end(k), end(k + 1)],
            )
        };
        (0..count).map(part).collect()
    }
}

/// Colour channels: Pauli decomposition for four polarisations; two or three images unchanged.
fn channels<'a>(images: &'a [Pictured], basis: Option<&'a [(&str, Sum); 3]>) -> Vec<Channel<'a>> {
    if let Some(basis) = basis {
        let sums = basis.iter().map(|(name, sum)| Channel {
            name: (*name).to_owned(),
            image: Source::ImageSource(sum),
        });
        return sums.collect();
    }
    let each = images.iter().map(|image| {
        let path = &image.stored.path;
        let name = path.file_name().unwrap_or(path.as_os_str());
        Channel {
            name: name.to_string_lossy().into_owned(),
            image: Source::ImageSource(&image.stored.pixels),
        }
    });
    each.collect()
}

/// Pixel size as shown, rows before columns.
fn pixel(panel: &Panel, in_metres: bool) -> String {
    let grid = panel.shown_grid();
    let [down, across] = [grid.rows.step.abs(), grid.columns.step.abs()];
    match (in_metres, grid.polar) {
        (false, _) => format!("{down} x {across} pixels"),
        (true, true) => format!("{down:.4} m x {:.4} deg", across.to_degrees()),
        (true, false) => format!("{down:.4} m x {across:.4} m"),
    }
}

/// Unit vector from the record.
fn direction(value: &Value) -> Option<DVec3> {
    let number = |i: usize| value[i].as_f64();
    DVec3::new(number(0)?, number(1)?, number(2)?).try_normalize()
}
