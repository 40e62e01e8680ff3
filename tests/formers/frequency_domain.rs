//! Frequency-domain formers against the exact sum: complex images, phase included, and point responses.

use glam::DVec3;
use num_complex::Complex64;
use subaperture::focus::exact::Exact;
use subaperture::focus::frequency_domain::{Stage, StageKind};
use subaperture::focus::{FormError, ImageFormer, Task};
use subaperture::geometry::{Axis, ImageGrid};
use subaperture::monitor::{Monitor, Silent};
use subaperture::phase_history::{PhaseHistory, Weights};
use subaperture::signal::window::Window;
use subaperture::simulate::{PointTargetHistory, Preset, Scatterer, Variation};

use crate::strip_scene::{
    OMEGA_K, RAIL, RDA, RDA_WITHOUT_SRC, Radar, SQUINT, STRIPMAP, errors_db, others, try_form,
};

#[test]
fn stripmap_images_keep_bound() {
    let history = STRIPMAP.over_many([50.0, 50.0]);
    for window in [Window::None, Window::default()] {
        let [omega_k, rda, without] = errors_db(
            "stripmap",
            &history,
            "x=-55:55:2.3,y=-60:60:2.1",
            window,
            [&OMEGA_K, &RDA, &RDA_WITHOUT_SRC],
        );
        assert!(omega_k < -95.0, "{omega_k}");
        assert!(rda < -75.0 && without < -35.0, "{rda} {without}");
    }
}

#[test]
fn rail_images_keep_bound() {
    let history = RAIL.over_many([2.0, 2.5]);
    let [omega_k, rda] = errors_db(
        "rail",
        &history,
        "x=-2:2:0.11,y=-2.5:2.5:0.13",
        Window::None,
        [&OMEGA_K, &RDA],
    );
    assert!(omega_k < -85.0 && rda < -45.0, "{omega_k} {rda}");
}

#[test]
fn table_4_1_images_keep_bound() {
    let history = Preset::Table41.simulate(&Variation::default());
    let [omega_k, rda] = errors_db(
        "Table 4.1",
        &history,
        "x=-40:40:1.97,y=-40:40:1.91",
        Window::None,
        [&OMEGA_K, &RDA],
    );
    assert!(omega_k < -95.0 && rda < -80.0, "{omega_k} {rda}");
}

#[test]
fn squinted_images_keep_bound() {
    let history = SQUINT.over_many([15.0, 15.0]);
    let [omega_k, rda, without] = errors_db(
        "squint",
        &history,
        "x=-16:16:0.53,y=-16:16:0.57",
        Window::None,
        [&OMEGA_K, &RDA, &RDA_WITHOUT_SRC],
    );
    assert!(omega_k < -100.0 && rda < -20.0, "{omega_k} {rda}");
    assert!(without > -5.0, "{without}");
}

/// Position and width of a point's response along a cut.
struct Cut {
    peak_m: f64,
    width_m: f64,
    peak_side_lobe_db: f64,
    integrated_side_lobe_db: f64,
}

impl Cut {
    /// From values at `start_m + i step_m`, which include the point's main lobe.
    fn new(start_m: f64, step_m: f64, values: &[num_complex::Complex32]) -> Self {
        let power: Vec<f64> = values.iter().map(|z| f64::from(z.norm_sqr())).collect();
        let top = (0..power.len())
            .max_by(|&a, &b| power[a].total_cmp(&power[b]))
            .unwrap();
        // A parabola through the three largest values.
        let (a, b, c) = (power[top - 1], power[top], power[top + 1]);
        let shift = 0.5 * (a - c) / (a - 2.0 * b + c);
        let peak = b - 0.25 * (a - c) * shift;
        let crossing = |i: usize, j: usize| {
            let t = (peak / 2.0 - power[i]) / (power[j] - power[i]);
            i as f64 + t * (j as f64 - i as f64)
        };
        let right = (top..).find(|&i| power[i + 1] < peak / 2.0).unwrap();
        let left = (0..=top)
            .rev()
            .find(|&i| power[i - 1] < peak / 2.0)
            .unwrap();
        let width = crossing(right, right + 1) - crossing(left, left - 1);
        let null_right = (right..).find(|&i| power[i + 1] > power[i]).unwrap();
        let null_left = (0..=left).rev().find(|&i| power[i - 1] > power[i]).unwrap();
        let main: f64 = power[null_left..=null_right].iter().sum();
        let sides = power[..null_left].iter().chain(&power[null_right + 1..]);
        Self {
            peak_m: start_m + (top as f64 + shift) * step_m,
            width_m: width * step_m,
            peak_side_lobe_db: 10.0
                * (sides.clone().fold(0.0, |a: f64, &b| a.max(b)) / peak).log10(),
            integrated_side_lobe_db: 10.0 * (sides.sum::<f64>() / main).log10(),
        }
    }
}

