//! Smooth step from 0 to 1: the integral of a Kaiser window.

use subaperture_signal::window::bessel_i0;

/// Number of tabulated values of the step.
const STEPS: usize = 2048;

/// Step over `0 <= t <= 1`. Over a length `F` its spectrum decays beyond `2 beta / F`.
#[derive(Clone, Debug)]
pub(super) struct Fall {
    step: Vec<f64>,
}

impl Fall {
    /// Tabulate the step of a Kaiser window of shape `beta`.
    pub(super) fn new(beta: f64) -> Self {
        let mut sum = 0.0;
        let mut step = vec![0.0];
        for i in 0..STEPS {
            let u = (2.0 * (i as f64 + 0.5) / STEPS as f64) - 1.0;
            sum += bessel_i0(beta * (1.0 - u * u).sqrt());
            step.push(sum);
        }
        step.iter_mut().for_each(|value| *value /= sum);
        Self { step }
    }

    /// Value at `t`: 0 before 0, 1 after 1.
    pub(super) fn at(&self, t: f64) -> f64 {
        if t <= 0.0 {
            return 0.0;
        }
        if t >= 1.0 {
            return 1.0;
        }
        let place = t * STEPS as f64;
        let whole = (place as usize).min(STEPS - 1);
        let (a, b) = (self.step[whole], self.step[whole + 1]);
        a + (b - a) * (place - whole as f64)
    }
}
