//! Displacement of simulated slopes against their known motion.

mod slope;
mod speckle;

use num_complex::Complex32;
use slope::{NEAR_M, SPACING, STEP_M, Slope, WAVELENGTH_M, coverage, days, rms, weather};
use subaperture_interferometry::displacement::{
    DisplacementError, DisplacementSeries, Passes, PointChoice, ScreenModel, Settings, StableArea,
    measure,
};
use subaperture_model::geometry::Extent;

/// Slide of a Gaussian profile of 20 m deviation about x = 0, y = 220 m that accelerates to 40 mm: 4.7 half wavelengths, at most 6.4 mm in a pass. Neighbours 8 m apart differ by
/// up to 1.6 mm in a pass.
fn slide(x: f64, y: f64, pass: usize) -> f64 {
    let k = pass as f64 / 12.0;
    0.04 * k * k * (-0.5 * (x * x + (y - 220.0).powi(2)) / 400.0).exp()
}

fn rectangle(x_m: (f64, f64), y_m: (f64, f64)) -> StableArea {
    StableArea::Rectangle(Extent { x_m, y_m })
}

/// At 30 dB the phase deviates by 1 / sqrt(2 000) rad, the difference of two passes by 0.032 rad, and the displacement by 0.043 mm; the fit of the screen adds less than a tenth of the variance.
#[test]
fn displacement_of_accelerating_slide_is_within_a_tenth_of_a_millimetre() {
    let slope = Slope {
        side: 30,
        times_s: days(13),
        motion: slide,
        snr_db: |_| 30.0,
        screen: weather,
    };
    let settings = Settings {
        stable: vec![
            rectangle((-1e3, 1e3), (310.0, 1e3)),
            rectangle((-1e3, 1e3), (0.0, 120.0)),
        ],
        ..Settings::default()
    };
    for stable in [settings.stable.clone(), Vec::new()] {
        let robust = stable.is_empty();
        let settings = Settings {
            stable,
            ..settings.clone()
        };
        let series = slope.measured(5, &settings).unwrap();
        assert_eq!(series.points.len(), 900);
        assert_eq!(series.counts.doubtful, 0);
        let errors = slope.errors(&series);
        let largest = errors.iter().map(|e| e[0].abs()).fold(0.0, f64::max);
        let rms_mm = 1e3 * rms(errors.iter().map(|e| e[0]));
        let stated_mm = 1e3 * rms(errors.iter().map(|e| e[1]));
        println!(
            "robust {robust}: rms {rms_mm:.4} mm, stated {stated_mm:.4} mm, largest {:.4} mm, coverage {:.4}, screen {}",
            1e3 * largest,
            coverage(&errors),
            series.counts.screen
        );
        // No slip of half a wavelength, 8.5 mm: five deviations and more only.
        assert!(largest < 0.5e-3, "{largest}");
        assert!(rms_mm < 0.1, "{rms_mm}");
        assert!(
            (rms_mm / stated_mm - 1.0).abs() < 0.1,
            "{rms_mm} {stated_mm}"
        );
        // Slope of each screen relative to the first pass, within five deviations.
        for (k, screen) in series.screens.iter().enumerate().skip(1) {
            let truth = weather(k)[1] - weather(0)[1];
            let error = (screen.slope_rad_per_m - truth).abs();
            assert!(
                error < 5.0 * screen.slope_deviation_rad_per_m,
                "{k}: {screen:?} {truth}"
            );
        }
    }
}

