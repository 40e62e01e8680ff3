//! Phase convention of a recording: the sign of its phase and the path that the phase is compensated to.
//!
//! Image formers know one convention, that of [`phase_history`](super). Readers convert to it. A file that does not state its own is not
//! read by a default: an image of its samples is formed under each candidate, and the candidate whose image is
//! clearly the sharpest is taken ([`judge`]). How an image's sharpness is measured is an [`Inference`], which
//! the crate `subaperture` brings; readers only make the candidates.
//!
//! The test works where candidates differ by more than a shift or a mirrored image. Raw samples of either sign and compensated samples
//! differ by the curvature of the whole wave front. Compensated samples of either sign differ by the change of curvature across the scene only: a
//! small scene far away looks equally sharp under both, mirrored about the reference point, and the file has to state the sign.

use std::fmt;
use std::ops::Range;

use glam::DVec3;
use serde::Serialize;

use super::{Collection, InMemory, Pulse};
use crate::geometry::ImageGrid;

/// Sign of the phase `sign 2 pi f tau` of an echo of delay `tau`, as recorded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(into = "i8")]
pub enum PhaseSign {
    /// `exp(-j 2 pi f tau)`: that of image formers, and CPHD's `SGN = -1`.
    Minus,
    /// `exp(+j 2 pi f tau)`.
    Plus,
}

impl PhaseSign {
    /// The other one.
    #[must_use]
    pub fn opposite(self) -> Self {
        match self {
            Self::Minus => Self::Plus,
            Self::Plus => Self::Minus,
        }
    }
}

impl From<PhaseSign> for i8 {
    fn from(sign: PhaseSign) -> Self {
        match sign {
            PhaseSign::Minus => -1,
            PhaseSign::Plus => 1,
        }
    }
}

impl fmt::Display for PhaseSign {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", i8::from(*self))
    }
}

/// Reference of the phase compensation of the samples.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PhaseReference {
    /// Nothing: the phase is that of the whole path (reference path 0).
    Raw,
    /// The path to one point of the scene frame, metres.
    Point(DVec3),
    /// A path or a point that the recording gives pulse by pulse.
    Recorded,
}

impl PhaseReference {
    /// Sets the reference of a pulse. One that the recording gives is kept.
    pub fn set(self, pulse: &mut Pulse) {
        match self {
            Self::Raw => (pulse.reference_m, pulse.reference_path_m) = (DVec3::ZERO, 0.0),
            Self::Point(point) => {
                (pulse.reference_m, pulse.reference_path_m) = (point, pulse.path_m(point));
            }
            Self::Recorded => {}
        }
    }
}

impl fmt::Display for PhaseReference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Raw => f.write_str("not compensated (raw echoes)"),
            Self::Point(DVec3::ZERO) => f.write_str("compensated to the origin 0, 0, 0"),
            Self::Point(DVec3 { x, y, z }) => write!(f, "compensated to {x}, {y}, {z} m"),
            Self::Recorded => f.write_str("compensated to each pulse's reference"),
        }
    }
}

/// Where a property of the convention is known from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Basis {
    /// The recording or its format states it.
    Stated,
    /// Inferred from the samples, by the sharpest image.
    Inferred,
}

impl fmt::Display for Basis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Stated => "stated",
            Self::Inferred => "inferred",
        })
    }
}

/// The convention of a recording's phase, as recorded. Samples that are read have the sign of [`PhaseSign::Minus`] whatever this says.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PhaseConvention {
    /// Sign.
    pub sign: PhaseSign,
    /// Where the sign is known from.
    pub sign_basis: Basis,
    /// Reference.
    pub reference: PhaseReference,
    /// Where the reference is known from.
    pub reference_basis: Basis,
}

impl PhaseConvention {
    /// A convention that the recording states in full.
    pub fn stated(sign: PhaseSign, reference: PhaseReference) -> Self {
        Self {
            sign,
            sign_basis: Basis::Stated,
            reference,
            reference_basis: Basis::Stated,
        }
    }

    /// Whether any of it is inferred.
    pub fn is_inferred(&self) -> bool {
        [self.sign_basis, self.reference_basis].contains(&Basis::Inferred)
    }
}

