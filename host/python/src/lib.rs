//! Native module of the Python package `subaperture`: conversions of arguments and results, and calls of the library without the
//! interpreter lock.
//!
//! ```text
//! python/subaperture/*.py   public functions: defaults, docstrings, warnings, xarray, plots, Dask
//!         │ arguments
//!         v
//! _native: convert ── work::run (thread of its own, progress, Ctrl-C) ── library
//!         ^                                                            │
//!         └── errors: exceptions of subaperture.errors <───────────────┘
//! ```
//!
//! Functions are documented in the Python files, classes here. Arrays are passed without a copy from the library to
//! NumPy; arrays from NumPy are copied once.

#![deny(unsafe_code)]

use std::ffi::OsString;

use pyo3::prelude::*;

mod convert;
mod errors;
mod estimate;
mod focus;
mod grid;
mod image;
mod recording;
mod remote;
mod simulate;
mod work;

/// Run the command `subap` with the arguments of a process, the name of the program first. Returns the exit status.
#[pyfunction]
fn command(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| subap::run(arguments))
}

/// Native module `subaperture._native` of the Python package.
#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    remote::install();
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<estimate::Autofocus>()?;
    module.add_class::<estimate::Track>()?;
    module.add_class::<focus::Plan>()?;
    module.add_class::<grid::Grid>()?;
    module.add_class::<image::Image>()?;
    module.add_class::<recording::ChannelList>()?;
    module.add_class::<recording::Recording>()?;
    module.add_class::<simulate::Scene>()?;
    module.add_function(wrap_pyfunction!(command, module)?)?;
    module.add_function(wrap_pyfunction!(estimate::autofocus, module)?)?;
    module.add_function(wrap_pyfunction!(estimate::gmti, module)?)?;
    module.add_function(wrap_pyfunction!(estimate::track, module)?)?;
    module.add_function(wrap_pyfunction!(focus::focus, module)?)?;
    module.add_function(wrap_pyfunction!(focus::formers_table, module)?)?;
    module.add_function(wrap_pyfunction!(focus::plan, module)?)?;
    module.add_function(wrap_pyfunction!(image::compare_images, module)?)?;
    module.add_function(wrap_pyfunction!(image::read_image, module)?)?;
    module.add_function(wrap_pyfunction!(recording::open_channels, module)?)?;
    module.add_function(wrap_pyfunction!(recording::open_recording, module)?)?;
    module.add_function(wrap_pyfunction!(recording::phase_history, module)?)?;
    module.add_function(wrap_pyfunction!(simulate::scene, module)?)?;
    module.add_function(wrap_pyfunction!(simulate::simulate, module)?)?;
    Ok(())
}
