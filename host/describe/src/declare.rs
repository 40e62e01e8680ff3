//! Sections declared as structs.
//!
//! A section is a struct with the attribute [`macro@section`]. From it come its part of the [`Schema`] and the values read from a text that
//! agrees with it ([`Declared::read`]).
//!
//! ```
//! use subaperture_describe::declare::{Located, section};
//! use subaperture_describe::schema::Schema;
//! use subaperture_describe::Description;
//!
//! /// Oscillator of the radar.
//! #[section]
//! struct Oscillator {
//!     /// Frequency of the oscillator.
//!     #[key(required = "10 MHz", positive)]
//!     frequency_hz: Located<f64>,
//!     /// Reference of the oscillator.
//!     #[key(default = "internal", select(Internal, External))]
//!     source: Source,
//!     /// Delay of the reference cable.
//!     #[key(default = "0 s", not_negative, when(External))]
//!     delay_s: f64,
//! }
//!
//! #[section]
//! struct Top {
//!     #[section]
//!     oscillator: Oscillator,
//! }
//!
//! let schema = Schema::of::<Top>("An example is a TOML file.");
//! let text = "[oscillator]\nfrequency = \"5 MHz\"\nsource = \"external\"\ndelay = \"0.5 s\"\n";
//! let description = Description::new("a.toml", text, ".");
//! let top: Top = description.resolve_as(&schema).map_err(|faults| description.explain(faults))?;
//! assert_eq!(*top.oscillator.frequency_hz, 5e6);
//! let Source::External(external) = &top.oscillator.source else { panic!() };
//! assert_eq!(external.delay_s, 0.5);
//! let fault = top.oscillator.frequency_hz.fault("expected 10 MHz");
//! assert!(description.explain(vec![fault]).to_string().starts_with("a.toml:2:13: expected 10 MHz"));
//! # Ok::<(), subaperture_describe::DescriptionError>(())
//! ```
//!
//! - **Doc comments** are the descriptions of the key reference: of a key that of its field; of a section that of the field that holds it,
//!   or else that of its struct.
//! - **A unit at the end of a field's name** states the dimension: `delay_s` is the key `delay`, a time, in seconds (`UNITS`). A number
//!   without a unit is a ratio.
//! - **Types** are those of [`KeyType`]; an enum of words derives [`macro@Choice`]. An optional key is an [`Option`]. [`Located`] adds the
//!   position, for errors of checks that concern several keys. A section that may be left out is an `Option`, one that may be repeated a
//!   `Vec`.
//! - `#[key(...)]`: `required`, `default` or `example` (of an optional key), with its TOML; bounds: `positive`, `not_negative`,
//!   `within(from, to, "words")` in SI units, `whole(from, to)` of integers; `words("a", "b")` permitted for a text; `rows(least, Time,
//!   Length)` of an array of rows.
//! - `select(A, B)` makes the key the **selector** of its section, and its type an enum. A key with `when(A)` applies to these values only: it
//!   is in the structs of their variants if it is required or has a default, and a field of the section's struct if it is optional.
//! - `#[section]` holds a section within, `#[keys]` the keys of another struct, `#[at]` the [`Location`] of the header. `#[skip]` is a
//!   field that is not in the text: it has its default, and the reader sets it.

use std::ops::Deref;
use std::path::PathBuf;

use glam::DVec3;
use subaperture_model::units::Dimension;

use crate::error::{Fault, Location};
use crate::schema::{Bounds, Key, Presence, Schema, Section, ValueType};
use crate::values::{LocatedValue, Value, Values};

pub use subaperture_describe_derive::{Choice, section};

/// Section declared as a struct, by [`macro@section`].
pub trait Declared: Sized {
    /// Doc comment of the struct.
    const DOC: &'static str;
    /// Name of the key that selects the applicable keys, or an empty text.
    const SELECTOR: &'static str;

    /// Keys of the section.
    fn keys() -> Vec<Key>;

    /// Add the sections within the one at `path`; subsections follow their parents.
    fn sections(path: &str, sections: &mut Vec<Section>);

    /// Read the values of a section that was checked against the schema.
    fn read(values: &Values) -> Self;
}

