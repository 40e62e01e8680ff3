//! Where a SICD's pixels are on the Earth: image projection of NGA.STND.0024-3.
//!
//! A pixel `x` metres along rows and `y` along columns from the scene centre point (SCP) has the range and the range rate that the antenna, at `A` with the velocity `V` at the
//! pixel's centre of aperture, has to what is seen there:
//!
//! ```text
//! |A - p| = R(x, y),    V . (A - p) / |A - p| = R'(x, y)
//! ```
//!
//! | grid, algorithm | R, R' by |
//! |---|---|
//! | `RGAZIM`, `PFA` | polar angle and scale of spatial frequency, polynomials |
//! | `RGAZIM`, `RGAZCOMP` | the increment of the cosine of the Doppler cone angle, `AzSF` |
//! | `RGZERO`, `RMA` of type `INCA` | range and time of closest approach |
//! | `PLANE`, `XRGYCR`, `XCTYAT` | the point of the image's plane itself |
//!
//! Both ways are solved by Newton's method, to a thousandth of a millimetre. Of the two points with one range and rate that is meant which lies on the side of the SCP. Adjustable
//! parameters and bistatic images are not supported.

use glam::{DMat3, DVec3};
use roxmltree::Document;
use subaperture_model::geometry::Geodetic;

use crate::lookup::Lookup;
use crate::polynomial::Path;

/// Steps of Newton's method.
const MOST_STEPS: usize = 30;
/// Where it ends, metres.
const NEAR_M: f64 = 1e-6;
/// Steps by which slopes in the image are looked at, metres.
const LOOK_M: f64 = 1.0;
/// Points that lie farther from the SCP are none of an image's, metres.
const FARTHEST_M: f64 = 5e6;

/// Why a SICD's pixels have no place.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct ProjectionError(String);

/// Where pixels are: ranges and range rates of a SICD.
#[derive(Clone, Debug)]
pub struct Projection {
    scp: DVec3,
    row: DVec3,
    column: DVec3,
    spacings_m: [f64; 2],
    /// Row and column of the SCP, counted from the image's own first.
    scp_pixel: [f64; 2],
    antenna: Path,
    /// Seconds, of metres along rows and columns.
    time_coa: Vec<Vec<f64>>,
    lies: Lies,
}

/// How range and range rate follow from a place in the image.
#[derive(Clone, Debug)]
enum Lies {
    Plane,
    Polar {
        angle: Vec<f64>,
        scale: Vec<f64>,
    },
    Cone {
        scale: f64,
    },
    Closest {
        range_m: f64,
        time: Vec<f64>,
        rate_scale: Vec<Vec<f64>>,
    },
}

/// An antenna and what it measures.
#[derive(Clone, Copy, Debug)]
struct Contour {
    antenna: DVec3,
    velocity: DVec3,
    range_m: f64,
    rate_m_s: f64,
}

impl Projection {
    /// Of a SICD's XML.
    ///
    /// # Errors
    /// [`ProjectionError`]: what is missing, or not supported.
    pub fn of(xml: &str) -> Result<Self, ProjectionError> {
        Self::told(xml).map_err(ProjectionError)
    }

