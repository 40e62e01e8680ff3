//! Survey of apertures of any kind and pulse order, and default grids without aliasing.

use std::f64::consts::TAU;

use glam::DVec3;
use subaperture::geometry::{Extent, SceneFrame};
use subaperture::phase_history::{Collection, PhaseHistory, Pulse, Sweep};
use subaperture::resolution::survey::{MAX_PIXELS, Survey};
use subaperture::simulate::scenario::{Scenario, examples};

const C_M_S: f64 = 299_792_458.0;

/// Pulses from each of `antennas`, monostatic.
fn collection(
    antennas: impl Iterator<Item = DVec3>,
    [start_hz, step_hz]: [f64; 2],
    num_samples: usize,
    extent: Option<[(f64, f64); 2]>,
) -> Collection {
    let pulses = antennas.enumerate().map(|(n, antenna_m)| Pulse {
        time_s: n as f64 * 1e-3,
        transmitter_m: antenna_m,
        receiver_m: antenna_m,
        reference_m: DVec3::ZERO,
        reference_path_m: 2.0 * antenna_m.length(),
        start_hz,
        step_hz,
        sweep: Sweep::AT_ONCE,
        recorded_path_m: None,
    });
    Collection {
        name: "test".to_owned(),
        num_samples,
        pulses: pulses.collect(),
        frame: SceneFrame::Local,
        extent: extent.map(|[x_m, y_m]| Extent { x_m, y_m }),
        timed: true,
    }
}

fn near(name: &str, value: f64, wanted: f64, relative: f64) {
    assert!(
        (value / wanted - 1.0).abs() < relative,
        "{name}: {value}, not {wanted}"
    );
}

#[test]
fn aperture_length_is_independent_of_pulse_order() {
    let band = [77e9, 1e7];
    // Eight alternating channels 9 mm apart, 40 times: summed from pulse to pulse over 5 m.
    let mimo = (0..320).map(|n| DVec3::new(f64::from(n % 8) * 9e-3, -5.0, 0.0));
    let survey = Survey::of(&collection(mimo, band, 64, None)).unwrap();
    near("MIMO", survey.aperture_length_m, 63e-3, 1e-9);
    near(
        "MIMO angle",
        survey.aperture_angle_deg,
        (63e-3f64 / 5.0).atan().to_degrees(),
        1e-3,
    );
    near(
        "MIMO unambiguous",
        survey.unambiguous_cross_range_m.unwrap(),
        C_M_S / 77.315e9 * 5.0 / 18e-3,
        2e-3,
    );
    // Two halves of a pass, the second one first.
    let pass = |n: i32| DVec3::new(f64::from(n) * 0.5, -1000.0, 300.0);
    let swapped = (50..100).chain(0..50).map(pass);
    let in_order = Survey::of(&collection((0..100).map(pass), band, 64, None)).unwrap();
    let swapped = Survey::of(&collection(swapped, band, 64, None)).unwrap();
    near("swapped", swapped.aperture_length_m, 49.5, 1e-9);
    near(
        "swapped angle",
        swapped.aperture_angle_deg,
        in_order.aperture_angle_deg,
        1e-9,
    );
    near(
        "swapped unambiguous",
        swapped.unambiguous_cross_range_m.unwrap(),
        in_order.unambiguous_cross_range_m.unwrap(),
        1e-9,
    );
    // A circle seen at a grazing angle of 35.5 degrees, and three quarters of one.
    let around = |turn: f64, count: i32| {
        (0..count).map(move |n| {
            let (sin, cos) = (turn * f64::from(n) / f64::from(count)).sin_cos();
            DVec3::new(700.0 * cos, 700.0 * sin, 500.0)
        })
    };
    let circle = Survey::of(&collection(around(TAU, 3600), band, 64, None)).unwrap();
    assert_eq!(circle.aperture_azimuth_deg, 360.0);
    // 72 chords of 5 degrees between means over as much: (5 deg)^2 / 24 short, twice.
    near("circle", circle.aperture_length_m, TAU * 700.0, 7e-4);
    // Opposite antennas.
    near(
        "circle angle",
        circle.aperture_angle_deg,
        2.0 * (700f64 / 500.0).atan().to_degrees(),
        1e-6,
    );
    let most = Survey::of(&collection(around(0.75 * TAU, 2700), band, 64, None)).unwrap();
    near("3/4 circle", most.aperture_azimuth_deg, 270.0, 1e-3);
    near(
        "3/4 circle",
        most.aperture_length_m,
        0.75 * TAU * 700.0,
        2e-3,
    );
    // A pass in both directions is no longer than in one.
    let back = (0..100).chain((0..100).rev()).map(pass);
    near(
        "there and back",
        Survey::of(&collection(back, band, 64, None))
            .unwrap()
            .aperture_length_m,
        49.5,
        1e-9,
    );
}

/// Extent of spatial frequencies along x and y at a position, from differences of paths.
fn extents(collection: &Collection, place_m: DVec3) -> [f64; 2] {
    [DVec3::X, DVec3::Y].map(|axis| {
        let mut all: Vec<f64> = Vec::new();
        for pulse in &collection.pulses {
            for k in [-0.5, collection.num_samples as f64 - 0.5] {
                let slope = (pulse.path_m(place_m + axis * 1e-4)
                    - pulse.path_m(place_m - axis * 1e-4))
                    / 2e-4;
                all.push((pulse.start_hz + k * pulse.step_hz) / C_M_S * slope);
            }
        }
        let low = all.iter().copied().fold(f64::INFINITY, f64::min);
        all.iter().copied().fold(f64::NEG_INFINITY, f64::max) - low
    })
}

