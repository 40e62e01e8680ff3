//! The radar planner against what the image formers do.

use glam::DVec3;
use num_complex::Complex64;
use subaperture::focus::rdbp::{Mode, RangeDoppler};
use subaperture::focus::{ImageFormer, Silent, Task, Weights};
use subaperture::geometry::{Axis, ImageGrid};
use subaperture::phase_history::PhaseHistory;
use subaperture::planner::grating::{self, Pass, PointResponse};
use subaperture::signal::window::Window;
use subaperture::simulate::{Preset, Scatterer, Simulated, Variation};

/// Table 4.1 with one scatterer.
fn table_4_1(position_m: DVec3) -> Simulated {
    let preset = Preset::Table41.simulate(&Variation::default());
    let scatterer = Scatterer {
        position_m,
        amplitude: Complex64::ONE,
    };
    Simulated::new(preset.collection().clone(), vec![scatterer], None)
}

fn lobes(position_m: DVec3) {
    let history = table_4_1(position_m);
    let collection = history.collection();
    let pixel_m = 0.1;
    let x = Axis {
        start: position_m.x - 50.0,
        step: pixel_m,
        count: 1001,
    };
    let y = Axis {
        start: position_m.y - 0.4,
        step: 0.05,
        count: 11,
    };
    let grid = ImageGrid::horizontal(x, y, 0.0);
    let weights = Weights::new(collection, Window::None, Window::None);
    let task = Task {
        history: &history,
        grid: &grid,
        weights: &weights,
        memory_bytes: 1 << 30,
        monitor: &Silent,
    };
    let thesis = RangeDoppler {
        mode: Mode::Thesis,
        error_db: -60.0,
        sub_cpi: Some(52),
        patch_m: None,
    };
    let image = thesis.form(&task).unwrap().image;
    let response = PointResponse::new(collection, 52, position_m).unwrap();
    let predicted = grating::lobes(collection, 52, position_m, 50.0, 4);
    println!(
        "main {} {}",
        response.at(position_m),
        image.pixels[8 * 1001 + 500]
    );
    let pass = Pass {
        wavelength_m: 299_792_458.0 / 10e9,
        bandwidth_hz: 200e6,
        range_m: 5000.0 + position_m.y,
        spacing_m: 0.125,
        num_pulses: 1040,
    };
    for lobe in &predicted {
        for side in [-1.0, 1.0] {
            let c = 500.0 + side * lobe.cross_range_m / pixel_m;
            let lo = (c - 8.0) as usize;
            let mut best = (0.0f32, 0, 0);
            let mut bestp = (0.0f64, 0, 0);
            for r in 0..11 {
                for col in lo..(lo + 17) {
                    let v = image.pixels[r * 1001 + col].norm();
                    if v > best.0 {
                        best = (v, r, col);
                    }
                    let v = response.at(grid.position_m(r, col)).norm();
                    if v > bestp.0 {
                        bestp = (v, r, col);
                    }
                }
            }
            println!(
                "order {} at {:.2} pred {:.2} dB closed {:.2} | measured {:.2} dB at {:.2} row {} | response {:.2} dB at {:.2} row {}",
                lobe.order,
                lobe.cross_range_m,
                lobe.level_db,
                grating::lobe_level(&pass, 52, lobe.order).level_db,
                20.0 * best.0.log10(),
                (best.2 as f64 - 500.0) * pixel_m,
                best.1,
                20.0 * bestp.0.log10(),
                (bestp.2 as f64 - 500.0) * pixel_m,
                bestp.1
            );
        }
    }
}

#[test]
fn grating_lobes_are_where_and_as_high_as_predicted() {
    lobes(DVec3::ZERO);
    lobes(DVec3::new(21.3, 17.7, 0.0));
}
