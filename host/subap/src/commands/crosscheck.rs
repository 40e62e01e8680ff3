//! `subap crosscheck`: the host's code against the embedded core, sub-CPI by sub-CPI.

use serde_json::json;
use subaperture::onboard::crosscheck::{LIMIT_DB, SUB_CPI, crosscheck};

use crate::args::Crosscheck;
use crate::config::Session;
use crate::{messages, text};

/// Prints the worst difference; a bound is missed if it is above the limit.
pub(crate) fn run(session: &Session, typed: &Crosscheck) -> anyhow::Result<()> {
    let history = session.open(&typed.input)?;
    let progress = session.progress("cross-checking");
    let sub_cpi = typed.sub_cpi.unwrap_or(SUB_CPI);
    let report = crosscheck(&history, sub_cpi, session.memory_bytes, &progress)?;
    progress.finish();

    for (index, difference_db) in report.differences_db.iter().enumerate() {
        session.note(1, || format!("sub-CPI {index}: {difference_db:.1} dB"));
    }
    let (worst, worst_db) = report.worst();
    let shape = &report.shape;
    if !report.passes() {
        messages::bound_missed(format!(
            "host and core differ by {worst_db:.1} dB, above the bound of {LIMIT_DB} dB"
        ));
    }
    if session.json() {
        return text::say_json(
            "crosscheck",
            json!({
                "differences_db": report.differences_db,
                "worst_sub_cpi": worst,
                "worst_db": worst_db,
                "bound_db": LIMIT_DB,
                "within_bound": report.passes(),
                "pulses": shape.num_pulses,
                "frequencies": shape.num_frequencies,
                "range_bins": shape.num_range_bins,
                "doppler_bins": shape.num_doppler_bins,
            }),
        );
    }
    text::say(format!(
        "worst relative error {worst_db:.1} dB, in sub-CPI {worst} of {} ({} pulses of {} \
         frequencies, maps of {} x {})",
        report.differences_db.len(),
        shape.num_pulses,
        shape.num_frequencies,
        shape.num_range_bins,
        shape.num_doppler_bins
    ))?;
    Ok(())
}
