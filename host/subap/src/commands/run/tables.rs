//! Tables of a report, from the records of the stages.

use serde_json::{Value, json};

use crate::html::{Cells, Page, Row, escaped};
use crate::text;

/// Measured error, predicted error and bound.
pub(super) fn error(page: &mut Page, image: &Value, check: &Value) {
    page.section("error", "Error against the exact sum");
    let predicted = &image["settings"]["resolved"]["predicted_error_db"];
    let row = |name: &str, value: String| -> Row { ("", vec![name.to_owned(), value]) };
    let measured = &check["relative_to_image_db"];
    let bound = &check["bound_db"];
    let rows = [
        row("pixels compared", check["num_pixels"].to_string()),
        row("of an average pixel's power", decibels(measured)),
        row(
            "of these pixels' power",
            decibels(&check["relative_rms_db"]),
        ),
        row("predicted", decibels(predicted)),
        row("bound", decibels(bound)),
    ];
    let header = ["relative RMS error, phase included", ""];
    page.table(Cells::Numbers, &header, &rows);
    match (measured.as_f64(), bound.as_f64()) {
        (Some(measured), Some(bound)) if measured > bound => {
            page.paragraph("bad", "The error exceeds the bound.");
        }
        (Some(_), Some(_)) => page.paragraph("good", "The error is within the bound."),
        _ => {}
    }
}

/// Point responses: two cuts each, with the theory of each cut.
pub(super) fn points(page: &mut Page, points: &[Value], polar: bool) {
    page.section("points", "Points");
    page.paragraph(
        "soft small",
        "Two cuts through each peak. PSLR and ISLR are of the side lobes outside the first minima. \
         Theory weights all pulses equally, without a beam pattern.",
    );
    let mut rows: Vec<Row> = Vec::new();
    for (i, point) in points.iter().enumerate() {
        let response = &point["response"];
        let place = (0..3).map(|k| number(&response["position_m"][k], 3));
        let place: Vec<String> = place.collect();
        for (k, cut) in response["cuts"]
            .as_array()
            .into_iter()
            .flatten()
            .enumerate()
        {
            let mut row = match k {
                0 => vec![
                    (i + 1).to_string(),
                    place.join(", "),
                    decibels(&response["level_db"]),
                    number(
                        &json!(response["phase_rad"].as_f64().map(f64::to_degrees)),
                        1,
                    ),
                ],
                _ => vec![String::new(); 4],
            };
            let along = words(&cut["along"]);
            // On a polar grid the first axis is an angle.
            let (along, factor) = match (polar, &along[..]) {
                (true, "x") => ("angle (deg)", 1f64.to_degrees()),
                (true, "y") => ("range", 1.0),
                (_, along) => (along, 1.0),
            };
            row.push(escaped(along));
            row.extend(figures(&cut["width_3db"], factor, &cut["null_rule"]));
            rows.push(("", row));
            let theory = &point["theory"][k];
            if !theory.is_null() && theory["in_cells"] != true {
                let mut row = vec![String::new(); 4];
                row.push("theory".to_owned());
                row.extend(figures(&theory["width_3db"], factor, &theory["null_rule"]));
                rows.push(("theory", row));
            }
        }
    }
    let header = [
        "",
        "x, y, z (m)",
        "level",
        "phase (deg)",
        "along",
        "3 dB width (m)",
        "PSLR (dB)",
        "ISLR (dB)",
    ];
    page.table(Cells::Numbers, &header, &rows);
}

