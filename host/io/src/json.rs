//! JSON from untrusted files, read as a stream with limits on text and memory.
//!
//! A short text can make a large value: an element of `[0,0,0]` takes two bytes of text and 32 of memory, an empty
//! object in an array three bytes and some 700. [`value`] therefore counts the memory of what it creates and stops at
//! a limit. [`typed`] skips keys that its type does not name, and the type limits the rest. Neither keeps the text in
//! memory.
//!
//! **Memory** of [`value`]: at most [`Limits::value_bytes`], and twice [`Limits::string_bytes`] while a string is read.

use std::cell::Cell;
use std::fmt;
use std::io::{self, BufReader, Read};

use serde::de::{
    DeserializeOwned, DeserializeSeed, Deserializer, Error, IgnoredAny, MapAccess, SeqAccess,
    Visitor,
};
use serde_json::{Map, Number, Value};

/// Limits on a JSON text and its value.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Maximum text length in bytes.
    pub bytes: u64,
    /// Maximum length of a string or key in bytes of text.
    pub string_bytes: u64,
    /// Maximum memory of the value in bytes. Unused for typed reads.
    pub value_bytes: u64,
}

/// Error of reading JSON.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum JsonError {
    /// The operating system reported an error.
    #[error(transparent)]
    Io(io::Error),
    /// The text, or a string in it, is too long.
    #[error(
        "expected at most {most} bytes of {of}, found more: the file is damaged or written by another program"
    )]
    Long {
        /// Text or string that exceeds the limit.
        of: &'static str,
        /// Maximum number of bytes.
        most: u64,
    },
    /// The value takes too much memory.
    #[error(
        "expected JSON that takes at most {most} bytes of memory, found more: the file is damaged, or more memory is needed"
    )]
    Memory {
        /// Maximum number of bytes.
        most: u64,
    },
    /// The text is not JSON, or not of the expected type.
    #[error("not JSON of the expected form: {0}")]
    Syntax(serde_json::Error),
}

/// Read a value.
///
/// # Errors
/// [`JsonError`].
pub fn value(stream: impl Read, limits: Limits) -> Result<Value, JsonError> {
    let left = Cell::new(Some(limits.value_bytes));
    let mut source = serde_json::Deserializer::from_reader(Guarded::buffered(stream, limits));
    let read = Within(&left).deserialize(&mut source);
    let read = read.and_then(|value| source.end().map(|()| value));
    read.map_err(|error| match left.get() {
        None => JsonError::Memory {
            most: limits.value_bytes,
        },
        Some(_) => of_reader(error),
    })
}

/// Read a type. Text and strings are limited in length; the type limits its memory.
///
/// # Errors
/// [`JsonError`].
pub fn typed<T: DeserializeOwned>(stream: impl Read, limits: Limits) -> Result<T, JsonError> {
    serde_json::from_reader(Guarded::buffered(stream, limits)).map_err(of_reader)
}

fn of_reader(error: serde_json::Error) -> JsonError {
    if !error.is_io() {
        return JsonError::Syntax(error);
    }
    let error = io::Error::from(error);
    match error.get_ref().and_then(|inner| inner.downcast_ref()) {
        Some(&TooLong { of, most }) => JsonError::Long { of, most },
        None => JsonError::Io(error),
    }
}

/// Error that ends a stream that is too long.
#[derive(Clone, Copy, Debug, thiserror::Error)]
#[error("more than {most} bytes of {of}")]
struct TooLong {
    of: &'static str,
    most: u64,
}

/// JSON stream that ends with an error if it, or a string in it, is too long.
struct Guarded<R> {
    stream: R,
    limits: Limits,
    bytes: u64,
    /// Bytes of the current string, without its quotes. `None` outside strings.
    string: Option<u64>,
    escaped: bool,
}

impl<R: Read> Guarded<R> {
    fn buffered(stream: R, limits: Limits) -> BufReader<Self> {
        BufReader::new(Self {
            stream,
            limits,
            bytes: 0,
            string: None,
            escaped: false,
        })
    }

    fn look_at(&mut self, bytes: &[u8]) -> Result<(), TooLong> {
        self.bytes += bytes.len() as u64;
        if self.bytes > self.limits.bytes {
            return Err(TooLong {
                of: "JSON",
                most: self.limits.bytes,
            });
        }
        for &byte in bytes {
            // Bytes of a multi-byte character are never quotes or backslashes.
            let Some(count) = self.string else {
                self.string = (byte == b'"').then_some(0);
                continue;
            };
            let ends = byte == b'"' && !self.escaped;
            self.escaped = byte == b'\\' && !self.escaped;
            self.string = (!ends).then_some(count + 1);
            if count >= self.limits.string_bytes && !ends {
                return Err(TooLong {
                    of: "a string in JSON",
                    most: self.limits.string_bytes,
                });
            }
        }
        Ok(())
    }
}

impl<R: Read> Read for Guarded<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.stream.read(buffer)?;
        self.look_at(&buffer[..count]).map_err(io::Error::other)?;
        Ok(count)
    }
}