#[test]
fn points_have_exact_position_and_width() {
    // Cuts of 20 resolution cells: 0.37 m along track (240 m of track at 3 km), 1.6 m on the ground (1.5 m of range from 1 km height).
    let stripmap = (&STRIPMAP, DVec3::new(13.31, -17.73, 0.0), [0.37, 1.59]);
    // 1.6 m of rail at 9.4 m and 1.2 GHz; 200 MHz.
    let rail = (&RAIL, DVec3::new(0.31, 0.43, 0.0), [0.73, 0.75]);
    for (radar, at_m, [along_m, across_m]) in [stripmap, rail] {
        let point = Scatterer {
            position_m: at_m,
            amplitude: Complex64::ONE,
        };
        let history = PointTargetHistory::new(radar.collection(), vec![point], None);
        let lobes = if along_m < 0.5 { 10.0 } else { 4.0 };
        let cut = |former: &dyn ImageFormer, along: bool| {
            let (centre_m, resolution_m) = if along {
                (at_m.x, along_m)
            } else {
                (at_m.y, across_m)
            };
            let (start_m, step_m) = (centre_m - lobes * resolution_m, resolution_m / 40.0);
            let range = format!("{start_m}:{}:{step_m}", centre_m + lobes * resolution_m);
            let grid = if along {
                format!("x={range},y={}:{}:1", at_m.y, at_m.y + 0.5)
            } else {
                format!("x={}:{}:1,y={range}", at_m.x, at_m.x + 0.5)
            };
            let grid = grid.parse().unwrap();
            let formed = try_form(&history, &grid, Window::None, former, 1 << 30, &Silent).unwrap();
            (
                Cut::new(start_m, step_m, &formed.image.pixels),
                centre_m,
                resolution_m,
            )
        };
        for along in [true, false] {
            let (exact, ..) = cut(&Exact, along);
            for former in [&OMEGA_K as &dyn ImageFormer, &RDA] {
                let (got, centre_m, resolution_m) = cut(former, along);
                let off = (got.peak_m - centre_m) / resolution_m;
                let width = got.width_m / exact.width_m - 1.0;
                let pslr_db = got.peak_side_lobe_db - exact.peak_side_lobe_db;
                let islr_db = got.integrated_side_lobe_db - exact.integrated_side_lobe_db;
                println!(
                    "{} along {along}: off {off:.1e} resolutions, width {:.4} m {width:+.1e}, PSLR \
                     {:.2} dB {pslr_db:+.1e}, ISLR {:.2} dB {islr_db:+.1e}",
                    former.name(),
                    got.width_m,
                    got.peak_side_lobe_db,
                    got.integrated_side_lobe_db,
                );
                assert!(width.abs() < 0.01 && pslr_db.abs() < 0.2 && islr_db.abs() < 0.2);
                assert!(off.abs() <= 1.0 / 128.0, "{off}");
            }
        }
    }
}

#[test]
fn tilted_planes_and_polar_grids_keep_bound() {
    let history = STRIPMAP.over_many([20.0, 20.0]);
    for grid in [
        "x=-20:20:1.7,y=-20:20:1.9,yaw=30,pitch=10,roll=-20",
        "r=5:25:1.1,theta=-80:80:4,cx=-10,cy=3",
    ] {
        let [omega_k, rda] =
            errors_db("plane", &history, grid, Window::default(), [&OMEGA_K, &RDA]);
        assert!(omega_k < -100.0 && rda < -75.0, "{omega_k} {rda}");
    }
}

