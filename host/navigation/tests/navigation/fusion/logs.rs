//! Measurements from logs: velocities of receivers and their benefit.

use std::path::Path;

use glam::{DMat3, DVec3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use subaperture_model::geometry::{Geodetic, SceneFrame};
use subaperture_model::monitor::Silent;
use subaperture_navigation::fusion::{
    DefaultSigmas, Increment, Inertial, Inputs, Measured, Model, Position, fuse, inertial,
    positions, velocity_walk,
};
use subaperture_navigation::write::{Deviations, LogFormat, VehicleState};
use subaperture_navigation::{GpsTime, Kind, Log, Options};

use super::sensors::{noise, place, sensors, velocity};
use crate::write::Field::{D, F, U};
use crate::write::{ascii, binary, body, nmea};

const START: GpsTime = GpsTime {
    week: 2209,
    seconds: 502_061.0,
};

fn log(text: &str) -> Log {
    Log::read_from(text.as_bytes(), Path::new("log"), &Options::default()).unwrap()
}

fn frame() -> SceneFrame {
    let place = Geodetic {
        latitude_deg: 51.0,
        longitude_deg: -114.0,
        height_m: 1000.0,
    };
    let [east, north, _] = place.east_north_up();
    SceneFrame::Earth {
        origin_ecf_m: place.to_ecf_m(),
        x_axis_ecf: east,
        y_axis_ecf: north,
    }
}

/// BESTPOS record `seconds` after [`START`].
fn position(seconds: f64) -> String {
    let header = format!(
        "COM1,0,58.5,FINESTEERING,2209,{:.3},02000020,18bc,16809",
        START.seconds + seconds
    );
    ascii(&format!(
        "#BESTPOSA,{header};SOL_COMPUTED,PSRDIFF,51.0,-114.0,1017.0,-17.0,WGS84,0.5,0.25,0.75,\"AAAA\",6.0,0.0,47,35,35,33,00,06,39,33"
    ))
}

/// BESTVEL record `seconds` after [`START`]: 5 m/s towards 30 degrees from north.
fn moving(seconds: f64, latency: f64) -> String {
    let header = format!(
        "COM1,0,58.5,FINESTEERING,2209,{:.3},02000020,18bc,16809",
        START.seconds + seconds
    );
    ascii(&format!(
        "#BESTVELA,{header};SOL_COMPUTED,DOPPLER_VELOCITY,{latency},0.0,5.0,30.0,-0.25,0.0"
    ))
}

#[test]
fn velocities_are_assigned_to_simultaneous_positions() {
    let text = position(0.0)
        + &moving(0.0, 0.0)
        + &position(1.0)
        // 40 ms before the position, and 0.2 s before it: too early to be assigned.
        + &moving(1.0, 0.04)
        + &position(2.0)
        + &moving(2.0, 0.2)
        + &position(3.0);
    let log = log(&text);
    assert_eq!(log.of(Kind::Bestvel).count(), 3);
    let late = log.of(Kind::Bestvel).nth(2).unwrap();
    assert!((late.time.since(START) - 1.8).abs() < 1e-9);
    // In binary: status, type, latency, age, speed, direction, upwards.
    let bytes = body(&[
        U(0),
        U(8),
        F(0.04),
        F(0.0),
        D(5.0),
        D(30.0),
        D(-0.25),
        F(0.0),
    ]);
    assert_eq!(bytes.len(), 44);
    let bytes = binary(99, 2209, 502_062_000, &bytes);
    let binary_log = Log::read_from(&bytes[..], Path::new("log"), &Options::default()).unwrap();
    let second = log.of(Kind::Bestvel).nth(1).unwrap();
    assert_eq!(binary_log.records[0].velocity_m_s, second.velocity_m_s);
    assert!(binary_log.records[0].time.since(second.time).abs() < 1e-6);
    let found = positions(
        &log,
        Kind::Bestpos,
        &frame(),
        START,
        &DefaultSigmas::default(),
    );
    let velocities: Vec<Option<[DVec3; 2]>> = found.iter().map(|one| one.velocity_m_s).collect();
    let [Some([first, sigma]), Some([second, wider]), None, None] = velocities[..] else {
        panic!("{velocities:?}")
    };
    // East and north: sine and cosine of 30 degrees.
    let expected = DVec3::new(2.5, 5.0 * 0.75f64.sqrt(), -0.25);
    assert!(
        first.distance(expected) < 1e-9 && second == first,
        "{first}"
    );
    assert!(sigma.distance(DVec3::splat(0.1)) < 1e-9, "{sigma}");
    // The standard deviation grows by 1 m/s^2 times 40 ms.
    assert!(
        wider.distance(DVec3::splat(f64::hypot(0.1, 0.04))) < 1e-9,
        "{wider}"
    );
}

/// Positions every 20 ms with velocities between them: each velocity is assigned to the nearest position only, and of two velocities for one position the nearer is used.
#[test]
fn velocity_is_assigned_to_one_position() {
    let mut text = String::new();
    for n in 0..10 {
        text += &position(0.02 * f64::from(n));
    }
    for seconds in [0.019, 0.109, 0.142, 0.175, 0.181] {
        text += &moving(seconds, 0.0);
    }
    // Each kind of record is ordered by time.
    let log = log(&text);
    let found = positions(
        &log,
        Kind::Bestpos,
        &frame(),
        START,
        &DefaultSigmas::default(),
    );
    let with: Vec<usize> = (0..10)
        .filter(|&n| found[n].velocity_m_s.is_some())
        .collect();
    assert_eq!(with, [1, 5, 7, 9]);
    let sigma = found[9].velocity_m_s.unwrap()[1];
    assert!((sigma.x - f64::hypot(0.1, 0.001)).abs() < 1e-9, "{sigma}");
}

#[test]
fn nmea_velocity_has_negligible_vertical_weight() {
    let text = nmea("GPGGA,000000.00,5100.0,N,11400.0,W,4,10,1.0,1017.0,M,-17.0,M,,")
        + &nmea("GPRMC,000000.00,A,5100.0,N,11400.0,W,10.0,90.0,010120,,,A");
    let log = log(&text);
    let start = log.records[0].time;
    let [one] = positions(&log, Kind::Nmea, &frame(), start, &DefaultSigmas::default())[..] else {
        panic!("not one position")
    };
    let [velocity, sigma] = one.velocity_m_s.unwrap();
    // Ten knots to the east.
    assert!(
        velocity.distance(DVec3::new(5.1444, 0.0, 0.0)) < 1e-3,
        "{velocity}"
    );
    assert!((sigma.x - 0.1).abs() < 1e-9 && sigma.z > 100.0, "{sigma}");
}

/// Positions with errors of 0.1 m at 5 Hz, with and without Doppler velocities of 1 cm/s, and no increments for 4 s. With velocities every 0.2 s the motion between them is
/// known to `0.5 m/s/sqrt(s) (0.2 s / 3)^(3/2)`, some millimetres per step; with positions alone to some centimetres.
#[test]
fn velocities_bridge_gaps_of_increments() {
    let mut sensors = sensors();
    sensors.seconds = 12.0;
    sensors.out[0] = Some([4.0, 8.0]);
    let measured = sensors.measure(11);
    let mut random = ChaCha8Rng::seed_from_u64(12);
    let sigma = DVec3::splat(0.01);
    let mut moving = measured.positions.clone();
    for one in &mut moving {
        let truth = velocity(one.time_s);
        one.velocity_m_s = Some([truth + noise(&mut random, sigma), sigma]);
    }
    // RMS error of the track from 4.5 s to 7.5 s, and its standard deviation.
    let errors_m = |positions: &[_]| {
        let inputs = Inputs {
            increments: &measured.increments,
            positions,
            inertial: &[],
        };
        let fused = fuse(&inputs, &sensors.model, &Silent).unwrap();
        let gap = fused
            .samples
            .iter()
            .filter(|one| (4.5..7.5).contains(&one.time_s));
        let (mut square, mut sigma_m, mut count) = (0.0, 0.0, 0.0);
        for one in gap {
            square += (one.position_m - place(one.time_s))
                .truncate()
                .length_squared();
            sigma_m += one.covariance[0][0] + one.covariance[1][1];
            count += 1.0;
        }
        let [sum, expected] = fused.chi_square;
        assert!(
            (sum - expected).abs() < 5.0 * (2.0 * expected).sqrt(),
            "{sum} {expected}"
        );
        [square / count, sigma_m / count].map(f64::sqrt)
    };
    let [without, with] = [errors_m(&measured.positions), errors_m(&moving)];
    println!("off and expected, m: {without:?} without velocities, {with:?} with");
    assert!(with[1] < 0.7 * without[1] && with[0] < without[0]);
    // Errors within a gap are correlated: with few independent ones the RMS is within a factor of two.
    assert!((0.4..2.2).contains(&(with[0] / with[1])), "{with:?}");
}

/// INSPVAX of a vehicle at rest, ten records a second, with these deviations over time.
fn inertial_log(seconds: f64, deviations: impl Fn(f64) -> Deviations) -> Log {
    let states = (0..(10.0 * seconds) as i32).map(|n| {
        let time_s = f64::from(n) / 10.0;
        VehicleState {
            time: START.later(time_s),
            place: Geodetic {
                latitude_deg: 51.0,
                longitude_deg: -114.0,
                height_m: 1000.0,
            },
            velocity_m_s: DVec3::ZERO,
            attitude_deg: [0.0, 0.0, 90.0],
            deviations: deviations(time_s),
        }
    });
    let mut bytes = Vec::new();
    LogFormat::Inspvax
        .write(&mut bytes, "test", 0.0, states)
        .unwrap();
    Log::read_from(&bytes[..], Path::new("log"), &Options::default()).unwrap()
}

/// Deviation of a random walk of 0.05 m/s a root second from 2 s to 6 s, on 0.1 m/s.
fn walking(time_s: f64) -> Deviations {
    let seconds = if time_s < 6.0 {
        (time_s - 2.0).max(0.0)
    } else {
        0.0
    };
    Deviations {
        horizontal_m: 0.02,
        vertical_m: 2.0,
        velocity_m_s: (0.01 + 0.05f64.powi(2) * seconds).sqrt(),
        attitude_deg: 0.2,
    }
}

#[test]
fn velocity_walk_is_growth_of_stated_deviations() {
    let walk = velocity_walk(&inertial_log(10.0, walking), Kind::Inspvax).unwrap();
    // Deviations of 0.1 m/s are rounded to 0.05 mm/s: squares over a second err by 1e-5 of 2.5e-3.
    assert!(
        (walk - 0.05).abs() < 0.05 * 0.5 * 1e-5 / 2.5e-3 + 1e-9,
        "{walk}"
    );
    let steady = inertial_log(10.0, |_| walking(0.0));
    assert_eq!(velocity_walk(&steady, Kind::Inspvax), None);
    // Rounding and a growth for less than a second do not count.
    let short = inertial_log(10.0, |t| {
        walking(if (3.0..3.5).contains(&t) { t } else { 0.0 })
    });
    assert_eq!(velocity_walk(&short, Kind::Inspvax), None);
}

#[test]
fn inertial_states_have_stated_deviations_up_to_the_default() {
    let default = DefaultSigmas::default();
    let log = inertial_log(0.2, walking);
    let states = inertial(&log, Kind::Inspvax, &frame(), START, &default);
    let [_, place] = states[0].position_m.unwrap();
    // Stated are 2 cm level and 2 m in height.
    assert!(
        place.distance(DVec3::new(0.02, 0.02, default.place_m)) < 1e-9,
        "{place}"
    );
    let [_, velocity] = states[0].velocity_m_s.unwrap();
    assert!(velocity.distance(DVec3::splat(0.1)) < 1e-9, "{velocity}");
    let [_, heading] = states[0].heading_rad.unwrap();
    assert!((heading - 0.2f64.to_radians()).abs() < 1e-12, "{heading}");
}

/// Radar at rest with exact increments, positions of 1 cm, and an inertial solution that is off by half a metre until a correction at 5 s.
#[test]
fn correction_of_inertial_solution_leaves_no_outliers() {
    let times = |hz: f64| (0..(10.0 * hz) as i32).map(move |n| f64::from(n) / hz);
    let step = |from_s: f64| Increment {
        from_s,
        to_s: from_s + 0.1,
        moved_m: [0.0; 2],
        turned_rad: 0.0,
        covariance: DMat3::IDENTITY * 1e-8,
    };
    let increments: Vec<Increment> = times(10.0).map(step).collect();
    let position = |time_s| Position {
        time_s,
        position_m: DVec3::ZERO,
        sigma_m: DVec3::splat(0.01),
        velocity_m_s: None,
    };
    let positions: Vec<Position> = times(1.0).map(position).collect();
    let outliers = |sigma_m: f64| {
        let state = |time_s: f64| {
            let [off_m, sigma_m] = if time_s < 5.0 {
                [0.5, sigma_m]
            } else {
                [0.0, 0.01]
            };
            Inertial {
                time_s,
                position_m: Some([DVec3::X * off_m, DVec3::splat(sigma_m)]),
                velocity_m_s: None,
                heading_rad: Some([0.0, 1e-3]),
                roll_pitch_rad: [0.0; 2],
            }
        };
        let inertial: Vec<Inertial> = times(10.0).map(state).collect();
        let inputs = Inputs {
            increments: &increments,
            positions: &positions,
            inertial: &inertial,
        };
        let model = Model {
            outlier_sigmas: None,
            ..Model::default()
        };
        let fused = fuse(&inputs, &model, &Silent).unwrap();
        let outliers = fused.outliers.iter();
        outliers
            .filter(|one| one.of == Measured::InertialPosition)
            .count()
    };
    // With a stated deviation of the same size the correction is expected; without, many states contradict the others.
    assert_eq!(outliers(0.5), 0);
    assert!(outliers(0.01) > 5, "{}", outliers(0.01));
}
