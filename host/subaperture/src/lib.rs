//! Radar image formation: from phase history to a focused, measured image.
//!
//! The library opens a SAR recording, forms an image by one of seven algorithms within an error bound, measures it, and saves it
//! as an array with a metadata record and a picture. A complete program:
//!
#![doc = concat!("```no_run\n", include_str!("../examples/read_and_focus.rs"), "```")]
//!
//! - [`open()`] reads CPHD, CRSD, NISAR L0B, AFRL's GOTCHA files and GMTI challenge, arrays, and raw samples described in TOML.
//! - [`scene_grid`] proposes an image grid from the recording's extent and resolution. Other grids are parsed from text or
//!   constructed ([`geometry::ImageGrid`]).
//! - [`Focus::focus`] forms the image with default settings. [`Focusing`] sets windows, memory, progress reports, and whether
//!   an image that exceeds the error bound is an error.
//! - [`FocusedImage`] holds the pixels with their grid, frame, band and settings.
//!
//! No file is required. [`phase_history::InMemory`] wraps arrays in memory, and any type can implement
//! [`phase_history::PhaseHistory`]. This example simulates a recording and images it:
//!
#![cfg_attr(feature = "simulate", doc = "```")]
#![cfg_attr(not(feature = "simulate"), doc = "```ignore")]
//! use subaperture::prelude::*;
//! use subaperture::simulate::{Preset, Variation};
//!
//! // 41 point scatterers at 5 km range; 200 MHz of bandwidth at 10 GHz; one scatterer at the origin.
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
//! [`open_channels`] opens all channels of a recording. Formers take one channel or the coherent sum of all
//! ([`phase_history::Channels`]). [`focus::live::Live`] takes pulses one at a time, as a radar sends them, and provides the
//! current image after each.
//!
//! The folder `examples` contains the program above and others: [read and focus][a], [custom phase history][b], [simulate and
//! measure][c], [one image in tiles][d] spread over several machines, [a live image][f], and [a custom former][e].
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
//!   `-2 pi f (path_n(p) - reference_path_n) / c`, which is CPHD's `SGN = -1`. Readers convert every file to this convention.
//!   The reference path of raw echoes is 0. If a file does not state its sign or reference, the reader infers them from the
//!   samples or refuses the file ([`convention`]).
//! - **Path** is the two-way length from transmitter to point to receiver, in metres. For a monostatic antenna it is twice the range.
//! - **Frame.** Positions are float64 metres in the scene frame ([`geometry::SceneFrame`]): x and y in the ground plane, z up.
//!   A recording may georeference this frame.
//! - **Images** are complex float32, with rows in ascending y and columns in ascending x. A unit scatterer centred on a pixel
//!   and seen equally by all pulses has the value 1, whatever the windows.
//! - **Units** are suffixes of names (`_m`, `_s`, `_hz`, `_rad`, `_db`); SI otherwise. Levels in dB are `20 log10` of magnitudes.
//! - **Error** is the relative RMS error against the exact sum ([`focus::exact`]) over the grid's pixels, phase included.
//!
//! # Modules and features
//! `default` enables `cphd`, `gotcha`, `npz`, `recording`, `simulate`, `quality` and `plot`. `full` enables every feature except
//! `uhd`, which links a GPL library, `viewer`, which needs a web server, and `gpu`, which needs a driver.
//!
//! | module | contents | feature | added dependencies |
//! |---|---|---|---|
//! | [`phase_history`], [`geometry`], [`image`], [`radar`], [`track`], [`monitor`], [`units`], [`quantity`] | shared data types | | |
//! | [`focus`] | image formers, their plans and error bounds | | `rayon`, `rustfft` |
//! | [`resolution`] | resolution, sampling and default grid of a collection | | |
//! | [`signal`] | windows, transforms, interpolation kernels | | |
//! | [`io`] | file readers and writers | | `fs4`, `serde_json` |
//! | `io::cphd`, `io::crsd` | CPHD 1.x; CRSD 1.0 (read only) | `cphd` | `roxmltree` |
//! | `io::l0b` | NISAR L0B (read only) | `cphd` with `hdf5` | `hdf5-pure` |
//! | `io::gotcha` | AFRL's GOTCHA files (MATLAB 5) | `gotcha` | `flate2` |
//! | `io::gotcha_gmti` | AFRL's Gotcha GMTI challenge (read only) | `cphd` with `gotcha` | |
//! | [`io::npy`], `io::arrays` | NumPy arrays and archives; phase history stored in them | `npz` | `zip` |
//! | `io::arrays` | phase history stored in HDF5 | `hdf5` | `hdf5-pure` |
//! | `io::recording`, `describe`, `receive` | raw recordings described in TOML; range compression to phase history | `recording` | `toml` |
//! | `job` | processing pipelines from one TOML file; unchanged stages are reused | `recording` | |
//! | `simulate` | simulator of scenes, tracks, receivers and recordings | `simulate` | `rand_chacha`, `rand_distr`, `png` |
//! | `quality` | image quality: impulse responses, statistics, coherence | `quality` | |
//! | `plot` | pictures of images and curves | `plot` | `png`, `ab_glyph`, `dejavu` |
//! | `planner` | performance prediction, signal chains and collection planning | `planner` | `toml` |
//! | `autofocus` | calibration of parameters, phases and tracks by image sharpness | `autofocus` | |
//! | `corrections` | recordings corrected for troposphere, phase errors and the motion of a target | `autofocus` | |
//! | `motion`, `targets` | ego-motion estimation from echo phases; detected targets | `motion` | `subaperture-core` |
//! | `navigation` | navigation logs; their fusion with the estimated track | `navigation` | |
//! | `track_fusion` | fusion of a recording's echoes and its navigation into one track | `motion` and `navigation` | |
//! | `maps` | map products: cloud-optimised GeoTIFF, KMZ, PNG with world files | `maps` | `png`, `flate2`, `zip` |
//! | `sicd` | SICD complex images, read and written | `sicd` | `roxmltree` |
//! | `images` | images of any supported format; pairs resampled onto common pixels | `maps`, `sicd` and `terrain` | |
//! | `terrain` | elevation models (SRTM HGT, GeoTIFF) with heights above the ellipsoid | `terrain` | `tiff` |
//! | `module` | embedded module: plan, serial link, maps | `link` | `subaperture-core`, `serial2` |
//! | `radio` | stepped-frequency radar on a software-defined radio, real or simulated: capture, range profiles | `radio` | |
//! | `gmti` | moving targets of several channels: clutter cancellation, detection, velocity, position | `gmti` | |
//! | `interferometry` | coherent pairs of images: interferogram, coherence and its statistics, coherent change detection (CCD); displacement of persistent points over repeat passes | `interferometry`, which enables `quality` | |
//! | `live_capture` | image of a running capture, updated with each sweep, on a given or estimated track | `radio`, which enables `motion` | |
//! | `viewer` | local web viewer for large images and running captures | `viewer` | `axum`, `tokio` |
//! | `gpu` | backprojection on a GPU by Vulkan or Metal | `gpu` | `wgpu` |
//! | `radio::uhd` | USRP devices by UHD (GPL-3.0-or-later) | `uhd` | the UHD library, linked |
//!
//! [`glam`] (positions) and [`num_complex`] (samples) are re-exported under their own names.
#![forbid(unsafe_code)]