/// Memory of a list with one element; further elements take less. A list starts with four places, and a growing list
/// holds twice its elements while it is copied.
const LIST_BYTES: u64 = 4 * size_of::<Value>() as u64 + ALLOCATION_BYTES;
const ELEMENT_BYTES: u64 = 3 * size_of::<Value>() as u64;
/// Memory of a map with one entry; further entries take less. Nodes have 11 entries, of which at least half can be
/// empty.
const MAP_BYTES: u64 = 11 * ENTRY_BYTES + 2 * ALLOCATION_BYTES;
const ENTRY_BYTES: u64 = (size_of::<String>() + size_of::<Value>()) as u64;
/// Overhead of the allocator per allocation.
const ALLOCATION_BYTES: u64 = 32;

/// Read an object with one long list and pass its elements to `take` one by one. Returns the values of the keys in
/// `kept` and skips all others. Memory: [`Limits::value_bytes`] for the kept values, and for each element.
///
/// # Errors
/// [`JsonError`], which includes the error of `take` for an element.
pub fn each_element(
    stream: impl Read,
    limits: Limits,
    list: &str,
    kept: &[&str],
    take: &mut dyn FnMut(Value) -> Result<(), String>,
) -> Result<Map<String, Value>, JsonError> {
    let left = Cell::new(Some(limits.value_bytes));
    let mut source = serde_json::Deserializer::from_reader(Guarded::buffered(stream, limits));
    let object = ObjectWithList {
        within: Within(&left),
        limits,
        list,
        kept,
        take,
    };
    let read = source.deserialize_map(object);
    let read = read.and_then(|rest| source.end().map(|()| rest));
    read.map_err(|error| match left.get() {
        None => JsonError::Memory {
            most: limits.value_bytes,
        },
        Some(_) => of_reader(error),
    })
}

struct ObjectWithList<'a> {
    within: Within<'a>,
    limits: Limits,
    list: &'a str,
    kept: &'a [&'a str],
    take: &'a mut dyn FnMut(Value) -> Result<(), String>,
}

impl<'de> Visitor<'de> for ObjectWithList<'_> {
    type Value = Map<String, Value>;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "an object with a list {}", self.list)
    }

    fn visit_map<A: MapAccess<'de>>(mut self, mut entries: A) -> Result<Self::Value, A::Error> {
        let mut rest = Map::new();
        while let Some(key) = entries.next_key::<String>()? {
            if key == self.list {
                entries.next_value_seed(Elements(&mut self))?;
                continue;
            }
            if !self.kept.contains(&key.as_str()) {
                entries.next_value::<IgnoredAny>()?;
                continue;
            }
            self.within.take(key.len() as u64 + MAP_BYTES)?;
            rest.insert(key, entries.next_value_seed(self.within)?);
        }
        Ok(rest)
    }
}

struct Elements<'o, 'a>(&'o mut ObjectWithList<'a>);

impl<'de> DeserializeSeed<'de> for Elements<'_, '_> {
    type Value = ();

    fn deserialize<D: serde::Deserializer<'de>>(self, source: D) -> Result<(), D::Error> {
        source.deserialize_seq(self)
    }
}

impl<'de> Visitor<'de> for Elements<'_, '_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a list")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut elements: A) -> Result<(), A::Error> {
        let Within(left) = self.0.within;
        let of_rest = left.get();
        loop {
            left.set(Some(self.0.limits.value_bytes));
            let Some(element) = elements.next_element_seed(self.0.within)? else {
                left.set(of_rest);
                return Ok(());
            };
            (self.0.take)(element).map_err(A::Error::custom)?;
        }
    }
}

/// Builds a value while it counts down the memory left. `None` once the limit is reached.
#[derive(Clone, Copy)]
struct Within<'a>(&'a Cell<Option<u64>>);

impl Within<'_> {
    fn take<E: Error>(self, bytes: u64) -> Result<(), E> {
        let left = self.0.get().and_then(|left| left.checked_sub(bytes));
        self.0.set(left);
        left.map(drop).ok_or_else(|| E::custom("too much memory"))
    }
}

