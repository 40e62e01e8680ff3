//! Pixels whose delays lie within the recorded interval of delays.
//!
//! Samples at frequencies `step` apart repeat in delay: a profile holds paths, relative to the pulse's reference path, over an interval of `c / step`.
//! A pulse covers a pixel if its path lies within this interval about the reference path:
//!
//! ```text
//! |path_n(p) - reference_path_n| <= c / (2 step_n)
//! ```
//!
//! A pixel that a pulse does not cover receives echoes of other ranges from it. [`Coverage`] counts such pixels. Raw echoes with a reference path of 0 do
//! not state where their interval lies: the radar chooses it, by a range gate for example.
//!
//! **Cost.** Some 500 000 paths, whatever the size of grid and recording.

use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::{Collection, Pulse};

/// Largest number of rows, of columns and of pulses that are sampled.
const NODES: usize = 129;
const PULSES: usize = 33;

/// Shares of a grid's pixels that pulses do not cover, from 0 to 1. Shares are those of up to 129 rows, 129 columns and 33 pulses spread evenly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coverage {
    /// Pixels that no pulse covers.
    pub none: f64,
    /// Pixels that some pulses cover and others do not.
    pub part: f64,
}

impl Coverage {
    /// Coverage of `grid` by the pulses of `collection`; `None` for raw echoes, whose interval of delays is not stated.
    pub fn of(collection: &Collection, grid: &ImageGrid) -> Option<Self> {
        let all = &collection.pulses;
        let is_raw = |pulse: &Pulse| pulse.reference_path_m == 0.0;
        if all.is_empty() || all.iter().any(is_raw) {
            return None;
        }
        let pulses: Vec<&Pulse> = spread(all.len(), PULSES).map(|n| &all[n]).collect();
        let (mut none, mut part, mut count) = (0, 0, 0);
        for row in spread(grid.rows.count, NODES) {
            for column in spread(grid.columns.count, NODES) {
                let place_m = grid.position_m(row, column);
                let covering = pulses
                    .iter()
                    .filter(|pulse| excess_m(pulse, place_m) <= 0.0)
                    .count();
                count += 1;
                none += usize::from(covering == 0);
                part += usize::from(covering > 0 && covering < pulses.len());
            }
        }
        let share = |pixels: usize| pixels as f64 / count as f64;
        Some(Self {
            none: share(none),
            part: share(part),
        })
    }

    /// Warning of pixels that pulses do not cover; `None` if all pulses cover all pixels.
    pub fn warning(&self) -> Option<String> {
        let percent = |share: f64| format!("{:.1} %", 100.0 * share);
        (self.none + self.part > 0.0).then(|| {
            format!(
                "image: {} of the pixels lie outside the recorded interval of ranges in all pulses, and {} in some: echoes of other ranges appear there",
                percent(self.none),
                percent(self.part)
            )
        })
    }
}

/// Path beyond the end of a pulse's interval, metres; negative within.
fn excess_m(pulse: &Pulse, place_m: glam::DVec3) -> f64 {
    pulse.relative_path_m(place_m).abs() - 0.5 * SPEED_OF_LIGHT_M_S / pulse.step_hz
}

/// Up to `most` numbers below `count`, evenly, the first and the last among them.
fn spread(count: usize, most: usize) -> impl Iterator<Item = usize> {
    let nodes = count.min(most);
    (0..nodes).map(move |i| i * (count - 1) / (nodes - 1).max(1))
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use subaperture_model::geometry::SceneFrame;
    use subaperture_model::phase_history::Sweep;

    use super::*;

    /// A radar 10 km from the reference whose profiles hold 100 m of path: 50 m of range.
    fn collection(reference_path_m: f64) -> Collection {
        let pulses = (0..50).map(|n| {
            let antenna_m = DVec3::new(0.1 * f64::from(n), -10_000.0, 0.0);
            Pulse {
                transmitter_m: antenna_m,
                receiver_m: antenna_m,
                reference_m: DVec3::ZERO,
                reference_path_m,
                start_hz: 1e10,
                step_hz: SPEED_OF_LIGHT_M_S / 100.0,
                time_s: f64::from(n),
                sweep: Sweep::AT_ONCE,
            }
        });
        Collection {
            name: "strip".to_owned(),
            frame: SceneFrame::Local,
            pulses: pulses.collect(),
            num_samples: 8,
            timed: true,
            extent: None,
        }
    }

    #[test]
    fn pixels_beyond_the_recorded_interval_are_counted() {
        let coverage = |grid: &str| {
            let grid: ImageGrid = grid.parse().unwrap();
            Coverage::of(&collection(20_000.0), &grid).unwrap()
        };
        let within = coverage("x=-5:5:1,y=-24:24:1");
        assert_eq!((within.none, within.part), (0.0, 0.0));
        assert_eq!(within.warning(), None);
        // 100 rows at -49.5 to 49.5 m. Those from -24.5 to 24.5 m are covered.
        let wide = coverage("x=0:1:1,y=-49.5:50:1");
        assert!((wide.none - 50.0 / 100.0).abs() < 1e-12, "{wide:?}");
        let outside = coverage("x=-5:5:1,y=60:80:1");
        assert_eq!(outside.none, 1.0);
        let grid: ImageGrid = "x=-5:5:1,y=60:80:1".parse().unwrap();
        assert_eq!(Coverage::of(&collection(0.0), &grid), None);
    }
}
