//! Decoded pictures: pixel positions against the axes, and colours against the levels.

use num_complex::Complex32;
use subaperture::geometry::{Axis, ImageGrid};
use subaperture::image::Image;
use subaperture::plot::{
    Colours, Dot, Dots, Orientation, Panel, Scale, ShownAxis, panels, quicklook,
};

use super::decoded::Picture;

impl Picture {
    /// Smallest box (left, top, right, bottom; ends excluded) around the pixels in `within` of a colour.
    fn find(&self, within: [usize; 4], wanted: [u8; 3]) -> Option<[usize; 4]> {
        let mut found: Option<[usize; 4]> = None;
        for y in within[1]..within[3] {
            for x in within[0]..within[2] {
                if self.at(x, y) == wanted {
                    let [l, t, r, b] = found.unwrap_or([x, y, x + 1, y + 1]);
                    found = Some([l.min(x), t.min(y), r.max(x + 1), b.max(y + 1)]);
                }
            }
        }
        found
    }
}

/// A constant level with one pixel at 0 dB.
fn dot(rows: usize, columns: usize, level_db: f32, row: usize, column: usize) -> Image {
    let level = 10f32.powf(level_db / 20.0);
    let mut image = Image {
        rows,
        columns,
        pixels: vec![Complex32::new(0.0, level); rows * columns],
    };
    image.pixels[row * columns + column] = Complex32::new(-1.0, 0.0);
    image
}

fn fixed<'a>(image: &'a Image, grid: &'a ImageGrid) -> Panel<'a> {
    Panel {
        scale: Scale::Fixed {
            top_db: 0.0,
            span_db: 60.0,
        },
        ..Panel::new(image, grid, "dot")
    }
}

#[test]
fn picture_pixel_agrees_with_axes() {
    let grid: ImageGrid = "x=-10:10:1,y=0:10:1".parse().unwrap();
    let image = dot(10, 20, -30.0, 7, 3);
    let picture = Picture::decode(&quicklook(&fixed(&image, &grid)).unwrap());
    let plot = picture.plot();
    let [left, top, right, bottom] = plot;
    let (width, height) = (right - left, bottom - top);
    assert_eq!(width, 2 * height, "20 m by 10 m");
    assert_eq!(width % 20, 0, "pixels are repeated whole");
    let side = width / 20;
    // Row 7 of 10 is third from the top, as y points up.
    let expected = [
        left + 3 * side,
        top + 2 * side,
        left + 4 * side,
        top + 3 * side,
    ];
    assert_eq!(picture.find(plot, [255; 3]), Some(expected));
    // -30 dB on a scale of -60 to 0 is half of 255, rounded either way by float32.
    let grey = picture.at(left, top)[0];
    assert!((127..=128).contains(&grey), "{grey}");
}

#[test]
fn picture_keeps_scene_aspect() {
    // The same 20 m by 10 m with pixels of 1 m by 0.25 m.
    let grid: ImageGrid = "x=-10:10:1,y=0:10:0.25".parse().unwrap();
    let picture = Picture::decode(&quicklook(&fixed(&dot(40, 20, -30.0, 0, 19), &grid)).unwrap());
    let [left, top, right, bottom] = picture.plot();
    assert_eq!(right - left, 2 * (bottom - top));
    let found = picture.find([left, top, right, bottom], [255; 3]).unwrap();
    assert_eq!(
        (found[2], found[3]),
        (right, bottom),
        "the last column, the lowest row"
    );
}

#[test]
fn large_image_is_reduced_by_mean_power() {
    // 4000 x 2000 pixels on 1600 x 800: a cell covers 2.5 x 2.5 pixels, so a dot within one cell has 1 / 6.25 of its power, -7.96 dB, and
    // the surrounding -90 dB are negligible. Column 3001 is within cell 1200 (3000 to 3002.5), row 1001 within cell 400.
    let grid: ImageGrid = "x=0:4000:1,y=0:2000:1".parse().unwrap();
    let image = dot(2000, 4000, -90.0, 1001, 3001);
    let picture = Picture::decode(&quicklook(&fixed(&image, &grid)).unwrap());
    let [left, top, right, bottom] = picture.plot();
    assert_eq!((right - left, bottom - top), (1600, 800));
    let grey = f64::from(picture.at(left + 1200, bottom - 1 - 400)[0]);
    let expected = 255.0 * (1.0 - 10.0 * 6.25f64.log10() / 60.0);
    assert!(
        (grey - expected).abs() <= 0.5 + 1e-3,
        "{grey}, not {expected}"
    );
    assert_eq!(picture.at(left + 1201, bottom - 1 - 400), [0; 3]);
    assert_eq!(picture.at(left + 1200, bottom - 1 - 401), [0; 3]);
}

