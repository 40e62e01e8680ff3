//! Images from patch maps against the exact sum, and the module planner that chose the patches. The maps are the defining
//! sum in float64.

use std::path::Path;

use subaperture::focus::exact::Exact;
use subaperture::focus::{BoundPolicy, FormError, ImageFormer, Task};
use subaperture::geometry::ImageGrid;
use subaperture::image::Image;
use subaperture::io::open::{Options, open_all};
use subaperture::module::image::{MapsTask, Report, form};
use subaperture::module::maps::{Arithmetic, OwnedMap, Run, RunTotals};
use subaperture::module::maps_file::{MapFile, MapWriter};
use subaperture::module::plan::{
    ModuleCapacity, ModulePlan, ModuleProduct, PlanError, Requirements,
};
use subaperture::monitor::{Monitor, Silent};
use subaperture::phase_history::{InMemory, Joined, PhaseHistory, Weights};
use subaperture::signal::window::Window;
use subaperture::simulate::{PointTargetHistory, Preset, Variation};
use subaperture_tests::error_db;
use subaperture_tests::maps::{fast_weights, in_blocks, maps};

/// A recording, its plan, and the maps that a module without rounding would send.
struct Bench<'a> {
    history: &'a dyn PhaseHistory,
    grid: ImageGrid,
    weights: Weights,
    plan: ModulePlan,
    maps: Vec<OwnedMap>,
}

impl<'a> Bench<'a> {
    fn new(history: &'a dyn PhaseHistory, grid: &str, window: Window, error_db: f64) -> Self {
        let grid: ImageGrid = grid.parse().unwrap();
        let collection = history.collection();
        let weights = Weights::new(collection, window, window);
        let requirements = Requirements {
            product: ModuleProduct::Maps,
            error_db,
            room: ModuleCapacity::Ram { bytes: 1 << 20 },
            arithmetic: Arithmetic::Float,
        };
        let plan = ModulePlan::new(&[collection], &grid, &requirements).unwrap();
        let fast = fast_weights(&weights.fast);
        let maps = maps(history, &plan.setup, &plan.patches, &fast, &weights.slow);
        println!(
            "{} patches of {} x {} pixels, {} sub-CPIs of {}, D {}, R {}, {} taps, {} bytes, predicted {:.1} dB",
            plan.patches.len(),
            plan.patch_pixels.rows,
            plan.patch_pixels.columns,
            plan.num_sub_cpis,
            plan.setup.num_pulses,
            plan.setup.doppler_length,
            plan.setup.range_length,
            plan.taps,
            plan.ram.total_bytes,
            plan.predicted_db
        );
        Self {
            history,
            grid,
            weights,
            plan,
            maps,
        }
    }

    fn run(&self, arithmetic: Arithmetic) -> Run {
        Run {
            name: "bench".to_owned(),
            setup: self.plan.setup,
            arithmetic,
            fast_window: "as given".to_owned(),
            fast_weights: fast_weights(&self.weights.fast),
            frame: self.history.collection().frame,
            provenance: serde_json::Map::new(),
        }
    }

    fn closing(&self) -> RunTotals {
        RunTotals {
            num_pulses: self.history.collection().pulses.len() as u64,
            weight_sum: self.weights.slow.iter().sum(),
            counters: serde_json::Map::new(),
        }
    }

    /// Image of `maps` written to and read from a file.
    fn try_form(
        &self,
        maps: &[OwnedMap],
        arithmetic: Arithmetic,
        error_db: f64,
        memory_bytes: u64,
        monitor: &dyn Monitor,
    ) -> Result<(Image, Report), FormError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.maps");
        let mut writer = MapWriter::create(&path, &self.run(arithmetic)).unwrap();
        maps.iter()
            .for_each(|map| writer.append(&map.view()).unwrap());
        writer.finish(&self.closing()).unwrap();
        let maps = MapFile::open(&path).unwrap();
        assert!(maps.is_complete());
        let task = MapsTask {
            maps: &maps,
            grid: &self.grid,
            error_db,
            bound_policy: BoundPolicy::Allowed,
            memory_bytes,
            monitor,
        };
        form(&task).map(|(formed, report)| (formed.image, report))
    }

    fn form(&self, maps: &[OwnedMap], error_db: f64) -> (Image, Report) {
        self.try_form(maps, Arithmetic::Float, error_db, 1 << 30, &Silent)
            .unwrap()
    }

    fn exact(&self) -> Image {
        let task = Task::new(self.history, &self.grid, &self.weights);
        Exact.form(&task).unwrap().image
    }
}

