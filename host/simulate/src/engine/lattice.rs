//! Reuse of phasors for a lattice of points along a straight track with stop-and-go.
//!
//! If pulse positions lie on a straight line at integer multiples of a spacing `e`, with constant attitude, and the
//! scene's points lie on lines along the track at integer multiples of `e` too, then delay, phase and gain of a point
//! in a pulse depend only on the difference of the two integers (Schone 2020, 4.1.1). A row contains all points with
//! equal cross-track coordinates. It needs as many phasors as there are differences: points plus pulses instead of
//! their product.
//!
//! Points may deviate from the lattice by 1e-7 wavelengths, pulses by 1e-6 wavelengths (-100 dB). Occlusion depends on
//! position instead of difference: tables are not reused in scenes with obstacles or terrain shadow. A pulse off the lattice is computed
//! normally.
//!
//! Benefit: 11.7 ns per point and pulse instead of 17.0, one core, 1e6 points (`benches/simulate.rs`); the remainder is
//! gridding.
//!
//! Memory: 16 bytes per difference and 12 per point.

use glam::{DQuat, DVec3};
use num_complex::Complex64;
use rayon::prelude::*;

use super::chunk::{Chunk, LANES, Values};
use super::illumination::Illumination;
use super::run::{Run, Work};
use super::{Sweep, View};
use crate::Scatterer;
use crate::scene::Scene;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::radar::{Antenna, Motion};
use subaperture_signal::phase::phasor;

/// Maximum number of point spacings per pulse spacing.
const MAX_SPACINGS: u32 = 16;
/// Minimum ratio of uses to table entries.
const MIN_REUSE: u64 = 4;

/// Tables for one radar on one track.
#[derive(Debug)]
pub(super) struct Lattice {
    sweep: Sweep,
    transmitter: Antenna,
    receiver: Antenna,
    spreading_from_m: Option<f64>,
    reference_s: f64,
    attitude: DQuat,
    start_m: DVec3,
    pitch_m: DVec3,
    last: i64,
    rows: Vec<Row>,
}

/// Points of a row, and their unit responses.
#[derive(Debug)]
struct Row {
    /// Index (from the row's first point) and amplitude of each point.
    points: Vec<(u32, f32, f32)>,
    /// Unit responses by difference, from the first point seen from the last pulse.
    seen: Vec<Seen>,
}

/// Response of a unit scatterer at one difference.
#[derive(Clone, Copy, Debug)]
struct Seen {
    cell: u32,
    fraction: f32,
    re: f32,
    im: f32,
}

/// Cross-track cells (two axes), index along the track, and number of a scatterer.
type Placed = (i64, i64, i64, u32);

/// Index of a point along the track, and its distance from the lattice in metres.
fn place(from_origin_m: f64, spacing_m: f64) -> (f64, f64) {
    let x = from_origin_m / spacing_m;
    (x.round(), (x - x.round()).abs() * spacing_m)
}

/// Number of point spacings per pulse spacing for which all points lie on the lattice.
fn spacings(scene: &Scene, origin_m: DVec3, step_m: DVec3, slack_m: f64) -> Option<u32> {
    let along = step_m.try_normalize()?;
    (1..=MAX_SPACINGS).find(|&n| {
        let spacing_m = step_m.length() / f64::from(n);
        scene.points.iter().all(|point| {
            let x_m = (point.position_m - origin_m).dot(along);
            place(x_m, spacing_m).1 <= slack_m
        })
    })
}

/// All points, sorted by cross-track cells, then along the track.
fn in_rows(
    scene: &Scene,
    origin_m: DVec3,
    along: DVec3,
    pitch_m: f64,
    slack_m: f64,
) -> Vec<Placed> {
    let beside = along.any_orthonormal_vector();
    let above = along.cross(beside);
    let mut order: Vec<Placed> = (0u32..)
        .zip(&scene.points)
        .map(|(i, point)| {
            let from_m = point.position_m - origin_m;
            let cell = |axis| (from_m.dot(axis) / slack_m).round() as i64;
            let index = place(from_m.dot(along), pitch_m).0 as i64;
            (cell(beside), cell(above), index, i)
        })
        .collect();
    order.par_sort_unstable();
    order
}

