//! Backprojection: every pulse's range profile read at every pixel's range.
//!
//! ```text
//! I(p) = sum_n w_slow[n] exp(+j 2 pi f_c r_n(p) / c) profile_n(r_n(p)),   r_n(p) = path_n(p) - reference_path_n
//! ```
//!
//! (Schone 2020, chapter 2 and 5.1), with `f_c` the frequency of sample `K/2`. Profiles are upsampled
//! by zero padding, emphasised for linear interpolation ([`RangeProfiler`]), in float32; ranges and
//! phases are float64.
//!
//! Neglected: nothing but interpolation, whose error the upsampling is chosen for (`error_db`).
//! Each pulse's own positions and frequencies are used, so any track will do.
//!
//! **Motion from sample to sample** ([`subaperture_model::phase_history::Sweep`], whose terms these are) shifts a pixel's range
//! profile by `f_c r' / step`, which is added to the range that is read, and blurs it by the phase
//! `2 pi q d^2`, `q = (step r' + f_c r'' / 2) / c` turns, `d = k - K/2`. Profiles are made for even steps of `q` and read
//! linearly between the two nearest: the error of a sample at the band's edge is `h^2 / sqrt(120)`, `h` the step
//! there in radians. The term in `d^3` is neglected and predicted.
//!
//! Cost: a square root, a sine and cosine and about 20 operations a pixel and pulse; one transform a
//! pulse; with motion from sample to sample twice as much, and a transform for each step of `q` (`cost`). Memory: a
//! block of upsampled profiles beside the image.
//!
//! Accuracy: the bound asked for, against [`crate::exact`], on the simulated and the recorded scenes of
//! the tests.

mod blurs;
mod cost;

use glam::DVec3;
use num_complex::Complex32;
use rayon::prelude::*;
use serde_json::json;

use self::blurs::Blurs;
use super::options::ERROR_DB;
use super::{Entry, of};
use crate::budget::Budget;
use crate::former::{chosen, misfit};
use crate::patch::PatchSize;
use crate::pixels::for_each_run;
use crate::{
    Aim, Asked, DEFAULT_ERROR_DB, Decision, FormError, Forming, ImageFormer, MARGIN_DB, Reason,
    Remedy, Tile, Work, rounding,
};
use subaperture_kernels::backprojection::{self, Blurred, Scale};
use subaperture_kernels::paths::{Antennas, Points};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::{PathTerms, Pulse};
use subaperture_signal::range_profile::RangeProfiler;

/// Pulses whose terms of a pixel are summed before they are added to it, if scratch has room for their profiles: a choice of
/// the plan, so that memory is no matter of bits.
const SUMMED_PULSES: usize = 16;
/// Finest upsampling: -120 dB take a thousand, and float32 leaves no less than some -140.
const MOST_OVERSAMPLING: f64 = 4096.0;
/// Of these sums, as many as are made at a time.
const MOST_PARTS: usize = 4;

/// Backprojection with upsampled range profiles.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Backprojection {
    /// Bound on the relative RMS error of the image, dB (negative).
    pub error_db: f64,
}

/// What one pulse contributes with, beside its profiles.
struct Source<'a> {
    pulse: &'a Pulse,
    antennas: Antennas,
    scale: Scale,
    /// What phases are referred to, and how that changes from sample to sample.
    reference: PathTerms,
    /// `f_c / step`: samples by which a rate of a metre a sample shifts range, in metres.
    coupling: f64,
}

/// What the points of a grid are.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Meaning {
    /// Places of what rests.
    Places,
    /// Velocities of what is at a place at a moment: metres a second where images have metres.
    Velocities { position_m: DVec3, epoch_s: f64 },
}

impl Meaning {
    /// Place and velocity at the moment of a pulse, metres and metres a second, for a point of the grid.
    fn target(&self, pulse: &Pulse, point: DVec3) -> (DVec3, DVec3) {
        match *self {
            Self::Places => (point, DVec3::ZERO),
            Self::Velocities {
                position_m,
                epoch_s,
            } => (position_m + point * (pulse.time_s - epoch_s), point),
        }
    }
}

