//! Error of the linear path model within the sub-CPIs of maps.
//!
//! A map header contains the antennas at two nodes of its sub-CPI, symmetric about the middle. The track in between is
//! modelled as a line with a curvature from the change of velocity to the neighbouring sub-CPIs. This gives the path to a
//! pixel, relative to the patch centre, for every pulse. Its deviation from the line through the two nodes is the error of
//! the model:
//!
//! ```text
//! antenna(u) = middle + v u + (a / 2) (u^2 - g^2),   u = -(M - 1) / 2 ..= (M - 1) / 2,   g^2 = (M^2 - 1) / 12
//! ```
//!
//! Vibration between the nodes is not contained in maps. A plan made on the recorded track includes it: the prediction is
//! never better than that of a plan recorded with the run ([`crate::maps::Run::provenance`]).

use std::f64::consts::TAU;

use glam::DVec3;
use subaperture_core::stream::{MapHeader, Node, Setup};

use subaperture_focus::sub_cpi::SubCpi;
use subaperture_model::SPEED_OF_LIGHT_M_S;

/// Number of evaluated positions within a sub-CPI.
const PLACES: usize = 9;

/// Antenna motion in a sub-CPI for transmitter and receiver: midpoint between the nodes in metres, and velocity in metres per
/// pulse.
#[derive(Clone, Copy)]
struct Motion {
    middle_m: [DVec3; 2],
    speed_m: [DVec3; 2],
    num_pulses: f64,
}

impl Motion {
    fn new(header: &MapHeader) -> Self {
        let num_pulses = f64::from(header.num_pulses);
        let spread = spread(num_pulses);
        let both = |node: &Node| [node.transmitter_m, node.receiver_m].map(DVec3::from);
        let [early, late] = header.nodes.each_ref().map(both);
        let speed = |i: usize| match spread > 0.0 {
            true => (late[i] - early[i]) / (2.0 * spread),
            false => DVec3::ZERO,
        };
        Self {
            middle_m: [0, 1].map(|i| (early[i] + late[i]) / 2.0),
            speed_m: [0, 1].map(speed),
            num_pulses,
        }
    }
}

/// `g`: RMS of the pulse positions about the middle.
fn spread(num_pulses: f64) -> f64 {
    ((num_pulses * num_pulses - 1.0) / 12.0).sqrt()
}

/// Change of velocity between sub-CPIs in metres per pulse squared.
fn acceleration(a: &Motion, b: &Motion) -> [DVec3; 2] {
    let apart = (a.num_pulses + b.num_pulses) / 2.0;
    [0, 1].map(|i| (b.speed_m[i] - a.speed_m[i]) / apart)
}

/// RMS phase error in radians of the linear path model at `points` for the map `header`, using the maps before and after it of
/// the same patch.
pub(super) fn error(
    setup: &Setup,
    header: &MapHeader,
    [before, after]: [Option<&MapHeader>; 2],
    points: &[DVec3],
) -> f64 {
    let own = Motion::new(header);
    let next_to = |other: &&MapHeader| other.sub_cpi.abs_diff(header.sub_cpi) == 1;
    let from = before
        .filter(next_to)
        .map(|other| acceleration(&Motion::new(other), &own));
    let to = after
        .filter(next_to)
        .map(|other| acceleration(&own, &Motion::new(other)));
    let bend = match (from, to) {
        (Some(a), Some(b)) => [0, 1].map(|i| (a[i] + b[i]) / 2.0),
        (Some(one), None) | (None, Some(one)) => one,
        (None, None) => [DVec3::ZERO; 2],
    };
    let g = spread(own.num_pulses);
    let places =
        (0..PLACES).map(|i| (i as f64 / (PLACES - 1) as f64 - 0.5) * (own.num_pulses - 1.0));
    let antennas: Vec<(f64, [DVec3; 2])> = places
        .map(|u| {
            let at =
                |i: usize| own.middle_m[i] + own.speed_m[i] * u + bend[i] * ((u * u - g * g) / 2.0);
            (u, [at(0), at(1)])
        })
        .collect();
    let centre = DVec3::from(header.patch.centre_m);
    let sub_cpi = sub_cpi_of(header);
    let datum = sub_cpi.datum(centre);
    let path_m = |antennas: &[DVec3; 2], point: DVec3| {
        antennas[0].distance(point) + antennas[1].distance(point)
    };
    let mean_square = |&point: &DVec3| {
        let (a, b) = sub_cpi.line(&datum, point);
        let left = antennas.iter().map(|(u, at)| {
            let path_m = path_m(at, point) - path_m(at, centre);
            (path_m - a - b * u).powi(2)
        });
        left.sum::<f64>() / PLACES as f64
    };
    let sum: f64 = points.iter().map(mean_square).sum();
    let mean = sum / points.len().max(1) as f64;
    TAU * setup.centre_hz() / SPEED_OF_LIGHT_M_S * mean.sqrt()
}

/// Sub-CPI of a map, from the nodes in its header.
pub(super) fn sub_cpi_of(header: &MapHeader) -> SubCpi {
    let antennas = |node: &Node| [node.transmitter_m, node.receiver_m].map(DVec3::from);
    SubCpi::from_nodes(
        header.num_pulses.into(),
        header.nodes.each_ref().map(antennas),
    )
}
