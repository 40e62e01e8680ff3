//! Image-to-ground and ground-to-image projection of SICD (NGA.STND.0024-3).
//!
//! A pixel `x` metres along rows and `y` along columns from the scene centre point (SCP) defines the range and range rate of its ground point `p` from the antenna at `A` with
//! velocity `V` at the pixel's centre of aperture:
//!
//! ```text
//! |A - p| = R(x, y),    V . (A - p) / |A - p| = R'(x, y)
//! ```
//!
//! Left sides of a bistatic image are means over the transmitter at the time of transmission and the receiver at the time of reception. Bistatic images are read from
//! SICD 1.4, which defines these times, for grids of type `PLANE`, `XRGYCR`, `XCTYAT` and of polar format (`PFA`).
//!
//! | grid type, algorithm | R, R' from |
//! |---|---|
//! | `RGAZIM`, `PFA` | polynomials of polar angle and spatial frequency scale |
//! | `RGAZIM`, `RGAZCOMP` | increment of the cosine of the Doppler cone angle, `AzSF` |
//! | `RGZERO`, `RMA` of type `INCA` | range and time of closest approach |
//! | `PLANE`, `XRGYCR`, `XCTYAT` | point of the image plane |
//!
//! Both directions are solved by Newton's method to a micrometre. Of the two points with equal range and range rate, the one on the side of the SCP is returned. Adjustable
//! parameters are not supported.

use glam::{DMat3, DVec3};
use subaperture_io::container::{Element, MetadataError};
use subaperture_io::xml::DEFAULT_MEMORY_BYTES;
use subaperture_model::geometry::Geodetic;

use crate::contour::{Antenna, Contour, Sensor};
use crate::lookup::{self, line, polynomial, version, with_root};
use crate::pair::Pair;
use crate::polynomial::Path;

/// Largest number of Newton iterations.
const MAX_STEPS: usize = 30;
/// Convergence threshold, metres.
const NEAR_M: f64 = 1e-6;
/// Step of finite differences in the image, metres.
const LOOK_M: f64 = 1.0;
/// Largest distance from the SCP, metres; iterations beyond have diverged.
const FARTHEST_M: f64 = 5e6;

/// Metadata of a SICD do not define a supported projection.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct ProjectionError(String);

/// Projection model of a SICD.
#[derive(Clone, Debug)]
pub struct Projection {
    scp: DVec3,
    row: DVec3,
    column: DVec3,
    spacings_m: [f64; 2],
    /// Row and column of the SCP, counted from the image's first.
    scp_pixel: [f64; 2],
    trajectory: Trajectory,
    /// Time of centre of aperture, seconds; coefficients of metres along rows and columns.
    time_coa: Vec<Vec<f64>>,
    model: Model,
}

/// Model of range and range rate.
#[derive(Clone, Debug)]
enum Model {
    Plane,
    Polar {
        angle: Vec<f64>,
        scale: Vec<f64>,
    },
    Cone {
        antenna: Path,
        scale: f64,
    },
    Closest {
        antenna: Path,
        range_m: f64,
        time: Vec<f64>,
        rate_scale: Vec<Vec<f64>>,
    },
}

/// Trajectories of one or both antennas.
#[derive(Clone, Debug)]
enum Trajectory {
    Monostatic(Path),
    Bistatic(Pair),
}

impl Trajectory {
    fn parse(root: Element) -> Result<Self, MetadataError> {
        let kind = lookup::text(root, &["CollectionInfo", "CollectType"]);
        if kind != "BISTATIC" {
            let path = lookup::path(root.at(&["Position", "ARPPoly"])?)?;
            return Ok(Self::Monostatic(path));
        }
        let version = version(root, "SICD")?;
        if OLDER.iter().any(|old| version.starts_with(old)) {
            return Err(root.fault(format!(
                "the projection of bistatic images is defined from SICD 1.4, found version {version}"
            )));
        }
        Ok(Self::Bistatic(Pair::parse(root)?))
    }

    /// Antennas at a centre of aperture.
    fn at(&self, time_s: f64) -> Sensor {
        match self {
            Self::Monostatic(path) => Sensor {
                transmitter: Antenna {
                    place: path.at(time_s, 0),
                    velocity: path.at(time_s, 1),
                },
                receiver: None,
            },
            Self::Bistatic(pair) => pair.at(time_s),
        }
    }
}

/// Versions without bistatic projection.
const OLDER: [&str; 5] = ["0.", "1.0", "1.1", "1.2", "1.3"];

impl Projection {
    /// Parse a SICD's XML.
    ///
    /// # Errors
    /// [`ProjectionError`] names what is missing or not supported.
    pub fn of(xml: &str) -> Result<Self, ProjectionError> {
        with_root(xml, DEFAULT_MEMORY_BYTES, Self::parse)
            .map_err(|error| ProjectionError(error.to_string()))
    }

