//! Georeferencing of SICD images from any program.

use subaperture_maps::ProjectionModel;
use subaperture_model::geometry::Geodetic;
use subaperture_sicd::{Band, Projection, ReadError, SicdFile};

/// Mapping between SICD pixels and the Earth. Every scatterer is assumed to be at the height of the scene centre point above the
/// ellipsoid. A scatterer `h` higher is displaced towards the radar by about `h / tan(grazing angle)` (layover).
///
/// [`subaperture_maps::Ortho::with_projection`] resamples the image by it.
#[derive(Clone, Debug)]
pub struct SicdOnMap {
    projection: Projection,
    band: Band,
    height_m: f64,
    steps_m: [f64; 2],
}

impl SicdOnMap {
    /// Mapping of a SICD file.
    ///
    /// # Errors
    /// [`ReadError::Malformed`] if the metadata do not locate the pixels.
    pub fn new(file: &SicdFile) -> Result<Self, ReadError> {
        let projection = file.projection()?;
        let wrong = |what: &str| ReadError::Malformed {
            path: file.path().to_owned(),
            what: what.to_owned(),
        };
        let band = file.band().ok_or_else(|| {
            wrong("XML: expected sample spacings Grid/Row/SS and Grid/Col/SS, found none")
        })?;
        let height_m = projection.scp().height_m;
        let [row_m, column_m] = projection.spacings_m();
        let at = |along_m| {
            let place = projection.on_height(along_m, height_m);
            place.map(|place| place.to_ecf_m())
        };
        let places = (at([0.0; 2]), at([row_m, 0.0]), at([0.0, column_m]));
        let (Some(centre), Some(down), Some(across)) = places else {
            return Err(wrong(
                "the pixels around the scene centre point do not project to the ground",
            ));
        };
        Ok(Self {
            steps_m: [down, across].map(|next| next.distance(centre)),
            projection,
            band,
            height_m,
        })
    }

    /// Whether pixels are points of the image plane (`Grid/Type` `PLANE`, `XRGYCR`, `XCTYAT`).
    pub fn is_plane(&self) -> bool {
        self.projection.is_plane()
    }

    /// Assumed height above the ellipsoid, metres.
    pub fn height_m(&self) -> f64 {
        self.height_m
    }
}

impl ProjectionModel for SicdOnMap {
    fn place(&self, pixel: [f64; 2]) -> Option<Geodetic> {
        let along_m = self.projection.along_of(pixel);
        self.projection.on_height(along_m, self.height_m)
    }

    fn pixel(&self, place: &Geodetic) -> Option<[f64; 2]> {
        let ground = Geodetic {
            height_m: self.height_m,
            ..*place
        };
        let along_m = self.projection.along_m(ground.to_ecf_m())?;
        Some(self.projection.pixel_of(along_m))
    }

    fn steps_m(&self) -> [f64; 2] {
        self.steps_m
    }

    fn middle(&self, pixel: [f64; 2]) -> [f64; 2] {
        // If the metadata are not finite, the spectrum is assumed to be centred on zero.
        let along_m = self.projection.along_of(pixel);
        self.band.middle(along_m).unwrap_or_default()
    }

    fn widths(&self) -> [f64; 2] {
        self.band.widths()
    }
}
