//! Association of targets from pulse to pulse.
//!
//! **Prediction.** A Kalman filter of constant rate follows a target's range and range rate, with white acceleration of [`TrackerSettings::acceleration_cells`] a pulse squared. Phase differences between channels, which give the
//! direction of arrival, are predicted to stay as in the last sighting.
//!
//! **Association.** An echo may belong to a target if its range is within [`TrackerSettings::gate_cells`] of the prediction and its phase differences are within [`MAX_TURNED_RAD`] RMS of the last ones. Of all such pairs the one with
//! the least sum of squares, each over its limit, is assigned first, then the next of the remaining ones.
//!
//! **Birth.** An unassigned echo starts a candidate. A candidate with sightings in [`TrackerSettings::seen`] of its first [`TrackerSettings::within`] pulses becomes a target, otherwise it is discarded. Results of a pulse are delayed by as many
//! pulses, so that a target is reported from its first echo on.
//!
//! **Gaps and death.** A target without an echo continues at its rate. After more than [`TrackerSettings::bridge`] such pulses in a row it is dead. Later echoes are another target: the whole turns of phase between are unknown.
//!
//! **Crossing.** Targets with predicted ranges within [`TrackerSettings::apart_cells`] of each other are one peak, or two that distort each other's phases. They are followed but not reported until they separate, when directions of
//! arrival identify them. A target that was not identified is another target until the track shows that both have one position ([`crate::targets::recover()`]). A target that is born so near to another is reported as split from it.
//!
//! **Crowds.** Measured with 6 to 24 random reflectors over 20 m by 12 m, in cells of 0.25 m, by 240 pulses of 1.1 to 1.7 GHz. Of a pulse's echoes the follower associates about as many as can be identified with all positions
//! known (2.5 of 2.4 for 8 reflectors, 3.6 of 3.6 with a lower rank of detection, 5.8 of 5.0 for 24). Gates on direction and motion (C 7.3.4) do not improve this: `crate::arrival` unwraps channels one
//! baseline after another, which are its target regions. Detection fails in crowds: with 12 training cells on either side, mostly with other targets, 2 to 78 % of the separate targets are detected; with 40 cells and
//! rank 0.4, 82 to 98 %. With two or three targets a pulse tracks are lost, and their chi-square shows it: 6 to 1e5 times its expectation. (One of six crowds by default, and no crowd with 40 cells, is tracked to
//! its noise: distortion by targets nearer than 1.5 cells is not measured.)

use std::collections::VecDeque;
use std::f64::consts::TAU;

use crate::Sighting;

use crate::targets::echo::Echo;

/// Largest deviation of phase differences from the last ones, radians RMS.
pub const MAX_TURNED_RAD: f64 = 1.2;

/// Settings of the association; cells are range cells of `c / (2 B)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackerSettings {
    /// Largest distance of an echo from its prediction, cells; 0.5 by default.
    pub gate_cells: f64,
    /// Standard deviation of a target's acceleration, cells a pulse squared; 0.01 by default.
    pub acceleration_cells: f64,
    /// Distance below which targets distort each other, cells; 1.5 by default.
    pub apart_cells: f64,
    /// Least number of a candidate's first pulses with a sighting; 5 by default.
    pub seen: usize,
    /// Number of those first pulses, 1000 at most; 8 by default.
    pub within: usize,
    /// Largest number of pulses in a row without a sighting; 30 by default.
    pub bridge: usize,
}

impl Default for TrackerSettings {
    fn default() -> Self {
        Self {
            gate_cells: 0.5,
            acceleration_cells: 0.01,
            apart_cells: 1.5,
            seen: 5,
            within: 8,
            bridge: 30,
        }
    }
}

impl TrackerSettings {
    /// Text that names an invalid setting.
    pub(crate) fn fault(&self) -> Option<&'static str> {
        let positive = |x: f64| x > 0.0 && x.is_finite();
        let lengths = [self.gate_cells, self.acceleration_cells, self.apart_cells];
        if !lengths.into_iter().all(positive) {
            return Some(
                "expected a gate, an acceleration and a distance of targets above 0 range cells",
            );
        }
        if self.seen == 0 || self.seen > self.within || self.within > 1000 {
            return Some(
                "expected a candidate's least number of sightings from 1 to the number of its first pulses, 1000 at most",
            );
        }
        None
    }
}

