//! Where the spectrum of anyone's samples is: what reading them between pixels takes.

use roxmltree::Document;

use crate::lookup::Lookup;
use crate::projection::of_two;

/// Of one direction of an image.
#[derive(Clone, Debug)]
struct Direction {
    /// Cycles a sample that the spectrum fills.
    width: f64,
    /// `DeltaKCOAPoly` in cycles a sample, of metres along rows and columns.
    middle: Vec<Vec<f64>>,
}

/// The spectrum along rows and columns.
#[derive(Clone, Debug)]
pub struct Band([Direction; 2]);

impl Band {
    /// Of a SICD's XML; where it does not say how wide a spectrum is, all of what samples hold is taken.
    pub fn of(xml: &str) -> Option<Self> {
        let document = Document::parse(xml).ok()?;
        let root = Lookup::of(document.root_element());
        let of = |way: &str| {
            let number = |name: &str| root.number(&["Grid", way, name]);
            let spacing_m = number("SS").filter(|step| *step > 0.0)?;
            let width = number("ImpRespBW").map_or(1.0, |band| band * spacing_m);
            // Sgn -1: samples turn as exp(2 pi i K x).
            let scale = -number("Sgn").unwrap_or(-1.0).signum() * spacing_m;
            let middle = root.polynomial(&["Grid", way, "DeltaKCOAPoly"]);
            let scaled = |row: Vec<f64>| row.into_iter().map(|c| c * scale).collect();
            Some(Direction {
                width: if width > 0.0 { width.min(1.0) } else { 1.0 },
                middle: middle.unwrap_or_default().into_iter().map(scaled).collect(),
            })
        };
        Some(Self([of("Row")?, of("Col")?]))
    }

    /// Cycles a row and a column that it fills, 1 at the most.
    pub fn widths(&self) -> [f64; 2] {
        [0, 1].map(|k| self.0[k].width)
    }

    /// Cycles a row and a column of its middle, metres along rows and columns from the SCP; none where the metadata are no numbers there.
    pub fn middle(&self, along_m: [f64; 2]) -> Option<[f64; 2]> {
        let middle = [0, 1].map(|k| of_two(&self.0[k].middle, along_m));
        middle.iter().all(|k| k.is_finite()).then_some(middle)
    }
}
