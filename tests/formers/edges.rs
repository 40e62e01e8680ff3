//! Formers on degenerate input: empty recordings and grids, one pulse, one sample or one pixel, no motion, non-finite positions, grids
//! beyond any memory. None panics; an image that is formed equals the exact sum; a refusal states its reason.

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use subaperture::Focusing;
use subaperture::SPEED_OF_LIGHT_M_S;
use subaperture::focus::bp::Backprojection;
use subaperture::focus::exact::Exact;
use subaperture::focus::ffbp::FastFactorised;
use subaperture::focus::omega_k::OmegaK;
use subaperture::focus::pfa::PolarFormat;
use subaperture::focus::rda::RangeDopplerAlgorithm;
use subaperture::focus::rdbp::{Mode, RangeDopplerBackprojection};
use subaperture::focus::{FormError, Formed, ImageFormer, Remedy, Task};
use subaperture::geometry::{Axis, ImageGrid, SceneFrame};
use subaperture::phase_history::{Collection, PhaseHistory, Pulse, Sweep, Weights};
use subaperture::signal::window::Window;
use subaperture::simulate::{PointTargetHistory, Preset, Scatterer, Variation};
use subaperture_tests::error_db;

const ERROR_DB: f64 = -50.0;

fn formers() -> Vec<Box<dyn ImageFormer>> {
    let error_db = ERROR_DB;
    vec![
        Box::new(Exact),
        Box::new(Backprojection { error_db }),
        Box::new(RangeDopplerBackprojection {
            mode: Mode::Precise,
            error_db,
            sub_cpi: None,
            patch_m: None,
        }),
        Box::new(FastFactorised { error_db }),
        Box::new(PolarFormat {
            error_db,
            centre_m: None,
        }),
        Box::new(RangeDopplerAlgorithm {
            error_db,
            secondary_compression: true,
        }),
        Box::new(OmegaK { error_db }),
    ]
}

/// A radar at 1 GHz, 300 m from a scatterer near the origin.
fn history(
    num_pulses: usize,
    num_samples: usize,
    place: impl Fn(f64) -> DVec3,
) -> PointTargetHistory {
    let pulses = (0..num_pulses)
        .map(|n| {
            let at = place(n as f64 - (num_pulses as f64 - 1.0) / 2.0);
            Pulse {
                time_s: n as f64,
                transmitter_m: at,
                receiver_m: at,
                reference_m: DVec3::ZERO,
                reference_path_m: 600.0,
                start_hz: 1e9,
                step_hz: 1e6,
                sweep: Sweep::AT_ONCE,
                // The sum is defined at all places.
                recorded_path_m: Some([0.0, 1e12]),
            }
        })
        .collect();
    let collection = Collection {
        name: "edge".to_owned(),
        num_samples,
        pulses,
        frame: SceneFrame::Local,
        extent: None,
        timed: true,
    };
    let scatterer = Scatterer {
        position_m: DVec3::new(0.3, -0.2, 0.0),
        amplitude: Complex64::ONE,
    };
    PointTargetHistory::new(collection, vec![scatterer], None)
}

/// Antenna position of pulse `n`: along x, 1 m from pulse to pulse.
fn line(n: f64) -> DVec3 {
    DVec3::new(n, -300.0, 0.0)
}

fn form(
    former: &dyn ImageFormer,
    history: &PointTargetHistory,
    grid: &ImageGrid,
) -> Result<Formed, FormError> {
    let weights = Weights::new(history.collection(), Window::None, Window::None);
    former.form_best(&Task {
        memory_bytes: 64 << 20,
        ..Task::new(history, grid, &weights)
    })
}

fn grid(text: &str) -> ImageGrid {
    text.parse().unwrap()
}

#[test]
fn empty_recordings_and_grids_are_refused() {
    let some = grid("x=-2:2:0.5,y=-2:2:0.5");
    let none = Axis {
        start: 0.0,
        step: 1.0,
        count: 0,
    };
    let no_rows = ImageGrid {
        rows: none,
        ..some.clone()
    };
    let no_columns = ImageGrid {
        columns: none,
        ..some.clone()
    };
    for former in formers() {
        for (history, grid, reason) in [
            (history(0, 8, line), &some, "no pulses"),
            (history(5, 0, line), &some, "no samples"),
            (history(5, 8, line), &no_rows, "no pixels"),
            (history(5, 8, line), &no_columns, "no pixels"),
        ] {
            let error = form(&*former, &history, grid).unwrap_err();
            let text = error.to_string();
            assert!(matches!(error, FormError::Unsuited(_)), "{text}");
            assert!(text.contains(reason), "{}: {text}", former.name());
        }
    }
}