    fn parse(root: Element) -> Result<Self, MetadataError> {
        let number = |path: &[&str]| root.at(path)?.number();
        let vector = |path: &[&str]| root.at(path)?.xyz();
        let trajectory = Trajectory::parse(root)?;
        let grid = lookup::text(root, &["Grid", "Type"]);
        let former = lookup::text(root, &["ImageFormation", "ImageFormAlgo"]);
        let monostatic = |grid: &str| {
            match &trajectory {
            Trajectory::Monostatic(path) => Ok(path.clone()),
            Trajectory::Bistatic(_) => Err(root.fault(format!(
                "expected grid type PLANE, XRGYCR, XCTYAT or RGAZIM of PFA of a bistatic image, found '{grid}' of '{former}'"
            ))),
        }
        };
        let model = match (grid.as_str(), former.as_str()) {
            ("PLANE" | "XRGYCR" | "XCTYAT", _) => Model::Plane,
            ("RGAZIM", "PFA") => Model::Polar {
                angle: line(root.at(&["PFA", "PolarAngPoly"])?)?,
                scale: line(root.at(&["PFA", "SpatialFreqSFPoly"])?)?,
            },
            ("RGAZIM", "RGAZCOMP") => Model::Cone {
                antenna: monostatic(&grid)?,
                scale: number(&["RgAzComp", "AzSF"])?,
            },
            ("RGZERO", _) => {
                let inca = root.at(&["RMA", "INCA"])?;
                Model::Closest {
                    antenna: monostatic(&grid)?,
                    range_m: inca.child("R_CA_SCP")?.number()?,
                    time: line(inca.child("TimeCAPoly")?)?,
                    rate_scale: polynomial(inca.child("DRateSFPoly")?)?,
                }
            }
            _ => {
                return Err(root.fault(format!(
                    "unsupported grid type '{grid}' of image formation algorithm '{former}'"
                )));
            }
        };
        let spacing_m = |name| {
            let spacing_m = number(&["Grid", name, "SS"])?;
            match spacing_m > 0.0 {
                true => Ok(spacing_m),
                false => Err(root.fault(format!(
                    "expected a positive number in Grid/{name}/SS, found {spacing_m}"
                ))),
            }
        };
        let centre = |name, first: &str| {
            let first = lookup::number(root, &["ImageData", first]).unwrap_or(0.0);
            Ok::<_, MetadataError>(number(&["ImageData", "SCPPixel", name])? - first)
        };
        let projection = Self {
            spacings_m: [spacing_m("Row")?, spacing_m("Col")?],
            scp_pixel: [centre("Row", "FirstRow")?, centre("Col", "FirstCol")?],
            scp: vector(&["GeoData", "SCP", "ECF"])?,
            row: vector(&["Grid", "Row", "UVectECF"])?,
            column: vector(&["Grid", "Col", "UVectECF"])?,
            trajectory,
            time_coa: polynomial(root.at(&["Grid", "TimeCOAPoly"])?)?,
            model,
        };
        let height_m = Geodetic::from_ecf_m(projection.scp).height_m;
        let centre = projection
            .on_height([0.0; 2], height_m)
            .and_then(|place| projection.along_m(place.to_ecf_m()));
        match centre {
            Some([row_m, column_m]) if row_m.hypot(column_m) < LOOK_M => Ok(projection),
            _ => Err(root.fault(
                "the geometry is inconsistent: the scene centre point does not project to itself",
            )),
        }
    }

    /// Whether pixels are points of the image plane (`PLANE`, `XRGYCR`, `XCTYAT`).
    pub fn is_plane(&self) -> bool {
        matches!(self.model, Model::Plane)
    }

    /// Scene centre point.
    pub fn scp(&self) -> Geodetic {
        Geodetic::from_ecf_m(self.scp)
    }

    /// Row and column spacing, metres.
    pub fn spacings_m(&self) -> [f64; 2] {
        self.spacings_m
    }

