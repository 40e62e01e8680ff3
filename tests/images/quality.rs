//! Point target measurements of synthetic and focused responses against theory.

use std::f64::consts::{PI, TAU};

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use subaperture::focus::exact::Exact;
use subaperture::focus::rdbp::{Mode, RangeDopplerBackprojection};
use subaperture::focus::{ImageFormer, Task};
use subaperture::geometry::{Axis, ImageGrid};
use subaperture::image::Image;
use subaperture::phase_history::{PhaseHistory, Weights};
use subaperture::quality::response::{
    Carrier, Direction, Response, ResponseError, Settings, Target, UPSAMPLING, measure,
};
use subaperture::resolution::theory::{Expected, expected};
use subaperture::signal::window::Window;
use subaperture::simulate::{PointTargetHistory, Preset, Scatterer, Variation};

use crate::made::{Made, noise};

const WINDOWS: [Window; 3] = [
    Window::None,
    Window::Hamming,
    Window::Taylor { side_lobe_db: 35.0 },
];

fn square(side: usize) -> ImageGrid {
    let axis = Axis {
        start: 0.0,
        step: 1.0,
        count: side,
    };
    ImageGrid::horizontal(axis, axis, 0.0)
}

/// Theory for a span of pixels on either side.
fn theory(window: Window, span_cells: f64) -> Expected {
    expected(&window.weights(Made::LINES), span_cells, 1.5).unwrap()
}

#[track_caller]
fn near_db(name: &str, value: Option<f64>, wanted: Option<f64>) {
    let (value, wanted) = (value.unwrap(), wanted.unwrap());
    println!("{name}: {value:.3} dB, theory {wanted:.3} dB");
    assert!(
        (value - wanted).abs() < 0.2,
        "{name}: {value}, not {wanted}"
    );
}

/// Assert every cut: widths to 1 %, ratios to 0.2 dB.
fn check_cuts(name: &str, response: &Response, window: Window, cells: [f64; 2]) {
    for (cut, cell) in response.cuts.iter().zip(cells) {
        let span = (cut.span[1] - cut.span[0]) / 2.0 / cell;
        let theory = theory(window, span);
        let width = cut.width_3db.unwrap() / cell;
        println!(
            "{name} {window} {:?}: {width:.4} cells, theory {:.4}, span {span:.1}",
            cut.along, theory.width_3db
        );
        assert!(
            (width / theory.width_3db - 1.0).abs() < 0.01,
            "{name} {window}: {width}"
        );
        near_db(
            "PSLR, nulls",
            cut.null_rule.pslr_db,
            theory.null_rule.pslr_db,
        );
        near_db(
            "ISLR, nulls",
            cut.null_rule.islr_db,
            theory.null_rule.islr_db,
        );
        near_db(
            "PSLR, fixed",
            cut.fixed_rule.pslr_db,
            theory.fixed_rule.pslr_db,
        );
        near_db(
            "ISLR, fixed",
            cut.fixed_rule.islr_db,
            theory.fixed_rule.islr_db,
        );
    }
}

