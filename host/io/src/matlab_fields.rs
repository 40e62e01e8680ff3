//! Fields of a MATLAB structure, read with checks that name the field.

use super::matlab::{Array, Content, MatError, Numbers};

/// Maximum number of names in a message.
const MAX_NAMED: usize = 20;

/// A 1 x 1 structure.
pub(super) struct Fields<'a> {
    name: String,
    fields: Vec<(String, &'a [u8])>,
}

impl<'a> Fields<'a> {
    /// Structure `name` in the bytes of an array; `content` names its fields in the error.
    pub(super) fn of(bytes: &'a [u8], name: &str, content: &str) -> Result<Self, MatError> {
        let array = Array::parse(bytes, name)?;
        let Content::Structure(fields) = array.content else {
            return Err(MatError::Malformed(format!(
                "'{name}': expected a 1 x 1 structure with {content}, found {}",
                array.describe()
            )));
        };
        Ok(Self {
            name: name.to_owned(),
            fields,
        })
    }

    /// Full name of a field, such as `data.fp`.
    fn named(&self, field: &str) -> String {
        format!("{}.{field}", self.name)
    }

    fn bytes(&self, field: &str) -> Option<&'a [u8]> {
        let found = self.fields.iter().find(|(name, _)| name == field);
        found.map(|(_, bytes)| *bytes)
    }

    /// Bytes of a field that must be present.
    fn required(&self, field: &str) -> Result<&'a [u8], MatError> {
        self.bytes(field).ok_or_else(|| {
            let names = self.fields.iter().map(|(name, _)| name.as_str());
            let names: Vec<&str> = names.take(MAX_NAMED).collect();
            MatError::Malformed(format!(
                "{} is missing; fields found: {}",
                self.named(field),
                names.join(", ")
            ))
        })
    }

    /// Whether the structure has a field.
    #[cfg(feature = "cphd")]
    pub(super) fn has(&self, field: &str) -> bool {
        self.bytes(field).is_some()
    }

    /// Field that must be present.
    pub(super) fn array(&self, field: &str) -> Result<Array<'a>, MatError> {
        Array::parse(self.required(field)?, &self.named(field))
    }

    /// Field that is a structure in turn.
    #[cfg(feature = "cphd")]
    pub(super) fn part(&self, field: &str, content: &str) -> Result<Self, MatError> {
        Self::of(self.required(field)?, &self.named(field), content)
    }

    /// Real numbers of a field with the array that has them.
    fn real(&self, field: &str) -> Result<(Array<'a>, Numbers<'a>), MatError> {
        let array = self.array(field)?;
        let Content::Numeric {
            real,
            imaginary: None,
        } = array.content
        else {
            return Err(MatError::Malformed(format!(
                "{}: expected real numbers, found {}",
                self.named(field),
                array.describe()
            )));
        };
        Ok((array, real))
    }

    fn finite(&self, field: &str, numbers: Numbers) -> Result<Vec<f64>, MatError> {
        let values: Vec<f64> = numbers.iter().collect();
        match values.iter().position(|v| !v.is_finite()) {
            None => Ok(values),
            Some(i) => Err(MatError::Malformed(format!(
                "{}: expected finite values, found {} at index {i}",
                self.named(field),
                values[i]
            ))),
        }
    }

    /// Vector of `count` finite numbers, as a row or a column; `since` is the reason for their number.
    pub(super) fn values(
        &self,
        field: &str,
        count: usize,
        since: &str,
    ) -> Result<Vec<f64>, MatError> {
        let (array, numbers) = self.real(field)?;
        if numbers.len() != count || !array.dimensions.contains(&count) {
            return Err(MatError::Malformed(format!(
                "{}: expected {count} values, since {since}, found {}",
                self.named(field),
                array.describe_shape()
            )));
        }
        self.finite(field, numbers)
    }

    /// Matrix of `rows` x `columns` finite numbers, column after column; `since` is the reason for its size.
    #[cfg(feature = "cphd")]
    pub(super) fn matrix(
        &self,
        field: &str,
        [rows, columns]: [usize; 2],
        since: &str,
    ) -> Result<Vec<f64>, MatError> {
        let (array, numbers) = self.real(field)?;
        if array.dimensions != [rows, columns] {
            return Err(MatError::Malformed(format!(
                "{}: expected {rows} x {columns} values, since {since}, found {}",
                self.named(field),
                array.describe_shape()
            )));
        }
        self.finite(field, numbers)
    }

    /// Positive number, the first one of a vector.
    #[cfg(feature = "cphd")]
    pub(super) fn first_positive(&self, field: &str, unit: &str) -> Result<f64, MatError> {
        let (array, numbers) = self.real(field)?;
        match numbers.iter().next() {
            Some(value) if value.is_finite() && value > 0.0 => Ok(value),
            Some(value) => Err(MatError::Malformed(format!(
                "{}: expected a positive number of {unit}, found {value}",
                self.named(field)
            ))),
            None => Err(MatError::Malformed(format!(
                "{}: expected a positive number of {unit}, found {}",
                self.named(field),
                array.describe()
            ))),
        }
    }

    /// Vector of `count` finite numbers, or one number for all; `since` is the reason for their number.
    #[cfg(feature = "cphd")]
    pub(super) fn values_or_one(
        &self,
        field: &str,
        count: usize,
        since: &str,
    ) -> Result<Vec<f64>, MatError> {
        let (_, numbers) = self.real(field)?;
        match numbers.len() {
            1 => Ok(vec![self.finite(field, numbers)?[0]; count]),
            _ => self.values(field, count, since),
        }
    }
}
