//! Image of a running capture, updated with each sweep.
//!
//! ```text
//! radio::live::Follower ── LiveSweep ──> Imaging: a pulse of each receiver (radio::history) ─> focus::live ── Picture ──> radio::live::Board
//! ```
//!
//! A sweep is treated as a pulse and placed by the track at the device's own times. The image equals that of the
//! recorded phase history by [`bp`](crate::focus::bp), within the error bound of [`focus::live`](crate::focus::live). Two receivers are summed, each with its
//! own antenna position. A sweep is omitted and counted if it is incomplete, outside the track's time, or would exceed the error bound:
//! long sweeps of a fast radar exceed float32 precision.
//!
//! Without a given track, the track is estimated from the echoes ([`BodyMotion::Echoes`], [`targets::live`](crate::targets::live)). A sweep is then
//! imaged once its position is estimated,
//! about twenty sweeps later, in the initial axes of the body. Imaged sweeps are not revised, so the image is slightly less sharp than that of
//! [`recover`](crate::targets::recover()) on the complete recording.
//!
//! Cost: one push per sweep and receiver. Memory: [`Live::held_bytes`], one pulse, and the waiting sweeps. `tests/cli/live.rs` compares the image
//! with that of the recording.

mod walk;

use subaperture_focus::live::{Live, LiveError, Settings};
use subaperture_model::geometry::{Extent, ImageGrid, SceneFrame};
use subaperture_model::image::{Image, power};
use subaperture_motion::targets::TargetsError;
use subaperture_radio::Antennas;
use subaperture_radio::history::{HistoryError, Placement, Track};
use subaperture_radio::live::{LiveSweep, MAX_PIXELS, Picture};
use subaperture_radio::profile::Sweep;

use glam::DVec3;

pub use walk::{EchoTrack, Echoes};
use walk::{Known, Walk};

/// Image of a capture in progress.
pub struct Imaging {
    live: Live,
    places: Places,
    reference_m: DVec3,
    extent: Option<Extent>,
    receivers: &'static [usize],
    reach_m: f64,
    taken: u64,
    left_out: u64,
    why: Option<String>,
}

/// Motion of the body that carries the antennas.
#[derive(Debug)]
pub enum BodyMotion {
    /// Motion on a given track.
    Track(Track),
    /// Motion estimated from the echoes.
    Echoes(Echoes),
}

/// Track with the antennas on the body it describes.
enum Places {
    Known(Track, Antennas),
    Found(Box<Walk>),
}

/// Positions of a capture's antennas, and its receivers.
#[derive(Debug)]
pub struct CaptureGeometry {
    /// Motion of the body that carries the antennas.
    pub motion: BodyMotion,
    /// Positions of the antennas on the body.
    pub antennas: Antennas,
    /// Position to which phases are referred, metres; `None` for the grid's centre.
    pub reference_m: Option<DVec3>,
    /// Indices of the receivers in a sweep, in order.
    pub receivers: &'static [usize],
    /// Maximum range of echoes, metres.
    pub reach_m: f64,
}

impl Imaging {
    /// Start an image without sweeps, for sweeps of `carriers` frequencies.
    ///
    /// # Errors
    /// No pixels or carriers; more memory than the settings allow; positions that are not finite.
    pub fn new(
        grid: &ImageGrid,
        num_carriers: usize,
        place: CaptureGeometry,
        settings: &Settings,
    ) -> Result<Self, ImagingError> {
        // One pulse per receiver.
        let mut settings = *settings;
        settings.last_pulses = settings
            .last_pulses
            .map(|sweeps| sweeps.saturating_mul(place.receivers.len()));
        let live = Live::new(grid, num_carriers, &settings)?;
        let (rows, columns) = (grid.rows.count, grid.columns.count);
        let reference_m = place
            .reference_m
            .unwrap_or_else(|| grid.position_m(rows / 2, columns / 2));
        if !(place.antennas.is_finite() && reference_m.is_finite()) {
            let fault = "expected finite positions of antennas and reference point";
            return Err(HistoryError::Track(fault.to_owned()).into());
        }
        let places = match place.motion {
            BodyMotion::Track(track) => Places::Known(track, place.antennas),
            BodyMotion::Echoes(echoes) => {
                let (receivers, reach_m) = (place.receivers, place.reach_m);
                let walk = Walk::new(&echoes, place.antennas, receivers, reference_m, reach_m)?;
                Places::Found(Box::new(walk))
            }
        };
        Ok(Self {
            live,
            places,
            reference_m,
            extent: extent(grid),
            receivers: place.receivers,
            reach_m: place.reach_m,
            taken: 0,
            left_out: 0,
            why: None,
        })
    }

    /// Add a sweep, or queue it until its position is known. An unusable sweep, or one that would exceed the error bound, is counted as omitted and
    /// leaves the image unchanged.
    pub fn take(&mut self, sweep: &LiveSweep) {
        if sweep.receivers.is_empty() {
            let why = sweep.why.clone();
            self.leave_out(
                1,
                why.unwrap_or_else(|| "the sweep is incomplete".to_owned()),
            );
            return;
        }
        match &mut self.places {
            Places::Known(track, antennas) => {
                let placement = Placement {
                    track: Some(track),
                    antennas: Some(*antennas),
                    reference_m: self.reference_m,
                    extent: self.extent,
                    frame: SceneFrame::Local,
                };
                let done = push(
                    &mut self.live,
                    &placement,
                    self.receivers,
                    self.reach_m,
                    &sweep.receivers,
                );
                self.count(done);
            }
            Places::Found(walk) => {
                match walk.take(&sweep.receivers) {
                    Ok(0) => {}
                    Ok(given_up) => self.leave_out(given_up, NO_PLACE.to_owned()),
                    Err(error) => self.leave_out(1, error.to_string()),
                }
                self.image_known(false);
            }
        }
    }

