//! How a picture looks: levels and colours.

use std::path::PathBuf;

use clap::{Args as Group, ValueEnum, ValueHint};
use subaperture::plot::{Colours, Scale};
use subaperture::units::Dimension;

use super::RemapName;
use super::values::{above_zero, any, output};

/// Levels and colours of a picture.
#[derive(Clone, Copy, Debug, Group)]
#[command(next_help_heading = "Picture")]
pub(crate) struct Look {
    /// Level of the brightest colour, dB; what lies above it has a colour of its own [default: the peak]
    #[arg(long, value_name = "DB", allow_negative_numbers = true, value_parser = any(Dimension::Level))]
    pub(crate) top: Option<f64>,

    /// Levels from the brightest to the darkest colour, dB [default: down to 6 dB below the median, 40 to
    /// 60 in all]
    #[arg(long, value_name = "DB", value_parser = above_zero(Dimension::Level))]
    pub(crate) span: Option<f64>,

    /// How levels become greys
    #[arg(long, value_enum, default_value_t, conflicts_with_all = ["top", "span"])]
    pub(crate) remap: RemapName,

    /// Colours
    #[arg(long, value_enum, default_value_t)]
    pub(crate) colours: ColourMap,
}

/// Colour maps by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum ColourMap {
    /// Black to white
    #[default]
    Grey,
    /// Dark blue over green to yellow, even to the eye
    Viridis,
}

impl Look {
    /// The scale asked for.
    pub(crate) fn scale(&self) -> Scale {
        match self.remap {
            RemapName::Density => Scale::Density,
            RemapName::Db => Scale::FromData {
                top_db: self.top,
                span_db: self.span,
            },
        }
    }

    /// The colours asked for.
    pub(crate) fn colours(&self) -> Colours {
        match self.colours {
            ColourMap::Grey => Colours::Grey,
            ColourMap::Viridis => Colours::Viridis,
        }
    }
}

/// `subap picture`.
#[derive(Debug, Group)]
pub(crate) struct Picture {
    /// Folder of a product (image.json and image.npy), its image.json, or anyone's SICD
    #[arg(value_name = "IMAGE", value_hint = ValueHint::DirPath)]
    pub(crate) image: PathBuf,

    /// PNG file to write
    #[arg(long, short, value_name = "PNG", value_hint = ValueHint::FilePath, value_parser = output())]
    pub(crate) out: PathBuf,

    #[command(flatten)]
    pub(crate) look: Look,

    #[command(flatten)]
    pub(crate) writing: super::Writing,
}
