//! `[live]`: what is imaged while an experiment is captured, and how its antennas move.

use std::path::{Path, PathBuf};

use glam::DVec3;
use subaperture_describe::error::Found;
use subaperture_describe::schema::{Bounds, Key, Kind, Need, Presence, Section};
use subaperture_describe::values::Values;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::track::Linear;
use subaperture_model::units::Dimension;

use crate::antennas::Reference;
use crate::history::{HistoryError, Track};

/// What is imaged, and from where.
#[derive(Clone, Debug, PartialEq)]
pub struct Live {
    /// Pixels.
    pub grid: ImageGrid,
    /// How the antennas' body moves.
    pub way: Way,
    /// What phases are referred to, metres; the grid's middle if `None`.
    pub reference_m: Option<DVec3>,
    /// The image is of the last so many sweeps; of all if `None`.
    pub last: Option<usize>,
}

/// How a body moves.
#[derive(Clone, Debug, PartialEq)]
pub enum Way {
    /// As a file says, whose time 0 is so many seconds of the device's.
    File(PathBuf, f64),
    /// At constant speed, as on a rail; it is at the position at so many seconds of the device's.
    Rail {
        /// Metres in the scene frame.
        position_m: DVec3,
        /// Metres a second.
        velocity_m_s: DVec3,
        /// Seconds.
        at_s: f64,
    },
    /// As its echoes tell, from this place on; its axes are the scene's then.
    Echoes {
        /// Metres in the scene frame.
        start_m: DVec3,
    },
}

impl Way {
    /// The track.
    ///
    /// # Errors
    /// If its file cannot be read, or is none; if it is to be found of the echoes.
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
                "nobody knows the way before its echoes are heard".to_owned(),
            )),
        }
    }
}

pub(super) static LIVE: Section = Section {
    path: "live",
    presence: Presence::Optional,
    when: &[],
    selector: "",
    doc: "What subap live images while it captures, and how the antennas move: by a file, on a rail, or as their echoes tell.",
    keys: &[
        Key::new(
            "grid",
            Kind::Text,
            Need::Required("\"x=-3:3:0.05,y=2:8:0.05\""),
            "Pixels, metres in the scene frame: x and y, each from, to and step.",
        ),
        Key::new(
            "track",
            Kind::Path,
            Need::Optional("\"track.csv\""),
            "The body's track, comma-separated: time, position, attitude. In its place position and velocity.",
        ),
        Key::new(
            "position",
            Kind::Vector(Dimension::Length),
            Need::Optional("\"-2.5, 0, 1 m\""),
            "Where the body is at the time zero; with echoes at first, without it at the origin.",
        ),
        Key::new(
            "velocity",
            Kind::Vector(Dimension::Speed),
            Need::Optional("\"0.1, 0, 0 m/s\""),
            "Its velocity; it looks to where it goes, antennas are placed so.",
        ),
        Key::new(
            "echoes",
            Kind::Flag,
            Need::Default("false"),
            "Whether nobody knows the way and it is found of the echoes of two receivers (MPGA), the leakage as the reference: x is forward at first. Two reflectors and more have to \
             be seen, and a sweep taken at least every quarter of a wavelength.",
        ),
        Key::new(
            "zero",
            Kind::Quantity(Dimension::Time, Bounds::Any),
            Need::Default("\"0 s\""),
            "The radio's time at the track's time 0, or at which the body is at its position.",
        ),
        Key::new(
            "reference",
            Kind::Vector(Dimension::Length),
            Need::Optional("\"0, 5, 0 m\""),
            "What phases are referred to; the grid's middle without.",
        ),
        Key::new(
            "last",
            Kind::Count(1, 1 << 20),
            Need::Optional("200"),
            "The image is of the last so many sweeps; of all without.",
        ),
    ],
};

pub(super) fn build(
    values: &Values,
    folder: &Path,
    reference: Reference,
) -> Result<Live, Vec<Found>> {
    let grid: ImageGrid = values
        .text("grid")
        .parse()
        .map_err(|error| vec![values.fault("grid", format!("{error}"))])?;
    if grid.polar {
        let what = "a live image is Cartesian: give x and y, in metres";
        return Err(vec![values.fault("grid", what)]);
    }
    let zero_s = values.number("zero");
    let file = values.optional_text("track");
    let position_m = values.optional_vector("position");
    let velocity_m_s = values.optional_vector("velocity");
    let echoes = values.flag("echoes");
    if echoes && reference != Reference::Leakage {
        let what = "a way is found of the echoes of two receivers: plan.reference is \"leakage\", and [antennas] says where they are";
        return Err(vec![values.fault("echoes", what)]);
    }
    let way = match (file, position_m, velocity_m_s) {
        (None, start_m, None) if echoes => Way::Echoes {
            start_m: start_m.unwrap_or_default(),
        },
        (Some(file), None, None) if !echoes => Way::File(folder.join(file), zero_s),
        (None, Some(position_m), Some(velocity_m_s)) if !echoes => Way::Rail {
            position_m,
            velocity_m_s,
            at_s: zero_s,
        },
        _ => {
            let what =
                "say how the body moves: a track, or position and velocity, or echoes = true";
            return Err(vec![values.fault("track", what)]);
        }
    };
    Ok(Live {
        grid,
        way,
        reference_m: values.optional_vector("reference"),
        last: values.optional_count("last").map(|count| count as usize),
    })
}
