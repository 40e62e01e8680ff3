//! Pictures of `subap quality`: cuts with theory, chips, and maps of differences.

use std::path::Path;

use subaperture::io::claim::OutputClaims;
use subaperture::io::together::FileSet;
use subaperture::io::written::{FileKind, WrittenFile};
use subaperture::plot::{
    Chart, Colours, Curve, HeatMap, Panel, Scale, Source as Shown, Stroke, heat, lines,
    quicklook_within,
};
use subaperture::quality::PixelMap;
use subaperture::quality::response::Cut;

use super::report::{Point, Report};
use super::source::Source;
use crate::interrupt;

/// Lower limit of cuts, dB.
const FLOOR_DB: f64 = -60.0;

/// Write all pictures or none into `folder`, which is created if needed. Returns them.
pub(super) fn write(
    claims: &mut OutputClaims,
    folder: &Path,
    report: &Report,
    source: &Source,
    picture_bytes: u64,
) -> anyhow::Result<Vec<WrittenFile>> {
    let mut drawn: Vec<(String, Vec<u8>)> = Vec::new();
    let mut save = |name: String, bytes: Vec<u8>| {
        drawn.push((name, bytes));
        interrupt::check()
    };
    for (i, point) in report.points.iter().enumerate() {
        let number = i + 1;
        let place = source.place(&point.response);
        for (k, cut) in point.response.cuts.iter().enumerate() {
            let name = source.along(cut.along).replace(' ', "-");
            let chart = cut_chart(source, cut, point, k, &place);
            save(format!("point-{number}-{name}.png"), lines(&chart)?)?;
        }
        let chip = &point.response.chip;
        let panel = Panel {
            scale: Scale::Fixed {
                top_db: point.response.level_db,
                span_db: -FLOOR_DB,
            },
            colours: Colours::Viridis,
            ..Panel::new(
                Shown::ImageSource(chip),
                &chip.grid,
                format!("response at {place}"),
            )
        };
        let picture = quicklook_within(&panel, picture_bytes)?;
        save(format!("point-{number}-chip.png"), picture)?;
    }
    if let Some(against) = &report.against {
        let map = |map: &PixelMap, title: &str, unit: &str, range| {
            let [(across_label, columns), (up_label, rows)] = source.shown_axes();
            heat(&HeatMap {
                values: &map.values,
                rows,
                columns,
                title: title.to_owned(),
                across_label,
                up_label,
                unit: unit.to_owned(),
                range,
                colours: Colours::Viridis,
                proportional: !source.grid.polar,
            })
        };
        // Scale of figure 4.10 of Schone 2020, unless most of the picture would be dark.
        let most = against.percent_difference.percentile_95.unwrap_or(0.0);
        let top = [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0]
            .into_iter()
            .find(|top| most <= *top)
            .unwrap_or(200.0);
        save(
            "percent-difference.png".to_owned(),
            map(
                &against.difference.map,
                "percent difference of magnitudes (pale: too dark)",
                "%",
                (0.0, top),
            )?,
        )?;
        save(
            "coherence.png".to_owned(),
            map(&against.coherence, "coherence", "", (0.0, 1.0))?,
        )?;
    }
    claims.folder(folder, drawn.iter().map(|(name, _)| name))?;
    let mut files = FileSet::new();
    for (name, bytes) in drawn {
        interrupt::check()?;
        files.write_bytes(&folder.join(&name), FileKind::Picture, &bytes)?;
    }
    Ok(files.commit()?)
}

fn cut_chart(source: &Source, cut: &Cut, point: &Point, index: usize, place: &str) -> Chart {
    let (unit, factor) = source.unit(cut.along);
    let db = |power: f64| 10.0 * power.log10();
    let floored = |power: f64| db(power).max(2.0 * FLOOR_DB);
    let measured = cut.offsets.iter().zip(&cut.powers);
    let mut curves = vec![Curve {
        name: "measured".to_owned(),
        points: measured.map(|(s, p)| (s * factor, floored(*p))).collect(),
        stroke: Stroke::Solid,
    }];
    for (theories, gain) in [
        (&point.theory, ""),
        (&point.theory_with_gain, ", with gain"),
    ] {
        let Some(Some(theory)) = theories.get(index) else {
            continue;
        };
        let points = cut
            .offsets
            .iter()
            .map(|&s| (s * factor, floored(theory.power(s))));
        curves.push(Curve {
            name: format!("{}{gain}", theory.title()),
            points: points.collect(),
            stroke: Stroke::Dashed,
        });
    }
    Chart {
        title: format!("cut along {} at {place}", source.along(cut.along)),
        across_label: format!("{} from the peak ({unit})", source.along(cut.along)),
        up_label: "power relative to the peak (dB)".to_owned(),
        curves,
        marks: cut.nulls.map_or(vec![], |n| n.map(|v| v * factor).to_vec()),
        across: Some((cut.span[0] * factor, cut.span[1] * factor)),
        up: Some((FLOOR_DB, 3.0)),
        ..Chart::default()
    }
}
