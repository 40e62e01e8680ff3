//! Points on a strip, seen by antennas of each pattern, with amplitudes by the formulas of this file; and the image with matched weights as a plain sum.

use std::f64::consts::PI;

use glam::{DMat3, DQuat, DVec3};
use num_complex::{Complex32, Complex64};
use subaperture::antenna::PatternTable;
use subaperture::geometry::ImageGrid;
use subaperture::phase_history::{Collection, InMemory, Weights};
use subaperture::radar::{Antenna, MountedAntennas, Pattern};
use subaperture_tests::plain_history::{complex, plain_pulse, plain_samples};
use subaperture_tests::plain_sum::{PlainSum, hamming};

use crate::beam_scene;

pub(crate) const PULSES: usize = 300;
pub(crate) const GRID: &str = "x=-24:20.6:0.6,y=285:315.1:3";

/// Depression of the boresight, radians: towards the middle of the grid, 60 m below at 300 m.
const DOWN_RAD: f64 = 0.2;

/// Two-way pattern: amplitudes by azimuth and elevation, radians, and the library's description of the same antennas.
pub(crate) struct Scene {
    pub(crate) name: &'static str,
    single: fn(f64, f64) -> f64,
    /// Whether the receiver has the pattern too; otherwise it is isotropic.
    is_combined: bool,
    pattern: Pattern,
    /// Yaw and roll of the body by pulse, radians.
    turned_rad: fn(usize) -> [f64; 2],
    aim_m: Option<DVec3>,
}

const AZIMUTH_RAD: f64 = 0.12;
const ELEVATION_RAD: f64 = 0.1;

fn gaussian(azimuth: f64, elevation: f64) -> f64 {
    0.5f64.powf(2.0 * ((azimuth / AZIMUTH_RAD).powi(2) + (elevation / ELEVATION_RAD).powi(2)))
}

/// Half the power where the cosine's power `2 q` is 1/2.
fn cosine(azimuth: f64, elevation: f64) -> f64 {
    let one = |angle: f64, width: f64| {
        let q = 0.5f64.ln() / (2.0 * (0.5 * width).cos().ln());
        angle.cos().powf(q)
    };
    one(azimuth, AZIMUTH_RAD) * one(elevation, ELEVATION_RAD)
}

/// Far field of a uniform rectangle: direction cosines to left and up, nulls at `sin(w / 2) / 0.443`.
fn aperture(azimuth: f64, elevation: f64) -> f64 {
    let one = |cosine: f64, width: f64| {
        let x = PI * 0.442_946_470_689_452_3 * cosine / (0.5 * width).sin();
        if x == 0.0 { 1.0 } else { x.sin() / x }
    };
    one(azimuth.sin() * elevation.cos(), AZIMUTH_RAD) * one(elevation.sin(), ELEVATION_RAD)
}

const TABLE_STEPS_DEG: [f64; 2] = [0.5, 1.0];
const TABLE_ENDS_DEG: [f64; 2] = [20.0, 15.0];

/// Amplitude at a sample of the table, degrees: an unsymmetrical bell.
fn sample(azimuth_deg: f64, elevation_deg: f64) -> f64 {
    let bell = |x: f64| 1.0 / (1.0 + x * x);
    bell(azimuth_deg / 6.0) * bell(elevation_deg / 8.0) * (1.0 + 0.01 * azimuth_deg)
}

/// Amplitude of the table, bilinear between its samples.
fn table(azimuth: f64, elevation: f64) -> f64 {
    let [x, y] = [(azimuth, 0), (elevation, 1)]
        .map(|(angle, i)| (angle.to_degrees() + TABLE_ENDS_DEG[i]) / TABLE_STEPS_DEG[i]);
    let at = |i: f64, j: f64| {
        sample(
            i * TABLE_STEPS_DEG[0] - TABLE_ENDS_DEG[0],
            j * TABLE_STEPS_DEG[1] - TABLE_ENDS_DEG[1],
        )
    };
    let (i, j) = (x.floor(), y.floor());
    let (u, v) = (x - i, y - j);
    let mixed = (1.0 - v) * ((1.0 - u) * at(i, j) + u * at(i + 1.0, j))
        + v * ((1.0 - u) * at(i, j + 1.0) + u * at(i + 1.0, j + 1.0));
    mixed / largest_sample()
}

