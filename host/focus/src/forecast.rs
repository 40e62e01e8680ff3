//! Forecast of processing time from measurements of increasing parts of the work on this machine.
//!
//! Parts are processed until one takes 0.3 s or 1.5 s have passed. With the operations of the parts and of the whole by the
//! cost model, and `slope` the time per additional operation between the last two parts, the estimate is
//!
//! ```text
//! time = time(part) + slope * (operations(whole) - operations(part))
//! ```
//!
//! Time is not proportional to operations: a part of a large image may fit caches that the whole exceeds. Checked on recordings of every former
//! (`tests/forecast.rs`): within a factor of 2.

use std::iter::Sum;
use std::ops::Range;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use num_complex::Complex32;

use crate::FormError;
use subaperture_model::monitor::Monitor;

/// Minimum time of a sufficiently large part, s.
const LONG_ENOUGH_S: f64 = 0.3;

/// Time limit of a part, s; a part that exceeds it is stopped and extrapolated.
const MAX_S: f64 = 1.5;

/// Smallest ratio of the time per additional operation to the mean time per operation; differences of short times are inexact.
const MIN_SLOPE: f64 = 0.25;

/// Operations of the first part.
const FIRST_OPERATIONS: f64 = 1e7;

/// Samples read at a time.
const BLOCK_SAMPLES: usize = 1 << 17;

/// Estimated and measured time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Forecast {
    /// Estimated time of the whole work, seconds.
    pub seconds: f64,
    /// Time taken by the measured part, seconds.
    pub measured_s: f64,
}

impl Sum for Forecast {
    /// Sum of estimates of consecutive work.
    fn sum<I: Iterator<Item = Self>>(parts: I) -> Self {
        parts.fold(
            Self {
                seconds: 0.0,
                measured_s: 0.0,
            },
            |sum, part| Self {
                seconds: sum.seconds + part.seconds,
                measured_s: sum.measured_s + part.measured_s,
            },
        )
    }
}

/// Size of a part of the work.
#[derive(Clone, Copy)]
pub struct Size {
    /// Fraction of each side of the grid.
    pub side: f64,
    /// Number of pulses in the part.
    pub pulses: usize,
}

/// Size of the whole work.
pub struct WorkSize {
    /// Operations of the whole work.
    pub operations: f64,
    /// Pulses of the whole work.
    pub pulses: usize,
    /// Pulses of the first parts; more are used once a part has all pixels.
    pub few_pulses: usize,
}

/// Measure increasing parts of the work. `part` returns the operations of a part and a function that performs it. `None` where the
/// operations of a part are unknown, or it failed.
///
/// # Errors
/// [`FormError::Cancelled`].
pub fn grow<F: FnOnce(&dyn Monitor) -> Result<(), FormError>>(
    whole: &WorkSize,
    monitor: &dyn Monitor,
    part: impl Fn(Size) -> Option<(f64, F)>,
) -> Result<Option<Forecast>, FormError> {
    let mut size = Size {
        side: (FIRST_OPERATIONS / whole.operations).sqrt().min(1.0),
        pulses: whole.few_pulses,
    };
    let begun = Instant::now();
    let mut smaller = None;
    loop {
        let Some((operations, form)) = part(size) else {
            return Ok(None);
        };
        let until = Until {
            monitor,
            deadline: Instant::now() + Duration::from_secs_f64(MAX_S),
            seen: Mutex::new(None),
        };
        let start = Instant::now();
        let formed = form(&until);
        let measured_s = start.elapsed().as_secs_f64();
        let (done, seconds) = match formed {
            Ok(()) => (1.0, measured_s),
            Err(FormError::Cancelled) if monitor.cancelled() => return Err(FormError::Cancelled),
            Err(FormError::Cancelled) => until.all_s(start, measured_s),
            Err(_) => return Ok(None),
        };
        let is_whole = size.side >= 1.0 && size.pulses == whole.pulses;
        let is_enough = measured_s >= LONG_ENOUGH_S && smaller.is_some();
        if is_enough || is_whole || done < 1.0 || begun.elapsed().as_secs_f64() > MAX_S {
            // Overhead of a part for planning and startup is contained in the previous part as well.
            let mean = seconds / operations;
            let slope = match smaller {
                Some((before, took_s)) if before < operations => {
                    (seconds - took_s) / (operations - before)
                }
                _ => mean,
            };
            let more_s = (whole.operations - operations) * slope.clamp(MIN_SLOPE * mean, mean);
            return Ok(Some(Forecast {
                seconds: seconds + more_s,
                measured_s,
            }));
        }
        smaller = Some((operations, measured_s));
        let more = (LONG_ENOUGH_S * 1.5 / measured_s.max(1e-4)).clamp(4.0, 64.0);
        if size.side < 1.0 {
            size.side = (size.side * more.sqrt()).min(1.0);
        } else {
            size.pulses = whole.pulses.min((size.pulses as f64 * more) as usize + 1);
        }
    }
}