    fn told(xml: &str) -> Result<Self, String> {
        let document = Document::parse(xml).map_err(|error| format!("XML: {error}"))?;
        let root = Lookup::of(document.root_element());
        let missing = |path: &[&str]| format!("XML: no {}, or no number", path.join("/"));
        let vector = |path: &[&str]| root.vector(path).ok_or_else(|| missing(path));
        let line = |path: &[&str]| root.line(path).ok_or_else(|| missing(path));
        let number = |path: &[&str]| root.number(path).ok_or_else(|| missing(path));
        let polynomial = |path: &[&str]| root.polynomial(path).ok_or_else(|| missing(path));
        let kind = ["CollectionInfo", "CollectType"];
        if root.text(&kind) == Some("BISTATIC") {
            return Err("it is bistatic, and monostatic images are projected".to_owned());
        }
        let grid = root.text(&["Grid", "Type"]).unwrap_or_default();
        let former = root
            .text(&["ImageFormation", "ImageFormAlgo"])
            .unwrap_or_default();
        let lies = match (grid, former) {
            ("PLANE" | "XRGYCR" | "XCTYAT", _) => Lies::Plane,
            ("RGAZIM", "PFA") => Lies::Polar {
                angle: line(&["PFA", "PolarAngPoly"])?,
                scale: line(&["PFA", "SpatialFreqSFPoly"])?,
            },
            ("RGAZIM", "RGAZCOMP") => Lies::Cone {
                scale: number(&["RgAzComp", "AzSF"])?,
            },
            ("RGZERO", _) => Lies::Closest {
                range_m: number(&["RMA", "INCA", "R_CA_SCP"])?,
                time: line(&["RMA", "INCA", "TimeCAPoly"])?,
                rate_scale: polynomial(&["RMA", "INCA", "DRateSFPoly"])?,
            },
            _ => {
                return Err(format!(
                    "its grid is of type '{grid}', formed by '{former}', which is not known"
                ));
            }
        };
        let path = ["Position", "ARPPoly"];
        let spacing_m = |way| {
            let path = ["Grid", way, "SS"];
            let positive = number(&path)?;
            match positive > 0.0 {
                true => Ok(positive),
                false => Err(format!("XML: {} is not positive", path.join("/"))),
            }
        };
        let centre = |way, first: &str| {
            let first = root.number(&["ImageData", first]).unwrap_or(0.0);
            Ok::<_, String>(number(&["ImageData", "SCPPixel", way])? - first)
        };
        let projection = Self {
            spacings_m: [spacing_m("Row")?, spacing_m("Col")?],
            scp_pixel: [centre("Row", "FirstRow")?, centre("Col", "FirstCol")?],
            scp: vector(&["GeoData", "SCP", "ECF"])?,
            row: vector(&["Grid", "Row", "UVectECF"])?,
            column: vector(&["Grid", "Col", "UVectECF"])?,
            antenna: root.path(&path).ok_or_else(|| missing(&path))?,
            time_coa: polynomial(&["Grid", "TimeCOAPoly"])?,
            lies,
        };
        let soft = || "its centre has no place: its geometry contradicts itself".to_owned();
        let height_m = Geodetic::from_ecf_m(projection.scp).height_m;
        let centre = projection
            .on_height([0.0; 2], height_m)
            .and_then(|place| projection.along_m(place.to_ecf_m()))
            .ok_or_else(soft)?;
        match centre[0].hypot(centre[1]) < LOOK_M {
            true => Ok(projection),
            false => Err(soft()),
        }
    }

    /// The scene centre point.
    pub fn scp(&self) -> Geodetic {
        Geodetic::from_ecf_m(self.scp)
    }

    /// From row to row and from column to column, metres.
    pub fn spacings_m(&self) -> [f64; 2] {
        self.spacings_m
    }

