//! Diagnosis of simulated faults of channels, receivers and scenes.

use super::scene::{seen, still};
use super::*;
use subaperture_motion::diagnosis::{Finding, examine};

fn pulses(array: &Array, snr_db: f64) -> Vec<Vec<Sighting>> {
    let noise = Noise::of_snr(snr_db);
    seen(
        array,
        &poses(1000)[..100],
        |_| 0.0,
        &still(&PLACES_M),
        &noise,
        7,
    )
}

/// Pulses with the phases of each sighting changed by `change`, which gets the pulse's number.
fn with(
    pulses: &[Vec<Sighting>],
    mut change: impl FnMut(usize, &mut Vec<f64>),
) -> Vec<Vec<Sighting>> {
    let mut all = pulses.to_vec();
    for (n, pulse) in all.iter_mut().enumerate() {
        pulse
            .iter_mut()
            .for_each(|sighting| change(n, &mut sighting.phases_rad));
    }
    all
}

#[test]
fn faultless_sightings_have_no_findings() {
    for receivers in [2, 3, 4, 8] {
        for snr_db in [15.0, 30.0, 40.0] {
            let array = array(receivers);
            assert_eq!(
                examine(&array, &pulses(&array, snr_db)),
                Ok(vec![]),
                "{receivers} {snr_db}"
            );
        }
    }
    // A radar that stands still has no dead channel.
    let array = array(3);
    let noise = Noise::of_snr(20.0);
    let here = vec![Pose::default(); 100];
    let pulses = seen(&array, &here, |_| 0.0, &still(&PLACES_M), &noise, 7);
    assert_eq!(examine(&array, &pulses), Ok(vec![]));
}

#[test]
fn dead_channels_are_reported() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    for (receivers, dead) in [
        (2, vec![1]),
        (4, vec![2]),
        (4, vec![0, 3]),
        (4, vec![0, 1, 2, 3]),
    ] {
        for snr_db in [15.0, 30.0] {
            let array = array(receivers);
            let pulses = with(&pulses(&array, snr_db), |_, phases| {
                for &channel in &dead {
                    phases[channel] = TAU * (random.next_u32() as f64 / 4_294_967_296.0 - 0.5);
                }
            });
            let expected: Vec<Finding> = match dead.len() < receivers {
                true => dead
                    .iter()
                    .map(|&channel| Finding::Dead { channel })
                    .collect(),
                false => vec![Finding::AllDead],
            };
            assert_eq!(examine(&array, &pulses), Ok(expected), "{dead:?} {snr_db}");
        }
    }
}

#[test]
fn constant_channels_are_reported() {
    let mut random = ChaCha8Rng::seed_from_u64(2);
    for (receivers, still) in [(2, 0), (4, 3)] {
        let array = array(receivers);
        let pulses = with(&pulses(&array, 25.0), |_, phases| {
            phases[still] = 0.7 + 0.02 * gaussian(&mut random);
        });
        let found = examine(&array, &pulses).unwrap();
        assert!(
            matches!(found[..], [Finding::Still { channel, others_rad, .. }] if channel == still && others_rad > 0.3),
            "{found:?}"
        );
    }
}

#[test]
fn swapped_receivers_are_reported() {
    for (receivers, [i, j]) in [(3, [0, 1]), (4, [1, 2]), (4, [0, 3]), (8, [2, 7])] {
        for snr_db in [15.0, 30.0] {
            let array = array(receivers);
            let pulses = with(&pulses(&array, snr_db), |_, phases| phases.swap(i, j));
            let found = examine(&array, &pulses).unwrap();
            assert!(
                matches!(found[..], [Finding::Swapped { receivers, .. }] if receivers == [i, j]),
                "{receivers} {snr_db} {found:?}"
            );
        }
    }
    // The same receivers swapped for both of two transmitters.
    let mut array = array(4);
    array
        .transmitters_m
        .push(DVec2::new(-0.02 - 2.0 * WAVELENGTH_M, 0.0));
    let pulses = with(&pulses(&array, 25.0), |_, phases| {
        phases.swap(1, 3);
        phases.swap(5, 7);
    });
    let found = examine(&array, &pulses).unwrap();
    assert!(
        matches!(
            found[..],
            [Finding::Swapped {
                receivers: [1, 3],
                ..
            }]
        ),
        "{found:?}"
    );
}

#[test]
fn receiver_phase_offset_is_reported() {
    for off in 0..5 {
        let array = array(5);
        let pulses = with(&pulses(&array, 25.0), |_, phases| phases[off] += 0.9);
        let found = examine(&array, &pulses).unwrap();
        assert!(
            matches!(found[..], [Finding::Off { receiver, .. }] if receiver == off),
            "{off}: {found:?}"
        );
    }
    // A different offset at each receiver: no single one explains the errors.
    let array = array(5);
    let pulses = with(&pulses(&array, 25.0), |_, phases| {
        let other = [0.0, 0.9, -0.8, 0.6, -1.1];
        phases
            .iter_mut()
            .zip(other)
            .for_each(|(phase, other)| *phase += other);
    });
    let found = examine(&array, &pulses).unwrap();
    assert!(matches!(found[..], [Finding::Disagree { .. }]), "{found:?}");
}

#[test]
fn excessive_motion_per_pulse_is_reported() {
    // 1.6 mm per pulse towards the targets at a wavelength of 3.9 mm: half a wavelength more than the wrapped phase shows.
    let array = array(2);
    for (by_m, turns) in [(1.6e-3, 1), (-1.6e-3, -1), (3.9e-3, 2)] {
        let pose = |n: usize| Pose {
            at_m: DVec2::new(0.0, by_m * n as f64),
            heading_rad: 0.0,
        };
        let poses: Vec<Pose> = (0..100).map(pose).collect();
        let pulses = seen(
            &array,
            &poses,
            |_| 0.0,
            &still(&PLACES_M),
            &Noise::of_snr(20.0),
            3,
        );
        let found = examine(&array, &pulses).unwrap();
        assert_eq!(found.len(), 4, "{found:?}");
        for finding in found {
            assert!(
                matches!(finding, Finding::Wrapped { turns: found, .. } if found == turns),
                "{by_m} {finding}"
            );
        }
    }
}

#[test]
fn too_few_targets_are_reported() {
    let array = array(2);
    let mut pulses = pulses(&array, 30.0);
    pulses[3].clear();
    pulses[10].truncate(1);
    pulses[11].truncate(1);
    assert_eq!(
        examine(&array, &pulses),
        Ok(vec![
            Finding::NoTarget {
                pulses: 1,
                all: 100
            },
            Finding::OneTarget {
                pulses: 2,
                all: 100
            },
        ])
    );
    assert_eq!(examine(&array, &[]), Ok(vec![]));
    pulses[5][1].range_m = -1.0;
    let refused = examine(&array, &pulses).unwrap_err();
    assert!(matches!(
        refused,
        (5, MotionError::Sighting { target: 1, .. })
    ));
}
