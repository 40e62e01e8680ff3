//! Azimuth ambiguities of the strip, and its Doppler centroid.

use glam::DVec3;
use subaperture::focus::beam::{BeamChoice, InBeam, choose, doppler_centroid};
use subaperture::focus::{ImageFormer, Task};
use subaperture::geometry::ImageGrid;
use subaperture::monitor::Silent;
use subaperture::phase_history::PhaseHistory;
use subaperture::signal::window::Window;

use subaperture_tests::orbit_strip::{self as strip, Missing, START_S};

use super::folder::{CSV, describe, former, history, patch, recorded};

#[test]
fn azimuth_ambiguities_are_below_35_db() {
    let ground = strip::ground();
    // A point in the middle of the beam in the first fifth of the pulses, so that pulses illuminate its ghost.
    let point = strip::point_in_beam_at(
        &ground,
        START_S + 0.17 * strip::PULSES as f64 / strip::PRF_HZ,
    );
    let ghost = strip::ghost_m(&ground, point, 1.0);
    let seen_s = strip::centre_s(ground.ecef(ghost)) - START_S;
    println!("point {point:.0}, ghost {ghost:.0} in the beam at {seen_s:.3} s of 0.833 s");
    // A power of 25 in 480 samples and a third of the pulses, against noise of 1.4 in 1200 samples, shows the beam by 7 dB in the spectrum.
    let echoes = strip::echoes(&ground, &[point], 5.0);
    let near_rad = Some(strip::SQUINT_DEG.to_radians());
    // 600 Hz are 0.127 deg of the beam of 0.12 deg.
    let band = |centroid_hz| BeamChoice::DopplerBand {
        width_hz: 0.5 * strip::PRF_HZ,
        centroid_hz,
    };
    for missing in [Missing::Absent, Missing::Zero] {
        let folder = recorded(&echoes, missing);
        let all = [
            (strip::antennas(), vec![BeamChoice::Stated, band(None)]),
            (
                String::new(),
                vec![
                    BeamChoice::None,
                    BeamChoice::Estimated { near_rad },
                    band(Some(strip::centroid_hz())),
                ],
            ),
        ];
        let count = match missing {
            Missing::Zero => 1,
            _ => all.len(),
        };
        let mut in_stated_beam = None;
        for (antenna, choices) in all.into_iter().take(count) {
            describe(folder.path(), CSV, &antenna);
            let history = history(folder.path());
            for choice in choices {
                let snr_db = snr_above_ghost(&*history, choice, [point, ghost]);
                // A rectangle over a Gaussian pattern to half its amplitude has 0.6 dB less than the matched filter. All pulses have the noise of 95 % of
                // 1000 pulses for the signal of 0.27 of them. The mean of noise over 625 pixels, a third of them independent, is known to 0.3 dB.
                let reference_db = *in_stated_beam.get_or_insert(snr_db);
                match choice {
                    BeamChoice::None => assert!(snr_db < reference_db + 0.5, "{snr_db} dB"),
                    _ => assert!(
                        (snr_db - reference_db).abs() < 1.0,
                        "{choice:?}: {snr_db} dB"
                    ),
                }
            }
        }
    }
}

/// Signal-to-noise ratio of a point, dB. Its ghost has to be 35 dB lower, except without a beam.
fn snr_above_ghost(
    history: &dyn PhaseHistory,
    choice: BeamChoice,
    [point, ghost]: [DVec3; 2],
) -> f64 {
    let clutter_free = point + DVec3::new(300.0, 300.0, 0.0);
    let [own, other, noise] = [
        patch(point, 3.0, 4.0),
        patch(ghost, 20.0, 6.0),
        patch(clutter_free, 12.0, 6.0),
    ]
    .map(|grid| powers(history, choice, &grid));
    let largest = |powers: &[f64]| powers.iter().copied().fold(0.0, f64::max);
    let decibels = |ratio: f64| 10.0 * ratio.log10();
    let level_db = decibels(largest(&other) / largest(&own));
    let mean = noise.iter().sum::<f64>() / noise.len() as f64;
    let snr_db = decibels(largest(&own) / mean);
    println!("{choice:?}: ghost {level_db:.1} dB, signal to noise {snr_db:.1} dB");
    // Within the beam, noise 60 dB below the point exceeds its mean power by 10 dB in some of 1681 pixels, and the pattern is below -60 dB in all
    // pulses that see the ghost. From all pulses the ghost has the smear of a range migration that differs by 1.3 km sin 1.6 deg = 36 m.
    match choice {
        BeamChoice::None => assert!(level_db > -35.0, "{level_db} dB without a beam"),
        _ => assert!(level_db < -35.0, "{choice:?}: {level_db} dB"),
    }
    snr_db
}