/// One thread's buffers, for a run of pixels.
#[derive(Default)]
struct Scratch {
    sums: Vec<Complex32>,
    /// Places at a pulse of what moves.
    moved: Points,
    blurred: Vec<Blurred>,
}

impl Default for Backprojection {
    fn default() -> Self {
        Self {
            error_db: DEFAULT_ERROR_DB,
        }
    }
}

impl Backprojection {
    /// With this bound on the relative RMS error of the image, dB (negative).
    #[must_use]
    pub fn error_db(self, error_db: f64) -> Self {
        Self { error_db }
    }
}

/// In the list of formers.
pub(super) const ENTRY: Entry = Entry {
    name: "bp",
    summary: "backprojection: every pulse's range profile read at every pixel",
    options: &[ERROR_DB],
    of: of::<Backprojection>,
};

impl ImageFormer for Backprojection {
    fn name(&self) -> &'static str {
        ENTRY.name
    }

    fn settings(&self) -> serde_json::Value {
        serde_json::json!(self)
    }

    fn bound_db(&self) -> Option<f64> {
        Some(self.error_db)
    }

    fn follows_sweeps(&self) -> bool {
        true
    }

    fn planning_for(&self, error_db: f64) -> Option<Box<dyn ImageFormer>> {
        Some(Box::new(Self { error_db }))
    }

    fn decide(&self, aim: &Aim, asked: &Asked, _: &dyn Monitor) -> Result<Decision, FormError> {
        decide(aim, self.error_db, asked, Meaning::Places)
    }

    fn open<'a>(
        &self,
        aim: Aim<'a>,
        choices: &serde_json::Value,
    ) -> Result<Box<dyn Forming + 'a>, FormError> {
        open(aim, chosen(ENTRY.name, choices)?, Meaning::Places)
    }
}

/// What a plan fixes.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub(crate) struct Choices {
    /// Upsampling of range profiles.
    oversampling: f64,
    /// Profiles for motion from sample to sample, if there is any.
    blurs: Option<Blurs>,
    /// Pulses whose terms of a pixel are summed before they are added to it.
    summed_pulses: usize,
}

/// Bytes of a pulse and its upsampled profiles.
fn pulse_bytes(num_samples: usize, each: usize, length: usize) -> u64 {
    8 * (num_samples + each * (length + 1)) as u64
}

/// Decides for a grid of this meaning.
pub(crate) fn decide(
    aim: &Aim,
    error_db: f64,
    asked: &Asked,
    meaning: Meaning,
) -> Result<Decision, FormError> {
    let collection = aim.collection;
    let (num_samples, num_pulses) = (collection.num_samples, collection.pulses.len());
    let sweeps = collection.sweeps();
    // Half of the error's power for either interpolation, where there are two.
    let share_db = error_db - MARGIN_DB - if sweeps { 10.0 * 2f64.log10() } else { 0.0 };
    let oversampling = RangeProfiler::oversampling_for(share_db).min(MOST_OVERSAMPLING);
    let (blurs, blurs_error) = match sweeps {
        true => Blurs::new(aim, share_db, meaning),
        false => (None, 0.0),
    };
    let profiler = RangeProfiler::new(&aim.weights.fast, oversampling);
    let each = blurs.as_ref().map_or(1, |blurs| blurs.count);
    let fit = aim.scratch_bytes / pulse_bytes(num_samples, each, profiler.length());
    let summed_pulses = fit.clamp(1, SUMMED_PULSES as u64) as usize;
    let planned_db = rounding::total_db(&[
        profiler.error(),
        blurs_error,
        profiler.rounding(),
        // Sums over some pulses, and over these sums.
        rounding::sum(summed_pulses),
        rounding::sum(num_pulses.div_ceil(summed_pulses)),
        rounding::path_phase_rad(aim),
    ]);
    asked.check(planned_db, || {
        Reason::new("float32 sums and profiles leave no less")
            .helped_by(&[Remedy::OtherFormer(&["exact"])])
    })?;
    let choices = Choices {
        oversampling,
        blurs,
        summed_pulses,
    };
    Ok(Decision {
        choices: json!(choices),
        settings: json!({
            "profile_length": profiler.length(),
            "oversampling": profiler.length() as f64 / num_samples as f64,
            "profiles_each": each,
            "pulses_a_sum": summed_pulses,
        }),
        planned_db,
        grain: PatchSize::PIXEL,
        cost: cost::cost(aim, profiler.length(), each, summed_pulses),
    })
}

