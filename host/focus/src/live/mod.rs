//! Live image: pulses are added one at a time, and the image of those so far is available at any time.
//!
//! Every pulse is backprojected on arrival ([`bp`](super::bp), for a collection of this one pulse) and added to
//! sums in float64,
//!
//! ```text
//! S(p) <- S(p) + sum_k w_fast[k] z[k] exp(+j 2 pi f_k (path(p) - reference_path) / c) / sum_k w_fast[k],   I(p) = S(p) / N
//! ```
//!
//! so that a unit scatterer reads 1 after every pulse. There is no slow-time window, since its weights would require knowledge of the
//! end of the aperture. Use a former on recorded pulses for a windowed image.
//!
//! A pixel is zero as long as its delay lies outside the recorded delays of one of the pulses, as in every image.
//!
//! **The last `M` pulses** ([`Settings::last_pulses`]). The contribution of the pulse that leaves the aperture is computed again, bit-identical,
//! and subtracted. Float64 rounding of additions and subtractions would accumulate; a second set of sums therefore
//! starts at zero, receives every new pulse as well, and replaces the first set once it has `M` pulses. The sums shown have
//! then undergone at most `3 M` roundings of 2^-53 each, of at most `M + 1` pulses' values at a time. With `a` the
//! largest value added to a pixel by any of the last `2 M` pulses, the error of that pixel is at most
//!
//! ```text
//! 3 M (M + 1) 2^-53 a / M = 3 (M + 1) 2^-53 a
//! ```
//!
//! which is -190 dB of the strongest pulse for a million pulses. Pulses older than `2 M` leave no trace, however strong they were.
//!
//! **Cost** of a push, independent of the number of earlier pulses: a `bp` plan for one pulse, backprojection of each pixel, the profile of the
//! pulse, and the exact sum at 64 pixels (8 operations per
//! sample each); twice that with `last_pulses`. Intra-pulse motion costs as much as in `bp`.
//! Reading the image takes one division per pixel.
//!
//! **Memory**, allocated at the start: 28 bytes per pixel, or 56 with `last_pulses` plus 8 per sample of `M`
//! pulses and 264 per pulse; during a push, also the profiles of one pulse.
//!
//! **Accuracy** is that of `bp`, whose upsampling keeps the requested bound: the error of each pulse is planned on arrival, and
//! that of the image is at most the root of their mean square. [`Live::accuracy`] compares the image with the exact sum at 64 of its
//! pixels at any time ([`super::accuracy`]). Float32 rounding is that of one pulse, for any number of pulses.
//! `tests/formers/live.rs` compares the image after every push with `bp` and with an independent sum.

mod settings;
mod sums;

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use rayon::prelude::*;

use super::accuracy::judge;
use super::bp::Backprojection;
use super::compared::Planned;
use super::coverage::Coverage;
use super::exact::{LANES, add_pulse};
use super::sampled::{ComparedPixel, sampled_pixels};
use super::{
    BoundPolicy, ErrorGoal, FormError, GridPoints, ImageFormer, ImageSpec, Judgement,
    SCRATCH_BYTES, TileRecord, Work, rounding,
};
use subaperture_model::geometry::{ImageGrid, SceneFrame};
use subaperture_model::image::{Image, power};
use subaperture_model::monitor::{Monitor, Silent};
use subaperture_model::phase_history::{Collection, InMemory, Pulse, Weights};
use subaperture_signal::phase::narrow;

pub use settings::{LiveError, Settings};
use sums::{Aperture, Part, Ring, Sums};

/// Memory per pixel, bytes: sums with the number of pulses that do not cover it, and the contribution of one pulse.
const PIXEL_BYTES: u64 = 16 + 4 + 8;

/// Image to which pulses are added one at a time; see the example `live` of `subaperture`.
pub struct Live {
    grid: ImageGrid,
    settings: Settings,
    num_samples: usize,
    weights: Weights,
    shown: Sums,
    part: Part,
    aperture: Option<Aperture>,
    /// Indices and positions of the pixels compared with the exact sum.
    sampled: Vec<usize>,
    points: Vec<DVec3>,
    /// Pulse with the largest path rounding so far, and its phase error, radians.
    farthest: Option<(Pulse, f64)>,
}

impl Live {
    /// Make an image without pulses on `grid`, for pulses of `num_samples` each.
    ///
    /// # Errors
    /// [`LiveError::Empty`]; [`LiveError::Memory`] before any allocation.
    pub fn new(
        grid: &ImageGrid,
        num_samples: usize,
        settings: &Settings,
    ) -> Result<Self, LiveError> {
        if grid.num_pixels() == 0 || num_samples == 0 || settings.last_pulses == Some(0) {
            return Err(LiveError::Empty);
        }
        let needed_bytes = needed_bytes(grid, num_samples, settings);
        if needed_bytes > u128::from(settings.memory_bytes) {
            return Err(LiveError::Memory {
                needed_bytes,
                allowed_bytes: settings.memory_bytes,
            });
        }
        let columns = grid.columns.count;
        let sampled = sampled_pixels(grid);
        let points = sampled
            .iter()
            .map(|i| grid.position_m(i / columns, i % columns));
        let num_pixels = grid.num_pixels() as usize;
        Ok(Self {
            grid: grid.clone(),
            settings: *settings,
            num_samples,
            weights: Weights {
                fast: settings.window.weights(num_samples),
                slow: vec![1.0],
                illumination: None,
                windows: None,
            },
            shown: Sums::new(num_pixels, sampled.len()),
            part: Part::new(grid, sampled.len()),
            aperture: settings.last_pulses.map(|num_pulses| Aperture {
                ring: Ring::new(num_pulses, num_samples),
                next: Sums::new(num_pixels, sampled.len()),
                falling_out: Part::new(grid, sampled.len()),
            }),
            points: points.collect(),
            sampled,
            farthest: None,
        })
    }