/// One pulse, one sample, one pixel, or no motion: the image equals the exact sum, or the refusal names another former.
#[test]
fn single_pulse_sample_or_pixel_is_formed_or_refused() {
    let some = "x=-2:2:0.5,y=-2:2:0.5";
    let still = |_| DVec3::new(0.0, -300.0, 0.0);
    for (case, history, text) in [
        ("one pulse", history(1, 32, line), some),
        ("one sample", history(40, 1, line), some),
        ("one of both", history(1, 1, line), some),
        ("no motion", history(40, 32, still), some),
        ("one pixel", history(40, 32, line), "x=0:1:1,y=0:1:1"),
        ("one row", history(40, 32, line), "x=-9:9:0.5,y=0:1:1"),
        (
            "polar",
            history(40, 32, line),
            "r=298:302:0.5,theta=89:91:0.1,cy=-300",
        ),
        (
            "an antenna amid the pixels",
            history(1, 32, |_| DVec3::new(1.35, 1.17, 0.1)),
            "x=-4:4:0.65,y=-38:38:0.39",
        ),
    ] {
        let grid = grid(text);
        let exact = form(&Exact, &history, &grid).unwrap().image;
        for former in formers() {
            match form(&*former, &history, &grid) {
                Ok(formed) => {
                    let error_db = error_db(&formed.image, &exact);
                    // The range-Doppler algorithm has no bound, but predicts its error.
                    let bound_db = formed.predicted_error_db.max(ERROR_DB);
                    println!("{case}: {} {error_db:.1} dB", former.name());
                    assert!(error_db < bound_db, "{case}: {}", former.name());
                }
                Err(error) => {
                    println!("{case}: {}: {error}", former.name());
                    let may_refuse: &[&str] = match case {
                        "an antenna amid the pixels" => &["rda", "omega-k", "pfa"],
                        _ => &["rda", "omega-k"],
                    };
                    assert!(
                        may_refuse.contains(&former.name()),
                        "{case}: {}: {error}",
                        former.name()
                    );
                    let named = |remedy: &Remedy| matches!(remedy, Remedy::OtherFormer(names) if names.contains(&"bp"));
                    assert!(error.remedies().iter().any(named), "{error:?}");
                }
            }
        }
    }
}

#[test]
fn extreme_positions_and_grids_do_not_panic() {
    let lost = |n: f64| match n {
        0.5 => DVec3::new(f64::NAN, 0.0, 0.0),
        _ => line(n),
    };
    let some = grid("x=-2:2:0.5,y=-2:2:0.5");
    let wide = grid("x=-9e8:9e8:1e8,y=-9e8:9e8:1e8");
    let fine = grid("x=0:1:1e-6,y=0:1:1e-6");
    for former in formers() {
        // No image can be right here; any result except a panic is accepted.
        let result = form(&*former, &history(40, 32, lost), &some);
        println!("lost: {} {:?}", former.name(), result.err());
        let result = form(&*former, &history(40, 32, line), &wide);
        println!("wide: {} {:?}", former.name(), result.err());
        let error = form(&*former, &history(40, 32, line), &fine).unwrap_err();
        assert!(
            matches!(error, FormError::Memory { .. } | FormError::Unsuited(_)),
            "{}: {error}",
            former.name()
        );
    }
    // All formers except the exact sum and backprojection must refuse so wide a grid, or form it.
    let error = form(
        &PolarFormat {
            error_db: ERROR_DB,
            centre_m: None,
        },
        &history(40, 32, line),
        &wide,
    )
    .unwrap_err();
    assert!(error.remedies().contains(&Remedy::SmallerGrid), "{error:?}");
}

#[test]
fn pixels_outside_the_recorded_delays_are_zero_in_every_former() {
    // Profiles of 192 m about the scene's middle, on a track in the direction of x at y = -5 km.
    let history = Preset::Table41.simulate(&Variation::default());
    let outside = grid("x=-2:2:1,y=200:204:1");
    let partly = grid("x=-16:16:1,y=80:112:1");
    let half_m = 0.5 * SPEED_OF_LIGHT_M_S / history.collection().pulses[0].step_hz;
    let covered = |place_m: DVec3| {
        let pulses = &history.collection().pulses;
        pulses.iter().all(|pulse| {
            let path_m = place_m.distance(pulse.transmitter_m) + place_m.distance(pulse.receiver_m);
            (path_m - pulse.reference_path_m).abs() <= half_m
        })
    };
    for former in formers() {
        let error = Focusing::new(&history, &outside).by(&*former).unwrap_err();
        let named = "no pixel lies within the recorded delays";
        assert!(
            error.to_string().contains(named),
            "{}: {error}",
            former.name()
        );
        let image = Focusing::new(&history, &partly).allow_error().by(&*former);
        let image = match image {
            Err(FormError::Unsuited(_)) => continue,
            image => image.unwrap(),
        };
        let mut count = 0;
        for (i, pixel) in image.image.pixels.iter().enumerate() {
            let is_covered = covered(partly.position_m(i / 32, i % 32));
            assert_eq!(
                *pixel != Complex32::ZERO,
                is_covered,
                "{} {i}",
                former.name()
            );
            count += usize::from(!is_covered);
        }
        let named = format!("{count} of 1024 pixels lie outside the recorded delays");
        let warnings = &image.warnings;
        assert!(
            warnings.iter().any(|warning| warning.contains(&named)),
            "{warnings:?}"
        );
        assert!((500..540).contains(&count), "{count}");
    }
}