/// Ready to form by `choices`.
pub(crate) fn open<'a>(
    aim: Aim<'a>,
    choices: Choices,
    meaning: Meaning,
) -> Result<Box<dyn Forming + 'a>, FormError> {
    choices.check(&aim)?;
    // Normalised here, before the transform sums: large samples stay within float32.
    let norm = aim.weights.normalisation();
    let window: Vec<f64> = aim.weights.fast.iter().map(|w| w * norm).collect();
    Ok(Box::new(Opened {
        profiler: RangeProfiler::new(&window, choices.oversampling),
        aim,
        choices,
        meaning,
    }))
}

impl Choices {
    /// Refuses what no decision came to.
    fn check(&self, aim: &Aim) -> Result<(), FormError> {
        let num_samples = aim.collection.num_samples;
        let blurs = self.blurs.is_none_or(|blurs| blurs.suit(num_samples));
        let profiles = (1.0..=MOST_OVERSAMPLING).contains(&self.oversampling);
        let sums = (1..=SUMMED_PULSES).contains(&self.summed_pulses);
        match profiles && blurs && sums {
            true => Ok(()),
            false => Err(misfit(
                ENTRY.name,
                "its range profiles or its sums are none",
            )),
        }
    }

    fn profiles_each(&self) -> usize {
        self.blurs.as_ref().map_or(1, |blurs| blurs.count)
    }
}

struct Opened<'a> {
    aim: Aim<'a>,
    choices: Choices,
    profiler: RangeProfiler,
    meaning: Meaning,
}

impl Forming for Opened<'_> {
    fn form(&self, work: &Work, tiles: &mut [Tile]) -> Result<(), FormError> {
        let collection = self.aim.collection;
        let (num_samples, num_pulses) = (collection.num_samples, collection.pulses.len());
        let (length, each) = (self.profiler.length(), self.choices.profiles_each());
        let summed = self.choices.summed_pulses;
        let pulse_bytes = pulse_bytes(num_samples, each, length);
        let parts = Budget::new(work.memory_bytes).take_block(
            "range profiles of some pulses",
            pulse_bytes * summed.min(num_pulses) as u64,
            num_pulses.div_ceil(summed).min(MOST_PARTS),
            &[Remedy::MoreMemory],
        )?;
        let block = (parts * summed).min(num_pulses);
        let mut samples = vec![Complex32::ZERO; block * num_samples];
        let mut profiles = vec![Complex32::ZERO; block * each * (length + 1)];
        for first in (0..num_pulses).step_by(block) {
            let pulses = first..(first + block).min(num_pulses);
            let samples = &mut samples[..pulses.len() * num_samples];
            work.history.read(pulses.clone(), samples)?;
            let profiles = &mut profiles[..pulses.len() * each * (length + 1)];
            self.profiles(samples, profiles);
            let sources: Vec<Source> = pulses.clone().map(|n| self.source(n)).collect();
            let add = |scratch: &mut Scratch, points: &Points, pixels: &mut [Complex32]| {
                let profiles = profiles.chunks(summed * each * (length + 1));
                for (sources, profiles) in sources.chunks(summed).zip(profiles) {
                    self.sum(sources, profiles, points, scratch);
                    let sums = pixels.iter_mut().zip(&scratch.sums);
                    sums.for_each(|(pixel, sum)| *pixel += sum);
                }
            };
            let (grid, monitor) = (self.aim.grid, work.monitor);
            for_each_run(grid, tiles, monitor, Scratch::default, add);
            if work.monitor.cancelled() {
                return Err(FormError::Cancelled);
            }
            work.monitor.progress(pulses.end as f64 / num_pulses as f64);
        }
        Ok(())
    }
}

