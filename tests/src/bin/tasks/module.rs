//! Report of the module's costs.

use std::fs;
use std::process::ExitCode;

use subaperture_tests::module_report;

/// Write the report, or compare it with the existing one.
pub(crate) fn report(check: bool) -> ExitCode {
    match write_or_compare(check) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

fn write_or_compare(check: bool) -> Result<(), String> {
    let text = module_report::render(&module_report::measure_all()?);
    let place = module_report::place();
    let error_at = |error| format!("{}: {error}", place.display());
    if !check {
        fs::write(&place, text).map_err(error_at)?;
        println!("{}", place.display());
        return Ok(());
    }
    let there = fs::read_to_string(&place).map_err(error_at)?;
    let other = there.lines().zip(text.lines()).find(|(a, b)| a != b);
    match other {
        Some((there, measured)) => Err(format!(
            "firmware/REPORT.md is out of date; run  cargo xtask module-report\n  there    {there}\n  \
             measured {measured}"
        )),
        None if there.len() == text.len() => Ok(()),
        None => Err("firmware/REPORT.md is out of date; run  cargo xtask module-report".to_owned()),
    }
}
