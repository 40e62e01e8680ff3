//! Test of the cost model against operations counted in the inner loops.

use std::sync::atomic::{AtomicU64, Ordering};

use crate::{BoundPolicy, ImageSpec, Task, formers};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::monitor::Silent;
use subaperture_model::phase_history::{PhaseHistory, Weights};
use subaperture_signal::window::Window;
use subaperture_simulate::{Preset, Variation};

static OPERATIONS: AtomicU64 = AtomicU64::new(0);

/// Count a decimated history: its samples before, and the taps and samples of sums over pulses and over samples.
pub(super) fn refined(before: usize, sums: [(usize, usize); 2]) {
    // Phase rotation: 6 operations per sample and 6 for the phasor recurrence; every 8th phasor is evaluated in 38, and 7 reduce its phase.
    let turned = before as f64 * (12.0 + 45.0 / 8.0);
    // A tap is a product and a sum of two components.
    let sums: usize = sums.map(|(taps, samples)| 4 * taps * samples).iter().sum();
    OPERATIONS.fetch_add(turned as u64 + sums as u64, Ordering::Relaxed);
}

/// Count profiles of `length` bins per pulse, their intervals, and pixels summed over them: position 2, bin 3, spline 12, carrier 10, sum 8.
pub(super) fn imaged(pulses: usize, length: usize, pieces: usize, pixels: usize) {
    let transform = 5.0 * length as f64 * (length as f64).log2();
    // Four taps of two components for each degree, and the product with the weight.
    let of_pieces = pieces as f64 * 4.0 * (16.0 + 2.0);
    let operations = pulses as f64 * (transform + of_pieces + 35.0 * pixels as f64);
    OPERATIONS.fetch_add(operations as u64, Ordering::Relaxed);
}

#[test]
fn cost_model_matches_counted_operations() {
    let history = Preset::Table41.simulate(&Variation::default());
    let weights = Weights::new(history.collection(), Window::None, Window::None);
    let mut worst = 0.0f64;
    for (grid, error_db) in [
        ("x=-40:40:0.4,y=-40:40:0.4", -60.0),
        ("x=-40:40:0.2,y=-40:40:0.2", -60.0),
        ("x=-40:40:0.2,y=-40:40:0.2", -40.0),
        ("x=-40:40:0.1,y=-40:40:0.1", -60.0),
    ] {
        let grid: ImageGrid = grid.parse().unwrap();
        let settings = serde_json::json!({ "error_db": error_db });
        let former = formers::former("ffbp", &settings).unwrap();
        let spec = ImageSpec::new(history.collection(), &grid, &weights);
        let goal = former.goal(BoundPolicy::Allowed);
        let predicted = former
            .decide(&spec, &goal, &Silent)
            .unwrap()
            .cost
            .operations;
        let task = Task::new(&history, &grid, &weights);
        OPERATIONS.store(0, Ordering::Relaxed);
        former.form_best(&task).unwrap();
        let done = OPERATIONS.load(Ordering::Relaxed) as f64;
        println!(
            "{} x {}, {error_db} dB: {predicted:.3e} operations predicted, {done:.3e} counted",
            grid.rows.count, grid.columns.count
        );
        worst = worst.max((predicted / done).max(done / predicted));
    }
    // Bound documented in `cost`.
    assert!(worst < 1.5, "{worst}");
}
