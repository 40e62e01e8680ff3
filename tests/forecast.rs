//! Forecasts of `--dry-run`: estimated time against measured time.
//!
//! A separate executable, because other tests' threads would distort the times.

use std::time::Instant;

use subaperture::focus::bp::Backprojection;
use subaperture::focus::exact::Exact;
use subaperture::focus::ffbp::FastFactorised;
use subaperture::focus::omega_k::OmegaK;
use subaperture::focus::pfa::PolarFormat;
use subaperture::focus::rdbp::RangeDopplerBackprojection;
use subaperture::focus::{BoundPolicy, ImageFormer, Task};
use subaperture::phase_history::{PhaseHistory, Weights};
use subaperture::planner::forecast::forecast;
use subaperture::signal::window::Window;
use subaperture::simulate::{Preset, Variation};
use subaperture_tests::subap::{listing, run};

/// Number of tries; the best one counts, as the machine may be busy.
const TRIES: usize = 4;

#[track_caller]
fn within_a_factor_of_two(former: &dyn ImageFormer, grid: &str) {
    let history = Preset::Table41.simulate(&Variation::default());
    let grid = grid.parse().unwrap();
    let weights = Weights::new(history.collection(), Window::default(), Window::default());
    let task = Task::new(&history, &grid, &weights);
    let mut best = f64::INFINITY;
    for _ in 0..TRIES {
        let result = forecast(former, &task).unwrap().expect("an estimate");
        let start = Instant::now();
        former.form_asked(&task, BoundPolicy::Allowed).unwrap();
        let taken_s = start.elapsed().as_secs_f64();
        let ratio = result.seconds / taken_s;
        println!(
            "{}: {:.2} s forecast, {taken_s:.2} s taken",
            former.name(),
            result.seconds
        );
        best = f64::min(best, ratio.max(1.0 / ratio));
        if best < 2.0 {
            return;
        }
    }
    panic!("{}: off by {best:.1}", former.name());
}

/// Whether the machine is busy with other work, so that times are meaningless: with a dozen compilers running, forecasts were off by up to
/// a factor of 4, because short tasks get more of a processor than long ones.
fn is_busy() -> bool {
    let load = std::fs::read_to_string("/proc/loadavg").ok();
    let load: Option<f64> = load.and_then(|text| text.split(' ').next()?.parse().ok());
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    load.is_some_and(|load| load > 1.5 * cores as f64)
}

#[test]
fn estimates_are_within_a_factor_of_two() {
    if is_busy() {
        println!("skipped: the machine is busy with other work, so that times are meaningless");
        return;
    }
    let error_db = -60.0;
    within_a_factor_of_two(&Exact, "x=-10:10:0.3,y=-10:10:0.3");
    within_a_factor_of_two(&Backprojection { error_db }, "x=-40:40:0.4,y=-40:40:0.4");
    let rdbp = RangeDopplerBackprojection {
        mode: subaperture::focus::rdbp::Mode::Precise,
        error_db,
        sub_cpi: None,
        patch_m: None,
    };
    within_a_factor_of_two(&rdbp, "x=-40:40:0.1,y=-40:40:0.1");
    within_a_factor_of_two(&OmegaK { error_db }, "x=-40:40:0.1,y=-40:40:0.1");
    within_a_factor_of_two(&FastFactorised { error_db }, "x=-40:40:0.1,y=-40:40:0.1");
    let pfa = PolarFormat {
        error_db,
        centre_m: None,
    };
    within_a_factor_of_two(&pfa, "x=-40:40:0.1,y=-40:40:0.1");
}

