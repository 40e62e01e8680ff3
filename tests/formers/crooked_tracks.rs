//! The frequency-domain formers on tracks that are neither straight nor even, against the exact sum.

use glam::DVec3;
use serde_json::json;
use subaperture::focus::exact::Exact;
use subaperture::focus::former::SCRATCH_BYTES;
use subaperture::focus::omega_k::OmegaK;
use subaperture::focus::rda::RangeDopplerAlgorithm;
use subaperture::focus::{Aim, FormError, ImageFormer, Task, Tile, Work};
use subaperture::geometry::ImageGrid;
use subaperture::image::Image;
use subaperture::monitor::Silent;
use subaperture::phase_history::{PhaseHistory, Weights};
use subaperture::signal::window::Window;
use subaperture::simulate::Simulated;
use subaperture_tests::error_db;

use crate::strip_scene::{OMEGA_K, RDA, Radar, STRIPMAP, errors_db, others, try_form, twelve};

/// Smooth random motion: of each direction four sines of up to `cycles` cycles over the aperture, together of `rms_m`.
fn wandering(seed: u32, num_pulses: usize, cycles: f64, rms_m: DVec3) -> impl Fn(f64) -> DVec3 {
    let mut state = u64::from(seed) * 2 + 1;
    let mut draw = move || {
        // Knuth's multiplier; the upper bits.
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    let terms: Vec<[[f64; 2]; 3]> = (0..4)
        .map(|_| [(); 3].map(|()| [cycles * draw(), draw()]))
        .collect();
    move |n| {
        let along = n / num_pulses as f64;
        let sum = |i: usize| -> f64 {
            let each = terms.iter().map(|term| term[i]);
            each.map(|[cycles, turn]| (std::f64::consts::TAU * (cycles * along + turn)).sin())
                .sum()
        };
        // Four sines have an RMS of sqrt(2).
        rms_m * DVec3::new(sum(0), sum(1), sum(2)) / 2f64.sqrt()
    }
}

/// The image as one compensation forms it, whatever it errs by.
fn compensated(
    former: &dyn ImageFormer,
    history: &Simulated,
    grid: &ImageGrid,
    window: Window,
    compensation: &str,
) -> Result<Image, FormError> {
    let weights = Weights::new(history.collection(), window, window);
    let aim = Aim {
        collection: history.collection(),
        grid,
        weights: &weights,
        scratch_bytes: SCRATCH_BYTES,
        means: Default::default(),
    };
    let forming = former.open(aim, &json!({ "compensation": compensation }))?;
    let work = Work {
        history,
        memory_bytes: 1 << 30,
        monitor: &Silent,
    };
    let mut tiles = [Tile::whole(grid)];
    forming.form(&work, &mut tiles)?;
    let [tile] = tiles;
    Ok(Image {
        pixels: tile.pixels,
        rows: grid.rows.count,
        columns: grid.columns.count,
    })
}

#[test]
fn table() {
    let grid: ImageGrid = "x=-30:30:1.3,y=-30:30:1.7".parse().unwrap();
    for rms_m in [
        DVec3::new(0.5, 0.0, 0.0),
        DVec3::new(0.0, 0.03, 0.03),
        DVec3::new(0.5, 0.1, 0.1),
        DVec3::new(0.5, 0.3, 0.3),
        DVec3::new(0.5, 1.0, 1.0),
    ] {
        let path = wandering(3, STRIPMAP.num_pulses, 4.0, rms_m);
        let collection = STRIPMAP.collection_on(|n| {
            let (at, _) = (STRIPMAP.antennas)(n);
            (at + path(n), at + path(n))
        });
        let history = Simulated::new(collection, twelve([30.0, 30.0]), None);
        for window in [Window::None, Window::default()] {
            let weights = Weights::new(history.collection(), window, window);
            let exact = try_form(&history, &grid, window, &Exact, 1 << 30, &Silent)
                .unwrap()
                .image;
            let former = OmegaK { error_db: -150.0 };
            let formed = try_form(&history, &grid, window, &former, 1 << 30, &Silent).unwrap();
            println!(
                "{rms_m} {window:?}: best {:.1} predicted {:.1} {}",
                error_db(&formed.image, &exact),
                formed.predicted_error_db,
                formed.settings["compensations_db"]
            );
            for compensation in ["point", "places", "ranges"] {
                let started = std::time::Instant::now();
                let image = compensated(&former, &history, &grid, window, compensation).unwrap();
                println!(
                    "   {compensation} {:.1} in {:.2?}",
                    error_db(&image, &exact),
                    started.elapsed()
                );
            }
        }
    }
}

#[test]
fn small_deviations_are_compensated_and_large_ones_refused() {
    // 3 cm of slow sway, and antennas 0.5 m apart: exact at the grid's middle.
    let radar = Radar {
        antennas: |n| {
            let sway_m = 0.03 * (n * 0.02).sin();
            let at = DVec3::new(0.4 * n, -3000.0 + sway_m, sway_m);
            let half = DVec3::new(0.25, 0.0, 0.0);
            (at - half, at + half)
        },
        ..STRIPMAP
    };
    let history = radar.over_many([30.0, 30.0]);
    let grid = "x=-30:30:1.3,y=-30:30:1.7";
    let omega_k = OmegaK { error_db: -40.0 };
    let rda = RangeDopplerAlgorithm {
        error_db: -40.0,
        ..RDA
    };
    let got = errors_db("sway", &history, grid, Window::None, [&omega_k, &rda]);
    assert!(got.iter().all(|&db| db < -40.0), "{got:?}");
    // What the track leaves is in the prediction of either.
    for former in [&omega_k as &dyn ImageFormer, &rda] {
        let grid = grid.parse().unwrap();
        let formed = try_form(&history, &grid, Window::None, former, 1 << 30, &Silent).unwrap();
        let predicted_db = formed.predicted_error_db;
        assert!((-64.0..-40.0).contains(&predicted_db), "{predicted_db}");
    }

    // A circle of 3 km: 2.4 m off the line at the ends of 240 m.
    let curved = Radar {
        antennas: |n| {
            let angle = n * 0.4 / 3000.0;
            let at = DVec3::new(3000.0 * angle.sin(), -3000.0 * angle.cos(), 0.0);
            (at, at)
        },
        ..STRIPMAP
    };
    let gap = Radar {
        antennas: |n| {
            let at = DVec3::new(0.4 * n + 20.0 * n.signum(), -3000.0, 0.0);
            (at, at)
        },
        ..STRIPMAP
    };
    for radar in [curved, gap] {
        let history = radar.over_many([30.0, 30.0]);
        for former in [&OMEGA_K as &dyn ImageFormer, &RDA] {
            let grid = grid.parse().unwrap();
            let weights = Weights::new(history.collection(), Window::None, Window::None);
            let refused = former.form(&Task {
                history: &history,
                grid: &grid,
                weights: &weights,
                memory_bytes: 1 << 30,
                monitor: &Silent,
                means: Default::default(),
            });
            let error = refused.unwrap_err();
            assert!(matches!(error, FormError::BoundMissed { .. }), "{error}");
            assert!(error.to_string().contains("not straight"), "{error}");
            assert!(others(&error).contains(&"rdbp"), "{error:?}");
            // Formed all the same, it is as bad as was said.
            let [got] = errors_db(
                "bent",
                &history,
                "x=-30:30:2.3,y=-30:30:2.7",
                Window::None,
                [former],
            );
            assert!(got > -40.0, "{got}");
        }
    }
}
