//! The account against the operations that the loops do, counted where they run.

use std::sync::atomic::{AtomicU64, Ordering};

use super::FastFactorised;
use crate::{Aim, ImageFormer, Misses, SCRATCH_BYTES, Task};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::monitor::Silent;
use subaperture_model::phase_history::{PhaseHistory, Weights};
use subaperture_signal::window::Window;
use subaperture_simulate::{Preset, Variation};

static OPERATIONS: AtomicU64 = AtomicU64::new(0);

/// A history made smaller by kernels of `taps`: its samples before, and those that sums over pulses and over samples made.
pub(super) fn refined(taps: usize, before: usize, [over_pulses, over_samples]: [usize; 2]) {
    // A sample is turned by a phasor that is stepped on: 6 and 6, and anew every 8th time: 38 and 7 to reduce its phase.
    let turned = before as f64 * (12.0 + 45.0 / 8.0);
    // A tap is a product and a sum of two parts, and there is the one that stays.
    let sums = 2.0 * (2.0 * taps as f64 + 1.0) * (over_pulses + over_samples) as f64;
    OPERATIONS.fetch_add((turned + sums) as u64, Ordering::Relaxed);
}

/// Profiles of `length` bins of each pulse, so many pieces of them, and pixels summed over them: place 2, bin 3, spline 12, carrier 10, sum 8.
pub(super) fn imaged(pulses: usize, length: usize, pieces: usize, pixels: usize) {
    let transform = 5.0 * length as f64 * (length as f64).log2();
    // Of each degree 4 taps of two parts, and a product with the weight.
    let of_pieces = pieces as f64 * 4.0 * (16.0 + 2.0);
    let operations = pulses as f64 * (transform + of_pieces + 35.0 * pixels as f64);
    OPERATIONS.fetch_add(operations as u64, Ordering::Relaxed);
}

#[test]
fn the_account_is_what_the_loops_do() {
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
        let former = FastFactorised { error_db };
        let aim = Aim {
            collection: history.collection(),
            grid: &grid,
            weights: &weights,
            scratch_bytes: SCRATCH_BYTES,
            means: Default::default(),
        };
        let asked = former.asked(Misses::Allowed);
        let told = former
            .decide(&aim, &asked, &Silent)
            .unwrap()
            .cost
            .operations;
        let task = Task {
            history: &history,
            grid: &grid,
            weights: &weights,
            memory_bytes: 1 << 30,
            monitor: &Silent,
            means: Default::default(),
        };
        OPERATIONS.store(0, Ordering::Relaxed);
        former.form_best(&task).unwrap();
        let done = OPERATIONS.load(Ordering::Relaxed) as f64;
        println!(
            "{} x {}, {error_db} dB: {told:.3e} told, {done:.3e} done",
            grid.rows.count, grid.columns.count
        );
        worst = worst.max((told / done).max(done / told));
    }
    // As `cost` says of itself.
    assert!(worst < 1.5, "{worst}");
}
