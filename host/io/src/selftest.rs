//! Checks of a hardware self-test, and their report: a JSON file that a user can send to the developers.

use std::io::Write;
use std::path::Path;

use serde::Serialize;

use crate::atomic::{WriteError, write_atomically};

/// Result of a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// The value is within its limits.
    Passed,
    /// The value is outside its limits.
    Failed,
    /// No value, with the reason in [`Check::note`].
    #[serde(rename = "not measured")]
    NotMeasured,
}

impl Verdict {
    /// Name of the verdict in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Passed => "passed",
            Self::Failed => "failed",
            Self::NotMeasured => "not measured",
        }
    }
}

/// Measured value with its limits.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Check {
    /// Name of the quantity.
    pub name: String,
    /// Result of the comparison with the limits.
    pub verdict: Verdict,
    /// Measured value in `unit`.
    pub value: Option<f64>,
    /// Unit of value and limits; empty for counts.
    pub unit: &'static str,
    /// Lowest permitted value in `unit`.
    pub least: Option<f64>,
    /// Highest permitted value in `unit`.
    pub most: Option<f64>,
    /// Derivation of the limits.
    pub limit: String,
    /// Advice after a failure, reason for a missing value, or further figures.
    pub note: String,
}

impl Check {
    /// Judge a value by its limits. A value that is not finite fails.
    pub fn measured(
        name: impl Into<String>,
        (value, unit): (f64, &'static str),
        (least, most): (Option<f64>, Option<f64>),
        limit: impl Into<String>,
    ) -> Self {
        let within = value.is_finite()
            && least.is_none_or(|least| value >= least)
            && most.is_none_or(|most| value <= most);
        Self {
            name: name.into(),
            verdict: if within {
                Verdict::Passed
            } else {
                Verdict::Failed
            },
            value: Some(value),
            unit,
            least,
            most,
            limit: limit.into(),
            note: String::new(),
        }
    }

    /// Judge a count of faults: 0 passes.
    pub fn faults(name: impl Into<String>, count: u64, limit: impl Into<String>) -> Self {
        Self::measured(name, (count as f64, ""), (None, Some(0.0)), limit)
    }

    /// Check without a value, for the reason `why`.
    pub fn not_measured(name: impl Into<String>, unit: &'static str, why: &str) -> Self {
        Self {
            name: name.into(),
            verdict: Verdict::NotMeasured,
            value: None,
            unit,
            least: None,
            most: None,
            limit: String::new(),
            note: why.to_owned(),
        }
    }

    /// Append `text` to the note.
    #[must_use]
    pub fn noted(mut self, text: &str) -> Self {
        if !self.note.is_empty() {
            self.note += ". ";
        }
        self.note += text;
        self
    }

    /// Append advice to the note if the check failed.
    #[must_use]
    pub fn advised(self, advice: &str) -> Self {
        match self.verdict {
            Verdict::Failed => self.noted(advice),
            _ => self,
        }
    }
}

/// Report of a self-test. `A` describes the tested device; its fields are those of the JSON object.
#[derive(Clone, Debug, Serialize)]
pub struct Report<A> {
    /// Name of the format.
    pub schema: &'static str,
    /// Version of the format.
    pub schema_version: u32,
    /// Version of this library.
    pub library: &'static str,
    /// UTC time of the test, ISO 8601.
    pub date: String,
    /// Description of the tested device.
    #[serde(flatten)]
    pub about: A,
    /// Whether no check failed.
    pub passed: bool,
    /// Checks in the order of the test.
    pub checks: Vec<Check>,
}

impl<A: Serialize> Report<A> {
    /// Make the report of the checks of a device, in the format `schema`, whose name begins with `subaperture-`.
    pub fn new(schema: &'static str, date: String, about: A, checks: Vec<Check>) -> Self {
        Self {
            schema,
            schema_version: 1,
            library: env!("CARGO_PKG_VERSION"),
            date,
            about,
            passed: checks.iter().all(|check| check.verdict != Verdict::Failed),
            checks,
        }
    }

    /// Number of failed checks.
    pub fn failed(&self) -> usize {
        let failed = |check: &&Check| check.verdict == Verdict::Failed;
        self.checks.iter().filter(failed).count()
    }

    /// Write the report as JSON, complete or not at all.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn write(&self, path: &Path) -> Result<(), WriteError> {
        write_atomically(path, 0, |file| {
            let mut text = serde_json::to_vec_pretty(self)?;
            text.push(b'\n');
            file.write_all(&text)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_outside_limits_and_nan_fail() {
        let verdict = |value, limits| Check::measured("x", (value, "s"), limits, "").verdict;
        let both = (Some(-1.0), Some(2.0));
        for (value, expected) in [
            (-1.0, Verdict::Passed),
            (2.0, Verdict::Passed),
            (-1.1, Verdict::Failed),
            (2.1, Verdict::Failed),
            (f64::NAN, Verdict::Failed),
        ] {
            assert_eq!(verdict(value, both), expected, "{value}");
        }
        assert_eq!(verdict(1e9, (None, None)), Verdict::Passed);
        assert_eq!(Check::faults("x", 1, "").verdict, Verdict::Failed);
    }

    #[test]
    fn report_passes_unless_a_check_fails() {
        let missing = Check::not_measured("a", "s", "no sensor");
        let report = |checks| Report::new("subaperture-x", String::new(), (), checks);
        assert!(report(vec![missing.clone(), Check::faults("b", 0, "")]).passed);
        let failed = report(vec![missing, Check::faults("b", 2, "")]);
        assert!(!failed.passed && failed.failed() == 1);
    }
}
