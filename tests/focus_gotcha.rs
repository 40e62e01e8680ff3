//! The image formers on a real recording, against the exact sum.

use std::path::Path;

use glam::DVec3;
use subaperture::crosscheck::crosscheck;
use subaperture::focus::bp::Backprojection;
use subaperture::focus::exact::Exact;
use subaperture::focus::ffbp::FastFactorised;
use subaperture::focus::rdbp::{Mode, RangeDoppler};
use subaperture::focus::{ImageFormer, Silent, Task, Weights};
use subaperture::geometry::ImageGrid;
use subaperture::io::open::{Options, open_all};
use subaperture::phase_history::{Aperture, PhaseHistory};
use subaperture::signal::window::Window;

/// Both degrees of the recording as one aperture, if at hand.
fn gotcha() -> Option<Aperture> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/gotcha");
    let paths = [1, 2].map(|i| folder.join(format!("data_3dsar_pass1_az00{i}_HH.mat")));
    if let Some(missing) = paths.iter().find(|path| !path.exists()) {
        println!("skipped: {} not found", missing.display());
        return None;
    }
    Some(open_all(&paths, &Options::default()).unwrap())
}

#[test]
fn error_on_a_thousand_pixels_and_the_brightest_point() {
    let Some(history) = gotcha() else { return };
    let grid: ImageGrid = "x=-50:50:0.2,y=-50:50:0.2,z=0".parse().unwrap();
    let weights = Weights::new(history.collection(), Window::None, Window::None);
    let task = Task {
        history: &history,
        grid: &grid,
        weights: &weights,
        memory_bytes: 1 << 30,
        monitor: &Silent,
    };

    // Knuth's generator: a thousand pixels, the same in every run.
    let mut state = 1u64;
    let chosen: Vec<usize> = std::iter::repeat_with(|| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % grid.num_pixels() as usize
    })
    .take(1000)
    .collect();
    let points: Vec<DVec3> = chosen
        .iter()
        .map(|i| grid.position_m(i / grid.columns.count, i % grid.columns.count))
        .collect();
    let exact = Exact::at_points(&history, &weights, &points, 1 << 30, &Silent).unwrap();
    let power: f64 = exact.iter().map(|z| z.norm_sqr()).sum();

    let rdbp = RangeDoppler {
        mode: Mode::Precise,
        error_db: -60.0,
        sub_cpi: None,
        patch_m: None,
    };
    let formers: [(&dyn ImageFormer, f64); 2] =
        [(&rdbp, -60.0), (&Backprojection { error_db: -50.0 }, -50.0)];
    for (former, bound_db) in formers {
        let image = former.form(&task).unwrap().image;
        let error: f64 = chosen
            .iter()
            .zip(&exact)
            .map(|(&i, e)| {
                let z = image.pixels[i];
                (f64::from(z.re) - e.re).powi(2) + (f64::from(z.im) - e.im).powi(2)
            })
            .sum();
        let error_db = 10.0 * (error / power).log10();
        println!("{}: {error_db:.1} dB, bound {bound_db} dB", former.name());
        assert!(error_db <= bound_db, "{}: {error_db}", former.name());

        let brightest = (0..image.pixels.len())
            .max_by(|&a, &b| {
                image.pixels[a]
                    .norm_sqr()
                    .total_cmp(&image.pixels[b].norm_sqr())
            })
            .unwrap();
        let at = grid.position_m(
            brightest / grid.columns.count,
            brightest % grid.columns.count,
        );
        let expected = DVec3::new(-15.6, 21.6, 0.0);
        assert!(at.distance(expected) <= 0.2, "{}: {at}", former.name());
    }
}

/// A vertical plane, on which paths change quickly from row to row; decimated pulses beyond the aperture's ends once cost
/// 23 dB more than predicted there.
#[test]
fn factorised_backprojection_keeps_its_bound_on_a_wall() {
    let Some(history) = gotcha() else { return };
    let text = "x=-15:15:0.15,y=-10:10:0.15,z=0,cx=-15.6,cy=21.6,roll=90";
    let grid: ImageGrid = text.parse().unwrap();
    let weights = Weights::new(history.collection(), Window::None, Window::None);
    let task = Task {
        history: &history,
        grid: &grid,
        weights: &weights,
        memory_bytes: 1 << 30,
        monitor: &Silent,
    };
    // Every 17th pixel, prime to the rows' length.
    let chosen: Vec<usize> = (0..grid.num_pixels() as usize).step_by(17).collect();
    let points: Vec<DVec3> = chosen
        .iter()
        .map(|i| grid.position_m(i / grid.columns.count, i % grid.columns.count))
        .collect();
    let exact = Exact::at_points(&history, &weights, &points, 1 << 30, &Silent).unwrap();
    let power: f64 = exact.iter().map(|z| z.norm_sqr()).sum();
    for bound_db in [-45.0, -60.0] {
        let former = FastFactorised { error_db: bound_db };
        let formed = former.form(&task).unwrap();
        let error: f64 = chosen
            .iter()
            .zip(&exact)
            .map(|(&i, e)| {
                let z = formed.image.pixels[i];
                (f64::from(z.re) - e.re).powi(2) + (f64::from(z.im) - e.im).powi(2)
            })
            .sum();
        let error_db = 10.0 * (error / power).log10();
        let predicted_db = formed.predicted_error_db;
        println!("wall: {error_db:.1} dB, predicted {predicted_db:.1} dB, bound {bound_db} dB");
        assert!(error_db <= bound_db && error_db <= predicted_db + 3.0);
    }
}

#[test]
fn host_and_core_agree() {
    let Some(history) = gotcha() else { return };
    for sub_cpi in [17, 40] {
        let report = crosscheck(&history, sub_cpi, 1 << 30, &Silent).unwrap();
        println!("{sub_cpi} pulses: {:.1} dB", report.worst().1);
        assert!(report.passes(), "{:?}", report.worst());
    }
}
