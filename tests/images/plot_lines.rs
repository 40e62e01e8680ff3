//! Decoded line charts and heat maps: positions against the axes, and colours against the values.

use subaperture::geometry::Axis;
use subaperture::plot::{Chart, Colours, Curve, HeatMap, Stroke, heat, lines, stacked};

use super::decoded::Picture;

impl Picture {
    /// Rows of column `x` of the plot with approximately this colour.
    fn rows_of(&self, x: usize, [_, top, _, bottom]: [usize; 4], colour: [u8; 3]) -> Vec<usize> {
        let alike = |y: &usize| {
            let pixel = self.at(x, *y);
            pixel.iter().zip(colour).all(|(a, b)| a.abs_diff(b) < 40)
        };
        (top..bottom).filter(alike).collect()
    }
}

const BLUE: [u8; 3] = [0, 114, 178];
const ORANGE: [u8; 3] = [213, 94, 0];

fn curve(points: Vec<(f64, f64)>, stroke: Stroke) -> Curve {
    Curve {
        name: String::new(),
        points,
        stroke,
    }
}

#[test]
fn line_is_drawn_at_its_values() {
    // A line from the lower left corner to the upper right one, and a dashed horizontal one at a quarter.
    let chart = Chart {
        curves: vec![
            curve(vec![(0.0, -10.0), (4.0, 10.0)], Stroke::Solid),
            curve(vec![(0.0, -5.0), (4.0, -5.0)], Stroke::Dashed),
        ],
        across: Some((0.0, 4.0)),
        up: Some((-10.0, 10.0)),
        ..Chart::default()
    };
    let picture = Picture::decode(&lines(&chart).unwrap());
    let plot @ [left, top, right, bottom] = picture.plot();
    let (width, height) = ((right - left) as f64, (bottom - top) as f64);
    for part in [0.1, 0.4, 0.6, 0.9] {
        let x = left + (part * width) as usize;
        let wanted = bottom as f64 - part * height;
        let rows = picture.rows_of(x, plot, BLUE);
        let middle = rows.iter().sum::<usize>() as f64 / rows.len() as f64 + 0.5;
        assert!(
            (middle - wanted).abs() < 1.0,
            "{part}: {middle}, not {wanted}"
        );
        assert!(rows.len() <= 4, "{rows:?}");
    }
    let level = (bottom as f64 - height / 4.0) as usize;
    let lit = (left..right)
        .filter(|&x| {
            picture
                .rows_of(x, plot, ORANGE)
                .iter()
                .any(|y| y.abs_diff(level) <= 1)
        })
        .count() as f64;
    // Dashes of 9 of every 15 pixels, with round ends.
    assert!((0.55..0.85).contains(&(lit / width)), "{lit} of {width}");
}

#[test]
fn curves_are_clipped_and_interrupted_at_nan() {
    let chart = Chart {
        curves: vec![curve(
            vec![
                (0.0, 0.5),
                (1.0, 0.5),
                (1.5, f64::NAN),
                (2.0, 0.5),
                (3.0, 0.5),
                (3.0, 1e12),
            ],
            Stroke::Solid,
        )],
        marks: vec![0.5],
        across: Some((0.0, 4.0)),
        up: Some((0.0, 1.0)),
        ..Chart::default()
    };
    let picture = Picture::decode(&lines(&chart).unwrap());
    let plot @ [left, top, right, _] = picture.plot();
    let column = |value: f64| left + (value / 4.0 * (right - left) as f64) as usize;
    assert!(!picture.rows_of(column(0.3), plot, BLUE).is_empty());
    assert!(
        picture.rows_of(column(1.5), plot, BLUE).is_empty(),
        "the gap"
    );
    assert!(picture.rows_of(column(3.5), plot, BLUE).is_empty());
    // Out of the box upwards at 3: the whole upper half is drawn, but no pixel above the frame.
    let up = picture.rows_of(column(3.0), plot, BLUE);
    assert_eq!(up.first(), Some(&top));
    for y in 0..top - 1 {
        assert_ne!(picture.at(column(3.0), y), BLUE);
    }
    assert!(
        picture.rows_of(column(0.5), plot, [130, 130, 130]).len() > 100,
        "the mark"
    );
}

#[test]
fn proportional_chart_has_equal_scales() {
    // A square of 2 by 2, and an area of 2 by 200: both axes of the first have the same number of pixels.
    let square = |height: f64| {
        let corners = [
            (3.0, 1.0),
            (5.0, 1.0),
            (5.0, 1.0 + height),
            (3.0, 1.0 + height),
        ];
        Chart {
            curves: vec![curve(corners.to_vec(), Stroke::Dots)],
            proportional: true,
            ..Chart::default()
        }
    };
    for height in [2.0, 200.0, 0.02] {
        let picture = Picture::decode(&lines(&square(height)).unwrap());
        let plot @ [left, _, right, _] = picture.plot();
        let lit: Vec<(usize, Vec<usize>)> = (left..right)
            .map(|x| (x, picture.rows_of(x, plot, BLUE)))
            .filter(|(_, rows)| !rows.is_empty())
            .collect();
        // Dots have a radius of 3 pixels and are inside the box.
        let across = (lit[lit.len() - 1].0 - lit[0].0) as f64 - 6.0;
        let rows = || lit.iter().flat_map(|(_, rows)| rows.iter().copied());
        let up = (rows().max().unwrap() - rows().min().unwrap()) as f64 - 6.0;
        // The shorter side by the longer.
        let [short, long] = if height > 2.0 {
            [across, up]
        } else {
            [up, across]
        };
        let ratio = if height > 2.0 {
            2.0 / height
        } else {
            height / 2.0
        };
        assert!(
            (short - long * ratio).abs() <= 3.0,
            "{height}: {across} {up}"
        );
        assert!(across.max(up) > 300.0, "{height}: {across} {up}");
    }
}

