//! Spectral support of an image along rows and columns (`Grid/Row`, `Grid/Col`).

use glam::DVec3;

use subaperture_model::resolution::support::Looks;
use subaperture_signal::window::Window;

use crate::SicdError;
use crate::formed::Formed;
use crate::polynomial::Surface;

/// 3 dB width of the impulse response for a uniform band of 1 cycle per metre, metres; digits as in the standard.
const EVEN_WIDTH: f64 = 0.8859;
/// Samples per side at which the spectrum is evaluated.
const PLACES: usize = 11;

/// Spectrum along one image direction.
#[derive(Clone, Debug)]
pub(crate) struct Spectrum {
    /// Direction, unit vector of the scene frame.
    pub(crate) direction: DVec3,
    /// Sample spacing, metres.
    pub(crate) spacing_m: f64,
    /// 3 dB width of the impulse response at the centre, metres.
    pub(crate) width_m: f64,
    /// Bandwidth of a uniform band of that resolution, cycles per metre.
    pub(crate) bandwidth: f64,
    /// Spatial frequency of the samples' zero frequency (`KCtr`), cycles per metre.
    pub(crate) centre: f64,
    /// Edges of the spectrum relative to `centre` (`DeltaK1`, `DeltaK2`), cycles per metre.
    pub(crate) edges: [f64; 2],
    /// Centre of the spectrum relative to `centre` (`DeltaKCOAPoly`), over distances along rows and columns.
    pub(crate) middle: Surface,
    pub(crate) window: Window,
}

/// Pixel layout: centre, and directions of rows and columns in the scene frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Layout {
    pub(crate) centre_m: DVec3,
    pub(crate) directions: [DVec3; 2],
    pub(crate) spacings_m: [f64; 2],
    /// Distance of the first and last row and column from the centre, metres.
    pub(crate) ends_m: [[f64; 2]; 2],
}

impl Spectrum {
    /// Spectra along rows and columns; `vertices` are distances along both, metres.
    pub(crate) fn both(
        formed: &Formed,
        layout: &Layout,
        vertices: &[[f64; 2]],
    ) -> Result<[Self; 2], SicdError> {
        let [fast, slow] = formed.windows;
        let looks = |fast, slow| formed.looks.looks(fast, slow);
        let (Some(even), Some(weighted)) = (looks(Window::None, Window::None), looks(fast, slow))
        else {
            return Err(SicdError::Record("the image's support"));
        };
        let along = |which: usize, window: Window| {
            Self::along(which, window, [&even, &weighted], layout, vertices)
        };
        Ok([along(0, fast)?, along(1, slow)?])
    }

    fn along(
        which: usize,
        window: Window,
        [even, weighted]: [&Looks; 2],
        layout: &Layout,
        vertices: &[[f64; 2]],
    ) -> Result<Self, SicdError> {
        let direction = layout.directions[which];
        let spacing_m = layout.spacings_m[which];
        let name = ["rows", "columns"][which];
        let width = |looks: &Looks| looks.at(layout.centre_m).along(direction)?.width_3db_m();
        let none = || {
            SicdError::Unsuited(format!(
                "the aperture does not resolve the image along its {name}"
            ))
        };
        let width_m = width(weighted).ok_or_else(none)?;
        let bandwidth = match window {
            Window::None => EVEN_WIDTH / width_m,
            _ => EVEN_WIDTH / width(even).ok_or_else(none)?,
        };
        if bandwidth * spacing_m > 1.0 {
            return Err(SicdError::Unsuited(format!(
                "the image is undersampled: spacing of {name} {spacing_m} m, bandwidth {bandwidth:.3} cycles per metre; SICD needs at most {:.3} m",
                1.0 / bandwidth
            )));
        }
        let middle_at = |[x, y]: [f64; 2]| {
            let place_m = layout.centre_m + layout.directions[0] * x + layout.directions[1] * y;
            let [low, high] = even.at(place_m).extent(direction)?;
            Some(0.5 * (low + high))
        };
        let at_centre = middle_at([0.0; 2]).ok_or_else(none)?;
        let centre = (at_centre * spacing_m).round() / spacing_m;
        let half = [0, 1].map(|k| {
            let [from, to] = layout.ends_m[k];
            (-from).max(to).max(0.5 * layout.spacings_m[k])
        });
        let step = |n: usize| 2.0 * n as f64 / (PLACES - 1) as f64 - 1.0;
        let mut points = Vec::with_capacity(PLACES * PLACES);
        for n in 0..PLACES * PLACES {
            let at = [step(n / PLACES) * half[0], step(n % PLACES) * half[1]];
            points.push((at, middle_at(at).ok_or_else(none)? - centre));
        }
        let middle = Surface::through(&points, half).ok_or_else(none)?;
        let ends = vertices.iter().map(|&at| middle.at(at));
        let [least, most] = ends.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], k| {
            [a.min(k), b.max(k)]
        });
        let edges = [least - 0.5 * bandwidth, most + 0.5 * bandwidth];
        // A spectrum beyond the Nyquist limit wraps around and occupies the full band.
        let whole = 0.5 / spacing_m;
        let within = edges[0] >= -whole && edges[1] <= whole;
        Ok(Self {
            direction,
            spacing_m,
            width_m,
            bandwidth,
            centre,
            edges: if within { edges } else { [-whole, whole] },
            middle,
            window,
        })
    }
}
