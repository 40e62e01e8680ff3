//! Operation counts and memory that formers state, against counts by hand.

use glam::DVec3;
use serde_json::Value;
use subaperture::focus::formers::FORMERS;
use subaperture::focus::pfa::PolarFormat;
use subaperture::focus::rdbp::{Mode, RangeDopplerBackprojection, Thesis};
use subaperture::focus::{BoundPolicy, Decision, ImageFormer, ImageSpec, Plan, Task};
use subaperture::geometry::ImageGrid;
use subaperture::monitor::Silent;
use subaperture::phase_history::{PhaseHistory, Weights};
use subaperture::planner::forecast::operations;
use subaperture::signal::window::Window;
use subaperture::simulate::{Preset, Variation};

/// Pulses and frequencies of Table 4.1.
const PULSES: f64 = 1040.0;
const SAMPLES: f64 = 256.0;

/// A grid of 80 x 80 m: `side` pixels.
fn grid(side: usize) -> ImageGrid {
    let step = 80.0 / side as f64;
    let text = format!("x=-40:39.99:{step},y=-40:39.99:{step}");
    let grid: ImageGrid = text.parse().unwrap();
    assert_eq!(grid.num_pixels(), (side * side) as u64);
    grid
}

fn decide(former: &dyn ImageFormer, grid: &ImageGrid) -> Decision {
    let history = Preset::Table41.simulate(&Variation::default());
    let weights = Weights::new(history.collection(), Window::None, Window::None);
    let spec = ImageSpec::new(history.collection(), grid, &weights);
    let goal = former.goal(BoundPolicy::Allowed);
    former.decide(&spec, &goal, &Silent).unwrap()
}

/// Former of the registry; polar format with one reference point, which is not divided into patches.
fn listed(name: &str) -> Box<dyn ImageFormer> {
    if name == "pfa" {
        return Box::new(PolarFormat {
            error_db: -60.0,
            centre_m: Some(DVec3::ZERO),
        });
    }
    let entry = FORMERS.iter().find(|entry| entry.name == name);
    entry.unwrap().within(-60.0)
}

fn transform(length: f64) -> f64 {
    5.0 * length * length.log2()
}

fn near(got: f64, expected: f64, tolerance: f64, name: &str) {
    println!("{name}: {got:.4e}, by hand {expected:.4e}");
    assert!(
        (got / expected - 1.0).abs() <= tolerance,
        "{name}: {got} {expected}"
    );
}

/// Operations of one more pixel: the difference between 300 x 300 and 200 x 200 pixels, where only the number of pixels matters.
#[test]
fn operations_of_a_pixel_agree_with_inner_loop() {
    for (name, operations) in [
        // A complex product (4 products, 2 sums) and a complex sum (2) for each pulse and frequency.
        ("exact", 8.0 * PULSES * SAMPLES),
        // Paths from 16 pulses at 11 each, and as much to fit the position in the spectrum; a phasor; 6 x 6 values, each a real weight (2)
        // and a sum (2).
        ("pfa", 16.0 * 22.0 + 20.0 + 4.0 * 36.0),
        // Position along the line and across it, and 6 taps in both directions, rows first.
        ("omega-k", 40.0),
        ("rda", 40.0),
    ] {
        let former = listed(name);
        let [small, large] = [200, 300].map(|side| decide(&*former, &grid(side)).cost);
        let more = (large.operations - large.shared_operations)
            - (small.operations - small.shared_operations);
        near(
            more / (300.0f64.powi(2) - 200.0f64.powi(2)),
            operations,
            1e-9,
            name,
        );
    }
    for side in [200, 300] {
        let Decision { cost, settings, .. } = decide(&*listed("bp"), &grid(side));
        // For each pulse: position 2; nearest bin and offset 3; a spline of two components 4 per degree; the carrier from the last two 4,
        // times that of the group 6; a complex product 6 and a sum 2.
        let each = 23.0 + 4.0 * settings["spline_degree"].as_f64().unwrap();
        let pixels = (side * side) as f64;
        let own = (cost.operations - cost.shared_operations) / pixels;
        near(own, each * PULSES, 1e-9, "bp");
    }
}

