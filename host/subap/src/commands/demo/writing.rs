//! Output files of the demonstration: a folder for each image, the differences, the overview and the table.

use std::time::{Duration, Instant};

use serde_json::json;
use subaperture::geometry::ImageGrid;
use subaperture::image::Image;
use subaperture::io::product::Product;
use subaperture::io::together::FileSet;
use subaperture::io::written::{FileKind, WrittenFile};
use subaperture::plot::{self, Colours, Panel, PlotError, Scale};
use subaperture::signal::window::Window;
use subaperture::simulate::Preset;

use super::report;
use super::trials::{GRID, Outcome};
use crate::args::Demo;
use crate::config::{Session, record_of_run};
use crate::interrupt;

/// Columns of images in the overview: half of all images.
const COLUMNS: usize = 5;

/// Common scale of all images, dB: unit scatterers and the side lobes of neighbours added to them.
const IMAGE_SCALE: Scale = Scale::Fixed {
    top_db: 3.0,
    span_db: 60.0,
};

/// Common scale of all differences, dB.
const DIFFERENCE_SCALE: Scale = Scale::Fixed {
    top_db: -20.0,
    span_db: 80.0,
};

/// Write all products, differences and tables, or none. Returns the files.
pub(super) fn write(
    session: &Session,
    typed: &Demo,
    grid: &ImageGrid,
    exact: &Image,
    report: &report::Report,
    start: Instant,
) -> anyhow::Result<Vec<WrittenFile>> {
    let mut files = FileSet::new();
    let image_panel = |image, title: &str| Panel {
        scale: IMAGE_SCALE,
        ..Panel::new(image, grid, title)
    };
    let panel = image_panel(exact, "exact");
    save(
        &mut files,
        typed,
        "exact",
        record(session, typed, "exact", json!({}), report.exact_taken),
        exact,
        &panel,
    )?;
    let mut panels = vec![panel];
    // Below each image its difference; below the reference, the reference on the scale of differences.
    let mut differences = vec![Panel {
        scale: DIFFERENCE_SCALE,
        colours: Colours::Viridis,
        ..Panel::new(exact, grid, "exact, on this scale")
    }];
    for outcome in report.outcomes {
        let Outcome {
            trial,
            image,
            difference,
            comparison,
            settings,
            taken,
        } = outcome;
        let panel = image_panel(image, trial.title);
        let mut metadata = record(session, typed, trial.title, json!(settings), *taken);
        metadata["comparison"] = json!(comparison);
        save(&mut files, typed, trial.folder, metadata, image, &panel)?;
        panels.push(panel);
        let error = comparison.error_db.unwrap_or(f64::NAN);
        differences.push(Panel {
            scale: DIFFERENCE_SCALE,
            colours: Colours::Viridis,
            ..Panel::new(difference, grid, format!("minus exact: {error:.1} dB"))
        });
    }
    for (outcome, panel) in report.outcomes.iter().zip(&differences[1..]) {
        let picture = plot::quicklook(panel)?;
        let name = format!("difference-{}.png", outcome.trial.folder);
        files.write_bytes(&typed.out.join(name), FileKind::Picture, &picture)?;
    }
    interrupt::check()?;
    let mut table = report.to_json();
    table["run"] = record_of_run(session, start.elapsed());
    for (name, kind, bytes) in [
        (
            "overview.png",
            FileKind::Picture,
            overview(&panels, &differences)?,
        ),
        ("errors.md", FileKind::Report, report.to_markdown().into()),
        (
            "errors.json",
            FileKind::Record,
            serde_json::to_vec_pretty(&table)?,
        ),
    ] {
        files.write_bytes(&typed.out.join(name), kind, &bytes)?;
    }
    Ok(files.commit()?)
}

/// Overview page: rows of images, each above the row of their differences.
fn overview(panels: &[Panel], differences: &[Panel]) -> Result<Vec<u8>, PlotError> {
    let mut page = Vec::new();
    for (images, differences) in panels.chunks(COLUMNS).zip(differences.chunks(COLUMNS)) {
        page.extend_from_slice(images);
        page.extend_from_slice(differences);
    }
    plot::panels(&page, COLUMNS)
}

/// JSON record of an image.
fn record(
    session: &Session,
    typed: &Demo,
    title: &str,
    settings: serde_json::Value,
    taken: Duration,
) -> serde_json::Value {
    json!({
        "schema": "subaperture-demo-image",
        "schema_version": 1,
        "run": record_of_run(session, taken),
        "title": title,
        "collection": Preset::Table41.name(),
        "window": Window::default().to_string(),
        "slow_window": Window::default().to_string(),
        "grid": typed.grid.as_ref().map_or(json!(GRID), |_| json!("as given on the command line")),
        "settings": settings,
    })
}

/// Add the folder of an image.
fn save(
    files: &mut FileSet,
    typed: &Demo,
    folder: &str,
    metadata: serde_json::Value,
    image: &Image,
    panel: &Panel,
) -> anyhow::Result<()> {
    interrupt::check()?;
    let quicklook = plot::quicklook(panel)?;
    Product {
        image,
        metadata: &metadata,
        quicklook: &quicklook,
    }
    .add_to(files, &typed.out.join(folder))?;
    Ok(())
}
