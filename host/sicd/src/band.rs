//! Spectrum of a SICD's samples, from its metadata; needed to interpolate between pixels.

use subaperture_io::container::{self, Element};
use subaperture_io::xml::DEFAULT_MEMORY_BYTES;

use crate::lookup;
use crate::projection::of_two;

/// Spectrum along one image direction.
#[derive(Clone, Debug)]
struct Direction {
    /// Bandwidth, cycles per sample.
    width: f64,
    /// Centre (`DeltaKCOAPoly`), cycles per sample; coefficients of metres along rows and columns.
    middle: Vec<Vec<f64>>,
}

/// Spectrum along rows and columns.
#[derive(Clone, Debug)]
pub struct Band([Direction; 2]);

impl Band {
    /// Parse a SICD's XML. Without `ImpRespBW` the full sampling bandwidth is assumed. `None` if the sample spacing is missing.
    pub fn of(xml: &str) -> Option<Self> {
        let document = container::parse(xml, DEFAULT_MEMORY_BYTES).ok()?;
        let root = Element::root(&document);
        let of = |axis: &str| {
            let number = |name: &str| lookup::number(root, &["Grid", axis, name]);
            let spacing_m = number("SS").filter(|step| *step > 0.0)?;
            let width = number("ImpRespBW").map_or(1.0, |band| band * spacing_m);
            // Sgn -1: the phase of samples is exp(2 pi i K x).
            let scale = -number("Sgn").unwrap_or(-1.0).signum() * spacing_m;
            let middle = root.find(&["Grid", axis, "DeltaKCOAPoly"]);
            let middle = middle.and_then(|element| lookup::polynomial(element).ok());
            let scaled = |row: Vec<f64>| row.into_iter().map(|c| c * scale).collect();
            Some(Direction {
                width: if width > 0.0 { width.min(1.0) } else { 1.0 },
                middle: middle.unwrap_or_default().into_iter().map(scaled).collect(),
            })
        };
        Some(Self([of("Row")?, of("Col")?]))
    }

    /// Bandwidth, cycles per row and per column, at most 1.
    pub fn widths(&self) -> [f64; 2] {
        [0, 1].map(|k| self.0[k].width)
    }

    /// Centre at a position (metres along rows and columns from the scene centre point), cycles per row and per column; `None` if the metadata give no finite number.
    pub fn middle(&self, along_m: [f64; 2]) -> Option<[f64; 2]> {
        let middle = [0, 1].map(|k| of_two(&self.0[k].middle, along_m));
        middle.iter().all(|k| k.is_finite()).then_some(middle)
    }
}
