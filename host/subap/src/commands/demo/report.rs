//! Error table of the demonstration as text, Markdown and JSON.

use std::time::Duration;

use serde_json::{Value, json};
use subaperture::io::ours::TEXT_MARK;

use super::trials::Outcome;
use crate::text;

const HEADER: [&str; 7] = [
    "former",
    "error dB",
    "bound dB",
    "scaled dB",
    "phase deg",
    "correlation",
    "seconds",
];

/// Contents of the table.
pub(super) struct Report<'a> {
    pub(super) outcomes: &'a [Outcome],
    pub(super) exact_taken: Duration,
    /// Cross-range distance of the first grating lobe in thesis mode at 130 pulses, metres.
    pub(super) grating_lobe_m: Option<f64>,
}

impl Report<'_> {
    fn rows(&self) -> Vec<Vec<String>> {
        let number = |value: Option<f64>, digits: usize| match value {
            Some(value) => format!("{value:.digits$}"),
            None => "-".to_owned(),
        };
        let mut rows = vec![vec![
            "exact".to_owned(),
            "reference".to_owned(),
            "-".to_owned(),
            "-".to_owned(),
            "-".to_owned(),
            "-".to_owned(),
            format!("{:.2}", self.exact_taken.as_secs_f64()),
        ]];
        rows.extend(self.outcomes.iter().map(|outcome| {
            let comparison = &outcome.comparison;
            let miss = if outcome.misses_bound() {
                " MISSED"
            } else {
                ""
            };
            vec![
                outcome.trial.title.to_owned(),
                number(comparison.error_db, 1),
                number(outcome.trial.bound_db, 0) + miss,
                number(comparison.scaled_error_db, 1),
                number(comparison.peak_phase_error_deg, 3),
                number(comparison.correlation, 7),
                format!("{:.2}", outcome.taken.as_secs_f64()),
            ]
        }));
        rows
    }

    /// Notes below the table: meaning of the columns, and references.
    fn notes(&self) -> String {
        let lobes = match self.grating_lobe_m {
            Some(metres) => format!(
                "\nGrating lobes of thesis mode at 130 pulses lie at multiples of \
                 {metres:.2} m in x from each scatterer."
            ),
            None => String::new(),
        };
        let unjudged = if self.outcomes.iter().all(|o| o.trial.bound_db.is_none()) {
            "\nBounds are for the default grid, which covers all scatterers, and are not judged on \
             another."
        } else {
            ""
        };
        format!(
            "Error: RMS of image - exact over RMS of exact; scaled: after the best complex factor; \
             phase: the largest error within 20 dB of the peak.{lobes}{unjudged}"
        )
    }

    /// Format as an aligned text table.
    pub(super) fn to_text(&self) -> String {
        format!("{}\n{}", text::table(&HEADER, &self.rows()), self.notes())
    }

    /// Format as a Markdown document.
    pub(super) fn to_markdown(&self) -> String {
        let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
        let header: Vec<String> = HEADER.map(str::to_owned).to_vec();
        let rule: Vec<String> = HEADER.map(|_| "---".to_owned()).to_vec();
        let rows: String = self.rows().iter().map(|row| line(row)).collect();
        format!(
            "<!-- {TEXT_MARK} -->\n# Table 4.1 (Schone 2020), every former against the exact sum\n\n{}{}{rows}\n{}\n",
            line(&header),
            line(&rule),
            self.notes()
        )
    }

    /// Format as a JSON object.
    pub(super) fn to_json(&self) -> Value {
        let rows: Vec<Value> = self
            .outcomes
            .iter()
            .map(|outcome| {
                json!({
                    "former": outcome.trial.former.name(),
                    "title": outcome.trial.title,
                    "folder": outcome.trial.folder,
                    "bound_db": outcome.trial.bound_db,
                    "within_bound": outcome.trial.bound_db.map(|_| !outcome.misses_bound()),
                    "comparison": outcome.comparison,
                    "settings": outcome.settings,
                    "run_time_s": outcome.taken.as_secs_f64(),
                })
            })
            .collect();
        json!({
            "schema": "subaperture-demo",
            "schema_version": 1,
            "exact_run_time_s": self.exact_taken.as_secs_f64(),
            "grating_lobe_m_at_130_pulses": self.grating_lobe_m,
            "formers": rows,
        })
    }
}
