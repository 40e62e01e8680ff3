//! `subap crosscheck`: the host's code against the embedded core, sub-CPI by sub-CPI.

use anyhow::bail;
use subaperture::crosscheck::crosscheck;
use subaperture::io::open::open_all;

use crate::args::Crosscheck;
use crate::config::Session;
use crate::text;

/// The largest relative error that passes, dB.
const LIMIT_DB: f64 = -100.0;

/// Prints the worst error; fails above -100 dB.
pub(crate) fn run(session: &Session, typed: &Crosscheck) -> anyhow::Result<()> {
    let history = open_all(&typed.input.paths, typed.input.channel.as_deref())?;
    let progress = session.progress("cross-checking");
    let report = crosscheck(&history, typed.sub_cpi, &progress)?;
    progress.finish();
    session.note(1, || format!("{report:#?}"));
    text::say(format!(
        "{} sub-CPIs of {} pulses: worst relative error {:.1} dB (sub-CPI {})",
        report.errors_db.len(),
        report.sub_cpi,
        report.worst_db,
        report.worst_sub_cpi,
    ))?;
    // Written so that NaN fails.
    if !(report.worst_db <= LIMIT_DB) {
        bail!("core and host differ by more than {LIMIT_DB} dB");
    }
    Ok(())
}
