//! `subap crosscheck`: compare the embedded core and the host's `rdbp` maps with the float64 sum, one sub-CPI at a time.

use serde_json::{Value, json};
use subaperture::module::crosscheck::{FIXED_DB, FLOAT_DB, Report, SUB_CPI, SubCpi, crosscheck};

use crate::args::Crosscheck;
use crate::config::Session;
use crate::{messages, text};

/// Print the largest errors. Fails if an error exceeds its bound.
pub(crate) fn run(session: &Session, typed: &Crosscheck) -> anyhow::Result<()> {
    let history = session.open(&typed.input)?;
    let progress = session.progress("cross-checking");
    let sub_cpi = typed.sub_cpi.unwrap_or(SUB_CPI);
    let report = crosscheck(&history, sub_cpi, session.memory_bytes, &progress)?;
    progress.finish();

    for sub_cpi in &report.sub_cpis {
        session.note(1, || line(sub_cpi));
    }
    if let Some(why) = &report.no_image {
        messages::warning(format!("rdbp is not compared: {why}"));
    }
    if !report.passes() {
        messages::bound_missed(missed(&report));
    }
    match session.json() {
        true => text::say_json("crosscheck", object(&report)),
        false => Ok(text::say(summary(&report))?),
    }
}

/// One line for a sub-CPI.
fn line(sub_cpi: &SubCpi) -> String {
    let rdbp = sub_cpi.image.map_or_else(String::new, |image| {
        format!(
            ", rdbp {:.1} dB (bound {:.1} dB)",
            image.error_db,
            image.bound_db()
        )
    });
    format!(
        "sub-CPI {}: float32 {:.1} dB, fixed point {:.1} dB (samples {:.1} dB){rdbp}",
        sub_cpi.index, sub_cpi.float_db, sub_cpi.fixed_db, sub_cpi.sample_rounding_db
    )
}

/// Description of the errors above their bounds.
fn missed(report: &Report) -> String {
    let (float, fixed) = (report.worst_float(), report.worst_fixed());
    let mut all = Vec::new();
    if float.float_db > FLOAT_DB {
        all.push(format!(
            "core, float32: error of {:.1} dB in sub-CPI {}, above the bound of {FLOAT_DB} dB",
            float.float_db, float.index
        ));
    }
    if fixed.fixed_db > FIXED_DB {
        let samples_db = fixed.sample_rounding_db;
        let why = match samples_db > FIXED_DB {
            true => format!(
                ": the samples are too weak for 16-bit quantisation scaled to the recording's peak; rounding leaves {samples_db:.1} dB"
            ),
            false => String::new(),
        };
        all.push(format!(
            "core, fixed point: error of {:.1} dB in sub-CPI {}, above the bound of {FIXED_DB} dB{why}",
            fixed.fixed_db, fixed.index
        ));
    }
    if let Some((sub_cpi, image)) = report.worst_image().filter(|(_, image)| !image.within()) {
        all.push(format!(
            "rdbp: error of {:.1} dB in sub-CPI {}, above its plan's bound of {:.1} dB",
            image.error_db,
            sub_cpi.index,
            image.bound_db()
        ));
    }
    all.join("; ")
}

/// Summary of the largest errors and the compared data.
fn summary(report: &Report) -> String {
    let (float, fixed) = (report.worst_float(), report.worst_fixed());
    let rdbp = match report.worst_image() {
        None => "not compared".to_owned(),
        Some((sub_cpi, image)) => format!(
            "{:.1} dB at worst, in sub-CPI {} (its plan's bound: {:.1} dB)",
            image.error_db,
            sub_cpi.index,
            image.bound_db()
        ),
    };
    let images = report.grid.as_ref().map_or_else(String::new, |grid| {
        format!(
            ", images of {} x {} pixels",
            grid.rows.count, grid.columns.count
        )
    });
    format!(
        "core, float32: {:.1} dB at worst, in sub-CPI {} (bound {FLOAT_DB} dB)\n\
         core, fixed point: {:.1} dB at worst, in sub-CPI {} (bound {FIXED_DB} dB; rounding samples to 16 bits alone: {:.1} dB)\n\
         host, rdbp: {rdbp}\n\
         {} of {} sub-CPIs of {} pulses and {} frequencies against the float64 sum, maps of {} x {} bins{images}",
        float.float_db,
        float.index,
        fixed.fixed_db,
        fixed.index,
        fixed.sample_rounding_db,
        report.sub_cpis.len(),
        report.num_sub_cpis,
        report.setup.num_pulses,
        report.setup.num_frequencies,
        report.patch.num_doppler_bins(),
        report.patch.num_range_bins(),
    )
}

/// Report as a JSON object.
fn object(report: &Report) -> Value {
    let (float, fixed) = (report.worst_float(), report.worst_fixed());
    let rdbp = report.worst_image().map(|(sub_cpi, image)| {
        json!({
            "worst_db": image.error_db,
            "worst_sub_cpi": sub_cpi.index,
            "bound_db": image.bound_db(),
            "planned_db": image.planned_db,
        })
    });
    let compared: Vec<Value> = report
        .sub_cpis
        .iter()
        .map(|sub_cpi| {
            json!({
                "sub_cpi": sub_cpi.index,
                "pulses": [sub_cpi.pulses.start, sub_cpi.pulses.end],
                "float_db": sub_cpi.float_db,
                "fixed_db": sub_cpi.fixed_db,
                "sample_rounding_db": sub_cpi.sample_rounding_db,
                "rdbp_db": sub_cpi.image.map(|image| image.error_db),
                "rdbp_bound_db": sub_cpi.image.map(|image| image.bound_db()),
            })
        })
        .collect();
    json!({
        "schema_version": 2,
        "within_bound": report.passes(),
        "float": {
            "worst_db": float.float_db,
            "worst_sub_cpi": float.index,
            "bound_db": FLOAT_DB,
        },
        "fixed": {
            "worst_db": fixed.fixed_db,
            "worst_sub_cpi": fixed.index,
            "bound_db": FIXED_DB,
            "sample_rounding_db": fixed.sample_rounding_db,
        },
        "rdbp": rdbp,
        "sub_cpis": report.num_sub_cpis,
        "compared": compared,
        "pulses": report.setup.num_pulses,
        "frequencies": report.setup.num_frequencies,
        "range_bins": report.patch.num_range_bins(),
        "doppler_bins": report.patch.num_doppler_bins(),
    })
}