/// Units at the end of a field's name, and their dimensions; longer ones first.
const UNITS: [(&str, Dimension); 13] = [
    ("_m_s2", Dimension::Acceleration),
    ("_rad_s", Dimension::AngularRate),
    ("_m_s", Dimension::Speed),
    ("_hz_s", Dimension::SweepRate),
    ("_m2", Dimension::CrossSection),
    ("_dbi", Dimension::Gain),
    ("_rad", Dimension::Angle),
    ("_db", Dimension::Level),
    ("_hz", Dimension::Frequency),
    ("_k", Dimension::Temperature),
    ("_m", Dimension::Length),
    ("_s", Dimension::Time),
    ("_w", Dimension::Power),
];

/// Name of the key, and dimension, of a field.
pub fn split(field: &'static str) -> (&'static str, Dimension) {
    let mut named = UNITS
        .iter()
        .filter_map(|(unit, dimension)| Some((field.strip_suffix(unit)?, *dimension)));
    named.next().unwrap_or((field, Dimension::Ratio))
}

/// Limits of a key's value.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Dimension of a quantity.
    pub dimension: Dimension,
    /// Bounds of a quantity, or of an integer.
    pub bounds: Bounds,
    /// First and last integer.
    pub whole: (u64, u64),
    /// Permitted words; empty for any text.
    pub words: &'static [&'static str],
    /// Least number of rows, and the dimensions of each.
    pub rows: (usize, &'static [Dimension]),
}

impl Limits {
    /// Any value of the type; a quantity is a ratio.
    pub const NONE: Self = Self {
        dimension: Dimension::Ratio,
        bounds: Bounds::Any,
        whole: (0, u64::MAX),
        words: &[],
        rows: (0, &[]),
    };

    fn count(&self) -> ValueType {
        match self.bounds {
            Bounds::Positive => ValueType::Count(1, u64::MAX),
            _ => ValueType::Count(self.whole.0, self.whole.1),
        }
    }

    fn text(&self) -> ValueType {
        match self.words {
            [] => ValueType::Text,
            words => ValueType::Choice(words),
        }
    }
}

/// Type of a field that holds a key's value.
pub trait KeyType: Sized {
    /// Whether the key may be optional.
    const MAY_BE_ABSENT: bool = false;

    /// Type of the value in the text.
    fn kind(limits: &Limits) -> ValueType;

    /// Convert a value of this type; `None` if the value is of another.
    fn of(value: &Value) -> Option<Self>;

    /// Convert the value of a key that is given or has a default. `section` is the position of the header.
    ///
    /// # Panics
    /// If the value is absent or of another type, which the check against the schema excludes.
    fn read(given: Option<&LocatedValue>, section: &Location) -> Self {
        let _ = section;
        agreed(&given.expect("required keys are present").value)
    }
}

fn agreed<T: KeyType>(value: &Value) -> T {
    T::of(value).expect("values agree with the schema")
}

impl Values {
    /// Value of the key of a field, whose name may end in a unit.
    ///
    /// # Panics
    /// If the schema has no key of this name and type.
    pub fn key<T: KeyType>(&self, field: &'static str) -> T {
        let (name, _) = split(field);
        T::read(self.keys.get(name), &self.at)
    }
}

impl<T: KeyType> KeyType for Option<T> {
    const MAY_BE_ABSENT: bool = true;

    fn kind(limits: &Limits) -> ValueType {
        T::kind(limits)
    }

    fn of(value: &Value) -> Option<Self> {
        T::of(value).map(Some)
    }

    fn read(given: Option<&LocatedValue>, section: &Location) -> Self {
        given.map(|given| T::read(Some(given), section))
    }
}

macro_rules! key_type {
    ($($type:ty, $value:pat => $of:expr, $limits:pat => $kind:expr;)*) => {$(
        impl KeyType for $type {
            fn kind($limits: &Limits) -> ValueType {
                $kind
            }

            fn of(value: &Value) -> Option<Self> {
                match value {
                    $value => $of,
                    _ => None,
                }
            }
        }
    )*};
}

key_type! {
    f64, Value::Number(number) => Some(*number), limits => ValueType::Quantity(limits.dimension, limits.bounds);
    DVec3, Value::Numbers(numbers) => Some(DVec3::from_slice(numbers)), limits => ValueType::Vector(limits.dimension);
    (f64, f64), Value::Numbers(ends) => Some((ends[0], ends[1])), limits => ValueType::Interval(limits.dimension);
    bool, Value::Flag(flag) => Some(*flag), _ => ValueType::Flag;
    u64, Value::Count(count) => Some(*count), limits => limits.count();
    u32, Value::Count(count) => u32::try_from(*count).ok(), limits => limits.count();
    usize, Value::Count(count) => usize::try_from(*count).ok(), limits => limits.count();
    String, Value::Text(text) => Some(text.clone()), limits => limits.text();
    PathBuf, Value::Text(path) => Some(path.into()), _ => ValueType::Path;
    Vec<String>, Value::Texts(paths) => Some(paths.clone()), _ => ValueType::Paths;
}

