//! Series of cases: a named case alone, or the cases in which pixels, pulses or range bins grow.
//!
//! One of the three is doubled some times while the others have the middle values; the exponent of a series is the slope of the
//! least-squares line through the logarithms of sizes and processor times. More pixels are a larger scene, more pulses a denser track, more
//! samples a longer swath; resolution and aperture stay constant. An exponent of 1 is linear growth; work that does not depend on the size
//! lowers it towards 0.

use crate::case::Case;

/// Pulses, samples and pixels along each side, while not varied.
const MIDDLE: [usize; 3] = [1024, 1024, 512];

/// Varied quantity: name, index in a case's name, values, and the power of it in the count (pixels are a square).
const VARIED: [(&str, usize, [usize; 4], i32); 3] = [
    ("pixels", 2, [192, 384, 768, 1536], 2),
    ("pulses", 0, [512, 1024, 2048, 4096], 1),
    ("range bins", 1, [512, 1024, 2048, 4096], 1),
];

/// Cases whose measurements share a row.
#[derive(Clone, Debug)]
pub(crate) struct Series {
    /// Name in the table.
    pub(crate) name: String,
    /// Line of the list above the table.
    pub(crate) description: String,
    pub(crate) cases: Vec<Case>,
    /// Values of the varied quantity, one for each case.
    pub(crate) sizes: Vec<f64>,
}

impl Series {
    /// Series of a word of the command line: a case, or `growth`.
    ///
    /// # Errors
    /// List of the names, if there is no such case.
    pub(crate) fn named(word: &str) -> Result<Vec<Self>, String> {
        if word == "growth" {
            return Ok(VARIED.map(Self::growing).into());
        }
        let case = Case::named(word)?;
        Ok(vec![Self {
            name: case.name.clone(),
            description: case.to_string(),
            cases: vec![case],
            sizes: vec![1.0],
        }])
    }

    fn growing((name, place, values, power): (&str, usize, [usize; 4], i32)) -> Self {
        let sizes = |value| {
            let mut sizes = MIDDLE;
            sizes[place] = value;
            sizes.map(|n| n.to_string()).join("x")
        };
        let cases = values.map(|value| Case::named(&sizes(value)).expect("it is well-formed"));
        let names: Vec<&str> = cases.iter().map(|case| case.name.as_str()).collect();
        Self {
            name: format!("growth: {name}"),
            description: format!("growth: {name}: {}", names.join(", ")),
            sizes: values.map(|value| (value as f64).powi(power)).into(),
            cases: cases.into(),
        }
    }

    /// Whether a quantity varies.
    pub(crate) fn grows(&self) -> bool {
        self.cases.len() > 1
    }
}