/// Birth, death or crossing of targets.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Event {
    /// A candidate became a target.
    Born {
        /// Number of the target.
        target: usize,
        /// Pulse of its first sighting.
        pulse: usize,
        /// Range at the first sighting, metres.
        range_m: f64,
    },
    /// A target was lost for longer than the bridge.
    Lost {
        /// Number of the target.
        target: usize,
        /// Pulse of its last sighting.
        pulse: usize,
    },
    /// Two targets came too near to be resolved.
    Crossed {
        /// Numbers of the targets.
        targets: [usize; 2],
        /// First pulse in which they are not resolved.
        pulse: usize,
    },
    /// A target appeared too near to another to have been resolved before.
    Split {
        /// Number of the other target.
        target: usize,
        /// Number of the new target.
        into: usize,
        /// Pulse of its first sighting.
        pulse: usize,
    },
}

/// Candidate or confirmed target.
struct Followed {
    number: usize,
    confirmed: bool,
    born: usize,
    born_range_m: f64,
    last_seen: usize,
    times_seen: usize,
    range_m: f64,
    /// Range rate, metres a pulse.
    rate_m: f64,
    /// Variances of range and rate, with the covariance between them.
    variance: [f64; 3],
    /// Phase of each channel but the first against the first, radians.
    differences_rad: Vec<f64>,
    /// Numbers of targets that are not resolved from it.
    near: Vec<usize>,
    /// Number of the target from which it was not resolved at its birth.
    split_from: Option<usize>,
}

/// Associates echoes with targets, pulse by pulse.
pub struct TargetTracker {
    follow: TrackerSettings,
    cell_m: f64,
    all: Vec<Followed>,
    next: usize,
    pulse: usize,
    /// Delayed results, oldest first.
    waiting: VecDeque<Vec<Sighting>>,
    events: Vec<Event>,
    /// Largest range rate so far, metres a pulse, with the target and the pulse.
    fastest: Option<(f64, usize, usize)>,
}

