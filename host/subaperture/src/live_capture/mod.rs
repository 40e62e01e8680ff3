//! The image of a capture, sweep by sweep as it comes.
//!
//! ```text
//! radio::live::Follower ── LiveSweep ──> Imaging: a pulse of each receiver (radio::history) ─> focus::live ── Picture ──> radio::live::Board
//! ```
//!
//! A sweep is a pulse, placed by the track at the device's own times, as a recording of it would be: the image is that of the recording's
//! phase history by [`bp`](crate::focus::bp), within the bound of [`focus::live`](crate::focus::live). Two receivers are summed, each by its own antenna.
//! A sweep of which too little came, or that the track does not know, is left out and counted, as is one
//! of which the error would be above the bound: long sweeps of a radar that moves fast are hard on float32.
//!
//! Where nobody knows the way it is found of the echoes ([`Way::Echoes`], [`targets::live`](crate::targets::live)): a sweep then waits for its place, some twenty sweeps, and is imaged when
//! that is known; the image is in the axes that the body has at first. What is imaged while it moves is not looked at again, and so is not quite as sharp as what
//! [`recover`](crate::targets::recover()) makes of the recording.
//!
//! Cost: a push a sweep and receiver; memory: [`Live::held_bytes`], a pulse, and what waits. `tests/cli/live.rs` holds it against the recording.

mod walk;

use subaperture_focus::live::{Live, LiveError, Settings};
use subaperture_model::geometry::{Extent, ImageGrid, SceneFrame};
use subaperture_model::image::{Image, power};
use subaperture_radio::Antennas;
use subaperture_radio::history::{HistoryError, Placement, Track};
use subaperture_radio::live::{LiveSweep, MOST_PIXELS, Picture};
use subaperture_radio::profile::Sweep;
use subaperture_targets::TargetsError;

use glam::DVec3;

pub use walk::{Echoes, Found};
use walk::{Known, Walk};

/// An image that grows with a capture.
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

/// How the body that carries the antennas moves.
#[derive(Debug)]
pub enum Way {
    /// On a track.
    Track(Track),
    /// As its echoes tell.
    Echoes(Echoes),
}

/// A way, with the antennas on the body that it is of.
enum Places {
    Known(Track, Antennas),
    Found(Box<Walk>),
}

/// Where a capture's antennas are, and which echoes there are.
#[derive(Debug)]
pub struct Place {
    /// How the body that carries them moves.
    pub way: Way,
    /// Where they are on it.
    pub antennas: Antennas,
    /// What phases are referred to, metres; the grid's middle if `None`.
    pub reference_m: Option<DVec3>,
    /// Which receivers sweeps are of, in their order.
    pub receivers: &'static [usize],
    /// Echoes come from no farther, metres.
    pub reach_m: f64,
}

impl Imaging {
    /// An image of no sweeps yet, of sweeps of some carriers.
    ///
    /// # Errors
    /// No pixels or carriers; more memory than the settings allow; places that are no numbers.
    pub fn new(
        grid: &ImageGrid,
        num_carriers: usize,
        place: Place,
        settings: &Settings,
    ) -> Result<Self, ImagingError> {
        // Pulses of as many receivers as there are.
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
            let what = "places of antennas and the reference point are finite numbers";
            return Err(HistoryError::Track(what.to_owned()).into());
        }
        let places = match place.way {
            Way::Track(track) => Places::Known(track, place.antennas),
            Way::Echoes(echoes) => {
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

    /// Adds a sweep, or has it wait for its place. One that is of no use, or whose error would be above the bound, is counted as left out, and the image is as it was.
    pub fn take(&mut self, sweep: &LiveSweep) {
        if sweep.receivers.is_empty() {
            let why = sweep.why.clone();
            self.leave_out(1, why.unwrap_or_else(|| "too little of it came".to_owned()));
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

    /// Images what waits still for its place, when no more come; what has none is left out.
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

    /// Images the sweeps whose place is known by now.
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

    /// The way, where it is found of the echoes.
    pub fn found(&self) -> Option<Found> {
        match &self.places {
            Places::Known(..) => None,
            Places::Found(walk) => Some(walk.found()),
        }
    }

    /// Sweeps that the image has been given.
    pub fn taken(&self) -> u64 {
        self.taken
    }

    /// Sweeps that were left out, and why the last of them.
    pub fn left_out(&self) -> (u64, Option<&str>) {
        (self.left_out, self.why.as_deref())
    }

    /// The image so far.
    pub fn image(&self) -> Image {
        self.live.image()
    }

    /// What is known of its error, and its pixels: [`Live`].
    pub fn live(&self) -> &Live {
        &self.live
    }

    /// The image so far as it is shown: no larger than [`MOST_PIXELS`], each pixel the brightest of those it stands for.
    pub fn picture(&self) -> Picture {
        let (image, grid) = (self.image(), self.live.grid());
        let mut every = 1;
        while image.rows.div_ceil(every) * image.columns.div_ceil(every) > MOST_PIXELS {
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

/// Why a sweep has no place.
const NO_PLACE: &str = "its echoes do not tell where it was taken: two targets at the least have to be seen, in different directions";

/// Adds a sweep of some receivers.
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
    // Receivers are alike: what refuses one refuses the first.
    pulses
        .iter()
        .try_for_each(|(pulse, samples)| live.push(pulse, samples))
        .map_err(|error| error.to_string())
}

/// The part of the scene that a grid's corners enclose; none of a polar one, whose edges are no straight lines.
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

/// Why there is no image of a capture.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImagingError {
    /// The image.
    #[error(transparent)]
    Live(#[from] LiveError),
    /// Where the antennas are.
    #[error(transparent)]
    Place(#[from] HistoryError),
    /// Their way is not to be found of what they hear.
    #[error(transparent)]
    Way(#[from] TargetsError),
}
