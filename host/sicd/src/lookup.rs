//! Lookup of values by path in SICD and SIDD XML of any version.

use glam::DVec3;
use roxmltree::{Document, Node};
use subaperture_io::xml::check;

use crate::polynomial::Path;

/// Largest supported exponent of a polynomial.
const MAX_ORDER: usize = 40;

/// Parse XML that takes at most `memory_bytes`.
pub(crate) fn document(xml: &str, memory_bytes: u64) -> Result<Document<'_>, String> {
    check(xml, memory_bytes).map_err(|fault| format!("XML: {fault}"))?;
    Document::parse(xml).map_err(|error| format!("XML: {error}"))
}

/// Element below which values are looked up; missing, invalid and non-finite values are `None`.
#[derive(Clone, Copy)]
pub(crate) struct Lookup<'a, 'b>(Node<'a, 'b>);

impl<'a, 'b> Lookup<'a, 'b> {
    pub(crate) fn of(node: Node<'a, 'b>) -> Self {
        Self(node)
    }

    fn at(self, path: &[&str]) -> Option<Self> {
        path.iter().try_fold(self, |Self(node), name| {
            node.children()
                .find(|child| child.tag_name().name() == *name)
                .map(Self)
        })
    }

    fn own_number(self) -> Option<f64> {
        let value: f64 = self.0.text()?.trim().parse().ok()?;
        value.is_finite().then_some(value)
    }

    pub(crate) fn text(self, path: &[&str]) -> Option<&'a str> {
        self.at(path)?.0.text().map(str::trim)
    }

    pub(crate) fn number(self, path: &[&str]) -> Option<f64> {
        self.at(path)?.own_number()
    }

    /// Vector of the children `X`, `Y` and `Z`.
    pub(crate) fn vector(self, path: &[&str]) -> Option<DVec3> {
        let own = self.at(path)?;
        let [x, y, z] = ["X", "Y", "Z"].map(|name| own.number(&[name]));
        Some(DVec3::new(x?, y?, z?))
    }

    /// Coefficients `[i][j]` of `x^i y^j`; `j` is 0 for a polynomial of one variable.
    pub(crate) fn polynomial(self, path: &[&str]) -> Option<Vec<Vec<f64>>> {
        let mut coefficients: Vec<Vec<f64>> = Vec::new();
        let Self(node) = self.at(path)?;
        for coefficient in node
            .children()
            .filter(|child| child.tag_name().name() == "Coef")
        {
            let power = |name: &str| match coefficient.attribute(name) {
                None => Some(0),
                Some(text) => text.parse::<usize>().ok().filter(|&n| n <= MAX_ORDER),
            };
            let (i, j) = (power("exponent1")?, power("exponent2")?);
            if coefficients.len() <= i {
                coefficients.resize(i + 1, Vec::new());
            }
            let row = &mut coefficients[i];
            if row.len() <= j {
                row.resize(j + 1, 0.0);
            }
            row[j] = Self(coefficient).own_number()?;
        }
        (!coefficients.is_empty()).then_some(coefficients)
    }

    /// Coefficients of a polynomial of one variable.
    pub(crate) fn line(self, path: &[&str]) -> Option<Vec<f64>> {
        let rows = self.polynomial(path)?.into_iter();
        Some(
            rows.map(|row| row.first().copied().unwrap_or(0.0))
                .collect(),
        )
    }

    /// Position polynomial over time.
    pub(crate) fn path(self, path: &[&str]) -> Option<Path> {
        let own = self.at(path)?;
        let [x, y, z] = ["X", "Y", "Z"].map(|name| own.line(&[name]));
        let (x, y, z) = (x?, y?, z?);
        let of = |line: &[f64], k: usize| line.get(k).copied().unwrap_or(0.0);
        let count = x.len().max(y.len()).max(z.len());
        Some(Path {
            coefficients: (0..count)
                .map(|k| DVec3::new(of(&x, k), of(&y, k), of(&z, k)))
                .collect(),
            off_m: 0.0,
        })
    }
}
