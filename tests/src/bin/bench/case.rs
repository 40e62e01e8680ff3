//! Cases on which formers are measured: track, scene and pixels.
//!
//! | case | radar and track | pulses x samples | pixels |
//! |---|---|---|---|
//! | `a` | 10 GHz, 600 MHz, 2 km away on a bent track of 120 m | 1040 x 1024 | 512 x 512 of 0.2 m |
//! | `straight` | the same, not bent, pulses evenly along it | | |
//! | `b` | as `a` | 4096 x 4096 | 1024 x 1024 |
//! | `c` | | 4096 x 4096 | 4096 x 4096 |
//! | `large` | 10 GHz, 600 MHz, 10 km away on a bent track of 600 m | 30,000 x 4096 | 1024 x 1024 of 0.25 m, in the middle of a scene of 1 km |
//! | `large-whole` | | | all 4000 x 4000 |
//! | `gotcha` | 9.6 GHz, 622 MHz, once around at 7.2 km, 7.2 km up, 117 pulses a degree | 42,120 x 424 | 512 x 512 of 0.2 m |
//! | `PxKxS` | as `a` | P x K | S x S of 0.2 m |
//!
//! `large` is a part of the large scene of Schone 2020 (30,000 pulses, 1 km x 1 km at 0.25 m); `gotcha` has the geometry of AFRL's GOTCHA
//! collection. All are simulated with scatterers all over the scene and phases referred to its middle. Windows are Hamming's.

use std::f64::consts::TAU;
use std::fmt;
use std::ops::Range;

use subaperture::geometry::{ImageGrid, SceneFrame};
use subaperture::glam::DVec3;
use subaperture::phase_history::{Collection, Pulse, Sweep};

use crate::sums;

/// Names of the named cases.
pub(crate) const NAMES: [&str; 7] = ["a", "straight", "b", "c", "large", "large-whole", "gotcha"];

/// Cases measured by default.
pub(crate) const USUAL: [&str; 6] = ["a", "straight", "b", "c", "large", "gotcha"];

/// Track of the radar.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Track {
    /// Along x for `length_m`, at this ground distance and the same height.
    Along {
        length_m: f64,
        away_m: f64,
        height_m: f64,
        /// Whether the track is slightly bent.
        bent: bool,
    },
    /// A full circle.
    Around { radius_m: f64, height_m: f64 },
}

/// Pixels of a scatterer's main lobe: 3 x 3.
const LOBE_PIXELS: usize = 9;

/// A pixel at which errors are measured.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    pub(crate) row: usize,
    pub(crate) column: usize,
    /// Number of pixels that it represents.
    pub(crate) stands_for: f64,
}

/// Benchmark case.
#[derive(Clone, Debug)]
pub(crate) struct Case {
    pub(crate) name: String,
    pub(crate) track: Track,
    pub(crate) start_hz: f64,
    pub(crate) step_hz: f64,
    pub(crate) pulses: usize,
    pub(crate) samples: usize,
    /// Pixels along each side of the image, which is centred on the scene.
    pub(crate) side: usize,
    pub(crate) pixel_m: f64,
    /// Side of the square of scatterers, metres.
    pub(crate) scene_m: f64,
    pub(crate) scatterers: usize,
}

impl Case {
    /// Case of this name.
    ///
    /// # Errors
    /// List of the names, if there is no such case.
    pub(crate) fn named(name: &str) -> Result<Self, String> {
        let near = |pulses, samples, side, scatterers| {
            let track = Track::Along {
                length_m: 120.0,
                away_m: 1732.0,
                height_m: 1000.0,
                bent: name != "straight",
            };
            let step_hz = 600e6 / samples as f64;
            Self {
                name: name.to_owned(),
                track,
                start_hz: 10e9 - (samples / 2) as f64 * step_hz,
                step_hz,
                pulses,
                samples,
                side,
                pixel_m: 0.2,
                scene_m: side as f64 * 0.2,
                scatterers,
            }
        };
        let far = |side| Self {
            track: Track::Along {
                length_m: 600.0,
                away_m: 8660.0,
                height_m: 5000.0,
                bent: true,
            },
            side,
            pixel_m: 0.25,
            scene_m: 1000.0,
            ..near(30_000, 4096, side, 100)
        };
        Ok(match name {
            "a" | "straight" => near(1040, 1024, 512, 3000),
            "b" => near(4096, 4096, 1024, 1500),
            "c" => near(4096, 4096, 4096, 400),
            "large" => far(1024),
            "large-whole" => far(4000),
            "gotcha" => Self {
                track: Track::Around {
                    radius_m: 7200.0,
                    height_m: 7200.0,
                },
                start_hz: 9.288e9,
                step_hz: 1.4714e6,
                ..near(360 * 117, 424, 512, 300)
            },
            _ => {
                let sizes: Option<Vec<usize>> = name.split('x').map(|n| n.parse().ok()).collect();
                match sizes.as_deref() {
                    Some(&[pulses, samples, side]) if pulses > 1 && samples > 1 && side > 0 => {
                        near(pulses, samples, side, 100)
                    }
                    _ => {
                        return Err(format!(
                            "there is no case '{name}': choose of {}, or PULSESxSAMPLESxSIDE",
                            NAMES.join(", ")
                        ));
                    }
                }
            }
        })
    }