#[test]
fn measure_agrees_with_theory_for_synthetic_response() {
    // Cells of 1.4 to 3 pixels, peaks between pixels, and spectra at any frequency, also across their boundary.
    for (cell, row, column, turn) in [
        (2.0, 50.31, 49.77, [0.0, 0.0]),
        (1.4, 50.5, 50.0, [0.6, -1.1]),
        (3.0, 49.9, 50.123, [3.0, -2.9]),
    ] {
        for window in WINDOWS {
            let made = Made {
                window,
                cell,
                row,
                column,
                turn,
                amplitude: Complex64::from_polar(0.3, 1.2),
            };
            let image = made.image(101);
            let response = measure(
                &image,
                &square(101),
                Target::Brightest,
                &Settings::default(),
            )
            .unwrap();
            let error = (response.row - row).hypot(response.column - column);
            println!(
                "{window}, cell {cell}: position off by {:.5} cells",
                error / cell
            );
            assert!(error < cell / 128.0, "{window}: {error}");
            // The polynomial through the chip is the response plus the interpolated error of periodic continuation outside, sum_m
            // (f_periodic - f)[m] sinc(x - m), |m| > H. At H pixels the response is at most a = cell / (pi H) of the peak, and the
            // difference 2 a. Its terms are +-sin(pi x) / (pi m) times that, with phases that change by pi - pi / cell between terms: such
            // a sum is its first term over 2 cos(pi / (2 cell)). Two ends and two directions.
            let half = (response.chip.grid.rows.count / UPSAMPLING / 2) as f64;
            let bound: f64 = [row, column]
                .map(|at: f64| {
                    let between = (PI * (at - at.round())).sin().abs();
                    let edge = cell / (PI * half);
                    4.0 * edge * between / (PI * half) / (2.0 * (PI / (2.0 * cell)).cos())
                })
                .iter()
                .sum();
            let level_db = response.level_db - 20.0 * 0.3f64.log10();
            // The phase is that at the estimated peak.
            let found = turn[0] * (response.row - row) + turn[1] * (response.column - column);
            let phase_rad = response.phase_rad - 1.2 - found;
            println!("level off by {level_db:.5} dB, phase by {phase_rad:.5}, bound {bound:.5}");
            // Rounding to float32 may add 1e-6.
            assert!(level_db.abs() < 20.0 * (bound + 1e-5).ln_1p() / 10f64.ln());
            assert!(phase_rad.abs() < bound + 1e-5, "{phase_rad}");
            check_cuts("made", &response, window, [cell, cell]);
            // Separable: (main + side)^2 is the total energy, main^2 that inside.
            let ratio = |i: usize| 10f64.powf(response.cuts[i].null_rule.islr_db.unwrap() / 10.0);
            let both = (1.0 + ratio(0)) * (1.0 + ratio(1)) - 1.0;
            near_db("ISLR, 2-D", response.islr_2d_db, Some(10.0 * both.log10()));
        }
    }
}

/// Widths and side lobes do not depend on the pixels: the same from 2.3 pixels per cell to 46.
#[test]
fn measure_is_independent_of_pixel_spacing() {
    let measured: Vec<Response> = [2.3, 9.2, 46.0]
        .into_iter()
        .map(|cell| {
            let side = (30.0 * cell) as usize;
            let made = Made {
                window: Window::Taylor { side_lobe_db: 35.0 },
                cell,
                row: side as f64 / 2.0 + 0.3,
                column: side as f64 / 2.0 - 0.2,
                turn: [0.4, -0.2],
                amplitude: Complex64::ONE,
            };
            let grid = square(side);
            measure(
                &made.image(side),
                &grid,
                Target::Brightest,
                &Settings::default(),
            )
            .unwrap()
        })
        .collect();
    for (response, cell) in measured.iter().zip([2.3, 9.2, 46.0]) {
        check_cuts(
            "made",
            response,
            Window::Taylor { side_lobe_db: 35.0 },
            [cell; 2],
        );
        let (cut, first) = (&response.cuts[0], &measured[0].cuts[0]);
        let spans = [cut, first].map(|cut| cut.span[1] / cut.width_3db.unwrap());
        assert!((spans[0] / spans[1] - 1.0).abs() < 0.02, "{spans:?}");
        near_db("ISLR", cut.null_rule.islr_db, first.null_rule.islr_db);
        assert!((response.phase_rad - measured[0].phase_rad).abs() < 0.01 + 0.4 / 128.0 * cell);
    }
}

