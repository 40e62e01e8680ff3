//! Radar image formation: from phase history to a focused, measured image.
//!
//! A recording is opened, an image of it formed by one of seven algorithms within a bound on its error, and saved as an
//! array, a record of everything that it came from, and a picture. The whole program:
//!
#![doc = concat!("```no_run\n", include_str!("../examples/read_and_focus.rs"), "```")]
//!
//! [`open()`] reads CPHD, CRSD, AFRL's GOTCHA files and raw samples described in TOML; [`scene_grid`] is a grid that suits what
//! was recorded, and any other is written as text or made of numbers ([`geometry::ImageGrid`]). [`Focus::focus`] takes
//! defaults for all the rest; [`Focusing`] has them: windows, memory, progress, what to do where the bound is missed. The
//! image comes with its grid, frame, band and settings ([`FocusedImage`]).
//!
//! Nothing need be on a disk. Phase history of one's own is a [`phase_history::InMemory`] of arrays or implements
//! [`phase_history::PhaseHistory`]; simulated, it looks like this:
//!
#![cfg_attr(feature = "simulate", doc = "```")]
#![cfg_attr(not(feature = "simulate"), doc = "```ignore")]
//! use subaperture::prelude::*;
//! use subaperture::simulate::{Preset, Variation};
//!
//! // 41 points seen from 5 km by a radar of 200 MHz at 10 GHz; one is in the middle.
//! let recording = Preset::Table41.simulate(&Variation::default());
//! let grid: ImageGrid = "x=-4:4:0.25,y=-4:4:0.25,z=0".parse()?;
//! let image = Backprojection::default().error_db(-50.0).focus(&recording, &grid)?;
//!
//! let brightest = image.brightest().ok_or("an image of zeros")?;
//! assert_eq!(brightest.position_m, [0.0, 0.0, 0.0]);
//! assert!(brightest.level_db.abs() < 0.1 && image.predicted_error_db < -50.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! [`open_channels`] has all channels of a recording side by side: formers take one, or the coherent sum of all
//! ([`phase_history::Channels`]). [`focus::live::Live`] takes pulses one at a time, as a radar sends them, and has the image of
//! those so far after each.
//!
//! The folder `examples` has six programs: [read and focus][a], [phase history of one's own][b], [simulate and
//! measure][c], [one image in tiles][d] on as many machines as there are, [a live image][f], and [a former of one's
//! own][e].
//!
//! [a]: https://docs.rs/crate/subaperture/latest/source/examples/read_and_focus.rs
//! [b]: https://docs.rs/crate/subaperture/latest/source/examples/own_history.rs
//! [c]: https://docs.rs/crate/subaperture/latest/source/examples/simulate_and_measure.rs
//! [d]: https://docs.rs/crate/subaperture/latest/source/examples/tiles.rs
//! [e]: https://docs.rs/crate/subaperture/latest/source/examples/own_former.rs
//! [f]: https://docs.rs/crate/subaperture/latest/source/examples/live.rs
//!
//! # Conventions
//! - **Phase.** A unit scatterer at `p` in pulse `n` at frequency `f` has the phase
//!   `-2 pi f (path_n(p) - reference_path_n) / c`: CPHD's `SGN = -1`. Readers convert to it; nothing else asks.
//! - **Path** is the two-way length from transmitter to point to receiver, metres: of one antenna twice the range.
//! - **Frame.** Positions are metres in the scene frame ([`geometry::SceneFrame`]), float64: x and y in the scene's plane, z up;
//!   a recording may say where on the Earth that is.
//! - **Images** have rows of y ascending and columns of x ascending, complex float32. A unit scatterer on a pixel, seen alike
//!   by all pulses, reads 1, whatever the windows.
//! - **Units** are in names (`_m`, `_s`, `_hz`, `_rad`, `_db`), and SI otherwise. Levels are `20 log10` of magnitudes.
//! - **Error** means relative RMS error against the exact sum ([`focus::exact`]), phase included, over the grid's pixels.
//!
//! # Modules and features
//! What `default` takes reads, simulates, measures and draws; `full` is all there is but `uhd`, which has a licence of its own, and `viewer`,
//! which takes a server.
//!
//! | module | what it holds | feature | adds dependencies |
//! |---|---|---|---|
//! | [`phase_history`], [`geometry`], [`image`], [`radar`], [`track`], [`monitor`], [`units`], [`quantity`] | what all speak of | | |
//! | [`focus`] | image formers, plans of them, the contract on their error | | `rayon`, `rustfft` |
//! | [`resolution`] | what a collection can show: widths, sampling, a grid | | |
//! | [`signal`] | windows, transforms, kernels | | |
//! | [`io`] | files: recordings in, images out | | `fs4`, `serde_json` |
//! | `io::cphd`, `io::crsd` | CPHD 1.x; CRSD 1.0, read | `cphd` | `roxmltree` |
//! | `io::gotcha` | AFRL's GOTCHA files (MATLAB 5) | `gotcha` | `flate2` |
//! | [`io::npy`], `io::arrays` | arrays in NumPy's archives, too, and phase history of them | `npz` | `zip` |
//! | `io::arrays` | phase history of arrays in HDF5 | `hdf5` | `hdf5-pure` |
//! | `io::recording`, `describe`, `receive` | raw recordings described in TOML, and what they need to be phase history | `recording` | `toml` |
//! | `job` | a whole job as one text: which stages stand, and what is to be done again | `recording` | |
//! | `simulate` | scenes, tracks and receivers, and what a radar records of them | `simulate` | `rand_chacha`, `rand_distr`, `png` |
//! | `quality` | measures of images: responses, statistics, coherence | `quality` | |
//! | `plot` | pictures of images and curves | `plot` | `png`, `ab_glyph`, `dejavu` |
//! | `planner` | what a radar will show, what that takes and costs | `planner` | |
//! | `autofocus` | parameters, phases and tracks of recordings by the sharpness of their images | `autofocus` | |
//! | `motion`, `targets` | a radar's own motion from the phases of its echoes, and the targets that they are of | `motion` | |
//! | `navigation` | logs of navigation receivers; a radar's own motion fused with them | `navigation` | |
//! | `one_track` | one track of a recording's echoes and its navigation | `motion` and `navigation` | |
//! | `maps` | images on the map: cloud-optimised GeoTIFF, KMZ, PNG with world files | `maps` | `png`, `flate2`, `zip` |
//! | `sicd` | complex images as SICD: written for other programs, and read of them | `sicd` | `roxmltree` |
//! | `terrain` | surfaces of the Earth to focus on: elevation models (SRTM HGT, GeoTIFF), heights above the ellipsoid | `terrain` | `tiff` |
//! | `onboard` | a processor on the platform: its plan, the serial link, its maps | `link` | `subaperture-core`, `serial2` |
//! | `radio` | a stepped-carrier radar on a software-defined radio: the radio, a simulated one, capture, range profiles | `radio` | |
//! | `live_capture` | the image of a capture, sweep by sweep as it comes, on a known way or as its echoes tell | `radio`, which brings `motion` | |
//! | `viewer` | local web pages: images of any size, a capture as it runs | `viewer` | `axum`, `tokio` |
//! | `radio::uhd` | a USRP by UHD, which is under GPL-3.0-or-later | `uhd` | the library UHD, linked |
//!
//! `default` is `cphd`, `gotcha`, `npz`, `recording`, `simulate`, `quality` and `plot`.
//!
//! [`glam`], of which positions are, and [`num_complex`], of which samples are, are here under their own names.
#![forbid(unsafe_code)]

