//! Formed image with its provenance.

use std::time::Duration;

use serde_json::{Map, Value};
use subaperture_focus::Formed;
use subaperture_focus::auto::selected;
use subaperture_focus::beam::{Beam, seeing};
use subaperture_io::product::Antennas;
use subaperture_io::product::record::Brightest;
use subaperture_model::geometry::{ImageGrid, SceneFrame};
use subaperture_model::image::Image;
use subaperture_model::phase_history::{Band, Channel, InputFile, PhaseConvention, PhaseHistory};
use subaperture_model::resolution::support::{Looks, RecordedLooks};
use subaperture_model::resolution::survey::Survey;
#[cfg(feature = "plot")]
use subaperture_plot::Orientation;
#[cfg(feature = "quality")]
use subaperture_quality::response::{
    Carrier, Geometry, Response, ResponseError, Settings, Target, measure,
};
use subaperture_signal::window::Window;

/// Formed image with its grid, frame, band and settings.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct FocusedImage {
    /// Pixels: rows (y ascending) x columns (x ascending). A unit scatterer centred on a pixel and seen equally by all pulses
    /// has the value 1.
    pub image: Image,
    /// Positions of the pixels in the scene frame.
    pub grid: ImageGrid,
    /// Frame of the scene; georeferenced if the recording is.
    pub frame: SceneFrame,
    /// Frequencies of the recording; `None` if pulses differ in them.
    pub band: Option<Band>,
    /// Name, band, aperture and resolution of the recording.
    pub survey: Option<Survey>,
    /// Short name of the former, such as `ffbp`.
    pub former: &'static str,
    /// Windows over fast and slow time.
    pub windows: [Window; 2],
    /// All settings: given, default or planned.
    pub settings: Map<String, Value>,
    /// Predicted relative RMS error against the exact sum, dB.
    pub predicted_error_db: f64,
    /// Whether the predicted error exceeds the requested bound.
    pub bound_missed: bool,
    /// Warnings for the user, one sentence each.
    pub warnings: Vec<String>,
    /// Channels of the recording used for the image, if they are named.
    pub channels: Vec<Channel>,
    /// Distinct phase conventions of the recordings, stated or inferred.
    pub phase_conventions: Vec<PhaseConvention>,
    /// Files of the recording, with checksums.
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
        (former, windows, beam): (&'static str, [Window; 2], Option<Beam>),
        inputs: Vec<InputFile>,
    ) -> Self {
        let collection = history.collection();
        let listed = formed.settings.get("warnings").and_then(Value::as_array);
        let from_former = listed.into_iter().flatten().filter_map(Value::as_str);
        let middle_m = grid.position_m(grid.rows.count / 2, grid.columns.count / 2);
        // The theoretical response is that of the pulses whose beam covers the image centre.
        let seen = beam
            .as_ref()
            .and_then(|beam| seeing(beam, history, middle_m).ok());
        let seen = seen.as_ref().map_or(collection, |seen| seen.collection());
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
                .chain(from_former.map(str::to_owned))
                .collect(),
            channels: history.channels(),
            phase_conventions: history.phase_conventions(),
            inputs,
            antennas: Antennas::of(history),
            looks: RecordedLooks::of(seen, middle_m, [grid.x_axis, grid.y_axis]),
            #[cfg(feature = "plot")]
            orientation: Orientation::of(collection, grid),
            memory_bytes: 0,
            taken: Duration::ZERO,
            settings: formed.settings,
            image: formed.image,
        }
    }

    /// Title for pictures: name of the recording and of the former. For [`Auto`](crate::focus::auto::Auto), that of the selected former.
    pub fn title(&self) -> String {
        let survey = self.survey.as_ref();
        let name = survey.map_or("", |survey| survey.name.as_str());
        format!("{name}, {}", selected(&self.settings, self.former))
    }

    /// Brightest pixel; `None` if all pixels are zero.
    pub fn brightest(&self) -> Option<Brightest> {
        Brightest::of(&self.image, &self.grid)
    }

    /// Antenna positions and bands under the windows, from which the theoretical point response follows. `None` if more than 1021
    /// pulses are needed to represent the aperture.
    pub fn looks(&self) -> Option<Looks> {
        let [fast, slow] = self.windows;
        self.looks.as_ref()?.looks(fast, slow)
    }

    /// Measure a point target: position, width, side lobes, level and phase.
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
