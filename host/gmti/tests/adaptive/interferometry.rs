//! Along-track interferometry against simulated counts.

use num_complex::Complex64;
use subaperture_gmti::ati::{Interferogram, radial_velocity_m_s};

use crate::noise::{gaussian, random};

/// Two channels of clutter with this coherence, of powers 4 and 9.
fn clutter(coherence: Complex64, random: &mut rand_chacha::ChaCha8Rng) -> [Complex64; 2] {
    let first = gaussian(random);
    let rest = (1.0 - coherence.norm_sqr()).sqrt();
    [
        2.0 * first,
        3.0 * (coherence * first + gaussian(random) * rest),
    ]
}

#[test]
fn false_alarms_of_the_interferogram_have_their_probability() {
    const CELLS: usize = 400_000;
    for (block, magnitude) in [0.0, 0.7, 0.99, 0.99999].into_iter().enumerate() {
        let coherence = Complex64::from_polar(magnitude, 0.8);
        let mut random = random(31, block as u64);
        let mut cell = || clutter(coherence, &mut random);
        let interferogram = Interferogram::estimate((0..CELLS).map(|_| cell())).unwrap();
        let statistics: Vec<f64> = (0..CELLS)
            .map(|_| interferogram.statistic(cell()))
            .collect();
        for threshold in [0.3, 2.0, 5.0, 8.0] {
            let expected = interferogram.false_alarm_probability(threshold);
            let count = statistics.iter().filter(|&&t| t > threshold).count() as f64;
            let deviation = (CELLS as f64 * expected).sqrt();
            println!(
                "{magnitude} {threshold}: {count} of {:.1}",
                CELLS as f64 * expected
            );
            // Four standard deviations of the count, and 1 % for that of the estimated coherence at the largest threshold.
            let bound = 4.0 * deviation + 0.01 * CELLS as f64 * expected;
            assert!((count - CELLS as f64 * expected).abs() < bound, "{count}");
        }
        assert!((interferogram.false_alarm_probability(0.0) - 1.0).abs() < 2e-5);
    }
}

#[test]
fn phase_of_a_target_gives_its_velocity() {
    let (lag_s, wavelength_m) = (1.6e-3, 0.03);
    let mut random = random(32, 0);
    let cells = (0..10_000).map(|_| clutter(Complex64::new(0.9, 0.1), &mut random));
    let interferogram = Interferogram::estimate(cells).unwrap();
    let mean_phase = Complex64::new(0.9, 0.1).arg();
    for velocity in [-4.0, 0.5, 3.0] {
        let phase = 4.0 * std::f64::consts::PI * velocity * lag_s / wavelength_m + mean_phase;
        let target = [
            Complex64::new(50.0, 20.0),
            Complex64::new(50.0, 20.0) * Complex64::cis(phase),
        ];
        let measured = radial_velocity_m_s(interferogram.phase_rad(target), lag_s, wavelength_m);
        let (found, ambiguity) = measured;
        // The mean phase of 10,000 cells has a standard deviation of 0.005 radians, 7 mm/s.
        assert!((found - velocity).abs() < 0.03, "{found} {velocity}");
        assert!((ambiguity - 9.375).abs() < 1e-9, "{ambiguity}");
    }
}
