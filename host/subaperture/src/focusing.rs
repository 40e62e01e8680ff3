//! Forming an image with what is left out as by default.

use std::time::Instant;

use crate::FocusedImage;
use subaperture_focus::{FormError, ImageFormer, Means, Misses, Task, TimeModel, machine};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::monitor::{Monitor, Silent};
use subaperture_model::phase_history::{PhaseHistory, Weights};
use subaperture_signal::window::Window;

/// Forming an image by any former in one call; every [`ImageFormer`] has it.
pub trait Focus: ImageFormer {
    /// Forms the image of `history` on `grid` within this former's bound on the error, with everything else as
    /// [`Focusing`] has it by default.
    ///
    /// # Errors
    /// [`FormError`]; [`FormError::BoundMissed`] if the bound cannot be kept.
    fn focus(
        &self,
        history: &dyn PhaseHistory,
        grid: &ImageGrid,
    ) -> Result<FocusedImage, FormError> {
        Focusing::new(history, grid).by(self)
    }
}

impl<F: ImageFormer + ?Sized> Focus for F {}

/// An image to be formed, and how.
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
    misses: Misses,
    means: Means<'a>,
}

impl<'a> Focusing<'a> {
    /// The image of `history` on `grid`: Taylor windows of 35 dB over fast and slow time, half of the machine's memory,
    /// in silence, and an error if the former's bound is missed.
    pub fn new(history: &'a dyn PhaseHistory, grid: &'a ImageGrid) -> Self {
        Self {
            history,
            grid,
            windows: [Window::default(); 2],
            memory_bytes: None,
            monitor: &Silent,
            misses: Misses::Refused,
            means: Means::default(),
        }
    }

    /// With these windows over fast time (frequencies) and slow time (pulses).
    #[must_use]
    pub fn windows(self, fast: Window, slow: Window) -> Self {
        let windows = [fast, slow];
        Self { windows, ..self }
    }

    /// Within so many bytes for the image, the samples in hand and all scratch.
    #[must_use]
    pub fn memory_bytes(self, bytes: u64) -> Self {
        let memory_bytes = Some(bytes);
        Self {
            memory_bytes,
            ..self
        }
    }

    /// With someone who is told how far it is, and may stop it.
    #[must_use]
    pub fn monitor(self, monitor: &'a dyn Monitor) -> Self {
        Self { monitor, ..self }
    }

    /// As well as can be where the former's bound is missed: [`FocusedImage::bound_missed`] tells.
    #[must_use]
    pub fn allow_error(self) -> Self {
        let misses = Misses::Allowed;
        Self { misses, ..self }
    }

    /// With the same bits on every machine, at the price of slower transforms.
    #[must_use]
    pub fn portable(self) -> Self {
        let means = self.means.portable();
        Self { means, ..self }
    }

    /// Choosing by the times of another machine than the one that defaults are of.
    #[must_use]
    pub fn time_model(self, model: &'a TimeModel) -> Self {
        let means = Means {
            model,
            ..self.means
        };
        Self { means, ..self }
    }

    /// Forms the image, then reads the recording's files once more for their checksums, which go into the record.
    ///
    /// # Errors
    /// [`FormError`].
    pub fn by<F: ImageFormer + ?Sized>(self, former: &F) -> Result<FocusedImage, FormError> {
        let start = Instant::now();
        let [fast, slow] = self.windows;
        let memory_bytes = self.memory_bytes.unwrap_or_else(machine::default_bytes);
        let task = Task {
            history: self.history,
            grid: self.grid,
            weights: &Weights::new(self.history.collection(), fast, slow),
            memory_bytes,
            monitor: self.monitor,
            means: self.means,
        };
        let formed = former.form_asked(&task, self.misses)?;
        let inputs = self.history.inputs()?;
        let about = (former.name(), self.windows);
        let mut image = FocusedImage::new(formed, self.history, self.grid, about, inputs);
        image.memory_bytes = memory_bytes;
        image.taken = start.elapsed();
        Ok(image)
    }
}