impl<'de> DeserializeSeed<'de> for Within<'_> {
    type Value = Value;

    fn deserialize<D: serde::Deserializer<'de>>(self, source: D) -> Result<Value, D::Error> {
        source.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Within<'_> {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("any JSON")
    }

    fn visit_bool<E: Error>(self, value: bool) -> Result<Value, E> {
        Ok(Value::Bool(value))
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<Value, E> {
        Ok(Value::Number(value.into()))
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<Value, E> {
        Ok(Value::Number(value.into()))
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<Value, E> {
        Ok(Number::from_f64(value).map_or(Value::Null, Value::Number))
    }

    fn visit_unit<E: Error>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Value, E> {
        self.take(text.len() as u64 + ALLOCATION_BYTES)?;
        Ok(Value::String(text.to_owned()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut elements: A) -> Result<Value, A::Error> {
        let mut list = Vec::new();
        while let Some(element) = elements.next_element_seed(self)? {
            self.take(if list.is_empty() {
                LIST_BYTES
            } else {
                ELEMENT_BYTES
            })?;
            list.push(element);
        }
        Ok(Value::Array(list))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<Value, A::Error> {
        let mut map = Map::new();
        while let Some(key) = entries.next_key::<String>()? {
            let own = key.len() as u64 + ALLOCATION_BYTES;
            self.take(
                own + if map.is_empty() {
                    MAP_BYTES
                } else {
                    2 * ENTRY_BYTES
                },
            )?;
            let value = entries.next_value_seed(self)?;
            map.insert(key, value);
        }
        Ok(Value::Object(map))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits {
        bytes: 1 << 20,
        string_bytes: 1 << 10,
        value_bytes: 64 << 10,
    };

    #[test]
    fn values_equal_those_of_serde_json() {
        for text in [
            "null",
            "[]",
            r#"{"a":[1,-2,0.1,1e300,true,null,"\"\\\u00e9 é"],"b":{"c":{}},"b2":18446744073709551615}"#,
            " [[[]], {}] ",
        ] {
            let plain: Value = serde_json::from_str(text).unwrap();
            assert_eq!(value(text.as_bytes(), LIMITS).unwrap(), plain, "{text}");
        }
        for text in ["", "[1", "{} x", "[1e999]"] {
            assert!(serde_json::from_str::<Value>(text).is_err());
            let error = value(text.as_bytes(), LIMITS).unwrap_err();
            assert!(matches!(error, JsonError::Syntax(_)), "{text}: {error}");
        }
    }

    #[test]
    fn long_texts_and_strings_end_at_their_limits() {
        let text = " ".repeat(1 << 20) + "1";
        let error = value(text.as_bytes(), LIMITS).unwrap_err();
        assert!(
            matches!(error, JsonError::Long { of: "JSON", .. }),
            "{error}"
        );
        let error = typed::<Value>(text.as_bytes(), LIMITS).unwrap_err();
        assert!(matches!(error, JsonError::Long { .. }), "{error}");
        let string = |count: usize| format!("[\"{}\\\"\"]", "é".repeat(count / 2));
        assert!(value(string(1022).as_bytes(), LIMITS).is_ok());
        let error = value(string(1024).as_bytes(), LIMITS).unwrap_err();
        assert!(error.to_string().contains("a string"), "{error}");
    }

    /// The length of each text is at most a tenth of the limit.
    #[test]
    fn memory_limit_counts_small_elements() {
        for element in ["0,", "{},", "[0],", "{\"\":0},", "[[0],[0]],"] {
            let mut text = "[".to_owned() + &element.repeat((6 << 10) / element.len());
            text.pop();
            text.push(']');
            let small = Limits {
                value_bytes: 6 << 10,
                ..LIMITS
            };
            let error = value(text.as_bytes(), small).unwrap_err();
            assert!(
                matches!(error, JsonError::Memory { .. }),
                "{element} {error}"
            );
        }
    }

    #[test]
    fn long_list_elements_are_passed_one_by_one() {
        let text = format!(
            r#"{{"a":[1],"all":[{}[3]],"b":{{"c":2}}}}"#,
            "[2],".repeat(5000)
        );
        let mut seen = Vec::new();
        let rest = each_element(
            text.as_bytes(),
            LIMITS,
            "all",
            &["a", "b"],
            &mut |element| {
                seen.push(element[0].as_u64().unwrap());
                Ok(())
            },
        );
        assert_eq!(
            Value::Object(rest.unwrap()),
            serde_json::json!({"a": [1], "b": {"c": 2}})
        );
        assert_eq!((seen.len(), seen[0], seen[5000]), (5001, 2, 3));
        let refused = each_element(text.as_bytes(), LIMITS, "all", &["a"], &mut |_| {
            Err("why".to_owned())
        });
        assert!(refused.unwrap_err().to_string().contains("why"));
        let skipped = format!(r#"{{"all":[],"rest":[{}0]}}"#, "{},".repeat(100_000));
        let rest = each_element(skipped.as_bytes(), LIMITS, "all", &["a"], &mut |_| Ok(()));
        assert!(rest.unwrap().is_empty());
        let large = text.replacen("[2]", &format!("[{}1]", "{},".repeat(1000)), 1);
        let error =
            each_element(large.as_bytes(), LIMITS, "all", &["a"], &mut |_| Ok(())).unwrap_err();
        assert!(matches!(error, JsonError::Memory { .. }), "{error}");
    }

    #[test]
    fn unnamed_fields_are_skipped() {
        #[derive(serde::Deserialize)]
        struct Schema {
            schema: Option<String>,
        }
        let text = format!(r#"{{"big":[{}0],"schema":"s"}}"#, "{},".repeat(100_000));
        let read: Schema = typed(text.as_bytes(), LIMITS).unwrap();
        assert_eq!(read.schema.as_deref(), Some("s"));
    }
}
