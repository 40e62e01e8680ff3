//! Increments of the core against the true motion, against the host's, and bit by bit.

use std::f64::consts::TAU;

use glam::DVec2;
use subaperture::motion::{self as host, Heading};
use subaperture_core::motion::{Antennas, Echo, MotionError, Pairwise};
use subaperture_core::selftest::MotionSelfTest;

const WAVELENGTH_M: f64 = 0.004;
const TRANSMITTERS_M: [[f64; 2]; 2] = [[-0.02, 0.0], [-0.013, 0.002]];
const RECEIVERS_M: [[f64; 2]; 3] = [[0.0, 0.0], [0.002, 0.0], [0.006, 0.0]];
const PLACES_M: [[f64; 2]; 5] = [[-0.8, 2.2], [0.3, 3.1], [1.6, 3.6], [-1.1, 4.7], [0.9, 1.9]];
const CHANNELS: usize = 6;

/// Changes only if the arithmetic changes: find the reason, then update the value.
const CHECKSUM: u32 = 0xeeb9_a44a;

fn antennas() -> Antennas<'static> {
    Antennas {
        transmitters_m: &TRANSMITTERS_M,
        receivers_m: &RECEIVERS_M,
        wavelength_m: WAVELENGTH_M,
    }
}

/// Pseudo-random numbers from -1 to 1.
fn scatter(seed: &mut u64) -> f64 {
    *seed = seed
        .wrapping_mul(6_364_136_223_846_793_005)
        .wrapping_add(1_442_695_040_888_963_407);
    (*seed >> 33) as f64 / (1u64 << 30) as f64 - 1.0
}

/// Pose of the radar at pulse `n`: displacement along and aside, and rotation.
fn pose(n: usize) -> ([f64; 2], f64) {
    let u = n as f64 / 300.0;
    let sway = |cycles: f64| (TAU * cycles * u).sin();
    (
        [0.3 * u + 0.001 * sway(1.0), 0.002 * sway(2.0)],
        0.01 * sway(1.5),
    )
}

fn pulse(n: usize, noise_rad: f64, seed: &mut u64) -> Vec<Echo<CHANNELS>> {
    let (at_m, heading_rad) = pose(n);
    let (sin, cos) = heading_rad.sin_cos();
    let leg_m = |place: &[f64; 2], a: &[f64; 2]| {
        let antenna = [
            at_m[0] + cos * a[0] - sin * a[1],
            at_m[1] + sin * a[0] + cos * a[1],
        ];
        (place[0] - antenna[0]).hypot(place[1] - antenna[1])
    };
    let mut echoes = Vec::new();
    for (i, place) in PLACES_M.iter().enumerate() {
        let mut phases_rad = [0.0; CHANNELS];
        let mut sum_m = 0.0;
        for (c, phase) in phases_rad.iter_mut().enumerate() {
            let path_m = leg_m(place, &TRANSMITTERS_M[c / 3]) + leg_m(place, &RECEIVERS_M[c % 3]);
            sum_m += path_m;
            let clean = i as f64 - TAU * path_m / WAVELENGTH_M + noise_rad * scatter(seed);
            *phase = clean - TAU * (clean / TAU).round();
        }
        echoes.push(Echo {
            target: i as u16,
            range_m: sum_m / 12.0,
            phases_rad,
            phase_sigma_rad: 0.6 * noise_rad,
        });
    }
    echoes
}

fn host_array() -> host::Array {
    let places = |all: &[[f64; 2]]| all.iter().map(|place| DVec2::from_array(*place)).collect();
    host::Array {
        transmitters_m: places(&TRANSMITTERS_M),
        receivers_m: places(&RECEIVERS_M),
        wavelength_m: WAVELENGTH_M,
    }
}

/// Both are implemented separately from the same equations; they differ in the order of sums. Phases of 1e4 rad, rounded by
/// 2^-53 of that in a dozen steps, have errors of 1e-11 rad: 1e-14 m in range, and 1e-11 rad in rotation, which is determined
/// by antennas 1 mm from their centre, ten times that for similar directions.
#[test]
fn increments_match_host() {
    for noise_rad in [0.01, 0.05, 0.2] {
        let mut core = Pairwise::<5, CHANNELS>::new(&antennas()).unwrap();
        let mut on_host = host::Pairwise::new(host_array(), Heading::Estimated).unwrap();
        let mut seed = 1;
        for n in 0..300 {
            let mut echoes = pulse(n, noise_rad, &mut seed);
            // Targets appear and disappear, in any order.
            echoes.remove(n % 5);
            echoes.rotate_left(n % 3);
            let sightings: Vec<host::Sighting> = echoes
                .iter()
                .map(|echo| host::Sighting {
                    target: usize::from(echo.target),
                    range_m: echo.range_m,
                    range_sigma_m: 1e-3,
                    phases_rad: echo.phases_rad.to_vec(),
                    phase_sigma_rad: echo.phase_sigma_rad,
                })
                .collect();
            let got = core.push(&echoes).unwrap();
            let expected = on_host.push(&sightings).unwrap();
            assert_eq!(got.is_some(), expected.is_some(), "{n}");
            let (Some(got), Some(expected)) = (got, expected) else {
                continue;
            };
            assert_eq!(
                (got.targets, got.doubtful),
                (expected.targets, expected.doubtful),
                "{n}"
            );
            let off_m =
                DVec2::from_array(got.increment.moved_m).distance(expected.increment.moved_m);
            let off_rad = (got.increment.turn_rad - expected.increment.turn_rad).abs();
            assert!(off_m < 1e-12 && off_rad < 1e-9, "{n}: {off_m} {off_rad}");
        }
    }
}