#[test]
fn strip_polar_and_extreme_images_are_drawn() {
    let grid: ImageGrid = "x=0:3:1,y=0:3:1".parse().unwrap();
    let zero = Image {
        rows: 3,
        columns: 3,
        pixels: vec![Complex32::ZERO; 9],
    };
    let picture = Picture::decode(&quicklook(&Panel::new(&zero, &grid, "zero")).unwrap());
    let plot = picture.plot();
    assert_eq!(picture.find(plot, [0; 3]), Some(plot), "all black");

    let mut bad = dot(3, 3, -30.0, 1, 1);
    bad.pixels[8].re = f32::NAN;
    bad.pixels[0].re = f32::INFINITY;
    let picture = Picture::decode(&quicklook(&Panel::new(&bad, &grid, "bad")).unwrap());
    let [left, top, right, bottom] = picture.plot();
    assert_eq!(
        picture.at(right - 1, top),
        [214, 40, 40],
        "the NaN, last row and column"
    );
    assert_eq!(picture.at(left, bottom - 1), [214, 40, 40], "the infinity");
    assert_eq!(
        picture.at((left + right) / 2, (top + bottom) / 2),
        [255; 3],
        "the peak"
    );

    let one: ImageGrid = "x=5:6:1,y=5:6:1".parse().unwrap();
    let single = dot(1, 1, 0.0, 0, 0);
    let picture = Picture::decode(&quicklook(&Panel::new(&single, &one, "one")).unwrap());
    let plot = picture.plot();
    assert_eq!(picture.find(plot, [255; 3]), Some(plot));

    // A strip, a polar grid, extreme values, an extreme scale, a very long title.
    let strip: ImageGrid = "x=0:5000:1,y=0:1:1".parse().unwrap();
    quicklook(&Panel::new(&dot(1, 5000, -30.0, 0, 9), &strip, "strip")).unwrap();
    let polar: ImageGrid = "r=100:200:1,theta=-30:30:0.5".parse().unwrap();
    let mut faint = dot(100, 120, -30.0, 5, 5);
    faint.pixels[7] = Complex32::new(f32::MAX, f32::MAX);
    faint.pixels[8] = Complex32::new(f32::MIN_POSITIVE / 4.0, 0.0);
    let mut panel = Panel::new(&faint, &polar, "long ".repeat(10_000));
    for scale in [
        Scale::default(),
        Scale::Fixed {
            top_db: f64::NAN,
            span_db: 60.0,
        },
        Scale::Fixed {
            top_db: 1e300,
            span_db: f64::INFINITY,
        },
        Scale::Fixed {
            top_db: 0.0,
            span_db: -1.0,
        },
    ] {
        panel.scale = scale;
        quicklook(&panel).unwrap();
    }
}

/// Seen from above, angles increase counter-clockwise: with range upwards they increase to the left.
#[test]
fn polar_picture_is_not_mirrored() {
    let grid: ImageGrid = "r=10:20:1,theta=0:20:1".parse().unwrap();
    let image = dot(10, 20, -30.0, 7, 3);
    let picture = Picture::decode(&quicklook(&fixed(&image, &grid)).unwrap());
    let plot = picture.plot();
    let [left, top, right, _] = plot;
    let side = (right - left) / 20;
    let found = picture.find(plot, [255; 3]).unwrap();
    assert_eq!(
        (found[0], found[1]),
        (left + (20 - 1 - 3) * side, top + 2 * side),
        "column 3 from the right, row 7 of 10 from below"
    );
}

