//! Memory budget: allocations taken from a limit, and the remainder for samples.

use super::{FormError, Remedy, Task};

/// Remaining bytes of a memory limit.
#[derive(Clone, Copy, Debug)]
pub struct Budget {
    total_bytes: u64,
    left_bytes: u64,
}

impl Budget {
    /// Make a budget of `total_bytes`.
    pub fn new(total_bytes: u64) -> Self {
        Self {
            total_bytes,
            left_bytes: total_bytes,
        }
    }

    /// Make the budget of a task, less the memory of its recording and of its image at
    /// `bytes_a_pixel`.
    ///
    /// # Errors
    /// [`FormError::Memory`] if these exceed the limit, [`FormError::Unsuited`] for a task without
    /// pulses, samples or pixels.
    pub fn for_task(task: &Task, bytes_a_pixel: u64) -> Result<Self, FormError> {
        super::check_not_empty(task.history.collection(), task.grid)?;
        let mut budget = Self::new(task.memory_bytes);
        budget.take(
            "the recording",
            task.history.held_bytes().into(),
            &[Remedy::MoreMemory],
        )?;
        let image_bytes = u128::from(task.grid.num_pixels()) * u128::from(bytes_a_pixel);
        budget.take(
            "the image",
            image_bytes,
            &[Remedy::FewerPixels, Remedy::MoreMemory],
        )?;
        Ok(budget)
    }

    /// Remaining bytes.
    pub fn left_bytes(&self) -> u64 {
        self.left_bytes
    }

    /// Take `bytes` for `what`; `remedies` are reported where the remainder is too small.
    ///
    /// # Errors
    /// [`FormError::Memory`] if the remainder is too small.
    pub fn take(
        &mut self,
        purpose: &'static str,
        bytes: u128,
        remedies: &'static [Remedy],
    ) -> Result<(), FormError> {
        if bytes > u128::from(self.left_bytes) {
            let taken = u128::from(self.total_bytes - self.left_bytes);
            return Err(FormError::Memory {
                purpose,
                needed_bytes: taken + bytes,
                budget_bytes: self.total_bytes,
                remedies,
            });
        }
        self.left_bytes -= bytes as u64;
        Ok(())
    }

    /// Take as many of `wanted` items of `bytes_each` as fit: at least one, at most all, and
    /// no more than half of the remainder. Return their number.
    ///
    /// # Errors
    /// [`FormError::Memory`] if not even one fits.
    pub fn take_block(
        &mut self,
        purpose: &'static str,
        bytes_each: u64,
        wanted: usize,
        remedies: &'static [Remedy],
    ) -> Result<usize, FormError> {
        let fit = self.left_bytes / 2 / bytes_each.max(1);
        let count = fit.clamp(1, wanted.max(1) as u64);
        self.take(
            purpose,
            u128::from(count) * u128::from(bytes_each),
            remedies,
        )?;
        Ok(count as usize)
    }
}

/// Run `work` on at most `workers` threads.
///
/// # Errors
/// Errors of `work`; [`FormError::Unsuited`] if threads cannot be started.
pub(crate) fn on_threads(
    workers: usize,
    work: impl FnOnce() -> Result<(), FormError> + Send,
) -> Result<(), FormError> {
    if workers >= rayon::current_num_threads() {
        return work();
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(workers).build();
    pool.map_err(|e| FormError::unsuited(format!("cannot start {workers} threads: {e}")))?
        .install(work)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_budget_is_never_exceeded() {
        let mut budget = Budget::new(1000);
        budget.take("image", 600, &[]).unwrap();
        assert_eq!(budget.take_block("pulses", 50, 100, &[]).unwrap(), 4);
        assert!(budget.take("scratch", 201, &[]).is_err());
        budget.take("scratch", 200, &[]).unwrap();
        let error = budget
            .take_block("pulses", 1, 1, &[Remedy::FewerPixels])
            .unwrap_err();
        assert_eq!(error.remedies(), [Remedy::FewerPixels]);
        let error = error.to_string();
        assert!(
            error.contains("needs 1001 bytes of the 1000 bytes allowed"),
            "{error}"
        );
    }
}