impl TargetTracker {
    /// Follower for the range resolution `cell_m`, metres.
    ///
    /// # Errors
    /// Text that names the invalid setting.
    pub fn new(follow: TrackerSettings, cell_m: f64) -> Result<Self, &'static str> {
        if !(cell_m > 0.0 && cell_m.is_finite()) {
            return Err("expected a range resolution above 0 m");
        }
        match follow.fault() {
            Some(fault) => Err(fault),
            None => Ok(Self {
                follow,
                cell_m,
                all: Vec::new(),
                next: 0,
                pulse: 0,
                waiting: VecDeque::new(),
                events: Vec::new(),
                fastest: None,
            }),
        }
    }

    /// Take the next pulse's echoes and return the sightings of the pulse [`TrackerSettings::within`] pulses before, if any.
    pub fn push(&mut self, echoes: &[Echo]) -> Option<Vec<Sighting>> {
        self.predict();
        self.find_crossings();
        let taken = self.associate(echoes);
        let mut sightings = Vec::new();
        for (i, echo) in taken.iter().enumerate() {
            let Some(echo) = echo else { continue };
            let echo = &echoes[*echo];
            self.update(i, echo);
            if self.all[i].near.is_empty() {
                sightings.push(sighting(self.all[i].number, echo));
            }
        }
        let new = echoes.iter().enumerate();
        for (_, echo) in new.filter(|(e, _)| !taken.contains(&Some(*e))) {
            if let Some(sighting) = self.start_candidate(echo) {
                sightings.push(sighting);
            }
        }
        self.confirm();
        self.end_lost();
        self.waiting.push_back(sightings);
        self.pulse += 1;
        match self.waiting.len() > self.follow.within {
            true => self.release(),
            false => None,
        }
    }

    /// Return the delayed sightings, pulse by pulse, and end all targets.
    pub fn finish(&mut self) -> Vec<Vec<Sighting>> {
        std::iter::from_fn(|| self.release()).collect()
    }

    /// Take the events since the last call.
    pub fn events(&mut self) -> Vec<Event> {
        std::mem::take(&mut self.events)
    }

    /// Largest range rate of a target so far, metres a pulse, with its number and the pulse.
    pub fn fastest(&self) -> Option<(f64, usize, usize)> {
        self.fastest
    }

    /// Oldest delayed result, targets only.
    fn release(&mut self) -> Option<Vec<Sighting>> {
        let mut sightings = self.waiting.pop_front()?;
        let is_target = |number: usize| {
            let own = self.all.iter().find(|own| own.number == number);
            own.is_some_and(|own| own.confirmed)
        };
        sightings.retain(|sighting| is_target(sighting.target));
        // Dead targets are kept while results are delayed.
        let oldest = self.pulse - self.waiting.len();
        let (bridge, within) = (self.follow.bridge, self.follow.within);
        self.all
            .retain(|own| own.last_seen + bridge.max(within) + 1 >= oldest);
        Some(sightings)
    }

    fn is_alive(&self, own: &Followed) -> bool {
        self.pulse - own.last_seen <= self.follow.bridge + 1
    }

    fn predict(&mut self) {
        let noise = (self.follow.acceleration_cells * self.cell_m).powi(2);
        for own in &mut self.all {
            let [range, both, rate] = own.variance;
            own.range_m += own.rate_m;
            own.variance = [
                range + 2.0 * both + rate + 0.25 * noise,
                both + rate + 0.5 * noise,
                rate + noise,
            ];
        }
    }

    fn find_crossings(&mut self) {
        let apart_m = self.follow.apart_cells * self.cell_m;
        for i in 0..self.all.len() {
            let own = &self.all[i];
            let others = self.all.iter().enumerate().filter(|(j, other)| {
                *j != i && other.confirmed && self.is_alive(other) && self.is_alive(own)
            });
            let near = others.filter(|(_, other)| (other.range_m - own.range_m).abs() < apart_m);
            let near: Vec<usize> = near.map(|(_, other)| other.number).collect();
            let new = near.iter().filter(|number| !own.near.contains(number));
            for &other in new.filter(|&&other| own.confirmed && own.number < other) {
                self.events.push(Event::Crossed {
                    targets: [own.number, other],
                    pulse: self.pulse,
                });
            }
            self.all[i].near = near;
        }
    }

    /// Assigned echo of each candidate and target.
    fn associate(&self, echoes: &[Echo]) -> Vec<Option<usize>> {
        let gate_m = self.follow.gate_cells * self.cell_m;
        let expected = self.all.iter().map(|own| {
            let alive = self.is_alive(own);
            alive.then_some((own.range_m, own.differences_rad.as_slice()))
        });
        associate(expected, echoes, gate_m)
    }

    fn update(&mut self, i: usize, echo: &Echo) {
        let own = &mut self.all[i];
        let [range, both, rate] = own.variance;
        let mut noise = echo.range_sigma_m.powi(2);
        if !own.near.is_empty() {
            // Uncertainty of an unresolved pair.
            noise += (self.follow.gate_cells * self.cell_m).powi(2);
        }
        let (gain, rate_gain) = (range / (range + noise), both / (range + noise));
        let off_m = echo.range_m - own.range_m;
        own.range_m += gain * off_m;
        own.rate_m += rate_gain * off_m;
        own.variance = [
            range - gain * range,
            both - gain * both,
            rate - rate_gain * both,
        ];
        own.last_seen = self.pulse;
        own.times_seen += 1;
        if own.near.is_empty() {
            own.differences_rad = differences_rad(&echo.phases_rad);
            let settled = own.confirmed && own.variance[2].sqrt() < 0.05 * own.rate_m.abs();
            if settled
                && self
                    .fastest
                    .is_none_or(|(most, ..)| own.rate_m.abs() > most)
            {
                self.fastest = Some((own.rate_m.abs(), own.number, self.pulse));
            }
        }
    }

    /// Start a candidate, with its sighting if no target is near.
    fn start_candidate(&mut self, echo: &Echo) -> Option<Sighting> {
        let apart_m = self.follow.apart_cells * self.cell_m;
        let near = self.all.iter().filter(|own| {
            own.confirmed && self.is_alive(own) && (own.range_m - echo.range_m).abs() < apart_m
        });
        let near: Vec<usize> = near.map(|own| own.number).collect();
        let gate_m = self.follow.gate_cells * self.cell_m;
        self.all.push(Followed {
            number: self.next,
            confirmed: false,
            born: self.pulse,
            born_range_m: echo.range_m,
            last_seen: self.pulse,
            times_seen: 1,
            range_m: echo.range_m,
            rate_m: 0.0,
            variance: [echo.range_sigma_m.powi(2), 0.0, gate_m * gate_m],
            differences_rad: differences_rad(&echo.phases_rad),
            split_from: near.first().copied(),
            near,
        });
        self.next += 1;
        let own = &self.all[self.all.len() - 1];
        own.near.is_empty().then(|| sighting(own.number, echo))
    }

    fn confirm(&mut self) {
        for own in self.all.iter_mut().filter(|own| !own.confirmed) {
            let in_time = self.pulse - own.born < self.follow.within;
            if !(in_time && own.times_seen >= self.follow.seen) {
                continue;
            }
            own.confirmed = true;
            self.events.push(Event::Born {
                target: own.number,
                pulse: own.born,
                range_m: own.born_range_m,
            });
            if let Some(target) = own.split_from {
                self.events.push(Event::Split {
                    target,
                    into: own.number,
                    pulse: own.born,
                });
            }
        }
    }

    fn end_lost(&mut self) {
        let (within, bridge, pulse) = (self.follow.within, self.follow.bridge, self.pulse);
        let events = &mut self.events;
        self.all.retain(|own| {
            // Candidates live for their first pulses.
            own.confirmed || pulse - own.born < within
        });
        for own in self.all.iter().filter(|own| own.confirmed) {
            if pulse - own.last_seen == bridge + 1 {
                events.push(Event::Lost {
                    target: own.number,
                    pulse: own.last_seen,
                });
            }
        }
    }
}