/// Values along the axes are scene coordinates; where there are none, the label states it.
#[test]
fn rotated_grid_axes_show_scene_coordinates() {
    for (text, labels, first_edges) in [
        ("x=-4:4:1,y=2:8:1", ["x (m)", "y (m)"], [-4.5, 1.5]),
        (
            "x=-4:4:1,y=2:8:1,cx=10,cy=-5",
            ["x (m)", "y (m)"],
            [5.5, -3.5],
        ),
        (
            "x=-4:4:1,y=2:8:1,cx=1,cy=2,z=3,yaw=90,roll=90",
            ["y (m)", "z (m)"],
            [-2.5, 4.5],
        ),
        ("x=-4:4:1,y=2:8:1,yaw=180", ["x (m)", "y (m)"], [4.5, -1.5]),
        (
            "x=-4:4:1,y=2:8:1,yaw=30,cx=10,cy=-5",
            [
                "u (m), along (0.87, 0.50, 0.00) from (10, -5, 0) m",
                "v (m), along (-0.50, 0.87, 0.00) from (10, -5, 0) m",
            ],
            [-4.5, 1.5],
        ),
        (
            "r=5:9:1,theta=-10:10:1,cx=3,yaw=90",
            [
                "angle (deg) from (0.00, 1.00, 0.00)",
                "range (m) from (3, 0, 0) m",
            ],
            [-10.5, 4.5],
        ),
    ] {
        let grid: ImageGrid = text.parse().unwrap();
        let [across, up] = ShownAxis::of_grid(&grid);
        assert_eq!([across.label.as_str(), up.label.as_str()], labels, "{text}");
        let edges = [across.edges(&grid.columns).0, up.edges(&grid.rows).0];
        for (edge, expected) in edges.iter().zip(first_edges) {
            assert!((edge - expected).abs() < 1e-9, "{text}: {edges:?}");
        }
        // Axes of any direction are drawn.
        let image = dot(grid.rows.count, grid.columns.count, -30.0, 0, 0);
        quicklook(&Panel::new(&image, &grid, text)).unwrap();
    }
}

#[test]
fn levels_above_scale_have_marked_colour() {
    const AMBER: [u8; 3] = [255, 150, 30];
    let grid: ImageGrid = "x=0:20:1,y=0:20:1".parse().unwrap();
    let image = dot(20, 20, -30.0, 7, 3);
    let cap = |scale| {
        let picture = Picture::decode(
            &quicklook(&Panel {
                scale,
                ..Panel::new(&image, &grid, "dot")
            })
            .unwrap(),
        );
        let plot = picture.plot();
        let all = [0, 0, picture.width, picture.height];
        (
            picture.find(plot, AMBER).is_some(),
            picture.find(all, AMBER).map(|b| b[2] > plot[2]),
            picture.grey,
        )
    };
    // 0 dB on a scale that ends at -10: the dot, and a cap on the bar to the right of the plot.
    let clipped = Scale::Fixed {
        top_db: -10.0,
        span_db: 40.0,
    };
    assert_eq!(cap(clipped), (true, Some(true), false));
    // By default the scale includes the peak, however strong it is, and the picture has only levels of grey.
    assert_eq!(cap(Scale::default()), (false, None, true));
}

#[test]
fn look_and_north_arrows_are_drawn() {
    let grid: ImageGrid = "x=0:20:1,y=0:20:1".parse().unwrap();
    let image = dot(20, 20, -30.0, 7, 3);
    let ink = |orientation| {
        let picture = Picture::decode(
            &quicklook(&Panel {
                orientation,
                ..Panel::new(&image, &grid, "dot")
            })
            .unwrap(),
        );
        let [left, _, _, bottom] = picture.plot();
        let below = [2, bottom + 30, left, bottom + 59];
        words(&picture, below).len()
    };
    let look = Some(glam::DVec3::new(0.6, 0.8, 0.0));
    let north = Some(glam::DVec3::Y);
    let none = Orientation::default();
    assert_eq!(ink(none), 0);
    let one = ink(Orientation { look, ..none });
    assert!(one >= 1);
    assert!(ink(Orientation { look, north }) > one);
}

