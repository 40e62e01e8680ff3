//! Queue of sweeps whose positions are estimated from their echoes with a delay.

use std::collections::VecDeque;

use glam::DVec3;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::SceneFrame;
use subaperture_model::phase_history::{Band, Pulse, Sweep as AtOnce};
use subaperture_model::track::{Fix, SampledTrack};
use subaperture_motion::targets::cfar::{Cfar, Level};
use subaperture_motion::targets::live::{Going, Live};
use subaperture_motion::targets::{Settings, TargetsError};
use subaperture_radio::Antennas;
use subaperture_radio::history::{HistoryError, Placement, Track};
use subaperture_radio::profile::Sweep;

/// Settings of track estimation from the echoes.
#[derive(Clone, Debug)]
pub struct Echoes {
    /// Frequencies of a sweep, including the offset of the tone.
    pub band: Band,
    /// Settings of target detection.
    pub settings: Settings,
    /// Initial position of the body, metres; its initial axes are the scene's.
    pub start_m: DVec3,
}

impl Echoes {
    /// Settings for a stepped-frequency radar with a maximum range of `reach_m`. Its range profiles have tens of cells: training cells are few and up to half of them
    /// may contain other targets; the first three cells contain leakage.
    pub fn new(band: Band, reach_m: f64, start_m: DVec3) -> Self {
        let cell_m = 0.5 * SPEED_OF_LIGHT_M_S / band.bandwidth_hz();
        let settings = Settings {
            ranges_m: Some((3.0 * cell_m, reach_m)),
            cfar: Cfar {
                guard: 2,
                training: 8,
                level: Level::Ordered(0.45),
                ..Cfar::default()
            },
            ..Settings::default()
        };
        Self {
            band,
            settings,
            start_m,
        }
    }
}

/// Track estimated from the echoes so far.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EchoTrack {
    /// Length of the estimated track, metres.
    pub length_m: f64,
    /// Number of sweeps queued without a position.
    pub waiting: u64,
    /// Quality of the estimate.
    pub going: Going,
}

/// Maximum number of sweeps queued beyond the estimation lag. Sweeps without detected targets have no position until targets are detected.
const MAX_BLIND: usize = 64;
/// Number of fixes kept before those of the queue: a spline's dependence on a knot falls by a factor of a thousand for every five knots.
const FIXES_BEFORE: usize = 10;

/// Track estimation with the queue of sweeps. A sweep's fix is in its middle; half a sweep before the first and after the last one the body
/// moves on at constant velocity.
pub(super) struct Walk {
    live: Live,
    /// Antennas of the plan, and on the located body.
    antennas: [Antennas; 2],
    receivers: &'static [usize],
    start_m: DVec3,
    /// Reference point in the initial axes of the body, metres.
    reference_m: DVec3,
    reach_m: f64,
    waiting: VecDeque<Waiting>,
    pushed: usize,
    fixes: VecDeque<Fix>,
    /// Times of the first and the last sample of the sweep of the last fix, seconds.
    last_span_s: [f64; 2],
    length_m: f64,
}

struct Waiting {
    pulse: usize,
    time_s: f64,
    /// Times of the first and the last sample, seconds.
    span_s: [f64; 2],
    of_receivers: Vec<Sweep>,
}

/// Sweeps whose positions are known.
pub(super) struct Known {
    pub(super) track: Track,
    pub(super) sweeps: Vec<Vec<Sweep>>,
}

impl Walk {
    pub(super) fn new(
        echoes: &Echoes,
        antennas: Antennas,
        receivers: &'static [usize],
        reference_m: DVec3,
        reach_m: f64,
    ) -> Result<Self, TargetsError> {
        let reference_m = reference_m - echoes.start_m;
        let first = |receiver: &usize| {
            let [transmitter_m, receiver_m] =
                [antennas.transmitter_m, antennas.receivers_m[*receiver]];
            Pulse {
                time_s: 0.0,
                transmitter_m,
                receiver_m,
                reference_m,
                reference_path_m: transmitter_m.distance(reference_m)
                    + receiver_m.distance(reference_m),
                start_hz: echoes.band.start_hz,
                step_hz: echoes.band.step_hz,
                sweep: AtOnce::AT_ONCE,
                recorded_path_m: None,
            }
        };
        let first: Vec<Pulse> = receivers.iter().map(first).collect();
        let live = Live::new(&first, echoes.band.count, &echoes.settings)?;
        let own = live.arrangement();
        // An array needs at least two receivers, so these are both receivers of the radio in order.
        let located = Antennas {
            transmitter_m: own.transmitters_m[0],
            receivers_m: [0, 1].map(|i| own.receivers_m[own.of_channels[i][1]]),
        };
        Ok(Self {
            live,
            antennas: [antennas, located],
            receivers,
            start_m: echoes.start_m,
            reference_m,
            reach_m,
            waiting: VecDeque::new(),
            pushed: 0,
            fixes: VecDeque::new(),
            last_span_s: [0.0; 2],
            length_m: 0.0,
        })
    }

