//! Errors as exceptions of `subaperture.errors`.

use std::ffi::CString;
use std::fmt::Display;

use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use subaperture::autofocus::SharpenError;
use subaperture::corrections::CorrectionsError;
use subaperture::describe::DescriptionError;
use subaperture::focus::formers::{OptionError, UnknownFormer};
use subaperture::focus::plan::PlanError;
use subaperture::focus::{FormError, Remedy};
use subaperture::geometry::GridError;
use subaperture::gmti::GmtiError;
use subaperture::images::{CompareError, OpenError};
use subaperture::io::atomic::WriteError;
use subaperture::io::track_csv::TrackCsvError;
use subaperture::phase_history::{ChannelError, ReadError};
use subaperture::plot::PlotError;
use subaperture::quality::response::ResponseError;
use subaperture::resolution::survey::NoDefaultGrid;
use subaperture::targets::TargetsError;
use subaperture::terrain::{PlacementError, TerrainError};

/// Exception class of `subaperture.errors`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Class {
    Argument,
    Read,
    Write,
    Memory,
    Unsuited,
    Bound,
    Measurement,
}

impl Class {
    fn name(self) -> &'static str {
        match self {
            Self::Argument => "ArgumentError",
            Self::Read => "ReadError",
            Self::Write => "WriteError",
            Self::Memory => "MemoryLimitError",
            Self::Unsuited => "UnsuitedError",
            Self::Bound => "BoundError",
            Self::Measurement => "MeasurementError",
        }
    }
}

/// Error of a function, raised as an exception when it returns.
#[derive(Debug)]
pub(crate) enum Error {
    /// Exception raised by Python, such as by a progress callback.
    Raised(PyErr),
    /// Error of the library.
    Library(Class, String),
    /// Cancelled without an exception.
    Cancelled,
}

impl Error {
    pub(crate) fn argument(message: impl Display) -> Self {
        Self::Library(Class::Argument, message.to_string())
    }

    pub(crate) fn new(class: Class, message: impl Display) -> Self {
        Self::Library(class, message.to_string())
    }
}

impl From<PyErr> for Error {
    fn from(error: PyErr) -> Self {
        Self::Raised(error)
    }
}

impl From<Error> for PyErr {
    fn from(error: Error) -> Self {
        match error {
            Error::Raised(error) => error,
            Error::Cancelled => PyKeyboardInterrupt::new_err("interrupted"),
            Error::Library(class, message) => Python::attach(|py| {
                let made = py
                    .import("subaperture.errors")
                    .and_then(|module| module.getattr(class.name()))
                    .and_then(|class| class.call1((message,)));
                made.map_or_else(|error| error, PyErr::from_value)
            }),
        }
    }
}

/// Errors of one class.
macro_rules! classes {
    ($($error:ty => $class:ident),* $(,)?) => {
        $(impl From<$error> for Error {
            fn from(error: $error) -> Self {
                Self::new(Class::$class, error)
            }
        })*
    };
}

classes! {
    ChannelError => Argument,
    CompareError => Argument,
    DescriptionError => Argument,
    GridError => Argument,
    NoDefaultGrid => Argument,
    OpenError => Read,
    OptionError => Argument,
    PlotError => Measurement,
    ResponseError => Measurement,
    TrackCsvError => Read,
    UnknownFormer => Argument,
    WriteError => Write,
}

/// Warn of Python's caller, two frames up.
pub(crate) fn warn(py: Python<'_>, message: &str) -> PyResult<()> {
    let errors = py.import("subaperture.errors")?;
    let category = errors.getattr("SubapertureWarning")?;
    PyErr::warn(py, &category, &CString::new(message)?, 2)
}

impl From<ReadError> for Error {
    fn from(error: ReadError) -> Self {
        match error {
            ReadError::Memory { .. } => Self::new(Class::Memory, format!("{error}: raise memory")),
            ReadError::Channels(_) | ReadError::Mismatch(_) => Self::argument(error),
            error => Self::new(Class::Read, error),
        }
    }
}

