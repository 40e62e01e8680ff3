//! Tracker of GMTI detections over time: Kalman filter, global nearest neighbour association, sequential probability ratio test.
//!
//! **State.** `s = (x, y, vx, vy)`, metres and metres per second along the two axes of a [`Plane`]. Motion is nearly of constant velocity: white
//! acceleration of spectral density `q`, m^2/s^3, independent along x and y. Over an interval `T`,
//!
//! ```text
//! x(t + T) = x + T vx,  vx(t + T) = vx,   Q = q [[T^3 / 3, T^2 / 2], [T^2 / 2, T]]  of (x, vx), and the same of (y, vy)
//! ```
//!
//! **Measurement.** `z = (x, y, v_r)` with a 3 x 3 covariance `R`. The radial velocity is positive when approaching. With the radar at `a`, the target
//! at `p`, its velocity `v` in the plane and the unit vector `u = (p - a) / |p - a|`,
//!
//! ```text
//! v_r = -v . u,   d v_r / dv = -u,   d v_r / dp = -(v - (v . u) u) / |p - a|
//! ```
//!
//! Errors of position and radial velocity are correlated: a GMTI position is the image place moved along the track by `R_0 v_r / V` at the slant range
//! `R_0` and the radar's speed `V`. [`Detection::of`] builds `R` with the cross terms.
//!
//! **Filter.** Extended Kalman filter with the Jacobian `H` at the predicted state, `S = H P H^T + R`, `K = P H^T S^-1`, and Joseph's form
//! `P = (I - K H) P (I - K H)^T + K R K^T`. The unknown tangential speed of a new track, times the error of the position, is a radial velocity of
//! second order: with the mixed second derivatives `C = d^2 v_r / dp dv = -(I - u u^T) / |p - a|` in the Hessian `[[0, C], [C^T, 0]]`, the predicted
//! `v_r` has the mean `+ tr(Hessian P) / 2` and `R` the variance `+ tr(Hessian P Hessian P) / 2` (second-order filter, Bar-Shalom 10.3.2).
//! Second derivatives by position alone are neglected: about `|v| (sigma / |p - a|)^2` for a cross-range standard deviation `sigma`, 1e-3 m/s for
//! 20 m/s, 35 m and 5 km.
//!
//! **Folded velocities.** With a velocity ambiguity `A` the radial velocity is `v_r + k A` for an integer `k`. The position moves with it: its range
//! from the radar stays, and its direction cosine along the radar's velocity `w` changes by
//!
//! ```text
//! w . u(p_k) = w . u(p) - k A
//! ```
//!
//! The covariance follows by the derivative of `p_k` with respect to `p`. The fold nearest to the prediction minimises `d^2 + ln det S` among
//! those within 4 standard deviations of the predicted radial velocity, at most 8 on each side.
//!
//! A new track starts at the stated velocity (`k = 0`). Its fold stays unknown: all folds of a detection have the same range and range rate, and
//! therefore predict the same detections apart from the curvature of the range circle. A track of a wrong fold is continuous, and its position
//! and velocity are those of a fold. Velocities beyond the interval need channels with smaller baselines, several pulse repetition frequencies, or a
//! map of roads.
//!
//! **Gate.** `d^2 = nu^T S^-1 nu` of the innovation `nu`, detection minus prediction, is at most the chi-square quantile of 3 degrees of freedom at the gate probability.
//!
//! **Association.** One detection per track and one track per detection, with the least sum of `d^2 + ln det S`. A track without a detection costs
//!
//! ```text
//! G = 2 ln(P_D / ((1 - P_D) (2 pi)^(3/2) beta)),   beta = beta_FA + beta_NT
//! ```
//!
//! the cost at which a detection changes the score as a miss does (maximum-likelihood gate, Blackman and Popoli 6.3). `beta_FA` and `beta_NT` are the
//! densities of false alarms and of new targets per scan, 1 / (m^2 m/s). The assignment is optimal (shortest augmenting paths of Jonker and
//! Volgenant, separately for each group of tracks and detections linked by gates).
//!
//! **Score.** The log-likelihood ratio of a target against false alarms (Blackman and Popoli 6.2) starts at `ln(beta_NT / beta_FA)`. A scan adds
//!
//! ```text
//! ln(P_D / ((2 pi)^(3/2) beta sqrt(det S))) - d^2 / 2   with a detection
//! ln(1 - P_D)                                            without
//! ```
//!
//! With the probabilities of false confirmation `alpha` and of true deletion `eps`, and the score `L_0` of the first detection,
//!
//! ```text
//! tentative track:  confirmed at L - L_0 >= ln((1 - eps) / alpha),  deleted at L - L_0 <= ln(eps / (1 - alpha))      (Wald)
//! confirmed track:  deleted at max L - L >= ln((1 - alpha) / eps)                                                   (Page)
//! ```
//!
//! A tentative track of false alarms is confirmed with a probability of at most `alpha / (1 - eps)`: a scan's factor of the score is at most the exact
//! likelihood ratio of all detections, whose mean over uniform false alarms of density `beta` is 1. A confirmed track whose scores follow the model is
//! deleted less often than once in `(1 - alpha) / eps` scans (Lorden). Without detections, a track is deleted after
//! `ln((1 - alpha) / eps) / -ln(1 - P_D)` scans, rounded up: 4 at the defaults.
//!
//! **Initiation.** Each detection without a track starts one. The tangential speed has mean 0 and a prior standard deviation; the other
//! components follow from `z`, with the covariance `T R T^T` of the inverse `T` of the measurement. The error of the position turns the tangential
//! direction by an angle of variance `sigma_a^2`; with the prior `sigma_t` this adds the variance `(sigma_t sigma_a)^2` of the radial speed. A radar within 1e-3 rad of the plane's
//! normal above a target measures no velocity in the plane: such detections start and continue no track.
//!
//! **Limits.** The numbers of tracks, tentative tracks, detections per scan and history entries are bounded by [`Settings`]. Cost per scan:
//! tracks times detections, and the cube of the size of the largest group. One track per target: a target resolved into several detections
//! starts several tracks.
//!
//! **Accuracy** (`tests/tracker/`). Over 200 simulated runs of 40 scans, the normalised estimation error squared (NEES) has a mean of 4.06, expected 4,
//! and the normalised innovation squared (NIS) 2.990, expected 3. Of 10 crossing targets of 1 to 20 m/s with `P_D = 0.9` and 5 false alarms per scan,
//! in 10 runs of 60 scans, all 100 have one confirmed track, without identity swaps and false tracks; 99.9 % of their detections update
//! it, the position error is 7.0 m RMS, and the 95 % ellipse contains 94.8 %.
//!
//! **Sources.** Blackman, Popoli, "Design and analysis of modern tracking systems", Artech House, 1999 (score, thresholds, association). Bar-Shalom, Li,
//! Kirubarajan, "Estimation with applications to tracking and navigation", Wiley, 2001 (motion model, Joseph's form, NEES). Wald, "Sequential tests of
//! statistical hypotheses", Ann. Math. Stat. 16, 1945. Page, "Continuous inspection schemes", Biometrika 41, 1954. Lorden, "Procedures for
//! reacting to a change in distribution", Ann. Math. Stat. 42, 1971. Jonker, Volgenant, "A shortest augmenting path algorithm for dense
//! and sparse linear assignment problems", Computing 38, 1987.

mod assignment;
mod association;
mod error;
mod filter;
mod fold;
mod gate;
mod plane;
mod scan;
mod settings;
mod track;

pub use association::Tracker;
pub use error::TrackerError;
pub use plane::Plane;
pub use scan::{Detection, Scan};
pub use settings::Settings;
pub use track::{Estimate, Status, Track};
