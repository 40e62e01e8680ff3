//! Time and memory of range-Doppler backprojection: Schone 2020, Table 5.1 and section 5.2.

use std::time::Instant;

use glam::DVec3;
use num_complex::Complex64;

use super::forming::{form, grid_about, hold, thesis_with};
use crate::{Check, Context, Finding, Item, ItemError};
use subaperture_focus::ImageFormer;
use subaperture_focus::bp::Backprojection;
use subaperture_focus::rdbp::{Mode, RangeDopplerBackprojection, Thesis};
use subaperture_model::geometry::{Axis, ImageGrid, SceneFrame};
use subaperture_model::phase_history::{Collection, InMemory, PhaseHistory, Pulse, Sweep};
use subaperture_planner::cost::{FormerCost, ThesisMemory, Work};
use subaperture_planner::{RadarPlan, Request};
use subaperture_simulate::{PointTargetHistory, Preset, Scatterer, Variation};

pub(super) const ITEMS: [Item; 2] = [
    Item {
        id: "s-table-5-1",
        source: "Schone 2020, Table 5.1",
        title: "Time that sub-CPIs save",
        work: 60.0,
        reproduce: times,
    },
    Item {
        id: "s-5-2",
        source: "Schone 2020, section 5.2",
        title: "Memory that sub-CPIs take",
        work: 3.0,
        reproduce: memory,
    },
];

/// Interpolation error at the band edge with the thesis's tenfold range upsampling, dB.
const TENFOLD_DB: f64 = -46.0;
/// Time of backprojection in the thesis, seconds: 0:38:10.6.
const THESIS_BACKPROJECTION_S: f64 = 2290.6;
/// Runs of the thesis: pulses per sub-CPI and Doppler padding.
const RUNS: [(usize, usize); 3] = [(31, 16), (63, 16), (127, 8)];
/// Times of these runs in the thesis, seconds: 0:8:30.6, 0:8:14.1, 0:4:59.5.
const THESIS_S: [f64; 3] = [510.6, 494.1, 299.5];
/// Name of the check on the larger recording.
const PRECISE_ON_LARGE: &str =
    "faster than backprojection by: precise mode, 4096 pulses, 1024 x 1024 pixels";
/// Repetitions; the shortest time is used, because other load only adds.
const REPEATS: usize = 2;

/// Frequencies, pulses and pixels of the thesis's data (S 5.2).
const GOTCHA: Work = Work {
    frequencies: 21_232,
    pulses: 30_000,
    pixels: 400_000_000,
};