pub mod convention;
#[cfg(feature = "autofocus")]
pub mod corrections;
mod focused;
mod focusing;
#[cfg(all(feature = "maps", feature = "sicd", feature = "terrain"))]
pub mod images;
#[cfg(feature = "recording")]
pub mod job;
#[cfg(feature = "radio")]
pub mod live_capture;
#[cfg(all(feature = "maps", feature = "sicd"))]
pub mod on_map;
pub mod prelude;
mod reading;
#[cfg(feature = "recording")]
mod recognise;
mod save;
#[cfg(all(feature = "motion", feature = "navigation"))]
pub mod track_fusion;

pub use subaperture_model::{
    SPEED_OF_LIGHT_M_S, antenna, geometry, image, monitor, phase_history, quantity, radar,
    resolution, track, units,
};
pub use {subaperture_focus as focus, subaperture_io as io, subaperture_signal as signal};

#[cfg(feature = "autofocus")]
pub use subaperture_autofocus as autofocus;
#[cfg(feature = "recording")]
pub use subaperture_describe as describe;
#[cfg(feature = "gmti")]
pub use subaperture_gmti as gmti;
#[cfg(feature = "gpu")]
pub use subaperture_gpu as gpu;
#[cfg(feature = "interferometry")]
pub use subaperture_interferometry as interferometry;
#[cfg(feature = "recording")]
pub use subaperture_io::receive;
#[cfg(feature = "maps")]
pub use subaperture_maps as maps;
#[cfg(feature = "link")]
pub use subaperture_module as module;
#[cfg(feature = "motion")]
pub use subaperture_motion as motion;
#[cfg(feature = "motion")]
pub use subaperture_motion::targets;
#[cfg(feature = "navigation")]
pub use subaperture_navigation as navigation;
#[cfg(feature = "planner")]
pub use subaperture_planner as planner;
#[cfg(feature = "plot")]
pub use subaperture_plot as plot;
#[cfg(feature = "quality")]
pub use subaperture_quality as quality;
#[cfg(feature = "radio")]
pub use subaperture_radio as radio;
#[cfg(feature = "sicd")]
pub use subaperture_sicd as sicd;
#[cfg(feature = "simulate")]
pub use subaperture_simulate as simulate;

#[cfg(feature = "terrain")]
pub use subaperture_maps::terrain;
#[cfg(feature = "viewer")]
pub use subaperture_viewer as viewer;

pub use {glam, num_complex};

pub use focused::FocusedImage;
pub use focusing::{Focus, Focusing};
pub use reading::{open, open_all, open_channels};
#[cfg(feature = "recording")]
pub use recognise::{FileKind, capture_of, recognise};
pub use save::SaveError;
pub use subaperture_model::resolution::survey::scene_grid;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