/// 77 GHz from a short rail, with a scene from 1 to 8 m that extends far off boresight: at the corner, range lies along x as much as along
/// y, and pixels suited to the middle alias.
#[test]
fn default_grid_samples_near_range_scene_without_aliasing() {
    let rail = (0..200).map(|n| DVec3::new(f64::from(n) * 1e-3 - 0.1, 0.0, 0.0));
    let extent = [(-4.5, 4.5), (3.0, 7.0)];
    let collection = collection(rail, [76e9, 3.9e7], 100, Some(extent));
    let survey = Survey::of(&collection).unwrap();
    let grid = survey.default_grid().unwrap().grid;
    let places = |i: usize, j: usize| {
        grid.position_m(
            (grid.rows.count - 1) * i / 20,
            (grid.columns.count - 1) * j / 20,
        )
    };
    let mut least = f64::INFINITY;
    for i in 0..=20 {
        for j in 0..=20 {
            let [x, y] = extents(&collection, places(i, j));
            // Twice as fine as necessary, except for the margin of positions between the survey's 9 x 9.
            let oversampling = (1.0 / (grid.columns.step * x)).min(1.0 / (grid.rows.step * y));
            least = least.min(oversampling);
        }
    }
    println!(
        "{} x {} pixels, at least {least:.3} times as fine as needed",
        grid.columns.count, grid.rows.count
    );
    assert!(least > 1.95, "{least}");
    // And not much finer: the most demanding position determines it.
    assert!(least < 2.2, "{least}");
}

#[test]
fn default_grid_reports_ambiguous_or_cropped_scene() {
    // A full circle at 9.6 GHz, 3600 pulses: 9.3 mm of extent over 20 m are 4300 pixels per side at half of it, and lambda R / (2 d) =
    // 10.99 m.
    let around = (0..3600).map(|n| {
        let (sin, cos) = (TAU * f64::from(n) / 3600.0).sin_cos();
        DVec3::new(700.0 * cos, 700.0 * sin, 500.0)
    });
    let scene = [(-10.0, 10.0), (-10.0, 10.0)];
    let circle = collection(around, [9.3e9, 4.6875e6], 128, Some(scene));
    let survey = Survey::of(&circle).unwrap();
    let suited = survey.default_grid().unwrap();
    assert!(suited.grid.num_pixels() <= MAX_PIXELS as u64);
    let [x, y] = extents(&circle, DVec3::ZERO);
    let (columns, rows) = (suited.grid.columns, suited.grid.rows);
    assert!(
        columns.step * x < 0.52 && rows.step * y < 0.52,
        "still sampled"
    );
    // The grid's middle is the scene's.
    assert!((columns.start + columns.at(columns.count)).abs() < 1e-9);
    let cropped = suited.cropped.unwrap();
    assert!(
        cropped.contains("20.0 x 20.0 m") && cropped.contains("its middle, "),
        "{cropped}"
    );
    near(
        "repeats",
        survey.unambiguous_cross_range_m.unwrap(),
        10.99,
        0.005,
    );
    let ambiguity = survey.ambiguity().unwrap();
    assert!(
        ambiguity.contains("28.3 m across") && ambiguity.contains("every 11.0 m"),
        "{ambiguity}"
    );
    // A long, narrow scene keeps its depth; a valid one is covered completely without warnings.
    let pass = || (0..2000).map(|n| DVec3::new(f64::from(n) * 0.05 - 50.0, -1000.0, 400.0));
    let strip = [(-2000.0, 2000.0), (-50.0, 50.0)];
    let long = collection(pass(), [9.7e9, 1e6], 600, Some(strip));
    let long = Survey::of(&long).unwrap().default_grid().unwrap();
    let deep_m = long.grid.rows.step * long.grid.rows.count as f64;
    assert!(
        (deep_m - 100.0).abs() < 1.0 && long.cropped.is_some(),
        "{deep_m}"
    );
    assert!(long.grid.num_pixels() as f64 > 0.99 * MAX_PIXELS as f64);
    let small = collection(
        pass(),
        [9.7e9, 1e6],
        600,
        Some([(-40.0, 40.0), (-40.0, 40.0)]),
    );
    let small = Survey::of(&small).unwrap();
    assert_eq!(
        (small.ambiguity(), small.default_grid().unwrap().cropped),
        (None, None)
    );
}

/// Every example scenario is unambiguous over its own scene, and its default grid covers it.
#[test]
fn example_scenes_are_unambiguous() {
    for name in examples::names() {
        let text = examples::text(name).unwrap();
        let scenario = Scenario::new(name, text, ".");
        let experiment = scenario.experiment().unwrap();
        let recording = experiment.record(experiment.pairs()[0]).unwrap();
        let survey = Survey::of(recording.collection()).unwrap();
        println!("{name}: {:?}", survey.ambiguity());
        match survey.default_grid() {
            Ok(suited) => println!(
                "{name}: {} x {} pixels, {:?}",
                suited.grid.columns.count, suited.grid.rows.count, suited.cropped
            ),
            Err(why) => println!("{name}: {why}"),
        }
        assert_eq!(survey.ambiguity(), None, "{name}");
    }
}