/// Two comparisons with the exact sum, 64 pixels spread evenly and 64 drawn: a complex product (6) and a sum (2) for each pulse and
/// frequency, and a range profile of each pulse. All of 10 x 10 pixels are compared, once.
#[test]
fn forecast_counts_both_comparisons_with_the_exact_sum() {
    let history = Preset::Table41.simulate(&Variation::default());
    let weights = Weights::new(history.collection(), Window::None, Window::None);
    for (side, by_hand) in [
        (10, 100.0 * 8.0 * PULSES * SAMPLES),
        (
            200,
            128.0 * 8.0 * PULSES * SAMPLES + PULSES * transform(SAMPLES),
        ),
    ] {
        let grid = grid(side);
        let task = Task::new(&history, &grid, &weights);
        for name in ["exact", "bp", "ffbp", "pfa"] {
            let former = listed(name);
            let cost = decide(&*former, &grid).cost;
            let counted = operations(&task, &cost) - cost.operations;
            near(counted, by_hand, 1e-6, name);
            println!("{name}: {:.1} %", 100.0 * counted / cost.operations);
        }
    }
}

#[test]
fn each_pulse_has_one_range_transform() {
    let grid = grid(200);
    let decision = decide(&*listed("bp"), &grid);
    let bins = decision.settings["profile_length"].as_f64().unwrap();
    // For each bin read: polynomial coefficients from as many values, and the weight.
    let taps = decision.settings["spline_degree"].as_f64().unwrap() + 1.0;
    let piece = 2.0 * taps * taps + 2.0 * taps;
    let made = decision.cost.shared_operations / PULSES - transform(bins);
    // Shortest and longest path to the grid's edges: no path inside the grid lies outside this interval.
    let history = Preset::Table41.simulate(&Variation::default());
    let edges = (0..200).flat_map(|i| [[0, i], [199, i], [i, 0], [i, 199]]);
    let edges: Vec<_> = edges.map(|[i, j]| grid.position_m(i, j)).collect();
    let pulses = history.collection().pulses.iter();
    let places = pulses.flat_map(|pulse| {
        let bins_m = pulse.step_hz * bins / 299_792_458.0;
        edges
            .iter()
            .map(move |&at| pulse.relative_path_m(at) * bins_m)
    });
    let places: Vec<f64> = places.collect();
    let least = places.iter().copied().fold(f64::INFINITY, f64::min);
    let read = places.iter().copied().fold(f64::NEG_INFINITY, f64::max) - least;
    assert!(read < 0.9 * bins, "{read} of {bins}");
    // Margins on either side: the half-diagonal of a tile of 64 x 64 pixels with its last groups, 16 bins of windows, and rounding to whole
    // bins.
    let bin_m = 299_792_458.0 / (bins * history.collection().pulses[0].step_hz);
    let reach = 2.0 * (32.0 + 15.0) * 2f64.sqrt() * 0.4 / bin_m + 18.0;
    let pieces = made / piece;
    assert!(
        (read..read + 2.0 * reach + 8.0).contains(&pieces),
        "{pieces} {read} {reach}"
    );
}

