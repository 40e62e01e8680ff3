//! Pixels on a surface: formers that support relief against the exact sum, phase included; the others refuse.

use std::f64::consts::TAU;

use crate::tiles::{Run, WHOLE, execute};
use crate::track_scene::scene;
use glam::DVec3;
use num_complex::Complex64;
use subaperture::focus::exact::Exact;
use subaperture::focus::formers::{FORMERS, former};
use subaperture::focus::{BoundPolicy, ImageFormer, ImageSpec, Plan, Task};
use subaperture::geometry::{Axis, ImageGrid, Relief};
use subaperture::monitor::Silent;
use subaperture::phase_history::{PhaseHistory, Weights};
use subaperture::quality::response::{Carrier, Settings, Target, measure};
use subaperture::signal::window::Window;
use subaperture::simulate::{Noise, PointTargetHistory, Scatterer};
use subaperture_tests::error_db;

/// A bent track 1.2 km up and 1.5 km aside, so that heights affect ranges. Scatterers lie up to 20 m above and below the plane.
fn history(num_pulses: usize) -> PointTargetHistory {
    let antennas = |n: f64| {
        let part = n * 500.0 / num_pulses as f64;
        let at = DVec3::new(
            0.35 * part,
            -1500.0 + 2e-4 * part * part,
            1200.0 + 0.01 * part,
        );
        (at, at)
    };
    let plain = scene(num_pulses, (9.5e9, 1.1e6, 256), antennas, 40.0);
    let raised = plain
        .scatterers()
        .iter()
        .zip(0..)
        .map(|(own, i)| Scatterer {
            position_m: own.position_m + DVec3::Z * (f64::from(i) * 4.0 - 20.0),
            ..*own
        });
    let noise = Noise {
        // High enough that no pixel is dark and errors are as planned.
        power_db: 20.0,
        seed: 11,
    };
    let raised = raised.collect();
    PointTargetHistory::new(plain.collection().clone(), raised, Some(noise))
}

/// A rough surface over the plane: hills of `height_m` and steps of a quarter of that, at nodes 3.7 m apart that coincide with no pixel.
fn relief(height_m: f64) -> Relief {
    let axis = |start: f64| Axis {
        start,
        step: 3.7,
        count: 27,
    };
    let (rows, columns) = (axis(-47.0), axis(-49.0));
    let mut heights_m = Vec::new();
    for row in 0..rows.count {
        for column in 0..columns.count {
            let (x, y) = (columns.at(column), rows.at(row));
            let hill = (x / 17.0).sin() * (y / 13.0).cos();
            let step = if (row * 7 + column * 5) % 3 == 0 {
                0.25
            } else {
                0.0
            };
            heights_m.push(height_m * (hill + step));
        }
    }
    Relief::new("hills", [rows, columns], heights_m, 0.0).unwrap()
}

fn on_hills(text: &str, height_m: f64) -> ImageGrid {
    let grid: ImageGrid = text.parse().unwrap();
    grid.on(relief(height_m))
}

fn of(name: &str, error_db: f64) -> Box<dyn ImageFormer> {
    former(name, &serde_json::json!({ "error_db": error_db })).unwrap()
}

#[test]
fn formers_keep_their_bounds_on_surfaces() {
    let history = history(500);
    let weights = Weights::new(history.collection(), Window::Hamming, Window::default());
    for grid in [
        on_hills("x=-40:40:1.9,y=-38:40:1.7", 1.5),
        on_hills("x=-40:40:1.9,y=-38:40:1.7,roll=20", 14.0),
        on_hills("x=-46:46:0.83,y=-40:40:0.91,yaw=30", 30.0),
        on_hills("r=3:44:1.3,theta=-170:180:4", 10.0),
    ] {
        let task = Task::new(&history, &grid, &weights);
        let exact = Exact.form(&task).unwrap().image;
        let flat = ImageGrid {
            relief: None,
            ..grid.clone()
        };
        let plane = Exact
            .form(&Task {
                grid: &flat,
                ..task
            })
            .unwrap()
            .image;
        // The image on the surface differs from that on the plane as much as two images of noise.
        assert!(error_db(&plane, &exact) > -3.0);
        for (name, bound_db) in [
            ("bp", -50.0),
            ("bp", -90.0),
            ("ffbp", -45.0),
            ("ffbp", -60.0),
            ("ffbp", -80.0),
            ("auto", -60.0),
        ] {
            let formed = of(name, bound_db).form(&task).unwrap();
            let measured_db = error_db(&formed.image, &exact);
            println!("{name}: {bound_db} dB asked, {measured_db:.1} dB measured");
            assert!(measured_db <= bound_db, "{name}: {measured_db}");
            assert!(formed.predicted_error_db >= measured_db - 3.0, "{name}");
        }
        for entry in &FORMERS {
            let own = former(entry.name, &serde_json::json!({})).unwrap();
            if own.follows_relief() {
                continue;
            }
            let refused = own.form(&task).unwrap_err().to_string();
            let said = refused.contains("hills") && refused.contains(entry.name);
            assert!(said, "{}: {refused}", entry.name);
        }
    }
}

