//! Content common to SICD and SIDD: image position, aperture and spectrum.

use subaperture_model::geometry::{Geodetic, SceneFrame};

use crate::SicdError;
use crate::aperture::{Aperture, Scpcoa};
use crate::bistatic::Bistatic;
use crate::contour::Sensor;
use crate::formed::{Formed, Georeference};
use crate::grid::Placed;
use crate::nitf::{About, Product, Segment, segments};
use crate::spectrum::Spectrum;
use crate::written::Written;

/// Georeferenced image with its aperture.
pub(crate) struct Laid {
    pub(crate) placed: Placed,
    pub(crate) aperture: Aperture,
    pub(crate) seen: Scpcoa,
    /// Antennas at the centre of aperture.
    pub(crate) sensor: Sensor,
    pub(crate) bistatic: Option<Bistatic>,
    pub(crate) spectra: [Spectrum; 2],
    /// Image corners on the ground: first row and column, then clockwise.
    pub(crate) corners: [Geodetic; 4],
}

impl Laid {
    pub(crate) fn new(formed: &Formed, placing: &Georeference) -> Result<Self, SicdError> {
        let grid = &formed.grid;
        let frame = match (formed.frame, placing.origin) {
            (_, Some(origin)) => SceneFrame::east_north_up(&origin),
            (SceneFrame::Local, None) => return Err(SicdError::Nowhere),
            (frame, None) => frame,
        };
        let centre_m = grid.position_m(grid.rows.count / 2, grid.columns.count / 2);
        let mut aperture = Aperture::new(&formed.antennas, &frame, centre_m, placing)?;
        let radar_m = frame.from_ecf_m(aperture.path.at(aperture.coa_s, 0));
        let placed = Placed::new(formed, frame, radar_m)?;
        if aperture.pair.is_some() {
            // The aperture reference point of a bistatic image depends on the scene centre point.
            let scp_m = placed.layout.centre_m;
            aperture = Aperture::new(&formed.antennas, &frame, scp_m, placing)?;
        }
        let (coa_s, scp) = (aperture.coa_s, placed.scp_ecf_m);
        let seen = Scpcoa::new(&aperture.path, coa_s, scp);
        let pair = aperture.pair.as_ref();
        let sensor = pair.map_or_else(|| seen.sensor(), |pair| pair.at(coa_s));
        let bistatic = pair.map(|pair| Bistatic::new(pair, coa_s, scp));
        let vertices = placed.vertices();
        let along_m = vertices.map(|at| placed.along_m(at));
        let spectra = Spectrum::both(formed, &placed.layout, &along_m)?;
        let [first, _, second, _, third, _, fourth, _] = vertices;
        let corners = [first, second, third, fourth].map(|at| placed.on_ground(at, &sensor));
        Ok(Self {
            placed,
            aperture,
            seen,
            sensor,
            bistatic,
            spectra,
            corners,
        })
    }

    /// File layout of an image with this XML: segments of at most `segment_bytes`, and headers.
    pub(crate) fn written(
        self,
        formed: &Formed,
        product: Product,
        created_ns: i64,
        xml: String,
        segment_bytes: u64,
    ) -> Result<Written, SicdError> {
        let [rows, columns] = self.placed.size.map(|count| count as u64);
        let too_large = || {
            SicdError::Unsuited(format!(
                "{rows} x {columns} pixels exceed the capacity of a NITF file"
            ))
        };
        let segments = segments(rows, columns, product.sample_bytes(), segment_bytes);
        let segments = segments.ok_or_else(too_large)?;
        let of_segments = corners_of(&segments, rows, &self.corners);
        let about = About {
            product,
            name: &formed.name,
            start_ns: self.aperture.start_ns,
            created_ns,
            columns,
            segments: &segments,
            corners: &of_segments,
            outline: &self.corners,
            xml_bytes: xml.len() as u64,
        };
        let headers = about.headers().ok_or_else(too_large)?;
        Ok(Written {
            turned: self.placed.turned,
            image: (formed.grid.rows.count, formed.grid.columns.count),
            xml,
            segments,
            headers,
            assumed: self.aperture.assumed,
        })
    }
}

/// Corners of each segment, by linear interpolation (ECF) between the image corners.
fn corners_of(segments: &[Segment], rows: u64, corners: &[Geodetic; 4]) -> Vec<[Geodetic; 4]> {
    let ecf = corners.map(|corner| {
        Geodetic {
            height_m: 0.0,
            ..corner
        }
        .to_ecf_m()
    });
    // Left and right edge at a row; the image's last corners belong to its last row.
    let at = |row: u64| {
        let share = row as f64 / (rows.max(2) - 1) as f64;
        [[0, 3], [1, 2]].map(|[a, b]| Geodetic::from_ecf_m(ecf[a].lerp(ecf[b], share)))
    };
    let last = segments.len() - 1;
    let of = |(n, segment): (usize, &Segment)| {
        let [first, second] = at(segment.first);
        let [fourth, third] = match n == last {
            true => [corners[3], corners[2]],
            false => at(segment.first + segment.rows),
        };
        [first, second, third, fourth]
    };
    segments.iter().enumerate().map(of).collect()
}