fn table_4_1() -> PointTargetHistory {
    Preset::Table41.simulate(&Variation::default())
}

const GRID: &str = "x=-40:40:1.37,y=-40:40:1.31";

#[test]
fn image_of_simulated_maps_keeps_the_bound() {
    let history = table_4_1();
    for (bound_db, window) in [
        (-40.0, Window::None),
        (-60.0, Window::None),
        (-60.0, Window::default()),
        (-80.0, Window::None),
    ] {
        let bench = Bench::new(&history, GRID, window, bound_db);
        assert!(bench.plan.patches.len() > 3 && bench.plan.num_sub_cpis > 3);
        let (image, report) = bench.form(&bench.maps, bound_db);
        let measured_db = error_db(&image, &bench.exact());
        println!("bound {bound_db} dB: measured {measured_db:.1} dB, {report:?}");
        assert!(measured_db <= bound_db, "{measured_db} {bound_db}");
        // The prediction is that of the worst patch and sub-CPI: never far below the actual error.
        assert!(
            measured_db <= bench.plan.predicted_db + 2.0,
            "{measured_db}"
        );
        // The prediction from the maps alone: no plan's prediction is recorded here.
        assert!(measured_db <= report.predicted_db + 3.0, "{measured_db}");
        assert!(
            report.predicted_db <= bench.plan.predicted_db + 3.0,
            "{} {}",
            report.predicted_db,
            bench.plan.predicted_db
        );
        assert_eq!(report.pixels_outside, 0);
        assert_eq!(report.maps_missing, 0);
        assert!((report.least_weight_share.unwrap() - 1.0).abs() < 1e-6);
        assert_eq!(report.kernel_taps, bench.plan.taps);
    }
}

#[test]
fn block_floating_point_maps_keep_bound() {
    let history = table_4_1();
    let bench = Bench::new(&history, GRID, Window::None, -60.0);
    let fixed: Vec<OwnedMap> = bench.maps.iter().map(in_blocks).collect();
    let form = bench.try_form(&fixed, Arithmetic::Fixed, -60.0, 1 << 30, &Silent);
    let measured_db = error_db(&form.unwrap().0, &bench.form(&bench.maps, -60.0).0);
    println!("blocks against float32: {measured_db:.1} dB");
    // Rounding is 2^-15 / sqrt(12) of a block's peak per part, -101 dB. Blocks of sidelobes round finer, and a peak is seldom
    // 20 dB above the RMS of its block.
    assert!(measured_db < -80.0, "{measured_db}");
}

#[test]
fn missing_maps_keep_unit_scatterer_at_amplitude_one() {
    let history = table_4_1();
    let bench = Bench::new(&history, GRID, Window::None, -60.0);
    // Without the second sub-CPI, the image is the exact sum over the other pulses.
    let kept: Vec<OwnedMap> = bench
        .maps
        .iter()
        .filter(|map| map.header.sub_cpi != 1)
        .cloned()
        .collect();
    let (image, report) = bench.form(&kept, -60.0);
    assert_eq!(report.maps_missing, bench.plan.patches.len() as u64);
    let length = usize::from(bench.plan.setup.num_pulses);
    let mut weights = bench.weights.clone();
    weights.slow[length..2 * length].fill(0.0);
    let num_pulses = weights.slow.len() as f64;
    let share = 1.0 - length as f64 / num_pulses;
    assert!((report.least_weight_share.unwrap() - share).abs() < 1e-6);
    let thinned = Bench {
        weights,
        maps: Vec::new(),
        plan: bench.plan.clone(),
        ..bench
    };
    let measured_db = error_db(&image, &thinned.exact());
    println!("one sub-CPI missing: {measured_db:.1} dB");
    assert!(measured_db <= -60.0, "{measured_db}");
}

#[test]
fn pixels_outside_every_patch_are_zero_and_counted() {
    let history = table_4_1();
    let mut bench = Bench::new(&history, "x=-10:10:1.37,y=-10:10:1.31", Window::None, -60.0);
    let inner = bench.form(&bench.maps, -60.0).0;
    // The same maps on a grid twice as wide whose middle has the same pixels.
    let (x, y) = (bench.grid.columns, bench.grid.rows);
    bench.grid.columns.start -= 15.0 * x.step;
    bench.grid.columns.count += 30;
    bench.grid.rows.start -= 15.0 * y.step;
    bench.grid.rows.count += 30;
    let (image, report) = bench.form(&bench.maps, -60.0);
    let zeros = image.pixels.iter().filter(|z| z.norm_sqr() == 0.0).count();
    assert_eq!(report.pixels_outside, zeros as u64);
    assert!(report.pixels_outside > 0);
    for row in 0..y.count {
        for column in 0..x.count {
            let wide = image.pixels[(row + 15) * image.columns + column + 15];
            // Positions differ by a rounding of the start.
            let same = (wide - inner.pixels[row * x.count + column]).norm() < 1e-6;
            assert!(same, "{row} {column}");
        }
    }
}