#[test]
fn undersampled_slow_time_has_the_ambiguities_of_the_exact_sum() {
    // 3 m between pulses and 600 m of track: ambiguities lie 30 m apart, inside the scene.
    let radar = Radar {
        num_pulses: 200,
        antennas: |n| {
            let at = DVec3::new(3.0 * n, -3000.0, 0.0);
            (at, at)
        },
        ..STRIPMAP
    };
    let history = radar.over_many([40.0, 10.0]);
    let grid = "x=-60:60:0.57,y=-10:10:1.9";
    let [omega_k] = errors_db("coarse", &history, grid, Window::None, [&OMEGA_K]);
    assert!(omega_k < -95.0, "{omega_k}");
}

#[test]
fn unsuited_geometry_is_refused() {
    let history = RAIL.over_many([2.0, 2.0]);
    let refused =
        |history: &PointTargetHistory, grid: &str, memory_bytes, former: &dyn ImageFormer| {
            let grid = grid.parse().unwrap();
            try_form(history, &grid, Window::None, former, memory_bytes, &Silent).unwrap_err()
        };
    // Pixels on the track's line, close to it, far along it, and grids beyond the memory.
    for (grid, expected) in [
        ("x=-1:1:0.5,y=-9:-8:0.5", "too near"),
        ("x=-1:1:0.5,y=-8.9:-8:0.5", "too near"),
        ("x=-1:100:0.5,y=-2:2:0.5", "too near"),
    ] {
        let error = refused(&history, grid, 1 << 30, &OMEGA_K);
        assert!(error.to_string().contains(expected), "{error}");
        assert!(others(&error).contains(&"bp"), "{error:?}");
    }
    for former in [&OMEGA_K as &dyn ImageFormer, &RDA] {
        let error = refused(&history, "x=-1:1:0.1,y=-1:1:0.1", 40_000, former);
        assert!(matches!(error, FormError::Memory { .. }), "{error}");
    }
    // 0.3 to 1.7 GHz: a wavenumber 45 degrees from broadside at 1.7 GHz does not exist at 1 GHz.
    let wide = Radar {
        band: (0.3e9, 20e6, 71),
        ..RAIL
    };
    let wide = wide.over_many([2.0, 2.0]);
    let error = refused(&wide, "x=-30:30:0.5,y=20:24:0.5", 1 << 30, &RDA);
    assert!(others(&error).contains(&"omega-k"), "{error:?}");
}

#[test]
fn image_is_bit_identical_for_any_thread_count_and_cancelled_work_stops() {
    struct Stop;
    impl Monitor for Stop {
        fn progress(&self, _fraction: f64) {}
        fn cancelled(&self) -> bool {
            true
        }
    }
    let history = RAIL.over_many([2.0, 2.0]);
    let grid: ImageGrid = "x=-2:2:0.11,y=-2:2:0.13".parse().unwrap();
    for former in [&OMEGA_K as &dyn ImageFormer, &RDA] {
        let form = || try_form(&history, &grid, Window::None, former, 1 << 30, &Silent).unwrap();
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            pool.build().unwrap().install(|| form().image)
        };
        assert_eq!(on(1), on(3), "{}", former.name());
        let stopped = try_form(&history, &grid, Window::None, former, 1 << 30, &Stop);
        assert!(matches!(stopped, Err(FormError::Cancelled)));
    }
}

/// A stored stage: kind, values, rows, columns.
type Kept = (StageKind, Vec<num_complex::Complex32>, Axis, Axis);

