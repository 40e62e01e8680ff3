//! Polynomials in SICD and SIDD XML of any version.

use glam::DVec3;
use subaperture_io::container::{self, Element, MetadataError};

use crate::polynomial::Path;

/// Largest supported exponent of a polynomial.
const MAX_ORDER: usize = 40;

/// Call `read` with the root element of XML that takes at most `memory_bytes`.
pub(crate) fn with_root<T>(
    xml: &str,
    memory_bytes: u64,
    read: impl FnOnce(Element) -> Result<T, MetadataError>,
) -> Result<T, MetadataError> {
    let document = container::parse(xml, memory_bytes)?;
    read(Element::root(&document))
}

/// Version of the standard, from the namespace of its root element.
pub(crate) fn version(root: Element, standard: &str) -> Result<String, MetadataError> {
    let version = root.namespace().strip_prefix("urn:").and_then(|rest| {
        let rest = rest.strip_prefix(standard)?.strip_prefix(':')?;
        (root.name() == standard && !rest.is_empty()).then(|| rest.to_owned())
    });
    version.ok_or_else(|| {
        root.fault(format!(
            "expected {standard} XML, found element '{}' in namespace '{}'",
            root.name(),
            root.namespace()
        ))
    })
}

/// Text of an element; empty if it is missing.
pub(crate) fn text(root: Element, path: &[&str]) -> String {
    let element = root.find(path);
    element.map_or_else(String::new, |element| element.text().into_owned())
}

/// Number of an element; `None` if it is missing or not a finite number.
pub(crate) fn number(root: Element, path: &[&str]) -> Option<f64> {
    root.find(path)?.number().ok()
}

/// Coefficients `[i][j]` of `x^i y^j`; `j` is 0 for a polynomial of one variable.
pub(crate) fn polynomial(element: Element) -> Result<Vec<Vec<f64>>, MetadataError> {
    let mut coefficients: Vec<Vec<f64>> = Vec::new();
    for coefficient in element.children("Coef") {
        let power = |name: &str| match coefficient.attribute(name) {
            None => Ok(0),
            Some(text) => {
                let power = text.parse::<usize>().ok().filter(|&n| n <= MAX_ORDER);
                power.ok_or_else(|| {
                    let what = format!("expected {name} from 0 to {MAX_ORDER}, found '{text}'");
                    coefficient.fault(what)
                })
            }
        };
        let (i, j) = (power("exponent1")?, power("exponent2")?);
        if coefficients.len() <= i {
            coefficients.resize(i + 1, Vec::new());
        }
        let row = &mut coefficients[i];
        if row.len() <= j {
            row.resize(j + 1, 0.0);
        }
        row[j] = coefficient.number()?;
    }
    match coefficients.is_empty() {
        true => Err(element.fault("expected coefficients (Coef), found none")),
        false => Ok(coefficients),
    }
}

/// Coefficients of a polynomial of one variable.
pub(crate) fn line(element: Element) -> Result<Vec<f64>, MetadataError> {
    let rows = polynomial(element)?.into_iter();
    Ok(rows
        .map(|row| row.first().copied().unwrap_or(0.0))
        .collect())
}

/// Position polynomial over time.
pub(crate) fn path(element: Element) -> Result<Path, MetadataError> {
    let axis = |name| line(element.child(name)?);
    let (x, y, z) = (axis("X")?, axis("Y")?, axis("Z")?);
    let of = |line: &[f64], k: usize| line.get(k).copied().unwrap_or(0.0);
    let count = x.len().max(y.len()).max(z.len());
    Ok(Path {
        coefficients: (0..count)
            .map(|k| DVec3::new(of(&x, k), of(&y, k), of(&z, k)))
            .collect(),
        off_m: 0.0,
    })
}
