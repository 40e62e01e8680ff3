//! Input of a measurement of displacement.

use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::Image;

use super::areas::StableArea;
use super::error::DisplacementError;

/// Complex images of repeat passes on one grid.
#[derive(Clone, Copy, Debug)]
pub struct Passes<'a> {
    /// Images, at least 2, earliest first.
    pub images: &'a [Image],
    /// Time of each pass, seconds, ascending.
    pub times_s: &'a [f64],
    /// Grid of all images.
    pub grid: &'a ImageGrid,
    /// Centre of the radar's aperture, metres, scene frame. Ranges count from it.
    pub radar_m: [f64; 3],
    /// Wavelength at the band centre, metres.
    pub wavelength_m: f64,
}

/// Pixels that can be points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PointChoice {
    /// Local maxima of the mean power among their 8 neighbours: independent points on an oversampled grid. Default.
    #[default]
    Maxima,
    /// All pixels. Neighbours within a resolution cell are counted as independent, so that deviations of the screen are too small.
    All,
}

/// Atmospheric screen of a pass.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ScreenModel {
    /// Phase linear in range. Default.
    #[default]
    Linear,
    /// Constant phase, for stable areas at one range.
    Constant,
}

impl ScreenModel {
    /// Number of estimated parameters.
    pub(super) fn terms(self) -> usize {
        match self {
            Self::Linear => 2,
            Self::Constant => 1,
        }
    }
}

/// Settings of a measurement of displacement.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Largest amplitude dispersion index of a point, above 0 up to 1.
    pub dispersion: f64,
    /// Smallest mean power of a point, relative to the median over all pixels, dB.
    pub floor_db: f64,
    /// Pixels that can be points.
    pub choice: PointChoice,
    /// Model of the atmospheric screen.
    pub screen: ScreenModel,
    /// Areas at rest; empty for a robust fit to all points.
    pub stable: Vec<StableArea>,
    /// Largest number of points. Each takes about [`Self::point_bytes`] of memory.
    pub most_points: usize,
}

impl Default for Settings {
    /// A dispersion up to 0.25, a floor of 10 dB, local maxima, a screen linear in range, no stable areas, any number of points.
    fn default() -> Self {
        Self {
            dispersion: 0.25,
            floor_db: 10.0,
            choice: PointChoice::Maxima,
            screen: ScreenModel::Linear,
            stable: Vec::new(),
            most_points: usize::MAX,
        }
    }
}

impl Settings {
    /// Memory of a point in this number of passes, bytes: values, phases and results, eight edges and some twelve triangles.
    pub fn point_bytes(passes: usize) -> u64 {
        1000 + 50 * passes as u64
    }
}

/// Check passes and settings.
pub(super) fn check(passes: &Passes, settings: &Settings) -> Result<(), DisplacementError> {
    let count = passes.images.len();
    if count < 2 {
        return Err(DisplacementError::Passes(count));
    }
    if passes.times_s.len() != count {
        return Err(DisplacementError::Times {
            passes: count,
            times: passes.times_s.len(),
        });
    }
    for (pass, times) in (1..).zip(passes.times_s.windows(2)) {
        let span_s = times[1] - times[0];
        if !(span_s > 0.0 && span_s.is_finite()) {
            return Err(DisplacementError::Order {
                pass,
                before_s: times[0],
                found_s: times[1],
            });
        }
    }
    let [rows, columns] = [passes.grid.rows.count, passes.grid.columns.count];
    for (pass, image) in passes.images.iter().enumerate() {
        let fits = (image.rows, image.columns) == (rows, columns);
        if !fits || Some(image.pixels.len()) != rows.checked_mul(columns) {
            return Err(DisplacementError::Size {
                pass,
                rows,
                columns,
                found_rows: image.rows,
                found_columns: image.columns,
            });
        }
    }
    let within = |name, expected, found: f64, holds: bool| match holds {
        true => Ok(()),
        false => Err(DisplacementError::Setting {
            name,
            expected,
            found,
        }),
    };
    let wavelength_m = passes.wavelength_m;
    let sound = wavelength_m > 0.0 && wavelength_m.is_finite();
    within("wavelength", "a length above 0 m", wavelength_m, sound)?;
    let dispersion = settings.dispersion;
    let sound = dispersion > 0.0 && dispersion <= 1.0;
    within(
        "dispersion",
        "a number above 0 and up to 1",
        dispersion,
        sound,
    )?;
    let floor_db = settings.floor_db;
    within(
        "floor",
        "a finite level in dB",
        floor_db,
        floor_db.is_finite(),
    )?;
    let odd = passes.radar_m.iter().find(|v| !v.is_finite());
    within(
        "radar position",
        "finite metres",
        odd.copied().unwrap_or_default(),
        odd.is_none(),
    )
}
