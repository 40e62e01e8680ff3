//! Detection performance of all methods by Monte Carlo, against theory: probability of detection, false alarms, minimum detectable velocity (MDV).
//!
//! ```text
//! draw ─> recordings of clutter with targets of known motion (the caller simulates them)
//!      ─> outcomes: each method's statistic of each target, and of motions without a target
//!      ─> Evaluation ─> Report: Pd and SINR over radial velocity, MDV, Pd over Pfa (ROC), measured over requested false alarms
//! ```
//!
//! A statistic is recorded as the probability that clutter alone exceeds it. A target is detected at every probability of false alarm above it, so that one trial gives a point of
//! each ROC curve. The statistic is evaluated at the true motion of the target, or at the pixel nearest to the place where the image shows it: losses of the
//! search are not included, and pixels lose up to some tenths of a dB between samples.
//!
//! Targets move along the line of sight, so that the image focuses them, and fluctuate from recording to recording (Swerling 1).

mod draw;
mod method;
mod outcomes;
mod plan;
mod report;
mod trials;

pub use draw::TestTarget;
pub use method::Method;
pub use outcomes::Setup;
pub use plan::Plan;
pub use report::{AtVelocity, FalseAlarms, MethodReport, Report};
pub use trials::Evaluation;
