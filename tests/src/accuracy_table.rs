//! Measured errors of the image formers as the guide states them, read from its page.

use std::fs;

use crate::subap::root;

/// Largest difference between a figure as measured and as the guide prints it, dB: the digit printed, and as much for Fourier transforms of other
/// processors.
pub const OFF_DB: f64 = 0.1;

/// The page of the guide that states them.
pub fn text() -> String {
    fs::read_to_string(root().join("host/guide/src/concepts/error-bounds.md")).unwrap()
}

/// The figure, dB, in a column of the row of the table of errors that begins with `former`: columns are Table 4.1 by 26 sub-CPIs, by 8, and GOTCHA.
///
/// # Panics
/// If there is no such row or figure.
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

/// What is wrong with a stated figure, if it is not the one measured.
pub fn misstated(what: &str, measured_db: f64, stated_db: f64) -> Option<String> {
    println!("{what}: {measured_db:.1} dB, guide {stated_db} dB");
    ((measured_db - stated_db).abs() > OFF_DB)
        .then(|| format!("{what}: measured {measured_db:.1} dB, the guide states {stated_db} dB"))
}