    /// Add a pulse; the oldest pulse beyond [`Settings::last_pulses`] is removed.
    ///
    /// # Errors
    /// [`LiveError`]; the image is then unchanged.
    pub fn push(&mut self, pulse: &Pulse, samples: &[Complex32]) -> Result<(), LiveError> {
        self.push_watched(pulse, samples, &Silent)
    }

    /// Add a pulse with a monitor that may cancel it.
    ///
    /// # Errors
    /// Errors of [`Self::push`]; [`FormError::Cancelled`] in [`LiveError::Form`].
    pub fn push_watched(
        &mut self,
        pulse: &Pulse,
        samples: &[Complex32],
        monitor: &dyn Monitor,
    ) -> Result<(), LiveError> {
        self.check(pulse, samples)?;
        let bench = Bench {
            grid: &self.grid,
            settings: &self.settings,
            weights: &self.weights,
            points: &self.points,
            monitor,
        };
        // All fallible steps precede any change.
        bench.backproject(pulse, samples, &mut self.part)?;
        let falls_out = self
            .aperture
            .as_ref()
            .is_some_and(|aperture| aperture.ring.is_full());
        if let (Some(aperture), true) = (&mut self.aperture, falls_out) {
            let Aperture {
                ring, falling_out, ..
            } = aperture;
            let (pulse, samples) = ring.oldest(self.num_samples);
            bench.backproject(pulse, samples, falling_out)?;
        }
        let rad = bench.path_phase_rad(pulse);
        if self.farthest.is_none_or(|(_, most)| rad > most) {
            self.farthest = Some((*pulse, rad));
        }
        self.shown.add(1.0, &self.part);
        let Some(aperture) = &mut self.aperture else {
            return Ok(());
        };
        if falls_out {
            self.shown.add(-1.0, &aperture.falling_out);
        }
        aperture.ring.keep(pulse, samples);
        aperture.next.add(1.0, &self.part);
        if aperture.next.count == aperture.ring.num_pulses {
            std::mem::swap(&mut self.shown, &mut aperture.next);
            aperture.next.clear();
        }
        Ok(())
    }

    fn check(&self, pulse: &Pulse, samples: &[Complex32]) -> Result<(), LiveError> {
        if samples.len() != self.num_samples {
            return Err(LiveError::Samples {
                given: samples.len(),
                expected: self.num_samples,
            });
        }
        if let Some(fault) = pulse.fault(self.num_samples) {
            return Err(LiveError::Pulse { fault });
        }
        if !pulse.sweep.is_finite() {
            let fault =
                "expected finite velocities and times of its antennas during the pulse".to_owned();
            return Err(LiveError::Pulse { fault });
        }
        let finite = |z: &Complex32| z.re.is_finite() && z.im.is_finite();
        match samples.iter().position(|z| !finite(z)) {
            Some(sample) => Err(LiveError::NotFinite { sample }),
            None => Ok(()),
        }
    }

    /// Pixel grid of the image.
    pub fn grid(&self) -> &ImageGrid {
        &self.grid
    }

    /// Number of pulses in the image.
    pub fn num_pulses(&self) -> usize {
        self.shown.count
    }

    /// Image of the current pulses, rows and columns as the grid's; a unit scatterer on a pixel reads 1. Zeros before the first pulse.
    pub fn image(&self) -> Image {
        let pixels = (0..self.shown.pixels.len()).into_par_iter();
        Image {
            rows: self.grid.rows.count,
            columns: self.grid.columns.count,
            pixels: (pixels.with_min_len(1 << 12))
                .map(|i| self.pixel(i))
                .collect(),
        }
    }