fn lattice_deg() -> [Vec<f64>; 2] {
    [0, 1].map(|i| {
        let count = (2.0 * TABLE_ENDS_DEG[i] / TABLE_STEPS_DEG[i]) as usize;
        let at = |n: usize| n as f64 * TABLE_STEPS_DEG[i] - TABLE_ENDS_DEG[i];
        (0..=count).map(at).collect()
    })
}

fn largest_sample() -> f64 {
    let [azimuths, _] = lattice_deg();
    azimuths
        .iter()
        .map(|&az| sample(az, 0.0))
        .fold(0.0, f64::max)
}

fn tabulated() -> Pattern {
    let [azimuths, elevations] = lattice_deg();
    let gains = elevations.iter().flat_map(|&el| {
        let gain = move |&az: &f64| 20.0 * sample(az, el).log10();
        azimuths.iter().map(gain).collect::<Vec<_>>()
    });
    let gains: Vec<f64> = gains.collect();
    let radians = |axis: &[f64]| axis.iter().map(|deg| deg.to_radians()).collect();
    let table = PatternTable::new(radians(&azimuths), radians(&elevations), &gains);
    Pattern::Table(table.unwrap())
}

pub(crate) fn scenes() -> Vec<Scene> {
    let (azimuth_rad, elevation_rad) = (AZIMUTH_RAD, ELEVATION_RAD);
    let fixed = Scene {
        name: "gaussian",
        single: gaussian,
        is_combined: true,
        pattern: Pattern::Gaussian {
            azimuth_rad,
            elevation_rad,
        },
        turned_rad: |_| [0.0; 2],
        aim_m: None,
    };
    let pattern = || fixed.pattern.clone();
    vec![
        Scene {
            name: "cosine",
            single: cosine,
            pattern: Pattern::Cosine {
                azimuth_rad,
                elevation_rad,
            },
            ..fixed
        },
        Scene {
            name: "one-way aperture",
            single: aperture,
            is_combined: false,
            pattern: Pattern::Aperture {
                azimuth_rad,
                elevation_rad,
            },
            ..fixed
        },
        Scene {
            name: "table",
            single: table,
            pattern: tabulated(),
            ..fixed
        },
        Scene {
            name: "steered",
            pattern: pattern(),
            aim_m: Some(DVec3::new(-3.0, 301.0, 0.0)),
            ..fixed
        },
        Scene {
            name: "swaying",
            pattern: pattern(),
            turned_rad: |n| {
                let t = n as f64 / PULSES as f64;
                [0.03 * (9.0 * t).sin(), 0.015 * (14.0 * t).cos()]
            },
            ..fixed
        },
        fixed,
    ]
}

impl Scene {
    /// Boresight, left and up of the antennas at a place in pulse `n`.
    fn axes(&self, n: usize, from_m: DVec3) -> [DVec3; 3] {
        let [yaw, roll] = (self.turned_rad)(n);
        let body = DMat3::from_rotation_z(yaw) * DMat3::from_rotation_x(roll);
        let (sine, cosine) = DOWN_RAD.sin_cos();
        let [fixed, up] = [
            DVec3::new(0.0, cosine, -sine),
            DVec3::new(0.0, sine, cosine),
        ]
        .map(|v| body * v);
        let boresight = self
            .aim_m
            .map_or(fixed, |aim_m| (aim_m - from_m).normalize());
        let up = (up - boresight * boresight.dot(up)).normalize();
        [boresight, up.cross(boresight), up]
    }

    /// Two-way amplitude of a pulse at a point.
    pub(crate) fn amplitude(&self, collection: &Collection, n: usize, point_m: DVec3) -> f64 {
        let from_m = collection.pulses[n].transmitter_m;
        let towards = (point_m - from_m).normalize();
        let [ahead, left, up] = self.axes(n, from_m).map(|axis| towards.dot(axis));
        let one = (self.single)(left.atan2(ahead), up.asin());
        if self.is_combined { one * one } else { one }
    }

    fn mounted(&self) -> MountedAntennas {
        let antenna = |pattern: Pattern| Antenna {
            name: "antenna".to_owned(),
            offset_m: DVec3::ZERO,
            boresight: DVec3::new(0.0, DOWN_RAD.cos(), -DOWN_RAD.sin()),
            up: DVec3::new(0.0, DOWN_RAD.sin(), DOWN_RAD.cos()),
            pattern,
            aim_m: self.aim_m,
        };
        let receiver = match self.is_combined {
            true => self.pattern.clone(),
            false => Pattern::Isotropic,
        };
        let attitude = |n: usize| {
            let [yaw, roll] = (self.turned_rad)(n);
            [DQuat::from_rotation_z(yaw) * DQuat::from_rotation_x(roll); 2]
        };
        MountedAntennas {
            antennas: [antenna(self.pattern.clone()), antenna(receiver)],
            attitudes: (0..PULSES).map(attitude).collect(),
        }
    }

