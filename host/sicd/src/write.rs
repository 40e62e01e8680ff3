//! The file: headers, samples in strips, XML.

use std::io::{self, Write};
use std::path::Path;

use subaperture_io::atomic::Beside;
use subaperture_model::geometry::{Geodetic, SceneFrame};
use subaperture_model::image::Parts;
use subaperture_model::monitor::Monitor;

use crate::SicdError;
use crate::aperture::{Aperture, Scpcoa};
use crate::describe::Told;
use crate::formed::{Formed, Placing};
use crate::grid::Placed;
use crate::nitf::{About, Headers, Segment, segments};
use crate::spectrum::Spectrum;
use crate::turned::Turned;

/// Pixels that are held of an image while it is written, about: a row at the least, and their bytes besides.
pub const STRIP_PIXELS: usize = 1 << 20;

/// A SICD but for its samples.
#[derive(Clone, Debug)]
pub struct Sicd {
    xml: String,
    turned: Turned,
    /// Rows and columns of the image as it is.
    image: (usize, usize),
    segments: Vec<Segment>,
    headers: Headers,
    told: Vec<String>,
}

impl Sicd {
    /// What is told of an image; `created_ns` is now, nanoseconds since the beginning of 1970.
    ///
    /// # Errors
    /// [`SicdError`].
    pub fn new(formed: &Formed, placing: &Placing, created_ns: i64) -> Result<Self, SicdError> {
        let grid = &formed.grid;
        let frame = match (formed.frame, placing.origin) {
            (_, Some(origin)) => SceneFrame::east_north_up(&origin),
            (SceneFrame::Local, None) => return Err(SicdError::Nowhere),
            (frame, None) => frame,
        };
        let centre_m = grid.position_m(grid.rows.count / 2, grid.columns.count / 2);
        let aperture = Aperture::new(&formed.antennas, &frame, centre_m, placing)?;
        let radar_m = frame.from_ecf_m(aperture.path.at(aperture.coa_s(), 0));
        let placed = Placed::new(formed, frame, radar_m)?;
        let seen = Scpcoa::new(&aperture.path, aperture.coa_s(), placed.scp_ecf_m);
        let vertices = placed.vertices();
        let spectra = Spectrum::both(
            formed,
            &placed.lying,
            &vertices.map(|at| placed.along_m(at)),
        )?;
        let [first, _, second, _, third, _, fourth, _] = vertices;
        let corners = [first, second, third, fourth].map(|at| placed.on_ground(at, &seen));
        let xml = Told {
            formed,
            placed: &placed,
            aperture: &aperture,
            seen: &seen,
            spectra: &spectra,
            corners: &corners,
            created_ns,
        }
        .document();
        let [rows, columns] = placed.size.map(|count| count as u64);
        let too_large = || {
            SicdError::Unsuited(format!(
                "{rows} x {columns} pixels are more than a NITF file holds"
            ))
        };
        let segments = segments(rows, columns).ok_or_else(too_large)?;
        let of_segments = corners_of(&segments, rows, &corners);
        let about = About {
            name: &formed.name,
            start_ns: aperture.start_ns,
            created_ns,
            columns,
            segments: &segments,
            corners: &of_segments,
            outline: &corners,
            xml_bytes: xml.len() as u64,
        };
        let headers = about.headers().ok_or_else(too_large)?;
        Ok(Self {
            turned: placed.turned,
            image: (grid.rows.count, grid.columns.count),
            told: aperture.told,
            xml,
            segments,
            headers,
        })
    }

    /// The metadata.
    pub fn xml(&self) -> &str {
        &self.xml
    }

    /// How rows and columns lie on the image's.
    pub fn turned(&self) -> Turned {
        self.turned
    }

    /// What was assumed, in sentences: it stands in the file, too.
    pub fn told(&self) -> &[String] {
        &self.told
    }

    /// Bytes of the file.
    pub fn bytes(&self) -> u64 {
        self.headers.bytes
    }

    /// Writes the file, complete or not at all, reading the image in strips.
    ///
    /// # Errors
    /// [`SicdError`]; then nothing is left behind.
    ///
    /// # Panics
    /// If the image is not of the size that was told.
    pub fn write(
        &self,
        path: &Path,
        image: &dyn Parts,
        monitor: &dyn Monitor,
    ) -> Result<(), SicdError> {
        assert_eq!(image.size(), self.image, "the image's size");
        let mut beside = Beside::create(path, self.bytes(), ".part")?;
        let mut put = |bytes: &[u8]| -> Result<(), SicdError> {
            let wrote = beside.file().write_all(bytes);
            wrote.map_err(|source: io::Error| beside.failed(source).into())
        };
        put(&self.headers.file)?;
        let [rows, columns] = self.turned.size(self.image);
        let strip = (STRIP_PIXELS / columns.max(1)).max(1);
        for (segment, header) in self.segments.iter().zip(&self.headers.images) {
            put(header)?;
            let end = (segment.first + segment.rows) as usize;
            for from in (segment.first as usize..end).step_by(strip) {
                if monitor.cancelled() {
                    return Err(SicdError::Cancelled);
                }
                let read = self.turned.rows(image, from, (from + strip).min(end));
                let pixels = read.map_err(SicdError::Read)?;
                let mut bytes = Vec::with_capacity(8 * pixels.len());
                for z in pixels {
                    bytes.extend(z.re.to_be_bytes());
                    bytes.extend(z.im.to_be_bytes());
                }
                put(&bytes)?;
                monitor.progress((from + strip).min(end) as f64 / rows as f64);
            }
        }
        put(&self.headers.xml)?;
        put(self.xml.as_bytes())?;
        Ok(beside.commit()?)
    }
}

/// Corners of each segment: between those of the image, straight through the Earth.
fn corners_of(segments: &[Segment], rows: u64, corners: &[Geodetic; 4]) -> Vec<[Geodetic; 4]> {
    let ecf = corners.map(|corner| {
        Geodetic {
            height_m: 0.0,
            ..corner
        }
        .to_ecf_m()
    });
    // On the left and right edge at a row; the image's last corners belong to its last row.
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
