//! Phase convention of a recording: the sign of its phase and the path that the phase is compensated to.
//!
//! Image formers use one convention, that of [`phase_history`](super), and readers convert to it. If a file does not
//! state its convention, there is no default: an image of its samples is formed for each candidate, and the candidate
//! with the clearly sharpest image is used ([`judge`]). An [`Inference`] measures the sharpness; the crate
//! `subaperture` provides one. Readers only create the candidates.
//!
//! The test distinguishes candidates that differ by more than a shift or a mirrored image. Raw samples of either sign
//! and compensated samples differ by the curvature of the whole wave front. Compensated samples of either sign differ
//! only by the change of curvature across the scene: a small, distant scene is equally sharp for both, mirrored about
//! the reference point, and the file must state the sign.

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
    /// `exp(-j 2 pi f tau)`, the convention of image formers and of CPHD with `SGN = -1`.
    Minus,
    /// `exp(+j 2 pi f tau)`.
    Plus,
}

impl PhaseSign {
    /// Opposite sign.
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
    /// No compensation: the phase is that of the whole path (reference path 0).
    Raw,
    /// The path to one point of the scene frame, metres.
    Point(DVec3),
    /// A path or a point that the recording states for each pulse.
    Recorded,
}

impl PhaseReference {
    /// Set the reference of a pulse. A recorded reference is kept.
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

/// Origin of a property of the convention.
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

/// Phase convention of a recording as recorded. Samples are always delivered with the sign [`PhaseSign::Minus`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PhaseConvention {
    /// Sign.
    pub sign: PhaseSign,
    /// Origin of the sign.
    pub sign_basis: Basis,
    /// Reference.
    pub reference: PhaseReference,
    /// Origin of the reference.
    pub reference_basis: Basis,
}

impl PhaseConvention {
    /// Convention that is completely stated by the recording.
    pub fn stated(sign: PhaseSign, reference: PhaseReference) -> Self {
        Self {
            sign,
            sign_basis: Basis::Stated,
            reference,
            reference_basis: Basis::Stated,
        }
    }

    /// Whether sign or reference is inferred.
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

/// Part of a recording that is used to compare candidates.
#[derive(Clone, Debug)]
pub struct Probe {
    /// Pulse indices, ascending.
    pub pulses: Vec<usize>,
    /// Frequency samples.
    pub samples: Range<usize>,
    /// Grid of the image patch.
    pub grid: ImageGrid,
}

/// Sharpness of an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sharpness {
    /// Sharpness as a power: larger for a sharper image of the same samples.
    pub power: f64,
    /// Whether the image has a point: a peak that noise of its mean power exceeds in less than one of 10^4 images.
    pub has_point: bool,
}

/// Method of comparing candidates of the convention.
#[derive(Clone, Copy)]
pub struct Inference {
    /// Select the part of a recording that distinguishes candidates at a bounded cost. References in the collection
    /// are not used. An error states why no part does.
    pub plan: fn(&Collection) -> Result<Probe, String>,
    /// Sharpness of the image of that part, with the given memory limit in bytes. An error states why there is no
    /// image.
    pub sharpness: fn(&Probe, &InMemory, u64) -> Result<Sharpness, String>,
}

impl fmt::Debug for Inference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Inference")
    }
}

/// Minimum ratio of sharpness (power) at which one candidate is clearly sharper than another: 1.76 dB. Between
/// equivalent candidates the position of points between pixels changes the sharpness by at most 0.5 dB, and noise by
/// less.
pub const CLEAR_RATIO: f64 = 1.5;

/// Result of comparing candidates by image sharpness.
#[derive(Clone, Debug, PartialEq)]
pub enum InferenceOutcome {
    /// One candidate, by its index, and the ratio of its sharpness to the next one's in dB.
    Clear(usize, f64),
    /// Candidates of about equal sharpness, the sharpest first.
    Alike(Vec<usize>),
}

/// Compare candidates by the sharpness of their images. An image without a point is not conclusive.
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
    fn judge_requires_clearly_sharper_candidate() {
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