/// Factorised backprojection with decimated histories on a fine grid, compared with the exact sum at every 13th pixel.
#[test]
fn ffbp_keeps_bound_on_surface_over_several_decimations() {
    const EVERY: usize = 13;
    let history = history(3000);
    let weights = Weights::new(history.collection(), Window::None, Window::None);
    for height_m in [2.0, 25.0] {
        let fine = on_hills("x=-46:46:0.2,y=-40:40:0.16", height_m);
        let every = |axis: Axis| Axis {
            step: axis.step * EVERY as f64,
            count: axis.count.div_ceil(EVERY),
            ..axis
        };
        let coarse = ImageGrid {
            rows: every(fine.rows),
            columns: every(fine.columns),
            ..fine.clone()
        };
        let task = Task {
            memory_bytes: 2 << 30,
            ..Task::new(&history, &fine, &weights)
        };
        let exact = Exact
            .form(&Task {
                grid: &coarse,
                ..task
            })
            .unwrap()
            .image;
        for bound_db in [-50.0, -75.0] {
            let formed = of("ffbp", bound_db).form(&task).unwrap();
            let mut picked = exact.clone();
            for (i, pixel) in picked.pixels.iter_mut().enumerate() {
                let (row, column) = (i / exact.columns, i % exact.columns);
                *pixel = formed.image.pixels[EVERY * (row * formed.image.columns + column)];
            }
            let measured_db = error_db(&picked, &exact);
            println!(
                "{height_m} m: {bound_db} dB asked, {measured_db:.1} dB measured; {:?}",
                formed.settings
            );
            assert!(measured_db <= bound_db, "{measured_db}");
            assert!(
                formed.settings["levels"].as_u64() > Some(1),
                "{:?}",
                formed.settings
            );
        }
    }
}

/// A point on the slope of a hill, where the phase varies non-linearly: position, amplitude and phase are exact.
#[test]
fn point_on_slope_has_exact_position_amplitude_and_phase() {
    let axis = Axis {
        start: -30.0,
        step: 0.25,
        count: 241,
    };
    let heights_m = (0..axis.count * axis.count).map(|i| {
        let (x, y) = (axis.at(i % axis.count), axis.at(i / axis.count));
        5.0 * (x / 11.0).sin() * (y / 9.0).cos() + 0.3 * y
    });
    let hills = Relief::new("hills", [axis, axis], heights_m.collect(), 0.0).unwrap();
    let (x, y) = (3.31, -4.17);
    let place = DVec3::new(x, y, hills.height_m(x, y));
    let [_, slope] = hills.slopes(x, y);
    assert!(slope.abs() > 0.3, "{slope}");
    let point = Scatterer {
        position_m: place,
        amplitude: Complex64::from_polar(1.0, 0.5),
    };
    let history = PointTargetHistory::new(history(500).collection().clone(), vec![point], None);
    let weights = Weights::new(history.collection(), Window::default(), Window::default());
    let grid = "x=-3:9.6:0.06,y=-14:6:0.15"
        .parse::<ImageGrid>()
        .unwrap()
        .on(hills);
    let task = Task::new(&history, &grid, &weights);
    let image = Exact.form(&task).unwrap().image;
    // The middle of the band, and the antenna position at the middle pulse.
    let wavelength_m = 299_792_458.0 / (9.5e9 + 127.5 * 1.1e6);
    let antenna = DVec3::new(0.0, -1500.0, 1200.0);
    let settings = Settings {
        carrier: Some(Carrier::new(antenna, wavelength_m)),
        ..Settings::default()
    };
    let response = measure(&image, &grid, Target::Brightest, &settings).unwrap();
    let found = DVec3::from(response.position_m);
    let off = found - place;
    println!(
        "{off:.4} m off, {:.4} dB, {:.4} rad",
        response.level_db, response.phase_rad
    );
    // Cells are 0.2 m by 0.6 m and larger; where the slope changes over a cell, a hundredth of it.
    assert!(off.x.abs() < 0.004 && off.y.abs() < 0.01, "{off}");
    assert!(response.level_db.abs() < 0.03, "{}", response.level_db);
    let wanted =
        0.5 + 2.0 * TAU / wavelength_m * (found.distance(antenna) - place.distance(antenna));
    let apart = Complex64::cis(response.phase_rad - wanted).arg();
    assert!(apart.abs() < 0.05, "{} {wanted}", response.phase_rad);
}

/// Tiles of a plan read from text, with other threads and sizes, are bit-identical to the whole image.
#[test]
fn tiles_on_surfaces_are_bit_identical_to_whole_image() {
    let history = history(500);
    let grid = on_hills("x=-40:37.4:1.09,y=-38:39.9:1.47", 12.0);
    for name in ["exact", "bp", "ffbp", "auto"] {
        let own = former(name, &serde_json::json!({})).unwrap();
        let weights = Weights::new(history.collection(), Window::Hamming, Window::default());
        let spec = ImageSpec::new(history.collection(), &grid, &weights);
        let plan = Plan::new(&*own, &spec, BoundPolicy::Allowed, &Silent).unwrap();
        assert_eq!(Plan::from_text(&plan.to_text()).unwrap().grid, grid);
        let formed = |tile: Option<[usize; 2]>, threads: usize| {
            let run = Run {
                threads,
                tile,
                most_a_pass: 3,
                backwards: true,
                ..WHOLE
            };
            execute(&plan, &history, &run)
        };
        let whole = formed(None, 2);
        assert!(whole == formed(Some([11, 19]), 3), "{name}");
        assert!(whole == formed(Some([53, 7]), 1), "{name}");
    }
}