mod focused;
mod focusing;
#[cfg(feature = "recording")]
pub mod job;
#[cfg(feature = "radio")]
pub mod live_capture;
#[cfg(all(feature = "maps", feature = "sicd"))]
pub mod on_map;
#[cfg(all(feature = "motion", feature = "navigation"))]
pub mod one_track;
pub mod prelude;
mod reading;
mod save;

pub use subaperture_model::{
    SPEED_OF_LIGHT_M_S, geometry, image, monitor, phase_history, quantity, radar, track, units,
};
pub use {
    subaperture_focus as focus, subaperture_io as io, subaperture_resolution as resolution,
    subaperture_signal as signal,
};

#[cfg(feature = "autofocus")]
pub use subaperture_autofocus as autofocus;
#[cfg(feature = "recording")]
pub use subaperture_describe as describe;
#[cfg(feature = "maps")]
pub use subaperture_maps as maps;
#[cfg(feature = "motion")]
pub use subaperture_motion as motion;
#[cfg(feature = "navigation")]
pub use subaperture_navigation as navigation;
#[cfg(feature = "link")]
pub use subaperture_onboard as onboard;
#[cfg(feature = "planner")]
pub use subaperture_planner as planner;
#[cfg(feature = "plot")]
pub use subaperture_plot as plot;
#[cfg(feature = "quality")]
pub use subaperture_quality as quality;
#[cfg(feature = "radio")]
pub use subaperture_radio as radio;
#[cfg(feature = "recording")]
pub use subaperture_receive as receive;
#[cfg(feature = "sicd")]
pub use subaperture_sicd as sicd;
#[cfg(feature = "simulate")]
pub use subaperture_simulate as simulate;
#[cfg(feature = "motion")]
pub use subaperture_targets as targets;

#[cfg(feature = "terrain")]
pub use subaperture_terrain as terrain;
#[cfg(feature = "viewer")]
pub use subaperture_viewer as viewer;

pub use {glam, num_complex};

pub use focused::FocusedImage;
pub use focusing::{Focus, Focusing};
pub use reading::{open, open_all, open_channels};
pub use save::SaveError;
pub use subaperture_resolution::survey::scene_grid;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
