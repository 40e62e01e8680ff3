//! A small far scene, in which phase errors are common to all points.

use glam::DVec3;
use subaperture_autofocus::{
    Corrected, Correction, Estimator, MapDrift, Measure, Method, PhaseGradient, SharpenError,
    Stopping, Subject, sharpen,
};
use subaperture_focus::FormError;
use subaperture_focus::bp::Backprojection;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::Image;
use subaperture_model::monitor::Silent;
use subaperture_model::phase_history::{PhaseHistory, PulseRange};
use subaperture_signal::window::Window;

use super::{Radar, Random, corrected, form, peak_db, sharpened};

/// 10 GHz, 300 MHz, 512 pulses over 300 m at 10 km: cells of 0.5 m in range and cross-range.
fn radar() -> Radar {
    let track: Vec<DVec3> = (0..512)
        .map(|n| DVec3::new(-150.0 + 300.0 * f64::from(n) / 511.0, -9_000.0, 4_000.0))
        .collect();
    Radar {
        start_hz: 9.85e9,
        step_hz: 300e6 / 256.0,
        samples: 256,
        recorded_m: track.clone(),
        phases_rad: vec![0.0; track.len()],
        true_m: track,
        noise: 1.0,
    }
}

fn scene(random: &mut Random) -> Vec<(DVec3, f64)> {
    (0..40)
        .map(|_| {
            let place_m = DVec3::new(
                60.0 * random.uniform() - 30.0,
                60.0 * random.uniform() - 30.0,
                0.0,
            );
            (place_m, 0.2 + random.uniform())
        })
        .collect()
}

fn level_db(image: &Image) -> f64 {
    10.0 * f64::from(image.peak().unwrap().value.norm_sqr()).log10()
}

const GRID: &str = "x=-35:35:0.25,y=-35:35:0.25,z=0";

#[test]
fn white_errors_of_two_radians_are_removed() {
    let mut random = Random(7);
    let points = scene(&mut random);
    let grid: ImageGrid = GRID.parse().unwrap();
    let perfect = radar().echoes(&points, &mut Random(1));
    let mut disturbed = radar();
    disturbed
        .phases_rad
        .iter_mut()
        .for_each(|phase| *phase = 2.0 * random.gauss());
    let history = disturbed.echoes(&points, &mut Random(1));
    // Peak of the brightest point, searched nearby as a slope of the phases shifts the image.
    let brightest = points.iter().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap().0;
    let at = |history: &dyn PhaseHistory| peak_db(history, brightest, 1.5, [0.05, 0.05]);
    let best_db = at(&perfect);
    for estimator in [Estimator::Eigenvector, Estimator::Gradient] {
        let method = PhaseGradient {
            estimator,
            ..PhaseGradient::default()
        };
        let found = sharpened(&history, &grid, &method, 3);
        let [before_db, after_db] = [at(&history), at(&corrected(&history, &found))];
        println!(
            "{estimator}: perfect {best_db:.3} dB, before {before_db:.3}, after {after_db:.3}"
        );
        // Errors of 2 rad rms leave exp(-2^2) of the power, -17 dB, and scattered power of -27 dB.
        assert!(before_db < best_db - 8.0);
        assert!(
            after_db > best_db - 0.1,
            "{estimator}: {after_db} {best_db}"
        );
    }
}

#[test]
fn map_drift_recovers_quadratic_phase() {
    let points = scene(&mut Random(7));
    let grid: ImageGrid = GRID.parse().unwrap();
    let mut disturbed = radar();
    let count = disturbed.phases_rad.len() as f64;
    for (n, phase) in disturbed.phases_rad.iter_mut().enumerate() {
        let u = 2.0 * (n as f64 + 0.5) / count - 1.0;
        *phase = 15.0 * u * u;
    }
    let history = disturbed.echoes(&points, &mut Random(1));
    let found = sharpened(&history, &grid, &MapDrift::default(), 6);
    let Some(Correction::Phase { error_rad }) = &found.correction else {
        panic!("no phase correction");
    };
    // Quadratic term of the phases, orthogonal to constant and slope.
    let (mut sum, mut norm) = (0.0, 0.0);
    for (n, phase) in error_rad.iter().enumerate() {
        let u = 2.0 * (n as f64 + 0.5) / count - 1.0;
        let basis = u * u - 1.0 / 3.0;
        sum += basis * phase;
        norm += basis * basis;
    }
    let term = sum / norm;
    let perfect = form(&radar().echoes(&points, &mut Random(1)), &grid);
    println!(
        "quadratic term {term:.3} rad of 15; peak {:.3} dB of {:.3}",
        level_db(&found.image_after),
        level_db(&perfect)
    );
    // The resolution of a look is 1 m, and a shift of a hundredth of that is a term of 0.03 rad. 0.5 rad at the ends of the aperture lowers
    // a point by 0.1 dB (a variance of 0.5^2 x 4 / 45).
    assert!((term - 15.0).abs() < 0.5, "{term}");
    // Points lie between pixels of 0.25 m, at a resolution of 0.5 m.
    assert!(level_db(&found.image_after) > level_db(&perfect) - 0.5);
}

#[test]
fn focused_image_is_not_changed() {
    let points = scene(&mut Random(7));
    let grid: ImageGrid = GRID.parse().unwrap();
    let history = radar().echoes(&points, &mut Random(1));
    for method in [
        &PhaseGradient::default() as &dyn Method,
        &MapDrift::default(),
    ] {
        let found = sharpened(&history, &grid, method, 3);
        let gained = found.before.entropy - found.after.entropy;
        // The image is never worse; phases fitted to noise gain less than 0.01 nats.
        assert!((0.0..0.01).contains(&gained), "{}: {gained}", method.name());
    }
    // Short recordings, insufficient memory and invalid corrections are refused.
    let short = PulseRange::new(&history, 0..5);
    let subject = Subject {
        history: &short,
        grid: &grid,
        former: &Backprojection { error_db: -50.0 },
        windows: [Window::default(); 2],
        measure: Measure::Entropy,
        memory_bytes: 1 << 30,
        monitor: &Silent,
    };
    let error = sharpen(&subject, &PhaseGradient::default(), Stopping::default()).unwrap_err();
    assert_eq!(
        error.to_string(),
        "pga needs at least 8 pulses, the recording has 5"
    );
    let tight = Subject {
        history: &history,
        memory_bytes: 2 << 20,
        ..subject
    };
    let error = sharpen(&tight, &PhaseGradient::default(), Stopping::default()).unwrap_err();
    assert!(
        matches!(error, SharpenError::Form(FormError::Memory { .. })),
        "{error}"
    );
    let nan = Correction::Phase {
        error_rad: vec![f64::NAN; 512],
    };
    let error = Corrected::new(&history, &nan).err().unwrap();
    assert_eq!(
        error.to_string(),
        "the correction of pulse 0 (from 0) is not a finite number"
    );
}
