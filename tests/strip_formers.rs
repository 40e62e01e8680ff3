//! The frequency-domain formers against the exact sum: complex images, phase included, and points by
//! their measures.

use glam::DVec3;
use num_complex::Complex64;
use subaperture::focus::exact::Exact;
use subaperture::focus::omega_k::OmegaK;
use subaperture::focus::rda::RangeDopplerAlgorithm;
use subaperture::focus::{FormError, Formed, ImageFormer, Monitor, Silent, Task, Weights};
use subaperture::geometry::{ImageGrid, SceneFrame};
use subaperture::phase_history::{Collection, PhaseHistory, Pulse};
use subaperture::signal::window::Window;
use subaperture::simulate::{Preset, Scatterer, Simulated, Variation};
use subaperture_tests::error_db;

const OMEGA_K: OmegaK = OmegaK { error_db: -60.0 };
const RDA: RangeDopplerAlgorithm = RangeDopplerAlgorithm {
    error_db: -60.0,
    secondary_compression: true,
};
const RDA_WITHOUT_SRC: RangeDopplerAlgorithm = RangeDopplerAlgorithm {
    error_db: -60.0,
    secondary_compression: false,
};

/// A radar on a track.
struct Radar {
    /// Frequency of sample 0, step, number.
    band: (f64, f64, usize),
    num_pulses: usize,
    /// Transmitter and receiver of pulse `n`, from the aperture's middle.
    antennas: fn(f64) -> (DVec3, DVec3),
    /// Path that all samples are referred to, or to the scene's origin if `None`.
    reference_path_m: Option<f64>,
}

impl Radar {
    fn collection(&self) -> Collection {
        let (start_hz, step_hz, num_samples) = self.band;
        let pulses = (0..self.num_pulses)
            .map(|n| {
                let index = n as f64 - (self.num_pulses as f64 - 1.0) / 2.0;
                let (transmitter_m, receiver_m) = (self.antennas)(index);
                let to_origin_m = transmitter_m.length() + receiver_m.length();
                Pulse {
                    time_s: n as f64,
                    transmitter_m,
                    receiver_m,
                    reference_m: DVec3::ZERO,
                    reference_path_m: self.reference_path_m.unwrap_or(to_origin_m),
                    start_hz,
                    step_hz,
                }
            })
            .collect();
        Collection {
            name: "strip".to_owned(),
            num_samples,
            pulses,
            frame: SceneFrame::Local,
            extent: None,
            timed: true,
        }
    }

    /// Twelve scatterers within `half_m` of the origin.
    fn over_many(&self, half_m: [f64; 2]) -> Simulated {
        let scatterers = (0..12)
            .map(|i| {
                // The plastic number's powers: spread evenly without a lattice.
                let place = |a: f64| 2.0 * (a * f64::from(i) + 0.5).fract() - 1.0;
                let (x, y) = (place(0.754_877_666), place(0.569_840_291));
                Scatterer {
                    position_m: DVec3::new(half_m[0] * x, half_m[1] * y, 0.0),
                    amplitude: Complex64::cis(f64::from(i)),
                }
            })
            .collect();
        Simulated::new(self.collection(), scatterers, None)
    }
}

/// A stripmap of 5 GHz and 100 MHz at 3 km, from 1 km above the ground, broadside.
const STRIPMAP: Radar = Radar {
    band: (4.95e9, 0.8e6, 125),
    num_pulses: 600,
    antennas: |n| {
        let at = DVec3::new(0.4 * n, -(8f64.sqrt()) * 1000.0, 1000.0);
        (at, at)
    },
    reference_path_m: Some(6000.0),
};

/// A rail of 1.6 m at 1.1 to 1.3 GHz, its scene from 6 m on.
const RAIL: Radar = Radar {
    band: (1.1e9, 4e6, 51),
    num_pulses: 81,
    antennas: |n| {
        let at = DVec3::new(0.02 * n, -9.0, 0.0);
        (at, at)
    },
    reference_path_m: Some(0.0),
};

/// X band, 400 MHz, looking 40 degrees ahead.
const SQUINT: Radar = Radar {
    band: (9.4e9, 1e6, 400),
    num_pulses: 300,
    antennas: |n| {
        let ahead_m = 2000.0 * 40f64.to_radians().tan();
        let at = DVec3::new(0.3 * n - ahead_m, -2000.0, 0.0);
        (at, at)
    },
    reference_path_m: None,
};

fn try_form(
    history: &dyn PhaseHistory,
    grid: &ImageGrid,
    window: Window,
    former: &dyn ImageFormer,
    memory_bytes: u64,
    monitor: &dyn Monitor,
) -> Result<Formed, FormError> {
    let weights = Weights::new(history.collection(), window, window);
    former.form(&Task {
        history,
        grid,
        weights: &weights,
        memory_bytes,
        monitor,
    })
}

/// Errors of the formers on a grid, dB against the exact sum.
fn errors_db<const N: usize>(
    what: &str,
    history: &Simulated,
    grid: &str,
    window: Window,
    formers: [&dyn ImageFormer; N],
) -> [f64; N] {
    let grid: ImageGrid = grid.parse().unwrap();
    let form = |former| try_form(history, &grid, window, former, 1 << 30, &Silent).unwrap();
    let exact = form(&Exact).image;
    formers.map(|former| {
        let started = std::time::Instant::now();
        let formed = form(former);
        let taken = started.elapsed();
        let db = error_db(&formed.image, &exact);
        let settings = serde_json::to_string(&formed.settings).unwrap();
        println!("{what}: {} {db:.1} dB in {taken:.2?} {settings}", former.name());
        db
    })
}

#[test]
fn stripmap() {
    let history = STRIPMAP.over_many([50.0, 50.0]);
    for window in [Window::None, Window::default()] {
        let [omega_k, rda, without] = errors_db(
            "stripmap",
            &history,
            "x=-55:55:2.3,y=-60:60:2.1",
            window,
            [&OMEGA_K, &RDA, &RDA_WITHOUT_SRC],
        );
        assert!(omega_k < -90.0, "{omega_k}");
        assert!(rda < -60.0 && without < -40.0, "{rda} {without}");
    }
}

#[test]
fn rail() {
    let history = RAIL.over_many([2.0, 2.5]);
    let [omega_k, rda] = errors_db(
        "rail",
        &history,
        "x=-2:2:0.11,y=-2.5:2.5:0.13",
        Window::None,
        [&OMEGA_K, &RDA],
    );
    assert!(omega_k < -60.0 && rda < -20.0, "{omega_k} {rda}");
}

#[test]
fn table_4_1() {
    let history = Preset::Table41.simulate(&Variation::default());
    let [omega_k, rda] = errors_db(
        "Table 4.1",
        &history,
        "x=-40:40:1.97,y=-40:40:1.91",
        Window::None,
        [&OMEGA_K, &RDA],
    );
    assert!(omega_k < -90.0 && rda < -60.0, "{omega_k} {rda}");
}

#[test]
fn squint() {
    let history = SQUINT.over_many([15.0, 15.0]);
    let [omega_k, rda, without] = errors_db(
        "squint",
        &history,
        "x=-16:16:0.53,y=-16:16:0.57",
        Window::None,
        [&OMEGA_K, &RDA, &RDA_WITHOUT_SRC],
    );
    assert!(omega_k < -90.0 && rda < -30.0, "{omega_k} {rda}");
    assert!(without > -10.0, "{without}");
}