    /// Metres along rows and columns from the SCP of a row and column, counted from 0, with fractions.
    pub fn along_of(&self, pixel: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|k| (pixel[k] - self.scp_pixel[k]) * self.spacings_m[k])
    }

    /// The inverse of that.
    pub fn pixel_of(&self, along_m: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|k| along_m[k] / self.spacings_m[k] + self.scp_pixel[k])
    }

    /// Where on the surface of a height above the ellipsoid there is what is seen so many metres along rows and columns from the SCP; none where nothing is.
    pub fn on_height(&self, along_m: [f64; 2], height_m: f64) -> Option<Geodetic> {
        let contour = self.contour(along_m)?;
        let mut point = self.point(along_m);
        for _ in 0..MOST_STEPS {
            let place = Geodetic::from_ecf_m(point);
            let [.., up] = place.east_north_up();
            let [range, rate] = contour.off(point);
            let off = DVec3::new(range, rate, place.height_m - height_m);
            let [along, turning] = contour.slopes(point);
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

    /// Where in the image a point in ECF is seen: metres along rows and columns from the SCP; none where it is not. The inverse of [`Self::on_height`].
    pub fn along_m(&self, point: DVec3) -> Option<[f64; 2]> {
        let from = point - self.scp;
        let mut at = [from.dot(self.row), from.dot(self.column)];
        let off = |at: [f64; 2]| Some(self.contour(at)?.off(point));
        for _ in 0..MOST_STEPS {
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

    /// The point of the image's plane.
    fn point(&self, [x, y]: [f64; 2]) -> DVec3 {
        self.scp + self.row * x + self.column * y
    }

    /// Range and range rate of a place in the image; none where they are no numbers.
    fn contour(&self, [x, y]: [f64; 2]) -> Option<Contour> {
        let time_s = of_two(&self.time_coa, [x, y]);
        let [antenna, velocity] = [0, 1].map(|k| self.antenna.at(time_s, k));
        let of_point = |point: DVec3| {
            let sight = antenna - point;
            let range_m = sight.length();
            [range_m, velocity.dot(sight) / range_m]
        };
        let [range_m, rate_m_s] = match &self.lies {
            Lies::Plane => of_point(self.point([x, y])),
            Lies::Polar { angle, scale } => {
                let (theta, theta_rate) = (of(angle, time_s), slope(angle, time_s));
                let (stretch, growth) = (of(scale, theta), slope(scale, theta));
                let (sin, cos) = libm::sincos(theta);
                let (along, across) = (x * cos + y * sin, y * cos - x * sin);
                let [range_m, rate_m_s] = of_point(self.scp);
                [
                    range_m + stretch * along,
                    rate_m_s + (growth * along + stretch * across) * theta_rate,
                ]
            }
            Lies::Cone { scale } => {
                let [range_m, rate_m_s] = of_point(self.scp);
                [range_m + x, rate_m_s - velocity.length() * scale * y]
            }
            Lies::Closest {
                range_m,
                time,
                rate_scale,
            } => {
                let (closest_m, closest_s) = (range_m + x, of(time, y));
                let speed2 = self.antenna.at(closest_s, 1).length_squared();
                let since_s = time_s - closest_s;
                let rate = of_two(rate_scale, [x, y]) * speed2 * since_s;
                let range_m = (closest_m * closest_m + rate * since_s).sqrt();
                [range_m, rate / range_m]
            }
        };
        let sound = range_m > 0.0 && (antenna + velocity).is_finite();
        (sound && range_m.is_finite() && rate_m_s.is_finite()).then_some(Contour {
            antenna,
            velocity,
            range_m,
            rate_m_s,
        })
    }
}

impl Contour {
    /// By how much the range and the range rate of a point are more: metres, metres a second.
    fn off(&self, point: DVec3) -> [f64; 2] {
        let sight = self.antenna - point;
        let range_m = sight.length();
        [
            range_m - self.range_m,
            self.velocity.dot(sight) / range_m - self.rate_m_s,
        ]
    }

    /// How both grow with the point.
    fn slopes(&self, point: DVec3) -> [DVec3; 2] {
        let sight = self.antenna - point;
        let range_m = sight.length();
        let away = -sight / range_m;
        let across = self.velocity - away * self.velocity.dot(away);
        [away, -across / range_m]
    }
}

/// A polynomial's value.
fn of(line: &[f64], x: f64) -> f64 {
    line.iter().rev().fold(0.0, |sum, c| sum * x + c)
}

/// Its derivative's.
fn slope(line: &[f64], x: f64) -> f64 {
    let powers = line.iter().enumerate().skip(1).rev();
    powers.fold(0.0, |sum, (k, c)| sum * x + k as f64 * c)
}

/// The value of one of two variables.
pub(crate) fn of_two(coefficients: &[Vec<f64>], [x, y]: [f64; 2]) -> f64 {
    coefficients
        .iter()
        .rev()
        .fold(0.0, |sum, row| sum * x + of(row, y))
}