#[test]
fn stacked_charts_keep_order() {
    let level = |value: f64| Chart {
        curves: vec![curve(vec![(0.0, value), (1.0, value)], Stroke::Solid)],
        up: Some((0.0, 1.0)),
        ..Chart::default()
    };
    let [upper, lower] = [0.2, 0.7].map(|value| Picture::decode(&lines(&level(value)).unwrap()));
    let both = Picture::decode(&stacked(&[level(0.2), level(0.7)]).unwrap());
    assert_eq!(both.width, upper.width);
    assert!(both.rgb == [upper.rgb, lower.rgb].concat());
    assert!(stacked(&[]).is_err());
}

#[test]
fn legend_uses_corner_with_fewest_curve_pixels() {
    // Points in all corners but one, where the three names appear.
    let corners = [(0.95, 0.95), (0.05, 0.95), (0.95, 0.05), (0.05, 0.05)];
    for free in 0..4 {
        let points = (0..4).filter(|&i| i != free).map(|i| corners[i]).collect();
        let chart = Chart {
            curves: vec![Curve {
                name: "dots".to_owned(),
                ..curve(points, Stroke::Dots)
            }],
            across: Some((0.0, 1.0)),
            up: Some((0.0, 1.0)),
            ..Chart::default()
        };
        let picture = Picture::decode(&lines(&chart).unwrap());
        let plot @ [left, top, right, bottom] = picture.plot();
        let (width, height) = ((right - left) as f64, (bottom - top) as f64);
        for (x, y) in corners {
            let column = left + (x * width) as usize;
            let rows = picture.rows_of(column, plot, BLUE);
            let at = bottom as f64 - y * height;
            let near = rows.iter().any(|&row| (row as f64 - at).abs() < 3.0);
            assert_eq!(near, (x, y) != corners[free], "{free}: {x} {y}");
        }
    }
}

/// A legend longer than the plot begins at its top, and covers no part of the title.
#[test]
fn long_legend_starts_inside_plot() {
    let named = |name: &str| Curve {
        name: name.to_owned(),
        ..curve(vec![(0.0, 0.0), (1.0, 1.0)], Stroke::Dots)
    };
    let title = |curves| {
        let chart = Chart {
            title: "many".to_owned(),
            curves,
            ..Chart::default()
        };
        let picture = Picture::decode(&lines(&chart).unwrap());
        let [_, top, ..] = picture.plot();
        picture.rgb[..3 * picture.width * (top - 2)].to_vec()
    };
    let many = (0..25).map(|n| named(&n.to_string())).collect();
    assert!(title(many) == title(vec![named("")]));
}

#[test]
fn lines_rejects_charts_without_finite_points_or_range() {
    let chart = |points, up| Chart {
        title: "cut".to_owned(),
        curves: vec![curve(points, Stroke::Dots)],
        up,
        ..Chart::default()
    };
    for (chart, part) in [
        (chart(vec![(f64::NAN, 1.0)], None), "found no finite point"),
        (chart(vec![(0.0, 1.0)], Some((1.0, 1.0))), "an axis range"),
    ] {
        let error = lines(&chart).unwrap_err().to_string();
        assert!(error.contains(part) && error.contains("cut"), "{error}");
    }
    // A single point has axes of its own.
    lines(&chart(vec![(0.0, 1.0)], None)).unwrap();
}

#[test]
fn heat_map_uses_linear_scale() {
    let axis = |start, count| Axis {
        start,
        step: 1.0,
        count,
    };
    let mut values = vec![0.0; 200];
    // Row 7 of 10 is third from the top; column 3 of 20.
    values[7 * 20 + 3] = 4.0;
    values[0] = f32::NAN;
    let map = HeatMap {
        values: &values,
        rows: axis(100.0, 10),
        columns: axis(-10.0, 20),
        title: "map".to_owned(),
        across_label: "Doppler (Hz)".to_owned(),
        up_label: "range (m)".to_owned(),
        unit: "%".to_owned(),
        range: (-4.0, 4.0),
        colours: Colours::Grey,
        proportional: false,
    };
    let picture = Picture::decode(&heat(&map).unwrap());
    let [left, top, right, bottom] = picture.plot();
    let side = (right - left) / 20;
    assert_eq!((right - left, bottom - top), (20 * side, 10 * side));
    let at = |row: usize, column: usize| {
        picture.at(
            left + column * side + side / 2,
            bottom - 1 - row * side - side / 2,
        )
    };
    assert_eq!(at(7, 3), [255; 3]);
    assert_eq!(at(5, 5), [128; 3], "0 is the middle of the scale");
    assert_eq!(at(0, 0), [214, 40, 40], "NaN is red among greys");
    let coloured = heat(&HeatMap {
        colours: Colours::Viridis,
        ..map.clone()
    });
    let picture = Picture::decode(&coloured.unwrap());
    let [left, _, _, bottom] = picture.plot();
    assert_eq!(picture.at(left + side / 2, bottom - 1 - side / 2), [222; 3]);
    let error = heat(&HeatMap {
        range: (1.0, 1.0),
        ..map.clone()
    })
    .unwrap_err()
    .to_string();
    assert!(error.contains("found 1 to 1"), "{error}");
    let error = heat(&HeatMap {
        rows: axis(0.0, 9),
        ..map
    })
    .unwrap_err()
    .to_string();
    assert!(
        error.contains("200 values do not fill 9 rows x 20"),
        "{error}"
    );
}
