//! Theoretical cuts of a point response, from the recording's spectral support or the window.

use glam::DVec3;
use serde::Serialize;
use subaperture::geometry::ImageGrid;
use subaperture::quality::response::{Cut, Direction, Response, Settings};
use subaperture::resolution::support::{Looks, Projection};
use subaperture::resolution::theory::{Expected, expected, transform};
use subaperture::signal::window::Window;

use super::source::Source;

/// Number of samples of a band of unknown width.
const SAMPLES: usize = 512;

/// Basis of the theoretical response.
pub(super) enum Basis {
    /// What the image was formed from, and its windows over fast and slow time.
    Looks(Looks, [Window; 2]),
    /// Window of a band of unknown width.
    Window(Window),
    /// Neither support nor window is available.
    Unknown,
}

/// Theoretical widths and side lobes of a cut.
#[derive(Serialize)]
pub(super) struct Theory {
    /// Lengths in the units of the cut, metres or radians; in resolution cells if only the window is known.
    #[serde(flatten)]
    pub(super) expected: Expected,
    /// Whether widths are in resolution cells.
    in_cells: bool,
    /// Power relative to the peak as a function of distance.
    #[serde(skip)]
    curve: Curve,
}

enum Curve {
    Support(Box<Projection>),
    Window { weights: Vec<f64>, cell: f64 },
}

impl Basis {
    /// Basis for an image; `typed` overrides its windows.
    pub(super) fn new(source: &Source, typed: Option<Window>) -> Self {
        let windows = typed.map(|window| [window; 2]).or(source.windows);
        let looks = source.looks.as_ref().zip(windows);
        let looks = looks.and_then(|(looks, windows)| {
            Some(Self::Looks(looks.looks(windows[0], windows[1])?, windows))
        });
        let window = || match windows {
            Some([fast, slow]) if fast == slow => Self::Window(fast),
            _ => Self::Unknown,
        };
        looks.unwrap_or_else(window)
    }

    pub(super) fn looks(&self) -> Option<&Looks> {
        match self {
            Self::Looks(looks, _) => Some(looks),
            _ => None,
        }
    }

    /// Names of the windows.
    pub(super) fn name(&self) -> Option<String> {
        match self {
            Self::Looks(_, [fast, slow]) if fast != slow => {
                Some(format!("{fast} over fast time, {slow} over slow time"))
            }
            Self::Looks(_, [window, _]) | Self::Window(window) => Some(window.to_string()),
            Self::Unknown => None,
        }
    }
}

impl Theory {
    /// Half-power width, if known.
    pub(super) fn width(&self) -> Option<f64> {
        (!self.in_cells).then_some(self.expected.width_3db)
    }

    /// Power relative to the peak at `s`.
    pub(super) fn power(&self, s: f64) -> f64 {
        match &self.curve {
            Curve::Support(projection) => projection.power(s),
            Curve::Window { weights, cell } => transform(weights, s / cell).powi(2),
        }
    }

    /// Legend of the theoretical curve.
    pub(super) fn title(&self) -> &'static str {
        match self.in_cells {
            true => "theory, of this width",
            false => "theory",
        }
    }
}

/// Theory for every cut of a response measured on `grid`, from `looks` or else from the basis's window.
pub(super) fn of_cuts(
    basis: &Basis,
    response: &Response,
    grid: &ImageGrid,
    looks: Option<&Looks>,
) -> Vec<Option<Theory>> {
    let main_lobe_widths = Settings::default().main_lobe_widths;
    let support = looks.map(|looks| looks.at(DVec3::from(response.position_m)));
    let one = |cut: &Cut| match (&support, basis) {
        (Some(support), _) => {
            let projection = support.along(direction(cut, response, grid))?;
            let span = (cut.span[1] - cut.span[0]) / 2.0;
            Some(Theory {
                expected: projection.expected(span, main_lobe_widths)?,
                in_cells: false,
                curve: Curve::Support(Box::new(projection)),
            })
        }
        (None, Basis::Window(window)) => {
            // The span in multiples of the width, converted to cells by the window's own width.
            let weights = window.weights(SAMPLES);
            let width = cut.width_3db?;
            let widths = (cut.span[1] - cut.span[0]) / 2.0 / width;
            let cells = expected(&weights, 8.0, main_lobe_widths)?.width_3db;
            let expected = expected(&weights, widths * cells, main_lobe_widths)?;
            Some(Theory {
                curve: Curve::Window {
                    weights,
                    cell: width / expected.width_3db,
                },
                expected,
                in_cells: true,
            })
        }
        _ => None,
    };
    response.cuts.iter().map(one).collect()
}

/// Displacement of the scene point per unit of distance along a cut.
fn direction(cut: &Cut, response: &Response, grid: &ImageGrid) -> DVec3 {
    let [x, y] = grid.directions(response.row_value, response.column_value);
    let (sin, cos) = response.line_of_sight_rad.unwrap_or(0.0).sin_cos();
    match cut.along {
        Direction::X => x,
        Direction::Y => y,
        Direction::Range => x * cos + y * sin,
        Direction::CrossRange => y * cos - x * sin,
    }
}
