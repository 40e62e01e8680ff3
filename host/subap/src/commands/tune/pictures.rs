//! Output folder of `subap tune`: the record, the measure against each key, and the image before and after.

use std::path::Path;

use serde_json::Value;
use subaperture::autofocus::Tuned;
use subaperture::focus::bp::Backprojection;
use subaperture::focus::{ImageFormer, Task};
use subaperture::geometry::ImageGrid;
use subaperture::image::Image;
use subaperture::io::together::FileSet;
use subaperture::io::written::FileKind;
use subaperture::phase_history::{InMemory, PhaseHistory, ReadError, Weights};
use subaperture::plot::{self, Chart, Colours, Curve, HeatMap, Panel};

use super::measure::{figure, less_is_better, measure_name, rounded};
use crate::args::Tune;
use crate::config::{DEFAULT_ERROR_DB, Session};
use crate::interrupt;

/// Add all files to a set; `histories` are the recording as described, if possible, and as tuned.
pub(super) fn add_to(
    files: &mut FileSet,
    session: &Session,
    typed: &Tune,
    folder: &Path,
    record: &Value,
    found: &Tuned,
    histories: [&Result<InMemory, ReadError>; 2],
) -> anyhow::Result<()> {
    let mut put = |name: &str, bytes: &[u8]| {
        let path = folder.join(name);
        let kind = match name {
            "tune.json" => FileKind::Record,
            _ => FileKind::Picture,
        };
        files.write_bytes(&path, kind, bytes)
    };
    put("tune.json", &serde_json::to_vec_pretty(record)?)?;
    for (vary, (scan, &best)) in typed.vary.iter().zip(found.scans.iter().zip(&found.best)) {
        let label = match vary.unit.as_str() {
            "" => vary.key.clone(),
            unit => format!("{} ({unit})", vary.key),
        };
        let finite = scan.points.iter().filter(|point| point.1.is_finite());
        let chart = Chart {
            title: format!("{}: best at {}", vary.key, vary.text(rounded(vary, best))),
            across_label: label,
            up_label: match less_is_better(typed) {
                true => format!("{}, less is better", measure_name(typed)),
                false => format!("{}, more is better", measure_name(typed)),
            },
            curves: vec![Curve {
                name: String::new(),
                points: finite.map(|&(x, y)| (x, figure(typed, y))).collect(),
                stroke: plot::Stroke::Solid,
            }],
            marks: vec![best],
            ..Chart::default()
        };
        if scan.points.len() > 1 {
            put(&format!("{}.png", vary.key), &plot::lines(&chart)?)?;
        }
    }
    if let (Some(merits), [up, across]) = (&found.grid, typed.vary.as_slice()) {
        let values: Vec<f32> = merits.iter().map(|&merit| merit as f32).collect();
        let finite = || merits.iter().copied().filter(|merit| merit.is_finite());
        let range = (finite().fold(f64::INFINITY, f64::min), found.merit);
        let map = HeatMap {
            values: &values,
            rows: up.axis,
            columns: across.axis,
            title: measure_name(typed),
            across_label: format!("{} ({})", across.key, across.unit),
            up_label: format!("{} ({})", up.key, up.unit),
            unit: String::new(),
            range,
            colours: Colours::Grey,
            proportional: false,
        };
        if range.0 < range.1 {
            put("map.png", &plot::heat(&map)?)?;
        }
    }
    if let Some(grid) = &typed.grid {
        let mut images: Vec<(&str, Image)> = Vec::new();
        for (name, history) in ["as described", "as tuned"].into_iter().zip(histories) {
            if let Ok(history) = history {
                images.push((name, image(session, typed, grid, history)?));
            }
        }
        let panels: Vec<Panel> = images
            .iter()
            .map(|(name, image)| Panel::new(image, grid, *name))
            .collect();
        put("image.png", &plot::panels(&panels, 2)?)?;
    }
    interrupt::check()?;
    Ok(())
}

fn image(
    session: &Session,
    typed: &Tune,
    grid: &ImageGrid,
    history: &InMemory,
) -> anyhow::Result<Image> {
    let progress = session.progress("focusing");
    let task = Task {
        history,
        grid,
        weights: &Weights::new(
            history.collection(),
            typed.windows.window,
            typed.windows.slow_window,
        ),
        memory_bytes: session.memory_bytes,
        monitor: &progress,
        numerics: Default::default(),
    };
    let former = Backprojection {
        error_db: DEFAULT_ERROR_DB,
    };
    Ok(former.form_best(&task)?.image)
}
