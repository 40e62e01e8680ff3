//! Adaptive detection in Gaussian clutter of unknown covariance.
//!
//! **Model.** A cell is a complex vector `x` of `N` degrees of freedom, for example channels times Doppler bins: `x = a s + n` with a steering vector `s`, an amplitude `a` and
//! circular complex Gaussian clutter and noise `n` of covariance `R = E[n n^H]`. `K` independent training snapshots of the same covariance give the sum `S = sum_k x_k x_k^H`.
//! SNR is the output SNR of the filter matched to `R`: `|a|^2 s^H R^-1 s`, a power ratio.
//!
//! | statistic | formula | false-alarm probability |
//! |---|---|---|
//! | matched filter, known covariance | <code>\|s^H R^-1 x\|^2 / (s^H R^-1 s)</code> | `exp(-eta)` |
//! | AMF | <code>\|s^H S^-1 x\|^2 / (s^H S^-1 s)</code> | `E[(1 + eta b)^-L]` |
//! | Kelly's GLRT | `AMF / (1 + x^H S^-1 x)` | `(1 - eta)^L` |
//! | ACE | `AMF / (x^H S^-1 x)` | `E[(1 + (1 - b) eta / (1 - eta))^-L]` |
//!
//! with `L = K - N + 1` and the loss factor `b` of distribution `Beta(K - N + 2, N - 1)`.
//!
//! **Derivation.** Kelly's statistic `t` gives `u = t / (1 - t)`. Conditional on `b`, which depends only on the part of `x` orthogonal to `s`, `u` is the ratio of `|z|^2` to an independent Gamma variable of
//! shape `L`, `z` being complex Gaussian of variance 1 and mean square `SNR b` (Kelly 1986). From `1 + x^H S^-1 x = 1 / b + AMF` follow `AMF = u / b` and `ACE = u / (1 - b + u)`. So AMF exceeds
//! `eta` where `u > eta b`, and ACE where `u > (1 - b) eta / (1 - eta)`. [`Performance`] averages over `b` by quadrature.
//!
//! **Constant false-alarm rate.** All three adaptive statistics have a false-alarm probability independent of `R`. This holds for homogeneous Gaussian training without diagonal loading. A maximum over `M`
//! steering vectors has at most `M` times the false-alarm probability of one.
//!
//! **Use.** [`Covariance`] sums snapshots. [`Covariance::factor`] returns the [`Whitener`]. [`Detector`] evaluates cells without allocation and [`Detector::train`] replaces its covariance.
//! A scalar map of power outside the clutter Doppler band (exo-clutter detection) needs no covariance: use the CFAR detector of `subaperture-motion` or `subaperture_core::cfar`.
//!
//! **Sources.** Reed, Mallett, Brennan, "Rapid convergence rate in adaptive arrays", IEEE Trans. AES-10, 1974 (RMB: loss factor). Kelly, "An adaptive detection algorithm", IEEE Trans. AES-22, 1986 (GLRT).
//! Robey, Fuhrmann, Kelly, Nitzberg, "A CFAR adaptive matched filter detector", IEEE Trans. AES-28, 1992 (AMF). Conte, Lops, Ricci, "Asymptotically optimum radar detection in compound-Gaussian clutter",
//! IEEE Trans. AES-31, 1995, and Kraut, Scharf, "The CFAR adaptive subspace detector is a scale-invariant GLRT", IEEE Trans. SP-47, 1999 (ACE). Ward, "Space-time adaptive processing for airborne radar",
//! MIT Lincoln Laboratory TR-1015, 1994 (SINR loss, training).

mod covariance;
mod detector;
mod error;
mod exceedance;
mod loss;
mod performance;
mod whitener;

pub(crate) use covariance::widen;
pub use covariance::{Covariance, Loading};
pub use detector::{Detector, Peak, Statistic};
pub use error::AdaptiveError;
pub use loss::mean_sinr_loss;
pub use performance::{Performance, TargetModel};
pub use whitener::Whitener;
pub(crate) use whitener::{power, product};