fn times(context: &Context) -> Result<Finding, ItemError> {
    let history = hold(context, &Preset::Table41.simulate(&Variation::default()))?;
    let grid = grid_about(DVec3::ZERO, 44.0, 44.0, 0.2);
    let work = Work {
        frequencies: history.collection().num_samples,
        pulses: history.collection().pulses.len(),
        pixels: grid.num_pixels(),
    };
    let traditional = Backprojection {
        error_db: TENFOLD_DB,
    };
    let precise = RangeDopplerBackprojection {
        mode: Mode::Precise,
        error_db: TENFOLD_DB,
        sub_cpi: None,
        patch_m: None,
    };
    let options = |doppler_padding| Thesis {
        doppler_padding,
        ..Thesis::default()
    };
    let thesis = RUNS.map(|(pulses, padding)| thesis_with(pulses, options(padding)));
    let mut formers: Vec<&dyn ImageFormer> = vec![&traditional, &precise];
    formers.extend(thesis.iter().map(|former| former as &dyn ImageFormer));

    let images = REPEATS * (formers.len() + 2) + 1;
    let seconds = shortest_s(context, (&history, &grid), &formers, [0, images])?;
    let large = hold(context, &large())?;
    let square = grid_about(DVec3::ZERO, 0.25 * 511.5, 0.25 * 511.5, 0.25);
    let before = REPEATS * formers.len() + 1;
    let on_large = shortest_s(context, (&large, &square), &formers[..2], [before, images])?;
    let larger = on_large[0] / on_large[1];
    let faster: Vec<f64> = seconds.iter().map(|s| seconds[0] / s).collect();
    let ours = &faster[2..];

    let mut checks = checks(ours);
    checks.push(Check::claim(
        PRECISE_ON_LARGE,
        "4.49 to 7.65 times",
        format!("{larger:.2} times"),
        larger >= 4.49,
    ));
    // Most of the thesis's time per pixel is spent on maps.
    let one = grid_about(DVec3::ZERO, 0.0, 0.0, 1.0);
    let start = Instant::now();
    form(context, [before - 1, images], &history, &one, &thesis[0])?;
    let maps = 100.0 * start.elapsed().as_secs_f64() / seconds[2];
    // Seconds per sub-CPI in the thesis, Doppler padded to 512 and to 1024.
    let [half, whole] = [THESIS_S[0] / 966.0, THESIS_S[1] / 476.0];
    let thesis_maps = 100.0 * (whole - half) / half;
    let map_bins = 16.0 * 31.0 * 10.0 * work.frequencies as f64;
    Ok(Finding {
        thesis: "38 minutes of backprojection become 8:31, 8:14 and 5:00 with sub-CPIs of 31, 63 and 127 pulses."
            .to_owned(),
        method: format!(
            "Scaled down: {} pulses of {} frequencies for the thesis's 30,000 of 21,232. Table 4.1 on {} x {} pixels, {:.2} of them for a bin of the map of 31 pulses (the thesis's 1 km x 1 km has \
             0.15 at 0.25 m); range upsampled tenfold by the thesis's mode, backprojection within the error of that; the shorter of {REPEATS} times on {} threads, which was \
             {:.2} s for backprojection. The precise mode within the same {} dB \
             is faster by {:.2} times. It is also compared on {} pulses of {} frequencies and {} x {} pixels, a scene that is larger against its maps. Sub-CPIs, their \
             range-Doppler maps and the interpolation of every pixel by range and Doppler are the thesis's; nested patches, their compensation and the gridding of maps are not.",
            work.pulses,
            work.frequencies,
            grid.rows.count,
            grid.columns.count,
            work.pixels as f64 / map_bins,
            rayon::current_num_threads(),
            seconds[0],
            TENFOLD_DB,
            faster[1],
            large.collection().pulses.len(),
            large.collection().num_samples,
            square.rows.count,
            square.columns.count,
        ),
        checks,
        why: Some(format!(
            "In the thesis a sub-CPI of twice the Doppler bins took {:.2} times as long, whatever its pixels: about {:.0} % of \
             the time of 31 pulses went into maps of gigabytes. Here maps of {:.0} MB in float32 took {:.0} %, measured with \
             one pixel; the rest is interpolation of pixels, which sub-CPIs reduce. But backprojection here processes 16 pixels at once, with \
             paths that are polynomials over a tile, and the thesis's mode, kept as published, one pixel at a time: the ratio compares \
             programs as well as of methods.",
            whole / half,
            thesis_maps.min(100.0),
            8e-6 * map_bins,
            maps
        )),
        pictures: vec![],
    })
}

/// Shortest time of each former, seconds; `before` of `images` images precede, for progress.
fn shortest_s(
    context: &Context,
    (history, grid): (&InMemory, &ImageGrid),
    formers: &[&dyn ImageFormer],
    [before, images]: [usize; 2],
) -> Result<Vec<f64>, ItemError> {
    let mut seconds = vec![f64::INFINITY; formers.len()];
    for repeat in 0..REPEATS {
        for (index, former) in formers.iter().enumerate() {
            let place = [before + repeat * formers.len() + index, images];
            let start = Instant::now();
            form(context, place, history, grid, *former)?;
            seconds[index] = seconds[index].min(start.elapsed().as_secs_f64());
        }
    }
    Ok(seconds)
}

/// Speed-up of the thesis's runs over backprojection, in the thesis and here.
fn checks(ours: &[f64]) -> Vec<Check> {
    let mut checks: Vec<Check> = RUNS
        .iter()
        .zip(THESIS_S.map(|s| THESIS_BACKPROJECTION_S / s))
        .zip(ours)
        .map(|((&(pulses, padding), thesis), &ours)| {
            Check::printed(
                &format!("faster than backprojection by: {pulses} pulses, Doppler {padding}x"),
                &format!("{thesis:.2}"),
                ours,
                2,
                "times",
            )
        })
        .collect();
    checks.push(Check::claim(
        "127 pulses and coarser Doppler against 63",
        "much faster",
        format!("{:.2} times", ours[2] / ours[1]),
        ours[2] > 1.2 * ours[1],
    ));
    checks
}

