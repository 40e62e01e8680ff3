//! The standard's enumerations, by its names.

use std::fmt;

/// The axis of the samples of a vector.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Domain {
    /// Transmitted frequency.
    Fx,
    /// Time of arrival after that of the SRP.
    Toa,
}

impl fmt::Display for Domain {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Fx => "FX",
            Self::Toa => "TOA",
        })
    }
}

/// The standard's SGN: the sign of phase with delay.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sgn {
    /// -1: phase falls with delay, as everywhere in this crate.
    Minus,
    /// +1: phase rises with delay; conjugated when read.
    Plus,
}

impl fmt::Display for Sgn {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Minus => "-1",
            Self::Plus => "+1",
        })
    }
}

/// Polarisation of an antenna, by the standard's names.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Polarization {
    /// Along the antenna's x axis.
    X,
    /// Along the antenna's y axis.
    Y,
    /// Vertical.
    V,
    /// Horizontal.
    H,
    /// Sequence of several polarisations.
    S,
    /// Elliptical.
    E,
    /// Right-hand circular.
    Rhc,
    /// Left-hand circular.
    Lhc,
    /// Unknown.
    #[default]
    Unspecified,
}

impl fmt::Display for Polarization {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::X => "X",
            Self::Y => "Y",
            Self::V => "V",
            Self::H => "H",
            Self::S => "S",
            Self::E => "E",
            Self::Rhc => "RHC",
            Self::Lhc => "LHC",
            Self::Unspecified => "UNSPECIFIED",
        })
    }
}
