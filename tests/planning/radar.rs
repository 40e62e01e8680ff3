//! Radar planner against images of the formers.

use glam::DVec3;
use num_complex::Complex64;
use subaperture::focus::formers::FORMERS;
use subaperture::focus::rdbp::{Mode, RangeDopplerBackprojection, Thesis};
use subaperture::focus::{ImageFormer, Task};
use subaperture::geometry::{Axis, ImageGrid};
use subaperture::phase_history::{Collection, PhaseHistory, Weights};
use subaperture::planner::grating::{self, Lobe, Pass};
use subaperture::planner::{Parameters, RadarPlan, Request};
use subaperture::signal::window::Window;
use subaperture::simulate::{PointTargetHistory, Preset, Scatterer, Variation};

/// Pixel spacing along x, in which positions are measured.
const PIXEL_M: f64 = 0.1;

/// Table 4.1.
fn table_4_1() -> Collection {
    let preset = Preset::Table41.simulate(&Variation::default());
    preset.collection().clone()
}

/// The peak within 0.8 m of the expected position of a lobe, in the image of one scatterer by the thesis's mode: cross-range distance, m,
/// and level relative to the scatterer's own.
fn measured(collection: &Collection, sub_cpi: usize, at: DVec3, lobes: &[Lobe]) -> Vec<(f64, f64)> {
    let scatterer = Scatterer {
        position_m: at,
        amplitude: Complex64::ONE,
    };
    let history = PointTargetHistory::new(collection.clone(), vec![scatterer], None);
    // Lobes lie at the scatterer's range, up to 0.3 m from its row: several rows.
    let axis = |middle: f64, step: f64, half: usize| Axis {
        start: middle - half as f64 * step,
        step,
        count: 2 * half + 1,
    };
    let columns = axis(at.x, PIXEL_M, 400);
    let grid = ImageGrid::horizontal(columns, axis(at.y, 0.05, 10), 0.0);
    let weights = Weights::new(collection, Window::None, Window::None);
    let task = Task::new(&history, &grid, &weights);
    let thesis = RangeDopplerBackprojection {
        mode: Mode::Thesis(Thesis::default()),
        error_db: -60.0,
        sub_cpi: Some(sub_cpi),
        patch_m: None,
    };
    let image = thesis.form(&task).unwrap().image;
    let main = image.pixels[10 * columns.count + 400].norm();
    let sides = lobes
        .iter()
        .flat_map(|lobe| [-lobe.cross_range_m, lobe.cross_range_m]);
    sides
        .map(|expected_m| {
            let near = (0..image.pixels.len()).filter(|i| {
                let distance_m = columns.at(i % columns.count) - at.x;
                (distance_m - expected_m).abs() < 0.8
            });
            let peak = near
                .max_by(|&a, &b| image.pixels[a].norm().total_cmp(&image.pixels[b].norm()))
                .unwrap();
            let level = f64::from(image.pixels[peak].norm() / main);
            let place_m = columns.at(peak % columns.count) - at.x;
            (place_m.abs(), 20.0 * level.log10())
        })
        .collect()
}

/// Assert that lobes on both sides are within a pixel and `tolerance_db` of the prediction.
fn assert_lobes(
    collection: &Collection,
    sub_cpi: usize,
    at: DVec3,
    lobes: &[Lobe],
    tolerance_db: f64,
) {
    let found = measured(collection, sub_cpi, at, lobes);
    for (i, (place_m, level_db)) in found.into_iter().enumerate() {
        let lobe = lobes[i / 2];
        println!(
            "{sub_cpi} pulses, lobe {}: {:.2} m {:.2} dB predicted, {place_m:.2} m {level_db:.2} dB found",
            lobe.order, lobe.cross_range_m, lobe.level_db
        );
        assert!((place_m - lobe.cross_range_m).abs() <= PIXEL_M, "{lobe:?}");
        assert!((level_db - lobe.level_db).abs() <= tolerance_db, "{lobe:?}");
    }
}

#[test]
fn grating_lobes_of_20_sub_cpis_agree_with_prediction() {
    // Figure 4.5. Bilinear interpolation and Keystone's edges leave errors of about -50 dB: at worst 0.35 of the third lobe, in quadrature
    // with it (real where it is imaginary): 0.5 dB. The closed form is of first order in an edge phase of 0.44 rad: 0.44^2 / 10, 0.2 dB.
    let collection = table_4_1();
    for at in [DVec3::ZERO, DVec3::new(21.3, 17.7, 0.0)] {
        let lobes = grating::lobes(&collection, 52, at, 38.0, 10);
        assert_eq!(lobes.len(), 3);
        assert_lobes(&collection, 52, at, &lobes, 0.7);
        let pass = Pass {
            wavelength_m: 299_792_458.0 / 10e9,
            bandwidth_hz: 200e6,
            range_m: 5000.0 + at.y,
            spacing_m: 0.125,
            num_pulses: 1040,
        };
        let closed: Vec<Lobe> = (1..=3).map(|k| grating::lobe_level(&pass, 52, k)).collect();
        assert_lobes(&collection, 52, at, &closed, 0.7);
    }
}