#[test]
fn stages_hold_the_documented_arrays() {
    // The rail: a scatterer 9 m away, 0.3 m ahead of the aperture's centre.
    let at = DVec3::new(0.3, 0.0, 0.0);
    let scatterer = Scatterer {
        position_m: at,
        amplitude: Complex64::ONE,
    };
    let history = PointTargetHistory::new(RAIL.collection(), vec![scatterer], None);
    let grid: ImageGrid = "x=-1:1.01:0.1,y=-1:1.01:0.1".parse().unwrap();
    let weights = Weights::new(history.collection(), Window::None, Window::None);
    let task = Task {
        memory_bytes: 1 << 28,
        ..Task::new(&history, &grid, &weights)
    };
    for rda in [true, false] {
        let mut stages: Vec<Kept> = Vec::new();
        let mut keep = |stage: &Stage| {
            stages.push((stage.kind, stage.values.to_vec(), stage.rows, stage.columns));
        };
        let (observed, plain, sizes) = match rda {
            true => (
                RDA.form_observed(&task, &mut keep),
                RDA.form_best(&task),
                RDA.sizes(history.collection(), &grid).unwrap(),
            ),
            false => (
                OMEGA_K.form_observed(&task, &mut keep),
                OMEGA_K.form_best(&task),
                OMEGA_K.sizes(history.collection(), &grid).unwrap(),
            ),
        };
        assert_eq!(observed.unwrap().image.pixels, plain.unwrap().image.pixels);
        let [spectrum, corrected, image] = &stages[..] else {
            panic!("{} stages", stages.len())
        };

        let (kind, values, rows, columns) = spectrum;
        assert_eq!(*kind, StageKind::Spectrum);
        assert_eq!((rows.count, columns.count), (51, sizes.along_wavenumbers));
        // Slow-time transform by a plain sum over the paths of 81 antennas.
        for (k, q) in [(0, 0), (25, columns.count / 2), (50, columns.count - 1)] {
            let sum: Complex64 = (0..81)
                .map(|n| {
                    let along_m = 0.02 * (f64::from(n) - 40.0);
                    let range_m = 9f64.hypot(0.3 - along_m);
                    let phase = rows.at(k) * range_m + columns.at(q) * 0.02 * f64::from(n);
                    Complex64::cis(-phase) / (81.0 * 51.0)
                })
                .sum();
            let got = values[k * columns.count + q];
            let error = (Complex64::new(got.re.into(), got.im.into()) - sum).norm();
            // The largest value is 1 / 51; float32 phases of some 500 rad are computed in float64.
            assert!(error < 1e-6 / 51.0, "{k} {q}: {error:e}");
        }

        let (kind, values, rows, columns) = corrected;
        assert_eq!(*kind, StageKind::RangeDoppler);
        assert_eq!(
            (rows.count, columns.count),
            (sizes.along_wavenumbers, sizes.ranges)
        );
        let peak = |line: &[num_complex::Complex32]| {
            let largest = |a: &usize, b: &usize| line[*a].norm().total_cmp(&line[*b].norm());
            (0..line.len()).max_by(largest).unwrap()
        };
        // Directions well inside the aperture's extent, from 0.3 - 0.8 to 0.3 + 0.8 m at 9 m: the line is straight there.
        let inside = (0..rows.count).filter(|&q| (rows.at(q) / 50.0 - 0.033).abs() < 0.05);
        let mut seen = 0;
        for q in inside {
            let line = &values[q * columns.count..(q + 1) * columns.count];
            let range_m = columns.at(peak(line));
            assert!((range_m - 9.0).abs() <= columns.step, "{q}: {range_m}");
            seen += 1;
        }
        assert!(seen >= 3, "{seen}");

        let (kind, values, rows, columns) = image;
        assert_eq!(*kind, StageKind::Image);
        assert_eq!((rows.count, columns.count), (sizes.ranges, sizes.columns));
        let place = peak(values);
        let (range_m, along_m) = (
            rows.at(place / columns.count),
            columns.at(place % columns.count),
        );
        assert!((range_m - 9.0).abs() <= rows.step && (along_m - 0.3).abs() <= columns.step);
    }
}

#[test]
fn error_of_scatterer_in_corner_is_predicted() {
    // Seen from the far end of the aperture, the near corner lies at the edge of the band of directions.
    let preset = Preset::Table41.simulate(&Variation::default());
    for (x, y) in [(39.0, 39.0), (-39.5, -39.5), (0.0, 0.0), (39.9, -39.9)] {
        let scatterer = Scatterer {
            position_m: DVec3::new(x, y, 0.0),
            amplitude: Complex64::ONE,
        };
        let history = PointTargetHistory::new(preset.collection().clone(), vec![scatterer], None);
        // Sampled at the resolution; a coarser grid might contain side lobes only.
        let grid = "x=-40:40:0.61,y=-40:40:0.67";
        // Within 3 dB of the prediction.
        let [omega_k, rda] = errors_db("corner", &history, grid, Window::None, [&OMEGA_K, &RDA]);
        assert!(omega_k < -100.0 && rda < -80.0, "{omega_k} {rda}");
    }
}