/// Aliased pixels are refused where the resolution is given.
#[test]
fn measure_rejects_undersampled_image() {
    let history = Preset::Table41.simulate(&Variation::default());
    let looks = subaperture::resolution::support::Looks::new(
        history.collection(),
        Window::None,
        Window::None,
    );
    let settings = Settings {
        looks: Some(&looks),
        ..Settings::default()
    };
    // Cells of 0.58 and 0.75 m.
    for (grid, along) in [
        ("x=-15:15:0.3,y=-15:15:0.3", None),
        ("x=-15:15:0.6,y=-15:15:0.3", Some("x")),
        ("x=-15:15:0.3,y=-15:15:0.8", Some("y")),
    ] {
        let grid: ImageGrid = grid.parse().unwrap();
        let made = Made {
            window: Window::None,
            cell: 2.0,
            row: grid.rows.count as f64 / 2.0,
            column: grid.columns.count as f64 / 2.0,
            turn: [0.0; 2],
            amplitude: Complex64::ONE,
        };
        let side = grid.rows.count.max(grid.columns.count);
        let whole = made.image(side);
        let pixels = (0..grid.rows.count)
            .flat_map(|i| whole.pixels[i * side..i * side + grid.columns.count].to_vec());
        let image = Image {
            rows: grid.rows.count,
            columns: grid.columns.count,
            pixels: pixels.collect(),
        };
        let found = measure(&image, &grid, Target::Brightest, &settings);
        match along {
            None => assert!(found.is_ok()),
            Some(wanted) => assert!(
                matches!(found, Err(ResponseError::TooCoarse { along, .. }) if along == wanted),
                "{found:?}"
            ),
        }
    }
}

#[test]
fn measure_cuts_along_and_across_line_of_sight() {
    // The response is the same along both axes and, with the round main lobe of the Hamming window, nearly so along diagonals; exactly, the
    // diagonal cut is the product of both axes' responses at s / sqrt 2.
    let made = Made {
        window: Window::Hamming,
        cell: 2.0,
        row: 50.2,
        column: 50.4,
        turn: [0.0; 2],
        amplitude: Complex64::ONE,
    };
    let settings = Settings {
        line_of_sight_rad: Some(TAU / 8.0),
        ..Settings::default()
    };
    let response = measure(&made.image(101), &square(101), Target::Brightest, &settings).unwrap();
    let directions: Vec<Direction> = response.cuts.iter().map(|cut| cut.along).collect();
    assert_eq!(
        directions,
        [
            Direction::X,
            Direction::Y,
            Direction::Range,
            Direction::CrossRange
        ]
    );
    // Where the product has half of its power each factor has 1 / sqrt 2 of it.
    let weights = Window::Hamming.weights(Made::LINES);
    let power = |x: f64| subaperture::resolution::theory::transform(&weights, x).powi(2);
    let half = (0..20_000)
        .map(|i| f64::from(i) * 1e-4)
        .find(|&x| power(x) < 0.5f64.sqrt())
        .unwrap();
    let wanted = 2.0 * half * 2f64.sqrt() * 2.0;
    for cut in &response.cuts[2..] {
        let width = cut.width_3db.unwrap();
        assert!((width / wanted - 1.0).abs() < 0.01, "{width}, not {wanted}");
    }
}

