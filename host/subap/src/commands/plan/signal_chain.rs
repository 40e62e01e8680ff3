//! Tables of a signal chain in the plan of a radar.

use subaperture::planner::chain::ChainLevels;

use crate::text;

/// Level or ratio with one decimal; a dash if it is unknown.
fn decibels(value: Option<f64>) -> String {
    // Adding zero turns -0 into 0.
    value.map_or_else(
        || "-".to_owned(),
        |value| format!("{:.1}", (value * 10.0).round() / 10.0 + 0.0),
    )
}

/// Tables of the transmit and receive stages, and lines on the converter.
pub(super) fn tables(levels: &ChainLevels) -> Vec<String> {
    let transmit: Vec<Vec<String>> = (levels.transmit.iter())
        .map(|row| {
            let values = [Some(row.level_dbm), row.compression_dbm, row.margin_db];
            named(&row.name, &values)
        })
        .collect();
    let receive: Vec<Vec<String>> = (levels.receive.iter())
        .map(|row| {
            let values = [
                Some(row.gain_db),
                Some(row.noise_figure_db),
                Some(row.leakage_dbm),
                Some(row.nearest_dbm),
                Some(row.farthest_dbm),
                Some(row.snr_db),
                row.margin_db,
            ];
            named(&row.name, &values)
        })
        .collect();
    let mut parts = Vec::new();
    if !transmit.is_empty() {
        let header = ["transmit", "dBm", "compression dBm", "margin dB"];
        parts.push(text::table(&header, &transmit));
        parts.push(String::new());
    }
    let header = [
        "receive",
        "gain dB",
        "noise figure dB",
        "leakage dBm",
        "nearest dBm",
        "farthest dBm",
        "SNR dB",
        "margin dB",
    ];
    parts.push(text::table(&header, &receive));
    parts.push(String::new());
    let converter = &levels.converter;
    parts.extend(text::facts(&[
        (
            "transmitted",
            format!("{:.1} dBm", levels.transmitted_dbm),
        ),
        (
            "converter",
            format!(
                "{:.1} dBm, {:.1} dB {} full scale; noise {:.1} dBm thermal, {:.1} dBm of quantisation",
                converter.level_dbm,
                converter.margin_db.abs(),
                if converter.margin_db < 0.0 { "above" } else { "below" },
                converter.thermal_noise_dbm,
                converter.quantisation_noise_dbm
            ),
        ),
        (
            "dynamic range",
            format!(
                "{:.1} dB up to {:.1} dBm, limited by {}; {} saturates first",
                converter.dynamic_range_db,
                converter.upper_limit_dbm,
                converter.limited_by,
                levels.first_to_saturate
            ),
        ),
        (
            "target",
            format!(
                "SNR {:.1} dB per sample, {:.1} dB per pulse, {:.1} dB in the image",
                converter.sample_snr_db, converter.pulse_snr_db, converter.image_snr_db
            ),
        ),
    ]));
    parts
}

fn named(name: &str, values: &[Option<f64>]) -> Vec<String> {
    let cells = values.iter().map(|&value| decibels(value));
    std::iter::once(name.to_owned()).chain(cells).collect()
}