    /// Antenna position of pulse `n`, metres.
    fn antenna_m(&self, n: usize) -> DVec3 {
        let part = n as f64 / (self.pulses - 1) as f64;
        match self.track {
            Track::Along {
                length_m,
                away_m,
                height_m,
                bent,
            } => {
                let u = part - 0.5;
                let straight = DVec3::new(length_m * u, -away_m, height_m);
                let bend = DVec3::new(
                    0.3 * (9.0 * u).sin(),
                    0.02 * (40.0 * u).sin(),
                    0.2 * (23.0 * u).cos(),
                );
                if bent { straight + bend } else { straight }
            }
            Track::Around { radius_m, height_m } => {
                let angle = TAU * n as f64 / self.pulses as f64;
                let radius_m = radius_m + 5.0 * (3.0 * angle).sin();
                DVec3::new(radius_m * angle.cos(), radius_m * angle.sin(), height_m)
            }
        }
    }

    /// Geometry and frequencies.
    pub(crate) fn collection(&self) -> Collection {
        let pulse = |n: usize| {
            let at = self.antenna_m(n);
            Pulse {
                time_s: 1e-3 * n as f64,
                transmitter_m: at,
                receiver_m: at,
                reference_m: DVec3::ZERO,
                reference_path_m: 2.0 * at.length(),
                start_hz: self.start_hz,
                step_hz: self.step_hz,
                sweep: Sweep::AT_ONCE,
                recorded_path_m: None,
            }
        };
        Collection {
            name: self.name.clone(),
            num_samples: self.samples,
            pulses: (0..self.pulses).map(pulse).collect(),
            frame: SceneFrame::Local,
            extent: None,
            timed: true,
        }
    }

    /// The image, or `side` x `side` pixels in its middle.
    pub(crate) fn grid(&self, side: usize) -> ImageGrid {
        let first_m = -(side as f64) / 2.0 * self.pixel_m;
        // Half a pixel beyond the last one, so that it is included for any rounding.
        let last_m = first_m + (side as f64 - 0.5) * self.pixel_m;
        let axis = format!("{first_m}:{last_m}:{}", self.pixel_m);
        let text = format!("x={axis},y={axis}");
        text.parse().expect("the grid is well-formed")
    }

    /// Pixels of an image of `side` x `side` at which its error is measured, and how many each represents: some spread evenly, for errors
    /// that are everywhere, and some at scatterers, for errors close to them, which evenly spread ones would mostly miss.
    pub(crate) fn judged(&self, side: usize) -> Vec<Place> {
        // As many as can be computed in a few seconds.
        let most = 9e9 / (self.pulses as f64 * self.samples as f64);
        let count = (most as usize / 2).clamp(32, 256).min(side * side);
        // Strides of a prime that does not divide the number of pixels visit each pixel once.
        let stride = [15_485_863, 32_452_843]
            .into_iter()
            .find(|&prime| !side.is_multiple_of(prime));
        let stride = stride.expect("a side has not both divisors");
        let spread = (0..count).map(|i| {
            let index = i * stride % (side * side);
            Place {
                row: index / side,
                column: index % side,
                stands_for: (side * side) as f64 / count as f64,
            }
        });
        let pixel = |at_m: f64| (at_m / self.pixel_m).round() + (side / 2) as f64;
        let scatterers = sums::scatterers(self.scatterers, self.scene_m).into_iter();
        let pixels = scatterers.map(|s| [pixel(s.position_m.y), pixel(s.position_m.x)]);
        let within: Vec<[f64; 2]> = pixels
            .filter(|place| place.iter().all(|&i| (0.0..side as f64).contains(&i)))
            .collect();
        let count = count.min(within.len());
        let bright = within[..count].iter().map(|&[row, column]| Place {
            row: row as usize,
            column: column as usize,
            stands_for: (LOBE_PIXELS * within.len()) as f64 / count as f64,
        });
        spread.chain(bright).collect()
    }

    /// Side of the central part that `exact` can form in some seconds, where every pixel needs all samples.
    pub(crate) fn part_for_exact(&self) -> usize {
        let pixels = 1e9 / (self.pulses as f64 * self.samples as f64);
        (pixels.sqrt() as usize)
            .clamp(4, self.side.max(4))
            .min(self.side)
    }

    /// Bytes of all samples.
    pub(crate) fn bytes(&self) -> u64 {
        8 * self.pulses as u64 * self.samples as u64
    }

    /// Blocks of pulses that are simulated together.
    pub(crate) fn runs(&self) -> impl Iterator<Item = Range<usize>> {
        let (run, pulses) = ((1 << 22) / self.samples + 1, self.pulses);
        (0..pulses)
            .step_by(run)
            .map(move |first| first..pulses.min(first + run))
    }
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            name,
            pulses,
            samples,
            side,
            pixel_m,
            ..
        } = self;
        write!(
            f,
            "{name}: {pulses} pulses x {samples} samples ({} MiB), {side} x {side} pixels of {pixel_m} m",
            self.bytes() >> 20
        )?;
        let image_m = *side as f64 * pixel_m;
        if image_m < self.scene_m {
            let scene_m = self.scene_m;
            write!(
                f,
                ", {image_m} m x {image_m} m of a scene of {scene_m} m x {scene_m} m"
            )?;
        }
        Ok(())
    }
}