    /// Echoes of unit points through the antennas, with their description.
    pub(crate) fn record(&self, points_m: &[DVec3]) -> InMemory {
        let (collection, _) = beam_scene::strip(self.name, PULSES, |_| 0.0);
        let mut samples = Vec::new();
        for (n, pulse) in collection.pulses.iter().enumerate() {
            let plain = plain_pulse(pulse, 1.0);
            let seen: Vec<_> = points_m
                .iter()
                .map(|&point_m| {
                    let amplitude = self.amplitude(&collection, n, point_m);
                    (point_m.to_array(), [amplitude, 0.0])
                })
                .collect();
            for k in 0..collection.num_samples {
                let [re, im] = plain.echo(k, &seen);
                samples.push(Complex32::new(re as f32, im as f32));
            }
        }
        let history = InMemory::new(collection, samples).unwrap();
        history.with_antennas(Some(self.mounted()))
    }

    /// Weights `W_n` of all pulses at a point: amplitudes down to a tenth of the largest, 0 below and at the opposite sign.
    pub(crate) fn matched(&self, collection: &Collection, point_m: DVec3) -> Vec<f64> {
        let amplitudes: Vec<f64> = (0..PULSES)
            .map(|n| self.amplitude(collection, n, point_m))
            .collect();
        let largest = |a: f64, b: f64| if b.abs() > a.abs() { b } else { a };
        let peak = amplitudes.iter().copied().fold(0.0, largest);
        let weight = |a: f64| {
            if a / peak >= 0.1 {
                a / peak.signum()
            } else {
                0.0
            }
        };
        amplitudes.into_iter().map(weight).collect()
    }

    /// Image with Hamming windows as a plain sum: the blocks are those of the library, their pulses and weights those of this file.
    pub(crate) fn image(
        &self,
        history: &InMemory,
        samples: &[Complex32],
        grid: &ImageGrid,
        weights: &Weights,
    ) -> Vec<Complex64> {
        use subaperture::phase_history::PhaseHistory;
        let collection = history.collection();
        let width = collection.num_samples;
        let lit = weights.illumination.as_ref().unwrap();
        let columns = grid.columns.count;
        let mut values = vec![Complex64::ZERO; grid.num_pixels() as usize];
        for block in 0..lit.num_blocks() {
            let [rows, across] = lit.place(block);
            let [row, column] = [&rows, &across].map(|side| side.start + side.len() / 2);
            let own = self.matched(collection, grid.position_m(row, column));
            let first = own.iter().position(|w| *w > 0.0).unwrap();
            let last = own.iter().rposition(|w| *w > 0.0).unwrap();
            let range = lit.pulses(block);
            // Interpolated attitudes are off by up to 1e-4 of the width, which may move a pulse across the floor.
            assert!(range.start.abs_diff(first) <= 1 && range.end.abs_diff(last + 1) <= 1);
            let window = hamming(range.len());
            let pulses = range.clone().zip(&window);
            let pulses = pulses.map(|(n, w)| plain_pulse(&collection.pulses[n], w * own[n]));
            let sum = PlainSum {
                pulses: pulses.collect(),
                samples: plain_samples(&samples[range.start * width..range.end * width]),
                fast: hamming(width),
            };
            let total: f64 = sum.pulses.iter().map(|pulse| pulse.weight).sum();
            let pixels: Vec<usize> = rows
                .flat_map(|row| across.clone().map(move |column| row * columns + column))
                .collect();
            let points_m: Vec<DVec3> = pixels
                .iter()
                .map(|i| grid.position_m(i / columns, i % columns))
                .collect();
            let places: Vec<[f64; 3]> = points_m.iter().map(DVec3::to_array).collect();
            let formed = complex(&sum.at(&places));
            for ((pixel, point_m), value) in pixels.into_iter().zip(points_m).zip(formed) {
                let terms = range
                    .clone()
                    .zip(&sum.pulses)
                    .map(|(n, pulse)| pulse.weight * self.amplitude(collection, n, point_m));
                values[pixel] = value * (total / terms.sum::<f64>());
            }
        }
        values
    }
}
