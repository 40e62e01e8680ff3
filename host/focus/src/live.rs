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

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use rayon::prelude::*;

use super::accuracy::judge;
use super::bp::Backprojection;
use super::exact::{LANES, add_pulse};
use super::sampled::{Seen, sampled_pixels};
use super::{
    Aim, Asked, DEFAULT_ERROR_DB, FormError, ImageFormer, Judgement, Misses, SCRATCH_BYTES, Tile,
    TileRecord, Work, machine, rounding,
};
use subaperture_model::geometry::{ImageGrid, SceneFrame};
use subaperture_model::image::{Image, power};
use subaperture_model::monitor::{Monitor, Silent};
use subaperture_model::phase_history::{Collection, InMemory, Pulse, Weights};
use subaperture_model::quantity::bytes;
use subaperture_signal::phase::narrow;
use subaperture_signal::window::Window;

/// Bytes a pixel: of the sums, and of what one pulse adds.
const PIXEL_BYTES: u64 = 16 + 8;

/// How a live image is made.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Settings {
    /// Bound on the relative RMS error of the image, dB (negative).
    pub error_db: f64,
    /// Window over fast time.
    pub window: Window,
    /// Pulses that the image is of: the last so many. All so far, if `None`.
    pub last_pulses: Option<usize>,
    /// Bytes that it may hold; a pulse that is added takes up to 48 MiB besides.
    pub memory_bytes: u64,
}

impl Default for Settings {
    /// -60 dB, Taylor's window of 35 dB, all pulses, half of the machine's memory.
    fn default() -> Self {
        Self {
            error_db: DEFAULT_ERROR_DB,
            window: Window::default(),
            last_pulses: None,
            memory_bytes: machine::default_bytes(),
        }
    }
}

impl Settings {
    /// With this bound on the relative RMS error, dB (negative).
    #[must_use]
    pub fn error_db(self, error_db: f64) -> Self {
        Self { error_db, ..self }
    }

    /// With this window over fast time.
    #[must_use]
    pub fn window(self, window: Window) -> Self {
        Self { window, ..self }
    }

    /// Of the last so many pulses.
    #[must_use]
    pub fn last_pulses(self, count: usize) -> Self {
        let last_pulses = Some(count);
        Self {
            last_pulses,
            ..self
        }
    }

    /// Within so many bytes.
    #[must_use]
    pub fn memory_bytes(self, memory_bytes: u64) -> Self {
        Self {
            memory_bytes,
            ..self
        }
    }
}

/// Why there is no live image, or why a pulse was not added. The image is as it was before.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LiveError {
    /// No pixels, no samples, or an aperture of no pulses.
    #[error("a live image needs pixels, samples and an aperture of at least one pulse")]
    Empty,
    /// It does not fit the memory allowed.
    #[error("a live image needs {} of the {} allowed", bytes(*needed_bytes), bytes((*allowed_bytes).into()))]
    Memory {
        /// Bytes needed.
        needed_bytes: u128,
        /// Bytes allowed.
        allowed_bytes: u64,
    },
    /// A pulse of another number of samples.
    #[error("the pulse has {given} samples, and pulses of this image have {expected}")]
    Samples {
        /// Its samples.
        given: usize,
        /// Those of every pulse.
        expected: usize,
    },
    /// A number that no radar has measured.
    #[error("the pulse is none: {what}")]
    Pulse {
        /// What is wrong with it.
        what: String,
    },
    /// A sample is NaN or infinite.
    #[error("sample {sample} of the pulse is not a finite number")]
    NotFinite {
        /// Its index, from 0.
        sample: usize,
    },
    /// The pulse was not backprojected: its error would be above the bound, it needs more memory, or the monitor
    /// asked to stop.
    #[error(transparent)]
    Form(#[from] FormError),
}

/// Sums over pulses, and how many they are of.
struct Sums {
    pixels: Vec<Complex64>,
    /// The exact sum at some pixels.
    exact: Vec<Complex64>,
    /// Of the weighted samples' squares.
    terms: f64,
    /// Of the planned errors' squares.
    planned: f64,
    count: usize,
}

impl Sums {
    fn new(num_pixels: usize, num_sampled: usize) -> Self {
        Self {
            pixels: vec![Complex64::ZERO; num_pixels],
            exact: vec![Complex64::ZERO; num_sampled],
            terms: 0.0,
            planned: 0.0,
            count: 0,
        }
    }

    fn clear(&mut self) {
        self.pixels.fill(Complex64::ZERO);
        self.exact.fill(Complex64::ZERO);
        (self.terms, self.planned, self.count) = (0.0, 0.0, 0);
    }