#[test]
fn panels_are_drawn_on_one_page() {
    let grid: ImageGrid = "x=0:300:1,y=0:300:1".parse().unwrap();
    let image = dot(300, 300, -30.0, 7, 3);
    let a = fixed(&image, &grid);
    let b = Panel {
        colours: Colours::Viridis,
        ..a.clone()
    };
    let page = panels(&[a.clone(), b.clone(), a.clone()], 2).unwrap();
    let picture = Picture::decode(&page);
    let one = Picture::decode(&panels(&[a.clone(), b.clone()], 2).unwrap());
    assert_eq!((picture.width, picture.height), (one.width, 2 * one.height));
    // The maximum of Viridis is the yellow (253, 231, 37), in the right half only.
    let half = picture.width / 2;
    let yellow = [253, 231, 37];
    assert!(picture.find([0, 0, half, picture.height], yellow).is_none());
    assert!(
        picture
            .find([half, 0, picture.width, one.height], yellow)
            .is_some()
    );
    assert!(
        picture
            .find([half, one.height, picture.width, picture.height], [0; 3])
            .is_none()
    );
    assert_eq!(
        page,
        panels(&[a.clone(), b, a], 2).unwrap(),
        "the same bytes every time"
    );
}

#[test]
fn picture_rejects_grid_of_other_size() {
    let grid: ImageGrid = "x=0:3:1,y=0:3:1".parse().unwrap();
    let image = dot(2, 3, -30.0, 0, 0);
    let text = quicklook(&Panel::new(&image, &grid, "wrong"))
        .unwrap_err()
        .to_string();
    for part in ["wrong", "2 rows x 3 columns", "3 x 3"] {
        assert!(text.contains(part), "{text}");
    }
    let mut short = dot(3, 3, -30.0, 0, 0);
    short.pixels.pop();
    assert!(quicklook(&Panel::new(&short, &grid, "short")).is_err());
    assert!(panels(&[], 3).is_err());
}

/// Words in a band of the page: runs of columns with dark pixels, separated by at least six white columns. (Within a number the white next
/// to a point or a one has at most five.)
fn words(picture: &Picture, [left, top, right, bottom]: [usize; 4]) -> Vec<(usize, usize)> {
    let mut words: Vec<(usize, usize)> = Vec::new();
    for x in left..right {
        if (top..bottom).any(|y| picture.at(x, y) != [255; 3]) {
            match words.last_mut() {
                Some(last) if x - last.1 < 6 => last.1 = x + 1,
                _ => words.push((x, x + 1)),
            }
        }
    }
    words
}

/// Draw a picture and assert that its border is white; returns it with the words below the plot.
fn labels_below(text: &str, scale: Scale) -> (Picture, Vec<(usize, usize)>) {
    labels_below_grid(&text.parse().unwrap(), scale)
}

/// Like [`labels_below`], for grids that have no text form.
fn labels_below_grid(grid: &ImageGrid, scale: Scale) -> (Picture, Vec<(usize, usize)>) {
    let image = dot(grid.rows.count, grid.columns.count, -30.0, 0, 0);
    let panel = Panel {
        scale,
        ..Panel::new(&image, grid, "labels")
    };
    let bytes = quicklook(&panel).unwrap();
    let picture = Picture::decode(&bytes);
    let (width, height) = (picture.width, picture.height);
    for border in [
        [0, 0, 2, height],
        [width - 2, 0, width, height],
        [0, 0, width, 2],
        [0, height - 2, width, height],
    ] {
        assert_eq!(words(&picture, border), [], "{grid:?}: ink in {border:?}");
    }
    let bottom = picture.plot()[3];
    // Digits are 11 pixels high above a base line 23 below the plot.
    let below = words(&picture, [0, bottom + 10, width, bottom + 26]);
    (picture, below)
}

