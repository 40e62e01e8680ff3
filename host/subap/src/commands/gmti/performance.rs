//! Detection performance as a page and as text.

use subaperture::gmti::evaluation::{AtVelocity, Method, MethodReport, Plan, Report};
use subaperture::plot::{Chart, Curve, Stroke, lines};

use crate::args::Gmti;
use crate::html::{Cells, Page, Row, escaped};
use crate::text;

/// Lowest SINR of the chart, dB.
const LEAST_SINR_DB: f64 = -10.0;

/// Page with a table of all methods and their curves.
pub(super) fn page(
    scenario: &str,
    typed: &Gmti,
    plan: &Plan,
    report: &Report,
) -> anyhow::Result<String> {
    let mut page = Page::new(&format!("Detection of moving targets: {scenario}"));
    let [slowest, fastest] = plan.speeds_m_s;
    let (targets, recordings) = (plan.targets * plan.recordings, plan.recordings);
    page.facts(&[
        ("Targets", format!("{targets} in {recordings} recordings")),
        (
            "Mean radar cross-section",
            format!("{} m², Swerling 1", typed.cross_section),
        ),
        (
            "Radial speed",
            format!("{slowest} to {fastest} m/s, log-uniform"),
        ),
        (
            "Probability of false alarm",
            format!("{:e}", report.false_alarm_probability),
        ),
    ]);
    page.section("mdv", "Minimum detectable velocity");
    page.paragraph(
        "",
        "Smallest radial speed with a probability of detection of 0.5. Theory uses the covariance that each \
         method has estimated around each target. The statistic is evaluated at the true motion, or at the \
         pixel nearest to the place where the image shows the target. In the image, targets whose displaced \
         place lies outside of the grid are missed. Exo-clutter CFAR uses one sub-CPI of the first channel, ATI and \
         DPCA the first two channels, AMF (adaptive matched filter) and EFA (extended factored algorithm, of so many \
         Doppler bins) all channels.",
    );
    let header = ["method", "measured, m/s", "theory, m/s"];
    let row = |own: &MethodReport| -> Row {
        let cells = mdv_cells(own).iter().map(|cell| escaped(cell)).collect();
        ("", cells)
    };
    let rows: Vec<Row> = report.methods.iter().map(row).collect();
    page.table(Cells::Numbers, &header, &rows);
    page.section("pd", "Probability of detection");
    let probability = |title: &str, of: &dyn Fn(&AtVelocity) -> Option<f64>| {
        let label = "probability of detection";
        over_speed(title, label, curves(report, of), Some((0.0, 1.0)))
    };
    let measured = probability("Measured", &|at| Some(at.detected))?;
    let theory = probability("Theory", &|at| at.predicted)?;
    for (chart, caption) in [
        (
            measured,
            "Fraction of targets that were detected, in intervals of a fifth of a decade",
        ),
        (
            theory,
            "Mean probability of detection of a fluctuating target (Swerling 1)",
        ),
    ] {
        page.pictures(&[(chart, caption.to_owned())]);
    }
    page.paragraph(
        "",
        "Fraction detected, and the probability by theory in parentheses:",
    );
    speed_table(&mut page, report);
    page.section("sinr", "Signal to interference and noise");
    let sinr = curves(report, &|at| at.sinr_db.map(|db| db.max(LEAST_SINR_DB)));
    let caption = "Mean SINR of a target of the mean radar cross-section after the filter. Its distance from the level \
                   at high speed is the loss by clutter";
    let chart = over_speed("SINR", "SINR (dB)", sinr, None)?;
    page.pictures(&[(chart, caption.to_owned())]);
    page.section("roc", "Receiver operating characteristic");
    let caption = "Fraction of all targets that were detected, over the probability of false alarm";
    page.pictures(&[(roc(report)?, caption.to_owned())]);
    page.section("pfa", "False alarms");
    page.paragraph(
        "",
        "Rate measured over requested, and its count in parentheses: motions without a target in recordings of \
         clutter and noise whose statistic exceeds the threshold.",
    );
    let requested = report.methods.first();
    let requested = requested.map_or(&[][..], |own| &own.false_alarms);
    let titles = requested.iter();
    let titles: Vec<String> = titles
        .map(|alarms| format!("at {:e}", alarms.requested))
        .collect();
    let mut header = vec!["method", "tested"];
    header.extend(titles.iter().map(String::as_str));
    let rows: Vec<Row> = report.methods.iter().map(alarm_row).collect();
    page.table(Cells::Numbers, &header, &rows);
    Ok(page.finish())
}

