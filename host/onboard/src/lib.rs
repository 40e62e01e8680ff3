//! The processor on the platform, seen from the host: what it is to do, the line to it, and what becomes of its maps.
//!
//! A part of [Subaperture](https://docs.rs/subaperture), radar image formation: the crate `subaperture`
//! has it as its module `onboard`.
//!
//! ```text
//! phase history ─> plan ─> link ═ serial ═ module        (subaperture-core: stream)
//!                           └─> maps, maps_file ─> image
//! ```
//!
//! This processor is called the module, here as in the words of the command line.
//!
//! - [`plan`]: sub-CPIs, patches and buffers that keep a bound on the error within a module's memory;
//! - [`link`]: a session with a module over a serial line, or with one under emulation;
//! - [`maps`]: range-Doppler maps of patches; [`maps_file`]: kept in a file; [`image`]: an image of them;
//! - [`crosscheck`]: every sub-CPI through the host ([`range_doppler`]) and the core, compared.
#![forbid(unsafe_code)]

pub mod crosscheck;
pub mod image;
pub mod link;
pub mod maps;
pub mod maps_file;
pub mod plan;
pub mod range_doppler;
