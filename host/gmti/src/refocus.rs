//! Targets refocused under their own motion, at their places in the image.
//!
//! Each target is imaged in the frame that moves with it ([`Moving`]), on the pixels of the grid around its position. Stationary scatterers are
//! smeared there by the motion of the frame.

use glam::DVec3;
use subaperture_focus::Task;
use subaperture_focus::moving::Moving;
use subaperture_model::geometry::{Axis, ImageGrid};
use subaperture_model::image::{Image, power};
use subaperture_model::phase_history::{Channels, Collection, PhaseHistory};
use subaperture_model::track::Displacement;

use crate::balance::Balanced;
use crate::error::GmtiError;
use crate::images::Imaging;
use crate::report::MovingTargets;

/// Least power of the pixels of a target, relative to its peak: -6 dB.
const TARGET: f64 = 0.25;

/// Intervals of the spline of an accelerated motion.
const NODES: usize = 64;

/// Image of a target, a part of the grid.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Chip {
    /// Index of the target.
    pub target: usize,
    /// Row and column of the grid of the first pixel.
    pub first: [usize; 2],
    /// Complex image of channel 0 in the frame of the target, at the time of its position.
    pub image: Image,
}

impl MovingTargets {
    /// Refocus the targets that have a position on the grid and a velocity, on at most `pixels` rows and columns each. `channels` and `imaging` are those of [`crate::find`].
    ///
    /// # Errors
    /// [`GmtiError::Form`].
    pub fn refocus(
        &self,
        channels: &Channels,
        imaging: &Imaging,
        pixels: usize,
    ) -> Result<Vec<Chip>, GmtiError> {
        let history = Balanced::new(channels.channel(0), &self.images.balances[0]);
        let mut chips = Vec::new();
        for (target, about) in self.targets.iter().enumerate() {
            let (Some(position_m), Some(velocity_m_s)) = (about.position_m, about.velocity_m_s)
            else {
                continue;
            };
            let Some((grid, first)) = part(imaging.grid, position_m.into(), pixels) else {
                continue;
            };
            let velocity_m_s = DVec3::from(velocity_m_s);
            let displacement = match about.acceleration_m_s2.map(DVec3::from) {
                Some(rate) if rate != DVec3::ZERO => {
                    accelerated(history.collection(), about.time_s, (velocity_m_s, rate))?
                }
                _ => velocity_m_s.into(),
            };
            let moving = Moving::new(&history, displacement, about.time_s)?;
            let task = Task {
                memory_bytes: imaging.memory_bytes,
                monitor: imaging.monitor,
                numerics: imaging.numerics,
                ..Task::new(&moving, &grid, &self.images.weights[0])
            };
            let image = imaging.former.form(&task)?.image;
            chips.push(Chip {
                target,
                first,
                image,
            });
        }
        Ok(chips)
    }
}

impl Chip {
    /// Put the target into `image`: replace pixels by those of the chip that are stronger, within 6 dB of its peak.
    pub fn put_into(&self, image: &mut Image) {
        let powers = self.image.pixels.iter().map(|pixel| power(*pixel));
        let least = TARGET * powers.fold(0.0, f64::max);
        for row in 0..self.image.rows {
            let own = &self.image.pixels[row * self.image.columns..][..self.image.columns];
            let start = (self.first[0] + row) * image.columns + self.first[1];
            for (pixel, own) in image.pixels[start..].iter_mut().zip(own) {
                if power(*own) > power(*pixel).max(least) {
                    *pixel = *own;
                }
            }
        }
    }
}

/// Displacement of constant acceleration over the pulses of a recording, with the velocity at `epoch_s`.
fn accelerated(
    collection: &Collection,
    epoch_s: f64,
    (velocity_m_s, acceleration_m_s2): (DVec3, DVec3),
) -> Result<Displacement, GmtiError> {
    let ends = [collection.pulses.first(), collection.pulses.last()];
    let [Some(start_s), Some(end_s)] = ends.map(|pulse| pulse.map(|pulse| pulse.time_s)) else {
        return Err(GmtiError::Track("the recording has no pulses"));
    };
    // The spline is straight at its ends: they lie beyond the pulses.
    let margin_s = (end_s - start_s) / 2.0;
    let step_s = (end_s - start_s + 2.0 * margin_s) / NODES as f64;
    let time_s = |i: usize| start_s - margin_s + i as f64 * step_s;
    let times_s: Vec<f64> = (0..=NODES).map(time_s).collect();
    let position = |time_s: &f64| {
        let t = time_s - epoch_s;
        velocity_m_s * t + acceleration_m_s2 * (0.5 * t * t)
    };
    let positions_m: Vec<DVec3> = times_s.iter().map(position).collect();
    Displacement::sampled(times_s, &positions_m)
        .map_err(|_| GmtiError::Track("expected ascending pulse times"))
}

/// Part of a grid of at most `pixels` rows and columns about a position, and its first row and column. `None` if the position is outside.
fn part(grid: &ImageGrid, position_m: DVec3, pixels: usize) -> Option<(ImageGrid, [usize; 2])> {
    let [row, column] = grid.coordinates(position_m);
    let of_axis = |axis: &Axis, value: f64| {
        let pixel = ((value - axis.start) / axis.step).round();
        if !(0.0..axis.count as f64).contains(&pixel) {
            return None;
        }
        let count = pixels.min(axis.count);
        let first = (pixel as usize)
            .saturating_sub(count / 2)
            .min(axis.count - count);
        let start = axis.at(first);
        Some((
            Axis {
                start,
                count,
                ..*axis
            },
            first,
        ))
    };
    let (rows, first_row) = of_axis(&grid.rows, row)?;
    let (columns, first_column) = of_axis(&grid.columns, column)?;
    let part = ImageGrid {
        rows,
        columns,
        ..grid.clone()
    };
    Some((part, [first_row, first_column]))
}