/// Estimate the time for reading all pulses of `width` samples by reading scattered blocks. The first block has two pulses for each thread, and each
/// further one twice as many, so that pulses that take long (simulated scenes of many scatterers) are measured in about a second, too.
///
/// # Errors
/// Errors of `read`.
pub fn reading<E>(
    num_pulses: usize,
    width: usize,
    read: impl Fn(Range<usize>, &mut [Complex32]) -> Result<(), E>,
) -> Result<Forecast, E> {
    let block = (BLOCK_SAMPLES / width.max(1)).clamp(1, num_pulses.max(1));
    let mut samples = vec![Complex32::ZERO; block * width];
    let (begun, mut done) = (Instant::now(), 0);
    let blocks = num_pulses.div_ceil(block);
    let mut count = (2 * rayon::current_num_threads()).min(block);
    // A prime stride avoids reading neighbours in sequence.
    for index in (0..blocks).map(|i| i * 7919 % blocks) {
        let first = index * block;
        let pulses = first..num_pulses.min(first + count);
        done += pulses.len();
        let samples = &mut samples[..pulses.len() * width];
        read(pulses, samples)?;
        if begun.elapsed().as_secs_f64() > LONG_ENOUGH_S {
            break;
        }
        count = (2 * count).min(block);
    }
    let measured_s = begun.elapsed().as_secs_f64();
    Ok(Forecast {
        seconds: measured_s * num_pulses as f64 / done.max(1) as f64,
        measured_s,
    })
}

/// Fraction `side` of the elements of an axis; at least two if it has as many.
pub fn fewer(count: usize, side: f64) -> usize {
    ((count as f64 * side).ceil() as usize).clamp(count.min(2), count)
}

/// Monitor that stops work at a given time and stores its progress.
struct Until<'a> {
    monitor: &'a dyn Monitor,
    deadline: Instant,
    /// Time and value of the first progress report, and the largest progress so far.
    seen: Mutex<Option<(Instant, f64, f64)>>,
}

impl Until<'_> {
    /// Extrapolated time of work stopped after `measured_s`, seconds. Planning before the first progress report is counted
    /// once; for work stopped before any progress the result is only known to be long.
    fn all_s(&self, start: Instant, measured_s: f64) -> (f64, f64) {
        let seen = *self.seen.lock().unwrap_or_else(|held| held.into_inner());
        let Some((first, from, most)) = seen else {
            return (0.0, measured_s / 1e-3);
        };
        let before_s = (first - start).as_secs_f64();
        match most > from {
            true => (
                most,
                before_s + (measured_s - before_s) * (1.0 - from) / (most - from),
            ),
            false => (most, measured_s / most.max(1e-3)),
        }
    }
}

impl Monitor for Until<'_> {
    fn progress(&self, fraction: f64) {
        let mut seen = self.seen.lock().unwrap_or_else(|held| held.into_inner());
        match &mut *seen {
            Some((.., most)) => *most = most.max(fraction),
            None => *seen = Some((Instant::now(), fraction, fraction)),
        }
    }

    fn cancelled(&self) -> bool {
        self.monitor.cancelled() || Instant::now() > self.deadline
    }
}
