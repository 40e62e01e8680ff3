//! Levels and colours of a picture.

use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args as Group, ValueEnum, ValueHint};
use serde::{Deserialize, Deserializer};
use serde_json::Value;
use subaperture::plot::{Colours, MAX_HUES, Scale, Upper};
use subaperture::units::Dimension;

use super::RemapName;
use super::values::{above_zero, any, output};

/// Levels and colours of a picture.
#[derive(Clone, Copy, Debug, Default, Group, Deserialize)]
#[serde(default)]
#[command(next_help_heading = "Picture")]
pub(crate) struct Look {
    /// Upper level, dB; pixels above it have a separate colour. As an option also `peak` [default: the level that 0.1 % of the pixels exceed, at most
    /// 12 dB below the peak]
    #[arg(long, value_name = "DB", allow_hyphen_values = true, value_parser = upper)]
    #[serde(deserialize_with = "upper_of_job")]
    pub(crate) top: Option<Upper>,

    /// Dynamic range, dB [default: down to 6 dB below the median, 40 to 60 dB]
    #[arg(long, value_name = "DB", value_parser = above_zero(Dimension::Level))]
    pub(crate) span: Option<f64>,

    /// Mapping of levels to greys
    #[arg(long, value_enum, default_value_t, conflicts_with_all = ["top", "span"])]
    pub(crate) remap: RemapName,

    /// Colour map
    #[arg(long, value_enum, default_value_t)]
    pub(crate) colours: ColourMap,
}

/// Upper level: `peak`, or a level.
fn upper(text: &str) -> Result<Upper, String> {
    if text == "peak" {
        return Ok(Upper::Peak);
    }
    any(Dimension::Level)(text).map(Upper::Db)
}

fn upper_of_job<'de, D: Deserializer<'de>>(from: D) -> Result<Option<Upper>, D::Error> {
    Ok(Some(Upper::Db(f64::deserialize(from)?)))
}

/// Colour maps by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum ColourMap {
    /// Black to white
    #[default]
    Grey,
    /// Dark blue over green to yellow, even to the eye
    Viridis,
}

impl Look {
    /// The upper level as recorded: dB, `peak`, or null for the automatic level.
    pub(crate) fn recorded_top(&self) -> Value {
        match self.top {
            None | Some(Upper::Automatic) => Value::Null,
            Some(Upper::Peak) => "peak".into(),
            Some(Upper::Db(top_db)) => top_db.into(),
        }
    }

    /// Scale of the levels.
    pub(crate) fn scale(&self) -> Scale {
        match self.remap {
            RemapName::Density => Scale::Density,
            RemapName::Db => Scale::FromData {
                top: self.top.unwrap_or_default(),
                span_db: self.span,
            },
        }
    }

    /// Colours of the plot.
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
    /// Image: folder of a product, complex64 array (.npy) or SICD. Two or three images of one grid become the colours of one picture, each with its
    /// own levels: magenta and green, or red, green and blue (HH, HV, VV). Four images are HH, HV, VH and VV, shown in the Pauli basis
    #[arg(value_name = "IMAGE", required = true, num_args = 1..=4, value_hint = ValueHint::AnyPath)]
    pub(crate) images: Vec<PathBuf>,

    /// PNG file to write
    #[arg(long, short, value_name = "PNG", value_hint = ValueHint::FilePath, value_parser = output())]
    pub(crate) out: PathBuf,

    /// Multilook: mean power of this many rows by columns of pixels, such as 3x3 or 4; reduces speckle and resolution [default: 1x1]
    #[arg(long, value_name = "ROWSxCOLUMNS")]
    pub(crate) looks: Option<Looks>,

    /// Colour composite of N sub-apertures, 2 to 12, from the spectrum of the image: brightness from the image, hue from each sub-aperture's share
    /// of power, red first
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(2..=MAX_HUES as i64), conflicts_with = "colours")]
    pub(crate) sub_apertures: Option<u8>,

    #[command(flatten)]
    pub(crate) look: Look,

    #[command(flatten)]
    pub(crate) writing: super::Writing,
}

/// Multilook: rows and columns of pixels that are averaged.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Looks(pub(crate) [usize; 2]);

impl FromStr for Looks {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (rows, columns) = text.split_once(['x', 'X']).unwrap_or((text, text));
        let count = |text: &str| text.trim().parse().ok().filter(|count| *count >= 1);
        let looks = count(rows).zip(count(columns));
        let (rows, columns) = looks.ok_or_else(|| {
            "give whole numbers of pixels, rows by columns, as 3x3, or one for both".to_owned()
        })?;
        Ok(Self([rows, columns]))
    }
}