#[test]
fn grating_lobes_of_long_sub_cpis_agree_with_prediction() {
    // Edge phases of 1.8 and 2.8 radians, beyond the closed form.
    let collection = table_4_1();
    for sub_cpi in [104, 130] {
        let lobes = grating::lobes(&collection, sub_cpi, DVec3::ZERO, 25.0, 10);
        assert!(lobes.len() >= 4);
        assert_lobes(&collection, sub_cpi, DVec3::ZERO, &lobes, 0.7);
    }
}

#[test]
fn compensation_to_scatterer_removes_its_grating_lobes() {
    let mut collection = table_4_1();
    let uncompensated = grating::lobes(&collection, 104, DVec3::ZERO, 20.0, 3);
    for pulse in &mut collection.pulses {
        pulse.reference_m = DVec3::ZERO;
        pulse.reference_path_m = pulse.path_m(DVec3::ZERO);
    }
    let predicted = grating::lobes(&collection, 104, DVec3::ZERO, 20.0, 3);
    assert_eq!(predicted.len(), 3);
    let found = measured(&collection, 104, DVec3::ZERO, &predicted);
    for (i, (_, level_db)) in found.into_iter().enumerate() {
        let (before, after) = (uncompensated[i / 2].level_db, predicted[i / 2].level_db);
        println!(
            "lobe {}: {before:.1} dB before, {after:.1} predicted, {level_db:.1} found",
            i / 2 + 1
        );
        // The remainder is the aperture's own side lobes within 0.8 m, -32 dB at the ninth and lower.
        assert!(after < -80.0, "{after}");
        assert!(
            level_db < before - 8.0 && level_db < -28.0,
            "{before} {level_db}"
        );
    }
}

#[test]
fn radar_plan_of_table_4_1_agrees_with_hand_calculation() {
    let collection = Parameters::default().collection().unwrap();
    let grid: ImageGrid = "x=-40:40:0.25,y=-40:40:0.25,z=0".parse().unwrap();
    let request = Request {
        grid: &grid,
        error_db: -60.0,
        memory_bytes: 1 << 30,
        thesis_sub_cpi: 52,
        beamwidth_rad: Some(0.026),
        power: None,
        chain: None,
    };
    let plan = RadarPlan::new(&collection, &request).unwrap();
    let aperture = plan.aperture;
    // lambda = 2.998 cm. Track: 1040 pulses that represent 0.125 m each; the null of their sum is at lambda / (4 sin theta) of 130 m,
    // 0.57658 m. The middle of the band is half a sample below the carrier, 4e-5 of it, and its 2 % blur the null, a sixth of their square
    // twice: 1e-4.
    let resolution_m = aperture.cross_range_resolution_m.unwrap();
    assert!(
        (resolution_m / 0.57660 - 1.0).abs() < 3e-4,
        "{resolution_m}"
    );
    // The beam of 0.026 rad illuminates 130 m: lambda / (4 sin 0.013) = 0.57654.
    assert!((aperture.beam_resolution_m.unwrap() / 0.57654 - 1.0).abs() < 3e-4);
    // At 10.1 GHz (less a sample): 2.969 cm; the scene of 80 m needs 2.969 cm 5000 / 160 = 0.928 m, the beam 0.571 m.
    assert!(
        (aperture.scene.spacing_m / 0.928 - 1.0).abs() < 2e-3,
        "{aperture:?}"
    );
    assert!(
        (aperture.beam.unwrap().spacing_m / 0.571 - 1.0).abs() < 2e-3,
        "{aperture:?}"
    );
    assert_eq!(
        (aperture.scene_is_sampled, aperture.beam_is_sampled),
        (Some(true), Some(true))
    );
    assert!((aperture.unambiguous_range_m.unwrap() - 149_896.229).abs() < 1e-3);
    // The image repeats after lambda R / 2d = 599.6 m: with seven pulses the first lobe is beyond 80 m.
    assert_eq!(plan.sub_cpis.thesis_clear_pulses, Some(7));
    assert_eq!(plan.sub_cpis.thesis_lobes.len(), 6);
    assert!(plan.sub_cpis.predicted_db <= -60.0);
    assert_eq!(plan.work.pixels, 320 * 320);
    // Every former of the list can form it, and the thesis's mode.
    let mut all: Vec<&str> = FORMERS.iter().map(|entry| entry.name).collect();
    all.push("rdbp, thesis");
    let names: Vec<&str> = plan.costs.iter().map(|cost| &*cost.algorithm).collect();
    assert_eq!(names, all);
    let operations = |name: &str| {
        let cost = plan.costs.iter().find(|cost| cost.algorithm == name);
        cost.unwrap().operations
    };
    // The frequency-domain formers' operations do not grow with pulses times pixels.
    for name in ["ffbp", "pfa", "rda", "omega-k"] {
        assert!(operations(name) < 0.2 * operations("bp"), "{name}");
    }
    assert!(operations("rdbp") < operations("bp"));
    assert!(operations("bp") < operations("exact"));
}