/// 95 % bars of displacements and velocities over seeds, for few and many passes, equal and unequal points.
#[test]
fn bars_of_95_percent_cover_90_to_98_percent() {
    /// Levels from 17 to 37 dB: the deviation of a point is up to ten times that of another.
    fn mixed(n: usize) -> f64 {
        17.0 + (n * 7 % 21) as f64
    }
    fn creep(_: f64, y: f64, pass: usize) -> f64 {
        2e-4 * pass as f64 * if y < 140.0 { 1.0 } else { 0.0 }
    }
    for (passes, snr_db) in [
        (2, (|_| 30.0) as fn(usize) -> f64),
        (3, mixed),
        (5, |_| 30.0),
        (12, mixed),
    ] {
        let slope = Slope {
            side: 12,
            times_s: days(passes),
            motion: creep,
            snr_db,
            screen: weather,
        };
        let settings = Settings {
            stable: vec![rectangle((-1e3, 1e3), (150.0, 1e3))],
            ..Settings::default()
        };
        for stable in [true, false] {
            let settings = match stable {
                true => settings.clone(),
                // At rest, so that all points may determine the screen.
                false => Settings {
                    stable: Vec::new(),
                    ..settings.clone()
                },
            };
            let slope = match stable {
                true => Slope {
                    times_s: slope.times_s.clone(),
                    ..slope
                },
                false => Slope {
                    motion: |_, _, _| 0.0,
                    times_s: slope.times_s.clone(),
                    ..slope
                },
            };
            let (mut errors, mut velocities) = (Vec::new(), Vec::new());
            for seed in 0..30 {
                let series = slope.measured(100 + seed, &settings).unwrap();
                errors.extend(slope.errors(&series));
                velocities.extend(series.points.iter().map(|point| {
                    let [x, y, _] = point.position_m;
                    let truth = (slope.motion)(x, y, 1) / 86_400.0;
                    [point.velocity_m_s - truth, point.velocity_deviation_m_s]
                }));
            }
            let [covered, of_velocity] = [coverage(&errors), coverage(&velocities)];
            println!(
                "{passes} passes, stable {stable}: {} bars cover {covered:.4}, velocities {of_velocity:.4}",
                errors.len()
            );
            assert!((0.90..0.98).contains(&covered), "{covered}");
            assert!((0.90..0.98).contains(&of_velocity), "{of_velocity}");
        }
    }
}

/// Slides that are too fast for their passes: every displacement that is wrong by a slip is reported as doubtful. Peak rates from an eighth of a wavelength per pass, which is measured without
/// slips, to 3 wavelengths; profiles of one to four points' width, and blocks with a sharp edge.
#[test]
fn half_wavelength_slips_of_fast_slides_are_reported() {
    macro_rules! slide {
        ($rate:expr, $width_m:expr) => {
            (|x: f64, y: f64, pass: usize| {
                let off = (x * x + (y - 190.0).powi(2)) / ($width_m * $width_m);
                $rate * WAVELENGTH_M * pass as f64 * (-0.5 * off).exp()
            }) as fn(f64, f64, usize) -> f64
        };
    }
    macro_rules! block {
        ($rate:expr) => {
            |x: f64, y: f64, pass: usize| {
                let inside = x.abs() < 25.0 && (y - 190.0).abs() < 25.0;
                $rate * WAVELENGTH_M * pass as f64 * f64::from(u8::from(inside))
            }
        };
    }
    let cases = [
        (0.125, slide!(0.125, 20.0)),
        (0.3, slide!(0.3, 30.0)),
        (0.3, slide!(0.3, 10.0)),
        (0.45, slide!(0.45, 12.0)),
        (0.6, slide!(0.6, 15.0)),
        (0.9, slide!(0.9, 20.0)),
        (0.35, slide!(0.35, 5.0)),
        (0.6, slide!(0.6, 6.0)),
        (0.9, slide!(0.9, 9.0)),
        (1.3, slide!(1.3, 14.0)),
        (2.0, slide!(2.0, 20.0)),
        (3.0, slide!(3.0, 30.0)),
        (0.3, block!(0.3)),
        (0.35, block!(0.35)),
    ];
    let settings = Settings {
        stable: vec![
            rectangle((-1e3, -60.0), (0.0, 1e3)),
            rectangle((60.0, 1e3), (0.0, 1e3)),
        ],
        ..Settings::default()
    };
    let (mut slips, mut silent) = (0, 0);
    for (rate, motion) in cases {
        let slope = Slope {
            side: 24,
            times_s: days(5),
            motion,
            snr_db: |_| 30.0,
            screen: weather,
        };
        let series = slope.measured(7, &settings).unwrap();
        let (mut wrong, mut unreported) = (0, 0);
        for point in &series.points {
            let [x, y, _] = point.position_m;
            for pass in 1..5 {
                let error = point.displacement_m[pass] - motion(x, y, pass);
                let reported = point.doubtful_from.is_some_and(|from| from <= pass);
                if error.abs() > WAVELENGTH_M / 4.0 {
                    wrong += 1;
                    unreported += usize::from(!reported);
                }
            }
        }
        println!(
            "{rate} wavelengths a pass: {wrong} slips, {unreported} unreported, {} doubtful of {}",
            series.counts.doubtful,
            series.points.len()
        );
        if rate == 0.125 {
            assert_eq!((wrong, series.counts.doubtful), (0, 0));
        }
        slips += wrong;
        silent += unreported;
    }
    assert!(slips > 100, "{slips}");
    assert_eq!(silent, 0);
}