impl From<FormError> for Error {
    fn from(error: FormError) -> Self {
        let class = match error {
            FormError::Cancelled => return Self::Cancelled,
            FormError::Read(error) => return error.into(),
            FormError::Memory { .. } => Class::Memory,
            FormError::BoundMissed { .. } => Class::Bound,
            _ => Class::Unsuited,
        };
        let advice = advice(&error);
        Self::new(class, format!("{error}{advice}"))
    }
}

/// Advice on an error as a continuation of its text: remedies in terms of the arguments of `subaperture.focus`.
fn advice(error: &FormError) -> String {
    let mut steps: Vec<String> = error.remedies().iter().map(step).collect();
    if let FormError::BoundMissed { .. } = error {
        steps.push("allow the error with allow_error=True".to_owned());
    }
    match steps.is_empty() {
        true => String::new(),
        false => format!("; {}", steps.join(", or ")),
    }
}

fn step(remedy: &Remedy) -> String {
    match remedy {
        Remedy::MoreMemory => "raise memory".to_owned(),
        Remedy::OtherFormer(names) => format!("use former={}", quoted(names)),
        Remedy::Word { option, word } => format!("give {option}='{word}'"),
        Remedy::Smaller(options) => format!("reduce {}", options.join(" or ")),
        Remedy::Larger(option) => format!("increase {option}"),
        Remedy::LeftOut(options) => format!("leave out {}", options.join(" and ")),
        Remedy::SomeGrid => "give grid".to_owned(),
        Remedy::SmallerGrid => "reduce the extent of grid".to_owned(),
        Remedy::FewerPixels => "use a smaller or coarser grid".to_owned(),
        Remedy::FartherGrid => "use a grid farther away, or a narrower one".to_owned(),
        Remedy::GridWithout => "leave these points out of the grid".to_owned(),
        Remedy::GridWith => "include these points in the grid".to_owned(),
        Remedy::FinerGrid => "reduce the spacing of the grid".to_owned(),
        Remedy::PlanFor { error_db } => format!("give error_db={error_db:.0}"),
        other => format!("{other:?}"),
    }
}

fn quoted(names: &[&str]) -> String {
    let quoted: Vec<String> = names.iter().map(|name| format!("'{name}'")).collect();
    quoted.join(" or ")
}

impl From<CorrectionsError> for Error {
    fn from(error: CorrectionsError) -> Self {
        match error {
            CorrectionsError::Troposphere(error) => error.into(),
            CorrectionsError::Target(error) => error.into(),
            error => Self::argument(error),
        }
    }
}

impl From<PlacementError> for Error {
    fn from(error: PlacementError) -> Self {
        let class = match &error {
            PlacementError::Terrain(TerrainError::Cancelled) => return Self::Cancelled,
            PlacementError::Terrain(TerrainError::Memory { .. }) => Class::Memory,
            PlacementError::Terrain(TerrainError::Io { .. } | TerrainError::Format { .. }) => {
                Class::Read
            }
            PlacementError::Terrain(_) => Class::Unsuited,
            _ => Class::Argument,
        };
        Self::new(class, error)
    }
}

impl From<PlanError> for Error {
    fn from(error: PlanError) -> Self {
        match error {
            PlanError::Form(error) => error.into(),
            error => Self::argument(error),
        }
    }
}

impl From<SharpenError> for Error {
    fn from(error: SharpenError) -> Self {
        match error {
            SharpenError::Form(error) => error.into(),
            error => Self::new(Class::Unsuited, error),
        }
    }
}

impl From<GmtiError> for Error {
    fn from(error: GmtiError) -> Self {
        match error {
            GmtiError::Form(error) => error.into(),
            GmtiError::Read(error) => error.into(),
            error => Self::new(Class::Unsuited, error),
        }
    }
}

impl From<TargetsError> for Error {
    fn from(error: TargetsError) -> Self {
        match error {
            TargetsError::Read(error) => error.into(),
            error => Self::new(Class::Unsuited, error),
        }
    }
}
