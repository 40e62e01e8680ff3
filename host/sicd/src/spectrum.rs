//! Where an image's spectrum lies along its rows and columns (`Grid/Row`, `Grid/Col`).

use glam::DVec3;

use subaperture_resolution::support::Looks;
use subaperture_signal::window::Window;

use crate::SicdError;
use crate::formed::Formed;
use crate::polynomial::Surface;

/// Half-power width of the response to an even band of 1 cycle a metre, metres, in the digits that the standard and its checkers use.
const EVEN_WIDTH: f64 = 0.8859;
/// Places a side at which the spectrum is looked at.
const PLACES: usize = 11;

/// One direction of an image.
#[derive(Clone, Debug)]
pub(crate) struct Spectrum {
    /// Unit vector of the scene frame.
    pub(crate) direction: DVec3,
    /// Sample spacing, metres.
    pub(crate) spacing_m: f64,
    /// Half-power width of the response at the centre, metres.
    pub(crate) width_m: f64,
    /// Bandwidth of an even band of that resolution, cycles a metre.
    pub(crate) bandwidth: f64,
    /// The spatial frequency at which the samples' spectrum has its zero.
    pub(crate) centre: f64,
    /// The spectrum's edges relative to it.
    pub(crate) edges: [f64; 2],
    /// Where its middle is, relative to it, over distances along rows and columns.
    pub(crate) middle: Surface,
    pub(crate) window: Window,
}

/// How the pixels lie: the centre, and the directions of rows and columns in the scene frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lying {
    pub(crate) centre_m: DVec3,
    pub(crate) directions: [DVec3; 2],
    pub(crate) spacings_m: [f64; 2],
    /// The first and the last row and column, from the centre.
    pub(crate) ends_m: [[f64; 2]; 2],
}

impl Spectrum {
    /// Along rows and along columns; `vertices` of the image in metres along both.
    pub(crate) fn both(
        formed: &Formed,
        lying: &Lying,
        vertices: &[[f64; 2]],
    ) -> Result<[Self; 2], SicdError> {
        let [fast, slow] = formed.windows;
        let looks = |fast, slow| formed.looks.looks(fast, slow);
        let (Some(even), Some(weighed)) = (looks(Window::None, Window::None), looks(fast, slow))
        else {
            return Err(SicdError::Record("pulses that stand for the recording's"));
        };
        let along = |which: usize, window: Window| {
            Self::along(which, window, [&even, &weighed], lying, vertices)
        };
        Ok([along(0, fast)?, along(1, slow)?])
    }

    fn along(
        which: usize,
        window: Window,
        [even, weighed]: [&Looks; 2],
        lying: &Lying,
        vertices: &[[f64; 2]],
    ) -> Result<Self, SicdError> {
        let direction = lying.directions[which];
        let spacing_m = lying.spacings_m[which];
        let name = ["rows", "columns"][which];
        let width = |looks: &Looks| looks.at(lying.centre_m).along(direction)?.width_3db_m();
        let none = || {
            SicdError::Unsuited(format!(
                "the recording does not resolve the image along its {name}"
            ))
        };
        let width_m = width(weighed).ok_or_else(none)?;
        let bandwidth = match window {
            Window::None => EVEN_WIDTH / width_m,
            _ => EVEN_WIDTH / width(even).ok_or_else(none)?,
        };
        if bandwidth * spacing_m > 1.0 {
            return Err(SicdError::Unsuited(format!(
                "{name} are {spacing_m} m apart and the spectrum is {bandwidth:.3} cycles a metre wide: the image is undersampled, and SICD wants {:.3} m at the most",
                1.0 / bandwidth
            )));
        }
        let middle_at = |[x, y]: [f64; 2]| {
            let place_m = lying.centre_m + lying.directions[0] * x + lying.directions[1] * y;
            let [low, high] = even.at(place_m).extent(direction)?;
            Some(0.5 * (low + high))
        };
        let at_centre = middle_at([0.0; 2]).ok_or_else(none)?;
        let centre = (at_centre * spacing_m).round() / spacing_m;
        let half = [0, 1].map(|k| {
            let [from, to] = lying.ends_m[k];
            (-from).max(to).max(0.5 * lying.spacings_m[k])
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
        // A spectrum that passes the edge of what samples tell apart comes in again at the other, and takes all.
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