impl Opened<'_> {
    /// The profiles of `samples`, pulse by pulse.
    fn profiles(&self, samples: &[Complex32], profiles: &mut [Complex32]) {
        let num_samples = self.aim.collection.num_samples;
        let (profiler, each) = (&self.profiler, self.choices.profiles_each());
        let scratch = || {
            let row = vec![Complex32::ZERO; num_samples];
            (row, vec![Complex32::ZERO; profiler.scratch_length()])
        };
        profiles
            .par_chunks_exact_mut(profiler.length() + 1)
            .enumerate()
            .for_each_init(scratch, |(row, scratch), (i, profile)| {
                let first = i / each * num_samples;
                let pulse = &samples[first..first + num_samples];
                match &self.choices.blurs {
                    None => profiler.profile(pulse, profile, scratch),
                    Some(blurs) => {
                        blurs.sharpen(i % each, pulse, row);
                        profiler.profile(row, profile, scratch);
                    }
                }
            });
    }

    /// What pulse `n` contributes with.
    fn source(&self, n: usize) -> Source<'_> {
        let collection = self.aim.collection;
        let pulse = &collection.pulses[n];
        let centre_hz = pulse.frequency_hz(collection.num_samples / 2);
        Source {
            pulse,
            antennas: Antennas {
                transmitter_m: pulse.transmitter_m.to_array(),
                receiver_m: pulse.receiver_m.to_array(),
                datum_m: pulse.reference_path_m,
            },
            scale: Scale {
                cycles_m: centre_hz / SPEED_OF_LIGHT_M_S,
                bins_m: pulse.step_hz / SPEED_OF_LIGHT_M_S,
                weight: self.aim.weights.slow[n] as f32,
            },
            reference: pulse.reference_terms(),
            coupling: centre_hz / pulse.step_hz,
        }
    }

    /// Sums what some pulses add to a run of pixels, into the scratch.
    fn sum(
        &self,
        sources: &[Source],
        profiles: &[Complex32],
        points: &Points,
        scratch: &mut Scratch,
    ) {
        let length = self.profiler.length();
        let each = self.choices.profiles_each() * (length + 1);
        let Scratch {
            sums,
            moved,
            blurred,
        } = scratch;
        sums.clear();
        sums.resize(points.len(), Complex32::ZERO);
        for (source, profiles) in sources.iter().zip(profiles.chunks_exact(each)) {
            let (scale, antennas) = (&source.scale, &source.antennas);
            match (&self.choices.blurs, self.meaning) {
                (Some(blurs), _) => {
                    blurred.clear();
                    let places = points.iter().map(DVec3::from);
                    blurred.extend(places.map(|point| self.blurred(source, blurs, point)));
                    backprojection::add_blurred(profiles, length, scale, blurred, sums);
                }
                (None, Meaning::Places) => {
                    backprojection::add_pulse(profiles, scale, antennas, points, sums);
                }
                (None, Meaning::Velocities { .. }) => {
                    moved.clear();
                    for point in points.iter().map(DVec3::from) {
                        let (at, _) = self.meaning.target(source.pulse, point);
                        moved.push(at.to_array());
                    }
                    backprojection::add_pulse(profiles, scale, antennas, moved, sums);
                }
            }
        }
    }

    /// Where a point reads the profiles of a pulse with motion from sample to sample.
    #[inline(always)]
    fn blurred(&self, source: &Source, blurs: &Blurs, point: DVec3) -> Blurred {
        let (at, velocity_m_s) = self.meaning.target(source.pulse, point);
        let terms = source.pulse.path_terms(at, velocity_m_s) - source.reference;
        Blurred {
            path_m: terms.path_m,
            turns: (terms.path_m + terms.rate_m * source.coupling) * source.scale.bins_m,
            level: blurs.level(blurs.turns(source.pulse, &terms)),
        }
    }
}
