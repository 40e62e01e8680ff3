//! Image formation with defaults for all settings.

use crate::FocusedImage;
use subaperture_focus::beam::{AntennaWeights, BeamChoice, EstimateError, choose, limited};
use subaperture_focus::coverage;
use subaperture_focus::device::Device;
use subaperture_focus::{
    BoundPolicy, FormError, ImageFormer, Numerics, Task, TimeModel, formers, machine,
};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::monitor::{Monitor, Silent};
use subaperture_model::phase_history::PhaseHistory;
use subaperture_model::stopwatch::Stopwatch;
use subaperture_signal::window::Window;

/// Form an image in one call. Implemented for every [`ImageFormer`].
pub trait Focus: ImageFormer {
    /// Form the image of `history` on `grid` within this former's error bound, with the defaults of
    /// [`Focusing`] for all other settings.
    ///
    /// # Errors
    /// [`FormError`]; [`FormError::BoundMissed`] if the image would exceed the error bound.
    fn focus(
        &self,
        history: &dyn PhaseHistory,
        grid: &ImageGrid,
    ) -> Result<FocusedImage, FormError> {
        Focusing::new(history, grid).by(self)
    }
}

impl<F: ImageFormer + ?Sized> Focus for F {}

/// Settings of one image formation.
///
/// ```no_run
/// use subaperture::prelude::*;
///
/// let recording = open("lot.cphd")?;
/// let grid = "x=-50:50:0.2,y=-50:50:0.2,z=0".parse()?;
/// let image = Focusing::new(&recording, &grid)
///     .windows(Window::None, Window::Hamming)
///     .memory_bytes(2 << 30)
///     .by(&Backprojection::default())?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy)]
pub struct Focusing<'a> {
    history: &'a dyn PhaseHistory,
    grid: &'a ImageGrid,
    windows: [Window; 2],
    memory_bytes: Option<u64>,
    monitor: &'a dyn Monitor,
    bound_policy: BoundPolicy,
    numerics: Numerics<'a>,
    beam: BeamChoice,
    antenna_weights: AntennaWeights,
}

impl<'a> Focusing<'a> {
    /// Settings for the image of `history` on `grid`. Defaults: Taylor windows of 35 dB over fast and slow time, half of the
    /// machine's memory, no progress reports, an error if the former's bound is exceeded, and [`BeamChoice::Stated`].
    pub fn new(history: &'a dyn PhaseHistory, grid: &'a ImageGrid) -> Self {
        Self {
            history,
            grid,
            windows: [Window::default(); 2],
            memory_bytes: None,
            monitor: &Silent,
            bound_policy: BoundPolicy::Refused,
            numerics: Numerics::default(),
            beam: BeamChoice::default(),
            antenna_weights: AntennaWeights::default(),
        }
    }

    /// Beam that selects the pulses of each point, as in `subap focus --beam`. Default: [`BeamChoice::Stated`], the beam of the recording's antennas, or the
    /// one that its Doppler spectrum clearly shows where ghosts are possible. [`FocusedImage::settings`] and
    /// [`FocusedImage::warnings`] report the beam that was used and the ones that were rejected.
    #[must_use]
    pub fn beam(self, beam: BeamChoice) -> Self {
        Self { beam, ..self }
    }

    /// Weights of pulses by the antenna patterns of the recording, as in `subap focus --antenna-weights`. With matched weights the patterns select the pulses
    /// of each point, unless a beam is requested. Default: [`AntennaWeights::None`].
    #[must_use]
    pub fn antenna_weights(self, antenna_weights: AntennaWeights) -> Self {
        Self {
            antenna_weights,
            ..self
        }
    }

    /// Windows over fast time (frequencies) and slow time (pulses). Default: Taylor, 35 dB.
    #[must_use]
    pub fn windows(self, fast: Window, slow: Window) -> Self {
        let windows = [fast, slow];
        Self { windows, ..self }
    }

    /// Memory for the image, the samples held and all scratch, bytes. Default: half of the machine's memory.
    #[must_use]
    pub fn memory_bytes(self, bytes: u64) -> Self {
        let memory_bytes = Some(bytes);
        Self {
            memory_bytes,
            ..self
        }
    }

    /// Monitor that receives progress and may cancel. Default: none.
    #[must_use]
    pub fn monitor(self, monitor: &'a dyn Monitor) -> Self {
        Self { monitor, ..self }
    }