/// Power of the pixels of an image by backprojection.
fn powers(history: &dyn PhaseHistory, choice: BeamChoice, grid: &ImageGrid) -> Vec<f64> {
    let chosen = choose(choice, history, grid, &Silent).unwrap();
    let former: Box<dyn ImageFormer> = match chosen.beam {
        Some(beam) => {
            let degrees = [beam.width_rad, beam.squint_rad].map(f64::to_degrees);
            println!("{degrees:.4?} deg, {:?}", beam.source);
            // The pattern itself, and the estimate with its noise and the ends of the pulses.
            assert!(
                (degrees[0] / strip::BEAM_DEG - 1.0).abs() < 0.25,
                "{degrees:?}"
            );
            assert!(
                (degrees[1] - strip::SQUINT_DEG).abs() < 0.1 * strip::BEAM_DEG,
                "{degrees:?}"
            );
            Box::new(InBeam::new(former("bp"), beam).unwrap())
        }
        None => former("bp"),
    };
    let weights = former.weights(history.collection(), grid, Window::None, Window::None);
    let weights = weights.unwrap();
    let task = Task {
        memory_bytes: u64::MAX,
        ..Task::new(history, grid, &weights)
    };
    let image = former.form(&task).unwrap().image;
    let powers = image.pixels.iter().map(|z| f64::from(z.norm_sqr()));
    powers.collect()
}

#[test]
fn doppler_centroid_shows_a_wrong_beam() {
    // The squint of the antennas, and one that is wrong by 0.04 deg, a sixth of the PRF.
    let right = strip::antennas();
    let [old, new] =
        [0.0, 0.04].map(|more| format!("\"{}, ", (strip::SQUINT_DEG + more).to_radians().sin()));
    assert!(right.contains(&old));
    let wrong = right.replace(&old, &new);
    let ground = strip::ground();
    let forward = strip::forward(&ground);
    // Points along the whole strip, each seen by part of the pulses.
    let points: Vec<DVec3> = (-4..=4).map(|n| forward * (600.0 * f64::from(n))).collect();
    let echoes = strip::echoes(&ground, &points, 2.0);
    let true_hz = strip::centroid_hz();
    for missing in [Missing::Complete, Missing::Absent, Missing::Zero] {
        for (antenna, differs) in [(&right, false), (&wrong, true)] {
            let folder = recorded(&echoes, missing);
            describe(folder.path(), CSV, antenna);
            let history = history(folder.path());
            let found = doppler_centroid(&*history, DVec3::ZERO, &Silent).unwrap();
            println!("{found:?}, true {true_hz:.1} Hz");
            assert!((found.prf_hz / strip::PRF_HZ - 1.0).abs() < 1e-6);
            // The origin is in the middle of the beam of the middle pulse. Half of the flight of the echo later, 2.8 ms, its Doppler frequency is 6 Hz lower, and it
            // changes by 2 Hz from pulse to pulse, and some more pulses may be missing in one half than in the other.
            assert!((found.point_hz - true_hz).abs() < 30.0);
            let turns = (found.fraction_hz - true_hz) / strip::PRF_HZ;
            let off = turns - turns.round();
            assert!(off.abs() < 0.05, "{off} of the PRF");
            assert_eq!(found.disagreement_hz().is_some(), differs);
            // A band of 0.4 % does not resolve 6 PRFs.
            assert!(found.ambiguity.is_none_or(|number| number == -6));
        }
    }
}