/// Unused channel capacity and its contents have no effect.
#[test]
fn unused_channel_capacity_has_no_effect() {
    let mut exact = Pairwise::<5, CHANNELS>::new(&antennas()).unwrap();
    let mut roomy = Pairwise::<7, 9>::new(&antennas()).unwrap();
    let mut seed = 8;
    for n in 0..20 {
        let echoes = pulse(n, 0.05, &mut seed);
        let wider: Vec<Echo<9>> = echoes
            .iter()
            .map(|echo| Echo {
                target: echo.target,
                range_m: echo.range_m,
                phases_rad: std::array::from_fn(|c| *echo.phases_rad.get(c).unwrap_or(&f64::NAN)),
                phase_sigma_rad: echo.phase_sigma_rad,
            })
            .collect();
        assert_eq!(exact.push(&echoes), roomy.push(&wider), "{n}");
    }
}

/// Without noise: accurate up to the near-field terms neglected on the host as well.
#[test]
fn increments_match_true_motion() {
    let mut core = Pairwise::<5, CHANNELS>::new(&antennas()).unwrap();
    let mut seed = 1;
    for n in 0..300 {
        let Some(moved) = core.push(&pulse(n, 1e-9, &mut seed)).unwrap() else {
            continue;
        };
        let ((from_m, heading_rad), (to_m, next_rad)) = (pose(n - 1), pose(n));
        let (sin, cos) = heading_rad.sin_cos();
        let [x, y] = [to_m[0] - from_m[0], to_m[1] - from_m[1]];
        let [along, ahead] = [cos * x + sin * y, cos * y - sin * x];
        let off_m = (moved.increment.moved_m[0] - along).hypot(moved.increment.moved_m[1] - ahead);
        let off_rad = (moved.increment.turn_rad - (next_rad - heading_rad)).abs();
        // (Antenna spread)^2 / (2 range), 1e-4 / 4 m, over 2 m, of a millimetre, and three times that for directions; the same fraction for a rotation, over the antennas' 2 mm.
        assert!(off_m < 4e-8 && off_rad < 2e-5, "{n}: {off_m} {off_rad}");
    }
}

#[test]
fn increment_checksum_is_reproducible() {
    let first = MotionSelfTest::new().unwrap().run().unwrap();
    assert_eq!(
        first, CHECKSUM,
        "0x{first:08x} is not the recorded 0x{CHECKSUM:08x}"
    );
    println!("{} bytes", MotionSelfTest::BYTES);
}

#[test]
fn echoes_without_motion_information_are_rejected() {
    let new = |antennas: &Antennas<'_>| Pairwise::<2, CHANNELS>::new(antennas).map(|_| ());
    assert_eq!(new(&antennas()), Ok(()));
    let receivers_m = &RECEIVERS_M[..1];
    assert_eq!(
        new(&Antennas {
            receivers_m,
            ..antennas()
        }),
        Err(MotionError::Channels)
    );
    let smaller = Pairwise::<2, 5>::new(&antennas()).map(|_| ());
    assert_eq!(smaller, Err(MotionError::Channels));
    for wavelength_m in [f64::NAN, -1.0, 0.0, 0.003] {
        assert_eq!(
            new(&Antennas {
                wavelength_m,
                ..antennas()
            }),
            Err(MotionError::Array)
        );
    }
    let mut core = Pairwise::<2, CHANNELS>::new(&antennas()).unwrap();
    let mut seed = 3;
    let mut echoes = pulse(0, 0.01, &mut seed);
    assert_eq!(core.push(&echoes), Err(MotionError::Room));
    echoes.truncate(2);
    assert_eq!(core.push(&echoes), Ok(None));
    for wrong in [
        Echo {
            range_m: -1.0,
            ..echoes[1]
        },
        Echo {
            phase_sigma_rad: f64::NAN,
            ..echoes[1]
        },
        Echo {
            phases_rad: [f64::INFINITY; CHANNELS],
            ..echoes[1]
        },
        echoes[0],
    ] {
        assert_eq!(
            core.push(&[echoes[0], wrong]),
            Err(MotionError::Echo(wrong.target))
        );
    }
    assert!(
        core.push(&pulse(1, 0.01, &mut seed)[..2])
            .unwrap()
            .is_some()
    );
    assert_eq!(core.push(&echoes[..1]), Err(MotionError::TooLittle));
    assert_eq!(core.push(&[]), Err(MotionError::TooLittle));
}
