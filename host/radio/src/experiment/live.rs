//! Live imaging during a capture (`[live]`): image grid, and motion of the antennas.

use std::path::{Path, PathBuf};

use glam::DVec3;
use subaperture_describe::error::Fault;
use subaperture_describe::schema::{Bounds, Key, Presence, Requirement, Section, ValueType};
use subaperture_describe::values::Values;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::track::Linear;
use subaperture_model::units::Dimension;

use crate::antennas::Reference;
use crate::history::{HistoryError, Track};

/// Live image, and motion of the antennas.
#[derive(Clone, Debug, PartialEq)]
pub struct Live {
    /// Grid of the live image.
    pub grid: ImageGrid,
    /// Motion of the body that carries the antennas.
    pub motion: BodyMotion,
    /// Motion compensation reference point, metres; `None` for the middle of the grid.
    pub reference_m: Option<DVec3>,
    /// Number of latest sweeps in the image; `None` for all.
    pub last: Option<usize>,
}

/// Motion of the body that carries the antennas.
#[derive(Clone, Debug, PartialEq)]
pub enum BodyMotion {
    /// Track file, and the device time of the track's time 0, seconds.
    File(PathBuf, f64),
    /// Constant velocity, as on a rail.
    Rail {
        /// Position at `at_s`, metres in the scene frame.
        position_m: DVec3,
        /// Velocity, metres per second.
        velocity_m_s: DVec3,
        /// Device time of the position, seconds.
        at_s: f64,
    },
    /// Estimated from the echoes, starting at a given position; the body axes are initially those of the scene.
    Echoes {
        /// Start position, metres in the scene frame.
        start_m: DVec3,
    },
}

impl BodyMotion {
    /// Make the track.
    ///
    /// # Errors
    /// If the track file cannot be read or is invalid; if the track is to be estimated from the echoes.
    pub fn track(&self) -> Result<Track, HistoryError> {
        match self {
            Self::File(path, zero_s) => Track::read(path, *zero_s),
            Self::Rail {
                position_m,
                velocity_m_s,
                at_s,
            } => Ok(Track {
                poses: Box::new(Linear {
                    position_m: *position_m,
                    velocity_m_s: *velocity_m_s,
                    at_s: 0.0,
                }),
                span_s: (f64::NEG_INFINITY, f64::INFINITY),
                zero_s: *at_s,
            }),
            Self::Echoes { .. } => Err(HistoryError::Track(
                "the track is estimated from the echoes: it is not known before the capture"
                    .to_owned(),
            )),
        }
    }
}

pub(super) static LIVE: Section = Section {
    path: "live",
    presence: Presence::Optional,
    when: &[],
    selector: "",
    doc: "Live imaging during a capture: image grid, and motion of the antennas from a file, on a rail, or estimated from the echoes.",
    keys: &[
        Key::new(
            "grid",
            ValueType::Text,
            Requirement::Required("\"x=-3:3:0.05,y=2:8:0.05\""),
            "Image grid in metres of the scene frame: x and y, each as start:stop:step.",
        ),
        Key::new(
            "track",
            ValueType::Path,
            Requirement::Optional("\"track.csv\""),
            "Track file (CSV): time, position, attitude of the body. Alternative: position and velocity.",
        ),
        Key::new(
            "position",
            ValueType::Vector(Dimension::Length),
            Requirement::Optional("\"-2.5, 0, 1 m\""),
            "Position of the body at the time zero. With echoes: start position, default the origin.",
        ),
        Key::new(
            "velocity",
            ValueType::Vector(Dimension::Speed),
            Requirement::Optional("\"0.1, 0, 0 m/s\""),
            "Velocity of the body. The body's x axis, to which the antenna positions refer, points along it.",
        ),
        Key::new(
            "echoes",
            ValueType::Flag,
            Requirement::Default("false"),
            "Estimate the track from the echoes of two receivers (MPGA), with the leakage as the reference; x is initially forward. At least two reflectors must be \
             visible, with at least one sweep per quarter wavelength of travel.",
        ),
        Key::new(
            "zero",
            ValueType::Quantity(Dimension::Time, Bounds::Any),
            Requirement::Default("\"0 s\""),
            "Device time of the track's time 0, or at which the body is at its position.",
        ),
        Key::new(
            "reference",
            ValueType::Vector(Dimension::Length),
            Requirement::Optional("\"0, 5, 0 m\""),
            "Motion compensation reference point; default: the middle of the grid.",
        ),
        Key::new(
            "last",
            ValueType::Count(1, 1 << 20),
            Requirement::Optional("200"),
            "Number of latest sweeps in the image; default: all.",
        ),
    ],
};

pub(super) fn build(
    values: &Values,
    folder: &Path,
    reference: Reference,
) -> Result<Live, Vec<Fault>> {
    let grid: ImageGrid = values
        .text("grid")
        .parse()
        .map_err(|error| vec![values.fault("grid", format!("{error}"))])?;
    if grid.polar {
        let what = "expected a Cartesian grid: give x and y, in metres";
        return Err(vec![values.fault("grid", what)]);
    }
    let zero_s = values.number("zero");
    let file = values.optional_text("track");
    let position_m = values.optional_vector("position");
    let velocity_m_s = values.optional_vector("velocity");
    let echoes = values.flag("echoes");
    if echoes && reference != Reference::Leakage {
        let what = "estimating the track from echoes needs two receivers: set plan.reference is \"leakage\" and their positions in [antennas]";
        return Err(vec![values.fault("echoes", what)]);
    }
    let motion = match (file, position_m, velocity_m_s) {
        (None, start_m, None) if echoes => BodyMotion::Echoes {
            start_m: start_m.unwrap_or_default(),
        },
        (Some(file), None, None) if !echoes => BodyMotion::File(folder.join(file), zero_s),
        (None, Some(position_m), Some(velocity_m_s)) if !echoes => BodyMotion::Rail {
            position_m,
            velocity_m_s,
            at_s: zero_s,
        },
        _ => {
            let what =
                "expected one kind of motion: a track, or position and velocity, or echoes = true";
            return Err(vec![values.fault("track", what)]);
        }
    };
    Ok(Live {
        grid,
        motion,
        reference_m: values.optional_vector("reference"),
        last: values.optional_count("last").map(|count| count as usize),
    })
}
