//! Arbitrary sightings give a finite estimate or an error, without panics.

use super::*;
use subaperture_motion::diagnosis::examine;
use subaperture_motion::movers::{classify, track_among_movers};
use subaperture_motion::{Heading, Pairwise, Robust};

/// A number of plausible size in 22 of 23 cases, else an extreme or non-finite one.
fn number(random: &mut ChaCha8Rng) -> f64 {
    const ANY: [f64; 10] = [
        0.0,
        -1.0,
        1e-300,
        1e300,
        -1e18,
        1e-9,
        f64::NAN,
        f64::INFINITY,
        2e-3,
        5e-324,
    ];
    let word = random.next_u32() as usize;
    match word % 23 {
        0 => ANY[word / 23 % ANY.len()],
        _ => gaussian(random).abs() * [1.0, 10.0, 1e-3][word / 23 % 3],
    }
}

#[test]
fn arbitrary_sightings_cause_no_panic_and_no_infinity() {
    let mut random = ChaCha8Rng::seed_from_u64(11);
    let mut estimates = 0;
    for case in 0..300 {
        let mut place = |scale: f64| DVec2::new(number(&mut random), number(&mut random)) * scale;
        let array = match case % 3 {
            0 => array(2 + case % 5),
            _ => Array {
                transmitters_m: (0..1 + case % 2).map(|_| place(0.01)).collect(),
                receivers_m: (0..1 + case % 4).map(|_| place(1e-3)).collect(),
                wavelength_m: WAVELENGTH_M,
            },
        };
        let mut sighting = |target: usize| Sighting {
            target,
            range_m: number(&mut random),
            range_sigma_m: number(&mut random),
            phases_rad: (0..array.num_channels())
                .map(|_| number(&mut random))
                .collect(),
            phase_sigma_rad: number(&mut random),
        };
        let pulses: Vec<Vec<Sighting>> = (0..12)
            .map(|n| (0..(case + n) % 6).map(&mut sighting).collect())
            .collect();
        let times_s: Vec<f64> = (0..12).map(f64::from).collect();
        estimates += usize::from(examine(&array, &pulses).is_ok());
        estimates += usize::from(classify(&array, &pulses, 8).is_ok());
        estimates += usize::from(track_among_movers(&array, &pulses, &times_s, 8, 4).is_ok());
        estimates += usize::from(track(&array, &pulses, 3).is_ok());
        if let Ok(mut a) = Pairwise::new(array.clone(), Heading::Estimated) {
            estimates += pulses.iter().filter(|pulse| a.push(pulse).is_ok()).count();
        }
        for heading in [Heading::Estimated, Heading::Known] {
            let Ok(mut b) = Robust::new(array.clone(), heading, 5) else {
                continue;
            };
            for pulse in &pulses {
                if let Ok(Some(found)) = b.push(pulse) {
                    estimates += 1;
                    assert!(found.increment.moved_m.is_finite() && found.covariance.is_finite());
                }
            }
        }
    }
    println!("{estimates} estimates");
    assert!(estimates > 100, "{estimates}");
}
