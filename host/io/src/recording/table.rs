//! Look-up table of the values of integer codes, such as those of a block-adaptive quantiser.

use num_complex::Complex32;

use super::arrays::Source;
use crate::npy::{Array, Values};
use subaperture_describe::declare::Located;
use subaperture_describe::error::Fault;

/// Maximum number of entries: the number of 16-bit codes.
const MAX_ENTRIES: usize = 1 << 16;

/// Values of the codes; NaN for an invalid sample.
pub(super) struct Table(Vec<f32>);

impl Table {
    /// Read the table named by `key`.
    pub(super) fn read(key: &Located<String>, source: &Source) -> Result<Self, Fault> {
        let array = source.array(key)?;
        let fault = |message: String| Err(key.fault(message));
        let Some(values) = array.real().filter(|_| array.shape.len() == 1) else {
            return fault(format!(
                "expected a row of real numbers, the values of codes, found shape {:?}, {}",
                array.shape,
                if array.real().is_some() {
                    "real"
                } else {
                    "complex"
                }
            ));
        };
        if values.is_empty() || values.len() > MAX_ENTRIES {
            return fault(format!(
                "expected 1 to {MAX_ENTRIES} values, one for each code, found {}",
                values.len()
            ));
        }
        let mut table = Vec::with_capacity(values.len());
        for (code, &value) in values.iter().enumerate() {
            if value.abs() > f64::from(f32::MAX) {
                return fault(format!(
                    "expected values within the range of float32, or NaN, found {value} for code {code}"
                ));
            }
            table.push(value as f32);
        }
        Ok(Self(table))
    }

    /// Entry of a code.
    fn entry(&self, code: f64) -> Option<usize> {
        let count = self.0.len() as f64;
        let place = if code < 0.0 { code + count } else { code };
        (0.0..count).contains(&place).then_some(place as usize)
    }

    /// Value of a code that [`Self::check`] has accepted; NaN for an invalid sample.
    fn value(&self, code: f64) -> f32 {
        self.entry(code).map_or(f32::NAN, |place| self.0[place])
    }

    /// Value of a real sample; 0 if it is invalid.
    pub(super) fn real(&self, code: f64) -> f32 {
        let value = self.value(code);
        if value.is_nan() { 0.0 } else { value }
    }

    /// Value of a complex sample; 0 if a part is invalid.
    pub(super) fn complex(&self, code: Complex32) -> Complex32 {
        let value = Complex32::new(self.value(code.re.into()), self.value(code.im.into()));
        match value.is_nan() {
            true => Complex32::ZERO,
            false => value,
        }
    }

    /// Check that an array contains integer codes of the table. The message states the place of the first other value.
    pub(super) fn check(&self, array: &Array) -> Result<(), String> {
        if array
            .integer_range
            .is_none_or(|[low, high]| high - low >= MAX_ENTRIES as f64)
        {
            return Err("expected codes of 8 or 16 bits (int8, uint8, int16, uint16), found numbers of another type: remove 'table', or save the codes".to_owned());
        }
        let outside = |code: f64| self.entry(code).is_none();
        let found = match &array.values {
            Values::Real(codes) => codes.iter().position(|&code| outside(code)),
            Values::Complex(codes) => codes
                .iter()
                .position(|code| outside(code.re.into()) || outside(code.im.into())),
        };
        let Some(i) = found else {
            return Ok(());
        };
        let code = match &array.values {
            Values::Real(codes) => codes[i].to_string(),
            Values::Complex(codes) => format!("{} + j {}", codes[i].re, codes[i].im),
        };
        Err(format!(
            "the code {code} at index {:?} has no entry in the table of {} values",
            index_of(&array.shape, i),
            self.0.len()
        ))
    }
}

/// Index of value `i` of an array in C order.
fn index_of(shape: &[usize], mut i: usize) -> Vec<usize> {
    let mut index: Vec<usize> = shape
        .iter()
        .rev()
        .map(|&size| {
            let at = i % size;
            i /= size;
            at
        })
        .collect();
    index.reverse();
    index
}