#[test]
fn operations_of_rdbp_are_maps_and_interpolation() {
    let side = 400;
    let patches = RangeDopplerBackprojection::default().patch_m(10.0);
    let decision = decide(&patches, &grid(side));
    let chosen = |key: &str| decision.settings[key].as_u64().unwrap() as usize;
    let (longest, count) = (chosen("sub_cpi_pulses"), chosen("sub_cpis"));
    let (rows, taps) = (chosen("patch_rows"), chosen("kernel_taps") as f64);
    let patches = side.div_ceil(rows) * side.div_ceil(chosen("patch_columns"));
    // A scatterer at the edge of a patch approaches by 2 x d / R per pulse: offset x, pulse spacing d = 0.125 m, R = 5000 m. Doppler bins are twice the Nyquist
    // rate's at 10.1 GHz plus a tenth, with the kernel's half-width and one bin on both sides.
    let edge_m = (chosen("patch_columns") - 1) as f64 / 2.0 * 80.0 / side as f64;
    let doppler = 2.0 * edge_m * 0.125 / 5000.0 * 10e9 / 299_792_458.0;
    let map = |pulses: f64| {
        let reach = (1.1 * doppler * 2.0 * pulses * 1.01).ceil() + 1.0 + taps / 2.0;
        let bins = 2.0 * reach + 1.0;
        // Two pulses symmetric to the middle and two bins symmetric to zero share 4 products with sums, and as many to rotate sine and
        // cosine.
        8.0 * pulses * SAMPLES
            + SAMPLES * pulses / 2.0 * bins / 2.0 * (8.0 + 8.0)
            + bins * transform(2.0 * SAMPLES)
    };
    let last = PULSES - (count - 1) as f64 * longest as f64;
    assert!(
        last > 0.0 && last <= longest as f64,
        "sub-CPIs of several lengths"
    );
    let maps = (count - 1) as f64 * map(longest as f64) + map(last);
    let pixel = 56.0 + 8.0 * taps + 4.0 * taps * taps;
    let expected = patches as f64 * maps + count as f64 * pixel * (side * side) as f64;
    near(decision.cost.operations, expected, 0.01, "rdbp");
}

#[test]
fn operations_of_thesis_mode_are_scene_maps() {
    let thesis = RangeDopplerBackprojection::default()
        .mode(Mode::Thesis(Thesis::default()))
        .sub_cpi(40);
    let decision = decide(&thesis, &grid(200));
    // 640 and 2560 are lengths of fast transforms: 2^7 5 and 2^9 5.
    let map = 4.0 * SAMPLES * 1600.0 + SAMPLES * transform(640.0) + 640.0 * transform(2560.0);
    near(decision.cost.shared_operations, 26.0 * map, 1e-6, "maps");
    near(
        decision.cost.operations,
        26.0 * (map + 88.0 * 40_000.0),
        1e-6,
        "thesis",
    );
}

/// Operations of Table 4.1 on 400 x 400 pixels within -60 dB from an earlier estimate that ignored rounded lengths and margins, a few per
/// cent.
#[test]
fn operations_agree_with_recorded_counts() {
    for (name, operations) in [
        ("exact", 3.407_872e11),
        // With the carrier demodulated once per tile; 6.508e9 with a phasor for each pixel.
        ("bp", 5.304_749e9),
        ("pfa", 1.339_082e8),
        ("omega-k", 9.341_259e7),
        ("rda", 9.494_224e7),
    ] {
        let cost = decide(&*listed(name), &grid(400)).cost;
        near(cost.operations, operations, 0.04, name);
    }
}

/// A plan states its operations and memory, and those of a single tile: the shared part and the part of its pixels.
#[test]
fn plans_state_operations_and_memory() {
    let history = Preset::Table41.simulate(&Variation::default());
    let grid = grid(200);
    for entry in &FORMERS {
        let former = entry.within(-60.0);
        let weights = Weights::new(history.collection(), Window::None, Window::None);
        let spec = ImageSpec::new(history.collection(), &grid, &weights);
        let plan = Plan::new(&*former, &spec, BoundPolicy::Allowed, &Silent).unwrap();
        let text: Value = serde_json::from_str(&plan.to_text()).unwrap();
        let pixels = (plan.tile.rows * plan.tile.columns) as f64;
        let own = plan.cost.operations - plan.cost.shared_operations;
        let expected = plan.cost.shared_operations + own * pixels / 40_000.0;
        near(
            text["tile_operations"].as_f64().unwrap(),
            expected,
            1e-6,
            entry.name,
        );
        assert_eq!(
            text["cost"]["operations"].as_f64(),
            Some(plan.cost.operations)
        );
        assert!(plan.tile_bytes as f64 >= 8.0 * pixels, "{}", entry.name);
        assert_eq!(
            Plan::from_text(&plan.to_text()).unwrap(),
            plan,
            "{}",
            entry.name
        );
    }
}
