//! Radar image formation in a web page. Part of [Subaperture](https://docs.rs/subaperture).
//!
//! The page opens CPHD and GOTCHA files and archives of arrays (`.npz`) from the memory of the browser and forms images on one thread of a
//! web worker. No byte of a recording leaves the machine: the page's content security policy forbids every connection except to its own
//! origin.
//!
//! | module | contents |
//! |---|---|
//! | [`recording`] | recordings opened from bytes, with their summary |
//! | [`request`] | image requested by the page: grid, former, error bound |
//! | [`focused`] | formed image: pixels as `.npy`, levels for a picture, facts |
//! | [`memory`] | limit of the memory |
//! | `bindings` | the same for JavaScript (wasm32 only) |
//!
//! The folder `page` contains the page; `cargo xtask wasm` writes both to `target/wasm`.
//!
//! **Bits.** Kernels are rounded once per operation, as on every machine, and [`request::Request::portable`] selects the portable
//! transforms: images are then bit-identical to those of the native library. Otherwise only the transforms differ, by rounding.
//! `tests/page.rs` compares both in Chromium.
//!
//! **Memory.** At most [`memory::MEMORY_BYTES`] for the recording, the image and the scratch of the former; the address space of wasm32
//! is 4 GiB.
#![forbid(unsafe_code)]

#[cfg(target_arch = "wasm32")]
mod bindings;
pub mod focused;
pub mod memory;
pub mod recording;
pub mod request;