/// Print the minimum detectable velocities.
pub(super) fn say(typed: &Gmti, report: &Report) -> anyhow::Result<()> {
    let rows: Vec<Vec<String>> = report.methods.iter().map(mdv_cells).collect();
    let header = ["method", "MDV measured (m/s)", "MDV by theory (m/s)"];
    text::say(text::table(&header, &rows))?;
    text::say(typed.out.display().to_string())?;
    Ok(())
}

fn mdv_cells(own: &MethodReport) -> Vec<String> {
    let speed = |speed: Option<f64>| speed.map_or("-".to_owned(), |speed| format!("{speed:.3}"));
    vec![
        own.method.to_string(),
        speed(own.mdv_m_s),
        speed(own.predicted_mdv_m_s),
    ]
}

/// Table of the charted methods over radial speed.
fn speed_table(page: &mut Page, report: &Report) {
    let own: Vec<&MethodReport> = charted(report).collect();
    let names: Vec<String> = own.iter().map(|own| own.method.to_string()).collect();
    let mut header = vec!["radial speed, m/s", "targets"];
    header.extend(names.iter().map(String::as_str));
    let cell = |at: &AtVelocity| {
        let theory = at.predicted.map_or(String::new(), |p| format!(" ({p:.2})"));
        format!("{:.2}{theory}", at.detected)
    };
    let row = |(i, at): (usize, &AtVelocity)| -> Row {
        let mut cells = vec![format!("{:.3}", at.speed_m_s), at.targets.to_string()];
        cells.extend(own.iter().map(|own| cell(&own.curve[i])));
        ("", cells)
    };
    // All methods were tested with the same targets.
    let speeds = own.first().map_or(&[][..], |own| &own.curve);
    let rows: Vec<Row> = speeds.iter().enumerate().map(row).collect();
    page.table(Cells::Numbers, &header, &rows);
}

fn alarm_row(own: &MethodReport) -> Row {
    let tested = own.false_alarms.first().map_or(0, |alarms| alarms.tested);
    let mut cells = vec![escaped(&own.method.to_string()), tested.to_string()];
    let alarms = own.false_alarms.iter();
    cells.extend(alarms.map(|alarms| format!("{:.2} ({})", alarms.ratio(), alarms.found)));
    ("", cells)
}

/// Methods of the charts: one number of Doppler bins. Those without a theory are last, so that a method has one colour in all charts.
fn charted(report: &Report) -> impl Iterator<Item = &MethodReport> {
    let shown = |own: &&MethodReport| match own.method {
        Method::Efa { bins } | Method::Integrated { bins } => bins == 3,
        _ => true,
    };
    let of = move |theory: bool| {
        let own = report.methods.iter().filter(shown);
        own.filter(move |own| own.method.has_theory() == theory)
    };
    of(true).chain(of(false))
}

/// Curves over the logarithm of the radial speed.
fn curves(report: &Report, of: &dyn Fn(&AtVelocity) -> Option<f64>) -> Vec<Curve> {
    let own = |own: &MethodReport| {
        let point = |at: &AtVelocity| Some((at.speed_m_s.log10(), of(at)?));
        curve(own, own.curve.iter().filter_map(point).collect())
    };
    let all = charted(report).map(own);
    all.filter(|curve| !curve.points.is_empty()).collect()
}

fn curve(own: &MethodReport, points: Vec<(f64, f64)>) -> Curve {
    Curve {
        name: own.method.to_string(),
        points,
        stroke: Stroke::Solid,
    }
}

fn over_speed(
    title: &str,
    label: &str,
    curves: Vec<Curve>,
    up: Option<(f64, f64)>,
) -> anyhow::Result<Vec<u8>> {
    Ok(lines(&Chart {
        title: title.to_owned(),
        across_label: "radial speed, logarithm of m/s".to_owned(),
        up_label: label.to_owned(),
        curves,
        up,
        ..Chart::default()
    })?)
}

fn roc(report: &Report) -> anyhow::Result<Vec<u8>> {
    let own = |own: &MethodReport| {
        let points = own.roc.iter();
        curve(
            own,
            points.map(|[p, detected]| (p.log10(), *detected)).collect(),
        )
    };
    Ok(lines(&Chart {
        title: "ROC".to_owned(),
        across_label: "probability of false alarm, logarithm".to_owned(),
        up_label: "fraction detected".to_owned(),
        curves: charted(report).map(own).collect(),
        up: Some((0.0, 1.0)),
        ..Chart::default()
    })?)
}
