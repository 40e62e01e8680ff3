//! Map drift autofocus: phase errors from the relative shifts of sub-aperture looks.
//!
//! A phase error `phi(n)` shifts the image of a short look at `n_j` in cross-range by `d_j`, such that the slopes of path and phase cancel:
//! `phi'(n_j) + k g'(n_j) d_j = 0`, with the wavenumber `k` in radians per metre and the derivative `g` of the path by cross-range. Between
//! neighbouring looks therefore
//!
//! ```text
//! phi'(n_(j+1)) - phi'(n_j) = -k g' (d_(j+1) - d_j)
//! ```
//!
//! The right side is measured by correlation of the magnitudes of the look images, from any former
//! ([`subaperture_quality::registration`]). The left side is a polynomial of degree `L` for `L` looks, whose constant and slope only
//! shift the image. Two looks determine the quadratic term, the effect of an error of the along-track velocity. More
//! looks determine higher terms less accurately, as shorter looks have coarser resolution.
//!
//! Neglected: differences of the shift over the scene (near range), and phase errors within a look other than the polynomial. All
//! channels have the same phase in a turn. Cost of a round: the looks together cost one image, plus their transforms, 48 bytes per pixel.

use std::ops::Range;

use glam::DVec3;

use subaperture_focus::{FormError, Task};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::Image;
use subaperture_model::phase_history::{PhaseHistory, PulseRange, Weights};
use subaperture_quality::registration::offset;
use subaperture_signal::dense::solve;

use super::centring::cross_range;
use super::correction::Correction;
use super::echoes::{Echo, Points, brightest, gradients, wavenumber_rad_m};
use super::measure::Quiet;
use super::rounds::{Method, RoundInput, SharpenError};

/// Map drift autofocus: a polynomial phase from relative shifts of looks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MapDrift {
    /// Number of looks and degree of the polynomial: 2 or more.
    pub looks: usize,
}

impl Default for MapDrift {
    fn default() -> Self {
        Self { looks: 2 }
    }
}

/// Least number of pulses per look.
const MIN_PULSES: usize = 4;

impl Method for MapDrift {
    fn name(&self) -> &'static str {
        "map-drift"
    }

    fn first_rounds(&self, _turns: usize) -> usize {
        2
    }

    fn propose(&self, look: &RoundInput) -> Result<Option<Correction>, SharpenError> {
        let collection = look.history.collection();
        let (grid, turns) = (look.subject.grid, collection.num_turns());
        if !look.kept {
            // Another round would give the same estimate.
            return Ok(None);
        }
        let looks = self.looks.max(2);
        if turns < MIN_PULSES * looks {
            return Err(SharpenError::TooShort {
                method: self.name(),
                needed: MIN_PULSES * looks,
                pulses: turns,
            });
        }
        look.room(
            "images of looks",
            (8 * looks as u64 + 48) * grid.num_pixels(),
        )?;
        let only = Points {
            most: 1,
            within_db: 0.0,
        };
        let Some(&place_m) = brightest(collection, grid, look.image, only).first() else {
            return Err(SharpenError::Dark);
        };
        let Some(slopes) = slopes(look, place_m) else {
            return Ok(None);
        };
        let spans: Vec<Range<usize>> = (0..looks)
            .map(|j| j * turns / looks..(j + 1) * turns / looks)
            .collect();
        let images = spans
            .iter()
            .map(|span| image_of(look, span.clone(), looks))
            .collect::<Result<Vec<_>, _>>()?;
        // Powers 2 to L of a variable from -1 to 1 over the aperture.
        let scale = 2.0 / turns as f64;
        let place = |n: usize| (n as f64 + 0.5) * scale - 1.0;
        let slope_of = |power: usize, span: &Range<usize>| {
            let at = |n: usize| power as f64 * scale * place(n).powi(power as i32 - 1);
            span.clone().map(at).sum::<f64>() / span.len() as f64
        };
        let (mut matrix, mut right) = (Vec::new(), Vec::new());
        for j in 0..looks - 1 {
            let Ok(shift) = offset(&images[j + 1], &images[j]) else {
                return Ok(None);
            };
            let drift = slopes.at(grid, place_m, [shift.rows, shift.columns]);
            right.push(-drift);
            let powers = 2..=looks;
            matrix.extend(powers.map(|p| slope_of(p, &spans[j + 1]) - slope_of(p, &spans[j])));
        }
        let Some(terms) = solve(&matrix, &right) else {
            return Ok(None);
        };
        let phase = |n: usize| -> f64 {
            let each = terms.iter().zip(2..);
            each.map(|(term, power)| term * place(n).powi(power)).sum()
        };
        let error_rad = (0..collection.pulses.len())
            .map(|n| phase(n % turns))
            .collect();
        Ok(Some(Correction::Phase { error_rad }))
    }
}

/// Relation of phase rate and cross-range shift.
struct Slopes {
    across: DVec3,
    /// Phase rate per shift, radians per pulse and metre.
    rad_m: f64,
}

impl Slopes {
    /// Phase rate, radians per pulse, of a shift in pixels.
    fn at(&self, grid: &ImageGrid, place_m: DVec3, [rows, columns]: [f64; 2]) -> f64 {
        let [row, column] = grid.coordinates(place_m);
        let [by_column, by_row] = grid.directions(row, column);
        let moved_m = by_row * (rows * grid.rows.step) + by_column * (columns * grid.columns.step);
        moved_m.dot(self.across) * self.rad_m
    }
}

fn slopes(look: &RoundInput, place_m: DVec3) -> Option<Slopes> {
    let collection = look.history.collection();
    let turns = collection.num_turns();
    let echo = Echo {
        point: 0,
        first: 0,
        values: vec![Default::default(); turns],
    };
    let (across, _) = cross_range(collection, look.subject.grid, &echo, place_m)?;
    let along: Vec<f64> = gradients(collection, &echo, place_m)
        .iter()
        .map(|gradient| gradient.dot(across))
        .collect();
    // By least squares over the pulses.
    let middle = (turns - 1) as f64 / 2.0;
    let sums = along.iter().enumerate().fold([0.0; 2], |[a, b], (n, g)| {
        let u = n as f64 - middle;
        [a + u * g, b + u * u]
    });
    let rad_m = wavenumber_rad_m(collection, &collection.pulses[turns / 2]) * sums[0] / sums[1];
    (rad_m.is_finite() && rad_m != 0.0).then_some(Slopes { across, rad_m })
}

/// Image of one of `looks` looks, from the first channel.
fn image_of(look: &RoundInput, span: Range<usize>, looks: usize) -> Result<Image, FormError> {
    let subject = look.subject;
    // Memory of the best image, the previous one, and the looks.
    let held_bytes = (looks as u64 + 2) * 8 * subject.grid.num_pixels();
    let stretch = PulseRange::new(look.history, span);
    let [fast, slow] = subject.windows;
    let task = Task {
        history: &stretch,
        grid: subject.grid,
        weights: &Weights::new(stretch.collection(), fast, slow),
        memory_bytes: subject.memory_bytes.saturating_sub(held_bytes),
        monitor: &Quiet(subject.monitor),
        numerics: Default::default(),
    };
    let mut image = subject.former.form_planned(&task)?.image;
    if look.holds_out() {
        for (index, pixel) in image.pixels.iter_mut().enumerate() {
            let place_m = subject
                .grid
                .position_m(index / image.columns, index % image.columns);
            if !look.uses(place_m) {
                *pixel = Default::default();
            }
        }
    }
    Ok(image)
}
