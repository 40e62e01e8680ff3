//! A live image: pulses come one at a time, and the image of those so far is there at any moment.
//!
//! Every pulse is backprojected as it comes ([`bp`](super::bp), of a collection of this one pulse) and added to
//! sums in float64,
//!
//! ```text
//! S(p) <- S(p) + sum_k w_fast[k] z[k] exp(+j 2 pi f_k (path(p) - reference_path) / c) / sum_k w_fast[k],   I(p) = S(p) / N
//! ```
//!
//! so that a unit scatterer reads 1 after every pulse. Slow time has no window: its weights would have to know where the
//! aperture ends. A tapered image is formed of recorded pulses, by a former.
//!
//! **The last `M` pulses** ([`Settings::last_pulses`]). What the pulse that falls out had added is computed again, to the
//! same bits, and taken off. What adding and taking off round in float64 would stay for ever; so a second set of sums
//! begins at zero, takes every new pulse too, and once it has `M` of them takes the first one's place. The sums shown have
//! then been through at most `3 M` roundings of 2^-53 each, of at most `M + 1` pulses' values at a time: with `a` the
//! largest value that any of the last `2 M` pulses added to a pixel, that pixel is off by at most
//!
//! ```text
//! 3 M (M + 1) 2^-53 a / M = 3 (M + 1) 2^-53 a
//! ```
//!
//! -190 dB of the strongest pulse for a million pulses; what is older than `2 M` pulses leaves no trace, however strong it was.
//!
//! **Cost** of a push, however many came before: a plan of `bp`'s for the one pulse, what that takes for each pixel and for the pulse's
//! profile, and 64 pixels of the exact sum (8 operations a
//! sample each); twice that with `last_pulses`. Of a pulse whose samples are taken one after another in motion, what `bp` says
//! of such. An image is a division a pixel.
//!
//! **Memory**, all of it taken at the beginning: 24 bytes a pixel, 48 with `last_pulses` and then 8 a sample of `M`
//! pulses and 240 a pulse; and while a pulse is added that of its profiles.
//!
//! **Accuracy** is that of `bp`, whose upsampling keeps the bound that is asked: each pulse's error is planned as it comes, and
//! the image's is at most the root of their mean square. At any time [`Live::accuracy`] compares the image with the exact sum at 64 of its
//! pixels, as the contract has it ([`super::accuracy`]). Rounding is float32's of one pulse, whatever their number.
//! `tests/formers/live.rs` holds the image after every push against `bp` and against a sum of its own.

mod settings;
mod sums;

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use rayon::prelude::*;

use super::accuracy::judge;
use super::bp::Backprojection;
use super::exact::{LANES, add_pulse};
use super::sampled::{Seen, sampled_pixels};
use super::{
    Aim, Asked, FormError, ImageFormer, Judgement, Misses, SCRATCH_BYTES, TileRecord, Work,
    rounding,
};
use subaperture_model::geometry::{ImageGrid, SceneFrame};
use subaperture_model::image::{Image, power};
use subaperture_model::monitor::{Monitor, Silent};
use subaperture_model::phase_history::{Collection, InMemory, Pulse, Weights};
use subaperture_signal::phase::narrow;

pub use settings::{LiveError, Settings};
use sums::{Aperture, Part, Ring, Sums};

/// Bytes a pixel: of the sums, and of what one pulse adds.
const PIXEL_BYTES: u64 = 16 + 8;

/// An image that pulses are added to one at a time: the example `live` of `subaperture` shows it at work.
pub struct Live {
    grid: ImageGrid,
    settings: Settings,
    num_samples: usize,
    weights: Weights,
    shown: Sums,
    part: Part,
    aperture: Option<Aperture>,
    /// Indices of the pixels that are compared with the exact sum, and where they lie.
    sampled: Vec<usize>,
    points: Vec<DVec3>,
    /// Of all pulses so far the one whose paths are rounded most, with that, radians.
    farthest: Option<(Pulse, f64)>,
}

impl Live {
    /// An image of no pulses on `grid`, of pulses of `num_samples` each.
    ///
    /// # Errors
    /// [`LiveError::Empty`]; [`LiveError::Memory`] before anything is taken.
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

    /// Adds a pulse; of more than [`Settings::last_pulses`] the oldest falls out.
    ///
    /// # Errors
    /// [`LiveError`], of which the image does not know afterwards.
    pub fn push(&mut self, pulse: &Pulse, samples: &[Complex32]) -> Result<(), LiveError> {
        self.push_watched(pulse, samples, &Silent)
    }