#[test]
fn dry_run_reports_time_memory_and_disk_and_writes_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    run(at, "simulate --preset table-4-1 -o scene.cphd").succeeded();
    let before = listing(at);
    let grid = "--grid x=-40:40:0.1,y=-40:40:0.1";
    for line in [
        format!("focus scene.cphd {grid} --out deep/image"),
        format!("focus scene.cphd {grid} --out deep/image -a exact"),
        "velocity scene.cphd --at 1,2 --vx=-9:9:0.05 --vy=-9:9:0.05 --out v".to_owned(),
        "simulate --preset table-4-1 -o deep/a.cphd".to_owned(),
        "demo --grid x=-3:3:0.3,y=-3:3:0.3 --out demo".to_owned(),
        "reproduce --out gallery".to_owned(),
    ] {
        let ran = run(at, &format!("{line} --dry-run"));
        let said = ran.succeeded();
        for part in [
            "work ",
            "time             about ",
            "memory           about ",
            "disk ",
            " free",
        ] {
            assert!(said.contains(part), "no '{part}': {said}");
        }
        assert_eq!(listing(at), before, "{line}");
    }
    // 640 000 complex64 pixels and a header.
    let ran = run(
        at,
        &format!("focus scene.cphd {grid} --out image --dry-run"),
    );
    assert!(ran.succeeded().contains("4.9 MiB in image"), "{ran:?}");
    // Points would be measured on chips formed from the recording.
    run(
        at,
        "focus scene.cphd --grid x=-9:9:0.3,y=-9:9:0.3 --out small",
    )
    .succeeded();
    let before = listing(at);
    let ran = run(
        at,
        "quality small --from scene.cphd --at 1,2 --at 3,4 --plots plots --dry-run",
    );
    let said = ran.succeeded();
    assert!(said.contains("2 chips of 1040 pulses"), "{said}");
    assert!(said.contains("time             about "), "{said}");
    assert_eq!(listing(at), before);
    run(at, "quality small --dry-run").failed(2, &["--from"]);
    // The size of the file is exact to the byte.
    let ran = run(at, "simulate --preset table-4-1 -o again.cphd --dry-run");
    let mib = at.join("scene.cphd").metadata().unwrap().len() as f64 / 1024.0 / 1024.0;
    assert!(
        ran.succeeded()
            .contains(&format!("{mib:.1} MiB in again.cphd")),
        "{ran:?}"
    );
}

#[test]
fn items_take_the_forecast_time() {
    if is_busy() {
        println!("skipped: the machine is busy with other work, so that times are meaningless");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    // Cuts of images take a second or two.
    let line = "reproduce --only s-4-4 --json";
    let mut best = f64::INFINITY;
    for i in 0..TRIES {
        let ran = run(at, &format!("{line} --out {i} --dry-run"));
        let result: serde_json::Value = serde_json::from_str(ran.succeeded()).unwrap();
        let forecast_s = result["time_s"].as_f64().unwrap();
        let start = Instant::now();
        run(at, &format!("{line} --out {i}")).succeeded();
        let taken_s = start.elapsed().as_secs_f64();
        println!("{forecast_s:.2} s forecast, {taken_s:.2} s taken");
        best = best.min((forecast_s / taken_s).max(taken_s / forecast_s));
        if best < 2.0 {
            break;
        }
    }
    assert!(best < 2.0, "off by {best:.1}");
    // Existing items are not made again.
    let ran = run(at, "reproduce --only s-4-4 --out 0 --dry-run");
    assert!(
        ran.succeeded()
            .contains("0 items to compute, 1 already computed"),
        "{ran:?}"
    );
}

#[test]
fn search_is_forecast_from_one_of_its_images() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let text = subaperture::simulate::scenario::examples::text("stepped").unwrap();
    std::fs::write(at.join("s.toml"), text).unwrap();
    run(at, "simulate s.toml --echoes raw --set radar.pulses=40").succeeded();
    let before = listing(at);
    let line = "tune raw/recording.toml --vary recording.range_bias=-0.5:0.6:0.1m --dry-run";
    // 12 values including both ends, 5 halvings with 2 neighbours each, and a scan of 12 and 4 close to the best.
    let said = run(at, &format!("{line} --at 2,16,0"));
    let said = said.succeeded();
    assert!(said.contains("about 38 images of 1 points"), "{said}");
    assert!(said.contains("time             about "), "{said}");
    // The search on an image has two more rounds in turn.
    let grid = "--grid x=-4:4:0.5,y=2:18:0.5";
    let ran = run(at, &format!("{line} {grid} --json"));
    let result: serde_json::Value = serde_json::from_str(ran.succeeded()).unwrap();
    assert!(result["time_s"].as_f64().unwrap() > 0.0, "{result}");
    assert!(
        result["work"]
            .as_str()
            .unwrap()
            .contains("images of 16 x 32 pixels"),
        "{result}"
    );
    assert_eq!(listing(at), before);
}