/// A uniform motion of the slope is displacement relative to a stable area, and atmosphere if the settings name no area.
#[test]
fn stable_area_defines_zero_displacement() {
    fn uniform(_: f64, y: f64, pass: usize) -> f64 {
        if y > 140.0 { 1e-3 * pass as f64 } else { 0.0 }
    }
    let slope = Slope {
        side: 16,
        times_s: days(4),
        motion: uniform,
        snr_db: |_| 30.0,
        screen: |pass| [2.4 * pass as f64, 0.0],
    };
    let settings = Settings {
        screen: ScreenModel::Constant,
        stable: vec![StableArea::Disc {
            centre_m: [0.0, 115.0],
            radius_m: 20.0,
        }],
        ..Settings::default()
    };
    let mean_of = |series: &DisplacementSeries| {
        let moving = series.points.iter().filter(|p| p.position_m[1] > 140.0);
        let last: Vec<f64> = moving.map(|p| p.displacement_m[3]).collect();
        last.iter().sum::<f64>() / last.len() as f64
    };
    // Positive away from the radar: 3 mm after 3 passes. The mean of some 15 stable points has a deviation of 0.011 mm.
    let series = slope.measured(3, &settings).unwrap();
    assert!(series.counts.stable >= 12, "{:?}", series.counts);
    let moved = mean_of(&series);
    assert!((moved - 3e-3).abs() < 0.06e-3, "{moved}");
    // The velocity of 1 mm a day, likewise.
    let fastest = series.points.last().unwrap().velocity_m_s * 86_400.0;
    assert!((fastest - 1e-3).abs() < 0.1e-3, "{fastest}");
    // Three quarters of the points move alike: they are the reference.
    let series = slope
        .measured(
            3,
            &Settings {
                stable: Vec::new(),
                ..settings
            },
        )
        .unwrap();
    let moved = mean_of(&series);
    assert!(moved.abs() < 0.06e-3, "{moved}");
}