    /// [`Self::push`] with someone who may stop it.
    ///
    /// # Errors
    /// As [`Self::push`]; [`FormError::Cancelled`] in [`LiveError::Form`].
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
        // All that can fail comes before anything is changed.
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
        if let Some(what) = pulse.fault(self.num_samples) {
            return Err(LiveError::Pulse { what });
        }
        if !pulse.sweep.is_finite() {
            let what = "how its antennas move while it lasts is not of finite numbers".to_owned();
            return Err(LiveError::Pulse { what });
        }
        let finite = |z: &Complex32| z.re.is_finite() && z.im.is_finite();
        match samples.iter().position(|z| !finite(z)) {
            Some(sample) => Err(LiveError::NotFinite { sample }),
            None => Ok(()),
        }
    }

    /// The pixels.
    pub fn grid(&self) -> &ImageGrid {
        &self.grid
    }

    /// Pulses that the image is of.
    pub fn num_pulses(&self) -> usize {
        self.shown.count
    }

    /// The image of these: rows and columns as the grid's; a unit scatterer on a pixel reads 1. Zeros before the first.
    pub fn image(&self) -> Image {
        let norm = self.norm();
        let pixels = self.shown.pixels.par_iter().with_min_len(1 << 12);
        Image {
            rows: self.grid.rows.count,
            columns: self.grid.columns.count,
            pixels: pixels.map(|sum| narrow(sum * norm)).collect(),
        }
    }

    /// How far it errs, as it was planned and as it shows at the pixels where the exact sum is known. Nothing is known before
    /// the first pulse: -200 dB. One that is above the bound asked, though no pulse was planned so, says that the grid is
    /// dark beside something bright that it leaves out.
    pub fn accuracy(&self) -> Judgement {
        let Some((farthest, _)) = self.farthest else {
            return Judgement {
                planned_db: -200.0,
                measured_db: -200.0,
                num_sampled: 0,
            };
        };
        let collection = lone(farthest, self.num_samples);
        let aim = aim(&collection, &self.grid, &self.weights);
        let norm = self.norm();
        let fast: f64 = self.weights.fast.iter().sum();
        let pixel = |pixel: usize| narrow(self.shown.pixels[pixel] * norm);
        let seen = self.sampled.iter().zip(&self.shown.exact);
        let seen = seen.map(|(&i, &sum)| {
            let (formed, exact) = (pixel(i), sum * (norm / fast));
            Seen {
                pixel: i,
                formed: [formed.re, formed.im],
                exact: [exact.re, exact.im],
            }
        });
        let record = TileRecord {
            power: (0..self.shown.pixels.len()).map(|i| power(pixel(i))).sum(),
            seen: seen.collect(),
            terms: self.shown.terms * (norm / fast).powi(2),
            narrow: false,
        };
        // Squares may have been taken off to a rounding; pixels are rounded once more.
        let planned = (self.shown.planned * norm).max(0.0).sqrt();
        let planned_db = rounding::total_db(&[planned, rounding::LARGEST_FLOAT32]);
        judge(&aim, &[record], planned_db)
    }

    /// Bytes held, however many pulses there were.
    pub fn held_bytes(&self) -> u128 {
        needed_bytes(&self.grid, self.num_samples, &self.settings)
    }

    /// Pixels that a push computes a value for, however many pulses there were: those of the image, and once more where a pulse
    /// falls out.
    pub fn pixels_a_push(&self) -> u64 {
        let times = 1 + u64::from(self.aperture.is_some());
        times * self.grid.num_pixels()
    }

    fn norm(&self) -> f64 {
        1.0 / self.shown.count.max(1) as f64
    }
}

/// Bytes that a live image holds.
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

/// A collection of one pulse.
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

fn aim<'a>(collection: &'a Collection, grid: &'a ImageGrid, weights: &'a Weights) -> Aim<'a> {
    Aim {
        collection,
        grid,
        weights,
        scratch_bytes: SCRATCH_BYTES,
        means: Default::default(),
    }
}

/// What a pulse is backprojected with.
struct Bench<'a> {
    grid: &'a ImageGrid,
    settings: &'a Settings,
    weights: &'a Weights,
    points: &'a [DVec3],
    monitor: &'a dyn Monitor,
}

impl Bench<'_> {
    /// What a pulse adds, into `part`.
    fn backproject(
        &self,
        pulse: &Pulse,
        samples: &[Complex32],
        part: &mut Part,
    ) -> Result<(), FormError> {
        let collection = lone(*pulse, samples.len());
        let aim = aim(&collection, self.grid, self.weights);
        let former = Backprojection::default().error_db(self.settings.error_db);
        let asked = Asked {
            bound_db: former.bound_db(),
            misses: Misses::Refused,
        };
        let decision = former.decide(&aim, &asked, self.monitor)?;
        let history = InMemory::new(collection.clone(), samples.to_vec())?;
        let work = Work {
            history: &history,
            memory_bytes: SCRATCH_BYTES,
            monitor: self.monitor,
        };
        part.tile.pixels.fill(Complex32::ZERO);
        let tiles = std::slice::from_mut(&mut part.tile);
        former.open(aim, &decision.choices)?.form(&work, tiles)?;
        part.tile.check_finite(self.grid)?;
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

    /// How much the rounding of a pulse's paths turns its phases, radians.
    fn path_phase_rad(&self, pulse: &Pulse) -> f64 {
        let collection = lone(*pulse, self.weights.fast.len());
        rounding::path_phase_rad(&collection, self.grid)
    }
}

#[cfg(test)]
mod tests;
