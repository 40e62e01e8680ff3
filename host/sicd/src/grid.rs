//! Image position on the Earth: scene centre point, vertices and corners.

use glam::DVec3;

use subaperture_model::geometry::{Geodetic, SceneFrame};

use crate::SicdError;
use crate::aperture::Scpcoa;
use crate::contour::Sensor;
use crate::formed::Formed;
use crate::orientation::Orientation;
use crate::spectrum::Layout;

/// Sine of the angle within which two planes are identified.
const SAME_PLANE: f64 = 0.03;

/// Pixel positions of an image on the Earth.
#[derive(Clone, Debug)]
pub(crate) struct Placed {
    pub(crate) frame: SceneFrame,
    pub(crate) turned: Orientation,
    /// Rows and columns.
    pub(crate) size: [usize; 2],
    /// Row and column of the scene centre point (SCP).
    pub(crate) scp_pixel: [usize; 2],
    pub(crate) scp_ecf_m: DVec3,
    pub(crate) layout: Layout,
}

impl Placed {
    pub(crate) fn new(
        formed: &Formed,
        frame: SceneFrame,
        radar_m: DVec3,
    ) -> Result<Self, SicdError> {
        let grid = &formed.grid;
        if grid.polar {
            return Err(SicdError::Unsuited(
                "the image is on a polar grid; SICD needs pixels evenly spaced in a plane: form it on a Cartesian grid".to_owned(),
            ));
        }
        if let Some(relief) = &grid.relief {
            return Err(SicdError::Unsuited(format!(
                "the image's pixels lie on {}; SICD needs pixels evenly spaced in a plane: form it on the grid's plane or on the slant plane",
                relief.surface()
            )));
        }
        let middle_m = grid.position_m(grid.rows.count / 2, grid.columns.count / 2);
        let [.., up] = Geodetic::from_ecf_m(frame.to_ecf_m(middle_m)).east_north_up();
        let up = frame.direction_from_ecf(up);
        let turned = Orientation::along(grid, middle_m - radar_m, up);
        let image = (grid.rows.count, grid.columns.count);
        let size = turned.size(image);
        let scp_pixel = size.map(|count| count / 2);
        let [row, column] = turned.of(image, scp_pixel);
        let centre_m = grid.position_m(row, column);
        let spacings_m = turned.axes(grid).map(|axis| axis.step);
        let end = |k: usize, n: usize| (n as f64 - scp_pixel[k] as f64) * spacings_m[k];
        Ok(Self {
            frame,
            turned,
            size,
            scp_pixel,
            scp_ecf_m: frame.to_ecf_m(centre_m),
            layout: Layout {
                centre_m,
                directions: turned.directions(grid),
                spacings_m,
                ends_m: [0, 1].map(|k| [end(k, 0), end(k, size[k] - 1)]),
            },
        })
    }

    /// Row and column of corners and edge centres, clockwise from the first row and column.
    pub(crate) fn vertices(&self) -> [[usize; 2]; 8] {
        let [r, c] = self.size.map(|count| count - 1);
        [
            [0, 0],
            [0, c / 2],
            [0, c],
            [r / 2, c],
            [r, c],
            [r, c / 2],
            [r, 0],
            [r / 2, 0],
        ]
    }

    /// Distance from the SCP along rows and columns, metres.
    pub(crate) fn along_m(&self, pixel: [usize; 2]) -> [f64; 2] {
        [0, 1].map(|k| (pixel[k] as f64 - self.scp_pixel[k] as f64) * self.layout.spacings_m[k])
    }

    /// Pixel position, ECF, metres.
    pub(crate) fn ecf_m(&self, pixel: [usize; 2]) -> DVec3 {
        let [x, y] = self.along_m(pixel);
        let [row, column] = self.layout.directions;
        self.frame
            .to_ecf_m(self.layout.centre_m + row * x + column * y)
    }

    /// Value of `ImagePlane`: `GROUND`, `SLANT` or `OTHER`.
    pub(crate) fn plane(&self, seen: &Scpcoa) -> &'static str {
        let [row, column] = self.layout.directions;
        let normal = self.frame.direction_to_ecf(row.cross(column));
        let [.., up] = Geodetic::from_ecf_m(self.scp_ecf_m).east_north_up();
        let los = (self.scp_ecf_m - seen.place).normalize();
        match () {
            () if normal.cross(up).length() < SAME_PLANE => "GROUND",
            () if normal.dot(los).abs() < SAME_PLANE => "SLANT",
            () => "OTHER",
        }
    }

    /// Intersection of a pixel's range and Doppler contour with the plane tangent to the Earth at the SCP, by Newton's method.
    pub(crate) fn on_ground(&self, pixel: [usize; 2], sensor: &Sensor) -> Geodetic {
        let place = self.ecf_m(pixel);
        let seen = match sensor.receiver {
            None => sensor.transmitter,
            Some(_) => {
                return Geodetic::from_ecf_m(sensor.on_tangent_plane(place, self.scp_ecf_m));
            }
        };
        let [east, north, up] = Geodetic::from_ecf_m(self.scp_ecf_m).east_north_up();
        let heading = seen.velocity.normalize();
        let range_m = place.distance(seen.place);
        let along_m = (place - seen.place).dot(heading);
        let mut ground = place - up * (place - self.scp_ecf_m).dot(up);
        for _ in 0..20 {
            let from = ground - seen.place;
            let off = [
                0.5 * (from.length_squared() - range_m * range_m),
                from.dot(heading) - along_m,
            ];
            let (a, b) = (from.dot(east), from.dot(north));
            let (c, d) = (heading.dot(east), heading.dot(north));
            let determinant = a * d - b * c;
            // Singular below the track, where the two solutions meet: the foot is used.
            if determinant.abs() < 1e-3 * from.length() {
                break;
            }
            let step = east * ((off[0] * d - off[1] * b) / determinant)
                + north * ((off[1] * a - off[0] * c) / determinant);
            if !step.is_finite() || step.length() > range_m {
                break;
            }
            ground -= step;
            if step.length() < 1e-6 {
                break;
            }
        }
        Geodetic::from_ecf_m(ground)
    }
}
