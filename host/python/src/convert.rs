//! Conversions between Python's values and the library's.

use std::path::PathBuf;

use num_complex::Complex32;
use numpy::{
    Element, PyArray1, PyArray2, PyArrayDescrMethods, PyArrayDyn, PyArrayMethods,
    PyReadonlyArrayDyn, PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::Value;
use subaperture::focus::machine;
use subaperture::glam::DVec3;
use subaperture::io::npy::{Array, Values};
use subaperture::signal::window::Window;

use crate::errors::Error;

/// JSON value as an object of Python's module `json`.
pub(crate) fn object<'py>(py: Python<'py>, value: &Value) -> PyResult<Bound<'py, PyAny>> {
    py.import("json")?
        .call_method1("loads", (value.to_string(),))
}

/// Object that Python's module `json` can write, as a JSON value.
pub(crate) fn json(object: &Bound<'_, PyAny>) -> Result<Value, Error> {
    let json = object.py().import("json")?;
    let text: String = json.call_method1("dumps", (object,))?.extract()?;
    serde_json::from_str(&text).map_err(Error::argument)
}

/// Memory limit: bytes, a text such as `2G`, or half of the machine's memory.
#[derive(Clone, FromPyObject)]
pub(crate) enum Memory {
    Bytes(u64),
    Text(String),
}

/// Bytes of a memory limit.
pub(crate) fn memory_bytes(memory: Option<Memory>) -> Result<u64, Error> {
    const MIN_BYTES: u64 = 1 << 20;
    let bytes = match &memory {
        None => return Ok(machine::default_bytes()),
        Some(Memory::Bytes(bytes)) => Some(*bytes),
        Some(Memory::Text(text)) => {
            let digits = text.trim_end_matches(['K', 'M', 'G', 'T']);
            let shift = match &text[digits.len()..] {
                "" => Some(0),
                "K" => Some(10),
                "M" => Some(20),
                "G" => Some(30),
                "T" => Some(40),
                _ => None,
            };
            let count: Option<u64> = digits.parse().ok();
            count
                .zip(shift)
                .and_then(|(count, shift)| count.checked_mul(1 << shift))
        }
    };
    bytes.filter(|bytes| *bytes >= MIN_BYTES).ok_or_else(|| {
        Error::argument("memory: expected bytes or a text such as '512M' or '2G', at least 1M")
    })
}

/// Windows over fast and slow time.
pub(crate) fn windows(fast: Option<&str>, slow: Option<&str>) -> Result<[Window; 2], Error> {
    let window = |name: &str, text: Option<&str>| match text {
        None => Ok(Window::default()),
        Some(text) => text
            .parse()
            .map_err(|error| Error::argument(format!("{name}: {error}"))),
    };
    Ok([window("window", fast)?, window("slow_window", slow)?])
}

/// Positions as an array of n x 3.
pub(crate) fn positions(
    py: Python<'_>,
    positions: impl ExactSizeIterator<Item = DVec3>,
) -> Bound<'_, PyArray2<f64>> {
    let count = positions.len();
    let values: Vec<f64> = positions.flat_map(|position| position.to_array()).collect();
    matrix(py, [count, 3], values)
}

/// Array of rows x columns that takes over `values`.
pub(crate) fn matrix<T: Element>(
    py: Python<'_>,
    size: [usize; 2],
    values: Vec<T>,
) -> Bound<'_, PyArray2<T>> {
    PyArray1::from_vec(py, values)
        .reshape(size)
        .expect("as many values as pixels")
}

/// Array of any numeric type as an array of the library: complex numbers as complex64, real ones as float64.
pub(crate) fn array(name: &str, value: &Bound<'_, PyAny>) -> Result<Array, Error> {
    let numpy = value.py().import("numpy")?;
    let made = numpy.call_method1("asarray", (value,))?;
    let untyped = made.cast::<PyUntypedArray>().map_err(PyErr::from)?;
    let shape = untyped.shape().to_vec();
    let kind = untyped.dtype().kind();
    let float = match kind {
        b'c' => "complex64",
        b'f' | b'i' | b'u' | b'b' => "float64",
        _ => {
            return Err(Error::argument(format!(
                "{name}: expected an array of numbers, found dtype {}",
                untyped.dtype()
            )));
        }
    };
    // Without a copy if type and order are these already.
    let float = numpy.call_method1("ascontiguousarray", (made, float))?;
    let values = match kind {
        b'c' => Values::Complex(in_order(&extracted::<Complex32>(&float)?)),
        _ => Values::Real(in_order(&extracted::<f64>(&float)?)),
    };
    Ok(Array {
        shape,
        values,
        integer_range: None,
    })
}

/// Table of numbers: the path of a CSV file, or an array.
#[derive(FromPyObject)]
pub(crate) enum Table<'py> {
    File(PathBuf),
    Numbers(Bound<'py, PyAny>),
}

/// Real numbers of an array with its shape.
pub(crate) fn numbers(
    name: &str,
    value: &Bound<'_, PyAny>,
) -> Result<(Vec<usize>, Vec<f64>), Error> {
    match array(name, value)? {
        Array {
            shape,
            values: Values::Real(values),
            ..
        } => Ok((shape, values)),
        _ => Err(Error::argument(format!(
            "{name}: expected real numbers, found complex ones"
        ))),
    }
}

/// Times, seconds, and positions, metres, of an array of n x 4.
pub(crate) fn timed_positions(
    name: &str,
    value: &Bound<'_, PyAny>,
) -> Result<(Vec<f64>, Vec<DVec3>), Error> {
    let (shape, values) = numbers(name, value)?;
    let [_, 4] = shape[..] else {
        return Err(Error::argument(format!(
            "{name}: expected an array of n x 4 (time_s, x_m, y_m, z_m), found the shape {shape:?}"
        )));
    };
    let rows = values.chunks_exact(4);
    Ok(rows
        .map(|row| (row[0], DVec3::new(row[1], row[2], row[3])))
        .unzip())
}

fn extracted<'py, T: Element>(
    array: &Bound<'py, PyAny>,
) -> Result<PyReadonlyArrayDyn<'py, T>, Error> {
    let array = array.cast::<PyArrayDyn<T>>().map_err(PyErr::from)?;
    array.try_readonly().map_err(Error::argument)
}

/// Values of an array in C order.
fn in_order<T: Element + Clone>(array: &PyReadonlyArrayDyn<'_, T>) -> Vec<T> {
    let values = array.as_slice().expect("an array in C order");
    values.to_vec()
}

/// Arguments that are not `None`, as a JSON object.
pub(crate) fn given(
    arguments: Option<&Bound<'_, PyDict>>,
) -> Result<serde_json::Map<String, Value>, Error> {
    let mut given = serde_json::Map::new();
    for (name, value) in arguments.into_iter().flatten() {
        if !value.is_none() {
            given.insert(name.extract()?, json(&value)?);
        }
    }
    Ok(given)
}
