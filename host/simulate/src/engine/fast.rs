//! Fast sum over scatterers: one NUFFT per pulse over chunks of scatterers.
//!
//! Points of constant velocity are static points at their places in the pulse. With stop-and-go, a scatterer's phase is linear in `k`, a single frequency of the NUFFT. With intra-pulse motion it
//! is a parabola over each block of samples ([`super::arc`]), a series of NUFFTs ([`super::run`]).

use glam::{DVec2, DVec3};
use num_complex::Complex64;
use rayon::prelude::*;

use super::View;
use super::arc::{Arc, Reach};
use super::chunk::{Chunk, LANES};
use super::illumination::Illumination;
use super::lattice::Lattice;
use super::run::{Run, Work};
use super::sum::{self, Adder};
use crate::Scatterer;
use crate::scene::{MovingPoint, Scene};
use subaperture_model::radar::Motion;

/// Set `out` to the sum over `scene`, whose points are `points`.
pub(super) fn pulse(
    scene: &Scene,
    points: &[Chunk],
    lattice: Option<&Lattice>,
    view: &View,
    work: &mut Work,
    out: &mut [Complex64],
) {
    let illumination = Illumination::new(view, scene);
    let mut corners = chunks(scene.corners.iter().map(|corner| Scatterer {
        position_m: corner.position_m,
        amplitude: illumination.corner(corner).into(),
    }));
    corners.extend(scene.facets.chunks(LANES).map(|facets| {
        let points: Vec<MovingPoint> = facets.iter().map(|f| illumination.facet(f)).collect();
        Chunk::moving(&points)
    }));
    let middle_s = view.middle_s();
    let movers = chunks(scene.movers.iter().map(|mover| Scatterer {
        position_m: mover.motion.pose(middle_s).position_m,
        amplitude: mover.amplitude,
    }));
    out.fill(Complex64::ZERO);
    match view.motion {
        Motion::StopAndGo => {
            let recycled = lattice.and_then(|l| l.shift(view).map(|shift| (l, shift)));
            if let Some((lattice, shift)) = recycled {
                let mut run = Run::new(work, out.len());
                lattice.add(shift, &mut run);
                run.finish(out);
                lattice.refer(view, out);
            }
            let reused = recycled.is_some();
            let mut run = Run::new(work, out.len());
            let points = points.iter().filter(|chunk| chunk.moves() || !reused);
            for chunk in points.chain(&corners).chain(&movers) {
                let chunk = chunk.at(|_| view.time_s);
                run.illuminate(&illumination, &chunk);
                run.stand_still(view, &chunk);
                run.add(&chunk, 1);
            }
            run.finish(out);
        }
        Motion::True => {
            let all = || points.iter().chain(&corners);
            let reaches = [illumination.transmitter_m, illumination.receiver_m]
                .map(|from_m| reach(work, all(), from_m, middle_s));
            let Some(arcs) = Arc::split(view, reaches[0], reaches[1]) else {
                return sum::pulse(scene, view, out);
            };
            for arc in &arcs {
                let samples = arc.first..arc.first + arc.count;
                let mut run = Run::new(work, arc.count);
                for chunk in all() {
                    run.illuminate(&illumination, &chunk.at(|_| middle_s));
                    arc.phases(chunk, &mut run.work.phases);
                    run.add_bent(chunk);
                }
                let mut rest = Vec::new();
                for (chunk, movers) in movers.iter().zip(scene.movers.chunks(LANES)) {
                    run.illuminate(&illumination, chunk);
                    rest.extend(run.follow(arc, view, movers));
                    run.add_bent(chunk);
                }
                run.finish(&mut out[samples.clone()]);
                if !rest.is_empty() {
                    let adder = Adder::of_samples(view, samples.clone());
                    for mover in rest {
                        let amplitude = mover.amplitude
                            * illumination.of(mover.motion.pose(middle_s).position_m);
                        let place = |t| mover.motion.pose(t).position_m;
                        adder.add(amplitude, place, &mut out[samples.clone()]);
                    }
                }
            }
        }
    }
}

/// Chunks of a scene's points: static ones, then moving ones.
pub(super) fn points(scene: &Scene) -> Vec<Chunk> {
    let mut points = match scene.is_open() {
        true => chunks(scene.points.iter().copied()),
        false => chunks(ordered(&scene.points).map(|i| scene.points[i])),
    };
    points.extend(scene.moving_points.chunks(LANES).map(Chunk::moving));
    points
}

/// Numbers of points along a Morton curve of x and y, on a lattice of 65536 cells a side.
fn ordered(points: &[Scatterer]) -> impl Iterator<Item = usize> + use<> {
    let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for point in points {
        let at = point.position_m.truncate();
        (low, high) = (low.min(at), high.max(at));
    }
    let cells = 65535.0 / (high - low).max(DVec2::splat(1e-9));
    // Bits of a 16-bit number at even places.
    let spread = |value: f64| {
        let mut bits = u64::from(value as u16);
        for (shift, mask) in [
            (8, 0x00ff_00ff),
            (4, 0x0f0f_0f0f),
            (2, 0x3333_3333),
            (1, 0x5555_5555),
        ] {
            bits = (bits | (bits << shift)) & mask;
        }
        bits
    };
    let code = |(i, point): (u64, &Scatterer)| {
        let cell = (point.position_m.truncate() - low) * cells;
        // 32 bits of place, 32 bits of number.
        ((spread(cell.x) | (spread(cell.y) << 1)) << 32) | i
    };
    let mut order: Vec<u64> = (0u64..).zip(points).map(code).collect();
    order.par_sort_unstable();
    order.into_iter().map(|code| (code & 0xffff_ffff) as usize)
}

/// Group scatterers into chunks.
fn chunks(scatterers: impl Iterator<Item = Scatterer>) -> Vec<Chunk> {
    let mut scatterers = scatterers.peekable();
    let mut chunks = Vec::new();
    while scatterers.peek().is_some() {
        chunks.push(Chunk::new(scatterers.by_ref().take(LANES)));
    }
    chunks
}

/// Distances of the nearest and farthest scatterers from `from_m` at `time_s`; NaN positions make the interval infinitely
/// wide.
fn reach<'a>(
    work: &mut Work,
    chunks: impl Iterator<Item = &'a Chunk>,
    from_m: DVec3,
    time_s: f64,
) -> Reach {
    let mut reach: Option<Reach> = None;
    for chunk in chunks {
        let speed_m_s = chunk.speed_m_s();
        let chunk = chunk.at(|_| time_s);
        let ranges_m = &mut work.ranges_m[0];
        chunk.ranges_m(from_m, ranges_m);
        let (mut near_m, mut far_m) = (f64::INFINITY, 0.0f64);
        for &range_m in &ranges_m[..chunk.count] {
            near_m = near_m.min(range_m);
            far_m = far_m.max(range_m);
        }
        let so_far = reach.unwrap_or(Reach {
            near_m,
            far_m,
            speed_m_s,
        });
        reach = Some(Reach {
            near_m: so_far.near_m.min(near_m),
            far_m: so_far.far_m.max(far_m),
            speed_m_s: so_far.speed_m_s.max(speed_m_s),
        });
    }
    // No points and corners: any distance is valid.
    reach.unwrap_or(Reach {
        near_m: 1e6,
        far_m: 1e6,
        speed_m_s: 0.0,
    })
}
