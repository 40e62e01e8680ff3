//! Keys of the position of a scene on the Earth.

use std::f64::consts::{FRAC_PI_2, PI};

use crate::schema::{Bounds, Key, Kind, Need, Presence, Section};
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
            Kind::Quantity(
                Dimension::Angle,
                Bounds::Within(-FRAC_PI_2, FRAC_PI_2, "-90 to 90 deg"),
            ),
            Need::Default("\"0 deg\""),
            "Latitude, north positive.",
        ),
        Key::new(
            "longitude",
            Kind::Quantity(Dimension::Angle, Bounds::Within(-PI, PI, "-180 to 180 deg")),
            Need::Default("\"0 deg\""),
            "Longitude, east positive.",
        ),
        Key::new(
            "height",
            Kind::Quantity(
                Dimension::Length,
                Bounds::Within(-1e4, 1e6, "-10 to 1000 km"),
            ),
            Need::Default("\"0 m\""),
            "Height above the ellipsoid.",
        ),
    ],
};