#[test]
fn image_is_independent_of_threads_and_faults_are_reported() {
    let history = table_4_1();
    let bench = Bench::new(&history, "x=-10:10:1.37,y=-10:10:1.31", Window::None, -60.0);
    let one = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap();
    let alone = one.install(|| bench.form(&bench.maps, -60.0).0);
    assert_eq!(alone, bench.form(&bench.maps, -60.0).0);

    let expect_error = |maps: &[OwnedMap], memory: u64, monitor: &dyn Monitor, parts: &[&str]| {
        let error = bench
            .try_form(maps, Arithmetic::Float, -60.0, memory, monitor)
            .unwrap_err();
        for part in parts {
            assert!(
                format!("{error} {:?}", error.remedies()).contains(part),
                "{error}"
            );
        }
    };
    expect_error(&[], 1 << 30, &Silent, &["no maps in 'bench'"]);
    expect_error(
        &bench.maps,
        1000,
        &Silent,
        &["of the 1000 bytes allowed", "MoreMemory"],
    );
    struct Impatient;
    impl Monitor for Impatient {
        fn progress(&self, _fraction: f64) {}
        fn cancelled(&self) -> bool {
            true
        }
    }
    expect_error(&bench.maps, 1 << 30, &Impatient, &["interrupted"]);
    let mut other = bench.maps.clone();
    other[bench.plan.patches.len()].header.patch.centre_m[0] += 1.0;
    expect_error(
        &other,
        1 << 30,
        &Silent,
        &["patch index 0", "maps of one run"],
    );
    let mut other = bench.maps.clone();
    other.iter_mut().for_each(|map| map.header.weight_sum = 0.0);
    expect_error(&other, 1 << 30, &Silent, &["patch 0", "positive sum"]);
    let mut other = bench.maps.clone();
    let subaperture::module::maps::OwnedSamples::Float(samples) = &mut other[1].samples else {
        unreachable!()
    };
    samples[3].re = f32::NAN;
    expect_error(&other, 1 << 30, &Silent, &["patch 1", "not finite"]);
}

#[test]
fn plans_fit_module_memory_or_report_least_memory() {
    let history = table_4_1();
    let collection = history.collection();
    let grid: ImageGrid = GRID.parse().unwrap();
    let plan = |room: ModuleCapacity, error_db: f64, arithmetic: Arithmetic| {
        let requirements = Requirements {
            product: ModuleProduct::Maps,
            error_db,
            room,
            arithmetic,
        };
        ModulePlan::new(&[collection], &grid, &requirements)
    };
    let wide = plan(
        ModuleCapacity::Ram { bytes: 1 << 30 },
        -60.0,
        Arithmetic::Float,
    )
    .unwrap();
    // Buffers built for a plan are sufficient for it; with one pulse less they are not.
    let capacity = wide.capacity();
    assert_eq!(
        plan(ModuleCapacity::Built(capacity), -60.0, Arithmetic::Float).unwrap(),
        wide
    );
    let mut smaller = capacity;
    smaller.pulses -= 1;
    let other = plan(ModuleCapacity::Built(smaller), -60.0, Arithmetic::Float).unwrap();
    assert!(other.setup.num_pulses < wide.setup.num_pulses);
    for patch in &other.patches {
        other.setup.check_patch(patch, &smaller).unwrap();
    }

    for arithmetic in [Arithmetic::Float, Arithmetic::Fixed] {
        let error = plan(ModuleCapacity::Ram { bytes: 1000 }, -60.0, arithmetic).unwrap_err();
        let PlanError::Room { least_bytes, .. } = error else {
            panic!("{error}");
        };
        let least = plan(
            ModuleCapacity::Ram { bytes: least_bytes },
            -60.0,
            arithmetic,
        )
        .unwrap();
        println!(
            "{arithmetic:?}: least {least_bytes}, {}",
            least.setup.num_pulses
        );
        assert!(least.ram.total_bytes <= least_bytes);
        assert!(error.to_string().contains("least memory"), "{error}");
    }
    let error = plan(
        ModuleCapacity::Ram { bytes: 1 << 30 },
        -200.0,
        Arithmetic::Float,
    )
    .unwrap_err();
    assert!(matches!(error, PlanError::Bound { .. }), "{error}");
}

