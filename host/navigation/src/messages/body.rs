//! Sequential fields of a NovAtel record, from text or from bytes: both have the same fields in the same order.

/// Value of an enumeration: number and name.
pub(crate) type Named = (u32, &'static str);

/// Fields in their order.
pub(crate) trait Body {
    /// Read a float64.
    fn double(&mut self, field: &str) -> Result<f64, String>;
    /// Read a float32 as float64.
    fn single(&mut self, field: &str) -> Result<f64, String>;
    /// Read an unsigned 32-bit integer.
    fn whole(&mut self, field: &str) -> Result<u32, String>;
    /// Read a value of an enumeration; `None` if it is not one of `known`.
    fn state(&mut self, field: &str, known: &[Named]) -> Result<Option<u32>, String>;
}

/// Comma-separated fields.
pub(crate) struct Text<'a>(pub(crate) std::str::Split<'a, char>);

impl Text<'_> {
    fn next(&mut self, field: &str) -> Result<&str, String> {
        self.0
            .next()
            .ok_or_else(|| format!("no {field}: the record has too few fields"))
    }
}

impl Body for Text<'_> {
    fn double(&mut self, field: &str) -> Result<f64, String> {
        let text = self.next(field)?;
        let number = text.parse().ok().filter(|value: &f64| value.is_finite());
        number.ok_or_else(|| format!("{field} is '{text}', expected a finite number"))
    }

    fn single(&mut self, field: &str) -> Result<f64, String> {
        self.double(field)
    }

    fn whole(&mut self, field: &str) -> Result<u32, String> {
        let text = self.next(field)?;
        text.parse()
            .map_err(|_| format!("{field} is '{text}', expected an integer of at least 0"))
    }

    fn state(&mut self, field: &str, known: &[Named]) -> Result<Option<u32>, String> {
        let text = self.next(field)?;
        let found = known.iter().find(|(_, name)| *name == text);
        Ok(found.map(|&(number, _)| number))
    }
}

/// Little-endian binary fields.
pub(crate) struct Bytes<'a>(pub(crate) &'a [u8]);

impl Bytes<'_> {
    fn take<const N: usize>(&mut self, field: &str) -> Result<[u8; N], String> {
        let Some((&bytes, rest)) = self.0.split_first_chunk() else {
            return Err(format!("no {field}: the record has too few bytes"));
        };
        self.0 = rest;
        Ok(bytes)
    }
}

/// Refuse a number that is not finite.
fn finite(value: f64, field: &str) -> Result<f64, String> {
    let number = value.is_finite().then_some(value);
    number.ok_or_else(|| format!("{field} is {value}, expected a finite number"))
}

impl Body for Bytes<'_> {
    fn double(&mut self, field: &str) -> Result<f64, String> {
        finite(f64::from_le_bytes(self.take(field)?), field)
    }

    fn single(&mut self, field: &str) -> Result<f64, String> {
        finite(f64::from(f32::from_le_bytes(self.take(field)?)), field)
    }

    fn whole(&mut self, field: &str) -> Result<u32, String> {
        Ok(u32::from_le_bytes(self.take(field)?))
    }

    fn state(&mut self, field: &str, known: &[Named]) -> Result<Option<u32>, String> {
        let number = self.whole(field)?;
        let found = known.iter().find(|(known, _)| *known == number);
        Ok(found.map(|&(number, _)| number))
    }
}
