//! Frequency-domain formers on tracks that are bent or flown unevenly, against the exact sum.

use glam::DVec3;
use serde_json::json;
use subaperture::focus::exact::Exact;
use subaperture::focus::omega_k::OmegaK;
use subaperture::focus::rda::RangeDopplerAlgorithm;
use subaperture::focus::{FormError, FormerChoices, ImageFormer, ImageSpec, Task, Tile, Work};
use subaperture::geometry::ImageGrid;
use subaperture::image::Image;
use subaperture::monitor::Silent;
use subaperture::phase_history::{PhaseHistory, Weights};
use subaperture::signal::window::Window;
use subaperture::simulate::PointTargetHistory;
use subaperture_tests::error_db;

use crate::strip_scene::{
    OMEGA_K, RAIL, RDA, Radar, STRIPMAP, errors_db, others, try_form, twelve,
};

/// Smooth random motion with RMS `rms_m` along each axis: four sines of up to `cycles` cycles over the aperture.
fn wandering(seed: u32, num_pulses: usize, cycles: f64, rms_m: DVec3) -> impl Fn(f64) -> DVec3 {
    let mut state = u64::from(seed) * 2 + 1;
    let mut draw = move || {
        // Knuth's multiplier; the upper bits are used.
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

/// The image without windows by one method of motion compensation, whatever its error.
fn compensated(
    former: &dyn ImageFormer,
    history: &PointTargetHistory,
    grid: &ImageGrid,
    compensation: &str,
) -> Result<Image, FormError> {
    let weights = Weights::new(history.collection(), Window::None, Window::None);
    let spec = ImageSpec::new(history.collection(), grid, &weights);
    let choices = FormerChoices::new(json!({ "compensation": compensation }));
    let forming = former.open(spec, &choices)?;
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

/// The stripmap radar with random motion of RMS `rms_m` along track, across track and in height.
fn wandering_stripmap(seed: u32, rms_m: DVec3) -> PointTargetHistory {
    let path = wandering(seed, STRIPMAP.num_pulses, 4.0, rms_m);
    let collection = STRIPMAP.collection_on(|n| {
        let at = (STRIPMAP.antennas)(n).0 + path(n);
        (at, at)
    });
    PointTargetHistory::new(collection, twelve([30.0, 30.0]), None)
}

/// Errors of omega-k after motion compensation of the point, of positions, and of ranges, for surge and for sway and heave (m). These are
/// the numbers in the documentation of motion compensation. No prediction is below the measurement.
#[test]
fn residual_of_each_motion_compensation() {
    let grid: ImageGrid = "x=-30:30:2.3,y=-30:30:2.7".parse().unwrap();
    let none = f64::NEG_INFINITY;
    for (surge_m, sway_m, expected) in [
        (0.5, 0.0, [[-20.0, 0.0], [none, -100.0], [none, -98.0]]),
        (0.0, 0.03, [[-52.0, -36.0], [-52.0, -36.0], [none, -60.0]]),
        (0.5, 0.1, [[-20.0, 0.0], [-42.0, -25.0], [none, -49.0]]),
        (0.5, 0.3, [[-20.0, 0.0], [-32.0, -15.0], [none, -39.0]]),
        (0.5, 1.0, [[-20.0, 0.0], [-22.0, 0.0], [none, -27.0]]),
    ] {
        let history = wandering_stripmap(3, DVec3::new(surge_m, sway_m, sway_m));
        let form = |former| try_form(&history, &grid, Window::None, former, 1 << 30, &Silent);
        let exact = form(&Exact).unwrap().image;
        // A bound so small that every method is evaluated.
        let former = OmegaK { error_db: -190.0 };
        let formed = form(&former).unwrap();
        for (compensation, [least_db, most_db]) in
            ["point", "places", "ranges"].into_iter().zip(expected)
        {
            let image = compensated(&former, &history, &grid, compensation).unwrap();
            let got_db = error_db(&image, &exact);
            let predicted_db = formed.settings["compensations_db"][compensation].as_f64();
            println!(
                "{surge_m} {sway_m} {compensation}: {got_db:.1} dB, predicted {predicted_db:.1?}"
            );
            assert!(least_db < got_db && got_db < most_db, "{got_db}");
            // Predictions below -95 dB omit the kernels' error; those above -3 dB are saturated.
            let of_track = predicted_db.filter(|db| (-95.0..-3.0).contains(db));
            assert!(
                of_track.is_none_or(|db| got_db <= db),
                "{got_db} {predicted_db:?}"
            );
        }
        let best_db = error_db(&formed.image, &exact);
        assert!(best_db <= formed.predicted_error_db, "{best_db}");
    }
}

#[test]
fn cheapest_motion_compensation_that_keeps_bound_is_used() {
    let grid = "x=-30:30:2.3,y=-30:30:2.7";
    for seed in 0..3 {
        // A straight track flown unevenly needs the compensation of positions; one with 6 cm RMS of sway that of ranges.
        for (rms_m, method) in [
            (DVec3::new(0.7, 0.0, 0.0), "places"),
            (DVec3::new(0.7, 0.06, 0.06), "ranges"),
        ] {
            let history = wandering_stripmap(seed, rms_m);
            let omega_k = OmegaK { error_db: -42.0 };
            let rda = RangeDopplerAlgorithm {
                error_db: -42.0,
                ..RDA
            };
            for window in [Window::None, Window::default()] {
                let formers: [&dyn ImageFormer; 2] = [&omega_k, &rda];
                let got = errors_db("wandering", &history, grid, window, formers);
                assert!(got.iter().all(|&db| db < -42.0), "{got:?}");
            }
            let formed = try_form(
                &history,
                &grid.parse().unwrap(),
                Window::None,
                &omega_k,
                1 << 30,
                &Silent,
            );
            assert_eq!(formed.unwrap().settings["motion_compensation"], method);
        }
    }
}

/// Directions differ most near the ground: 1.2 GHz, 4 m of track at 2 m height, pixels 8 to 14 m away, and 1 cm of sway.
#[test]
fn residual_of_directions_near_the_ground_is_predicted() {
    let path = wandering(5, 201, 3.0, DVec3::new(0.05, 0.01, 0.01));
    let radar = Radar {
        num_pulses: 201,
        ..RAIL
    };
    let collection = radar.collection_on(|n| {
        let at = DVec3::new(0.02 * n, -11.0, 2.0) + path(n);
        (at, at)
    });
    let history = PointTargetHistory::new(collection, twelve([2.0, 3.0]), None);
    let [omega_k] = errors_db(
        "truck",
        &history,
        "x=-2:2:0.11,y=-3:3:0.13",
        Window::None,
        [&OMEGA_K],
    );
    let grid: ImageGrid = "x=-2:2:0.11,y=-3:3:0.13".parse().unwrap();
    let exact = try_form(&history, &grid, Window::None, &Exact, 1 << 30, &Silent).unwrap();
    let point = compensated(&OMEGA_K, &history, &grid, "point").unwrap();
    let point_db = error_db(&point, &exact.image);
    println!("for a point {point_db:.1} dB");
    assert!(omega_k < point_db - 10.0, "{omega_k} {point_db}");
}

#[test]
fn image_is_bit_identical_for_any_thread_count_and_memory_is_counted() {
    let history = wandering_stripmap(7, DVec3::new(0.5, 0.1, 0.1));
    let grid: ImageGrid = "x=-30:30:2.3,y=-30:30:2.7".parse().unwrap();
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let form = || compensated(&OMEGA_K, &history, &grid, "ranges").unwrap();
        pool.build().unwrap().install(form)
    };
    assert_eq!(on(1), on(3));
    let short = try_form(&history, &grid, Window::None, &OMEGA_K, 1 << 20, &Silent);
    assert!(matches!(short, Err(FormError::Memory { .. })));
}

#[test]
fn small_deviations_are_compensated_and_large_ones_refused() {
    // 3 cm of slow sway, and antennas 0.5 m apart: the compensation is exact at the grid's middle.
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
    // The prediction of both formers includes the residual of the track.
    for former in [&omega_k as &dyn ImageFormer, &rda] {
        let grid = grid.parse().unwrap();
        let formed = try_form(&history, &grid, Window::None, former, 1 << 30, &Silent).unwrap();
        let predicted_db = formed.predicted_error_db;
        assert!((-64.0..-40.0).contains(&predicted_db), "{predicted_db}");
    }

    // A circle of radius 3 km: the ends of 240 m of track lie 2.4 m off the line.
    let curved = Radar {
        antennas: |n| {
            let angle = n * 0.4 / 3000.0;
            let at = DVec3::new(3000.0 * angle.sin(), -3000.0 * angle.cos(), 0.0);
            (at, at)
        },
        ..STRIPMAP
    };
    {
        let history = curved.over_many([30.0, 30.0]);
        for former in [&OMEGA_K as &dyn ImageFormer, &RDA] {
            let grid = grid.parse().unwrap();
            let weights = Weights::new(history.collection(), Window::None, Window::None);
            let refused = former.form(&Task::new(&history, &grid, &weights));
            let error = refused.unwrap_err();
            assert!(matches!(error, FormError::BoundMissed { .. }), "{error}");
            assert!(error.to_string().contains("not straight"), "{error}");
            assert!(others(&error).contains(&"rdbp"), "{error:?}");
            // Formed with `BoundPolicy::Allowed`, the image has the predicted error.
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

#[test]
fn gaps_and_stops_cause_no_error() {
    // 40 m without pulses in the middle of the track, and a radar that stands still for a third of its pulses.
    let gap = |n: f64| 0.4 * n + 20.0 * n.signum();
    let stop = |n: f64| 0.4 * (n - n.clamp(-100.0, 100.0));
    let straight: [(&str, &dyn Fn(f64) -> f64); 2] = [("gap", &gap), ("stop", &stop)];
    for (case, along_m) in straight {
        let collection = STRIPMAP.collection_on(|n| {
            let at = DVec3::new(along_m(n), -3000.0, 0.0);
            (at, at)
        });
        let history = PointTargetHistory::new(collection, twelve([30.0, 30.0]), None);
        let formers: [&dyn ImageFormer; 2] = [&OMEGA_K, &RDA];
        let [omega_k, rda] = errors_db(
            case,
            &history,
            "x=-30:30:2.3,y=-30:30:2.7",
            Window::None,
            formers,
        );
        assert!(omega_k < -95.0 && rda < -70.0, "{omega_k} {rda}");
    }
}