impl Lattice {
    /// Make tables for `views` if they fit into `memory_bytes` and are worth it.
    pub(super) fn new(scene: &Scene, views: &[View], memory_bytes: u64) -> Option<Lattice> {
        if !scene.is_open() {
            return None;
        }
        let (first, last) = (views.first()?, views.last()?);
        let pose = first.body.pose(first.time_s);
        let travel_m = last.body.pose(last.time_s).position_m - pose.position_m;
        let step_m = travel_m / (views.len() - 1).max(1) as f64;
        let along = step_m.try_normalize()?;
        let origin_m = scene.points.first()?.position_m;
        let wavelength_m = SPEED_OF_LIGHT_M_S / first.sweep.start_hz;
        let slack_m = 1e-7 * wavelength_m;
        let spacings = spacings(scene, origin_m, step_m, slack_m)?;
        let pitch_m = step_m / f64::from(spacings);
        let last = (views.len() - 1) as i64 * i64::from(spacings);
        let order = in_rows(scene, origin_m, along, pitch_m.length(), slack_m);
        let rows: Vec<&[Placed]> = order.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)).collect();
        let length = |row: &[Placed]| (row[row.len() - 1].2 - row[0].2 + last + 1) as u64;
        let differences = rows
            .iter()
            .fold(0u64, |sum, row| sum.saturating_add(length(row)));
        let points = scene.points.len() as u64;
        if differences.saturating_mul(MIN_REUSE) > points * views.len() as u64
            || differences.saturating_mul(16).saturating_add(12 * points) > memory_bytes
        {
            return None;
        }

        let mut lattice = Lattice {
            sweep: first.sweep,
            transmitter: first.transmitter.clone(),
            receiver: first.receiver.clone(),
            spreading_from_m: first.spreading_from_m,
            reference_s: first.reference_s,
            attitude: pose.attitude,
            start_m: pose.position_m,
            pitch_m,
            last,
            rows: Vec::new(),
        };
        if !views.iter().all(|view| lattice.shift(view).is_some()) {
            return None;
        }
        lattice.rows = rows
            .par_iter()
            .map_init(Work::default, |work, row| {
                let position_m = scene.points[row[0].3 as usize].position_m;
                let points = row
                    .iter()
                    .map(|&(_, _, index, i)| {
                        let amplitude = scene.points[i as usize].amplitude;
                        let offset = (index - row[0].2) as u32;
                        (offset, amplitude.re as f32, amplitude.im as f32)
                    })
                    .collect();
                let start_m = position_m - pitch_m * last as f64;
                let seen = see(first, start_m, pitch_m, length(row) as usize, work);
                Row { points, seen }
            })
            .collect();
        Some(lattice)
    }

    /// Size of the tables, bytes.
    pub(super) fn held_bytes(&self) -> u64 {
        let row = |row: &Row| size_of_val(&*row.points) + size_of_val(&*row.seen);
        self.rows.iter().map(row).sum::<usize>() as u64
    }

    /// Distance of this pulse from the first in pitches; `None` if it does not fit the tables.
    pub(super) fn shift(&self, view: &View) -> Option<i64> {
        let pose = view.body.pose(view.time_s);
        let offset_m = pose.position_m - self.start_m;
        let shift = (offset_m.dot(self.pitch_m) / self.pitch_m.length_squared()).round();
        let off_m = offset_m.distance(self.pitch_m * shift);
        let wavelength_m = SPEED_OF_LIGHT_M_S / self.sweep.start_hz;
        // A constant change of delay is a phase ramp, but changes the residual video phase nonlinearly.
        let same_reference = self.reference_s == view.reference_s;
        let fits = view.motion == Motion::StopAndGo
            && view.sweep == self.sweep
            && view.spreading_from_m == self.spreading_from_m
            && (same_reference || self.sweep.residual_hz_s == 0.0)
            && pose.attitude == self.attitude
            && *view.transmitter == self.transmitter
            && *view.receiver == self.receiver
            && off_m <= 1e-6 * wavelength_m
            && (0.0..=self.last as f64).contains(&shift);
        fits.then_some(shift as i64)
    }

    /// Add all points, seen from `shift`, to `run`.
    pub(super) fn add(&self, shift: i64, run: &mut Run) {
        let from = (self.last - shift) as usize;
        for row in &self.rows {
            let seen = &row.seen[from..];
            for points in row.points.chunks(LANES) {
                run.add_values(points.len(), |values: &mut Values| {
                    for (i, &(offset, re, im)) in points.iter().enumerate() {
                        let unit = seen[offset as usize];
                        values.cell[i] = unit.cell;
                        values.fraction[i] = unit.fraction;
                        values.re[i] = re * unit.re - im * unit.im;
                        values.im[i] = re * unit.im + im * unit.re;
                    }
                });
            }
        }
    }

    /// Change the reference delay of samples from that of the tables to that of `view`.
    pub(super) fn refer(&self, view: &View, out: &mut [Complex64]) {
        let late_s = view.reference_s - self.reference_s;
        if late_s != 0.0 {
            let mut turn = phasor(self.sweep.start_hz * late_s);
            let step = phasor(self.sweep.step_hz * late_s);
            for z in out {
                *z *= turn;
                turn *= step;
            }
        }
    }
}

/// Responses of unit scatterers from `start_m` on, one pitch apart.
fn see(view: &View, start_m: DVec3, pitch_m: DVec3, count: usize, work: &mut Work) -> Vec<Seen> {
    let illumination = Illumination::open(view);
    let mut seen = Vec::with_capacity(count);
    for first in (0..count).step_by(LANES) {
        let chunk = Chunk::new((first..count.min(first + LANES)).map(|i| Scatterer {
            position_m: start_m + pitch_m * i as f64,
            amplitude: Complex64::ONE,
        }));
        let mut run = Run::new(work, view.sweep.count);
        run.illuminate(&illumination, &chunk);
        run.stand_still(view, &chunk);
        let values = run.values(&chunk);
        seen.extend((0..chunk.count).map(|i| Seen {
            cell: values.cell[i],
            fraction: values.fraction[i],
            re: values.re[i],
            im: values.im[i],
        }));
    }
    seen
}