    /// Distance from the SCP along rows and columns, metres, of a fractional row and column counted from 0.
    pub fn along_of(&self, pixel: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|k| (pixel[k] - self.scp_pixel[k]) * self.spacings_m[k])
    }

    /// Fractional row and column of a distance from the SCP. The inverse of [`Self::along_of`].
    pub fn pixel_of(&self, along_m: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|k| along_m[k] / self.spacings_m[k] + self.scp_pixel[k])
    }

    /// Image to ground: point at a height above the ellipsoid (metres) that is imaged at this distance from the SCP; `None` if the contour does not intersect it.
    pub fn on_height(&self, along_m: [f64; 2], height_m: f64) -> Option<Geodetic> {
        let contour = self.contour(along_m)?;
        let mut point = self.point(along_m);
        for _ in 0..MAX_STEPS {
            let place = Geodetic::from_ecf_m(point);
            let [.., up] = place.east_north_up();
            let [range, rate] = contour.off(point);
            let off = DVec3::new(range, rate, place.height_m - height_m);
            let [along, turning] = contour.sensor.gradients(point);
            let rows = DMat3::from_cols(along, turning, up).transpose();
            let step = rows.inverse() * off;
            if !step.is_finite() || point.distance(self.scp) > FARTHEST_M {
                return None;
            }
            point -= step;
            if step.length() < NEAR_M {
                return Some(Geodetic::from_ecf_m(point));
            }
        }
        None
    }

    /// Ground to image: distance from the SCP, metres along rows and columns, of a point (ECF); `None` if the iteration does not converge. The inverse of [`Self::on_height`].
    pub fn along_m(&self, point: DVec3) -> Option<[f64; 2]> {
        let from = point - self.scp;
        let mut at = [from.dot(self.row), from.dot(self.column)];
        let off = |at: [f64; 2]| Some(self.contour(at)?.off(point));
        for _ in 0..MAX_STEPS {
            let [[a, b], [c, d], [e, f]] = [
                off(at)?,
                off([at[0] + LOOK_M, at[1]])?,
                off([at[0], at[1] + LOOK_M])?,
            ];
            let [[p, q], [r, s]] =
                [[c - a, e - a], [d - b, f - b]].map(|row| row.map(|x| x / LOOK_M));
            let determinant = p * s - q * r;
            let step = [(a * s - b * q) / determinant, (b * p - a * r) / determinant];
            let length = step[0].hypot(step[1]);
            if !length.is_finite() || at[0].hypot(at[1]) > FARTHEST_M {
                return None;
            }
            at = [at[0] - step[0], at[1] - step[1]];
            if length < NEAR_M {
                return Some(at);
            }
        }
        None
    }

    /// Point of the image plane, ECF.
    fn point(&self, [x, y]: [f64; 2]) -> DVec3 {
        self.scp + self.row * x + self.column * y
    }

    /// Contour of an image position; `None` if it is not finite.
    fn contour(&self, [x, y]: [f64; 2]) -> Option<Contour> {
        let time_s = of_two(&self.time_coa, [x, y]);
        let sensor = self.trajectory.at(time_s);
        let [range_m, rate_m_s] = match &self.model {
            Model::Plane => sensor.range_and_rate(self.point([x, y])),
            Model::Polar { angle, scale } => {
                let (theta, theta_rate) = (of(angle, time_s), slope(angle, time_s));
                let (stretch, growth) = (of(scale, theta), slope(scale, theta));
                let (sin, cos) = libm::sincos(theta);
                let (along, across) = (x * cos + y * sin, y * cos - x * sin);
                let [range_m, rate_m_s] = sensor.range_and_rate(self.scp);
                [
                    range_m + stretch * along,
                    rate_m_s + (growth * along + stretch * across) * theta_rate,
                ]
            }
            Model::Cone { antenna, scale } => {
                let [range_m, rate_m_s] = sensor.range_and_rate(self.scp);
                [
                    range_m + x,
                    rate_m_s - antenna.at(time_s, 1).length() * scale * y,
                ]
            }
            Model::Closest {
                antenna,
                range_m,
                time,
                rate_scale,
            } => {
                let (closest_m, closest_s) = (range_m + x, of(time, y));
                let speed2 = antenna.at(closest_s, 1).length_squared();
                let since_s = time_s - closest_s;
                let rate = of_two(rate_scale, [x, y]) * speed2 * since_s;
                let range_m = (closest_m * closest_m + rate * since_s).sqrt();
                [range_m, rate / range_m]
            }
        };
        let sound = range_m > 0.0 && sensor.is_finite();
        (sound && range_m.is_finite() && rate_m_s.is_finite()).then_some(Contour {
            sensor,
            range_m,
            rate_m_s,
        })
    }
}

/// Value of a polynomial.
fn of(line: &[f64], x: f64) -> f64 {
    line.iter().rev().fold(0.0, |sum, c| sum * x + c)
}

/// Value of a polynomial's derivative.
fn slope(line: &[f64], x: f64) -> f64 {
    let powers = line.iter().enumerate().skip(1).rev();
    powers.fold(0.0, |sum, (k, c)| sum * x + k as f64 * c)
}

/// Value of a polynomial of two variables.
pub(crate) fn of_two(coefficients: &[Vec<f64>], [x, y]: [f64; 2]) -> f64 {
    coefficients
        .iter()
        .rev()
        .fold(0.0, |sum, row| sum * x + of(row, y))
}
