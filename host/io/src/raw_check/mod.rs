//! Defects of raw samples: bias and imbalance of I and Q, clipped values.
//!
//! [`examine`] reads the pulses of [`examined_pulses`] twice. Memory: 70 bytes per sample of a pulse. A report states how many pulses were
//! examined. Statements about I and Q need [`LEAST_PULSES`] pulses with recorded samples.
//!
//! | defect | criterion |
//! |---|---|
//! | bias | [`balance`]: constant over pulses and over the samples of a pulse, at least 1 % of the standard deviation |
//! | imbalance | [`balance`]: `E[z^2] / E[|z|^2]` of at least 0.02 that is the same in all parts of the recording |
//! | clipping | [`clipping`]: at least 1e-4 of the values at a limit of the integer type, or piled up at one value |

pub(crate) mod absent;
pub(crate) mod balance;
mod clipping;
#[cfg(feature = "cphd")]
pub(crate) mod stored;
mod wording;

use num_complex::Complex32;

use balance::{Balance, Moments, Residuals};
use clipping::Clipping;
use subaperture_model::phase_history::{LEAST_PULSES, examined_pulses};
pub(crate) use wording::{Cures, Named, Report};

/// Defects of the samples of one receiver.
#[derive(Clone, Debug)]
pub(crate) struct Defects {
    /// Number of pulses examined, and number of pulses in all.
    examined: [usize; 2],
    /// Significant bias and imbalance of I and Q.
    pub(crate) balance: Balance,
    clipping: Clipping,
    /// Whether the samples have only a real part.
    real: bool,
}

/// Raw samples that are examined.
pub(crate) struct Raw {
    /// Number of pulses to choose from.
    pub(crate) num_pulses: usize,
    /// Number of samples per pulse.
    pub(crate) num_samples: usize,
    /// Whether the samples have only a real part.
    pub(crate) real: bool,
    /// Limits of the integer type of the samples.
    pub(crate) integer_range: Option<[f32; 2]>,
}

/// Examine the samples of pulses, which `read` writes into a row by the pulse's number. Places that are [`absent`] are skipped.
///
/// # Errors
/// Those of `read`.
pub(crate) fn examine<E>(
    raw: &Raw,
    mut read: impl FnMut(usize, &mut [Complex32]) -> Result<(), E>,
) -> Result<Defects, E> {
    let chosen = examined_pulses(raw.num_pulses, raw.num_samples);
    let count = chosen.len();
    let mut row = vec![Complex32::ZERO; raw.num_samples];
    let mut clipping = Clipping::new(raw.real, raw.integer_range);
    let enough = count >= LEAST_PULSES;
    let mut moments = enough.then(|| Moments::new(count, raw.num_samples));
    for (i, pulse) in chosen.clone().enumerate() {
        read(pulse, &mut row)?;
        clipping.add(&row);
        if let Some(moments) = &mut moments {
            moments.add(i, &row);
        }
    }
    let mut balance = Balance::default();
    if let Some(moments) = moments.filter(|moments| moments.num_pulses() >= LEAST_PULSES) {
        let mut residuals = Residuals::new(moments);
        for (i, pulse) in chosen.enumerate() {
            if raw.real {
                break;
            }
            read(pulse, &mut row)?;
            residuals.add(i, &row);
        }
        balance = residuals.balance();
    }
    Ok(Defects {
        examined: [count, raw.num_pulses],
        balance,
        clipping,
        real: raw.real,
    })
}

#[cfg(test)]
mod tests;
