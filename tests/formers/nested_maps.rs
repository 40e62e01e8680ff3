//! Nested patches with range-Doppler maps (`rdbp`) against the defining sum, on tracks along either axis of the grid, oblique, curved,
//! bistatic and bent, and on a tilted plane.

use glam::DVec3;
use subaperture::focus::rdbp::RangeDopplerBackprojection;
use subaperture::focus::{Formed, ImageFormer, Task};
use subaperture::geometry::ImageGrid;
use subaperture::phase_history::{PhaseHistory, Weights};
use subaperture::signal::window::Window;
use subaperture::simulate::PointTargetHistory;
use subaperture_tests::plain_history::{complex, plain_sum};

use crate::track_scene::{noise, scene};

const BAND: (f64, f64, usize) = (9.8e9, 3e6, 200);
const PULSES: usize = 360;
/// Pixels compared with the defining sum.
const COMPARED: usize = 250;

fn weights(history: &PointTargetHistory) -> Weights {
    Weights::new(history.collection(), Window::Hamming, Window::Hamming)
}

fn form(history: &PointTargetHistory, grid: &ImageGrid, error_db: f64) -> Formed {
    let former = RangeDopplerBackprojection::default().error_db(error_db);
    former
        .form(&Task::new(history, grid, &weights(history)))
        .unwrap()
}

/// A track of 40 m in `direction` (degrees from x), seen from 1.5 km at `squint_deg` from broadside.
fn straight(direction_deg: f64, squint_deg: f64) -> impl Fn(f64) -> (DVec3, DVec3) {
    move |n| {
        let (sin, cos) = direction_deg.to_radians().sin_cos();
        let along = DVec3::new(cos, sin, 0.0);
        let across = DVec3::new(-sin, cos, 0.0);
        let squint = squint_deg.to_radians();
        let middle = along * (1200.0 * squint.sin()) - across * (1200.0 * squint.cos());
        let at = middle + DVec3::Z * 900.0 + along * (n * 40.0 / PULSES as f64);
        (at, at)
    }
}

#[test]
fn maps_keep_bound_on_any_smooth_track() {
    let bent = |n: f64| {
        let u = n / PULSES as f64;
        let bend = DVec3::new(
            0.1 * (9.0 * u).sin(),
            0.05 * (20.0 * u).sin(),
            0.2 * (13.0 * u).cos(),
        );
        let at = straight(0.0, 0.0)(n).0 + bend;
        (at, at)
    };
    let jitter = |n: f64| {
        let at =
            straight(0.0, 0.0)(n).0 + 2e-4 * DVec3::new(noise(n), noise(n + 0.5), noise(n + 0.2));
        (at, at)
    };
    let bistatic = |n: f64| {
        let at = straight(0.0, 0.0)(n).0;
        (at, DVec3::new(900.0, -700.0, 1500.0) - 0.03 * n * DVec3::X)
    };
    let circle = |n: f64| {
        let (sin, cos) = (0.15 * n / PULSES as f64).sin_cos();
        let at = DVec3::new(1400.0 * sin, -1400.0 * cos, 600.0);
        (at, at)
    };
    let plane = "x=-16:16:0.2,y=-16:16:0.2";
    let cases: [(&str, PointTargetHistory, &str); 9] = [
        (
            "along x",
            scene(PULSES, BAND, straight(0.0, 0.0), 14.0),
            plane,
        ),
        (
            "along y",
            scene(PULSES, BAND, straight(90.0, 0.0), 14.0),
            plane,
        ),
        (
            "oblique",
            scene(PULSES, BAND, straight(40.0, 0.0), 14.0),
            plane,
        ),
        (
            "squinted",
            scene(PULSES, BAND, straight(0.0, 35.0), 14.0),
            plane,
        ),
        ("bent", scene(PULSES, BAND, bent, 14.0), plane),
        ("jitter", scene(PULSES, BAND, jitter, 14.0), plane),
        ("bistatic", scene(PULSES, BAND, bistatic, 14.0), plane),
        ("circle", scene(PULSES, BAND, circle, 14.0), plane),
        (
            "tilted plane off centre",
            scene(PULSES, BAND, straight(10.0, 0.0), 30.0),
            "x=5:45:0.25,y=-30:2:0.25,pitch=5,roll=-8",
        ),
    ];
    for (name, history, grid) in cases {
        let grid: ImageGrid = grid.parse().unwrap();
        let count = grid.rows.count * grid.columns.count;
        let compared: Vec<usize> = (0..COMPARED).map(|i| i * 7919 % count).collect();
        let columns = grid.columns.count;
        let places = compared
            .iter()
            .map(|i| grid.position_m(i / columns, i % columns));
        let places: Vec<[f64; 3]> = places.map(|place| place.to_array()).collect();
        let expected = complex(&plain_sum(&history, &weights(&history)).at(&places));
        for error_db in [-40.0, -60.0, -75.0] {
            let formed = form(&history, &grid, error_db);
            assert!(formed.settings.contains_key("map_rows"), "{name}");
            let pixels = &formed.image.pixels;
            let errors = compared.iter().zip(&expected).map(|(&i, e)| {
                let (re, im) = (
                    f64::from(pixels[i].re) - e.re,
                    f64::from(pixels[i].im) - e.im,
                );
                re * re + im * im
            });
            let power: f64 = pixels.iter().map(|z| f64::from(z.norm_sqr())).sum();
            let mean = errors.sum::<f64>() / COMPARED as f64 / (power / count as f64);
            let measured_db = 10.0 * mean.log10();
            println!(
                "{name}, {error_db} dB: {measured_db:.1} dB, predicted {:.1} dB, maps of {}",
                formed.predicted_error_db, formed.settings["map_rows"]
            );
            assert!(measured_db <= error_db, "{name}");
        }
    }
}

/// The image is the same for any number of threads, each with buffers of its own.
#[test]
fn maps_do_not_depend_on_the_number_of_threads() {
    let history = scene(PULSES, BAND, straight(20.0, 5.0), 14.0);
    let grid: ImageGrid = "x=-20:20:0.2,y=-16:16:0.2".parse().unwrap();
    let image = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let formed = pool
            .build()
            .unwrap()
            .install(|| form(&history, &grid, -50.0));
        assert!(formed.settings.contains_key("map_rows"));
        formed.image.pixels
    };
    let one = image(1);
    assert!(one == image(3));
}
