//! Check of float64 values for the range of float32, since samples are stored as complex64.

/// Smallest useful maximum value, 2^-100. The smallest normal float32 is 2^-126, so 78 dB or 13 bits of precision
/// remain below it.
const LEAST: f64 = 1.0 / (1u128 << 100) as f64;

/// Range of the values of an array.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Range {
    /// Largest finite value.
    largest: f64,
    count: usize,
    /// Index and value of the first finite value beyond float32.
    beyond: Option<(usize, f64)>,
}

impl Range {
    /// Include the parts of the next value.
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

    /// Fault of the values as complex64, with its remedy.
    pub(crate) fn fault(&self) -> Option<String> {
        if let Some((n, value)) = self.beyond {
            return Some(format!(
                "value {n} is {value:e}, beyond the float32 maximum (3.4e38): divide all values by one number"
            ));
        }
        (self.largest > 0.0 && self.largest < LEAST).then(|| {
            format!(
                "the largest value is {:e}, below {LEAST:.1e}, where float32 loses precision: multiply all values by one number",
                self.largest
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_outside_float32_range_are_named() {
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
