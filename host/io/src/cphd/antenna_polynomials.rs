//! Polynomials of the `Antenna` branch, of one or two variables, as terms.

use crate::container::{Element, MetadataError};

/// Most coefficients of a polynomial.
const MAX_COEFFICIENTS: usize = 1024;
/// Largest exponent of a polynomial.
const MAX_EXPONENT: u64 = 64;

/// Terms of a polynomial of one variable: exponent, coefficient.
pub(super) type Line = Vec<(u32, f64)>;

/// Terms of a polynomial of two variables: exponents, coefficient.
pub(super) type Surface = Vec<(u32, u32, f64)>;

pub(super) fn line(parent: &Element, name: &'static str) -> Result<Line, MetadataError> {
    let terms = terms(&parent.child(name)?, &["exponent1"])?;
    Ok(terms.into_iter().map(|(e, value)| (e[0], value)).collect())
}

pub(super) fn surface(parent: &Element, name: &'static str) -> Result<Surface, MetadataError> {
    let terms = terms(&parent.child(name)?, &["exponent1", "exponent2"])?;
    Ok(terms
        .into_iter()
        .map(|(e, value)| (e[0], e[1], value))
        .collect())
}

fn terms(
    polynomial: &Element,
    exponents: &[&'static str],
) -> Result<Vec<([u32; 2], f64)>, MetadataError> {
    let mut terms = Vec::new();
    for coefficient in polynomial.children("Coef") {
        if terms.len() == MAX_COEFFICIENTS {
            return Err(
                polynomial.fault(format!("expected at most {MAX_COEFFICIENTS} coefficients"))
            );
        }
        let mut of = [0; 2];
        for (exponent, name) in of.iter_mut().zip(exponents) {
            let text = coefficient.attribute(name).unwrap_or_default();
            let number = text.parse::<u64>().ok().filter(|n| *n <= MAX_EXPONENT);
            let number = number.ok_or_else(|| {
                let fault = format!("expected {name} from 0 to {MAX_EXPONENT}, found '{text}'");
                coefficient.fault(fault)
            })?;
            *exponent = number as u32;
        }
        terms.push((of, coefficient.number()?));
    }
    Ok(terms)
}

pub(super) fn value(line: &[(u32, f64)], at: f64) -> f64 {
    line.iter()
        .map(|&(n, coefficient)| coefficient * libm::pow(at, f64::from(n)))
        .sum()
}

pub(super) fn value_of_two(terms: &[(u32, u32, f64)], [x, y]: [f64; 2]) -> f64 {
    let power = |x: f64, n: u32| libm::pow(x, f64::from(n));
    terms
        .iter()
        .map(|&(m, n, coefficient)| coefficient * power(x, m) * power(y, n))
        .sum()
}
