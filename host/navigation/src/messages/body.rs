//! The fields of a NovAtel record one after another, as text or as bytes: both have the same in the same order.

/// A value of an enumeration: its number and its name.
pub(crate) type Named = (u32, &'static str);

/// Fields in their order.
pub(crate) trait Body {
    /// A number of 8 bytes.
    fn double(&mut self, what: &str) -> Result<f64, String>;
    /// A number of 4 bytes.
    fn single(&mut self, what: &str) -> Result<f64, String>;
    /// A whole number of 4 bytes.
    fn whole(&mut self, what: &str) -> Result<u32, String>;
    /// Which value of an enumeration it is, if one of those given.
    fn state(&mut self, what: &str, known: &[Named]) -> Result<Option<u32>, String>;
}

/// Comma-separated.
pub(crate) struct Text<'a>(pub(crate) std::str::Split<'a, char>);

impl Text<'_> {
    fn field(&mut self, what: &str) -> Result<&str, String> {
        self.0
            .next()
            .ok_or_else(|| format!("no {what}: it has too few fields"))
    }
}

impl Body for Text<'_> {
    fn double(&mut self, what: &str) -> Result<f64, String> {
        let text = self.field(what)?;
        let number = text.parse().ok().filter(|value: &f64| value.is_finite());
        number.ok_or_else(|| format!("{what} is '{text}', not a finite number"))
    }

    fn single(&mut self, what: &str) -> Result<f64, String> {
        self.double(what)
    }

    fn whole(&mut self, what: &str) -> Result<u32, String> {
        let text = self.field(what)?;
        text.parse()
            .map_err(|_| format!("{what} is '{text}', not a whole number"))
    }

    fn state(&mut self, what: &str, known: &[Named]) -> Result<Option<u32>, String> {
        let text = self.field(what)?;
        let found = known.iter().find(|(_, name)| *name == text);
        Ok(found.map(|&(number, _)| number))
    }
}

/// Little-endian.
pub(crate) struct Bytes<'a>(pub(crate) &'a [u8]);

impl Bytes<'_> {
    fn take<const N: usize>(&mut self, what: &str) -> Result<[u8; N], String> {
        let Some((&bytes, rest)) = self.0.split_first_chunk() else {
            return Err(format!("no {what}: it has too few bytes"));
        };
        self.0 = rest;
        Ok(bytes)
    }
}

/// A number, if it is finite.
fn finite(value: f64, what: &str) -> Result<f64, String> {
    let number = value.is_finite().then_some(value);
    number.ok_or_else(|| format!("{what} is {value}, not a finite number"))
}

impl Body for Bytes<'_> {
    fn double(&mut self, what: &str) -> Result<f64, String> {
        finite(f64::from_le_bytes(self.take(what)?), what)
    }

    fn single(&mut self, what: &str) -> Result<f64, String> {
        finite(f64::from(f32::from_le_bytes(self.take(what)?)), what)
    }

    fn whole(&mut self, what: &str) -> Result<u32, String> {
        Ok(u32::from_le_bytes(self.take(what)?))
    }

    fn state(&mut self, what: &str, known: &[Named]) -> Result<Option<u32>, String> {
        let number = self.whole(what)?;
        let found = known.iter().find(|(known, _)| *known == number);
        Ok(found.map(|&(number, _)| number))
    }
}
