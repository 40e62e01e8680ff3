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

/// A history of so many pulses and samples made smaller by kernels of `taps`: each sample turned by a phasor that is
/// stepped on (6 and 6) and spread over frequency (2 a real weight and 2 to add), each row so made over pulses.
pub(super) fn refined(taps: usize, [pulses, samples]: [usize; 2], after: usize, by: [usize; 2]) {
    let spread = |count: usize, by: usize| if by > 1 { 4 * taps * count } else { 0 };
    let operations = pulses * (12 * samples + spread(samples, by[1]) + spread(after, by[0]));
    OPERATIONS.fetch_add(operations as u64, Ordering::Relaxed);
}

/// Profiles of `length` bins of each pulse, and pixels summed over them: path 9 and 2, place 3, reading 6, phasor 21, sum 8.
pub(super) fn imaged(pulses: usize, length: usize, pixels: usize) {
    let transform = 5.0 * length as f64 * (length as f64).log2();
    let operations = pulses as f64 * (transform + 49.0 * pixels as f64);
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
    assert!(worst < 1.75, "{worst}");
}
