//! How long work will take: larger and larger parts of it, measured on this machine.
//!
//! Parts are done until one takes 0.3 s or 1.5 s have passed. With the operations of the parts and of the whole by the
//! work's own account, and `slope` the time of an operation more from the last part but one to the last, the estimate is
//!
//! ```text
//! time = time(part) + slope * (operations(whole) - operations(part))
//! ```
//!
//! Counts are not times: what a part of a large image keeps in caches the whole may not. Checked on recordings of every former
//! (`tests/forecast.rs`): within a factor of 2.

use std::iter::Sum;
use std::ops::Range;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use num_complex::Complex32;

use crate::FormError;
use subaperture_model::monitor::Monitor;

/// A part that takes so long is large enough.
const LONG_ENOUGH_S: f64 = 0.3;

/// No part takes longer: one that does is stopped, and its time is that of what it did.
const MOST_S: f64 = 1.5;

/// Time of an operation more over that of a part's in the mean, at the least: differences of short times say little.
const LEAST_SLOPE: f64 = 0.25;

/// Operations of the first part.
const FIRST_OPERATIONS: f64 = 1e7;

/// Samples read at a time.
const BLOCK_SAMPLES: usize = 1 << 17;

/// An estimate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Forecast {
    /// Of the whole work, seconds.
    pub seconds: f64,
    /// That the part measured took, seconds.
    pub measured_s: f64,
}

impl Sum for Forecast {
    /// Of work done one after another.
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

/// How much of a work.
#[derive(Clone, Copy)]
pub struct Size {
    /// Of each of the grid's sides.
    pub side: f64,
    /// Pulses.
    pub pulses: usize,
}

/// All of a work.
pub struct Whole {
    /// Operations of it.
    pub operations: f64,
    /// Its pulses.
    pub pulses: usize,
    /// Pulses of its first parts: more are taken once a part has all pixels.
    pub few_pulses: usize,
}

/// Measures larger and larger parts of a work. `part` says how many operations a part has, and what does it. `None` where a
/// part has no account of its operations, or could not be done.
///
/// # Errors
/// [`FormError::Cancelled`].
pub fn grow<F: FnOnce(&dyn Monitor) -> Result<(), FormError>>(
    whole: &Whole,
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
            deadline: Instant::now() + Duration::from_secs_f64(MOST_S),
            fraction: Mutex::new(0.0),
        };
        let start = Instant::now();
        let formed = form(&until);
        let measured_s = start.elapsed().as_secs_f64();
        let done = match formed {
            Ok(()) => 1.0,
            Err(FormError::Cancelled) if monitor.cancelled() => return Err(FormError::Cancelled),
            Err(FormError::Cancelled) => until.done(),
            Err(_) => return Ok(None),
        };
        let is_whole = size.side >= 1.0 && size.pulses == whole.pulses;
        let is_enough = measured_s >= LONG_ENOUGH_S && smaller.is_some();
        if is_enough || is_whole || done < 1.0 || begun.elapsed().as_secs_f64() > MOST_S {
            // What was stopped before it told of any progress says only that it is long.
            let seconds = measured_s / done.max(1e-3);
            // What a part takes beside its operations, to plan and to begin, it took before too.
            let mean = seconds / operations;
            let slope = match smaller {
                Some((before, took_s)) if before < operations => {
                    (seconds - took_s) / (operations - before)
                }
                _ => mean,
            };
            let more_s = (whole.operations - operations) * slope.clamp(LEAST_SLOPE * mean, mean);
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

/// How long it takes to read all of so many pulses of `width` samples, by reading some of them here and there.
///
/// # Errors
/// Those of `read`.
pub fn reading<E>(
    num_pulses: usize,
    width: usize,
    read: impl Fn(Range<usize>, &mut [Complex32]) -> Result<(), E>,
) -> Result<Forecast, E> {
    let block = (BLOCK_SAMPLES / width.max(1)).clamp(1, num_pulses.max(1));
    let mut samples = vec![Complex32::ZERO; block * width];
    let (begun, mut done) = (Instant::now(), 0);
    let blocks = num_pulses.div_ceil(block);
    // A prime stride, so that neighbours are not read one after the other.
    for index in (0..blocks).map(|i| i * 7919 % blocks) {
        let first = index * block;
        let pulses = first..num_pulses.min(first + block);
        done += pulses.len();
        let samples = &mut samples[..pulses.len() * width];
        read(pulses, samples)?;
        if begun.elapsed().as_secs_f64() > LONG_ENOUGH_S {
            break;
        }
    }
    let measured_s = begun.elapsed().as_secs_f64();
    Ok(Forecast {
        seconds: measured_s * num_pulses as f64 / done.max(1) as f64,
        measured_s,
    })
}

/// `side` of the elements of an axis; two where it has as many.
pub fn fewer(count: usize, side: f64) -> usize {
    ((count as f64 * side).ceil() as usize).clamp(count.min(2), count)
}

/// Stops work at a time, and keeps how far it was.
struct Until<'a> {
    monitor: &'a dyn Monitor,
    deadline: Instant,
    fraction: Mutex<f64>,
}

impl Until<'_> {
    fn done(&self) -> f64 {
        *self
            .fraction
            .lock()
            .unwrap_or_else(|held| held.into_inner())
    }
}

impl Monitor for Until<'_> {
    fn progress(&self, fraction: f64) {
        let mut most = self
            .fraction
            .lock()
            .unwrap_or_else(|held| held.into_inner());
        *most = most.max(fraction);
    }

    fn cancelled(&self) -> bool {
        self.monitor.cancelled() || Instant::now() > self.deadline
    }
}