impl<const COLUMNS: usize> KeyType for Vec<[f64; COLUMNS]> {
    fn kind(limits: &Limits) -> ValueType {
        ValueType::Rows(limits.rows.1, limits.rows.0)
    }

    fn of(value: &Value) -> Option<Self> {
        match value {
            Value::Rows(rows) => rows.iter().map(|row| row[..].try_into().ok()).collect(),
            _ => None,
        }
    }
}

/// Rows of two quantities; empty if the key is absent.
impl KeyType for Vec<(f64, f64)> {
    const MAY_BE_ABSENT: bool = true;

    fn kind(limits: &Limits) -> ValueType {
        Vec::<[f64; 2]>::kind(limits)
    }

    fn of(value: &Value) -> Option<Self> {
        let rows = Vec::<[f64; 2]>::of(value)?;
        Some(rows.into_iter().map(Into::into).collect())
    }

    fn read(given: Option<&LocatedValue>, _: &Location) -> Self {
        given.map(|given| agreed(&given.value)).unwrap_or_default()
    }
}

/// Value of a key with its position.
#[derive(Clone, Debug, PartialEq)]
pub struct Located<T> {
    value: T,
    at: Location,
}

impl<T> Located<T> {
    /// Value at a position.
    pub fn new(value: T, at: &Location) -> Self {
        let at = at.clone();
        Self { value, at }
    }

    /// Position of the value; that of the section if the key is absent.
    pub fn at(&self) -> &Location {
        &self.at
    }

    /// Make a fault at the value.
    pub fn fault(&self, message: impl Into<String>) -> Fault {
        Fault::new(&self.at, message)
    }
}

impl Located<DVec3> {
    /// Unit vector along the vector. The error is that of a zero vector.
    pub fn direction(&self) -> Result<DVec3, Fault> {
        self.try_normalize().ok_or_else(|| {
            self.fault("a direction cannot have length zero: write for example \"0, 1, 0\"")
        })
    }
}

impl<T> Deref for Located<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.value
    }
}

impl<T: KeyType> KeyType for Located<T> {
    const MAY_BE_ABSENT: bool = T::MAY_BE_ABSENT;

    fn kind(limits: &Limits) -> ValueType {
        T::kind(limits)
    }

    fn of(_: &Value) -> Option<Self> {
        None
    }

    fn read(given: Option<&LocatedValue>, section: &Location) -> Self {
        let at = given.map_or(section, |given| &given.at);
        Self::new(T::read(given, section), at)
    }
}

/// Restrict keys to values of a selector; keys with a restriction of their own keep it.
pub fn applicable(keys: Vec<Key>, when: &'static [&'static str]) -> impl Iterator<Item = Key> {
    keys.into_iter().map(move |key| match key.when {
        [] => key.when(when),
        _ => key,
    })
}

/// The first of these names that is not empty, or an empty text.
pub const fn first(names: &[&'static str]) -> &'static str {
    match names {
        [] => "",
        [name, others @ ..] if name.is_empty() => first(others),
        [name, ..] => name,
    }
}

/// Path of the parent, name, presence, applicable values of the parent's selector, and description of a section.
type Within<'p> = (
    &'p str,
    &'static str,
    Presence,
    &'static [&'static str],
    &'static str,
);

/// Add the section declared as `T`, and all within it.
pub fn within<T: Declared>(
    (parent, name, presence, when, doc): Within,
    sections: &mut Vec<Section>,
) {
    let path = match parent {
        "" => name.to_owned(),
        parent => format!("{parent}.{name}"),
    };
    sections.push(Section {
        path: path.clone(),
        presence,
        when,
        selector: T::SELECTOR,
        doc,
        keys: T::keys(),
    });
    T::sections(&path, sections);
}

impl Schema {
    /// Schema of a description whose top level is declared as `T`.
    pub fn of<T: Declared>(introduction: &'static str) -> Self {
        let mut sections = Vec::new();
        within::<T>(("", "", Presence::Always, &[], ""), &mut sections);
        Self {
            sections,
            introduction,
        }
    }
}
