//! Plans of images, which are copied between machines.

use std::sync::OnceLock;

use num_complex::Complex32;
use subaperture::focus::formers::FORMERS;
use subaperture::focus::plan::InMemory;
use subaperture::focus::{BoundPolicy, ImageSpec, Plan, Work};
use subaperture::geometry::ImageGrid;
use subaperture::monitor::Silent;
use subaperture::phase_history::{InMemory as Samples, PhaseHistory, Weights};
use subaperture::signal::window::Window;
use subaperture::simulate::{Preset, Variation};

use super::MEMORY_BYTES;

/// Words of plans.
pub(super) const WORDS: &[&str] = &[
    "schema",
    "subaperture-plan-2",
    "former",
    "settings",
    "choices",
    "summary",
    "grid",
    "origin_m",
    "columns",
    "rows",
    "count",
    "polar",
    "tile",
    "recording",
    "oversampling",
    "blurs",
    "precise",
    "thesis",
    "sub_cpis",
    "spans",
    "patch_rows",
    "taps",
    "longest",
    "centre_m",
    "1e308",
    "-1",
    "0",
    "null",
];

/// A short and narrow part of the thesis's collection.
fn history() -> &'static Samples {
    static HISTORY: OnceLock<Samples> = OnceLock::new();
    HISTORY.get_or_init(|| {
        let whole = Preset::Table41.simulate(&Variation::default());
        let mut samples = vec![Complex32::ZERO; 24 * 256];
        whole.read(500..524, &mut samples).unwrap();
        let mut collection = whole.collection().clone();
        collection.pulses = collection.pulses[500..524].to_vec();
        collection.num_samples = 16;
        let narrow = samples.chunks(256).flat_map(|row| row[..16].to_vec());
        Samples::new(collection, narrow.collect()).unwrap()
    })
}

/// Read a plan and, if it is small, execute its first tile.
pub(super) fn plan(bytes: &[u8]) -> String {
    let plan = match Plan::from_text(&String::from_utf8_lossy(bytes)) {
        Ok(plan) => plan,
        Err(error) => return error.to_string(),
    };
    let history = history();
    let weights = match plan.weights(history.collection()) {
        Ok(weights) => weights,
        Err(error) => return error.to_string(),
    };
    let opened = match plan.open(history.collection(), &weights) {
        Ok(opened) => opened,
        Err(error) => return error.to_string(),
    };
    let [rows, columns] = plan.tiling().place(0);
    if rows.len() * columns.len() > 1024 || plan.grid.num_pixels() > 1 << 14 {
        return "large".to_owned();
    }
    let work = Work {
        history,
        memory_bytes: MEMORY_BYTES,
        monitor: &Silent,
    };
    let mut image = InMemory::of(&plan);
    match opened.form(&work, &[0], 1, &mut image) {
        Ok(()) => {
            assert!(image.image.pixels.iter().all(|z| z.is_finite()));
            let again = Plan::from_text(&plan.to_text()).unwrap();
            assert_eq!(again, plan);
            "formed".to_owned()
        }
        Err(error) => error.to_string(),
    }
}

pub(super) fn plan_seeds() -> Vec<Vec<u8>> {
    let history = history();
    let grid: ImageGrid = "x=-12:12:2.5,y=-12:12:3".parse().unwrap();
    let weights = Weights::new(history.collection(), Window::Hamming, Window::default());
    let spec = ImageSpec::new(history.collection(), &grid, &weights);
    let thesis = serde_json::json!({ "mode": { "thesis": {} } });
    let mut formers: Vec<_> = FORMERS
        .iter()
        .map(|entry| (entry.of)(&serde_json::json!({})).unwrap())
        .collect();
    formers.push(subaperture::focus::formers::former("rdbp", &thesis).unwrap());
    formers
        .iter()
        .filter_map(|former| Plan::new(&**former, &spec, BoundPolicy::Allowed, &Silent).ok())
        .map(|plan| plan.to_text().into_bytes())
        .collect()
}
