//! `subap recording` and `subap tune`.

use std::path::PathBuf;

use clap::{Args as Group, ValueHint};
use glam::DVec3;
use subaperture::autofocus::Measure;
use subaperture::geometry::{Axis, ImageGrid};
use subaperture::io::recording;
use subaperture::units::Dimension;

/// `subap recording`.
#[derive(Debug, Group)]
#[command(after_help = "First steps:\n  \
    subap recording --example arcsar-8 > rec.toml\n  \
    subap info rec.toml\n  \
    subap focus rec.toml --grid r=1.5:8:0.02,theta=30:150:0.2 --out image")]
#[group(required = true, multiple = false)]
pub(crate) struct Recording {
    /// Print every key of a description with its unit, default and meaning
    #[arg(long)]
    pub(crate) keys: bool,

    /// Print the format of phase history in arrays (NumPy .npz, HDF5)
    #[arg(long)]
    pub(crate) arrays: bool,

    /// Print the description of a public recording as an example
    #[arg(long, value_name = "NAME",
        value_parser = clap::builder::PossibleValuesParser::new(recording::examples::names()))]
    pub(crate) example: Option<String>,
}

/// `subap tune`.
#[derive(Debug, Group)]
#[command(
    after_help = "The length of an arm, by the sharpness of the image:\n  \
    subap tune rec.toml --vary platform.radius=0.18:0.25:0.005m --grid x=-3:3:0.05,y=2:8:0.05"
)]
pub(crate) struct Tune {
    /// Description of a raw recording (see subap recording)
    #[arg(value_name = "RECORDING", value_hint = ValueHint::FilePath)]
    pub(crate) recording: PathBuf,

    /// Key, or component of a vector such as platform.velocity[0], and its range of values, stop included. Give it one to three times
    #[arg(long, required = true, value_name = "KEY=START:STOP:STEP[UNIT]",
        allow_hyphen_values = true, value_parser = vary)]
    pub(crate) vary: Vec<Vary>,

    /// Override a key, such as radar.start="77.1 GHz". May be repeated
    #[arg(long, value_name = "KEY=VALUE", value_parser = super::setting)]
    pub(crate) set: Vec<(String, String)>,

    /// Pixels whose sharpness is maximised, as for focus; choose a part of the scene with point-like echoes
    #[arg(
        long,
        value_name = "GRID",
        allow_hyphen_values = true,
        required_unless_present = "at"
    )]
    pub(crate) grid: Option<ImageGrid>,

    /// Surveyed position of a reflector whose power is maximised, metres, in place of a grid. May be repeated
    #[arg(long, value_name = "X,Y[,Z]", allow_hyphen_values = true, value_parser = super::vector(Dimension::Length),
        conflicts_with_all = ["grid", "measure"])]
    pub(crate) at: Vec<DVec3>,

    /// Sharpness measure: entropy (many points), contrast, sharpness (few points) or peak
    #[arg(long, value_name = "MEASURE", default_value_t)]
    pub(crate) measure: Measure,

    /// Vary one key after another instead of all combinations: faster, valid for keys with independent effects
    #[arg(long)]
    pub(crate) in_turn: bool,

    /// Number of times that the step is halved around the best value
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u8).range(0..=20))]
    pub(crate) refine: u8,

    #[command(flatten)]
    pub(crate) windows: super::Windows,

    /// Write the values into the description; the rest of its text is unchanged
    #[arg(long)]
    pub(crate) write: bool,

    /// Write the description with the values to this new file in the same folder
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, conflicts_with = "write")]
    pub(crate) write_to: Option<PathBuf>,

    /// Folder for tune.json and pictures: the measure over each key, and the image before and after
    #[arg(long, short, value_name = "DIR", value_hint = ValueHint::DirPath, value_parser = super::output())]
    pub(crate) out: Option<PathBuf>,

    #[command(flatten)]
    pub(crate) writing: super::Writing,

    #[command(flatten)]
    pub(crate) rehearsal: super::Rehearsal,
}

/// A key and its values.
#[derive(Clone, Debug)]
pub(crate) struct Vary {
    pub(crate) key: String,
    pub(crate) axis: Axis,
    /// Unit as given; empty for a plain number.
    pub(crate) unit: String,
}

impl Vary {
    /// Value as in a description.
    pub(crate) fn text(&self, value: f64) -> String {
        format!("{value} {}", self.unit).trim_end().to_owned()
    }
}

/// Largest number of values of one key.
const MOST: f64 = 1e6;

/// `platform.radius=0.18:0.25:0.005m`.
fn vary(text: &str) -> Result<Vary, String> {
    let wanted =
        "give KEY=START:STOP:STEP and a unit, for example platform.radius=0.18:0.25:0.005m";
    let (key, values) = text.split_once('=').ok_or(wanted)?;
    let parts: Vec<&str> = values.split(':').map(str::trim).collect();
    let [start, stop, step] = parts[..] else {
        return Err(wanted.to_owned());
    };
    // The longest prefix that is a number; the rest is the unit.
    let end = (1..=step.len())
        .rev()
        .filter(|&end| step.is_char_boundary(end))
        .find(|&end| step[..end].parse::<f64>().is_ok_and(f64::is_finite))
        .ok_or(wanted)?;
    let (step, unit) = step.split_at(end);
    let (start, stop, step) = (
        super::finite(start)?,
        super::finite(stop)?,
        super::finite(step)?,
    );
    let steps = (stop - start) / step;
    if !(step > 0.0 && (0.0..MOST).contains(&steps)) {
        return Err("give START below STOP and a positive STEP".to_owned());
    }
    Ok(Vary {
        key: key.trim().to_owned(),
        axis: Axis {
            start,
            step,
            count: (steps + 1e-9).floor() as usize + 1,
        },
        unit: unit.trim().to_owned(),
    })
}

#[cfg(test)]
mod tests {
    use super::vary;

    #[test]
    fn values_to_try_have_units_and_both_ends() {
        let radius = vary("platform.radius=0.18:0.25:5e-3 m").unwrap();
        assert_eq!(
            (radius.key.as_str(), radius.axis.count),
            ("platform.radius", 15)
        );
        assert_eq!(radius.text(0.2), "0.2 m");
        let offset = vary("radar.first_pulse=-5:15:0.5s").unwrap();
        assert_eq!(
            (offset.axis.start, offset.axis.count, offset.unit.as_str()),
            (-5.0, 41, "s")
        );
        assert_eq!(vary("a=1:1:1").unwrap().axis.count, 1);
        for bad in [
            "a",
            "a=1:2",
            "a=1:2:0",
            "a=2:1:1",
            "a=1:2:x",
            "a=x:2:1m",
            "a=0:1e9:1",
        ] {
            assert!(vary(bad).is_err(), "{bad}");
        }
    }
}