    /// Antennas on the body that the tracks of [`Known`] describe.
    pub(super) fn antennas(&self) -> Antennas {
        self.antennas[1]
    }

    /// Track estimated so far.
    pub(super) fn found(&self) -> EchoTrack {
        EchoTrack {
            length_m: self.length_m,
            waiting: self.waiting.len() as u64,
            going: self.live.going(),
        }
    }

    /// Queue a sweep. Returns the number of sweeps given up because they had no position for too long.
    pub(super) fn take(&mut self, of_receivers: &[Sweep]) -> Result<u64, HistoryError> {
        let standing = Placement {
            track: None,
            antennas: Some(self.antennas[0]),
            reference_m: self.reference_m,
            extent: None,
            frame: SceneFrame::Local,
        };
        let each = self.receivers.iter().zip(of_receivers);
        let pulses: Result<Vec<_>, HistoryError> = each
            .map(|(&receiver, sweep)| standing.pulse(sweep, receiver, self.reach_m))
            .collect();
        let pulses = pulses?;
        let moments = of_receivers.iter().flat_map(Sweep::moments);
        let span_s = moments.fold(
            [f64::INFINITY, f64::NEG_INFINITY],
            |[first_s, last_s], (_, at_s)| [first_s.min(at_s), last_s.max(at_s)],
        );
        self.waiting.push_back(Waiting {
            pulse: self.pushed,
            time_s: pulses[0].0.time_s,
            span_s,
            of_receivers: of_receivers.to_vec(),
        });
        self.pushed += 1;
        for located in self.live.push(&pulses) {
            self.learn(located.pulse, located.position_m, located.attitude);
        }
        let most = self.live.lag() + MAX_BLIND;
        let given_up = self.waiting.len().saturating_sub(most);
        self.waiting.drain(..given_up);
        Ok(given_up as u64)
    }

    /// Finish the estimation at the end of the capture.
    pub(super) fn finish(&mut self) {
        for located in self.live.finish() {
            self.learn(located.pulse, located.position_m, located.attitude);
        }
        if let [.., before, last] = self.fixes.make_contiguous() {
            let beyond = moved_on([before, last], self.last_span_s[1]);
            self.fixes.extend(beyond);
        }
    }

    fn learn(&mut self, pulse: usize, position_m: DVec3, attitude: glam::DQuat) {
        let Some(own) = self.waiting.iter().find(|own| own.pulse == pulse) else {
            return;
        };
        let last = self.fixes.back();
        if last.is_some_and(|last| last.time_s >= own.time_s) {
            return;
        }
        let fix = Fix {
            time_s: own.time_s,
            position_m: self.start_m + position_m,
            attitude: Some(attitude),
        };
        self.length_m += last.map_or(0.0, |last| last.position_m.distance(fix.position_m));
        if let (1, Some(first)) = (self.fixes.len(), last) {
            let before = moved_on([&fix, first], self.last_span_s[0]);
            self.fixes = before.into_iter().chain([*first]).collect();
        }
        self.last_span_s = own.span_s;
        self.fixes.push_back(fix);
        if self.fixes.len() > self.live.lag() + FIXES_BEFORE {
            self.fixes.pop_front();
        }
    }

    /// Sweeps that end before the last fix but one (at the end of the capture, the last): later parts of a spline may still change.
    pub(super) fn known(&mut self, no_more_come: bool) -> Result<Option<Known>, HistoryError> {
        let beyond = if no_more_come { 1 } else { 2 };
        let until = self.fixes.len().checked_sub(beyond);
        let (Some(until), true) = (until, self.fixes.len() > 1) else {
            return Ok(None);
        };
        let until_s = self.fixes[until].time_s;
        let count = self.waiting.partition_point(|own| own.span_s[1] <= until_s);
        if count == 0 {
            return Ok(None);
        }
        let sweeps = self.waiting.drain(..count).map(|own| own.of_receivers);
        let sweeps = sweeps.collect();
        let fixes = self.fixes.make_contiguous();
        let poses =
            SampledTrack::new(fixes).map_err(|error| HistoryError::Track(error.to_string()))?;
        let track = Track {
            poses: Box::new(poses),
            span_s: (fixes[0].time_s, fixes[fixes.len() - 1].time_s),
            zero_s: 0.0,
        };
        Ok(Some(Known { track, sweeps }))
    }

    /// Discard the queue. Returns the number of sweeps discarded.
    pub(super) fn give_up(&mut self) -> u64 {
        self.waiting.drain(..).count() as u64
    }
}

/// Fix at a time beyond the `near` fix, at its attitude and the velocity from `far` to `near`; `None` at the time of `near`.
fn moved_on([far, near]: [&Fix; 2], time_s: f64) -> Option<Fix> {
    let velocity_m_s = (near.position_m - far.position_m) / (near.time_s - far.time_s);
    let elapsed_s = time_s - near.time_s;
    (elapsed_s * (near.time_s - far.time_s) > 0.0).then_some(Fix {
        time_s,
        position_m: near.position_m + velocity_m_s * elapsed_s,
        attitude: near.attitude,
    })
}
