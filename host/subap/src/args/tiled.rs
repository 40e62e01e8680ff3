//! Options of `subap focus` for images formed in tiles.

use std::path::PathBuf;

use clap::{Args as Group, ValueHint};

/// Options of an image in tiles.
#[derive(Debug, Default, Group)]
#[command(next_help_heading = "Tiles")]
pub(crate) struct Tiled {
    /// Form the image tile by tile into image.zarr instead of image.npy. A killed run can resume, and several processes can
    /// share the work
    #[arg(long, conflicts_with_all = ["from_maps"])]
    pub(crate) tiled: bool,

    /// Resume an ended run with --tiled
    #[arg(long, conflicts_with_all = ["from_maps"])]
    pub(crate) resume: bool,

    /// Execute a plan of subap plan focus; finished tiles are kept
    #[arg(long, value_name = "PLAN", value_hint = ValueHint::FilePath, conflicts_with_all = [
        "from_maps", "allow_error", "beam", "squint", "doppler_band", "doppler_centroid", "antenna_weights", "window", "slow_window", "pixels", "surface", "geoid", "scratch", "portable", "model", "device"
    ])]
    pub(crate) plan: Option<PathBuf>,

    /// Form part I of N of the plan's tiles, such as 3/8. The process that finishes last writes record and picture [default: all tiles]
    #[arg(long, value_name = "I/N", requires = "plan", value_parser = part)]
    pub(crate) tiles: Option<Part>,
}

impl Tiled {
    /// Whether the image is formed in tiles.
    pub(crate) fn wanted(&self) -> bool {
        self.tiled || self.resume || self.plan.is_some()
    }
}

/// One of several parts of the work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Part {
    /// Number of the part, from 1.
    pub(crate) number: usize,
    /// Number of parts.
    pub(crate) count: usize,
}

impl Part {
    /// All of it.
    pub(crate) const WHOLE: Self = Self {
        number: 1,
        count: 1,
    };

    /// Its tiles, of `total`.
    pub(crate) fn of(&self, total: usize) -> std::ops::Range<usize> {
        let edge = |number: usize| (number as u128 * total as u128 / self.count as u128) as usize;
        edge(self.number - 1)..edge(self.number)
    }
}

impl std::fmt::Display for Part {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}/{}", self.number, self.count)
    }
}

fn part(text: &str) -> Result<Part, String> {
    let wrong = || "a part is wanted, as 3/8: which, from 1, of how many".to_owned();
    let (number, count) = text.split_once('/').ok_or_else(wrong)?;
    let read = |text: &str| text.trim().parse::<usize>().map_err(|_| wrong());
    let part = Part {
        number: read(number)?,
        count: read(count)?,
    };
    match (1..=part.count).contains(&part.number) {
        true => Ok(part),
        false => Err(wrong()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_cover_the_whole_once() {
        for total in [0, 1, 7, 8, 100] {
            let mut next = 0;
            for number in 1..=8 {
                let tiles = Part { number, count: 8 }.of(total);
                assert_eq!(tiles.start, next);
                next = tiles.end;
            }
            assert_eq!(next, total);
        }
        assert_eq!(part("3/8").unwrap().to_string(), "3/8");
        for wrong in ["0/8", "9/8", "3", "a/b", "1/0"] {
            assert!(part(wrong).is_err(), "{wrong}");
        }
    }
}
