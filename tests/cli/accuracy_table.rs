//! The guide's figures of the formers' errors on Table 4.1, as `subap demo` measures them.

use std::fs;

use serde_json::Value;
use subaperture_tests::accuracy_table::{figure_db, misstated, text};
use subaperture_tests::subap::run;

#[test]
fn guide_states_the_errors_that_demo_measures() {
    let folder = tempfile::tempdir().unwrap();
    let ran = run(folder.path(), "demo -q --out demo");
    assert!(!ran.succeeded().contains("MISSED"));
    let errors = fs::read(folder.path().join("demo/errors.json")).unwrap();
    let errors: Value = serde_json::from_slice(&errors).unwrap();
    let error_db = |folder: &str| {
        let formers = errors["formers"].as_array().unwrap();
        let former = formers.iter().find(|former| former["folder"] == folder);
        former.unwrap()["comparison"]["error_db"].as_f64().unwrap()
    };
    let figures = [
        ("bp", "`bp`, -60 dB asked", 0),
        ("ffbp", "`ffbp`, -60 dB asked", 0),
        ("precise-40", "`rdbp --mode precise`, -60 dB asked", 0),
        ("precise-130", "`rdbp --mode precise`, -60 dB asked", 1),
        ("thesis-40", "`rdbp --mode thesis`", 0),
        ("thesis-130", "`rdbp --mode thesis`", 1),
    ];
    let wrong: Vec<String> = figures
        .into_iter()
        .filter_map(|(folder, row, column)| {
            misstated(folder, error_db(folder), figure_db(row, column))
        })
        .collect();
    // The sentence after the table, in whole decibels.
    let names = ["omega-k", "rda", "pfa", "ffbp"];
    let [a, b, c, d] = names.map(|name| format!("{:.0}", error_db(name)));
    let stated = format!("by `subap demo`: {a}, {b}, {c} and {d} dB");
    let is_stated = text().replace('\n', " ").contains(&stated);
    assert!(wrong.is_empty() && is_stated, "{wrong:#?} {stated}");
}