    /// Planned error, and error measured at the pixels where the exact sum is known; -200 dB before
    /// the first pulse. A measured error above the bound, although every pulse was planned within it, indicates a
    /// dark grid next to a bright scatterer outside it.
    pub fn accuracy(&self) -> Judgement {
        let Some((farthest, _)) = self.farthest else {
            return Judgement {
                planned_db: -200.0,
                measured_db: -200.0,
                outside_db: f64::NEG_INFINITY,
                num_sampled: 0,
                spacing_cells: 0.0,
            };
        };
        let collection = lone(farthest, self.num_samples);
        let spec = ImageSpec::new(&collection, &self.grid, &self.weights);
        let norm = self.norm();
        let fast: f64 = self.weights.fast.iter().sum();
        let seen = self.sampled.iter().zip(&self.shown.exact);
        let seen = seen.map(|(&i, &sum)| {
            let exact = match self.shown.covers(i) {
                true => sum * (norm / fast),
                false => Complex64::ZERO,
            };
            let formed = self.pixel(i);
            ComparedPixel {
                pixel: i,
                formed: [formed.re, formed.im],
                exact: [exact.re, exact.im],
                about: 0.0,
            }
        });
        let record = TileRecord {
            power: (0..self.shown.pixels.len())
                .map(|i| power(self.pixel(i)))
                .sum(),
            seen: seen.collect(),
            terms: self.shown.terms * (norm / fast).powi(2),
            recorded: Default::default(),
            narrow: false,
            // Pulses are not stored, so a second comparison is impossible.
            drawn: Default::default(),
            pending: false,
        };
        // Differences of squares may be negative by rounding; pixels are rounded once more.
        let planned = (self.shown.planned * norm).max(0.0).sqrt();
        let planned_db = rounding::total_db(&[planned, rounding::LARGEST_FLOAT32]);
        judge(&spec, &[record], Planned::of(planned_db), None)
    }

    /// Memory held, bytes, for any number of pulses.
    pub fn held_bytes(&self) -> u128 {
        needed_bytes(&self.grid, self.num_samples, &self.settings)
    }

    /// Pixel values computed per push, for any number of pulses: the image once, and once more where a pulse
    /// is removed.
    pub fn pixels_a_push(&self) -> u64 {
        let times = 1 + u64::from(self.aperture.is_some());
        times * self.grid.num_pixels()
    }

    /// Value of a pixel by its number in the grid; zero where a pulse does not cover it.
    fn pixel(&self, i: usize) -> Complex32 {
        match self.shown.covers(i) {
            true => narrow(self.shown.pixels[i] * self.norm()),
            false => Complex32::ZERO,
        }
    }

    fn norm(&self) -> f64 {
        1.0 / self.shown.count.max(1) as f64
    }
}

/// Memory needed by a live image, bytes.
fn needed_bytes(grid: &ImageGrid, num_samples: usize, settings: &Settings) -> u128 {
    let pixels = u128::from(grid.num_pixels()) * u128::from(PIXEL_BYTES);
    let window = 8 * num_samples as u128;
    match settings.last_pulses {
        None => window + pixels,
        Some(pulses) => {
            let pulse_bytes = 8 * num_samples as u128 + size_of::<Pulse>() as u128;
            window + 2 * pixels + pulses as u128 * pulse_bytes
        }
    }
}

/// Collection of one pulse.
fn lone(pulse: Pulse, num_samples: usize) -> Collection {
    Collection {
        name: "live".to_owned(),
        num_samples,
        pulses: vec![pulse],
        frame: SceneFrame::Local,
        extent: None,
        timed: true,
    }
}

/// Parameters for backprojecting a pulse.
struct Bench<'a> {
    grid: &'a ImageGrid,
    settings: &'a Settings,
    weights: &'a Weights,
    points: &'a [DVec3],
    monitor: &'a dyn Monitor,
}

impl Bench<'_> {
    /// Compute the contribution of a pulse into `part`.
    fn backproject(
        &self,
        pulse: &Pulse,
        samples: &[Complex32],
        part: &mut Part,
    ) -> Result<(), FormError> {
        let collection = lone(*pulse, samples.len());
        let spec = ImageSpec::new(&collection, self.grid, self.weights);
        let former = Backprojection::default().error_db(self.settings.error_db);
        let goal = ErrorGoal {
            bound_db: former.bound_db(),
            bound_policy: BoundPolicy::Refused,
        };
        let decision = former.decide(&spec, &goal, self.monitor)?;
        let history = InMemory::new(collection.clone(), samples.to_vec())?;
        let work = Work {
            history: &history,
            memory_bytes: SCRATCH_BYTES,
            monitor: self.monitor,
        };
        part.tile.pixels.fill(Complex32::ZERO);
        let tiles = std::slice::from_mut(&mut part.tile);
        former.open(spec, &decision.choices)?.form(&work, tiles)?;
        part.tile.check_finite(self.grid)?;
        let coverage = Coverage::new(spec, GridPoints::Positions);
        coverage.fill(&mut part.tile, Complex32::new(f32::NAN, f32::NAN));
        part.planned = 10f64.powf(decision.planned_db / 10.0);
        let weighted = samples.iter().zip(&self.weights.fast);
        part.terms = weighted.map(|(&z, w)| w * w * power(z)).sum();
        part.exact.fill(Complex64::ZERO);
        let lanes = part.exact.chunks_mut(LANES).zip(self.points.chunks(LANES));
        for (sums, points) in lanes {
            add_pulse(pulse, 1.0, &self.weights.fast, samples, points, sums);
        }
        Ok(())
    }

    /// Phase error from rounding of a pulse's paths, radians.
    fn path_phase_rad(&self, pulse: &Pulse) -> f64 {
        let collection = lone(*pulse, self.weights.fast.len());
        rounding::path_phase_rad(&collection, self.grid)
    }
}

#[cfg(test)]
mod tests;
