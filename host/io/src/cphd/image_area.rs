//! Image area coordinates of a file to be written: the scene frame on its reference surface.
//!
//! `Planar`: image area coordinates are scene coordinates. `HAE`: x and y count the increments of latitude and
//! longitude `uIAXLL` and `uIAYLL`, each one metre long at the IARP, and z is the height above the IARP's surface.
//! The scene frame is then the tangent plane at the IARP. At a distance of `d` m the surface is `d^2 / 12.8e6` m
//! below it.

use glam::DVec3;

use super::metadata::ReferenceSurface;
use super::write_options::WriteError;
use crate::xml::Writer;
use subaperture_model::geometry::{Geodetic, SceneFrame};

/// Maximum angle between the scene's z axis and the vertical for an HAE surface, radians: 6 m at the Earth's radius.
const UPRIGHT: f64 = 1e-6;

/// Coordinates on a surface about the IARP.
pub(super) struct ImageAreaCoordinates {
    frame: SceneFrame,
    iarp: Geodetic,
    /// Increments of latitude and longitude, radians per metre along x and y. `None` on a plane.
    increments: Option<[[f64; 2]; 2]>,
}

impl ImageAreaCoordinates {
    /// Of a frame of the Earth.
    ///
    /// # Errors
    /// [`WriteError::Unsuited`] of an HAE surface in a frame whose z axis is not the vertical.
    pub(super) fn new(frame: SceneFrame, surface: ReferenceSurface) -> Result<Self, WriteError> {
        let iarp = Geodetic::from_ecf_m(frame.to_ecf_m(DVec3::ZERO));
        let [east, north, up] = iarp.east_north_up();
        let increments = match surface {
            ReferenceSurface::Planar => None,
            ReferenceSurface::Hae => {
                let off = frame.direction_to_ecf(DVec3::Z).distance(up);
                if off.is_nan() || off > UPRIGHT {
                    return Err(WriteError::Unsuited(format!(
                        "a reference surface of constant height is level at the scene's origin, and the scene's z axis is {off:.1e} rad off the \
                         vertical there: write a planar one"
                    )));
                }
                // Metres a radian of latitude and of longitude.
                let [latitude_m, longitude_m] = [
                    iarp.direction(1.0, 0.0).length(),
                    iarp.direction(0.0, 1.0).length(),
                ];
                Some([DVec3::X, DVec3::Y].map(|axis| {
                    let along = frame.direction_to_ecf(axis);
                    [along.dot(north) / latitude_m, along.dot(east) / longitude_m]
                }))
            }
        };
        Ok(Self {
            frame,
            iarp,
            increments,
        })
    }

    /// Position on the surface at these coordinates.
    pub(super) fn place(&self, x_m: f64, y_m: f64) -> Geodetic {
        match self.increments {
            None => Geodetic::from_ecf_m(self.frame.to_ecf_m(DVec3::new(x_m, y_m, 0.0))),
            Some([x, y]) => Geodetic {
                latitude_deg: self.iarp.latitude_deg + (x[0] * x_m + y[0] * y_m).to_degrees(),
                longitude_deg: self.iarp.longitude_deg + (x[1] * x_m + y[1] * y_m).to_degrees(),
                ..self.iarp
            },
        }
    }

    /// Coordinates of a point.
    pub(super) fn of(&self, ecf_m: DVec3) -> DVec3 {
        let Some([x, y]) = self.increments else {
            return self.frame.from_ecf_m(ecf_m);
        };
        let place = Geodetic::from_ecf_m(ecf_m);
        let north = (place.latitude_deg - self.iarp.latitude_deg).to_radians();
        let east = place.longitude_deg - self.iarp.longitude_deg;
        let east = ((east + 180.0).rem_euclid(360.0) - 180.0).to_radians();
        let determinant = x[0] * y[1] - x[1] * y[0];
        DVec3::new(
            (north * y[1] - east * y[0]) / determinant,
            (x[0] * east - x[1] * north) / determinant,
            place.height_m - self.iarp.height_m,
        )
    }

    /// The branches `IARP` and `ReferenceSurface`.
    pub(super) fn describe(&self, w: &mut Writer) {
        w.element("IARP", "", |w| {
            w.xyz("ECF", self.frame.to_ecf_m(DVec3::ZERO));
            w.element("LLH", "", |w| {
                w.numbers(&[
                    ("Lat", self.iarp.latitude_deg),
                    ("Lon", self.iarp.longitude_deg),
                    ("HAE", self.iarp.height_m),
                ]);
            });
        });
        w.element("ReferenceSurface", "", |w| match self.increments {
            None => w.element("Planar", "", |w| {
                w.xyz("uIAX", self.frame.direction_to_ecf(DVec3::X));
                w.xyz("uIAY", self.frame.direction_to_ecf(DVec3::Y));
            }),
            Some(increments) => w.element("HAE", "", |w| {
                for (name, [latitude, longitude]) in
                    ["uIAXLL", "uIAYLL"].into_iter().zip(increments)
                {
                    w.element(name, "", |w| {
                        w.numbers(&[("Lat", latitude), ("Lon", longitude)]);
                    });
                }
            }),
        });
    }
}