fn memory(context: &Context) -> Result<Finding, ItemError> {
    let short = ThesisMemory::new(GOTCHA.frequencies, 512, GOTCHA.pixels);
    let long = ThesisMemory::new(GOTCHA.frequencies, 8192, GOTCHA.pixels);
    let giga = |bytes: u128| bytes as f64 * 1e-9;
    let grid = ImageGrid::horizontal(side(), side(), 0.0);
    let plan = RadarPlan::new(
        &like_gotcha(),
        &Request {
            grid: &grid,
            error_db: TENFOLD_DB,
            memory_bytes: context.memory_bytes,
            thesis_sub_cpi: 31,
            beamwidth_rad: None,
            power: None,
            chain: None,
        },
    )
    .map_err(|error| ItemError::Measure(error.to_string()))?;
    let image_bytes = 8 * grid.num_pixels();
    let without_image = |cost: &FormerCost| {
        let bytes = cost.total_bytes - image_bytes;
        format!("{} {:.3} GB", cost.algorithm, giga(bytes.into()))
    };
    let costs: Vec<String> = plan.costs.iter().map(without_image).collect();
    Ok(Finding {
        thesis: "21,232 frequencies, range upsampled 10 times, complex float64, 400 million pixels. A profile takes \
                 3.4 MB, a map of 31 pulses 1.74 GB, one of 499 pulses 27.83 GB, the image 6.4 GB, range and Doppler of \
                 its pixels as much, lines of sight nearly 20 GB."
            .to_owned(),
        method: format!(
            "The thesis's count, recomputed, and the memory that our algorithms plan for such a recording in float32: {:.1} GB \
             for the image, all else {}, with {} pulses per sub-CPI in the precise mode and 31 in the thesis's. Scale: as in the \
             thesis; planned, not run.",
            giga(image_bytes.into()),
            costs.join(", "),
            plan.sub_cpis.precise_pulses
        ),
        checks: vec![
            Check::printed("a profile", "3.4", 1e3 * giga(short.profile_bytes), 2, "MB"),
            Check::printed("a map of 31 pulses", "1.74", giga(short.map_bytes), 3, "GB"),
            Check::printed("a map of 499 pulses", "27.83", giga(long.map_bytes), 3, "GB"),
            Check::printed("the image", "6.4", giga(short.image_bytes), 2, "GB"),
            Check::printed(
                "range and Doppler of all pixels",
                "6.4",
                giga(short.range_and_doppler_bytes),
                2,
                "GB",
            ),
            // 19.2 GB at 16 bytes per component: see the planner.
            Check::claim(
                "lines of sight",
                "nearly 20 GB",
                format!("{:.1} GB", giga(short.line_of_sight_bytes)),
                (19.0..20.0).contains(&giga(short.line_of_sight_bytes)),
            ),
        ],
        why: None,
        pictures: vec![],
    })
}

/// 5 km in steps of 0.25 m.
fn side() -> Axis {
    Axis {
        start: -2500.0,
        step: 0.25,
        count: 20_000,
    }
}

/// Geometry of the thesis's pass with fewer samples, over nine points.
fn large() -> PointTargetHistory {
    let at = |i: i32| f64::from(i % 3 - 1) * 90.0;
    let scatterers = (0..9).map(|i| Scatterer {
        position_m: DVec3::new(at(i), at(i / 3), 0.0),
        amplitude: Complex64::ONE,
    });
    PointTargetHistory::new(straight_pass(1024, 4096), scatterers.collect(), None)
}

/// Straight pass with the thesis's numbers of frequencies and pulses.
fn like_gotcha() -> Collection {
    straight_pass(GOTCHA.frequencies, GOTCHA.pulses)
}

/// Straight pass that resolves 0.25 m in range and cross-range at 10 km and 9.6 GHz.
fn straight_pass(frequencies: usize, pulses: usize) -> Collection {
    let bandwidth_hz = 600e6;
    let step_hz = bandwidth_hz / frequencies as f64;
    // An aperture of lambda R / (2 * 0.25 m) = 625 m.
    let spacing_m = 625.0 / pulses as f64;
    let middle = (pulses as f64 - 1.0) / 2.0;
    let pulse = |n| {
        let antenna_m = DVec3::new((f64::from(n) - middle) * spacing_m, -7000.0, 7000.0);
        Pulse {
            time_s: f64::from(n) * 1e-3,
            transmitter_m: antenna_m,
            receiver_m: antenna_m,
            reference_m: DVec3::ZERO,
            reference_path_m: 2.0 * antenna_m.length(),
            start_hz: 9.6e9 - bandwidth_hz / 2.0,
            step_hz,
            sweep: Sweep::AT_ONCE,
            recorded_path_m: None,
        }
    };
    Collection {
        name: "like GOTCHA".to_owned(),
        num_samples: frequencies,
        pulses: (0..pulses as u32).map(pulse).collect(),
        frame: SceneFrame::Local,
        extent: None,
        timed: false,
    }
}