impl fmt::Display for PhaseConvention {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "sign {} ({}), {} ({})",
            self.sign, self.sign_basis, self.reference, self.reference_basis
        )
    }
}

/// The part of a recording that candidates are compared by.
#[derive(Clone, Debug)]
pub struct Probe {
    /// Pulses, ascending.
    pub pulses: Vec<usize>,
    /// Frequency samples.
    pub samples: Range<usize>,
    /// The patch that is formed.
    pub grid: ImageGrid,
}

/// How sharp an image is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sharpness {
    /// A power, which is larger of a sharper image of the same samples.
    pub power: f64,
    /// Whether the image has a point at all: a peak that noise of its mean power has in less than one image of 10^4.
    pub has_point: bool,
}

/// How candidates of the convention are compared.
#[derive(Clone, Copy)]
pub struct Inference {
    /// Select the part of a recording that distinguishes candidates at a bounded cost. References in the collection are not used. An error says why
    /// there is none.
    pub plan: fn(&Collection) -> Result<Probe, String>,
    /// Sharpness of the image of that part, which may take so many bytes. An error says why there is no image.
    pub sharpness: fn(&Probe, &InMemory, u64) -> Result<Sharpness, String>,
}

impl fmt::Debug for Inference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Inference")
    }
}

/// Ratio of sharpness, a power, from which one candidate is clearly sharper than another: 1.76 dB. Between candidates that are alike the place
/// of points between pixels makes 0.5 dB of difference at most, and noise less.
pub const CLEAR_RATIO: f64 = 1.5;

/// Result of comparing candidates by image sharpness.
#[derive(Clone, Debug, PartialEq)]
pub enum InferenceOutcome {
    /// One candidate, by its index, and how much sharper it is than the next, dB.
    Clear(usize, f64),
    /// Candidates that are about as sharp as each other, the sharpest first.
    Alike(Vec<usize>),
}

/// Compares candidates by the sharpness of their images. An image without a point decides nothing.
pub fn judge(candidates: &[Sharpness]) -> InferenceOutcome {
    let sharpness: Vec<f64> = candidates.iter().map(|candidate| candidate.power).collect();
    let mut order: Vec<usize> = (0..sharpness.len()).collect();
    order.sort_by(|&a, &b| sharpness[b].total_cmp(&sharpness[a]));
    let Some(&best) = order.first() else {
        return InferenceOutcome::Alike(Vec::new());
    };
    if !candidates[best].has_point {
        return InferenceOutcome::Alike(order);
    }
    let most = sharpness[best];
    let clear = |&i: &usize| most >= CLEAR_RATIO * sharpness[i] && most > 0.0;
    match order.get(1) {
        Some(next) if clear(next) => {
            let ratio = most / sharpness[*next].max(f64::MIN_POSITIVE);
            InferenceOutcome::Clear(best, 10.0 * libm::log10(ratio))
        }
        Some(_) => {
            order.retain(|i| !clear(i));
            InferenceOutcome::Alike(order)
        }
        None => InferenceOutcome::Clear(best, f64::INFINITY),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn judge_takes_only_a_candidate_that_is_clearly_sharper() {
        let judged = |powers: &[f64], has_point: bool| {
            let of = |&power: &f64| Sharpness { power, has_point };
            judge(&powers.iter().map(of).collect::<Vec<_>>())
        };
        // 10 log10(4 / 1).
        let InferenceOutcome::Clear(2, ratio_db) = judged(&[1.0, 0.5, 4.0], true) else {
            panic!("not clear");
        };
        assert!((ratio_db - 6.0206).abs() < 1e-3, "{ratio_db}");
        assert_eq!(
            judged(&[1.0, 0.1, 1.4], true),
            InferenceOutcome::Alike(vec![2, 0])
        );
        assert_eq!(
            judged(&[1.0, 4.0], false),
            InferenceOutcome::Alike(vec![1, 0])
        );
        assert_eq!(
            judged(&[0.0, 0.0], true),
            InferenceOutcome::Alike(vec![0, 1])
        );
        assert_eq!(
            judged(&[3.0], true),
            InferenceOutcome::Clear(0, f64::INFINITY)
        );
        assert_eq!(judge(&[]), InferenceOutcome::Alike(Vec::new()));
    }
}
