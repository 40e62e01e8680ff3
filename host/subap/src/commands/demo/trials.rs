//! Formers to demonstrate, and their images.

use std::time::Duration;

use subaperture::focus::ImageFormer;
use subaperture::focus::bp::Backprojection;
use subaperture::focus::exact::Exact;
use subaperture::focus::ffbp::FastFactorised;
use subaperture::focus::omega_k::OmegaK;
use subaperture::focus::pfa::PolarFormat;
use subaperture::focus::rda::RangeDopplerAlgorithm;
use subaperture::focus::rdbp::{Mode, RangeDopplerBackprojection, Thesis};
use subaperture::image::{Comparison, Image};

/// Scene of 80 x 80 m with a margin of 5 m, sampled at about half the resolution (0.58 x 0.75 m).
pub(super) const GRID: &str = "x=-45:45:0.3,y=-45:45:0.3,z=0";

/// Error bound of the formers that plan, dB.
const ERROR_DB: f64 = -60.0;

/// Former to demonstrate, with the error bound to keep.
pub(super) struct Trial {
    pub(super) folder: &'static str,
    pub(super) title: &'static str,
    pub(super) former: Box<dyn ImageFormer>,
    /// Relative RMS error that must not be exceeded, dB.
    pub(super) bound_db: Option<f64>,
}

/// Formed image with its error.
pub(super) struct Outcome {
    pub(super) trial: Trial,
    pub(super) image: Image,
    pub(super) difference: Image,
    pub(super) comparison: Comparison,
    pub(super) settings: serde_json::Map<String, serde_json::Value>,
    pub(super) taken: Duration,
}

/// Trial of a former that chooses all its parameters by its bound.
fn trial(
    folder: &'static str,
    title: &'static str,
    former: Box<dyn ImageFormer>,
    bound_db: Option<f64>,
) -> Trial {
    Trial {
        folder,
        title,
        former,
        bound_db,
    }
}

pub(super) fn trials() -> Vec<Trial> {
    let range_doppler = |folder, title, mode, pulses, bound_db| Trial {
        folder,
        title,
        former: Box::new(RangeDopplerBackprojection {
            mode,
            error_db: ERROR_DB,
            sub_cpi: Some(pulses),
            patch_m: None,
        }),
        bound_db,
    };
    let thesis = Mode::Thesis(Thesis::default());
    let precise = Mode::Precise;
    vec![
        trial(
            "bp",
            "bp",
            Box::new(Backprojection { error_db: ERROR_DB }),
            Some(ERROR_DB),
        ),
        range_doppler("thesis-40", "rdbp thesis, 26 x 40", thesis, 40, None),
        range_doppler(
            "precise-40",
            "rdbp precise, 26 x 40",
            precise,
            40,
            Some(-60.0),
        ),
        range_doppler("thesis-130", "rdbp thesis, 8 x 130", thesis, 130, None),
        range_doppler(
            "precise-130",
            "rdbp precise, 8 x 130",
            precise,
            130,
            Some(-45.0),
        ),
        trial(
            "ffbp",
            "ffbp",
            Box::new(FastFactorised { error_db: ERROR_DB }),
            Some(ERROR_DB),
        ),
        trial(
            "omega-k",
            "omega-k",
            Box::new(OmegaK { error_db: ERROR_DB }),
            Some(ERROR_DB),
        ),
        trial(
            "rda",
            "rda",
            Box::new(RangeDopplerAlgorithm {
                error_db: ERROR_DB,
                secondary_compression: true,
            }),
            Some(ERROR_DB),
        ),
        trial(
            "pfa",
            "pfa",
            Box::new(PolarFormat {
                error_db: ERROR_DB,
                centre_m: None,
            }),
            Some(ERROR_DB),
        ),
    ]
}

/// Exact sum, the reference of all comparisons.
pub(super) fn oracle() -> Trial {
    trial("exact", "exact", Box::new(Exact), None)
}

impl Outcome {
    /// Whether there is a bound that the error exceeds or may exceed.
    pub(super) fn misses_bound(&self) -> bool {
        let error_db = self.comparison.error_db.unwrap_or(f64::NAN);
        self.trial.bound_db.is_some_and(|bound_db| {
            let within = error_db <= bound_db;
            !within
        })
    }
}
