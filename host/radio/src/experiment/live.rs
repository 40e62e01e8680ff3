//! Live imaging during a capture (`[live]`): image grid, and motion of the antennas.

use std::path::{Path, PathBuf};

use glam::DVec3;
use subaperture_describe::declare::{Located, section};
use subaperture_describe::error::Fault;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::track::Linear;

use crate::antennas::Reference;
use crate::history::{HistoryError, Track};

/// Live image, and motion of the antennas.
#[derive(Clone, Debug, PartialEq)]
pub struct Live {
    /// Grid of the live image.
    pub grid: ImageGrid,
    /// Motion of the body that carries the antennas.
    pub motion: BodyMotion,
    /// Motion compensation reference point, metres; `None` for the middle of the grid.
    pub reference_m: Option<DVec3>,
    /// Number of latest sweeps in the image; `None` for all.
    pub last: Option<usize>,
}

/// Motion of the body that carries the antennas.
#[derive(Clone, Debug, PartialEq)]
pub enum BodyMotion {
    /// Track file, and the device time of the track's time 0, seconds.
    File(PathBuf, f64),
    /// Constant velocity, as on a rail.
    Rail {
        /// Position at `at_s`, metres in the scene frame.
        position_m: DVec3,
        /// Velocity, metres per second.
        velocity_m_s: DVec3,
        /// Device time of the position, seconds.
        at_s: f64,
    },
    /// Estimated from the echoes, starting at a given position; the body axes are initially those of the scene.
    Echoes {
        /// Start position, metres in the scene frame.
        start_m: DVec3,
    },
}

impl BodyMotion {
    /// Make the track.
    ///
    /// # Errors
    /// If the track file cannot be read or is invalid; if the track is to be estimated from the echoes.
    pub fn track(&self) -> Result<Track, HistoryError> {
        match self {
            Self::File(path, zero_s) => Track::read(path, *zero_s),
            Self::Rail {
                position_m,
                velocity_m_s,
                at_s,
            } => Ok(Track {
                poses: Box::new(Linear {
                    position_m: *position_m,
                    velocity_m_s: *velocity_m_s,
                    at_s: 0.0,
                }),
                span_s: (f64::NEG_INFINITY, f64::INFINITY),
                zero_s: *at_s,
            }),
            Self::Echoes { .. } => Err(HistoryError::Track(
                "the track is estimated from the echoes: it is not known before the capture"
                    .to_owned(),
            )),
        }
    }
}

/// Live imaging during a capture: image grid, and motion of the antennas from a file, on a rail, or estimated from the echoes.
#[section]
pub(super) struct LiveKeys {
    /// Image grid in metres of the scene frame: x and y, each as start:stop:step.
    #[key(required = "x=-3:3:0.05,y=2:8:0.05")]
    grid: Located<String>,
    /// Track file (CSV): time, position, attitude of the body. Alternative: position and velocity.
    #[key(example = "track.csv")]
    track: Located<Option<PathBuf>>,
    /// Position of the body at the time zero. With echoes: start position, default the origin.
    #[key(example = "-2.5, 0, 1 m")]
    position_m: Option<DVec3>,
    /// Velocity of the body. The body's x axis, to which the antenna positions refer, points along it.
    #[key(example = "0.1, 0, 0 m/s")]
    velocity_m_s: Option<DVec3>,
    /// Estimate the track from the echoes of two receivers (MPGA), with the leakage as the reference; x is initially forward. At least two
    /// reflectors must be visible, with at least one sweep per quarter wavelength of travel.
    #[key(default = false)]
    echoes: Located<bool>,
    /// Device time of the track's time 0, or at which the body is at its position.
    #[key(default = "0 s")]
    zero_s: f64,
    /// Motion compensation reference point; default: the middle of the grid.
    #[key(example = "0, 5, 0 m")]
    reference_m: Option<DVec3>,
    /// Number of latest sweeps in the image; default: all.
    #[key(example = 200, whole(1, 1 << 20))]
    last: Option<usize>,
}

impl LiveKeys {
    pub(super) fn build(self, folder: &Path, reference: Reference) -> Result<Live, Fault> {
        let parsed = self.grid.parse();
        let grid: ImageGrid = parsed.map_err(|error| self.grid.fault(format!("{error}")))?;
        if grid.polar {
            let what = "expected a Cartesian grid: give x and y, in metres";
            return Err(self.grid.fault(what));
        }
        if *self.echoes && reference != Reference::Leakage {
            let what = "estimating the track from echoes needs two receivers: set plan.reference is \"leakage\" and their positions in [antennas]";
            return Err(self.echoes.fault(what));
        }
        let motion = match (&*self.track, self.position_m, self.velocity_m_s) {
            (None, start_m, None) if *self.echoes => BodyMotion::Echoes {
                start_m: start_m.unwrap_or_default(),
            },
            (Some(file), None, None) if !*self.echoes => {
                BodyMotion::File(folder.join(file), self.zero_s)
            }
            (None, Some(position_m), Some(velocity_m_s)) if !*self.echoes => BodyMotion::Rail {
                position_m,
                velocity_m_s,
                at_s: self.zero_s,
            },
            _ => {
                let what = "expected one kind of motion: a track, or position and velocity, or echoes = true";
                return Err(self.track.fault(what));
            }
        };
        Ok(Live {
            grid,
            motion,
            reference_m: self.reference_m,
            last: self.last,
        })
    }
}