    /// Return an image that exceeds the error bound, marked by [`FocusedImage::bound_missed`], instead of an error.
    #[must_use]
    pub fn allow_error(self) -> Self {
        let bound_policy = BoundPolicy::Allowed;
        Self {
            bound_policy,
            ..self
        }
    }

    /// Make results bit-identical on all machines. Transforms are slower.
    #[must_use]
    pub fn portable(self) -> Self {
        let numerics = self.numerics.portable();
        Self { numerics, ..self }
    }

    /// Device for the formers that can use one, such as a GPU. `bp` uses it on Cartesian grids; [`FocusedImage::settings`] then
    /// contain its name as `device`. Default: none.
    #[must_use]
    pub fn device(self, device: &'a dyn Device) -> Self {
        let numerics = Numerics {
            device: Some(device),
            ..self.numerics
        };
        Self { numerics, ..self }
    }

    /// Timing model by which plans are chosen. Default: that of the reference machine.
    #[must_use]
    pub fn time_model(self, model: &'a TimeModel) -> Self {
        let numerics = Numerics {
            model,
            ..self.numerics
        };
        Self { numerics, ..self }
    }

    /// Form the image, then read the recording's files again for the checksums in the record.
    ///
    /// A former of another crate forms every pixel from all pulses, unless it is wrapped in [`InBeam`](subaperture_focus::beam::InBeam).
    ///
    /// # Errors
    /// [`FormError`]; [`FormError::Unsuited`] if a requested beam or antenna weights do not suit the recording, the grid or a former of another crate.
    pub fn by<F: ImageFormer + ?Sized>(self, former: &F) -> Result<FocusedImage, FormError> {
        let start = Stopwatch::start();
        let mut warnings = Vec::new();
        let mut image = match self.in_beam(former, &mut warnings)? {
            Some(in_beam) => self.formed(&*in_beam)?,
            None => self.formed(former)?,
        };
        image.warnings.append(&mut warnings);
        image.taken = start.elapsed();
        Ok(image)
    }

    /// The former in the chosen beam; `None` for an image from all pulses, and for a former that already has a beam.
    fn in_beam<F: ImageFormer + ?Sized>(
        &self,
        former: &F,
        warnings: &mut Vec<String>,
    ) -> Result<Option<Box<dyn ImageFormer>>, FormError> {
        if former.forms_blocks() {
            return Ok(None);
        }
        // A former is identified by its name and settings, as in a stored plan.
        let again = formers::former(former.name(), &former.settings()).ok();
        let again = again.filter(|again| again.settings() == former.settings());
        let patterns = self.antenna_weights.patterns(self.history)?;
        // Matched weights follow the whole main lobe, not only its half-power width.
        let beam = self.antenna_weights.beam(self.beam);
        let requested =
            patterns.is_some() || !matches!(beam, BeamChoice::Stated | BeamChoice::None);
        let Some(again) = again else {
            return match requested {
                true => Err(FormError::unsuited(format!(
                    "expected a former of subaperture, found {}: wrap it in InBeam::new to form its image in a beam",
                    former.name()
                ))),
                false => Ok(None),
            };
        };
        let chosen = choose(beam, self.history, self.grid, self.monitor);
        let chosen = chosen.map_err(|error| match error {
            EstimateError::Form(error) => error,
            error => FormError::unsuited(error.to_string()),
        })?;
        let about_beam = chosen.warnings(self.grid);
        warnings.extend(about_beam.iter().map(ToString::to_string));
        if patterns.is_none() && chosen.beam.is_none() {
            return Ok(None);
        }
        limited(again, patterns, chosen.beam).map(Some)
    }

    fn formed<F: ImageFormer + ?Sized>(&self, former: &F) -> Result<FocusedImage, FormError> {
        let [fast, slow] = self.windows;
        let memory_bytes = self.memory_bytes.unwrap_or_else(machine::default_bytes);
        let collection = self.history.collection();
        let task = Task {
            history: self.history,
            grid: self.grid,
            weights: &former.weights(collection, self.grid, fast, slow)?,
            memory_bytes,
            monitor: self.monitor,
            numerics: self.numerics,
        };
        let formed = former.form_asked(&task, self.bound_policy)?;
        let inputs = self.history.inputs()?;
        let about = (former.name(), self.windows, former.beam());
        let mut image = FocusedImage::new(formed, self.history, self.grid, about, inputs);
        image.memory_bytes = memory_bytes;
        let uncovered = coverage::warning(&image.settings, self.grid);
        image.warnings.extend(uncovered);
        Ok(image)
    }
}