/// Assign echoes to expected ranges and phase differences.
pub(crate) fn associate<'a>(
    expected: impl Iterator<Item = Option<(f64, &'a [f64])>>,
    echoes: &[Echo],
    gate_m: f64,
) -> Vec<Option<usize>> {
    let mut pairs = Vec::new();
    let mut taken = Vec::new();
    for (i, expected) in expected.enumerate() {
        taken.push(None);
        let Some((range_m, differences_rad)) = expected else {
            continue;
        };
        for (e, echo) in echoes.iter().enumerate() {
            let off = (echo.range_m - range_m) / gate_m;
            let turned = turned_rad(differences_rad, &echo.phases_rad) / MAX_TURNED_RAD;
            if off.abs() < 1.0 && turned < 1.0 {
                pairs.push((off * off + turned * turned, i, e));
            }
        }
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    for (_, i, e) in pairs {
        if taken[i].is_none() && !taken.contains(&Some(e)) {
            taken[i] = Some(e);
        }
    }
    taken
}

pub(crate) fn sighting(target: usize, echo: &Echo) -> Sighting {
    Sighting {
        target,
        range_m: echo.range_m,
        range_sigma_m: echo.range_sigma_m,
        phases_rad: echo.phases_rad.clone(),
        phase_sigma_rad: echo.phase_sigma_rad,
    }
}

/// Phase of each channel but the first against the first.
pub(crate) fn differences_rad(phases_rad: &[f64]) -> Vec<f64> {
    let (first, rest) = phases_rad.split_first().unwrap_or((&0.0, &[]));
    rest.iter().map(|phase| phase - first).collect()
}

/// RMS deviation of phase differences from `last`, radians.
fn turned_rad(last: &[f64], phases_rad: &[f64]) -> f64 {
    let new = differences_rad(phases_rad);
    let squares = last.iter().zip(&new).map(|(last, new)| {
        let turns = (new - last) / TAU;
        (TAU * (turns - turns.round())).powi(2)
    });
    (squares.sum::<f64>() / last.len().max(1) as f64).sqrt()
}
