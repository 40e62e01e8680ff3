//! Points of the strip in images by every former that takes it.

use subaperture::focus::beam::{BeamChoice, InBeam, choose};
use subaperture::focus::{FormError, ImageFormer, Task};
use subaperture::geometry::ImageGrid;
use subaperture::image::Image;
use subaperture::monitor::Silent;
use subaperture::phase_history::PhaseHistory;
use subaperture::signal::window::Window;

use super::folder::{CSV, POINTS_M, folder, former, history, patch};
use subaperture_tests::orbit_strip::{self as strip, Missing};

fn form(
    former: Box<dyn ImageFormer>,
    history: &dyn PhaseHistory,
    grid: &ImageGrid,
) -> Result<Image, FormError> {
    let chosen = choose(BeamChoice::Stated, history, grid, &Silent).unwrap();
    let former = InBeam::new(former, chosen.beam.expect("the description states a beam"))?;
    let weights = former.weights(history.collection(), grid, Window::None, Window::None)?;
    let task = Task {
        memory_bytes: u64::MAX,
        ..Task::new(history, grid, &weights)
    };
    Ok(former.form(&task)?.image)
}

/// Offset of the maximum from the middle of a patch in x and y, metres, by the paraboloid through the brightest pixel and its neighbours.
fn peak_m(image: &Image, step: f64) -> [f64; 2] {
    let (rows, columns) = (image.rows, image.columns);
    let level = |row: usize, column: usize| f64::from(image.pixels[row * columns + column].norm());
    let inner = (1..rows - 1).flat_map(|row| (1..columns - 1).map(move |column| (row, column)));
    let (r, c) = inner
        .max_by(|a, b| level(a.0, a.1).total_cmp(&level(b.0, b.1)))
        .unwrap();
    let half = |before: f64, after: f64| 0.5 * (after - before);
    let bend = |before: f64, after: f64| before - 2.0 * level(r, c) + after;
    // Gradient and second derivatives; the axes of the response are not those of the grid.
    let [gx, gy] = [
        half(level(r, c - 1), level(r, c + 1)),
        half(level(r - 1, c), level(r + 1, c)),
    ];
    let [xx, yy] = [
        bend(level(r, c - 1), level(r, c + 1)),
        bend(level(r - 1, c), level(r + 1, c)),
    ];
    let xy = 0.25
        * (level(r + 1, c + 1) - level(r + 1, c - 1) - level(r - 1, c + 1) + level(r - 1, c - 1));
    let det = xx * yy - xy * xy;
    let part = [(xy * gy - yy * gx) / det, (xy * gx - xx * gy) / det];
    let from_middle = |at: usize, count: usize| at as f64 - 0.5 * (count - 1) as f64;
    [
        (from_middle(c, columns) + part[0]) * step,
        (from_middle(r, rows) + part[1]) * step,
    ]
}

/// Distance between pixels: half of the resolution of 12.6 m in the ground plane (7.5 m in slant range at 37 degrees of incidence).
const PIXEL_M: f64 = 6.0;

#[test]
fn points_are_focused_within_a_tenth_of_a_pixel() {
    for missing in [Missing::Absent, Missing::Zero] {
        let folder = folder(missing, CSV, &strip::antennas());
        let history = history(folder.path());
        let absent = (0..strip::PULSES).filter(|&n| strip::missing(n)).count();
        // Pulses of zeros are left out.
        assert_eq!(history.collection().pulses.len(), strip::PULSES - absent);
        let names: &[&str] = match missing {
            Missing::Zero => &["bp"],
            _ => &["bp", "ffbp", "rdbp"],
        };
        for &name in names {
            for point in POINTS_M {
                let image = form(former(name), &*history, &patch(point, 4.0, 2.0)).unwrap();
                let [x, y] = peak_m(&image, 2.0);
                println!("{name}, {point:.0}: {x:.3} m, {y:.3} m off");
                // The receiver is that of the origin's echo: up to 1.5 km away the position along the track is wrong by 0.04 m. Noise at 57 dB moves
                // a peak by a thousandth of the resolution, and the parabola by a hundredth of its step.
                assert!(x.hypot(y) < 0.1 * PIXEL_M, "{name}, {point}: {x} m, {y} m");
            }
        }
    }
}

#[test]
fn frequency_domain_formers_focus_or_state_a_reason() {
    let complete = folder(Missing::Complete, CSV, &strip::antennas());
    let absent = folder(Missing::Absent, CSV, &strip::antennas());
    for name in ["rda", "omega-k"] {
        let point = POINTS_M[0];
        for folder in [&complete, &absent] {
            match form(
                former(name),
                &*history(folder.path()),
                &patch(point, 4.0, 2.0),
            ) {
                Ok(image) => {
                    let [x, y] = peak_m(&image, 2.0);
                    println!("{name}: {x:.3} m, {y:.3} m off");
                    assert!(x.hypot(y) < 0.1 * PIXEL_M, "{name}: {x} m, {y} m");
                }
                Err(error @ (FormError::Unsuited(_) | FormError::BoundMissed { .. })) => {
                    println!("{name}: {error}");
                }
                Err(error) => panic!("{name}: {error}"),
            }
        }
    }
}
