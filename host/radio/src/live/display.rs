//! Profiles, rows of the board and rates from finished sweeps.

use std::collections::VecDeque;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use num_complex::Complex64;
use subaperture_io::atomic::free_bytes;
use subaperture_signal::window::Window;

use super::board::{LiveState, Row, Status};
use super::level::Level;
use super::step::Counts;
use crate::profile::{Options, Profile, ProfileError, Ranging, Sweep};
use crate::sigmf::Setup;

/// Number of sweeps over which the sweep rate is averaged.
const RATE_OVER: usize = 16;
/// Interval between queries of the free disk space.
const DISK_EVERY: Duration = Duration::from_secs(1);
/// Lowest level of a displayed profile, dB; below the rounding error of float64.
const FLOOR_DB: f32 = -300.0;

/// Display options of a running capture.
#[derive(Clone, Debug)]
pub struct View {
    /// Rows of the waterfall, in sweeps.
    pub rows: usize,
    /// Maximum number of columns of a row.
    pub columns: usize,
    /// Window function over the carriers.
    pub window: Window,
    /// Phase reference, maximum range and calibration.
    pub profile: Options,
    /// File on the disk that holds the recording, for its free space; `None` to skip this.
    pub disk: Option<PathBuf>,
}

impl Default for View {
    /// 256 sweeps of 512 columns, Taylor window with -35 dB sidelobes, no calibration.
    fn default() -> Self {
        Self {
            rows: 256,
            columns: 512,
            window: Window::default(),
            profile: Options::default(),
            disk: None,
        }
    }
}

/// Sweep of a running capture, divided by its reference and calibrated if a calibration is given.
#[derive(Clone, Debug)]
pub struct LiveSweep {
    /// Index of the sweep.
    pub index: u64,
    /// Response of each receiver that has an antenna; empty if the received data do not determine it.
    pub receivers: Vec<Sweep>,
    /// Reason why `receivers` is empty.
    pub why: Option<String>,
    /// Range profile of the last receiver; `None` if too few carriers were received.
    pub profile: Option<Profile>,
}

/// Display of finished sweeps on a board.
pub(super) struct Display {
    columns: usize,
    window: Window,
    disk: Option<PathBuf>,
    pub(super) ranging: Ranging,
    bytes_a_second: f64,
    fineness: usize,
    begun_s: VecDeque<f64>,
    asked: Option<Instant>,
    free_bytes: Option<u64>,
}

/// State of the capture at the end of a sweep.
pub(super) struct Finished {
    pub(super) index: u64,
    /// Device time of its start, seconds.
    pub(super) began_s: f64,
    pub(super) flagged: [usize; 5],
    pub(super) levels: [Level; 2],
    pub(super) counts: Counts,
}

impl Display {
    /// Make a display and its board, for `sweeps` sweeps of a set-up with the name and `bytes_a_second` written to disk.
    ///
    /// # Errors
    /// If the calibration belongs to another set-up, or the reach exceeds the unambiguous range.
    pub(super) fn new(
        (name, sweeps): (&str, u64),
        setup: &Setup,
        bytes_a_second: f64,
        view: View,
    ) -> Result<(Self, LiveState), ProfileError> {
        let calibrated = view.profile.calibration.is_some();
        let ranging = Ranging::new(setup, view.profile)?;
        let carriers = setup.band().count;
        // At least four columns per resolution cell: the scalloping loss of a peak is at most 0.3 dB.
        let fineness = (2 * view.columns.max(1))
            .div_ceil(carriers.max(1))
            .clamp(4, 64);
        let status = Status {
            name: name.to_owned(),
            steps: carriers,
            sweeps,
            ranges_m: [0.0, ranging.reach_m()],
            calibrated,
            ..Status::default()
        };
        let display = Self {
            columns: view.columns,
            window: view.window,
            disk: view.disk,
            ranging,
            bytes_a_second,
            fineness,
            begun_s: VecDeque::with_capacity(RATE_OVER + 1),
            asked: None,
            free_bytes: None,
        };
        Ok((display, LiveState::new(status, view.rows)))
    }

    /// Publish a sweep on the board.
    pub(super) fn show(
        &mut self,
        board: &LiveState,
        finished: &Finished,
        responses: Result<Vec<Sweep>, ProfileError>,
    ) -> LiveSweep {
        // If the leakage reference cannot be determined, the sweep has no profile.
        let (receivers, why) = match responses {
            Ok(receivers) => (receivers, None),
            Err(error) => (Vec::new(), Some(error.to_string())),
        };
        let last = receivers.last();
        let reach_m = self.ranging.reach_m();
        let profile =
            last.and_then(|sweep| sweep.profile(self.window, self.fineness, reach_m).ok());
        let row = Row {
            sweep: finished.index,
            levels_db: profile
                .as_ref()
                .map_or_else(Vec::new, |profile| self.reduced(profile)),
        };
        let rate_hz = self.sweeps_a_second(finished.began_s);
        self.ask_disk();
        let change = |status: &mut Status| {
            status.sweep = Some(finished.index);
            status.usable = last.map_or(0, Sweep::usable);
            status.flagged = finished.flagged;
            status.levels = finished.levels;
            status.rate_hz = rate_hz;
            status.counts = finished.counts;
            status.free_bytes = self.free_bytes;
            let lasts_s = |bytes: u64| bytes as f64 / self.bytes_a_second;
            status.disk_lasts_s = self.free_bytes.map(lasts_s).filter(|s| s.is_finite());
        };
        board.show_sweep(change, row);
        LiveSweep {
            index: finished.index,
            receivers,
            why,
            profile,
        }
    }

    /// Reduce a profile to at most the configured number of columns from range 0 to the reach; each column is the
    /// maximum over its nearest samples.
    fn reduced(&self, profile: &Profile) -> Vec<f32> {
        let reach_m = self.ranging.reach_m();
        let last = (reach_m / profile.spacing_m).floor() as usize;
        let count = (last + 1).min(profile.values.len());
        let columns = self.columns.clamp(2, count.max(2));
        let mut largest = vec![0.0f64; columns];
        for (i, value) in profile.values[..count].iter().enumerate() {
            let range_m = i as f64 * profile.spacing_m;
            let place = (range_m / reach_m * (columns - 1) as f64).round() as usize;
            let here = &mut largest[place.min(columns - 1)];
            *here = here.max(Complex64::norm_sqr(value));
        }
        let level = |power: &f64| ((10.0 * libm::log10(*power)) as f32).max(FLOOR_DB);
        largest.iter().map(level).collect()
    }

    fn sweeps_a_second(&mut self, began_s: f64) -> Option<f64> {
        self.begun_s.push_back(began_s);
        if self.begun_s.len() > RATE_OVER + 1 {
            self.begun_s.pop_front();
        }
        let took_s = began_s - self.begun_s.front()?;
        (took_s > 0.0).then(|| (self.begun_s.len() - 1) as f64 / took_s)
    }

    fn ask_disk(&mut self) {
        let Some(disk) = &self.disk else { return };
        if self.asked.is_none_or(|asked| asked.elapsed() >= DISK_EVERY) {
            self.free_bytes = free_bytes(disk);
            self.asked = Some(Instant::now());
        }
    }
}
