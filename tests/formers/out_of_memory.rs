//! Recordings larger than the memory: the pulses that a former reads are those stated in advance.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use glam::DVec3;
use num_complex::Complex64;
use subaperture::focus::bp::Backprojection;
use subaperture::focus::ffbp::FastFactorised;
use subaperture::focus::rdbp::{Mode, RangeDopplerBackprojection};
use subaperture::focus::{BoundPolicy, ImageFormer, Plan, Task, machine};
use subaperture::geometry::{ImageGrid, SceneFrame};
use subaperture::phase_history::{Collection, PhaseHistory, Pulse, Sweep, Weights};
use subaperture::planner::forecast::forecast_of;
use subaperture::signal::window::Window;
use subaperture::simulate::{PointTargetHistory, Scatterer};

use crate::accuracy::Counted;

/// A straight track of 120 m at a distance of 2 km, 600 MHz about 10 GHz, with two scatterers.
fn near(num_pulses: usize, num_samples: usize) -> Counted {
    let step_hz = 600e6 / num_samples as f64;
    let pulse = |n: usize| {
        let along_m = 120.0 * (n as f64 / (num_pulses - 1) as f64 - 0.5);
        let at = DVec3::new(along_m, -1732.0, 1000.0);
        Pulse {
            time_s: 1e-4 * n as f64,
            transmitter_m: at,
            receiver_m: at,
            reference_m: DVec3::ZERO,
            reference_path_m: 2.0 * at.length(),
            start_hz: 9.7e9,
            step_hz,
            sweep: Sweep::AT_ONCE,
            recorded_path_m: None,
        }
    };
    let collection = Collection {
        name: "near".to_owned(),
        num_samples,
        pulses: (0..num_pulses).map(pulse).collect(),
        frame: SceneFrame::Local,
        extent: None,
        timed: true,
    };
    let scatterer = |x, y, amplitude| Scatterer {
        position_m: DVec3::new(x, y, 0.0),
        amplitude: Complex64::new(amplitude, 0.0),
    };
    let scatterers = vec![scatterer(3.0, -7.0, 1.0), scatterer(-20.0, 15.0, 0.5)];
    let history = PointTargetHistory::new(collection, scatterers, None);
    Counted(history, AtomicUsize::new(0))
}

/// Range-Doppler backprojection on nested patches.
fn nested() -> RangeDopplerBackprojection {
    RangeDopplerBackprojection {
        mode: Mode::Precise,
        error_db: -50.0,
        sub_cpi: None,
        patch_m: None,
    }
}

/// Form the image of `grid` in `memory_bytes`. Returns the stated and the counted number of pulses read to form it, with the error, dB.
fn read_pulses(
    former: &dyn ImageFormer,
    history: &Counted,
    grid: &str,
    memory_bytes: u64,
) -> (u64, u64, f64) {
    let grid: ImageGrid = grid.parse().unwrap();
    let weights = Weights::new(history.collection(), Window::Hamming, Window::Hamming);
    let task = Task {
        memory_bytes,
        ..Task::new(history, &grid, &weights)
    };
    let plan = Plan::new(former, &task.spec(), BoundPolicy::Refused, task.monitor).unwrap();
    let stated = plan.pulses_read(former, &task, true).unwrap();
    let begun = Instant::now();
    let forecast = forecast_of(former, &task, &plan.cost).unwrap().unwrap();
    history.1.store(0, Ordering::Relaxed);
    let planned_s = begun.elapsed().as_secs_f64();
    let begun = Instant::now();
    let formed = plan.form(former, &task).unwrap();
    let all = history.1.load(Ordering::Relaxed) as u64;
    println!(
        "{}: {} s forecast in {planned_s:.1} s, {:.1} s taken, {stated} pulses stated, {all} read, {:.1} dB",
        former.name(),
        forecast.seconds,
        begun.elapsed().as_secs_f64(),
        formed.predicted_error_db
    );
    (stated, all, formed.predicted_error_db)
}

/// The recording has 128 MiB. The factorised formers read it for each of two first patches unless memory holds it; the comparison with the
/// exact sum may read it once more.
#[test]
fn pulses_read_are_as_stated() {
    let num_pulses = 2048;
    let history = near(num_pulses, 8192);
    let grid = "x=-110:109.8:0.2,y=-51.2:51:0.2";
    let formers: [&dyn ImageFormer; 3] = [
        &Backprojection { error_db: -50.0 },
        &FastFactorised { error_db: -50.0 },
        &nested(),
    ];
    let mut several = false;
    for former in formers {
        for memory_bytes in [80 << 20, 400 << 20] {
            let (stated, all, _) = read_pulses(former, &history, grid, memory_bytes);
            several |= stated > num_pulses as u64;
            assert!(
                all == stated || all == stated + num_pulses as u64,
                "{} in {memory_bytes} bytes: {stated} stated, {all} read",
                former.name()
            );
        }
    }
    assert!(several, "every recording was read once");
}

/// 107 GB of samples, simulated when read, in 2 GiB.
#[test]
#[ignore = "minutes: cargo xtask long"]
fn recording_of_100_gigabytes_is_focused_in_two() {
    let history = near(204_800, 65_536);
    let former = nested();
    let grid = "x=-102.4:102.2:0.2,y=-102.4:102.2:0.2";
    let (stated, all, error_db) = read_pulses(&former, &history, grid, 2 << 30);
    let peak_bytes = machine::peak_bytes().unwrap_or(0);
    println!("{} MiB at most", peak_bytes >> 20);
    assert!(all == stated || all == stated + 204_800);
    assert!(error_db <= -50.0 && peak_bytes < 2 << 30);
}
