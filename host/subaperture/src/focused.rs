//! An image that carries what it was formed of and how.

use std::time::Duration;

use serde_json::{Map, Value};
use subaperture_focus::Formed;
use subaperture_io::product::Antennas;
use subaperture_io::product::record::Brightest;
use subaperture_model::geometry::{ImageGrid, SceneFrame};
use subaperture_model::image::Image;
use subaperture_model::phase_history::{Band, Channel, InputFile, PhaseHistory};
#[cfg(feature = "plot")]
use subaperture_plot::Orientation;
#[cfg(feature = "quality")]
use subaperture_quality::response::{
    Carrier, Geometry, Response, ResponseError, Settings, Target, measure,
};
use subaperture_resolution::support::{Looks, RecordedLooks};
use subaperture_resolution::survey::Survey;
use subaperture_signal::window::Window;

/// A formed image with its grid, frame, band and settings.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct FocusedImage {
    /// The pixels: rows (y ascending) x columns (x ascending). A unit scatterer on a pixel, seen alike by all pulses,
    /// reads 1.
    pub image: Image,
    /// Where they lie in the scene frame.
    pub grid: ImageGrid,
    /// Where the scene frame lies.
    pub frame: SceneFrame,
    /// The recording's frequencies, if all pulses share them.
    pub band: Option<Band>,
    /// What the recording can show: its name, band, aperture, resolution.
    pub survey: Option<Survey>,
    /// The former's name.
    pub former: &'static str,
    /// Windows over fast and slow time.
    pub windows: [Window; 2],
    /// Every setting that was chosen, given or planned.
    pub settings: Map<String, Value>,
    /// Predicted relative RMS error against the exact sum, dB.
    pub predicted_error_db: f64,
    /// Whether that is above the bound asked.
    pub bound_missed: bool,
    /// What its user has to know, a sentence each.
    pub warnings: Vec<String>,
    /// The recording's channels that it was formed of, where they are named.
    pub channels: Vec<Channel>,
    /// The recording's files and their checksums.
    pub inputs: Vec<InputFile>,
    pub(crate) looks: Option<RecordedLooks>,
    pub(crate) antennas: Antennas,
    #[cfg(feature = "plot")]
    pub(crate) orientation: Orientation,
    pub(crate) memory_bytes: u64,
    pub(crate) taken: Duration,
}

impl FocusedImage {
    pub(crate) fn new(
        formed: Formed,
        history: &dyn PhaseHistory,
        grid: &ImageGrid,
        (former, windows): (&'static str, [Window; 2]),
        inputs: Vec<InputFile>,
    ) -> Self {
        let collection = history.collection();
        let told = formed.settings.get("warnings").and_then(Value::as_array);
        let of_former = told.into_iter().flatten().filter_map(Value::as_str);
        let middle_m = grid.position_m(grid.rows.count / 2, grid.columns.count / 2);
        Self {
            grid: grid.clone(),
            frame: collection.frame,
            band: collection.band(),
            survey: Survey::of(collection),
            former,
            windows,
            predicted_error_db: formed.predicted_error_db,
            bound_missed: formed.bound_missed,
            warnings: (history.warnings().into_iter())
                .chain(of_former.map(str::to_owned))
                .collect(),
            channels: history.channels(),
            inputs,
            antennas: Antennas::of(history),
            looks: RecordedLooks::of(collection, middle_m, [grid.x_axis, grid.y_axis]),
            #[cfg(feature = "plot")]
            orientation: Orientation::of(collection, grid),
            memory_bytes: 0,
            taken: Duration::ZERO,
            settings: formed.settings,
            image: formed.image,
        }
    }

    /// A title: what was recorded, and by what it was formed.
    pub fn title(&self) -> String {
        let survey = self.survey.as_ref();
        let name = survey.map_or("", |survey| survey.name.as_str());
        format!("{name}, {}", self.former)
    }

    /// The brightest pixel; `None` of an image of zeros.
    pub fn brightest(&self) -> Option<Brightest> {
        Brightest::of(&self.image, &self.grid)
    }

    /// Antennas and bands under the windows: what theory needs to say how a point should look. `None` if more than 1021
    /// pulses are needed to tell.
    pub fn looks(&self) -> Option<Looks> {
        let [fast, slow] = self.windows;
        self.looks.as_ref()?.looks(fast, slow)
    }

    /// Measures a point: place, width, side lobes, level and phase.
    ///
    /// # Errors
    /// [`ResponseError`].
    #[cfg(feature = "quality")]
    pub fn measure(&self, target: Target) -> Result<Response, ResponseError> {
        let looks = self.looks();
        let seen = self.survey.as_ref();
        let settings = Settings {
            carrier: seen.map(|seen| {
                Carrier::of(&Geometry {
                    scene_centre_m: seen.scene_centre_m,
                    slant_range_m: seen.slant_range_m,
                    grazing_angle_deg: seen.grazing_angle_deg,
                    azimuth_deg: seen.azimuth_deg,
                    aperture_angle_deg: seen.aperture_angle_deg,
                    bistatic_angle_deg: seen.bistatic_angle_deg,
                    wavelength_m: seen.wavelength_m,
                })
            }),
            looks: looks.as_ref(),
            ..Settings::default()
        };
        measure(&self.image, &self.grid, target, &settings)
    }
}
