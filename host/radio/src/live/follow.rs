//! Assembly of live steps into sweeps, and of sweeps into rows of the board.

use std::collections::VecDeque;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use num_complex::Complex64;
use subaperture_io::atomic::free_bytes;
use subaperture_signal::window::Window;

use super::board::{LiveState, Row, Status};
use super::level::Level;
use super::step::LiveStep;
use crate::plan::Plan;
use crate::profile::{Options, Profile, ProfileError, Ranging, Steps, Sweep};
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

/// Assembler of sweeps from live steps.
pub struct SweepAssembler {
    columns: usize,
    window: Window,
    disk: Option<PathBuf>,
    ranging: Ranging,
    samples: f64,
    rate_hz: f64,
    bytes_a_second: f64,
    fineness: usize,
    empty: Steps,
    /// Index of the current sweep.
    index: Option<u64>,
    steps: Steps,
    taken: Vec<bool>,
    /// Carriers that the plan avoids.
    avoided: Vec<bool>,
    levels: [Vec<Level>; 2],
    flagged: [usize; 5],
    began_s: f64,
    begun_s: VecDeque<f64>,
    asked: Option<Instant>,
    free_bytes: Option<u64>,
    latest: Option<LiveStep>,
}

impl SweepAssembler {
    /// Make a follower and its board, for a plan with the radio parameters `setup` in effect and `bytes_a_second`
    /// written to disk.
    ///
    /// # Errors
    /// If the calibration belongs to another set-up, or the reach exceeds the unambiguous range.
    pub fn new(
        plan: &Plan,
        setup: &Setup,
        bytes_a_second: f64,
        view: View,
    ) -> Result<(Self, LiveState), ProfileError> {
        let calibrated = view.profile.calibration.is_some();
        let ranging = Ranging::new(setup, view.profile)?;
        // At least four columns per resolution cell: the scalloping loss of a peak is at most 0.3 dB.
        let fineness = (2 * view.columns.max(1))
            .div_ceil(setup.steps.max(1))
            .clamp(4, 64);
        let status = Status {
            name: plan.name.clone(),
            steps: setup.steps,
            sweeps: plan.sweeps,
            ranges_m: [0.0, ranging.reach_m()],
            calibrated,
            ..Status::default()
        };
        let avoided: Vec<bool> = (0..setup.steps).map(|n| plan.avoids(n)).collect();
        let follower = Self {
            columns: view.columns,
            window: view.window,
            disk: view.disk,
            ranging,
            samples: setup.samples as f64,
            rate_hz: setup.sample_rate_hz,
            bytes_a_second,
            fineness,
            index: None,
            steps: Steps::empty(setup),
            empty: Steps::empty(setup),
            taken: avoided.clone(),
            avoided,
            levels: Default::default(),
            flagged: [0; 5],
            began_s: 0.0,
            begun_s: VecDeque::with_capacity(RATE_OVER + 1),
            asked: None,
            free_bytes: None,
            latest: None,
        };
        Ok((follower, LiveState::new(status, view.rows)))
    }

    /// Maximum range, metres.
    pub fn reach_m(&self) -> f64 {
        self.ranging.reach_m()
    }

    /// Receivers to which [`LiveSweep::receivers`] belong.
    pub fn receivers(&self) -> &'static [usize] {
        self.ranging.reference().receivers()
    }

    /// Process a step, and return the sweep that it completes, after publishing it on the board.
    pub fn take(&mut self, board: &LiveState, step: &LiveStep) -> Option<LiveSweep> {
        if step.step >= self.taken.len() {
            return None;
        }
        let mut ended = None;
        if self.index.is_some_and(|index| index != step.sweep) {
            ended = self.end(board);
        }
        if self.index.is_none() {
            self.index = Some(step.sweep);
            self.began_s = step.time_s;
        }
        self.taken[step.step] = true;
        if let Some(burst) = step.mixed {
            let middle_s = step.time_s + 0.5 * self.samples / self.rate_hz;
            self.steps.take(step.step, burst, middle_s);
        }
        for (all, level) in self.levels.iter_mut().zip(step.levels) {
            // At most as many as a sweep has steps, whatever arrives.
            if all.len() < self.taken.len() {
                all.push(level);
            }
        }
        for (count, is) in self.flagged.iter_mut().zip(step.flagged) {
            *count += usize::from(is);
        }
        self.latest = Some(*step);
        if self.taken.iter().all(|taken| *taken) {
            ended = self.end(board);
        }
        ended
    }

    /// End the current sweep, if there is one; also used at the end of a capture.
    pub fn end(&mut self, board: &LiveState) -> Option<LiveSweep> {
        let index = self.index.take()?;
        let latest = self.latest?;
        let steps = std::mem::replace(&mut self.steps, self.empty.clone());
        // If the leakage reference cannot be determined, the sweep has no profile.
        let (receivers, why) = match self.ranging.sweeps(&steps) {
            Ok(receivers) => (receivers, None),
            Err(error) => (Vec::new(), Some(error.to_string())),
        };
        let last = receivers.last();
        let reach_m = self.ranging.reach_m();
        let profile =
            last.and_then(|sweep| sweep.profile(self.window, self.fineness, reach_m).ok());
        let row = Row {
            sweep: index,
            levels_db: profile
                .as_ref()
                .map_or_else(Vec::new, |profile| self.reduced(profile)),
        };
        let rate_hz = self.sweeps_a_second();
        self.ask_disk();
        let levels = self.levels.each_ref().map(|all| Level::together(all));
        let change = |status: &mut Status| {
            status.sweep = Some(index);
            status.usable = last.map_or(0, Sweep::usable);
            status.flagged = self.flagged;
            status.levels = levels;
            status.rate_hz = rate_hz;
            status.counts = latest.counts;
            status.free_bytes = self.free_bytes;
            let lasts_s = |bytes: u64| bytes as f64 / self.bytes_a_second;
            status.disk_lasts_s = self.free_bytes.map(lasts_s).filter(|s| s.is_finite());
        };
        board.show_sweep(change, row);
        self.taken.copy_from_slice(&self.avoided);
        self.levels.iter_mut().for_each(Vec::clear);
        self.flagged = [0; 5];
        Some(LiveSweep {
            index,
            receivers,
            why,
            profile,
        })
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

    fn sweeps_a_second(&mut self) -> Option<f64> {
        self.begun_s.push_back(self.began_s);
        if self.begun_s.len() > RATE_OVER + 1 {
            self.begun_s.pop_front();
        }
        let took_s = self.began_s - self.begun_s.front()?;
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
