//! Live track, pulse by pulse: [`Tracker`], one thread. `cargo bench --bench motion`. An item is a pulse: a radar at
//! 1 kHz needs 1000 items per second.
//!
//! One transmitter and four receivers, four targets, a window of ten pulses in the middle of a track, where each push marginalises a pulse.

use std::f64::consts::TAU;

use divan::Bencher;
use divan::counter::ItemsCount;
use subaperture::glam::DVec2;
use subaperture::motion::{Array, Heading, Pairwise, Robust, Sighting, Tracker};

/// Seconds for one line of the table.
const LONGEST_S: f64 = 2.0;
const WAVELENGTH_M: f64 = 299_792_458.0 / 77e9;
const PLACES_M: [[f64; 2]; 4] = [[-0.8, 2.2], [0.3, 3.1], [1.6, 3.6], [-1.1, 4.7]];
/// Number of pulses, 1 mm of track each.
const PULSES: usize = 500;

fn main() {
    divan::main();
}

fn array() -> Array {
    Array {
        transmitters_m: vec![DVec2::new(-0.02, 0.0)],
        receivers_m: (0..4)
            .map(|i| DVec2::new(0.5 * WAVELENGTH_M * f64::from(i), 0.0))
            .collect(),
        wavelength_m: WAVELENGTH_M,
    }
}

/// Phases with errors of about 0.03 rad, without a random generator.
fn pulses(array: &Array) -> Vec<Vec<Sighting>> {
    let sighting = |n: usize, target: usize| {
        let at_m = DVec2::from_array(PLACES_M[target]) - DVec2::new(1e-3 * n as f64, 0.0);
        let transmitter_m = at_m.distance(array.transmitters_m[0]);
        let paths_m = array
            .receivers_m
            .iter()
            .map(|r| at_m.distance(*r) + transmitter_m);
        let phases_rad = paths_m.enumerate().map(|(c, path_m)| {
            let error = ((n * 7919 + target * 104_729 + c * 1299) % 1009) as f64 / 1009.0 - 0.5;
            -TAU * path_m / WAVELENGTH_M + 0.1 * error
        });
        Sighting {
            target,
            phases_rad: phases_rad.collect(),
            range_m: at_m.length(),
            range_sigma_m: 2e-3,
            phase_sigma_rad: 0.03,
        }
    };
    let pulse = |n: usize| {
        (0..PLACES_M.len())
            .map(|target| sighting(n, target))
            .collect()
    };
    (0..PULSES).map(pulse).collect()
}

/// Least squares over a window of pulses: (c).
#[divan::bench(max_time = LONGEST_S)]
fn jointly(bencher: Bencher) {
    let array = array();
    let pulses = pulses(&array);
    bencher.counter(ItemsCount::new(PULSES)).bench_local(|| {
        let mut tracker = Tracker::new(array.clone(), 10).expect("the array measures angles");
        for pulse in &pulses {
            divan::black_box(tracker.push(pulse).expect("four targets determine a pose"));
        }
    });
}

/// Pulse by pulse with exact path lengths: (b).
#[divan::bench(max_time = LONGEST_S)]
fn robustly(bencher: Bencher) {
    let array = array();
    let pulses = pulses(&array);
    bencher.counter(ItemsCount::new(PULSES)).bench_local(|| {
        let mut robust =
            Robust::new(array.clone(), Heading::Estimated, 100).expect("such an array");
        for pulse in &pulses {
            divan::black_box(robust.push(pulse).expect("four targets determine a motion"));
        }
    });
}

/// Pulse by pulse by the thesis's method: (a).
#[divan::bench(max_time = LONGEST_S)]
fn by_pairs(bencher: Bencher) {
    let array = array();
    let pulses = pulses(&array);
    bencher.counter(ItemsCount::new(PULSES)).bench_local(|| {
        let mut pairwise = Pairwise::new(array.clone(), Heading::Estimated).expect("such an array");
        for pulse in &pulses {
            divan::black_box(
                pairwise
                    .push(pulse)
                    .expect("four targets determine a motion"),
            );
        }
    });
}
