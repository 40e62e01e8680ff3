//! Pixels on a surface: the formers that follow reliefs against the exact sum, phase included; the others refuse.

use num_complex::Complex32;
use subaperture::focus::exact::Exact;
use subaperture::focus::formers::{FORMERS, former};
use subaperture::focus::patch::PatchSize;
use subaperture::focus::plan::{InMemory, Request};
use subaperture::focus::{ImageFormer, Misses, Plan, SCRATCH_BYTES, Task, Work};
use subaperture::geometry::{Axis, ImageGrid, Relief};
use subaperture::monitor::Silent;
use subaperture::phase_history::{PhaseHistory, Weights};
use subaperture::signal::window::Window;
use subaperture::simulate::{Noise, Preset, Simulated, Variation};
use subaperture_tests::error_db;

fn history() -> Simulated {
    Preset::Table41.simulate(&Variation {
        noise: Some(Noise {
            power_db: -20.0,
            seed: 11,
        }),
        ..Variation::default()
    })
}

/// A rough surface over the plane: hills of so many metres and steps of a quarter of that, at nodes 3.7 m apart that no pixel knows of.
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
    let history = history();
    let weights = Weights::new(history.collection(), Window::Hamming, Window::default());
    for grid in [
        on_hills("x=-40:40:1.9,y=-38:40:1.7", 1.5),
        on_hills("x=-40:40:1.9,y=-38:40:1.7,roll=20", 14.0),
        on_hills("x=-46:46:0.83,y=-40:40:0.91,yaw=30", 30.0),
        on_hills("r=3:44:1.3,theta=-170:180:4", 10.0),
    ] {
        let task = Task {
            history: &history,
            grid: &grid,
            weights: &weights,
            memory_bytes: 1 << 30,
            monitor: &Silent,
            means: Default::default(),
        };
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
        // The surface is another place than the plane: as unlike as two images of noise.
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

/// Tiles of a plan that went through text, with other threads and sizes, have the bits of the whole.
#[test]
fn tiles_on_surfaces_are_parts_of_the_whole() {
    let history = history();
    let grid = on_hills("x=-40:37.4:1.09,y=-38:39.9:1.47", 12.0);
    for name in ["exact", "bp", "ffbp", "auto"] {
        let own = former(name, &serde_json::json!({})).unwrap();
        let request = Request {
            collection: history.collection(),
            grid: &grid,
            fast: Window::Hamming,
            slow: Window::default(),
            scratch_bytes: SCRATCH_BYTES,
            misses: Misses::Allowed,
            means: Default::default(),
        };
        let plan = Plan::new(&*own, &request, &Silent).unwrap();
        let formed = |tile: Option<[usize; 2]>, threads: usize| -> Vec<Complex32> {
            let mut plan = Plan::from_text(&plan.to_text()).unwrap();
            assert_eq!(plan.grid, grid);
            if let Some([rows, columns]) = tile {
                plan.tile = PatchSize { rows, columns };
            }
            let weights = plan.weights(history.collection()).unwrap();
            let opened = plan.open(history.collection(), &weights).unwrap();
            let work = Work {
                history: &history,
                memory_bytes: 1 << 30,
                monitor: &Silent,
            };
            let indices: Vec<usize> = (0..plan.num_tiles()).rev().collect();
            let mut image = InMemory::new(&plan.grid);
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            let pool = pool.build().unwrap();
            pool.install(|| opened.form(&work, &indices, 3, &mut image))
                .unwrap();
            image.image.pixels
        };
        let whole = formed(None, 2);
        assert!(whole == formed(Some([11, 19]), 3), "{name}");
        assert!(whole == formed(Some([53, 7]), 1), "{name}");
    }
}
