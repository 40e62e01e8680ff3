//! Radars and scenes for the formers that need a straight track, and errors of these formers.

use glam::DVec3;
use num_complex::Complex64;
use subaperture::focus::exact::Exact;
use subaperture::focus::omega_k::OmegaK;
use subaperture::focus::rda::RangeDopplerAlgorithm;
use subaperture::focus::{FormError, Formed, ImageFormer, Remedy, Task};
use subaperture::geometry::{ImageGrid, SceneFrame};
use subaperture::monitor::{Monitor, Silent};
use subaperture::phase_history::{Collection, PhaseHistory, Pulse, Sweep, Weights};
use subaperture::signal::window::Window;
use subaperture::simulate::{PointTargetHistory, Scatterer};
use subaperture_tests::error_db;

pub(crate) const OMEGA_K: OmegaK = OmegaK { error_db: -60.0 };
pub(crate) const RDA: RangeDopplerAlgorithm = RangeDopplerAlgorithm {
    error_db: -60.0,
    secondary_compression: true,
};
pub(crate) const RDA_WITHOUT_SRC: RangeDopplerAlgorithm = RangeDopplerAlgorithm {
    error_db: -60.0,
    secondary_compression: false,
};

/// A radar on a track.
pub(crate) struct Radar {
    /// Frequency of sample 0, step (both Hz), number of samples.
    pub(crate) band: (f64, f64, usize),
    pub(crate) num_pulses: usize,
    /// Transmitter and receiver of pulse `n`, 0 in the middle of the aperture.
    pub(crate) antennas: fn(f64) -> (DVec3, DVec3),
    /// Reference path of all samples; that of the scene's origin if `None`.
    pub(crate) reference_path_m: Option<f64>,
}

impl Radar {
    pub(crate) fn collection(&self) -> Collection {
        self.collection_on(self.antennas)
    }

    /// The same band on another track: transmitter and receiver of pulse `n`, 0 in the middle of the aperture.
    pub(crate) fn collection_on(&self, antennas: impl Fn(f64) -> (DVec3, DVec3)) -> Collection {
        let (start_hz, step_hz, num_samples) = self.band;
        let pulses = (0..self.num_pulses)
            .map(|n| {
                let index = n as f64 - (self.num_pulses as f64 - 1.0) / 2.0;
                let (transmitter_m, receiver_m) = antennas(index);
                let to_origin_m = transmitter_m.length() + receiver_m.length();
                Pulse {
                    time_s: n as f64,
                    transmitter_m,
                    receiver_m,
                    reference_m: DVec3::ZERO,
                    reference_path_m: self.reference_path_m.unwrap_or(to_origin_m),
                    start_hz,
                    step_hz,
                    sweep: Sweep::AT_ONCE,
                    recorded_path_m: None,
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
    pub(crate) fn over_many(&self, half_m: [f64; 2]) -> PointTargetHistory {
        PointTargetHistory::new(self.collection(), twelve(half_m), None)
    }
}

/// Twelve scatterers within `half_m` of the origin.
pub(crate) fn twelve(half_m: [f64; 2]) -> Vec<Scatterer> {
    (0..12)
        .map(|i| {
            // Powers of the plastic number: evenly spread without a lattice.
            let place = |a: f64| 2.0 * (a * f64::from(i) + 0.5).fract() - 1.0;
            let (x, y) = (place(0.754_877_666), place(0.569_840_291));
            Scatterer {
                position_m: DVec3::new(half_m[0] * x, half_m[1] * y, 0.0),
                amplitude: Complex64::cis(f64::from(i)),
            }
        })
        .collect()
}

/// A stripmap radar at 5 GHz with 100 MHz, 3 km away and 1 km above the ground, broadside.
pub(crate) const STRIPMAP: Radar = Radar {
    band: (4.95e9, 0.8e6, 125),
    num_pulses: 600,
    antennas: |n| {
        let at = DVec3::new(0.4 * n, -(8f64.sqrt()) * 1000.0, 1000.0);
        (at, at)
    },
    reference_path_m: Some(6000.0),
};

/// A rail of 1.6 m, 1.1 to 1.3 GHz, with scatterers from 6 m on.
pub(crate) const RAIL: Radar = Radar {
    band: (1.1e9, 4e6, 51),
    num_pulses: 81,
    antennas: |n| {
        let at = DVec3::new(0.02 * n, -9.0, 0.0);
        (at, at)
    },
    reference_path_m: Some(0.0),
};

/// X band, 200 MHz, squinted 40 degrees forward.
pub(crate) const SQUINT: Radar = Radar {
    band: (9.4e9, 1e6, 200),
    num_pulses: 300,
    antennas: |n| {
        let ahead_m = 2000.0 * 40f64.to_radians().tan();
        let at = DVec3::new(0.3 * n - ahead_m, -2000.0, 0.0);
        (at, at)
    },
    reference_path_m: None,
};

pub(crate) fn try_form(
    history: &dyn PhaseHistory,
    grid: &ImageGrid,
    window: Window,
    former: &dyn ImageFormer,
    memory_bytes: u64,
    monitor: &dyn Monitor,
) -> Result<Formed, FormError> {
    let weights = Weights::new(history.collection(), window, window);
    former.form_best(&Task {
        memory_bytes,
        monitor,
        ..Task::new(history, grid, &weights)
    })
}

/// Errors of the formers on a grid, dB against the exact sum.
pub(crate) fn errors_db<const N: usize>(
    case: &str,
    history: &PointTargetHistory,
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
        let predicted_db = formed.predicted_error_db;
        println!(
            "{case}: {} {db:.1} dB in {taken:.2?}, predicted {predicted_db:.1}, track {}, line {}",
            former.name(),
            formed.settings["track_error_db"],
            formed.settings["line_error_db"],
        );
        assert!(db <= predicted_db + 3.0, "{db} {predicted_db}");
        assert!(formed.bound_missed || db <= -40.0, "{db}");
        db
    })
}

/// Names of the formers that the error recommends.
pub(crate) fn others(error: &FormError) -> Vec<&'static str> {
    let remedies = error.remedies().iter();
    let named = remedies.filter_map(|remedy| match remedy {
        Remedy::OtherFormer(names) => Some(*names),
        _ => None,
    });
    named.flatten().copied().collect()
}
