//! Errors of the image formers as the guide states them, read from its page.

use std::fs;

use crate::subap::root;

/// Allowed difference between a measured error and the guide's, dB: half of the printed digit, and as much for Fourier transforms of other
/// processors.
pub const OFF_DB: f64 = 0.1;

/// Text of the guide's page with the errors.
pub fn text() -> String {
    fs::read_to_string(root().join("host/guide/src/concepts/error-bounds.md")).unwrap()
}

/// Error, dB, in a column of the row that begins with `former`. Columns are Table 4.1 by 26 sub-CPIs, by 8, and GOTCHA.
///
/// # Panics
/// Panics if there is no such row or figure.
pub fn figure_db(former: &str, column: usize) -> f64 {
    let text = text();
    let start = format!("| {former} |");
    let row = text.lines().find(|line| line.starts_with(&start));
    let row = row.unwrap_or_else(|| panic!("the guide has no row '{start}'"));
    let cell = row.split('|').nth(column + 2).unwrap_or_default().trim();
    let number = cell.split(' ').next().unwrap_or_default();
    number
        .parse()
        .unwrap_or_else(|_| panic!("no figure in column {column} of {row}"))
}

/// Message if a stated error differs from the measured one.
pub fn misstated(name: &str, measured_db: f64, stated_db: f64) -> Option<String> {
    println!("{name}: {measured_db:.1} dB, guide {stated_db} dB");
    ((measured_db - stated_db).abs() > OFF_DB)
        .then(|| format!("{name}: measured {measured_db:.1} dB, the guide states {stated_db} dB"))
}