/// Autofocus: figures before and after, on the data used and on held-out data.
pub(super) fn sharpened(page: &mut Page, found: &Value, picture: Vec<u8>) {
    page.section("autofocus", "Autofocus");
    let row = |name: &str, figures: &Value| -> Row {
        let cells = vec![
            name.to_owned(),
            number(&figures["entropy"], 4),
            number(&figures["contrast"], 4),
            decibels(&figures["peak_db"]),
        ];
        ("", cells)
    };
    let mut rows = vec![
        row("before", &found["before"]),
        row("after", &found["after"]),
    ];
    let held_out = &found["held_out"];
    if held_out.is_object() {
        rows.push(row("held out, before", &held_out["before"]));
        rows.push(row("held out, after", &held_out["after"]));
    }
    page.table(Cells::Numbers, &["", "entropy", "contrast", "peak"], &rows);
    let rounds = found["rounds"].as_array().map_or(0, Vec::len);
    let by = match (
        found["rms_phase_rad"].as_f64(),
        found["rms_displacement_m"].as_f64(),
    ) {
        (Some(phase), _) => format!("phase errors of {phase:.3} rad rms were removed"),
        (None, Some(moved)) => format!("the track was moved by {} rms", text::metres(Some(moved))),
        _ => match &*words(&found["outcome"]) {
            "unjudged" => "correction refused: held-out data cannot judge it",
            "not-sharper" => "correction refused: it does not pass the tests on held-out data",
            _ => "no correction sharpens the image",
        }
        .to_owned(),
    };
    let method = words(&found["method"]);
    page.paragraph(
        "",
        &escaped(&format!("By {method} in {rounds} rounds: {by}.")),
    );
    page.pictures(&[(picture, format!("before and after {method}"))]);
}

/// Levels and contrast of the whole image.
pub(super) fn statistics(page: &mut Page, statistics: &Value) {
    page.section("levels", "The image as a whole");
    page.facts(&[
        ("Mean level", decibels(&statistics["mean_level_db"])),
        ("Median level", decibels(&statistics["median_level_db"])),
        ("Peak level", decibels(&statistics["peak_level_db"])),
        (
            "Entropy",
            format!("{} nats", number(&statistics["entropy"], 4)),
        ),
        (
            "Contrast of power",
            number(&statistics["power_contrast"], 4),
        ),
        (
            "Contrast of amplitude",
            number(&statistics["amplitude_contrast"], 4),
        ),
    ]);
}

/// The former, and for automatic choice the one chosen.
pub(super) fn former(image: &Value) -> String {
    let named = words(&image["settings"]["algorithm"]);
    match image["settings"]["resolved"]["former"].as_str() {
        Some(chosen) if chosen != named => format!("{named}: {chosen}"),
        _ => named,
    }
}

/// Caption of a picture from its file name, such as `point-2-x.png`.
pub(super) fn caption(name: &str) -> String {
    let name = name.trim_end_matches(".png").trim_start_matches("point-");
    match name.split_once('-') {
        Some((number, "chip")) => format!("point {number}: response"),
        Some((number, along)) => {
            format!("point {number}: cut along {}", along.replace('-', " "))
        }
        None => name.to_owned(),
    }
}

/// Width, PSLR and ISLR as cells.
fn figures(width: &Value, factor: f64, rule: &Value) -> [String; 3] {
    let width = &json!(width.as_f64().map(|width| width * factor));
    [
        number(width, 4),
        number(&rule["pslr_db"], 2),
        number(&rule["islr_db"], 2),
    ]
}

fn number(value: &Value, digits: usize) -> String {
    value
        .as_f64()
        .map_or_else(|| "none".to_owned(), |v| format!("{v:.digits$}"))
}

/// Level in decibels; `none` if absent.
pub(super) fn decibels(value: &Value) -> String {
    value
        .as_f64()
        .map_or_else(|| "none".to_owned(), text::decibels)
}

/// Text of a JSON value, without quotes.
pub(super) fn words(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Array(values) => values.iter().map(words).collect::<Vec<_>>().join(", "),
        value => value.to_string(),
    }
}

/// Format a duration with three significant digits.
pub(super) fn seconds(seconds: f64) -> String {
    text::seconds(format!("{seconds:.2e}").parse().unwrap_or(seconds))
}