#[test]
fn measure_rejects_noise_borders_and_non_finite_pixels() {
    let made = |row, column| Made {
        window: Window::None,
        cell: 2.0,
        row,
        column,
        turn: [0.0; 2],
        amplitude: Complex64::ONE,
    };
    let settings = Settings::default();
    let grid = square(61);
    let at = |image: &Image, target| measure(image, &grid, target, &settings).unwrap_err();
    let border = at(&made(4.0, 30.0).image(61), Target::Brightest);
    assert!(
        matches!(
            border,
            ResponseError::Border {
                row: 4,
                column: 30,
                room: 4,
                ..
            }
        ),
        "{border}"
    );
    let noise = noise(61, 1);
    assert!(matches!(
        at(&noise, Target::Brightest),
        ResponseError::NoPeak { .. } | ResponseError::Border { .. }
    ));
    let near = |x, y| Target::Near {
        column_value: x,
        row_value: y,
    };
    let refused = at(&noise, near(30.0, 30.0));
    assert!(matches!(refused, ResponseError::NoPeak { .. }), "{refused}");
    let outside = at(&noise, near(90.0, 30.0)).to_string();
    assert!(
        outside.contains("x 90 is not on the image, which reaches from 0 to 60"),
        "{outside}"
    );
    let mut holed = made(30.0, 30.0).image(61);
    holed.pixels[35 * 61 + 35] = Complex32::new(f32::NAN, 0.0);
    let error = at(&holed, Target::Brightest);
    assert_eq!(
        error,
        ResponseError::NotFinite {
            row: 30,
            column: 30
        }
    );
    let dark = Image {
        pixels: vec![Complex32::ZERO; 61 * 61],
        ..holed
    };
    assert!(
        at(&dark, Target::Brightest)
            .to_string()
            .contains("no pixel above zero")
    );
}

/// One scatterer of Table 4.1 by two formers.
#[test]
fn measure_agrees_with_theory_for_focused_points() {
    let history = Preset::Table41.simulate(&Variation::default());
    let position_m = DVec3::new(0.113, -0.207, 0.0);
    let history = PointTargetHistory::new(
        history.collection().clone(),
        vec![Scatterer {
            position_m,
            amplitude: Complex64::from_polar(1.0, 0.5),
        }],
        None,
    );
    // Range: c / (2 B) with 200 MHz. Cross range: the wavelength at 10 GHz over twice the angle of the aperture, whose pulses, like the
    // samples of the band, count as cells: 1040 times 0.125 m at 5 km.
    let cross = 299_792_458.0 / 10e9 / 2.0 / (2.0 * f64::atan(1040.0 * 0.125 / 2.0 / 5000.0));
    let cells = [cross, 299_792_458.0 / 2.0 / 200e6];
    let grid: ImageGrid = "x=-9:9:0.28,y=-12:12:0.35".parse().unwrap();
    let formers: [Box<dyn ImageFormer>; 2] = [
        Box::new(Exact),
        Box::new(RangeDopplerBackprojection {
            mode: Mode::Precise,
            error_db: -60.0,
            sub_cpi: None,
            patch_m: None,
        }),
    ];
    for former in &formers {
        for window in [Window::None, Window::Taylor { side_lobe_db: 35.0 }] {
            let weights = Weights::new(history.collection(), window, window);
            let image = former
                .form(&Task::new(&history, &grid, &weights))
                .unwrap()
                .image;
            // The middle of the band is 10 GHz less half a sample.
            let wavelength_m = 299_792_458.0 / (10e9 - 200e6 / 256.0 / 2.0);
            let settings = Settings {
                carrier: Some(Carrier::new(DVec3::new(0.0, -5000.0, 0.0), wavelength_m)),
                ..Settings::default()
            };
            let response = measure(&image, &grid, Target::Brightest, &settings).unwrap();
            let off = [
                response.column_value - position_m.x,
                response.row_value - position_m.y,
            ];
            println!("{} {window}: off by {off:?} m", former.name());
            assert!(
                off[0].abs() < cells[0] / 128.0 && off[1].abs() < cells[1] / 128.0,
                "{off:?}"
            );
            assert!(response.level_db.abs() < 0.02, "{}", response.level_db);
            // The phase is that at the estimated peak, 2 / lambda cycles per metre of range: 1 mm changes it by 0.42 radians.
            let wanted = 0.5 + 2.0 * TAU / wavelength_m * off[1];
            println!(
                "phase {:.4}, expected there {wanted:.4}, turn {:?}",
                response.phase_rad, response.turn
            );
            assert!(response.turn_is_known);
            assert!(
                (response.phase_rad - wanted).abs() < 0.02,
                "{}",
                response.phase_rad
            );
            check_cuts(former.name(), &response, window, cells);
        }
    }
}