#[test]
fn axis_labels_are_complete_and_do_not_overlap() {
    // 4000000.00 to .25 by 0.05, and "dB". Each label has nine digits and a point, which DejaVu Sans sets 1303 and 651 / 2048 em wide: 90.7
    // pixels, less the white at the outer digits.
    let (picture, below) = labels_below(
        "x=4e6:4000000.3:0.01,y=6378137:6378137.3:0.01",
        Scale::default(),
    );
    assert_eq!(below.len(), 7, "{below:?}");
    for (begin, end) in &below[..6] {
        assert!((86..=91).contains(&(end - begin)), "{below:?}");
    }
    // Left of the ticks: the title, then labels of the same width.
    let [left, top, _, bottom] = picture.plot();
    let left_of_ticks = words(&picture, [0, top, left - 8, bottom]);
    assert_eq!(left_of_ticks.len(), 2, "{left_of_ticks:?}");
    let wide = left_of_ticks[1].1 - left_of_ticks[1].0;
    assert!((86..=91).contains(&wide), "{left_of_ticks:?}");

    // A label at the very end, at least 12 pixels from "dB". 500 pixels are drawn on 1000: 0 to 450 by 50 are 100 pixels apart, and none is
    // omitted. The last of 501 is 500.
    for (grid, count) in [
        ("x=0:500:1,y=0:1:1", 10),
        ("x=0:501:1,y=0:1:1", 11),
        ("x=4e6:4000501:1,y=0:1:1", 11),
    ] {
        let (_, below) = labels_below(grid, Scale::default());
        assert_eq!(below.len(), count + 1, "{grid}: {below:?}");
        let gap = below[count].0 - below[count - 1].1;
        assert!(gap >= 12, "{grid}: {below:?}");
    }

    // -40 to 40 by 20, on 990 pixels by 10: as many as before.
    let (picture, below) = labels_below("x=-45:45:1,y=-45:45:1", Scale::default());
    assert_eq!(below.len(), 9 + 1, "{below:?}");
    assert_eq!(picture.plot()[0], 96, "the margin");

    // Labels wider than the smallest plot, on either axis and the bar; values without exponents of 301 digits.
    let top_db = 1e12;
    for (start, step, span_db) in [(1e14, 1.0, 60.0), (1e300, 1e300, 0.01)] {
        let axis = Axis {
            start,
            step,
            count: 2,
        };
        let grid = ImageGrid::horizontal(axis, axis, 0.0);
        labels_below_grid(&grid, Scale::Fixed { top_db, span_db });
    }
}

/// Dots have the colour of their values at their places; without a value they are rings. The ends of viridis are (68, 1, 84) and (253, 231, 37).
#[test]
fn dots_have_colours_of_their_values() {
    let grid: ImageGrid = "x=0:40:1,y=0:20:1".parse().unwrap();
    let image = dot(20, 40, -30.0, 0, 0);
    let values = [(2.0, 5.0, -1.0), (2.0, 35.0, 3.0), (15.0, 20.0, f64::NAN)];
    let panel = Panel {
        dots: Some(Dots {
            dots: values.map(|(y, x, value)| Dot { at: [y, x], value }).into(),
            range: (-1.0, 3.0),
            unit: "mm".to_owned(),
            colours: Colours::Viridis,
        }),
        ..fixed(&image, &grid)
    };
    let picture = Picture::decode(&quicklook(&panel).unwrap());
    let [left, top, right, bottom] = picture.plot();
    let side = (right - left) as f64 / 40.0;
    // The middle of a pixel is half a pixel from its edge; rows point up.
    let middle = |y: f64, x: f64| {
        let across = left as f64 + (x + 0.5) * side;
        let down = bottom as f64 - (y + 0.5) * side;
        (across as usize, down as usize)
    };
    let at = |(x, y): (usize, usize)| picture.at(x, y);
    assert_eq!(at(middle(2.0, 5.0)), [68, 1, 84]);
    assert_eq!(at(middle(2.0, 35.0)), [253, 231, 37]);
    // -30 dB of 60: the middle of grey, as in the rest of the image.
    assert_eq!(at(middle(15.0, 20.0)), at(middle(10.0, 10.0)));
    let (x, y) = middle(15.0, 20.0);
    let around = [x - 12, y - 12, x + 12, y + 12];
    let red = picture.find(around, [214, 40, 40]);
    assert!(
        red.is_some_and(|[l, t, r, b]| l < x && r > x && t < y && b > y),
        "{red:?}"
    );
    assert!(top < bottom);
    let Some(dots) = panel.dots.clone() else {
        unreachable!()
    };
    let empty = Panel {
        dots: Some(Dots {
            range: (1.0, 1.0),
            ..dots
        }),
        ..panel
    };
    let refused = quicklook(&empty).unwrap_err().to_string();
    assert!(
        refused.contains("dots: expected a finite range"),
        "{refused}"
    );
}