    /// Adds what a pulse adds, or takes it off again where `sign` is -1.
    fn add(&mut self, sign: f64, part: &Part) {
        let both = self.pixels.par_iter_mut().zip(&part.tile.pixels);
        both.with_min_len(1 << 12).for_each(|(sum, z)| {
            *sum += Complex64::new(z.re.into(), z.im.into()) * sign;
        });
        let both = self.exact.iter_mut().zip(&part.exact);
        both.for_each(|(sum, value)| *sum += value * sign);
        self.terms += part.terms * sign;
        self.planned += part.planned * sign;
        self.count = self.count.saturating_add_signed(sign as isize);
    }
}

/// What a pulse adds to [`Sums`].
struct Part {
    tile: Tile,
    exact: Vec<Complex64>,
    terms: f64,
    planned: f64,
}

impl Part {
    fn new(grid: &ImageGrid, num_sampled: usize) -> Self {
        Self {
            tile: Tile::whole(grid),
            exact: vec![Complex64::ZERO; num_sampled],
            terms: 0.0,
            planned: 0.0,
        }
    }
}

/// The last pulses, and the sums that will take the place of those shown.
struct Aperture {
    ring: Ring,
    next: Sums,
    falling_out: Part,
}

/// Pulses of which the oldest gives way to the newest.
struct Ring {
    num_pulses: usize,
    pulses: Vec<Pulse>,
    samples: Vec<Complex32>,
    /// Where the next one goes: of a full ring, the oldest's place.
    place: usize,
}

impl Ring {
    fn new(num_pulses: usize, num_samples: usize) -> Self {
        Self {
            num_pulses,
            pulses: Vec::with_capacity(num_pulses),
            samples: Vec::with_capacity(num_pulses * num_samples),
            place: 0,
        }
    }

    fn is_full(&self) -> bool {
        self.pulses.len() == self.num_pulses
    }

    /// The oldest pulse, where it is full.
    fn oldest(&self, num_samples: usize) -> (&Pulse, &[Complex32]) {
        let first = self.place * num_samples;
        (
            &self.pulses[self.place],
            &self.samples[first..first + num_samples],
        )
    }

    fn keep(&mut self, pulse: &Pulse, samples: &[Complex32]) {
        if self.is_full() {
            let first = self.place * samples.len();
            self.pulses[self.place] = *pulse;
            self.samples[first..first + samples.len()].copy_from_slice(samples);
        } else {
            self.pulses.push(*pulse);
            self.samples.extend_from_slice(samples);
        }
        self.place = (self.place + 1) % self.num_pulses;
    }
}

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
            grid: *grid,
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
        rounding::path_phase_rad(&aim(&collection, self.grid, self.weights))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use subaperture_model::phase_history::Sweep;

    /// What is really allocated, counted from the vectors, before and after many pulses.
    #[test]
    fn no_vector_grows() {
        let grid: ImageGrid = "x=-4:4:1,y=-4:4:1,z=0".parse().unwrap();
        let settings = Settings::default().last_pulses(5);
        let mut live = Live::new(&grid, 16, &settings).unwrap();
        let allocated = |live: &Live| {
            let aperture = live.aperture.as_ref().unwrap();
            let sums = [&live.shown, &aperture.next].map(|sums| 16 * sums.pixels.capacity());
            let parts = [&live.part, &aperture.falling_out];
            let parts = parts.map(|part| 8 * part.tile.pixels.capacity());
            let ring = 8 * aperture.ring.samples.capacity()
                + size_of::<Pulse>() * aperture.ring.pulses.capacity();
            let window = 8 * live.weights.fast.capacity();
            (sums.iter().chain(&parts).sum::<usize>() + ring + window) as u128
        };
        // All but the few that are compared with the exact sum.
        assert_eq!(allocated(&live), live.held_bytes());
        for n in 0..40 {
            let antenna_m = DVec3::new(f64::from(n), -100.0, 0.0);
            let pulse = Pulse {
                time_s: f64::from(n),
                transmitter_m: antenna_m,
                receiver_m: antenna_m,
                reference_m: DVec3::ZERO,
                reference_path_m: 2.0 * antenna_m.length(),
                start_hz: 1e9,
                step_hz: 5e6,
                sweep: Sweep::AT_ONCE,
            };
            live.push(&pulse, &[Complex32::ONE; 16]).unwrap();
            assert_eq!(allocated(&live), live.held_bytes(), "{n}");
            assert_eq!(live.num_pulses(), 5.min(n as usize + 1));
        }
    }
}
