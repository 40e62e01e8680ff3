//! Keys of the position of a scene on the Earth.

use std::f64::consts::{FRAC_PI_2, PI};

use crate::schema::{Bounds, Key, Presence, Requirement, Section, ValueType};
use subaperture_model::units::Dimension;

pub static ORIGIN: Section = Section {
    path: "scene.origin",
    presence: Presence::Always,
    when: &[],
    selector: "",
    doc: "Origin of the scene on the Earth (WGS 84); x points east, y north, z up.",
    keys: &[
        Key::new(
            "latitude",
            ValueType::Quantity(
                Dimension::Angle,
                Bounds::Within(-FRAC_PI_2, FRAC_PI_2, "-90 to 90 deg"),
            ),
            Requirement::Default("\"0 deg\""),
            "Latitude, north positive.",
        ),
        Key::new(
            "longitude",
            ValueType::Quantity(Dimension::Angle, Bounds::Within(-PI, PI, "-180 to 180 deg")),
            Requirement::Default("\"0 deg\""),
            "Longitude, east positive.",
        ),
        Key::new(
            "height",
            ValueType::Quantity(
                Dimension::Length,
                Bounds::Within(-1e4, 1e6, "-10 to 1000 km"),
            ),
            Requirement::Default("\"0 m\""),
            "Height above the ellipsoid.",
        ),
    ],
};
