//! Results of `subap pair` as GeoTIFF and Zarr.

use serde_json::json;
use subaperture::interferometry::ChangeMap;
use subaperture::io::stack::{Measure, Stack};
use subaperture::io::together::FileSet;
use subaperture::io::written::WrittenFile;
use subaperture::maps::cog;
use subaperture::quality::PixelMap;

use super::read::Read;
use crate::args::Pair;
use crate::commands::export::stack_attributes;
use crate::commands::rasters::{self, Map};
use crate::config::Session;

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

/// Add the maps to a set of files.
pub(super) fn add_maps(
    session: &Session,
    typed: &Pair,
    read: &Read,
    changes: &ChangeMap,
    files: &mut FileSet,
) -> anyhow::Result<()> {
    let (grid, frame) = read.grid();
    let real = |map: &PixelMap| rasters::real(map.rows, map.columns, &map.values);
    let coherence = real(&changes.interferogram.magnitude());
    let change = real(&changes.map);
    let images = [
        (&coherence, cog::Layout::Amplitude),
        (&changes.interferogram.coherence, cog::Layout::Complex),
        (&change, cog::Layout::Amplitude),
    ];
    let maps = MAPS.iter().zip(images);
    let maps = maps.map(|(&(name, title), (image, layout))| Map {
        name,
        title,
        image,
        layout,
    });
    let maps: Vec<Map> = maps.collect();
    rasters::add_maps(session, &typed.out, (&grid, &frame), &maps, files)
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
    rasters::write_stack(session, &stack, &typed.out.join(STACK))
}
