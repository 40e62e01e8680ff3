//! Doppler centroid of strip maps.

use serde_json::{Value, json};
use subaperture::focus::FormError;
use subaperture::focus::beam::{DopplerCentroid, EstimateError, doppler_centroid};
use subaperture::phase_history::PhaseHistory;
use subaperture::resolution::survey::Survey;

use crate::config::Session;
use crate::messages;
use crate::text::{self, Fact};

/// Estimated centroid, or the reason why it is missing.
pub(super) struct Doppler(Result<DopplerCentroid, String>);

impl Doppler {
    /// Estimate the centroid of a recording, and warn if it disagrees with the stated beam.
    pub(super) fn of(
        session: &Session,
        history: &dyn PhaseHistory,
        survey: &Survey,
    ) -> anyhow::Result<Self> {
        let progress = session.progress("estimating the Doppler centroid");
        let found = doppler_centroid(history, survey.scene_centre_m.into(), &progress);
        progress.finish();
        let found = match found {
            Err(EstimateError::Form(error @ (FormError::Cancelled | FormError::Read(_)))) => {
                return Err(error.into());
            }
            found => found.map_err(|error| error.to_string()),
        };
        if let Ok(centroid) = &found
            && let Some(off_hz) = centroid.disagreement_hz()
        {
            messages::warning(format!(
                "Doppler: the centroid of the echoes differs from the stated beam by {off_hz:.1} Hz modulo the PRF of {:.1} Hz, expected a tenth of it at most: check \
                 the boresight, the attitude and the track, or state a beam with --beam",
                centroid.prf_hz
            ));
        }
        Ok(Self(found))
    }

    /// Lines of the report; empty for recordings without a centroid.
    pub(super) fn describe(&self) -> String {
        let Ok(centroid) = &self.0 else {
            return String::new();
        };
        let number = match (centroid.ambiguity, centroid.resolved_hz()) {
            (Some(number), Some(hz)) => format!("ambiguity number {number}, {hz:.1} Hz"),
            _ => "ambiguity not resolved".to_owned(),
        };
        let compared = |hz: f64| {
            format!(
                "{hz:.1} Hz, {:+.1} Hz from the echoes modulo the PRF",
                -centroid.off_hz(hz)
            )
        };
        let mut facts: Vec<Fact> = vec![(
            "Doppler",
            format!(
                "centroid {:.1} Hz modulo the PRF of {:.1} Hz, {number} ({} pulses)",
                centroid.fraction_hz, centroid.prf_hz, centroid.num_pulses
            ),
        )];
        if let Some(stated_hz) = centroid.stated_hz {
            facts.push(("", format!("stated beam {}", compared(stated_hz))));
        }
        let point = compared(centroid.point_hz);
        facts.push(("", format!("scene at the middle pulse {point}")));
        text::facts(&facts).join("\n") + "\n"
    }

    /// Value of the key `doppler`.
    pub(super) fn to_json(&self) -> Value {
        match &self.0 {
            Err(why) => json!({ "none": why }),
            Ok(centroid) => json!({
                "prf_hz": centroid.prf_hz,
                "centroid_hz": centroid.fraction_hz,
                "ambiguity": centroid.ambiguity,
                "resolved_hz": centroid.resolved_hz(),
                "stated_beam_hz": centroid.stated_hz,
                "scene_hz": centroid.point_hz,
                "pulses": centroid.num_pulses,
            }),
        }
    }
}
