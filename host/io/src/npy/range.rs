//! Values that float32 does not hold: samples are complex64 once they are read.

/// Largest value below which float32 loses what is far below it: 2^-100. The least normal float32 is 2^-126, so that 78 dB and 13 bits are left.
const LEAST: f64 = 1.0 / (1u128 << 100) as f64;

/// What values were like, as they are in a file.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Range {
    /// The largest that is finite.
    largest: f64,
    count: usize,
    /// The first that is finite and beyond float32: which, and its value.
    beyond: Option<(usize, f64)>,
}

impl Range {
    /// Takes a part of the next value.
    pub(crate) fn take(&mut self, parts: &[f64]) {
        for &part in parts {
            if part.is_finite() {
                self.largest = self.largest.max(part.abs());
                if !(part as f32).is_finite() && self.beyond.is_none() {
                    self.beyond = Some((self.count, part));
                }
            }
        }
        self.count += 1;
    }

    /// What is wrong with the values as complex64 in words, and what to do.
    pub(crate) fn fault(&self) -> Option<String> {
        if let Some((n, value)) = self.beyond {
            return Some(format!(
                "value {n} is {value:e}, beyond the largest of float32 (3.4e38): divide all values by one number"
            ));
        }
        (self.largest > 0.0 && self.largest < LEAST).then(|| {
            format!(
                "its largest value is {:e}, so small that float32 loses what is below it (values from {LEAST:.1e} on are kept well): multiply all values by one number",
                self.largest
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_that_float32_does_not_hold_are_named() {
        let fault = |values: &[[f64; 2]]| {
            let mut range = Range::default();
            values.iter().for_each(|parts| range.take(parts));
            range.fault()
        };
        assert_eq!(fault(&[[0.0, 0.0], [0.0, 0.0]]), None);
        assert_eq!(fault(&[[1e-300, 0.0], [0.0, -1.0]]), None);
        assert_eq!(fault(&[[f64::NAN, 1.0], [f64::INFINITY, 0.0]]), None);
        let beyond = fault(&[[1.0, 0.0], [0.0, -1e300]]).unwrap();
        assert!(beyond.starts_with("value 1 is -1e300, beyond"), "{beyond}");
        for tiny in [1e-300, 5e-324, 1e-40, 7e-31] {
            assert!(
                fault(&[[0.0, 0.0], [tiny, 0.0]])
                    .unwrap()
                    .contains("largest value is")
            );
        }
        assert_eq!(fault(&[[1e-30, 0.0]]), None);
    }
}
