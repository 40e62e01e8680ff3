//! Logs as measurements: velocities of receivers, and what they are worth.

use std::path::Path;

use glam::DVec3;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use subaperture_model::geometry::{Geodetic, SceneFrame};
use subaperture_model::monitor::Silent;
use subaperture_navigation::fusion::{Inputs, Unstated, fuse, positions};
use subaperture_navigation::{GpsTime, Kind, Log, Options};

use super::sensors::{noise, sensors, velocity};
use crate::write::{ascii, nmea};

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

/// A position at a time after [`START`], and a velocity of 5 m/s towards 30 degrees from north, as a receiver tells both.
fn position(seconds: f64) -> String {
    let header = format!(
        "COM1,0,58.5,FINESTEERING,2209,{:.3},02000020,18bc,16809",
        START.seconds + seconds
    );
    ascii(&format!(
        "#BESTPOSA,{header};SOL_COMPUTED,PSRDIFF,51.0,-114.0,1017.0,-17.0,WGS84,0.5,0.25,0.75,\"AAAA\",6.0,0.0,47,35,35,33,00,06,39,33"
    ))
}

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
fn velocities_beside_positions_are_theirs() {
    let text = position(0.0)
        + &moving(0.0, 0.0)
        + &position(1.0)
        // Of 40 ms before, and of a fifth of a second before: too far away.
        + &moving(1.0, 0.04)
        + &position(2.0)
        + &moving(2.0, 0.2)
        + &position(3.0);
    let log = log(&text);
    assert_eq!(log.of(Kind::Bestvel).count(), 3);
    let late = log.of(Kind::Bestvel).nth(2).unwrap();
    assert!((late.time.since(START) - 1.8).abs() < 1e-9);
    let found = positions(&log, Kind::Bestpos, &frame(), START, &Unstated::default());
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
    // A metre a second squared for 40 ms.
    assert!(
        wider.distance(DVec3::splat(f64::hypot(0.1, 0.04))) < 1e-9,
        "{wider}"
    );
}

#[test]
fn speeds_over_ground_say_nothing_upwards() {
    let text = nmea("GPGGA,000000.00,5100.0,N,11400.0,W,4,10,1.0,1017.0,M,-17.0,M,,")
        + &nmea("GPRMC,000000.00,A,5100.0,N,11400.0,W,10.0,90.0,010120,,,A");
    let log = log(&text);
    let start = log.records[0].time;
    let [one] = positions(&log, Kind::Nmea, &frame(), start, &Unstated::default())[..] else {
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

/// Positions to a decimetre five times a second, with Doppler velocities to 3 cm/s and without, and nothing else but increments: velocities hold the length of the radar's x, which errors of
/// positions hold badly over some metres.
#[test]
fn velocities_make_the_scale_surer() {
    let mut sensors = sensors();
    sensors.seconds = 20.0;
    let measured = sensors.measure(11);
    let mut random = ChaCha8Rng::seed_from_u64(12);
    let sigma = DVec3::splat(0.03);
    let mut with = measured.positions.clone();
    for one in &mut with {
        let truth = velocity(one.time_s);
        one.velocity_m_s = Some([truth + noise(&mut random, sigma), sigma]);
    }
    let fused = |positions: &[_]| {
        let inputs = Inputs {
            increments: &measured.increments,
            positions,
            inertial: &[],
        };
        fuse(&inputs, &sensors.model, &Silent).unwrap()
    };
    let [without, with] = [fused(&measured.positions), fused(&with)];
    println!(
        "scale {:?} without velocities, {:?} with",
        without.scale, with.scale
    );
    assert!(with.scale.sigma < 0.9 * without.scale.sigma);
    assert!((with.scale.value - sensors.scale).abs() < 4.0 * with.scale.sigma);
    // As good as they say: of 100 positions' and velocities' 600 numbers and the increments'.
    let [sum, expected] = with.chi_square;
    assert!(
        (sum - expected).abs() < 5.0 * (2.0 * expected).sqrt(),
        "{sum} {expected}"
    );
}
