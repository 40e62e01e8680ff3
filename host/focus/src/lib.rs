//! Image formers: phase history in, complex image out.
//!
//! Part of [Subaperture](https://docs.rs/subaperture), radar image formation; the crate `subaperture`
//! re-exports it as the module `focus`.
//!
//! Every former computes, or approximates, the matched filter of Schone 2020 (section 1.2): for a
//! pixel at `p`
//!
//! ```text
//! I(p) = sum_n sum_k w_slow[n] w_fast[k] z[n][k] exp(+j 2 pi f_k (path_n(p) - reference_path_n) / c)
//!        / (sum_n w_slow[n]  sum_k w_fast[k])
//! ```
//!
//! so that a unit scatterer on a pixel, seen equally by all pulses, reads 1 for any window. The formers
//! differ only in speed and error. A scatterer that the antenna pattern, spreading loss or a shadow lets pulse `n` see with amplitude
//! `g_n` reads `sum_n w_slow[n] g_n / sum_n w_slow[n]`: the sum compensates phases only. In
//! strip maps a point therefore reads less, the smaller the illuminated part of the track; a recording does not contain `g_n`, so the
//! sum cannot divide by it. [`exact`] is the sum, the reference for all images; [`accuracy`] defines the
//! error, its prediction and the check of a requested bound.
#![forbid(unsafe_code)]

pub mod accuracy;
pub mod beam;
pub mod budget;
mod calibrate;
mod checks;
mod compared;
pub mod cost;
pub mod coverage;
pub mod dark;
pub mod device;
mod drawn;
mod error;
mod execute;
mod factorised;
mod fingerprint;
pub mod forecast;
mod formed;
pub mod former;
mod former_choices;
pub mod formers;
pub mod frequency_domain;
mod goal;
mod grid_points;
pub mod live;
pub mod machine;
pub mod moving;
mod numerics;
mod opened;
pub mod patch;
pub mod path_model;
mod path_tile;
mod pixels;
pub mod plan;
mod probes;
mod read_ahead;
mod rounding;
mod sampled;
mod second_look;
mod sink;
mod spec;
pub mod stages;
pub mod straight_track;
mod stray;
pub mod sub_cpi;
pub mod sweep;
mod task;
pub mod time_model;

pub use accuracy::Judgement;
use checks::{check, check_not_empty, check_size, check_surface};
pub use cost::{Cost, StageCost};
pub use drawn::SampledPixels;
pub use error::{FormError, Reason, Remedy};
pub use execute::{Executed, Execution};
pub use formed::Formed;
pub use former::{Forming, ImageFormer};
pub use former_choices::FormerChoices;
pub use formers::{auto, bp, exact, ffbp, omega_k, pfa, rda, rdbp};
pub use goal::{BoundPolicy, DEFAULT_ERROR_DB, ErrorGoal, MARGIN_DB, Settings};
pub use grid_points::GridPoints;
pub use numerics::{Numerics, Transforms};
pub use opened::Opened;
pub use plan::Plan;
pub use sampled::TileRecord;
pub use spec::{Decision, ImageSpec, SCRATCH_BYTES, Tile, Work};
pub use stray::RecordedEnergy;
pub use task::Task;
pub use time_model::TimeModel;

/// Instruction set used on this machine: `avx512`, `avx2`, `neon` or `portable`.
///
/// Kernels are bit-identical in all instruction sets. The fastest Fourier transforms are not; they also depend on the processor
/// ([`Transforms`]).
pub fn instructions() -> &'static str {
    subaperture_kernels::lanes::Instructions::best().name()
}