#[test]
fn unsuited_passes_and_settings_are_refused() {
    let slope = Slope {
        side: 6,
        times_s: days(3),
        motion: |_, _, _| 0.0,
        snr_db: |_| 30.0,
        screen: weather,
    };
    let images = slope.images(1);
    let grid = slope.grid();
    let passes = Passes {
        images: &images,
        times_s: &slope.times_s,
        grid: &grid,
        radar_m: [0.0; 3],
        wavelength_m: WAVELENGTH_M,
    };
    let settings = Settings::default();
    let refused = |passes: &Passes, settings: &Settings| measure(passes, settings).unwrap_err();
    let one = Passes {
        images: &images[..1],
        times_s: &[0.0],
        ..passes
    };
    assert_eq!(refused(&one, &settings), DisplacementError::Passes(1));
    let equal = Passes {
        times_s: &[0.0, 5.0, 5.0],
        ..passes
    };
    assert!(matches!(
        refused(&equal, &settings),
        DisplacementError::Order { pass: 2, .. }
    ));
    let few = Passes {
        times_s: &[0.0, 5.0],
        ..passes
    };
    assert!(matches!(
        refused(&few, &settings),
        DisplacementError::Times {
            passes: 3,
            times: 2
        }
    ));
    let other = Slope {
        side: 5,
        times_s: days(3),
        ..slope
    }
    .grid();
    let other = Passes {
        grid: &other,
        ..passes
    };
    assert!(matches!(
        refused(&other, &settings),
        DisplacementError::Size { pass: 0, .. }
    ));
    let zero = Passes {
        wavelength_m: 0.0,
        ..passes
    };
    assert!(matches!(
        refused(&zero, &settings),
        DisplacementError::Setting {
            name: "wavelength",
            ..
        }
    ));
    let wide = Settings {
        dispersion: 1.5,
        ..settings.clone()
    };
    assert!(matches!(
        refused(&passes, &wide),
        DisplacementError::Setting {
            name: "dispersion",
            ..
        }
    ));
    let high = Settings {
        floor_db: 50.0,
        ..settings.clone()
    };
    assert!(matches!(
        refused(&passes, &high),
        DisplacementError::TooFewPoints {
            found: 0,
            above_floor: 0,
            ..
        }
    ));
    let empty = Settings {
        stable: vec![rectangle((500.0, 600.0), (0.0, 10.0))],
        ..settings.clone()
    };
    assert!(matches!(
        refused(&passes, &empty),
        DisplacementError::EmptyArea(_)
    ));
    let single = Settings {
        stable: vec![StableArea::Disc {
            centre_m: slope_point(),
            radius_m: 1.0,
        }],
        ..settings.clone()
    };
    assert!(matches!(
        refused(&passes, &single),
        DisplacementError::TooFewStable { found: 1, .. }
    ));
    // Pixels that are not finite in one pass are no points; every pixel of a response may be one.
    let mut holed = images.clone();
    let at = (SPACING + 1) * (6 * SPACING) + SPACING + 1;
    holed[1].pixels[at] = Complex32::new(f32::NAN, 0.0);
    let whole = measure(&passes, &settings).unwrap();
    let less = measure(
        &Passes {
            images: &holed,
            ..passes
        },
        &settings,
    )
    .unwrap();
    let is_there = |series: &DisplacementSeries| {
        (series.points.iter()).any(|p| (p.row, p.column) == (SPACING + 1, SPACING + 1))
    };
    assert!(is_there(&whole) && !is_there(&less));
    let limited = Settings {
        most_points: 35,
        ..settings.clone()
    };
    assert!(matches!(
        refused(&passes, &limited),
        DisplacementError::TooManyPoints { most: 35, .. }
    ));
    // The median pixel belongs to the edge of a response, 6 dB down.
    let all = Settings {
        choice: PointChoice::All,
        floor_db: -3.0,
        ..settings
    };
    let all = measure(&passes, &all).unwrap();
    assert!(
        all.points.len() > 4 * whole.points.len(),
        "{}",
        all.points.len()
    );
}

/// Position of the first point of a slope of 6 x 6.
fn slope_point() -> [f64; 2] {
    [-(3.0 * SPACING as f64 - 1.0) * STEP_M, NEAR_M + STEP_M]
}

/// Noise between the points, three times as many sites as points: its maxima that look steady over few passes are doubtful, and points stay certain.
#[test]
fn noise_maxima_are_doubtful_and_leave_points_certain() {
    fn creep(x: f64, y: f64, pass: usize) -> f64 {
        2e-4 * pass as f64 * (-0.5 * (x * x + (y - 180.0).powi(2)) / 400.0).exp()
    }
    let (mut noise, mut certain) = (0, 0);
    for passes in [3, 5] {
        let slope = Slope {
            side: 20,
            times_s: days(passes),
            motion: creep,
            snr_db: |n| if n % 4 == 0 { 30.0 } else { -60.0 },
            screen: weather,
        };
        let settings = Settings {
            floor_db: -40.0,
            stable: vec![rectangle((-1e3, -50.0), (0.0, 1e3))],
            ..Settings::default()
        };
        let mut series = slope.measured(3, &settings).unwrap();
        // 27 dB over the noise: no maximum of the noise.
        let (points, maxima): (Vec<_>, Vec<_>) = series
            .points
            .into_iter()
            .partition(|point| point.power > 500.0);
        assert_eq!(points.len(), 100);
        assert!(points.iter().all(|point| point.doubtful_from.is_none()));
        noise += maxima.len();
        certain += maxima.iter().filter(|m| m.doubtful_from.is_none()).count();
        series.points = points;
        let errors = slope.errors(&series);
        let rms_mm = 1e3 * rms(errors.iter().map(|e| e[0]));
        println!(
            "{passes} passes: {} maxima of noise, rms of points {rms_mm:.4} mm",
            maxima.len()
        );
        assert!(rms_mm < 0.1, "{rms_mm}");
    }
    // A random phase is within an eighth of a turn of a quiet neighbour with a probability of a quarter: in both steps of three passes 1 of 16.
    println!("{certain} of {noise} maxima are certain");
    assert!(noise > 50 && certain * 8 < noise, "{certain} {noise}");
}