    /// Image the queued sweeps at the end of the capture. Sweeps without a position are omitted.
    pub fn finish(&mut self) {
        let Places::Found(walk) = &mut self.places else {
            return;
        };
        walk.finish();
        self.image_known(true);
        let Places::Found(walk) = &mut self.places else {
            return;
        };
        let without = walk.give_up();
        if without > 0 {
            self.leave_out(without, NO_PLACE.to_owned());
        }
    }

    /// Image the sweeps whose positions are known.
    fn image_known(&mut self, no_more_come: bool) {
        let Places::Found(walk) = &mut self.places else {
            return;
        };
        let antennas = walk.antennas();
        let Known { track, sweeps } = match walk.known(no_more_come) {
            Ok(Some(known)) => known,
            Ok(None) => return,
            Err(error) => return self.leave_out(1, error.to_string()),
        };
        let placement = Placement {
            track: Some(&track),
            antennas: Some(antennas),
            reference_m: self.reference_m,
            extent: self.extent,
            frame: SceneFrame::Local,
        };
        for sweep in sweeps {
            let (live, receivers) = (&mut self.live, self.receivers);
            let done = push(live, &placement, receivers, self.reach_m, &sweep);
            self.count(done);
        }
    }

    fn count(&mut self, done: Result<(), String>) {
        match done {
            Ok(()) => self.taken += 1,
            Err(why) => self.leave_out(1, why),
        }
    }

    fn leave_out(&mut self, sweeps: u64, why: String) {
        self.left_out += sweeps;
        self.why = Some(why);
    }

    /// Estimated track, if the track is estimated from the echoes.
    pub fn found(&self) -> Option<EchoTrack> {
        match &self.places {
            Places::Known(..) => None,
            Places::Found(walk) => Some(walk.found()),
        }
    }

    /// Number of sweeps in the image.
    pub fn taken(&self) -> u64 {
        self.taken
    }

    /// Number of omitted sweeps, and the reason for the last omission.
    pub fn left_out(&self) -> (u64, Option<&str>) {
        (self.left_out, self.why.as_deref())
    }

    /// Current image.
    pub fn image(&self) -> Image {
        self.live.image()
    }

    /// State of the live former: pixels and error.
    pub fn live(&self) -> &Live {
        &self.live
    }

    /// Current image for display, at most [`MAX_PIXELS`]; each pixel is the brightest of those it represents.
    pub fn picture(&self) -> Picture {
        let (image, grid) = (self.image(), self.live.grid());
        let mut every = 1;
        while image.rows.div_ceil(every) * image.columns.div_ceil(every) > MAX_PIXELS {
            every += 1;
        }
        let (rows, columns) = (image.rows.div_ceil(every), image.columns.div_ceil(every));
        let mut brightest = vec![0f32; rows * columns];
        for (i, z) in image.pixels.iter().enumerate() {
            let [row, column] = [i / image.columns, i % image.columns];
            let here = &mut brightest[row / every * columns + column / every];
            *here = here.max(power(*z) as f32);
        }
        let ends = |axis: &crate::geometry::Axis| [axis.at(0), axis.at(axis.count - 1)];
        Picture {
            columns,
            x_m: ends(&grid.columns),
            y_m: ends(&grid.rows),
            levels_db: brightest
                .iter()
                .map(|power| 10.0 * libm::log10f(*power))
                .collect(),
            pulses: self.live.num_pulses() as u64,
        }
    }
}

/// Reason for leaving out a sweep without a position.
const NO_PLACE: &str = "its position cannot be estimated: expected at least two detected targets in different directions";

/// Add a sweep of all receivers.
fn push(
    live: &mut Live,
    placement: &Placement,
    receivers: &[usize],
    reach_m: f64,
    of_receivers: &[Sweep],
) -> Result<(), String> {
    let each = receivers.iter().zip(of_receivers);
    let pulses: Result<Vec<_>, HistoryError> = each
        .map(|(&receiver, sweep)| placement.pulse(sweep, receiver, reach_m))
        .collect();
    let pulses = pulses.map_err(|error| error.to_string())?;
    // A sweep refused for one receiver is refused for the first, because all have the same geometry.
    pulses
        .iter()
        .try_for_each(|(pulse, samples)| live.push(pulse, samples))
        .map_err(|error| error.to_string())
}

/// Extent enclosed by the corners of a grid; `None` for a polar grid, whose edges are curved.
fn extent(grid: &ImageGrid) -> Option<Extent> {
    if grid.polar {
        return None;
    }
    let (rows, columns) = (grid.rows.count, grid.columns.count);
    let corners = [
        (0, 0),
        (0, columns - 1),
        (rows - 1, 0),
        (rows - 1, columns - 1),
    ];
    let corners = corners.map(|(row, column)| grid.position_m(row, column));
    let ends = |of: fn(&DVec3) -> f64| {
        let all = corners.iter().map(of);
        let least = all.clone().fold(f64::INFINITY, f64::min);
        (least, all.fold(f64::NEG_INFINITY, f64::max))
    };
    Some(Extent {
        x_m: ends(|corner| corner.x),
        y_m: ends(|corner| corner.y),
    })
}

/// Error of imaging a capture.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImagingError {
    /// Error of the image.
    #[error(transparent)]
    Live(#[from] LiveError),
    /// Error of the antenna positions.
    #[error(transparent)]
    Place(#[from] HistoryError),
    /// Error of the track estimation from echoes.
    #[error(transparent)]
    BodyMotion(#[from] TargetsError),
}
