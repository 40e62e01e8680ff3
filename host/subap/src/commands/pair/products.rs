//! Results of `subap pair` as GeoTIFF and Zarr.

use anyhow::bail;
use serde_json::json;
use subaperture::geometry::SceneFrame;
use subaperture::image::Image;
use subaperture::interferometry::ChangeMap;
use subaperture::io::stack::{Measure, Stack, StackError};
use subaperture::io::together::FileSet;
use subaperture::io::written::{FileKind, WrittenFile};
use subaperture::maps::{Ortho, Projection, Raster, cog};
use subaperture::num_complex::Complex32;
use subaperture::quality::PixelMap;

use super::read::Read;
use crate::args::Pair;
use crate::commands::export::stack_attributes;
use crate::config::Session;
use crate::interrupt;

/// Name of the Zarr group.
pub(super) const STACK: &str = "pair.zarr";

/// Names and titles of the maps.
pub(super) const MAPS: [(&str, &str); 3] = [
    ("coherence.tif", "coherence, 0 to 1"),
    (
        "interferogram.tif",
        "complex coherence: magnitude is the coherence, angle the interferometric phase",
    ),
    (
        "change.tif",
        "change: 1 changed, 0 unchanged, NaN not tested",
    ),
];

/// Fail if the images have no position on the Earth.
pub(super) fn check_place(typed: &Pair, read: &Read) -> anyhow::Result<()> {
    let name = typed.reference.display();
    match (read.reference.grid(), read.grid().1) {
        (None, _) => bail!(
            "--format cog: {name} has no metadata that state its position: give products of subap focus, or --format zarr"
        ),
        (_, SceneFrame::Local) => bail!(
            "--format cog: {name} does not state its position on the Earth: give the scene's origin with --place LAT,LON[,HEIGHT]"
        ),
        _ => Ok(()),
    }
}

/// Add the maps to a set of files.
pub(super) fn add_maps(
    session: &Session,
    typed: &Pair,
    read: &Read,
    changes: &ChangeMap,
    files: &mut FileSet,
) -> anyhow::Result<()> {
    let (grid, frame) = read.grid();
    let raster = Raster::covering(&grid, &frame, Projection::utm, None)?;
    let real = |map: &PixelMap| Image {
        rows: map.rows,
        columns: map.columns,
        pixels: map
            .values
            .iter()
            .map(|&v| Complex32::new(v, v * 0.0))
            .collect(),
    };
    let coherence = real(&changes.interferogram.magnitude());
    let change = real(&changes.map);
    let images = [
        (&coherence, cog::Layout::Amplitude),
        (&changes.interferogram.coherence, cog::Layout::Complex),
        (&change, cog::Layout::Amplitude),
    ];
    let progress = session.progress("writing maps");
    for ((name, title), (image, layout)) in MAPS.iter().zip(images) {
        let ortho = Ortho::nearest(image, &grid, &frame, raster)?;
        cog::add_to(
            files,
            &typed.out.join(name),
            &ortho,
            layout,
            title,
            &progress,
        )?;
        interrupt::check()?;
    }
    progress.finish();
    Ok(())
}

/// Write the Zarr group of both images and the measures.
pub(super) fn write_stack(
    session: &Session,
    typed: &Pair,
    read: &Read,
    changes: &ChangeMap,
) -> anyhow::Result<WrittenFile> {
    let (grid, frame) = read.grid();
    let [coherence, phase] = [
        changes.interferogram.magnitude(),
        changes.interferogram.phase(),
    ];
    let mut attributes = stack_attributes(&[&read.later, &read.reference], &grid, &frame);
    attributes["pair"] = json!({
        "effective_looks": changes.looks,
        "scene_coherence": changes.coherence,
        "threshold": changes.threshold,
        "false_alarm_probability": typed.pfa,
    });
    let stack = Stack {
        images: &[&read.image, &read.pixels],
        grid: &grid,
        start_ns: &[],
        measures: &[
            Measure {
                name: "coherence",
                long_name: "magnitude of the sample coherence",
                units: "1",
                values: &coherence.values,
            },
            Measure {
                name: "phase",
                long_name: "interferometric phase of image 0 relative to image 1",
                units: "radian",
                values: &phase.values,
            },
            Measure {
                name: "change",
                long_name: "1 changed, 0 unchanged, NaN not tested",
                units: "1",
                values: &changes.map.values,
            },
        ],
        attributes: &attributes,
    };
    let path = typed.out.join(STACK);
    let progress = session.progress("writing");
    match stack.write(&path, &progress) {
        Err(StackError::Cancelled) => {
            interrupt::check()?;
            bail!("interrupted");
        }
        wrote => wrote?,
    }
    progress.finish();
    Ok(WrittenFile::new(path, FileKind::Zarr))
}