/// Check the image of a plan's maps: within the bound and close to the prediction.
fn check_prediction(history: &dyn PhaseHistory, grid: &str) -> ModulePlan {
    let bench = Bench::new(history, grid, Window::None, -60.0);
    let (image, report) = bench.form(&bench.maps, -60.0);
    let measured_db = error_db(&image, &bench.exact());
    println!("measured {measured_db:.1} dB");
    assert!(measured_db <= -60.0, "{measured_db}");
    // The worst sub-CPI and patch determine the prediction, so the whole image is better. The share of scatterers outside the
    // grid (see `focus::rdbp::plan`) is less than the margin.
    let predicted_db = bench.plan.predicted_db;
    assert!(
        measured_db <= predicted_db + 3.0,
        "{measured_db} {predicted_db}"
    );
    assert_eq!(report.pixels_outside, 0);
    bench.plan
}

/// Sub-CPIs are consecutive pulse numbers, also across a jump in the track: either no sub-CPI contains the jump, or the error
/// it causes must be small.
#[test]
fn prediction_includes_gaps_in_track() {
    let whole = table_4_1();
    let collection = whole.collection();
    let width = collection.num_samples;
    let mut samples = vec![num_complex::Complex32::ZERO; collection.pulses.len() * width];
    whole
        .read(0..collection.pulses.len(), &mut samples)
        .unwrap();
    let without = |gap: std::ops::Range<usize>| {
        let mut collection = collection.clone();
        collection.pulses.drain(gap.clone());
        let mut samples = samples.clone();
        samples.drain(gap.start * width..gap.end * width);
        InMemory::new(collection, samples).unwrap()
    };
    let grid = "x=-6:6:1,y=-6:6:1";
    let whole = check_prediction(&whole, grid);
    let longest = whole.setup.num_pulses;
    assert!(whole.gaps.is_empty());
    // 323 = 17 * 19: sub-CPIs of 19 pulses do not contain the jump.
    let jumped = check_prediction(&without(323..700), grid);
    assert_eq!(323 % jumped.setup.num_pulses, 0);
    assert_eq!(jumped.gaps, [323]);
    assert!(jumped.setup.num_pulses < longest);
    // 331 is prime: some sub-CPI contains the jump, unless it has a single pulse.
    let lost = check_prediction(&without(331..332), grid);
    assert!(lost.setup.num_pulses < longest);
}

fn gotcha(degrees: &[u8]) -> Option<Joined> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/gotcha");
    let paths: Vec<_> = degrees
        .iter()
        .map(|degree| folder.join(format!("data_3dsar_pass1_az{degree:03}_HH.mat")))
        .collect();
    if let Some(missing) = paths.iter().find(|path| !path.exists()) {
        println!("skipped: {} not found", missing.display());
        return None;
    }
    Some(open_all(&paths, &Options::default()).unwrap())
}

/// Two degrees of GOTCHA in order, and in reverse order with a jump of two degrees.
#[test]
fn gotcha_maps_across_recordings_keep_the_bound() {
    let grid = "x=-10:10:0.5,y=-10:10:0.5";
    let Some(history) = gotcha(&[1, 2]) else {
        return;
    };
    let onward = check_prediction(&history, grid);
    let Some(history) = gotcha(&[2, 1]) else {
        return;
    };
    let back = check_prediction(&history, grid);
    // The track is the same in any order of the files.
    assert!(back.gaps.is_empty());
    assert_eq!(back.setup, onward.setup);
}

/// One degree of GOTCHA, divided by its own plan.
#[test]
fn gotcha_maps_keep_the_bound() {
    let Some(history) = gotcha(&[1]) else { return };
    let bench = Bench::new(&history, "x=-20:20:0.4,y=-20:20:0.4", Window::None, -60.0);
    let (image, report) = bench.form(&bench.maps, -60.0);
    let measured_db = error_db(&image, &bench.exact());
    println!("measured {measured_db:.1} dB, {report:?}");
    println!("{:?}", bench.plan.link(921_600));
    assert!(measured_db <= -60.0, "{measured_db}");
    assert_eq!(report.pixels_outside, 0);
    assert!(bench.plan.ram.total_bytes <= 512 << 10);
}
